"""Inputs of the measurement equations: regressors of the sensor errors, actual and predicted from past data.

A regressor of a sensor error must be uncorrelated with the current gust. The aircraft's motion responds to gusts; a
regressor that contains this response attributes the gust to the sensor. So the residuals use actual values, which
make them exact, and the derivatives use values predicted from past data (instrumental variables).
"""

from typing import NamedTuple

import numpy as np
from scipy import linalg

from flightpower.analysis.sources.grid import CubicSpline, local_quadratic, stretches, without_gaps
from flightpower.analysis.trajectory.block_means import BlockMeans
from flightpower.analysis.trajectory.equations import (
    ALPHA_REGRESSORS,
    MEASUREMENT_INPUTS,
    SENSOR_ERRORS,
    STATES,
    NamedArrays,
    vibration,
)
from flightpower.analysis.trajectory.extrapolation import extrapolated
from flightpower.analysis.trajectory.measurements import LevelField
from flightpower.analysis.trajectory.process import GustConditions, airspeed_without_gusts
from flightpower.analysis.trajectory.settings import PREDICTION, PROCESS
from flightpower.flight import motion
from flightpower.flight.arrays import Array, BoolArray
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.probe_maps import ALPHA_PORT_SLOPE
from flightpower.flight.units import GRAVITY_MPS2

LAGS = PREDICTION.lags


def parabola_fit(values: Array, over: Array, flying: BoolArray) -> Array:
    """Values (n,) of the least-squares parabola of `values` over another quantity; 0 on the ground."""
    fitted = flying & np.isfinite(values)
    if fitted.sum() < 3 or np.ptp(over[fitted]) == 0:
        return np.zeros(len(values))
    return np.where(flying, np.polyval(np.polyfit(over[fitted], values[fitted], 2), over), 0.0)


def projected_on_past(
    current: Array, past: Array, decay: Array, flying: BoolArray, increment_over_noise: Array | float = np.inf
) -> Array:
    """Least-squares prediction of `current` (n, m) from functions `past` (n, k) of past data; 0 on the ground.

    decay : (n-1,) decay factors of a gust over each step. increment_over_noise : (n-1,) standard deviation of the
    gust's increment over that of white noise, in the measurement that the prediction is for

    A filter that makes the sum of gust and noise white precedes least squares, which then weights values as a smoother
    does: only their increments beyond the decay where there is no noise, the values themselves where there is no gust.
    So instrument z and regressor x have z'x = z'z, and the covariance that the smoother computes is the true one
    (estimators.md). With noise ignored, z'x was -0.3 z'z in calm air for the lag of the angle of attack.
    """
    two_in_flight = flying[1:] & flying[:-1]
    returned = _moving_average(decay, increment_over_noise)
    w_current, w_past = (
        _whitened(values, decay, returned, two_in_flight)[1:][two_in_flight] for values in (current, past)
    )
    return np.where(flying[:, None], past @ np.linalg.lstsq(w_past, w_current, rcond=None)[0], 0.0)


def _moving_average(decay: Array, increment_over_noise: Array | float) -> Array:
    """The moving-average coefficient (n-1,) of a first-order gust plus white noise, written as an ARMA(1, 1) process.

    The increments beyond the decay have variance a^2 + 1 + decay^2 and covariance -decay, in units of the noise
    variance; a is `increment_over_noise`.
    """
    ratio = (increment_over_noise**2 + 1 + decay**2) / np.maximum(decay, np.finfo(float).tiny)
    return np.asarray(2 / (ratio + np.sqrt(ratio**2 - 4)))


def _whitened(values: Array, decay: Array, returned: Array, two_in_flight: BoolArray) -> Array:
    """Innovations (n, k): w_i = v_i - decay v_i-1 + returned w_i-1 where both instants are in flight, 0 elsewhere."""
    increments = np.zeros_like(values)
    increments[1:][two_in_flight] = values[1:][two_in_flight] - decay[two_in_flight, None] * values[:-1][two_in_flight]
    band = np.ones((2, len(values)))
    band[1, :-1] = -np.where(two_in_flight, returned, 0.0)
    return np.asarray(linalg.solve_banded((1, 0), band, increments))


def lagged(values: Array, flying: BoolArray) -> Array:
    """`values` LAGS blocks earlier, (n, len(LAGS)), newest first; 0 on the ground, and constant before a flight.

    Lag 1 is left out (PREDICTION.newest).
    """
    past = np.zeros((len(values), len(LAGS)))
    for rows in stretches(flying):
        before = np.arange(rows.start, rows.stop)[:, None] - LAGS
        past[rows] = values[np.maximum(before, rows.start)]
    return past


def has_past(flying: BoolArray) -> BoolArray:
    """Whether the aircraft was in flight at all LAGS before each instant, (n,)."""
    settled = np.zeros(len(flying), dtype=bool)
    for rows in stretches(flying):
        settled[rows.start + LAGS[-1] : rows.stop] = True
    return settled


def derivative(values: Array, flying: BoolArray, step_s: float) -> Array:
    """Derivative by a local quadratic over PREDICTION.slow_s; 0 on the ground and in stretches shorter than that."""
    window = 2 * round(PREDICTION.slow_s / step_s / 2) + 1
    rate = np.zeros(len(values))
    for rows in stretches(flying):
        if rows.stop - rows.start >= window:
            rate[rows] = local_quadratic(values[rows], window, 1, step_s)
    return rate


class _LiftHistory(NamedTuple):
    """Lift coefficient (n,), up to a common factor: prediction from past data, its derivative, and measured value.

    turning : (n,) [1/m] pitch rate over airspeed of the steady level turn that past data predict
    """

    predicted: Array
    predicted_rate: Array
    measured: Array
    turning: Array


class Regressors:
    """MEASUREMENT_INPUTS for trajectories of one flight."""

    def __init__(
        self,
        blocks: BlockMeans,
        measured_V_predicted: Array,
        noise_mps: tuple[float, float, float],
        conditions: GustConditions,
        field: LevelField,
    ):
        """measured_V_predicted: (n,) measured airspeed, predicted from past data. noise_mps: noise of block means of
        airspeed, sideslip and angle of attack, angles times the cruise speed."""
        self._V_noise_mps, _, self._alpha_noise_mps = noise_mps
        self._blocks, self._flying, self._step_s = blocks, blocks.flying, blocks.step_s
        # Bridges short gaps: otherwise predictions would restart from the current gust after each missing block.
        self._in_flight = blocks.in_flight
        self._measured_V_predicted, self._conditions, self._field = measured_V_predicted, conditions, field
        self._slowest_mps = PROCESS.slowest_mps * blocks.speed_scale
        self._by_upwash, self._by_rotation, beta_by_rotation = (
            np.nan_to_num(blocks[name]) if name in blocks else np.zeros(blocks.n)
            for name in ("alpha_by_upwash_rad", "alpha_by_rotation_rad", "beta_by_rotation_rad")
        )
        self._pitch_rate, self._yaw_rate = (self._bridged(blocks[name]) for name in ("q_radps", "r_radps"))
        self._probe_beta_rate = CubicSpline(blocks.t_s, self._bridged(blocks["beta_rad"] + beta_by_rotation))(
            blocks.t_s, 1
        )

    def measurement_inputs(self, x: Array, sensor_errors: Array, sigma_w_mps: float) -> tuple[Array, Array]:
        """MEASUREMENT_INPUTS (n, ·) at states x and sensor errors of the current iteration: actual, and predicted from
        past data."""
        errors, state, blocks = NamedArrays(SENSOR_ERRORS, sensor_errors), NamedArrays(STATES, x.T), self._blocks
        inertial_V = airspeed_without_gusts(state)
        V = np.maximum(self._extrapolated(inertial_V)[0], self._slowest_mps)
        _, V_rate_predicted = self._extrapolated(inertial_V, PREDICTION.rate_s)
        V_regressors = np.column_stack([inertial_V, derivative(inertial_V, self._in_flight, self._step_s)])
        V_instruments = self._airspeed_instruments(inertial_V, V_regressors, sigma_w_mps)
        measured_V = np.maximum(self._measured_V_predicted / (1 + errors.V_scale), self._slowest_mps)
        cos_bank = np.cos(np.clip(self._extrapolated(state.phi)[0], -1.2, 1.2))  # a steeper prediction is useless
        lift = 1 / (measured_V**2 * cos_bank)  # lift coefficient up to a factor
        az = np.nan_to_num(blocks["az_mps2"], nan=-9.8)
        regressors, predicted_regressors, alpha_predicted = self._alpha(
            state,
            errors,
            _LiftHistory(
                lift,
                lift * V_rate_predicted / V,
                -az / measured_V**2,
                GRAVITY_MPS2 * (1 / cos_bank - cos_bank) / measured_V**2,
            ),
            sigma_w_mps,
            inertial_V,
        )
        field_forward, field_right = self._field.leveled(state.phi, state.theta)
        qbar_Pa = np.nan_to_num(blocks["rho"], nan=SEA_LEVEL_DENSITY) * V**2 / 2
        common = {
            "ax": np.nan_to_num(blocks["ax_mps2"]),
            "ay": np.nan_to_num(blocks["ay_mps2"]),
            "az": az,
            "vibration": vibration(blocks["n_revps"]),
            "V_predicted": V,
            "alpha_predicted": alpha_predicted,
            "transverse_gust_variance": np.full(blocks.n, self._conditions.transverse_variance(sigma_w_mps)),
            "dlnV_dlndp_alpha": parabola_fit(blocks["dlnV_dlndp_alpha"], 1 / (V**2 * cos_bank), self._flying),
            "V_scale_per_Pa": 1 / (2 * qbar_Pa),
            "alpha_per_Pa": 1 / (ALPHA_PORT_SLOPE * qbar_Pa),
            "field_forward": np.nan_to_num(field_forward),
            "field_right": np.nan_to_num(field_right),
        }

        def columns(airspeed: Array, beta_rate: Array, yawing: Array, alpha: dict[str, Array]) -> Array:
            named = common | {"V_mean": airspeed[:, 0], "V_rate": airspeed[:, 1]} | alpha
            named["probe_beta_rate"], named["beta_per_m_ahead"] = beta_rate * self._flying, yawing
            return np.column_stack([named[name] for name in MEASUREMENT_INPUTS])

        # Past data do not predict the derivative of sideslip, nor quick yawing: sideslip contributes neither to the
        # estimate of the lag nor to that of the probe's place.
        none = np.zeros(blocks.n)
        return (
            columns(V_regressors, self._probe_beta_rate, self._yaw_rate / V * self._flying, regressors),
            columns(V_instruments, none, none, predicted_regressors),
        )

    def _airspeed_instruments(self, inertial_V: Array, regressors: Array, sigma_w_mps: float) -> Array:
        """Instruments (n, 2): a constant airspeed, and its derivative predicted from past inertial speed.

        A pilot who holds airspeed changes inertial speed with the gusts of the last 10 s, and gusts persist: past
        speed shows more of the current gust than noisy air data do (docs/understand/estimators.md).
        """
        V, _ = self._extrapolated(inertial_V, newest=PREDICTION.newest)
        _, V_rate = self._extrapolated(inertial_V, PREDICTION.rate_s, PREDICTION.newest)
        constant = np.ones((len(V), 1))
        decay, increment_mps = self._conditions.longitudinal_steps(sigma_w_mps, inertial_V)
        filter_arguments = decay, self._flying, increment_mps / self._V_noise_mps
        mean = projected_on_past(regressors[:, :1], constant, *filter_arguments)
        return np.hstack(
            [mean, projected_on_past(regressors[:, 1:], np.column_stack([constant, V, V_rate]), *filter_arguments)]
        )

    def predicted_states(self, x: Array) -> Array:
        """The states with vertical velocity predicted from past data: the aircraft heaves with a gust within a step."""
        predicted, down = x.copy(), STATES.index("v_down")
        v_down, _ = self._extrapolated(x[:, down])
        predicted[self._flying, down] = v_down[self._flying]
        return predicted

    def _bridged(self, values: Array) -> Array:
        """Values (n,) in flight, interpolated linearly elsewhere; 0 where there are none."""
        return np.nan_to_num(without_gaps(np.where(self._flying, values, np.nan)))

    def _extrapolated(self, values: Array, window_s: float = PREDICTION.slow_s, newest: int = 1) -> tuple[Array, Array]:
        return extrapolated(values, self._in_flight, self._step_s, window_s, newest)

    def _alpha(
        self,
        state: NamedArrays,
        errors: NamedArrays,
        history: _LiftHistory,
        sigma_w_mps: float,
        inertial_V: Array,
    ) -> tuple[dict[str, Array], dict[str, Array], Array]:
        """ALPHA_REGRESSORS, actual and predicted, and the predicted angle of attack at the center of gravity.

        The change of the angle due to its slope [rad] follows from the probe's calibration for a relative change of
        dp_alpha. The prediction uses predicted lift and its derivative, and the measured lift some blocks before. So
        stick movements are predicted, and the current gust is not. Earlier reconstructed angles would contain
        errors of the states that last for seconds: with them the slope was 4 % low for an aircraft that flies at 7 m/s
        in gusts (16 flights).
        """
        flying = self._flying
        at_probe = self._blocks["alpha_rad"] + self._by_upwash + self._by_rotation
        slope = errors.alpha_scale - 2 * errors.V_scale
        # The angle is used without its offset, so that the offset keeps its meaning: the reading at zero angle.
        by_slope = (self._blocks["dalpha_dlndp_alpha_rad"] - errors.alpha_bias) / (1 + slope)
        measured = at_probe - errors.alpha_bias - slope * by_slope
        steady = state.v_north - state.wind_north, state.v_east - state.wind_east, state.v_down
        u, _, w = motion.body_from_earth(steady, (state.phi, state.theta, state.psi))
        inertial = self._bridged(np.arctan2(w, u))
        curvature = np.zeros(len(inertial))
        curvature[1:-1] = np.diff(inertial, 2) / 24  # a parabola's mean over a block less the value at its center
        bridged, t_s = self._bridged(measured), self._blocks.t_s
        alpha = bridged - self._by_upwash - self._by_rotation
        by_slope = self._bridged(by_slope)
        by_V_scale = -2 * by_slope + 2 * self._by_upwash + self._by_rotation
        excess_load = self._bridged(-self._blocks["az_mps2"] / GRAVITY_MPS2 - 1)
        alpha_rate = CubicSpline(t_s, bridged)(t_s, 1)
        actual = np.column_stack([by_slope, alpha_rate, by_V_scale, excess_load, alpha]) * flying[:, None]
        past = np.column_stack(
            [
                np.ones(len(inertial)),
                history.predicted,
                history.predicted_rate,
                lagged(history.measured, self._in_flight),
            ]
        )
        decay, increment_mps = self._conditions.vertical_steps(sigma_w_mps, inertial_V)
        filter_arguments = decay, flying, increment_mps / self._alpha_noise_mps
        predicted = projected_on_past(actual, past, *filter_arguments)
        pitching = (-self._pitch_rate / np.maximum(inertial_V, self._slowest_mps) * flying)[:, None]
        pitching_predicted = projected_on_past(
            pitching, np.column_stack([np.ones(len(past)), history.turning]), *filter_arguments
        )
        settled = has_past(self._in_flight)[:, None]

        def named(values: Array, pitching: Array) -> dict[str, Array]:
            return dict(zip(ALPHA_REGRESSORS, (*values.T[:4], pitching[:, 0], curvature * flying), strict=True))

        return (
            named(actual, pitching),
            named(predicted * settled, pitching_predicted * settled),
            predicted[:, 4],
        )
