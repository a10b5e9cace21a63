"""Significance of lift due to pitch rate (4.3-4.7): the trends of Fig. 4.12 on simulated flights."""

import estimation
import numpy as np
import pytest

from flightpower.flight.aircraft import load_aircraft

NEXSTAR = load_aircraft("nexstar")
SEEDS = 3


@pytest.fixture(scope="module")
def flown():
    return estimation.maneuvers()


def test_CLq_is_more_significant_in_quicker_maneuvers(flown):
    """With the gyro as it is: t grows from a slow run over a throttle step to an elevator input, several times."""
    t = [estimation.t_of_CLq(NEXSTAR, run, 0.5, estimation.GYRO_RADPS / 2, SEEDS) for run in flown.values()]
    slow, step, elevator = t
    assert slow < 1.96 < step < elevator
    assert elevator > 4 * step


@pytest.mark.slow
def test_the_limit_rises_with_the_noise_of_the_other_signals(flown):
    step = flown["throttle step, height wanders"]
    quiet, loud = (estimation.significance_limit(NEXSTAR, step, factor, SEEDS) for factor in (0.5, 1.0))
    assert loud.t_quiet == pytest.approx(quiet.t_quiet / 2, rel=0.4), "t goes with one over the noise"
    assert quiet.snr < loud.snr < np.inf
    noisy = estimation.significance_limit(NEXSTAR, step, 2.0, SEEDS)
    assert np.isnan(noisy.snr), "with twice the noise in all else no gyro is quiet enough"
