"""Is the tray fit to fly? Reads it for a few seconds and says of every topic what works, and what to do if not."""

import tempfile
from collections import Counter
from pathlib import Path
from statistics import fmean, stdev
from typing import NamedTuple

import msgspec

from daq.bus import IN_USE, Buses
from daq.clock import Clock
from daq.config import Tray
from daq.health import FINE
from daq.identity import identity
from daq.keeper import free_bytes
from daq.survey import Survey, survey
from flight.messages import Message, Status

ENOUGH = 0.95  # of the readings after that have to be measurements
BYTES_PER_S = 16_000  # of a log of the default tray at 25 Hz, 550 to 640 bytes a tick
ENOUGH_ROOM_S = 2 * 3600.0
# What a person wants to see of each topic: field, factor to the unit shown, unit.
SHOWN: dict[str, tuple[tuple[str, float, str], ...]] = {
    "/imu": (("specific_force_z_mps2", 1, "m/s2 down"), ("angular_rate_y_radps", 57.29578, "deg/s pitch")),
    "/mag": (("field_x_T", 1e6, "uT forward"),),
    "/baro": (("pressure_Pa", 0.01, "hPa"),),
    "/static": (("pressure_Pa", 0.01, "hPa"),),
    "/probe/alpha": (("differential_pressure_Pa", 1, "Pa"),),
    "/probe/beta": (("differential_pressure_Pa", 1, "Pa"),),
    "/probe/airspeed": (("differential_pressure_Pa", 1, "Pa"),),
    "/gps": (
        ("satellites", 1, "satellites"),
        ("horizontal_accuracy_m", 1, "m accuracy"),
        ("fix_type", 1, "dimensional fix"),
    ),
    "/rpm": (("motor_speed_revps", 60, "rpm"),),
    "/controls": (("elevator_rad", 57.29578, "deg elevator"), ("throttle", 100, "% throttle")),
    "/attitude": (("pitch_rad", 57.29578, "deg pitch"),),
    "/battery": (("voltage_V", 1, "V"),),
}
ADVICE = {
    Status.STARTING: "it does not come up: is its supply right?",
    Status.STALE: "it has nothing new to say: switch its supply off and on",
    Status.FAULT: "it reports a fault, which stays until its supply was off",
    Status.SATURATED: "at the end of its range: blocked or exchanged tubes, or an open bridge",
    Status.NO_REPLY: "nothing answers: wiring, supply, address or device name (i2cdetect -y 1, ls /dev/tty*)",
    Status.TIMEOUT: "the bus hangs: unplug its parts one by one until it comes back",
    Status.CORRUPT: "damaged data: baud rate, ground, or cable length",
    Status.WRONG_DEVICE: "another part answers there: compare the address in the tray with the wiring",
    Status.NO_DATA: "nothing arrives: TX and RX exchanged, baud rate, or it is not switched on",
}
NO_FIX = "no fix yet: give the antenna a view of the sky and wait a minute"
STOP_IT = "stop what uses it: sudo systemctl stop flightpower-daq"
BUS_ERRORS = (Status.NO_REPLY, Status.TIMEOUT, Status.CORRUPT)
STANDING = "silent, as it is while the motor stands; run the motor to be sure"


class Line(NamedTuple):
    """One topic's verdict. ok: None where it cannot be told."""

    topic: str
    identity: str  # which part, where, and what it says of itself
    ok: bool | None
    rate_Hz: float  # of measurements
    values: list[str]  # mean and scatter
    bus_errors: int  # transfers that failed
    trouble: str  # statuses other than good ones, with how often
    advice: str


class Fact(NamedTuple):
    """Something beside the sensors."""

    ok: bool
    text: str


class Report(NamedTuple):
    lines: list[Line]
    missed: int  # ticks
    late_ms: float  # the worst tick
    free_s: float  # how long a flight the disk has room for
    facts: list[Fact]

    @property
    def fit(self) -> bool:
        return all(line.ok is not False for line in self.lines) and all(fact.ok for fact in self.facts)


def examine(tray: Tray, *, buses: Buses, clock: Clock, seconds: float = 5.0, watched: bool = False) -> Report:
    """Read the whole tray for `seconds` after it has settled; nothing is recorded. watched: see `turns`.

    Raises InputError when the configuration lacks something.
    """
    found = survey(tray, buses=buses, clock=clock, seconds=seconds, watched=watched)
    messages: dict[str, list[Message]] = {topic: [] for table in tray.sensors for topic in table.topics}
    for topic, _, message in found.samples:
        if topic in messages:
            messages[topic].append(message)
    identities: dict[str, str] = {}
    for table in tray.sensors:
        identities |= dict.fromkeys(table.topics, identity(table, buses, clock))
    lines = [judge(topic, these, seconds, identities[topic]) for topic, these in messages.items()]
    room = free_bytes(Path(tray.directory)) - tray.files.keep_free_MB * 1e6
    free_s = max(room, 0.0) / (BYTES_PER_S * tray.rate_Hz / 25)
    return Report(lines, found.missed, found.late_ms, free_s, facts(tray, found, free_s))


def facts(tray: Tray, found: Survey, free_s: float) -> list[Fact]:
    """The loop, the card, the place where logs go, and the zero."""
    expected = found.ticks + found.missed
    loop = f"{found.ticks} of {expected} ticks at {tray.rate_Hz:g} Hz, {found.late_ms:.1f} ms late at worst"
    room = f"room for {free_s / 3600:.1f} h of log at {tray.directory}"
    writable = is_writable(Path(tray.directory))
    return [
        Fact(not found.missed, loop if not found.missed else f"{loop}: what else runs on this computer?"),
        Fact(free_s >= ENOUGH_ROOM_S, room if free_s >= ENOUGH_ROOM_S else f"{room}: move logs away"),
        Fact(writable, f"{tray.directory} can be written" if writable else f"{tray.directory} cannot be written"),
        Fact(True, f"zero: {tray.zero if Path(tray.zero).exists() else 'none taken (`daq zero`)'}"),
    ]


def judge(topic: str, messages: list[Message], seconds: float, identity: str = "") -> Line:
    """The verdict on a topic from what it brought in `seconds`."""
    statuses = Counter(message.status for message in messages)
    good = [message for message in messages if message.status is Status.OK]
    bad = {status: n for status, n in statuses.most_common() if status not in FINE}
    trouble = ", ".join(f"{status} {n}" for status, n in bad.items())
    fine = sum(statuses[status] for status in FINE)
    ok: bool | None = bool(good) and fine >= ENOUGH * len(messages)
    advice = "" if ok else ADVICE[next(iter(bad), Status.NO_DATA)]
    if topic == "/gps" and not ok and any(getattr(message, "fix_type", None) is not None for message in messages):
        advice = NO_FIX
    if not ok and IN_USE in identity:
        advice = STOP_IT
    if topic == "/rpm" and set(bad) <= {Status.NO_DATA} and not good:
        ok, advice = None, STANDING
    values = [_value(good, *shown) for shown in SHOWN[topic]]
    bus_errors = sum(statuses[status] for status in BUS_ERRORS)
    return Line(topic, identity, ok, len(good) / seconds, values, bus_errors, trouble, advice)


def _value(messages: list[Message], field: str, factor: float, unit: str) -> str:
    values = [getattr(message, field) * factor for message in messages if getattr(message, field) is not None]
    if not values:
        return ""
    scatter = f" ± {stdev(values):.2g}" if len(values) > 1 else ""
    return f"{fmean(values):.5g}{scatter} {unit}"


def is_writable(directory: Path) -> bool:
    """Whether logs can be made there, or the directory made where it will be."""
    while not directory.exists() and directory != directory.parent:
        directory = directory.parent
    try:
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False


def as_json(report: Report) -> str:
    """For machines: the report's fields, and `fit`."""
    lines = [line._asdict() for line in report.lines]
    facts_ = [fact._asdict() for fact in report.facts]
    return msgspec.json.encode({**report._asdict(), "lines": lines, "facts": facts_, "fit": report.fit}).decode()
