"""The page of a fleet, from its fleet.json (docs/use/fleet.md)."""

import csv
import io
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np

from flightpower.analysis.pages.answers import HeadlineAnswer
from flightpower.analysis.pages.charts.figure import Axis, Cursor, Figure, Line, Points
from flightpower.analysis.pages.charts.style import BLUE, GRAY, INK, ORANGE, band, curve_arrays, true_airspeed
from flightpower.analysis.pages.html_page import HtmlFigure, HtmlTable, html_figure, render_page
from flightpower.analysis.pages.pooled_page import count
from flightpower.analysis.records.fleet import (
    AirframeResult,
    ChangeResult,
    FleetCurveResult,
    FleetResults,
    FlightShareResult,
    Shape,
)
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.results.evidence import sentence
from flightpower.flight.arrays import Array
from flightpower.flight.units import DAY_S


def render_fleet(fleet: FleetResults) -> str:
    """Return the page as one HTML file."""
    names = {airframe.name for airframe in fleet.airframes}
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
        histories=_histories(fleet),
        airframes=airframes_table(fleet),
        logs=[
            (airframe.name, [(_date(log.start_unix_s), log.log, log.report) for log in airframe.logs])
            for airframe in fleet.airframes
            if airframe.logs
        ],
        notes=fleet.notes,
        doubts=doubts(fleet),
        left_out=fleet.left_out,
        source=f"flightpower {fleet.software_version}",
    )


def fleet_answers(fleet: FleetResults) -> list[HeadlineAnswer]:
    """Say which airframes changed, and how much airframes of one kind differ."""
    changed = [airframe for airframe in fleet.airframes if airframe.changes]
    answers = [
        HeadlineAnswer(
            "Changed airframes",
            f"{len({airframe.name for airframe in changed})} of {len({airframe.name for airframe in fleet.airframes})}",
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
                f"At {mean.speed_mps:.1f} m/s, before it has flown (95 % interval)." + _apart(curve),
            )
        )
    return answers


def _apart(curve: FleetCurveResult) -> str:
    """Say whether airframes that changed are left out of the mean, or kept in it because too few others remain."""
    if not curve.changed:
        return ""
    names = ", ".join(curve.changed)
    within = set(curve.changed) <= set(curve.airframes)
    return f" With {names}, changed: too few others." if within else f" Without {names}, changed."


def flights_csv(fleet: FleetResults) -> str:
    """Return a row per flight for spreadsheets: its own values in percent of the airframe's; empty if unknown."""
    shares = ("drag_percent", "drag_half_width_percent", "thrust_percent", "thrust_half_width_percent")
    rows: list[Sequence[str]] = [("airframe", "mounted", "log", "start_utc", *shares, "report")]
    for airframe in fleet.airframes:
        share_of_flight: dict[tuple[str, float | None], FlightShareResult] = {
            (share.log, share.start_unix_s): share for share in airframe.history
        }
        for log in airframe.logs:
            share = share_of_flight.get((log.log, log.start_unix_s))
            values = ["" if share is None else f"{getattr(share, name):.3f}" for name in shares]
            began = None if log.start_unix_s is None else datetime.fromtimestamp(log.start_unix_s, UTC)
            start = "" if began is None else began.strftime("%Y-%m-%d %H:%M:%S")
            rows.append((airframe.name, airframe.installation, log.log, start, *values, log.report))
    return _csv(rows)


def curves_csv(fleet: FleetResults) -> str:
    """Return a row per point of each curve for spreadsheets: curves of the airframes, and of the fleet's means."""
    fields = ("speed_mps", "power_W", "power_lo_W", "power_hi_W")
    rows: list[Sequence[str]] = [("curve", "mounted", "kind", "weight_N", "air_density_kgpm3", *fields)]
    curves = [
        (airframe.name, airframe.installation, airframe.kind, airframe.test, airframe.power_required)
        for airframe in fleet.airframes
    ]
    for curve in fleet.curves:
        name = f"airframes like {curve.airframes[0]}"
        curves += [(f"mean of {name}", "", Kind.POWER_REQUIRED, curve.test, curve.mean)]
        curves += [(f"another of {name}", "", Kind.POWER_REQUIRED, curve.test, curve.another)]
    for name, mounted, kind, condition, points in curves:
        for point in points:
            numbers = (condition.weight_N, condition.air_density_kgpm3, *(getattr(point, field) for field in fields))
            rows.append((name, mounted, kind, *(f"{number:.6g}" for number in numbers)))
    return _csv(rows)


def _csv(rows: Sequence[Sequence[str]]) -> str:
    out = io.StringIO()
    csv.writer(out, lineterminator="\n").writerows(rows)
    return out.getvalue()


def news_table(fleet: FleetResults) -> HtmlTable:
    """Return the table of changes, latest first."""
    changes = [(airframe, change) for airframe in fleet.airframes for change in airframe.changes]
    changes.sort(key=lambda pair: pair[1].since_unix_s or 0.0, reverse=True)
    return HtmlTable(
        ("airframe", "what changed", "seen after"),
        [(airframe.name, change.text, change.found_log) for airframe, change in changes],
    )


def airframes_table(fleet: FleetResults) -> HtmlTable:
    return HtmlTable(
        ("airframe", "installation", "flights pooled", "last flight", "least power", "± %", "trust"),
        [_row(airframe) for airframe in fleet.airframes],
        numbers=True,
    )


def _row(airframe_result: AirframeResult) -> tuple[str, ...]:
    least = min(airframe_result.power_required, key=lambda point: point.power_W)
    share = 50 * (least.power_hi_W - least.power_lo_W) / least.power_W
    return (
        airframe_result.name,
        airframe_result.kind.words
        if airframe_result.kind is not Kind.POWER_REQUIRED
        else airframe_result.installation or "none named",
        f"{airframe_result.pooled_flights} of {airframe_result.flights}",
        _date(airframe_result.last_unix_s),
        f"{least.power_W:.1f} W, {least.speed_mps:.1f} m/s",
        f"{share:.1f}",
        airframe_result.trust,
    )


def doubts(fleet: FleetResults) -> list[str]:
    """Return sentences on what contradicts the curves, with the airframe's name."""
    of_curves = [
        f"{airframe.name}: {sentence(evidence)}" for airframe in fleet.airframes for evidence in airframe.evidence
    ]
    return [*(contradiction.text for contradiction in fleet.contradictions), *of_curves]


def _date(unix_s: float | None) -> str:
    return "" if unix_s is None else datetime.fromtimestamp(unix_s, UTC).strftime("%Y-%m-%d")


def _histories(fleet: FleetResults) -> list[tuple[str, HtmlFigure, bool]]:
    """Return name, figure, and whether it changed for each airframe; changed airframes come first."""
    dated = sorted(
        (airframe for airframe in fleet.airframes if airframe.history), key=lambda airframe: not airframe.changes
    )
    return [
        (airframe.name, html_figure(history_figure(airframe), f"history-{i}"), bool(airframe.changes))
        for i, airframe in enumerate(dated)
    ]


def history_figure(airframe: AirframeResult) -> Figure:
    """Draw drag and thrust of each flight by date, and the changes found."""
    days = np.array([share.start_unix_s for share in airframe.history]) / DAY_S
    figure = Figure(panels=2, height_px=420, cursor=Cursor.NEAREST, x=_dates(days))
    figure.zero_lines = {1, 2}
    for panel, name in ((1, "drag"), (2, "thrust")):
        values = np.array([getattr(share, f"{name}_percent") for share in airframe.history])
        half = np.array([getattr(share, f"{name}_half_width_percent") for share in airframe.history])
        figure.ys[panel - 1] = Axis(name, "%", from_zero=True, most_ticks=5)
        figure.add(
            Points(
                x=days, y=values, y_ends=np.stack([values - half, values + half]), color=BLUE, panel=panel,
                name="flight, 95 % interval", value="{y:+.1f} %",
            )
        )  # fmt: skip
        if airframe.changes:
            x, y = _level(airframe.changes, name, days[-1])
            figure.add(
                Line(x=np.r_[days[0], x], y=np.r_[0.0, y], color=ORANGE, panel=panel, name="change", value="{y:+.1f} %")
            )
    return figure


def _dates(days: Array) -> Axis:
    """Return an axis with evenly spaced dates, short enough for a phone; a single year is in the title instead."""
    days_marked = np.unique(np.linspace(np.ceil(days[0]), max(np.floor(days[-1]), np.ceil(days[0])), 5).round())
    dates = [datetime.fromtimestamp(day * DAY_S, UTC) for day in days_marked.tolist()]
    years = sorted({date.year for date in dates})
    texts = [f"{date.day} {date:%b}" if len(years) == 1 else f"{date:%b %Y}" for date in dates]
    title = f"date, UTC, {years[0]}" if len(years) == 1 else "date, UTC"
    return Axis(title, ticks=dict(zip(days_marked.tolist(), texts, strict=True)))


def _level(changes: Sequence[ChangeResult], name: str, last_day: float) -> tuple[Array, Array]:
    """Return corners of the line, from 0 % on, that shows changes of drag or thrust: steps and drifts."""
    days = [(change.since_unix_s or 0.0) / DAY_S for change in changes]
    x, y, level = [], [], 0.0
    for change, since, until in zip(changes, days, [*days[1:], last_day], strict=True):
        after = level + getattr(change, f"{name}_percent")
        x += [since, since if change.shape is Shape.STEP else until, until]
        y += [level, after, after]
        level = after
    return np.array(x), np.array(y)


def curve_figure(fleet: FleetResults, curve: FleetCurveResult) -> Figure:
    """Draw every airframe's curve, the mean, and the power that another airframe will need."""
    figure = Figure(height_px=480, cursor=Cursor.NEAREST, x=true_airspeed())
    V, _, lo, hi = curve_arrays(curve.another)
    figure.add(band(V, (lo, hi), GRAY, 0.3))
    for airframe in (airframe for airframe in fleet.airframes if airframe.name in {*curve.airframes, *curve.changed}):
        color, kind = (ORANGE, "changed airframe") if airframe.changes else (BLUE, "airframe")
        V, P, _, _ = curve_arrays(airframe.power_required)
        figure.add(Line(x=V, y=P, name=kind, color=color, width=2, label=airframe.name, value="{y:.1f} W"))
    V, P, _, _ = curve_arrays(curve.mean)
    figure.add(Line(x=V, y=P, name="mean", color=INK, width=5, value="{y:.1f} W"))
    figure.y = Axis("power required", "W", from_zero=True)
    return figure
