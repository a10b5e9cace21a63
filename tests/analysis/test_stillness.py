"""Zeros come from standing still, and only from there."""

import numpy as np
import pandas as pd
import pytest

from analysis.stillness import CHANNELS, still_segments, stretches, zeros

RATE_HZ = 25.0
BIAS = {"p_radps": 0.01, "q_radps": -0.02, "r_radps": 0.005, "dp_alpha_Pa": 1.5, "dp_beta_Pa": -0.8, "q_c_Pa": 2.2}
NOISE = {"p_radps": 0.005, "q_radps": 0.005, "r_radps": 0.005, "dp_alpha_Pa": 1.0, "dp_beta_Pa": 1.0, "q_c_Pa": 1.0}


def log_table(seed: int = 0) -> pd.DataFrame:
    """20 s standing, 60 s flying, 10 s standing; zeros as in BIAS, noise as in NOISE."""
    rng = np.random.default_rng(seed)
    n = round(90 * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    flying = (t >= 20) & (t < 80)
    table = {name: BIAS[name] + rng.normal(0, NOISE[name], n) for name in CHANNELS}
    table["q_c_Pa"] = table["q_c_Pa"] + np.where(flying, 150 + 20 * np.sin(t), 0)
    table["q_radps"] = table["q_radps"] + np.where(flying, 0.1 * np.sin(3 * t), 0)
    for name in ("ax_mps2", "ay_mps2", "az_mps2"):
        table[name] = rng.normal(0, 0.06, n) + np.where(flying, np.sin(5 * t), 0)
    table["n_revps"] = np.where(flying, 100.0, np.nan)
    return pd.DataFrame(table, index=pd.Index(t, name="t_s"))


def test_both_stands_are_found_and_nothing_else() -> None:
    table = log_table()
    found = [(table.index[s.start], table.index[s.stop - 1]) for s in still_segments(table, RATE_HZ)]
    assert len(found) == 2
    assert found[0][0] < 1.5 and 18 < found[0][1] < 20
    assert 80 < found[1][0] < 82 and found[1][1] > 88.5


def test_zeros_lie_within_four_of_their_own_standard_errors() -> None:
    for seed in range(20):
        table = log_table(seed)
        rest = zeros(table, still_segments(table, RATE_HZ))
        assert rest is not None
        for name in CHANNELS:
            assert abs(rest.value[name] - BIAS[name]) < 4 * rest.standard_error[name]
            assert rest.standard_error[name] == pytest.approx(NOISE[name] / np.sqrt(27 * RATE_HZ), rel=0.2)


def test_a_flight_without_a_stand_has_no_zeros() -> None:
    table = log_table().iloc[round(25 * RATE_HZ) : round(75 * RATE_HZ)]
    assert zeros(table, still_segments(table, RATE_HZ)) is None


def test_stretches_are_the_runs_of_true() -> None:
    assert stretches(np.array([True, False, True, True])) == [slice(0, 1), slice(2, 4)]
    assert stretches(np.zeros(3, dtype=bool)) == []
