"""Regressors of sensor errors are predicted from past data, so they do not correlate with the current gust."""

import numpy as np
import pandas as pd
import pytest
from test_reconstruction import flown as fly

from flightpower.analysis.trajectory.block_means import BLOCK, BlockMeans
from flightpower.analysis.trajectory.equations import MEASUREMENT_INPUTS, STATES, NamedArrays
from flightpower.analysis.trajectory.extrapolation import extrapolated
from flightpower.analysis.trajectory.priors import WIND
from flightpower.analysis.trajectory.problem import TrajectoryProblem
from flightpower.analysis.trajectory.regressors import LAGS, has_past, lagged, projected_on_past
from flightpower.analysis.trajectory.settings import PREDICTION

DECAY = 0.93  # in 0.2 s, of a gust of 40 m at 14 m/s
N = 6000


def simulated(slope: float, response: float, seed: int):
    """Return the aircraft's angle, the gust, and a measurement of (1 + slope) times the angle plus the gust.

    The pilot oscillates the angle with the stick; gusts change it too.
    """
    noise = np.random.default_rng(seed).normal(0, 0.02, N)
    gust, angle = np.zeros(N), np.zeros(N)
    stick = 0.05 * np.sin(2 * np.pi * np.cumsum(0.2 / np.linspace(1.8, 1.3, N)))
    for k in range(1, N):
        gust[k] = DECAY * gust[k - 1] + noise[k]
        angle[k] = stick[k] - response * gust[k - 1] - response * noise[k]
    return angle, gust, (1 + slope) * angle + gust


def estimated_slope(measured, angle, instrument) -> tuple[float, float]:
    """Return the instrumental-variable estimate from increments, and the standard error of least squares."""
    x, z, y = (values[1:] - DECAY * values[:-1] for values in (measured, instrument, measured - angle))
    return float(z @ y / (z @ x)), float(0.02 / np.sqrt(z @ z))


def test_a_predicted_regressor_gives_an_unbiased_slope_and_its_true_standard_error() -> None:
    """Over 40 seeds, the mean error is within 3 standard errors of 0, and its scatter within 3 of its own standard
    errors (1/sqrt(80), 11 %) of the stated one. With the current angle, which responds to the gust, bias is large."""
    slope = 0.05 / 1.05  # per measured angle
    flying = np.ones(N, dtype=bool)
    errors, naive = [], []
    for seed in range(40):
        angle, _, measured = simulated(0.05, 0.5, seed)
        past = np.column_stack([np.ones(N), lagged(angle, flying)])
        predicted = projected_on_past(measured[:, None], past, np.full(N - 1, DECAY), flying)[:, 0]
        errors.append(np.array(estimated_slope(measured, angle, predicted)) - [slope, 0])
        naive.append(estimated_slope(measured, angle, angle)[0] - slope)
    off, estimated = np.array(errors).T
    assert abs(off.mean()) < 3 * estimated.mean() / np.sqrt(40)
    assert off.std() < estimated.mean() * (1 + 3 / np.sqrt(80))
    assert off.std() > estimated.mean() * (1 - 3 / np.sqrt(80))
    assert abs(np.mean(naive)) > 10 * estimated.mean()


def test_on_the_ground_predictions_and_lagged_values_are_zero() -> None:
    flying = np.arange(100) >= 40
    values = np.linspace(1, 2, 100)
    past = lagged(values, flying)
    assert past.shape == (100, len(LAGS))
    assert 1 not in LAGS, "means of neighboring blocks share part of a gust's increment"
    assert not past[:40].any() and np.all(past[40 : 40 + LAGS[0]] == values[40]), "no value from before the flight"
    assert np.array_equal(past[60], values[60 - np.array(LAGS)])
    predicted = projected_on_past(values[:, None], past, np.full(99, DECAY), flying)
    assert not predicted[~flying].any() and predicted[60:].any()


def test_a_prediction_has_a_past_only_after_all_lags_in_flight() -> None:
    flying = np.ones(60, dtype=bool)
    flying[[0, 1, 30, 31, 35]] = False
    settled = has_past(flying)
    for k in range(60):
        assert settled[k] == (k - LAGS[-1] >= 0 and bool(flying[k - LAGS[-1] : k + 1].all()))


@pytest.mark.parametrize("increment_over_noise", [0.0, 0.05, 0.4, np.inf])
def test_instrument_and_regressor_agree_in_the_metric_of_gust_and_noise(increment_over_noise: float) -> None:
    """z'Wx = z'Wz, with the smoother's W, the inverse covariance of first-order gust and white noise together."""
    rng, n = np.random.default_rng(0), 400
    decay, flying = np.full(n - 1, DECAY), np.ones(n, dtype=bool)
    past = np.column_stack([np.ones(n), np.sin(np.arange(n) / 7), np.cos(np.arange(n) / 11)])
    x = past @ [0.1, 1.0, -0.5] + rng.normal(0, 2.0, n)
    z = projected_on_past(x[:, None], past, decay, flying, increment_over_noise)[:, 0]
    noise = 0.0 if np.isinf(increment_over_noise) else 1.0
    gust = 1.0 if noise == 0 else increment_over_noise / np.sqrt(1 - DECAY**2)
    lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
    covariance = gust**2 * DECAY**lag + noise**2 * np.eye(n)
    Wz = np.linalg.solve(covariance, z)
    assert Wz @ x == pytest.approx(Wz @ z, rel=0.03)


def test_regressors_of_airspeed_do_not_depend_on_measured_airspeed(probe) -> None:
    """Longitudinal gusts last for many blocks, so past airspeed correlates with the current gust. The instrument of the
    airspeed scale is a constant, since speed itself follows the gusts. The instrument of the lag combines past inertial
    speed, its derivative and a constant, in proportions that may depend on all data of the flight."""
    _, _, air, still = fly(0, probe, "accel-decel")
    gusty = air.assign(V_mps=air["V_mps"] + np.random.default_rng(0).normal(0, 1.0, len(air)))
    first = TrajectoryProblem(air, still)
    x, errors, flying = first.initial_states.copy(), first.initial_errors, first.blocks.flying
    x[:, WIND] = 0.0  # any states will do; here speed also changes in turns
    (actual, calm), (_, rough) = (
        (NamedArrays(MEASUREMENT_INPUTS, inputs.T) for inputs in problem.regressors.measurement_inputs(x, errors, 0.2))
        for problem in (TrajectoryProblem(table, still) for table in (air, gusty))
    )
    for name in ("V_predicted", "dlnV_dlndp_alpha"):
        assert getattr(calm, name).any() and np.array_equal(getattr(calm, name), getattr(rough, name))
    state = NamedArrays(STATES, x.T)
    assert actual.V_mean == pytest.approx(
        np.hypot(np.hypot(state.v_north - state.wind_north, state.v_east - state.wind_east), state.v_down)
    )
    assert np.ptp(rough.V_mean[flying]) == pytest.approx(0.0, abs=1e-9)
    assert rough.V_mean[flying][0] == pytest.approx(np.mean(actual.V_mean[flying]), rel=0.1)
    step_s = first.blocks.step_s
    (V, _), (_, V_rate) = (
        extrapolated(actual.V_mean, first.blocks.in_flight, step_s, s, PREDICTION.newest) * flying
        for s in (PREDICTION.slow_s, PREDICTION.rate_s)
    )
    past = np.column_stack([flying, V, V_rate])
    for result in (calm, rough):
        combined = np.linalg.lstsq(past, result.V_rate, rcond=None)[0]
        assert result.V_rate == pytest.approx(past @ combined, abs=1e-8)
    assert np.corrcoef(calm.V_rate[flying], actual.V_rate[flying])[0, 1] > 0.8


def test_a_straight_line_is_extrapolated_from_any_window() -> None:
    """The window leaves out the `newest` - 1 blocks before the instant, so changing them changes nothing."""
    values, flying = 3.0 + 0.5 * 0.2 * np.arange(60), np.ones(60, dtype=bool)
    for newest in (1, 2, 5):
        predicted, slope = extrapolated(values, flying, 0.2, 1.0, newest)
        assert predicted[20:] == pytest.approx(values[20:]) and slope[20:] == pytest.approx(0.5)
        changed = values.copy()
        changed[41 - newest :] += 1.0
        assert extrapolated(changed, flying, 0.2, 1.0, newest)[0][40] == predicted[40]
        assert extrapolated(changed, flying, 0.2, 1.0, newest)[0][41] != predicted[41]


def test_after_a_short_gap_predictions_are_of_the_past_before_it_and_not_of_the_current_gust() -> None:
    """A light aircraft in W20 = 15 kt once lost 94 blocks, and after each the past began with the current gust for
    three seconds. The slope of angle of attack came out 6 % low from data that should have given 0 +- 8 %, and priors
    were widened by 4.6."""
    rng = np.random.default_rng(0)
    airspeed = 15.0 + rng.normal(size=200)
    airspeed[100:102] = np.nan
    table = pd.DataFrame({"V_mps": np.repeat(airspeed, BLOCK), "height_m": 40.0}, index=0.04 * np.arange(200 * BLOCK))
    blocks = BlockMeans(table)
    assert not blocks.flying[100:102].any() and blocks.in_flight.all()

    def predicted(values):
        return extrapolated(values, blocks.in_flight, blocks.step_s)[0]

    before = predicted(airspeed)
    for later in range(102, 120):
        changed = airspeed.copy()
        changed[later] += 5.0
        assert np.array_equal(predicted(changed)[: later + 1], before[: later + 1])
        assert abs(predicted(changed)[later + 1] - before[later + 1]) > 0.1
    assert before[102] == pytest.approx(15.0, abs=2.0)


def test_a_long_gap_ends_the_past() -> None:
    height = np.full(200 * BLOCK, 40.0)
    V = np.full(200 * BLOCK, 15.0)
    V[: 10 * BLOCK] = V[-10 * BLOCK :] = V[80 * BLOCK : 120 * BLOCK] = np.nan
    blocks = BlockMeans(pd.DataFrame({"V_mps": V, "height_m": height}, index=0.04 * np.arange(len(V))))
    assert np.array_equal(blocks.in_flight, blocks.flying)
