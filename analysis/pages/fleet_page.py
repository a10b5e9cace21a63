"""The page of a fleet, from its fleet.json (docs/use/fleet.md)."""

from datetime import UTC, datetime

from flightpower.analysis.pages.answers import HeadlineAnswer
from flightpower.analysis.pages.charts.figure import Axis, Cursor, Figure, Line
from flightpower.analysis.pages.charts.style import BLUE, GRAY, INK, ORANGE, band, curve_arrays, true_airspeed
from flightpower.analysis.pages.html_page import HtmlTable, html_figure, render_page
from flightpower.analysis.pages.pooled_page import count
from flightpower.analysis.records.fleet import AirframeResult, FleetCurveResult, FleetResults
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.results.evidence import sentence


def render_fleet(fleet: FleetResults) -> str:
    """The page as one HTML file."""
    names = {one.name for one in fleet.airframes}
    return render_page(
        "fleet.html",
        title=f"Fleet of {count(len(names), 'airframe')}, {count(fleet.flights, 'flight')}",
        answers=fleet_answers(fleet),
        news=news_table(fleet),
        curves=[
            (
                f"Airframes like {curve.airframes[0]}",
                html_figure(curve_figure(fleet, curve), "power" if not i else f"power-{i}"),
            )
            for i, curve in enumerate(fleet.curves)
        ],
        airframes=airframes_table(fleet),
        notes=fleet.notes,
        doubts=doubts(fleet),
        left_out=fleet.left_out,
        source=f"flightpower {fleet.software_version}",
    )


def fleet_answers(fleet: FleetResults) -> list[HeadlineAnswer]:
    """Which airframes changed, and how much airframes of one kind differ."""
    changed = [one for one in fleet.airframes if one.changes]
    answers = [
        HeadlineAnswer(
            "Changed airframes",
            f"{len({one.name for one in changed})} of {len({one.name for one in fleet.airframes})}",
            "By drag or propulsion, since their first flight.",
        )
    ]
    for curve in fleet.curves:
        middle = len(curve.mean) // 2
        mean, another = curve.mean[middle], curve.another[middle]
        share = 50 * (another.power_hi_W - another.power_lo_W) / another.power_W
        answers.append(
            HeadlineAnswer(
                f"Another airframe like these {len(curve.airframes)}",
                f"{mean.power_W:.0f} W ± {share:.1f} %",
                f"At {mean.speed_mps:.1f} m/s, before it has flown (95 % interval).",
            )
        )
    return answers


def news_table(fleet: FleetResults) -> HtmlTable:
    """Changes, the latest first."""
    changes = [(one, change) for one in fleet.airframes for change in one.changes]
    changes.sort(key=lambda pair: pair[1].since_unix_s or 0.0, reverse=True)
    return HtmlTable(
        ("airframe", "what changed", "seen after"),
        [(one.name, change.text, change.found_log) for one, change in changes],
    )


def airframes_table(fleet: FleetResults) -> HtmlTable:
    return HtmlTable(
        ("airframe", "mounted", "flights", "last flight", "least power", "± %", "trust"),
        [_row(one) for one in fleet.airframes],
        numbers=True,
    )


def _row(one: AirframeResult) -> tuple[str, ...]:
    least = min(one.power_required, key=lambda point: point.power_W)
    share = 50 * (least.power_hi_W - least.power_lo_W) / least.power_W
    return (
        one.name,
        one.kind.words if one.kind is not Kind.POWER_REQUIRED else one.installation or "none named",
        f"{one.pooled_flights} of {one.flights}",
        _date(one.last_unix_s),
        f"{least.power_W:.1f} W, {least.speed_mps:.1f} m/s",
        f"{share:.1f}",
        one.trust,
    )


def doubts(fleet: FleetResults) -> list[str]:
    """What speaks against the curves, by airframe."""
    of_curves = [f"{one.name}: {sentence(evidence)}" for one in fleet.airframes for evidence in one.evidence]
    return [*(one.text for one in fleet.contradictions), *of_curves]


def _date(unix_s: float | None) -> str:
    return "" if unix_s is None else datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%d")


def curve_figure(fleet: FleetResults, curve: FleetCurveResult) -> Figure:
    """Every airframe's curve, the mean, and what another airframe will need."""
    figure = Figure(height_px=480, cursor=Cursor.NEAREST, x=true_airspeed())
    V, _, lo, hi = curve_arrays(curve.another)
    figure.add(band(V, (lo, hi), GRAY, 0.3))
    for one in (one for one in fleet.airframes if one.name in curve.airframes):
        color, kind = (ORANGE, "changed airframe") if one.changes else (BLUE, "airframe")
        V, P, _, _ = curve_arrays(one.power_required)
        figure.add(Line(x=V, y=P, name=kind, color=color, width=2, label=one.name, value="{y:.1f} W"))
    V, P, _, _ = curve_arrays(curve.mean)
    figure.add(Line(x=V, y=P, name="mean", color=INK, width=5, value="{y:.1f} W"))
    figure.y = Axis("power required", "W", from_zero=True)
    return figure
