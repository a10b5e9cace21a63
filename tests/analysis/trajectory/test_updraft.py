"""Mean updraft over the runs of a flight: by the sun, the wind, and what the runs pass through."""

import math
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from analysis.trajectory import updraft
from analysis.trajectory.settings import UPDRAFT
from flight.aircraft import Uncertainty
from flight.messages import Gps

NOON, DAWN = math.radians(70.0), math.radians(-5.0)
HEIGHT_M, SPEED_MPS, RUN_S = 40.0, 15.0, 18.0


def states(wind_mps: float, duration_s: float) -> pd.DataFrame:
    """To and fro over the same ground at one height, turning every RUN_S, while wind from the north carries the air."""
    t_s = np.arange(0.0, duration_s, 0.2)
    over_ground = np.where((t_s // RUN_S) % 2 == 0, SPEED_MPS, -SPEED_MPS)
    columns = {"v_north": over_ground, "v_east": 0.0, "wind_north": -wind_mps, "wind_east": 0.0}
    return pd.DataFrame(columns | {"height": HEIGHT_M}, index=pd.Index(t_s, name="t_s"))


def sigma(runs: int, sun_rad: float | None, wind_mps: float = 4.0) -> float:
    flown = SimpleNamespace(states=states(wind_mps, 2 * RUN_S * runs))
    return updraft.mean_updraft(flown, [(2 * RUN_S * k, (2 * k + 1) * RUN_S) for k in range(runs)], sun_rad).sigma_mps


def test_elevation_of_the_sun_is_that_of_a_published_example():
    """Reda & Andreas 2008, Solar Position Algorithm (NREL/TP-560-34302), table A5.1, without refraction."""
    at = datetime(2003, 10, 17, 19, 30, 30, tzinfo=UTC).timestamp()
    elevation = updraft.sun_elevation(at, math.radians(39.742476), math.radians(-105.1786))
    assert math.degrees(elevation) == pytest.approx(39.872, abs=0.02)


@pytest.mark.parametrize(("month", "noon_deg"), [(3, 50.0), (6, 73.4), (12, 26.6)])
def test_at_noon_the_sun_is_as_high_as_the_season_makes_it(month, noon_deg):
    day = [updraft.sun_elevation(datetime(2024, month, 21, h, tzinfo=UTC).timestamp(), math.radians(40.0), 0.0)
           for h in range(24)]  # fmt: skip
    assert math.degrees(max(day)) == pytest.approx(noon_deg, abs=0.6)
    assert np.argmax(day) == 12


def test_a_clear_day_heats_the_air_by_a_third_of_a_kilowatt_and_a_night_does_not():
    assert 250 < updraft.heat_flux_WPM2(NOON) < 350
    assert 1.5 < updraft.convective_velocity(NOON) < 2.5  # Stull 1988, sec. 4.2: typical of fair weather
    assert updraft.heat_flux_WPM2(DAWN) == updraft.convective_velocity(DAWN) == 0


def test_before_sunrise_in_little_wind_it_is_that_of_the_aircraft_file():
    assert sigma(10, DAWN) == sigma(1, DAWN) == sigma(10, None) == Uncertainty().updraft_mps


def test_wind_rises_along_the_slope():
    assert sigma(10, DAWN, wind_mps=10.0) == pytest.approx(10.0 * UPDRAFT.slope)


def test_at_noon_more_runs_and_more_wind_meet_more_eddies():
    one, four, ten = (sigma(runs, NOON) for runs in (1, 4, 10))
    assert 0.1 < one < 0.2
    assert one > four > 1.2 * ten > 0.05
    assert sigma(10, NOON, wind_mps=1.0) > 1.2 * ten
    assert sigma(4, math.radians(20.0)) < 0.7 * four


def test_the_mean_along_a_straight_line_has_the_variance_of_its_integral_length():
    """Over a length L much beyond the integral length l: 2 l / L of that of a point (Lenschow & Stankov 1986)."""
    length_m, speed_mps = 2.0e6, 1.0e4  # so fast that no eddy changes
    t_s = np.linspace(0.0, length_m / speed_mps, 100_000)
    path_m = np.stack([speed_mps * t_s, 0 * t_s], axis=1)
    point = updraft.convective_mean(path_m[:1], t_s[:1], HEIGHT_M, NOON)
    points, step_m = 400, length_m / 399  # the line is sampled: the sum over its instants in place of the integral
    decay = math.exp(-step_m / (0.28 * UPDRAFT.mixed_layer_m))
    expected = point * math.sqrt((1 + decay) / (1 - decay) / points)
    assert updraft.convective_mean(path_m, t_s, HEIGHT_M, NOON) == pytest.approx(expected, rel=0.01)


def test_at_the_ground_the_air_cannot_rise():
    assert updraft.convective_mean(np.zeros((1, 2)), np.zeros(1), 0.0, NOON) == 0


def log_with(fixes) -> SimpleNamespace:
    return SimpleNamespace(entries={"/gps": [SimpleNamespace(time_ns=time_ns, message=fix) for time_ns, fix in fixes]})


def test_the_hour_is_that_of_the_satellites_and_not_of_the_computer():
    noon_ns = int(datetime(2016, 5, 14, 17, 0, tzinfo=UTC).timestamp() * 1e9)
    fix = Gps(status="ok", latitude_deg=35.773, longitude_deg=-78.674, utc_ns=noon_ns)
    assert math.degrees(updraft.sun_over(log_with([(10**9, fix)]))) == pytest.approx(72.9, abs=0.1)
    assert updraft.sun_over(log_with([(noon_ns, Gps(status="ok"))])) is None
    assert updraft.sun_over(SimpleNamespace(entries={})) is None


def test_the_reader_is_told_why_an_interval_is_wider_and_what_is_not_known():
    assert not updraft.updraft_notes(updraft.Updraft(0.004, DAWN))
    assert len(updraft.updraft_notes(updraft.Updraft(0.1, NOON))) == 1
    assert len(updraft.updraft_notes(updraft.Updraft(0.004, None))) == 1
