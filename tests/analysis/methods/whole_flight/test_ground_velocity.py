"""Airspeed as the velocity by GPS less the wind: circles, the wind's profile, and what gusts do to it."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.airspeed_gps import airspeed_errors
from flightpower.analysis.methods.whole_flight.energy_balance import Windows, by_horizontal_gusts
from flightpower.analysis.methods.whole_flight.ground_velocity import (
    GroundVelocity,
    circle_center,
    gusts,
    height_factor,
)
from flightpower.analysis.methods.whole_flight.settings import GPS
from flightpower.analysis.sources import recording

STEP_S = 0.2


def turning(seconds: float, V: float = 15.0, wind: tuple[float, float] = (-3.0, 5.0)) -> tuple[np.ndarray, np.ndarray]:
    """Ground velocity on circles of 40 s, or on one heading where it lasts less than a second."""
    heading = 2 * np.pi * np.arange(0.0, seconds, STEP_S) / 40.0
    return V * np.cos(heading) + wind[0], V * np.sin(heading) + wind[1]


def test_the_center_of_circles_is_the_wind() -> None:
    assert circle_center(*turning(400.0), STEP_S) == pytest.approx([-3.0, 5.0], abs=0.15)
    one_heading = np.full(2000, 18.0), np.full(2000, 2.0)
    assert np.hypot(*circle_center(*one_heading, STEP_S)) < GPS.wind_sigma_mps


def test_airspeed_is_what_is_left_of_the_ground_velocity() -> None:
    north, east = turning(80.0)
    t_s = np.arange(len(north)) * STEP_S - 40.0
    trend = 0.01
    ground = GroundVelocity(north + trend * t_s, east, 0 * t_s, np.ones(len(t_s)), t_s, np.zeros(2))
    assert ground.airspeed(np.array([-3.0, 5.0, trend, 0.0])) == pytest.approx(15.0)
    climbing = ground._replace(down_mps=np.full(len(t_s), -8.0), height_factor=np.full(len(t_s), 0.5))
    assert climbing.airspeed(np.array([-6.0, 10.0, 2 * trend, 0.0])) == pytest.approx(np.hypot(15.0, 8.0))


def test_the_wind_grows_with_the_logarithm_of_height() -> None:
    height, flown = np.array([130.0, 140.0, 180.0]), np.array([False, True, True])
    ground = np.full(3, 120.0)
    factor = height_factor(height, ground, flown)
    middle = (np.log(20.0 / GPS.roughness_m) + np.log(60.0 / GPS.roughness_m)) / 2
    assert factor == pytest.approx(np.log(np.array([10.0, 20.0, 60.0]) / GPS.roughness_m) / middle)
    assert height_factor(height, None, flown) == pytest.approx(1.0)
    assert np.isfinite(height_factor(ground, ground, flown)).all(), "on the ground"


def test_horizontal_gusts_near_the_ground_are_larger_and_longer() -> None:
    """At 60 m by MIL-F-8785C: 1.54 times the vertical ones, over 3.66 times their length."""
    assert gusts() == pytest.approx((1.54, 3.66), rel=0.005)


def test_a_gust_changes_windows_as_the_wind_does() -> None:
    """Over windows much shorter than the gust all of its variance is left; far apart nothing correlates."""
    offsets = np.linspace(-1.0, 1.0, 11)
    windows = Windows(np.array([0.0, 1.0, 1e4]), offsets, np.full(11, 1 / 11), np.zeros(11))
    change = np.array([[2.0, 0.0], [0.0, 3.0], [1.0, 1.0]])
    result = by_horizontal_gusts(windows, change, 0.5, 1000.0)
    assert np.diag(result) == pytest.approx((0.5 * gusts()[0]) ** 2 * np.array([4.0, 9.0, 2.0]), rel=1e-3)
    assert result[0, 1] == 0.0, "a gust to the north does nothing where the east counts"
    assert abs(result[0, 2]) < 0.1 * np.sqrt(result[0, 0] * result[2, 2])
    twice = by_horizontal_gusts(windows, np.vstack([change, -change]), 0.5, 1000.0)
    assert twice[:3, 3:] == pytest.approx(-result)


@pytest.mark.parametrize(("noise_Pa", "gust_mps"), [(6.0, 0.0), (0.5, 0.8)])
def test_the_airspeed_s_scale_is_covered_whichever_velocity_is_disturbed(noise_Pa: float, gust_mps: float) -> None:
    """White noise of the pitot, or gusts that last 10 s and carry the aircraft along after 5 s. If all errors are taken
    to be in the velocity by GPS, the scale of the first is two standard errors too high.
    """
    t, rho, scale, z = np.arange(0.0, 200.0, 0.2), 1.2, 0.01, []
    V, heading = 16 + 1.5 * np.sign(np.sin(0.11 * t)), 0.12 * t
    for seed in range(12):
        rng = np.random.default_rng(seed)
        gust, drift = np.zeros((2, 2, len(t)))
        for i in range(1, len(t)):
            gust[:, i] = np.exp(-0.02) * gust[:, i - 1] + gust_mps * np.sqrt(0.04) * rng.standard_normal(2)
            drift[:, i] = drift[:, i - 1] + 0.04 * (gust[:, i] - drift[:, i - 1])
        (north, east), (felt_n, felt_e) = np.array([np.cos(heading), np.sin(heading)]) * V + drift, drift - gust
        through_air = np.hypot(V * np.cos(heading) + felt_n, V * np.sin(heading) + felt_e)
        noise = np.interp(t, t[::5], noise_Pa * rng.standard_normal(len(t[::5])))
        pressure = rho / 2 * (through_air * (1 + scale)) ** 2 + noise
        gps = (np.interp(t - GPS.latency_s, t, item) for item in (north + 3.0, east - 2.0, 0 * t))
        table = pd.DataFrame(
            {"pressure_Pa": pressure, "rho": rho} | dict(zip(recording.GPS, gps, strict=True)), index=t
        )
        flight = SimpleNamespace(
            table=table, flown=np.ones(len(t), dtype=bool), zero_sigma_Pa=3.0, airspeed_scale_sigma=GPS.scale_sigma
        )
        errors = airspeed_errors(flight, most_points=150)  # type: ignore[arg-type]
        z.append((errors.scale - scale) / np.sqrt(errors.covariance[0, 0]))
    assert np.mean(np.abs(z) < NORMAL_95) >= 0.8 and abs(np.mean(z)) < 1.2
