"""Measurements of the smoother: values and weights of block means, GPS shifted by its latency, headings."""

import numpy as np
import pandas as pd

from flightpower.analysis.air.magnetometer import Compass
from flightpower.analysis.sources.grid import CubicSpline, without_gaps
from flightpower.analysis.sources.grid_settings import CHANNELS, RECEIVER
from flightpower.analysis.trajectory.block_means import BLOCK, BlockMeans, block_mean, moving_average
from flightpower.analysis.trajectory.equations import MEASUREMENTS
from flightpower.analysis.trajectory.settings import PRIORS, SENSORS
from flightpower.flight import motion
from flightpower.flight.arrays import Array, BoolArray
from flightpower.flight.probe_maps import ALPHA_PORT_SLOPE


class LevelField:
    """Block means (n, 3) of the field in body axes [T], NaN without a compass; error_T: its standard deviation."""

    def __init__(self, compass: Compass | None, blocks: BlockMeans):
        self._width = round(PRIORS.compass_averaging_s / (blocks.t_s[1] - blocks.t_s[0]))
        if compass is None:
            self.body_T, self.error_T = np.full((blocks.n, 3), np.nan), np.inf
        else:
            self.body_T = np.column_stack([block_mean(pd.Series(part), blocks.n) for part in compass.field_T.T])
            self.error_T = compass.error_T

    def leveled(self, phi: Array, theta: Array) -> tuple[Array, Array]:
        """Components forward and right (n,) [T], in the horizontal plane at these attitudes."""
        x, y, z = self.body_T.T
        forward, right, _ = motion.earth_from_body((x, y, z), (phi, theta, 0.0))
        return forward, right

    def heading_offset(self, heading: Array, phi: Array, theta: Array) -> Array:
        """Averaged compass heading less `heading` (n,), unwrapped [rad]."""
        forward, right = self.leveled(phi, theta)
        offset = np.arctan2(-right, forward) - heading
        sine, cosine = (moving_average(part, self._width) for part in (np.sin(offset), np.cos(offset)))
        return np.unwrap(np.arctan2(sine, cosine))


GPS_COLUMNS = ("gps_north", "gps_east", "gps_down")


class Measurements:
    """Values and weights of MEASUREMENTS.

    weight : (n, ny), 1/sigma, 0 where nothing was measured; GPS as if it had no gaps
    compass_sigma_factor : factor on the standard deviation of a compass block, so that all blocks together count as
        SENSORS.independent_headings
    """

    def __init__(
        self,
        table: pd.DataFrame,
        blocks: BlockMeans,
        at_rest: BoolArray,
        noise: dict[str, float],
        *,
        V_reference: Array,
        field: LevelField,
    ):
        """table: averaged in `blocks`. at_rest: (n,). noise: 1 sigma per sample. V_reference: (n,) smooth airspeed."""
        self._t_s = blocks.t_s
        self._gps = {name: table[f"{name}_mps"].dropna() for name in GPS_COLUMNS}
        self.has_gps = bool(table["gps_north_mps"].notna().any())
        self.compass_sigma_factor = float(np.sqrt(max(blocks.flying.sum() / SENSORS.independent_headings, 1.0)))
        sigma = _standard_deviations(blocks, noise, V_reference)
        sigma["compass"] = np.full(blocks.n, field.error_T * self.compass_sigma_factor)
        zero, everywhere = np.zeros(blocks.n), np.ones(blocks.n, dtype=bool)
        flying = blocks.flying
        values_and_use = {
            "V": (blocks["V_mps"], flying),
            "alpha": (blocks["alpha_rad"], flying),
            "beta": (blocks["beta_rad"], flying),
            "height": (blocks["height_m"], everywhere),
            "gps_north": (zero, everywhere),  # `at_gps_latency` fills in the values
            "gps_east": (zero, everywhere),
            "gps_down": (zero, everywhere),
            "v_north": (zero, at_rest),
            "v_east": (zero, at_rest),
            "v_down": (zero, at_rest),
            "compass": (0.0 * field.body_T[:, 0], flying),  # zero where the field was measured
        }
        self._values, self.weight = (np.zeros((blocks.n, len(MEASUREMENTS))) for _ in range(2))
        for i, name in enumerate(MEASUREMENTS):
            values, used = values_and_use[name]
            self._values[:, i] = np.nan_to_num(values)
            self.weight[:, i] = (used & np.isfinite(values)) / sigma[name]
        self.has_compass = bool(self.weight[:, MEASUREMENTS.index("compass")].any())

    def at_gps_latency(self, latency_s: float) -> tuple[Array, Array]:
        """Values and weights, with GPS shifted to earlier times by its latency; weight 0 in gaps of GPS."""
        values, weight = self._values.copy(), self.weight.copy()
        for name, series in self._gps.items():
            i = MEASUREMENTS.index(name)
            if len(series) < CubicSpline.fewest_points:
                weight[:, i] = 0.0
                continue
            t_s = series.index.to_numpy() - latency_s
            values[:, i] = CubicSpline(t_s, series.to_numpy())(self._t_s)
            after = np.clip(np.searchsorted(t_s, self._t_s), 1, len(t_s) - 1)
            without_gap = t_s[after] - t_s[after - 1] < CHANNELS.gap * np.median(np.diff(t_s))
            weight[:, i] *= without_gap & (self._t_s > t_s[0]) & (self._t_s < t_s[-1])
        return values, weight


def _standard_deviations(blocks: BlockMeans, noise: dict[str, float], V_reference: Array) -> dict[str, Array]:
    """Standard deviations of block means (n,); noise of air data is constant in pascals."""
    rho = without_gaps(blocks["rho"])
    qbar = rho * V_reference**2 / 2
    root = np.sqrt(BLOCK)
    level_mps, vertical_mps = RECEIVER.velocity_mps
    constant = {
        "height": noise["static_Pa"] / 11.8 / root,  # Pa/m: rho g at 100 m
        "gps_north": level_mps, "gps_east": level_mps, "gps_down": vertical_mps,
        "v_north": SENSORS.rest_mps, "v_east": SENSORS.rest_mps, "v_down": SENSORS.rest_mps,
    }  # fmt: skip
    return {name: np.full(blocks.n, sigma) for name, sigma in constant.items()} | {
        "V": noise["q_c_Pa"] / (rho * V_reference) / root,
        "alpha": noise["dp_alpha_Pa"] / (ALPHA_PORT_SLOPE * qbar) / root,
        "beta": noise["dp_beta_Pa"] / (ALPHA_PORT_SLOPE * qbar) / root,
    }
