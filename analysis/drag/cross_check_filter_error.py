"""Filter error over the runs alone: output error with gusts as states (method section 8, "F").

What turbulence does to the motion is told from what sensors do to the data, instead of being taken for either.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.cross_check_data import OUTPUTS, priors, segments_of
from analysis.estimation import aircraft_models as models
from analysis.estimation import filter_error, output_error
from analysis.estimation.filter_error import FilterFit, ProcessNoise
from analysis.maneuvers.kinds import Run
from flight.aircraft import Aircraft
from flight.propeller import Propeller

Array = NDArray[np.float64]

BLOCK = 5  # samples: gusts that matter last longer than 0.2 s, and a filter's cycle costs fifty times a model's
GYRO_NOISE = 0.005  # rad/s in a sample (Table 4.1), which the pitch angle integrates


def fitted(
    table: pd.DataFrame, runs: list[Run], aircraft: Aircraft, propeller: Propeller, *, zeroed: bool
) -> FilterFit:
    """The filter-error fit of all runs at once. Arguments as in `output_error.estimate_polar`."""
    segments = segments_of(table, runs, propeller, block=BLOCK)
    known = priors(zeroed=zeroed)
    still = output_error.estimate(
        models.level_run(aircraft, priors=known), segments, start=models.starting_values(aircraft, segments)
    )
    V = float(np.mean([segment.u["V_ref"].mean() for segment in segments]))
    sample_s = segments[0].step_s / BLOCK
    # Gusts may explain all of the specific force and leave no noise in it; what changes from sample to sample is noise.
    known_noise = {
        name: np.median([_sample_noise(table[OUTPUTS[name]].to_numpy()[run.rows]) for run in runs]) / np.sqrt(BLOCK)
        for name in ("ax", "az")
    }
    gyro = ProcessNoise(state="theta", start=GYRO_NOISE * float(np.sqrt(sample_s)), free=False)
    return filter_error.estimate(
        models.level_run(aircraft, priors=known, gusts=True),
        segments,
        (*models.gust_noise(V), gyro),
        noise_sigma=known_noise,
        start=dict(zip(still.names, still.values.tolist(), strict=True)),
        test_significance=False,
    )


def _sample_noise(signal: Array) -> float:
    """Standard deviation of what is white: a sample's distance from the mean of its neighbours has 1.5 its variance."""
    return float(np.sqrt(np.nanmean((signal[1:-1] - (signal[:-2] + signal[2:]) / 2) ** 2) / 1.5))
