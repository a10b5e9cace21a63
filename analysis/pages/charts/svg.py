"""Draws a figure as SVG text: the drawing that a reader sees on the screen, on paper, and in a saved file.

Positions are percentages of the width, or units of 1/10,000 of an axis in a drawing that stretches, except for its
strokes. So one drawing fits every width. Colors are variables of the page's style, which adapt to a dark page and to
paper.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from html import escape
from importlib import resources
from typing import Any, NamedTuple

import numpy as np

from flightpower.analysis.pages.charts.figure import Axis, Band, Bars, Figure, Line, Mark, Points, Shade, Symbol
from flightpower.analysis.pages.charts.style import ON_DARK, PAPER
from flightpower.flight.arrays import Array

UNITS = 10_000  # length of an axis in a drawing that stretches
RATIOS = (0.9, 1.2, 1.6, 2.4)  # possible width over height of a figure with equal scales


class Sheet(NamedTuple):
    """Sizes in px, as in chart.css: the space below and above the panels, the gap between panels, the width of a letter
    in a label, and the width of a title beside the labels."""

    below: int = 52
    above: int = 8
    gap: int = 14
    letter: float = 8.0
    title: int = 34


SHEET = Sheet()


def color_variable(color: str) -> str:
    """Return the name of the style variable for this color; its value depends on a white or dark page."""
    return f"--c{color.removeprefix('#').lower()}"


@dataclass(frozen=True)
class Scale:
    """An axis with its ends `lo` and `hi`, which are logarithms if the axis is logarithmic."""

    axis: Axis
    lo: float
    hi: float

    def share(self, values: Array) -> Array:
        """Return the position between the ends, 0 to 1; NaN for the logarithm of zero or less."""
        values = np.asarray(values, dtype=float)
        if self.axis.logarithmic:
            values = np.log10(np.where(values > 0, values, np.nan))
        return np.asarray((values - self.lo) / (self.hi - self.lo))

    def ticks(self, most: int) -> list[tuple[float, str]]:
        """Return positions (0 to 1) and labels of ticks: a limited number of round values, or the axis' own ticks."""
        if self.axis.ticks is not None:
            places = self.share(np.array(list(self.axis.ticks)))
            return list(zip(places.tolist(), self.axis.ticks.values(), strict=True))
        if self.axis.logarithmic:
            every = max(1, round((self.hi - self.lo) / 5))
            powers = range(int(np.ceil(self.lo)), int(np.floor(self.hi)) + 1, every)
            return [((power - self.lo) / (self.hi - self.lo), f"1e{power}") for power in powers]
        step = self.axis.step or round_step(self.hi - self.lo, min(most, self.axis.most_ticks))
        values = step * np.arange(np.ceil(self.lo / step - 1e-9), np.floor(self.hi / step + 1e-9) + 1) + 0.0
        return [(float(self.share(value)), f"{float(f'{value:.10g}'):g}".replace("-", "−")) for value in values]

    def digits(self) -> int:
        """Return the decimals set for the axis, or enough to resolve a hundredth of the range."""
        if self.axis.decimals is not None:
            return self.axis.decimals
        return int(np.clip(2 - np.floor(np.log10(self.hi - self.lo)), 0, 6))


def round_step(reach: float, count: int) -> float:
    """Return the step between ticks: 1, 2 or 5 times a power of ten, with at most `count` steps in the range."""
    raw = reach / count
    power = 10.0 ** np.floor(np.log10(raw))
    return float(power * next(nice for nice in (1, 2, 5, 10) if nice * power >= raw * (1 - 1e-9)))


def scale(axis: Axis, reach: tuple[float, float], margin: float = 0.04) -> Scale:
    """Return the scale of an axis over the values `reach`, with a margin unless the axis has limits."""
    lo, hi = axis.limits or reach
    if axis.logarithmic:
        lo, hi = float(np.log10(lo)), float(np.log10(hi))
    if axis.limits is None:
        if axis.from_zero:
            lo, hi = min(lo, 0.0), max(hi, 0.0)
        more = margin * (hi - lo or abs(hi) or 1.0)
        lo, hi = (lo if axis.from_zero and lo == 0 else lo - more), hi + more
    return Scale(axis, lo, hi)


def chart(figure: Figure, name: str, title: str = "") -> str:
    """Return the figure with legend and readout as HTML. name : id of the element     title : for screen readers"""
    heading = f'<p class="heading">{escape(figure.heading)}</p>' if figure.heading else ""
    entries = [_entry(figure, entry) for entry in figure.entries()]
    legend = f'<div class="legend">{"".join(entries)}</div>' if entries else ""
    return f'<div class="plot" id="{escape(name)}">{heading}{legend}{svg(figure, title)}</div>'


def svg(figure: Figure, title: str = "") -> str:
    """Return the drawing without its legend."""
    x = scale(figure.x, _reach(figure, "x"), _margin(figure))
    ys = [scale(axis, _reach(figure, "y", panel)) for panel, axis in enumerate(figure.ys, start=1)]
    attributes = f'class="chart p{figure.panels}" role="graphics-document" tabindex="0" data-cursor="{figure.cursor}"'
    if figure.equal:
        x, ys, ratio = _equal(x, ys[0])
        attributes = attributes.replace('class="chart', f'class="chart equal r{10 * ratio:.0f}')
    else:
        attributes += f' height="{figure.height_px}"'
    if figure.rows:
        attributes = attributes.replace('class="chart', 'class="chart rows')
    if figure.left_px != Figure().left_px:
        attributes += f' style="padding-left:{figure.left_px}px"'
    usable = figure.height_px - SHEET.below - SHEET.above
    gap, high = 100 * SHEET.gap / usable, 100 * _panel_px(figure) / usable
    body = "".join(
        f'<svg class="panel" y="{i * (high + gap):.2f}%" height="{high:.2f}%" data-x="{x.lo:.7g} {x.hi:.7g}"'
        f' data-y="{y.lo:.7g} {y.hi:.7g}" data-digits="{x.digits()} {y.digits()}" data-names="{escape(x.axis.name)}|'
        f'{escape(x.axis.unit)}" data-log="{int(y.axis.logarithmic)}">'
        f"{''.join(_panel(figure, i + 1, x, y))}</svg>"
        for i, y in enumerate(ys)
    )
    about = f"<title>{escape(title or figure.heading or figure.y.title)}</title>"
    about += f"<desc>{escape(_described(figure, x, ys))}</desc>"
    return f"<svg {attributes}>{about}<g><title></title>{body}</g></svg>"


def _panel_px(figure: Figure) -> float:
    """Return the height of a panel in px."""
    usable = figure.height_px - SHEET.below - SHEET.above
    return (usable - SHEET.gap * (figure.panels - 1)) / figure.panels


def _described(figure: Figure, x: Scale, ys: Sequence[Scale]) -> str:
    """Describe the axes with their ends, and the lines by name, for readers who cannot see the drawing."""

    def ends(scale: Scale) -> str:
        lo, hi = (10**end if scale.axis.logarithmic else end for end in (scale.lo, scale.hi))
        return f"{scale.axis.title} from {lo:.4g} to {hi:.4g}"

    names = figure.entries()
    lines = f". Shown: {', '.join(names)}" if names else ""
    return f"{'; '.join(ends(y) for y in ys)}, against {ends(x)}{lines}."


def _margin(figure: Figure) -> float:
    return 0.0 if all(isinstance(mark, Line | Band) for mark in figure.marks) and not figure.equal else 0.04


def _reach(figure: Figure, along: str, panel: int | None = None) -> tuple[float, float]:
    """Return the least and greatest value of the marks along an axis, including the ends of their bars."""
    values: list[Array] = []
    for mark in figure.marks:
        if panel in (None, mark.panel):
            values.append(getattr(mark, along).ravel())
            ends = getattr(mark, f"{along}_ends", None)
            if ends is not None:
                values.append(np.ravel(ends))
            if isinstance(mark, Bars):
                values += [_corners(mark)[along == "y"].ravel()]
    numbers = np.concatenate(values) if values else np.array([0.0, 1.0])
    axis = figure.x if panel is None else figure.ys[panel - 1]
    numbers = numbers[np.isfinite(numbers) & (numbers > 0 if axis.logarithmic else True)]
    return (float(numbers.min()), float(numbers.max())) if len(numbers) else (0.0, 1.0)


def _equal(x: Scale, y: Scale) -> tuple[Scale, list[Scale], float]:
    """Widen the shorter axis, so that width over height is one of the ratios for which the style has a class."""
    wide, high = x.hi - x.lo, y.hi - y.lo
    ratio = min(RATIOS, key=lambda ratio: abs(np.log(ratio * high / wide)))
    to_wide, to_high = max(wide, ratio * high), max(high, wide / ratio)
    return (
        Scale(x.axis, x.lo - (to_wide - wide) / 2, x.hi + (to_wide - wide) / 2),
        [Scale(y.axis, y.lo - (to_high - high) / 2, y.hi + (to_high - high) / 2)],
        ratio,
    )


def _panel(figure: Figure, number: int, x: Scale, y: Scale) -> Iterator[str]:
    marks = [mark for mark in figure.marks if mark.panel == number]
    last = number == figure.panels
    yield '<rect class="frame" width="100%" height="100%"/>'
    yield from _x_ticks(x, labels=last)
    for share, label in y.ticks(6):
        line = '<line x2="100%"/>' if y.axis.grid else ""
        place = f'class="tick y{_fixed_class(y)}" y="{100 * (1 - share):.2f}%"'
        yield f"<svg {place}>{line}{_text(label, -8, 5, 'end')}</svg>"
    yield f'<svg class="drawn" viewBox="0 0 {UNITS} {UNITS}" preserveAspectRatio="none">'
    yield from (_shade(shade, x) for shade in figure.shades)
    if number in figure.zero_lines:
        zero_y = UNITS * (1 - float(y.share(np.array(0.0))))
        yield f'<path class="zero" d="M-1e6 {zero_y:.0f}H1e6"/>'
    if figure.zero_column:
        yield f'<path class="zero" d="M{UNITS * float(x.share(np.array(0.0))):.0f} 0V{UNITS}"/>'
    for mark in marks:
        yield from _mark_elements(mark, x, y)
    yield '</svg><svg class="placed">'
    for mark in marks:
        yield from _placed(mark, x, y)
    yield '</svg><line class="axis" y2="100%"/><line class="axis" y1="100%" y2="100%" x2="100%"/>'
    longest = max((len(label) for _, label in y.ticks(6)), default=0)
    if SHEET.letter * len(y.axis.title) < _panel_px(figure) and SHEET.letter * longest < figure.left_px - SHEET.title:
        place, turned = ' y="50%"', f'transform="translate({18 - figure.left_px}) rotate(-90)" text-anchor="middle"'
    else:  # title longer than the panel is high, or overlapping labels
        place, turned = "", 'class="inside" x="6" y="15"'
    yield f'<svg{place} class="title"><text {turned}>{escape(y.axis.title)}</text></svg>'
    if last:
        yield f'<text x="50%" y="100%" dy="44" text-anchor="middle">{escape(x.axis.title)}</text>'


def _x_ticks(x: Scale, *, labels: bool) -> Iterator[str]:
    ticks = x.ticks(9)
    for i, (share, label) in enumerate(ticks):
        line = '<line y2="100%"/>' if x.axis.grid else ""
        text = f'<svg y="100%">{_text(label, 0, 20, "middle")}</svg>' if labels else ""
        rare = " rare" if len(ticks) > 7 and i % 2 and x.axis.grid else ""
        yield f'<svg class="tick x{_fixed_class(x)}{rare}" x="{100 * share:.2f}%">{line}{text}</svg>'


def _fixed_class(scale: Scale) -> str:
    """Return the attributes of ticks that do not change when the reader zooms."""
    return " given" if scale.axis.ticks is not None else ""


def _text(label: str, x: int, y: int, anchor: str) -> str:
    lines = label.split("\n")
    if len(lines) == 1:
        return f'<text x="{x}" y="{y}" text-anchor="{anchor}">{escape(label)}</text>'
    first = y - (8 * (len(lines) - 1) if anchor == "end" else 0)
    rows = (f'<tspan x="{x}" y="{first + 16 * i}">{escape(line)}</tspan>' for i, line in enumerate(lines))
    return f'<text text-anchor="{anchor}">{"".join(rows)}</text>'


def _about(mark: Mark, y: Scale) -> str:
    """Return what script and style need to know of a mark: entry of the legend, run, and the cursor's text."""
    value = f"{{y:.{y.digits()}f}} {y.axis.unit}".strip() if mark.value is None else mark.value
    parts = {"name": mark.name, "run": mark.run, "value": value}
    if value and mark.label:
        parts["label"] = mark.label
    if mark.z is not None and value:
        parts["z"] = " ".join(f"{z:.5g}" for z in np.ravel(mark.z))
    attributes = "".join(f' data-{key}="{escape(text)}"' for key, text in parts.items() if text)
    return attributes + (' class="off"' if mark.hidden else "")


def _ink(color: str) -> str:
    return f"var({color_variable(color)})"


def _mark_elements(mark: Mark, x: Scale, y: Scale) -> Iterator[str]:
    """Yield elements that stretch with the panel."""
    about = _about(mark, y)
    if isinstance(mark, Bars):
        yield from _bars(mark, x, y)
        return
    X, Y = UNITS * x.share(mark.x), UNITS * (1 - y.share(mark.y))
    match mark:
        case Band():
            yield f'<path{about} d="{path(X, Y)}Z" fill="{_ink(mark.color)}" fill-opacity="{mark.opacity:g}"/>'
        case Line():
            look = f'stroke="{_ink(mark.color)}" stroke-width="{mark.width:g}"'
            look += f' stroke-dasharray="{mark.dash}"' if mark.dash else ""
            look += f' stroke-opacity="{mark.opacity:g}"' if mark.opacity < 1 else ""
            yield f'<path{about} d="{path(X, Y)}" {look}/>'
        case Points():
            for color in dict.fromkeys(mark.colors or [mark.color]):
                is_color = (
                    np.array([name == color for name in mark.colors]) if mark.colors else np.ones(len(X), dtype=bool)
                )
                yield from _dots(mark, color, (X, Y), is_color, y)
            yield from _error_bars(mark, x, y)


def _dots(mark: Points, color: str, places: tuple[Array, Array], chosen: Array, y: Scale) -> Iterator[str]:
    """Yield points of one color as round strokes of zero length; `_placed` draws points with other outlines."""
    X, Y = (values[chosen] for values in places)
    d = path(X, Y, dots=True)
    part = Points(**{**vars(mark), "z": None if mark.z is None else np.ravel(mark.z)[chosen]})
    about, look = _about(part, y), f'class="dots" stroke="{_ink(color)}"'
    if mark.hidden:
        about, look = about.replace(' class="off"', ""), look.replace("dots", "dots off")
    if mark.opacity < 1:
        look += f' stroke-opacity="{mark.opacity:g}"'
    if mark.symbols or mark.symbol is not Symbol.CIRCLE:
        look += ' opacity="0"'
    yield f'<path{about} d="{d}" {look} stroke-width="{mark.size:g}"/>'
    if mark.hollow:
        plain = look.replace(_ink(color), _ink(PAPER))
        yield f'<path{_names(mark)} d="{d}" {plain} stroke-width="{mark.size - 5:g}"/>'


def _names(mark: Mark) -> str:
    """Return the attributes by which the script finds marks to hide or to highlight."""
    return "".join(f' data-{key}="{escape(text)}"' for key, text in (("name", mark.name), ("run", mark.run)) if text)


def path(x: Array, y: Array, *, dots: bool = False) -> str:
    """Return the path of a line, interrupted where a value is missing, or of dots, which are strokes of zero length.

    Each piece starts at M with absolute coordinates and continues with differences, which take fewer characters.
    """
    parts: list[str] = []
    before: tuple[int, int] | None = None
    for one_x, one_y in zip(x.tolist(), y.tolist(), strict=True):
        if not math.isfinite(one_x + one_y):
            before = before if dots else None
            continue
        point = round(one_x), round(one_y)
        if before is None:
            parts.append(f"M{point[0]} {point[1]}{'z' if dots else 'l'}")
        else:
            dx, dy = point[0] - before[0], point[1] - before[1]
            parts.append(
                f"{'m' if dots else '' if dx < 0 else ' '}{dx}{'' if dy < 0 else ' '}{dy}{'z' if dots else ''}"
            )
        before = point
    return "".join(parts).replace("l ", "l").replace("lM", "M").removesuffix("l")


def _error_bars(mark: Points, x: Scale, y: Scale) -> Iterator[str]:
    X, Y = UNITS * x.share(mark.x), UNITS * (1 - y.share(mark.y))
    parts: list[str] = []
    if mark.x_ends is not None:
        lo, hi = UNITS * x.share(np.asarray(mark.x_ends))
        parts += [f"M{a:.0f} {b:.0f}H{c:.0f}" for a, b, c in zip(lo, Y, hi, strict=True) if np.isfinite(a + b + c)]
    if mark.y_ends is not None:
        lo, hi = UNITS * (1 - y.share(np.asarray(mark.y_ends)))
        parts += [f"M{a:.0f} {b:.0f}V{c:.0f}" for a, b, c in zip(X, lo, hi, strict=True) if np.isfinite(a + b + c)]
    if parts:
        name = f' data-name="{escape(mark.name)}"' if mark.name else ""
        hidden = ' class="off"' if mark.hidden else ""
        yield f'<path{name}{hidden} d="{"".join(parts)}" stroke="{_ink(mark.color)}" stroke-width="2"/>'


def _corners(bars: Bars) -> tuple[Array, Array]:
    """Return left and right (2, n), and lower and upper (2, n) ends of the bars."""
    half = bars.width / 2
    if bars.lying:
        base = np.zeros_like(bars.x) if bars.base is None else bars.base
        return np.stack([base, base + bars.x]), np.stack([bars.y - half, bars.y + half])
    base = np.zeros_like(bars.y) if bars.base is None else bars.base
    return np.stack([bars.x - half, bars.x + half]), np.stack([base, base + bars.y])


def _bars(bars: Bars, x: Scale, y: Scale) -> Iterator[str]:
    (left, right), (low, high) = _corners(bars)
    xs, ys = UNITS * x.share(np.stack([left, right])), UNITS * (1 - y.share(np.stack([low, high])))
    about = f' data-name="{escape(bars.name)}"' if bars.name else ""
    for i in range(len(bars.x)):
        color = bars.colors[i] if bars.colors else bars.color
        opacity = f' fill-opacity="{bars.opacities[i]:g}"' if bars.opacities else ""
        z = float(bars.z[i]) if bars.z is not None else np.nan
        label = (bars.value or "").format(x=bars.x[i], y=bars.y[i], z=z)
        say = (
            f' data-say="{escape(f"{bars.label or bars.name}: {label}" if bars.label or bars.name else label)}"'
            if label
            else ""
        )
        yield (
            f'<rect{about}{say} x="{xs[0, i]:.0f}" y="{ys[1, i]:.0f}" width="{xs[1, i] - xs[0, i]:.0f}"'
            f' height="{ys[0, i] - ys[1, i]:.0f}" fill="{_ink(color)}"{opacity}/>'
        )


def _shade(shade: Shade, x: Scale) -> str:
    start, end = (UNITS * float(x.share(np.array(value))) for value in (shade.start, shade.end))
    look = f'class="shade{" outlined" if shade.outlined else ""}" fill="{_ink(shade.color)}"'
    look += f' stroke="{_ink(shade.color)}"' if shade.outlined else ""
    about = f' data-name="{escape(shade.name)}"' if shade.name else ""
    about += f' data-run="{escape(shade.run)}"' if shade.run else ""
    return (
        f'<rect{about} {look} fill-opacity="{shade.opacity:g}" x="{start:.0f}" y="-{UNITS}" width="{end - start:.0f}"'
        f' height="{3 * UNITS}"/>'
    )


def _placed(mark: Mark, x: Scale, y: Scale) -> Iterator[str]:
    """Yield elements that keep their shape: symbols, arrow heads and texts, at percentages of the panel."""
    about = _names(mark)
    off = " off" if mark.hidden else ""

    def placed(i: int, content: str) -> str:
        X, Y = 100 * float(x.share(mark.x[i])), 100 * (1 - float(y.share(mark.y[i])))
        return f'<svg{about} class="at{off}" x="{X:.2f}%" y="{Y:.2f}%">{content}</svg>' if np.isfinite(X + Y) else ""

    if isinstance(mark, Line) and mark.symbol:
        (seen,) = np.nonzero(np.isfinite(mark.x + mark.y))
        for i in seen[np.unique(np.linspace(0, len(seen) - 1, min(len(seen), mark.symbols)).round().astype(int))]:
            yield placed(int(i), symbol(mark.symbol, mark.color, 5.5))
    if isinstance(mark, Line) and mark.arrow:
        angle = float(np.degrees(np.arctan2(mark.y[-2] - mark.y[-1], mark.x[-1] - mark.x[-2])))  # the page's y is down
        yield placed(
            len(mark.x) - 1, f'<path transform="rotate({angle:.1f})" d="M6 0L-10 7V-7Z" fill="{_ink(mark.color)}"/>'
        )
    if isinstance(mark, Points) and (mark.symbols or mark.symbol is not Symbol.CIRCLE):
        for i in range(len(mark.x)):
            outline = mark.symbols[i] if mark.symbols else mark.symbol
            yield placed(i, symbol(outline, mark.colors[i] if mark.colors else mark.color, mark.size / 2))
    if isinstance(mark, Bars):
        middle_x, middle_y = (ends.mean(axis=0) for ends in _corners(mark))
        for X, Y, text in zip(x.share(middle_x), y.share(middle_y), mark.texts, strict=False):
            place = f'x="{100 * X:.2f}%" y="{100 * (1 - Y):.2f}%"'
            yield f'<svg class="at" {place}><text y="5" text-anchor="middle">{escape(text)}</text></svg>'


def symbol(outline: Symbol, color: str, radius: float) -> str:
    """Return the symbol around the origin, with a rim in the color of paper."""
    if outline is Symbol.CIRCLE:
        return f'<circle r="{radius:g}" fill="{_ink(color)}"/>'
    return f'<path class="symbol" transform="scale({radius:g})" d="{outline}" fill="{_ink(color)}"/>'


def _entry(figure: Figure, name: str) -> str:
    """Return a button of the legend with a sample of the line."""
    marks = figure.named(name)
    lines = [mark for mark in marks if not isinstance(mark, Band)]
    shades = [shade for shade in figure.shades if shade.name == name]
    mark: Mark | Shade = lines[0] if lines else marks[0] if marks else shades[0]
    ink, group_start = _ink(mark.color), '<g transform="translate(14 7)">'
    area = f'<rect x="6" y="1" width="16" height="12" fill="{ink}"'
    match mark:
        case Line():
            dash = f' stroke-dasharray="{mark.dash}"' if mark.dash else ""
            swatch = f'<path d="M1 7H27" stroke="{ink}" stroke-width="{min(mark.width, 5):g}"{dash}/>'
            swatch += f"{group_start}{symbol(mark.symbol, mark.color, 5)}</g>" if mark.symbol else ""
        case Points():
            swatch = f"{group_start}{symbol(mark.symbol, mark.color, min(mark.size / 2, 6))}</g>"
            if mark.hollow:
                swatch += f'{group_start}<circle r="{mark.size / 2 - 2.5:g}" fill="{_ink(PAPER)}"/></g>'
        case Shade(outlined=True):
            swatch = f'{area} fill-opacity="{mark.opacity:g}" stroke="{ink}" stroke-dasharray="3 3"/>'
        case Band() | Shade():
            swatch = f'{area} fill-opacity="{max(mark.opacity, 0.35):g}"/>'
        case _:
            swatch = f"{area}/>"
    hidden = bool(marks) and all(mark.hidden for mark in marks)
    return (
        f'<button type="button" data-entry="{escape(name)}" aria-pressed="{"false" if hidden else "true"}">'
        f'<svg class="swatch" width="28" height="14" aria-hidden="true">{swatch}</svg>{escape(name)}</button>'
    )


def chart_style() -> str:
    """Return the style of the charts, with their colors on white paper and on a dark screen."""
    light = " ".join(f"{color_variable(white)}: {white};" for white in ON_DARK)
    dark = " ".join(f"{color_variable(white)}: {black};" for white, black in ON_DARK.items())
    rules = resources.files("flightpower.analysis.pages.charts").joinpath("chart.css").read_text("utf-8")
    return f":root {{ {light} }}\n@media screen and (prefers-color-scheme: dark) {{ :root {{ {dark} }} }}\n{rules}"


def chart_script() -> str:
    """Return the script that reads values, zooms, and hides marks in the charts."""
    return resources.files("flightpower.analysis.pages.charts").joinpath("chart.js").read_text("utf-8")


def plain(value: Any) -> Any:
    """Convert NumPy arrays and numbers to Python's. Raises NotImplementedError for any other type."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise NotImplementedError(f"{type(value).__name__} is no part of JSON")
