"""The significance of lift due to pitch rate (4.3-4.7) has the trends of Fig. 4.12 on simulated flights."""

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
    """With a given gyro, t grows from a slow run to a throttle step, and several times more to an elevator input."""
    t = [estimation.t_of_CLq(NEXSTAR, run, 0.5, estimation.GYRO_RADPS / 2, SEEDS) for run in flown.values()]
    slow, step, elevator = t
    assert slow < 1.96 < step < elevator
    assert elevator > 4 * step


@pytest.mark.slow
def test_the_limit_rises_with_the_noise_of_the_other_signals(flown):
    step = flown["throttle step, height wanders"]
    quiet, loud = (estimation.significance_limit(NEXSTAR, step, factor, SEEDS) for factor in (0.5, 1.0))
    assert loud.t_quiet == pytest.approx(quiet.t_quiet / 2, rel=0.4), "t must go with one over the noise"
    assert quiet.snr < loud.snr < np.inf
    noisy = estimation.significance_limit(NEXSTAR, step, 2.0, SEEDS)
    assert np.isnan(noisy.snr), "if all other noise is twice as large, no gyro is quiet enough"
