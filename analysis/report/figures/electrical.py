"""Figures of the electrical power of level flight, of the flight, and of the energy balance."""

import numpy as np
from numpy.typing import NDArray

from analysis.electrical.estimate import ElectricalEstimate
from analysis.electrical.flight_table import FlightTable
from analysis.report.figures.style import (
    BLUE,
    GRAY,
    INK,
    Figure,
    add_band,
    add_curve,
    curve_arrays,
    rounded,
    styled,
    thinned,
)
from analysis.schema import Results

TIME_TITLE = "time since the start of the log, s"


def electrical_power(results: Results, estimate: ElectricalEstimate) -> Figure:
    """Electrical power against airspeed with its 95 % interval, and the flight's moments reduced to level flight."""
    figure = Figure()
    V, _, lo, hi = curve_arrays(results.electrical_power)
    add_band(figure, V, (lo, hi), BLUE, 0.3)
    figure.add_scatter(
        x=rounded(estimate.measured_V_mps),
        y=rounded(estimate.measured_W),
        mode="markers",
        marker={"color": GRAY, "size": 7, "opacity": 0.6},
        name="the flight, reduced to level flight",
        hovertemplate="%{y:.0f} W",
    )
    add_curve(figure, results.electrical_power, "electrical power", BLUE, width=5)
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power, W", range=[0, 1.2 * float(np.max(hi))])
    return styled(figure, 420, hover="closest")


def flight(table: FlightTable, V_mps: NDArray[np.float64]) -> Figure:
    """Airspeed, height and electrical power of the whole log; the part used is shaded."""
    rows = (
        (V_mps, "airspeed, m/s"),
        (table.table["height_m"].to_numpy(), "height, m"),
        (table.table["power_W"].to_numpy(), "power, W"),
    )
    figure = Figure(len(rows))
    t_s = table.table.index.to_numpy()
    for i, (values, title) in enumerate(rows, start=1):
        x, y = thinned(t_s, values)
        figure.add_scatter(
            x=rounded(x), y=rounded(y), panel=i, mode="lines", line={"color": INK, "width": 1.8}, showlegend=False,
            name=title,
        )  # fmt: skip
        figure.update_yaxis(title=title, panel=i)
    figure.update_layout(
        shapes=[
            {
                "type": "rect", "xref": "x", "yref": "paper", "x0": t_s[part.start], "x1": t_s[part.stop - 1],
                "y0": 0, "y1": 1, "fillcolor": BLUE, "opacity": 0.12, "line": {"width": 0}, "layer": "below",
            }
            for part in table.airborne
        ]
    )  # fmt: skip
    figure.update_xaxis(title=TIME_TITLE)
    return styled(figure, 620)


def residuals(estimate: ElectricalEstimate) -> Figure:
    """The energy balance's residuals over time."""
    figure = Figure()
    figure.add_scatter(
        x=rounded(estimate.time_s), y=rounded(estimate.residual_W), mode="lines+markers",
        line={"color": BLUE, "width": 2}, name="residual", hovertemplate="%{y:.0f} W",
    )  # fmt: skip
    figure.update_xaxis(title=TIME_TITLE)
    figure.update_yaxis(title="residual, W")
    return styled(figure, 320)
