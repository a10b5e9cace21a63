"""Figures of several flights together, and of the comparison of two configurations."""

from collections.abc import Sequence

import numpy as np
from msgspec import Struct

from analysis.pooling.results import ComparisonResults, PooledFlight, PooledResults
from analysis.report.figures.style import (
    BLUE,
    GRAY,
    INK,
    ORANGE,
    PALETTE,
    RED,
    Array,
    Figure,
    add_band,
    curve_arrays,
    rounded,
    styled,
)
from analysis.schema import ElectricalFlight

ROW_PX = 24


def column(rows: Sequence[Struct], name: str) -> Array:
    return np.array([getattr(row, name) for row in rows], dtype=float)


def power_required(pooled: PooledResults) -> Figure:
    """The pooled curve with its 95 % interval, over those of the single flights."""
    V, P, lo, hi = curve_arrays(pooled.power_required)
    figure = Figure()
    if len(pooled.flights) > 1:
        x, y = [], []
        for flight in pooled.flights:
            speed = column(flight.against_pool, "speed_mps")
            power = np.interp(speed, V, P) * (1 + column(flight.against_pool, "difference_percent") / 100)
            x += [*speed, np.nan]
            y += [*power, np.nan]
        figure.add_scatter(
            x=rounded(np.array(x)), y=rounded(np.array(y)), mode="lines", name="each flight alone",
            line={"color": GRAY, "width": 2}, opacity=0.7, hoverinfo="skip", connectgaps=False,
        )  # fmt: skip
    add_band(figure, V, (lo, hi), BLUE, 0.35)
    outside = np.array([point.extrapolated for point in pooled.power_required])
    for flag, dash in ((~outside, "solid"), (outside, "9px,6px")):
        if flag.any():
            figure.add_scatter(
                x=rounded(V), y=rounded(np.where(flag, P, np.nan)), mode="lines", name="power required, all flights",
                line={"color": BLUE, "width": 3, "dash": dash}, hovertemplate="%{y:.1f} W",
                showlegend=dash == "solid" or bool(outside.all()),
            )  # fmt: skip
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power, W", range=[0, 1.12 * float(np.max(hi))])
    return styled(figure, 400)


def half_widths(pooled: PooledResults, best: PooledFlight) -> Figure:
    """Half width of the 95 % interval against speed: the best flight alone, all flights, and one flight more."""
    more = pooled.one_more
    V = np.array(more.speed_mps)
    figure = Figure()
    for values, name, color, dash in (
        (best.half_width_percent, f"best flight alone, {best.log}", GRAY, "dot"),
        (more.half_width_percent, "all flights", BLUE, "solid"),
        (more.half_width_then_percent, "one flight more", ORANGE, "dash"),
    ):
        figure.add_scatter(
            x=rounded(V), y=rounded(np.array(values)), mode="lines", name=name,
            line={"color": color, "width": 4, "dash": dash}, hovertemplate="±%{y:.1f} %",
        )  # fmt: skip
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="± % of power", rangemode="tozero")
    return styled(figure, 360)


def against_pool(flights: Sequence[PooledFlight], at: int) -> Figure:
    """Each flight's power minus the pooled one at one speed, with the limits that its errors allow."""
    figure = Figure()
    names = [flight.log for flight in flights]
    for outlier, color, name in ((False, BLUE, "flight"), (True, RED, "outlier")):
        chosen = [flight for flight in flights if flight.outlier == outlier]
        if not chosen:
            continue
        points = [flight.against_pool[at] for flight in chosen]
        figure.add_scatter(
            x=rounded(column(points, "difference_percent")), y=[flight.log for flight in chosen],
            error_x={"array": rounded(column(points, "limit_percent")), "thickness": 2, "width": 4},
            mode="markers", name=name, marker={"color": color, "size": 10, "symbol": "x" if outlier else "circle"},
            hovertemplate="%{y}: %{x:+.1f} %",
        )  # fmt: skip
    figure.update_xaxis(title="power minus that of all flights, %")
    figure.update_yaxis(
        categoryorder="array", categoryarray=names[::-1], range=[-0.7, len(names) - 0.3], automargin=True,
        tickfont={"size": 14},
    )  # fmt: skip
    figure = styled(figure, 110 + ROW_PX * max(3, len(flights)), hover="closest")
    figure.update_xaxis(zeroline=True, zerolinecolor=INK, zerolinewidth=2)
    return figure


def electrical_power(flights: Sequence[ElectricalFlight]) -> Figure:
    """The electrical power of each flight at its own weight and density."""
    figure = Figure()
    for i, flight in enumerate(flights):
        V, P, _, _ = curve_arrays(flight.electrical_power)
        figure.add_scatter(
            x=rounded(V), y=rounded(P), mode="lines", name=flight.log, showlegend=len(flights) <= len(PALETTE),
            line={"color": PALETTE[i % len(PALETTE)], "width": 3}, hovertemplate="%{y:.0f} W",
        )  # fmt: skip
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power from the battery, W", rangemode="tozero")
    return styled(figure, 480, hover="closest")


def difference(comparison: ComparisonResults) -> Figure:
    """Power of B minus that of A against speed, with its 95 % interval."""
    rows = comparison.differences
    V, d, lo, hi = (column(rows, name) for name in ("speed_mps", "difference_percent", "lo_percent", "hi_percent"))
    figure = Figure()
    add_band(figure, V, (lo, hi), BLUE, 0.3)
    figure.add_scatter(
        x=rounded(V), y=rounded(d), mode="lines", name="B minus A", line={"color": BLUE, "width": 5},
        hovertemplate="%{y:+.1f} %", showlegend=False,
    )  # fmt: skip
    figure.add_zero_line({"color": INK, "width": 2})
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="% of the power of A")
    return styled(figure, 400)
