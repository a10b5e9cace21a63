"""Noise of the sensors, measured while the aircraft is at rest."""

import numpy as np
import pandas as pd

# Standard deviations of one sample where the log has no rest.
BENCH_SIGMA = {
    "p_radps": 0.005, "q_radps": 0.005, "r_radps": 0.005, "ax_mps2": 0.06, "ay_mps2": 0.06, "az_mps2": 0.06,
    "dp_alpha_Pa": 6.0, "dp_beta_Pa": 6.0, "q_c_Pa": 6.0, "static_Pa": 6.0,
}  # fmt: skip
LEAST_SHARE = 0.1  # of BENCH_SIGMA: a smaller standard deviation at rest is quantization or a stuck channel


def noise_at_rest(table: pd.DataFrame, rest: list[slice]) -> dict[str, float]:
    """Standard deviation of one sample of each channel of BENCH_SIGMA. rest: rows in which the aircraft is at rest."""
    noise = {}
    for name, bench in BENCH_SIGMA.items():
        variance = np.array([table[name].iloc[rows].var() for rows in rest])
        finite = variance[np.isfinite(variance)]
        noise[name] = float(max(np.sqrt(finite.mean()), LEAST_SHARE * bench)) if len(finite) else bench
    return noise
