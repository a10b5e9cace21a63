"""Each kind of maneuver is found where the simulator flew it, and a file of maneuvers can be edited and read back."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from methods import draw_errors, fly

from flightpower.analysis.air.air import bank_angle
from flightpower.analysis.maneuvers import runs_file
from flightpower.analysis.maneuvers.find import find
from flightpower.analysis.maneuvers.kinds import Maneuvers, Unsuitable
from flightpower.analysis.maneuvers.quality import load_factor_rms
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.sim.sensors import load_budget

# Each kind of segment in a plan, and the kind of maneuver that should be found in it.
FOUND_AS = {
    "hold": "steady",
    "roller-coaster": "roller coaster",
    "wind-up-turn": "wind-up turn",
    "3-2-1-1": "3-2-1-1",
    "stand": "standing",
}
SETTLED_S = 15.0  # longer holds have a steady part: 7 s to reach the speed, 8 s for the point


def flown(probe, plan: str, turbulence_kt: float = 0.0):
    errors = draw_errors(load_budget("bench"), 0)
    return fly(load_aircraft("nexstar"), probe, errors, plan, turbulence_kt, 0)


@pytest.fixture(scope="module")
def maneuvers(probe):
    return flown(probe, "maneuvers")


def test_the_maneuvers_of_the_literature_are_found_once_each_where_they_were_flown(maneuvers) -> None:
    all_maneuvers = find(maneuvers.table, maneuvers.still)
    segments = maneuvers.segments
    for kind in ("roller-coaster", "wind-up-turn", "3-2-1-1"):
        start, end = segments.loc[segments["kind"] == kind, ["start_s", "end_s"]].iloc[0]
        (run,) = all_maneuvers.of(FOUND_AS[kind])
        # A maneuver begins when its load factor or elevator has moved; its segment ends with a recovery.
        assert start - 0.5 < run.start_s < start + 3
        assert run.end_s < end + 0.5
        assert run.end_s - run.start_s > 0.3 * (end - start)


def test_a_gap_in_the_imu_does_not_make_a_wind_up_turn_vanish_without_a_word(maneuvers) -> None:
    (complete,) = find(maneuvers.table, maneuvers.still).of("wind-up turn")
    table = maneuvers.table.copy()
    middle = (complete.start_s + complete.end_s) / 2
    table.loc[middle : middle + 0.6, ["ax_mps2", "ay_mps2", "az_mps2"]] = np.nan
    table["bank_rad"] = bank_angle(table)
    all_maneuvers = find(table, maneuvers.still)
    messages = [*all_maneuvers.of("wind-up turn"), *(r for r in all_maneuvers.rejected if r.kind == "wind-up turn")]
    assert any(message.start_s < middle < message.end_s + 0.1 for message in messages)


def test_porpoising_is_found_as_such_and_is_neither_a_roller_coaster_nor_a_3211(probe, tmp_path: Path) -> None:
    plan = tmp_path / "plan.toml"
    text = (Path("sim/plans/maneuvers.toml")).read_text("utf-8")
    plan.write_text(text.replace('"roller-coaster"', '"porpoise"\nduration = "30 s"'), "utf-8")
    flight = flown(probe, str(plan))
    maneuvers, segments = find(flight.table, flight.still), flight.segments
    start, end = segments.loc[segments["kind"] == "porpoise", ["start_s", "end_s"]].iloc[0]
    (run,) = maneuvers.of("porpoising")
    assert (run.start_s, run.end_s) == (pytest.approx(start, abs=2), pytest.approx(end, abs=2))
    assert not maneuvers.of("roller coaster") and len(maneuvers.of("3-2-1-1")) == 1
    assert not [stretch for stretch in maneuvers.rejected if start < stretch.start_s < end]
    others = maneuvers.of("acceleration", "deceleration", "steady")
    assert others and not [item for item in others if item.start_s < run.end_s and run.start_s < item.end_s]


def test_steady_points_are_found_in_every_long_hold_and_nowhere_else(probe) -> None:
    flight = flown(probe, "steady-points")
    steady = find(flight.table, flight.still).of("steady")
    segments = flight.segments
    holds = segments[(segments["kind"] == "hold") & (segments["end_s"] - segments["start_s"] > SETTLED_S)]
    assert len(steady) == len(holds)
    for run, (_, hold) in zip(steady, holds.iterrows(), strict=True):
        assert min(run.end_s, hold["end_s"]) - max(run.start_s, hold["start_s"]) > 0.75 * (hold.end_s - hold.start_s)
        assert run.highest_speed_mps < 1.06 * run.lowest_speed_mps


@pytest.mark.slow
@pytest.mark.parametrize(
    ("plan", "count", "turbulence_kt"),
    [
        ("two-pairs", 4, 15.0),
        *(pytest.param("full-test-flight", 11, kt, marks=pytest.mark.thorough) for kt in (0.0, 3.0, 15.0)),
    ],
)
def test_each_acceleration_and_deceleration_flown_is_found_as_one(
    probe, plan: str, count: int, turbulence_kt: float
) -> None:
    """This holds even in gusts that make speed rise and fall every few seconds."""
    flight = flown(probe, plan, turbulence_kt)
    result = find(flight.table, flight.still).of("acceleration", "deceleration")
    segments = flight.segments[flight.segments["kind"] == "run"]
    assert len(segments) == count
    shares = []
    for i, (_, segment) in enumerate(segments.iterrows()):
        kind = "deceleration" if i % 2 else "acceleration"
        (run,) = (
            r for r in result if r.kind == kind and r.end_s > segment.start_s + 2 and r.start_s < segment.end_s - 2
        )
        V = flight.table["V_mps"].loc[segment.start_s : segment.end_s].rolling(25, center=True, min_periods=1).mean()
        done = (V - V.iloc[0]) / (V.iloc[-1] - V.iloc[0])
        # Speed within 5 % of an end counts as held; at the fast end that is a tenth of the change.
        first, last = done.index[done < 0.1].max(), done.index[done > 0.9].min()
        shares.append((min(run.end_s, last) - max(run.start_s, first)) / (last - first))
    # In 15 kt (sigma 1.2 m/s), a gust at either end can change speed as much as throttle does.
    assert min(shares) == pytest.approx(1) or (turbulence_kt == 15 and np.mean(shares) > 0.8)


def test_standing_and_flying_are_what_the_aircraft_did(maneuvers) -> None:
    all_maneuvers, segments = find(maneuvers.table, maneuvers.still), maneuvers.segments
    (flying,) = all_maneuvers.of("flying")
    take_off, land = (segments[segments["kind"] == kind].iloc[0] for kind in ("take-off", "land"))
    assert take_off["start_s"] < flying.start_s < take_off["end_s"]
    assert land["start_s"] - 5 < flying.end_s < land["end_s"]
    first = all_maneuvers.of("standing")[0]
    assert first.end_s == pytest.approx(take_off["start_s"], abs=2)


def test_turbulence_is_noted_and_grows_with_the_wind(probe) -> None:
    """Dryden gusts scale with W20; the accelerometer's own noise is 0.006 of gravity (Table 4.1)."""
    calm, rough = flown(probe, "accel-decel"), flown(probe, "accel-decel", 15.0)
    notes = [note for run in find(rough.table, rough.still).maneuvers for note in run.notes]
    assert any("turbulence" in note for note in notes)
    rms = [load_factor_rms(flight.table.loc[60.0:90.0]) for flight in (calm, rough)]
    assert rms[0] < 0.02
    assert rms[1] > 5 * rms[0]


def test_a_throttle_step_is_noted_and_a_ramp_is_not(probe) -> None:
    flight = flown(probe, "throttle-step")
    accelerations = find(flight.table, flight.still).of("acceleration")
    assert ["throttle" in " ".join(run.notes) for run in accelerations] == [True, False]


def test_a_file_of_runs_taken_back_unchanged_gives_the_same_runs(maneuvers, tmp_path: Path) -> None:
    all_maneuvers = find(maneuvers.table, maneuvers.still)
    again = taken_back(runs_file.to_toml(all_maneuvers, "log.mcap"), maneuvers.table, tmp_path)
    assert [(run.kind, run.rows) for run in again.maneuvers] == [
        (run.kind, run.rows) for run in all_maneuvers.maneuvers
    ]
    assert len(again.rejected) == len(all_maneuvers.rejected)


def test_runs_can_be_dropped_kept_and_shifted(maneuvers, tmp_path: Path) -> None:
    text = runs_file.to_toml(find(maneuvers.table, maneuvers.still), "log.mcap")
    only = '[[run]]\nkind = "acceleration"\nstart = "60 s"\nend = "68 s"\n'
    (run,) = taken_back(
        only + "[[run]]\nkind='steady'\nstart='70 s'\nend='80 s'\nkeep=false", maneuvers.table, tmp_path
    ).maneuvers
    assert (run.kind, run.start_s, run.end_s) == (
        "acceleration",
        pytest.approx(60, abs=0.04),
        pytest.approx(68, abs=0.04),
    )
    everything = taken_back(text.replace("keep = false", "keep = true"), maneuvers.table, tmp_path)
    assert not everything.rejected


def taken_back(text: str, table: pd.DataFrame, folder: Path) -> Maneuvers:
    path = folder / "runs.toml"
    path.write_text(text, "utf-8")
    return runs_file.apply(runs_file.load(path), table, [], "runs.toml")


def test_runs_that_meet_do_not_overlap(maneuvers, tmp_path: Path) -> None:
    """An acceleration and a deceleration share the moment between them, whichever is written first."""
    first, second = ONE, ONE.replace('"68', '"75').replace('"60', '"68')
    for text in (first + second, second + first):
        assert [round(run.start_s) for run in taken_back(text, maneuvers.table, tmp_path).maneuvers] == [60, 68]


ONE = '[[run]]\nkind = "acceleration"\nstart = "60 s"\nend = "68 s"\n'


@pytest.mark.parametrize(
    ("text", "cause"),
    [
        ("", "has no [[run]]"),
        ("[[run]", "not valid TOML"),
        ("runs = 1\n" + ONE, "unknown key 'runs'"),
        (ONE.replace("acceleration", "speeding"), "kind: 'speeding' is not one of acceleration"),
        (ONE.replace('"60 s"', "60"), "give a number with a unit"),
        (ONE.replace("60 s", "60 m"), "cannot be read as a quantity in s"),
        (ONE.replace("60 s", "70 s"), "must lie before end"),
        (ONE.replace("60 s", "-1 s"), "must lie before end"),
        (ONE + "color = 1", "unknown key 'color'"),
        (ONE.replace('end = "68 s"', ""), "end is missing"),
        (ONE + "keep = false", "no [[run]] has keep = true"),
        (ONE.replace("60", "9000").replace("68", "9010"), "the log ends at"),
        (ONE.replace("60 s", "67.9 s"), "samples"),
        (ONE.replace("60 s", "66.2 s"), "samples; 50 are needed"),
        (ONE + ONE.replace("60 s", "67 s").replace("68 s", "72 s"), "overlaps the acceleration at 60 s"),
        (ONE.replace("60 s", "5 s"), "no V for"),
    ],
)
def test_a_wrong_file_of_runs_is_refused_in_one_line(maneuvers, tmp_path: Path, text: str, cause: str) -> None:
    with pytest.raises(InputError, match=re.escape(cause)) as refused:
        taken_back(text, maneuvers.table, tmp_path)
    assert "\n" not in str(refused.value) and "runs.toml" in str(refused.value)


def test_elevator_steps_that_are_no_3211_are_rejected_with_their_times(maneuvers) -> None:
    table = maneuvers.table.copy()
    start = next(run.start_s for run in find(table, maneuvers.still).maneuvers if run.kind == "3-2-1-1")
    t = table.index.to_numpy() - start
    doublet = np.radians(3) * (((t > 0) & (t < 1)).astype(float) - ((t >= 1) & (t < 2)))
    table.loc[(t > -1) & (t < 8), "elevator_rad"] = doublet[(t > -1) & (t < 8)]
    all_maneuvers = find(table, maneuvers.still)
    assert not all_maneuvers.of("3-2-1-1")
    assert [s.kind for s in all_maneuvers.rejected if s.rejection.reason is Unsuitable.NO_3211] == ["3-2-1-1"]


def test_a_file_taken_back_as_it_was_written_changes_nothing_and_keeps_every_reason(maneuvers, tmp_path: Path) -> None:
    """This holds even if thrust is missing for over 5 % of the flight, outside all runs but the whole flight."""
    table = maneuvers.table.copy()
    all_maneuvers = find(table, maneuvers.still)
    (flight_stretch,) = all_maneuvers.of("flying")
    used = [run for run in all_maneuvers.maneuvers if run.kind not in ("flying", "standing", "porpoising")]
    free = np.ones(len(table), dtype=bool)
    for run in used:
        free[run.rows] = False
    table.loc[free & (table.index.to_numpy() > flight_stretch.start_s), "thrust_N"] = np.nan
    assert table["thrust_N"].iloc[flight_stretch.rows].isna().mean() > 0.05
    (tmp_path / "runs.toml").write_text(runs_file.to_toml(all_maneuvers, "log.mcap"), "utf-8")
    back = runs_file.apply(runs_file.load(tmp_path / "runs.toml"), table, all_maneuvers.rejected, "runs.toml")
    assert [(run.kind, run.rows) for run in back.maneuvers] == [(run.kind, run.rows) for run in all_maneuvers.maneuvers]
    assert all_maneuvers.rejected and [s.rejection for s in back.rejected] == [
        s.rejection for s in all_maneuvers.rejected
    ]
