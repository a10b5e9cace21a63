"""The noise of a polar comes from errors of the states, and from the part of the residuals they do not explain."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.consider import _by_rest, _by_states, noise_covariance
from flightpower.analysis.methods.regression import POLAR_FIT
from flightpower.analysis.trajectory.smoother import StatesGivenErrors

STEP_S, BEFORE = 0.2, 40  # blocks of the flight before the first run
CL = np.concatenate([np.linspace(1.1, 0.3, 150), np.linspace(0.3, 1.1, 130)])
X = np.stack([np.ones_like(CL), CL, CL**2], axis=1)
ROWS = BEFORE + np.arange(len(CL))
BY_STATE = (0.3, -0.2)  # change of z with each of the two states
T_S = STEP_S * np.arange(BEFORE + len(CL) + 10)


def segments_along(noise: np.ndarray, states: np.ndarray) -> list[Segment]:
    z = X @ [0.05, -0.02, 0.06] + noise + states[ROWS] @ BY_STATE
    return [
        Segment(
            name=name, t_s=T_S[ROWS[of]], u=dict(zip(("X0", "X1", "X2"), X[of].T, strict=True)), z={"z": z[of]}
        )
        for name, of in (("up", slice(0, 150)), ("down", slice(150, None)))
    ]  # fmt: skip


def flown(noise: np.ndarray, draws: np.ndarray, sigma: float):
    """Return a fit, a trajectory whose states have independent errors `sigma` in each block, and a function that
    makes segments from states."""
    states = np.zeros((len(T_S), 2))
    fit = fit_output_error(POLAR_FIT, segments_along(noise, states))
    trajectory = SimpleNamespace(
        states=pd.DataFrame(states, index=T_S),
        states_given_errors=StatesGivenErrors(np.full((1, states.size), 1 / sigma)),
        draws=draws,
    )
    return fit, trajectory, lambda x: segments_along(noise, x)


def colored(rng: np.random.Generator, count: int, sigma: float = 1.0) -> np.ndarray:
    """Return noise with a correlation of 0.8 between adjacent samples, and this standard deviation."""
    white = rng.standard_normal(count)
    out = np.empty(count)
    out[0] = white[0]
    for i in range(1, count):
        out[i] = 0.8 * out[i - 1] + 0.6 * white[i]
    return sigma * out


WHITE = 0.01 * np.random.default_rng(0).standard_normal(len(CL))
STILL = np.zeros((1, len(T_S), 2))


def test_errors_of_states_reach_the_polar_as_those_of_the_data_do() -> None:
    """In least squares, the covariance is (X'X)^-1 times the variance of z due to both states together."""
    fit, trajectory, along = flown(WHITE, STILL, sigma=0.05)
    variance = 0.05**2 * (BY_STATE[0] ** 2 + BY_STATE[1] ** 2)
    assert _by_states(fit, trajectory, along) == pytest.approx(variance * np.linalg.inv(X.T @ X), rel=1e-6)


@pytest.mark.parametrize("noise", [WHITE, colored(np.random.default_rng(1), len(CL), 0.01)], ids=["white", "colored"])
def test_states_without_error_leave_the_residuals_as_they_are(noise: np.ndarray) -> None:
    fit, trajectory, along = flown(noise, STILL, sigma=1e-9)
    usual = covariance.of_noise(fit)
    assert _by_rest(fit, trajectory, along) == pytest.approx(usual, rel=0.02, abs=1e-3 * np.abs(usual).max())
    assert noise_covariance(fit, trajectory, along) == pytest.approx(_by_rest(fit, trajectory, along), rel=1e-6)


def test_what_errors_of_the_states_explain_is_taken_from_the_residuals() -> None:
    """Sensors have white noise, and one state a colored error three times as strong; about the white noise is left."""
    rng = np.random.default_rng(2)
    of_states = np.stack([colored(rng, len(T_S), 0.1) for _ in range(41)])  # 0.03 in z
    noise = WHITE + BY_STATE[0] * of_states[0, ROWS]
    draws = np.stack([of_states[1:], np.zeros_like(of_states[1:])], axis=2)
    fit, trajectory, along = flown(noise, draws, sigma=0.1)
    rest = np.sqrt(np.diag(_by_rest(fit, trajectory, along)))
    white = np.sqrt(np.diag(0.01**2 * np.linalg.inv(X.T @ X)))
    assert (rest < 0.4 * np.sqrt(np.diag(covariance.of_noise(fit)))).all()
    assert ((0.7 * white < rest) & (rest < 2.5 * white)).all()
