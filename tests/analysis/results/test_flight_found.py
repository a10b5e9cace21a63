"""Tests the wind, heights and residuals of a flight in `results.json`."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.curve import Condition
from flightpower.analysis.results.flight_found import DRAG, air_found, autocorrelation, run_residuals, track

T_S = np.arange(100.0, 140.0, 0.2)


def trajectory(north: np.ndarray, east: np.ndarray, error_mps: float = 0.2, **states):
    table = pd.DataFrame({"wind_north": north, "wind_east": east} | states, index=T_S)
    return SimpleNamespace(
        states=table,
        states_error=lambda: 0 * table + error_mps,
        gust_mps=0.4,
        gust_length=0.7,
        block_means=SimpleNamespace(flying=np.arange(len(T_S)) < 100),
    )


@pytest.mark.parametrize(("north", "east", "from_deg"), [(3.0, 4.0, 233.13), (-3.0, -4.0, 53.13), (3.0, -4.0, 126.87)])
def test_the_wind_is_the_mean_over_the_runs_and_named_by_where_it_comes_from(north, east, from_deg) -> None:
    """Only the runs count; without rows of runs, the mean is over all of the flight."""
    during = (T_S >= 110) & (T_S < 120)
    flown = pd.DataFrame(
        {"height_m": [40.0, np.nan, 55.0, 31.0], "temperature_K": [280.0, 281.0, 282.0, 285.0], "static_Pa": 1e5},
        index=[110.0] * 4,
    )
    flown.index = [t for t in T_S if 110 <= t < 110.8]
    wind = trajectory(np.where(during, north, 50.0), np.where(during, east, 50.0))
    result = air_found(wind, flown, Condition(40.0, 1.1, 0.5))
    assert (result.wind_mps, result.wind_from_deg) == pytest.approx((5.0, from_deg), abs=0.01)
    assert (result.gust_mps, result.gust_length) == (0.4, 0.7)
    assert result.wind_standard_error_mps == pytest.approx(0.2)
    assert (result.lowest_height_m, result.highest_height_m, result.temperature_K) == (31.0, 55.0, 282.0)
    assert result.density_altitude_m == pytest.approx(1110, abs=15)  # from ISO 2533
    flown.index = [1.0, 2.0, 3.0, 4.0]
    all_of_it = air_found(wind, flown, Condition(40.0, 1.1, 0.5))
    aloft = np.where(during, north, 50.0)[:100].mean(), np.where(during, east, 50.0)[:100].mean()
    assert all_of_it.wind_mps == pytest.approx(np.hypot(*aloft))


def test_residuals_are_measured_less_modeled_and_their_correlation_reaches_four_seconds() -> None:
    rng = np.random.default_rng(0)
    modeled = rng.normal(5.0, 1.0, 200)
    residual = 0.3 * np.sin(2 * np.pi * T_S / 4.0)
    measured = modeled + residual
    measured[7] = np.nan
    fit = SimpleNamespace(run="1 acceleration", t_s=T_S, measured={DRAG: measured}, modeled={DRAG: modeled})
    (run_residual,) = run_residuals(SimpleNamespace(fits=[fit]), {"1 acceleration": "acceleration"})
    assert (run_residual.points, run_residual.step_s) == (199, pytest.approx(0.2))
    assert run_residual.rms_mps2 == pytest.approx(0.3 / np.sqrt(2), rel=0.01)
    assert len(run_residual.autocorrelation) == 21  # lags of 0 to 4 s
    half, full_period = run_residual.autocorrelation[10], run_residual.autocorrelation[20]
    assert half == pytest.approx(-0.95, abs=0.02) and full_period == pytest.approx(0.9, abs=0.02)  # n - k products


def test_the_autocorrelation_is_about_zero_and_not_about_the_mean() -> None:
    assert autocorrelation(np.full(10, 3.0), 20) == pytest.approx([1.0, 0.9, 0.8, 0.7, 0.6, 0.5])
    assert autocorrelation(np.zeros(10), 5) == pytest.approx([1.0])


@pytest.mark.parametrize(("samples", "points"), [(600, 600), (601, 301), (200, 200)])
def test_a_track_has_at_most_six_hundred_points(samples: int, points: int) -> None:
    t = np.arange(samples) * 0.2
    result = track(SimpleNamespace(states=pd.DataFrame({"v_north": 2 * t, "v_east": -3.0}, index=t)))
    assert len(result.t_s) == len(result.north_m) == len(result.east_m) == points
    assert result.north_m == pytest.approx(np.square(result.t_s), abs=0.051)
    assert result.east_m == pytest.approx(-3.0 * np.array(result.t_s), abs=0.051)
