"""Filter error on the runs alone: output error with gusts as states.

Process noise separates turbulence, which moves the aircraft, from measurement noise.
"""

from dataclasses import replace

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.cross_check_data import OUTPUTS, priors, segments_of
from analysis.drag.thrust_prior import stand_measurements
from analysis.estimation import aircraft_models, filter_error, output_error
from analysis.estimation.filter_error import FilterFit, ProcessNoise
from analysis.maneuvers.kinds import Maneuver
from flight.aircraft import Aircraft
from flight.propeller import Propeller

Array = NDArray[np.float64]

BLOCK = 5  # samples: gusts that matter last longer than 0.2 s, and a filter step costs fifty times a model step
GYRO_NOISE_RADPS = 0.005  # of a sample (Table 4.1); the pitch angle integrates it


def filter_error_fit(
    table: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller, *, zeroed: bool
) -> FilterFit:
    """The filter-error fit of all runs at once. Arguments as in `cross_check.on_runs_alone`."""
    segments = segments_of(table, runs, propeller, block=BLOCK)
    known = priors(aircraft, zeroed=zeroed)
    measured = stand_measurements(aircraft)
    still_air = output_error.estimate(
        replace(aircraft_models.level_run(aircraft, priors=known), prior_measurements=measured),
        segments,
        start=aircraft_models.starting_values(aircraft, segments),
    )
    V = float(np.mean([segment.u["V_ref"].mean() for segment in segments]))
    sample_s = segments[0].step_s / BLOCK
    # Gusts as states could explain all of the specific force. Its noise is therefore known, from changes per sample.
    known_noise = {
        name: np.median([_sample_noise(table[OUTPUTS[name]].to_numpy()[run.rows]) for run in runs]) / np.sqrt(BLOCK)
        for name in ("ax", "az")
    }
    gyro = ProcessNoise(state="theta", start=GYRO_NOISE_RADPS * float(np.sqrt(sample_s)), free=False)
    return filter_error.estimate(
        replace(aircraft_models.level_run(aircraft, priors=known, gusts=True), prior_measurements=measured),
        segments,
        (*aircraft_models.gust_noise(V), gyro),
        noise_sigma=known_noise,
        start=dict(zip(still_air.names, still_air.values.tolist(), strict=True)),
        test_significance=False,
    )


def _sample_noise(signal: Array) -> float:
    """Standard deviation of white noise: a sample less the mean of its neighbours has 1.5 times its variance."""
    return float(np.sqrt(np.nanmean((signal[1:-1] - (signal[:-2] + signal[2:]) / 2) ** 2) / 1.5))
