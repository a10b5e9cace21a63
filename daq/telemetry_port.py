"""Opens the port to which telemetry is sent: a serial line, or one UDP address."""

import socket

from flightpower.daq.config import TelemetryConfig, parse_port
from flightpower.daq.linux_bus import LinuxSerial


class UdpSender:
    """Sends datagrams to one address."""

    def __init__(self, host: str, port: int):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.connect((host, port))

    def write(self, data: bytes) -> None:
        try:
            self._socket.send(data)
        except (BlockingIOError, ConnectionRefusedError):  # there is no receiver yet
            return


def open_port(telemetry: TelemetryConfig) -> LinuxSerial | UdpSender:
    """Open the serial line or socket to the ground station. Raises OSError."""
    if telemetry.to.startswith("udp:"):
        return UdpSender(*parse_port(telemetry.to))
    return LinuxSerial(telemetry.to, telemetry.baud)
