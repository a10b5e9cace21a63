"""Warnings and flags show where runs lie outside the propeller's table."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.maneuvers.flown import TableLimit, limits_left, thrust_coverage, thrust_known
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller


def flown(J: np.ndarray, covered: np.ndarray) -> pd.DataFrame:
    V, n = np.linspace(12, 24, len(J)), np.linspace(50, 140, len(J))
    return pd.DataFrame({"V_mps": V, "J": J, "n_revps": n, "propeller_covered": covered})


def test_a_table_that_covers_all_runs_gives_no_warning() -> None:
    data = flown(np.linspace(0.4, 0.8, 100), np.ones(100, dtype=bool))
    assert thrust_coverage(data, load_propeller("apc-12x8e")) == []


def test_runs_outside_the_table_in_J_are_warned_of_with_both_ranges() -> None:
    data = flown(np.linspace(0.5, 1.1, 100), np.arange(100) < 70)
    (warning,) = thrust_coverage(data, load_propeller("apc-12x8e"))
    assert "30 % of the runs" in warning and "J = 0.88" in warning and "0.52 to 1.08" in warning


def test_runs_outside_the_table_in_rpm_are_warned_of() -> None:
    """J stays inside the table all the time."""
    data = flown(np.linspace(0.4, 0.6, 100), np.arange(100) >= 20)
    (warning,) = thrust_coverage(data, load_propeller("apc-12x8e"))
    assert "20 % of the runs" in warning and "rpm (flown: 3135 to 8265)" in warning


def test_a_propeller_that_was_not_flown_is_refused() -> None:
    data = flown(np.linspace(0.5, 1.1, 100), np.arange(100) < 20)
    with pytest.raises(InputError, match=r"apc-10x5e.*80 % of the runs.*was flown\?"):
        thrust_coverage(data, load_propeller("apc-10x5e"))


def test_decelerations_alone_are_no_sign_of_another_propeller() -> None:
    """When the motor is slow, the advance ratio goes beyond any table."""
    data = flown(np.linspace(0.5, 1.1, 100), np.arange(100) < 20)
    with pytest.raises(InputError, match=r"^mine\.toml: keeps decelerations only.*keep an acceleration as well$"):
        thrust_coverage(data, load_propeller("apc-12x8e"), {"deceleration"}, "mine.toml")
    with pytest.raises(InputError, match=r"all are decelerations: fly accelerations as well$"):
        thrust_coverage(data, load_propeller("apc-12x8e"), {"deceleration"})


def test_the_curve_is_flagged_where_the_table_was_extrapolated() -> None:
    V = np.linspace(12, 24, 400)
    data = pd.DataFrame({"V_mps": V, "propeller_covered": V > 16})
    covered = thrust_known(data, np.array([12.5, 14.0, 18.0, 23.0, 30.0]))
    assert covered.tolist() == [False, False, True, True, True], "nothing flown at 30 m/s, which another check flags"


def test_the_curve_is_flagged_where_less_than_half_of_the_samples_near_a_speed_are_covered() -> None:
    """For example, accelerations may lie within the table, and decelerations through the same speed outside it."""
    V = np.linspace(12, 24, 400)
    for covered_of_ten, enough in ((4, False), (6, True)):
        data = pd.DataFrame({"V_mps": V, "propeller_covered": np.arange(400) % 10 < covered_of_ten})
        assert thrust_known(data, np.array([18.0])).tolist() == [enough]


def test_the_limit_that_was_left_is_named_at_the_speeds_where_it_was() -> None:
    """At low speed the motor turns slower than the table's lowest rpm; at high speed J exceeds the table's largest."""
    propeller = load_propeller("apc-12x8e")
    first, last = propeller.rows[0].rpm, propeller.rows[-1].rpm
    V = np.linspace(12, 24, 121)
    rpm = np.where(V < 16, 0.8 * first, (first + last) / 2)
    J = np.where(V > 20, 1.1, 0.5)
    data = pd.DataFrame({"V_mps": V, "J": J, "n_revps": rpm / 60})
    data["propeller_covered"] = (V >= 16) & (V <= 20)
    assert limits_left(data, propeller, np.array([13.0])) == [TableLimit.MOTOR_SPEED]
    assert limits_left(data, propeller, np.array([23.0])) == [TableLimit.ADVANCE_RATIO]
    assert limits_left(data, propeller, np.array([13.0, 23.0])) == [*TableLimit]
    assert limits_left(data, propeller, np.array([18.0])) == limits_left(data, propeller, np.array([])) == []
    too_fast = data.assign(n_revps=1.1 * last / 60)
    assert limits_left(too_fast, propeller, np.array([13.0])) == [TableLimit.MOTOR_SPEED]
