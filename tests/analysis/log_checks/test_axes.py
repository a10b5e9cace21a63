"""Axes that a straight flight does not show."""

import numpy as np
import pandas as pd
import pytest

from analysis.log_checks.axes import check_axes
from flight.errors import InputError


def circling(turn: float) -> pd.DataFrame:
    """Air data of a minute at 15 m/s whose yaw rate swings by 0.4 rad/s; `turn` is the sign of the GPS course."""
    t_s = np.arange(0, 60, 0.04)
    rate = 0.4 * np.sin(2 * np.pi * t_s / 20)
    course = turn * np.cumsum(rate) * 0.04
    steady = {"V_mps": 15.0, "qbar_Pa": 138.0, "q_c_Pa": 138.0, "az_mps2": -9.8, "flying": True}
    columns = ("ax_mps2", "ay_mps2", "q_radps", "alpha_rad", "beta_rad", "dp_alpha_Pa", "dp_beta_Pa", "height_m")
    velocity = {"gps_north_mps": 15 * np.cos(course), "gps_east_mps": 15 * np.sin(course), "gps_down_mps": 0.0}
    return pd.DataFrame(
        dict.fromkeys(columns, 0.0) | steady | velocity | {"r_radps": rate}, index=pd.Index(t_s, name="t_s")
    ).assign(qbar_Pa=138 + np.linspace(0, 1e-3, len(t_s)))


def test_a_yaw_rate_against_the_course_is_refused() -> None:
    check_axes(circling(1), "flight.mcap")
    with pytest.raises(InputError) as caught:
        check_axes(circling(-1), "flight.mcap")
    assert str(caught.value) == (
        "flight.mcap: /imu and /gps: angular_rate_z_radps turns against the course of velocity_north_mps and"
        " velocity_east_mps: the rate is not positive to the right, or north and east are exchanged"
    )
