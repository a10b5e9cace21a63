"""The path of a flight as its sensors measure it, used where no trajectory agrees with all of them.

Pitch attitude is the measured angle of attack plus the climb angle from the barometer; velocity is airspeed along the
heading of the first estimate. No sensor error is estimated: each keeps the mean and the variance of its prior.
"""

import numpy as np
import pandas as pd

from flightpower.analysis.air.magnetometer import Compass
from flightpower.analysis.trajectory.block_means import BlockMeans, moving_average
from flightpower.analysis.trajectory.equations import MEASUREMENT_INPUTS, PREDICTED_FLOW, SENSOR_ERRORS, STATES
from flightpower.analysis.trajectory.priors import WIND, SensorPriors
from flightpower.analysis.trajectory.problem import TrajectoryProblem
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.settings import PRIORS, SOLVER
from flightpower.analysis.trajectory.smoother import StatesGivenErrors


def path_as_measured(
    table: pd.DataFrame,
    rest: list[slice],
    priors: SensorPriors = SensorPriors(),
    *,
    compass: Compass | None = None,
    gust_length: float = 1.0,
) -> Trajectory:
    """Return the path as measured, as a trajectory that did not converge. The arguments are those of `reconstruct`."""
    problem = TrajectoryProblem(table, rest, priors, compass)
    blocks, n, m = problem.blocks, problem.blocks.n, len(SENSOR_ERRORS)
    x = problem.initial_states.copy()
    speed = np.where(np.isfinite(blocks["V_mps"]), moving_average(blocks["V_mps"], 5), 0.0)
    psi, climb = x[:, STATES.index("psi")], -x[:, STATES.index("v_down")]
    level = np.sqrt(np.maximum(speed**2 - climb**2, 0.0))
    x[:, STATES.index("v_north")], x[:, STATES.index("v_east")] = level * np.cos(psi), level * np.sin(psi)
    x[:, WIND] = 0.0
    gust_mps = _gusts_mps(blocks)
    inputs, _ = problem.regressors.measurement_inputs(x, problem.error_mean, gust_mps)
    sensitivity = np.zeros((n, len(STATES), m))
    alpha = np.nan_to_num(moving_average(blocks["alpha_rad"], 5))
    sensitivity[:, STATES.index("theta"), SENSOR_ERRORS.index("alpha_bias")] = -1.0
    sensitivity[:, STATES.index("theta"), SENSOR_ERRORS.index("alpha_scale")] = -alpha
    return Trajectory(
        states=pd.DataFrame(x, pd.Index(blocks.t_s, name="t_s"), list(STATES)),
        sensor_errors=problem.error_mean,
        covariance=np.diag(problem.error_sigma**2),
        prior_sigma=problem.error_sigma,
        state_sensitivity=sensitivity,
        states_given_errors=StatesGivenErrors(np.full((1, n * len(STATES)), np.inf)),
        draws=np.zeros((SOLVER.draws, n, len(STATES))),
        predicted_flow=inputs[:, [MEASUREMENT_INPUTS.index(name) for name in PREDICTED_FLOW]],
        gust_mps=gust_mps,
        residuals={},
        converged=False,
        block_means=blocks,
        gust_length=gust_length,
        as_measured=True,
    )


def _gusts_mps(blocks: BlockMeans) -> float:
    """Vertical gusts [m/s], 1 sigma, from quick changes of the angle of attack in flight, pilot inputs included."""
    if not blocks.flying.any():
        return SOLVER.least_gust_mps
    alpha = blocks["alpha_rad"]
    quick = (alpha - moving_average(alpha, round(PRIORS.compass_averaging_s / blocks.step_s)))[blocks.flying]
    lower, upper = np.nanpercentile(quick, (16, 84))
    speed = float(np.nanmedian(blocks["V_mps"][blocks.flying]))
    return float(np.clip((upper - lower) / 2 * speed, SOLVER.least_gust_mps, SOLVER.gusts_mps[-1]))
