"""Results of the flight other than the curve, in the form of `results.json`: air, residuals, correlation, track."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from flightpower.analysis.curve import POLAR, Condition
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.thrust_prior import J_REFERENCE, THRUST
from flightpower.analysis.performance.request import density_altitude_m
from flightpower.analysis.records.flight import (
    AirFound,
    Correlation,
    JointConflict,
    ParameterResult,
    PathResult,
    RunResidual,
    Track,
)
from flightpower.analysis.results.settings import RESULTS
from flightpower.analysis.trajectory.consistency import Consistency, consistency_checks
from flightpower.analysis.trajectory.observability import PriorConflict, sensor_error_estimates
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.arrays import Array

DRAG = "drag / mass, m/s²"  # its name in `RunFit`


def path_result(trajectory: Trajectory, agreement: Consistency, conflict: PriorConflict | None = None) -> PathResult:
    """Return the trajectory's quality, agreement of channels and sensor errors. conflict: with the priors, if tested"""
    jointly = conflict.jointly if conflict else None
    return PathResult(
        converged=trajectory.converged,
        gust_mps=trajectory.gust_mps,
        residuals=trajectory.residuals,
        checks=consistency_checks(agreement),
        sensor_errors=sensor_error_estimates(trajectory),
        prior_conflicts=dict(conflict.z) if conflict else {},
        joint_conflict=JointConflict(errors=jointly.errors, probability=jointly.probability)
        if jointly and jointly.errors
        else None,
    )


def air_found(trajectory: Trajectory, rows_flown: pd.DataFrame, condition: Condition) -> AirFound:
    """Return mean wind over the runs, gusts, temperature, and heights. rows_flown: air data within the runs."""
    rows = trajectory.states.index.isin(rows_flown.index)
    rows = rows if rows.any() else np.asarray(trajectory.block_means.flying)
    wind = trajectory.states.loc[rows, ["wind_north", "wind_east"]].mean()
    errors = trajectory.states_error().loc[rows, ["wind_north", "wind_east"]].to_numpy()
    north, east = float(wind["wind_north"]), float(wind["wind_east"])
    height = rows_flown["height_m"].dropna()
    return AirFound(
        wind_mps=float(np.hypot(north, east)),
        wind_from_deg=float(np.degrees(np.arctan2(-east, -north)) % 360),
        wind_standard_error_mps=float(np.sqrt(np.mean(errors**2))),
        gust_mps=trajectory.gust_mps,
        gust_length=trajectory.gust_length,
        temperature_K=float(rows_flown["temperature_K"].mean()),
        pressure_Pa=float(rows_flown["static_Pa"].mean()),
        density_altitude_m=float(density_altitude_m(condition.rho)),
        lowest_height_m=float(height.min()),
        highest_height_m=float(height.max()),
    )


def run_residuals(estimate: DynamicEstimate, kinds: Mapping[str, str]) -> list[RunResidual]:
    """Return scatter and autocorrelation of each run's residuals of drag. White residuals correlate at lag 0 only.
    kinds: of the runs, by name
    """
    residuals = []
    for fit in estimate.fits:
        residual = fit.measured[DRAG] - fit.modeled[DRAG]
        residual = residual[np.isfinite(residual)]
        step_s = float(fit.t_s[1] - fit.t_s[0])
        correlation = autocorrelation(residual, round(RESULTS.longest_lag_s / step_s))
        residuals.append(
            RunResidual(
                run=fit.run,
                kind=kinds[fit.run],
                points=len(residual),
                step_s=step_s,
                rms_mps2=float(np.sqrt(np.mean(residual**2))),
                autocorrelation=[round(float(r), 4) for r in correlation],
            )
        )
    return residuals


def autocorrelation(residual: Array, lags: int) -> Array:
    """Return the correlation of residuals (n,) with themselves at lags 0, 1, …, at most half of the residuals' length.

    This is the biased estimate about zero, since the residuals' mean is an error of the model as well.
    """
    lags = min(lags, len(residual) // 2)
    power = float(residual @ residual)
    if not power:
        return np.ones(1)
    return np.array([residual[: len(residual) - k] @ residual[k:] / power for k in range(lags + 1)])


def parameter_correlation(estimate: DynamicEstimate) -> Correlation:
    """Return the correlation of the errors of POLAR and THRUST; 0 for a parameter without error."""
    covariance = estimate.noise + estimate.systematic
    sigma = np.sqrt(np.diag(covariance))
    scale = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=sigma > 0)
    matrix = covariance * np.outer(scale, scale)
    return Correlation(names=[*POLAR, *THRUST], matrix=np.round(matrix, 4).tolist())


def static_thrust(estimate: DynamicEstimate) -> ParameterResult:
    """Return estimated thrust at rest over the table's: 1 + thrust_scale - J_REFERENCE thrust_slope."""
    row = np.array([0.0, 0.0, 0.0, 1.0, -J_REFERENCE])
    error = float(np.sqrt(row @ (estimate.noise + estimate.systematic) @ row))
    value = 1 + float(row @ estimate.values)
    return ParameterResult(name="static_thrust_ratio", value=value, standard_error=error, unit="")


def track(trajectory: Trajectory) -> Track:
    """Return the path [m] north and east of the start, integrated from velocity and thinned to 600 points at most."""
    t_s = trajectory.states.index.to_numpy()
    place = [_integral(trajectory.states[name].to_numpy(), t_s) for name in ("v_north", "v_east")]
    every = slice(None, None, -(-len(t_s) // 600))
    north, east = (np.round(values[every], 1).tolist() for values in place)
    return Track(t_s=np.round(t_s[every], 1).tolist(), north_m=north, east_m=east)


def _integral(rate: Array, t_s: Array) -> Array:
    """Integrate by trapezoids, starting from zero."""
    return np.asarray(np.r_[0.0, np.cumsum((rate[1:] + rate[:-1]) / 2 * np.diff(t_s))])
