"""Figures over time: the whole flight, the agreement of the sensors, and the fit of each run."""

from collections.abc import Sequence

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from plotly.subplots import make_subplots

from analysis.maneuvers.kinds import Maneuver
from analysis.report.figures.style import (
    BLUE,
    GREY,
    INK,
    PALETTE,
    POINTS_DRAWN,
    RED,
    RUN_COLOR,
    Array,
    rounded,
    styled,
)
from analysis.results.schema import RejectedResult
from analysis.trajectory.consistency import ANGLES, SPEED, Consistency

SHADE_OPACITY = {"acceleration": 0.16, "deceleration": 0.16, "steady": 0.22}
NOT_SHADED = ("standing", "flying")
TIME_TITLE = "time since the start of the log, s"
ROWS = (("V_mps", "speed, m/s", 1.0), ("height_m", "height, m", 1.0), ("n_revps", "motor, rpm", 60.0))


def timeline(table: pd.DataFrame, runs: Sequence[Maneuver], rejected: Sequence[RejectedResult] = ()) -> go.Figure:
    """Speed, height and motor speed of the whole flight; runs shaded by kind, rejected stretches outlined in grey."""
    figure = make_subplots(rows=len(ROWS), cols=1, shared_xaxes=True, vertical_spacing=0.05)
    thinned = table.iloc[:: max(1, len(table) // POINTS_DRAWN)]
    for i, (column, title, factor) in enumerate(ROWS, start=1):
        figure.add_scatter(
            x=rounded(thinned.index.to_numpy()),
            y=rounded(thinned[column].to_numpy() * factor),
            row=i,
            col=1,
            line={"color": INK, "width": 1.8},
            showlegend=False,
            name=title,
        )
        figure.update_yaxes(title=title, row=i, col=1)
    shaded = [run for run in runs if run.kind not in NOT_SHADED]
    figure.update_layout(shapes=_shades(shaded, rejected, len(ROWS)))
    in_legend = {run.kind: RUN_COLOR.get(run.kind, PALETTE[3]) for run in shaded}
    if rejected:
        in_legend["rejected"] = GREY
    for kind, color in in_legend.items():
        marker = {"color": color, "size": 14, "symbol": "square", "opacity": 0.6}
        figure.add_scatter(x=[None], y=[None], mode="markers", marker=marker, name=kind, row=1, col=1)
    figure.update_xaxes(title=TIME_TITLE, row=len(ROWS), col=1)
    return styled(figure, 620)


def _shades(runs: Sequence[Maneuver], rejected: Sequence[RejectedResult], rows: int) -> list[dict[str, object]]:
    """Rectangles for the layout, in each row. One list: `add_vrect` compares each shape with all earlier ones, which
    takes a minute for a long flight."""
    stretches: list[dict[str, object]] = [
        {"x0": run.start_s, "x1": run.end_s, "fillcolor": RUN_COLOR.get(run.kind, PALETTE[3]),
         "opacity": SHADE_OPACITY.get(run.kind, 0.18), "line": {"width": 0}}
        for run in runs
    ] + [
        {"x0": stretch.start_s, "x1": stretch.end_s, "fillcolor": "rgba(0,0,0,0.04)",
         "line": {"color": GREY, "width": 1.5, "dash": "dot"}}
        for stretch in rejected
    ]  # fmt: skip
    axes = ["" if i == 1 else str(i) for i in range(1, rows + 1)]
    places: list[dict[str, object]] = [
        {"type": "rect", "xref": f"x{i}", "yref": f"y{i} domain", "y0": 0, "y1": 1} for i in axes
    ]
    return [place | stretch for stretch in stretches for place in places]


def consistency(agreement: Consistency) -> go.Figure:
    """Differences between sensors that should be zero, before and after the correction of sensor errors and gusts."""
    degrees = float(np.degrees(1.0))
    rows = ((ANGLES, "θ - α - γ, deg", degrees), (SPEED, "V - GPS, m/s", 1.0))
    figure = make_subplots(rows=len(rows), cols=1, shared_xaxes=True, vertical_spacing=0.06)
    for i, (column, title, factor) in enumerate(rows, start=1):
        for name, differences, color in zip(("before", "after"), agreement, (GREY, BLUE), strict=True):
            thinned = differences[column].iloc[:: -(-len(differences) // POINTS_DRAWN)]
            figure.add_scatter(
                x=rounded(thinned.index.to_numpy()), y=rounded(factor * thinned.to_numpy()), mode="lines", row=i, col=1,
                line={"color": color, "width": 1.8}, name=name, legendgroup=name, showlegend=i == 1,
            )  # fmt: skip
        figure.add_hline(y=0, line={"color": INK, "width": 1}, row=i, col=1)
        figure.update_yaxes(title=title, row=i, col=1)
    figure.update_xaxes(title=TIME_TITLE, row=len(rows), col=1)
    return styled(figure, 520)


def run_fit(run: str, t_s: Array, measured: dict[str, Array], modelled: dict[str, Array]) -> go.Figure:
    """One run: measurement and fitted model on the left, their difference on the right."""
    figure = make_subplots(
        rows=len(measured), cols=2, shared_xaxes=True, vertical_spacing=0.04, horizontal_spacing=0.09,
        column_widths=[0.6, 0.4],
    )  # fmt: skip
    for i, quantity in enumerate(measured, start=1):
        difference = measured[quantity] - modelled[quantity]
        for column, values in ((1, measured[quantity]), (2, difference)):
            figure.add_scatter(
                x=rounded(t_s), y=rounded(values), mode="markers", row=i, col=column, marker={"size": 6, "color": GREY},
                name="measured", legendgroup="measured", showlegend=i == 1 and column == 1,
            )  # fmt: skip
        figure.add_scatter(
            x=rounded(t_s), y=rounded(modelled[quantity]), mode="lines", row=i, col=1, line={"color": RED, "width": 3},
            name="model", showlegend=i == 1,
        )  # fmt: skip
        figure.add_hline(y=0, row=i, col=2, line={"color": RED, "width": 3})
        figure.update_yaxes(title=quantity, row=i, col=1)
        figure.update_yaxes(title="difference", row=i, col=2)
    figure.update_xaxes(title=f"time, s ({run})", row=len(measured), col=1)
    figure.update_xaxes(title="time, s", row=len(measured), col=2)
    figure = styled(figure, 170 * len(measured) + 80)
    figure.update_layout(font={"size": 15})
    return figure
