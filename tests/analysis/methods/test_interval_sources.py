"""The shares of the variance of power required add up, and each responds to its own error."""

from types import SimpleNamespace

import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Polar, power_required
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.consider import JointEstimate
from flightpower.analysis.methods.interval_sources import Share, shares_of_correlated, variance_by_source
from flightpower.analysis.results.curves import interval_parts
from flightpower.analysis.uncertain import Uncertain

NAMES = ("A0", "A1", "A2", "thrust_scale", "V_scale", "alpha_bias", "gps_latency")
CONDITION = Condition(weight_N=37.0, rho=1.2, wing_area_m2=0.46)
V = np.linspace(12.0, 24.0, 5)


def joint(covariance: np.ndarray, **changes: np.ndarray) -> JointEstimate:
    values = np.array([0.045, 0.0, 0.065, 0.0, 0.0, 0.0, 0.0])
    return JointEstimate(NAMES, Uncertain(values, covariance, changes), covariance[:4, :4], values, np.full(7, np.inf))


def covariance_of(seed: int) -> np.ndarray:
    """Return the covariance of seven correlated errors whose sizes differ by factors of up to 1e5."""
    root = np.random.default_rng(seed).normal(size=(7, 12))
    scale = np.array([1e-3, 1e-3, 1e-3, 1e-2, 1e-2, 1e-4, 10.0])
    return (root @ root.T) * np.outer(scale, scale)


@pytest.mark.parametrize("seed", range(5))
def test_shares_are_never_negative_and_with_all_known_the_noise_of_the_runs_is_left(seed: int) -> None:
    covariance, gradient = covariance_of(seed), np.random.default_rng(seed).normal(size=(4, 3))
    shares = shares_of_correlated(joint(covariance), gradient)
    assert shares.keys() == {Share.PROPELLER, Share.AIRSPEED, Share.ANGLE_OF_ATTACK, Share.OTHER_SENSORS}
    assert min(share.min() for share in shares.values()) >= 0
    across = covariance[:3, 3:]
    explained = gradient @ across @ np.linalg.inv(covariance[3:, 3:]) @ across.T @ gradient.T
    assert sum(shares.values()) == pytest.approx(np.diag(explained), rel=1e-9)


def test_independent_errors_have_what_each_alone_contributes_and_alike_ones_share() -> None:
    """A0 = airspeed error + 2 x angle-of-attack error; then both errors are the same, and each has half the share."""
    covariance = np.diag([5.0, 1, 1, 1, 1, 1, 1])
    covariance[0, 4] = covariance[4, 0] = 1.0
    covariance[0, 5] = covariance[5, 0] = 2.0
    shares = shares_of_correlated(joint(covariance), np.array([[1.0, 0, 0]]))
    assert shares[Share.AIRSPEED] == pytest.approx([1.0]) and shares[Share.ANGLE_OF_ATTACK] == pytest.approx([4.0])
    covariance[4, 5] = covariance[5, 4] = 1.0
    covariance[0, 5] = covariance[5, 0] = 1.0
    shares = shares_of_correlated(joint(covariance), np.array([[1.0, 0, 0]]))
    assert shares[Share.AIRSPEED] == pytest.approx([0.5]) and shares[Share.ANGLE_OF_ATTACK] == pytest.approx([0.5])


def test_the_sources_add_up_to_the_variance_of_the_curve() -> None:
    covariance = covariance_of(7)
    changes = {"updraft": np.array([2e-3, 0, 1e-3, 0, 0, 0, 0]), "hysteresis alpha": np.array([1e-3, 0, 0, 0, 0, 0, 0])}
    total = covariance[:3, :3] + sum(np.outer(change[:3], change[:3]) for change in changes.values())
    polar = Polar(np.array([0.045, 0.0, 0.065]), total)
    estimate = SimpleNamespace(polar=polar, joint=joint(covariance, **changes))
    variances = variance_by_source(estimate, SimpleNamespace(), CONDITION, V)  # type: ignore[arg-type]
    assert {Share.NOISE, Share.UPDRAFT, Share.TRANSDUCERS} <= variances.keys() and Share.WEIGHT not in variances
    assert np.sqrt(sum(variances.values())) == pytest.approx(power_required(V, polar, CONDITION)[1], rel=1e-9)


def test_a_curve_by_another_method_has_noise_and_what_all_runs_share() -> None:
    noise, shared = np.diag([1e-6, 0, 0]), np.diag([3e-6, 0, 0])
    polar = Polar(np.array([0.045, 0.0, 0.065]), noise + shared)
    estimate = SimpleNamespace(polar=polar, joint=None, noise=noise, systematic=shared)
    variances = variance_by_source(estimate, SimpleNamespace(), CONDITION, V)  # type: ignore[arg-type]
    assert variances[Share.SHARED] / variances[Share.NOISE] == pytest.approx(3.0)


def test_what_a_propeller_table_contributes_is_no_noise_that_more_runs_average() -> None:
    """A0 varies only with the thrust scale, so all runs share all of its variance."""
    covariance = np.diag([4e-6, 0.0, 0.0, 1e-2, 1.0, 1.0, 1.0])
    covariance[0, 3] = covariance[3, 0] = 2e-4
    polar = Polar(np.array([0.045, 0.0, 0.065]), covariance[:3, :3])
    estimate = SimpleNamespace(polar=polar, joint=joint(covariance))
    parts = interval_parts(estimate, SimpleNamespace(), CONDITION, V)  # type: ignore[arg-type]
    half_width_W = NORMAL_95 * power_required(V, polar, CONDITION)[1]
    assert [part.systematic_W for part in parts] == pytest.approx(half_width_W, rel=1e-9)
    assert max(part.noise_W for part in parts) < 1e-3 * min(half_width_W)
