"""The channels of an ordinary flight on one time base, and the stretches in which the aircraft was airborne.

`flight_table` corrects the pitot's zero from the time on the ground, takes air temperature from the thermometer that
shows the air, and finds the flight from airspeed, GPS and height.
"""

from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.methods.whole_flight.ground_velocity import circle_center, height_factor
from flightpower.analysis.methods.whole_flight.settings import GPS, SHARED, TEMPERATURE, WINDOWS, ZERO
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.grid import resampled, rows_within, smoothed, stretches
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.analysis.sources.recording import Channel, FlightRecording
from flightpower.flight.arrays import Array, BoolArray
from flightpower.flight.atmosphere import density, height_at, temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g


class Needed(NamedTuple):
    """A sensor that the balance needs, and its channels."""

    title: str
    channels: frozenset[str]


NO_AIRSPEED = (
    "No airspeed sensor in this log: airspeed is the velocity by GPS less the wind, which is estimated with the curve."
)
NEEDED = (
    Needed("airspeed: a pitot tube and its sensor, or GPS", recording.OF_AIRSPEED),
    Needed("static pressure: a barometer", recording.OF_BAROMETER),
    Needed("battery voltage and current: a power module", recording.OF_BATTERY),
)


class FlightTable(NamedTuple):
    """One flight on a uniform grid of FLIGHT.step_s.

    table : index t_s; pressure_Pa (pitot with zero corrected, or from GPS as in `_first_wind`), rho, height_m, power_W,
        load_factor, force_x_mps2, load_variance and side_variance (variances of load factor and of side force over
        weight within a smoothing window), motor_revps, GPS, wind_factor (`height_factor`), throttle (all NaN if power
        does not follow it); NaN in gaps
    airborne : slices of rows     flown : the same rows as a mask (n,)
    zero_sigma_Pa : standard deviation of the pitot's zero     rho_sigma : relative standard deviation of density
    idle_power_W, idle_sigma_W : power drawn from the battery with the motor off, and its standard deviation
    first_wind_mps : (2,) first guess of the wind, to the north and to the east; None if a sensor measures airspeed
    start_s : time of the first row on the clock of the recording
    """

    table: pd.DataFrame
    airborne: list[slice]
    flown: BoolArray
    zero_sigma_Pa: float
    rho_sigma: float
    air_temperature_K: float
    idle_power_W: float
    idle_sigma_W: float
    notes: list[str]
    first_wind_mps: Array | None = None
    start_s: float = 0.0
    airspeed_scale_sigma: float = GPS.scale_sigma  # prior of the airspeed's scale error

    def thinned(self, every: int) -> "FlightTable":
        """Keep one of every `every` samples."""
        airborne = [slice(-(-rows.start // every), -(-rows.stop // every)) for rows in self.airborne]
        return self._replace(table=self.table.iloc[::every], airborne=airborne, flown=self.flown[::every])


Stretch = tuple[float, float]  # start and end [s], from the first row of the table


def flight_table(
    flight: FlightRecording, weight_N: float, wing_area_m2: float, left_out_s: Sequence[Stretch] = ()
) -> FlightTable:
    """The flight of a recording. left_out_s : stretches that the user leaves out, which do not count as airborne

    Raises InputError, in one line, where the recording lacks a channel or a flight that is long enough.
    """
    t_s = _grid(flight)
    columns = _columns(flight, t_s)
    least_Pa = weight_N / wing_area_m2 / FLIGHT.highest_CL
    has_pitot = recording.AIRSPEED_PRESSURE in flight.channels
    if has_pitot:
        standing, moving = _standing_and_moving(columns, least_Pa, flight.zeroed)
        zero_Pa, zero_sigma_Pa, notes = _zero(flight, columns["pressure_Pa"], standing, moving)
        columns["pressure_Pa"] = columns["pressure_Pa"] - zero_Pa
    else:
        ground_mps = _ground_speed(columns)
        standing, moving = ground_mps < FLIGHT.standing_mps, ground_mps > 2 * FLIGHT.standing_mps
        zero_sigma_Pa, notes = 0.0, [NO_AIRSPEED]
    temperature_K, temperature_sigma_K, temperature_note = _air_temperature_K(flight, moving, t_s)
    columns["rho"] = np.asarray(density(columns["static_Pa"], temperature_K))
    reference_Pa = float(np.nanmedian(columns["static_Pa"]))
    columns["height_m"] = np.asarray(
        height_at(columns["static_Pa"], ground_pressure_Pa=reference_Pa, ground_temperature_K=temperature_K)
    )
    first_wind = None
    columns["wind_factor"] = np.ones(len(t_s))
    if not has_pitot:
        ground_m = _ground_height(columns["height_m"], standing)
        columns["wind_factor"] = height_factor(columns["height_m"], ground_m, moving)
        first_wind, moving = _first_wind(columns, moving, least_Pa)
    airborne = _airborne(columns, standing, moving, least_Pa, rows_within(t_s - t_s[0], left_out_s))
    _refuse_meter(flight.path, columns, moving, weight_N)
    if sum(rows.stop - rows.start for rows in airborne) * FLIGHT.step_s < FLIGHT.shortest_flight_s:
        raise InputError(f"{flight.path}: {_why_too_short(columns, moving, left_out_s)}")
    flown = np.zeros(len(t_s), dtype=bool)
    for rows in airborne:
        flown[rows] = True
    columns[recording.THROTTLE], throttle_notes = _believed_throttle(columns, moving)
    off = power_off(columns[recording.THROTTLE])
    idle_W, idle_sigma_W = _idle_power_W(columns["power_W"], standing, flown, off)
    columns["power_W"] = np.where(off & np.isfinite(columns["power_W"]), idle_W, columns["power_W"])
    table = pd.DataFrame(columns, index=pd.Index(t_s - t_s[0], name="t_s"))
    if left_out_s:
        listed = ", ".join(f"{start:.1f} to {end:.1f} s" for start, end in left_out_s)
        notes = [f"Left out by hand: {listed}.", *notes]
    return FlightTable(
        table,
        airborne,
        flown,
        zero_sigma_Pa,
        temperature_sigma_K / temperature_K,
        temperature_K,
        idle_W,
        idle_sigma_W,
        [*flight.notes, *notes, *throttle_notes, temperature_note],
        first_wind,
        float(t_s[0]),
    )


def _why_too_short(columns: Mapping[str, Array], moving: BoolArray, left_out_s: Sequence[Stretch]) -> str:
    finite = np.isfinite(columns["pressure_Pa"] + columns["height_m"] + columns["power_W"])
    in_air_s, known_s = (float(rows.sum()) * FLIGHT.step_s for rows in (moving, moving & finite))
    lasting_s = max(((rows.stop - rows.start) * FLIGHT.step_s for rows in stretches(moving & finite)), default=0.0)
    if left_out_s:
        cause = f"what is left of {in_air_s:.0f} s in the air, without the stretches left out by hand, is too short"
    elif known_s < FLIGHT.shortest_flight_s or lasting_s > 0.9 * in_air_s:
        cause = f"airspeed, height and battery for {known_s:.0f} s in the air"
    else:
        cause = (
            f"airspeed, height and battery for {known_s:.0f} s of {in_air_s:.0f} s in the air, but broken up by gaps,"
            f" for {lasting_s:.0f} s at most at a time"
        )
    return f"too short a flight in this log: {cause}; {_least_length()}"


def _refuse_meter(path: Path, columns: Mapping[str, Array], moving: BoolArray, weight_N: float) -> None:
    """Raises InputError if the measured power cannot be the motor's."""
    if moving.sum() * FLIGHT.step_s <= FLIGHT.recognized_over_s:
        return
    most_W, throttle = float(np.nanmax(columns["power_W"][moving], initial=0.0)), columns[recording.THROTTLE][moving]
    opened = f", at up to {100 * np.nanmax(throttle):.0f} % throttle" if np.isfinite(throttle).any() else ""
    if most_W < weight_N * FLIGHT.climb_mps:
        raise InputError(
            f"{path}: the current sensor never reads more than {most_W:.0f} W in flight{opened}, too little for"
            f" {weight_N / g:.3g} kg to climb: it does not measure the motor's current, or the motor never ran"
        )
    if meter(columns, moving) is Meter.STANDS:
        usual_W = float(np.nanmedian(columns["power_W"][moving]))
        raise InputError(
            f"{path}: the current sensor shows about {usual_W:.0f} W in the air whatever the throttle, which varies by"
            f" {100 * np.nanstd(throttle):.0f} %: it does not measure the motor's current"
        )


def _believed_throttle(columns: Mapping[str, Array], moving: BoolArray) -> tuple[Array, list[str]]:
    """The throttle (n,), which is all NaN if power does not follow it, and a note if power contradicts it."""
    throttle = meter(columns, moving)
    if throttle is Meter.FOLLOWS:
        return columns[recording.THROTTLE], []
    contradicts = "The measured power does not follow the log's throttle, which is not used; check the current sensor."
    notes = [contradicts] if throttle is Meter.CONTRADICTS else []
    return np.full(len(moving), np.nan), notes


def _ground_speed(columns: Mapping[str, Array]) -> Array:
    """Ground speed (n,) [m/s], averaged over the time that it takes to recognize a flight."""
    speed_mps = pd.Series(np.hypot(columns[recording.GPS[0]], columns[recording.GPS[1]]))
    window = round(FLIGHT.recognized_over_s / FLIGHT.step_s)
    return speed_mps.rolling(window, center=True, min_periods=1).mean().to_numpy()


def _first_wind(columns: dict[str, Array], moving: BoolArray, least_Pa: float) -> tuple[Array, BoolArray]:
    """The wind (2,) from ground velocities alone, and a mask (n,) of rows in flight. Adds the pressure of a pitot.

    The wind is computed twice, the second time without rows in which the aircraft rolls or is carried, because these do
    not have the airspeed of the others.
    """
    north, east, down = (columns[name] for name in recording.GPS)
    flying, wind = moving, np.zeros(2)
    for _ in range(2):
        rows = flying & np.isfinite(north + east)
        if rows.sum() < READABLE.fewest_samples:
            break
        wind = circle_center(north[rows], east[rows], FLIGHT.step_s)
        wind_north, wind_east = wind
        through_air = np.square([north - wind_north, east - wind_east, down]).sum(axis=0)
        columns["pressure_Pa"] = columns["rho"] / 2 * through_air
        flying = moving & (columns["pressure_Pa"] > least_Pa)
    return wind, flying


def require_channels(flight: FlightRecording) -> None:
    """Raises InputError, in one line, if a recording lacks a channel that no value of the aircraft can replace."""
    has_gps = flight.channels.keys() >= set(recording.GPS)
    if missing := [part for part in NEEDED[has_gps:] if not flight.channels.keys() >= part.channels]:
        parts = "; ".join(part.title + flight.enabled_by.get(part.channels, "") for part in missing)
        raise InputError(f"{flight.path}: the log lacks {parts}")


def require_length(flight: FlightRecording) -> None:
    """Check whether a flight can be long enough, whatever the aircraft's weight and wing area.

    A row counts if all channels that the balance needs were measured, and if it is clear of the lowest height or moves
    over the ground. These rows include all that `flight_table` counts as airborne.

    Raises InputError, in one line, if the log lacks a channel, or all rows together are too short.
    """
    columns = _columns(flight, _grid(flight))
    speed_mps, static_Pa = _ground_speed(columns), columns["static_Pa"]
    airspeed = columns["pressure_Pa"] if recording.AIRSPEED_PRESSURE in flight.channels else speed_mps
    finite = np.isfinite(airspeed + static_Pa + columns["power_W"])
    height_m = np.asarray(height_at(static_Pa))
    lowest_m = float(np.min(height_m, where=finite & np.isfinite(height_m), initial=np.inf))
    moved = (height_m - lowest_m > FLIGHT.clear_of_ground_m) | (speed_mps > 2 * FLIGHT.standing_mps)
    flown_s = float((finite & moved).sum()) * FLIGHT.step_s
    if flown_s < FLIGHT.shortest_flight_s:
        raise InputError(
            f"{flight.path}: too short a flight in this log: airspeed, height and battery for {flown_s:.0f} s in the"
            f" air; {_least_length()}"
        )


def _least_length() -> str:
    return (
        f"{FLIGHT.shortest_flight_s:.0f} s clear of take-off and landing are needed, in stretches of"
        f" {2.5 * WINDOWS.length_s:.0f} s at least"
    )


def _grid(flight: FlightRecording) -> Array:
    require_channels(flight)
    has_airspeed = recording.AIRSPEED_PRESSURE in flight.channels
    main = flight.channels[recording.AIRSPEED_PRESSURE if has_airspeed else recording.GPS[0]].t_s
    if main[-1] - main[0] > FLIGHT.longest_log_s:
        raise InputError(f"{flight.path}: its clock spans {main[-1] - main[0]:.0f} s; longer than any flight")
    return np.asarray(np.arange(main[0], main[-1], FLIGHT.step_s))


def _columns(flight: FlightRecording, t_s: Array) -> dict[str, Array]:
    channels = flight.channels
    gap_s = WINDOWS.length_s if flight.by_radio else FLIGHT.longest_gap_s

    def column(name: str, window_s: float = 0.0) -> Array:
        channel = channels.get(name)
        return np.full(len(t_s), np.nan) if channel is None else resampled(channel, t_s, window_s, gap_s)

    columns = {
        "pressure_Pa": column(recording.AIRSPEED_PRESSURE, FLIGHT.smoothing_s),
        "static_Pa": column(recording.STATIC, FLIGHT.smoothing_s),
        "power_W": column(recording.VOLTAGE) * np.maximum(column(recording.CURRENT), 0.0),
        "load_factor": -column(recording.FORCE_Z, FLIGHT.smoothing_s) / g,
        "load_variance": _variance(channels.get(recording.FORCE_Z), t_s) / g**2,
        "side_variance": _variance(channels.get(recording.FORCE_Y), t_s) / g**2,
        "force_x_mps2": column(recording.FORCE_X, FLIGHT.smoothing_s),
    }
    return columns | {name: column(name) for name in (*recording.GPS, recording.MOTOR, recording.THROTTLE)}


def _variance(channel: Channel | None, t_s: Array) -> Array:
    """Variance (n,) of a channel within the smoothing window, without vibration; zero where it is not measured."""
    if channel is None or len(channel.t_s) < 2:
        return np.zeros(len(t_s))
    width = round(FLIGHT.step_s / 2 / float(np.median(np.diff(channel.t_s))))
    value = channel.value if width < 2 else smoothed(channel.value, width)
    mean, square = (resampled(Channel(channel.t_s, x), t_s) for x in (value, value**2))
    return np.asarray(np.maximum(np.nan_to_num(square - mean**2), 0.0))


def _standing_and_moving(columns: Mapping[str, Array], least_Pa: float, zeroed: bool) -> tuple[BoolArray, BoolArray]:
    """Rows in which the aircraft stands, and rows in which it flies or rolls fast, before the pitot's zero is known."""
    window = round(FLIGHT.recognized_over_s / FLIGHT.step_s)
    pressure = pd.Series(columns["pressure_Pa"]).rolling(window, center=True, min_periods=1).mean().to_numpy()
    ground_speed = np.hypot(columns[recording.GPS[0]], columns[recording.GPS[1]])
    has_gps = bool(np.isfinite(ground_speed).any())
    low = float(np.nanpercentile(pressure, 5))
    standing = pressure - low < least_Pa / 2
    if has_gps:
        standing &= np.nan_to_num(ground_speed, nan=np.inf) < FLIGHT.standing_mps
    on_ground = has_gps and standing.sum() * FLIGHT.step_s >= ZERO.block_s
    known_zero = 0.0 if zeroed and not on_ground and (low > least_Pa or not standing.any()) else low
    # If the whole log is airborne, the lowest pressure was measured in flight, and the zero is the autopilot's.
    standing &= pressure - known_zero < least_Pa / 2
    moving = pressure - known_zero > least_Pa
    if has_gps:
        slow = pd.Series(ground_speed).rolling(window, center=True, min_periods=1).mean().to_numpy()
        moving &= ~(slow < 2 * FLIGHT.standing_mps) | (pressure - known_zero > 3 * least_Pa)
    return standing, moving


def _zero(
    flight: FlightRecording, pressure: Array, standing: BoolArray, moving: BoolArray
) -> tuple[float, float, list[str]]:
    """Zero of the pitot [Pa] and its standard deviation, from the time on the ground next to the flight, and notes."""
    near = np.zeros(len(pressure), dtype=bool)
    if moving.any():
        first, last = np.flatnonzero(moving)[[0, -1]]
        reach = round(ZERO.near_s / FLIGHT.step_s)
        near[max(0, first - reach) : last + reach] = True
    block = round(ZERO.block_s / FLIGHT.step_s)
    rows = np.flatnonzero(standing & near & np.isfinite(pressure))
    means = pressure[rows[: len(rows) // block * block]].reshape(-1, block).mean(axis=1)
    if not len(means) and not flight.zeroed:
        raise InputError(
            f"{flight.path}: the pressure of the pitot is raw, and the log has no {ZERO.block_s:.0f} s on the ground"
            " that show its zero"
        )
    if not len(means):
        note = (
            "The log has no time on the ground: the pitot's zero is the autopilot's, taken as good to"
            f" {ZERO.unknown_sigma_Pa:.0f} Pa."
        )
        return 0.0, ZERO.unknown_sigma_Pa, [note]
    sigma = float(np.hypot(ZERO.sigma_Pa, np.std(means)))
    return float(np.median(means)), sigma, []


def _air_temperature_K(flight: FlightRecording, moving: BoolArray, t_s: Array) -> tuple[float, float, str]:
    """The air temperature, its standard deviation, and a sentence on it. The temperature comes from the user, or else
    from the thermometer with the coolest believable median in flight, or else from the standard atmosphere.
    """
    if flight.air_temperature_K is not None:
        given_K = flight.air_temperature_K
        return given_K, TEMPERATURE.given_sigma_K, f"Air temperature {given_K - 273.15:.0f} °C, as given."
    thermometers = flight.thermometers
    flown = t_s[moving] if moving.any() else t_s
    by_sensor = {}
    for name, sensor in thermometers.items():
        inside = sensor.value[(sensor.t_s >= flown[0]) & (sensor.t_s <= flown[-1])]
        values = inside[(inside > TEMPERATURE.coldest_K) & (inside < TEMPERATURE.hottest_K)]
        if len(values):
            by_sensor[name] = float(np.median(values))
    coolest = min(by_sensor, key=lambda sensor: by_sensor[sensor], default=None)
    warm = coolest is not None and by_sensor[coolest] > TEMPERATURE.warm_K
    if coolest is None or (warm and coolest in flight.inside):
        pressure_Pa = float(np.median(flight.channels[recording.STATIC].value))
        standard_K = float(temperature_at(height_at(pressure_Pa)))
        note = (
            f"No thermometer in the log shows the air: it is taken as {standard_K - 273.15:.0f} °C, as in the standard"
            " atmosphere; --air-temperature gives it."
        )
        return standard_K, TEMPERATURE.unknown_sigma_K, note
    others = [
        f"{sensor} shows {value - 273.15:.0f} °C"
        for sensor, value in by_sensor.items()
        if value > by_sensor[coolest] + 5
    ]
    also = f" ({'; '.join(others)})" if others else ""
    note = f"Air temperature {by_sensor[coolest] - 273.15:.0f} °C, by the coolest thermometer, {coolest}{also}."
    return (
        by_sensor[coolest],
        TEMPERATURE.unknown_sigma_K if warm or coolest in flight.inside else TEMPERATURE.sigma_K,
        note,
    )


def _airborne(
    columns: Mapping[str, Array],
    standing: BoolArray,
    moving: BoolArray,
    least_Pa: float,
    left_out: BoolArray | bool = False,
) -> list[slice]:
    """Stretches clear of the ground in which all needed channels were measured. left_out : mask (n,) of the user's rows
    to leave out"""
    finite = np.isfinite(columns["pressure_Pa"] + columns["height_m"] + columns["power_W"])
    flying = moving & ~np.asarray(left_out) & finite & (columns["pressure_Pa"] > least_Pa)
    ground = _ground_height(columns["height_m"], standing)
    if ground is not None:
        flying &= columns["height_m"] - ground > FLIGHT.clear_of_ground_m
    trim = round(WINDOWS.length_s / FLIGHT.step_s)
    slices = []
    for rows in stretches(flying):
        start = rows.start + (trim if _touches_ground(moving, rows.start, -1) else 0)
        stop = rows.stop - (trim if _touches_ground(moving, rows.stop - 1, 1) else 0)
        if (stop - start) * FLIGHT.step_s >= 2.5 * WINDOWS.length_s:
            slices.append(slice(start, stop))
    return slices


def _ground_height(height: Array, standing: BoolArray) -> Array | None:
    """Barometric height of the ground (n,), interpolated between the times on the ground because barometers drift."""
    rows = np.flatnonzero(standing & np.isfinite(height))
    if not len(rows):
        return None
    smooth = pd.Series(height[rows]).rolling(25, center=True, min_periods=1).median().to_numpy()
    return np.asarray(np.interp(np.arange(len(height)), rows, smooth))


def _touches_ground(moving: BoolArray, row: int, direction: int) -> bool:
    """Whether the aircraft was on the ground within two window lengths of a row; false if the log ends in flight."""
    reach = round(2 * WINDOWS.length_s / FLIGHT.step_s)
    neighbors = moving[row : row + reach] if direction > 0 else moving[max(0, row - reach) : row]
    return bool(len(neighbors)) and not bool(neighbors.all())


def _idle_power_W(power: Array, standing: BoolArray, flown: BoolArray, off: BoolArray) -> tuple[float, float]:
    """Power with the motor off, and its standard deviation.

    It is the median in flight with the throttle closed, or else on the ground, or less if less was drawn in flight.
    If the log has neither, the motor may have run all the time, so the power is assumed.
    """
    gliding = power[flown & off & np.isfinite(power)]
    if len(gliding) * FLIGHT.step_s > FLIGHT.recognized_over_s:
        return float(np.median(gliding)), SHARED.idle_power_W
    in_flight = float(np.nanpercentile(power[flown], 1))
    on_ground = power[standing & np.isfinite(power)]
    if len(on_ground):
        return min(in_flight, float(np.median(on_ground))), SHARED.idle_power_W
    unseen_W = min(in_flight, SHARED.unseen_idle_W)
    return unseen_W, max(unseen_W, SHARED.idle_power_W)


class Meter(StrEnum):
    """The relation between measured power and throttle."""

    FOLLOWS = "power follows the throttle"
    CONTRADICTS = "power varies, but not with the throttle"
    STANDS = "power hardly varies while the throttle does"
    UNCHECKED = "the log has no throttle that varies"


def meter(columns: Mapping[str, Array], moving: BoolArray) -> Meter:
    """Check the channels of power and throttle (n,) against each other in flight.

    At any airspeed, power relative to its mean rises at least as much as throttle does. A throttle that power
    contradicts belongs to another motor or was not in control.
    """
    throttle, power = columns[recording.THROTTLE], columns["power_W"]
    finite = moving & np.isfinite(throttle + power)
    if not finite.any():
        return Meter.UNCHECKED
    throttle, power = throttle[finite], power[finite]
    if np.std(throttle) <= 0.1 * np.mean(throttle):  # then only airspeed makes power vary
        return Meter.UNCHECKED
    # Throttle explains more than half of power's variance; in simulated flights and SITL it is 0.7 to 0.97.
    if np.std(power) > 0 and np.corrcoef(throttle, power)[0, 1] > np.sqrt(0.5):
        return Meter.FOLLOWS
    least = np.std(throttle) / np.mean(throttle) / 2  # half, because a motor may never idle
    return Meter.STANDS if np.std(power) < least * np.mean(power) else Meter.CONTRADICTS


def power_off(throttle: Array) -> BoolArray:
    """Mask (n,) of rows in which the throttle has been closed for so long that the motor no longer drives.

    Closed means below half a percent, because telemetry counts in percent.
    """
    closed = pd.Series(np.where(np.isfinite(throttle), np.abs(throttle) < 0.005, False).astype(float))
    return np.asarray(closed.rolling(round(FLIGHT.smoothing_s / FLIGHT.step_s), min_periods=1).min() == 1)
