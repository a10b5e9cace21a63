"""Checks whether the tray is fit to fly: reads it for a few seconds, and judges every topic and gives advice."""

import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from statistics import fmean, stdev
from typing import NamedTuple

import msgspec

from flightpower.daq import config
from flightpower.daq.bus import Buses
from flightpower.daq.clock import Clock
from flightpower.daq.computer_check import card_check, supply_check
from flightpower.daq.config import SensorTable, Tray
from flightpower.daq.daemon import STOP_SERVICE
from flightpower.daq.disk_space import free_bytes
from flightpower.daq.dry_run import DryRun, dry_run
from flightpower.daq.part_identity import PartIdentity, identify
from flightpower.daq.rest_check import OPEN_SKY, barometer_comparison, height_comparison, is_finite, rest_problem
from flightpower.daq.sensor_health import GOOD_STATUSES
from flightpower.daq.sensors.autopilot import FAR_TOO_FEW
from flightpower.flight.messages import SECOND, Message, Status

LEAST_OF_RATE = 0.9  # as a fraction of the configured rate
EVERY_TICK = frozenset({"/imu", "/mag", "/baro", "/static", "/probe/alpha", "/probe/beta", "/probe/airspeed"})
MINIMUM_GOOD_FRACTION = 0.95  # least fraction of a topic's messages that carry a measurement
BYTES_PER_S = 16_000  # log of the default tray at 25 Hz: 550 to 640 bytes a tick
MINIMUM_FREE_S = 2 * 3600.0  # recording time
# The values shown for each topic: field, factor to the displayed unit, unit.
SHOWN_FIELDS: dict[str, tuple[tuple[str, float, str], ...]] = {
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
        ("speed_accuracy_mps", 1, "m/s accuracy"),
        ("dynamic_model", 1, "dynamic model (6 to 8: airborne)"),
        ("fix_type", 1, "dimensional fix"),
    ),
    "/rpm": (("motor_speed_revps", 60, "rpm"),),
    "/controls": (("elevator_rad", 57.29578, "deg elevator"), ("throttle", 100, "% throttle")),
    "/attitude": (("pitch_rad", 57.29578, "deg pitch"),),
    "/battery": (("voltage_V", 1, "V"), ("current_A", 1, "A")),
    "/analog": (("voltage_V", 1, "V"),),
}
ADVICE = {
    Status.STARTING: "the part does not start: check its supply",
    Status.STALE: "no new measurements: switch its supply off and on",
    Status.FAULT: "the part reports a fault: switch its supply off and on",
    Status.SATURATED: "end of the measuring range: check for blocked or exchanged tubes, or an open bridge",
    Status.NO_REPLY: "no answer: check wiring, supply, address and device name (i2cdetect -y 1,"
    " ls /dev/flightpower /dev/tty*)",
    Status.TIMEOUT: "the bus hangs: unplug its parts one by one until it works",
    Status.CORRUPT: "damaged data: check baud rate, ground and cable length",
    Status.WRONG_DEVICE: "another part answers at this address: compare the tray file with the wiring",
    Status.NO_DATA: "nothing arrives: check TX and RX, baud rate and supply",
}
NOT_FINITE = "the part sends no numbers: wait until it has started and found its position"
NO_FIX = f"no fix yet: {OPEN_SKY}"
STOP_PROGRAM = f"stop the program that uses it: {STOP_SERVICE}"
BUS_ERRORS = (Status.NO_REPLY, Status.TIMEOUT, Status.CORRUPT)
BUS_SLOW, LINE_SLOW = "stop other programs on this computer, or raise i2c_arm_baudrate", "raise its baud rate"
MOTOR_STOPPED = "no frames, which is normal while the motor is stopped; run the motor to check"


class TopicCheck(NamedTuple):
    """The result for one topic. ok: None if it cannot be decided."""

    topic: str
    identity: str  # part that answers, and its place
    ok: bool | None
    rate_Hz: float  # rate of messages with a measurement
    values: list[str]  # texts with mean and standard deviation
    bus_errors: int  # number of failed transfers
    trouble: str  # statuses without a measurement, and their counts
    advice: str


class SystemCheck(NamedTuple):
    """The result for something other than a sensor."""

    ok: bool
    text: str


class TrayCheck(NamedTuple):
    """The result for the whole tray."""

    lines: list[TopicCheck]
    missed: int  # number of missed ticks
    late_ms: float  # delay of the latest tick
    free_s: float  # recording time for which there is space on the disk
    facts: list[SystemCheck]

    @property
    def fit(self) -> bool:
        return all(line.ok is not False for line in self.lines) and all(fact.ok for fact in self.facts)


def check_tray(tray: Tray, *, buses: Buses, clock: Clock, seconds: float, threaded: bool = False) -> TrayCheck:
    """Read the whole tray for `seconds` after it has settled, without recording. threaded: see `cycles`.

    Raises InputError when the configuration is incomplete.
    """
    readings = dry_run(tray, buses=buses, clock=clock, seconds=seconds, threaded=threaded)
    messages: dict[str, list[Message]] = {topic: [] for table in tray.sensors for topic in table.topics}
    for topic, _, message, _ in readings.samples:
        if topic in messages:
            messages[topic].append(message)
    identities: dict[str, PartIdentity] = {}
    for table in tray.sensors:
        identities |= dict.fromkeys(table.topics, identify(table, buses, clock))
    expected_Hz = {topic: expected_rate_Hz(table, topic, tray) for table in tray.sensors for topic in table.topics}
    lines = [
        check_rate(
            check_topic(topic, these, seconds, identities[topic], readings.slow),
            these,
            seconds,
            expected_Hz[topic],
            readings.troubles.get(topic, ""),
        )
        for topic, these in messages.items()
    ]
    usable_bytes = free_bytes(Path(tray.directory)) - tray.files.keep_free_MB * 1e6
    free_s = max(usable_bytes, 0.0) / (BYTES_PER_S * tray.rate_Hz / 25)
    facts = system_checks(tray, readings, free_s)
    comparisons = barometer_comparison(messages), height_comparison(messages)
    computer = supply_check(), card_check(Path(tray.directory))
    facts += [SystemCheck(*fact) for fact in (*comparisons, *computer) if fact is not None]
    return TrayCheck(lines, readings.missed, readings.late_ms, free_s, facts)


def system_checks(tray: Tray, readings: DryRun, free_s: float) -> list[SystemCheck]:
    """Check the sampling loop, the free space, the log directory and the still-air zero."""
    expected = readings.ticks + readings.missed
    loop = f"{readings.ticks} of {expected} ticks at {tray.rate_Hz:g} Hz, at most {readings.late_ms:.1f} ms late"
    space = f"space for {free_s / 3600:.1f} h of recording at {tray.directory}"
    writable = is_writable(Path(tray.directory))
    return [
        SystemCheck(
            not readings.missed, loop if not readings.missed else f"{loop}: stop other programs on this computer"
        ),
        SystemCheck(
            free_s >= MINIMUM_FREE_S, space if free_s >= MINIMUM_FREE_S else f"{space}: move logs to another disk"
        ),
        *(SystemCheck(False, text) for text in readings.slow),
        SystemCheck(writable, f"{tray.directory} is writable" if writable else f"{tray.directory} is not writable"),
        SystemCheck(True, f"still-air zero: {tray.zero if Path(tray.zero).exists() else 'not taken (see `daq zero`)'}"),
    ]


def check_topic(
    topic: str,
    messages: list[Message],
    seconds: float,
    part: PartIdentity = PartIdentity(""),
    slow: Sequence[str] = (),
) -> TopicCheck:
    """Judge a topic by the messages of `seconds`. slow: advice on buses that are too slow."""
    kind = topic.removesuffix(SECOND)
    statuses = Counter(message.status for message in messages)
    good = [message for message in messages if message.status is Status.OK and is_finite(message)]
    not_finite = statuses[Status.OK] - len(good)
    bad = {status: n for status, n in statuses.most_common() if status not in GOOD_STATUSES}
    trouble = ", ".join(f"{status} {n}" for status, n in bad.items())
    if not_finite:
        trouble = ", ".join(filter(None, (trouble, f"not a number {not_finite}")))
    fine = sum(statuses[status] for status in GOOD_STATUSES) - not_finite
    ok: bool | None = bool(good) and fine >= MINIMUM_GOOD_FRACTION * len(messages)
    advice = "" if ok else ADVICE[next(iter(bad), Status.NO_DATA)]
    if not ok and not_finite and not bad:
        advice = NOT_FINITE
    if not ok and next(iter(bad), None) is Status.TIMEOUT and slow:
        advice = "; ".join(slow)
    if kind == "/gps" and not ok and any(getattr(message, "fix_type", None) is not None for message in messages):
        advice = NO_FIX
    if not ok and part.in_use:
        advice = STOP_PROGRAM
    if topic == "/rpm" and set(bad) <= {Status.NO_DATA} and not good:
        ok, advice = None, MOTOR_STOPPED
    if ok and (problem := rest_problem(good)):
        ok, advice = False, problem
    values = [_value(good, *field) for field in SHOWN_FIELDS.get(kind, ())]
    bus_errors = sum(statuses[status] for status in BUS_ERRORS)
    return TopicCheck(topic, part.text, ok, len(good) / seconds, values, bus_errors, trouble, advice)


def expected_rate_Hz(table: SensorTable, topic: str, tray: Tray) -> float | None:
    """Least number of messages per second expected on a topic; None if unknown."""
    match table:
        case config.UBloxConfig() | config.UBloxDdcConfig():
            return LEAST_OF_RATE * table.rate_Hz
        case config.AutopilotConfig():
            return FAR_TOO_FEW * tray.rate_Hz if topic in ("/controls", "/attitude") else None
    return LEAST_OF_RATE * tray.rate_Hz if topic.removesuffix(SECOND) in EVERY_TICK else None


def check_rate(
    line: TopicCheck, messages: list[Message], seconds: float, least_Hz: float | None, trouble: str
) -> TopicCheck:
    """Check the rate of a topic without faults so far, and add its driver's complaint. least_Hz: `expected_rate_Hz`."""
    rate_Hz = sum(message.status in GOOD_STATUSES for message in messages) / seconds
    if line.ok and least_Hz is not None and rate_Hz < least_Hz:
        advice = trouble or (BUS_SLOW if line.topic.removesuffix(SECOND) in EVERY_TICK else LINE_SLOW)
        return line._replace(ok=False, advice=f"{rate_Hz:.1f} a second, {least_Hz:g} needed: {advice}")
    if trouble and (
        (line.ok and least_Hz is not None) or any(message.status is Status.WRONG_DEVICE for message in messages)
    ):
        return line._replace(ok=False, advice=trouble)
    return line


def _value(messages: list[Message], field: str, factor: float, unit: str) -> str:
    values = [getattr(message, field) * factor for message in messages if getattr(message, field) is not None]
    if not values:
        return ""
    scatter = f" ± {stdev(values):.2g}" if len(values) > 1 else ""
    return f"{fmean(values):.5g}{scatter} {unit}"


def is_writable(directory: Path) -> bool:
    """Whether files can be created in the directory, or the directory itself if it does not exist yet."""
    while not directory.exists() and directory != directory.parent:
        directory = directory.parent
    try:
        with tempfile.TemporaryFile(dir=directory):
            return True
    except OSError:
        return False


def check_file(tray: Tray) -> Path:
    """Path of the file with the result of the last check, next to the zero."""
    return Path(tray.zero).with_name("check.json")


def save(report: TrayCheck, tray: Tray) -> None:
    """Save the result for the status page. It is not an error if the folder cannot be written."""
    path = check_file(tray)
    beside = path.with_name(f"{path.name}.new")
    try:
        beside.write_text(f"{as_json(report)}\n", "utf-8")
        beside.replace(path)
    except OSError:
        return


def as_json(report: TrayCheck) -> str:
    """Return the fields of the check as JSON, including `fit`."""
    lines = [line._asdict() for line in report.lines]
    facts_ = [fact._asdict() for fact in report.facts]
    return msgspec.json.encode({**report._asdict(), "lines": lines, "facts": facts_, "fit": report.fit}).decode()
