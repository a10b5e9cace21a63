"""What a reader does with the report in a browser: with mouse and keyboard, on a laptop and on a phone."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import numpy as np
import pytest

from analysis.records.flight import Results
from flightpower import Options, analyze
from tests.browser import CHROMIUM, Browser

pytestmark = [
    pytest.mark.xdist_group("chain"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)"),
]

WIDTHS = (1280, 400)
DRAWN = "new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"  # and what is drawn in a frame


@pytest.fixture(params=WIDTHS, ids="{} px".format)
def report(request: pytest.FixtureRequest, flown: Path, browser: Browser) -> Iterator[Browser]:
    """The demonstration's report, newly opened; nothing on the console at the end."""
    browser.show(flown / "log.report" / "report.html", request.param)
    yield browser
    assert browser.complaints == []


def put(browser: Browser, field: str, value: str) -> None:
    """A number typed into a control."""
    box = f"document.querySelector('[data-field={field}] input[type=number]')"
    browser.value_of(f"{box}.value = '{value}'; {box}.dispatchEvent(new Event('input')); {DRAWN}")


def asked(browser: Browser, row: int, column: int = 2) -> str:
    return browser.value_of(f"document.querySelector('#other-conditions tbody').rows[{row}].cells[{column}].innerText")


def names(browser: Browser) -> list[str]:
    drawn = "document.getElementById('power').data"
    return browser.value_of(f"{drawn}.filter(trace => trace.showlegend !== false).map(trace => trace.name)")


def test_another_mass_changes_curve_and_answers_at_once_and_back(report: Browser, flown: Path) -> None:
    results = msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)
    assert results.use is not None
    heavier = next(case for case in results.use.loadings if case.title == "600 g more")
    before = names(report)
    assert f"{results.use.loadings[0].range_m.value / 1000:.1f} (" in asked(report, 2, 1)
    put(report, "mass", f"{heavier.weight_N / 9.80665:.6f}")
    assert f"{heavier.range_m.value / 1000:.1f} (" in asked(report, 2), "as Python has it"
    assert len(names(report)) == len(before) + 1 and "kg/m³" in names(report)[-1]
    slowest = results.power_required[0].speed_mps * (heavier.weight_N / results.test.weight_N) ** 0.5
    assert asked(report, 5) == f"{slowest:.1f}", "no speed is offered below the lift coefficients flown"
    report.value_of(f"document.querySelector('#other-conditions button').click(); {DRAWN}")
    assert names(report) == before and asked(report, 2) == "as flown"


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
    assert names(report) == before and asked(report, 2) == "as flown"


ROW = "document.querySelectorAll('#flight .table tbody tr')"
SHOWN = "document.getElementById('run-shown').hidden ? '' : document.querySelector('#run-shown b').innerText"


def number_of_the_deceleration(flown: Path) -> int:
    results = msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)
    return [run.kind for run in results.runs].index("deceleration")


def click(browser: Browser, x: float, y: float) -> None:
    browser.command("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    browser.value_of("new Promise(done => setTimeout(done, 250))")  # Plotly looks for what is under the pointer
    for kind in ("mousePressed", "mouseReleased"):
        browser.command("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", clickCount=1)
    browser.value_of(DRAWN)


def place(browser: Browser, figure: str, x: float, y: float) -> list[float]:
    """Where a point of a figure is in the window, scrolled to it."""
    return browser.value_of(f"""(async () => {{
      const element = document.getElementById('{figure}');
      element.scrollIntoView({{block: 'center'}});
      await new Promise(done => setTimeout(done, 200));
      const box = element.getBoundingClientRect(), {{xaxis, yaxis}} = element._fullLayout;
      return [box.left + xaxis._offset + xaxis.d2p({x}), box.top + yaxis._offset + yaxis.d2p({y})];
    }})()""")


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
    assert report.value_of(faded) == len(results.one_by_one) - 1
    report.value_of("document.querySelector('#run-shown [data-do=close]').click()")
    assert report.value_of(SHOWN) == "" and report.value_of(faded) == 0
    middle = (run.start_s + run.end_s) / 2
    click(report, *place(report, "timeline", middle, run.lowest_speed_mps))
    assert report.value_of(SHOWN) == label, "its band in the figure over time"
    dim = "document.getElementById('timeline').layout.shapes.filter(shape => shape.opacity === 0.5).length"
    assert report.value_of(dim) == 1
    report.command("Input.dispatchKeyEvent", type="rawKeyDown", key="Escape", windowsVirtualKeyCode=27)
    assert report.value_of(SHOWN) == ""
    assert results.track is not None
    at = int(np.argmin(np.abs(np.array(results.track.t_s) - middle)))
    click(report, *place(report, "track", results.track.east_m[at], results.track.north_m[at]))
    assert report.value_of(SHOWN) == label, "its line over the ground"


def test_a_run_left_out_gives_the_curve_of_an_analysis_without_it(report: Browser, flown: Path, tmp_path: Path) -> None:
    i = number_of_the_deceleration(flown)
    report.value_of(f"{ROW}[{i}].click(); document.querySelector('#run-shown [data-do=leave]').click(); {DRAWN}")
    assert f"preview without run {i + 1}" in names(report)
    assert f"without run {i + 1}" in report.value_of("document.getElementById('preview').innerText")
    (tmp_path / "runs.toml").write_text(report.value_of("document.getElementById('preview').editedRuns()"), "utf-8")
    again = analyze(flown / "log.mcap", Options(runs=tmp_path / "runs.toml")).results
    curve = report.value_of("added.power.without[1]")
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
