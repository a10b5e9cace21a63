"""The content of a figure: panels above one another on one x axis, and the lines, bands, points and bars in them.

Only `svg.py` draws figures. `chart.js` reads values from the drawing, zooms it, and hides what the reader clicks in the
legend.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from flightpower.flight.arrays import Array


class Cursor(StrEnum):
    """Whether the cursor reads every line at its x, or only the nearest point."""

    EVERY_LINE = "every line"
    NEAREST = "nearest"


class Dash(StrEnum):
    """Lengths of dashes and gaps in px."""

    SOLID = ""
    DASHED = "9 6"
    LONG = "12 6"
    DOTTED = "3 4"
    DASH_DOT = "9 4 3 4"


class Symbol(StrEnum):
    """Outlines of marks within a circle of radius 1."""

    CIRCLE = "circle"
    SQUARE = "M-.8-.8H.8V.8H-.8Z"
    DIAMOND = "M0-1.1L1.1 0 0 1.1-1.1 0Z"
    UP = "M0-1.1L1.1.8H-1.1Z"
    DOWN = "M0 1.1L1.1-.8H-1.1Z"
    LEFT = "M-1.1 0L.8-1.1V1.1Z"
    RIGHT = "M1.1 0L-.8-1.1V1.1Z"
    PLUS = "M-.35-1H.35V-.35H1V.35H.35V1H-.35V.35H-1V-.35H-.35Z"
    CROSS = "M-1-.6L-.6-1 0-.4 .6-1 1-.6 .4 0 1 .6 .6 1 0 .4-.6 1-1 .6-.4 0Z"
    HOURGLASS = "M-1-1H1L-1 1H1Z"
    BOWTIE = "M-1-1V1L1-1V1Z"
    STAR = "M0-1.2L.3-.4 1.15-.37 .48.15 .7.97 0 .5-.7.97-.48.15-1.15-.37-.3-.4Z"


@dataclass
class Axis:
    """Name and unit of the quantity along an axis.

    limits : values at its ends; by default those of the marks drawn     from_zero : whether the range includes zero
    ticks : labels by value, instead of round values     step : between ticks     most_ticks : limit for round values
    grid : lines across the panel     logarithmic : powers of ten at equal distances     decimals : in the cursor's
    readout
    """

    name: str = ""
    unit: str = ""
    limits: tuple[float, float] | None = None
    from_zero: bool = False
    logarithmic: bool = False
    ticks: Mapping[float, str] | None = None
    step: float | None = None
    most_ticks: int = 9
    grid: bool = True
    decimals: int | None = None  # None: enough decimals to resolve a hundredth of the range

    @property
    def title(self) -> str:
        return f"{self.name}, {self.unit}" if self.unit else self.name


@dataclass(kw_only=True)
class Mark:
    """A mark drawn at x (n,), y (n,); NaN interrupts it.

    name : entry of the legend that shows and hides all marks with this name; "" for none
    label : the cursor's name for it, if different from `name`
    value : the cursor's text, such as "{y:.1f} W" or "{z:.2f} deg"; "" for none; None for the value in the axis' unit
    z : (n,) a third value     run : the run that the mark shows     hidden : whether it is hidden at first
    """

    x: Array
    y: Array
    color: str
    panel: int = 1
    name: str = ""
    label: str = ""
    value: str | None = None
    z: Array | None = None
    run: str = ""
    hidden: bool = False

    def __post_init__(self) -> None:
        self.x, self.y = np.asarray(self.x, dtype=float), np.asarray(self.y, dtype=float)


@dataclass(kw_only=True)
class Line(Mark):
    """symbol : drawn on at most `symbols` of its points     arrow : whether it ends in an arrow"""

    width: float = 2
    dash: Dash = Dash.SOLID
    symbol: Symbol | None = None
    symbols: int = 1000
    arrow: bool = False
    opacity: float = 1.0


@dataclass(kw_only=True)
class Band(Mark):
    """An area with the outline x, y. The cursor reads the line within it, not the band."""

    value: str | None = ""
    opacity: float = 0.3


@dataclass(kw_only=True)
class Points(Mark):
    """size : px across     hollow : white with a rim of the color

    x_ends, y_ends : (2, n) ends of each point's error bars     colors, symbols : (n,) instead of common ones
    """

    size: float = 7
    hollow: bool = False
    symbol: Symbol = Symbol.CIRCLE
    x_ends: Array | None = None
    y_ends: Array | None = None
    opacity: float = 1.0
    colors: Sequence[str] | None = None
    symbols: Sequence[Symbol] | None = None


@dataclass(kw_only=True)
class Bars(Mark):
    """Bars that rise from `base` (n,) by y or, if lying, extend from `base` to the right by x at the heights y.

    width : of all bars, in the unit of the other axis     texts : (n,) in the bars     colors, opacities : (n,) instead
    of common ones
    """

    width: float
    base: Array | None = None
    lying: bool = False
    texts: Sequence[str] = ()
    colors: Sequence[str] | None = None
    opacities: Sequence[float] | None = None


@dataclass
class Shade:
    """A shaded stretch of the x axis across all panels. name : entry of the legend     run : the run to choose there"""

    start: float
    end: float
    color: str
    opacity: float = 0.18
    outlined: bool = False
    name: str = ""
    run: str = ""


@dataclass
class Figure:
    """panels : how many, numbered from 1 at the top     height_px : without the legend     cursor : what it reads
    equal : whether x and y have the same scale     legend_reversed : whether the legend begins with the topmost mark
    heading : above a figure beside others     rows : whether its height depends on a number of rows, also on paper
    left_px : width for the labels of the y axis
    """

    panels: int = 1
    height_px: int = 400
    cursor: Cursor = Cursor.EVERY_LINE
    equal: bool = False
    legend_reversed: bool = False
    heading: str = ""
    rows: bool = False
    left_px: int = 74
    x: Axis = field(default_factory=Axis)
    marks: list[Mark] = field(default_factory=list)
    shades: list[Shade] = field(default_factory=list)
    zero_lines: set[int] = field(default_factory=set)  # panels with a line at y = 0
    zero_column: bool = False  # whether there is a line at x = 0

    def __post_init__(self) -> None:
        self.ys = [Axis() for _ in range(self.panels)]

    @property
    def y(self) -> Axis:
        """The y axis of the first panel."""
        return self.ys[0]

    @y.setter
    def y(self, axis: Axis) -> None:
        self.ys[0] = axis

    def add(self, *marks: Mark) -> None:
        self.marks += marks

    def named(self, name: str) -> list[Mark]:
        """Return the marks of an entry of the legend."""
        return [mark for mark in self.marks if mark.name == name]

    def entries(self) -> list[str]:
        """Return the names in the legend, in the order shown."""
        names = [mark.name for mark in self.marks if not isinstance(mark, Band)]
        names += [mark.name for mark in self.marks] + [shade.name for shade in self.shades]
        titles = [name for name in dict.fromkeys(names) if name]
        return titles[::-1] if self.legend_reversed else titles
