"""Common style of all figures: large type and dark colors, so that they can be read in sunlight."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import plotly.graph_objects as go
from numpy.typing import NDArray

from analysis.results.schema import PowerPoint

Array = NDArray[np.float64]

INK, GRID, PAPER, GREY = "#000000", "#c9d1d8", "#ffffff", "#5b6b78"
BLUE, RED, GREEN, ORANGE = "#004a99", "#c22a1a", "#00693e", "#c64b00"
# Dark enough on white, and distinguishable with red-green color blindness.
PALETTE = (
    BLUE, ORANGE, "#00735c", "#8a2f8f", "#6b4e00", "#3d3d3d", "#0087b3", "#a3123f", "#5a7d00", "#b58900", "#5a3fc0",
    "#d4007f",
)  # fmt: skip
RUN_COLOR = {"acceleration": RED, "deceleration": BLUE, "steady": GREEN}
POINTS_DRAWN = 3000  # of a time history; more do not show on a screen
SIGNIFICANT_DIGITS = 5  # enough to draw with, at a third of the page's size


def styled(figure: go.Figure, height_px: int, *, hover: str = "x unified") -> go.Figure:
    """The figure with the common fonts, margins, axes and legend."""
    figure.update_layout(
        height=height_px,
        margin={"l": 84, "r": 24, "t": 16, "b": 64},
        paper_bgcolor=PAPER,
        plot_bgcolor=PAPER,
        font={"family": "system-ui, sans-serif", "size": 18, "color": INK},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.02, "x": 0, "font": {"size": 17}},
        hovermode=hover,
    )
    axis = {"gridcolor": GRID, "zeroline": False, "linecolor": INK, "linewidth": 2, "ticks": "outside"}
    figure.update_xaxes(**axis)
    figure.update_yaxes(**axis)
    return figure


def rounded(values: Array) -> Array:
    """Values to five significant digits of the largest; NaN stays."""
    largest = np.max(np.abs(values[np.isfinite(values)]), initial=0.0)
    scale = 10.0 ** (SIGNIFICANT_DIGITS - 1 - np.floor(np.log10(largest or 1.0)))
    return np.asarray(np.round(values * scale) / scale)


def translucent(color: str, opacity: float) -> str:
    """A color "#rrggbb" as CSS `rgba`."""
    red, green, blue = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red}, {green}, {blue}, {opacity})"


def curve_arrays(points: Sequence[PowerPoint]) -> tuple[Array, Array, Array, Array]:
    """Speed [m/s], power [W], lower and upper end of its interval [W] of a curve."""
    V, P, lo, hi = np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in points]).T
    return V, P, lo, hi


def add_band(figure: go.Figure, x: Array, lo: Array, hi: Array, color: str, opacity: float, **trace: Any) -> None:
    """A shaded band between two curves."""
    figure.add_scatter(
        x=rounded(np.r_[x, x[::-1]]),
        y=rounded(np.r_[hi, lo[::-1]]),
        mode="lines",
        fill="toself",
        fillcolor=translucent(color, opacity),
        line={"width": 0},
        hoverinfo="skip",
        showlegend=False,
        **trace,
    )


def add_curve(figure: go.Figure, points: Sequence[PowerPoint], name: str, color: str, width: float) -> None:
    """A curve, solid where it was measured and dashed where it is extrapolated."""
    V, P, _, _ = curve_arrays(points)
    outside = np.array([p.extrapolated for p in points])
    # A dashed piece reaches to the solid one beside it.
    beside = np.r_[outside[1:], False] | np.r_[False, outside[:-1]]
    for flag, dash, in_legend in ((~outside, "solid", True), (outside | beside, "9px,6px", outside.all())):
        if flag.any() and (dash == "solid" or outside.any()):
            figure.add_scatter(
                x=rounded(V),
                y=rounded(np.where(flag, P, np.nan)),
                mode="lines",
                line={"color": color, "width": width, "dash": dash},
                name=name,
                legendgroup=name,
                showlegend=bool(in_legend),
                hovertemplate="%{y:.1f} W",
            )
