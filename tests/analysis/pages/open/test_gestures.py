"""What a user does on the local page, in a browser: with mouse and keyboard, on a laptop and on a phone."""

import json
from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import numpy as np
import pytest
import waitress

from flightpower.analysis.pages.open.flights import Folder
from flightpower.analysis.pages.open.server import LocalPage
from flightpower.flight.aircraft import load_aircraft
from tests.browser import AXE, BOTH_WIDTHS, CHROMIUM, NO_AXE, WIDTHS, Browser

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
QUIET = "!document.body.classList.contains('busy')"
CURVE_DONE = f"last !== null && {QUIET}"
AS_OPENED = """flight.file === 'log.mcap' && selected < 0 && !edited && !Object.keys(changed).length && other === null
  && !polar && !method && String(last.curve.power_W) === String(first.power_W)"""
TOO_WIDE = "document.documentElement.scrollWidth"


@pytest.fixture(scope="module")
def served(shared: Folder) -> Iterator[tuple[str, Path]]:
    """Address of the page for a folder with one log, and the folder."""
    application = LocalPage(shared, set(), "secret")
    server = waitress.create_server(application, host="127.0.0.1", port=0)
    host = f"127.0.0.1:{server.effective_port}"
    application.hosts = {host}
    serving = Thread(target=server.run, daemon=True)
    serving.start()
    yield f"http://{host}/secret/#log.mcap", shared.path
    server.close()
    serving.join(5)


@pytest.fixture(scope="module", params=WIDTHS, ids="{} px".format)
def loaded(request: pytest.FixtureRequest, served: tuple[str, Path], browser: Browser) -> int:
    """The page is loaded once for all tests of a width [px]."""
    browser.show("about:blank", request.param)
    browser.show(served[0], request.param, height=1600)
    browser.wait_for(CURVE_DONE)
    return int(request.param)


@pytest.fixture
def page(loaded: int, browser: Browser) -> Iterator[Browser]:
    """The page as it is when its log is opened; at the end the console holds nothing but refusals."""
    if not browser.value_of(AS_OPENED):
        browser.value_of("open('log.mcap')")
        browser.wait_for(CURVE_DONE)
    browser.value_of("document.activeElement.blur(); scrollTo(0, 0)")
    browser.complaints.clear()
    yield browser
    assert [line for line in browser.complaints if "status of 422" not in line] == []
    assert browser.value_of(TOO_WIDE) <= loaded


def changed_curve(page: Browser, action: str) -> None:
    """Do something and wait until the curve has followed."""
    page.value_of("window.before = last")
    page.value_of(action)
    page.wait_for(f"last !== window.before && {QUIET}")


def index(page: Browser, kind: str) -> int:
    return int(page.value_of(f"runs.findIndex(run => run.keep && run.kind === '{kind}')"))


def place(page: Browser, end: str) -> tuple[float, float]:
    """The window coordinates of an end of the selected run."""
    x, y = page.value_of(f"""(box => [box.left + box.width / 2, box.top + 60])(
      document.querySelector('[data-end={end}]').getBoundingClientRect())""")
    return x, y


@pytest.mark.slow
def test_an_end_is_dragged_and_moved_with_keys_and_the_curve_follows(page: Browser) -> None:
    i = index(page, "deceleration")
    page.value_of("document.getElementById('strips').scrollIntoView()")
    page.value_of(f"select({i})")
    start_s, power = page.value_of(f"[runs[{i}].start_s, last.curve.power_W[0]]")
    x, y = place(page, "start_s")
    by_px = page.value_of("time(2) - time(0)")
    page.value_of("window.before = last")
    page.drag((x, y), (x + by_px, y))
    page.wait_for(f"last !== window.before && {QUIET}")
    dragged = page.value_of(f"runs[{i}].start_s")
    assert dragged == pytest.approx(start_s + 2, abs=2 * 2 / by_px + 0.01)
    assert page.value_of("last.curve.power_W[0]") != power
    assert "--runs" in page.value_of("document.getElementById('command').textContent")
    assert page.value_of("document.activeElement.dataset.end") == "start_s", "the end keeps the focus for the keyboard"
    page.value_of("window.before = last")
    page.press("ArrowRight", 39)
    page.wait_for(f"last !== window.before && {QUIET}")
    assert page.value_of(f"runs[{i}].start_s") == pytest.approx(dragged + 0.1, abs=0.006)
    changed_curve(page, "document.getElementById('as-found').click()")
    assert page.value_of(f"[runs[{i}].start_s, last.curve.power_W[0]]") == [start_s, power]


@pytest.mark.slow
def test_kinds_and_use_of_a_run_by_key_and_a_new_run(page: Browser) -> None:
    i = index(page, "acceleration")
    page.value_of(f"document.querySelectorAll('#runs tbody tr')[{i}].cells[4].click()")
    assert page.value_of("selected") == i
    page.value_of("window.before = last")
    page.press("x", 88)
    page.wait_for(f"last !== window.before && {QUIET}")
    assert (
        not page.value_of(f"runs[{i}].keep")
        and page.value_of("last.runs.filter(run => run.keep && run.kind === 'acceleration').length") == 0
    )
    page.press("x", 88)
    page.press("s", 83)
    assert page.value_of(f"runs[{i}].kind") == "steady"
    page.press("a", 65)
    assert page.value_of(f"runs[{i}].kind") == "acceleration"
    count = page.value_of("runs.length")
    why = page.value_of("[...document.querySelectorAll('#runs tbody tr')].map(row => row.cells[4].textContent)")
    left_out = page.value_of("runs.map(run => !run.keep || ['standing', 'flying'].includes(run.kind))")
    assert all(why[k] for k, out in enumerate(left_out) if out), "every run that is not in the curve says why"
    page.value_of("point(101)")
    page.press("n", 78)
    assert page.value_of("[runs.length, runs[selected].start_s]") == [count + 1, 101]
    page.press("Escape", 27)
    assert page.value_of("selected") == -1


@pytest.mark.parametrize("loaded", BOTH_WIDTHS, indirect=True, ids="{} px".format)
def test_the_cursor_reads_all_strips_and_shows_the_place(page: Browser) -> None:
    page.value_of("document.getElementById('strips').scrollIntoView()")
    x, y = page.value_of(
        "(box => [box.left + time(70), box.top + 100])(document.getElementById('strips').getBoundingClientRect())"
    )
    page.command("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y)
    first, *message = page.value_of("document.querySelector('#strips .readout').innerText").split("\n")
    assert first.startswith("time since the start of the log 70") and first.endswith(" s")
    lines = " ".join(message)
    assert all(part in lines for part in ("speed: ", " m/s", " m ", " rpm", "throttle: 100 %", "angle of attack: "))
    assert page.value_of("parseFloat(document.querySelector('#track .here').getAttribute('cx'))") > 0


def test_edits_that_no_report_has_are_not_left_without_a_question(page: Browser) -> None:
    """The page asks before it opens another log and before it is left; edits taken back are no edits."""
    choose, leave = (
        "document.querySelector('#logs tbody button').click()",
        "new Event('beforeunload', {cancelable: true})",
    )
    page.questions.clear()
    changed_curve(page, "runs[0].keep = !runs[0].keep; changedRuns()")
    page.answer = False
    page.value_of(choose)
    assert page.questions == ["The edits of log.mcap are not in a report. Discard them?"]
    assert page.value_of("edited") is True
    assert page.value_of(f"dispatchEvent({leave})") is False
    changed_curve(page, "document.getElementById('as-found').click()")
    assert page.value_of(f"dispatchEvent({leave})") is True
    page.answer = True
    changed_curve(page, "runs[0].keep = !runs[0].keep; changedRuns()")
    changed_curve(page, choose)
    page.wait_for(AS_OPENED)
    assert len(page.questions) == 2


def test_another_weight_changes_the_curve_and_back(page: Browser) -> None:
    box = "document.querySelector('[data-key=\"mass.weight\"]')"
    type_in = (
        f"document.getElementById('form').open = true; {box}.value = '{{}}'; {box}.dispatchEvent(new Event('change'))"
    )
    power = page.value_of("last.curve.power_W[20]")
    page.value_of(f"document.getElementById('form').open = true; {box}.focus()")
    assert page.value_of("document.getElementById('meaning').textContent").startswith("weight in flight: ")
    changed_curve(page, type_in.format("4.6 kg"))
    assert "for 4.60 kg" in page.value_of("document.getElementById('number').textContent")
    page.value_of(type_in.format("heavy"))
    page.wait_for("!document.getElementById('wrong').hidden")
    assert page.value_of("document.getElementById('wrong').textContent").startswith("aircraft file: ")
    changed_curve(page, "document.getElementById('as-recorded').click()")
    assert page.value_of("last.curve.power_W[20]") == power
    assert page.value_of("document.getElementById('wrong').hidden")


@pytest.mark.slow
def test_the_method_is_switched_with_the_keyboard_beside_the_headline(page: Browser) -> None:
    """A method that no run allows cannot be chosen; one that needs --likelihood adds the option to the command."""
    message, command = (
        "document.getElementById('by-method').textContent",
        "document.getElementById('command').textContent",
    )
    lines = "charts.curve.entries().filter(name => name.startsWith('direct drag')).length"
    before, plain = page.value_of("String(last.curve.power_W)"), page.value_of(command)
    assert page.value_of("at('method').options[0].textContent").endswith("of the report: dynamic method")
    assert page.value_of("at('method').querySelector('[value=varied-lift]').disabled")
    page.value_of("at('method').focus()")
    page.value_of("window.before = last")
    for _ in range(20):
        if page.value_of("at('method').value") == "direct":
            break
        page.press("ArrowDown", 40)
    page.wait_for(f"last !== window.before && last.method && last.method.name === 'direct' && {QUIET}")
    assert page.value_of(message).startswith("Green: direct drag") and page.value_of(lines) == 1
    assert page.value_of("String(last.curve.power_W)") == before and page.value_of(command) == plain
    page.value_of("at('method').value = 'two-state'; at('method').dispatchEvent(new Event('change'))")
    page.wait_for(f"last.method && last.method.name === 'two-state' && {QUIET}")
    assert page.value_of(command) == plain + " --likelihood"
    changed_curve(page, "at('method').value = ''; at('method').dispatchEvent(new Event('change'))")
    assert page.value_of(lines) == 0 and page.value_of(message) == "" and page.value_of(command) == plain


def test_a_predicted_polar_is_dropped_and_drawn(page: Browser, served: tuple[str, Path]) -> None:

    name, command = f"half-{page.value_of('innerWidth')}.txt", "document.getElementById('command').textContent"
    text = "CL CD\\n" + "\\n".join(f"{CL / 100} {0.02 + 0.06 * (CL / 100) ** 2}" for CL in range(2, 160, 2))
    page.value_of(f"window.before = last; drop(new File(['{text}'], '{name}'))")
    page.wait_for(f"last !== window.before && last.predicted && {QUIET}")
    assert (served[1] / name).is_file() and page.value_of("at('predicted').value") == name
    assert page.value_of("charts.curve.entries()").count(f"predicted by {name}") == 1
    assert name in page.value_of("at('by-polar').textContent")
    assert f"/{name}" in page.value_of(command).partition("--polar ")[2]
    V, P = np.array(page.value_of("[last.predicted.speed_mps, last.predicted.power_W]"))
    W, rho, S = (
        *page.value_of("[9.80665 * last.mass_kg, last.density_kgpm3]"),
        load_aircraft("nexstar").geometry.wing_area_m2,
    )
    CL = 2 * W / (rho * V**2 * S)
    assert P == pytest.approx(rho / 2 * V**3 * S * (0.02 + 0.06 * CL**2), rel=2e-3)
    changed_curve(page, "at('predicted').value = ''; at('predicted').dispatchEvent(new Event('change'))")
    assert page.value_of("last.predicted") is None and "--polar" not in page.value_of(command)


@pytest.mark.slow
def test_another_flight_is_compared_at_the_weight_of_this_one(
    page: Browser, served: tuple[str, Path], flown: bytes
) -> None:
    (served[1] / "second.mcap").write_bytes(flown)
    page.value_of("list()")
    page.wait_for("document.querySelector('#other option[value=\"second.mcap\"]') !== null")
    page.value_of("at('other').value = 'second.mcap'; at('other').dispatchEvent(new Event('change'))")
    page.wait_for(f"other !== null && {QUIET}")
    assert page.value_of("other.curve.power_W") == pytest.approx(page.value_of("last.curve.power_W"))
    compared = "document.getElementById('compared').textContent"
    assert "+0.0 %" in page.value_of(compared) and "log.report second.report" in page.value_of(compared)
    box = "document.querySelector('[data-key=\"mass.weight\"]')"
    changed_curve(page, f"{box}.value = '4.6 kg'; {box}.dispatchEvent(new Event('change'))")
    assert page.value_of("other.condition[0]") == pytest.approx(4.6, rel=1e-6)
    page.value_of("at('other').value = ''; at('other').dispatchEvent(new Event('change'))")
    page.wait_for(f"other === null && {QUIET}")
    assert page.value_of(compared) == ""
    (served[1] / "second.mcap").unlink()


@pytest.mark.slow
def test_the_report_is_written_and_shown_and_a_log_is_added(
    page: Browser, served: tuple[str, Path], flown: bytes, tmp_path: Path
) -> None:
    """For the second page the report already exists when the log is opened."""
    folder = served[1]
    if not (folder / "log.report").exists():
        page.value_of("document.getElementById('write').click()")
        page.wait_for(f"!document.getElementById('report').hidden && {QUIET}")
    results = json.loads((folder / "log.report" / "results.json").read_text("utf-8"))
    assert page.value_of("last.curve.power_W") == pytest.approx(
        [point["power_W"] for point in results["curves"]["power_required"]["points"]]
    )
    assert page.value_of("at('apart').querySelector('a').href") == page.value_of("at('report').src") != ""
    name = f"other-{page.value_of('innerWidth')}.mcap"
    (tmp_path / name).write_bytes(flown)
    document = page.command("DOM.getDocument")["root"]["nodeId"]
    box = page.command("DOM.querySelector", nodeId=document, selector="#logs input")["nodeId"]
    page.command("DOM.setFileInputFiles", nodeId=box, files=[str(tmp_path / name)])
    page.wait_for(f"flight.file === '{name}' && {CURVE_DONE}")
    assert (folder / name).read_bytes() == flown
    assert page.value_of("document.getElementById('report').hidden")


@pytest.mark.skipif(not AXE.is_file(), reason=NO_AXE)
def test_a_program_finds_no_barrier(page: Browser) -> None:
    """A program checks contrast, names, roles and order, with a run selected and everything open."""
    page.value_of("select(2); document.querySelectorAll('details').forEach(one => { one.open = true; })")
    assert page.barriers() == []
