"""Longest endurance and range of closed forms."""

import numpy as np
import pytest

from analysis.performance.endurance_range import longest_endurance, longest_range
from analysis.performance.level_flight import LevelFlight
from analysis.performance.propagation import UncertainValue


def of_battery(V: np.ndarray, power: np.ndarray) -> LevelFlight:
    none = UncertainValue(np.full_like(V, np.nan), np.full_like(V, np.nan))
    return LevelFlight(V, none, none, none, none, none, none, np.ones(len(V), dtype=bool), power[None])


def test_longest_endurance_and_range_of_a_closed_form() -> None:
    """P = a V^3 + b/V: least at V^4 = b/(3a), least over V at V^4 = b/a; 74 Wh of which 80 % are flown with."""
    a, b = 0.011, 330.0
    V = np.linspace(6, 30, 2000)
    flight = of_battery(V, a * V**3 + b / V)
    energy_J = 74 * 3600 * 0.8
    everywhere = np.ones(len(V), dtype=bool)
    slow, far = longest_endurance(flight, energy_J, everywhere), longest_range(flight, energy_J, everywhere)
    V_slow, V_far = (b / (3 * a)) ** 0.25, (b / a) ** 0.25
    assert float(slow.speed_mps.value) == pytest.approx(V_slow, rel=1e-5)
    assert float(slow.best.value) == pytest.approx(energy_J / (4 * a * V_slow**3), rel=1e-6)
    assert float(far.speed_mps.value) == pytest.approx(V_far, rel=1e-5)
    assert float(far.best.value) == pytest.approx(energy_J / (2 * a * V_far**2), rel=1e-6)
    assert not (slow.at_slowest or slow.at_fastest or far.at_slowest or far.at_fastest)


def test_a_best_speed_at_the_end_of_the_flown_range_is_marked() -> None:
    V = np.linspace(12, 24, 200)
    best = longest_endurance(of_battery(V, V**3), 1e5, np.ones(len(V), dtype=bool))
    assert best.at_slowest and not best.at_fastest
    assert float(best.speed_mps.value) == 12.0
