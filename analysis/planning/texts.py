"""A plan in words: rows of the card and lines of the terminal."""

from collections.abc import Sequence
from itertools import groupby
from math import degrees, pi
from typing import NamedTuple

from analysis.planning.maneuvers import Hold, Land, Maneuver, Porpoise, Run, Stand, TakeOff, Turn
from analysis.planning.pieces import HELD_MARGIN, MARGIN, MARGIN_PER_KT, after, before, slowest_mps
from analysis.planning.search import FlightPlan


class Row(NamedTuple):
    """One line of the card."""

    times: str
    title: str
    steps: str
    seconds: float


def rows(plan: FlightPlan) -> list[Row]:
    """The flight in order: pieces that follow each other unchanged are one row."""
    found = [Row("", "on the ground, then take off", _steps(before(plan.aircraft)), 0.0)]
    place = len(before(plan.aircraft))
    starts = plan.history.starts_s
    found[0] = found[0]._replace(seconds=float(starts[place]))
    for piece, same in groupby(plan.pieces):
        times = len(list(same))
        end = place + times * len(piece.maneuvers)
        found.append(Row(f"{times} ×", piece.title, _steps(piece.maneuvers), float(starts[end] - starts[place])))
        place = end
    return [
        *found,
        Row("", "land, then on the ground", _steps(after(plan.aircraft)), float(starts[-1] - starts[place])),
    ]


def _steps(maneuvers: Sequence[Maneuver]) -> str:
    return " → ".join(_words(maneuver) for maneuver in maneuvers)


def _words(maneuver: Maneuver) -> str:
    match maneuver:
        case Stand(duration_s):
            return f"stand still {duration_s:.0f} s, motor off"
        case TakeOff(speed_mps):
            return f"take off, climb at {speed_mps:.0f} m/s"
        case Hold(duration_s, speed_mps):
            return f"hold {speed_mps:.1f} m/s for {duration_s:.0f} s"
        case Turn(speed_mps, angle_rad, bank_rad):
            size = f"{abs(angle_rad) / (2 * pi):.0f} circles" if abs(angle_rad) > 1.5 * pi else "turn back"
            return f"{size} at {speed_mps:.1f} m/s, bank {degrees(bank_rad):.0f}°"
        case Run(throttle, ramp_s, until_mps, longest_s):
            return (
                f"throttle to {100 * throttle:.0f} % over {ramp_s:.0f} s until {until_mps:.1f} m/s"
                f" (at most {longest_s:.0f} s)"
            )
        case Porpoise():
            return (
                f"stick fore and aft for {maneuver.duration_s:.0f} s at {maneuver.speed_mps:.1f} m/s, a cycle in"
                f" {maneuver.first_period_s:g} s, later {maneuver.last_period_s:g} s, load factor"
                f" {1 - maneuver.load:.1f} to {1 + maneuver.load:.1f}"
            )
        case Land():
            return "land"
    raise AssertionError(maneuver)


def margin(plan: FlightPlan) -> str:
    """The slowest speeds planned, and their margin over the stall."""
    stall, kt = plan.aircraft.stall_mps, plan.request.wind_kt
    slow = slowest_mps(plan.aircraft, kt)
    return (
        f"Stall at {stall:.1f} m/s ({plan.aircraft.stall_basis}). Nothing slower than {slow:.1f} m/s is planned"
        f" ({100 * (slow / stall - 1):.0f} % above the stall; decelerations end there), and no speed below"
        f" {HELD_MARGIN * slow:.1f} m/s is held ({100 * (HELD_MARGIN * slow / stall - 1):.0f} % above). The margin is"
        f" {100 * (MARGIN - 1):.0f} % in still air and {MARGIN_PER_KT * 100:.1f} % more for each knot of wind."
    )


def side_m(plan: FlightPlan) -> float:
    """Room to the side of a leg that the widest turn needs [m], in still air."""
    return max((turn.width_m for turn in plan.maneuvers if isinstance(turn, Turn)), default=0.0)


def expected_interval(plan: FlightPlan) -> list[tuple[str, str]]:
    """Speed, and half width of the 95 % interval there."""
    return [(f"{V:.1f} m/s", f"±{w:.1f} %") for V, w in zip(plan.question.speeds, plan.half_widths, strict=True)]


def losses(plan: FlightPlan) -> list[str]:
    """What is lost where a piece cannot be flown, and by an autopilot."""
    worst = float(max(plan.half_widths))
    found = []
    for part in plan.contributions:
        times = f"{part.times} × " if part.times > 1 else ""
        found.append(
            f"{times}{part.title} ({part.seconds:.0f} s): without it ±{part.worst_without:.1f} % instead of"
            f" ±{worst:.1f} %"
        )
    if plan.worst_with_porpoising is not None:
        found.append(
            "An autopilot's mission cannot porpoise. With porpoising by a pilot, in the same time:"
            f" ±{plan.worst_with_porpoising:.1f} % instead of ±{worst:.1f} %."
        )
    return found
