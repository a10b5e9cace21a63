"""The dynamic method: drag polar from accelerations and decelerations, in two steps (method section 8, "T").

First the path over the whole flight, with the errors of its sensors; then, along the path, the forces of the runs are
regressed on lift. All runs of a flight are fitted at once: they share the aerodynamics and the errors of the sensors.
What the path could not determine is carried into the polar's covariance: each direction of the errors' covariance is
followed through path and regression, and so are draws of what the states may be off by on their own, which no two runs
share. Without these the interval of one deceleration covered 75 to 85 % at its slow end.

A gust near the stall takes the wing beyond any angle of attack of level flight, where drag is no parabola: such moments
are left out. With them power at 1.1 V_stall came out 1.1 % high in W20 = 15 kt (200 flights).
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.air import LEAST_HEIGHT_M
from analysis.drag import covariance
from analysis.drag.forces import J_REFERENCE, THRUST_SCALE, THRUST_SLOPE, Blocks
from analysis.drag.polar import Polar
from analysis.estimation import output_error
from analysis.estimation.data import Segment
from analysis.estimation.model import Model, NamedValues, Parameter
from analysis.maneuvers.kinds import Run
from analysis.trajectory.equations import SENSOR_ERRORS
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.propeller import Propeller
from flight.units import GRAVITY_MPS2

Array = NDArray[np.float64]
POLAR = ("A0", "A1", "A2")
THRUST = ("thrust_scale", "thrust_slope")  # thrust is the table's times 1 + scale + slope (J - J_REFERENCE)
SHORTEST = 10  # blocks of a run
# Level flight's angles of attack end with the slowest flown, and what turning and heaving in still air add to that.
SLOWEST_PERCENT, BEYOND_LEVEL_RAD = 97.5, np.radians(1.0)
LARGEST_UNMENTIONED_SHARE = 0.02
UNITS = {
    "p_bias": "rad/s", "q_bias": "rad/s", "r_bias": "rad/s", "ax_bias": "m/s^2", "ay_bias": "m/s^2", "az_bias": "m/s^2",
    "alpha_bias": "rad", "beta_bias": "rad", "heading_bias": "rad", "gps_latency": "s",
}  # fmt: skip


def _drag(_: NamedValues, u: NamedValues, p: NamedValues) -> tuple:
    """What is left of the axial force when the tabulated thrust is taken out, over mass [m/s^2]."""
    drag = u.qS * (p.A0 + p.A1 * u.CL + p.A2 * u.CL**2)
    return (drag - u.thrust * (p.thrust_scale + p.thrust_slope * (u.J - J_REFERENCE)),)


DRAG = Model(
    name="drag",
    inputs=("CL", "qS", "thrust", "J"),
    outputs=("drag",),
    output_function=_drag,
    parameters=(
        Parameter(name="A0", start=0.04),
        Parameter(name="A1", start=0.0),
        Parameter(name="A2", start=0.06),
        Parameter(name="thrust_scale", start=0.0, prior_sigma=THRUST_SCALE),
        Parameter(name="thrust_slope", start=0.0, prior_sigma=THRUST_SLOPE),
    ),
)


@dataclass(frozen=True)
class DynamicEstimate:
    """A drag polar with its covariance, and what a report shows."""

    polar: Polar
    parameters: list[tuple[str, float, float, str]]  # name, value, standard error, unit
    verdict: str
    warnings: list[str]
    fits: list[tuple[str, Array, dict[str, Array], dict[str, Array]]]  # run, time, measured, modelled
    values: Array  # of POLAR and THRUST
    noise: Array  # covariance of `values` by noise, (5, 5)
    systematic: Array  # and by what all runs share; both together is the covariance


def estimate_polar(
    table: pd.DataFrame, trajectory: Trajectory, runs: list[Run], aircraft: Aircraft, propeller: Propeller
) -> DynamicEstimate:
    """Fit all runs at once along the reconstructed path. table: as `air_data` leaves it."""
    blocks = Blocks(table, trajectory, aircraft, propeller)
    states = trajectory.states.to_numpy()
    aloft = (blocks.mean["height_m"] > LEAST_HEIGHT_M) & (blocks.mean["flying"] == 1)
    level = _level(blocks.forces(states, trajectory.sensor_errors), aloft, runs)

    def fitted(states: Array, shared: Array) -> output_error.Fit:
        forces = blocks.forces(states, shared)
        forces["CD"] = forces["CD"].where(level)
        return output_error.estimate(DRAG, _segments(forces, runs))

    def variance(states: Array, shared: Array) -> Array:
        moved = fitted(states, shared).values - fit.values
        return np.outer(moved, moved)

    fit = fitted(states, trajectory.sensor_errors)
    noise = covariance.of_noise(fit)
    systematic = covariance.floor(fit)
    for direction in np.linalg.cholesky(trajectory.covariance).T:
        systematic += variance(states + trajectory.state_sensitivity @ direction, trajectory.sensor_errors + direction)
    for draw in trajectory.draws:
        noise += variance(states + draw, trajectory.sensor_errors) / len(trajectory.draws)
    whole = noise + systematic
    where = [fit.names.index(name) for name in POLAR]
    both = [fit.names.index(name) for name in POLAR + THRUST]
    errors = np.sqrt(np.diag(whole))
    parameters = [
        (name, float(value), float(error), "") for name, value, error in zip(fit.names, fit.values, errors, strict=True)
    ]
    parameters += [
        (name, trajectory.value(name), trajectory.standard_error(name), UNITS.get(name, "")) for name in SENSOR_ERRORS
    ]
    converged = fit.verdict.ok and trajectory.converged
    warnings = [] if converged else [f"The estimation did not end well: {fit.verdict}; path: {trajectory.converged}."]
    beyond = float(np.mean([np.isnan(segment_fit.segment.z["drag"]).mean() for segment_fit in fit.segment_fits]))
    if beyond > LARGEST_UNMENTIONED_SHARE:
        warnings.append(
            f"In {100 * beyond:.0f} % of the runs gusts took the angle of attack beyond level flight's, towards the"
            " stall, where drag is more than the curve has: left out."
        )
    return DynamicEstimate(
        polar=Polar(fit.values[where], whole[np.ix_(where, where)]),
        parameters=parameters,
        verdict=str(fit.verdict) if trajectory.converged else "the path did not converge",
        warnings=warnings,
        fits=_drawn(blocks, trajectory, fit, runs),
        values=fit.values[both],
        noise=noise[np.ix_(both, both)],
        systematic=systematic[np.ix_(both, both)],
    )


def _level(forces: pd.DataFrame, aloft: NDArray[np.bool_], runs: list[Run]) -> NDArray[np.bool_]:
    """Where the angle of attack is one of level flight: no more than BEYOND_LEVEL_RAD above that at the largest lift
    coefficient that the speeds of flight or runs took, by the flight's own lift over angle."""
    flown = forces.loc[aloft, ["CL", "alpha", "qS"]].dropna()
    if len(flown) < SHORTEST:
        return np.ones(len(forces), dtype=bool)
    slope, offset = np.polyfit(flown["CL"], flown["alpha"], 1)
    lift = GRAVITY_MPS2 / forces["qS"]  # what level flight takes
    in_runs = pd.concat([lift.loc[run.start_s : run.end_s] for run in runs])
    slowest = max(np.nanpercentile(some, SLOWEST_PERCENT) for some in (lift[aloft], in_runs))
    return ~(forces["alpha"].to_numpy() > offset + slope * slowest + BEYOND_LEVEL_RAD)


def _segments(forces: pd.DataFrame, runs: list[Run]) -> list[Segment]:
    segments = []
    for run in runs:
        whole = forces.loc[run.start_s : run.end_s, [*DRAG.inputs, "CD"]]
        data = whole.interpolate(limit_direction="both")
        if len(data) >= SHORTEST and np.isfinite(data.to_numpy()).all():
            u = {name: data[name].to_numpy() for name in DRAG.inputs}
            z = {"drag": (data["qS"] * whole["CD"]).to_numpy()}
            segments.append(Segment(name=run.name, t_s=data.index.to_numpy(), u=u, z=z))
    return segments


def _drawn(blocks: Blocks, trajectory: Trajectory, fit: output_error.Fit, runs: list[Run]):
    """Measured and reconstructed: speed, angle of attack (sensor errors as found), height; drag and its model."""
    forces = blocks.forces(trajectory.states.to_numpy(), trajectory.sensor_errors)
    scale, slope, bias = (trajectory.value(name) for name in ("V_scale", "alpha_scale", "alpha_bias"))
    drawn = []
    for segment in (segment_fit.segment for segment_fit in fit.segment_fits):
        rows = (forces.index >= segment.t_s[0]) & (forces.index <= segment.t_s[-1])
        along, states = forces[rows], trajectory.states[rows]
        alpha = along["alpha"].to_numpy() * (1 + slope - 2 * scale) + bias
        model = fit.responses[segment.name].y[:, 0]
        measured = {
            "V, m/s": blocks.mean["V_mps"][rows],
            "α, deg": np.degrees(blocks.mean["alpha_rad"][rows]),
            "height, m": blocks.mean["height_m"][rows],
            "drag / mass, m/s²": segment.z["drag"],
        }
        modelled = {
            "V, m/s": along["V"].to_numpy() * (1 + scale),
            "α, deg": np.degrees(alpha),
            "height, m": states["height"].to_numpy(),
            "drag / mass, m/s²": model,
        }
        drawn.append((segment.name, segment.t_s, measured, modelled))
    return drawn
