"""The flying card, one A4 page in black on white that is readable in sunlight, and the plan's lines on the terminal."""

from collections.abc import Sequence
from html import escape
from itertools import groupby
from math import cos, degrees, pi, radians, sin
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.maneuvers.flown import thrust_known
from flightpower.analysis.methods.assumed_values import missing_values
from flightpower.analysis.methods.whole_flight.settings import PRIOR
from flightpower.analysis.missions.mission import course_text
from flightpower.analysis.missions.pieces import (
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
from flightpower.analysis.missions.plan_settings import MARGINS, PATH
from flightpower.analysis.missions.search import FlightPlan
from flightpower.analysis.missions.speed_unit import SpeedUnit, speed_text
from flightpower.analysis.performance.settings import ASKED
from flightpower.analysis.settings import EVIDENCE
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller
from flightpower.flight.runs import ACCELERATION, DECELERATION
from flightpower.flight.units import FOOT_M


class Row(NamedTuple):
    """One row of the card's table."""

    times: str
    title: str
    steps: str
    seconds: float


def rows(plan: FlightPlan, unit: SpeedUnit = SpeedUnit.KNOT) -> list[Row]:
    """Return the flight in order; consecutive identical pieces share one row."""
    first, last = len(before(plan.aircraft)), len(after(plan.aircraft))
    starts_s = plan.history.starts_s
    rows = [Row("", "on the ground, then take off", _steps(plan.maneuvers[:first], unit), float(starts_s[first]))]
    for piece, same in groupby(zip(plan.pieces, plan.piece_seconds, strict=True), key=lambda pair: pair[0]):
        seconds = [taken_s for _, taken_s in same]
        rows.append(Row(f"{len(seconds)} ×", piece.title, _steps(piece.maneuvers, unit), sum(seconds)))
    landing_s = float(starts_s[-1] - starts_s[-1 - last])
    return [*rows, Row("", "land, then on the ground", _steps(plan.maneuvers[-last:], unit), landing_s)]


def _steps(maneuvers: Sequence[Maneuver], unit: SpeedUnit) -> str:
    return " → ".join(_words(maneuver, unit) for maneuver in maneuvers)


def _words(maneuver: Maneuver, unit: SpeedUnit = SpeedUnit.KNOT) -> str:
    """Return what the pilot does in a maneuver, as one line of the card."""
    match maneuver:
        case Stand(duration_s):
            return f"stand still {duration_s:.0f} s, motor off"
        case TakeOff(speed_mps):
            return f"take off, climb at {speed_text(speed_mps, unit)}"
        case Hold(duration_s, speed_mps):
            return f"hold {speed_text(speed_mps, unit)} for {duration_s:.0f} s"
        case Turn(speed_mps, angle_rad, bank_rad):
            circles = round(abs(angle_rad) / (2 * pi))
            size = f"{circles} circles" if circles > 1 else "a circle" if abs(angle_rad) > 1.5 * pi else "turn back"
            return f"{size} at {speed_text(speed_mps, unit)}, bank {degrees(bank_rad):.0f}°"
        case Run(throttle, ramp_s, until_mps, longest_s):
            return (
                f"throttle to {100 * throttle:.0f} % over {ramp_s:g} s until {speed_text(until_mps, unit)}"
                f" (at most {longest_s:.0f} s)"
            )
        case Porpoise():
            return (
                f"stick fore and aft for {maneuver.duration_s:.0f} s at {speed_text(maneuver.speed_mps, unit)}, each"
                f" cycle {maneuver.first_period_s:g} s long at first and {maneuver.last_period_s:g} s at the end,"
                f" load factor {1 - maneuver.load:.1f} to {1 + maneuver.load:.1f}"
            )
        case Land():
            return "land"
    raise AssertionError(maneuver)


def margin(plan: FlightPlan, unit: SpeedUnit = SpeedUnit.KNOT) -> str:
    """State the slowest speeds planned, and their margin over the stall."""
    stall, kt = plan.aircraft.stall_mps, plan.request.wind_kt
    slow = slowest_mps(plan.aircraft, kt)
    slowest_hold = MARGINS.hold * slow
    return (
        f"Stall: {speed_text(stall, unit)}, {plan.aircraft.stall_basis}. Decelerations end at"
        f" {speed_text(slow, unit)}, {100 * (slow / stall - 1):.0f} % above the stall: never fly slower. The slowest"
        f" speed to hold is {speed_text(slowest_hold, unit)}, {100 * (slowest_hold / stall - 1):.0f} % above it."
    )


def warnings(plan: FlightPlan) -> list[str]:
    """Return problems to fix before flight day: propeller table, battery, wind, height."""
    warnings = []
    propeller, dashed = plan.aircraft.propeller, uncovered_mps(plan)
    if len(dashed):
        J, rpm = _propeller_in(_runs(plan), propeller)
        last = propeller.rows[-1]
        warnings.append(
            f"At {' and '.join(f'{speed:.1f}' for speed in dashed)} m/s most of the runs lie outside the table of"
            f" {propeller.name}, which has {propeller.rows[0].rpm:.0f} to {last.rpm:.0f} rpm and J to {last.J[-1]:.2f}."
            f" They take {np.quantile(rpm, 0.05):.0f} to {np.quantile(rpm, 0.95):.0f} rpm and J to"
            f" {np.quantile(J, 0.95):.2f}: get a table that has them, or the interval below will not hold."
        )
    battery_Wh, needed_Wh = plan.aircraft.aircraft.propulsion.battery_energy_Wh, energy_Wh(plan)
    usable = ASKED.usable
    if battery_Wh is not None and needed_Wh > usable * battery_Wh:
        warnings.append(
            f"The flight takes some {needed_Wh:.0f} Wh; with {100 * usable:.0f} % of the battery there are"
            f" {usable * battery_Wh:.0f} Wh. Plan fewer --minutes."
        )
    wind_mps, cruise_mps, fast_share = plan.request.wind_mps, plan.aircraft.cruise_mps, 0.7
    if wind_mps > fast_share * cruise_mps:
        warnings.append(
            f"The wind at {plan.request.space.height_m:.0f} m is {wind_mps:.1f} m/s, the speed between maneuvers"
            f" {cruise_mps:.1f} m/s: the flight hardly advances against it, and may end far downwind of the take-off."
            " Plan for less --wind."
        )
    highest_m = 400 * FOOT_M  # 14 CFR 107.51; 120 m in Regulation (EU) 2019/947
    if plan.request.space.height_m > highest_m:
        warnings.append(
            f"{plan.request.space.height_m:.0f} m is above {highest_m:.0f} m (400 ft), the limit in many countries."
        )
    return warnings


def uncovered_mps(plan: FlightPlan) -> Array:
    """Return the speeds [m/s] of the plan's question at which most of the runs lie outside the propeller's table."""
    runs, propeller, speeds = _runs(plan), plan.aircraft.propeller, np.array(plan.question.speeds)
    inside = propeller.covers(*_propeller_in(runs, propeller))
    covered = thrust_known(pd.DataFrame({"V_mps": runs["V_mps"].to_numpy(), "propeller_covered": inside}), speeds)
    return np.asarray(speeds[~covered])


def _propeller_in(history: pd.DataFrame, propeller: Propeller) -> tuple[Array, Array]:
    """Return advance ratio and rpm, each (n,)."""
    rpm = 60 * history["n_revps"].to_numpy()
    return 60 * history["V_mps"].to_numpy() / (rpm * propeller.diameter_m), rpm


def _runs(plan: FlightPlan) -> pd.DataFrame:
    """Return the rows of the history in which a run is flown."""
    table = plan.history.table
    maneuver = np.searchsorted(plan.history.starts_s, table.index.to_numpy(), side="right") - 1
    in_run = np.array([isinstance(maneuver, Run) for maneuver in plan.maneuvers])
    return table[in_run[np.minimum(maneuver, len(in_run) - 1)]]


def energy_Wh(plan: FlightPlan) -> float:
    """Return the battery energy of the plan, with the efficiency typical of small electric aircraft."""
    table = plan.history.table
    power_W = np.nan_to_num(np.maximum(table["thrust_N"].to_numpy() * table["V_mps"].to_numpy(), 0.0))
    return float(power_W.sum()) * PATH.step_s / PRIOR.efficiency.mean / 3600


def farthest_m(plan: FlightPlan) -> float:
    """Return the largest distance from the place of take-off."""
    return float(np.hypot(*plan.history.position_m.T).max())


def runs_to_tick_off(plan: FlightPlan) -> str:
    """Return the runs of the plan in the form that the daemon ticks off (`card.toml`, `daq.flight_card`)."""
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
    """Return the room [m] that the widest turn needs to the side of a leg, in still air."""
    return max((turn.width_m for turn in plan.maneuvers if isinstance(turn, Turn)), default=0.0)


def expected_interval(plan: FlightPlan, unit: SpeedUnit = SpeedUnit.KNOT) -> list[tuple[str, str]]:
    """Return each speed of the question with the half width of the 95 % interval there."""
    return [(speed_text(V, unit), f"±{w:.1f} %") for V, w in zip(plan.question.speeds, plan.half_widths, strict=True)]


def losses(plan: FlightPlan) -> list[str]:
    """Say how much missing keys, leaving out a piece, or using an autopilot widen the interval at the worst speed."""
    worst = float(max(plan.half_widths))
    losses = []
    if plan.worst_with_keys is not None and plan.worst_with_keys < (1 - EVIDENCE.negligible) * worst:
        keys = dict.fromkeys(value.key for value in missing_values(plan.aircraft.aircraft))
        losses.append(
            f"The aircraft file lacks {', '.join(keys)}: with {'them' if len(keys) > 1 else 'it'}"
            f" ±{plan.worst_with_keys:.1f} % instead of ±{worst:.1f} %. Measure and add them before planning."
        )
    for part in plan.contributions:
        times = f"{part.times} × " if part.times > 1 else ""
        losses.append(
            f"{times}{part.title} ({part.seconds:.0f} s): if you skip {'these' if part.times > 1 else 'this'},"
            f" ±{part.worst_without:.1f} % instead of ±{worst:.1f} %"
        )
    if plan.worst_with_porpoising is not None:
        losses.append(
            "An autopilot's mission cannot porpoise. With porpoising by a pilot, in the same time:"
            f" ±{plan.worst_with_porpoising:.1f} % instead of ±{worst:.1f} %."
        )
    return losses


STYLE = """
@page { size: A4; margin: 9mm; }
* { box-sizing: border-box; }
body { color: #000; background: #fff; font: 600 11pt/1.18 system-ui, sans-serif; margin: 0 auto; max-width: 192mm; }
h1 { font-size: 19pt; margin: 0 0 1mm; }
p { margin: 0 0 1.5mm; }
table { border-collapse: collapse; width: 100%; margin: 0 0 2mm; }
td, th { border: 1.6pt solid #000; padding: 0.8mm 1.6mm; text-align: left; vertical-align: top; }
td.n { font-size: 14pt; font-weight: 800; white-space: nowrap; text-align: center; }
td.n .boxes { display: inline-block; max-width: 5.5em; white-space: normal; overflow-wrap: anywhere; }
td.t { font-size: 13pt; font-weight: 800; white-space: nowrap; text-align: right; }
.title { font-size: 12pt; font-weight: 800; }
.steps { font-size: 10pt; font-weight: 500; }
.stall { border: 2.5pt solid #000; padding: 1.2mm 2mm; font-weight: 700; }
.widths td, .widths th { text-align: center; }
.map { float: right; width: 52mm; height: 52mm; margin: 0 0 2mm 3mm; border: 1.2pt solid #000; }
.map polyline { fill: none; stroke: #000; stroke-width: 0.5; }
.map .wind { fill: none; stroke: #000; stroke-width: 1.6; }
.map text { font-size: 5px; }
@media screen { body { padding: 3mm; } }
@media (max-width: 600px) { .map { float: none; display: block; margin: 0 auto 2mm; } }
ul { margin: 0; padding-left: 5mm; font-size: 9pt; font-weight: 500; }
""".strip()


def card(plan: FlightPlan, name: str, unit: SpeedUnit = SpeedUnit.KNOT) -> str:
    """Return the HTML page, which loads nothing from a network."""
    space = plan.request.space
    minutes, seconds = divmod(round(plan.seconds), 60)
    head = (
        f"To measure {plan.question.title}. Height {space.height_m:.0f} m ({space.height_m / FOOT_M:.0f} ft)."
        f" Legs{_headings(plan)} up to {space.leg_m:.0f} m long, with {side_m(plan):.0f} m on each side for the turns;"
        f" never more than {farthest_m(plan):.0f} m from the take-off. Alternate left and right turns"
        f"{', always into the wind' if plan.request.wind_kt else ''}. In runs keep the wings level and the height"
        f" within a few meters. {_air(plan)}"
    )
    lines = "".join(
        f'<tr><td class="n">{_boxes(row.times)}</td><td><span class="title">{escape(row.title)}</span><br>'
        f'<span class="steps">{escape(row.steps)}</span></td><td class="t">{_clock(row.seconds)}</td></tr>'
        for row in rows(plan, unit)
    )
    widths = expected_interval(plan, unit)
    speeds = "".join(f"<th>{escape(speed)}</th>" for speed, _ in widths)
    halves = "".join(f"<td>{escape(half)}</td>" for _, half in widths)
    warned = " ".join([*warnings(plan), margin(plan, unit)])
    lost = "".join(f"<li>{escape(line)}</li>" for line in losses(plan))
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(name)}: flying card</title><style>{STYLE}</style></head><body>\n"
        f"<h1>{escape(name)}: {minutes} min {seconds:02d} s</h1>\n"
        f"{_map(plan)}<p>{_to_fill_in(plan)}</p>\n"
        f'<p>{escape(head)}</p>\n<p class="stall">{escape(warned)}</p>\n<table>{lines}</table>\n'
        f'<table class="widths"><tr><th>speed</th>{speeds}</tr><tr><th>expected ± of power</th>{halves}</tr></table>\n'
        f"<p>What each part is worth, at the speed with the widest interval:</p>\n<ul>{lost}</ul>\n</body></html>\n"
    )


def _boxes(times: str) -> str:
    """Return one box to tick for each repetition."""
    return f'{escape(times)}<br><span class="boxes">{"☐" * int(times.split()[0])}</span>' if times else "☐"


def _air(plan: FlightPlan) -> str:
    """Describe the wind that the plan is made for, its direction, given or assumed, and what it means for times."""
    request = plan.request
    if not request.wind_kt:
        return "In still air."
    from_deg = request.wind_from_deg
    if from_deg is None:
        where = f", assumed to come from {-PATH.wind_from_deg:.0f}° left of the first leg"
    else:
        where = f" from {course_text(radians(from_deg))}"
    return (
        f"Wind {request.wind_kt:g} kt{where}. The times in the right column include this wind; the seconds within a"
        " step do not: flying into the wind, hold each speed until the leg ends."
    )


def _headings(plan: FlightPlan) -> str:
    heading_deg = plan.request.heading_deg
    if heading_deg is None:
        return ""
    outbound, back = (course_text(radians(course_deg)) for course_deg in (heading_deg, heading_deg + 180))
    return f" {outbound} (first) and {back},"


def _to_fill_in(plan: FlightPlan) -> str:
    craft = plan.aircraft.aircraft
    line, battery_Wh = "_" * 8, craft.propulsion.battery_energy_Wh
    battery = f"Battery{f' ({battery_Wh:.0f} Wh)' if battery_Wh else ''} {line} V before, {line} V after"
    return (
        f"Date {line}{line} Pilot {line}{line}<br>Weight {line} (planned {craft.mass_kg:.2f} kg) Propeller {line}"
        f" (planned {escape(craft.propulsion.propeller or '')})<br>{battery}; the flight takes some"
        f" {energy_Wh(plan):.0f} Wh<br>Wind {line} from {line}, {line} °C"
    )


def _map(plan: FlightPlan) -> str:
    """Draw the path over the ground, north up, with take-off place and scale; return nothing if no heading was given.

    The wind is drawn if its direction was given.
    """
    request = plan.request
    if request.heading_deg is None:
        return ""
    along, right = plan.history.position_m[:: round(0.5 / PATH.step_s)].T
    heading = radians(request.heading_deg)
    north, east = along * cos(heading) - right * sin(heading), along * sin(heading) + right * cos(heading)
    reach_m = 1.15 * max(farthest_m(plan), request.space.leg_m / 2)
    x, y = 50 * (1 + east / reach_m), 50 * (1 - north / reach_m)
    track = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
    arrow = ""
    if request.wind_kt and request.wind_from_deg is not None:
        arrow = (
            f'<g transform="translate(12 12) rotate({request.wind_from_deg:.0f})"><path d="M0-9V8M-4 2 0 9 4 2"'
            f' class="wind"/></g><text x="23" y="9">{request.wind_kt:g} kt</text>'
        )
    scale_m = 100 * max(1, round(reach_m / 300))
    width = 50 * scale_m / reach_m
    return (
        '<svg class="map" viewBox="0 0 100 100" role="img" aria-label="Map of the flight, north up">'
        f'<polyline points="{track}"/><circle cx="50" cy="50" r="2"/>{arrow}'
        '<path class="wind" d="M93 16V5M90 9 93 4 96 9"/><text x="91" y="22">N</text>'
        f'<path class="wind" d="M{96 - width:.1f} 95h{width:.1f}"/>'
        f'<text x="{96 - width:.1f}" y="92">{scale_m} m</text></svg>'
    )


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes}:{rest:02d}"
