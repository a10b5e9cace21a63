"""Colors readable in sunlight, on a dark page and on paper; thinning that keeps what is visible; bands and curves."""

from collections.abc import Sequence

import numpy as np

from flightpower.analysis.pages.charts.figure import Axis, Band, Dash, Line, Symbol
from flightpower.analysis.records.flight import PowerPoint
from flightpower.flight.arrays import Array

INK, GRID, PAPER, GRAY = "#000000", "#c9d1d8", "#ffffff", "#5b6b78"
BLUE, RED, GREEN, ORANGE = "#004a99", "#c22a1a", "#00693e", "#c64b00"
OTHER_RUN, ALL_RUNS = "#8a2f8f", "#3d3d3d"
# These colors are dark enough on white. Some look alike to the color-blind, so lines also differ in symbol, dash or
# width.
PALETTE = (
    BLUE, ORANGE, "#00735c", OTHER_RUN, "#6b4e00", ALL_RUNS, "#0087b3", "#a3123f", "#5a7d00", "#b58900", "#5a3fc0",
    "#d4007f", "#7d3c00", "#2f5d8c",
)  # fmt: skip
SYMBOLS = (
    Symbol.CIRCLE, Symbol.SQUARE, Symbol.DIAMOND, Symbol.UP, Symbol.PLUS, Symbol.CROSS, Symbol.DOWN, Symbol.LEFT,
    Symbol.STAR, Symbol.RIGHT, Symbol.HOURGLASS, Symbol.BOWTIE,
)  # fmt: skip
# Kinds of runs differ in color only, distinguishable also by the color-blind (tests/analysis/pages/test_style.py).
RUN_COLOR = {"acceleration": "#d95f02", "deceleration": BLUE, "steady": "#1b9e77"}
# Colors on a dark page, by the corresponding color on a white page.
ON_DARK = {
    INK: "#e8edf2", GRID: "#39424c", PAPER: "#12171d", GRAY: "#9fb0bf", BLUE: "#6cb6ff", RED: "#ff8375",
    GREEN: "#3fd18b", ORANGE: "#ffa657", "#00735c": "#4fd1b5", OTHER_RUN: "#e08be6", "#6b4e00": "#d9b44a",
    ALL_RUNS: "#c0c0c0", "#0087b3": "#4cc9f0", "#a3123f": "#ff7aa2", "#5a7d00": "#b5d94c", "#b58900": "#f2cc60",
    "#5a3fc0": "#b39dff", "#d4007f": "#ff6ec7", "#d95f02": "#ff9a4d", "#1b9e77": "#b8f2c0",
    "#7d3c00": "#e0a070", "#2f5d8c": "#9cc4f0",
}  # fmt: skip


def true_airspeed() -> Axis:
    # The cursor stops at the points of a curve, 0.1 to 0.3 m/s apart, so one decimal would show uneven steps.
    return Axis("true airspeed", "m/s", decimals=2)


def round_length(length_m: float) -> float:
    """Return the largest of 1, 2, 5, 10 … m that does not exceed a length; at least 1 m."""
    decade = 10 ** int(np.log10(max(length_m, 1.0)))
    return float(max(step * decade for step in (1, 2, 5) if step * decade <= max(length_m, 1.0)))


def thinned(x: Array, y: Array, points: int = 1000) -> tuple[Array, Array]:
    """Thin a time history to about `points`: the least and greatest value of each stretch, in order.

    points: a screen does not show more than the default. A stretch without values keeps its first point, so the gap
    stays visible.
    """
    if len(x) <= points:
        return x, y
    starts = np.linspace(0, len(x), points // 2 + 1).astype(int)[:-1]
    stretch = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(x)))
    values = np.where(np.isfinite(y), y, np.nan)
    indices = [starts[~np.logical_or.reduceat(np.isfinite(y), starts)]]
    for extreme in (np.fmin, np.fmax):
        (index,) = np.nonzero(values == extreme.reduceat(values, starts)[stretch])
        indices.append(index[np.unique(stretch[index], return_index=True)[1]])
    chosen = np.unique(np.concatenate(indices))
    return x[chosen], y[chosen]


def curve_arrays(points: Sequence[PowerPoint]) -> tuple[Array, Array, Array, Array]:
    """Return speed [m/s], power [W], and lower and upper end of its interval [W] along a curve."""
    V, P, lo, hi = np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in points]).T
    return V, P, lo, hi


def band(x: Array, ends: tuple[Array, Array], color: str, opacity: float, *, name: str = "", panel: int = 1) -> Band:
    """Return a shaded band between a lower and an upper curve. name : entry of the legend that hides it"""
    lo, hi = ends
    outline = np.r_[x, x[::-1]], np.r_[hi, lo[::-1]]
    return Band(x=outline[0], y=outline[1], color=color, opacity=opacity, name=name, panel=panel)


def curve_lines(
    points: Sequence[PowerPoint],
    name: str,
    color: str,
    *,
    width: float,
    symbol: Symbol | None = None,
    value: str = "{y:.1f} W",
) -> list[Line]:
    """Return a curve, solid where it was measured and dashed where it is extrapolated. symbol: drawn on a few points"""
    V, P, _, _ = curve_arrays(points)
    outside = np.array([p.extrapolated for p in points])
    # A dashed piece extends to the adjacent solid piece.
    beside = np.r_[outside[1:], False] | np.r_[False, outside[:-1]]
    pieces = ((~outside, Dash.SOLID), ((outside | beside) & outside.any(), Dash.DASHED))
    return [
        Line(
            x=V, y=np.where(flag, P, np.nan), name=name, color=color, width=width, dash=dash, symbol=symbol, symbols=4,
            value=value,
        )
        for flag, dash in pieces
        if flag.any()
    ]  # fmt: skip
