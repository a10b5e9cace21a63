"""What a reader does with the report in a browser: with mouse and keyboard, on a laptop and on a phone."""

import re
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from flightpower import Options, analyze
from flightpower.analysis.records.flight import Results
from tests.browser import BOTH_WIDTHS, CHROMIUM, WIDTHS, Browser

pytestmark = [
    pytest.mark.xdist_group("chain"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)"),
]

DRAWN = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"  # and what is drawn in a frame


@pytest.fixture(params=WIDTHS, ids="{} px".format)
def report(request: pytest.FixtureRequest, flown: Path, browser: Browser) -> Iterator[Browser]:
    """The demonstration's report, newly opened; nothing on the console at the end."""
    browser.show(flown / "log.report" / "report.html", request.param)
    yield browser
    assert browser.complaints == []


def put(browser: Browser, field: str, value: str) -> None:
    """Type a number into a control."""
    box = f"document.querySelector('[data-field={field}] input[type=number]')"
    browser.value_of(f"{box}.value = '{value}'; {box}.dispatchEvent(new Event('input')); {DRAWN}")


def cell_of(browser: Browser, row: int, column: int = 2) -> str:
    return browser.value_of(f"document.querySelector('#other-conditions tbody').rows[{row}].cells[{column}].innerText")


def names(browser: Browser) -> list[str]:
    return browser.value_of("charts.power.entries()")


def test_another_mass_changes_curve_and_answers_at_once_and_back(report: Browser, flown: Path) -> None:
    results = msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)
    assert results.use is not None
    heavier = next(case for case in results.use.loadings if case.title == "600 g more")
    before = names(report)
    assert f"{results.use.loadings[0].range_m.value / 1000:.1f} (" in cell_of(report, 2, 1)
    put(report, "mass", f"{heavier.weight_N / 9.80665:.6f}")
    assert f"{heavier.range_m.value / 1000:.1f} (" in cell_of(report, 2), "as Python has it"
    assert len(names(report)) == len(before) + 1 and "kg/m³" in names(report)[-1]
    slowest = results.power_required[0].speed_mps * (heavier.weight_N / results.test.weight_N) ** 0.5
    assert cell_of(report, 5) == f"{slowest:.1f}", "no speed is offered below the lift coefficients flown"
    report.value_of(f"document.querySelector('#other-conditions button').click(); {DRAWN}")
    assert names(report) == before and cell_of(report, 2) == "as flown"


def test_a_control_moves_with_the_keyboard(report: Browser) -> None:
    report.value_of("document.querySelector('[data-field=height] input[type=range]').focus()")
    thin_air = "Number(document.querySelector('#other-conditions output').innerText.match(/[\\d.]+/)[0])"
    before = report.value_of(thin_air)
    for kind in ("rawKeyDown", "keyUp"):
        report.command("Input.dispatchKeyEvent", type=kind, key="PageUp", windowsVirtualKeyCode=33)
    report.value_of(DRAWN)
    assert report.value_of(thin_air) < before, "higher is thinner"


@pytest.mark.parametrize("wrong", ["", "-3", "1e9"])
def test_an_impossible_value_changes_nothing(report: Browser, wrong: str) -> None:
    before = names(report)
    put(report, "mass", wrong)
    assert names(report) == before and cell_of(report, 2) == "as flown"


ROW = "document.querySelectorAll('#flight .table tbody tr')"
SHOWN = "document.getElementById('run-shown').hidden ? '' : document.querySelector('#run-shown b').innerText"


def number_of_the_deceleration(flown: Path) -> int:
    results = msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)
    return [run.kind for run in results.runs].index("deceleration")


def click(browser: Browser, x: float, y: float) -> None:
    browser.command("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    for kind in ("mousePressed", "mouseReleased"):
        browser.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    browser.value_of(DRAWN)


def place(browser: Browser, figure: str, x: float, y: float) -> list[float]:
    """The window coordinates of a point of a figure, after scrolling to it."""
    return browser.value_of(f"""(async () => {{
      const element = document.getElementById('{figure}');
      element.scrollIntoView({{block: 'center'}});
      return charts['{figure}'].place({x}, {y});
    }})()""")


@pytest.mark.parametrize("report", BOTH_WIDTHS, indirect=True, ids="{} px".format)
def test_a_run_is_shown_everywhere_from_the_table_a_band_or_the_track(report: Browser, flown: Path) -> None:
    i = number_of_the_deceleration(flown)
    results = msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)
    run = results.runs[i]
    label = f"Run {i + 1}: {run.name}"
    report.value_of(f"{ROW}[{i}].focus()")
    for kind in ("rawKeyDown", "keyUp"):
        report.command("Input.dispatchKeyEvent", type=kind, key="Enter", windowsVirtualKeyCode=13)
    assert report.value_of(SHOWN) == label, "with the keyboard"
    assert f"{label}, alone" in names(report)
    faded = "document.querySelectorAll('#fits figure.faded').length"
    assert report.value_of(faded) == len(results.single_runs) - 1
    report.value_of("document.querySelector('#run-shown [data-do=close]').click()")
    assert report.value_of(SHOWN) == "" and report.value_of(faded) == 0
    middle = (run.start_s + run.end_s) / 2
    click(report, *place(report, "timeline", middle, run.lowest_speed_mps))
    assert report.value_of(SHOWN) == label, "its band in the figure over time"
    assert report.value_of("document.querySelectorAll('#timeline .shade.selected').length") == 3, "in each panel"
    report.command("Input.dispatchKeyEvent", type="rawKeyDown", key="Escape", windowsVirtualKeyCode=27)
    assert report.value_of(SHOWN) == ""
    assert results.track is not None
    index = int(np.argmin(np.abs(np.array(results.track.t_s) - middle)))
    click(report, *place(report, "track", results.track.east_m[index], results.track.north_m[index]))
    assert report.value_of(SHOWN) == label, "its line over the ground"


@pytest.mark.slow
def test_a_run_left_out_gives_the_curve_of_an_analysis_without_it(report: Browser, flown: Path, tmp_path: Path) -> None:
    i = number_of_the_deceleration(flown)
    report.value_of(f"{ROW}[{i}].click(); document.querySelector('#run-shown [data-do=leave]').click(); {DRAWN}")
    assert f"preview without run {i + 1}" in names(report)
    assert f"without run {i + 1}" in report.value_of("document.getElementById('preview').innerText")
    (tmp_path / "runs.toml").write_text(report.value_of("document.getElementById('preview').editedRuns()"), "utf-8")
    again = analyze(flown / "log.mcap", Options(runs=tmp_path / "runs.toml")).results
    curve = report.value_of("document.getElementById('preview').curve")
    V, power = np.array([(point.speed_mps, point.power_W) for point in again.power_required]).T
    inside = (np.array(curve["x"]) >= V[0]) & (np.array(curve["x"]) <= V[-1])
    expected = np.interp(np.array(curve["x"])[inside], V, power)
    assert np.array(curve["y"])[inside] == pytest.approx(expected, rel=2e-3)
    j = [run.kind for run in again.runs].index("acceleration")
    leave = "document.querySelector('#run-shown [data-do=leave]')"
    report.value_of(f"document.querySelectorAll('#run-shown [data-do=close]')[0].click(); {ROW}[{j}].click()")
    assert report.value_of(f"{leave}.disabled"), "the last run stays"
    report.value_of(f"document.querySelector('#preview [data-do=all]').click(); {DRAWN}")
    assert report.value_of("document.getElementById('preview').hidden")


READ = "document.querySelector('#{} .readout').innerText"


def test_the_cursor_reads_every_line_at_its_speed(report: Browser, flown: Path) -> None:
    """It works with pointer and keyboard, and shows the values of the results."""
    results = msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)
    V, P = np.array([(point.speed_mps, point.power_W) for point in results.power_required]).T
    x, y = place(report, "power", float(V.mean()), 50.0)
    report.command("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    speed, *lines = report.value_of(READ.format("power")).split("\n")
    assert speed.startswith("true airspeed 1") and speed.endswith(" m/s")
    cursor_mps = float(speed.split()[2])
    (line,) = [line for line in lines if line.startswith("power required: ")]
    assert float(line.split()[2]) == pytest.approx(np.interp(cursor_mps, V, P), abs=0.3)
    assert any(line.startswith("available at full throttle: ") for line in lines)
    report.value_of("charts.power.svg.focus()")
    report.press("ArrowRight", 39)
    further = float(report.value_of(READ.format("power")).split()[2])
    assert cursor_mps < further < cursor_mps + 0.5, "a hundredth of the axis"
    report.value_of("charts.power.svg.blur()")
    assert report.value_of("document.querySelector('#power .readout').hidden")


def test_over_the_ground_the_cursor_names_the_run_beneath_it(report: Browser, flown: Path) -> None:
    results = msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)
    run = results.runs[number_of_the_deceleration(flown)]
    assert results.track is not None
    index = int(np.argmin(np.abs(np.array(results.track.t_s) - (run.start_s + run.end_s) / 2)))
    east, north = results.track.east_m[index], results.track.north_m[index]
    x, y = place(report, "track", east, north)
    report.command("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    name, message = report.value_of(READ.format("track")).strip().split(": ")
    assert name == run.name
    numbers = [float(number.replace("−", "-")) for number in re.findall(r"[−\d]+", message)]
    assert numbers == pytest.approx([east, north], abs=40)


@pytest.mark.parametrize("report", BOTH_WIDTHS, indirect=True, ids="{} px".format)
def test_a_figure_is_zoomed_by_dragging_and_by_key_and_shown_whole_again(report: Browser) -> None:
    texts = "document.querySelectorAll('#timeline .panel:last-of-type .tick.x text')"
    ticks = f"[...{texts}].map(one => Number(one.textContent))"
    all_ticks = report.value_of(ticks)
    lo, hi = report.value_of("charts.timeline.panels[0].x")
    middle = (lo + hi) / 2
    start, end = (place(report, "timeline", t, 15.0) for t in (middle - 20, middle + 20))
    report.drag((start[0], start[1]), (end[0], end[1]))
    zoomed = report.value_of(ticks)
    assert middle - 25 < min(zoomed) and max(zoomed) < middle + 25 and len(zoomed) >= 3
    views = report.value_of("charts.timeline.panels.map(({view}) => `${view[0].toFixed()} ${view[2].toFixed()}`)")
    assert len(set(views)) == 1, "panels share their x axis"
    again = "[...document.querySelectorAll('#timeline ~ .of-figure [data-reset]')][0]"
    assert not report.value_of(f"{again}.hidden")
    report.value_of(f"{again}.click()")
    assert report.value_of(ticks) == all_ticks and report.value_of(f"{again}.hidden")
    report.value_of("charts.timeline.svg.focus()")
    report.press("+", 187)
    assert len(report.value_of(ticks)) >= 3 and report.value_of(ticks) != all_ticks
    report.press("0", 48)
    assert report.value_of(ticks) == all_ticks


def test_a_line_is_hidden_and_shown_by_its_entry_in_the_legend(report: Browser) -> None:
    entry = "document.querySelector('#power [data-entry=\"power required\"]')"
    parts = "document.querySelectorAll('#power .chart [data-name=\"power required\"]')"
    seen = f"[...{parts}].filter(one => getComputedStyle(one).display !== 'none').length"
    before = report.value_of(seen)
    assert before >= 2, "band and curve"
    report.value_of(f"{entry}.click()")
    assert report.value_of(seen) == 0 and report.value_of(f"{entry}.getAttribute('aria-pressed')") == "false"
    report.value_of(f"{entry}.click()")
    assert report.value_of(seen) == before


def test_a_saved_figure_is_a_drawing_of_its_own(report: Browser) -> None:
    text = report.value_of("charts.timeline.text()")
    tree = ET.fromstring(text)
    texts = [item.text for item in tree.iter() if item.tag.endswith("text")]
    assert "speed, m/s" in texts and "deceleration" in texts and "--c000000: #000000" in text
    assert "http" not in text.replace("http://www.w3.org/2000/svg", "")
