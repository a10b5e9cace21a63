"""Tests the mean updraft over the runs of a flight, due to the sun, the wind, and waves in layered air."""

import math
from dataclasses import replace
from datetime import UTC, datetime
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from flights import AirOf, air_of, draw_errors, flown, tunnel_probe

from flightpower.analysis.sources.recording import Fix, Position
from flightpower.analysis.trajectory import updraft
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import prior_conflict
from flightpower.analysis.trajectory.priors import SensorPriors, stated_sigma
from flightpower.analysis.trajectory.reconstruction import Trajectory, reconstruct
from flightpower.analysis.trajectory.settings import UPDRAFT
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.sim.world import load_world

NOON, DAWN = math.radians(70.0), math.radians(-5.0)
HEIGHT_M, SPEED_MPS, RUN_S = 40.0, 15.0, 18.0
RISING_MPS = 0.3


def states(wind_mps: float, duration_s: float) -> pd.DataFrame:
    """Return a path back and forth over the same ground at one height, which turns every RUN_S, in a wind from the
    north."""
    t_s = np.arange(0.0, duration_s, 0.2)
    over_ground = np.where((t_s // RUN_S) % 2 == 0, SPEED_MPS, -SPEED_MPS)
    columns = {"v_north": over_ground, "v_east": 0.0, "wind_north": -wind_mps, "wind_east": 0.0}
    return pd.DataFrame(columns | {"height": HEIGHT_M}, index=pd.Index(t_s, name="t_s"))


def sigma(runs: int, sun_rad: float | None, wind_mps: float = 4.0) -> float:
    flown = SimpleNamespace(states=states(wind_mps, 2 * RUN_S * runs))
    return updraft.mean_updraft(flown, [(2 * RUN_S * k, (2 * k + 1) * RUN_S) for k in range(runs)], sun_rad).sigma_mps


def test_elevation_of_the_sun_is_that_of_a_published_example():
    """It is from Reda & Andreas 2008, Solar Position Algorithm (NREL/TP-560-34302), table A5.1, without refraction."""
    moment = datetime(2003, 10, 17, 19, 30, 30, tzinfo=UTC).timestamp()
    elevation = updraft.sun_elevation(moment, math.radians(39.742476), math.radians(-105.1786))
    assert math.degrees(elevation) == pytest.approx(39.872, abs=0.02)


@pytest.mark.parametrize(("month", "noon_deg"), [(3, 50.0), (6, 73.4), (12, 26.6)])
def test_at_noon_the_sun_is_as_high_as_the_season_makes_it(month, noon_deg):
    day = [updraft.sun_elevation(datetime(2024, month, 21, h, tzinfo=UTC).timestamp(), math.radians(40.0), 0.0)
           for h in range(24)]  # fmt: skip
    assert math.degrees(max(day)) == pytest.approx(noon_deg, abs=0.6)
    assert np.argmax(day) == 12


def test_a_clear_day_heats_the_air_by_a_third_of_a_kilowatt_and_a_night_does_not():
    assert 250 < updraft.heat_flux_WPM2(NOON) < 350
    assert 1.5 < updraft.convective_velocity(NOON) < 2.5  # typical of fair weather (Stull 1988, sec. 4.2)
    assert updraft.heat_flux_WPM2(DAWN) == updraft.convective_velocity(DAWN) == 0


def test_before_sunrise_in_little_wind_it_is_that_of_the_aircraft_file():
    assert sigma(40, DAWN) == sigma(50, DAWN) == sigma(40, None) == Uncertainty().updraft_mps


def test_air_in_layers_swings_about_its_level():
    """At an instant, its speed is displacement times buoyancy frequency, 0.02 rad/s. Over a long time, its mean updraft
    is the difference of two independent displacements over that time."""
    assert updraft.by_waves(1.0) == pytest.approx(0.02 * UPDRAFT.displacement_m, rel=1e-4)
    assert updraft.by_waves(2000.0) == pytest.approx(math.sqrt(2) * UPDRAFT.displacement_m / 2000.0, rel=1e-4)
    assert sigma(3, DAWN) == updraft.by_waves(5 * RUN_S)
    assert updraft.by_waves(1110.0) < Uncertainty().updraft_mps, "the whole test flight"


def test_wind_rises_along_the_slope():
    assert sigma(30, DAWN, wind_mps=10.0) == pytest.approx(10.0 * UPDRAFT.slope)


def test_at_noon_more_runs_and_more_wind_meet_more_eddies():
    item, four, ten = (sigma(runs, NOON) for runs in (1, 4, 10))
    assert 0.1 < item < 0.2
    assert item > four > 1.2 * ten > 0.05
    assert sigma(10, NOON, wind_mps=1.0) > 1.2 * ten
    assert sigma(4, math.radians(20.0)) < 0.7 * four


def test_the_mean_along_a_straight_line_has_the_variance_of_its_integral_length():
    """The variance of a mean over a length L much larger than the integral length l is 2 l / L times that at a point
    (Lenschow & Stankov 1986)."""
    length_m, speed_mps = 2.0e6, 1.0e4  # so fast that no eddy changes
    t_s = np.linspace(0.0, length_m / speed_mps, 100_000)
    path_m = np.stack([speed_mps * t_s, 0 * t_s], axis=1)
    point = updraft.convective_mean(path_m[:1], t_s[:1], HEIGHT_M, NOON)
    points, step_m = 400, length_m / 399  # the line is sampled, so a sum replaces the integral
    decay = math.exp(-step_m / (0.28 * UPDRAFT.mixed_layer_m))
    expected = point * math.sqrt((1 + decay) / (1 - decay) / points)
    assert updraft.convective_mean(path_m, t_s, HEIGHT_M, NOON) == pytest.approx(expected, rel=0.01)


def test_at_the_ground_the_air_cannot_rise():
    assert updraft.convective_mean(np.zeros((1, 2)), np.zeros(1), 0.0, NOON) == 0


def test_the_hour_is_that_of_the_satellites_and_not_of_the_computer():
    noon_s = datetime(2016, 5, 14, 17, 0, tzinfo=UTC).timestamp()
    ends = (Position(0.0, 35.773, -78.674), Position(600.0, 35.773, -78.674))
    by_satellites = Fix(noon_s, by_satellites=True, ends=ends)
    assert math.degrees(updraft.sun_over(by_satellites._replace(ends=ends[:1]))) == pytest.approx(72.9, abs=0.1)
    earlier = by_satellites._replace(unix_at_zero_s=noon_s - 6 * 3600.0)  # the sun is rising: higher at the end
    risen_deg = math.degrees(updraft.sun_over(earlier) - updraft.sun_over(earlier._replace(ends=ends[:1])))
    assert 1.5 < risen_deg < 2.5, "15 degrees an hour, along a path inclined by the latitude"
    assert updraft.sun_over(by_satellites._replace(ends=())) is None
    assert updraft.sun_over(by_satellites._replace(by_satellites=False)) is None
    assert updraft.sun_over(Fix()) is None


def test_the_reader_is_reported_why_an_interval_is_wider_and_what_is_not_known():
    assert not updraft.updraft_notes(updraft.Updraft(0.004, 0.0, DAWN))
    (by_sun,) = updraft.updraft_notes(updraft.Updraft(0.1, 0.09, NOON))
    (by_time,) = updraft.updraft_notes(updraft.Updraft(0.02, 0.0, DAWN))
    (unknown,) = updraft.updraft_notes(updraft.Updraft(0.004, 0.0, None))
    assert len({by_sun, by_time, unknown}) == 3


@pytest.fixture(scope="module")
def in_rising_air() -> AirOf:
    """Return a flight of four minutes in air that rises at RISING_MPS, with all errors of the study."""
    budget, aircraft = load_world("updraft").errors, load_complete_aircraft("nexstar")
    defects = replace(budget.defects, updraft_mps=RISING_MPS)
    flight = flown(aircraft, draw_errors(replace(budget, defects=defects), 3), "two-pairs", 3)
    return air_of(flight.table, aircraft, tunnel_probe())


def reconstructed(air: AirOf, sigma_mps: float) -> Trajectory:
    return reconstruct(air.table, air.still, SensorPriors(file_sigma=stated_sigma(Uncertainty(updraft_mps=sigma_mps))))


def test_a_flight_at_several_speeds_shows_a_steady_updraft(in_rising_air):
    """It acts on the angle of attack as 1/V, unlike an offset or a slope."""
    result = reconstructed(in_rising_air, 1.0)
    assert abs(result.value("updraft") - RISING_MPS) < 3 * result.standard_error("updraft") < 0.15
    assert "updraft" in prior_conflict(reconstructed(in_rising_air, 0.02)).z


def test_by_day_air_that_rose_is_not_taken_for_an_offset_of_the_angle_of_attack(in_rising_air):
    """The flight contradicts the noon prior, 0.1 m/s, and with a wider prior the updraft is found. Before sunrise and
    without a known hour there is no such prior."""
    result = reconstructed(in_rising_air, Uncertainty().updraft_mps)
    by_day = updraft.updraft_by_day(result, NOON)
    assert by_day.contradicted and by_day.z > 2.5 and 0.1 < by_day.sigma_mps < 0.6
    allowed = result.with_prior("updraft", by_day.sigma_mps)
    assert abs(allowed.value("updraft") - RISING_MPS) < 3 * allowed.standard_error("updraft") < 0.3
    assert abs(result.value("updraft") - RISING_MPS) > 0.2
    assert "have risen by" in by_day.note
    assert updraft.updraft_by_day(result, DAWN) is updraft.updraft_by_day(result, None) is None


def test_by_day_a_flight_that_denies_nothing_has_the_prior_of_the_hour(in_rising_air):
    result = reconstructed(in_rising_air, Uncertainty().updraft_mps)
    still = updraft.updraft_by_day(replace(result, sensor_errors=np.zeros(len(result.sensor_errors))), NOON)
    assert not still.contradicted and still.z == 0
    assert 0.05 < still.sigma_mps < 0.15


@pytest.mark.parametrize("sunk_mps", [0.5, 1.0])
def test_a_flight_that_tells_little_is_as_wide_as_the_air_may_sink(in_rising_air, sunk_mps):
    """Gusts leave the updraft uncertain by 0.4 m/s, so the noon prior pulls it to a twentieth, which is no
    contradiction. The prior then becomes as wide as the sink, and with it the estimate reaches the sink."""
    result = reconstructed(in_rising_air, Uncertainty().updraft_mps)
    i, of_hour = SENSOR_ERRORS.index("updraft"), updraft.updraft_by_day(
        replace(result, sensor_errors=np.zeros(len(result.sensor_errors))), NOON).sigma_mps  # fmt: skip
    information_of_data = 1 / 0.4**2
    variance = 1 / (information_of_data + 1 / result.prior_sigma[i] ** 2)
    errors = np.zeros(len(result.sensor_errors))
    errors[i] = -variance * information_of_data * sunk_mps
    covariance = np.diag(np.diag(result.covariance))
    covariance[i, i] = variance
    gusty = replace(result, sensor_errors=errors, covariance=covariance)
    by_day = updraft.updraft_by_day(gusty, NOON)
    expected_z = sunk_mps / math.hypot(0.4, of_hour)
    assert by_day.z == pytest.approx(-expected_z, rel=1e-3) and not by_day.contradicted
    assert by_day.sigma_mps == pytest.approx(math.sqrt(max(sunk_mps**2 - 0.4**2, of_hour**2)), rel=0.02)
    allowed = gusty.with_prior("updraft", by_day.sigma_mps)
    assert abs(allowed.value("updraft") + sunk_mps) < 2 * allowed.standard_error("updraft")


def test_another_prior_gives_the_trajectory_that_is_found_with_it(in_rising_air):
    narrow, wide = (reconstructed(in_rising_air, sigma_mps) for sigma_mps in (0.004, 0.02))
    swapped = narrow.with_prior("updraft", 0.02)
    assert np.diag(swapped.covariance) == pytest.approx(np.diag(wide.covariance), rel=0.1)
    apart = (swapped.sensor_errors - wide.sensor_errors) / np.sqrt(np.diag(wide.covariance))
    assert np.abs(apart).max() < 0.3
    assert (swapped.states - wide.states)["theta"].abs().max() < 1e-3
    assert swapped.prior_standard_error("updraft") == 0.02
