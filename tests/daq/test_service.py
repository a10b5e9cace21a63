"""The systemd side: the sandbox is tight and fits the tray, and install and uninstall can be run twice."""

import ctypes
import errno
import os
import re
import shutil
import struct
import subprocess
import sys
import sysconfig
from collections.abc import Callable
from pathlib import Path

import pytest
from test_commands_in_trouble import GIVE_UP_S, counter, tray_file  # noqa: F401
from test_daemon import fly

from flightpower.daq.background_recovery import NICE
from flightpower.daq.config import parse_tray
from flightpower.daq.systemd_unit import unit_drop_in
from flightpower.flight.log_reader import read_log

ROOT = Path(__file__).parents[2]
UNIT = ROOT / "systemd" / "flightpower-daq.service"
DAQ = Path(sysconfig.get_path("scripts")) / "daq"
PAGE_MOST_EXPOSED = 1.0
UDEV_MATCH = re.compile(r'(ACTION|KERNELS?|SUBSYSTEMS?|DRIVERS?|(ATTRS?|ENV)\{\w+\})(==|!=)"[^"]+"')
UDEV_ASSIGNMENT = re.compile(r'(GROUP|MODE|OWNER|SYMLINK|TAG|IMPORT\{builtin\}|(ATTR|ENV)\{\w+\})(=|\+=|:=)"[^"]+"')

needs_systemd = pytest.mark.skipif(not shutil.which("systemd-analyze"), reason="systemd-analyze is not here")
UDP = '[telemetry]\nto="udp:192.168.4.2:14550"\n[[sensors]]\ndriver="ublox"\nport="/dev/ttyAMA0"\n'


def tray(text: str):
    return parse_tray(text, "tray.toml", Path())


def example():
    return tray((ROOT / "daq" / "tray.example.toml").read_text())


def merged(folder: Path, text: str) -> Path:
    """The unit with a tray's drop-in at its end, and with the daemon's path on this machine."""
    path = folder / UNIT.name
    unit = UNIT.read_text().replace("/opt/flightpower/bin/daq", str(DAQ))
    service, install = unit.split("[Install]")
    path.write_text(f"{service}\n{text}\n[Install]{install}")
    return path


@needs_systemd
@pytest.mark.parametrize(
    ("of", "most_exposed"), [(example, 0.7), (lambda: tray(UDP), 1.5)], ids=["example", "telemetry over UDP"]
)
def test_the_unit_exposes_next_to_nothing(tmp_path, of, most_exposed):
    path = merged(tmp_path, unit_drop_in(of()))
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--no-pager", str(path)], capture_output=True, text=True
    )
    exposure = re.search(r"exposure level for \S+: ([\d.]+)", done.stdout)
    assert exposure and float(exposure[1]) <= most_exposed, done.stdout


@needs_systemd
def test_the_status_page_is_exposed_no_more_than_a_page_has_to_be(tmp_path):
    path = tmp_path / "flightpower-status.service"
    path.write_text((UNIT.parent / path.name).read_text().replace("/opt/flightpower/bin/daq", str(DAQ)))
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--no-pager", str(path)], capture_output=True, text=True
    )
    exposure = re.search(r"exposure level for \S+: ([\d.]+)", done.stdout)
    assert exposure and float(exposure[1]) <= PAGE_MOST_EXPOSED, done.stdout
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr


@needs_systemd
def test_the_unit_is_verified(tmp_path):
    path = merged(tmp_path, unit_drop_in(example()))
    done = subprocess.run(["systemd-analyze", "verify", "--man=no", str(path)], capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "", done.stderr


NUMBERS_OF_CALLS = Path("/usr/include/x86_64-linux-gnu/asm/unistd_64.h")
PR_SET_NO_NEW_PRIVS, PR_SET_SECCOMP, SECCOMP_MODE_FILTER = 38, 22, 2  # linux/prctl.h, linux/seccomp.h
LOAD_NUMBER, JUMP_IF_EQUAL, RETURN, ALLOW, REFUSE = 0x20, 0x15, 0x06, 0x7FFF0000, 0x00050000  # classic BPF


def system_calls(group: str) -> set[str]:
    """The system calls of one of systemd's groups, or the single call that has this name."""
    if not group.startswith("@"):
        return {group}
    listed = subprocess.run(["systemd-analyze", "syscall-filter", group], capture_output=True, text=True, check=True)
    return set().union(*(system_calls(line.strip()) for line in listed.stdout.splitlines()[1:] if "#" not in line))


def permitted_calls() -> set[str]:
    """Calls permitted by the lines of the unit in their order; systemd adds @default."""
    permitted = system_calls("@default")
    for line in re.findall(r"^SystemCallFilter=(.+)$", UNIT.read_text(), re.MULTILINE):
        calls = set().union(*map(system_calls, line.removeprefix("~").split()))
        permitted = permitted - calls if line.startswith("~") else permitted | calls
    return permitted


def sandbox(permitted: set[str]) -> Callable[[], None]:
    """A function after which a process is refused all other system calls, as by the unit."""
    numbers = re.findall(r"#define __NR_(\w+) (\d+)", NUMBERS_OF_CALLS.read_text())
    code = [struct.pack("=HBBI", LOAD_NUMBER, 0, 0, 0)]
    for number in (int(number) for name, number in numbers if name not in permitted):
        code += [
            struct.pack("=HBBI", JUMP_IF_EQUAL, 0, 1, number),
            struct.pack("=HBBI", RETURN, 0, 0, REFUSE | errno.EPERM),
        ]
    code.append(struct.pack("=HBBI", RETURN, 0, 0, ALLOW))
    instructions = ctypes.create_string_buffer(b"".join(code))
    program = ctypes.create_string_buffer(struct.pack("@HP", len(code), ctypes.addressof(instructions)))
    libc = ctypes.CDLL(None, use_errno=True)

    def enter() -> None:
        assert instructions and libc.prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0
        assert libc.prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, program, 0, 0) == 0

    return enter


needs_numbers = pytest.mark.skipif(not NUMBERS_OF_CALLS.exists(), reason="the numbers of system calls are not here")


@pytest.fixture(scope="module")
def torn(tmp_path_factory) -> bytes:
    complete = fly(tmp_path_factory.mktemp("whole"), 4).path.read_bytes()
    return complete[: len(complete) // 2]


@needs_systemd
@needs_numbers
def test_the_daemon_records_and_completes_old_logs_with_the_units_system_calls(tmp_path, counter, torn):  # noqa: F811
    old = tmp_path / "logs" / "log-0001.mcap"
    old.parent.mkdir()
    old.write_bytes(torn)
    tray = tray_file(tmp_path, counter.path, '[telemetry]\nto = "udp:127.0.0.1:9"')
    command = [sys.executable, "-m", "flightpower.daq", "run", "-c", str(tray), "--duration", "4"]
    done = subprocess.run(
        command, preexec_fn=sandbox(permitted_calls()), capture_output=True, text=True, timeout=GIVE_UP_S
    )
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    assert not read_log(old).torn
    assert len(read_log(old.with_name("log-0002.mcap")).entries["/daq/tick"]) > 50


@needs_systemd
@needs_numbers
@pytest.mark.parametrize("refused", [set(), {"setpriority"}], ids=["as the unit", "an older unit"])
def test_old_logs_are_completed_at_a_lower_priority_where_it_may_be_lowered(tmp_path, torn, refused):
    path = tmp_path / "log-0001.mcap"
    path.write_bytes(torn)
    show = "from flightpower.daq import background_recovery as b; b.main(); import os; print(os.getpriority(0, 0))"
    before = os.getpriority(os.PRIO_PROCESS, 0)
    done = subprocess.run(
        [sys.executable, "-c", show, str(path)],
        preexec_fn=sandbox(permitted_calls() - refused), capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0 and not read_log(path).torn, done.stderr
    assert int(done.stdout.splitlines()[-1]) == (before if refused else min(before + NICE, 19))


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
    """systemd resolves a path to its number once and ignores a missing path; a number or a class remains."""
    kind = 'ms5611"\nbus' if "i2c" in device else 'ublox"\nport'
    lines = unit_drop_in(tray(f'[[sensors]]\ndriver="{kind}="{device}"\n')).splitlines()
    assert [line for line in lines if line.startswith("DeviceAllow=")][1:] == [f"DeviceAllow={p} rw" for p in permitted]


def test_the_numbers_are_those_of_this_kernel():
    """Checked where this machine has such devices."""
    from flightpower.daq.systemd_unit import NUMBERS

    for path in Path("/dev").iterdir():
        for pattern, (major, first_minor) in NUMBERS.items():
            if path.is_char_device() and (match := re.fullmatch(pattern, str(path))):
                number = path.stat().st_rdev
                assert (os.major(number), os.minor(number)) == (major, first_minor + int(match[1]))


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


@pytest.mark.slow
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

    own_file = root / "etc/flightpower/tray.toml"
    own_file.write_text(own_file.read_text().replace("/dev/i2c-1", "/dev/i2c-7"))
    log = root / "var/lib/flightpower/log-0001.mcap"
    log.parent.mkdir(parents=True)
    log.write_bytes(b"a day's work")
    script("install.sh", root, "--tray")
    assert "/dev/i2c-7" in own_file.read_text()
    assert b"DeviceAllow=/dev/char/89:7 rw" in tree(root)["etc/systemd/system/flightpower-daq.service.d/tray.conf"]

    for _ in range(2):
        script("uninstall.sh", root)
        assert set(tree(root)) == {"etc/flightpower/tray.toml", "var/lib/flightpower/log-0001.mcap"}
    script("uninstall.sh", root, "--purge-tray")
    assert set(tree(root)) == {"var/lib/flightpower/log-0001.mcap"}


def test_a_tray_that_names_a_missing_file_is_reported_before_the_service_is_stopped(tmp_path):
    script("install.sh", tmp_path)
    tray = tmp_path / "etc/flightpower/tray.toml"
    tray.write_text(tray.read_text().replace('aircraft = "nexstar"', 'aircraft = "my.toml"').replace("i2c-1", "i2c-7"))
    before = tree(tmp_path)
    with pytest.raises(subprocess.CalledProcessError) as failed:
        script("install.sh", tmp_path, "--tray")
    assert failed.value.returncode == 2 and "my.toml" in failed.value.stderr.decode()
    assert tree(tmp_path) == before


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
    subprocess.run([shellcheck, *(ROOT / "systemd").glob("*.sh"), *(ROOT / "debian").glob("*.p[or]*")], check=True)


def test_the_udev_rules_are_understood():
    """The grammar is that of udev(7); `udevadm verify` (systemd 254) agrees if it is installed."""
    path = ROOT / "systemd" / "60-flightpower.rules"
    rules = [line for line in path.read_text("utf-8").splitlines() if line and not line.startswith("#")]
    assert rules
    for rule in rules:
        assert "ATTRS{serial}" not in rule  # it would match that of a hub or of the USB controller
        for term in rule.split(", "):
            assert UDEV_MATCH.fullmatch(term) or UDEV_ASSIGNMENT.fullmatch(term), f"{term} in {rule}"
    udevadm = shutil.which("udevadm")
    if udevadm and subprocess.run([udevadm, "verify", "--help"], capture_output=True).returncode == 0:
        subprocess.run([udevadm, "verify", str(path)], check=True)
