"""A figure as Plotly's JavaScript takes it, and the common style: large type and dark colors, to be read in sunlight.

Plotly's Python classes check every value, which took longer than everything else that the page needs.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from analysis.records.flight import PowerPoint
from flight.arrays import Array

Json = dict[str, Any]


class Figure:
    """Panels above one another with one x axis. Properties are those of Plotly's traces and layouts.

    data : traces, in the order of drawing      layout : of the figure
    """

    def __init__(self, panels: int = 1, gap: float = 0.05):
        """gap: between two panels, as a share of the height of all."""
        self.data: list[Json] = []
        self.layout: Json = {"xaxis": {"anchor": _axis("y", panels)}}
        self.panels = panels
        height = (1 - gap * (panels - 1)) / panels
        for panel in range(1, panels + 1):
            top = 1 - (panel - 1) * (height + gap)
            self.layout[_axis("yaxis", panel)] = {"domain": [max(0.0, top - height), top], "anchor": "x"}

    def add_scatter(self, *, panel: int = 1, **trace: Any) -> None:
        """A trace of lines or markers. panel: counted from 1, at the top."""
        self.data.append({"type": "scatter", "xaxis": "x", "yaxis": _axis("y", panel), **trace})

    def add_bars(self, *, panel: int = 1, **trace: Any) -> None:
        """A trace of bars. panel as in `add_scatter`."""
        self.data.append({"type": "bar", "xaxis": "x", "yaxis": _axis("y", panel), **trace})

    def add_zero_line(self, line: Json, *, panel: int = 1) -> None:
        """A horizontal line at zero across a panel."""
        shape = {"type": "line", "xref": "x domain", "x0": 0, "x1": 1, "yref": _axis("y", panel), "y0": 0, "y1": 0}
        self.layout.setdefault("shapes", []).append(shape | {"line": line})

    def update_xaxis(self, **properties: Any) -> None:
        self.layout["xaxis"].update(_titled(properties))

    def update_yaxis(self, *, panel: int = 1, **properties: Any) -> None:
        self.layout[_axis("yaxis", panel)].update(_titled(properties))

    def update_yaxes(self, **properties: Any) -> None:
        """The y axes of all panels."""
        for panel in range(1, self.panels + 1):
            self.update_yaxis(panel=panel, **properties)

    def update_layout(self, **properties: Any) -> None:
        """Properties inside a margin, font or legend are added to those that it has."""
        for name, value in properties.items():
            before = self.layout.get(name)
            self.layout[name] = before | value if isinstance(before, dict) and isinstance(value, dict) else value


def _titled(properties: Json) -> Json:
    """The same with a title that is text as Plotly wants it."""
    title = properties.get("title")
    return properties | {"title": {"text": title}} if isinstance(title, str) else properties


def _axis(name: str, panel: int) -> str:
    """ "y", "y2", "y3": Plotly numbers axes from the second on."""
    return name if panel == 1 else f"{name}{panel}"


INK, GRID, PAPER, GRAY = "#000000", "#c9d1d8", "#ffffff", "#5b6b78"
BLUE, RED, GREEN, ORANGE = "#004a99", "#c22a1a", "#00693e", "#c64b00"
OTHER_RUN, ALL_RUNS = "#8a2f8f", "#3d3d3d"
# Dark enough on white. With color blindness some look alike: lines also differ in symbol, dash or width.
PALETTE = (
    BLUE, ORANGE, "#00735c", OTHER_RUN, "#6b4e00", ALL_RUNS, "#0087b3", "#a3123f", "#5a7d00", "#b58900", "#5a3fc0",
    "#d4007f", "#7d3c00", "#2f5d8c",
)  # fmt: skip
SYMBOLS = (
    "circle", "square", "diamond", "triangle-up", "cross", "x", "triangle-down", "pentagon", "star", "hexagon",
    "hourglass", "bowtie", "star-diamond", "hexagram",
)  # fmt: skip
# Kinds of runs are told apart by color alone, also with color blindness (tests/analysis/pages/test_style.py).
RUN_COLOR = {"acceleration": "#d95f02", "deceleration": BLUE, "steady": "#1b9e77"}
# The same colors on a dark page, by the color on a white one.
ON_DARK = {
    INK: "#e8edf2", GRID: "#39424c", PAPER: "#12171d", GRAY: "#9fb0bf", BLUE: "#6cb6ff", RED: "#ff8375",
    GREEN: "#3fd18b", ORANGE: "#ffa657", "#00735c": "#4fd1b5", OTHER_RUN: "#e08be6", "#6b4e00": "#d9b44a",
    ALL_RUNS: "#c0c0c0", "#0087b3": "#4cc9f0", "#a3123f": "#ff7aa2", "#5a7d00": "#b5d94c", "#b58900": "#f2cc60",
    "#5a3fc0": "#b39dff", "#d4007f": "#ff6ec7", "#d95f02": "#ff9a4d", "#1b9e77": "#b8f2c0",
    "#7d3c00": "#e0a070", "#2f5d8c": "#9cc4f0",
}  # fmt: skip


def styled(figure: Figure, height_px: int, *, hover: str = "x unified") -> Figure:
    """The figure with the common fonts, margins, axes and legend."""
    figure.update_layout(
        height=height_px,
        margin={"l": 84, "r": 24, "t": 16, "b": 64},
        paper_bgcolor=PAPER,
        plot_bgcolor=PAPER,
        font={"family": "system-ui, sans-serif", "size": 18, "color": INK},
        legend={"orientation": "h", "yanchor": "bottom", "y": 1.02, "x": 0, "font": {"size": 17}},
        hoverlabel={"bgcolor": PAPER, "font": {"color": INK}},
        hovermode=hover,
        showlegend=True,
    )
    axis = {"gridcolor": GRID, "zeroline": False, "linecolor": INK, "linewidth": 2, "ticks": "outside",
            "automargin": True}  # fmt: skip
    figure.update_xaxis(**axis)
    figure.update_yaxes(**axis)
    return figure


def thinned(x: Array, y: Array, points: int = 1000) -> tuple[Array, Array]:
    """At most so many points of a time history: the least and the greatest value of each stretch, in order of time.

    points: more than the default do not show on a screen. A stretch without a value keeps its first point, so that a
    gap stays one.
    """
    if len(x) <= points:
        return x, y
    starts = np.linspace(0, len(x), points // 2 + 1).astype(int)[:-1]
    stretch = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(x)))
    values = np.where(np.isfinite(y), y, np.nan)
    kept = [starts[~np.logical_or.reduceat(np.isfinite(y), starts)]]
    for extreme in (np.fmin, np.fmax):
        (at,) = np.nonzero(values == extreme.reduceat(values, starts)[stretch])
        kept.append(at[np.unique(stretch[at], return_index=True)[1]])
    chosen = np.unique(np.concatenate(kept))
    return x[chosen], y[chosen]


def rounded(values: Array, digits: int = 5) -> Array:
    """Values to that many significant digits of their range; five are enough to zoom a little. NaN stays."""
    finite = values[np.isfinite(values)]
    span = float(np.ptp(finite)) if len(finite) else 0.0
    largest = float(np.max(np.abs(finite), initial=0.0))
    decimals = digits - 1 - int(np.floor(np.log10(span or largest or 1.0)))
    return np.asarray(np.round(values.astype(float), max(decimals, 0)))


def translucent(color: str, opacity: float) -> str:
    """A color "#rrggbb" as CSS `rgba`."""
    red, green, blue = (int(color[i : i + 2], 16) for i in (1, 3, 5))
    return f"rgba({red}, {green}, {blue}, {opacity})"


def curve_arrays(points: Sequence[PowerPoint]) -> tuple[Array, Array, Array, Array]:
    """Speed [m/s], power [W], lower and upper end of its interval [W] of a curve."""
    V, P, lo, hi = np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in points]).T
    return V, P, lo, hi


def add_band(figure: Figure, x: Array, ends: tuple[Array, Array], color: str, opacity: float, **trace: Any) -> None:
    """A shaded band between two curves, the lower and the upper."""
    lo, hi = ends
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


def add_curve(
    figure: Figure, points: Sequence[PowerPoint], name: str, color: str, *, width: float, symbol: str = ""
) -> None:
    """A curve, solid where it was measured and dashed where it is extrapolated. symbol: on a few points of it."""
    marks: dict[str, Any] = {"mode": "lines"}
    if symbol:
        marks = {"mode": "lines+markers", "marker": {"symbol": symbol, "size": 11, "color": color, "maxdisplayed": 4}}
    V, P, _, _ = curve_arrays(points)
    outside = np.array([p.extrapolated for p in points])
    # A dashed piece reaches to the solid one beside it.
    beside = np.r_[outside[1:], False] | np.r_[False, outside[:-1]]
    for flag, dash, in_legend in ((~outside, "solid", True), (outside | beside, "9px,6px", outside.all())):
        if flag.any() and (dash == "solid" or outside.any()):
            figure.add_scatter(
                x=rounded(V),
                y=rounded(np.where(flag, P, np.nan)),
                **marks,
                line={"color": color, "width": width, "dash": dash},
                name=name,
                legendgroup=name,
                showlegend=bool(in_legend),
                hovertemplate="%{y:.1f} W",
            )
