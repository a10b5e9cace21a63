"""Tests the speeds, durations and turns of the catalog's pieces for a stall at 10 m/s and a fastest speed of 30."""

from math import cos, degrees, pi
from types import SimpleNamespace
from typing import Any

import pytest

from flightpower.analysis.missions import pieces
from flightpower.analysis.missions.pieces import Hold, Pilot, Porpoise, Run, Space, Turn

AIRCRAFT: Any = SimpleNamespace(stall_mps=10.0, fastest_mps=30.0, cruise_mps=16.0, acceleration_throttle=0.87)
SLOW, FAST = 11.0, 27.6  # (1.08 + 0.002 x 10 kt) x stall; 92 % of the fastest
HELD = 1.04 * SLOW
WIND_KT = 10.0


def turning_mps(bank_rad: float) -> float:
    """Return 115 % of the speed at which a turn has the stall margin that SLOW has in level flight."""
    return 1.15 * SLOW / cos(bank_rad) ** 0.5


@pytest.mark.parametrize(("i", "ramp_s", "settle_s", "hold_s"), [(0, 13.0, 16.0, 5.0), (1, 8.0, 10.0, 3.0)])
def test_runs_go_from_the_slowest_speed_to_the_fastest_and_back(i, ramp_s, settle_s, hold_s) -> None:
    piece = list(pieces.run_pairs(AIRCRAFT, Space(5000.0, 60.0), WIND_KT))[i]
    settle, up, hold, down, rest, turn = piece.maneuvers
    assert settle == Hold(settle_s, pytest.approx(HELD)) and hold == Hold(hold_s, pytest.approx(FAST))
    assert up == Run(0.87, ramp_s, pytest.approx(FAST)) and down == Run(0.495, 2.5, pytest.approx(SLOW))
    assert rest == Hold(4.0, 13.0) and turn == Turn(16.0, pi, 0.6)
    assert f"throttle over {ramp_s:.0f} s" in piece.title
    # Both runs together last 38 s; if they do not fit into one leg, they take two, with a turn at the fast speed.
    needed_m = SLOW * settle_s + (SLOW + FAST) / 2 * 38 + hold_s * FAST
    for more_m, legs in ((1.0, 1), (-1.0, 2)):
        maneuvers = list(pieces.run_pairs(AIRCRAFT, Space(needed_m + more_m, 60.0), WIND_KT))[i].maneuvers
        assert sum(isinstance(maneuver, Turn) for maneuver in maneuvers) == legs
    assert maneuvers[0] == Hold(settle_s / 2, pytest.approx(HELD)) and maneuvers[2] == Turn(
        pytest.approx(FAST), pi, 0.6
    )


def test_circuits_are_at_six_speeds_for_8_to_60_seconds() -> None:
    for leg_m, least_s, most_s in ((400.0, 400 / 27.6, 400 / HELD), (50.0, 8.0, 8.0), (5000.0, 60.0, 60.0)):
        circuits = list(pieces.circuits(AIRCRAFT, Space(leg_m, 60.0), WIND_KT))
        assert [piece.maneuvers[0].speed_mps for piece in circuits] == pytest.approx(
            [HELD, 13.0, 16.0, 23.1, 25.5, FAST]
        )
        seconds = [piece.maneuvers[0].duration_s for piece in circuits]
        assert (min(seconds), max(seconds)) == pytest.approx((least_s, most_s))
        for piece in circuits:
            hold, turn, *again = piece.maneuvers
            assert again == [hold, turn] and turn.angle_rad == pi and turn.bank_rad == 0.6
            assert turn.speed_mps == pytest.approx(max(hold.speed_mps, turning_mps(0.6)))


def test_where_there_is_little_time_level_flight_and_porpoising_are_short_and_runs_are_not() -> None:
    """With `longest_s` = 20, porpoising lasts 20 s and each of two legs 10 s; they are never below 10 and 8 s."""
    wide, pilot = Space(5000.0, 60.0), Pilot(autopilot=False, load=1.0)
    for longest_s, porpoising_s, leg_s in ((20.0, 20.0, 10.0), (2.0, 10.0, 8.0), (1000.0, 75.0, 60.0)):
        catalog = pieces.catalog(AIRCRAFT, wide, pilot, WIND_KT, longest_s)
        flown = [piece.maneuvers for piece in catalog]
        assert {item.duration_s for each in flown for item in each if isinstance(item, Porpoise)} == {porpoising_s}
        of_circuits = [piece.maneuvers[0] for piece in catalog if piece.kind is pieces.PieceKind.CIRCUIT]
        assert {circuit.duration_s for circuit in of_circuits if isinstance(circuit, Hold)} == {leg_s}
        runs = [each for each in flown if any(isinstance(item, Run) for item in each)]
        assert runs == [piece.maneuvers for piece in pieces.run_pairs(AIRCRAFT, wide, WIND_KT)]


def test_no_circuit_is_faster_than_the_fastest_planned() -> None:
    slow: Any = SimpleNamespace(stall_mps=10.0, fastest_mps=15.0)
    speeds_mps = [piece.maneuvers[0].speed_mps for piece in pieces.circuits(slow, Space(400.0, 60.0), WIND_KT)]
    assert speeds_mps == pytest.approx([HELD, 13.0, 0.77 * 15, 0.85 * 15, 0.92 * 15])


def test_circles_are_two_at_three_speeds_and_two_banks() -> None:
    held, result = zip(*(piece.maneuvers for piece in pieces.circles(AIRCRAFT, WIND_KT)), strict=True)
    assert [item.speed_mps for item in held] == [item.speed_mps for item in result]
    expected = [Turn(V, 4 * pi, bank) for bank in (0.6, 0.8) for V in (turning_mps(bank), 24.0, FAST)]
    assert [(item.speed_mps, item.angle_rad, item.bank_rad) for item in result] == [
        (pytest.approx(turn.speed_mps), turn.angle_rad, turn.bank_rad) for turn in expected
    ]
    titles = [piece.title for piece in pieces.circles(AIRCRAFT, WIND_KT)]
    assert titles[1] == "two circles at 24.0 m/s, bank 34°" and degrees(0.6) == pytest.approx(34, abs=0.5)
    slow: Any = SimpleNamespace(stall_mps=10.0, fastest_mps=15.0)
    assert [piece.maneuvers[0].speed_mps for piece in pieces.circles(slow, WIND_KT)][1:2] != [12.0], "too slow to turn"


@pytest.mark.parametrize(
    ("load", "over_stall"), [(0.8, [1.5, 1.6, 1.75, 1.95, 2.76]), (1.0, [1.6, 1.75, 1.95, 2.76]), (1.6, [1.95, 2.76])]
)
def test_porpoising_is_where_the_wing_carries_more_than_its_load(load: float, over_stall: list[float]) -> None:
    """It is flown if (V/V_stall)^2 >= 1.1^2 (1 + load), at two rates, for a leg less 4 s, but 10 to 75 s."""
    for leg_m, seconds in ((800.0, lambda V: 800 / V - 4.0), (100.0, lambda V: 10.0), (5000.0, lambda V: 75.0)):
        result = list(pieces.porpoising(AIRCRAFT, Space(leg_m, 60.0), Pilot(autopilot=False, load=load), WIND_KT))
        speeds = [10 * ratio for ratio in over_stall for _ in range(2)]
        cycles = [(1.8, 1.3), (2.4, 1.8)] * len(over_stall)
        for piece, V, (first, last) in zip(result, speeds, cycles, strict=True):
            hold, porpoise, turn = piece.maneuvers
            assert hold == Hold(4.0, pytest.approx(V))
            assert porpoise == Porpoise(pytest.approx(seconds(V)), pytest.approx(V), load, first, last)
            assert turn.speed_mps == pytest.approx(max(V, turning_mps(0.6)))


def test_full_throttle_is_held_to_95_per_cent_of_the_fastest_speed() -> None:
    hold, run = pieces.full_throttle(AIRCRAFT).maneuvers
    assert hold == Hold(8.0, 13.0) and run == Run(1.0, 1.0, pytest.approx(28.5))


def test_a_flight_begins_and_ends_at_1_6_of_the_stall_and_turns_to_either_side() -> None:
    turn = Turn(17.0, pi, 0.6)
    maneuvers = pieces.sequence([pieces.Piece("", (turn, turn, turn), pieces.PieceKind.CIRCUIT)], AIRCRAFT)
    assert [maneuver.angle_rad for maneuver in maneuvers if isinstance(maneuver, Turn)] == [-pi, pi, -pi, pi, -pi]
    assert (maneuvers[0].duration_s, maneuvers[1].speed_mps, maneuvers[2].speed_mps) == (90.0, 16.0, 16.0)
    assert (maneuvers[-3].speed_mps, maneuvers[-2].speed_mps, maneuvers[-1].duration_s) == (16.0, 16.0, 30.0)


def test_a_turn_that_has_no_room_is_steeper_then_slower_then_left_out() -> None:
    circuit = pieces.Piece("", (Turn(25.0, pi, 0.6),), pieces.PieceKind.CIRCUIT)
    steep, slow = Turn(25.0, pi, 0.8), Turn(turning_mps(0.8), pi, 0.8)
    wide = circuit.maneuvers[0].width_m
    for side_m, expected in (
        (wide + 0.1, circuit.maneuvers[0]), (wide - 0.1, steep), (steep.width_m + 0.1, steep),
        (steep.width_m - 0.1, slow), (slow.width_m + 0.1, slow),
    ):  # fmt: skip
        (maneuver,) = pieces._with_room(circuit, turning_mps(0.8), side_m).maneuvers
        assert (maneuver.speed_mps, maneuver.bank_rad) == (pytest.approx(expected.speed_mps), expected.bank_rad)
    assert pieces._with_room(circuit, turning_mps(0.8), slow.width_m - 0.1) is None
    assert (
        pieces._with_room(pieces.replace(circuit, kind=pieces.PieceKind.CIRCLES), turning_mps(0.8), wide - 0.1) is None
    )
