"""Makes the tray's drop-in for the systemd unit, with the devices and network addresses that the sandbox permits."""

import re

from flightpower.daq.config import Tray, parse_port

# systemd ignores a path that does not exist when the service starts. Devices that may appear later are therefore
# permitted by number (Linux, Documentation/admin-guide/devices.txt), or by class if the number changes when they are
# plugged in again. A class exists once its driver is loaded; the unit loads the drivers of USB serial lines.
NUMBERS = {r"/dev/i2c-(\d+)": (89, 0), r"/dev/ttyAMA(\d+)": (204, 64), r"/dev/ttyS(\d+)": (4, 64)}  # major, first minor
USB_CLASSES = {r"/dev/ttyUSB\d+": "char-ttyUSB", r"/dev/ttyACM\d+": "char-ttyACM"}
CLASSES = USB_CLASSES | {r"/dev/gpiochip\d+": "char-gpiochip"}
USB_LINKS = ("/dev/serial/", "/dev/flightpower/")  # symbolic links to USB serial lines of either class
PI_LINKS = ("/dev/serial0", "/dev/serial1")  # symbolic links of Raspberry Pi OS
ANY_HOST = "0.0.0.0"


def unit_drop_in(tray: Tray) -> str:
    """A drop-in for flightpower-daq.service."""
    names = [sensor.device for sensor in tray.sensors] + ([tray.telemetry.to] if tray.telemetry else [])
    names += [tray.light.chip] if tray.light else []
    devices = sorted({device for name in names for device in _devices(name)})
    hosts = sorted({parse_port(name)[0] for name in names if name.startswith("udp:")})
    lines = [
        "# Made from the tray file. Run flightpower-tray (or install.sh --tray) when that has changed.",
        "[Service]",
    ]
    lines += ["DeviceAllow=", *(f"DeviceAllow={device} rw" for device in devices)]
    if hosts:
        lines += ["PrivateNetwork=no", "RestrictAddressFamilies=AF_UNIX AF_INET"]
        # A port that listens on all interfaces may receive from any address.
        lines += [
            "IPAddressAllow=",
            *(f"IPAddressAllow={'any' if host == ANY_HOST else _address(host)}" for host in hosts),
        ]
    if any(name.startswith("rcio:") for name in names):
        lines += ["# The receiver's files are in /sys.", "ProcSubset=all"]
    return "\n".join(lines) + "\n"


def _devices(device: str) -> list[str]:
    if device.startswith(("udp:", "rcio:")):
        return []
    if device.startswith(USB_LINKS):
        return sorted(USB_CLASSES.values())
    if device in PI_LINKS:
        return ["char-ttyAMA", "char-ttyS"]
    for pattern, (major, first_minor) in NUMBERS.items():
        if match := re.fullmatch(pattern, device):
            return [f"/dev/char/{major}:{first_minor + int(match[1])}"]
    return [next((name for pattern, name in CLASSES.items() if re.fullmatch(pattern, device)), device)]


def _address(host: str) -> str:
    """The value of IPAddressAllow: a numeric address or localhost as it is, and `any` for other host names."""
    if host == "localhost" or re.fullmatch(r"[\d.]+", host):
        return host
    return "any"
