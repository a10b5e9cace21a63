"""Tests the consistency of sensors after correction, and which sensor errors a flight determines."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from test_reconstruction import flown as fly

from flightpower.analysis.results import evidence as trust
from flightpower.analysis.results.flight_found import path_result
from flightpower.analysis.trajectory import observability
from flightpower.analysis.trajectory.block_means import block_mean
from flightpower.analysis.trajectory.consistency import ANGLES, SPEED, consistency, difference_check
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import (
    FlightExcitation,
    MissingExcitation,
    missing,
    sensor_error_estimates,
    sensor_error_notes,
)
from flightpower.analysis.trajectory.priors import PRIOR_SIGMA, ZEROS
from flightpower.analysis.trajectory.reconstruction import reconstruct

pytestmark = pytest.mark.xdist_group("calm")

GPS = ("gps_north_mps", "gps_east_mps", "gps_down_mps")
WITHIN = 3.3  # standard errors: 99.9 %

UP = """
heading = "20 deg"
[air]
wind = "2 m/s"
wind_from = "310 deg"
[[segment]]
kind = "stand"
duration = "20 s"
[[segment]]
kind = "take-off"
[[segment]]
kind = "climb"
height = "80 m"
climb = "3 m/s"
speed_over_stall = 1.6
"""
LEG = """
[[segment]]
kind = "hold"
duration = "25 s"
speed_over_stall = 1.6
"""
PORPOISE = LEG.replace('"hold"', '"porpoise"')
TURN = """
[[segment]]
kind = "turn"
"""


@pytest.fixture(scope="module")
def corrected_flight(calm):
    """Return a calm full test flight: the truth at the path's instants, the IMU's tilt, air data and path."""
    truth, errors, air, trajectory = calm(0)
    t = trajectory.states.index.to_numpy()
    true = {name: np.interp(t, truth["time_s"], truth[name]) for name in ("V_mps", "alpha_rad")}
    return true, errors.imu_rotation[0, 2], air, trajectory


@pytest.fixture(scope="module")
def without_gps(probe):
    """Return the trajectory of a short flight on one heading in calm air, without GPS."""
    _, _, air, still = fly(0, probe, "accel-decel", without=GPS)
    return reconstruct(air, still)


@pytest.mark.slow
def test_the_angles_agree_after_correction_and_before_differ_by_the_error_of_alpha(corrected_flight) -> None:
    """Before correction, theta - alpha - gamma is minus the error of alpha, to the 0.1 deg of a calm flight.

    The true mean error comes from the injected offset and slope, and from the IMU's tilt, which acts as an offset
    (test_reconstruction).
    """
    true, tilt, air, trajectory = corrected_flight
    agreement = consistency(trajectory)
    before, after = (difference_check(differences[ANGLES]) for differences in agreement)
    flew = agreement.before[ANGLES].notna().to_numpy()
    error = tilt + np.nanmean((block_mean(air["alpha_rad"], len(flew)) - true["alpha_rad"])[flew])
    assert abs(before.mean + error) < np.radians(0.1)
    assert abs(before.mean) > WITHIN * before.mean_standard_error, "an error of this size must be obvious"
    assert abs(after.mean) < WITHIN * after.mean_standard_error
    assert after.sigma < before.sigma


@pytest.mark.slow
def test_airspeed_agrees_with_gps_after_correction_and_before_differs_by_its_scale(corrected_flight) -> None:
    """Before correction, airspeed is off by its true error, within the 0.3 % that a calm flight can resolve."""
    true, _, air, trajectory = corrected_flight
    agreement = consistency(trajectory)
    before, after = (difference_check(differences[SPEED]) for differences in agreement)
    flew = agreement.before[SPEED].notna().to_numpy()
    V = true["V_mps"][flew]
    error = np.nanmean(block_mean(air["V_mps"], len(flew))[flew] - V)
    assert before.mean == pytest.approx(error, abs=0.003 * V.mean())
    assert abs(error) > 0.008 * V.mean(), "the scale drawn for this flight is 1 % low"
    assert abs(after.mean) < WITHIN * after.mean_standard_error
    assert after.sigma < before.sigma


@pytest.mark.slow
def test_a_full_test_flight_determines_every_error_but_two(corrected_flight) -> None:
    *_, trajectory = corrected_flight
    errors = sensor_error_estimates(trajectory)
    assert {error.name for error in errors} == set(SENSOR_ERRORS) - {"heading_bias", "probe_ahead", *ZEROS}, (
        "there is no compass, and the aircraft file says where the probe is"
    )
    undetermined = {error.name for error in errors if not error.determined}
    assert "updraft" in undetermined, "its prior before sunrise is better"
    assert undetermined <= {"updraft", "alpha_per_g"}, "scales may hide the bending of the boom"
    assert sensor_error_notes(errors) == []


def test_without_gps_the_latency_is_not_determined_and_the_reason_is_given(without_gps) -> None:
    trajectory = without_gps
    latency = next(error for error in sensor_error_estimates(trajectory) if error.name == "gps_latency")
    assert not latency.determined
    assert latency.missing == [MissingExcitation.GPS]
    message = path_result(trajectory, consistency(trajectory))
    assert [check.before.unit for check in message.checks] == ["deg"], "nothing to compare airspeed with"


@pytest.mark.parametrize("turns", [False, True])
def test_in_gusts_turns_determine_the_airspeed_scale_and_one_heading_does_not(
    probe, tmp_path: Path, turns: bool
) -> None:
    """Two flights of 2.5 minutes in W20 = 6 kt differ only in their turns.

    In calm air one heading is enough, because accelerometers also measure a change of speed.
    """
    plan = tmp_path / "plan.toml"
    plan.write_text(UP + (LEG + TURN if turns else LEG) * 6, "utf-8")
    _, _, air, still = fly(0, probe, str(plan), turbulence_kt=6.0)
    errors = sensor_error_estimates(reconstruct(air, still))
    scale = next(error for error in errors if error.name == "V_scale")
    assert scale.determined == turns
    assert (MissingExcitation.HEADINGS in scale.missing) == (not turns)
    assert any("scale of airspeed" in note for note in sensor_error_notes(errors)) == (not turns)
    slope = next(error for error in errors if error.name == "alpha_scale")
    assert MissingExcitation.SPEEDS in slope.missing, "one speed, with turns or without"


@pytest.mark.slow
def test_in_gusts_porpoising_determines_the_slope_of_angle_of_attack(probe, tmp_path: Path) -> None:
    """Two flights of 2.5 minutes in W20 = 10 kt at one speed differ only in 50 s of porpoising.

    Gusts have sigma 0.5 m/s and L = 80 m, porpoising has 3 deg rms at 4.1 rad/s. At best, the variance of the slope is
    3 sigma^2/(V omega^2 L) over the integral of the squared angle, (1.6 %)^2. 3 % are assumed; 2.4 % is determined.
    """
    slopes = []
    for legs in (6 * LEG, 2 * LEG + 2 * PORPOISE + 2 * LEG):
        plan = tmp_path / "plan.toml"
        plan.write_text(UP + legs, "utf-8")
        truth, _, air, still = fly(0, probe, str(plan), turbulence_kt=10.0)
        trajectory = reconstruct(air, still)
        flown = air["alpha_rad"].notna() & air["flying"]
        true_alpha = np.interp(air.index, truth["time_s"], truth["alpha_rad"])[flown]
        shown = np.polyfit(true_alpha, air["alpha_rad"][flown], 1)[0] - 1
        assert abs(trajectory.value("alpha_scale") - 2 * trajectory.value("V_scale") - shown) < WITHIN * np.hypot(
            trajectory.standard_error("alpha_scale"), 2 * trajectory.standard_error("V_scale")
        )
        slopes.append(next(error for error in sensor_error_estimates(trajectory) if error.name == "alpha_scale"))
    without, porpoised = slopes
    assert not without.determined and MissingExcitation.PORPOISING in without.missing
    assert porpoised.determined
    surest = 1 / np.hypot(1 / 1.6, 1 / 3.0)  # percent, from the bound and the prior together
    assert porpoised.standard_error > surest


def test_every_sensor_error_has_a_reason_when_not_determined() -> None:
    complete = FlightExcitation(gps=True, sideslip=True, mean_heading_vector=0.0, speed_ratio=2.0, gust_mps=0.0)
    empty = FlightExcitation(gps=False, sideslip=False, mean_heading_vector=1.0, speed_ratio=1.0, gust_mps=2.0)
    for name in observability.SENSOR_ERROR_KINDS:
        assert missing(name, complete) == (MissingExcitation.DURATION,)
        assert missing(name, empty)
    assert len(missing("beta_bias", empty)) == 4


def test_the_standard_error_of_a_mean_allows_for_slow_changes() -> None:
    """For white noise it is sigma / sqrt(n). A wave twice as long as a batch makes batches scatter far more."""
    t = np.arange(0, 400, 0.2)
    white = pd.Series(np.random.default_rng(0).normal(0, 1, len(t)), index=t)
    assert difference_check(white).mean_standard_error == pytest.approx(
        1 / np.sqrt(len(t)), rel=0.5
    )  # 20 batches give it to 16 %, 1 sigma
    wave = pd.Series(np.sign(np.sin(np.pi * t / 20)), index=t)
    assert difference_check(wave).mean_standard_error > 5 * wave.std() / np.sqrt(len(t))
    assert difference_check(white[:50]) is None, "one batch does not show the scatter between batches"


def test_each_error_is_shown_in_its_unit():
    """The factor converts one SI unit (rad, s, 1) to the unit printed after the number."""
    in_unit = {
        "deg": 180 / np.pi,
        "deg/s": 180 / np.pi,
        "%": 100.0,
        "ms": 1000.0,
        "m/s²": 1.0,
        "m/s": 1.0,
        "m": 1.0,
        "Pa": 1.0,
    }
    for kind in observability.SENSOR_ERROR_KINDS.values():
        factor, unit = kind.display_unit
        assert factor == pytest.approx(in_unit[unit]), kind.title


def test_each_error_has_a_title_a_prior_and_a_culprit():
    """A new sensor error needs more than its equation: every folder that reports on it must know it."""
    for table in (observability.SENSOR_ERROR_KINDS, trust.CULPRIT):
        assert set(table) == set(SENSOR_ERRORS)
    assert set(SENSOR_ERRORS) <= set(PRIOR_SIGMA)
