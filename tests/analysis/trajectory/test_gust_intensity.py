"""Gust intensity from evidence agrees with simulated gusts and exact likelihoods of a first-order process."""

import numpy as np
import pytest

from flightpower.analysis.trajectory import dryden
from flightpower.analysis.trajectory.gusts import (
    ObservedGust,
    block_mean_spectrum,
    intensity_of,
    process_spectrum,
    vertex,
)

STEP_S, PARTS = 0.2, 20
CRUISE = 1.0, 40.0, 17.0
GUSTS = dryden.longitudinal(*CRUISE), dryden.lateral(*CRUISE), dryden.vertical(*CRUISE)


def block_means(gust: dryden.GaussMarkov, n: int) -> np.ndarray:
    """Return means over blocks (n,) of a first-order gust, simulated in steps much shorter than a block."""
    decay, increment = gust.discretize(STEP_S / PARTS)
    rng = np.random.default_rng(3)
    values = np.empty(n * PARTS)
    g = gust.sigma_mps * rng.standard_normal()
    for k, white in enumerate(rng.standard_normal(len(values))):
        g = decay * g + increment * white
        values[k] = g
    return values.reshape(n, PARTS).mean(axis=1)


def minus_twice_log_likelihood(y: np.ndarray, gust: dryden.GaussMarkov, noise: float) -> float:
    """Return minus twice the log likelihood of y (n,), a gust with white noise at block centers, by a Kalman filter."""
    decay, increment = gust.discretize(STEP_S)
    g, P, total = 0.0, gust.sigma_mps**2, 0.0
    for value in y:
        S = P + noise**2
        total += np.log(S) + (value - g) ** 2 / S
        g, P = decay * (g + P / S * (value - g)), decay**2 * P * noise**2 / S + increment**2
    return total


@pytest.mark.parametrize("noise", [0.01, 0.13, 0.5])
def test_the_intensity_of_simulated_gusts_is_found_whatever_the_noise(noise) -> None:
    """Increments over 6,000 blocks (20 minutes) give their standard deviation within 1 % without noise, and within 3 %
    if noise hides most of them. At the lowest noise, the parabola's vertex itself is 5 % low."""
    sigma, n = 0.77, 6000
    unit = dryden.longitudinal(*CRUISE)
    y = block_means(dryden.longitudinal(sigma, *CRUISE[1:]), n) + noise * np.random.default_rng(4).standard_normal(n)
    middle = 0.8
    three = [minus_twice_log_likelihood(y, unit._replace(sigma_mps=unit.sigma_mps * s), noise)
             for s in (middle / 2, middle, middle * 2)]  # fmt: skip
    intensity = intensity_of(vertex(*three), middle, [ObservedGust(unit, noise)], STEP_S)
    assert intensity == pytest.approx(sigma, rel=0.03 if noise < 0.2 else 0.06)
    if noise < 0.1:
        assert middle * 2 ** vertex(*three) < 0.97 * sigma


@pytest.mark.parametrize("gust", GUSTS)
def test_spectra_contain_the_variance_of_their_process(gust) -> None:
    """The integral over all frequencies is the variance. Means over a step lack a sixth of the increments' variance."""
    theta = np.pi * (np.arange(4000) + 0.5) / 4000
    variance = float(gust.sigma_mps) ** 2
    assert process_spectrum(gust, theta, STEP_S).mean() == pytest.approx(variance, rel=1e-3)
    means = block_mean_spectrum(gust, theta, STEP_S)
    rate = (3.0 if isinstance(gust, dryden.SecondOrderGust) else 2.0) * variance / float(gust.time_s)  # increments
    assert variance - means.mean() == pytest.approx(rate * STEP_S / 6, rel=0.05)
    assert means[0] == pytest.approx(process_spectrum(gust, theta, STEP_S)[0], rel=2e-3), "slow gusts are the same"


def test_the_vertex_is_that_of_the_parabola() -> None:
    assert vertex(*(3 * (x - 0.3) ** 2 + 7 for x in (-1, 0, 1))) == pytest.approx(0.3)


def test_a_measurement_that_never_was_tells_nothing() -> None:
    """Without any measurement, the vertex itself is the answer."""
    gust = GUSTS[0]
    intensity = intensity_of(0.1, 0.4, [ObservedGust(gust, 0.1)], STEP_S)
    assert intensity_of(0.1, 0.4, [ObservedGust(gust, 0.1), ObservedGust(GUSTS[1], np.inf)], STEP_S) == intensity
    assert intensity_of(0.1, 0.4, [ObservedGust(gust, np.inf)], STEP_S) == pytest.approx(0.4 * 2**0.1)
