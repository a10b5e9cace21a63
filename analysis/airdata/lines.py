"""Takes out of the measured pressures what the probe's lines did to them.

Nearly all of it is a delay, which `synchronize` takes out with all the others. What is left, slow waves passing a
little better than quick ones, is divided out where a line is so long and narrow that it is worth the noise
(docs/calibration.md).
"""

from collections.abc import Callable
from statistics import median

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.tubing import ComplexArray, Gas, air, low_frequency_lag_s, response
from analysis.signals.stretches import stretches
from flight.aircraft import Aircraft, PneumaticLine
from flight.atmosphere import SEA_LEVEL_PRESSURE_PA, SEA_LEVEL_TEMPERATURE_K
from flight.log_reader import Log
from flight.messages import AbsolutePressure, Status

Array = NDArray[np.float64]

TOPIC = {"alpha": "/probe/alpha", "beta": "/probe/beta", "airspeed": "/probe/airspeed", "static": "/static"}
COLUMN = {"alpha": "dp_alpha_Pa", "beta": "dp_beta_Pa", "airspeed": "q_c_Pa", "static": "static_Pa"}
FIELD = {
    "alpha": "differential_pressure_Pa",
    "beta": "differential_pressure_Pa",
    "airspeed": "differential_pressure_Pa",
    "static": "pressure_Pa",
}
LARGEST_GAIN = 1.5  # noise of no frequency grows by more than this
QUICKEST_HZ = 3.0  # the aircraft's own motion: three times its short period
# Of the pressure at that frequency, which a line of some 40 ms takes. On simulated flights what a delay leaves of 25 ms
# is 0.01 Pa in calm air and 0.5 Pa of 6 Pa of noise in gusts, while dividing it out adds a fifth to the noise.
WORTH = 0.25
SHORTEST = 16  # samples


def air_in(log: Log) -> Gas:
    """What filled the lines, by the log's own static pressure and temperature; sea level where it has none."""
    good = [e.message for e in log.entries.get(TOPIC["static"], []) if e.message.status is Status.OK]
    pressure = [m.pressure_Pa for m in good if isinstance(m, AbsolutePressure) and m.pressure_Pa is not None]
    kelvin = [m.temperature_K for m in good if isinstance(m, AbsolutePressure) and m.temperature_K is not None]
    return air(
        median(pressure) if pressure else SEA_LEVEL_PRESSURE_PA, median(kelvin) if kelvin else SEA_LEVEL_TEMPERATURE_K
    )


def lags_s(aircraft: Aircraft, gas: Gas) -> dict[str, float]:
    """By topic, the lag of each line for slow changes [s]."""
    return {
        TOPIC[name]: low_frequency_lag_s([line], gas) for name, line in aircraft.probe.lines.items() if name in TOPIC
    }


def sharpened(table: pd.DataFrame, aircraft: Aircraft, gas: Gas) -> tuple[pd.DataFrame, list[str]]:
    """The table with the remainder of each long and narrow line taken out, and what was done in words.

    table: delays are taken out already, by `lags_s`; gaps stay gaps.
    """
    rate_Hz = 1 / float(table.index[1] - table.index[0])
    out, notes = table, []
    for name, line in aircraft.probe.lines.items():
        if name not in COLUMN or line.length_m <= 0:
            continue
        remainder = undelayed(line, gas)
        blunt = float(np.abs(1 - remainder(np.array([QUICKEST_HZ])))[0])
        if blunt > WORTH:
            values = undone(table[COLUMN[name]].to_numpy(dtype=float), rate_Hz, remainder, LARGEST_GAIN)
            out = out.assign(**{COLUMN[name]: values})
            notes.append(
                f"The line of {TOPIC[name]} is long and narrow: it changes a wave of {QUICKEST_HZ:g} Hz by"
                f" {100 * blunt:.0f} %. That is taken out; noise grows by a factor of {LARGEST_GAIN:g} at most."
            )
    return out, notes


def undelayed(line: PneumaticLine, gas: Gas) -> Callable[[Array], ComplexArray]:
    """The line's response less its lag for slow changes, as a function of frequency [Hz]."""
    lag_s = low_frequency_lag_s([line], gas)
    return lambda f: response([line], f, gas) * np.exp(2j * np.pi * f * lag_s)


def undone(values: Array, rate_Hz: float, of: Callable[[Array], ComplexArray], largest_gain: float) -> Array:
    """The input that a response `of` turned into `values`, as far as noise allows; NaN stays NaN.

    Divides by the response where it is above 1/largest_gain, and falls back towards nothing below: no frequency grows
    by more than `largest_gain`, steady values stay as they are. Each stretch between gaps is taken by itself, continued
    beyond its ends by its own odd reflection.
    """
    out = values.copy()
    for rows in stretches(np.isfinite(values)):
        n = rows.stop - rows.start
        if n < SHORTEST:
            continue
        pad = min(n - 1, round(2 * rate_Hz))
        x = np.pad(values[rows], pad, mode="reflect", reflect_type="odd")
        trend = np.linspace(x[0], x[-1], len(x))  # so that end and beginning meet
        spectrum = np.fft.rfft(x - trend)
        spectrum *= bounded_inverse(of(np.asarray(np.fft.rfftfreq(len(x), 1 / rate_Hz), dtype=float)), largest_gain)
        out[rows] = (np.fft.irfft(spectrum, len(x)) + trend)[pad : pad + n]
    return out


def bounded_inverse(H: ComplexArray, largest_gain: float) -> ComplexArray:
    """1/H, but never larger than `largest_gain`: conj(H) / max(|H|^2, 1/largest_gain^2)."""
    return np.conj(H) / np.maximum(np.abs(H) ** 2, 1 / largest_gain**2)
