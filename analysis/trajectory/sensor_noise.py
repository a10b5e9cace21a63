"""Noise of the sensors, measured while the aircraft is at rest."""

import numpy as np
import pandas as pd

from analysis.signals.rest import mean_at_rest

# Standard deviations of one sample where the log has no rest.
BENCH_SIGMA = {
    "p_radps": 0.005, "q_radps": 0.005, "r_radps": 0.005, "ax_mps2": 0.06, "ay_mps2": 0.06, "az_mps2": 0.06,
    "dp_alpha_Pa": 6.0, "dp_beta_Pa": 6.0, "q_c_Pa": 6.0, "static_Pa": 6.0,
}  # fmt: skip
ZEROS = {"dp_alpha_zero": "dp_alpha_Pa", "q_c_zero": "q_c_Pa"}  # sensor errors, and their channels
LEAST_SHARE = 0.1  # of BENCH_SIGMA: a smaller standard deviation at rest is quantization or a stuck channel


def noise_at_rest(table: pd.DataFrame, rest: list[slice]) -> dict[str, float]:
    """Standard deviation of one sample of each channel of BENCH_SIGMA. rest: rows in which the aircraft is at rest."""
    noise = {}
    for name, bench in BENCH_SIGMA.items():
        variance = np.array([table[name].iloc[rows].var() for rows in rest])
        finite = variance[np.isfinite(variance)]
        noise[name] = float(max(np.sqrt(finite.mean()), LEAST_SHARE * bench)) if len(finite) else bench
    return noise


def zeros_at_rest(table: pd.DataFrame, rest: list[slice], noise: dict[str, float]) -> dict[str, float]:
    """Standard errors [Pa] of the zeros of ZEROS; empty without rest. noise: of `noise_at_rest`.

    By the scatter of means over seconds, which noise correlated over less is in, and by white noise at least.
    """
    samples = sum(rows.stop - rows.start for rows in rest)
    if not samples:
        return {}
    step_s = float(table.index[1] - table.index[0])
    errors = {name: mean_at_rest(table[channel], rest, step_s)[1] for name, channel in ZEROS.items()}
    return {name: float(np.fmax(errors[name], noise[ZEROS[name]] / np.sqrt(samples))) for name in ZEROS}
