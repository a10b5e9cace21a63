"""Finds where the aircraft stood still (rest), and determines the zeros of its sensors there.

A log without rest uses the zeros from `daq zero`, if it carries them; a log with rest is compared with them. Zeros
before and after the flight may differ because transducers warm up. A significant drift is noted and corrected linearly
over the flight.
"""

from typing import NamedTuple

import msgspec
import numpy as np
import pandas as pd

from flightpower.analysis.sources.daemon import COLUMNS
from flightpower.analysis.sources.grid import stretches
from flightpower.analysis.sources.grid_settings import REST
from flightpower.flight.arrays import Array
from flightpower.flight.files import JsonFormat
from flightpower.flight.runs import AIRCRAFT_SIZE, STANDING

FORCES = ("ax_mps2", "ay_mps2", "az_mps2")
GPS_HORIZONTAL = ("gps_north_mps", "gps_east_mps")
CHANNELS = ("p_radps", "q_radps", "r_radps", "dp_alpha_Pa", "dp_beta_Pa", "q_c_Pa")


def resting_stretches(table: pd.DataFrame) -> list[pd.DataFrame]:
    """Return the rows of each stretch at rest, in order of time. table : from `sources.daemon.synchronize`"""
    step_s = float(table.index[1] - table.index[0])
    return [table.iloc[rows] for rows in rest_segments(table, 1 / step_s)]


class Zeros(NamedTuple):
    """Readings of each of CHANNELS at rest, in the channel's unit."""

    value: dict[str, float]  # mean over all rests
    standard_error: dict[str, float]
    drift: dict[str, float]  # zero after the flight minus zero before it; 0 if there is rest on one side only
    seconds: float  # total time at rest
    drift_error: dict[str, float]
    drifting: dict[str, tuple[Array, Array]]  # by channel with a significant drift: two times [s] and the zeros there
    notes: list[str]

    def at(self, name: str, t_s: Array) -> Array:
        """Return the zero of a channel at times (n,): constant, or linear from before to after the flight."""
        if name in self.drifting:
            return np.interp(t_s, *self.drifting[name])
        return np.full(len(t_s), self.value[name])


def rest_segments(table: pd.DataFrame, rate_Hz: float, flying_Pa: float = AIRCRAFT_SIZE.flying_Pa) -> list[slice]:
    """Return stretches (slices of rows) of at least REST.shortest_s in which the aircraft stood with its motor off.

    flying_Pa: dynamic pressure of flight. A stretch is a glide if its mean is above the least mean by more than this.
    """
    window = max(3, round(REST.window_s * rate_Hz))
    spread = table.rolling(window, center=True, min_periods=window // 2).std()
    airspeed_spread_Pa = max(STANDING.airspeed_spread_Pa, REST.noise_scatter * _white_noise(table["q_c_Pa"], window))
    at_rest = (table["n_revps"].fillna(0) < STANDING.motor_revps) & (spread["q_c_Pa"] < airspeed_spread_Pa)
    for name in ("p_radps", "q_radps", "r_radps"):
        at_rest &= spread[name] < STANDING.rate_spread_radps
    for name in FORCES:
        at_rest &= spread[name] < STANDING.force_spread_mps2
    gps = table.reindex(columns=list(GPS_HORIZONTAL))  # a log may lack GPS
    speed = gps.pow(2).sum(axis=1, min_count=2).pow(0.5)
    at_rest &= ~(speed.rolling(window, center=True, min_periods=1).mean() > REST.rolling_mps)
    margin = window // 2  # rows at each end, whose window reaches beyond the rest
    rests = [slice(s.start + margin, s.stop - margin) for s in stretches(at_rest.to_numpy())]
    standing = [_without_motion(table, s, window) for s in rests if s.stop - s.start >= REST.shortest_s * rate_Hz]
    long = [s for s in standing if s.stop - s.start >= REST.shortest_s * rate_Hz]
    q_c_Pa = [table["q_c_Pa"].iloc[s].mean() for s in long]
    least_Pa = min((q for q in q_c_Pa if np.isfinite(q)), default=0.0)
    return [s for s, q in zip(long, q_c_Pa, strict=True) if not q - least_Pa > flying_Pa]


def _white_noise(column: pd.Series, window: int) -> float:
    """Return the standard deviation of sample-to-sample noise, as its median over the log; 0 without samples."""
    noise = column.diff().rolling(window, min_periods=window // 2).std() / np.sqrt(2)
    return float(noise.median()) if noise.notna().any() else 0.0


def _without_motion(table: pd.DataFrame, rest: slice, window: int) -> slice:
    """Trim a gentle start of take-off from the end of a rest, and the end of a landing from its start."""
    mean = table[list(FORCES)].iloc[rest].rolling(window, center=True, min_periods=1).mean()
    standing = np.flatnonzero(~((mean - mean.median()).abs() > REST.force_change_mps2).any(axis=1))
    if not len(standing):
        return slice(rest.start, rest.start)
    first, last = int(standing[0]), int(standing[-1]) + 1
    start = rest.start + (first + window // 2 if first else 0)
    return slice(start, rest.start + last - (window // 2 if last < len(mean) else 0))


def zeros(
    table: pd.DataFrame,
    rests: list[slice],
    daq_zeros: dict[str, float] | None = None,
    flying_Pa: float = AIRCRAFT_SIZE.flying_Pa,
) -> Zeros | None:
    """Return the zeros of the sensors; None if the log has no rest and carries no zero.

    daq_zeros: by channel, the zero in still air that the log carries (`still_air_zero`). flying_Pa: dynamic
    pressure of flight.
    """
    if not rests:
        return None if daq_zeros is None else _without_rest(daq_zeros)
    step_s = float(table.index[1] - table.index[0])
    before, after = _around_flight(table, rests, flying_Pa)
    value, error, drift, drift_error, drifting = {}, {}, {}, {}, {}
    notes: list[str] = []
    for name in CHANNELS:
        value[name], error[name] = mean_at_rest(table[name], rests, step_s)
        (first, first_error), (last, last_error) = (mean_at_rest(table[name], some, step_s) for some in (before, after))
        drift[name] = last - first if before and after else 0.0
        drift_error[name] = float(np.hypot(first_error, last_error)) if before and after else float("nan")
        if abs(drift[name]) > REST.significant_drift * drift_error[name]:
            drifting[name] = np.array([_middle(table, before), _middle(table, after)]), np.array([first, last])
            notes.append(
                f"The zero of {_channel_name(name)} moved by {_with_unit(name, drift[name], drift_error[name])} between"
                " rest before and after the flight. This is corrected linearly over the flight."
                + (" Wind on the probe at rest has the same effect." if name == "q_c_Pa" else "")
            )
        if table[name].iloc[np.r_[tuple(rests)]].isna().all():
            value[name], error[name] = 0.0, float("nan")
    if not (before and after):
        side = "before" if before else "after"
        notes.append(f"The aircraft stood still only {side} the flight: the drift of the zeros is not known.")
    for name in CHANNELS if daq_zeros else ():
        notes += _disagreement(name, value[name], (daq_zeros or {}).get(name))
    seconds = sum(s.stop - s.start for s in rests) * step_s
    return Zeros(value, error, drift, seconds, drift_error, drifting, notes)


def without_zeros(table: pd.DataFrame, zeros: Zeros | None) -> tuple[pd.DataFrame, list[str]]:
    """Return the table with the zeros subtracted, and notes on them."""
    if zeros is None:
        return table, ["The aircraft never stood still in this log: zeros of transducers and gyros are not corrected."]
    t_s = table.index.to_numpy()
    return table.assign(**{name: table[name] - zeros.at(name, t_s) for name in zeros.value}), zeros.notes


def _without_rest(daq_zeros: dict[str, float]) -> Zeros:
    """Return the zeros measured by `daq zero`, for a log without rest."""
    missing = [_channel_name(name) for name in CHANNELS if name not in daq_zeros]
    notes = ["The aircraft never stood still in this log: the zeros are those taken by `daq zero`."]
    if missing:
        notes.append(f"`daq zero` took no zero of {', '.join(missing)}, which are not corrected.")
    value = {name: daq_zeros.get(name, 0.0) for name in CHANNELS}
    unknown = dict.fromkeys(CHANNELS, float("nan"))
    return Zeros(value, unknown, dict.fromkeys(CHANNELS, 0.0), 0.0, unknown, {}, notes)


def _around_flight(table: pd.DataFrame, rests: list[slice], flying_Pa: float) -> tuple[list[slice], list[slice]]:
    """Return the rests before the first flight in the log, and those after the last flight."""
    step_s = float(table.index[1] - table.index[0])
    rest = table["q_c_Pa"].iloc[np.r_[tuple(rests)]].mean()
    window = max(1, round(REST.flying_s / step_s))
    flown = np.flatnonzero(table["q_c_Pa"].rolling(window, min_periods=1, center=True).mean() - rest > flying_Pa)
    if not len(flown):
        return rests, []
    return [s for s in rests if s.stop <= flown[0]], [s for s in rests if s.start >= flown[-1]]


def mean_at_rest(column: pd.Series, rows: list[slice], step_s: float) -> tuple[float, float]:
    """Return the mean and its standard error, from the scatter of block means; NaN with fewer than two samples."""
    block = max(1, round(REST.window_s / step_s))
    parts = [column.iloc[s].dropna().to_numpy() for s in rows]
    samples = np.concatenate([*parts, np.empty(0)])
    if len(samples) < 2:
        return float("nan"), float("nan")
    blocks = [part[: len(part) // block * block].reshape(-1, block).mean(axis=1) for part in parts]
    means = np.concatenate(blocks)
    if len(means) < REST.fewest_blocks:
        return float(samples.mean()), float(samples.std(ddof=1) / np.sqrt(len(samples)))
    return float(samples.mean()), float(means.std(ddof=1) / np.sqrt(len(means)))


def _middle(table: pd.DataFrame, rows: list[slice]) -> float:
    return float(np.mean(table.index.to_numpy()[np.r_[tuple(rows)]]))


def _disagreement(name: str, rest: float, daq_zero: float | None) -> list[str]:
    if daq_zero is None or not abs(rest - daq_zero) > REST.zero_drift[_unit(name)]:
        return []
    wind = " Was there wind on the probe at one of them?" if _unit(name) == "Pa" else ""
    return [
        f"The zero of {_channel_name(name)} is {_with_unit(name, rest)} at rest in this log, but"
        f" {_with_unit(name, daq_zero)} by `daq zero`. That of the log is used.{wind}"
    ]


def _unit(name: str) -> str:
    return "Pa" if name.endswith("_Pa") else "rad/s"


def _channel_name(name: str) -> str:
    topic, _ = COLUMNS[name]
    return topic if topic != "/imu" else f"gyro {name[0]}"


def _with_unit(name: str, value: float, error: float | None = None) -> str:
    scale, unit = (1.0, "Pa") if _unit(name) == "Pa" else (float(np.degrees(1)), "deg/s")
    text = f"{scale * value:+.2f}"
    return f"{text} {unit}" if error is None else f"{text} ± {scale * error:.2f} {unit}"


class Reading(msgspec.Struct, frozen=True):
    """Readings of one field of one topic."""

    mean: float
    standard_deviation: float
    samples: int


class StillAirZero(msgspec.Struct, frozen=True):
    """The content of `zero.json`. readings: by topic and field"""

    format: str
    readings: dict[str, dict[str, Reading]]

    def by_channel(self) -> dict[str, float]:
        """Return the mean reading of each of CHANNELS that was measured."""
        fields = {name: COLUMNS[name] for name in CHANNELS}
        return {
            name: self.readings[topic][field].mean
            for name, (topic, field) in fields.items()
            if field in self.readings.get(topic, {})
        }


ZERO_FILE = JsonFormat(StillAirZero, ("flightpower-zero-1",), "a still-air zero")
