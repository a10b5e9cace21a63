"""A test waits for a page by what the page does, not by the clock."""

from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Event, Thread

import pytest

from tests.browser import CHROMIUM, Browser

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
PAGE = b"<!doctype html><script>let done = false; const finish = () => { done = true; };</script>"


class Server(ThreadingHTTPServer):
    """Answers /slow when `requested` has been set, and everything else at once."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), Answers)
        self.requested, self.answer = Event(), Event()

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/"


class Answers(BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        assert isinstance(self.server, Server)
        if self.path == "/slow":
            self.server.requested.set()
            self.server.answer.wait()
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(PAGE)

    def log_message(self, *_: object) -> None:
        pass


@pytest.fixture
def server() -> Iterator[Server]:
    with Server() as server:
        serving = Thread(target=server.serve_forever)
        serving.start()
        yield server
        server.answer.set()
        server.shutdown()
        serving.join()


def test_an_answer_is_waited_for_however_late_it_comes(server: Server, browser: Browser) -> None:
    """The answer comes later, by the page's clock, than a wait without progress would last."""
    browser.show(server.address, 800)
    browser.value_of("fetch('/slow').then(finish) && undefined")
    assert server.requested.wait(60)
    late = "setTimeout(() => fetch('/now'), {})"
    browser.value_of(";".join(late.format(200 * k) for k in range(8)) + "; undefined")

    def answered_at_the_end() -> None:
        seen = 0
        while seen < 8:
            seen = sum(url.endswith("/now") for url in browser.requests)
            server.answer.wait(0.02)
        server.answer.set()

    answering = Thread(target=answered_at_the_end)
    answering.start()
    browser.wait_for("done")
    answering.join()
    assert sum(url.endswith("/now") for url in browser.requests) == 8


def test_a_timer_of_the_page_is_waited_for(server: Server, browser: Browser) -> None:
    browser.show(server.address, 800)
    browser.value_of("setTimeout(finish, 150) && undefined")
    browser.wait_for("done")


def test_a_page_that_has_nothing_to_do_is_not_waited_for(server: Server, browser: Browser) -> None:
    browser.show(server.address, 800)
    with pytest.raises(AssertionError, match="waits for nothing, and this is false: done"):
        browser.wait_for("done")
