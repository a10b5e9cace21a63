"""Tests the iteration: search for the gust intensity, convergence, damping."""

from types import SimpleNamespace

import numpy as np
import pytest
from exact_motion import exact_motion
from scipy.signal import lfilter

from flightpower.analysis.trajectory import dryden, reconstruction
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, STATES
from flightpower.analysis.trajectory.priors import BENCH_SIGMA
from flightpower.analysis.trajectory.problem import TrajectoryProblem
from flightpower.analysis.trajectory.reconstruction import GUST_GRID_MPS, _most_probable_gust, _solve
from flightpower.analysis.trajectory.settings import SOLVER
from flightpower.analysis.trajectory.smoother import gauss_newton_step


def evidence_with_maximum_at(gust_mps: float):
    """Return a solver whose evidence is a parabola over the logarithm of the gust intensity."""

    def solve(_problem, x, sensor_errors, gust, **_limits):
        evidence = 7.0 + 3.0 * np.log2(gust / gust_mps) ** 2
        return SimpleNamespace(
            x=x, sensor_errors=sensor_errors, gust_mps=gust, minus_2_log_evidence=evidence, gust_ratio=gust_mps / gust
        )

    return solve


VERTEX = SimpleNamespace(gust_intensity=lambda vertex, middle_mps: middle_mps * 2**vertex)  # the vertex itself


@pytest.mark.parametrize("gust_mps", [0.03, 0.11, 0.2, 0.29, 1.3])
def test_the_gust_intensity_of_greatest_evidence_is_found(monkeypatch, gust_mps: float) -> None:
    """A parabola through three points of a parabola is exact, on whichever side of the first intensity its top is."""
    solve = evidence_with_maximum_at(gust_mps)
    monkeypatch.setattr(reconstruction, "_solve", solve)
    result, nearest = _most_probable_gust(VERTEX, solve(None, None, None, 0.2))
    assert result == pytest.approx(gust_mps)
    assert nearest.gust_mps == min(GUST_GRID_MPS, key=lambda tried: abs(np.log(tried / gust_mps)))


@pytest.mark.parametrize(
    ("gust_mps", "taken"), [(1e-4, SOLVER.least_gust_mps), (0.02, SOLVER.least_gust_mps), (100.0, GUST_GRID_MPS[-1])]
)
def test_gusts_are_neither_less_than_noise_nor_beyond_the_grid(monkeypatch, gust_mps: float, taken: float) -> None:
    """In calm air, the evidence comes from noise: two analyses of one log would find gusts of 0.01 and 0.03 m/s."""
    solve = evidence_with_maximum_at(gust_mps)
    monkeypatch.setattr(reconstruction, "_solve", solve)
    result, _ = _most_probable_gust(VERTEX, solve(None, None, None, 0.2))
    assert result == taken


@pytest.fixture(scope="module")
def noisy():
    """Return an exact motion with sensor errors and the noise of the bench."""
    table = exact_motion().table.copy()
    rng = np.random.default_rng(0)
    for name, sigma in {"p_radps": 0.005, "q_radps": 0.005, "r_radps": 0.005, "ax_mps2": 0.06, "ay_mps2": 0.06,
                        "az_mps2": 0.06, "V_mps": 0.3, "alpha_rad": 0.008, "beta_rad": 0.008, "height_m": 0.5,
                        "gps_north_mps": 0.1, "gps_east_mps": 0.1, "gps_down_mps": 0.1}.items():  # fmt: skip
        table[name] += sigma * rng.normal(size=len(table))
    table["V_mps"] *= 1.02
    table["alpha_rad"] += np.radians(1.5)
    return TrajectoryProblem(table, [slice(0, 0)])


@pytest.fixture(scope="module")
def solution(noisy):
    return _solve(noisy, noisy.initial_states, noisy.initial_errors, 0.05, iterations=40, tolerance=SOLVER.converged[1])


def test_over_a_lost_step_attitude_and_velocity_are_known_to_half_a_turn_and_twice_gravity(noisy) -> None:
    """In the step, a specific force of g in an unknown direction and gravity act; other steps keep their weights."""
    x, lost = noisy.initial_states, 7
    before = noisy.process_model(x, 0.3).weight
    noisy.lost[lost] = True
    try:
        after = noisy.process_model(x, 0.3).weight
    finally:
        noisy.lost[lost] = False
    assert 1 / after[lost, :3] == pytest.approx([np.pi] * 3)
    assert 1 / after[lost, 3:6] == pytest.approx([2 * 9.80665 * noisy.blocks.step_s] * 3)
    assert np.all(before[lost, :6] > 2 * after[lost, :6])
    others = np.arange(len(before)) != lost
    assert np.array_equal(after[others], before[others])


def test_a_converged_solution_does_not_move(noisy, solution) -> None:
    """One more step moves every sensor error by less than a fiftieth of its standard error."""
    assert solution.converged
    inputs = noisy.equation_inputs(solution.x, solution.sensor_errors, 0.05)
    remaining, prior = noisy.remaining_errors(solution.sensor_errors, 0.05)
    linearization = noisy.equations.linearize(solution.x, remaining, inputs)
    step = gauss_newton_step(linearization, prior, solution.x[0], remaining)
    assert np.abs(step.sensor_errors / np.sqrt(np.diag(step.covariance))).max() < 0.02


def test_injected_errors_are_found_within_what_is_stated(noisy, solution) -> None:
    value = dict(zip(SENSOR_ERRORS, solution.sensor_errors, strict=True))
    sigma = dict(zip(SENSOR_ERRORS, np.sqrt(np.diag(solution.last_step.covariance)), strict=True))
    for name, true in {"V_scale": 0.02, "alpha_bias": np.radians(1.5) * 1.0, "gps_latency": 0.0}.items():
        assert abs(value[name] - true) < 3.5 * sigma[name], name
    assert sigma["alpha_bias"] < np.radians(0.5) and sigma["gps_latency"] < 0.05


def test_the_latency_already_applied_is_not_counted_twice(noisy) -> None:
    """Only for the latency, the prior of the remaining error has a mean, 0.1 s minus the part already applied."""
    errors = np.full(len(SENSOR_ERRORS), 0.01)
    errors[SENSOR_ERRORS.index("gps_latency")] = 0.25
    remaining, prior = noisy.remaining_errors(errors, 0.1)
    assert remaining[SENSOR_ERRORS.index("gps_latency")] == 0.0
    assert prior.error_mean[SENSOR_ERRORS.index("gps_latency")] == pytest.approx(0.1 - 0.25)
    others = np.array(SENSOR_ERRORS) != "gps_latency"
    assert np.all(remaining[others] == 0.01) and not prior.error_mean[others].any()


def test_evidence_prefers_the_gusts_that_were_flown(noisy) -> None:
    """In calm air, strong gusts have less evidence, and the increments are smaller than strong gusts would have."""
    calm, gusty = (
        _solve(noisy, noisy.initial_states, noisy.initial_errors, gust, iterations=40, tolerance=SOLVER.converged[1])
        for gust in (0.05, 1.6)
    )
    assert calm.minus_2_log_evidence < gusty.minus_2_log_evidence
    assert gusty.gust_ratio < 0.5


def test_the_intensity_of_simulated_gusts_is_found() -> None:
    """A minute of data has Dryden gusts of 0.8 m/s, simulated sample by sample, and the noise of the sensors.

    300 increments of each gust give its standard deviation within 4 %; noise of air data makes this worse.
    """
    motion, sigma_w, dt = exact_motion(), 0.8, 0.04
    table, rng = motion.table.copy(), np.random.default_rng(1)
    n, past = len(table), 1000
    gust_arguments = sigma_w, float(table["height_m"].iloc[0]), float(table["V_mps"].mean())
    decay, increment = dryden.longitudinal(*gust_arguments).discretize(dt)
    u = lfilter([increment], [1, -decay], rng.normal(size=n + past))[past:]

    def second_order(gust: dryden.SecondOrderGust) -> np.ndarray:
        decay, once, _ = gust.discretize(dt)
        first = lfilter([once], [1, -decay], rng.normal(size=n + past))
        second = lfilter([(1 - decay) / 2] * 2, [1, -decay], first)
        return (second + np.sqrt(3) * (first - second))[past:]

    v, w = second_order(dryden.lateral(*gust_arguments)), second_order(dryden.vertical(*gust_arguments))
    V, alpha = table["V_mps"], table["alpha_rad"]
    table["V_mps"] = V - u * np.cos(alpha) - w * np.sin(alpha)
    table["alpha_rad"] = alpha + (u * np.sin(alpha) - w * np.cos(alpha)) / V
    table["beta_rad"] -= v / V
    for name, sigma in (BENCH_SIGMA | {"V_mps": 0.3, "alpha_rad": 0.008, "beta_rad": 0.008, "height_m": 0.5}).items():
        table[name] += sigma * rng.normal(size=n)
    trajectory = reconstruction.reconstruct(table, [slice(0, 0)])
    assert trajectory.converged
    assert trajectory.gust_mps == pytest.approx(sigma_w, rel=0.1)


@pytest.mark.parametrize("overshoot", [1.95, 3.0, 6.0])
def test_an_oscillating_iteration_is_damped(monkeypatch, overshoot: float) -> None:
    """Each step overshoots the solution; with a suitable fraction of each later step, the iteration converges.

    Half steps would diverge if the whole steps are at least four times too long.
    """
    m, n, nx = len(SENSOR_ERRORS), 3, len(STATES)

    def overshooting_step(_linearization, _prior, _initial, sensor_errors):
        return SimpleNamespace(
            states=np.zeros((n, nx)), sensor_errors=-overshoot * sensor_errors, covariance=np.eye(m),
            cost_decrease=0.0, log_determinant=0.0,
        )  # fmt: skip

    weights = SimpleNamespace(process_weight=np.ones((n, nx)), measurement_weight=np.ones((n, 11)))
    linearization = SimpleNamespace(process_residual=np.zeros((n, nx)), measurement_residual=np.zeros((n, 11)))
    problem = SimpleNamespace(
        equation_inputs=lambda *_: weights,
        remaining_errors=lambda errors, _gust: (errors, None),
        leave_out_lost_steps=lambda _: None,
        equations=SimpleNamespace(linearize=lambda *_: linearization),
    )
    monkeypatch.setattr(reconstruction, "gauss_newton_step", overshooting_step)
    monkeypatch.setattr(reconstruction, "cost", lambda *_: 0.0)
    solution = _solve(problem, np.zeros((n, nx)), np.ones(m), 0.1, iterations=20, tolerance=0.02)
    assert solution.converged and np.abs(solution.sensor_errors).max() < 0.02


def test_a_change_of_the_wind_is_a_gust_along_and_across_the_heading() -> None:
    """A wind from behind is a longitudinal gust, and a wind from the left is a lateral gust; the wind profile is no
    gust."""
    height = np.array([20.0, 20.0, 60.0, 60.0])
    x = np.zeros((4, len(STATES)))
    psi, north, u, w = (STATES.index(name) for name in ("psi", "wind_north", "gust_u", "gust_w"))
    x[:, STATES.index("height")], x[:, psi] = height, [0.0, np.pi / 2, 0.0, np.pi / 2]
    profile = dryden.mean_wind_profile(height)
    x[:, north] = 3.0 * profile
    assert reconstruction.gusts_and_wind(x) == pytest.approx(0.0, abs=1e-12)
    change = np.array([0.1, 0.1, -0.1, -0.1]) * profile / profile.mean()
    x[:, north] += change
    x[:, u] = x[:, w] = 0.5
    along, across, down = reconstruction.gusts_and_wind(x)
    assert along == pytest.approx([0.6, 0.5, 0.4, 0.5])
    assert across == pytest.approx([0.0, -0.1, 0.0, 0.1], abs=1e-12)
    assert down == pytest.approx(0.5)


def test_errors_of_the_wind_count_in_the_same_axes() -> None:
    states, errors = np.zeros((3, len(STATES))), np.zeros((2, 3, len(STATES)))
    states[:, STATES.index("height")], states[:, STATES.index("psi")] = 40.0, np.pi / 2
    errors[1, :, STATES.index("wind_east")] = 0.2
    along, across, _ = reconstruction.gusts_and_wind(errors, states)
    assert along == pytest.approx(np.array([[0.0] * 3, [0.2] * 3]))
    assert across == pytest.approx(0.0, abs=1e-12)
