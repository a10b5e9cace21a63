"""Puts words, tables and drawings together into one HTML file; the answers come first."""

import html
import math
from collections.abc import Sequence
from importlib import resources
from string import Template

import plotly.graph_objects as go
import plotly.io
from plotly.offline import get_plotlyjs

from analysis.report import field
from analysis.report.figures import methods_of
from analysis.results.schema import Interval, PerformanceResult, PowerPoint, Results, SpeedInterval
from flight.atmosphere import FOOT_POUND_PER_SECOND_W
from flight.units import GRAVITY_MPS2

BEYOND_TABLE = "Outside the propeller's table: an extrapolation."
_FEET_PER_SECOND, _KMPH = 1 / 0.3048, 3.6


def render(results: Results, drawings: dict[str, go.Figure], fits: list[go.Figure]) -> str:
    """The page. `fits`: one figure a run.

    `drawings` by name: "power", "methods", "timeline", "polar"; where there are, "parts", "loadings", "efficiency",
    "one_by_one" and "consistency".
    """
    figures = {name: _embedded(figure, name) for name, figure in drawings.items()}
    return filled(
        "page.html",
        title=html.escape(f"{results.aircraft.title}: power required"),
        condition=html.escape(_condition(results)),
        cards=_cards(results),
        power=figures["power"],
        below_power=_below_power(results),
        warnings="".join(f'<p class="warning">{html.escape(w)}</p>' for w in results.warnings),
        methods=_methods(results, figures["methods"]) + _one_by_one(figures),
        use=_use(results, figures),
        parts=_parts(results, figures),
        sensors=_sensors(results, figures),
        timeline=figures["timeline"],
        runs=_runs(results),
        rejected=_rejected(results),
        summary=_summary(results),
        polar=figures["polar"],
        curve=_curve(results),
        parameters=_table(
            ("parameter", "estimate", "standard error", "unit"),
            [(p.name, f"{p.value:.5g}", f"{p.standard_error:.2g}", p.unit) for p in results.parameters],
        ),
        fits="".join(_embedded(figure, f"fit-{i}") for i, figure in enumerate(fits)),
        software=html.escape(f"flightpower {results.software_version}, from {results.log}"),
    )


def filled(template: str, *, title: str, **parts: str) -> str:
    """A page of this folder below the head that all have in common: one file that opens without a network."""
    folder = resources.files("analysis") / "report"
    head, page = (Template((folder / name).read_text("utf-8")) for name in ("head.html", template))
    return page.substitute(head=head.substitute(title=title, plotly_js=get_plotlyjs()), title=title, **parts)


def special_in_words(special: SpeedInterval) -> str:
    """ "13.2 m/s (12.9 to 13.5)", "(up to 13.5)" where the interval has no lower end, or why there is none."""
    lo, hi = special.lo_mps, special.hi_mps
    if special.speed_mps is None or hi is None:
        return "not found: the curve has no such point"
    text = f"{special.speed_mps:.1f} m/s ({f'{lo:.1f}' if lo else 'up'} to {hi:.1f})"
    return text if special.inside_flown_range else text + ", outside the flown range: an extrapolation"


def answers_in_words(results: Results) -> list[tuple[str, str, str]]:
    """What is asked first: a question, the answer, and what to know about it. Plain text."""
    use = results.use
    if use is None:
        return [
            ("Longest endurance", special_in_words(results.minimum_power_speed), "least power required"),
            ("Longest range", special_in_words(results.best_range_speed), "least drag"),
        ]
    flown = use.loadings[0]
    least = results.minimum_power_speed
    with_battery = f"with {use.battery_energy_Wh:g} Wh, {100 * use.usable:.0f} % used"
    if not use.power_train.measured:
        with_battery += " (motor assumed, not measured)"
    note = f" {BEYOND_TABLE}" if flown.extrapolated else ""
    if flown.endurance_at_slowest:
        note += " Power still falls at the slowest speed flown"
        if least.speed_mps is not None:
            note += f"; least is reckoned at {least.speed_mps:.1f} m/s, not flown. Mind the stall."
        else:
            note += "."
    answers = [
        (
            "Longest endurance",
            _best(flown.endurance_speed_mps, flown.endurance_at_slowest, flown.endurance_at_fastest),
            f"{_of(flown.endurance_s.times(1 / 60), 'min', 0)} {with_battery}.{note}",
        ),
        (
            "Longest range",
            _best(flown.range_speed_mps, flown.range_at_slowest, flown.range_at_fastest),
            f"{_of(flown.range_m.times(1e-3), 'km', 1)} {with_battery}, in still air.",
        ),
    ]
    available = use.available
    if available.reason:
        answers.append(("Full throttle", "not known", available.reason))
    else:
        top = available.maximum_speed_mps
        climb = _of(available.best_climb_mps, "m/s", 1) if available.best_climb_mps else "not known"
        note = f"Climbs {climb} at {available.best_climb_speed_mps:.0f} m/s."
        if top and available.maximum_speed_extrapolated:
            faster = top.value > results.power_required[-1].speed_mps
            note += " Faster than was flown: an extrapolation." if faster else f" {BEYOND_TABLE}"
        answers.append(("Full throttle, level", _of(top, "m/s", 1) if top else "not found", note))
    return answers


def _best(speed: Interval, at_slowest: bool, at_fastest: bool) -> str:
    """ "13.5 m/s (13.2 to 13.9)"; at an end of what was flown the best may lie beyond."""
    if at_slowest or at_fastest:
        return f"{speed.value:.1f} m/s or {'slower' if at_slowest else 'faster'}"
    return _of(speed, "m/s", 1)


def _of(interval: Interval, unit: str, digits: int) -> str:
    """ "13.5 m/s (13.2 to 13.9)"."""
    return f"{interval.value:.{digits}f} {unit} ({interval.lo:.{digits}f} to {interval.hi:.{digits}f})"


def _condition(results: Results) -> str:
    return (
        f"{results.test.weight_N / GRAVITY_MPS2:.2f} kg, air {results.test.air_density_kgpm3:.3f} kg/m³"
        f" ({results.air_temperature_K - 273.15:.0f} °C), propeller {results.aircraft.propeller}"
    )


def _cards(results: Results) -> str:
    cards = []
    for question, answer, note in answers_in_words(results):
        number, _, rest = answer.partition(" m/s")
        if rest or answer.endswith("m/s"):
            speed = float(number)
            shown = f"<b>{number}</b> m/s<small>{html.escape(rest)}</small>"
            also = f"{speed * _KMPH:.0f} km/h · {speed * _FEET_PER_SECOND:.0f} ft/s"
        else:
            shown, also = f"<b>{html.escape(answer)}</b>", ""
        cards.append(
            f"<div><h2>{html.escape(question)}</h2><p class='answer'>{shown}</p>"
            f"<p class='also'>{also}</p><p>{html.escape(note)}</p></div>"
        )
    return "".join(cards)


def _below_power(results: Results) -> str:
    notes = ["Band: 95 % interval. Dashed: outside what was flown, or outside the propeller's table."]
    if results.use and not results.use.power_train.measured:
        notes.append(results.use.power_train.basis)
    return html.escape(" ".join(notes))


def _methods(results: Results, figure: str) -> str:
    """What each method says of itself, and where two of them disagree."""
    said = "".join(f'<p class="warning">{html.escape(d.text)}</p>' for d in results.disagreements)
    if results.methods and not results.disagreements:
        said = "<p>No two methods differ by more than would be no surprise.</p>"
    rows = [
        (
            m.title,
            m.equations,
            ", ".join(m.taken_as_measured).replace("_", " "),
            *_ends(m.power_required),
            "; ".join(m.notes),
        )
        for m in methods_of(results)
    ]
    return (
        f"<h2>By every method</h2><section>{figure}</section>"
        "<p>Upright bars: 95 % intervals; a click on a name hides or shows a method. A method takes some things as"
        " sensors give them, so that it differs when one is off: its interval is as wide as such errors can be.</p>"
        f"{said}" + _table(("method", "equations", "taken as measured", "slowest, W", "fastest, W", "notes"), rows)
    )


def _one_by_one(figures: dict[str, str]) -> str:
    if "one_by_one" not in figures:
        return ""
    return (
        f"<h2>Every run alone</h2><section>{figures['one_by_one']}</section>"
        "<p>Each run fitted by itself, with the whole flight's path and the propeller's table as it is. Runs of a kind"
        " scatter by noise and gusts; accelerations beside decelerations show a wrong table, or air data that lag.</p>"
    )


def _ends(points: Sequence[PowerPoint]) -> tuple[str, str]:
    """Power with its interval at the slowest and at the fastest speed of a curve."""
    if not points:
        return "no curve", ""
    slow, fast = (
        f"{p.power_W:.0f} ± {(p.power_hi_W - p.power_lo_W) / 2:.0f} at {p.speed_mps:.1f} m/s"
        for p in (points[0], points[-1])
    )
    return slow, fast


def _use(results: Results, figures: dict[str, str]) -> str:
    use = results.use
    if use is None:
        return ""
    costs = "".join(f"<li>{html.escape(cost)}</li>" for cost in (*use.costs, *use.too_much))
    notes = " ".join((use.available.basis, _ceiling(use), *use.available.notes, use.available.reason))
    conditions = (
        f"{field.heading(results, use)}. Level flight, still air, true airspeed; climb and top speed at full throttle;"
        f" ≤, ≥: or slower, or faster: the best lies at an end of the speeds flown. {field.assumption(use)}"
    )
    return (
        f"<h2>What more weight or thinner air costs</h2><section>{figures['loadings']}</section>"
        f"<p>Each at its own best speed, with {use.battery_energy_Wh:g} Wh of which {100 * use.usable:.0f} % are used."
        f" Band: 95 % interval.</p><ul>{costs}</ul>"
        f"<article id='field'><h2>To carry to the field</h2><p>{html.escape(conditions)}</p>"
        + _table(field.SPEEDS, field.speed_rows(use), numbers=True)
        + _table(field.LOADINGS, field.loading_rows(use), numbers=True)
        + _starred(use)
        + f"</article><h2>Propeller, motor and battery</h2><section>{figures['efficiency']}</section>"
        f"<p>Lines: level flight at the flight's weight and density, with 95 % intervals; circles: a few seconds of"
        f" steady or slowly changing flight each, climbing or not. {html.escape(use.power_train.basis)}</p>"
        f"<p>{html.escape(notes)}</p>"
        + _table(
            ("parameter", "estimate", "standard error", "unit"),
            [(p.name, f"{p.value:.4g}", f"{p.standard_error:.2g}", p.unit) for p in use.power_train.parameters],
        )
    )


def _ceiling(use: PerformanceResult) -> str:
    service, absolute = use.available.service_ceiling_m, use.available.absolute_ceiling_m
    words = []
    if service:
        words.append(f"Service ceiling (0.5 m/s of climb left): {_of(service, 'm', 0)} of density altitude.")
    if absolute:
        words.append(f"Absolute ceiling: {_of(absolute, 'm', 0)}.")
    if words:
        words.append("Whether the battery lasts that far is another matter.")
    return " ".join(words)


def _starred(use: PerformanceResult) -> str:
    return f"<p>* {BEYOND_TABLE}</p>" if field.starred(use) else ""


def _parts(results: Results, figures: dict[str, str]) -> str:
    if "parts" not in figures:
        return ""
    middle = results.interval_parts[len(results.interval_parts) // 2]
    share = middle.systematic_W**2 / (middle.systematic_W**2 + middle.noise_W**2)
    return (
        f"<h2>What the interval is made of</h2><section>{figures['parts']}</section>"
        f"<p>At {middle.speed_mps:.0f} m/s {100 * share:.0f} % of its square is what all runs share: errors of the"
        " sensors, of the propeller's table, of direction. More runs make noise smaller, and that not.</p>"
    )


def _runs(results: Results) -> str:
    return _table(
        ("run", "start, s", "length, s", "speed, m/s", "height change, m", "notes"),
        [
            (
                run.kind,
                f"{run.start_s:.1f}",
                f"{run.end_s - run.start_s:.1f}",
                f"{run.lowest_speed_mps:.1f} to {run.highest_speed_mps:.1f}",
                f"{run.altitude_change_m:+.1f}",
                "; ".join(run.notes),
            )
            for run in results.runs
        ],
    )


def _rejected(results: Results) -> str:
    if not results.rejected:
        return ""
    rows = [(r.kind, f"{r.start_s:.1f}", f"{r.end_s - r.start_s:.1f}", r.reason) for r in results.rejected]
    return "<h3>Looked like a run, and why it was not taken</h3>" + _table(
        ("like", "start, s", "length, s", "why"), rows
    )


_CHANNELS = {
    "V": "airspeed", "alpha": "angle of attack", "beta": "sideslip", "height": "barometer",
    "gps_north": "GPS north", "gps_east": "GPS east", "gps_down": "GPS down", "compass": "compass",
}  # fmt: skip


def _sensors(results: Results, figures: dict[str, str]) -> str:
    """Whether the sensors agree with one another, and which of their errors the flight showed."""
    path = results.path
    if path is None:
        return ""
    checks = [
        (check.before.title, *(f"{c.mean:+z.2f} ± {c.sigma:.2f} {c.unit}" for c in (check.before, check.after)))
        for check in path.checks
    ]
    noises = ", ".join(
        f"{words} {path.residuals[name]:.1f}" for name, words in _CHANNELS.items() if name in path.residuals
    )
    errors = [
        (
            e.title,
            f"{e.value:+.{_digits(e.standard_error)}f} ± {e.standard_error:.{_digits(e.standard_error)}f} {e.unit}",
            f"± {e.assumed_sigma:.3g}",
            "yes" if e.determined else "no: " + "; ".join(e.missing),
        )
        for e in path.sensor_errors
    ]
    return (
        "<h2>Do the sensors agree?</h2><p>Each should be zero. Before: as the sensors come; an offset is an error"
        " of a sensor. After: with their errors, and gusts, taken out; what scatters then is noise.</p>"
        + _table(("in flight, mean ± scatter", "before", "after"), checks)
        + (f"<section>{figures['consistency']}</section>" if "consistency" in figures else "")
        + f"<p>How far each channel lies from the flight path, in units of its own noise: {noises}. Well above 1:"
        " something there is not understood. Below 1 is no harm: gusts follow it, or its noise was assumed large.</p>"
        "<h3>What this flight says of its sensors</h3>"
        + _table(("error of", "found (± 1 sigma)", "assumed before", "did the flight show it?"), errors)
    )


def _digits(sigma: float) -> int:
    """Decimals that show two digits of a standard error."""
    return max(0, 1 - math.floor(math.log10(sigma))) if sigma > 0 else 2


def _summary(results: Results) -> str:
    polar, best = results.drag_polar, results.drag_polar.maximum_lift_to_drag
    rows = (
        ("Least power required at", special_in_words(results.minimum_power_speed)),
        ("Least drag at", special_in_words(results.best_range_speed) + _why_not_there(results)),
        (
            "Drag polar",
            f"C<sub>D0</sub> {polar.CD0:.4f}, Oswald e {polar.oswald_efficiency:.2f}, "
            f"(L/D)<sub>max</sub> {'–' if best is None else f'{best:.1f}'}",
        ),
        ("From", f"{_counted(results)}; estimation {html.escape(results.verdict)}"),
    )
    return "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in rows)


def _why_not_there(results: Results) -> str:
    """Why the speed for range on a battery is not that of least drag."""
    least = results.best_range_speed.speed_mps
    if results.use is None or least is None:
        return ""
    best = results.use.loadings[0].range_speed_mps.value
    if abs(best - least) < 0.2:
        return ""
    return f"; on the battery {best:.1f} m/s, where propeller and motor do better"


def _counted(results: Results) -> str:
    kinds = [run.kind for run in results.runs]
    return html.escape(" and ".join(_count(kinds, kind) for kind in ("acceleration", "deceleration")))


def _count(kinds: list[str], kind: str) -> str:
    n = kinds.count(kind)
    return f"{n} {kind}{'' if n == 1 else 's'}"


def _curve(results: Results) -> str:
    return _table(
        ("speed, m/s", "ft/s", "power, W", "95 % interval, W", "ft lbf/s"),
        [
            (
                f"{p.speed_mps:.1f}",
                f"{p.speed_mps * _FEET_PER_SECOND:.0f}",
                f"{p.power_W:.1f}",
                f"{p.power_lo_W:.1f} to {p.power_hi_W:.1f}",
                f"{p.power_W / FOOT_POUND_PER_SECOND_W:.1f}",
            )
            for p in results.power_required[:: max(1, len(results.power_required) // 12)]
        ],
        numbers=True,
    )


def _table(header: Sequence[str], rows: Sequence[Sequence[str]], *, numbers: bool = False) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    kind = "table numbers" if numbers else "table"
    return f'<div class="{kind}"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _embedded(figure: go.Figure, name: str) -> str:
    config = {"displayModeBar": False, "responsive": True}
    return plotly.io.to_html(figure, include_plotlyjs=False, full_html=False, div_id=name, config=config)
