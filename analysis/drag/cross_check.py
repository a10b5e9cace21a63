"""Output error over the runs alone, pitch and height as states (3.24-3.45, method section 8, "G"): the cross-check.

It integrates the equations of motion through each run and knows nothing of the rest of the flight, so it errs in other
ways than the path does: where the two disagree, one of them is wrong.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd

from analysis.drag import covariance
from analysis.drag import cross_check_filter_error as filter_error
from analysis.drag.cross_check_data import priors, segments_of
from analysis.drag.polar import Condition, Polar, power_required, speed_at
from analysis.estimation import aircraft_models as models
from analysis.estimation import output_error, uncertainty
from analysis.estimation.fit import Fit
from analysis.estimation.intervals import NORMAL_95
from analysis.maneuvers.kinds import Run
from flight.aircraft import Aircraft
from flight.propeller import Propeller

BLOCK = 2  # samples: 12.5 a second are ten a cycle of the short period
# Correlation of neighbouring residuals of the vertical acceleration, which feels a gust first: 0.2 in still air (the
# gyro's noise), 0.7 in turbulence of W20 = 3 kt.
DISTURBED = 0.4
SPEEDS = 61  # at which the polars are compared


class CrossCheck(NamedTuple):
    """A polar, and how the estimation ended. in_gusts: the air moved, and filter error was used instead."""

    polar: Polar
    verdict: str
    converged: bool
    in_gusts: bool = False

    @property
    def by(self) -> str:
        return "filter error" if self.in_gusts else "output error"


def estimate_polar(
    table: pd.DataFrame,
    runs: list[Run],
    aircraft: Aircraft,
    *,
    zeroed: bool,
    propeller: Propeller,
) -> CrossCheck:
    """Fit all runs at once; where residuals show that the air moved, by filter error with gusts as states.

    table: as `air_data` leaves it. zeroed: the gyro's bias at rest was taken out. propeller: the one flown.
    """
    fit = fitted(table, runs, aircraft, propeller, zeroed=zeroed)
    if _disturbed(fit):
        by_filter = filter_error.fitted(table, runs, aircraft, propeller, zeroed=zeroed)
        return CrossCheck(covariance.polar_of(by_filter), str(by_filter.verdict), by_filter.verdict.ok, in_gusts=True)
    return CrossCheck(covariance.polar_of(fit), str(fit.verdict), fit.verdict.ok)


def fitted(table: pd.DataFrame, runs: list[Run], aircraft: Aircraft, propeller: Propeller, *, zeroed: bool) -> Fit:
    """The output-error fit of all runs at once, in still air."""
    segments = segments_of(table, runs, propeller, block=BLOCK)
    model = models.level_run(aircraft, priors=priors(zeroed=zeroed))
    return output_error.estimate(model, segments, start=models.starting_values(aircraft, segments))


def _disturbed(fit: Fit) -> bool:
    return uncertainty.whiteness(fit)["az"].lag_one > DISTURBED


def disagreement(polar: Polar, check: CrossCheck, at: Condition, flown_CL: tuple[float, float]) -> list[str]:
    """Whether curve and cross-check differ by more than both their intervals allow, and where most."""
    if not check.converged:
        return [f"The cross-check by {check.by} did not end well, and is left out: {check.verdict}."]
    V = np.linspace(speed_at(flown_CL[1], at), speed_at(flown_CL[0], at), SPEEDS)
    (power, error), (other, other_error) = (power_required(V, p, at) for p in (polar, check.polar))
    excess = np.abs(other - power) / (NORMAL_95 * np.hypot(error, other_error))
    worst = int(np.argmax(excess))
    if excess[worst] <= 1:
        return []
    return [
        f"{check.by.capitalize()} over the runs alone differs by {100 * (other[worst] / power[worst] - 1):+.0f} % at"
        f" {V[worst]:.1f} m/s, more than both intervals allow: look at the fits below."
    ]
