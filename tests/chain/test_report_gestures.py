"""What a reader does with the report in a browser: with mouse and keyboard, on a laptop and on a phone."""

from collections.abc import Iterator
from pathlib import Path

import msgspec
import pytest

from analysis.schema import Results
from tests.browser import CHROMIUM, Browser, started

pytestmark = [
    pytest.mark.xdist_group("chain"),
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)"),
]

WIDTHS = (1280, 400)
DRAWN = "new Promise(done => setTimeout(done, 60))"  # a frame, and what is drawn in it


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with started() as browser:
        yield browser


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
    return browser.value_of("figures.power.data.filter(trace => trace.showlegend !== false).map(trace => trace.name)")


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
