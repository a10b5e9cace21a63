"""Figures of a fit: measured and fitted outputs, residuals, their autocorrelation, correlations, convergence.

Each function returns a plotly figure; `figure.show()` opens it, `figure.write_html(file)` keeps it.
"""

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from analysis.estimation.fit import Fit, SegmentFit
from analysis.estimation.noise import NORMAL_95
from flight.errors import InputError

Array = NDArray[np.float64]

MEASURED, FITTED = "#8a8f98", "#c2410c"
ROW_HEIGHT, MARGIN = 150, 100  # pixels


def overlay(fit: Fit, segment: str | None = None) -> go.Figure:
    """Measured and fitted outputs over time. segment : its name; default: the first one. Raises InputError."""
    chosen = _segment(fit, segment)
    t, names = chosen.segment.t_s, fit.model.outputs
    figure = _rows(f"{fit.model.name}, {chosen.segment.name}: measured and fitted", names)
    for i, name in enumerate(names):
        line = {"row": i + 1, "col": 1}
        first = i == 0
        measured = go.Scatter(
            x=t, y=chosen.segment.z[name], name="measured", mode="markers", marker={"size": 3, "color": MEASURED},
            legendgroup="measured", showlegend=first,
        )  # fmt: skip
        fitted = go.Scatter(
            x=t, y=chosen.response.y[:, i], name="fitted", line={"color": FITTED, "width": 1.5},
            legendgroup="fitted", showlegend=first,
        )  # fmt: skip
        figure.add_trace(measured, **line)
        figure.add_trace(fitted, **line)
    figure.update_xaxes(title_text="t, s", row=len(names))
    return figure


def residuals(fit: Fit, segment: str | None = None) -> go.Figure:
    """Residuals over time, with lines at two standard deviations. segment as in `overlay`. Raises InputError."""
    chosen = _segment(fit, segment)
    names, sigma = fit.model.outputs, np.sqrt(np.diag(fit.noise_covariance))
    figure = _rows(f"{fit.model.name}, {chosen.segment.name}: residuals and two standard deviations", names)
    for i in range(len(names)):
        points = go.Scatter(
            x=chosen.segment.t_s, y=chosen.residuals[:, i], mode="lines", line={"color": FITTED, "width": 1},
            showlegend=False,
        )  # fmt: skip
        figure.add_trace(points, row=i + 1, col=1)
        for sign in (-2, 2):
            figure.add_hline(y=sign * sigma[i], line={"color": MEASURED, "dash": "dash", "width": 1}, row=i + 1, col=1)
    figure.update_xaxes(title_text="t, s", row=len(names))
    return figure


def autocorrelation(fit: Fit, lags: int = 40) -> go.Figure:
    """Autocorrelation of the residuals over all segments, with the 95 % limits of white noise."""
    names = fit.model.outputs
    figure = _rows(f"{fit.model.name}: autocorrelation of the residuals, 95 % limits of white noise", names)
    for i in range(len(names)):
        r, samples = _autocorrelation([one.residuals[:, i] for one in fit.segment_fits], lags)
        bars = go.Bar(x=np.arange(1, len(r)), y=r[1:], marker={"color": FITTED}, showlegend=False)
        figure.add_trace(bars, row=i + 1, col=1)
        for sign in (-1, 1):
            limit = sign * NORMAL_95 / np.sqrt(samples)
            figure.add_hline(y=limit, line={"color": MEASURED, "dash": "dash", "width": 1}, row=i + 1, col=1)
    figure.update_xaxes(title_text="lag, samples", row=len(names))
    return figure


def correlation_matrix(fit: Fit) -> go.Figure:
    """Correlations of the estimates as colors, with their values where they are above 0.5."""
    values = fit.correlation
    text = np.where(np.abs(np.nan_to_num(values)) > 0.5, np.char.mod("%.2f", values), "")
    names = list(fit.names)
    cells = go.Heatmap(
        z=values, x=names, y=names, text=text, texttemplate="%{text}", zmin=-1, zmax=1, colorscale="RdBu",
        colorbar={"title": "correlation"},
    )  # fmt: skip
    figure = go.Figure(cells)
    size = 250 + 28 * len(names)
    figure.update_layout(title=f"{fit.model.name}: correlations of the estimates", width=size + 100, height=size)
    figure.update_yaxes(autorange="reversed")
    return figure


def convergence(fit: Fit) -> go.Figure:
    """The negative log-likelihood above its last value over the iterations. Raises InputError if it was not kept."""
    if len(fit.costs) < 2:
        raise InputError(f"model {fit.model.name}: the fit has no history of costs to show")
    above = np.array(fit.costs[:-1]) - fit.costs[-1]
    figure = go.Figure(go.Scatter(x=np.arange(len(above)), y=above, mode="lines+markers", line={"color": FITTED}))
    title = f"{fit.model.name}: {fit.verdict.text}"
    figure.update_layout(title=title, height=350, width=700, plot_bgcolor="white")
    figure.update_xaxes(title_text="iteration", gridcolor="#eeeeee")
    figure.update_yaxes(title_text="cost above the last one", type="log", exponentformat="power", gridcolor="#eeeeee")
    return figure


def _rows(title: str, names: tuple[str, ...]) -> go.Figure:
    figure = make_subplots(rows=len(names), cols=1, shared_xaxes=True, vertical_spacing=0.03)
    figure.update_layout(title=title, height=MARGIN + ROW_HEIGHT * len(names), width=900, plot_bgcolor="white")
    figure.update_xaxes(showgrid=True, gridcolor="#eeeeee")
    for i, name in enumerate(names):
        figure.update_yaxes(title_text=name, showgrid=True, gridcolor="#eeeeee", row=i + 1, col=1)
    return figure


def _segment(fit: Fit, name: str | None) -> SegmentFit:
    by_name = {one.segment.name: one for one in fit.segment_fits}
    if name is None:
        return fit.segment_fits[0]
    if name not in by_name:
        raise InputError(f"no segment is named {name!r}; known: {', '.join(by_name)}")
    return by_name[name]


def _autocorrelation(signals: list[Array], lags: int) -> tuple[Array, int]:
    """Biased autocorrelation at lags 0 to `lags`, pooled over the signals (NaN where missing), and their samples."""
    total = np.zeros(lags + 1)
    for signal in signals:
        e = np.nan_to_num(signal)
        for lag in range(min(lags, len(e) - 1) + 1):
            total[lag] += e[: len(e) - lag] @ e[lag:]
    return total / total[0], sum(int(np.isfinite(signal).sum()) for signal in signals)
