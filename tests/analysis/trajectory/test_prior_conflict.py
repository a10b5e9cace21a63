"""Tests the comparison of estimated sensor errors with their priors, and of residuals with noise."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy import special

from flightpower.analysis import flight as flight_steps
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import conflict_notes, joint_conflict, prior_conflict, with_misfit
from flightpower.analysis.trajectory.priors import PRIOR_MEAN, PRIOR_SIGMA
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.analysis.trajectory.smoother import StatesGivenErrors
from flightpower.flight.errors import InputError

PRIOR = np.array([PRIOR_SIGMA[name] for name in SENSOR_ERRORS])
STATES_ITS_UPDRAFT = SimpleNamespace(has=lambda key: key == "uncertainty.updraft")
MEAN = np.array([PRIOR_MEAN.get(name, 0.0) for name in SENSOR_ERRORS])


def estimated(in_prior_sigmas: np.ndarray, *, known_to: float = 0.3, **residuals: float) -> Trajectory:
    """Return a trajectory with these sensor errors [prior sigmas], each known to a share of its prior."""
    nothing = np.zeros((1, 1, 1))
    return Trajectory(
        None, MEAN + PRIOR * in_prior_sigmas, np.diag((known_to * PRIOR) ** 2), PRIOR, nothing,
        StatesGivenErrors(np.ones((1, 1))), nothing, nothing, 0.1, residuals, True, None,
    )  # fmt: skip


def test_errors_as_large_as_their_priors_are_no_conflict() -> None:
    conflict = prior_conflict(estimated(np.resize([1.0, -1.0], len(PRIOR))))
    assert not conflict.conflicting
    assert conflict_notes(conflict, estimated(np.zeros(len(PRIOR)))) == []


def test_one_error_beyond_its_prior_is_named_and_gets_a_wider_one() -> None:
    errors = np.zeros(len(PRIOR))
    errors[SENSOR_ERRORS.index("alpha_scale")] = -4.0
    trajectory = estimated(errors)
    conflict = prior_conflict(trajectory)
    message = 1 - 0.3**2  # the estimate's variance over the prior's, if the prior is right
    assert conflict.z == {"alpha_scale": pytest.approx(-4.0 / np.sqrt(message))}
    assert conflict.factor[SENSOR_ERRORS.index("alpha_scale")] == pytest.approx(4.0 / message, rel=0.02)
    assert conflict.common_factor < 1.5 and np.sort(conflict.factor)[:-1] == pytest.approx(conflict.common_factor), (
        "others must keep their priors"
    )
    (note,) = conflict_notes(conflict, trajectory)
    assert "slope of angle of attack is -4.2 standard deviations (3 %)" in note


def test_errors_all_twice_their_priors_are_a_conflict_by_that_factor() -> None:
    """The updraft is an exception, since its prior describes the air, not the installation."""
    conflict = prior_conflict(estimated(np.resize([2.0, -2.0], len(PRIOR)), known_to=0.05))
    assert conflict.z == {}
    of_air = np.array(SENSOR_ERRORS) == "updraft"
    assert conflict.factor == pytest.approx(np.where(of_air, 1.0, 2.0), rel=0.02)


def test_errors_that_the_data_half_determine_tell_their_own_size() -> None:
    """If data leave 0.7 of the prior, j = 1/0.49 - 1. They alone give x = y (1 + 1/j) with the variance s^2 + 1/j."""
    j = 1 / 0.7**2 - 1
    count = len(PRIOR)
    for y in (1.6, 2.2):
        conflict = prior_conflict(estimated(np.resize([y, -y], count), known_to=0.7))
        assert conflict.common_factor == pytest.approx(np.sqrt((y * (1 + 1 / j)) ** 2 - 1 / j), abs=0.006)
    # The sum of squares over its variance is a chi square. One flight in a hundred exceeds its limit by chance.
    at_the_limit = np.sqrt(special.chdtri(count, 0.01) / count * (1 + 1 / j)) / (1 + 1 / j)
    for share, conflict in ((0.99, False), (1.01, True)):
        y = share * at_the_limit
        assert prior_conflict(estimated(np.resize([y, -y], count), known_to=0.7)).conflicting is conflict


@pytest.mark.parametrize("expected", [0.5, 0.07, 0.02])
def test_an_error_is_judged_by_what_its_estimate_varies_if_the_prior_is_right(expected: float) -> None:
    """This holds however little of the prior's variance the data determine. If they determine 7 %, a boom that bends
    33 times as much as assumed is seen as 9 standard deviations, and gets a prior of its size."""
    i = SENSOR_ERRORS.index("alpha_per_g")
    for true, result in ((33.0, True), (2.4 / np.sqrt(expected), False)):
        errors = np.zeros(len(PRIOR))
        errors[i] = -true * expected  # the estimate is pulled to the prior's mean of zero
        conflict = prior_conflict(estimated(errors, known_to=np.sqrt(1 - expected)))
        assert conflict.z == ({"alpha_per_g": pytest.approx(-33.0 * np.sqrt(expected))} if result else {})
        assert conflict.factor[i] == (
            pytest.approx(np.sqrt(true**2 - (1 - expected) / expected), rel=0.01) if result else 1.0
        )


def test_what_the_solver_s_last_step_moves_is_no_conflict() -> None:
    """The step is 0.02 prior sigmas, but 2 and 4 sigmas of an estimate from data with so little information."""
    for message in (1e-4, 2.5e-5):
        moved = np.resize([0.02, -0.02], len(PRIOR))
        assert not prior_conflict(estimated(moved, known_to=np.sqrt(1 - message))).conflicting


def test_an_error_that_took_a_part_of_the_worst_one_s_is_no_conflict() -> None:
    """The data determine the sum of two errors and also one of them alone. The second is wrong by 30 prior standard
    deviations and pulls the first away from zero, although good data on the first alone say zero."""
    wrong, attributed = SENSOR_ERRORS.index("alpha_per_g"), SENSOR_ERRORS.index("alpha_scale")
    design = np.zeros((2, len(PRIOR)))
    design[0, [wrong, attributed]], design[1, attributed] = 0.3, 0.2
    P = np.linalg.inv(np.eye(len(PRIOR)) + design.T @ design)
    y = P @ design.T @ (design[:, wrong] * 30.0)
    alone = y / np.sqrt(np.maximum(1 - np.diag(P), 1e-9))
    assert alone[wrong] > alone[attributed] > 5, "each must contradict by itself"
    trajectory = replace(estimated(y), covariance=P * np.outer(PRIOR, PRIOR))
    conflict = prior_conflict(trajectory)
    assert set(conflict.z) == {"alpha_per_g"}
    assert conflict.factor[wrong] == pytest.approx(30, rel=0.1)


def test_two_errors_below_their_limits_are_improbable_together() -> None:
    """Offset and slope of the angle of attack are at -3.4 and -3.5 standard deviations, as in sinking air; neither is
    beyond 3.8. The sum of two squares is a chi square, whose probability is exp(-x/2)."""
    errors, message = np.zeros(len(PRIOR)), 1 - 0.3**2
    for name, z in (("alpha_bias", -3.4), ("alpha_scale", -3.5)):
        errors[SENSOR_ERRORS.index(name)] = z * np.sqrt(message)
    joint_conflict = prior_conflict(estimated(errors)).jointly
    assert joint_conflict.errors == {"alpha_bias": pytest.approx(-3.4), "alpha_scale": pytest.approx(-3.5)}
    pairs = len(PRIOR) * (len(PRIOR) - 1) / 2
    assert joint_conflict.probability == pytest.approx(2 * pairs * np.exp(-(3.4**2 + 3.5**2) / 2))
    assert joint_conflict.probability < 0.005 < prior_conflict(estimated(0.9 * errors)).jointly.probability


def test_all_errors_somewhat_large_are_improbable_together() -> None:
    joint_conflict = prior_conflict(estimated(np.resize([1.6, -1.6], len(PRIOR)))).jointly
    assert set(joint_conflict.errors) == set(SENSOR_ERRORS)
    assert joint_conflict.probability == pytest.approx(
        2 * special.chdtrc(len(PRIOR), 1.6**2 / (1 - 0.3**2) * len(PRIOR))
    )
    assert prior_conflict(estimated(np.resize([1.0, -1.0], len(PRIOR)))).jointly.errors == {}


def test_two_errors_of_which_data_tell_only_the_sum_are_as_probable_as_one() -> None:
    """Each is at two standard deviations, and so is their sum: a probability of 4.6 % as for one error, not 1.8 %."""
    design = np.zeros((1, len(PRIOR)))
    design[0, :2] = 30.0
    P = np.linalg.inv(np.eye(len(PRIOR)) + design.T @ design)
    y = np.where(design[0] > 0, 2.0 * np.sqrt(1 - P[0, 0]), 0.0)
    assert joint_conflict(y, P).probability == pytest.approx(2 * special.chdtrc(1, 4.0))


def test_sound_flights_are_called_improbable_no_more_often_than_said() -> None:
    """In 4,000 draws of correlated estimates, the rate is two thirds of the bound, since pairs share errors."""
    rng, m = np.random.default_rng(3), len(PRIOR)
    design = rng.normal(size=(m, m))
    P = np.linalg.inv(np.eye(m) + design.T @ design)
    root = np.linalg.cholesky(np.eye(m) - P)
    p = np.array([joint_conflict(root @ rng.standard_normal(m), P).probability for _ in range(4000)])
    for level in (0.05, 0.01):
        assert 0.3 * level < np.mean(p < level) < level


def test_residuals_larger_than_noise_widen_the_covariance_and_are_named() -> None:
    trajectory = estimated(np.zeros(len(PRIOR)), V=2.0, alpha=1.0)
    wider, (message,) = with_misfit(trajectory)
    assert wider.covariance == pytest.approx(4 * trajectory.covariance)
    assert "airspeed by 2.0." in message
    # The flight's own information falls to a quarter; without a factor on the prior, it would be negative.
    before, after = (np.linalg.inv(x.covariance) - np.diag(x.prior_sigma**-2.0) for x in (trajectory, wider))
    assert after == pytest.approx(before / 4)
    # Random errors of the states are also twice as large, which leaves a quarter of the information.
    draws = np.ones((3, 4, 5))
    wider, _ = with_misfit(replace(trajectory, draws=draws))
    assert wider.draws == pytest.approx(2 * draws)
    assert wider.states_given_errors.factor == pytest.approx(trajectory.states_given_errors.factor / 2)
    assert (
        with_misfit(replace(trajectory, residuals={"beta": 1.51}))[1]
        and not with_misfit(replace(trajectory, residuals={"beta": 1.49, "compass": 5.0}))[1]
    )
    same = replace(trajectory, residuals={"V": 1.1})
    assert with_misfit(same) == (same, [])


@pytest.mark.parametrize("second", ["does not converge", "raises"])
def test_where_wider_priors_give_no_path_there_is_none(monkeypatch, second: str) -> None:
    """The first path contradicts its priors, and there is no second path, so the first must not be used."""
    errors = np.zeros(len(PRIOR))
    errors[SENSOR_ERRORS.index("alpha_scale")] = -9.0
    first = estimated(errors)

    def path(_flight, _data, *, prior_factor=1.0, as_measured=False, height_noise=1.0) -> Trajectory:
        if as_measured:
            return replace(first, as_measured=True, converged=False)
        if np.max(prior_factor) > 1 and second == "raises":
            raise InputError("flight.mcap: contradiction")
        return replace(first, converged=bool(np.max(prior_factor) == 1))

    monkeypatch.setattr(flight_steps, "trajectory_with", path)
    record = SimpleNamespace(progress=lambda _: None, data=None, name="flight.mcap", aircraft=STATES_ITS_UPDRAFT)
    flight_path = flight_steps.flight_path(record)
    assert flight_path.as_measured and flight_path.trajectory.as_measured
    assert "slope of angle of attack" in flight_path.notes[0] and "No flight path explains" in flight_path.notes[-1]


@pytest.mark.parametrize(
    ("residuals", "noise"), [({"height": 4.0}, 4.0), ({"height": 4.0, "alpha": 3.0}, 1.0), ({"height": 1.2}, 1.0)]
)
def test_noise_of_the_height_in_flight_is_taken_from_its_residuals(monkeypatch, residuals, noise: float) -> None:
    """This applies only if height alone has more noise than at rest; with another misfit, more than that may be
    wrong."""

    def path(_flight, _data, *, prior_factor=1.0, height_noise=1.0) -> Trajectory:
        smaller = residuals | {"height": residuals["height"] / height_noise}
        return replace(estimated(np.zeros(len(PRIOR)), **smaller), height_noise=height_noise)

    monkeypatch.setattr(flight_steps, "trajectory_with", path)
    record = SimpleNamespace(progress=lambda _: None, data=None, name="flight.mcap", aircraft=STATES_ITS_UPDRAFT)
    flight_path = flight_steps.flight_path(record)
    assert flight_path.trajectory.height_noise == pytest.approx(noise)
    assert any("noise of the height is 4.0 times" in note for note in flight_path.notes) == (noise > 1)


@pytest.mark.parametrize(("measured", "is_reported"), [((), True), (("gps_north_mps",), False), (("beta_rad",), False)])
def test_without_velocity_and_sideslip_a_path_that_is_not_found_has_a_reason(
    monkeypatch, measured, is_reported: bool
) -> None:
    """Bank and a bias of the yaw gyro act alike on the airspeed: both turn the aircraft and leave no other trace."""
    first = replace(
        estimated(np.zeros(len(PRIOR))), converged=False, block_means=SimpleNamespace(measured=measured.__contains__)
    )
    monkeypatch.setattr(flight_steps, "trajectory_with", lambda *_, **__: first)
    flight_path = flight_steps.flight_path(SimpleNamespace(progress=lambda _: None, data=None, name="flight.mcap"))
    assert flight_path.as_measured
    assert ("cannot separate bank from the yaw gyro's bias" in flight_path.notes[-1]) is is_reported
