"""A figure as SVG text: what the page shows before a script runs, and where none does.

It draws what the figures of curves are made of: lines, bands, markers, error bars and the legend, on linear axes.
The colors are variables of the page's style, so that they follow a dark page.
"""

from collections.abc import Iterator, Sequence
from html import escape
from typing import Any, NamedTuple

import numpy as np

from analysis.pages.charts.style import Figure
from flight.arrays import Array

Json = dict[str, Any]

DASHES = {"dash": "9 9", "dot": "3 3", "dashdot": "9 3 3 3", "9px,6px": "9 6"}


class Sheet(NamedTuple):
    """Sizes in px: of the drawing, its margins, its type, a letter and a line of the legend."""

    width: int = 600
    left: int = 64
    right: int = 10
    bottom: int = 52
    font: int = 15
    letter: float = 8.0
    line: int = 20


SHEET = Sheet()


def color_variable(color: str) -> str:
    """Name of the variable of the page's style that holds this color, as it is on a white or a dark page."""
    return f"--c{color.removeprefix('#').lower()}"


def svg(figure: Figure) -> str:
    """The figure, as high as its layout says. Bars are not drawn."""
    height = figure.layout["height"]
    entries = [t for t in figure.data if t.get("name") and t.get("showlegend", True)]
    legend, lines = _legend(entries)
    top, bottom = SHEET.line * lines + 12, height - SHEET.bottom
    x = _Axis(figure.layout["xaxis"], _reach(figure.data, "x"), (SHEET.left, SHEET.width - SHEET.right))
    body = list(_x_axis(x, (bottom, top)))
    for number in ("", *map(str, range(2, figure.panels + 1))):
        layout = figure.layout[f"yaxis{number}"]
        traces = [trace for trace in figure.data if trace["yaxis"] == f"y{number}"]
        low, high = (round(bottom - share * (bottom - top)) for share in layout["domain"])
        y = _Axis(layout, _reach(traces, "y"), (low, high))
        place = f'x="{x.px[0]}" y="{high}" width="{x.px[1] - x.px[0]}" height="{low - high}"'
        body.append(f'<clipPath id="plotted{number}"><rect {place}/></clipPath>')
        body += _y_axis(x, y)
        body.append(f'<g clip-path="url(#plotted{number})">')
        body += [part for trace in traces for part in _trace(trace, x, y)]
        body.append("</g>")
    size = f'viewBox="0 0 {SHEET.width} {height}" font-size="{SHEET.font}"'
    return f'<svg {size} class="still">{"".join(body)}{"".join(legend)}</svg>'


class _Axis:
    """An axis of the layout over values `reach`, drawn between two ends `px`."""

    def __init__(self, layout: Json, reach: tuple[float, float], px: tuple[float, float]):
        self.title, self.px = layout["title"]["text"], px
        margin = 0.04 * (reach[1] - reach[0] or 1.0)
        self.lo, self.hi = layout.get("range", (reach[0] - margin, reach[1] + margin))

    def at(self, values: Array) -> Array:
        return np.asarray(self.px[0] + (values - self.lo) / (self.hi - self.lo) * (self.px[1] - self.px[0]))

    def ticks(self) -> list[float]:
        """Round values, about six."""
        raw = (self.hi - self.lo) / 6
        scale = 10.0 ** np.floor(np.log10(raw))
        step = scale * next(nice for nice in (1, 2, 5, 10) if nice * scale >= raw)
        return [float(tick) for tick in step * np.arange(np.ceil(self.lo / step), np.floor(self.hi / step) + 1)]


def _reach(traces: Sequence[Json], axis: str) -> tuple[float, float]:
    values = np.concatenate([np.asarray(trace[axis], dtype=float) for trace in traces])
    return float(np.nanmin(values)), float(np.nanmax(values))


def _x_axis(x: _Axis, ends: tuple[float, float]) -> Iterator[str]:
    """Below the lowest panel. ends : bottom and top of all panels [px]"""
    bottom, top = ends
    for tick in x.ticks():
        at = x.at(np.array(tick))
        yield f'<path d="M{at:.1f} {bottom}V{top}" class="grid"/>'
        yield f'<text x="{at:.1f}" y="{bottom + 20}" text-anchor="middle">{tick:g}</text>'
    yield f'<text x="{sum(x.px) / 2:.0f}" y="{bottom + 44}" text-anchor="middle">{escape(x.title)}</text>'


def _y_axis(x: _Axis, y: _Axis) -> Iterator[str]:
    """Left of a panel, with the lines around it."""
    for tick in y.ticks():
        at = y.at(np.array(tick))
        yield f'<path d="M{x.px[0]} {at:.1f}H{x.px[1]}" class="grid"/>'
        yield f'<text x="{x.px[0] - 8}" y="{at + 5:.1f}" text-anchor="end">{tick:g}</text>'
    yield f'<path d="M{x.px[0]} {y.px[1]}V{y.px[0]}H{x.px[1]}" class="axis"/>'
    place = f"translate(16 {sum(y.px) / 2:.0f}) rotate(-90)"
    yield f'<text transform="{place}" text-anchor="middle">{escape(y.title)}</text>'


def _trace(trace: Json, x: _Axis, y: _Axis) -> Iterator[str]:
    at_x, at_y = (axis.at(np.asarray(trace[name], dtype=float)) for axis, name in ((x, "x"), (y, "y")))
    mode, line = trace.get("mode", "lines"), trace.get("line", {})
    path = _path(at_x, at_y)
    if trace.get("fill"):
        red, green, blue, opacity = trace["fillcolor"].removeprefix("rgba(").removesuffix(")").split(", ")
        color = f"#{int(red):02x}{int(green):02x}{int(blue):02x}"
        yield f'<path d="{path}Z" style="fill:{_color(color)};fill-opacity:{opacity}"/>'
    elif "lines" in mode:
        yield (
            f'<path d="{path}" fill="none" stroke-width="{line.get("width", 2)}"'
            f'{_dashed(line)} style="stroke:{_color(line["color"])}"/>'
        )
    for axis, bars in (("x", trace.get("error_x")), ("y", trace.get("error_y"))):
        if bars:
            yield _error_bars(trace, bars, (x, y), axis)
    if "markers" in mode:
        for one_x, one_y in zip(at_x, at_y, strict=True):
            yield _marker(trace["marker"], one_x, one_y)


def _path(x: Array, y: Array) -> str:
    """Interrupted where a value is missing."""
    parts, pen = [], "M"
    for one_x, one_y in zip(x.tolist(), y.tolist(), strict=True):
        missing = not np.isfinite(one_x + one_y)
        if not missing:
            parts.append(f"{pen}{one_x:.1f} {one_y:.1f}")
        pen = "M" if missing else "L"
    return "".join(parts)


def _error_bars(trace: Json, bars: Json, axes: tuple[_Axis, _Axis], along: str) -> str:
    x, y = (np.asarray(trace[name], dtype=float) for name in "xy")
    more, less = np.asarray(bars["array"], dtype=float), np.asarray(bars["arrayminus"], dtype=float)
    ends = ((x - less, y), (x + more, y)) if along == "x" else ((x, y - less), (x, y + more))
    (x0, y0), (x1, y1) = ((axes[0].at(end_x), axes[1].at(end_y)) for end_x, end_y in ends)
    path = "".join(f"M{a:.1f} {b:.1f}L{c:.1f} {d:.1f}" for a, b, c, d in np.stack([x0, y0, x1, y1], axis=1).tolist())
    color = _color(_marker_color(trace["marker"]))
    return f'<path d="{path}" stroke-width="{bars.get("thickness", 2)}" style="stroke:{color}"/>'


def _marker_color(marker: Json) -> str:
    """That of the rim where it is wider than two pixels, as of points on white."""
    line = marker.get("line", {})
    return str(line["color"] if line.get("width", 0) > 2 else marker["color"])


def _marker(marker: Json, x: float, y: float) -> str:
    r, line = marker["size"] / 2, marker.get("line", {})
    style = f"fill:{_color(marker['color'])}"
    if line:
        style += f";stroke:{_color(line['color'])};stroke-width:{line['width']}"
    if marker.get("symbol") == "diamond":
        return f'<path d="M{x:.1f} {y - r:.1f}l{r} {r}l{-r} {r}l{-r} {-r}Z" style="{style}"/>'
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{r}" style="{style}"/>'


def _legend(entries: list[Json]) -> tuple[list[str], int]:
    """The entries in lines above the figure, and how many lines."""
    parts, left, line = [], float(SHEET.left), 0
    for trace in entries:
        width = 44 + SHEET.letter * len(trace["name"])
        if left + width > SHEET.width and left > SHEET.left:
            left, line = float(SHEET.left), line + 1
        y = SHEET.line * line + 12
        if "lines" in trace.get("mode", "lines"):
            stroke = trace["line"]
            parts.append(
                f'<path d="M{left} {y}h26" stroke-width="{stroke.get("width", 2)}"{_dashed(stroke)}'
                f' style="stroke:{_color(stroke["color"])}"/>'
            )
        if "markers" in trace.get("mode", "lines"):
            parts.append(_marker(trace["marker"], left + 13, y))
        parts.append(f'<text x="{left + 32}" y="{y + 5}">{escape(trace["name"])}</text>')
        left += width
    return parts, line + 1


def _dashed(line: Json) -> str:
    dash = DASHES.get(line.get("dash", ""))
    return f' stroke-dasharray="{dash}"' if dash else ""


def _color(color: str) -> str:
    return f"var({color_variable(color)})"
