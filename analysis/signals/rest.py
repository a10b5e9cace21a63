"""Finds where the aircraft stood still, and what its sensors read there: zeros that need no ground crew.

A log that never stands may carry what `daq zero` measured instead; one that stands is compared with it. Zeros before
and after the flight may differ: transducers warm up. What they moved is said, and taken out linearly over the flight
where it is more than noise.
"""

from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.signals.stretches import stretches
from analysis.signals.synchronize import COLUMNS
from flight.errors import InputError
from flight.json_file import decoded

Array = NDArray[np.float64]

WINDOW_S = 1.0
SHORTEST_S = 4.0
# Standing with the motor off. Bench noise is 0.005 rad/s and 0.06 m/s^2 (Table 4.1); gusts on the ground shake more.
RATE_SPREAD_RADPS = 0.03
FORCE_SPREAD_MPS2 = 0.5
MOTOR_REVPS = 1.0
AIRSPEED_SPREAD_PA = 8.0
CHANNELS = ("p_radps", "q_radps", "r_radps", "dp_alpha_Pa", "dp_beta_Pa", "q_c_Pa")
BLOCK_S = 1.0  # means over so long scatter as much as they err, coloured noise included
FEWEST_BLOCKS = 8
FLYING_PA, FLYING_S = 30.0, 2.0  # above its zero, for so long: 7 m/s at sea level is no wind on the ground
SIGNIFICANT = 4.0  # standard errors, of a drift
# A zero taken on another day may differ by the part's drift with temperature: within this it agrees. MPU-9250 PS 3.1:
# 30 deg/s over the range, here 10 K; MS4515DO and SSC: 1 % and 2 % of the span over theirs.
AGREES = {"Pa": 3.0, "rad/s": 0.01}
ZERO_FORMAT = "flightpower-zero-1"


class Zeros(NamedTuple):
    """What each of CHANNELS reads at rest, in its unit."""

    value: dict[str, float]  # mean over all rest
    standard_error: dict[str, float]
    drift: dict[str, float]  # after the flight less before it; 0 where it stood on one side only
    seconds: float  # of standing still in all
    drift_error: dict[str, float]
    moved: dict[str, tuple[Array, Array]]  # by channel that drifted: times [s] and zeros there, before and after
    notes: list[str]

    def at(self, name: str, t_s: Array) -> Array:
        """The zero of a channel over time: one number, or a straight line from before the flight to after it."""
        if name in self.moved:
            return np.interp(t_s, *self.moved[name])
        return np.full(len(t_s), self.value[name])


def rest_segments(table: pd.DataFrame, rate_Hz: float) -> list[slice]:
    """Stretches (as row slices) in which the aircraft stood with its motor off, each SHORTEST_S at least."""
    window = max(3, round(WINDOW_S * rate_Hz))
    spread = table.rolling(window, center=True, min_periods=window // 2).std()
    still = (table["n_revps"].fillna(0) < MOTOR_REVPS) & (spread["q_c_Pa"] < AIRSPEED_SPREAD_PA)
    for name in ("p_radps", "q_radps", "r_radps"):
        still &= spread[name] < RATE_SPREAD_RADPS
    for name in ("ax_mps2", "ay_mps2", "az_mps2"):
        still &= spread[name] < FORCE_SPREAD_MPS2
    margin = window // 2  # the window has already seen what comes next
    found = [slice(s.start + margin, s.stop - margin) for s in stretches(still.to_numpy())]
    return [s for s in found if s.stop - s.start >= SHORTEST_S * rate_Hz]


def zeros(table: pd.DataFrame, still: list[slice], taken: dict[str, float] | None = None) -> Zeros | None:
    """What the sensors read at rest; None if the log has no rest in it and carries no zero.

    taken: by channel, the still-air zero that the log carries (`zero_of_attachment`).
    """
    if not still:
        return None if taken is None else _as_taken(taken)
    step_s = float(table.index[1] - table.index[0])
    before, after = _around_flight(table, still)
    value, error, drift, drift_error, moved = {}, {}, {}, {}, {}
    notes: list[str] = []
    for name in CHANNELS:
        value[name], error[name] = _mean(table[name], still, step_s)
        (first, first_error), (last, last_error) = (_mean(table[name], some, step_s) for some in (before, after))
        drift[name] = last - first if before and after else 0.0
        drift_error[name] = float(np.hypot(first_error, last_error)) if before and after else float("nan")
        if abs(drift[name]) > SIGNIFICANT * drift_error[name]:
            moved[name] = np.array([_middle(table, before), _middle(table, after)]), np.array([first, last])
            notes.append(
                f"The zero of {_called(name)} moved by {_in_words(name, drift[name], drift_error[name])} between"
                " standing before and after the flight: taken out linearly over the flight."
                + (" Wind on the probe while it stood looks the same." if name == "q_c_Pa" else "")
            )
        if table[name].iloc[np.r_[tuple(still)]].isna().all():
            value[name], error[name] = 0.0, float("nan")
    if not (before and after):
        side = "before" if before else "after"
        notes.append(f"The aircraft stood still only {side} the flight: drift of the zeros is not known.")
    for name in CHANNELS if taken else ():
        notes += _disagreement(name, value[name], (taken or {}).get(name))
    seconds = sum(s.stop - s.start for s in still) * step_s
    return Zeros(value, error, drift, seconds, drift_error, moved, notes)


class _Reading(msgspec.Struct):
    mean: float
    standard_deviation: float
    samples: int


class _ZeroFile(msgspec.Struct):
    format: str
    readings: dict[str, dict[str, _Reading]]


def zero_of_attachment(data: bytes | None, where: str) -> dict[str, float] | None:
    """By channel, what `daq zero` measured: the attachment `zero.json` of a log, None if there is none.

    Raises InputError naming `where` when it is no zero.
    """
    if data is None:
        return None
    zero = decoded(data, _ZeroFile, (ZERO_FORMAT,), where, "a still-air zero")
    found = {}
    for name in CHANNELS:
        topic, field = COLUMNS[name]
        if field in zero.readings.get(topic, {}):
            found[name] = zero.readings[topic][field].mean
    return found


def load_zero(path: Path) -> dict[str, float]:
    """The same from a file that `daq zero` wrote. Raises InputError naming it."""
    try:
        return zero_of_attachment(path.read_bytes(), str(path)) or {}
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def _as_taken(taken: dict[str, float]) -> Zeros:
    """The zeros of `daq zero`, for a log without rest."""
    missing = [_called(name) for name in CHANNELS if name not in taken]
    notes = ["The aircraft never stood still in this log: zeros are those that `daq zero` took before."]
    if missing:
        notes.append(f"Nor did `daq zero` take {', '.join(missing)}: taken as they come.")
    value = {name: taken.get(name, 0.0) for name in CHANNELS}
    nobody = dict.fromkeys(CHANNELS, float("nan"))
    return Zeros(value, nobody, dict.fromkeys(CHANNELS, 0.0), 0.0, nobody, {}, notes)


def _around_flight(table: pd.DataFrame, still: list[slice]) -> tuple[list[slice], list[slice]]:
    """Which rests lie before the first flight in the log, and which after the last."""
    step_s = float(table.index[1] - table.index[0])
    rest = table["q_c_Pa"].iloc[np.r_[tuple(still)]].mean()
    window = max(1, round(FLYING_S / step_s))
    flown = np.flatnonzero(table["q_c_Pa"].rolling(window, min_periods=1, center=True).mean() - rest > FLYING_PA)
    if not len(flown):
        return still, []
    return [s for s in still if s.stop <= flown[0]], [s for s in still if s.start >= flown[-1]]


def _mean(column: pd.Series, rows: list[slice], step_s: float) -> tuple[float, float]:
    """Mean and its standard error, by means over blocks; NaN where there is nothing."""
    block = max(1, round(BLOCK_S / step_s))
    parts = [column.iloc[s].dropna().to_numpy() for s in rows]
    samples = np.concatenate([*parts, np.empty(0)])
    if len(samples) < 2:
        return float("nan"), float("nan")
    whole = [part[: len(part) // block * block].reshape(-1, block).mean(axis=1) for part in parts]
    means = np.concatenate(whole)
    if len(means) < FEWEST_BLOCKS:
        return float(samples.mean()), float(samples.std(ddof=1) / np.sqrt(len(samples)))
    return float(samples.mean()), float(means.std(ddof=1) / np.sqrt(len(means)))


def _middle(table: pd.DataFrame, rows: list[slice]) -> float:
    return float(np.mean(table.index.to_numpy()[np.r_[tuple(rows)]]))


def _disagreement(name: str, rest: float, taken: float | None) -> list[str]:
    if taken is None or not abs(rest - taken) > AGREES[_unit(name)]:
        return []
    wind = " Wind on the probe, at one of the two?" if _unit(name) == "Pa" else ""
    return [
        f"The zero of {_called(name)} is {_in_words(name, rest)} at rest in this log, but `daq zero` took"
        f" {_in_words(name, taken)}: that of the log is used.{wind}"
    ]


def _unit(name: str) -> str:
    return "Pa" if name.endswith("_Pa") else "rad/s"


def _called(name: str) -> str:
    topic, _ = COLUMNS[name]
    return topic if topic != "/imu" else f"gyro {name[0]}"


def _in_words(name: str, value: float, error: float | None = None) -> str:
    scale, unit = (1.0, "Pa") if _unit(name) == "Pa" else (float(np.degrees(1)), "deg/s")
    text = f"{scale * value:+.2f}"
    return f"{text} {unit}" if error is None else f"{text} ± {scale * error:.2f} {unit}"
