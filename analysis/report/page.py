"""Puts words, tables and drawings together into one HTML file."""

import html
from collections.abc import Sequence
from importlib import resources
from string import Template

import plotly.graph_objects as go
import plotly.io
from plotly.offline import get_plotlyjs

from analysis.results import Results, SpeedInterval
from flight.atmosphere import FOOT_POUND_PER_SECOND_W

_FEET_PER_SECOND = 1 / 0.3048


def render(results: Results, drawings: dict[str, go.Figure], fits: list[go.Figure]) -> str:
    """The page. `drawings`: "power", "timeline" and "polar" by name; `fits`: one figure a run."""
    template = Template((resources.files("analysis") / "report" / "page.html").read_text("utf-8"))
    figures = {name: _embedded(figure, name) for name, figure in drawings.items()}
    return template.substitute(
        title=html.escape(f"{results.aircraft.title}: power required"),
        plotly_js=get_plotlyjs(),
        summary=_summary(results),
        warnings="".join(f'<p class="warning">{html.escape(w)}</p>' for w in results.warnings),
        runs=_table(
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
        ),
        rejected=_rejected(results),
        parameters=_table(
            ("parameter", "estimate", "standard error", "unit"),
            [(p.name, f"{p.value:.5g}", f"{p.standard_error:.2g}", p.unit) for p in results.parameters],
        ),
        curve=_table(
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
        ),
        fits="".join(_embedded(figure, f"fit-{i}") for i, figure in enumerate(fits)),
        software=html.escape(f"flightpower {results.software_version}, from {results.log}"),
        **figures,
    )


def special_in_words(special: SpeedInterval) -> str:
    """ "13.2 m/s (12.9 to 13.5)", or why there is none."""
    if special.speed_mps is None:
        return "not found: the curve has no such point"
    text = f"{special.speed_mps:.1f} m/s ({special.lo_mps:.1f} to {special.hi_mps:.1f})"
    return text if special.inside_flown_range else text + ", outside the flown range: an extrapolation"


def _summary(results: Results) -> str:
    polar = results.drag_polar
    kinds = [run.kind for run in results.runs]
    rows = (
        ("Longest endurance at", special_in_words(results.minimum_power_speed)),
        ("Longest range at", special_in_words(results.best_range_speed)),
        (
            "Drag polar",
            f"C<sub>D0</sub> {polar.CD0:.4f}, Oswald e {polar.oswald_efficiency:.2f}, "
            f"(L/D)<sub>max</sub> {polar.maximum_lift_to_drag:.1f}",
        ),
        (
            "Test",
            f"{results.test.weight_N:.1f} N, air {results.test.air_density_kgpm3:.3f} kg/m³, "
            f"{results.air_temperature_K - 273.15:.0f} °C",
        ),
        (
            "From",
            f"{_count(kinds, 'acceleration')} and {_count(kinds, 'deceleration')}; "
            f"estimation {html.escape(results.verdict)}",
        ),
    )
    return "".join(f"<div><dt>{name}</dt><dd>{value}</dd></div>" for name, value in rows)


def _count(kinds: list[str], kind: str) -> str:
    n = kinds.count(kind)
    return f"{n} {kind}{'' if n == 1 else 's'}"


def _rejected(results: Results) -> str:
    if not results.rejected:
        return ""
    rows = [(r.kind, f"{r.start_s:.1f}", f"{r.end_s - r.start_s:.1f}", r.reason) for r in results.rejected]
    return "<h3>Looked like a run, and why it was not taken</h3>" + _table(
        ("like", "start, s", "length, s", "why"), rows
    )


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in header)
    body = "".join("<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="table"><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table></div>'


def _embedded(figure: go.Figure, name: str) -> str:
    config = {"displayModeBar": False, "responsive": True}
    return plotly.io.to_html(figure, include_plotlyjs=False, full_html=False, div_id=name, config=config)
