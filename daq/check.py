"""Is the tray fit to fly? Reads it for a few seconds and says of every topic what works, and what to do if not."""

import shutil
import threading
from collections import Counter
from pathlib import Path
from statistics import fmean, stdev
from typing import NamedTuple

import msgspec

from daq import luggage
from daq.bus import Buses
from daq.clock import Clock
from daq.config import Tray
from daq.daemon import stations
from daq.health import FINE
from daq.loop import turns
from flight.messages import Message, Status

SETTLING_S = 2.0  # parts are brought up meanwhile; not judged
ENOUGH = 0.95  # of the readings after that have to be measurements
BYTES_PER_S = 20_000  # of a log of the default tray at 25 Hz
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
    "/gps": (("satellites", 1, "satellites"), ("horizontal_accuracy_m", 1, "m accuracy")),
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
STANDING = "silent, as it is while the motor stands; run the motor to be sure"


class Line(NamedTuple):
    """One topic's verdict. ok: None where it cannot be told."""

    topic: str
    ok: bool | None
    rate_Hz: float  # of measurements
    values: list[str]  # mean and scatter
    trouble: str  # statuses other than good ones, with how often
    advice: str


class Report(NamedTuple):
    lines: list[Line]
    missed: int  # ticks
    late_ms: float  # the worst tick
    free_s: float  # how long a flight the disk has room for

    @property
    def fit(self) -> bool:
        return all(line.ok is not False for line in self.lines) and self.free_s >= ENOUGH_ROOM_S and not self.missed


def examine(tray: Tray, *, buses: Buses, clock: Clock, seconds: float = 5.0) -> Report:
    """Read the whole tray for `seconds` after it has settled; nothing is recorded.

    Raises InputError when the configuration lacks something.
    """
    places = stations(tray, buses, luggage.pack(tray).aircraft)
    settled_ns = clock.now_ns() + round(SETTLING_S * 1e9)
    until_ns = settled_ns + round(seconds * 1e9)
    messages: dict[str, list[Message]] = {topic: [] for place in places for topic in place.topics}
    missed, late_ns = 0, 0
    for turn in turns(places, rate_Hz=tray.rate_Hz, clock=clock, stop=threading.Event(), until_ns=until_ns):
        if turn.now_ns < settled_ns:
            continue
        missed, late_ns = missed + turn.beat.missed, max(late_ns, turn.beat.late_ns)
        for sample in turn.samples:
            if sample.topic in messages:
                messages[sample.topic].append(sample.message)
    lines = [judge(topic, found, seconds) for topic, found in messages.items()]
    return Report(lines, missed, late_ns / 1e6, free_bytes(Path(tray.directory)) / (BYTES_PER_S * tray.rate_Hz / 25))


def judge(topic: str, messages: list[Message], seconds: float) -> Line:
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
    if topic == "/rpm" and set(bad) <= {Status.NO_DATA} and not good:
        ok, advice = None, STANDING
    return Line(topic, ok, len(good) / seconds, [_value(good, *shown) for shown in SHOWN[topic]], trouble, advice)


def _value(messages: list[Message], field: str, factor: float, unit: str) -> str:
    values = [getattr(message, field) * factor for message in messages if getattr(message, field) is not None]
    if not values:
        return ""
    scatter = f" ± {stdev(values):.2g}" if len(values) > 1 else ""
    return f"{fmean(values):.5g}{scatter} {unit}"


def free_bytes(directory: Path) -> int:
    """Room on the disk where logs go, or would go once the directory is made."""
    while not directory.exists():
        directory = directory.parent
    return shutil.disk_usage(directory).free


def as_json(report: Report) -> str:
    """For machines: the report's fields, and `fit`."""
    lines = [line._asdict() for line in report.lines]
    return msgspec.json.encode({**report._asdict(), "lines": lines, "fit": report.fit}).decode()
