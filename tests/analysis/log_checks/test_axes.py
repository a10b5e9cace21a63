"""Axes that a straight flight does not show."""

import numpy as np
import pandas as pd
import pytest

from analysis.log_checks import axes
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


def test_the_climb_rate_is_that_of_the_height() -> None:
    t_s = np.arange(0, 60, 0.04)
    table = pd.DataFrame({"height_m": 50 + 2.0 * t_s}, index=pd.Index(t_s, name="t_s"))
    climb = axes._climb_mps(table).dropna()
    assert np.allclose(climb.iloc[50:-50], 2.0) and len(climb) > 1400


def test_means_are_of_stretches_that_count_as_a_whole() -> None:
    t_s = np.arange(0, 10, 0.04)
    table = pd.DataFrame({"V_mps": t_s}, index=pd.Index(t_s, name="t_s"))
    means = axes._means(table, pd.Series(t_s < 5.0, index=table.index), 1.0)["V_mps"]
    assert np.diff(means.index) == pytest.approx(1.0)
    known = means.dropna()
    assert np.allclose(known, known.index, atol=0.03) and known.index.max() < 5.0


def swinging(**change: float) -> pd.DataFrame:
    """Two minutes that dive and climb: each sensor reads what mechanics says, times a factor of `change`."""
    t_s = np.arange(0, 120, 0.04)
    V = 18 + 4 * np.sin(0.5 * t_s)
    Vdot = 2 * np.cos(0.5 * t_s)
    climb = 2 * np.sin(0.3 * t_s)
    lift_over_m = 9.8 + 3 * np.sin(0.7 * t_s)
    q = 0.6 * V**2
    columns = {
        "V_mps": V,
        "qbar_Pa": q,
        "q_c_Pa": q,
        "alpha_rad": 0.02 * lift_over_m * 150 / q,
        "beta_rad": 0.03 * np.sin(1.1 * t_s),
        "dp_alpha_Pa": 0.4 * lift_over_m * 30,
        "dp_beta_Pa": 0.05 * q * np.sin(1.1 * t_s),
        "ax_mps2": Vdot + 9.8 * climb / V,
        "ay_mps2": -0.02 * q * np.sin(1.1 * t_s) * 0.03,
        "az_mps2": -lift_over_m,
        "q_radps": (lift_over_m - 9.8) / V,
        "r_radps": 0.0,
        "height_m": 60 - 2 / 0.3 * np.cos(0.3 * t_s),
        "gps_north_mps": V,
        "gps_east_mps": 0.0,
        "gps_down_mps": -climb,
        "flying": True,
    }
    table = pd.DataFrame(columns, index=pd.Index(t_s, name="t_s"))
    for name, factor in change.items():
        table[name] *= factor
    return table


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"q_radps": 57.3}, "degrees per second"),
        ({"q_radps": -1.0}, "wrong sign; write it positive nose up"),
        ({"alpha_rad": -1.0, "dp_alpha_Pa": -1.0}, "the angle of attack falls where lift rises"),
        ({"dp_alpha_Pa": 0.01}, "is it in hPa"),
        ({"beta_rad": -1.0}, "the side force points to where the air comes from"),
        ({"gps_down_mps": -1.0}, "write it positive downwards"),
        ({"gps_north_mps": 3.6}, "it looks like km/h; multiply by 0.2778"),
        ({"gps_north_mps": 100.0}, "it looks like cm/s; multiply by 0.01"),
        ({"gps_north_mps": 1000.0}, "it looks like mm/s; multiply by 0.001"),
        ({"gps_north_mps": 0.01}, "write m/s"),
    ],
)
def test_a_sensor_that_contradicts_mechanics_is_refused(change: dict[str, float], said: str) -> None:
    check_axes(swinging(), "flight.mcap")
    with pytest.raises(InputError, match=said):
        check_axes(swinging(**change), "flight.mcap")


@pytest.mark.parametrize("name", ["gps_down_mps", "q_radps", "ax_mps2", "ay_mps2", "beta_rad", "dp_beta_Pa"])
def test_a_sensor_that_shows_nothing_of_the_motion_is_not_called_reversed(name: str) -> None:
    """Only one that contradicts it: noise, gusts and calm flights leave small correlations of either sign."""
    table = swinging()
    noise = np.random.default_rng(1).normal(0, float(table[name].std()), len(table))
    check_axes(table.assign(**{name: noise}), "flight.mcap")
