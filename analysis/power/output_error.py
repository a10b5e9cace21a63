"""Output error over the runs alone, pitch and height as states (3.24-3.45, method section 8, "G"): the cross-check.

It integrates the equations of motion through each run and knows nothing of the rest of the flight, so it errs in other
ways than the path does: where the two disagree, one of them is wrong.
"""

from typing import NamedTuple

import pandas as pd

from analysis.estimation import models, output_error, uncertainty
from analysis.estimation.fit import Fit
from analysis.power import covariance, filter_error
from analysis.power.curve import Polar
from analysis.power.level_runs import priors, segments_of
from analysis.runs import Run
from flight.aircraft import Aircraft
from flight.propeller import Propeller

BLOCK = 2  # samples: 12.5 a second are ten a cycle of the short period
# Correlation of neighbouring residuals of the vertical acceleration, which feels a gust first: 0.2 in still air (the
# gyro's noise), 0.7 in turbulence of W20 = 3 kt.
DISTURBED = 0.4


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
    return output_error.estimate(model, segments, start=models.quick_start(aircraft, segments))


def _disturbed(fit: Fit) -> bool:
    return uncertainty.whiteness(fit)["az"].lag_one > DISTURBED
