"""The tray's part of the systemd unit: which devices the sandbox lets through, and whether there is a network."""

import re

from daq.config import Tray, parse_port

# A USB line may not be there yet when the service starts, and a path that does not exist is forgotten by systemd: these
# are let through by their kind. Other names are paths.
KINDS = {r"/dev/ttyUSB\d+": "char-ttyUSB", r"/dev/ttyACM\d+": "char-ttyACM"}
BY_NAME = ("/dev/serial/", "/dev/flightpower/")  # names of USB lines, of either kind
ANY_HOST = "0.0.0.0"


def drop_in(tray: Tray) -> str:
    """A drop-in for flightpower-daq.service."""
    lanes = [sensor.lane for sensor in tray.sensors] + ([tray.telemetry.to] if tray.telemetry else [])
    devices = sorted({device for lane in lanes for device in _devices(lane)})
    hosts = sorted({parse_port(lane)[0] for lane in lanes if lane.startswith("udp:")})
    lines = ["# Made by install.sh from the tray file; run it again when the tray has changed.", "[Service]"]
    lines += ["DeviceAllow=", *(f"DeviceAllow={device} rw" for device in devices)]
    if hosts:
        lines += ["PrivateNetwork=no", "RestrictAddressFamilies=AF_UNIX AF_INET"]
        # A sensor that is listened for on all interfaces may come from anywhere.
        lines += [
            "IPAddressAllow=",
            *(f"IPAddressAllow={'any' if host == ANY_HOST else _address(host)}" for host in hosts),
        ]
    if any(lane.startswith("rcio:") for lane in lanes):
        lines += ["# The receiver's files are in /sys.", "ProcSubset=all"]
    return "\n".join(lines) + "\n"


def _devices(lane: str) -> list[str]:
    if lane.startswith(("udp:", "rcio:")):
        return []
    if lane.startswith(BY_NAME):
        return sorted(KINDS.values())
    return [next((kind for pattern, kind in KINDS.items() if re.fullmatch(pattern, lane)), lane)]


def _address(host: str) -> str:
    """What IPAddressAllow understands: numbers, or localhost; another name could be anywhere."""
    if host == "localhost" or re.fullmatch(r"[\d.]+", host):
        return host
    return "any"
