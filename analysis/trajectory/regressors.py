"""Inputs of the measurement equations: regressors of the sensor errors, actual and predicted from past data.

Actual values make the residuals exact; predicted ones are in the derivatives, which must be uncorrelated with the
current gust (instrumental variables).
"""

import numpy as np
from numpy.typing import NDArray

from analysis.signals.cubic_spline import CubicSpline
from analysis.signals.gaps import without_gaps
from analysis.trajectory.block_means import BlockMeans
from analysis.trajectory.equations import ALPHA_REGRESSORS, MEASUREMENT_INPUTS, SENSOR_ERRORS, STATES, NamedArrays
from analysis.trajectory.instrumental_variables import (
    NEWEST,
    RATE_S,
    SLOW_S,
    derivative,
    extrapolated,
    has_past,
    lagged,
    parabola_fit,
    projected_on_past,
)
from analysis.trajectory.level_field import LevelField
from analysis.trajectory.measurements import ALPHA_PORT_SLOPE
from analysis.trajectory.process import SLOWEST_MPS, GustConditions, airspeed_without_gusts
from flight import motion
from flight.atmosphere import SEA_LEVEL_DENSITY

Array = NDArray[np.float64]

LARGEST_BANK_RAD = 1.2


class Regressors:
    """MEASUREMENT_INPUTS for trajectories of one flight."""

    def __init__(
        self,
        blocks: BlockMeans,
        measured_V_predicted: Array,
        V_noise_mps: float,
        alpha_noise_rad: float,
        conditions: GustConditions,
        field: LevelField,
    ):
        """measured_V_predicted: (n,) measured airspeed, predicted from past data; V_noise_mps, alpha_noise_rad: noise
        of a block."""
        self._V_noise_mps = V_noise_mps
        self._alpha_noise_mps = alpha_noise_rad * conditions.cruise_mps
        self._blocks, self._flying, self._step_s = blocks, blocks.flying, blocks.step_s
        self._measured_V_predicted, self._conditions, self._field = measured_V_predicted, conditions, field
        self._slowest_mps = SLOWEST_MPS * blocks.speed_scale
        self._by_upwash, self._by_rotation, beta_by_rotation = (
            np.nan_to_num(blocks[name]) if name in blocks else np.zeros(blocks.n)
            for name in ("alpha_by_upwash_rad", "alpha_by_rotation_rad", "beta_by_rotation_rad")
        )
        self._probe_beta_rate = CubicSpline(blocks.t_s, self._bridged(blocks["beta_rad"] + beta_by_rotation))(
            blocks.t_s, 1
        )

    def measurement_inputs(self, x: Array, sensor_errors: Array, sigma_w_mps: float) -> tuple[Array, Array]:
        """MEASUREMENT_INPUTS (n, ·) at states x and sensor errors of the current iteration: actual, and predicted from
        past data."""
        errors, state, blocks = NamedArrays(SENSOR_ERRORS, sensor_errors), NamedArrays(STATES, x.T), self._blocks
        inertial_V = airspeed_without_gusts(state)
        V = np.maximum(self._extrapolated(inertial_V)[0], self._slowest_mps)
        _, V_rate_predicted = self._extrapolated(inertial_V, RATE_S)
        V_regressors = np.column_stack([inertial_V, derivative(inertial_V, self._flying, self._step_s)])
        V_instruments = self._airspeed_instruments(inertial_V, V_regressors, sigma_w_mps)
        measured_V = np.maximum(self._measured_V_predicted / (1 + errors.V_scale), self._slowest_mps)
        cos_bank = np.cos(np.clip(self._extrapolated(state.phi)[0], -LARGEST_BANK_RAD, LARGEST_BANK_RAD))
        lift = 1 / (measured_V**2 * cos_bank)  # lift coefficient up to a factor
        az = np.nan_to_num(blocks["az_mps2"], nan=-9.8)
        regressors, predicted_regressors, alpha_predicted = self._alpha(
            state, errors, lift, lift * V_rate_predicted / V, -az / measured_V**2, sigma_w_mps, inertial_V
        )
        field_forward, field_right = self._field.leveled(state.phi, state.theta)
        qbar_Pa = np.nan_to_num(blocks["rho"], nan=SEA_LEVEL_DENSITY) * V**2 / 2
        common = {
            "ax": np.nan_to_num(blocks["ax_mps2"]),
            "ay": np.nan_to_num(blocks["ay_mps2"]),
            "az": az,
            "V_predicted": V,
            "alpha_predicted": alpha_predicted,
            "transverse_gust_variance": np.full(blocks.n, self._conditions.transverse_variance(sigma_w_mps)),
            "dlnV_dlndp_alpha": parabola_fit(blocks["dlnV_dlndp_alpha"], 1 / (V**2 * cos_bank), self._flying),
            "V_scale_per_Pa": 1 / (2 * qbar_Pa),
            "alpha_per_Pa": 1 / (ALPHA_PORT_SLOPE * qbar_Pa),
            "field_forward": np.nan_to_num(field_forward),
            "field_right": np.nan_to_num(field_right),
        }

        def columns(airspeed: Array, beta_rate: Array, alpha: dict[str, Array]) -> Array:
            named = common | {"V_mean": airspeed[:, 0], "V_rate": airspeed[:, 1]} | alpha
            named["probe_beta_rate"] = beta_rate * self._flying
            return np.column_stack([named[name] for name in MEASUREMENT_INPUTS])

        # Past data do not predict the derivative of sideslip: sideslip does not contribute to the estimate of the lag.
        no_rate = np.zeros(blocks.n)
        return columns(V_regressors, self._probe_beta_rate, regressors), columns(
            V_instruments, no_rate, predicted_regressors
        )

    def _airspeed_instruments(self, inertial_V: Array, regressors: Array, sigma_w_mps: float) -> Array:
        """In place of `regressors` (n, 2): a constant airspeed, and its derivative predicted from past inertial speed.

        A pilot who holds airspeed changes the inertial speed by the gusts of the last 10 s, and these last: past speed
        knows more of the current gust than noisy air data do (docs/estimators.md).
        """
        V, _ = self._extrapolated(inertial_V, newest=NEWEST)
        _, V_rate = self._extrapolated(inertial_V, RATE_S, NEWEST)
        constant = np.ones((len(V), 1))
        decay, increment_mps = self._conditions.longitudinal_steps(sigma_w_mps, inertial_V)
        at = decay, self._flying, increment_mps / self._V_noise_mps
        mean = projected_on_past(regressors[:, :1], constant, *at)
        return np.hstack([mean, projected_on_past(regressors[:, 1:], np.column_stack([constant, V, V_rate]), *at)])

    def predicted_states(self, x: Array) -> Array:
        """The states with vertical velocity predicted from past data: the aircraft heaves with a gust within a step."""
        predicted, down = x.copy(), STATES.index("v_down")
        v_down, _ = self._extrapolated(x[:, down])
        predicted[self._flying, down] = v_down[self._flying]
        return predicted

    def _bridged(self, values: Array) -> Array:
        """Values (n,) in flight, interpolated linearly elsewhere; 0 where there are none."""
        return np.nan_to_num(without_gaps(np.where(self._flying, values, np.nan)))

    def _extrapolated(self, values: Array, window_s: float = SLOW_S, newest: int = 1) -> tuple[Array, Array]:
        return extrapolated(values, self._flying, self._step_s, window_s, newest)

    def _alpha(
        self,
        state: NamedArrays,
        errors: NamedArrays,
        lift: Array,
        lift_rate: Array,
        load: Array,
        sigma_w_mps: float,
        inertial_V: Array,
    ) -> tuple[dict[str, Array], dict[str, Array], Array]:
        """ALPHA_REGRESSORS, actual and predicted, and the predicted angle of attack at the centre of gravity.

        The angle's change by its slope [rad] is that of the probe's calibration for a relative change of dp_alpha.
        lift, lift_rate : predicted lift coefficient and its derivative, up to a factor
        load : lift coefficient by the accelerometer, up to the same factor
        The prediction uses the first two and the third some blocks before. So stick movements are predicted, and the
        current gust is not. Earlier reconstructed angles instead contain errors of the states that last for seconds:
        an aircraft that flies at 7 m/s in gusts had a slope 4 % low (16 flights).
        """
        flying = self._flying
        at_probe = self._blocks["alpha_rad"] + self._by_upwash + self._by_rotation
        slope = errors.alpha_scale - 2 * errors.V_scale
        # Of the angle without the offset, so that the offset keeps its meaning: what is measured at zero angle.
        by_slope = (self._blocks["dalpha_dlndp_alpha_rad"] - errors.alpha_bias) / (1 + slope)
        measured = at_probe - errors.alpha_bias - slope * by_slope
        steady = state.v_north - state.wind_north, state.v_east - state.wind_east, state.v_down
        u, _, w = motion.body_from_earth(*steady, state.phi, state.theta, state.psi)
        inertial = self._bridged(np.arctan2(w, u))
        curvature = np.zeros(len(inertial))
        curvature[1:-1] = np.diff(inertial, 2) / 24  # a parabola's mean over a block less the value at its center
        bridged, t_s = self._bridged(measured), self._blocks.t_s
        alpha = bridged - self._by_upwash - self._by_rotation
        by_slope = self._bridged(by_slope)
        by_V_scale = -2 * by_slope + 2 * self._by_upwash + self._by_rotation
        actual = np.column_stack([by_slope, CubicSpline(t_s, bridged)(t_s, 1), by_V_scale, alpha]) * flying[:, None]
        past = np.column_stack([np.ones(len(inertial)), lift, lift_rate, lagged(load, flying)])
        decay, increment_mps = self._conditions.vertical_steps(sigma_w_mps, inertial_V)
        predicted = projected_on_past(actual, past, decay, flying, increment_mps / self._alpha_noise_mps)
        instruments = predicted * has_past(flying)[:, None]

        def named(values: Array) -> dict[str, Array]:
            return dict(zip(ALPHA_REGRESSORS, (*values.T[:3], curvature * flying), strict=True))

        return named(actual), named(instruments), predicted[:, 3]
