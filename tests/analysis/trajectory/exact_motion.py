"""Makes a prescribed motion: swinging attitude in a turn, constant wind, known derivatives.

Sensors are exact; the IMU gives means of eight samples, as in a log.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from flightpower.analysis.trajectory.block_means import BLOCK
from flightpower.analysis.trajectory.equations import STATES
from flightpower.analysis.trajectory.inertial import CHANNELS
from flightpower.flight.motion import body_from_earth, flow_of

G = 9.80665
RATE_HZ = 25.0
WIND_NORTH, WIND_EAST = 2.0, -1.0
RHO = 1.1


class ExactMotion(NamedTuple):
    """The table as `air_data` returns it, and the true states (n, nx) at the centers of blocks."""

    table: pd.DataFrame
    states: np.ndarray


def exact_motion(duration_s: float = 60.0, *, turns: bool = False) -> ExactMotion:
    """Return a motion that banks and pitches at half a hertz in a turn that swings about 30 deg/s, at 15 m/s.

    turns : instead, fly turns to one side and to the other, with level flight between them
    """
    fine = np.arange(-1.0, duration_s + 1.0, 1e-3)
    phi, theta = 0.5 * np.sin(2.9 * fine), 0.15 + 0.1 * np.cos(2.9 * fine)
    psi = 0.5 * fine + 0.3 * np.sin(0.7 * fine)
    if turns:
        phi, theta = 0.8 * np.sin(0.3 * fine) ** 3, 0.1 + 0.02 * np.sin(0.2 * fine)
        psi = np.cumsum(G * np.tan(phi) / 15) * 1e-3
    down = 0.8 * np.sin(0.5 * fine)
    values = np.column_stack([phi, theta, psi, 15 * np.cos(psi), 15 * np.sin(psi), down])
    spline = CubicSpline(fine, values)
    height = CubicSpline(fine, down).antiderivative()
    t = np.arange(0.0, duration_s, 1 / RATE_HZ)
    phi, theta, psi, v_north, v_east, v_down = spline(t).T
    height_m = 100.0 - height(t)
    wind = WIND_NORTH, WIND_EAST
    V, alpha, beta = flow_of(*body_from_earth((v_north - wind[0], v_east - wind[1], v_down), (phi, theta, psi)))
    imu = np.mean([_imu(spline, t + part / RATE_HZ) for part in (np.arange(8) - 3.5) / 8], axis=0)
    table = pd.DataFrame(
        {
            **dict(zip(CHANNELS, imu, strict=True)),
            "V_mps": V, "alpha_rad": alpha, "beta_rad": beta, "dlnV_dlndp_alpha": 0.0 * t,
            "dalpha_dlndp_alpha_rad": 0.9 * alpha,
            "height_m": height_m, "rho": RHO + 0.0 * t, "flying": t >= 0, "bank_rad": phi,
            "gps_north_mps": v_north, "gps_east_mps": v_east, "gps_down_mps": v_down,
            "n_revps": 0.0 * t, "dp_alpha_Pa": 0.0 * t, "dp_beta_Pa": 0.0 * t, "q_c_Pa": 0.0 * t, "static_Pa": 0.0 * t,
        },
        index=pd.Index(t, name="t_s"),
    )  # fmt: skip
    states = np.zeros((len(t), len(STATES)))
    states[:, :9] = np.column_stack(
        [phi, theta, psi, v_north, v_east, v_down, height_m, *(np.full(len(t), w) for w in wind)]
    )
    return ExactMotion(table, states[BLOCK // 2 :: BLOCK][: len(t) // BLOCK])


def _imu(motion: CubicSpline, t: np.ndarray) -> np.ndarray:
    """Return CHANNELS (6, n) of a motion (attitude, velocity) at the instants t."""
    (phi, theta, psi), rates = motion(t).T[:3], motion(t, 1).T
    p = rates[0] - rates[2] * np.sin(theta)
    q = rates[1] * np.cos(phi) + rates[2] * np.cos(theta) * np.sin(phi)
    r = -rates[1] * np.sin(phi) + rates[2] * np.cos(theta) * np.cos(phi)
    return np.array([p, q, r, *body_from_earth((rates[3], rates[4], rates[5] - G), (phi, theta, psi))])
