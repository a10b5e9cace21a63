"""What a figure shows: panels above one another on one x axis, and the lines, bands, points and bars in them.

`svg.py` draws a figure, `chart.js` reads values from the drawing, zooms it and hides what the reader clicks in the
legend. Nothing else draws a figure.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

import numpy as np

from flightpower.flight.arrays import Array


class Cursor(StrEnum):
    """What the cursor reads: every line at its x, or only the nearest point."""

    EVERY_LINE = "every line"
    NEAREST = "nearest"


class Dash(StrEnum):
    """Lengths of strokes and gaps in px."""

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
    """Name and unit of what is measured along an axis.

    limits : values at its ends, if not those of what is drawn     from_zero : zero is among the values drawn
    ticks : labels by value, in place of round values     step : between ticks     most_ticks : of round values
    grid : lines across the panel     logarithmic : powers of ten at equal distances
    decimals : of what the cursor reads
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
    """Something drawn at x (n,), y (n,); NaN interrupts it.

    name : entry of the legend that shows and hides it, with all marks of that name; "" none
    label : what the cursor calls it, if not by its name
    value : what the cursor says, such as "{y:.1f} W" or "{z:.2f} deg"; "" nothing; None the value in the axis' unit
    z : (n,) a third value     run : of the flight, that the mark shows     hidden : until the reader asks for it
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
    """symbol : on at most `symbols` of its points     arrow : at its end"""

    width: float = 2
    dash: Dash = Dash.SOLID
    symbol: Symbol | None = None
    symbols: int = 1000
    arrow: bool = False
    opacity: float = 1.0


@dataclass(kw_only=True)
class Band(Mark):
    """An area with the outline x, y. The cursor reads the line within."""

    value: str | None = ""
    opacity: float = 0.3


@dataclass(kw_only=True)
class Points(Mark):
    """size : px across     hollow : white with a rim of the color

    x_ends, y_ends : (2, n) ends of the bars of each point     colors, symbols : (n,) in place of the common one
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
    """Bars up from `base` (n,) by y, or, lying, to the right by x at the heights y.

    width : of all bars, in the unit of the other axis     texts : (n,) in the bars
    colors, opacities : (n,) in place of the common ones
    """

    width: float
    base: Array | None = None
    lying: bool = False
    texts: Sequence[str] = ()
    colors: Sequence[str] | None = None
    opacities: Sequence[float] | None = None


@dataclass
class Shade:
    """A stretch of the x axis, across all panels. name : entry of the legend     run : that may be chosen there"""

    start: float
    end: float
    color: str
    opacity: float = 0.18
    outlined: bool = False
    name: str = ""
    run: str = ""


@dataclass
class Figure:
    """panels : counted from 1, at the top     height_px : without the legend     cursor : what it reads
    equal : one unit is as long along x as along y     legend_reversed : it begins with what lies on top
    heading : above a figure beside others     rows : its height counts rows, also on paper
    left_px : for the labels of the y axis
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
    zero_column: bool = False  # a line at x = 0

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
        """The marks of an entry of the legend."""
        return [mark for mark in self.marks if mark.name == name]

    def entries(self) -> list[str]:
        """Names in the legend, in its order."""
        names = [mark.name for mark in self.marks if not isinstance(mark, Band)]
        names += [mark.name for mark in self.marks] + [shade.name for shade in self.shades]
        titles = [name for name in dict.fromkeys(names) if name]
        return titles[::-1] if self.legend_reversed else titles
