"""What may stand beside a sensor's error: what the past foretells, and nothing that a gust has just done."""

import numpy as np
import pytest
from test_reconstruction import flown as fly

from analysis.trajectory.equations import MEASUREMENT_INPUTS
from analysis.trajectory.instrumental_variables import LAGS, lagged, projected_on_past
from analysis.trajectory.problem import TrajectoryProblem

STAYS = 0.93  # of a gust in 0.2 s: 40 m long, at 14 m/s
N = 6000


def flown(slope: float, answer: float, seed: int):
    """A sensor that shows (1 + slope) times the angle and the gust: the aircraft's angle, the gust, what is shown.

    The stick swings the angle; besides, the aircraft answers to each gust from the next block on.
    """
    noise = np.random.default_rng(seed).normal(0, 0.02, N)
    gust, angle = np.zeros(N), np.zeros(N)
    stick = 0.05 * np.sin(2 * np.pi * np.cumsum(0.2 / np.linspace(1.8, 1.3, N)))
    for k in range(1, N):
        gust[k] = STAYS * gust[k - 1] + noise[k]
        angle[k] = stick[k] - answer * gust[k - 1] - answer * noise[k]
    return angle, gust, (1 + slope) * angle + gust


def found_slope(shown, angle, beside) -> tuple[float, float]:
    """The slope that leaves nothing of `beside` in what is new in gusts, and the standard error that squares tell."""
    x, z, y = (values[1:] - STAYS * values[:-1] for values in (shown, beside, shown - angle))
    return float(z @ y / (z @ x)), float(0.02 / np.sqrt(z @ z))


def test_beside_what_is_foretold_a_slope_is_found_and_as_well_as_is_said() -> None:
    """40 seeds. An error's mean is within 3 standard errors of 0, its scatter is the stated one within 3 of its own
    (1/sqrt(80), 11 %). Beside the angle of the moment, which answers to the gust, it is wrong by many times that."""
    slope = 0.05 / 1.05  # of what is shown
    flying = np.ones(N, dtype=bool)
    errors, naive = [], []
    for seed in range(40):
        angle, _, shown = flown(0.05, 0.5, seed)
        past = np.column_stack([np.ones(N), lagged(angle, flying)])
        foretold = projected_on_past(shown[:, None], past, np.full(N - 1, STAYS), flying)[:, 0]
        errors.append(np.array(found_slope(shown, angle, foretold)) - [slope, 0])
        naive.append(found_slope(shown, angle, angle)[0] - slope)
    off, stated = np.array(errors).T
    assert abs(off.mean()) < 3 * stated.mean() / np.sqrt(40)
    assert off.std() < stated.mean() * (1 + 3 / np.sqrt(80))
    assert off.std() > stated.mean() * (1 - 3 / np.sqrt(80))
    assert abs(np.mean(naive)) > 10 * stated.mean()


def test_on_the_ground_nothing_is_foretold_and_nothing_remembered() -> None:
    flying = np.arange(100) >= 40
    values = np.linspace(1, 2, 100)
    past = lagged(values, flying)
    assert past.shape == (100, len(LAGS))
    assert not past[: 40 + LAGS[0]].any(), "before it flew there was nothing to remember"
    assert np.array_equal(past[60], values[60 - np.array(LAGS)])
    foretold = projected_on_past(values[:, None], past, np.full(99, STAYS), flying)
    assert not foretold[~flying].any() and foretold[60:].any()


@pytest.mark.parametrize("name", ["V_predicted", "V_per_pair", "V_rate"])
def test_beside_airspeed_stands_nothing_that_airspeed_shows(probe, name: str) -> None:
    """Gusts along the flight last: what airspeed showed a block ago is in what it shows now."""
    _, _, air, still = fly(0, probe, "accel-decel")
    gusty = air.assign(V_mps=air["V_mps"] + np.random.default_rng(0).normal(0, 1.0, len(air)))
    first = TrajectoryProblem(air, still, 0.0, None)
    x, errors = first.initial_states, first.initial_errors
    calm, rough = (
        TrajectoryProblem(table, still, 0.0, None).regressors.measurement_inputs(x, errors, 0.2)[1]
        for table in (air, gusty)
    )
    i = MEASUREMENT_INPUTS.index(name)
    assert calm[:, i].any() and np.array_equal(calm[:, i], rough[:, i])
