"""Legs of a speed history, and the limits of a level run, which analysis and pilot's monitor share."""

import math
from itertools import pairwise

import numpy as np
import pytest

from flightpower.flight.runs import Leg, RunMeasures, RunRejected, changing_part, legs_of

GOOD = RunMeasures(
    rows=50,
    step_s=0.2,
    seconds=10.0,
    peak_mps2=0.8,
    speed_change=0.5,
    lowest_m=60.0,
    mean_climb_mps=0.0,
    height_range_m=2.0,
    largest_bank_rad=0.1,
    missing=("thrust", 0.0),
)


def test_speed_turns_where_it_comes_back_and_not_where_it_wavers() -> None:
    V = [10.0, 10.6, 10.1, 14.0, 13.2, 18.0, 17.1, 12.0, 12.9, 11.0, 15.0]
    assert legs_of(V) == [Leg(1, 0, 5), Leg(-1, 5, 9), Leg(1, 9, 10)]
    assert legs_of([12.0, 12.9, 12.1, 12.8]) == [] and legs_of([]) == []
    # 4.5 m/s are 15 % of 30, but less than a quarter of the 20 m/s gained: the leg goes on.
    assert legs_of([10.0, 30.0, 25.5, 34.0, 20.0]) == [Leg(1, 0, 3), Leg(-1, 3, 4)]


def test_legs_alternate_and_end_at_the_furthest_speeds() -> None:
    """The speeds are random walks between 8 and 25 m/s; some change direction by slightly more or less than a leg
    needs."""
    rng = np.random.default_rng(0)
    for _ in range(40):
        turns = rng.uniform(8, 25) * np.exp(np.cumsum(rng.uniform(-0.25, 0.25, 30)))
        V = np.interp(np.arange(150) / 5, np.arange(30), np.clip(turns, 8, 25))
        legs = legs_of(V.tolist())
        for leg, following in pairwise(legs):
            assert following.sign == -leg.sign and following.first == leg.last
        for leg in legs:
            of_leg = leg.sign * V[leg.first : leg.last + 1]
            assert of_leg[-1] == of_leg.max() and leg.kind == ("acceleration" if leg.sign > 0 else "deceleration")


def test_speed_that_is_held_at_either_end_is_no_part_of_the_change() -> None:
    V = [12.0] * 10 + [12.0 + 0.5 * i for i in range(1, 20)] + [21.5] * 10
    part = changing_part(V, [False] * len(V))
    assert (V[part.start], V[part.start + 1]) == (12.5, 13.0)  # 12.6 is 5 % more than the first speed
    assert V[part.stop - 1] == 20.5  # 20.4 is 5 % less than the last
    changing = [False, *(b != a for a, b in pairwise(V))]
    change = changing_part(V, changing)
    assert (change.start, change.stop) == (10, 29)


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({}, None),
        ({"peak_mps2": 0.49}, RunRejected.TOO_GENTLE),
        ({"seconds": 5.1}, None),
        ({"seconds": 4.9}, RunRejected.TOO_SHORT),
        ({"seconds": 39.0}, None),
        ({"seconds": 41.0}, RunRejected.TOO_LONG),
        ({"speed_change": 0.21}, None),
        ({"speed_change": 0.19}, RunRejected.SPEED_CHANGED_LITTLE),
        ({"lowest_m": math.nan}, RunRejected.HEIGHT_UNKNOWN),
        ({"lowest_m": math.inf}, None),
        ({"lowest_m": 20.0}, None),
        ({"lowest_m": 19.0}, RunRejected.TOO_LOW),
        ({"mean_climb_mps": 1.15}, None),
        ({"mean_climb_mps": -1.25}, RunRejected.CLIMBED),
        ({"height_range_m": 19.0}, None),
        ({"height_range_m": 21.0}, RunRejected.HEIGHT_VARIED),
        ({"largest_bank_rad": math.radians(24)}, None),
        ({"largest_bank_rad": math.radians(26)}, RunRejected.BANKED),
        ({"missing": ("thrust", 0.02)}, None),
        ({"missing": ("thrust", 0.03)}, RunRejected.DATA_MISSING),
    ],
)
def test_a_run_is_rejected_beyond_each_limit(change: dict, reason: RunRejected | None) -> None:
    rejection = GOOD._replace(**change).rejection(1.0)
    assert (rejection.reason if rejection else None) is reason


@pytest.mark.parametrize(
    "change", [{"seconds": 3.2}, {"peak_mps2": 0.32}, {"lowest_m": 13.0}], ids=["short", "gentle", "low"]
)
def test_limits_of_a_slower_aircraft_are_smaller(change: dict) -> None:
    """At 0.6 of the speed, runs may last 3 s, change speed by 0.3 m/s^2 and be at 12 m, but may climb by only 0.72
    m/s."""
    run = GOOD._replace(**change)
    assert run.rejection(1.0) is not None and run.rejection(0.6) is None
    climbing = GOOD._replace(mean_climb_mps=0.8)
    assert climbing.rejection(1.0) is None and climbing.rejection(0.6) is not None


def test_what_is_not_mentioned_is_short_or_held() -> None:
    assert not GOOD.negligible(1.0) and not GOOD._replace(rows=15).negligible(1.0)
    assert GOOD._replace(rows=14).negligible(1.0) and not GOOD._replace(rows=14).negligible(0.6)
    assert GOOD._replace(peak_mps2=0.4, speed_change=0.1).negligible(1.0)
    assert not GOOD._replace(peak_mps2=0.4).negligible(1.0) and not GOOD._replace(speed_change=0.1).negligible(1.0)
