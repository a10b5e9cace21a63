"""Figures over time: the whole flight, the agreement of the sensors, and the fit of each run."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from analysis.maneuvers.kinds import Maneuver
from analysis.report.figures.figure import Figure
from analysis.report.figures.style import (
    BLUE,
    GREY,
    INK,
    ORANGE,
    OTHER_RUN,
    RUN_COLOR,
    Array,
    rounded,
    styled,
    thinned,
)
from analysis.results.schema import RejectedResult
from analysis.trajectory.consistency import ANGLES, SPEED, Consistency

SHADE_OPACITY = {"acceleration": 0.16, "deceleration": 0.16, "steady": 0.22}
NOT_SHADED = ("standing", "flying")
TIME_TITLE = "time since the start of the log, s"
ROWS = (("V_mps", "speed, m/s", 1.0), ("height_m", "height, m", 1.0), ("n_revps", "motor, rpm", 60.0))


def timeline(table: pd.DataFrame, runs: Sequence[Maneuver], rejected: Sequence[RejectedResult] = ()) -> Figure:
    """Speed, height and motor speed of the whole flight; runs shaded by kind, rejected stretches outlined in grey."""
    figure = Figure(len(ROWS))
    t_s = table.index.to_numpy()
    for i, (column, title, factor) in enumerate(ROWS, start=1):
        x, y = thinned(t_s, table[column].to_numpy() * factor)
        figure.add_scatter(
            x=rounded(x), y=rounded(y), panel=i, mode="lines", line={"color": INK, "width": 1.8}, showlegend=False,
            name=title,
        )  # fmt: skip
        figure.update_yaxis(title=title, panel=i)
    shaded = [run for run in runs if run.kind not in NOT_SHADED]
    figure.update_layout(shapes=_shades(shaded, rejected))
    in_legend = {run.kind: RUN_COLOR.get(run.kind, OTHER_RUN) for run in shaded}
    if rejected:
        in_legend["rejected"] = GREY
    for kind, color in in_legend.items():
        marker = {"color": color, "size": 14, "symbol": "square", "opacity": 0.6}
        figure.add_scatter(x=[None], y=[None], mode="markers", marker=marker, name=kind)
    figure.update_xaxis(title=TIME_TITLE)
    return styled(figure, 620)


def _shades(runs: Sequence[Maneuver], rejected: Sequence[RejectedResult]) -> list[dict[str, object]]:
    """Rectangles across all panels."""
    stretches: list[dict[str, object]] = [
        {"x0": run.start_s, "x1": run.end_s, "fillcolor": RUN_COLOR.get(run.kind, OTHER_RUN),
         "opacity": SHADE_OPACITY.get(run.kind, 0.18), "line": {"width": 0}}
        for run in runs
    ] + [
        {"x0": stretch.start_s, "x1": stretch.end_s, "fillcolor": "rgba(0, 0, 0, 0.04)",
         "line": {"color": GREY, "width": 1.5, "dash": "dot"}}
        for stretch in rejected
    ]  # fmt: skip
    place: dict[str, object] = {"type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 1}
    return [place | stretch for stretch in stretches]


def consistency(agreement: Consistency) -> Figure:
    """Differences between sensors that should be zero, before and after the correction of sensor errors and gusts."""
    degrees = float(np.degrees(1.0))
    rows = ((ANGLES, "θ - α - γ, deg", degrees), (SPEED, "V - GPS, m/s", 1.0))
    figure = Figure(len(rows), 0.06)
    for i, (column, title, factor) in enumerate(rows, start=1):
        for name, differences, color in zip(("before", "after"), agreement, (GREY, BLUE), strict=True):
            x, y = thinned(differences.index.to_numpy(), factor * differences[column].to_numpy())
            figure.add_scatter(
                x=rounded(x), y=rounded(y), mode="lines", panel=i, name=name, legendgroup=name, showlegend=i == 1,
                line={"color": color, "width": 1.8},
            )  # fmt: skip
        figure.add_zero_line({"color": INK, "width": 1}, panel=i)
        figure.update_yaxis(title=title, panel=i)
    figure.update_xaxis(title=TIME_TITLE)
    return styled(figure, 520)


def run_fit(run: str, t_s: Array, measured: dict[str, Array], modelled: dict[str, Array]) -> list[Figure]:
    """One run: measurement and fitted model, and their difference beside them."""
    both, differences = Figure(len(measured), 0.04), Figure(len(measured), 0.04)
    point, model = {"size": 6, "color": GREY}, {"color": ORANGE, "width": 3}
    for i, quantity in enumerate(measured, start=1):
        difference = measured[quantity] - modelled[quantity]
        for figure, values in ((both, measured[quantity]), (differences, difference)):
            figure.add_scatter(
                x=rounded(t_s), y=rounded(values), mode="markers", panel=i, marker=point, name="measured",
                legendgroup="measured", showlegend=i == 1 and figure is both,
            )  # fmt: skip
        both.add_scatter(
            x=rounded(t_s), y=rounded(modelled[quantity]), mode="lines", panel=i, line=model, name="model",
            showlegend=i == 1,
        )  # fmt: skip
        differences.add_zero_line(model, panel=i)
        both.update_yaxis(title=quantity, panel=i)
        differences.update_yaxis(title="difference", panel=i)
    for figure in (both, differences):
        figure.update_xaxis(title=f"time, s ({run})" if figure is both else "time, s")
        styled(figure, 150 * len(measured) + 80)
        figure.update_layout(font={"size": 15})
    differences.update_layout(showlegend=False)
    return [both, differences]
