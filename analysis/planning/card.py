"""The flying card, one A4 page in black on white to be read in sunlight, and the plan's lines on the terminal."""

from collections.abc import Sequence
from html import escape
from itertools import groupby
from math import degrees, pi
from typing import NamedTuple

from analysis.planning.pieces import (
    Hold,
    Land,
    Maneuver,
    Porpoise,
    Run,
    Stand,
    TakeOff,
    Turn,
    after,
    before,
    slowest_mps,
)
from analysis.planning.search import FlightPlan
from analysis.planning.settings import MARGINS
from flight.runs import ACCELERATION, DECELERATION


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
        f" {MARGINS.held * slow:.1f} m/s is held ({100 * (MARGINS.held * slow / stall - 1):.0f} % above). The margin is"
        f" {100 * (MARGINS.slowest - 1):.0f} % in still air and {MARGINS.slowest_per_kt * 100:.1f} % more for each knot"
        " of wind."
    )


def runs_to_tick_off(plan: FlightPlan) -> str:
    """The runs of the plan, as the daemon ticks them off (`card.toml`, `daq.flight_card`)."""
    times: dict[tuple[str, str, str], int] = {}
    speed_mps = 0.0
    for maneuver in plan.maneuvers:
        if isinstance(maneuver, Run):
            kind = ACCELERATION if maneuver.until_mps > speed_mps else DECELERATION
            run = kind, f"{speed_mps:.1f}", f"{maneuver.until_mps:.1f}"
            times[run] = times.get(run, 0) + 1
            speed_mps = maneuver.until_mps
        speed_mps = getattr(maneuver, "speed_mps", speed_mps)
    head = '# The runs of the plan, for the daemon: card = "card.toml" in the tray file.\n'
    return head + "".join(
        f'\n[[run]]\nkind = "{kind}"\nfrom_mps = {from_mps}\nto_mps = {to_mps}\ntimes = {count}\n'
        for (kind, from_mps, to_mps), count in times.items()
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


STYLE = """
@page { size: A4; margin: 9mm; }
* { box-sizing: border-box; }
body { color: #000; background: #fff; font: 600 12.5pt/1.22 system-ui, sans-serif; margin: 0 auto; max-width: 192mm; }
h1 { font-size: 19pt; margin: 0 0 1mm; }
p { margin: 0 0 1.5mm; }
table { border-collapse: collapse; width: 100%; margin: 0 0 2mm; }
td, th { border: 1.6pt solid #000; padding: 0.8mm 1.6mm; text-align: left; vertical-align: top; }
td.n { font-size: 17pt; font-weight: 800; white-space: nowrap; text-align: center; }
td.t { font-size: 15pt; font-weight: 800; white-space: nowrap; text-align: right; }
.title { font-size: 13.5pt; font-weight: 800; }
.steps { font-weight: 500; }
.stall { border: 2.5pt solid #000; padding: 1.2mm 2mm; font-weight: 700; }
.widths td, .widths th { text-align: center; }
@media screen { body { padding: 3mm; } }
ul { margin: 0; padding-left: 5mm; font-size: 10.5pt; font-weight: 500; }
""".strip()


def card(plan: FlightPlan, name: str) -> str:
    """The HTML page, without anything from a network."""
    request, space = plan.request, plan.request.space
    minutes, seconds = divmod(round(plan.seconds), 60)
    head = (
        f"For {plan.question.title}. Wind and turbulence of {request.wind_kt:g} kt. {space.height_m:.0f} m high, legs"
        f" of at most {space.leg_m:.0f} m, and {side_m(plan):.0f} m to their side for the turns. Turn left as"
        " often as right. Runs: wings level, height within a few meters."
    )
    lines = "".join(
        f'<tr><td class="n">{escape(row.times)}</td><td><span class="title">{escape(row.title)}</span><br>'
        f'<span class="steps">{escape(row.steps)}</span></td><td class="t">{_clock(row.seconds)}</td></tr>'
        for row in rows(plan)
    )
    widths = expected_interval(plan)
    speeds = "".join(f"<th>{escape(speed)}</th>" for speed, _ in widths)
    halves = "".join(f"<td>{escape(half)}</td>" for _, half in widths)
    lost = "".join(f"<li>{escape(line)}</li>" for line in losses(plan))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(name)}: flying card</title><style>{STYLE}</style></head><body>\n"
        f"<h1>{escape(name)}: {minutes} min {seconds:02d} s</h1>\n"
        f'<p>{escape(head)}</p>\n<p class="stall">{escape(margin(plan))}</p>\n<table>{lines}</table>\n'
        f'<table class="widths"><tr><th>speed</th>{speeds}</tr><tr><th>power, 95 %</th>{halves}</tr></table>\n'
        f"<p>At the worst speed:</p>\n<ul>{lost}</ul>\n</body></html>\n"
    )


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"
