"""The trials of the machine, and what must hold after each. A trial returns rows of the printed table."""

import random
import re
import subprocess
import sys
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

from card import logs_on, mounted, trouble
from image import UPGRADE
from machine import Machine

from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status

LARGEST_LOSS_S = 1.0
LARGEST_EXPOSURE = 0.7
COMPLETED_WITHIN_S = 60.0  # earlier logs must be completed this long after a recording begins
RECORDED_S = (4.0, 20.0)  # range from which the duration of a recording before a power pull is drawn
DAQ = "/opt/flightpower/bin/daq"
TRAY = "/etc/flightpower/tray.toml"
LOGS = "/var/lib/flightpower"
DEBS = "/home/pi/debs"
STOP, START = "sudo systemctl stop flightpower-daq", "sudo systemctl start flightpower-daq"
# The tray file is edited to name the adapters by their permanent names, and to put the autopilot on a serial line. The
# tick rate is low and the IMU is read sample by sample: an emulated processor is some twenty times slower, so that the
# FIFO would overflow during a reading.
RATE_HZ = 6
EDIT_TRAY = (
    f'sudo sed -i \'s|^rate_Hz = 25 |rate_Hz = {RATE_HZ} |; s|^sampling = "fifo" |sampling = "single" |; '
    "s|/dev/ttyAMA0|/dev/flightpower/gps|; "
    f"s|/dev/ttyUSB0|/dev/flightpower/rpm|; s|/dev/ttyUSB1|/dev/ttyS2|' {TRAY}"
)


class Row(NamedTuple):
    what: str
    figure: str
    good: bool


Step = Callable[..., str]


def steps_of(machine: Machine, rows: list[Row]) -> Step:
    """Return a function that runs a user's command and adds its row; `wanted` is a pattern for its output."""

    def step(what: str, command: str, wanted: str = "") -> str:
        begin_s = time.monotonic()
        code, output = machine.run(command, 3600.0)
        good = code == 0 and re.search(wanted, output) is not None
        rows.append(
            Row(what, f"{time.monotonic() - begin_s:.0f} s" if good else f"exit code {code}: {output[-300:]}", good)
        )
        return output

    return step


def install(machine: Machine) -> list[Row]:
    """Follow systemd/README.md from step 4 literally, as a user with sudo and no network."""
    machine.log_in()
    rows: list[Row] = []
    step = steps_of(machine, rows)

    step("install.sh --wheels", "(cd ~/flightpower && sudo systemd/install.sh --wheels ~/wheels)")
    step("tray edited, install.sh --tray", f"{EDIT_TRAY} && (cd ~/flightpower && sudo systemd/install.sh --tray)")
    step("daq check", f"{STOP}; sudo {DAQ} check --config {TRAY}", "fit to fly")
    step("daq zero", f"sudo {DAQ} zero --config {TRAY}")
    step("start", f"{START}; sleep 15; systemctl status flightpower-daq", r"Status: .*log-\d{4}")
    step("daq list", f"{DAQ} list", "log-0001")
    step("daq info", f"{DAQ} info {LOGS}/log-0001*.mcap", "ticks")
    step("rsync", f"{STOP}; rsync -a --partial-dir=.part pi@raspberrypi.local:{LOGS}/ logs/ && ls logs", "log-0001")
    step("waitress", "sudo /opt/flightpower/bin/pip install --no-index --find-links ~/wheels waitress")
    step(
        "status page",
        "sudo systemctl enable --now flightpower-status && sleep 20 && curl -s localhost:8080",
        "log-0001",
    )
    rows += exposure(machine, "status page on")
    step("status page off", "sudo systemctl disable --now flightpower-status")
    rows += exposure(machine, "status page off")
    machine.switch_off()
    return rows


def exposure(machine: Machine, when: str) -> list[Row]:
    _, output = machine.run("systemd-analyze security flightpower-daq | tail -1")
    level = re.search(r"exposure level.*: ([\d.]+)", output)
    good = level is not None and float(level[1]) <= LARGEST_EXPOSURE
    return [Row(f"exposure, {when}", level[1] if level else output[-200:], good)]


def figures(machine: Machine) -> list[Row]:
    """Measure a boot and the service in it; none of the figures can fail."""
    machine.log_in()
    machine.wait(20.0)
    commands = {
        "boot": "systemd-analyze time | head -1",
        "recording, after the kernel's start": "systemd-analyze critical-chain flightpower-daq.service"
        " | grep flightpower",
        "service, resident": "sudo cat /proc/$(systemctl show -P MainPID flightpower-daq)/smaps_rollup"
        " | awk '/^(Rss|Pss):/ {printf \"%s %.1f MB  \", $1, $2 / 1024}'",
        "service, its control group": "systemctl show -P MemoryCurrent flightpower-daq"
        " | awk '{printf \"%.1f MB\", $1 / 2^20}'",
        "installed": "du -sm /opt/flightpower | cut -f1",
        "missed ticks": "systemctl show -P StatusText flightpower-daq",
    }
    return [Row(what, machine.run(command)[1].strip(), True) for what, command in commands.items()]


def power_pulls(folder: Path, disk: Path, *, count: int, rng: random.Random) -> list[Row]:
    """Boot, pull the power during recording and boot by turns, and read the card, which the next boot uses as it is."""
    earlier_logs, rows = logs_on(folder, disk), []
    boots_s: list[float] = []  # this computer's time from start until data were on the card
    first_messages_s: list[float] = []
    for number in range(1, count + 1):
        booting = number % 2 == 0
        with Machine(folder, disk) as machine:
            share = rng.uniform(0.0, 1.0)  # fraction of the time until data are on the card
            if booting:
                time.sleep(share * boots_s[-1])
            else:
                machine.wait_for_recording(len(earlier_logs))
                boots_s.append(time.monotonic() - machine.started_s)
                machine.wait(rng.uniform(*RECORDED_S))
            cut_s = machine.pull_power()
        logs = logs_on(folder, disk)
        wrong = trouble(earlier_logs, logs)
        new = [log.state for name, log in logs.items() if name not in earlier_logs]
        last_s = max((state.last_s for state in new if state.last_s is not None), default=None)
        completed = sum(
            not earlier_logs[name].state.complete and logs[name].state.complete for name in earlier_logs if name in logs
        )
        if last_s is None:
            lost, good = f"nothing was recorded, after {share:.0%} of a start", booting and not wrong
        else:
            lost, good = f"lost {cut_s - last_s:.2f} s at {cut_s:.1f} s", not wrong and cut_s - last_s <= LARGEST_LOSS_S
            first_messages_s += [state.first_s for state in new if state.first_s is not None][-1:]
        when = "booting" if booting else "recording"
        text = f"{lost}; {len(logs)} logs, {completed} completed"
        rows.append(Row(f"power pull {number}, {when}", "; ".join([text, *wrong]), good))
        print(f"{rows[-1].what}: {rows[-1].figure}", flush=True)
        earlier_logs = logs
    seen = f"{min(first_messages_s):.1f} to {max(first_messages_s):.1f} s in {len(first_messages_s)} boots"
    with Machine(folder, disk) as machine:
        machine.wait_for_recording(len(earlier_logs))
        machine.wait(COMPLETED_WITHIN_S)
    logs = logs_on(folder, disk)
    left = [name for name in earlier_logs if name in logs and not logs[name].state.complete]
    wrong = [*trouble(earlier_logs, logs), *(f"{name} is not complete" for name in left)]
    text = f"{len(earlier_logs) - len(left)} of {len(earlier_logs)} logs complete after {COMPLETED_WITHIN_S:.0f} s"
    return [
        *rows,
        Row("first message, after the kernel's start", seen, True),
        Row("the next start", "; ".join([text, *wrong]), not wrong),
    ]


def eight_hours() -> list[Row]:
    """Record eight hours of simulated time on this computer."""
    command = [sys.executable, str(Path(__file__).resolve().parents[1] / "daemon.py"), "day", "--hours", "8"]
    done = subprocess.run(command, capture_output=True, text=True)
    return [Row("eight hours", "; ".join((done.stdout or done.stderr).splitlines()[-4:]), done.returncode == 0)]


def unplugged(folder: Path, disk: Path) -> list[Row]:
    """Unplug the receiver's USB adapter for six seconds during a recording."""
    earlier_logs = logs_on(folder, disk)
    with Machine(folder, disk) as machine:
        machine.log_in()
        machine.wait_for_recording(len(earlier_logs))
        machine.wait(10.0)
        machine.unplug("gps")
        machine.wait(6.0)
        machine.plug("gps")
        machine.wait(15.0)
        machine.run(STOP)
        machine.switch_off()
    rows = _judge("USB receiver unplugged", folder, disk, earlier_logs)
    with mounted(folder, disk) as root:
        log = read_log(_newest(root))
    fixes = [entry.time_ns / 1e9 for entry in log.entries["/gps"] if entry.message.status is Status.OK]
    gap_s = max((b - a for a, b in pairwise(fixes)), default=0.0)
    back = 5.0 < gap_s < 20.0
    seen = f"{gap_s:.1f} s without a fix" if back else f"longest gap {gap_s:.1f} s, expected 5 to 20"
    others = {
        topic: sum(entry.message.status not in (Status.OK, Status.BUSY) for entry in log.entries[topic][100:])
        for topic in ("/imu", "/baro", "/static", "/probe/alpha", "/probe/beta", "/probe/airspeed")
    }
    return [
        *rows,
        Row("receiver", seen, back),
        Row("other sensors meanwhile", f"{sum(others.values())} readings lost", sum(others.values()) == 0),
    ]


def clock_stepped(folder: Path, disk: Path) -> list[Row]:
    """Start a recording in 1970, then set the clock to today, back by an hour, and to 2000."""
    earlier_logs = logs_on(folder, disk)
    with Machine(folder, disk) as machine:
        machine.log_in()
        today = time.strftime("%Y-%m-%d %H:%M:%S", time.gmtime())
        machine.run(f"{STOP}; sudo date -u -s '1970-01-01 00:00:10'; {START}")
        for date in (today, "2000-01-01 00:00:00", today):
            machine.wait(4.0)
            machine.run(f"sudo date -u -s '{date}'")
        machine.wait(4.0)
        _, restarts = machine.run("systemctl show -P NRestarts flightpower-daq")
        machine.run(STOP)
        machine.switch_off()
    rows = _judge("clock stepped from 1970", folder, disk, earlier_logs)
    with mounted(folder, disk) as root:
        path = _newest(root)
        log = read_log(path)
    steps = [e.message.system_ns - e.time_ns for e in log.entries["/time"]]
    jumps = sum(abs(b - a) > 10**9 for a, b in pairwise(steps))
    ticks = [entry.time_ns for entry in log.entries["/daq/tick"]]
    ordered = all(b > a for a, b in pairwise(ticks))
    day = time.strftime("%Y-%m-%d", time.gmtime())
    return [
        *rows,
        Row("its log", f"{jumps} jumps of the system clock, times in order: {ordered}", jumps >= 3 and ordered),
        Row("its name", path.name, day in path.name),
        Row("restarts of the service", restarts, restarts == "0"),
    ]


def upgraded(folder: Path, disk: Path) -> list[Row]:
    """Install a newer version while the service records."""
    earlier_logs, rows = logs_on(folder, disk), []
    with Machine(folder, disk) as machine:
        machine.log_in()
        upgrade_while_recording(
            machine, steps_of(machine, rows), len(earlier_logs),
            "(cd ~/flightpower && sudo systemd/install.sh --wheels ~/wheels-upgrade)",
            "/opt/flightpower/bin/pip show flightpower | grep ^Version",
        )  # fmt: skip
        machine.run(STOP)
        machine.switch_off()
    return [*_judge("upgrade while recording", folder, disk, earlier_logs), *rows, _pause(folder, disk)]


def upgrade_while_recording(machine: Machine, step: Step, logs: int, command: str, version: str) -> None:
    """Upgrade between two recordings; afterwards `version` must print `UPGRADE`."""
    machine.wait_for_recording(logs)
    step("upgrade", command)
    machine.wait_for_recording(logs + 1)
    machine.wait(5.0)
    step("its version", version, re.escape(UPGRADE))


def package(folder: Path, disk: Path) -> list[Row]:
    """Test the Debian package on a computer without this software: first log, next start, upgrade, removal."""
    rows: list[Row] = []
    with Machine(folder, disk) as machine:
        machine.log_in()
        step = steps_of(machine, rows)
        step("dpkg -i", f"sudo dpkg -i {DEBS}/flightpower_*.deb", "Setting up flightpower")
        step("tray edited, flightpower-tray", f"{EDIT_TRAY} && sudo flightpower-tray")
        step("installed", "du -sm /usr/lib/flightpower")
        machine.wait_for_recording(0)
        step("daq list", "daq list", "log-0001")
        rows += exposure(machine, "by the package")
        machine.run(STOP)
        machine.switch_off()
    earlier_logs = logs_on(folder, disk)
    with Machine(folder, disk) as machine:
        machine.log_in()
        step = steps_of(machine, rows)
        upgrade = f"sudo dpkg -i {DEBS}/upgrade/flightpower_*.deb"
        upgrade_while_recording(machine, step, len(earlier_logs), upgrade, "dpkg-query -W flightpower")
        listed = "dpkg -L flightpower | while read -r path; do [ -d $path ] || echo $path; done"
        step("files listed", f"{listed} > files && wc -l < files", r"\d{3}")
        step("purge", "sudo dpkg --purge flightpower", "Purging configuration files")
        folders = "/usr/lib/flightpower /etc/flightpower /etc/systemd/system/flightpower-daq.service.d /opt/flightpower"
        step("nothing is left", f"for path in $(cat files) {folders}; do [ ! -e $path ] || exit 1; done")
        step("no service is left", "! systemctl cat flightpower-daq flightpower-status")
        machine.switch_off()
    logs = logs_on(folder, disk)
    first_s = next(log.state.first_s for name, log in logs.items() if name not in earlier_logs)
    return [
        *rows,
        *_judge("by the package", folder, disk, earlier_logs),
        Row("first message, after the kernel's start", f"{first_s:.1f} s", True),
        _pause(folder, disk),
    ]


def _pause(folder: Path, disk: Path) -> Row:
    """Return a row with the pause between the last two logs."""
    with mounted(folder, disk) as root:
        last, first = (read_log(path) for path in sorted((root / LOGS[1:]).glob("log-*.mcap"))[-2:])
    pause_s = _monotonic_s(first)[0] - _monotonic_s(last)[-1]
    return Row("pause between the two logs", f"{pause_s:.1f} s", True)


def _judge(what: str, folder: Path, disk: Path, earlier_logs: dict) -> list[Row]:
    """Check that all logs are readable and intact, new ones complete, and at most 1 % of the newest's ticks missed."""
    logs = logs_on(folder, disk)
    wrong = trouble(earlier_logs, logs)
    new = {name: log.state for name, log in logs.items() if name not in earlier_logs}
    wrong += [f"{name} is not complete" for name, state in new.items() if not state.complete]
    wrong += [] if new else ["no new log"]
    with mounted(folder, disk) as root:
        entries = read_log(_newest(root)).entries["/daq/tick"]
    missed = sum(entry.message.missed for entry in entries)
    wrong += [f"{missed} of {len(entries)} ticks missed"] if missed > len(entries) // 100 else []
    text = f"{len(logs)} logs, all readable, {len(entries)} ticks, {missed} missed"
    return [Row(what, "; ".join(wrong) or text, not wrong)]


def _newest(root: Path) -> Path:
    return max((root / LOGS[1:]).glob("log-*.mcap"))


def _monotonic_s(log) -> list[float]:
    facts = log.metadata["flightpower"]
    offset_ns = int(facts["start_monotonic_ns"]) - int(facts["start_unix_ns"])
    return [(entry.time_ns + offset_ns) / 1e9 for entry in log.entries["/daq/tick"]]
