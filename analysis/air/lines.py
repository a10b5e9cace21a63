"""Corrects measured pressures for the dynamic response of the probe's pneumatic lines.

Most of the response is a delay, which `synchronize` takes out with the other delays. The remainder attenuates high
frequencies. It is divided out only for lines so long and narrow that the gain is worth the additional noise
(docs/use/calibration.md).
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.air.settings import LAG
from flightpower.analysis.air.tubing import ComplexArray, Gas, air, low_frequency_lag_s, remainder_of
from flightpower.analysis.sources.daemon import field_of
from flightpower.analysis.sources.grid import stretches
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import SEA_LEVEL_PRESSURE_PA, SEA_LEVEL_TEMPERATURE_K
from flightpower.flight.log_reader import Log

TOPIC = {"alpha": "/probe/alpha", "beta": "/probe/beta", "airspeed": "/probe/airspeed", "static": "/static"}
COLUMN = {"alpha": "dp_alpha_Pa", "beta": "dp_beta_Pa", "airspeed": "q_c_Pa", "static": "static_Pa"}
FIELD = {
    "alpha": "differential_pressure_Pa",
    "beta": "differential_pressure_Pa",
    "airspeed": "differential_pressure_Pa",
    "static": "pressure_Pa",
}


class LineResponse(NamedTuple):
    """The response of one line in the air of a flight.

    topic, column : of its transducer     lag_s : for slow changes
    remainder : response without that lag, as a function of frequency [Hz]
    """

    topic: str
    column: str
    lag_s: float
    remainder: Callable[[Array], ComplexArray]


def air_in(log: Log) -> Gas:
    """The air in the lines, at the log's median static pressure and temperature; at sea level if it has none."""
    pressure, kelvin = (field_of(log, TOPIC["static"], field)[1] for field in ("pressure_Pa", "temperature_K"))
    return air(
        float(np.median(pressure)) if len(pressure) else SEA_LEVEL_PRESSURE_PA,
        float(np.median(kelvin)) if len(kelvin) else SEA_LEVEL_TEMPERATURE_K,
    )


def line_responses(log: Log, aircraft: Aircraft) -> list[LineResponse]:
    """The lines of an aircraft for which TOPIC names a transducer, in the air of a log."""
    gas = air_in(log)
    return [
        LineResponse(TOPIC[name], COLUMN[name], low_frequency_lag_s([line], gas), remainder_of(line, gas))
        for name, line in aircraft.probe.lines.items()
        if name in TOPIC and line.length_m > 0
    ]


def without_remainder(table: pd.DataFrame, lines: Sequence[LineResponse]) -> tuple[pd.DataFrame, list[str]]:
    """The table with the remainder of each long and narrow line divided out, and notes on it.

    table: from `synchronize` with the lags of the lines, so delays have been removed. Gaps stay gaps.
    """
    rate_Hz = 1 / float(table.index[1] - table.index[0])
    out, notes = table, []
    for topic, column, _, remainder in lines:
        change = float(np.abs(1 - remainder(np.array([LAG.highest_Hz])))[0])
        if change > LAG.smallest_remainder:
            values = inverted(table[column].to_numpy(dtype=float), rate_Hz, remainder, LAG.largest_gain)
            out = out.assign(**{column: values})
            notes.append(
                f"The line of {topic} is long and narrow: it changes a wave of {LAG.highest_Hz:g} Hz by"
                f" {100 * change:.0f} %. This is corrected; noise grows by a factor of {LAG.largest_gain:g} at most."
            )
    return out, notes


def inverted(values: Array, rate_Hz: float, response_of: Callable[[Array], ComplexArray], largest_gain: float) -> Array:
    """The input of a linear system, (n,), from its output `values` (n,) and its frequency response; NaN stays NaN.

    response_of: function of frequency [Hz]. `values` are divided by the response where its magnitude is above
    1/largest_gain; where it is smaller, the gain falls with it. No frequency is amplified by more than `largest_gain`,
    and steady values are unchanged. Each stretch between gaps is treated separately and extended beyond its ends by odd
    reflection.
    """
    out = values.copy()
    for rows in stretches(np.isfinite(values)):
        n = rows.stop - rows.start
        if n < 16:
            continue
        pad = min(n - 1, round(2 * rate_Hz))
        x = np.pad(values[rows], pad, mode="reflect", reflect_type="odd")
        trend = np.linspace(x[0], x[-1], len(x))  # subtracted, so that end and beginning meet
        spectrum = np.fft.rfft(x - trend)
        f: Array = np.asarray(np.fft.rfftfreq(len(x), 1 / rate_Hz), dtype=float)
        spectrum *= bounded_inverse(response_of(f), largest_gain)
        out[rows] = (np.fft.irfft(spectrum, len(x)) + trend)[pad : pad + n]
    return out


def bounded_inverse(H: ComplexArray, largest_gain: float) -> ComplexArray:
    """1/H, but never larger than `largest_gain`: conj(H) / max(|H|^2, 1/largest_gain^2)."""
    return np.asarray(np.conj(H) / np.maximum(np.abs(H) ** 2, 1 / largest_gain**2))
