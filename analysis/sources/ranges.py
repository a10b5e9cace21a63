"""Checks units in a log: limits hold for each quantity of every small electric aircraft in its proper unit only.

A measured value outside them has a wrong unit or axis. The limits are physical; they do not describe good flights.
"""

from typing import NamedTuple

import numpy as np

from flightpower.analysis.sources.check_settings import UNITS
from flightpower.analysis.sources.daemon import field_of, is_good, times_ns, values
from flightpower.analysis.sources.grid_settings import CHANNELS
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.runs import AIRCRAFT_SIZE, STANDING
from flightpower.flight.units import GRAVITY_MPS2

FORCE = tuple(f"specific_force_{axis}_mps2" for axis in "xyz")


class Limits(NamedTuple):
    """Limits for a percentile of a field's magnitude; beyond them the field has one of `units` (with factors to SI)."""

    topic: str
    field: str
    least: float
    largest: float
    reason: str
    units: dict[str, float]
    percentile: float = 50.0  # 50 is the median


LIMITS = (
    Limits(
        "/static", "pressure_Pa", 20_000, 115_000, "air has 20000 to 110000 Pa below 11 km",
        {"hPa (mbar)": 100, "kPa": 1000, "inHg": 3386.39, "bar": 1e5, "psi": 6894.76},
    ),
    Limits("/imu", "group_delay_s", 0, 1, "a filter delays by less than 1 s", {"milliseconds": 1e-3}),
    Limits(
        "/imu", "specific_force_group_delay_s", 0, 1, "a filter delays by less than 1 s", {"milliseconds": 1e-3}
    ),
    Limits("/controls", "elevator_rad", 0, 1.6, "a surface turns by less than 90 deg", {"degrees": np.pi / 180}, 95),
    Limits("/controls", "throttle", 0, 1.5, "full throttle is 1", {"percent": 0.01, "microseconds": 5e-4}, 95),
    Limits("/battery", "voltage_V", 0, 200, "such a battery has less than 200 V", {"mV": 1e-3}),
    Limits("/battery", "current_A", 0, 1000, "it gives less than 1000 A", {"mA": 1e-3}),
    Limits(
        "/mag", "field_x_T", 0, 1e-3, "the earth's field has 22e-6 to 67e-6 T",
        {"gauss": 1e-4, "uT": 1e-6, "mG": 1e-7, "nT": 1e-9},
    ),
)  # fmt: skip


def check_units(log: Log, diameter_m: float) -> None:
    """Raises InputError if a quantity's unit is not the one in its name. diameter_m: diameter of the propeller."""
    _check_differential_pressures(log)
    _check_specific_force(log)
    _check_temperature(log)
    _check_motor_speed(log, diameter_m)
    _check_current(log)
    for limits in LIMITS:
        _check(log, limits)


def _check(log: Log, limits: Limits) -> None:
    _, values = field_of(log, limits.topic, limits.field)
    if not len(values):
        return
    measured = float(np.percentile(np.abs(values), limits.percentile))
    if limits.least <= measured <= limits.largest:
        return
    unit = next((u for u, factor in limits.units.items() if limits.least <= measured * factor <= limits.largest), None)
    remedy = f"it looks like {unit}; multiply by {limits.units[unit]:g}" if unit else "write SI units"
    which = "median" if limits.percentile == 50 else f"{limits.percentile:g} % of the log below"
    raise InputError(
        f"{log.path}: {limits.topic}: {limits.field} is {measured:.4g} ({which}), but {limits.reason}: {remedy}"
    )


def _check_specific_force(log: Log) -> None:
    """Check that the accelerometers' median in flight is about 1 g in magnitude and points upward, along -z."""
    median, magnitude = _specific_force(log)
    low, high = (limit * GRAVITY_MPS2 for limit in UNITS.plausible.load_g)
    if not low <= magnitude <= high:
        factors = {"g": GRAVITY_MPS2, "milli-g": GRAVITY_MPS2 / 1000}
        unit = next((unit for unit, factor in factors.items() if low <= magnitude * factor <= high), None)
        if np.abs(median).max() < UNITS.gravity[1] * magnitude:
            remedy = "gravity was taken out; write what an accelerometer measures"
        else:
            remedy = f"it looks like {unit}; multiply by {factors[unit]:.6g}" if unit else "write m/s^2"
        raise InputError(
            f"{log.path}: /imu: specific_force_{{x,y,z}}_mps2 have a magnitude of {magnitude:.3g} (median in flight),"
            f" but rest and flight have about 9.8: {remedy}"
        )
    if median[2] > UNITS.gravity[0] * magnitude:
        if median[2] > -UNITS.gravity[0] * magnitude:
            cause = "z points up, or gravity was written in place of specific force"
        else:
            axis = int(np.argmax(np.abs(median)))
            cause = f"the axes are exchanged ({'xyz'[axis]} has {median[axis]:+.1f})"
        raise InputError(
            f"{log.path}: /imu: specific_force_z_mps2 is {median[2]:+.1f} (median in flight), but rest and level"
            f" flight have about -9.8: {cause}; axes are x forward, y right, z down"
        )


def _check_temperature(log: Log) -> None:
    _, values = field_of(log, "/static", "temperature_K")
    median_K = float(np.median(values))
    least_K, largest_K = UNITS.plausible.temperature_K
    if least_K <= median_K <= largest_K:
        return
    least, largest = UNITS.plausible.other_degrees
    other = least <= median_K <= largest
    remedy = "it looks like degrees Celsius (add 273.15) or Fahrenheit" if other else "write kelvin"
    raise InputError(
        f"{log.path}: /static: temperature_K is {median_K:.1f} (median), but air has 220 to 330 K: {remedy}"
    )


def _check_motor_speed(log: Log, diameter_m: float) -> None:
    """Check that the median tip speed of the turning propeller is below the speed of sound."""
    _, values = field_of(log, "/rpm", "motor_speed_revps")
    turning = values[np.abs(values) > STANDING.motor_revps]
    if not len(turning):
        return
    median_revps = float(np.median(np.abs(turning)))
    tip_mps = np.pi * diameter_m * median_revps
    slowest_mps, fastest_mps = UNITS.plausible.tip_mps
    if tip_mps > fastest_mps:
        per_minute = slowest_mps < tip_mps / 60 < fastest_mps
        remedy = "it looks like rev/min; divide by 60" if per_minute else "is it in rad/s, or electrical revolutions?"
        raise InputError(
            f"{log.path}: /rpm: motor_speed_revps is {median_revps:.0f} (median of the turning motor), at which the"
            f" tips of a propeller of {diameter_m:.2f} m move faster than sound: {remedy}"
        )


def _check_current(log: Log) -> None:
    """Check that the current is not negative in flight, when the battery discharges."""
    _, values = field_of(log, "/battery", "current_A")
    if not len(values):
        return
    low, high = np.percentile(values, (5, 95))
    if low < -UNITS.least_current_A and -low > 2 * high:
        raise InputError(
            f"{log.path}: /battery: current_A is negative in flight ({low:.3g} A): write it positive when discharging"
        )


def _check_differential_pressures(log: Log) -> None:
    """Check that center port minus static is positive in flight, and is not far below both side differences."""
    q_c = _pressure(log, "airspeed")
    low, high = -_reached(-q_c), _reached(q_c)
    if low < -AIRCRAFT_SIZE.least_flying_Pa and -low > 2 * high:
        raise InputError(
            f"{log.path}: /probe/airspeed: differential_pressure_Pa is negative in flight ({low:.0f} Pa): write center"
            " port minus static, or exchange the two tubes"
        )
    sides = {name: _reached(np.abs(side)) for name in ("alpha", "beta") if len(side := _pressure(log, name))}
    largest = max(sides, key=lambda name: sides[name])
    if sides[largest] > max(UNITS.swapped * high, AIRCRAFT_SIZE.least_flying_Pa):
        raise InputError(
            f"{log.path}: /probe/{largest}: differential_pressure_Pa reaches {sides[largest]:.3g} Pa, but that of"
            f" /probe/airspeed only {high:.3g} Pa, which is larger in flight: the topics or tubes are exchanged, a"
            " tube is blocked, or one of the pressures is not in Pa"
        )
    if high < AIRCRAFT_SIZE.least_flying_Pa:
        raise InputError(
            f"{log.path}: no flight in it: differential_pressure_Pa of /probe/airspeed reaches only {high:.2g} Pa, but"
            " 7 m/s make 30 Pa; is it in hPa (mbar), kPa or inches of water?"
        )


def _pressure(log: Log, name: str) -> Array:
    return field_of(log, f"/probe/{name}", "differential_pressure_Pa")[1]


def _reached(values: Array) -> float:
    """Return the value that CHANNELS.fewest_samples samples reach or exceed, however long the log is."""
    return float(np.sort(values)[-min(CHANNELS.fewest_samples, len(values))])


def _specific_force(log: Log) -> tuple[Array, float]:
    """Return medians of components (3,) and magnitude [m/s^2] in flight: with q_c above a quarter of its largest."""
    force = _times_and_values(log, "/imu", FORCE)
    pressure = _times_and_values(log, "/probe/airspeed", ("differential_pressure_Pa",))
    flown = np.interp(force[:, 0], pressure[:, 0], pressure[:, 1]) > _reached(pressure[:, 1]) / 4
    values = force[flown if flown.sum() >= CHANNELS.fewest_samples else slice(None), 1:]
    return np.median(values, axis=0), float(np.median(np.linalg.norm(values, axis=1)))


def _times_and_values(log: Log, topic: str, fields: tuple[str, ...]) -> Array:
    """Return log time [ns] and fields of the good messages that have all of these fields, (n, 1 + fields)."""
    entries = log.entries[topic]
    columns = [times_ns(entries).astype(float), *(values(entries, field) for field in fields)]
    rows = np.stack(columns, axis=1)[is_good(entries)]
    return np.asarray(rows[np.isfinite(rows).all(axis=1)])
