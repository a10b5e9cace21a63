"""The page of several flights together, or of two configurations, from their pooled results.json (pooling.md)."""

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import NamedTuple
from urllib.parse import quote

import numpy as np
from msgspec import Struct

from flightpower.analysis.flights.evidence import vehicle_notes
from flightpower.analysis.pages.answers import HeadlineAnswer, headline_answers
from flightpower.analysis.pages.charts.figure import Axis, Bars, Cursor, Dash, Figure, Line, Points, Symbol
from flightpower.analysis.pages.charts.power import efficiency, loadings
from flightpower.analysis.pages.charts.style import (
    BLUE,
    GRAY,
    GREEN,
    ORANGE,
    PALETTE,
    RED,
    band,
    curve_arrays,
    curve_lines,
    true_airspeed,
)
from flightpower.analysis.pages.html_page import HtmlTable, html_figure, render_page
from flightpower.analysis.pages.sections.performance import autopilot_section, performance_section
from flightpower.analysis.pages.wording import every, meaning, verdict
from flightpower.analysis.records.flight import ConditionResult, Kind, Results, Trust
from flightpower.analysis.records.pool import (
    Agreement,
    AgreementTest,
    ComparisonResults,
    Configuration,
    FlightsToSee,
    PooledFlight,
    PooledResults,
    PowerDifference,
    Scatter,
    SharedParameter,
    Trend,
    TrendQuantity,
    of_each_kind,
)
from flightpower.analysis.settings import EVIDENCE
from flightpower.flight.arrays import Array
from flightpower.flight.units import DAY_S, GRAVITY_MPS2


class FlightRow(NamedTuple):
    date: str
    name: str
    link: str
    vehicle: str
    weight: str
    density: str
    alone: str
    share: str
    remark: str


_PREFIXES = ("", "other-")  # prefixes of the figures' ids, by kind of power


def left_out_lines(results: PooledResults | Configuration) -> list[str]:
    """Return a line for each flight that is left out."""
    return [f"{flight.log}: {flight.text}" for flight in results.left_out]


def render_pooled(pooled: PooledResults) -> str:
    """Return the page as one HTML file."""
    return render_page(
        "pooled.html",
        title=_pooled_title(pooled),
        pools=[_pool_section(*section) for section in zip(of_each_kind(pooled), _PREFIXES, strict=False)],
        source=f"flightpower {pooled.software_version}, from the {count(len(pooled.flights), 'flight')} listed",
    )


def _pooled_title(pooled: PooledResults) -> str:
    return f"{pooled.aircraft.title}: {pooled.kind.words}, {count(len(pooled.flights), 'flight')}"


def _pool_section(pooled: PooledResults, prefix: str) -> dict[str, object]:
    """Return the template's data for the pool by one kind of power. prefix: of the figures' ids"""
    flights = by_date(pooled.flights)
    best = min(flights, key=lambda flight: np.nanmean(_numbers(flight.half_width_percent)))
    more, middle = pooled.one_more, len(pooled.one_more.speed_mps) // 2
    figures: dict[str, Figure | Sequence[Figure]] = {
        "power": pooled_power(pooled),
        "half_widths": half_widths(pooled, best),
    }
    if pooled.performance:
        figures |= {"loadings": loadings(pooled.performance), "efficiency": efficiency(pooled.performance)}
    if len(flights) > 1:
        figures |= {"against_pool": against_pool(flights), "weights": weights(flights)}
    return {
        "title": _pooled_title(pooled),
        "condition": _condition(pooled.test, pooled.aircraft.propeller, pooled.installation),
        "verdict": verdict(pooled.trust, pooled.evidence),
        "answers": [*headline_answers(pooled, pooled.performance), *pooled_answers(pooled)],
        "performance": performance_section(pooled, pooled.performance),
        "autopilot": autopilot_section(pooled),
        "figures": {name: html_figure(figure, prefix + name) for name, figure in figures.items()},
        "warnings": pooled.notes,
        "curve": curve_table(pooled),
        "one_more": (
            f"One more flight means another one like {more.like}, which contributed most. The best flight alone"
            f" is {best.log}."
        ),
        "same": "the same aircraft" if pooled.kind is Kind.ELECTRICAL else "the same installation of the probe",
        "to_see": to_see_table(pooled.flights_to_see),
        "agreement": [test.text for test in (pooled.homogeneity, pooled.installation_homogeneity) if test],
        "compared_at": f"{more.speed_mps[middle]:.1f} m/s",
        "scatter": _scatter(pooled.between_flights),
        "trends": _trends(pooled.trends),
        "flights": [_flight_row(flight) for flight in flights],
        "vehicles": any(flight.vehicle for flight in flights),
        "left_out": [*left_out_lines(pooled), *pooled.failures],
        "parameters": _parameters(pooled.parameters),
    }


def render_side_by_side(flights: Sequence[Results], refused: str, failures: Sequence[str]) -> str:
    """Return the page of flights that cannot be pooled, with their curves side by side. refused: why"""
    return render_page(
        "side_by_side.html",
        title=f"{flights[0].kind.words.capitalize()} of level flight, {count(len(flights), 'flight')}",
        refused=refused,
        figures={"power": html_figure(side_by_side(flights), "power")},
        warnings=vehicle_notes(flights),
        flights=[_result_row(flight) for flight in flights],
        left_out=failures,
        source=f"flightpower {flights[0].software_version}, from the {count(len(flights), 'flight')} listed",
    )


def _result_row(flight: Results) -> tuple[str, ...]:
    """Return link, name, aircraft, autopilot, weight, least power and its speed."""
    least = min(flight.main.points, key=lambda point: point.power_W)
    return (
        f"{quote(flight.log)}/report.html",
        flight.log,
        flight.aircraft.title,
        flight.vehicle or "–",
        f"{flight.test.weight_N / GRAVITY_MPS2:.2f} kg",
        f"{least.power_W:.0f} ({least.power_lo_W:.0f} to {least.power_hi_W:.0f})",
        f"{least.speed_mps:.1f}",
    )


def render_comparison(comparison: ComparisonResults) -> str:
    """Return the page of a comparison as one HTML file, from the content of its results.json."""
    return render_page(
        "comparison.html",
        title=_comparison_title(comparison),
        comparisons=[
            _comparison_section(*section) for section in zip(of_each_kind(comparison), _PREFIXES, strict=False)
        ],
        source=f"flightpower {comparison.software_version}",
    )


def _comparison_title(comparison: ComparisonResults) -> str:
    return f"{comparison.b.name} against {comparison.a.name}: {comparison.kind.words}"


def _comparison_section(comparison: ComparisonResults, prefix: str) -> dict[str, object]:
    """Return the template's data for the comparison by one kind of power. prefix: of the figure's id"""
    return {
        "title": _comparison_title(comparison),
        "condition": _condition(comparison.test, "", ""),
        "text": comparison.text,
        "verdict": verdict(comparison.trust, comparison.evidence),
        "warnings": comparison.notes,
        "answers": comparison_answers(comparison),
        "figure": html_figure(difference(comparison), f"{prefix}difference"),
        "differences": differences_table(comparison.differences),
        "sides": HtmlTable(
            ("", "aircraft", "propeller", "installation", "flights"),
            [_side("A", comparison.a), _side("B", comparison.b)],
        ),
        "left_out": [*left_out_lines(comparison.a), *left_out_lines(comparison.b)],
        "to_see": to_see_table(comparison.flights_to_see),
    }


def pooled_answers(pooled: PooledResults) -> list[HeadlineAnswer]:
    """Say how certain the curve is, whether the flights agree, what one more flight gains, and how many flights a
    comparison needs."""
    points = pooled.main.points
    shares = [50 * (p.power_hi_W - p.power_lo_W) / p.power_W for p in points]
    least, most = int(np.argmin(shares)), int(np.argmax(shares))
    more = pooled.one_more
    worst = int(np.argmax(more.half_width_percent))
    answers = [
        HeadlineAnswer(
            "Certainty of the curve",
            f"±{shares[least]:.1f} to ±{shares[most]:.1f} %",
            f"Best at {points[least].speed_mps:.1f} m/s, worst at {points[most].speed_mps:.1f} m/s (95 % interval).",
        )
    ]
    curves, installations = pooled.homogeneity, pooled.installation_homogeneity
    if pooled.agreement and curves:
        outliers = ", ".join(outlier.log for outlier in pooled.outliers)
        named = f"Outliers: {outliers}. " if outliers else ""
        all_but = outliers and pooled.agreement is Agreement.NOT_THE_CURVES
        answers.append(
            HeadlineAnswer(
                "Agreement of the flights",
                f"all but {outliers}" if all_but else pooled.agreement,
                f"{named}Probability that the known errors alone make differences this large: for the curves"
                f" {probability(curves.p)}{_of_installation(installations)}.",
            )
        )
    answers.append(
        HeadlineAnswer(
            "With one more flight",
            f"±{more.half_width_then_percent[worst]:.1f} % instead of ±{more.half_width_percent[worst]:.1f} %",
            f"At {more.speed_mps[worst]:.1f} m/s, if it is like {more.like}.",
        )
    )
    for flight in pooled.flights_to_see:
        if flight.difference_percent == 2:
            answers.append(
                HeadlineAnswer("To see a change of 2 %", _flights_each(flight), "For each of the two configurations.")
            )
    return answers


def _of_installation(test: AgreementTest | None) -> str:
    return f", for the installation {probability(test.p)}" if test else ""


def comparison_answers(comparison: ComparisonResults) -> list[HeadlineAnswer]:
    """Say whether the two differ, and by how much at the speed where that is clearest, or else best known."""
    best = comparison.quoted
    half_width, independent = (best.hi_percent - best.lo_percent) / 2, best.independent_half_width_percent
    cancels = f" If shared errors did not cancel: ±{independent:.1f} %." if independent > half_width else ""
    return [
        HeadlineAnswer(
            "Difference",
            "yes" if comparison.differs else "not seen",
            f"Probability of a difference this large by errors alone: {probability(comparison.p)}.",
        ),
        HeadlineAnswer(
            "Clearest difference" if best.excludes_zero else "Difference where it is known best",
            f"{best.difference_percent:+.1f} % ({best.lo_percent:+.1f} to {best.hi_percent:+.1f})",
            f"B minus A at {best.speed_mps:.1f} m/s.{cancels}",
        ),
    ]


def curve_table(pooled: PooledResults, rows: int = 12) -> HtmlTable:
    """Return about `rows` points of the pooled curve."""
    return HtmlTable(
        ("speed, m/s", "power, W", "95 % interval, W", "± %"),
        [
            (
                f"{p.speed_mps:.1f}",
                f"{p.power_W:.1f}",
                f"{p.power_lo_W:.1f} to {p.power_hi_W:.1f}",
                f"{50 * (p.power_hi_W - p.power_lo_W) / p.power_W:.1f}",
            )
            for p in every(pooled.main.points, rows)
        ],
        numbers=True,
    )


def differences_table(rows: Sequence[PowerDifference], most: int = 12) -> HtmlTable:
    """Return about `most` rows of a comparison."""
    return HtmlTable(
        ("speed, m/s", "A, W", "B, W", "B minus A, %", "95 % interval, %"),
        [
            (
                f"{row.speed_mps:.1f}",
                f"{row.power_a_W:.1f}",
                f"{row.power_b_W:.1f}",
                f"{row.difference_percent:+.1f}",
                f"{row.lo_percent:+.1f} to {row.hi_percent:+.1f}",
            )
            for row in every(rows, most)
        ],
        numbers=True,
    )


def to_see_table(rows: Sequence[FlightsToSee]) -> HtmlTable:
    return HtmlTable(
        ("difference of power", "flights of each"),
        [(f"{row.difference_percent:g} %", _flights_each(row)) for row in rows],
        numbers=True,
    )


def count(number: int, noun: str) -> str:
    """Return text such as "1 flight" or "12 flights"."""
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"


def probability(p: float) -> str:
    """Return text such as "p = 0.62" or "p below 0.0001"."""
    return "p below 0.0001" if p < 1e-4 else f"p = {p:.2g}"


def _condition(test: ConditionResult, propeller: str, installation: str) -> str:
    parts = [f"{test.weight_N / GRAVITY_MPS2:.2f} kg", f"air {test.air_density_kgpm3:.3f} kg/m³"]
    if propeller:
        parts.append(f"propeller {propeller}")
    if installation:
        parts.append(f"installation {installation}")
    return ", ".join(parts)


def _flights_each(row: FlightsToSee) -> str:
    return count(row.flights_each, "flight") if row.flights_each else f"more than {EVIDENCE.most_repetitions}"


def _side(letter: str, side: Configuration) -> tuple[str, ...]:
    aircraft = side.aircraft
    return (
        f"{letter}: {side.name}",
        aircraft.title,
        aircraft.propeller,
        side.installation or "none named",
        ", ".join(side.logs),
    )


def _scatter(rows: Sequence[Scatter]) -> HtmlTable:
    return HtmlTable(
        ("speed, m/s", "observed, %", "explained, %", "excess, %"),
        [
            tuple(
                f"{number:.1f}"
                for number in (row.speed_mps, row.observed_percent, row.expected_percent, row.excess_percent)
            )
            for row in rows
        ],
        numbers=True,
    )


def _trends(rows: Sequence[Trend]) -> HtmlTable:
    return HtmlTable(
        ("power against", "flown from", "to", "change of power", "standard error", "flights", ""),
        [
            (
                row.quantity,
                *_range(row),
                *_percent_or_unknown(row),
                str(row.flights),
                f"{'a trend' if row.p < EVIDENCE.false_alarms else 'none seen'} ({probability(row.p)})",
            )
            for row in rows
        ],
    )


def _percent_or_unknown(row: Trend) -> tuple[str, str]:
    """Return change and standard error, unless the standard error exceeds 100 % of power."""
    error = row.standard_error_percent
    if error > 100:
        return "not known", "more than 100 %"
    return f"{row.change_percent:+.1f} %", f"{error:.1f} %"


def _range(row: Trend) -> tuple[str, str]:
    if row.quantity == TrendQuantity.DATE:
        days = [datetime.fromtimestamp(DAY_S * value, UTC) for value in (row.lowest, row.highest)]
        return f"{days[0]:%Y-%m-%d %H:%M} UTC", f"{days[1]:%Y-%m-%d %H:%M} UTC"
    return f"{row.lowest:.1f} {row.unit}", f"{row.highest:.1f} {row.unit}"


def _flight_row(flight: PooledFlight) -> FlightRow:
    half = [share for share in flight.half_width_percent if share is not None]
    remarks = [
        *([flight.trust] if flight.trust is not Trust.TRUSTED else []),
        *([f"outlier: {flight.reason}"] if flight.outlier else []),
        *(["treated as remounted"] if flight.mounted_anew else []),
    ]
    return FlightRow(
        date=date_text(flight.start_unix_s) or "–",
        name=flight.log,
        link=f"{quote(flight.log)}/report.html",
        vehicle=flight.vehicle or "–",
        weight=f"{flight.test.weight_N / GRAVITY_MPS2:.2f} kg",
        density=f"{flight.test.air_density_kgpm3:.3f} kg/m³",
        alone=f"{min(half):.1f} to {max(half):.1f}" if half else "–",
        share=f"{100 * flight.share_of_information:.0f} %",
        remark="; ".join(remarks),
    )


def date_text(unix_s: float | None, form: str = "%Y-%m-%d %H:%M") -> str:
    """Return day and time in UTC; empty if they are not known."""
    return "" if unix_s is None else datetime.fromtimestamp(unix_s, UTC).strftime(form)


def _numbers(values: Sequence[float | None]) -> Array:
    """Return numbers (n,), NaN where one is missing."""
    return np.array(values, dtype=float)


def _parameters(rows: Sequence[SharedParameter]) -> HtmlTable:
    cells = []
    for row in rows:
        in_deg = row.unit == "rad"
        value, error = (float(np.degrees(number)) if in_deg else number for number in (row.value, row.standard_error))
        decimals = max(0, 1 - int(np.floor(np.log10(error)))) if error > 0 else 6
        unit = "deg" if in_deg else row.unit
        cells.append((meaning(row.name), f"{value:+.{decimals}f}", f"{error:.{decimals}f}", unit))
    return HtmlTable(("quantity", "estimate", "standard error", "unit"), cells, numbers=True)


def column(rows: Sequence[Struct], name: str) -> Array:
    return np.array([getattr(row, name) for row in rows], dtype=float)


def pooled_power(pooled: PooledResults) -> Figure:
    """Draw the pooled curve with its 95 % interval over the curves of the single flights."""
    points = pooled.main.points
    V, P, lo, hi = curve_arrays(points)
    figure = Figure(x=true_airspeed())
    if len(pooled.flights) > 1:
        x, y = [], []
        for flight in pooled.flights:
            speed = column(flight.against_pool, "speed_mps")
            power = np.interp(speed, V, P) * (1 + column(flight.against_pool, "difference_percent") / 100)
            x += [*speed, np.nan]
            y += [*power, np.nan]
        figure.add(
            Line(x=np.array(x), y=np.array(y), name="each flight alone", color=GRAY, width=2, opacity=0.7, value="")
        )
    name = f"{pooled.kind.words}, all flights"
    figure.add(band(V, (lo, hi), BLUE, 0.35, name=name), *curve_lines(points, name, BLUE, width=3))
    figure.y = Axis("power", "W", limits=(0, 1.12 * float(np.max(hi))))
    return figure


def half_widths(pooled: PooledResults, best: PooledFlight) -> Figure:
    """Draw the half width of the 95 % interval against speed: the best flight alone, all flights, and with one more."""
    more = pooled.one_more
    figure = Figure(height_px=360, x=true_airspeed())
    for values, name, color, dash in (
        (best.half_width_percent, f"best flight alone, {best.log}", GRAY, Dash.DOTTED),
        (more.half_width_percent, "all flights", BLUE, Dash.SOLID),
        (more.half_width_then_percent, "one flight more", ORANGE, Dash.DASHED),
    ):
        figure.add(
            Line(
                x=np.array(more.speed_mps), y=_numbers(values), name=name, color=color, width=4, dash=dash,
                value="±{y:.1f} %",
            )
        )  # fmt: skip
    figure.y = Axis("± % of power", from_zero=True)
    return figure


def by_date(flights: Sequence[PooledFlight]) -> list[PooledFlight]:
    """Sort flights by date; undated flights come last, in their given order."""
    return sorted(flights, key=lambda flight: np.inf if flight.start_unix_s is None else flight.start_unix_s)


def row_name(flight: PooledFlight) -> str:
    """Return date and log."""
    return f"{date_text(flight.start_unix_s, '%Y-%m-%d')} {flight.log}".strip()


def against_pool(flights: Sequence[PooledFlight]) -> Figure:
    """Draw each flight's power minus the pooled power in percent of it, with a row per flight in order of date: at the
    middle speed with the limits that its errors allow, and at the slowest and the fastest speed."""
    ordered = by_date(flights)
    figure = _rows([row_name(flight) for flight in ordered], Axis("power minus the power of all flights", "%"))
    speeds = [point.speed_mps for point in ordered[0].against_pool]
    middle = len(speeds) // 2
    for field, color, symbol in (
        (0, GREEN, Symbol.LEFT),
        (middle, BLUE, Symbol.CIRCLE),
        (len(speeds) - 1, ORANGE, Symbol.DIAMOND),
    ):
        points = [flight.against_pool[field] for flight in ordered]
        difference, limit = (column(points, name) for name in ("difference_percent", "limit_percent"))
        for y, flight, d, most in zip(_heights(ordered), ordered, difference, limit, strict=True):
            if np.isnan(d):  # the flight did not reach this speed
                continue
            figure.add(
                Points(
                    x=np.array([d]), y=np.array([y]), name=f"{speeds[field]:.1f} m/s", label=row_name(flight), size=10,
                    color=RED if flight.outlier else color, symbol=Symbol.CROSS if flight.outlier else symbol,
                    x_ends=np.array([[d - most], [d + most]]) if field == middle else None, value="{x:+.1f} %",
                )
            )  # fmt: skip
    figure.zero_column = True
    return figure


def weights(flights: Sequence[PooledFlight]) -> Figure:
    """Draw each flight's share in the information of all flights in percent, in order of date."""
    ordered = by_date(flights)
    figure = _rows([row_name(flight) for flight in ordered], Axis("share of information", "%", from_zero=True))
    for y, flight in zip(_heights(ordered), ordered, strict=True):
        share = np.array([100 * flight.share_of_information])
        figure.add(
            Bars(x=share, y=np.array([y]), width=0.7, lying=True, color=BLUE, label=row_name(flight), value="{x:.0f} %")
        )
    return figure


def _heights(rows: Sequence[object]) -> list[float]:
    """Return the heights of the rows, the first at the top."""
    return [float(row) for row in range(len(rows))][::-1]


def _rows(names: list[str], x: Axis) -> Figure:
    """Return an axis with a row for each name, the first at the top."""
    longest = max(map(len, names), default=0)
    figure = Figure(
        height_px=110 + 24 * max(3, len(names)), left_px=min(24 + 8 * longest, 280), rows=True,
        cursor=Cursor.NEAREST, x=x,
    )  # fmt: skip
    ticks = dict(zip(_heights(names), names, strict=True))
    figure.y = Axis(limits=(-0.7, len(names) - 0.3), ticks=ticks)
    return figure


def side_by_side(flights: Sequence[Results]) -> Figure:
    """Draw the curve of each flight at its own weight and density."""
    figure = Figure(height_px=480, cursor=Cursor.NEAREST, x=true_airspeed())
    named = len(flights) <= len(PALETTE)  # more names would fill the page
    for i, flight in enumerate(flights):
        V, P, _, _ = curve_arrays(flight.main.points)
        figure.add(
            Line(
                x=V, y=P, name=flight.log if named else "", label=flight.log, color=PALETTE[i % len(PALETTE)], width=3,
                value="{y:.0f} W",
            )
        )  # fmt: skip
    figure.y = Axis(flights[0].kind.words, "W", from_zero=True)
    return figure


def difference(comparison: ComparisonResults) -> Figure:
    """Draw power of A and B against speed, and below it B minus A in percent of A with its 95 % interval."""
    rows = comparison.differences
    V, d, lo, hi = (column(rows, name) for name in ("speed_mps", "difference_percent", "lo_percent", "hi_percent"))
    figure = Figure(2, height_px=600, x=true_airspeed())
    for side, name, color, dash in (("a", f"A: {comparison.a.name}", GRAY, Dash.DASHED),
                                    ("b", f"B: {comparison.b.name}", BLUE, Dash.SOLID)):  # fmt: skip
        power = column(rows, f"power_{side}_W")
        figure.add(Line(x=V, y=power, name=name, color=color, width=4, dash=dash, value="{y:.1f} W"))
    figure.add(
        band(V, (lo, hi), ORANGE, 0.3, panel=2, name="B minus A"),
        Line(panel=2, x=V, y=d, name="B minus A", color=ORANGE, width=4, value="{y:+.1f} %"),
    )
    figure.zero_lines.add(2)
    most = max(*column(rows, "power_a_W"), *column(rows, "power_b_W"))
    figure.ys = [Axis(comparison.kind.words, "W", limits=(0, 1.12 * most)), Axis("B minus A", "%")]
    return figure
