"""From synchronised data to what the equations of the path want: means and integrals over blocks, weights, priors.

Exact integrals of the inertial sensors carry everything faster than a block from one to the next.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from analysis.airdata.air import LEAST_HEIGHT_M
from analysis.airdata.magnetometer import Compass
from analysis.trajectory import dryden as gusts
from analysis.trajectory import instruments as slow
from analysis.trajectory.blocks import BLOCK, block_mean, smoothed
from analysis.trajectory.equations import GIVEN, MOVE, SENSOR_ERRORS, SHOWN, STATES, Data, Equations, Named
from flight import motion

Array = NDArray[np.float64]

ADDED = slice(MOVE.index("more_phi"), MOVE.index("more_down") + 1)
SLOWEST_MPS = 5.0
FIRST_BLOCKS = 25  # a log that stands within its first five seconds began at rest

# Standard deviations assumed where the log itself does not show them.
BENCH = {"p_radps": 0.005, "q_radps": 0.005, "r_radps": 0.005, "ax_mps2": 0.06, "ay_mps2": 0.06, "az_mps2": 0.06,
         "dp_alpha_Pa": 6.0, "dp_beta_Pa": 6.0, "q_c_Pa": 6.0, "static_Pa": 6.0}  # fmt: skip
GYRO_SCALE, ACCEL_SCALE = 0.005, 0.002  # of what is measured, as if it were noise
WIND_WALK_MPS = 0.02  # in a second: height, place and hour, without turbulence
# GPS errors wander over a minute; the horizontal ones look like wind, and height itself is the barometer's.
GPS_MPS, GPS_DOWN_MPS, REST_MPS = 0.3, 1.0, 0.1

PRIOR_SIGMA = {
    "p_bias": 0.002, "q_bias": 0.002, "r_bias": 0.002,  # about the zeros at rest
    "ax_bias": 0.19, "ay_bias": 0.19, "az_bias": 0.19,
    "alpha_bias": np.radians(1.0), "alpha_scale": 0.03, "beta_bias": np.radians(1.0), "V_scale": 0.0125,
    "air_data_lag": 0.012, "gps_latency": 0.2,
    "heading_bias": np.radians(10.0),  # declination where people live, and how the tray sits
}  # fmt: skip
PRIOR_MEAN = {"gps_latency": 0.1}
# Without GPS, north is the compass's; without either, where the nose pointed at first. So well:
NORTH_RAD = 0.01
# The iron left in a field is a function of heading, and motor current of speed: they come again with every leg, and a
# longer flight does not average them out. However long it is, its blocks together count as so many measurements.
INDEPENDENT_HEADINGS = 4
COMPASS_S = 10.0  # over which the compass is averaged to begin with


class Problem:
    """A flight's data as the equations want them, for any path and any intensity of gusts.

    n, t_s : instants, the middles of the blocks       weight : (n, len(SHOWN)) of what is shown, 0 where nothing is
    first : (nx,) the state to begin with, and its standard deviation, of `begun`       prior : of the shared numbers
    headings : by how much the compass is weighed down   equations : over the n instants
    """

    def __init__(self, table: pd.DataFrame, still: list[slice], alpha_scale_sigma: float, compass: Compass | None):
        self._rate_Hz = 1 / float(table.index[1] - table.index[0])
        self._noise = _noise_at_rest(table, still)
        self.n = len(table) // BLOCK
        self._center = np.arange(self.n) * BLOCK + BLOCK // 2
        self.t_s = table.index.to_numpy()[self._center]
        self._table = table
        self.equations = Equations(self.n)
        self._mean = {name: block_mean(table[name], self.n) for name in table.columns}
        V = pd.Series(self._mean["V_mps"])
        self._flying = (self._mean["height_m"] > LEAST_HEIGHT_M) & np.isfinite(V.to_numpy())
        smooth = V.interpolate(limit_direction="both").rolling(5, center=True, min_periods=1).mean()
        self._V_reference = np.maximum(smooth.fillna(5.0).to_numpy(), 5.0)
        self._felt_V, _ = slow.foreseen(self._mean["V_mps"], self._flying, BLOCK / self._rate_Hz)
        self._has_gps = bool(table["gps_north_mps"].notna().any())
        self._field_T = _blocks_of(compass, self.n)
        self._still = np.zeros(self.n, dtype=bool)
        for rows in still:
            self._still[-(-rows.start // BLOCK) : rows.stop // BLOCK] = True
        self._move, self._move_sigma = self._integrated()
        flown = self._flying if self._flying.any() else slice(None)
        self._cruise_mps = float(np.median(self._V_reference[flown]))
        self._cruise_height_m = float(np.nanmedian(self._mean["height_m"][flown]))
        # Where gusts are met, as the past foretells it; on the ground, where none are seen, as in mid-flight.
        up = self._flying[:-1]
        self._gusty_V = np.where(up, np.maximum(self._felt_V[:-1], SLOWEST_MPS), self._cruise_mps)
        self._gusty_height_m = np.where(up, self._mean["height_m"][:-1], self._cruise_height_m)
        self._gusts_stay = gusts.vertical(1.0, self._gusty_height_m, self._gusty_V).step(BLOCK / self._rate_Hz)[0]
        self.headings = float(np.sqrt(max(self._flying.sum() / INDEPENDENT_HEADINGS, 1.0)))
        self._shown, self.weight = self._what_is_shown(compass.error_T if compass else np.inf)
        self._has_compass = bool(self.weight[:, SHOWN.index("compass")].any())
        self.prior = (
            np.array([PRIOR_MEAN.get(name, 0.0) for name in SENSOR_ERRORS]),
            np.array([PRIOR_SIGMA[name] for name in SENSOR_ERRORS]),
        )
        slope = SENSOR_ERRORS.index("alpha_scale")
        self.prior[1][slope] = np.hypot(self.prior[1][slope], alpha_scale_sigma)
        if not self._has_gps:
            self.prior[1][SENSOR_ERRORS.index("heading_bias")] = NORTH_RAD

    def _integrated(self) -> tuple[Array, Array]:
        """Means of rates and forces from each block's centre to the next, and the noise of the states they lead to."""
        dt = BLOCK / self._rate_Hz
        columns, missing = [], np.zeros(self.n - 1, dtype=bool)
        between = slice(self._center[0], self._center[-1] + 1)
        fine = []
        for name in ("p_radps", "q_radps", "r_radps", "ax_mps2", "ay_mps2", "az_mps2"):
            series = self._table[name]
            gap = series.isna().to_numpy()
            values = series.interpolate(limit_direction="both").fillna(0.0).to_numpy()
            fine.append(values[between])
            total = np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)])
            columns.append(np.diff(total[self._center]) / BLOCK)
            missing |= np.diff(np.cumsum(gap)[self._center]) > 0
        self._fine, self._fine_t_s = np.array(fine), self._table.index.to_numpy()[between]
        move = np.column_stack([*columns, np.full(self.n - 1, dt)])
        move = np.pad(move, ((0, 0), (0, len(MOVE) - move.shape[1])))  # the rest depends on path and gusts
        profile = gusts.profile(smoothed(self._mean["height_m"], 3))
        move[:, MOVE.index("sheared")] = profile[1:] / profile[:-1]
        rates, forces = np.abs(move[:, :3]), np.abs(move[:, 3:6])
        spread = np.sqrt(dt / self._rate_Hz)
        sigma = np.empty((self.n - 1, len(STATES)))
        sigma[:, :3] = np.hypot([self._noise[f"{a}_radps"] * spread for a in "pqr"], GYRO_SCALE * rates * dt) + 1e-5
        noise = [self._noise[f"a{a}_mps2"] * spread for a in "xyz"]
        sigma[:, 3:6] = np.hypot(noise, ACCEL_SCALE * forces * dt) + 1e-4
        # North and east alike: the body's axes stand for the earth's here, and the nose must not turn to suit them.
        sigma[:, 3:5] = np.sqrt(np.mean(sigma[:, 3:5] ** 2, axis=1, keepdims=True))
        sigma[missing, :3] += 0.5 * dt  # nothing was measured: the aircraft may have done anything it usually does
        sigma[missing, 3:6] += 5.0 * dt
        sigma[:, 6] = 2e-3
        sigma[:, 7:9] = WIND_WALK_MPS * np.sqrt(dt)
        return move, sigma

    def _within(self, x: Array, shared: Array) -> Array:
        """What turning between two instants adds to the change of angles and velocity, (n-1, 6).

        The effect of rates and forces, integrated sample by sample along the attitude as it is known by now, less that
        of their means at the mean attitude: coning and sculling, and the arc of a turn. Left out, a turn tilts the
        whole path by a twentieth of a degree.
        """
        error = Named(SENSOR_ERRORS, shared)
        attitude = CubicSpline(self.t_s, x[:, :3])(self._fine_t_s).T
        fine = _effect(attitude, self._fine, error)
        total = np.concatenate([np.zeros((1, 6)), np.cumsum((fine[1:] + fine[:-1]) / 2, axis=0)])
        samples = total[np.arange(self.n) * BLOCK]
        mean = _effect(((x[1:, :3] + x[:-1, :3]) / 2).T, self._move[:, :6].T, error)
        return (np.diff(samples, axis=0) / BLOCK - mean) * BLOCK / self._rate_Hz

    def in_gusts(self, sigma_w_mps: float) -> tuple[Array, Array]:
        """MOVE as far as the path does not matter, and the weights of the process, in turbulence of this intensity."""
        dt = BLOCK / self._rate_Hz
        move, sigma = self._move.copy(), self._move_sigma.copy()
        where = sigma_w_mps, self._gusty_height_m, self._gusty_V
        stays, new = gusts.along(*where).step(dt)
        move[:, MOVE.index("stays_u")], sigma[:, STATES.index("gust_u")] = stays, new
        for name, gust in (("v", gusts.across(*where)), ("w", gusts.vertical(*where))):
            stays, once, twice = gust.step(dt)
            move[:, MOVE.index(f"stays_{name}")] = stays
            sigma[:, STATES.index(f"gust_{name}")] = once
            sigma[:, STATES.index(f"gust_{name}_twice")] = twice
        return move, 1 / sigma

    def begun(self, gust: float) -> Array:
        """Standard deviation of the first state (nx,)."""
        heading = 3.0 if self._has_gps or self._has_compass else NORTH_RAD
        velocity = 0.3 if self._still.any() and np.argmax(self._still) < FIRST_BLOCKS else 10.0
        return np.array([1.0, 0.5, heading, *[velocity] * 3, 3.0, 8.0, 8.0, *[max(gust, 0.01)] * 5])

    def data(self, x: Array, shared: Array, gust: float, move: Array, process_weight: Array) -> Data:
        """What goes into the equations about a path. move, process_weight: of `in_gusts`."""
        move = move.copy()
        move[:, ADDED] = self._within(x, shared)
        given, given_foreseen = self.what_is_given(x, shared, gust)
        shown, weight = self._with_gps(float(shared[SENSOR_ERRORS.index("gps_latency")]))
        return Data(move, process_weight, shown, weight, given, self._as_foreseen(x), given_foreseen)

    def what_is_given(self, x: Array, shared: Array, gust: float) -> tuple[Array, Array]:
        """GIVEN, with the slow flow as path and sensors' errors are known by now; and as the past foretells it."""
        error, state = Named(SENSOR_ERRORS, shared), Named(STATES, x.T)
        mean, step_s = self._mean, BLOCK / self._rate_Hz
        steady = np.sqrt(
            (state.v_north - state.wind_north) ** 2 + (state.v_east - state.wind_east) ** 2 + state.v_down**2
        )
        alpha = (mean["alpha_rad"] - error.alpha_bias) / (1 + error.alpha_scale - 2 * error.V_scale)
        V, _ = slow.foreseen(steady, self._flying, step_s)
        _, slope_foreseen = slow.foreseen(steady, self._flying, step_s, slow.SLOPE_S)
        V = np.maximum(V, SLOWEST_MPS)
        felt_V = np.maximum(self._felt_V / (1 + error.V_scale), SLOWEST_MPS)
        cos_bank = np.cos(np.clip(slow.foreseen(state.phi, self._flying, step_s)[0], -1.2, 1.2))
        load = 1 / (felt_V**2 * cos_bank)
        angle, angle_foretold = self._angle(state, alpha, load, load * slope_foreseen / V)
        field_ahead, field_right = self._levelled(state.phi, state.theta)
        sideways = gusts.across(gust, self._cruise_height_m, self._cruise_mps)
        columns = {
            "gusts_across": np.full(self.n, sideways.sigma_mps**2 + gust**2),
            "ax": np.nan_to_num(mean["ax_mps2"]),
            "ay": np.nan_to_num(mean["ay_mps2"]),
            "az": np.nan_to_num(mean["az_mps2"], nan=-9.8),
            "slow_V": V,
            "slow_alpha": angle_foretold["alpha"],
            # Over what lift takes at the inertial speed: beside airspeed nothing may stand that airspeed showed before.
            "V_per_pair": slow.parabola(mean["V_per_pair"], 1 / (V**2 * cos_bank), self._flying),
            "field_ahead": np.nan_to_num(field_ahead),
            "field_right": np.nan_to_num(field_right),
        }

        def given(slope_V: Array, quick: dict[str, Array]) -> Array:
            return np.column_stack([(columns | {"slope_V": slope_V} | quick)[name] for name in GIVEN])

        return given(slow.slope(steady, self._flying, step_s), angle), given(slope_foreseen, angle_foretold)

    def _angle(
        self, state: Named, alpha: Array, load: Array, loading: Array
    ) -> tuple[dict[str, Array], dict[str, Array]]:
        """ANGLE as it is, and as the past foretells it.

        alpha : as measured     load, loading : lift coefficient foreseen and its derivative, up to a factor
        The past is what lift dictates, and the aircraft's own swinging some blocks before: a stick that goes to and
        fro is foretold, what a gust does now is not.
        """
        flying = self._flying
        steady = state.v_north - state.wind_north, state.v_east - state.wind_east, state.v_down
        u, _, w = motion.body_from_earth(*steady, state.phi, state.theta, state.psi)
        flown = np.where(flying, np.arctan2(w, u), 0.0)
        bent = np.zeros(self.n)
        bent[1:-1] = np.diff(flown, 2) / 24  # a parabola's mean over a block, less its middle
        seen = pd.Series(np.where(flying, alpha, np.nan)).interpolate(limit_direction="both").fillna(0.0)
        now = np.column_stack([seen, CubicSpline(self.t_s, seen)(self.t_s, 1)]) * flying[:, None]
        past = np.column_stack([np.ones(self.n), load, loading, slow.before(flown, flying)])
        foretold = slow.foretold(now, past, self._gusts_stay, flying)
        is_now, is_foretold = (
            {"alpha": angle[:, 0], "slope_alpha": angle[:, 1], "bent_alpha": bent * flying} for angle in (now, foretold)
        )
        return is_now, is_foretold

    def _as_foreseen(self, x: Array) -> Array:
        """The states, but heaving as the past foretells it: an aircraft heaves with a vertical gust within a step."""
        foreseen, down = x.copy(), STATES.index("v_down")
        ahead, _ = slow.foreseen(x[:, down], self._flying, BLOCK / self._rate_Hz)
        foreseen[self._flying, down] = ahead[self._flying]
        return foreseen

    def _what_is_shown(self, field_error_T: float) -> tuple[Array, Array]:
        """Measurements and 1/sigma of each block's mean; noise of the air data is constant in pascals."""
        mean, noise = self._mean, self._noise
        rho = pd.Series(mean["rho"]).interpolate(limit_direction="both").to_numpy()
        qbar = rho * self._V_reference**2 / 2
        root = np.sqrt(BLOCK)
        sigma = {
            "V": noise["q_c_Pa"] / (rho * self._V_reference) / root,
            "alpha": noise["dp_alpha_Pa"] / (4.5 * qbar) / root,  # slope of the pair about 9/2 qbar (method, 7)
            "beta": noise["dp_beta_Pa"] / (4.5 * qbar) / root,
            "height": np.full(self.n, noise["static_Pa"] / 11.8 / root),  # rho g at 100 m
            "v_north": np.full(self.n, REST_MPS),
            "v_east": np.full(self.n, REST_MPS),
            "v_down": np.full(self.n, REST_MPS),
            "gps_north": np.full(self.n, GPS_MPS),
            "gps_east": np.full(self.n, GPS_MPS),
            "gps_down": np.full(self.n, GPS_DOWN_MPS),
            "compass": np.full(self.n, field_error_T * self.headings),
        }
        zero = np.zeros(self.n)
        values = {
            "V": mean["V_mps"], "alpha": mean["alpha_rad"], "beta": mean["beta_rad"], "height": mean["height_m"],
            "v_north": zero, "v_east": zero, "v_down": zero,
            "gps_north": zero, "gps_east": zero, "gps_down": zero,
            "compass": 0.0 * self._field_T[:, 0],
        }  # fmt: skip
        everywhere = np.ones(self.n, dtype=bool)
        used = {
            "V": self._flying, "alpha": self._flying, "beta": self._flying, "height": everywhere,
            "v_north": self._still, "v_east": self._still, "v_down": self._still,
            "gps_north": everywhere, "gps_east": everywhere, "gps_down": everywhere,
            "compass": self._flying,
        }  # fmt: skip
        shown, weight = np.zeros((self.n, len(SHOWN))), np.zeros((self.n, len(SHOWN)))
        for i, name in enumerate(SHOWN):
            shown[:, i] = np.nan_to_num(values[name])
            weight[:, i] = (used[name] & np.isfinite(values[name])) / sigma[name]
        return shown, weight

    def _with_gps(self, latency_s: float) -> tuple[Array, Array]:
        """SHOWN and weights, with GPS moved forward by its latency as it is known by now."""
        shown, weight = self._shown.copy(), self.weight.copy()
        for name in ("gps_north", "gps_east", "gps_down"):
            i = SHOWN.index(name)
            series = self._table[f"{name}_mps"].dropna()
            if len(series) < 4:
                weight[:, i] = 0.0
                continue
            taken = series.index.to_numpy() - latency_s
            shown[:, i] = CubicSpline(taken, series.to_numpy())(self.t_s)
            after = np.clip(np.searchsorted(taken, self.t_s), 1, len(taken) - 1)
            weight[:, i] *= (taken[after] - taken[after - 1] < 0.5) & (self.t_s > taken[0]) & (self.t_s < taken[-1])
        return shown, weight

    def start(self) -> tuple[Array, Array]:
        """A path to begin with: attitude from angles of attack and climb, velocity from GPS or the air."""
        mean, n = self._mean, self.n
        x = np.zeros((n, len(STATES)))
        climb = np.gradient(smoothed(mean["height_m"], 7), self.t_s)
        alpha = smoothed(np.where(self._flying, mean["alpha_rad"], np.nan), 5)
        theta = alpha + np.arcsin(np.clip(climb / self._V_reference, -0.5, 0.5))
        x[:, 0] = self._table["bank_rad"].to_numpy()[self._center] * self._flying
        x[:, 1] = np.where(self._flying, theta, 0.0)
        yaw_rate = np.nan_to_num(mean["r_radps"]) / np.cos(x[:, 0])
        heading = np.cumsum(yaw_rate) * (self.t_s[1] - self.t_s[0])
        north, east = (smoothed(mean[f"gps_{axis}_mps"], 3) for axis in ("north", "east"))
        if np.isfinite(north).all():
            fast = np.hypot(north, east) > 5
            offset = np.angle(np.sum(np.exp(1j * (np.arctan2(east, north) - heading))[fast]))
            heading = heading + offset
            fast_track = np.unwrap(np.arctan2(east, north)[fast])
            if fast.sum() > 10:
                heading = np.interp(np.arange(n), np.flatnonzero(fast), fast_track)
            x[:, 3], x[:, 4] = north, east
        else:
            if self._has_compass:
                heading = heading + self._compass_beside(heading, x)
            speed = np.where(self._flying, self._V_reference, 0.0)
            x[:, 3], x[:, 4] = speed * np.cos(heading), speed * np.sin(heading)
        x[:, 2], x[:, 5], x[:, 6] = heading, -climb, smoothed(mean["height_m"], 3)
        self.first = x[0].copy()
        shared = self.prior[0].copy()
        if self._has_gps and self._has_compass:
            beside = self._compass_beside(heading, x)[self._flying]
            shared[SENSOR_ERRORS.index("heading_bias")] = np.angle(np.mean(np.exp(1j * beside)))
        return x, shared

    def _levelled(self, phi: Array, theta: Array) -> tuple[Array, Array]:
        """The field ahead and to the right, level."""
        x, y, z = self._field_T.T
        ahead, right, _ = motion.earth_from_body(x, y, z, phi, theta, 0.0)
        return ahead, right

    def _compass_beside(self, heading: Array, x: Array) -> Array:
        """By how much the compass reads more than these headings, the nearest turn of it; level as states x are."""
        ahead, right = self._levelled(x[:, 0], x[:, 1])
        beside = np.arctan2(-right, ahead) - heading
        width = round(COMPASS_S / (self.t_s[1] - self.t_s[0]))
        return np.unwrap(np.arctan2(smoothed(np.sin(beside), width), smoothed(np.cos(beside), width)))


def _effect(attitude: Array, moved: Array, error: Named) -> Array:
    """Rates of the Euler angles and specific force in earth axes (n, 6), from rates and forces in body axes (6, n)."""
    phi, theta, psi = attitude
    p, q, r, ax, ay, az = moved
    turning = motion.attitude_derivative(phi, theta, p - error.p_bias, q - error.q_bias, r - error.r_bias)
    force = motion.earth_from_body(ax - error.ax_bias, ay - error.ay_bias, az - error.az_bias, phi, theta, psi)
    return np.column_stack([*turning, *force])


def _blocks_of(compass: Compass | None, n: int) -> Array:
    if compass is None:
        return np.full((n, 3), np.nan)
    return np.column_stack([block_mean(pd.Series(part), n) for part in compass.field_T.T])


def _noise_at_rest(table: pd.DataFrame, still: list[slice]) -> dict[str, float]:
    """Standard deviation of each channel while the aircraft stood; what is usual where that was not measured."""
    noise = {}
    for name, usual in BENCH.items():
        variance = np.array([table[name].iloc[rows].var() for rows in still])
        seen = variance[np.isfinite(variance)]
        noise[name] = float(max(np.sqrt(seen.mean()), 0.1 * usual)) if len(seen) else usual
    return noise
