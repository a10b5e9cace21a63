"""The drawing of a figure: every mark lies where the axes put it, and a text describes it to readers who cannot see
it."""

import re
import xml.etree.ElementTree as ET
from itertools import accumulate

import numpy as np
import pytest

from flightpower.analysis.pages.charts import power
from flightpower.analysis.pages.charts.figure import Axis, Bars, Cursor, Figure, Line, Points, Shade, Symbol
from flightpower.analysis.pages.charts.style import BLUE, ON_DARK, RED, band
from flightpower.analysis.pages.charts.svg import UNITS, chart, path, svg
from flightpower.analysis.records.flight import Results


def line_figure(x: list[float], y: list[float], name: str = "P & <Q>") -> Figure:
    figure = Figure(x=Axis("speed", "m/s", limits=(0, 10)))
    figure.y = Axis("power", "W", limits=(0, 100))
    values = np.array(y)
    figure.add(band(np.array(x), (values - 1, values + 1), BLUE, 0.3, name=name))
    figure.add(Line(x=np.array(x), y=values, color=BLUE, width=5, name=name))
    return figure


def parts(figure: Figure) -> ET.Element:
    return ET.fromstring(svg(figure))


def corners(d: str) -> list[list[tuple[int, int]]]:
    """The points of each piece of a path."""
    pieces = []
    for piece in d.split("M")[1:]:
        numbers = [int(number) for number in re.findall(r"-?\d+", piece)]
        pieces.append(list(zip(accumulate(numbers[::2]), accumulate(numbers[1::2]), strict=True)))
    return pieces


def coordinates(tree: ET.Element, width: str = "5") -> list[str]:
    return [item.get("d") or "" for item in tree.iter("path") if item.get("stroke-width") == width]


def test_a_line_lies_where_the_axes_say_with_its_gaps() -> None:
    tree = parts(line_figure([0.0, 5.0, 7.0, 10.0], [0.0, 50.0, np.nan, 100.0]))
    (line,) = coordinates(tree)
    assert corners(line) == [[(0, UNITS), (UNITS // 2, UNITS // 2)], [(UNITS, 0)]], "up is less"
    ticks = {
        text.text: item.get("x")
        for item in tree.iter("svg")
        if "tick x" in (item.get("class") or "")
        for text in item.iter("text")
    }
    assert ticks["0"] == "0.00%" and ticks["10"] == "100.00%" and ticks["4"] == "40.00%"


def test_the_points_of_a_path_are_its_values() -> None:
    """The differences in a path add up to its values, with gaps and without."""
    rng = np.random.default_rng(3)
    x, y = np.sort(rng.uniform(0, UNITS, 60)).round(), rng.uniform(-UNITS, 2 * UNITS, 60).round()
    y[[0, 20, 21, 59]] = np.nan
    finite_points = [(round(a), round(b)) for a, b in zip(x, y, strict=True) if np.isfinite(b)]
    pieces = corners(path(x, y))
    assert [point for piece in pieces for point in piece] == finite_points and len(pieces) == 2
    assert corners(path(x, y, dots=True)) == [finite_points], "dots have no line between them"


def test_panels_stand_above_one_another_each_with_its_axis() -> None:
    figure = Figure(2, x=Axis("x", limits=(0, 10)))
    for panel, ends in ((1, (0.0, 100.0)), (2, (-3.0, 3.0))):
        figure.ys[panel - 1] = Axis("y", limits=ends)
        figure.add(Line(x=np.array([0.0, 10.0]), y=np.array(ends), panel=panel, color=BLUE, width=5))
    tree = parts(figure)
    assert [corners(d) for d in coordinates(tree)] == [[[(0, UNITS), (UNITS, 0)]]] * 2, "each fills its panel"
    tops = [
        (float((item.get("y") or "")[:-1]), float((item.get("height") or "")[:-1]))
        for item in tree.iter("svg")
        if item.get("class") == "panel"
    ]
    (top, high), (lower, also_high) = tops
    assert top == 0 and high == also_high and high < lower and lower + high == pytest.approx(100, abs=0.02)
    assert [node.text for node in tree.iter("text")].count("6") == 1, "one x axis"


def test_equal_scales_draw_a_circle_round() -> None:
    angle = np.linspace(0, 2 * np.pi, 73)
    figure = Figure(equal=True)
    figure.add(Line(x=300 * np.cos(angle), y=300 * np.sin(angle), color=BLUE, width=5))
    (piece,) = corners(coordinates(parts(figure))[0])
    ratio = int(re.search(r"equal r(\d+)", svg(figure))[1]) / 10  # type: ignore[index]
    wide, high = np.ptp(np.array(piece), axis=0)
    assert wide * ratio == pytest.approx(high, rel=1e-3)


def test_a_bar_begins_at_its_base_and_a_lying_one_goes_to_the_right() -> None:
    figure = Figure(x=Axis(limits=(0, 10)))
    figure.y = Axis(limits=(0, 10))
    place = np.array([5.0])
    figure.add(
        Bars(x=place, y=np.array([2.0]), base=np.array([3.0]), width=2, color=BLUE, name="noise", value="{y:.1f} %"),
        Bars(x=np.array([4.0]), y=place, width=2, lying=True, color=RED),
    )
    bars = [item for item in parts(figure).iter("rect") if item.get("class") != "frame"]
    up, lying = ([int(bar.get(key) or 0) for key in ("x", "y", "width", "height")] for bar in bars)
    assert up == [4000, 5000, 2000, 2000] and lying == [0, 4000, 4000, 2000]
    assert bars[0].get("data-say") == "noise: 2.0 %" and bars[1].get("data-say") is None


def test_a_symbol_keeps_its_shape_at_its_place() -> None:
    figure = line_figure([0.0, 10.0], [0.0, 100.0])
    figure.add(Points(x=np.array([2.5]), y=np.array([75.0]), color=RED, symbol=Symbol.DIAMOND, size=14, name="best"))
    (place,) = [item for item in parts(figure).iter("svg") if item.get("class") == "at"]
    assert (place.get("x"), place.get("y"), place.get("data-name")) == ("25.00%", "25.00%", "best")


def test_who_does_not_see_a_figure_is_reported_axes_and_lines() -> None:
    tree = parts(line_figure([0.0, 10.0], [0.0, 100.0]))
    assert tree.findtext("title") == "power, W"
    assert tree.findtext("desc") == "power, W from 0 to 100, against speed, m/s from 0 to 10. Shown: P & <Q>."
    assert tree.get("role") == "graphics-document" and tree.get("tabindex") == "0"


def test_the_cursor_is_reported_what_to_say() -> None:
    figure = line_figure([0.0, 10.0], [0.0, 100.0])
    figure.cursor = Cursor.NEAREST
    figure.add(Line(x=np.zeros(2), y=np.ones(2), color=RED, width=3, label="run 1", value="{y:+.1f} %", run="r1"))
    figure.shades.append(Shade(2.0, 4.0, RED, run="r1"))
    tree = parts(figure)
    assert tree.get("data-cursor") == "nearest"
    (line,) = [item for item in tree.iter("path") if item.get("data-label")]
    assert (line.get("data-value"), line.get("data-run")) == ("{y:+.1f} %", "r1")
    read = [item for item in tree.iter("path") if item.get("data-value")]
    (plain,) = [item for item in read if item.get("stroke-width") == "5"]
    assert len(read) == 2, "the lines, not the band"
    assert plain.get("data-value") == "{y:.0f} W", "the axis' unit, to a hundredth of its range"
    (shade,) = [item for item in tree.iter("rect") if item.get("data-run") == "r1"]
    assert (shade.get("x"), shade.get("width")) == ("2000", "2000")


def test_the_curve_of_the_report_has_all_its_parts(with_battery: Results) -> None:
    figure = power.power_required(with_battery)
    text = chart(figure, "power")
    entries = re.findall(r'data-entry="([^"]+)"', text)
    assert entries == figure.entries() and "power required" in entries and len(entries) >= 4
    assert {"true airspeed, m/s", "power, W"} <= {node.text for node in parts(figure).iter("text")}
    assert svg(figure).count("fill-opacity") == 1, "the band"
    colors = set(re.findall(r"var\(--c(\w+)\)", text))
    assert {f"#{color}" for color in colors} <= {color.lower() for color in ON_DARK}, "each has one on a dark page"


def ends_of(axis: Axis, y: list[float]) -> tuple[float, float]:
    figure = Figure()
    figure.y = axis
    figure.add(Line(x=np.arange(len(y)), y=np.array(y), color=BLUE))
    (panel,) = [item for item in parts(figure).iter("svg") if item.get("class") == "panel"]
    lo, hi = (panel.get("data-y") or "").split()
    return float(lo), float(hi)


def test_an_axis_shows_what_is_drawn_zero_where_asked_and_powers_of_ten_by_their_logarithm() -> None:
    lo, hi = ends_of(Axis("y"), [50.0, 100.0])
    assert 45 < lo < 50 and 100 < hi < 105
    lo, hi = ends_of(Axis("y", from_zero=True), [50.0, 100.0])
    assert lo == 0 and hi > 100
    assert ends_of(Axis("y", limits=(10, 20)), [50.0, 100.0]) == (10, 20)
    lo, hi = ends_of(Axis("y", logarithmic=True), [1e-6, 1.0, np.nan])
    assert -6.5 < lo < -6 and 0 < hi < 0.5
    figure = Figure()
    figure.y = Axis("y", logarithmic=True)
    figure.add(Line(x=np.arange(3), y=np.array([1e-4, 1e-2, 1.0]), color=BLUE, width=5))
    ((_, lower), (_, middle), (_, upper)) = corners(coordinates(parts(figure))[0])[0]
    assert middle == pytest.approx((lower + upper) / 2, abs=1), "equal factors are equal distances"


def test_a_title_longer_than_its_panel_stands_inside_it() -> None:
    for name, inside in (("V", False), ("a quantity with a name that is long", True)):
        figure = Figure(4, height_px=400)
        figure.ys = [Axis(name, limits=(0, 1)) for _ in range(4)]
        figure.add(Line(x=np.arange(2.0), y=np.arange(2.0), color=BLUE))
        assert ('class="inside"' in svg(figure)) == inside
