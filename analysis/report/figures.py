"""The report's drawings, from arrays and tables to Plotly figures."""

import numpy as np
import pandas as pd
import plotly.graph_objects as go
from numpy.typing import NDArray
from plotly.subplots import make_subplots

from analysis.results import PowerPoint, Results
from analysis.runs import Run

Array = NDArray[np.float64]

INK, GRID, PAPER = "#1b2733", "#dde3e8", "#ffffff"
BLUE, BAND, ORANGE, GREEN = "#0b5fa5", "rgba(11, 95, 165, 0.18)", "#d1495b", "#2a7f62"
KIND_COLOUR = {"acceleration": "#d1495b", "deceleration": "#0b5fa5"}


def _styled(figure: go.Figure, height: int) -> go.Figure:
    figure.update_layout(
        height=height,
        margin={"l": 70, "r": 24, "t": 36, "b": 56},
        paper_bgcolor=PAPER,
        plot_bgcolor=PAPER,
        font={"family": "system-ui, sans-serif", "size": 14, "color": INK},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.0, "x": 0},
        hovermode="x unified",
    )
    figure.update_xaxes(gridcolor=GRID, zeroline=False, linecolor=INK, ticks="outside")
    figure.update_yaxes(gridcolor=GRID, zeroline=False, linecolor=INK, ticks="outside")
    return figure


def _curve(points: list[PowerPoint]) -> tuple[Array, Array, Array, Array]:
    V, P, lo, hi = np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in points]).T
    return V, P, lo, hi


def power_required(results: Results) -> go.Figure:
    """The product: power against speed, with its interval and the two speeds people ask for."""
    V, P, lo, hi = _curve(results.power_required)
    figure = go.Figure()
    figure.add_scatter(
        x=np.r_[V, V[::-1]],
        y=np.r_[hi, lo[::-1]],
        fill="toself",
        fillcolor=BAND,
        line={"width": 0},
        name="95 % interval",
        hoverinfo="skip",
    )
    figure.add_scatter(
        x=V, y=P, line={"color": BLUE, "width": 3}, name="power required, as flown", hovertemplate="%{y:.1f} W"
    )
    Vs, Ps, _, _ = _curve(results.power_required_standard)
    figure.add_scatter(
        x=Vs,
        y=Ps,
        line={"color": INK, "width": 1.5, "dash": "dash"},
        name="standard weight, sea level",
        hovertemplate="%{y:.1f} W",
    )
    Vc, Pc, _, _ = _curve(results.cross_check)
    figure.add_scatter(
        x=Vc,
        y=Pc,
        line={"color": ORANGE, "width": 1.5, "dash": "dot"},
        name="cross-check, output error",
        hovertemplate="%{y:.1f} W",
    )
    for special, name, colour in (
        (results.minimum_power_speed, "longest endurance", GREEN),
        (results.best_range_speed, "longest range", ORANGE),
    ):
        if special.speed_mps is not None and special.inside_flown_range:
            power = float(np.interp(special.speed_mps, V, P))
            errors = {
                "symmetric": False,
                "array": [(special.hi_mps or special.speed_mps) - special.speed_mps],
                "arrayminus": [special.speed_mps - (special.lo_mps or special.speed_mps)],
            }
            figure.add_scatter(
                x=[special.speed_mps],
                y=[power],
                error_x=errors,
                mode="markers",
                name=name,
                marker={"color": colour, "size": 11},
                hovertemplate="%{x:.1f} m/s",
            )
    figure.update_xaxes(title="true airspeed, m/s")
    figure.update_yaxes(title="power required, W", rangemode="tozero")
    return _styled(figure, 460)


def timeline(table: pd.DataFrame, runs: list[Run]) -> go.Figure:
    """The whole flight: speed, height, motor; the runs shaded."""
    rows = (("V_mps", "speed, m/s", 1.0), ("height_m", "height, m", 1.0), ("n_revps", "motor, rpm", 60.0))
    figure = make_subplots(rows=len(rows), cols=1, shared_xaxes=True, vertical_spacing=0.04)
    thin = table.iloc[:: max(1, len(table) // 3000)]
    for i, (name, title, scale) in enumerate(rows, start=1):
        figure.add_scatter(
            x=_rounded(thin.index.to_numpy()),
            y=_rounded(thin[name].to_numpy() * scale),
            row=i,
            col=1,
            line={"color": INK, "width": 1.3},
            showlegend=False,
            name=title,
        )
        figure.update_yaxes(title=title, row=i, col=1)
    for run in runs:
        figure.add_vrect(x0=run.start_s, x1=run.end_s, fillcolor=KIND_COLOUR[run.kind], opacity=0.15, line_width=0)
    figure.update_xaxes(title="time since the log began, s", row=len(rows), col=1)
    return _styled(figure, 520)


def fit(name: str, t_s: Array, measured: dict[str, Array], modelled: dict[str, Array]) -> go.Figure:
    """One run: what was measured and what the fitted model says; a panel each quantity."""
    names = list(measured)
    figure = make_subplots(rows=len(names), cols=1, shared_xaxes=True, vertical_spacing=0.03)
    for i, quantity in enumerate(names, start=1):
        first = i == 1
        figure.add_scatter(
            x=_rounded(t_s),
            y=_rounded(measured[quantity]),
            mode="markers",
            row=i,
            col=1,
            marker={"size": 5, "color": "#7f96a8"},
            name="measured",
            showlegend=first,
        )
        figure.add_scatter(
            x=_rounded(t_s),
            y=_rounded(modelled[quantity]),
            mode="lines",
            row=i,
            col=1,
            line={"color": ORANGE, "width": 2},
            name="model",
            showlegend=first,
        )
        figure.update_yaxes(title=quantity, row=i, col=1)
    figure.update_xaxes(title=f"time, s ({name})", row=len(names), col=1)
    return _styled(figure, 150 * len(names) + 60)


def polar(results: Results, CL: Array, CD: Array, lo: Array, hi: Array) -> go.Figure:
    """The drag polar over the flown lift coefficients, with its interval."""
    figure = go.Figure()
    figure.add_scatter(
        x=np.r_[lo, hi[::-1]],
        y=np.r_[CL, CL[::-1]],
        fill="toself",
        fillcolor=BAND,
        line={"width": 0},
        name="95 % interval",
        hoverinfo="skip",
    )
    figure.add_scatter(x=CD, y=CL, line={"color": BLUE, "width": 3}, name="drag polar")
    figure.update_xaxes(title="drag coefficient", rangemode="tozero")
    figure.update_yaxes(title="lift coefficient", rangemode="tozero")
    return _styled(figure, 400)


def _rounded(values: Array) -> Array:
    """Five digits are enough to draw with, and a third of the page's size."""
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 10.0 ** (4 - np.floor(np.log10(np.nanmax(np.abs(values)) or 1.0))) if np.isfinite(values).any() else 1.0
    return np.round(values * scale) / scale
