"""Output error on the runs alone, pitch and height as states (3.24-3.45): the cross-check.

It integrates the equations of motion through each run and uses nothing of the rest of the flight. Its errors differ
from those of the trajectory: where the two disagree, one of them is wrong.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import special

from analysis.drag import covariance
from analysis.drag.cross_check_data import priors, segments_of
from analysis.drag.cross_check_filter_error import filter_error_fit
from analysis.drag.polar import Condition, Polar, power_required, speed_at
from analysis.drag.thrust_prior import stand_measurements
from analysis.estimation import aircraft_models, output_error
from analysis.estimation.fit import Convergence, Fit
from analysis.maneuvers.kinds import Maneuver
from flight.aircraft import Aircraft
from flight.propeller import Propeller

BLOCK = 2  # samples: 12.5 blocks per second are ten per cycle of the short period
# Vertical gusts, 1 sigma, up to which output error's intervals hold: W20 = 1 kt has 0.05, 2 kt 0.1.
STILL_AIR_MPS = 0.07
SPEEDS = 61  # at which the polars are compared
# Each run has initial states of its own: the time of one iteration grows with the cube of their number.
MOST_RUNS = 40
# Errors of output error over its standard errors: 1.1 rms in 8 flights in calm air (docs/estimators.md).
EXCESS = 1.2
# One test over all speeds: a difference of two parabolas has three coefficients (Scheffe 1953, Biometrika 40, 87).
SIMULTANEOUS_95 = float(np.sqrt(special.chdtri(3, 1 - 0.95)))


class CrossCheck(NamedTuple):
    """A polar, and how its estimation ended. in_gusts: the flight had gusts, and filter error was used."""

    polar: Polar
    verdict: str
    converged: bool
    in_gusts: bool = False
    convergence: Convergence | None = None

    @property
    def by(self) -> str:
        return "filter error" if self.in_gusts else "output error"


def on_runs_alone(
    table: pd.DataFrame,
    runs: list[Maneuver],
    aircraft: Aircraft,
    *,
    zeroed: bool,
    propeller: Propeller,
    gust_mps: float,
) -> CrossCheck:
    """Fit all runs at once, by output error in still air, by filter error with gusts as states in gusts.

    table: from `air_data`. zeroed: the gyro biases at rest were subtracted. gust_mps: standard deviation of vertical
    gusts [m/s], by the trajectory, which tells them from noise. Of a long flight's runs, `spread` ones are taken.
    """
    in_gusts = gust_mps > STILL_AIR_MPS
    fit_of = filter_error_fit if in_gusts else output_error_fit
    fit = fit_of(table, spread(runs), aircraft, propeller, zeroed=zeroed)
    return CrossCheck(covariance.polar_of(fit), fit.verdict.text, fit.verdict.ok, in_gusts, fit.convergence)


def spread(runs: list[Maneuver]) -> list[Maneuver]:
    """MOST_RUNS of them at most, evenly over the flight, the first and the last among them."""
    if len(runs) <= MOST_RUNS:
        return runs
    return [runs[i] for i in np.linspace(0, len(runs) - 1, MOST_RUNS).round().astype(int)]


def output_error_fit(
    table: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller, *, zeroed: bool
) -> Fit:
    """The output-error fit of all runs at once, in still air."""
    segments = segments_of(table, runs, propeller, block=BLOCK)
    model = aircraft_models.level_run(aircraft, priors=priors(aircraft, zeroed=zeroed))
    model = replace(model, prior_measurements=stand_measurements(aircraft))
    return output_error.estimate(model, segments, start=aircraft_models.starting_values(aircraft, segments))


class Disagreement(NamedTuple):
    """Whether power curve and cross-check differ beyond the simultaneous 95 % band of the difference, and warnings."""

    differs: bool
    warnings: list[str]


def disagreement(polar: Polar, check: CrossCheck, condition: Condition, flown_CL: tuple[float, float]) -> Disagreement:
    """The comparison of power curve and cross-check over the speeds flown.

    Filter error says nothing about the power curve: its intervals cover 13 to 60 % where the air moved.
    """
    if check.in_gusts:
        return Disagreement(False, [])
    if not check.converged:
        left_out = f"The cross-check by {check.by} did not converge and is left out: {check.verdict}."
        return Disagreement(False, [left_out])
    V = np.linspace(speed_at(flown_CL[1], condition), speed_at(flown_CL[0], condition), SPEEDS)
    (power, error), (other, other_error) = (power_required(V, p, condition) for p in (polar, check.polar))
    excess = np.abs(other - power) / (SIMULTANEOUS_95 * np.hypot(error, EXCESS * other_error))
    worst = int(np.argmax(excess))
    if excess[worst] <= 1:
        return Disagreement(False, [])
    warning = (
        f"{check.by.capitalize()} on the runs alone differs from the power curve by"
        f" {100 * (other[worst] / power[worst] - 1):+.0f} % at {V[worst]:.1f} m/s, more than their intervals allow:"
        " the power curve is doubtful; check the fits below."
    )
    return Disagreement(True, [warning])
