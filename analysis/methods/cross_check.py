"""The cross-check: output error on the runs alone, with pitch and height as states (3.24-3.45).

It integrates the equations of motion through each run and uses nothing of the rest of the flight. Its errors differ
from those of the trajectory, so if the two disagree, one of them is wrong. Gusts move the aircraft and would make its
intervals too narrow, so in gusts there is no cross-check.
"""

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy import special

from flightpower.analysis.air.settings import AIR
from flightpower.analysis.curve import Condition, Polar, power_required, speed_at
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Convergence, Fit
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods import aircraft_models
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.aircraft_models import Priors
from flightpower.analysis.methods.settings import CROSS_CHECK, REGRESSION
from flightpower.analysis.methods.thrust_prior import stand_measurements
from flightpower.analysis.settings import CURVES
from flightpower.analysis.sources.daemon import speed_scale_of
from flightpower.analysis.sources.grid import without_gaps
from flightpower.analysis.trajectory.priors import upwash_slope_sigma
from flightpower.analysis.trajectory.settings import PROCESS
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller

INPUTS = {
    "elevator": "elevator_rad",
    "q": "q_radps",
    "p": "p_radps",
    "r": "r_radps",
    "beta": "beta_rad",
    "rho": "rho",
}
OUTPUTS = {"V": "V_mps", "alpha": "alpha_rad", "ax": "ax_mps2", "az": "az_mps2", "h": "height_m"}


def priors(aircraft: Aircraft, *, zeroed: bool) -> Priors:
    """Priors of the sensor errors and of thrust. zeroed: whether the gyro biases at rest were subtracted"""
    uncertainty = aircraft.uncertainty
    priors_of_file = Priors(
        alpha_bias_rad=uncertainty.angle_of_attack_offset_rad,
        alpha_scale=math.hypot(uncertainty.angle_of_attack_slope_fraction, upwash_slope_sigma(aircraft)),
        accelerometer_bias_mps2=uncertainty.accelerometer_offset_mps2,
        V_scale=uncertainty.airspeed_scale_fraction,
        thrust_scale=uncertainty.thrust_scale_fraction,
        thrust_slope=uncertainty.thrust_slope,
    )
    return priors_of_file if zeroed else replace(priors_of_file, gyro_bias_radps=CROSS_CHECK.unzeroed_gyro_radps)


def segments_of(table: pd.DataFrame, runs: list[Maneuver], propeller: Propeller, *, block: int) -> list[Segment]:
    """Inputs and outputs of `aircraft_models.level_run`, as means over `block` samples. table: from `air_data`

    Gaps in inputs are interpolated. Outputs without a sample in a block are NaN there, and runs with fewer blocks than
    `REGRESSION.fewest_blocks` are left out.
    """
    step_s = float(table.index[1] - table.index[0])
    width = max(1, round(AIR.derivative_s / step_s))
    V_ref = table["V_mps"].interpolate(limit_direction="both").rolling(width, center=True, min_periods=1).mean()
    least_mps = PROCESS.slowest_mps * speed_scale_of(table)
    V_ref = V_ref.fillna(least_mps).clip(lower=least_mps)
    n, rho = table["n_revps"].where(table["n_revps"] > 1).to_numpy(), table["rho"].to_numpy()
    measured = {name: table[column].to_numpy() for name, column in (INPUTS | {"phi": "bank_rad"}).items()}
    measured["V_ref"] = V_ref.to_numpy()
    outputs = {name: table[column].to_numpy() for name, column in OUTPUTS.items()}
    t_s = table.index.to_numpy()
    segments = []
    for run in runs:
        count = (run.rows.stop - run.rows.start) // block
        if count < REGRESSION.fewest_blocks:
            continue
        rows = slice(run.rows.start, run.rows.start + count * block)
        inputs = {name: signal[rows] for name, signal in measured.items()}
        inputs |= _propulsion(inputs["V_ref"], n[rows], rho[rows], propeller)
        segments.append(
            Segment(
                name=run.name,
                t_s=t_s[rows].reshape(count, block).mean(axis=1),
                u={name: _means(np.nan_to_num(without_gaps(signal)), block) for name, signal in inputs.items()},
                z={name: _means(signal[rows], block) for name, signal in outputs.items()},
            )
        )
    return segments


def _propulsion(V_ref: Array, n: Array, rho: Array, propeller: Propeller) -> dict[str, Array]:
    """The table's thrust at V_ref, its slope over speed, and the advance ratio, each (n,)."""
    step_mps = 0.3
    thrust_N, faster_N, slower_N = (
        np.asarray(propeller.thrust_and_power(V, n, rho)[0]) for V in (V_ref, V_ref + step_mps, V_ref - step_mps)
    )
    slope = (faster_N - slower_N) / (2 * step_mps)
    return {"thrust": thrust_N, "thrust_per_speed": slope, "J": V_ref / (n * propeller.diameter_m)}


def _means(signal: Array, block: int) -> Array:
    """Mean of the finite samples in each block; NaN for a block without any."""
    blocks = signal.reshape(-1, block)
    count = np.isfinite(blocks).sum(axis=1)
    return np.asarray(np.nansum(blocks, axis=1) / np.where(count > 0, count, np.nan))


# One test covers all speeds, because a difference of two parabolas has three coefficients (Scheffe 1953, Biometrika
# 40, 87).


class CrossCheck(NamedTuple):
    """A polar, and the reason why its estimation ended (`verdict`)."""

    polar: Polar
    verdict: str
    converged: bool
    convergence: Convergence | None = None


def on_runs_alone(
    table: pd.DataFrame,
    runs: list[Maneuver],
    aircraft: Aircraft,
    propeller: Propeller,
    *,
    gust_mps: float,
    zeroed: bool,
) -> CrossCheck | None:
    """Fit all runs at once by output error; None in gusts.

    In a long flight only the runs that `spread` chooses are used. table: from `air_data`. gust_mps: standard deviation
    of vertical gusts [m/s] from the trajectory, which separates them from noise. zeroed: whether the gyro biases at
    rest were subtracted
    """
    if gust_mps > CROSS_CHECK.still_air_mps:
        return None
    fit = output_error_fit(table, spread(runs), aircraft, propeller, zeroed=zeroed)
    return CrossCheck(covariance.polar_of(fit), fit.verdict.text, fit.verdict.ok, fit.convergence)


def spread(runs: list[Maneuver]) -> list[Maneuver]:
    """Choose at most `CROSS_CHECK.most_runs` runs, evenly over the flight, including the first and the last."""
    if len(runs) <= CROSS_CHECK.most_runs:
        return runs
    return [runs[i] for i in np.linspace(0, len(runs) - 1, CROSS_CHECK.most_runs).round().astype(int)]


def output_error_fit(
    table: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft, propeller: Propeller, *, zeroed: bool
) -> Fit:
    """The output-error fit of all runs at once, in still air."""
    segments = segments_of(table, runs, propeller, block=CROSS_CHECK.block)
    model = aircraft_models.level_run(aircraft, priors=priors(aircraft, zeroed=zeroed))
    model = replace(model, prior_measurements=stand_measurements(aircraft))
    start = aircraft_models.starting_values(aircraft, segments)
    return fit_output_error(model, segments, start=start, options=FitOptions(second_start=False))


class Disagreement(NamedTuple):
    """Whether power curve and cross-check differ by more than the simultaneous 95 % band allows, and warnings."""

    differs: bool
    warnings: list[str]


def disagreement(
    polar: Polar, check: CrossCheck | None, condition: Condition, flown_CL: tuple[float, float]
) -> Disagreement:
    """Compare the power curve with the cross-check over the speeds flown, if there is a cross-check."""
    if check is None:
        return Disagreement(False, [])
    if not check.converged:
        left_out = f"The cross-check by output error did not converge and is left out: {check.verdict}."
        return Disagreement(False, [left_out])
    V = np.linspace(speed_at(flown_CL[1], condition), speed_at(flown_CL[0], condition), CURVES.points)
    (power, error), (other, other_error) = (power_required(V, p, condition) for p in (polar, check.polar))
    simultaneous_95 = float(np.sqrt(special.chdtri(3, 1 - 0.95)))
    excess = np.abs(other - power) / (simultaneous_95 * np.hypot(error, CROSS_CHECK.excess * other_error))
    worst = int(np.argmax(excess))
    if excess[worst] <= 1:
        return Disagreement(False, [])
    warning = (
        f"Output error on the runs alone differs from the power curve by"
        f" {100 * (other[worst] / power[worst] - 1):+.0f} % at {V[worst]:.1f} m/s, more than their intervals allow:"
        " the power curve is doubtful; check the fits below."
    )
    return Disagreement(True, [warning])
