"""Synchronisation: what was measured is found again at its instant, and nothing is invented in a gap."""

import numpy as np
import pytest

from analysis.channels import on_grid

GRID = np.arange(0, 10, 0.04)


def signal(t):
    return np.sin(2 * np.pi * 0.5 * t)


def test_a_channel_sampled_late_and_unevenly_lands_on_the_grid() -> None:
    rng = np.random.default_rng(3)
    taken = GRID + 0.013 + rng.uniform(-0.004, 0.004, len(GRID))
    inside = slice(2, -2)
    # A cubic spline over steps h errs by at most (5/384) h^4 max|f''''| (de Boor), here 4e-6; twice that for uneven h.
    bound = 2 * 5 / 384 * 0.048**4 * np.pi**4
    assert on_grid(GRID, taken, signal(taken))[inside] == pytest.approx(signal(GRID)[inside], abs=bound)


def test_a_gap_stays_a_gap() -> None:
    kept = (GRID < 4) | (GRID > 5)
    out = on_grid(GRID, GRID[kept], signal(GRID[kept]))
    assert np.isnan(out[(GRID > 4.01) & (GRID < 4.99)]).all()
    assert np.isfinite(out[kept]).all()


def test_two_lost_samples_are_bridged_and_three_are_not() -> None:
    for lost, bridged in ((2, True), (3, False)):
        kept = np.ones(len(GRID), dtype=bool)
        kept[100 : 100 + lost] = False
        out = on_grid(GRID, GRID[kept], signal(GRID[kept]))
        assert np.isfinite(out[100 : 100 + lost]).all() == bridged


def test_nothing_is_known_before_the_first_and_after_the_last_sample() -> None:
    out = on_grid(GRID, GRID[50:200], signal(GRID[50:200]))
    assert np.isnan(out[:50]).all()
    assert np.isnan(out[200:]).all()
