"""A headless Chromium that tests share, driven through its DevTools protocol over a pipe.

To look at a page: `python -m tests.browser report.html FOLDER` writes pictures of it and the PDF that it prints.
"""

import base64
import json
import os
import select
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
OPTIONS = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync",
    "--disable-background-networking", "--disable-component-update", "--hide-scrollbars", "--remote-debugging-pipe",
)  # fmt: skip
# From the package axe-core (npm), MPL-2.0: the rules of WCAG 2 that a program can check.
AXE = Path(os.environ.get("AXE_CORE", "node_modules/axe-core/axe.min.js"))
NO_AXE = "no axe-core here (npm pack axe-core; AXE_CORE=…/axe.min.js)"
A4_INCHES = (8.27, 11.69)
# Window widths [px] of a laptop and a phone; what a phone only repeats is left to `make test-all`.
WIDTHS = (1280, pytest.param(400, marks=pytest.mark.thorough))
BOTH_WIDTHS = (1280, 400)
# Timers run in the order in which they are due, so this ends after all timers of a page that are due within this time.
AFTER_TIMERS = "new Promise(done => setTimeout(() => requestAnimationFrame(done), 200))"
HANGS_S = 120  # limit for what would never end
LOOK_AGAIN_S = 1.0  # while answers are outstanding, since some requests end without an event
QUIET_ROUNDS = 3  # rounds in which a page neither waits for an answer nor does what is waited for


class Browser:
    """Commands and events of the protocol.

    complaints: errors and warnings of the console; requests: URLs requested; questions: texts of dialogs, which
    `answer` closes
    """

    def __init__(self, to_browser: int, from_browser: int):
        self._out, self._in = os.fdopen(to_browser, "wb"), os.fdopen(from_browser, "rb")
        self._number, self._rest, self._session = 0, b"", ""
        self.complaints: list[str] = []
        self.requests: list[str] = []
        self.questions: list[str] = []
        self.answer = True
        self._events: list[str] = []
        self._unanswered: set[str] = set()
        target = self.command("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.command("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.command(f"{domain}.enable")

    def command(self, method: str, **parameters: object) -> dict[str, Any]:
        number = self._send(method, **parameters)
        while True:
            answer = self._next()
            if answer.get("id") == number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]

    def _send(self, method: str, **parameters: object) -> int:
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._out.write(json.dumps(message).encode() + b"\0")
        self._out.flush()
        return self._number

    def _speaks(self, within_s: float) -> bool:
        return b"\0" in self._rest or bool(select.select([self._in], [], [], within_s)[0])

    def _next(self) -> dict[str, Any]:
        while b"\0" not in self._rest:
            assert self._speaks(HANGS_S), f"Chromium says nothing for {HANGS_S} s"
            part = os.read(self._in.fileno(), 2**20)
            assert part, "Chromium ended"
            self._rest += part
        text, _, self._rest = self._rest.partition(b"\0")
        message = json.loads(text)
        self._keep(message.get("method", ""), message.get("params", {}))
        return message

    def _keep(self, event: str, content: dict[str, Any]) -> None:
        self._events.append(event)
        if event == "Log.entryAdded":
            self.complaints.append(content["entry"]["text"])
        elif event == "Runtime.exceptionThrown":
            details = content["exceptionDetails"]
            self.complaints.append(details.get("exception", {}).get("description", details["text"]))
        elif event == "Runtime.consoleAPICalled":
            messages = [argument.get("value", argument.get("description")) for argument in content["args"]]
            self.complaints.append(str(messages))
        elif event == "Page.javascriptDialogOpening":
            self.questions.append(content["message"] or content["type"])
            self._send("Page.handleJavaScriptDialog", accept=self.answer)
        elif event == "Network.requestWillBeSent":
            self.requests.append(content["request"]["url"])
            self._unanswered.add(content["requestId"])
        elif event in ("Network.loadingFinished", "Network.loadingFailed"):
            self._unanswered.discard(content["requestId"])

    def show(self, page: Path | str, width: int, *, dark: bool = False, height: int = 900) -> None:
        """Open a page, a file or an address, in a window of this size, and wait until it has loaded."""
        self.complaints.clear()
        self.requests.clear()
        self.resize(width, height, dark=dark)
        self._events.clear()
        self._unanswered.clear()
        self.command("Page.navigate", url=page if isinstance(page, str) else page.as_uri())
        while "Page.loadEventFired" not in self._events:
            self._next()

    def resize(self, width: int, height: int = 900, *, dark: bool = False) -> None:
        self.command(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.command("Emulation.setEmulatedMedia", features=[scheme])

    def value_of(self, script: str) -> Any:
        """Return the value of a JavaScript expression in the page, or the result of its promise."""
        answer = self.command("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in answer, answer
        return answer["result"].get("value")

    def wait_for(self, condition: str) -> None:
        """Wait until a JavaScript expression is true, however long a busy machine takes for it.

        Fails when the page waits for no answer and for no timer, and the expression is still false.
        """
        quiet = silent = 0
        while not self.value_of(condition):
            if self._unanswered:
                if self._speaks(LOOK_AGAIN_S):
                    self._next()
                    silent = 0
                else:
                    silent += 1
                    assert silent * LOOK_AGAIN_S < HANGS_S, f"no answer for {HANGS_S} s, and this is false: {condition}"
                quiet = 0
                continue
            assert quiet < QUIET_ROUNDS, f"the page waits for nothing, and this is false: {condition}"
            self.value_of(AFTER_TIMERS)
            quiet += 1

    def press(self, key: str, code: int) -> None:
        """Press a key; `code` is its virtual key code."""
        text = {"text": key} if len(key) == 1 else {}
        self.command("Input.dispatchKeyEvent", type="keyDown", key=key, windowsVirtualKeyCode=code, **text)
        self.command("Input.dispatchKeyEvent", type="keyUp", key=key, windowsVirtualKeyCode=code)

    def drag(self, start: tuple[float, float], end: tuple[float, float]) -> None:
        """Drags with the left button from one point of the window to another."""
        self.command("Input.dispatchMouseEvent", type="mouseMoved", x=start[0], y=start[1])
        self.command(
            "Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], button="left", clickCount=1
        )
        for share in (0.3, 0.6, 1.0):
            x, y = (a + share * (b - a) for a, b in zip(start, end, strict=True))
            self.command("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
        self.command("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], button="left", clickCount=1)

    def barriers(self) -> list[str]:
        """Accessibility violations that axe-core finds on the page, except those it calls minor."""
        self.command("Runtime.evaluate", expression=AXE.read_text("utf-8"))
        barriers: list[str] = self.value_of(
            "axe.run().then(({violations}) => violations.filter(one => one.impact !== 'minor')"
            ".map(one => `${one.id}: ${one.nodes.map(node => node.html).slice(0, 3)}`))"
        )
        return barriers

    def picture(self) -> bytes:
        """PNG of the window."""
        picture = self.command("Page.captureScreenshot")
        return base64.b64decode(picture["data"])

    def pdf(self) -> bytes:
        """The page as printed on A4."""
        width, height = A4_INCHES
        printed = self.command(
            "Page.printToPDF", paperWidth=width, paperHeight=height, preferCSSPageSize=True, printBackground=True
        )
        return base64.b64decode(printed["data"])


@contextmanager
def started() -> Iterator[Browser]:
    """A browser with one window; it ends with the context."""
    commands_in, commands_out = os.pipe()
    answers_in, answers_out = os.pipe()
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        arguments = [str(CHROMIUM), *OPTIONS, f"--user-data-dir={profile}", "about:blank"]
        # Chromium reads commands from its descriptor 3 and writes answers to 4.
        redirect = ["bash", "-c", f'exec "$@" 3<&{commands_in} 4>&{answers_out}', "bash", *arguments]
        process = subprocess.Popen(redirect, pass_fds=(commands_in, answers_out), stderr=subprocess.DEVNULL)
        os.close(commands_in)
        os.close(answers_out)
        try:
            browser = Browser(commands_out, answers_in)
            yield browser
        finally:
            process.terminate()
            process.wait()


def main() -> None:
    page, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    folder.mkdir(parents=True, exist_ok=True)
    with started() as browser:
        for width in (400, 1280):
            for dark in (False, True):
                browser.show(page, width, dark=dark)
                browser.value_of("document.querySelectorAll('details').forEach(d => d.open = true)")
                browser.resize(width, browser.value_of("document.documentElement.scrollHeight"), dark=dark)
                browser.value_of("new Promise(done => setTimeout(done, 1500))")
                (folder / f"{width}-{'dark' if dark else 'light'}.png").write_bytes(browser.picture())
        (folder / "report.pdf").write_bytes(browser.pdf())
        print(browser.complaints, browser.requests)


if __name__ == "__main__":
    main()
