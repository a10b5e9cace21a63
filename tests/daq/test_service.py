"""The systemd side: the sandbox is tight and fits the tray, and install and uninstall can be run twice."""

import os
import re
import shutil
import subprocess
import sysconfig
from pathlib import Path

import pytest

from daq.config import parse_tray
from daq.systemd_unit import unit_drop_in

ROOT = Path(__file__).parents[2]
UNIT = ROOT / "systemd" / "flightpower-daq.service"
DAQ = Path(sysconfig.get_path("scripts")) / "daq"
MOST_EXPOSED = 1.5
UDEV_MATCH = re.compile(r'(ACTION|KERNELS?|SUBSYSTEMS?|DRIVERS?|(ATTRS?|ENV)\{\w+\})(==|!=)"[^"]+"')
UDEV_ASSIGNMENT = re.compile(r'(GROUP|MODE|OWNER|SYMLINK|TAG|IMPORT\{builtin\}|(ATTR|ENV)\{\w+\})(=|\+=|:=)"[^"]+"')

needs_systemd = pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not here")
UDP = '[telemetry]\nto="udp:192.168.4.2:14550"\n[[sensors]]\ndriver="ublox"\nport="/dev/ttyAMA0"\n'


def tray(text: str):
    return parse_tray(text, "tray.toml", Path())


def example():
    return tray((ROOT / "daq" / "tray.example.toml").read_text())


def merged(folder: Path, text: str) -> Path:
    """The unit with a tray's drop-in at its end, and the daemon where it is here."""
    path = folder / UNIT.name
    unit = UNIT.read_text().replace("/opt/flightpower/bin/daq", str(DAQ))
    service, install = unit.split("[Install]")
    path.write_text(f"{service}\n{text}\n[Install]{install}")
    return path


@needs_systemd
@pytest.mark.parametrize("of", [example, lambda: tray(UDP)], ids=["example", "telemetry over UDP"])
def test_the_unit_exposes_next_to_nothing(tmp_path, of):
    path = merged(tmp_path, unit_drop_in(of()))
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--no-pager", str(path)], capture_output=True, text=True
    )
    exposure = re.search(r"exposure level for \S+: ([\d.]+)", done.stdout)
    assert exposure and float(exposure[1]) <= MOST_EXPOSED, done.stdout


@needs_systemd
def test_the_status_page_is_exposed_no_more_than_a_page_has_to_be(tmp_path):
    path = tmp_path / "flightpower-status.service"
    path.write_text((UNIT.parent / path.name).read_text().replace("/opt/flightpower/bin/daq", str(DAQ)))
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--no-pager", str(path)], capture_output=True, text=True
    )
    exposure = re.search(r"exposure level for \S+: ([\d.]+)", done.stdout)
    assert exposure and float(exposure[1]) <= MOST_EXPOSED, done.stdout
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr


@needs_systemd
def test_the_unit_is_verified(tmp_path):
    path = merged(tmp_path, unit_drop_in(example()))
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr


def test_the_sandbox_opens_exactly_the_trays_devices():
    lines = unit_drop_in(example()).splitlines()
    allowed = [line.removeprefix("DeviceAllow=") for line in lines if line.startswith("DeviceAllow=")]
    assert allowed == ["", "/dev/char/204:64 rw", "/dev/char/89:1 rw", "char-ttyUSB rw"]
    assert not any("Network" in line or "Address" in line for line in lines)
    in_unit = [line for line in UNIT.read_text().splitlines() if line.startswith("DeviceAllow=")]
    assert sorted(in_unit) == [f"DeviceAllow={device}" for device in allowed[1:]]


@pytest.mark.parametrize(
    ("device", "permitted"),
    [
        ("/dev/i2c-3", ["/dev/char/89:3"]),
        ("/dev/ttyAMA2", ["/dev/char/204:66"]),
        ("/dev/ttyS0", ["/dev/char/4:64"]),
        ("/dev/serial0", ["char-ttyAMA", "char-ttyS"]),
        ("/dev/ttyACM1", ["char-ttyACM"]),
        ("/dev/flightpower/A50285BI", ["char-ttyACM", "char-ttyUSB"]),
    ],
)
def test_no_device_has_to_exist_when_the_service_starts(device, permitted):
    """systemd looks up the number of a path once, and ignores one that is not there; a number or a class remains."""
    kind = 'ms5611"\nbus' if "i2c" in device else 'ublox"\nport'
    lines = unit_drop_in(tray(f'[[sensors]]\ndriver="{kind}="{device}"\n')).splitlines()
    assert [line for line in lines if line.startswith("DeviceAllow=")][1:] == [f"DeviceAllow={p} rw" for p in permitted]


def test_the_numbers_are_those_of_this_kernel():
    """Where such devices are here."""
    from daq.systemd_unit import NUMBERS

    for path in Path("/dev").iterdir():
        for pattern, (major, first_minor) in NUMBERS.items():
            if path.is_char_device() and (found := re.fullmatch(pattern, str(path))):
                number = path.stat().st_rdev
                assert (os.major(number), os.minor(number)) == (major, first_minor + int(found[1]))


def test_the_drivers_of_the_permitted_classes_are_loaded_before_the_service():
    unit = UNIT.read_text()
    for module in ("i2c_dev", "usbserial", "cdc_acm"):
        assert unit.count(f"modprobe@{module}.service") == 2


def test_telemetry_over_udp_reaches_its_host_and_no_other():
    lines = unit_drop_in(tray(UDP)).splitlines()
    assert [line for line in lines if line.startswith("IPAddressAllow=")] == [
        "IPAddressAllow=",
        "IPAddressAllow=192.168.4.2",
    ]
    assert "PrivateNetwork=no" in lines


def tree(root: Path) -> dict[str, bytes]:
    return {path.relative_to(root).as_posix(): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def script(name: str, root: Path, *arguments: str) -> None:
    environment = {**os.environ, "DESTDIR": str(root), "DAQ": str(DAQ)}
    subprocess.run([str(ROOT / "systemd" / name), *arguments], env=environment, check=True, capture_output=True)


def test_install_and_uninstall_can_be_run_twice_and_keep_what_is_the_users(tmp_path):
    root = tmp_path / "root"
    root.mkdir()
    script("install.sh", root)
    first = tree(root)
    assert set(first) == {
        "etc/flightpower/tray.toml",
        "etc/systemd/system/flightpower-daq.service",
        "etc/systemd/system/flightpower-daq.service.d/tray.conf",
        "etc/systemd/system/flightpower-status.service",
        "etc/udev/rules.d/60-flightpower.rules",
        "usr/lib/sysusers.d/flightpower.conf",
    }
    assert b'directory = "/var/lib/flightpower"' in first["etc/flightpower/tray.toml"]
    script("install.sh", root)
    assert tree(root) == first

    mine = root / "etc/flightpower/tray.toml"
    mine.write_text(mine.read_text().replace("/dev/i2c-1", "/dev/i2c-7"))
    log = root / "var/lib/flightpower/log-0001.mcap"
    log.parent.mkdir(parents=True)
    log.write_bytes(b"a day's work")
    script("install.sh", root, "--tray")
    assert "/dev/i2c-7" in mine.read_text()
    assert b"DeviceAllow=/dev/char/89:7 rw" in tree(root)["etc/systemd/system/flightpower-daq.service.d/tray.conf"]

    for _ in range(2):
        script("uninstall.sh", root)
        assert set(tree(root)) == {"etc/flightpower/tray.toml", "var/lib/flightpower/log-0001.mcap"}
    script("uninstall.sh", root, "--purge-tray")
    assert set(tree(root)) == {"var/lib/flightpower/log-0001.mcap"}


@pytest.mark.parametrize(
    ("arguments", "cause"),
    [(["--wheels"], "one folder"), (["--wheels", "."], "no wheel of flightpower"), (["--try"], "unknown option --try")],
)
def test_a_wrong_use_of_install_changes_nothing(tmp_path, arguments, cause):
    with pytest.raises(subprocess.CalledProcessError) as failed:
        script("install.sh", tmp_path, *arguments)
    assert failed.value.returncode == 2 and cause in failed.value.stderr.decode()
    assert tree(tmp_path) == {}


def test_the_scripts_are_sound():
    shellcheck = shutil.which("shellcheck", path=f"{DAQ.parent}{os.pathsep}{os.environ['PATH']}")
    assert shellcheck, "shellcheck is missing: install the developer's extra, flightpower[dev]"
    subprocess.run([shellcheck, *map(str, (ROOT / "systemd").glob("*.sh"))], check=True)


def test_the_udev_rules_are_understood():
    """By the grammar of udev(7); `udevadm verify` (systemd 254) says the same where it is there."""
    path = ROOT / "systemd" / "60-flightpower.rules"
    rules = [line for line in path.read_text("utf-8").splitlines() if line and not line.startswith("#")]
    assert rules
    for rule in rules:
        for term in rule.split(", "):
            assert UDEV_MATCH.fullmatch(term) or UDEV_ASSIGNMENT.fullmatch(term), f"{term} in {rule}"
    udevadm = shutil.which("udevadm")
    if udevadm and subprocess.run([udevadm, "verify", "--help"], capture_output=True).returncode == 0:
        subprocess.run([udevadm, "verify", str(path)], check=True)
