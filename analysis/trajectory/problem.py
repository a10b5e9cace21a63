"""One flight as an estimation problem: the inputs of the equations for any trajectory and intensity of gusts."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.air.magnetometer import Compass
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.trajectory.block_means import BLOCK, BlockMeans
from flightpower.analysis.trajectory.equations import (
    MEASUREMENTS,
    SENSOR_ERRORS,
    STATES,
    EquationInputs,
    NamedArrays,
)
from flightpower.analysis.trajectory.extrapolation import extrapolated
from flightpower.analysis.trajectory.gusts import ObservedGust, intensity_of
from flightpower.analysis.trajectory.inertial import InertialInputs
from flightpower.analysis.trajectory.measurements import LevelField, Measurements
from flightpower.analysis.trajectory.priors import (
    SensorPriors,
    begins_at_rest,
    initial_sensor_errors,
    initial_state_sigma,
    initial_states,
    noise_at_rest,
    sensor_error_prior,
    zeros_at_rest,
)
from flightpower.analysis.trajectory.process import GustConditions, ProcessModel, airspeed_without_gusts
from flightpower.analysis.trajectory.regressors import Regressors
from flightpower.analysis.trajectory.settings import PREDICTION, PROCESS, SENSORS
from flightpower.analysis.trajectory.smoother import TrajectoryPrior
from flightpower.flight.arrays import Array
from flightpower.flight.units import GRAVITY_MPS2

GPS_LATENCY = SENSOR_ERRORS.index("gps_latency")
FLOW_ANGLES = [MEASUREMENTS.index(name) for name in ("alpha", "beta")]


class TrajectoryProblem:
    """A flight's data in the form that the equations need.

    blocks, equations, measurements, regressors, conditions : see their classes
    height_noise : as in `SensorPriors`
    lost : (n-1,) whether the attitude over a step cannot be followed, so that the gyros are ignored there
    error_mean, error_sigma : (m,) prior of the sensor errors
    initial_states (n, nx), initial_errors (m,) : first estimate
    """

    def __init__(
        self,
        table: pd.DataFrame,
        rest: list[slice],
        priors: SensorPriors = SensorPriors(),
        compass: Compass | None = None,
    ):
        self.blocks = blocks = BlockMeans(table)
        # Imported here so that a flight without a trajectory neither loads nor needs CasADi (280 MB).
        from flightpower.analysis.trajectory.linearized_equations import Equations

        self.equations = Equations(blocks.n)
        noise = noise_at_rest(table, rest, priors.resolution)
        at_rest = _blocks_at_rest(rest, blocks.n)
        noise["static_Pa"] *= priors.height_noise
        self.height_noise = priors.height_noise
        V = pd.Series(blocks["V_mps"])
        smooth_V = V.interpolate(limit_direction="both").rolling(5, center=True, min_periods=1).mean()
        slowest_mps = PROCESS.slowest_mps * blocks.speed_scale
        V_reference = np.maximum(smooth_V.fillna(slowest_mps).to_numpy(), slowest_mps)
        V_predicted, _ = extrapolated(blocks["V_mps"], blocks.in_flight, blocks.step_s, newest=PREDICTION.newest)
        field = LevelField(compass, blocks)
        self._inertial = InertialInputs(table, blocks, noise)
        self.lost = np.zeros(blocks.n - 1, dtype=bool)
        self.conditions = GustConditions(blocks, V_reference)
        self.measurements = Measurements(table, blocks, at_rest, noise, V_reference=V_reference, field=field)
        V_noise_mps, alpha_noise_rad, beta_noise_rad = (
            _noise(self.measurements.weight[:, MEASUREMENTS.index(name)]) for name in ("V", "alpha", "beta")
        )
        cruise_mps = self.conditions.cruise_mps
        # Noise of block means as speeds, in the order of the gusts' axes.
        self._noise_mps = noise_mps = V_noise_mps, beta_noise_rad * cruise_mps, alpha_noise_rad * cruise_mps
        self.regressors = Regressors(blocks, V_predicted, noise_mps, self.conditions, field)
        self._begins_at_rest = begins_at_rest(at_rest)

        gps, has_compass = self.measurements.has_gps, self.measurements.has_compass
        zeros = zeros_at_rest(table, rest, noise)
        self.error_mean, self.error_sigma = sensor_error_prior(priors, zeros, gps=gps)
        bank = table["bank_rad"].to_numpy()[blocks.rows]
        self.initial_states = initial_states(blocks, bank, V_reference, field if has_compass else None)
        self.initial_errors = initial_sensor_errors(
            self.error_mean, blocks, self.initial_states, field if gps and has_compass else None
        )

    def process_model(self, x: Array, sigma_w_mps: float) -> ProcessModel:
        """The process model at states x (n, nx) for vertical gusts of this standard deviation."""
        without_gusts_mps = airspeed_without_gusts(NamedArrays(STATES, x.T))
        process = ProcessModel(self._inertial, self.blocks, self.conditions, sigma_w_mps, without_gusts_mps)
        # Over lost steps attitude is unknown, and so is the direction of the specific force, which adds to gravity.
        for columns, sigma in ((slice(0, 3), np.pi), (slice(3, 6), 2 * GRAVITY_MPS2 * self.blocks.step_s)):
            weight = process.weight[:, columns]
            weight[self.lost] = np.minimum(weight[self.lost], 1 / sigma)
        return process

    def leave_out_lost_steps(self, angle_residual_rad: Array) -> None:
        """Stop following the attitude over steps whose residuals of Euler angles (n-1, 3) no gyro noise explains.

        When an aircraft pitches through the vertical, its bank and heading reverse at once, and iterations that have to
        follow do not converge. If more than a small fraction of the flight would be lost, the data contradict each
        other, and no more steps are left out.
        """
        largest_rad = SENSORS.missing[0] * self.blocks.step_s
        too_large = (np.abs(angle_residual_rad) > largest_rad).any(axis=1)
        lost = self.lost | (np.convolve(too_large, np.ones(3), mode="same") > 0)  # and a step before and after
        if lost.mean() < STATISTICS.unmentioned_share:
            self.lost = lost

    def equation_inputs(self, x: Array, sensor_errors: Array, sigma_w_mps: float) -> EquationInputs:
        """Inputs of the equations at states x (n, nx) and sensor errors (m,), for this intensity of gusts."""
        process = self.process_model(x, sigma_w_mps)
        corrections = self._inertial.coning_and_sculling(x[:, :3], sensor_errors)
        actual, predicted = self.regressors.measurement_inputs(x, sensor_errors, sigma_w_mps)
        measured, weight = self.measurements.at_gps_latency(float(sensor_errors[GPS_LATENCY]))
        between = np.append(False, self.lost) & np.append(self.lost, False)
        weight[np.ix_(between, FLOW_ANGLES)] = 0.0  # the attitude is unknown
        return EquationInputs(
            process_inputs=process.with_corrections(corrections),
            process_weight=process.weight,
            measured=measured,
            measurement_weight=weight,
            measurement_inputs=actual,
            predicted_states=self.regressors.predicted_states(x),
            predicted_inputs=predicted,
        )

    def gust_intensity(self, octaves: float, middle_mps: float) -> float:
        """The intensity of vertical gusts [m/s] for this vertex of the evidence, from `intensity_of`."""
        gusts = self.conditions.in_cruise(1.0)
        observed = [ObservedGust(gust, noise_mps) for gust, noise_mps in zip(gusts, self._noise_mps, strict=True)]
        return intensity_of(octaves, middle_mps, observed, self.blocks.step_s)

    def remaining_errors(self, sensor_errors: Array, sigma_w_mps: float) -> tuple[Array, TrajectoryPrior]:
        """Sensor errors (m,) in the linearized equations, and the prior. GPS has already been shifted by the latency of
        the current iteration, so this latency is subtracted from both."""
        applied = np.zeros(len(SENSOR_ERRORS))
        applied[GPS_LATENCY] = sensor_errors[GPS_LATENCY]
        heading_measured = self.measurements.has_gps or self.measurements.has_compass
        sigma = initial_state_sigma(sigma_w_mps, heading_measured=heading_measured, at_rest=self._begins_at_rest)
        prior = TrajectoryPrior(self.initial_states[0], sigma, self.error_mean - applied, self.error_sigma)
        return sensor_errors - applied, prior


def _blocks_at_rest(rest: list[slice], n: int) -> NDArray[np.bool_]:
    """Which blocks (n,) lie wholly within a rest. rest: rows of the table."""
    at_rest = np.zeros(n, dtype=bool)
    for rows in rest:
        at_rest[-(-rows.start // BLOCK) : rows.stop // BLOCK] = True
    return at_rest


def _noise(weight: Array) -> float:
    """Standard deviation of a measurement: median where it was measured, infinite where it never was."""
    measured = weight[weight > 0]
    return float(1 / np.median(measured)) if len(measured) else np.inf
