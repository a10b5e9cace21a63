"""The figure that a page shows before any script runs."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest

from analysis.pages.charts import power
from analysis.pages.charts.style import BLUE, ON_DARK, Figure, add_band, styled
from analysis.pages.charts.svg import SHEET, svg
from analysis.records.flight import Results


def line_figure(x: list[float], y: list[float], name: str = "P & <Q>") -> Figure:
    figure = Figure()
    add_band(figure, np.array(x), (np.array(y) - 1, np.array(y) + 1), BLUE, 0.3)
    figure.add_scatter(x=x, y=y, mode="lines", line={"color": BLUE, "width": 5}, name=name)
    figure.update_xaxis(title="speed, m/s", range=[0, 10])
    figure.update_yaxis(title="power, W", range=[0, 100])
    return styled(figure, 400)


def test_a_line_lies_where_the_axes_say_with_its_gaps() -> None:
    text = svg(line_figure([0.0, 5.0, 7.0, 10.0], [0.0, 50.0, np.nan, 100.0]))
    tree = ET.fromstring(text)
    paths = [path.get("d") for path in tree.iter("path") if path.get("stroke-width") == "5"]
    curve = next(path for path in paths if path and path.count("M") == 2)
    corners = [tuple(map(float, pair)) for pair in re.findall(r"[ML]([\d.]+) ([\d.]+)", curve)]
    (left, bottom), (middle_x, middle_y), (right, top) = corners
    assert (middle_x, middle_y) == pytest.approx(((left + right) / 2, (bottom + top) / 2), abs=0.1)
    ticks = {
        node.text: float(node.get("x") or 0)
        for node in tree.iter("text")
        if node.get("text-anchor") == "middle" and node.get("x")
    }
    assert ticks["0"] == pytest.approx(left, abs=0.1) and ticks["10"] == pytest.approx(right, abs=0.1)
    assert 0 < left < right < SHEET.width and 0 < top < bottom < 400
    assert "P & <Q>" in [node.text for node in tree.iter("text")], "text of a user is text"


def test_panels_stand_above_one_another_each_with_its_axis() -> None:
    figure = Figure(2, 0.1)
    for panel, values in ((1, [0.0, 100.0]), (2, [-3.0, 3.0])):
        figure.add_scatter(x=[0.0, 10.0], y=values, panel=panel, mode="lines", line={"color": BLUE, "width": 5})
        figure.update_yaxis(panel=panel, title="y", range=values)
    figure.update_xaxis(title="x", range=[0, 10])
    tree = ET.fromstring(svg(styled(figure, 500)))
    lines = [path.get("d") or "" for path in tree.iter("path") if path.get("stroke-width") == "5"]
    (low, high), (lower, higher) = ([float(y) for y in re.findall(r" ([\d.]+)", d)] for d in lines)
    assert 0 < high < low < higher < lower < 500 and low - high == pytest.approx(lower - higher, abs=1.1)
    assert [node.text for node in tree.iter("text")].count("6") == 1, "one x axis"


def test_the_curve_of_the_report_has_all_its_parts(with_battery: Results) -> None:
    figure = power.power_required(with_battery)
    text = svg(figure)
    tree = ET.fromstring(text)
    said = [node.text for node in tree.iter("text")]
    names = [t["name"] for t in figure.data if t.get("name") and t.get("showlegend", True)]
    assert set(names) <= set(said) and {"true airspeed, m/s", "power, W"} <= set(said)
    assert text.count("fill-opacity") == 1, "the band"
    colors = set(re.findall(r"var\(--c(\w+)\)", text))
    assert {f"#{color}" for color in colors} <= {color.lower() for color in ON_DARK}, "each has one on a dark page"
