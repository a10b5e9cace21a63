"""Output error over the runs alone, pitch and height as states (3.24-3.45, method section 8, "G"): the cross-check.

It integrates the equations of motion through each run and knows nothing of the rest of the flight, so it errs in other
ways than the path does: where the two disagree, one of them is wrong.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.air import bank_rad
from analysis.estimation import models, output_error
from analysis.estimation.data import Segment
from analysis.power import covariance
from analysis.power.curve import Polar
from analysis.runs import Run
from flight.aircraft import Aircraft

Array = NDArray[np.float64]
INPUTS = {
    "thrust": "thrust_N",
    "J": "J",
    "elevator": "elevator_rad",
    "q": "q_radps",
    "p": "p_radps",
    "r": "r_radps",
    "beta": "beta_rad",
    "rho": "rho",
}
OUTPUTS = {"V": "V_mps", "alpha": "alpha_rad", "ax": "ax_mps2", "az": "az_mps2", "h": "height_m"}
UNZEROED_GYRO_RADPS = 0.02  # an MPU9250's zero-rate output at room temperature, as it comes


class CrossCheck(NamedTuple):
    polar: Polar
    verdict: str
    converged: bool


def estimate_polar(table: pd.DataFrame, runs: list[Run], aircraft: Aircraft, *, zeroed: bool) -> CrossCheck:
    """Fit all runs at once. table: as `air_data` leaves it. zeroed: the gyro's bias at rest was taken out."""
    priors = models.Priors() if zeroed else models.Priors(gyro_bias_radps=UNZEROED_GYRO_RADPS)
    bank = bank_rad(table)
    segments = [_segment(table, run, bank) for run in runs]
    model = models.pitch_and_height(aircraft, priors=priors)
    fit = output_error.estimate(model, segments, start=models.quick_start(aircraft, segments))
    where = [fit.names.index(name) for name in ("A0", "A1", "A2")]
    C = covariance.of_noise(fit) + covariance.floor(fit)
    return CrossCheck(Polar(fit.values[where], C[np.ix_(where, where)]), str(fit.verdict), fit.verdict.ok)


def _segment(table: pd.DataFrame, run: Run, bank: Array) -> Segment:
    """One run as the estimator wants it: small gaps in inputs bridged, gaps in outputs left."""
    data = table.iloc[run.rows]
    inputs = {name: _filled(data[column]) for name, column in INPUTS.items()}
    return Segment(
        name=run.name,
        t_s=data.index.to_numpy(),
        u={**inputs, "phi": bank[run.rows]},
        z={name: data[column].to_numpy() for name, column in OUTPUTS.items()},
    )


def _filled(column: pd.Series) -> Array:
    """A column without gaps: linear across them; zero where nothing was ever measured."""
    return column.interpolate(limit_direction="both").fillna(0.0).to_numpy()
