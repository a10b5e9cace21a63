"""The report opens in a real browser: nothing on the console, nothing asked of a network, the curve drawn."""

import shutil
import subprocess
from pathlib import Path

import pytest

pytestmark = pytest.mark.xdist_group("chain")

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--virtual-time-budget=5000",
)  # fmt: skip


def opened(page: Path, profile: Path) -> tuple[str, list[str]]:
    """The page as the browser ended up with it, and what it said on the console."""
    arguments = [*QUIET, f"--user-data-dir={profile}", "--enable-logging=stderr", "--dump-dom", page.as_uri()]
    shown = subprocess.run([str(CHROMIUM), *arguments], capture_output=True, text=True, timeout=120)
    return shown.stdout, [line for line in shown.stderr.splitlines() if ":CONSOLE" in line]


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
def test_the_report_opens_without_a_console_error_and_without_a_network(flown: Path, tmp_path: Path) -> None:
    """The page forbids itself any network; the browser says on the console when something is tried all the same."""
    page = flown / "log.report" / "report.html"
    assert "default-src 'none'" in page.read_text("utf-8")
    dom, console = opened(page, tmp_path)
    assert console == []
    assert dom.count('class="main-svg"') >= 3, "the drawings were drawn"


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
def test_the_browser_would_have_said_so(flown: Path, tmp_path: Path) -> None:
    """The test above can fail: the same page with a picture from a network and a wrong word of script."""
    page = tmp_path / "report.html"
    broken = '<img src="http://192.0.2.1/x.png"><script>nothing()</script></body>'
    page.write_text((flown / "log.report" / "report.html").read_text("utf-8").replace("</body>", broken), "utf-8")
    _, console = opened(page, tmp_path)
    assert any("Content Security Policy" in line for line in console)
    assert any("nothing is not defined" in line for line in console)
