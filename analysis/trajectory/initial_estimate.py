"""A first trajectory for the iteration: attitude from angle of attack and climb, velocity from GPS or airspeed."""

import numpy as np
from numpy.typing import NDArray

from analysis.trajectory.block_means import BlockMeans, moving_average
from analysis.trajectory.equations import SENSOR_ERRORS, STATES
from analysis.trajectory.level_field import LevelField

Array = NDArray[np.float64]

GROUND_TRACK_MPS = 5.0  # ground speed above which the ground track approximates the heading; times the speed scale
FEWEST_TRACK_BLOCKS = 10


def initial_states(blocks: BlockMeans, bank: Array, V_reference: Array, field: LevelField | None) -> Array:
    """States (n, nx). bank: (n,) [rad]. V_reference: (n,) smoothed airspeed. field: None without a compass."""
    flying = blocks.flying
    x = np.zeros((blocks.n, len(STATES)))
    climb = np.gradient(moving_average(blocks["height_m"], 7), blocks.t_s)
    alpha = moving_average(np.where(flying, blocks["alpha_rad"], np.nan), 5)
    theta = alpha + np.arcsin(np.clip(climb / V_reference, -0.5, 0.5))
    x[:, 0] = bank * flying
    x[:, 1] = np.where(flying, theta, 0.0)
    yaw_rate = np.nan_to_num(blocks["r_radps"]) / np.cos(x[:, 0])
    heading = np.cumsum(yaw_rate) * (blocks.t_s[1] - blocks.t_s[0])
    north, east = (moving_average(blocks[f"gps_{axis}_mps"], 3) for axis in ("north", "east"))
    if np.isfinite(north).all():
        heading = _with_ground_track(heading, north, east, GROUND_TRACK_MPS * blocks.speed_scale)
        x[:, 3], x[:, 4] = north, east
    else:
        if field is not None:
            heading = heading + field.heading_offset(heading, x[:, 0], x[:, 1])
        speed = np.where(flying, V_reference, 0.0)
        x[:, 3], x[:, 4] = speed * np.cos(heading), speed * np.sin(heading)
    x[:, 2], x[:, 5], x[:, 6] = heading, -climb, moving_average(blocks["height_m"], 3)
    return x


def initial_sensor_errors(prior_mean: Array, blocks: BlockMeans, x: Array, field: LevelField | None) -> Array:
    """Prior means (m,), with the compass offset measured against the headings of x. field: None without compass or
    without GPS."""
    errors = prior_mean.copy()
    if field is not None:
        offset = field.heading_offset(x[:, 2], x[:, 0], x[:, 1])[blocks.flying]
        errors[SENSOR_ERRORS.index("heading_bias")] = np.angle(np.mean(np.exp(1j * offset)))
    return errors


def _with_ground_track(heading: Array, north: Array, east: Array, least_mps: float) -> Array:
    """The ground track where faster than `least_mps`; otherwise the integrated heading, its mean offset corrected."""
    fast = np.hypot(north, east) > least_mps
    if fast.sum() > FEWEST_TRACK_BLOCKS:
        track = np.unwrap(np.arctan2(east, north)[fast])
        return np.interp(np.arange(len(heading)), np.flatnonzero(fast), track)
    offset = np.angle(np.sum(np.exp(1j * (np.arctan2(east, north) - heading))[fast]))
    return np.asarray(heading + offset)
