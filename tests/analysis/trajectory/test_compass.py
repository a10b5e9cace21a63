"""The trajectory with a calibrated magnetometer agrees with the simulator's truth."""

import dataclasses

import numpy as np
import pytest
from test_reconstruction import flown as fly

from flightpower.analysis.air.magnetometer import compass
from flightpower.analysis.calibrations.magnetometer import calibrate
from flightpower.analysis.trajectory.block_means import BlockMeans
from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    MEASUREMENTS,
    PROCESS_INPUTS,
    SENSOR_ERRORS,
    STATES,
    EquationInputs,
)
from flightpower.analysis.trajectory.linearized_equations import Equations
from flightpower.analysis.trajectory.observability import MissingExcitation, heading_notes, sensor_error_estimates
from flightpower.analysis.trajectory.priors import PRIOR_SIGMA
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.motion import body_from_earth, earth_from_body
from flightpower.flight.runs import AIRCRAFT_SIZE
from flightpower.sim.sensors.tray import DIP_RAD, FIELD_T

GPS = ("gps_north_mps", "gps_east_mps", "gps_down_mps")
MAG = [f"mag_{axis}_T" for axis in "xyz"]
WITHIN = 3.0  # standard errors
GUSTY_KT = 6.0


def calibration_by_hand(errors):
    """Calibrate the magnetometer from a minute of turning the aircraft about on the ground."""
    t = np.linspace(0, 60, 1500)
    attitude = np.pi * np.sin(t / 3.7), 1.3 * np.sin(t / 2.7 + 1), t / 1.75
    body = np.column_stack(body_from_earth((FIELD_T * np.cos(DIP_RAD), 0.0, FIELD_T * np.sin(DIP_RAD)), attitude))
    noise = errors.noise.magnetic_T * np.random.default_rng(0).normal(size=body.shape)
    return calibrate(body @ errors.soft_iron.T + errors.hard_iron + noise, "turned by hand")


def heading_error(trajectory, truth):
    """Return the error of the heading in flight, and its standard error [deg]."""
    t = trajectory.states.index.to_numpy()
    true = np.interp(t, truth["time_s"], np.unwrap(truth["yaw_rad"]))
    high = np.interp(t, truth["time_s"], truth["height_m"]) > AIRCRAFT_SIZE.least_height_m
    off = (trajectory.states["psi"].to_numpy() - true + np.pi) % (2 * np.pi) - np.pi
    return np.degrees(off)[high], np.degrees(trajectory.states_error()["psi"].to_numpy())[high]


def iron(air, field_T):
    """Return the air data with iron that came aboard after the magnetometer was calibrated."""
    return air.assign(**{name: air[name] + b for name, b in zip(MAG, field_T, strict=True)})


@pytest.fixture(scope="module")
def with_gps(probe):
    """Return a short flight in gusts with GPS: calibration of the magnetometer, air data, stretches at rest, the path
    without a compass, and the truth."""
    truth, errors, air, still = fly(0, probe, "accel-decel", turbulence_kt=GUSTY_KT)
    return calibration_by_hand(errors), air, still, reconstruct(air, still), truth


@pytest.fixture(scope="module")
def without_gps(probe):
    """Return the same for this flight without GPS."""
    truth, errors, air, still = fly(0, probe, "accel-decel", turbulence_kt=GUSTY_KT, without=GPS)
    return calibration_by_hand(errors), air, still, reconstruct(air, still), truth


def test_the_field_across_north_is_zero_and_depends_on_heading_only() -> None:
    """At any attitude it is zero across magnetic north. Its derivative with respect to heading is the level field, and
    to bank and pitch zero, though the field is steep, so residual iron cannot bank the aircraft."""
    rng = np.random.default_rng(0)
    n, level_T, declination = 50, FIELD_T * np.cos(DIP_RAD), 0.2
    x = np.zeros((n, len(STATES)))
    x[:, :3] = rng.uniform(-1, 1, (n, 3)) * (1.0, 0.5, np.pi)
    north = level_T * np.cos(declination), level_T * np.sin(declination), FIELD_T * np.sin(DIP_RAD)
    body = body_from_earth(north, x[:, :3].T)
    ones = np.ones((n, len(MEASUREMENT_INPUTS)))
    for name, part in zip(
        ("field_forward", "field_right"), earth_from_body(body, (x[:, 0], x[:, 1], 0.0)), strict=False
    ):
        ones[:, MEASUREMENT_INPUTS.index(name)] = part
    shared = np.zeros(len(SENSOR_ERRORS))
    shared[
        SENSOR_ERRORS.index("heading_bias")
    ] = -declination  # magnetic north lies to the east: the compass reads less
    nothing = np.zeros((n, len(MEASUREMENTS)))
    process = np.zeros((n - 1, len(PROCESS_INPUTS))), np.ones((n - 1, len(STATES)))
    linearization = Equations(n).linearize(x, shared, EquationInputs(*process, nothing, nothing + 1.0, ones, x, ones))
    row = MEASUREMENTS.index("compass")
    assert np.abs(linearization.measurement_residual[:, row]).max() < 1e-12 * FIELD_T
    slope = linearization.measurement_jacobian.dense()[:, row] / level_T
    assert slope[:, STATES.index("psi")] == pytest.approx(np.ones(n))
    assert slope[:, len(STATES) + SENSOR_ERRORS.index("heading_bias")] == pytest.approx(np.ones(n))
    assert np.count_nonzero(slope) == 2 * n


def test_without_gps_the_compass_holds_the_heading(without_gps) -> None:
    """It halves the uncertainty, and the true heading (the simulator's declination is zero) always stays within it."""
    calibration, air, still, alone, truth = without_gps
    field, message = compass(air, calibration)
    trajectory = reconstruct(air, still, compass=field)
    assert trajectory.converged and message == []
    off, error = heading_error(trajectory, truth)
    assert np.abs(off / error).max() < WITHIN
    assert error.mean() < 0.5 * heading_error(alone, truth)[1].mean()
    assert trajectory.standard_error("r_bias") < 0.8 * alone.standard_error("r_bias")
    assert 0 < trajectory.residuals["compass"] < 1


@pytest.mark.parametrize("left_uT", [(2.0, -2.0, 2.0), (-3.0, 0.0, -3.0)])
def test_iron_that_moved_since_the_calibration_stays_within_the_stated_error(without_gps, left_uT) -> None:
    """3 uT in 22 uT of level field are 8 deg. Pitch and bank do not follow: 0.1 deg is 2 % of power near the stall."""
    calibration, air, still, alone, truth = without_gps
    field, _ = compass(iron(air, 1e-6 * np.array(left_uT)), calibration)
    trajectory = reconstruct(air, still, compass=field)
    off, error = heading_error(trajectory, truth)
    assert np.abs(off / error).max() < WITHIN
    for angle in ("phi", "theta"):
        assert np.degrees(np.abs(trajectory.states[angle] - alone.states[angle])).max() < 0.05
    assert abs(trajectory.value("alpha_bias") - alone.value("alpha_bias")) < 0.1 * alone.standard_error("alpha_bias")


@pytest.mark.parametrize("left_uT", [(0.0, 0.0, 0.0), (-3.0, 3.0, 3.0)])
def test_with_gps_the_compass_changes_nothing_even_with_residual_iron(with_gps, left_uT) -> None:
    calibration, air, still, alone, _ = with_gps
    field, _ = compass(iron(air, 1e-6 * np.array(left_uT)), calibration)
    trajectory = reconstruct(air, still, compass=field)
    assert trajectory.converged
    moved = dict(
        zip(
            SENSOR_ERRORS,
            (trajectory.sensor_errors - alone.sensor_errors) / np.sqrt(np.diag(alone.covariance)),
            strict=True,
        )
    )
    moved.pop("heading_bias")
    assert max(map(abs, moved.values())) < 0.05
    for angle in ("phi", "theta", "psi"):
        assert np.degrees(np.abs(trajectory.states[angle] - alone.states[angle])).max() < 0.1


def test_with_gps_the_declination_is_found(with_gps) -> None:
    """Magnetic north is 12 deg to the west, so the compass reads 12 deg more. The prior pulls it by a fiftieth."""
    calibration, air, still, alone, truth = with_gps
    declination = np.radians(-12.0)
    level = FIELD_T * np.cos(DIP_RAD) * np.array([np.cos(declination), np.sin(declination)])
    attitude = [np.interp(air.index, truth["time_s"], np.unwrap(truth[f"{a}_rad"])) for a in ("roll", "pitch", "yaw")]
    field, _ = compass(air, calibration)
    field.field_T[:] = np.column_stack(body_from_earth((*level, FIELD_T * np.sin(DIP_RAD)), attitude))
    trajectory = reconstruct(air, still, compass=field)
    assert trajectory.converged
    off = np.degrees(trajectory.value("heading_bias")) - 12.0
    assert abs(off) < WITHIN * np.degrees(trajectory.standard_error("heading_bias")) < 6.0
    assert np.degrees(np.abs(trajectory.states["psi"] - alone.states["psi"])).max() < 0.1
    assert heading_notes(trajectory, calibrated=True) == []


def test_a_board_mounted_back_to_front_is_reported_and_has_no_effect_on_power(with_gps) -> None:
    """Its heading error also varies by tens of degrees. The reconstructed heading changes by less than a degree, and
    the sensor errors that power depends on do not change."""
    calibration, air, still, alone, _ = with_gps
    field, _ = compass(air, calibration)
    trajectory = reconstruct(air, still, compass=field._replace(field_T=field.field_T * (-1, -1, 1)))
    assert trajectory.converged
    assert np.degrees(abs(trajectory.value("heading_bias"))) == pytest.approx(180, abs=15)
    assert np.degrees(np.abs(trajectory.states["psi"] - alone.states["psi"])).max() < 1.0
    for name in ("alpha_bias", "alpha_scale", "V_scale"):
        assert abs(trajectory.value(name) - alone.value(name)) < 0.05 * alone.standard_error(name)
    (note,) = heading_notes(trajectory, calibrated=True)
    assert "contradicts GPS" in note and "mounted" in note


def test_an_uncalibrated_magnetometer_is_not_used_and_is_noted_only_without_gps(with_gps, without_gps) -> None:
    for (_, air, still, alone, _), gps in ((with_gps, True), (without_gps, False)):
        trajectory = reconstruct(iron(air, (15e-6, 0.0, 0.0)), still)
        assert np.array_equal(trajectory.states, alone.states) and np.array_equal(
            trajectory.sensor_errors, alone.sensor_errors
        )
        assert trajectory.standard_error("heading_bias") == pytest.approx(
            trajectory.prior_standard_error("heading_bias")
        )
        notes = heading_notes(trajectory, calibrated=False)
        assert len(notes) == (0 if gps else 1)
        assert all("not determined" in note and "not its calibration" in note for note in notes)
        bare = dataclasses.replace(trajectory, block_means=BlockMeans(air.drop(columns=MAG)))
        assert not any("agnetometer" in note for note in heading_notes(bare, calibrated=False))


def test_the_offset_of_the_compass_is_determined_with_gps_only(with_gps, without_gps) -> None:
    """Without GPS, the compass defines north. Errors of a compass that was not used are not listed."""
    for (calibration, air, still, alone, _), gps in ((with_gps, True), (without_gps, False)):
        trajectory = reconstruct(air, still, compass=compass(air, calibration)[0])
        offset = next(error for error in sensor_error_estimates(trajectory) if error.name == "heading_bias")
        assert offset.determined == gps
        assert offset.missing == ([] if gps else [MissingExcitation.GPS])
        assert (trajectory.prior_standard_error("heading_bias") == PRIOR_SIGMA["heading_bias"]) == gps
        assert all("held the heading" in note for note in heading_notes(trajectory, calibrated=True))
        assert len(heading_notes(trajectory, calibrated=True)) == (0 if gps else 1)
        for note in heading_notes(trajectory, calibrated=True):
            assert 1.0 < float(note.partition("standard error ")[2].split(" deg")[0]) < 5.0, "motor currents give 3 deg"
        assert "heading_bias" not in {error.name for error in sensor_error_estimates(alone)}


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize("turbulence_kt", [0.0, GUSTY_KT])
def test_twenty_minutes_without_gps_stay_on_their_heading(probe, turbulence_kt: float) -> None:
    truth, errors, air, still = fly(0, probe, "full-test-flight", without=GPS, turbulence_kt=turbulence_kt)
    field, _ = compass(iron(air, (1e-6, -1e-6, 1e-6)), calibration_by_hand(errors))
    trajectory = reconstruct(air, still, compass=field)
    assert trajectory.converged
    off, error = heading_error(trajectory, truth)
    assert np.abs(off / error).max() < WITHIN
    assert error.max() < 5.0
