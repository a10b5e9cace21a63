"""The report opens in a real browser: nothing on the console, nothing asked of a network, the curve drawn."""

import csv
import html
import re
import shutil
import subprocess
from pathlib import Path

import msgspec
import numpy as np
import pytest

from analysis.results.schema import Results

pytestmark = pytest.mark.xdist_group("chain")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--virtual-time-budget=5000",
)  # fmt: skip
DRAWINGS = ("power", "methods", "loadings", "efficiency", "parts", "timeline", "polar", "fit-0")


def opened(page: Path, profile: Path) -> tuple[str, list[str]]:
    """The page as the browser ended up with it, and what it said on the console."""
    arguments = [*QUIET, f"--user-data-dir={profile}", "--enable-logging=stderr", "--dump-dom", page.as_uri()]
    shown = subprocess.run([str(CHROMIUM), *arguments], capture_output=True, text=True, timeout=120)
    return shown.stdout, [line for line in shown.stderr.splitlines() if ":CONSOLE" in line]


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
def test_the_report_in_a_browser(flown: Path, results: Results, tmp_path: Path) -> None:
    """It opens without an error and without a network, every drawing is drawn, and what was not flown is dashed."""
    page = flown / "log.report" / "report.html"
    the_browser_complains_of_a_broken_page(page.read_text("utf-8"), tmp_path)
    dom, console = opened(page, tmp_path / "profile")
    assert console == []
    for name in DRAWINGS:
        assert 'class="main-svg"' in drawing(dom, name), name
    # The highest level speed of the demonstration lies beyond its runs: both curves go there in dashes.
    assert results.use is not None and results.use.available.maximum_speed_extrapolated
    power = drawing(dom, "power")
    assert power.count("stroke-dasharray: 9px, 9px") >= 1, "power required beyond the fastest flown"
    assert power.count("stroke-dasharray: 9px, 6px") >= 1, "power available there"


def the_browser_complains_of_a_broken_page(page: str, folder: Path) -> None:
    """The test can fail: the same page with a picture from a network and a wrong word of script is complained of."""
    assert "default-src 'none'" in page
    broken = '<img src="http://192.0.2.1/x.png"><script>nothing()</script></body>'
    (folder / "broken.html").write_text(page.replace("</body>", broken), "utf-8")
    _, console = opened(folder / "broken.html", folder / "profile")
    assert any("Content Security Policy" in line for line in console)
    assert any("nothing is not defined" in line for line in console)


def drawing(dom: str, name: str) -> str:
    """The part of the page from a drawing's start to the next drawing."""
    return dom.partition(f'<div id="{name}"')[2].split('class="plotly-graph-div')[1]


@pytest.fixture(scope="module")
def page(flown: Path) -> str:
    return (flown / "log.report" / "report.html").read_text("utf-8")


@pytest.fixture(scope="module")
def results(flown: Path) -> Results:
    return msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)


def test_the_answers_come_before_the_first_drawing(page: str, results: Results) -> None:
    """In words and large: how slow for longest endurance, how fast for longest range, with this battery."""
    assert results.use is not None
    head = re.sub(
        r"<[^>]+>",
        " ",
        re.sub(r"<(script|style).*?</\1>", "", page.partition('class="plotly-graph-div')[0], flags=re.S),
    )
    said = " ".join(head.split())
    flown = results.use.loadings[0]
    assert f"Longest endurance {flown.endurance_speed_mps.value:.1f} m/s" in said
    assert f"{flown.endurance_s.value / 60:.0f} min (" in said and "74 Wh, 80 % used" in said
    assert f"Longest range {flown.range_speed_mps.value:.1f} m/s ({flown.range_speed_mps.lo:.1f} to" in said


def test_every_method_is_named_with_its_equations(page: str, results: Results) -> None:
    assert len(results.methods) >= 5
    said = html.unescape(page)
    for method in results.methods:
        assert method.title in said
        assert method.equations in said
    for disagreement in results.disagreements:
        assert disagreement.text in said


def test_the_field_table_is_the_results(flown: Path, results: Results) -> None:
    assert results.use is not None
    with (flown / "log.report" / "field_table.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert [float(row["speed_mps"]) for row in rows] == [row.speed_mps for row in results.use.field_table]
    for row, known in zip(rows, results.use.field_table, strict=True):
        assert float(row["range_m"]) == pytest.approx(known.endurance_s * known.speed_mps, rel=1e-3)
        assert known.endurance_s * known.battery_W == pytest.approx(74 * 3600 * 0.8, rel=1e-9)
        assert float(row["weight_N"]) == pytest.approx(results.test.weight_N, rel=1e-3)
    text = (flown / "log.report" / "field_table.md").read_text("utf-8")
    assert len([line for line in text.splitlines() if line.startswith("| ")]) == (
        len(results.use.field_table) + len(results.use.loadings) + 4
    )


def test_the_path_is_written_with_the_error_of_every_state(flown: Path) -> None:
    """Five lines a second; pitch is known to better than half a degree, and never to less than its gyro's noise."""
    with (flown / "log.report" / "path.csv").open() as stream:
        rows = list(csv.DictReader(stream))
    assert {"t_s", "pitch_rad", "pitch_rad_error", "v_down_mps", "wind_north_mps_error"} <= rows[0].keys()
    times = [float(row["t_s"]) for row in rows]
    assert np.allclose(np.diff(times), 0.2)
    errors = np.array([float(row["pitch_rad_error"]) for row in rows])
    assert np.all(errors > 1e-5) and np.median(errors) < np.radians(0.5)
