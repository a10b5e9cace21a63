"""Constructed estimates test the comparison: which differences are allowed, and which cause is named, and its sign."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Polar
from flightpower.analysis.methods.causes import ErrorEstimate
from flightpower.analysis.methods.comparison import disagreements
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.method import Method, MethodEstimate
from flightpower.analysis.methods.methods_from_runs import ACCELERATIONS, DECELERATIONS, DIRECT, ENERGY
from flightpower.analysis.methods.settings import COMPARISON
from flightpower.analysis.records.flight import CurveStatus

AT = Condition(weight_N=37.68, rho=1.2, wing_area_m2=0.4636)
A = np.array([0.0465, -0.0195, 0.065])
CL = (0.3, 1.0)
NOISE = np.diag([1e-4, 0.0, 0.0]) ** 2
SURE = {name: ErrorEstimate(0.0, 1e-6) for name in COMPARISON.installation_sigma}


def dynamic(noise: np.ndarray = NOISE) -> DynamicEstimate:
    zero = np.zeros((5, 5))
    covariance = zero.copy()
    covariance[:3, :3] = noise
    return DynamicEstimate(Polar(A, noise), [], CurveStatus.CONVERGED, "", [], [], np.r_[A, 0.0, 0.0], covariance, zero)


def by(method: Method, change: float, **fields) -> MethodEstimate:
    """Return an estimate whose drag coefficient differs by the constant `change`."""
    there = A + np.array([change, 0.0, 0.0])
    return MethodEstimate(method, Polar(there, NOISE), noise=NOISE, flown_CL=CL, **fields)


def compared(*estimates: MethodEstimate, errors=SURE, noise: np.ndarray = NOISE):
    return disagreements(dynamic(noise), CL, list(estimates), errors, AT)


def effect(change: float) -> np.ndarray:
    return np.array([change, 0.0, 0.0])


# With three degrees of freedom, those of the polar, chi-square exceeds 11.344867 with a probability of 1 % (tables).
BAND = np.sqrt(11.344867)


def test_methods_disagree_beyond_the_simultaneous_band_of_their_difference() -> None:
    """Each method has a standard error of 1e-4 in C_D, so the difference has one of sqrt(2) times 1e-4."""
    limit = BAND * np.sqrt(2) * 1e-4
    assert compared(by(DIRECT, 0.99 * limit)) == []
    (result,) = compared(by(DIRECT, 1.01 * limit))
    assert abs(result.difference_W) == pytest.approx(1.01 * result.allowed_W, rel=1e-6)


def test_what_a_careful_installation_leaves_is_allowed() -> None:
    sensitivities = {"alpha_bias": effect(1.0)}
    change = 2.5 * COMPARISON.installation_sigma["alpha_bias"]
    assert len(compared(by(DIRECT, change))) == 1
    assert compared(by(DIRECT, change, sensitivities=sensitivities)) == []


def test_an_error_that_both_methods_share_is_not_allowed_for() -> None:
    """Two methods with equal sensitivity to lag err alike; with opposite sensitivities they differ."""
    tolerance = COMPARISON.installation_sigma["lag"]
    for sign, count in ((1.0, 1), (-1.0, 0)):
        method_estimate = by(DECELERATIONS, 0.0, sensitivities={"lag": effect(1.0)})
        other = by(ACCELERATIONS, 4 * tolerance, sensitivities={"lag": effect(sign)})
        assert len(disagreements(None, CL, [method_estimate, other], SURE, AT)) == count


def test_trajectory_errors_that_both_methods_share_cancel() -> None:
    moved = np.array([[0.01], [0.0], [0.0]])
    for sign, count in ((1.0, 1), (-1.0, 0)):
        method_estimate = by(DECELERATIONS, 0.0, trajectory_deviations=moved)
        other = by(ACCELERATIONS, 0.01, trajectory_deviations=sign * moved)
        assert len(disagreements(None, CL, [method_estimate, other], SURE, AT)) == count


def test_methods_without_common_speeds_are_not_compared() -> None:
    """The common speeds must span a ratio of at least 1.15."""
    narrow = by(DIRECT, 0.01)
    assert compared(replace(narrow, flown_CL=(0.3, 0.3 * 1.14**2))) == []
    assert len(compared(replace(narrow, flown_CL=(0.3, 0.3 * 1.16**2)))) == 1


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_cause_with_the_largest_share_in_the_difference_s_direction_is_named(sign: float) -> None:
    effects = {"angle of attack": effect(0.008 * sign), "air-data lag": effect(-0.02 * sign)}
    (result,) = compared(by(DIRECT, 0.01 * sign, cause_effects=effects | {"propeller table": effect(0.015 * sign)}))
    assert result.culprit == "propeller table"
    assert result.shares_W["air-data lag"] * result.difference_W < 0
    assert sum(result.shares_W.values()) == pytest.approx(result.difference_W)
    assert ("above" if sign > 0 else "below") in result.text


def test_a_small_significant_error_is_named_where_the_rest_is_within_what_is_allowed() -> None:
    """The difference is 1.1 times the limit, and a fifth of it is explained; only a significant error is reported."""
    change = 1.1 * BAND * np.sqrt(2) * 1e-4
    estimate = by(DIRECT, change, cause_effects={"angle of attack": effect(0.2 * change)})
    assert compared(estimate) == []
    (result,) = compared(estimate, errors=SURE | {"alpha_bias": ErrorEstimate(3.1e-6, 1e-6)})
    assert result.culprit == "angle of attack"
    assert compared(estimate, errors=SURE | {"alpha_bias": ErrorEstimate(2.9e-6, 1e-6)}) == []


def test_a_difference_that_nothing_explains_has_no_cause_but_for_energy() -> None:
    (direct,) = compared(by(DIRECT, 0.01))
    assert direct.culprit == "unexplained" and "No estimated error" in direct.text
    (energy,) = compared(by(ENERGY, 0.01))
    assert energy.culprit == "pitch attitude"


@pytest.mark.parametrize(("change", "side"), [(-1.0, "high"), (1.0, "low")])
def test_energy_below_dynamic_shows_a_trajectory_pitched_too_high(change: float, side: str) -> None:
    """A pitch attitude 1 deg too high adds L tan(1 deg) to the dynamic method's drag, so its A1 is 0.01746 higher."""
    there = A + np.array([0.0, change * np.radians(1.0), 0.0])
    estimate = replace(by(ENERGY, 0.0), polar=Polar(there, NOISE))
    (result,) = compared(estimate)
    assert f"pitch attitude is 1.00 deg too {side}" in result.text


@pytest.mark.parametrize(
    ("method", "cause", "errors", "sentence"),
    [
        (DIRECT, "angle of attack", {"alpha_bias": (np.radians(1.5), np.radians(0.05))},
         "angle of attack is 1.50 ± 0.10 deg too high relative to the IMU axes."),
        (DIRECT, "angle of attack", {"alpha_scale": (-0.05, 0.01)}, "its slope is 5.0 ± 2.0 % too low."),
        (DIRECT, "pitch attitude", {"pitch": (np.radians(-1.0), np.radians(0.05))},
         "attitude 1.00 ± 0.10 deg too low."),
        (ENERGY, "airspeed", {"airspeed_scale": (0.05, 0.005)}, "airspeed is 5.0 ± 1.0 % too high."),
        (DIRECT, "air-data lag", {"lag": (0.2, 0.01)}, "air data lag by 0.200 ± 0.020 s."),
        (DIRECT, "propeller table", {"thrust_scale": (-0.07, 0.01), "thrust_slope": (0.2, 0.05)},
         "Thrust is 7.0 ± 2.0 % less than the propeller table gives at J = 0.5, changing by +2.0 % per 0.1 of J"),
    ],
)  # fmt: skip
def test_text_states_the_estimated_error_with_its_95_per_cent_interval(method, cause, errors, sentence) -> None:
    estimates = SURE | {name: ErrorEstimate(*values) for name, values in errors.items()}
    (result,) = compared(by(method, 0.01, cause_effects={cause: effect(0.009)}), errors=estimates)
    assert result.culprit == cause
    assert sentence in result.text
    assert "remain unexplained" in result.text
