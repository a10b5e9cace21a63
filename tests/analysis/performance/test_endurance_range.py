"""Best endurance and range agree with closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.performance.level_flight import LevelFlight, _maxima, best_endurance, best_range
from flightpower.analysis.performance.propagation import UncertainValue


def of_battery(V: np.ndarray, power: np.ndarray) -> LevelFlight:
    none = UncertainValue(np.full_like(V, np.nan), np.full_like(V, np.nan))
    return LevelFlight(V, none, none, none, none, none, none, np.ones(len(V), dtype=bool), power[None])


def test_best_endurance_and_range_of_a_closed_form() -> None:
    """P = a V^3 + b/V is least at V^4 = b/(3a), and P/V at V^4 = b/a; 80 % of 74 Wh are used."""
    a, b = 0.011, 330.0
    V = np.linspace(6, 30, 2000)
    flight = of_battery(V, a * V**3 + b / V)
    energy_J = 74 * 3600 * 0.8
    everywhere = np.ones(len(V), dtype=bool)
    slow, far = best_endurance(flight, energy_J, everywhere), best_range(flight, energy_J, everywhere)
    V_slow, V_far = (b / (3 * a)) ** 0.25, (b / a) ** 0.25
    assert float(slow.speed_mps.value) == pytest.approx(V_slow, rel=1e-5)
    assert float(slow.best.value) == pytest.approx(energy_J / (4 * a * V_slow**3), rel=1e-6)
    assert float(far.speed_mps.value) == pytest.approx(V_far, rel=1e-5)
    assert float(far.best.value) == pytest.approx(energy_J / (2 * a * V_far**2), rel=1e-6)
    assert not (slow.at_slowest or slow.at_fastest or far.at_slowest or far.at_fastest)


def test_a_best_speed_at_the_end_of_the_flown_range_is_marked() -> None:
    V = np.linspace(12, 24, 200)
    best = best_endurance(of_battery(V, V**3), 1e5, np.ones(len(V), dtype=bool))
    assert best.at_slowest and not best.at_fastest
    assert float(best.speed_mps.value) == 12.0


def test_a_best_speed_is_sought_where_full_throttle_sustains_level_flight() -> None:
    """P = V^3 is least at the slowest speed; if only 15 m/s and faster are sustained, the best speed is 15 m/s."""
    V = np.linspace(12, 24, 121)
    best = best_endurance(of_battery(V, V**3), 1e5, V > 14.95)
    assert float(best.speed_mps.value) == pytest.approx(15.0) and not best.at_slowest
    assert float(best.power_W.value) == pytest.approx(15.0**3)


def test_range_that_still_grows_at_the_fastest_speed_is_marked() -> None:
    V = np.linspace(12, 24, 121)
    best = best_range(of_battery(V, np.full(len(V), 70.0)), 1e5, np.ones(len(V), dtype=bool))
    assert best.at_fastest and not best.at_slowest and float(best.speed_mps.value) == 24.0


def test_a_best_speed_outside_the_table_is_marked() -> None:
    V = np.linspace(12, 24, 121)
    for inside_below, inside in ((14.0, True), (11.0, False)):
        flight = replace(of_battery(V, V**3), inside=V < inside_below)
        assert best_endurance(flight, 1e5, np.ones(len(V), dtype=bool)).inside == inside


def test_the_maximum_of_a_parabola_is_exact_between_points() -> None:
    """Each row has its own maximum; at an end, or next to an unknown point, it is the highest point."""
    x = np.arange(4.0)
    beside_unknown = np.array([np.nan, 4.0, 3.0, np.nan])
    rows = np.array([5 - (x - 1.3) ** 2, 5 - (x - 2.2) ** 2 / 4, x, beside_unknown, np.full(4, np.nan)])
    places, heights = _maxima(x, rows)
    assert places == pytest.approx([1.3, 2.2, 3.0, 1.0, np.nan], nan_ok=True)
    assert heights == pytest.approx([5.0, 5.0, 3.0, 4.0, np.nan], nan_ok=True)
