"""Figures of an estimation: its convergence, and the correlation of its estimates."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from analysis.estimation.fit import Convergence
from analysis.report.figures.figure import Figure
from analysis.report.figures.style import BLUE, GRID, INK, ORANGE, PAPER, RED, Array, styled, translucent
from analysis.results.schema_provenance import Correlation

LINES = ((BLUE, "circle"), (ORANGE, "square"))
MOST_TICKS = 7  # of iterations
DEEPEST = 0.5  # opacity of the color of a correlation of 1: text is read on it
ROW_PX, MARGIN_PX = 54, 80


def convergence(histories: Mapping[str, Convergence]) -> Figure:
    """Cost above its last value, and length of the step, over the iterations of each estimation (at most two)."""
    figure = Figure(2, 0.08)
    for (name, history), (color, symbol) in zip(histories.items(), LINES, strict=False):
        costs = np.array(history.costs)
        for panel, first, values in ((1, 0, costs[:-1] - costs[-1]), (2, 1, np.array(history.steps))):
            figure.add_scatter(
                x=np.arange(first, first + len(values)), y=_for_logarithm(values), mode="lines+markers", panel=panel,
                name=name, legendgroup=name, showlegend=panel == 1, line={"color": color, "width": 2},
                marker={"symbol": symbol, "size": 8},
            )  # fmt: skip
    longest = max(len(history.steps) for history in histories.values())
    figure = styled(figure, 500)
    figure.update_yaxis(title="cost above the last")
    figure.update_yaxis(title="step, std. errors", panel=2)
    figure.update_yaxes(type="log", exponentformat="e", nticks=5)
    figure.update_xaxis(title="iteration", dtick=-(-longest // MOST_TICKS), range=[-0.4, longest + 0.4])
    return figure


def _for_logarithm(values: Array) -> Array:
    """Values to four significant digits; NaN where they are not positive."""
    return np.array([float(f"{value:.4g}") if value > 0 else np.nan for value in values])


def correlation(correlation: Correlation) -> Figure:
    """The matrix as colored cells with their values: blue where two errors have the same sign, red where not."""
    names = [name.replace("_", "<br>") for name in correlation.names]
    n, matrix = len(names), np.array(correlation.matrix)
    rows, columns = (index.ravel() for index in np.indices(matrix.shape))
    colors = [
        GRID if row == column else translucent(BLUE if value > 0 else RED, round(DEEPEST * abs(value), 3))
        for row, column, value in zip(rows, columns, matrix.ravel(), strict=True)
    ]
    written = [f"{value:+.2f}".replace("-", "−") if abs(value) < 1 else "1" for value in matrix.ravel()]
    figure = Figure()
    figure.add_bars(
        x=columns, base=n - 1 - rows, y=np.ones(n * n), width=1, showlegend=False, hoverinfo="skip",
        marker={"color": colors, "line": {"color": PAPER, "width": 3}}, textposition="inside", textangle=0,
        insidetextanchor="middle", text=written, insidetextfont={"color": INK},
    )  # fmt: skip
    figure = styled(figure, MARGIN_PX + ROW_PX * n, hover="closest")
    axis: dict[str, Any] = {"showgrid": False, "ticks": "", "showline": False, "tickmode": "array", "fixedrange": True}
    figure.update_xaxis(tickvals=np.arange(n), ticktext=names, tickangle=0, range=[-0.5, n - 0.5], **axis)
    figure.update_yaxis(tickvals=np.arange(n) + 0.5, ticktext=names[::-1], range=[0, n], **axis)
    figure.update_layout(barmode="overlay")
    return figure
