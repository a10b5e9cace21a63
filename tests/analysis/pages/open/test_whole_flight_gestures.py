"""What a user does on the page of an autopilot's flight, in a browser: with mouse and keyboard, wide and narrow."""

from collections.abc import Iterator
from pathlib import Path
from threading import Thread

import pytest
import waitress

from flightpower.analysis.pages.open.flights import Folder
from flightpower.analysis.pages.open.server import LocalPage
from tests.browser import AXE, BOTH_WIDTHS, CHROMIUM, NO_AXE, WIDTHS, Browser
from tests.unchanged.commands import flight

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
QUIET = "!document.body.classList.contains('busy')"
CURVE_DONE = f"last !== null && {QUIET}"
LOG = "flight 100%.BIN"


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[str, Path]]:
    """Address of the page for a folder with one log of an autopilot, and the folder."""
    folder = tmp_path_factory.mktemp("whole")
    for name in ("flights", "workspace"):
        (folder / name).mkdir()
    (folder / "flights" / LOG).write_bytes(flight("ordinary-flight", "--as", "ardupilot", "--seed", "3"))
    application = LocalPage(Folder(folder / "flights", folder / "workspace"), set(), "secret")
    server = waitress.create_server(application, host="127.0.0.1", port=0)
    host = f"127.0.0.1:{server.effective_port}"
    application.hosts = {host}
    serving = Thread(target=server.run, daemon=True)
    serving.start()
    yield f"http://{host}/secret/", folder / "flights"
    server.close()
    serving.join(5)


@pytest.fixture(params=WIDTHS, ids="{} px".format)
def page(request: pytest.FixtureRequest, served: tuple[str, Path], browser: Browser) -> Iterator[Browser]:
    """The page, which opens the only log of its folder and draws its curve; the console holds nothing but refusals."""
    browser.show("about:blank", request.param)
    browser.show(served[0], request.param, height=1600)
    browser.wait_for(CURVE_DONE)
    yield browser
    assert [line for line in browser.complaints if "status of 422" not in line] == []
    assert browser.value_of("document.documentElement.scrollWidth") <= request.param


def after(page: Browser, action: str) -> None:
    """Do something and wait until the curve has followed."""
    page.value_of("window.before = last")
    page.value_of(action)
    page.wait_for(f"last !== window.before && {QUIET}")


def typed(key: str, text: str) -> str:
    box = f"""document.querySelector('[data-key="{key}"]')"""
    return f"{box}.focus(); {box}.value = '{text}'; {box}.dispatchEvent(new Event('change'))"


@pytest.mark.slow
@pytest.mark.parametrize("page", BOTH_WIDTHS, indirect=True, ids="{} px".format)
def test_mass_and_span_stand_beside_the_curve_and_it_follows(page: Browser) -> None:
    """A guess is marked as a guess; an unusable value gets a red border and a message, also in the status."""
    assert page.value_of("!at('guessed').hidden && at('first').querySelectorAll('.guessed').length") == 3
    beside = "at('first').getBoundingClientRect().left > at('over-speed').getBoundingClientRect().left + 300"
    assert page.value_of(beside) == (page.value_of("innerWidth") == 1280)
    after(page, typed("mass", "3.84 kg"))
    for key, text in (("wing-area", "0.464"), ("span", "1.75 m")):
        after(page, typed(key, text))
    assert page.value_of("at('guessed').hidden && last.mass_kg") == pytest.approx(3.84)
    assert "--span '1.75 m'" in page.value_of("at('command').textContent")
    power = page.value_of("String(last.curve.power_W)")
    page.value_of(typed("span", "wide"))
    page.wait_for(f"!at('wrong').hidden && {QUIET}")
    box = """document.querySelector('[data-key="span"]')"""
    assert page.value_of(f"{box}.getAttribute('aria-invalid')") == "true"
    assert page.value_of(f"{box}.parentElement.querySelector('.at-field').textContent").startswith("--span wide")
    red, text = page.value_of(f"[getComputedStyle({box}).borderColor, at('wrong').textContent]")
    assert red == "rgb(179, 38, 30)" and text.startswith("--span wide")
    in_view = "(box => box.top >= 0 && box.bottom <= innerHeight + 1)(at('wrong').getBoundingClientRect())"
    for y in (0, 700):
        page.value_of(f"scrollTo(0, {y})")
        assert page.value_of(in_view), "the status stays in view"
    after(page, typed("span", "1.75 m"))
    assert page.value_of(f"{box}.hasAttribute('aria-invalid')") is False
    assert page.value_of("String(last.curve.power_W)") == power


def test_dropped_files_wait_for_each_other_and_a_refusal_stays_in_view(page: Browser) -> None:
    """Two files that are not logs are refused, and the second refusal does not hide the first."""
    wrong = "new File(['nothing'], '{}.BIN')".format
    page.value_of(f"addFiles([{wrong('first')}, {wrong('second')}])")
    page.wait_for(f"pending === 0 && {QUIET}")
    message = page.value_of("at('wrong').hidden ? '' : at('wrong').textContent")
    assert "first.BIN" in message and "second.BIN" in message
    page.value_of(f"addFiles([{wrong('third')}])")
    page.wait_for(f"pending === 0 && {QUIET}")
    message = page.value_of("at('wrong').textContent")
    assert "third.BIN" in message and "first.BIN" not in message, "refusals of an earlier drop are not repeated"


def test_what_the_command_lacks_is_reported_and_a_stretch_begins_in_flight(page: Browser) -> None:
    page.value_of("pointed = NaN; changed = {}; recompute()")
    page.wait_for(f"at('missing').textContent !== '' && {QUIET}")
    assert "mass in flight, wing area, wing span" in page.value_of("at('missing').textContent")
    start, end = page.value_of("airborne.reduce((a, b) => b[1] - b[0] > a[1] - a[0] ? b : a)")
    page.value_of("window.before = last; add()")
    page.wait_for(f"last !== window.before && {QUIET}")
    assert page.value_of("runs[0].start_s") == pytest.approx((start + end) / 2, abs=0.06)
    page.value_of("window.before = last; takeAgain(0)")
    page.wait_for(f"last !== window.before && {QUIET}")


def test_a_stretch_is_left_out_dragged_and_taken_again_by_mouse_and_keyboard(page: Browser) -> None:
    power, airborne = page.value_of("[String(last.curve.power_W), airborne.length]")
    middle = page.value_of("Math.round((airborne[0][0] + airborne[0][1]) / 2)")
    page.value_of(f"point({middle})")
    page.value_of("window.before = last")
    page.press("n", 78)
    page.wait_for(f"last !== window.before && {QUIET}")
    assert page.value_of("[runs.length, runs[0].start_s, runs[0].end_s]") == [1, middle, middle + 30]
    assert page.value_of("airborne.length") == airborne + 1
    assert page.value_of("String(last.curve.power_W)") != power
    page.value_of("at('strips').scrollIntoView()")
    x, y = page.value_of("""(box => [box.left + box.width / 2, box.top + 60])(
      document.querySelector('[data-end=end_s]').getBoundingClientRect())""")
    by_px = page.value_of("time(20) - time(0)")
    page.value_of("window.before = last")
    page.drag((x, y), (x + by_px, y))
    page.wait_for(f"last !== window.before && {QUIET}")
    dragged = page.value_of("runs[0].end_s")
    assert dragged == pytest.approx(middle + 50, abs=2 * 20 / by_px)
    page.value_of("window.before = last")
    page.press("ArrowLeft", 37)
    page.wait_for(f"last !== window.before && {QUIET}")
    assert page.value_of("runs[0].end_s") == pytest.approx(dragged - 0.1, abs=0.006)
    assert f"--leave-out '{middle}.0 to {dragged - 0.1:.1f} s'" in page.value_of("at('command').textContent")
    page.value_of("window.before = last")
    page.press("x", 88)
    page.wait_for(f"last !== window.before && {QUIET}")
    assert page.value_of("[runs.length, String(last.curve.power_W)]") == [0, power]
    for k in range(airborne):  # each whole stretch, by its check box: nothing is left
        page.value_of(f"at('runs').querySelector('[data-place=a{k}]').click()")
    page.wait_for(f"!at('wrong').hidden && {QUIET}")
    assert page.value_of("runs.length") == airborne
    assert "left out by hand" in page.value_of("at('wrong').textContent")
    after(page, "at('as-found').click()")
    assert page.value_of("[runs.length, String(last.curve.power_W)]") == [0, power]


def test_the_zoom_survives_a_new_curve_and_another_channel(page: Browser) -> None:
    page.value_of("charts.curve.zoom([2000, 6000], charts.curve.panels[0], [3000, 8000])")
    page.value_of("charts.strips.zoom([1000, 3000], null, null); charts.curve.toggle('electrical power', true)")
    read = """(chart => { const panel = chart.panels[0], [x, y, width, height] = panel.view;
      return [chart.xValue(x), chart.xValue(x + width), chart.value(panel, y), chart.value(panel, y + height)]; })"""
    curve, strips = page.value_of(f"[{read}(charts.curve), {read}(charts.strips)]")
    after(page, typed("mass", "5 kg"))
    assert page.value_of(f"{read}(charts.curve)") == pytest.approx(curve, rel=2e-3)
    page.value_of("at('channels').open = true")
    page.wait_for(f"at('channel-names').children.length > 20 && {QUIET}")
    page.value_of("at('channel').value = 'CTUN.ThO'; at('channel').focus()")
    page.press("Enter", 13)
    page.wait_for(f"drawnChannels.length === 1 && {QUIET}")
    titles = "[...document.querySelectorAll('#strips .title')].map(one => one.textContent)"
    assert "CTUN.ThO" in page.value_of(titles)
    assert page.value_of(f"{read}(charts.strips)") == pytest.approx(strips, rel=2e-3)
    page.value_of("at('channels').querySelector('.chips button').click()")
    page.wait_for(f"drawnChannels.length === 0 && {QUIET}")
    assert "CTUN.ThO" not in page.value_of(titles)
    page.value_of("at('channel').value = 'CTUN.Thrust'; at('draw').click()")
    page.wait_for("!at('wrong').hidden")
    assert page.value_of("at('channel').getAttribute('aria-invalid')") == "true"
    assert "no such channel" in page.value_of("document.querySelector('#channels .at-field').textContent")


def test_modes_and_messages_are_read_on_the_axis_of_time_and_in_a_list(page: Browser) -> None:
    message = page.value_of("[...document.querySelectorAll('#strips [data-say]')].map(one => one.dataset.say)")
    assert message and all(item.startswith("AUTO: for ") for item in message)
    page.value_of("at('events').open = true")
    rows = page.value_of("[...at('events').querySelectorAll('tbody tr')].map(one => one.innerText)")
    assert any("mode AUTO" in row for row in rows) and len(rows) > 1
    page.value_of("at('events').querySelector('button').click()")
    assert page.value_of("!document.querySelector('#strips .readout').hidden")


@pytest.mark.skipif(not AXE.is_file(), reason=NO_AXE)
def test_a_program_finds_no_barrier(page: Browser) -> None:
    """A program checks with a stretch left out, everything open, a channel drawn, and a message at its field."""
    page.value_of("at('channels').open = true")
    page.wait_for(f"at('channel-names').children.length > 20 && {QUIET}")
    page.value_of("drawChannels(['CTUN.ThO'])")
    page.wait_for(f"drawnChannels.length === 1 && {QUIET}")
    after(page, "add()")
    page.value_of("document.querySelectorAll('details').forEach(one => { one.open = true; })")
    page.value_of(typed("mass", "heavy"))
    page.wait_for(f"!at('wrong').hidden && {QUIET}")
    assert page.barriers() == []
