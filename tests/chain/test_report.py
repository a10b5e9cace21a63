"""The report opens in a real browser: nothing on the console, nothing asked of a network, the curve drawn."""

import csv
import html
import re
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

from flightpower.analysis.records.flight import Results
from tests.browser import AXE, CHROMIUM, NO_AXE, Browser

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import page_pictures

pytestmark = pytest.mark.xdist_group("chain")

SIZES = ((400, True), (400, False), (1280, False), (1280, True), (1920, True), (1920, False))  # px, dark
MOST_PAGES = 6  # of the demonstration
PAPER_PX = 695  # A4 without the margins of page.css
FIRST = {"power", "parts", "methods", "loadings-1", "loadings-2", "efficiency", "timeline", "polar",
         "track", "residuals", "autocorrelation",
         "convergence", "correlation", "air_and_path", "consistency", "fit-0-1",
         "fit-0-2"}  # fmt: skip
OPEN_ALL = "document.querySelectorAll('details').forEach(d => d.open = true)"
TOO_WIDE = """(() => {
  const page = document.body.getBoundingClientRect();
  return [...document.querySelectorAll('body *')].filter(e => !e.closest('.plot, svg'))
    .map(e => [e, e.getBoundingClientRect()])
    .filter(([e, box]) => box.width && (box.right > page.right + 0.5 || box.left < page.left - 0.5))
    .map(([e, box]) => `${e.tagName} ${e.className} to ${box.right}: ${e.textContent.slice(0, 40)}`);
})()"""
CUT = """[...document.querySelectorAll('.plot')].flatMap(plot => {
  const svg = plot.querySelector('svg.chart'), whole = plot.getBoundingClientRect();
  return [svg, ...plot.querySelectorAll('svg.chart text')].map(part => [part, part.getBoundingClientRect()])
    .filter(([part, box]) => box.width && (box.left < whole.left - 1 || box.right > whole.right + 1
                                           || box.top < whole.top - 1 || box.bottom > whole.bottom + 1))
    .map(([part, box]) => `${plot.id}: ${part.textContent.slice(0, 30)}`);
})"""


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
@pytest.mark.skipif(not AXE.is_file(), reason=NO_AXE)
def test_a_program_finds_no_barrier_in_the_report(flown: Path, browser: Browser) -> None:
    for width, dark in ((1280, False), (400, True)):
        browser.show(flown / "log.report" / "report.html", width, dark=dark)
        browser.value_of(OPEN_ALL)
        assert browser.barriers() == []


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
def test_the_report_in_a_browser(flown: Path, results: Results, browser: Browser, tmp_path: Path) -> None:
    """On a phone, a laptop and a wide screen, dark and light, and on paper: everything is drawn, nothing is cut off,
    and no dialog opens."""
    page = flown / "log.report" / "report.html"
    the_browser_complains_of_a_broken_page(browser, page.read_text("utf-8"), tmp_path)
    browser.show(page, *SIZES[0][:1], dark=SIZES[0][1])
    for width, dark in SIZES:
        browser.resize(width, dark=dark)
        browser.value_of(OPEN_ALL)
        assert browser.value_of(TOO_WIDE) == [], width
        assert browser.value_of("document.documentElement.scrollWidth") <= width
        assert browser.value_of(CUT) == [], width
        ink = browser.value_of("getComputedStyle(document.querySelector('#power text')).fill")
        assert (sum(map(int, re.findall(r"\d+", ink)[:3])) > 400) == dark, "light on dark, dark on light"
    assert browser.value_of("[...document.querySelectorAll('.plot')].map(e => e.id)") == sorted_like_the_page(browser)
    assert set(browser.value_of("Object.keys(charts)")) >= FIRST
    # The highest level speed of the demonstration lies beyond its runs: both curves go there in dashes.
    assert results.use is not None and results.use.available.maximum_speed_extrapolated
    power = browser.value_of("document.getElementById('power').innerHTML")
    assert power.count('stroke-dasharray="12 6"') >= 1, "power required beyond the fastest flown"
    assert power.count('stroke-dasharray="9 6"') >= 1, "power available there"
    on_paper(browser, page)
    the_curve_is_there_before_any_script(browser, page)
    assert browser.complaints == []
    assert browser.requests == [page.as_uri()], "no network"


def on_paper(browser: Browser, page: Path) -> None:
    """The page is as wide as the paper and dark on white; folded parts stay off the paper."""
    browser.show(page, PAPER_PX, dark=True)
    short = pages(browser.pdf())
    assert short <= MOST_PAGES
    browser.value_of(OPEN_ALL)
    assert pages(browser.pdf()) > short, "what is opened is printed, too"
    browser.command("Emulation.setEmulatedMedia", media="print", features=[])
    try:
        assert browser.value_of(CUT) == [] and browser.value_of(TOO_WIDE) == []
        ink = browser.value_of("getComputedStyle(document.querySelector('#power text')).fill")
        assert ink == "rgb(0, 0, 0)", "not the light colors of a dark page"
        assert browser.value_of("getComputedStyle(document.querySelector('.of-figure')).display") == "none"
    finally:
        browser.command("Emulation.setEmulatedMedia", media="", features=[])


def pages(pdf: bytes) -> int:
    return len(re.findall(rb"/Type /Page\b", pdf))


def the_curve_is_there_before_any_script(browser: Browser, page: Path) -> None:
    """The curve is there with scripts off."""
    curves = "document.querySelectorAll('#power svg.chart path').length"
    browser.command("Emulation.setScriptExecutionDisabled", value=True)
    try:
        browser.show(page, 400, dark=True)
        assert browser.value_of(curves) > 4
        curve = "getComputedStyle(document.querySelector('#power .drawn path[stroke-width=\"5\"]')).stroke"
        assert browser.value_of(curve) == "rgb(108, 182, 255)", "light on a dark page"
        assert browser.value_of("document.querySelector('#power .chart').getBoundingClientRect().height") > 200
    finally:
        browser.command("Emulation.setScriptExecutionDisabled", value=False)
    browser.show(page, 400)


def sorted_like_the_page(browser: Browser) -> list[str]:
    """The drawings in page order; each id occurs once, or a link would lead to the wrong place."""
    ids = browser.value_of("[...document.querySelectorAll('[id]')].filter(e => !e.closest('svg')).map(e => e.id)")
    assert len(set(ids)) == len(ids)
    drawings = set(browser.value_of("Object.keys(charts)"))
    return [name for name in ids if name in drawings]


def the_browser_complains_of_a_broken_page(browser: Browser, page: str, folder: Path) -> None:
    """This test can fail: it reports the same page with a picture from the network and a mistake in a script."""
    assert "default-src 'none'" in page
    broken = '<img src="http://192.0.2.1/x.png"><script>nothing()</script></body>'
    (folder / "broken.html").write_text(page.replace("</body>", broken), "utf-8")
    browser.show(folder / "broken.html", 1280)
    assert any("Content Security Policy" in line for line in browser.complaints)
    assert any("nothing is not defined" in line for line in browser.complaints)


@pytest.fixture(scope="module")
def page(flown: Path) -> str:
    return (flown / "log.report" / "report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def results(flown: Path) -> Results:
    return msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)


def test_the_answers_come_before_the_first_drawing(page: str, results: Results) -> None:
    """They are in words and large: how slow for best endurance, how fast for best range, with this battery."""
    assert results.use is not None
    head = re.sub(
        r"<[^>]+>",
        " ",
        re.sub(r"<(script|style).*?</\1>", "", page.partition('class="plot"')[0], flags=re.S),
    )
    message = " ".join(head.split())
    flown = results.use.loadings[0]
    assert f"Best endurance {flown.endurance_speed_mps.value:.1f} m/s" in message
    assert f"{flown.endurance_s.value / 60:.0f} min (" in message and "74 Wh, 80 % used" in message
    assert f"Best range {flown.range_speed_mps.value:.1f} m/s ({flown.range_speed_mps.lo:.1f} to" in message


def test_every_method_is_named_with_its_equations(page: str, results: Results) -> None:
    assert len(results.methods) >= 5
    message = html.unescape(page)
    for method in results.methods:
        assert method.title in message
        assert method.equations in message
    for disagreement in results.disagreements:
        assert disagreement.text in message


def test_the_field_table_is_the_results(flown: Path, results: Results) -> None:
    assert results.use is not None
    with (flown / "log.report" / "field_table.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["speed_mps"]) for row in rows] == [row.speed_mps for row in results.use.field_table]
    for row, point in zip(rows, results.use.field_table, strict=True):
        assert float(row["range_m"]) == pytest.approx(point.endurance_s * point.speed_mps, rel=1e-3)
        assert point.endurance_s * point.battery_W == pytest.approx(74 * 3600 * 0.8, rel=1e-9)
        assert float(row["weight_N"]) == pytest.approx(results.test.weight_N, rel=1e-3)
    text = (flown / "log.report" / "field_table.md").read_text("utf-8")
    assert len([line for line in text.splitlines() if line.startswith("| ")]) == (
        len(results.use.field_table) + len(results.use.loadings) + 4
    )


def test_the_path_is_written_with_the_error_of_every_state(flown: Path) -> None:
    """Five lines a second; pitch is known to better than half a degree, but never better than its gyro's noise."""
    with (flown / "log.report" / "path.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert {"t_s", "pitch_rad", "pitch_rad_error", "v_down_mps", "wind_north_mps_error"} <= rows[0].keys()
    times = [float(row["t_s"]) for row in rows]
    assert np.allclose(np.diff(times), 0.2)
    errors = np.array([float(row["pitch_rad_error"]) for row in rows])
    assert np.all(errors > 1e-5) and np.median(errors) < np.radians(0.5)


def test_the_picture_of_the_readme_has_the_curve_and_the_simulator_s(flown: Path) -> None:
    """Both are drawn over the same speeds, by the charts of the report."""
    page = page_pictures.curve_page(flown / "log.report" / "results.json", flown / page_pictures.CURVE)
    assert 'data-entry="truth (simulator)"' in page and 'data-entry="power required"' in page
