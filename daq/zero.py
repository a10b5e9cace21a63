"""The still-air zero: what the differential transducers and the gyroscopes read when there is nothing to read.

Taken on the ground with the probe covered and the aircraft at rest; kept beside the tray file and put into every log.
Nothing is subtracted anywhere in the daemon: the raw readings stay, and the analysis may use the zero.
"""

import os
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from statistics import fmean, stdev
from typing import NamedTuple

import msgspec

from daq.disk import sync_directory
from daq.sensors import Sample
from flight.errors import InputError
from flight.json_file import decoded
from flight.messages import DifferentialPressure, Imu, Rpm, Status

FORMAT = "flightpower-zero-1"
LEAST_SHARE = 0.9  # of the ticks have to bring a measurement


class Kind(NamedTuple):
    """How a quantity looks at rest.

    spread: largest standard deviation. shift: largest difference between the first and the second half, beyond what
    the noise explains. offset: largest plausible zero; what is beyond is wind, motion or a broken part.
    """

    spread: float
    shift: float
    offset: float
    unit: str
    moved: str  # what to do about it


# Bench noise is 0.005 rad/s, 0.06 m/s^2 (dissertation, Table 4.1); a hand on the wing shakes several times that.
# MPU-9250 zero-rate output is within 5 deg/s (PS 3.1). Zero of the transducers: MS4515DO total error 1 % of 4 inH2O,
# SSC 2 % of 10 inH2O; a breath of 3 m/s is 5.5 Pa, which no number here can tell from an offset: cover the probe.
COVER = "cover the probe, out of the wind, and let the transducers warm up for some minutes"
REST = "put the aircraft down and keep hands off"
PRESSURE = Kind(spread=8.0, shift=1.0, offset=50.0, unit="Pa", moved=COVER)
RATE = Kind(spread=0.02, shift=0.002, offset=0.09, unit="rad/s", moved=REST)
FORCE = Kind(spread=0.3, shift=0.05, offset=float("inf"), unit="m/s2", moved=REST)
RATES = ("angular_rate_x_radps", "angular_rate_y_radps", "angular_rate_z_radps")
FORCES = ("specific_force_x_mps2", "specific_force_y_mps2", "specific_force_z_mps2")
DIFFERENCE = "differential_pressure_Pa"
SHIFT_SIGMAS = 4.0  # of the difference between two means


class Reading(msgspec.Struct, frozen=True, kw_only=True):
    """One quantity at rest, in the unit of its field."""

    mean: float
    standard_deviation: float
    samples: int


class Zero(msgspec.Struct, frozen=True, kw_only=True):
    """What stands in zero.json. readings: by topic, then by field."""

    format: str
    taken_unix_ns: int  # by the system's clock
    seconds: float
    temperature_K: dict[str, float]  # by topic: of the part, on which its zero depends
    readings: dict[str, dict[str, Reading]]


class NotStill(Exception):
    """It was not a zero: the message has a line for each reason, with what to do."""


def measure(samples: Iterable[Sample], *, ticks: int, seconds: float, unix_ns: int) -> Zero:
    """The zero from what the sensors gave in `ticks` ticks; raises NotStill when it was none."""
    values: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    temperature: dict[str, list[float]] = defaultdict(list)
    turning = False
    for topic, _, message in samples:
        turning |= isinstance(message, Rpm) and (message.motor_speed_revps or 0.0) > 0
        fields = (DIFFERENCE,) if isinstance(message, DifferentialPressure) else RATES + FORCES
        if not isinstance(message, DifferentialPressure | Imu):
            continue
        values.setdefault(topic, defaultdict(list))
        if message.status is Status.OK:
            for field in fields:
                values[topic][field].append(getattr(message, field))
            if message.temperature_K is not None:
                temperature[topic].append(message.temperature_K)
    troubles = ["the motor turns: switch it off"] if turning else []
    if not values:
        troubles.append("the tray has no differential transducer and no IMU")
    for topic, fields_of_topic in values.items():
        counts = [len(found) for found in fields_of_topic.values()] or [0]
        if min(counts) < LEAST_SHARE * ticks:
            troubles.append(f"{topic} gave {min(counts)} measurements in {ticks} ticks: run `daq check`")
            continue
        for field, found in fields_of_topic.items():
            troubles += restless(f"{topic} {field}", found, kind_of(field))
    if troubles:
        raise NotStill("\n".join(troubles))
    return Zero(
        format=FORMAT,
        taken_unix_ns=unix_ns,
        seconds=seconds,
        temperature_K={topic: fmean(found) for topic, found in temperature.items()},
        readings={
            topic: {field: _reading(found) for field, found in fields.items() if field not in FORCES}
            for topic, fields in values.items()
        },
    )


def kind_of(field: str) -> Kind:
    return PRESSURE if field == DIFFERENCE else RATE if field in RATES else FORCE


def restless(name: str, values: list[float], kind: Kind) -> list[str]:
    """Why these values are not those of a sensor at rest; nothing when they may be."""
    half = len(values) // 2
    spread, first, second = stdev(values), fmean(values[:half]), fmean(values[half:])
    noise = SHIFT_SIGMAS * spread * (2 / half) ** 0.5
    if spread > kind.spread:
        return [f"{name} moves: ± {spread:.2g} {kind.unit}, at rest {kind.spread:g} at most; {kind.moved}"]
    if abs(second - first) > kind.shift + noise:
        return [f"{name} drifts: by {second - first:.2g} {kind.unit} within the measurement; {kind.moved}"]
    if abs(fmean(values)) > kind.offset:
        return [f"{name} is {fmean(values):.3g} {kind.unit}, too much for a zero; {kind.moved}; or the part is broken"]
    return []


def parse_zero(text: str, where: str) -> Zero:
    """A zero.json; raises InputError naming `where`."""
    return decoded(text, Zero, (FORMAT,), where, "a zero", "; take a new one with `daq zero`, or delete it")


def save(zero: Zero, path: Path) -> None:
    """Put a new zero in the place of an old one, so that a power cut leaves one of the two."""
    beside = path.with_name(path.name + ".new")
    try:
        with beside.open("wb") as stream:
            stream.write(msgspec.json.format(msgspec.json.encode(zero), indent=2) + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
        beside.rename(path)
        sync_directory(path.parent)
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None


def _reading(values: list[float]) -> Reading:
    return Reading(mean=fmean(values), standard_deviation=stdev(values), samples=len(values))
