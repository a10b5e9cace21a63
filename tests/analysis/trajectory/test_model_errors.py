"""Tests errors that grow with motor speed, load factor or lift: their effects, and how well a flight shows them."""

import numpy as np
import pytest
from exact_motion import exact_motion

from flightpower.analysis.trajectory.equations import (
    SENSOR_ERRORS,
    NamedArrays,
    corrected_force,
    corrected_rates,
    vibration,
)
from flightpower.analysis.trajectory.observability import prior_conflict
from flightpower.analysis.trajectory.priors import SensorPriors, stated_sigma
from flightpower.analysis.trajectory.reconstruction import Trajectory, reconstruct
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.units import GRAVITY_MPS2

VIBRATION_MPS2, NARROW_MPS2, BENDING_RAD, PER_LIFT, LOADING_PA = 0.1, 0.01, np.radians(1.0), 0.02, 80.0
MADE = {
    "ax_vibration": VIBRATION_MPS2,
    "az_vibration": -VIBRATION_MPS2,
    "alpha_per_g": BENDING_RAD,
}


@pytest.fixture(scope="module")
def reconstructed() -> Trajectory:
    """Return the trajectory of a flight without noise, whose motor speed changes, with errors beyond those assumed."""
    table, _ = exact_motion(40.0)
    t = table.index.to_numpy()
    revps = 70 + 40 * np.sin(0.6 * t)
    shaken = (revps / 100) ** 2
    load = -table["az_mps2"] / GRAVITY_MPS2
    wrong = table.assign(
        n_revps=revps,
        ax_mps2=table["ax_mps2"] + VIBRATION_MPS2 * shaken,
        az_mps2=table["az_mps2"] - VIBRATION_MPS2 * shaken,
        alpha_rad=table["alpha_rad"] + BENDING_RAD * (load - 1),
    )
    return reconstruct(wrong, [slice(0, 0)], SensorPriors(factor=10.0))


def test_offsets_by_vibration_and_bending_by_load_are_found(reconstructed: Trajectory) -> None:
    for name, value in MADE.items():
        assert reconstructed.value(name) == pytest.approx(
            value, abs=max(0.1 * abs(value), 3 * reconstructed.standard_error(name))
        ), name
        assert reconstructed.standard_error(name) < 0.3 * abs(value), name


def test_turns_show_how_far_ahead_the_probe_sits_where_the_file_does_not_say() -> None:
    """A probe 0.3 m further ahead moves up as the aircraft pitches up, and to the right as it yaws to the right. If its
    place is assumed to be known, residuals of the angle of attack are larger."""
    table, _ = exact_motion(turns=True)
    ahead_m = 0.3
    wrong = table.assign(
        alpha_rad=table["alpha_rad"] - ahead_m * table["q_radps"] / table["V_mps"],
        beta_rad=table["beta_rad"] + ahead_m * table["r_radps"] / table["V_mps"],
    )
    unknown, fixed = (reconstruct(wrong, [slice(0, 0)], SensorPriors(probe_ahead_m=m)) for m in (1.0, 1e-6))
    error_m = unknown.standard_error("probe_ahead")
    assert error_m < 0.2
    assert unknown.value("probe_ahead") == pytest.approx(ahead_m, abs=max(2 * error_m, 0.1))
    assert abs(fixed.value("probe_ahead")) < 1e-5
    assert unknown.residuals["alpha"] < fixed.residuals["alpha"]


def test_vibration_is_the_square_of_motor_speed_and_nothing_without_it() -> None:
    assert vibration(np.array([100.0, 50.0, 0.0, np.nan])) == pytest.approx([1.0, 0.25, 0.0, 0.0])


def test_specific_force_is_corrected_for_both_kinds_of_offset_and_then_for_scale() -> None:
    """A reading is the force times one plus the scale error, plus both offsets."""
    errors = NamedArrays(SENSOR_ERRORS, 0.01 * np.arange(1.0, len(SENSOR_ERRORS) + 1))
    ax, ay, az, shaken = 5.0, 6.0, -9.0, 0.5
    read = (
        (1 + errors.ax_scale) * ax + errors.ax_bias + shaken * errors.ax_vibration,
        ay + errors.ay_bias,
        (1 + errors.az_scale) * az + errors.az_bias + shaken * errors.az_vibration,
        shaken,
    )
    assert corrected_force(NamedArrays(("ax", "ay", "az", "vibration"), read), errors) == pytest.approx((ax, ay, az))


def test_angular_rates_are_corrected_for_offset_and_scale() -> None:
    errors = NamedArrays(SENSOR_ERRORS, 0.01 * np.arange(1.0, len(SENSOR_ERRORS) + 1))
    rates = 0.5, -0.3, 0.2
    read = [
        (1 + getattr(errors, f"{axis}_scale")) * rate + getattr(errors, f"{axis}_bias")
        for axis, rate in zip("pqr", rates, strict=True)
    ]
    assert corrected_rates(NamedArrays(("p", "q", "r"), read), errors) == pytest.approx(rates)


def test_airspeed_that_errs_with_lift_is_a_constant_pressure_in_level_flight() -> None:
    """(1 + k CL)^2 qbar is qbar + 2 k CL qbar to first order, and CL qbar is the wing loading."""
    sigma = stated_sigma(Uncertainty(airspeed_per_lift_fraction=PER_LIFT), LOADING_PA)
    for qbar in (50.0, 300.0):
        CL = LOADING_PA / qbar
        assert sigma["position_error"] == pytest.approx(((1 + PER_LIFT * CL) ** 2 - 1) * qbar, rel=0.03)


def test_a_narrow_prior_hides_no_conflict() -> None:
    """The estimate stays near its narrow prior, but the data disagree, so the disagreement widens the interval."""
    table, _ = exact_motion(40.0)
    revps = 70 + 40 * np.sin(0.6 * table.index.to_numpy())
    wrong = table.assign(n_revps=revps, ax_mps2=table["ax_mps2"] + VIBRATION_MPS2 * (revps / 100) ** 2)
    narrow = Uncertainty(accelerometer_vibration_mps2=NARROW_MPS2)
    trajectory = reconstruct(wrong, [slice(0, 0)], SensorPriors(file_sigma=stated_sigma(narrow)))
    conflict, i = prior_conflict(trajectory), SENSOR_ERRORS.index("ax_vibration")
    assert abs(conflict.z["ax_vibration"]) > 3
    assert conflict.factor[i] * NARROW_MPS2 == pytest.approx(VIBRATION_MPS2, rel=0.5)
