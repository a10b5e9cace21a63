"""Takes the still-air zero: readings of differential transducers and gyroscopes at zero pressure and angular rate.

It is measured on the ground with the probe covered and the aircraft at rest, stored next to the tray file, and attached
to every log. The daemon never subtracts it: logs contain raw readings, and the analysis may use the zero.
"""

import os
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

import msgspec

from flightpower.daq.sensors import Sample
from flightpower.daq.sync_directory import sync_directory
from flightpower.flight.errors import InputError
from flightpower.flight.files import JsonFormat
from flightpower.flight.messages import DifferentialPressure, Imu, Rpm, Status

FORMAT = "flightpower-zero-1"
MINIMUM_FRACTION = 0.9  # least fraction of ticks with a measurement


class RestCriteria(NamedTuple):
    """Limits of a quantity at rest.

    spread: largest standard deviation. shift: largest difference between the means of the first and the second half, in
    excess of the noise. offset: largest plausible zero; a larger mean is due to wind, motion or a broken part.
    """

    spread: float
    shift: float
    offset: float
    unit: str
    advice: str  # what to do when a limit is exceeded


# Bench noise is 0.005 rad/s, 0.06 m/s^2 (dissertation, Table 4.1); a hand on the wing gives several times that.
# MPU-9250 zero-rate output is within 5 deg/s (PS 3.1). Zero of the transducers: MS4515DO total error 1 % of 4 inH2O,
# SSC 2 % of 10 inH2O; a wind of 3 m/s gives 5.5 Pa, which looks like an offset: cover the probe.
COVER = "cover the probe, keep it out of the wind, and let the transducers warm up for some minutes"
REST = "put the aircraft down and do not touch it"
PRESSURE = RestCriteria(spread=8.0, shift=1.0, offset=50.0, unit="Pa", advice=COVER)
RATE = RestCriteria(spread=0.02, shift=0.002, offset=0.09, unit="rad/s", advice=REST)
FORCE = RestCriteria(spread=0.3, shift=0.05, offset=float("inf"), unit="m/s2", advice=REST)
RATES = ("angular_rate_x_radps", "angular_rate_y_radps", "angular_rate_z_radps")
FORCES = ("specific_force_x_mps2", "specific_force_y_mps2", "specific_force_z_mps2")
DIFFERENCE = "differential_pressure_Pa"
SHIFT_SIGMAS = 4.0  # standard deviations of the difference between two means


class ZeroReading(msgspec.Struct, frozen=True, kw_only=True):
    """Statistics of one quantity at rest, in the unit of its field."""

    mean: float
    standard_deviation: float
    samples: int


class Zero(msgspec.Struct, frozen=True, kw_only=True):
    """The contents of zero.json. readings: by topic, then by field."""

    format: str
    taken_unix_ns: int  # time by the system clock
    seconds: float
    temperature_K: dict[str, float]  # mean temperature of the part by topic, because the zero depends on it
    readings: dict[str, dict[str, ZeroReading]]


class NotStill(Exception):
    """The readings do not fit an aircraft at rest. The message has a line for each reason, with advice."""


def zero_from_samples(samples: Iterable[Sample], *, ticks: int, seconds: float, unix_ns: int) -> Zero:
    """Compute the zero from the samples of `ticks` ticks. Raises NotStill if a limit was exceeded."""
    from statistics import fmean

    values: dict[str, dict[str, list[float]]] = defaultdict(lambda: defaultdict(list))
    temperature: dict[str, list[float]] = defaultdict(list)
    turning = False
    for topic, _, message, _ in samples:
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
    problems = ["the motor is running: switch it off"] if turning else []
    if not values:
        problems.append("the tray has no differential transducer and no IMU")
    for topic, fields_of_topic in values.items():
        counts = [len(readings) for readings in fields_of_topic.values()] or [0]
        if min(counts) < MINIMUM_FRACTION * ticks:
            problems.append(f"{topic} gave {min(counts)} measurements in {ticks} ticks: run `daq check`")
            continue
        for field, readings in fields_of_topic.items():
            problems += rest_problems(f"{topic} {field}", readings, rest_criteria(field))
    if problems:
        raise NotStill("\n".join(problems))
    return Zero(
        format=FORMAT,
        taken_unix_ns=unix_ns,
        seconds=seconds,
        temperature_K={topic: fmean(readings) for topic, readings in temperature.items()},
        readings={
            topic: {field: _reading(readings) for field, readings in fields.items() if field not in FORCES}
            for topic, fields in values.items()
        },
    )


def rest_criteria(field: str) -> RestCriteria:
    return PRESSURE if field == DIFFERENCE else RATE if field in RATES else FORCE


def rest_problems(name: str, values: list[float], criteria: RestCriteria) -> list[str]:
    """Why these values do not fit a sensor at rest; an empty list if they are within limits."""
    from statistics import fmean, stdev  # this import loads decimal and random, a tenth of the daemon's startup time

    half = len(values) // 2
    spread, first, second = stdev(values), fmean(values[:half]), fmean(values[half:])
    noise = SHIFT_SIGMAS * spread * (2 / half) ** 0.5
    if spread > criteria.spread:
        return [
            f"{name} is not steady: standard deviation {spread:.2g} {criteria.unit}, limit {criteria.spread:g}; "
            f"{criteria.advice}"
        ]
    if abs(second - first) > criteria.shift + noise:
        return [f"{name} drifts by {second - first:.2g} {criteria.unit} during the measurement; {criteria.advice}"]
    if abs(fmean(values)) > criteria.offset:
        return [
            f"{name} is {fmean(values):.3g} {criteria.unit}, limit {criteria.offset:g}; "
            f"{criteria.advice}; otherwise the part is broken"
        ]
    return []


def parse_zero(text: str, where: str) -> Zero:
    """Parse a zero.json. Raises InputError naming `where`."""
    remedy = "; take a new one with `daq zero`, or delete it"
    return JsonFormat(Zero, (FORMAT,), "a zero", remedy=remedy).parsed(text, where)


def save_zero(zero: Zero, path: Path) -> None:
    """Replace the zero file atomically: a power cut leaves either the old or the new one."""
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


def _reading(values: list[float]) -> ZeroReading:
    from statistics import fmean, stdev

    return ZeroReading(mean=fmean(values), standard_deviation=stdev(values), samples=len(values))
