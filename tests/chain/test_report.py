"""The report opens in a real browser: nothing on the console, nothing asked of a network, the curve drawn."""

import json
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


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
def test_the_report_opens_without_a_console_error_and_without_a_network(flown: Path, tmp_path: Path) -> None:
    netlog = tmp_path / "net.json"
    shown = subprocess.run(
        [CHROMIUM, *QUIET, f"--user-data-dir={tmp_path}", f"--log-net-log={netlog}", "--enable-logging=stderr",
         "--dump-dom", (flown / "log.report" / "report.html").as_uri()],
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    console = [line for line in shown.stderr.splitlines() if ":CONSOLE" in line]
    assert console == []
    assert shown.stdout.count('class="main-svg"') >= 3, "the drawings were drawn"
    asked = [event.get("params", {}).get("url", "") for event in json.loads(netlog.read_text())["events"]]
    assert [url for url in asked if url.startswith(("http:", "https:", "ws:", "wss:"))] == []
