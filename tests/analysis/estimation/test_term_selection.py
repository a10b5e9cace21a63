"""Structure selection finds the known terms of a simulated nonlinear aircraft."""

import numpy as np
import pytest

from flightpower.analysis.estimation.term_selection import _fitted, _partial_F, orthogonal_functions, stepwise
from flightpower.flight.errors import InputError

NOISE = 0.02


def with_noise_known_to_a_factor_of_four(candidates, z):
    return orthogonal_functions(candidates, z, largest_noise_variance=16 * NOISE**2)


METHODS = [stepwise, with_noise_known_to_a_factor_of_four]
# A made-up vertical force coefficient with stall and pitch-rate terms, of a size typical of a light aircraft.
TRUE = {"alpha": -4.5, "alpha^2": 6.0, "q": -8.0, "elevator": -0.4, "alpha elevator": 2.5}


def flight(seed, n=400, noise=NOISE):
    """Return candidates up to third order from filtered random motion, and the force coefficient with noise."""
    rng = np.random.default_rng(seed)

    def motion(size, tau):
        x = np.zeros(n)
        for k in range(1, n):
            x[k] = x[k - 1] * np.exp(-0.04 / tau) + rng.standard_normal()
        return size * x / x.std()

    alpha, q, elevator = 0.05 + motion(0.05, 1.0), motion(0.01, 0.5), motion(0.08, 0.3)
    first = {"alpha": alpha, "q": q, "elevator": elevator, "beta": motion(0.05, 1.0), "p": motion(0.02, 0.4)}
    names = list(first)
    candidates = dict(first)
    for i, a in enumerate(names):
        for b in names[i:]:
            candidates[f"{a}^2" if a == b else f"{a} {b}"] = first[a] * first[b]
    candidates["alpha^3"] = alpha**3
    z = -0.3 + sum(value * candidates[name] for name, value in TRUE.items()) + noise * rng.standard_normal(n)
    return candidates, z


def test_the_true_terms_are_found_in_95_of_100_flights():
    right = dict.fromkeys(METHODS, 0)
    for seed in range(1000, 1100):
        candidates, z = flight(seed)
        for method in right:
            right[method] += set(method(candidates, z).names) == set(TRUE)
    assert min(right.values()) >= 95, right


@pytest.mark.parametrize("method", METHODS)
def test_coefficients_are_those_of_the_regression(method):
    """They agree within four of their standard errors, which are about 0.02/sqrt(400)/rms, as in least squares."""
    candidates, z = flight(7)
    result = method(candidates, z)
    for name, value, error in zip(result.names, result.coefficients, result.standard_errors, strict=True):
        assert value == pytest.approx(TRUE[name], abs=4 * error)
    assert result.constant == pytest.approx(-0.3, abs=4 * result.constant_error)
    assert np.std(z - result.predict(candidates)) == pytest.approx(0.02, rel=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_noise_alone_needs_no_terms(method):
    rng = np.random.default_rng(0)
    candidates, _ = flight(1)
    empty = sum(not method(candidates, NOISE * rng.standard_normal(400)).names for _ in range(20))
    assert empty >= 19


def test_without_knowledge_of_the_noise_small_terms_are_left_out():
    """Barron's bound takes all of z for noise: a term must explain 1/400 of its variance."""
    candidates, z = flight(7)
    functions = orthogonal_functions(candidates, z)
    assert functions.names[0] == "alpha" and functions.R2 > 0.98
    assert len(functions.names) < len(TRUE)


@pytest.mark.parametrize("method", METHODS)
def test_a_candidate_that_is_a_combination_of_others_is_taken_once(method):
    candidates, z = flight(3)
    twice = candidates | {"alpha in degrees": np.degrees(candidates["alpha"])}
    result = method(twice, z)
    assert len({"alpha", "alpha in degrees"} & set(result.names)) == 1
    assert np.all(np.isfinite(result.standard_errors))


def test_a_replaced_term_leaves_again():
    """A candidate close to the sum of two others enters first, and becomes superfluous when both are in."""
    rng = np.random.default_rng(2)
    a, b = rng.standard_normal((2, 300))
    stand_in = a + b + 0.3 * rng.standard_normal(300)
    result = stepwise({"stand-in": stand_in, "a": a, "b": b}, a + b + 0.1 * rng.standard_normal(300))
    assert set(result.names) == {"a", "b"}


def test_wrong_arrays_are_named():
    with pytest.raises(InputError, match=r"candidate a: shape \(3,\)"):
        stepwise({"a": np.ones(3)}, np.ones(4))
    with pytest.raises(InputError, match="a: not finite at sample 2"):
        stepwise({"a": [1, 2, np.nan, 4]}, np.ones(4))
    with pytest.raises(InputError, match="more samples than candidates"):
        orthogonal_functions({"a": np.arange(3)}, np.arange(3))


def test_the_predicted_square_error_adds_the_noise_of_each_term():
    """It is the mean square of residuals plus sigma_max^2/n, or twice sigma^2/n, for each term."""
    candidates, z, *_ = flight(0)
    n = len(z)
    for selection, penalty in (
        (orthogonal_functions(candidates, z, largest_noise_variance=4 * NOISE**2), 4 * NOISE**2),
        (stepwise(candidates, z), None),
    ):
        k = len(selection.names)
        residual = z - selection.predict(candidates)
        square = float(np.mean(residual**2))
        variance = n * square / (n - k - 1)
        expected = square + k * (2 * variance if penalty is None else penalty) / n
        assert k > 1 and selection.predicted_square_error == pytest.approx(expected)
        assert selection.R2 == pytest.approx(1 - n * square / np.sum((z - z.mean()) ** 2))


def test_the_partial_F_is_that_of_nested_regressions_whatever_is_added_to_a_candidate():
    """F = (RSS without - RSS with)/(RSS with/(n - terms)); a constant goes into the intercept."""
    rng = np.random.default_rng(0)
    n, chosen = 60, [1]
    X = rng.standard_normal((n, 4))
    X[:, 3] = 2 * X[:, 1] - 3.0  # adds nothing to the chosen one
    z = X[:, 0] + 2 * X[:, 1] + rng.standard_normal(n)

    def rss(columns):
        A = np.column_stack([np.ones(n), X[:, columns]])
        return float(np.sum((z - A @ np.linalg.lstsq(A, z, rcond=None)[0]) ** 2))

    expected = [(rss([1]) - rss([1, i])) / (rss([1, i]) / (n - 3)) for i in (0, 2)]
    partial_F = _partial_F(X, z, chosen)
    assert partial_F[[0, 2]] == pytest.approx(expected, rel=1e-9) and partial_F[1] == partial_F[3] == 0
    shifted = X + 1e5
    assert _partial_F(shifted, z, chosen)[[0, 2]] == pytest.approx(expected, rel=1e-4)


def test_a_fit_gives_the_standard_errors_of_least_squares():
    """For a straight line, they are sigma/sqrt(Sxx) for slope and sigma sqrt(1/n + mean^2/Sxx) for intercept."""
    rng = np.random.default_rng(1)
    x = 3.0 + rng.standard_normal(40)
    z = 1.0 + 2.0 * x + 0.5 * rng.standard_normal(40)
    result = _fitted(("x",), x[:, None], z, [0])
    slope, intercept = np.polyfit(x, z, 1)
    square = float(np.sum((z - intercept - slope * x) ** 2))
    Sxx, sigma = np.sum((x - x.mean()) ** 2), np.sqrt(square / 38)
    assert result[1:5] == pytest.approx(
        (slope, sigma / np.sqrt(Sxx), intercept, sigma * np.sqrt(1 / 40 + x.mean() ** 2 / Sxx))
    )
    assert result[5] == pytest.approx(np.corrcoef(x, z)[0, 1] ** 2)
    assert result[6] == pytest.approx(square / 40 + 2 * sigma**2 / 40)


@pytest.mark.parametrize("method", METHODS)
def test_a_constant_added_to_a_candidate_changes_nothing_but_the_constant(method):
    """This also holds if the mean of a term is twenty thousand times its variation."""
    candidates, z = flight(7)
    result = method(candidates, z)
    moved = {name: values + 2e4 * np.std(values) for name, values in candidates.items()}
    again = method(moved, z)
    assert again.names == result.names
    assert again.coefficients == pytest.approx(result.coefficients, rel=1e-4)
