"""Figures that compare the methods, and the runs fitted one by one."""

import numpy as np

from analysis.report.figures.figure import Figure
from analysis.report.figures.measured_points import add_measured_points
from analysis.report.figures.style import (
    OTHER_RUN,
    PALETTE,
    RUN_COLOR,
    SYMBOLS,
    add_band,
    add_curve,
    curve_arrays,
    rounded,
    styled,
)
from analysis.report.method_list import capitalized_title, listed_methods
from analysis.results.schema import MethodResult, Results

INTERVALS_SHOWN = 4  # of each curve
ALL_RUNS_COLOR = PALETTE[5]


def every_method(results: Results) -> Figure:
    """The curve of every method; bars are its 95 % interval, circles the points it measured."""
    figure = Figure()
    drawn = [method for method in listed_methods(results) if method.power_required]
    V, _, lo, hi = curve_arrays(results.power_required)
    add_band(figure, V, lo, hi, PALETTE[0], 0.25, legendgroup=capitalized_title(drawn[0]))
    for i, method in reversed(list(enumerate(drawn))):  # the first one on top
        color, title = PALETTE[i % len(PALETTE)], capitalized_title(method)
        symbol = "" if i == 0 else SYMBOLS[i % len(SYMBOLS)]
        add_curve(figure, method.power_required, title, color, 5 if i == 0 else 2.5, symbol)
        if i > 0:
            _add_interval_bars(figure, method, color, (i - 0.5) / len(drawn))
        if method.points:
            add_measured_points(figure, method, color, title, in_legend=False)
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power required, W", range=[0, 1.3 * float(np.max(hi))])
    figure = styled(figure, 640 + 13 * len(drawn), hover="closest")
    legend = {"traceorder": "reversed", "y": -0.16, "yanchor": "top"}
    figure.update_layout(legend=legend, margin={"b": 120})
    return figure


def _add_interval_bars(figure: Figure, method: MethodResult, color: str, offset: float) -> None:
    """The interval of a method at a few speeds. offset: 0 to 1, shifts the bars so that methods do not overlap."""
    V, P, lo, hi = curve_arrays(method.power_required)
    at = V[0] + (V[-1] - V[0]) * (np.arange(INTERVALS_SHOWN) + offset) / INTERVALS_SHOWN
    value, low, high = (np.interp(at, V, values) for values in (P, lo, hi))
    figure.add_scatter(
        x=rounded(at),
        y=rounded(value),
        error_y={"symmetric": False, "array": rounded(high - value), "arrayminus": rounded(value - low), "width": 5},
        mode="markers",
        marker={"color": color, "size": 3},
        legendgroup=capitalized_title(method),
        showlegend=False,
        hoverinfo="skip",
    )


def run_by_run(results: Results) -> Figure:
    """The curve of every run fitted alone, over the curve of all runs."""
    figure = Figure()
    V, _, lo, hi = curve_arrays(results.power_required)
    add_band(figure, V, lo, hi, ALL_RUNS_COLOR, 0.3)
    add_curve(figure, results.power_required, "all runs", ALL_RUNS_COLOR, 5)
    in_legend = set()
    for run in results.one_by_one:
        if run.power_required:
            kind = next((kind for kind in RUN_COLOR if kind in run.title), "run")
            V, P, _, _ = curve_arrays(run.power_required)
            figure.add_scatter(
                x=rounded(V), y=rounded(P), mode="lines", line={"color": RUN_COLOR.get(kind, OTHER_RUN), "width": 2},
                name=kind, legendgroup=kind, showlegend=kind not in in_legend,
                hovertemplate=f"{run.title}: %{{y:.1f}} W<extra></extra>",
            )  # fmt: skip
            in_legend.add(kind)
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="power required, W", range=[0, 1.3 * float(np.max(hi))])
    return styled(figure, 460, hover="closest")
