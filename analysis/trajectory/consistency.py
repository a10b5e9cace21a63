"""Whether a flight's channels agree with one another: as they come, and with what the path found wrong taken out.

Two checks that a flight-test person does by hand. Pitch attitude less angle of attack is the angle of climb, the
barometer's: theta - alpha - gamma = 0 (exactly so with level wings; a small bank is allowed for). And airspeed is what
GPS says once the wind is taken out. Nothing on board measures attitude or wind by itself: both are the path's, before
as after, so "before" shows what air data and GPS err by, and "after" what is left of it.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.air import LEAST_HEIGHT_M
from analysis.trajectory.blocks import block_mean
from analysis.trajectory.equations import PREDICTED_FLOW, SENSOR_ERRORS, STATES, Named
from analysis.trajectory.reconstruction import Trajectory
from flight.motion import earth_from_body

Array = NDArray[np.float64]

CLIMB_S = 3.0  # over which height becomes climb; the angles are averaged alike
BATCH_S = 20.0  # longer than what is left of one gust: means over it are independent
LEVEL_RAD = np.radians(10.0)  # of bank; beyond, an error of sideslip enters as one of angle of attack
ANGLES, SPEED = "angles_rad", "speed_mps"


class Spread(NamedTuple):
    """Mean of a difference in flight, the mean's standard error, and how the difference scatters (1 sigma)."""

    mean: float
    standard_error: float
    sigma: float


class Consistency(NamedTuple):
    """Differences in flight, index t_s, columns ANGLES [rad] and SPEED [m/s]; NaN where something was not measured.

    ANGLES : theta - alpha - gamma, wings nearly level     SPEED : airspeed less what GPS and the wind say
    """

    before: pd.DataFrame
    after: pd.DataFrame


def consistency(table: pd.DataFrame, trajectory: Trajectory) -> Consistency:
    """Both checks, as sensors come and with their errors and the gusts taken out.

    table : as `air_data` leaves it, the one the path was reconstructed from
    """
    n, t = len(trajectory.states), trajectory.states.index.to_numpy()
    x, c, slow = (
        Named(names, values)
        for names, values in (
            (STATES, trajectory.states[list(STATES)].to_numpy().T),
            (SENSOR_ERRORS, trajectory.sensor_errors),
            (PREDICTED_FLOW, trajectory.predicted_flow.T),
        )
    )
    names = ("V_mps", "alpha_rad", "beta_rad", "height_m", "gps_north_mps", "gps_east_mps")
    V, alpha, beta, height, north, east = (block_mean(table[name], n) for name in names)
    climb = np.gradient(_averaged(height, t), t)
    flying = np.where((height > LEAST_HEIGHT_M) & np.isfinite(V), 1.0, np.nan)
    level = np.where(np.abs(x.phi) < LEVEL_RAD, 1.0, np.nan)

    def differences(V: Array, alpha: Array, beta: Array, north: Array, east: Array) -> pd.DataFrame:
        beta = np.nan_to_num(beta)  # where it was not measured: straight flow
        along = np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)
        up = -np.asarray(earth_from_body(*along, x.phi, x.theta, x.psi)[2])
        by_angles = _averaged(np.arcsin(np.clip(up, -1, 1)) * flying, t)
        gamma = np.arcsin(np.clip(climb / _averaged(V * flying, t), -1, 1))
        by_gps = np.sqrt((north - x.wind_north) ** 2 + (east - x.wind_east) ** 2 + x.v_down**2)
        return pd.DataFrame({ANGLES: (by_angles - gamma) * flying * level, SPEED: (V - by_gps) * flying}, index=t)

    # What `model.shown` adds to the flow, taken out again.
    late, ca, sa = c.air_data_lag, np.cos(slow.slow_alpha), np.sin(slow.slow_alpha)
    quick = x.gust_u * ca + x.gust_w * sa + slow.gusts_across / (2 * slow.slow_V)
    slope = c.alpha_scale - 2 * c.V_scale
    after = differences(
        _sooner(V, t, late) - (c.V_scale + slow.V_per_pair * slope) * slow.slow_V + quick,
        _sooner(alpha, t, late)
        - c.alpha_bias
        - slope * slow.slow_alpha
        - (x.gust_u * sa - x.gust_w * ca) / slow.slow_V,
        _sooner(beta, t, late) - c.beta_bias + x.gust_v / slow.slow_V,
        _sooner(north, t, c.gps_latency),
        _sooner(east, t, c.gps_latency),
    )
    return Consistency(differences(V, alpha, beta, north, east), after)


def spread(difference: pd.Series) -> Spread | None:
    """Mean and scatter; None where less than two batches were measured. NaN is left out.

    The mean's error is that of the means of batches, so that what wanders slowly counts.
    """
    known = difference.dropna()
    batches = known.groupby((known.index.to_numpy() // BATCH_S).astype(int)).mean()
    if len(batches) < 2:
        return None
    return Spread(float(known.mean()), float(batches.std() / np.sqrt(len(batches))), float(known.std()))


def _averaged(values: Array, t: Array) -> Array:
    """Means over CLIMB_S about each instant; NaN where any of it was not measured."""
    window = 2 * round(CLIMB_S / (t[1] - t[0]) / 2) + 1
    return pd.Series(values).rolling(window, center=True).mean().to_numpy()


def _sooner(values: Array, t: Array, late_s: float) -> Array:
    """What a channel that is late by so much would have shown in time; NaN stays where it is."""
    known = np.isfinite(values)
    if not known.any():
        return values
    return np.where(known, np.interp(t + late_s, t[known], values[known]), np.nan)
