"""Slope and offset of the differential pressure transducers, from the same pressures applied to all three of them.

A T-piece connects the three to a water column, or to a syringe with a reference manometer. Each pressure is held, so
that the log has a plateau for it: reading = offset + slope * pressure. Errors of the reference's readings act on all
three transducers and are part of the residuals; an error of its scale shows in no residual and is given by the user.

For the interval, air data are also computed as they would be with more hysteresis, or with a zero that changes.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple, TypeVar

import msgspec
import numpy as np
import pandas as pd

from flightpower.analysis.air.settings import GROUND
from flightpower.analysis.sources.grid_settings import REST
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.files import JsonFormat
from flightpower.flight.log_entries import NO_ENTRIES
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import DifferentialPressure, Status

CHANNELS = ("alpha", "beta", "airspeed")


class Plateau(NamedTuple):
    """A pressure that was held: times [s] from the log's first reading, mean readings (3,) in the order of CHANNELS.

    open : whether the tubes were open
    """

    start_s: float
    end_s: float
    readings_Pa: tuple[float, float, float]
    open: bool


def readings(log: Log) -> pd.DataFrame:
    """Readings of CHANNELS [Pa] at the airspeed's times, index t_s; NaN where a reading failed or was out of range.

    Raises InputError naming a transducer that the log lacks.
    """
    columns: dict[str, pd.Series] = {}
    for name in CHANNELS:
        entries = log.entries.get(f"/probe/{name}", NO_ENTRIES)
        times_ns = [entry.time_ns for entry in entries]
        messages = [entry.message for entry in entries]
        values = [
            message.differential_pressure_Pa
            if isinstance(message, DifferentialPressure) and message.status is Status.OK
            else None
            for message in messages
        ]
        series = pd.Series(np.array(values, dtype=float), np.array(times_ns, dtype=np.int64))
        if series.isna().all():
            raise InputError(f"{log.path}: no reading of /probe/{name} in this log; all three transducers are needed")
        columns[name] = series[~series.index.duplicated()]
    at_ns = np.asarray(columns["airspeed"].index, dtype=np.int64)
    step_ns = int(np.median(np.diff(at_ns))) if len(at_ns) > 1 else 1
    table = {
        name: series.reindex(at_ns, method="nearest", tolerance=step_ns).to_numpy() for name, series in columns.items()
    }
    return pd.DataFrame(table, index=pd.Index((at_ns - at_ns[0]) / 1e9, name="t_s"))


def plateaus(table: pd.DataFrame, source: str) -> list[Plateau]:
    """Pressures that are held, in order of time; the first one has open tubes. table: from `readings`.

    Raises InputError for a plateau beyond the range of a transducer.
    """
    t_s = table.index.to_numpy()
    if len(t_s) < 2 or t_s[-1] - t_s[0] < GROUND.held_s[0]:
        return []
    step_s = float(np.median(np.diff(t_s)))
    window = max(1, round(GROUND.settling_s / step_s))
    seen = table["airspeed"].dropna().to_numpy()
    noise_Pa = float(1.4826 * np.median(np.abs(np.diff(seen))) / np.sqrt(2))
    allowed_Pa = max(REST.zero_drift["Pa"], GROUND.steady_noises * noise_Pa / np.sqrt(window))
    smooth = table["airspeed"].rolling(window, center=True, min_periods=1).mean().to_numpy()
    spans = [
        (a, b)
        for a, b in steady_stretches(smooth, allowed_Pa, round(GROUND.reference_s / step_s))
        if t_s[b] - t_s[a] >= GROUND.held_s[0]
    ]
    plateaus = []
    for first, last in spans:
        inside = table.loc[t_s[first] + GROUND.settling_s : t_s[last] - GROUND.settling_s]
        for name in CHANNELS:
            if inside[name].notna().mean() < GROUND.fewest_good:
                raise InputError(
                    f"{source}: /probe/{name} has no good readings at {t_s[first]:.0f} s: beyond its range; stay"
                    " within that of all three transducers"
                )
        means = inside.mean()
        values = (float(means["alpha"]), float(means["beta"]), float(means["airspeed"]))
        plateaus.append(Plateau(float(t_s[first]), float(t_s[last]), values, open=False))
    if not plateaus:
        return []
    zero = plateaus[0].readings_Pa[-1]
    return [plateau._replace(open=abs(plateau.readings_Pa[-1] - zero) <= allowed_Pa) for plateau in plateaus]


def steady_stretches(values: Array, allowed: float, reference: int) -> list[tuple[int, int]]:
    """First and last row of stretches whose values stay within `allowed` of the median of their first rows."""
    stretches, start = [], 0
    middle = values[0]
    for i in range(1, len(values) + 1):
        if i - start <= reference:
            middle = np.nanmedian(values[start : max(i, start + 1)]) if np.isfinite(values[start:i]).any() else np.nan
        if i < len(values) and not abs(values[i] - middle) > allowed:
            continue
        stretches.append((start, i - 1))
        start = i
        middle = values[min(i, len(values) - 1)]
    return stretches


def in_words(plateaus: Sequence[Plateau]) -> str:
    """The plateaus and their times, to match with the pressures written down; plateaus at zero have no number."""
    words, number = [], 0
    for plateau in plateaus:
        start_text = f"at {plateau.start_s:.0f} s"
        number += not plateau.open
        words.append(
            f"zero {start_text}" if plateau.open else f"{number}: {plateau.readings_Pa[-1]:.0f} Pa {start_text}"
        )
    return ", ".join(words) or "none"


Reading = TypeVar("Reading", float, pd.Series)

FORMAT = "flightpower-transducers-1"


class TransducerLine(msgspec.Struct, frozen=True, kw_only=True):
    """The straight line of one transducer: reading = offset + slope * pressure."""

    slope: float
    slope_error: float  # 1 sigma, with the error of the reference
    offset_Pa: float
    largest_residual_Pa: float
    largest_Pa: float  # pressure to which the line was measured


class TransducerCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """The content of `transducers.json`."""

    format: str = FORMAT
    source: str
    plateaus: int
    reference_error: float  # 1 sigma of the reference's scale, as given
    alpha: TransducerLine
    beta: TransducerLine
    airspeed: TransducerLine
    airspeed_scale: float  # fraction by which airspeed reads high without this calibration
    airspeed_scale_error: float  # 1 sigma

    def line(self, name: str) -> TransducerLine:
        """The line called "alpha", "beta" or "airspeed"."""
        return {"alpha": self.alpha, "beta": self.beta, "airspeed": self.airspeed}[name]

    def corrected(self, table: pd.DataFrame) -> pd.DataFrame:
        """The table with dp_alpha_Pa, dp_beta_Pa and q_c_Pa corrected to the pressures that the reference measures."""
        columns = {column: self.pressure_Pa(column, table[column]) for column in COLUMN_OF.values()}
        return table.assign(**columns)

    def corrected_zero(self, zero: Mapping[str, float]) -> dict[str, float]:
        """Correct zeros read in still air, by column, in the same way; other columns stay."""
        named = COLUMN_OF.values()
        return {name: self.pressure_Pa(name, value) if name in named else value for name, value in zero.items()}

    def pressure_Pa(self, column: str, reading: Reading) -> Reading:
        """The pressure at which the transducer of a column has this reading [Pa]."""
        line = next(self.line(name) for name, its_column in COLUMN_OF.items() if its_column == column)
        return (reading - line.offset_Pa) / line.slope


COLUMN_OF = {"alpha": "dp_alpha_Pa", "beta": "dp_beta_Pa", "airspeed": "q_c_Pa"}


def _check(calibration: TransducerCalibration, where: str) -> None:
    for name in CHANNELS:
        line = calibration.line(name)
        if not abs(line.slope - 1) <= GROUND.largest_gain_error or not 0 < line.slope_error < GROUND.largest_gain_error:
            raise InputError(
                f"{where}: not a transducer calibration ({name}: slope {line.slope:g} ± {line.slope_error:g})"
            )
    if not 0 < calibration.airspeed_scale_error < GROUND.largest_gain_error:
        raise InputError(
            f"{where}: not a transducer calibration (airspeed_scale_error {calibration.airspeed_scale_error:g})"
        )


TRANSDUCERS_FILE = JsonFormat(TransducerCalibration, (FORMAT,), "a transducer calibration", _check)


class AirDataErrors(NamedTuple):
    """Standard errors, as fractions, of the air data that the transducers' slopes affect."""

    V_scale: float
    alpha_scale: float


def air_data_errors(calibration: TransducerCalibration) -> AirDataErrors:
    """Errors of airspeed and of the slope of angle of attack, from the errors of the transducers' slopes."""
    return AirDataErrors(calibration.airspeed_scale_error, calibration.alpha.slope_error / calibration.alpha.slope)


AIR_DATA_CHANNELS = ("q_c_Pa", "dp_alpha_Pa")


def with_hysteresis(air: pd.DataFrame, channel: str, fraction: float) -> pd.DataFrame:
    """Air data (`air_data`) with hysteresis of one of AIR_DATA_CHANNELS, to first order.

    fraction : width of the hysteresis over the range of the pressure in flight. The reading lags half the width behind
    the pressure (play operator).
    """
    smooth = _smooth(air[channel].interpolate(limit_direction="both"), air)
    width = fraction * float(np.ptp(smooth[air["V_mps"].notna()]))
    return _with_change(air, channel, play(smooth.to_numpy(), width) - smooth.to_numpy())


def with_zero_step(air: pd.DataFrame, channel: str, step_Pa: float) -> pd.DataFrame:
    """Air data (`air_data`) with a step [Pa] of the zero of one of AIR_DATA_CHANNELS in the middle of the flight, to
    first order: readings are too low by half of it before, and too high by half of it after."""
    flying = air.index[air["V_mps"].notna()]
    later = air.index.to_numpy() > (flying[0] + flying[-1]) / 2
    return _with_change(air, channel, np.where(later, step_Pa / 2, -step_Pa / 2))


def _smooth(pressure: pd.Series, air: pd.DataFrame) -> pd.Series:
    # Averages over a second, because noise of the electronics does not move the membrane.
    window = max(1, round(1.0 / float(air.index[1] - air.index[0])))
    return pressure.rolling(window, center=True, min_periods=1).mean()


def _with_change(air: pd.DataFrame, channel: str, change_Pa: Array) -> pd.DataFrame:
    """Air data with a change (n,) of a pressure. Angle of attack is proportional to its pressure over dynamic
    pressure."""
    flying = air["V_mps"].notna()
    q_c = _smooth(air["q_c_Pa"], air).where(flying)
    relative = change_Pa / q_c
    if channel == "q_c_Pa":
        V, alpha = air["V_mps"] * (1 + relative / 2), air["alpha_rad"] * (1 - relative)
        return air.assign(V_mps=V, qbar_Pa=air["qbar_Pa"] * (1 + relative), alpha_rad=alpha)
    finite = flying & air["alpha_rad"].notna() & q_c.notna()
    slope, _ = np.polyfit((air["dp_alpha_Pa"] / q_c)[finite], air["alpha_rad"][finite], 1)
    return air.assign(alpha_rad=air["alpha_rad"] + slope * relative)


def play(x: Array, width: float) -> Array:
    """The play operator over x (n,): the output stays within half the width of x."""
    y, position = np.empty_like(x), float(x[0])
    for i, value in enumerate(x.tolist()):
        position = min(max(position, value - width / 2), value + width / 2)
        y[i] = position
    return y
