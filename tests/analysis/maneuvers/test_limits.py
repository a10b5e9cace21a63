"""Small synthetic flights test the limits of each kind of maneuver and of the notes."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.maneuvers.find import _part_of, _within, find_steady
from flightpower.analysis.maneuvers.find import _rejection as steady_rejection
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.maneuvers.find_loads import _wind_up_turn_rejection, find_3211
from flightpower.analysis.maneuvers.kinds import (
    PORPOISING,
    ROLLER_COASTER,
    STEPS_3211,
    Maneuver,
    RejectedManeuver,
    Unsuitable,
    reason_in_words,
)
from flightpower.analysis.maneuvers.quality import SmoothedMotion, notes, too_low, without_data
from flightpower.analysis.maneuvers.runs_file import nearest_miss
from flightpower.analysis.sources.daemon import SPEED_SCALE
from flightpower.flight.runs import LEVEL_RUN, Rejection, RunRejected, larger
from tests.analysis.maneuvers.test_find import RATE_HZ, flight, up_and_down


def seconds(n: int) -> np.ndarray:
    return np.arange(n) / RATE_HZ


def test_a_run_ends_where_the_aircraft_climbs_steeply() -> None:
    """It climbs at 3 m/s for 4 s of a 20 s acceleration: only 0.6 m/s on average, where 1.2 m/s would pass."""
    speed = up_and_down(low=10.0, high=28.0, seconds=20.0)
    height = 50 + 3.0 * np.clip(seconds(len(speed)) - 16.0, 0.0, 4.0)
    runs, _ = find_runs(flight(speed, height=height))
    assert not [run for run in runs if run.start_s < 17.0 and run.end_s > 19.0]
    assert [run.kind for run in runs][-1] == "deceleration"


def test_a_change_of_speed_that_lasts_too_long_for_one_run_is_several() -> None:
    """From 12 to 44 m/s in 50 s, each half is a run. From 12 to 40 m/s in 180 s, whole and parts are too gentle."""
    runs, rejected = find_runs(flight(up_and_down(low=12.0, high=44.0, seconds=50.0)))
    assert [run.kind for run in runs] == ["acceleration"] * 2 + ["deceleration"] * 2 and not rejected
    assert all(run.end_s - run.start_s < LEVEL_RUN.longest_s for run in runs)
    runs, rejected = find_runs(flight(up_and_down(low=12.0, high=40.0, seconds=180.0)))
    reasons = [stretch.rejection.reason for stretch in rejected]
    assert not runs and reasons == [RunRejected.TOO_GENTLE] * 2


def test_a_much_faster_aircraft_takes_longer_and_climbs_as_steeply() -> None:
    """60 to 140 m/s in 90 s is one run at 5.2 times the reference speed, where the largest values are 2.6-fold."""
    table = flight(up_and_down(low=60.0, high=140.0, seconds=90.0)).assign(**{SPEED_SCALE: 5.2})
    runs, rejected = find_runs(table)
    assert [run.kind for run in runs] == ["acceleration", "deceleration"] and not rejected
    assert larger(1.0) == larger(2.0) == 1.0, "aircraft of the usual size keep all limits"
    small = find_runs(table.assign(**{SPEED_SCALE: 1.0}))[0]
    assert len(small) > 2, "an aircraft of the usual size would have several runs"


@pytest.mark.parametrize("noise_mps, result", [(0.29, 0), (0.02, 2)])
def test_without_noise_a_gentler_and_smaller_change_of_speed_is_a_run(noise_mps: float, result: int) -> None:
    """20 to 23.4 m/s in 10 s, 16 % at 0.34 m/s², is too gentle and too small with the noise of Table 4.1."""
    speed = up_and_down(low=20.0, high=23.4, seconds=10.0)
    noise = np.random.default_rng(3).normal(0, noise_mps, len(speed))
    runs, _ = find_runs(flight(speed).assign(V_mps=speed + noise))
    assert len(runs) == result
    assert not find_runs(flight(speed).assign(V_mps=speed + noise), noise_mps=np.inf)[0]


def test_a_gap_costs_the_seconds_that_it_takes() -> None:
    """Thrust is missing for 2 s near the end of a 12 s acceleration, and the part before the gap is a run."""
    runs, rejected = find_runs(flight(up_and_down(), thrust_N=slice(400, 450)))
    assert [run.kind for run in runs] == ["acceleration", "deceleration"]
    assert 15.0 < runs[0].end_s < 16.1 and not [
        item for item in rejected if item.rejection.reason is RunRejected.TOO_LONG
    ]


def test_a_run_over_a_hill_is_rejected() -> None:
    """Going 25 m up and down at 1.7 m/s is no climb on average and never exceeds 2 m/s, but is not level flight."""
    speed = up_and_down(low=12.0, high=32.0, seconds=30.0)
    height = 50 + 25 * (1 - np.abs(np.clip(seconds(len(speed)) - 23.0, -15.0, 15.0)) / 15.0)
    runs, rejected = find_runs(flight(speed, height=height))
    assert [run.kind for run in runs] == ["deceleration"]
    (hill,) = (item.rejection for item in rejected if item.rejection.reason is RunRejected.HEIGHT_VARIED)
    assert hill.measured == pytest.approx(25.0, abs=4.0)


def steady_flight(**columns) -> pd.DataFrame:
    """Return thirty seconds at 15 m/s with constant motor speed."""
    return flight(np.full(round(30 * RATE_HZ), 15.0)).assign(**({"n_revps": 90.0} | columns))


def test_a_steady_point_needs_a_steady_motor() -> None:
    (point,), rejected = find_steady(steady_flight())
    assert point.end_s - point.start_s > 25 and not rejected
    varied = 90.0 * (1 + 0.1 * np.sign(np.sin(seconds(750))))
    points, (no_point,) = find_steady(steady_flight(n_revps=varied))
    assert not points and no_point.rejection.reason is Unsuitable.MOTOR_VARIED
    assert no_point.rejection.measured == pytest.approx(0.1, abs=0.005)
    points, (no_point,) = find_steady(steady_flight(n_revps=0.0))
    assert not points and no_point.rejection.reason is Unsuitable.MOTOR_STOPPED


@pytest.mark.parametrize(("bank_deg", "result"), [(8.0, True), (20.0, False)])
def test_a_steady_point_is_flown_with_nearly_level_wings(bank_deg: float, result: bool) -> None:
    """A bank of 12 deg takes a lift 2 % larger than the weight."""
    points, rejected = find_steady(steady_flight(bank_rad=np.radians(bank_deg)))
    assert (len(points) == 1) == result and not rejected


def elevator(holds_s) -> pd.DataFrame:
    """Return a flight with alternating elevator steps of 4 deg, held for `holds_s`, from the tenth second on."""
    table = steady_flight()
    t, deflection = seconds(len(table)), np.zeros(len(table))
    start, sign = 10.0, 1.0
    for hold in holds_s:
        deflection[(t >= start) & (t < start + hold)] = sign * np.radians(4.0)
        start, sign = start + hold, -sign
    return table.assign(elevator_rad=deflection)


@pytest.mark.parametrize("unit_s", [0.4, 0.8])
def test_a_3211_is_known_by_its_proportions(unit_s: float) -> None:
    (result,), rejected = find_3211(elevator(unit_s * np.array([3.0, 2.0, 1.0, 1.0])))
    assert not rejected
    assert result.start_s == pytest.approx(10.0, abs=0.15)
    (note,) = result.notes
    assert float(note.split()[1]) == pytest.approx(unit_s, abs=0.02)  # half a sample


def test_four_equal_steps_are_no_3211() -> None:
    result, (rejected,) = find_3211(elevator([1.0, 1.0, 1.0, 1.0]))
    assert not result and rejected.rejection.reason is Unsuitable.NO_3211
    assert rejected.reason == "steps held for 1.0, 1.0, 1.0, 1.0 s are not a 3-2-1-1"


@pytest.mark.parametrize(
    ("change", "note"),
    [
        ({}, ""),
        ({"bank_deg": 11.0}, ""),
        ({"bank_deg": 14.0}, "bank reached 14 deg"),
        ({"uncovered": 0.01}, ""),
        ({"uncovered": 0.05}, "5 % of the data lie outside the propeller table"),
        ({"height_m": 3.0}, ""),
        ({"height_m": 8.0}, "height varied by 8 m"),
        ({"throttle": 0.2}, ""),
        ({"throttle": 0.5}, "throttle moved by 50 %"),
        ({"lost": 0.012}, "thrust was stale or missing for 1.2 % of the time"),
    ],
)
def test_a_note_is_written_beyond_its_limit(change: dict[str, float], note: str) -> None:
    data = steady_flight(height_m=50.0)
    n = len(data)
    half = np.arange(n) >= n // 2
    data = data.assign(
        height_m=50.0 + change.get("height_m", 0.0) * half,
        throttle=0.4 + change.get("throttle", 0.0) * half,
        propeller_covered=np.arange(n) >= round(change.get("uncovered", 0.0) * n),
        thrust_N=np.where(np.arange(n) < change.get("lost", 0.0) * n, np.nan, 5.0),
    )
    bank = np.full(n, np.radians(change.get("bank_deg", 0.0)))
    result = notes(data, bank)
    assert len(result) == (1 if note else 0)
    assert not note or note in result[0]


@pytest.mark.parametrize(("lost", "missing"), [(0.01, False), (0.05, True)])
def test_a_channel_that_is_missing_for_more_than_2_per_cent_rules_a_maneuver_out(lost: float, missing: bool) -> None:
    data = steady_flight()
    data.loc[data.index < lost * 30, "alpha_rad"] = np.nan
    rejection = without_data(data)
    assert (rejection is not None) == missing
    assert rejection is None or reason_in_words(rejection) == "no alpha for 5 % of the time"


@pytest.mark.parametrize(("V", "drifted"), [((15.0, 15.85), False), ((15.0, 16.1), True)])
def test_a_steady_point_s_speed_stays_within_6_per_cent(V: tuple[float, float], drifted: bool) -> None:
    rejection = steady_rejection(steady_flight(), np.linspace(*V, 750), np.ones(750))
    assert (rejection is not None and rejection.reason is Unsuitable.SPEED_DRIFTED) == drifted
    assert rejection is None or reason_in_words(rejection) == "speed drifted by 7 % of its mean, 6 % are allowed"


def test_a_steady_point_lasts_8_seconds() -> None:
    def rejection(samples: int) -> Rejection | None:
        return steady_rejection(steady_flight().iloc[:samples], np.full(samples, 15.0), np.ones(samples))

    short = rejection(198)  # samples at 25 Hz
    assert short is not None and reason_in_words(short) == "too short: 7.9 s, 8 s are needed"
    assert rejection(204) is None


@pytest.mark.parametrize(
    ("n", "V", "reason"),
    [
        ((1.0, 1.9), (15.0, 17.5), None),
        ((1.0, 1.9), (15.0, 18.75), Unsuitable.SPEED_CHANGED),
        ((1.0, 1.8), (15.0, 15.0), Unsuitable.LOAD_NOT_STEADY),
        ((1.9, 1.0), (15.0, 15.0), Unsuitable.LOAD_NOT_STEADY),
    ],
)
def test_a_wind_up_turn_rises_steadily_at_a_constant_speed(
    n: tuple[float, float], V: tuple[float, float], reason: Unsuitable | None
) -> None:
    """Over thirty seconds, a rise by 0.9 is 0.030 per second, and a rise by 0.8 is 0.027 per second."""
    table = steady_flight()
    rows, ends = slice(0, 750), seconds(750)[-1]
    motion = SmoothedMotion(np.linspace(*V, 750), *[np.zeros(750)] * 3, 1 / RATE_HZ)  # type: ignore[arg-type]
    rising = n[0] + (n[1] - n[0]) * 1.005 * seconds(750) / ends
    rejection = _wind_up_turn_rejection(table, motion, rows, rising)
    assert (rejection.reason if rejection else None) is reason
    short = _wind_up_turn_rejection(table.iloc[100:162], motion, slice(100, 162), rising[100:162])
    assert short is not None and reason_in_words(short) == "too short: 2.4 s, 2.5 s are needed"


def test_a_load_factor_that_swings_about_its_rise_is_reported_by_its_variance() -> None:
    """A linear rise by 1.2 has a variance of 0.12; a swing of amplitude 0.4 adds 0.08, so a line explains 60 %."""
    motion = SmoothedMotion(*[np.full(750, 15.0)] * 4, 1 / RATE_HZ)  # type: ignore[arg-type]
    n = 1 + 1.2 * np.linspace(0, 1, 750) + 0.4 * np.cos(2 * np.pi * 10 * np.linspace(0, 1, 750))
    rejection = _wind_up_turn_rejection(steady_flight(), motion, slice(0, 750), n)
    assert rejection is not None and rejection.reason is Unsuitable.LOAD_NOT_STEADY
    assert reason_in_words(rejection).endswith("+0.04 per second, a straight line explains 60 %")


@pytest.mark.parametrize("reason", [*RunRejected, *Unsuitable])
def test_every_reason_is_reported_in_words_of_its_own(reason) -> None:
    words = {other: reason_in_words(Rejection(other, 0.07, 0.06, "thrust")) for other in [*RunRejected, *Unsuitable]}
    assert words[reason] and list(words.values()).count(words[reason]) == 1


def test_the_longest_stretch_without_a_run_is_reported_with_its_times() -> None:
    rejected = [
        RejectedManeuver("acceleration", 10.0, 16.0, Rejection(RunRejected.TOO_LONG, 6.0)),
        RejectedManeuver("deceleration", 100.0, 103.0, Rejection(RunRejected.HEIGHT_VARIED, 30.0)),
        RejectedManeuver("steady", 200.0, 290.0, Rejection(Unsuitable.MOTOR_STOPPED)),
    ]
    assert nearest_miss(rejected, steady_flight()) == "; the longest stretch, 10 to 16 s: too long: 6 s"
    assert nearest_miss(rejected, steady_flight(), rested=False) == "; the longest stretch, 10 to 16 s: too long: 6 s"
    low = [RejectedManeuver("acceleration", 0.0, 60.0, Rejection(RunRejected.TOO_LOW, 15.0, 20.0))]
    assert nearest_miss(low, steady_flight()).endswith("above the ground, 20 m are needed")
    assert "; there is no rest on the ground in the log" in nearest_miss(low, steady_flight(), rested=False)
    assert nearest_miss(rejected[2:], steady_flight()) == " (speed never changed steadily in level flight)"


@pytest.mark.parametrize(
    ("start_s", "end_s", "within", "part"),
    [
        (21.0, 24.0, True, True),
        (18.0, 21.0, True, True),
        (26.0, 29.0, True, True),
        (10.0, 19.0, False, False),  # before
        (28.5, 31.0, False, False),  # after
        (17.5, 30.5, False, True),  # longer than the input
        (16.9, 20.5, True, False),  # begins more than three seconds before porpoising
        (27.0, 31.1, True, False),
    ],
)
def test_a_short_stretch_within_an_input_or_a_porpoise_is_part_of_it(start_s, end_s, within, part) -> None:
    """An input claims any shorter stretch that overlaps it; porpoising claims what lies within it, 3 s on each side."""
    stretch = RejectedManeuver(ROLLER_COASTER, start_s, end_s, Rejection(RunRejected.TOO_SHORT))
    steps = Maneuver(STEPS_3211, slice(0, 1), 20.0, 28.0, 15.0, 15.0, 0.0)
    assert _within(stretch, [steps]) is within
    assert not _within(RejectedManeuver(STEPS_3211, start_s, end_s, ""), [steps])
    assert _part_of(stretch, [Maneuver(PORPOISING, slice(0, 1), 20.0, 28.0, 15.0, 15.0, 0.0)]) is part


@pytest.mark.parametrize(
    ("third_s", "result"), [(0.5 * 1.3, True), (0.5 * 1.5, False), (0.5 * 0.72, True), (0.28, False)]
)
def test_steps_flown_by_hand_may_be_a_third_of_a_unit_off(third_s: float, result: bool) -> None:
    """The unit is a seventh of the sum of all holds, so a hold that is too long makes it larger."""
    inputs, rejected = find_3211(elevator([1.5, 1.0, third_s, 0.5]))
    assert bool(inputs) is result and bool(rejected) is not result


@pytest.mark.parametrize(("lowest_m", "rejected"), [(5.0, True), (30.0, False)])
def test_the_lowest_point_of_a_maneuver_says_whether_it_is_near_the_ground(lowest_m: float, rejected: bool) -> None:
    data = steady_flight(height_m=60.0)
    data.loc[data.index[len(data) // 2], "height_m"] = lowest_m
    assert (too_low(data) is not None) == rejected
