"""Pressures that were held on the three differential transducers at the same time, found in a log."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.settings import GROUND
from flight.errors import InputError
from flight.log_entries import NO_ENTRIES
from flight.log_reader import Log
from flight.messages import DifferentialPressure, Status

Array = NDArray[np.float64]

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
    """Readings of CHANNELS [Pa] at the times of the airspeed's, index t_s; NaN where one failed or was out of range.

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
    together = {
        name: series.reindex(at_ns, method="nearest", tolerance=step_ns).to_numpy() for name, series in columns.items()
    }
    return pd.DataFrame(together, index=pd.Index((at_ns - at_ns[0]) / 1e9, name="t_s"))


def plateaus(table: pd.DataFrame, source: str) -> list[Plateau]:
    """Pressures that are held, in order of time; the first one has open tubes. table: of `readings`.

    Raises InputError for a plateau beyond the range of a transducer.
    """
    t_s = table.index.to_numpy()
    if len(t_s) < 2 or t_s[-1] - t_s[0] < GROUND.held_s[0]:
        return []
    step_s = float(np.median(np.diff(t_s)))
    window = max(1, round(GROUND.settling_s / step_s))
    seen = table["airspeed"].dropna().to_numpy()
    noise_Pa = float(1.4826 * np.median(np.abs(np.diff(seen))) / np.sqrt(2))
    allowed_Pa = max(GROUND.steady_Pa, GROUND.steady_noises * noise_Pa / np.sqrt(window))
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
    """The plateaus with their times, to be matched with the pressures written down; those at zero without a number."""
    words, number = [], 0
    for plateau in plateaus:
        at = f"at {plateau.start_s:.0f} s"
        number += not plateau.open
        words.append(f"zero {at}" if plateau.open else f"{number}: {plateau.readings_Pa[-1]:.0f} Pa {at}")
    return ", ".join(words) or "none"
