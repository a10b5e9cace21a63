"""The web server of the local page: a WSGI application (PEP 3333) that answers this computer's browser and nobody else.

Other pages in the same browser can send requests to it, and so can other users of the computer. Every request must
carry the secret that is in the address, name this server as its host (so that a foreign name that leads here is
refused), and, if it computes or writes, come from the page itself (Origin). Requests name files by their names in the
folder that was opened. The page may run only its own script; a report is shown in a sandbox that cannot reach anything.
"""

import atexit
import hmac
import logging
import os
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from enum import StrEnum
from http import HTTPStatus
from importlib import resources
from pathlib import Path
from socket import socket
from threading import Lock, Thread
from typing import IO, Any, NamedTuple
from urllib.parse import quote

import msgspec

from flightpower.analysis.files import write_file
from flightpower.analysis.pages.charts.svg import chart_script, chart_style, plain
from flightpower.analysis.pages.open.flights import Folder
from flightpower.analysis.pages.open.folder_files import POLARS, is_polar
from flightpower.analysis.pages.open.request import LIMITS, FieldError, Values
from flightpower.analysis.pages.predicted_polar import read_predicted_polar
from flightpower.analysis.sources.column_map import BESIDE, load_map, map_files
from flightpower.analysis.sources.open import is_table, suffixes
from flightpower.analysis.sources.recognize import autopilot_of
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log

StartResponse = Callable[[str, list[tuple[str, str]]], Any]
Environ = dict[str, Any]

PLAIN, HTML, JSON = "text/plain; charset=utf-8", "text/html; charset=utf-8", "application/json"
FILES = {"": ("page.html", HTML), "page.js": ("page.js", "text/javascript"), "page.css": ("page.css", "text/css")}
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src data:; frame-src 'self';"
    " base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
)
# Without allow-same-origin, a report has an origin of its own, and this server refuses requests from it.
REPORT_POLICY = (
    "sandbox allow-scripts allow-downloads; default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline';"
    " img-src data: blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'self'"
)
HEADERS = [
    ("X-Content-Type-Options", "nosniff"),
    ("Cache-Control", "no-store"),
    ("Referrer-Policy", "no-referrer"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
]


class Answer(NamedTuple):
    """Type and content of an answer, and what its page may do. field : next to which the page shows a message"""

    kind: str
    body: bytes
    policy: str = POLICY
    status: HTTPStatus = HTTPStatus.OK
    field: str = ""


class RefusedError(Exception):
    """A request that is refused. status : HTTP status of the answer"""

    def __init__(self, status: HTTPStatus, text: str):
        super().__init__(text)
        self.status = status


class LocalPage:
    """The application. hosts : names and port by which the browser addresses this server; token : the secret"""

    def __init__(self, folder: Folder, hosts: Collection[str], token: str):
        self.folder, self.hosts, self.token = folder, hosts, token
        self._computing = Lock()

    def __call__(self, environ: Environ, start_response: StartResponse) -> Iterable[bytes]:
        try:
            answer = self._answer(*self.checked(environ), environ)
        except (RefusedError, InputError) as error:
            status = error.status if isinstance(error, RefusedError) else HTTPStatus.UNPROCESSABLE_ENTITY
            field = error.field if isinstance(error, FieldError) else ""
            answer = Answer(PLAIN, str(error).encode("utf-8", "replace"), status=status, field=field)
        headers = [*HEADERS, ("Content-Type", answer.kind), ("Content-Security-Policy", answer.policy)]
        headers.append(("X-Field", quote(answer.field)))
        headers.append(("Content-Length", str(len(answer.body))))
        start_response(f"{answer.status.value} {answer.status.phrase}", headers)
        return [answer.body]

    def checked(self, environ: Environ) -> tuple[str, list[str]]:
        """Return method and parts of the path after the secret. Raises RefusedError for a request not from our page."""
        host, method = environ.get("HTTP_HOST", ""), environ["REQUEST_METHOD"]
        if host not in self.hosts:
            raise RefusedError(HTTPStatus.FORBIDDEN, "this page is for this computer only: use the address as printed")
        # A path of percent-encoded bytes arrives as Latin-1 (PEP 3333).
        path = environ.get("PATH_INFO", "").encode("latin-1", "replace").decode("utf-8", "replace")
        _, secret, *words = (*path.split("/"), "", "")[: max(3, path.count("/") + 1)]
        if not hmac.compare_digest(secret.encode(), self.token.encode()):
            raise RefusedError(HTTPStatus.NOT_FOUND, "the address lacks the secret that the command printed")
        if method not in ("GET", "POST", "PUT"):
            raise RefusedError(HTTPStatus.METHOD_NOT_ALLOWED, "only GET, POST and PUT are answered")
        if method != "GET" and environ.get("HTTP_ORIGIN") != f"http://{host}":
            raise RefusedError(HTTPStatus.FORBIDDEN, "this request does not come from the page")
        if environ.get("HTTP_SEC_FETCH_SITE", "none") not in ("none", "same-origin"):
            raise RefusedError(HTTPStatus.FORBIDDEN, "this request comes from another page")
        return method, words

    def _answer(self, method: str, words: list[str], environ: Environ) -> Answer:
        match method, words:
            case "GET", [name] if name in FILES:
                file, kind = FILES[name]
                return Answer(
                    kind, resources.files("flightpower.analysis.pages.open").joinpath("templates", file).read_bytes()
                )
            case "GET", ["chart.js"]:
                return Answer("text/javascript", chart_script().encode())
            case "GET", ["chart.css"]:
                return Answer("text/css", chart_style().encode())
            case "GET", ["report", name]:
                return Answer(HTML, self.folder.report(name), REPORT_POLICY)
            case "GET", ["logs"]:
                return _json(
                    {
                        "folder": str(self.folder.path.resolve()),
                        "logs": self.folder.listed(),
                        "polars": self.folder.polars(),
                    }
                )
            case "POST", ["open" | "curve" | "write" | "channels" | "strips" as action]:
                return self._computed(action, _values(environ))
            case "PUT", ["file", name]:
                return self._store_dropped_file(name, environ)
        raise RefusedError(HTTPStatus.NOT_FOUND, "there is no such page")

    def _computed(self, action: str, values: Values) -> Answer:
        with self._computing:
            flight = self.folder.flight(values.file)
            match action:
                case "open":
                    return _json(flight.shown)
                case "curve":
                    return _json(flight.curve(values))
                case "channels":
                    return _json({"names": list(flight.channels)})
                case "strips":
                    return _json(flight.drawn(values))
            return _json(flight.write(values))

    def read_ahead(self, name: str) -> None:
        """Prepare the data of a log for the page. Errors are reported when the page requests the log."""
        with self._computing, suppress(InputError):
            _ = self.folder.flight(name).shown

    def _store_dropped_file(self, name: str, environ: Environ) -> Answer:
        """Write a dropped file into the folder if it is a log, a predicted polar or a map of columns."""
        path = self.folder.new_file(name)
        small = path.suffix.lower() in (".txt", ".dat", ".toml")
        length = _length(environ, LIMITS.request_bytes if small else LIMITS.log_bytes)
        partly = path.with_name(f".{path.name}.part")
        try:
            with partly.open("xb") as stream:
                _copy(environ["wsgi.input"], stream, length)
            try:
                kind = _recognized(partly, path.suffix.lower())
            except InputError as error:
                raise InputError(str(error).replace(str(partly), name)) from None
            partly.rename(path)
            note = _drafted_map(path) if kind is Dropped.TABLE else ""
        except FileExistsError:
            raise InputError(f"{name}: is being written already") from None
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror or error})") from None
        finally:
            with suppress(OSError):
                partly.unlink()
        return _json({"file": name, "kind": kind, "note": note})


class Dropped(StrEnum):
    """The kind of a file dropped on the page."""

    LOG = "log"
    TABLE = "table"
    POLAR = "polar"
    MAP = "map"


def _recognized(path: Path, suffix: str) -> Dropped:
    """Tell what a file is by its contents. Raises InputError if it is nothing that the page can use."""
    if suffix == ".toml":
        load_map(path)
        return Dropped.MAP
    if suffix in POLARS and path.stat().st_size <= LIMITS.request_bytes:
        if is_polar(path):
            return Dropped.POLAR
        if suffix != ".csv":
            _refuse_polar(path)
    if autopilot_of(path):
        return Dropped.LOG
    if is_table(path):
        from flightpower.analysis.sources.table_file import read_columns

        if not read_columns(path):
            raise InputError(f"{path}: a table without a column of numbers; export the flight's channels")
        return Dropped.TABLE
    read_log(path)
    return Dropped.LOG


def _refuse_polar(path: Path) -> None:
    """Raise InputError that says why a file with the suffix of a polar is not a polar; it is not a log either."""
    try:
        read_predicted_polar(path)
    except InputError as error:
        reason = str(error).removeprefix(f"{path}: ")
        raise InputError(f"{path}: no log by its name ({', '.join(suffixes())}), and {reason}") from None


def _drafted_map(table: Path) -> str:
    """Draft a map of a table's columns from their names, next to the table, if there is none; return what to do with
    it."""
    if map_files(table, None):
        return ""
    from flightpower.analysis.sources.map_draft import draft

    beside = table.with_name(f"{table.name}.{BESIDE}")
    try:
        write_file(beside, draft(table, beside))
    except InputError as error:
        return f"{error}; write {beside.name} beside it"
    return (
        f"its columns were drafted by their names into {beside.name} in the folder: correct that file where it is"
        " wrong, then open the table again"
    )


def _length(environ: Environ, most: int) -> int:
    """Return the length of a request's body. Raises RefusedError if it is missing or too large."""
    length = environ.get("CONTENT_LENGTH") or ""
    if not length.isascii() or not length.isdigit():
        raise RefusedError(HTTPStatus.LENGTH_REQUIRED, "the length of the request is missing")
    if int(length) > most:
        raise RefusedError(HTTPStatus.REQUEST_ENTITY_TOO_LARGE, f"too large: {most / 1e6:g} MB are accepted at most")
    return int(length)


def _copy(source: IO[bytes], to: IO[bytes], length: int, at_once: int = 1 << 20) -> None:
    while length > 0:
        part = source.read(min(length, at_once))
        if not part:
            raise InputError("the file did not arrive completely; drop it again")
        to.write(part)
        length -= len(part)


def _values(environ: Environ) -> Values:
    """Return the values in a request. Raises RefusedError if they are invalid."""
    if environ.get("CONTENT_TYPE", "").split(";")[0].strip() != JSON:
        raise RefusedError(HTTPStatus.UNSUPPORTED_MEDIA_TYPE, "the request should be JSON")
    body = environ["wsgi.input"].read(_length(environ, LIMITS.request_bytes))
    try:
        values = msgspec.json.decode(body, type=Values)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise RefusedError(HTTPStatus.BAD_REQUEST, f"the request cannot be understood: {error}") from None
    if len(values.runs or []) > LIMITS.entries or len(values.aircraft) > LIMITS.entries:
        raise RefusedError(HTTPStatus.BAD_REQUEST, f"more than {LIMITS.entries} runs or values")
    return values


def _json(content: object) -> Answer:
    return Answer(JSON, msgspec.json.encode(content, enc_hook=plain))


def server_of(page: LocalPage, listening: socket) -> Any:
    """Return a server that reads a request's body only if the head shows that the page will answer the request."""
    import waitress  # type: ignore[import-untyped]
    from waitress.channel import HTTPChannel  # type: ignore[import-untyped]
    from waitress.parser import HTTPRequestParser  # type: ignore[import-untyped]

    class Parser(HTTPRequestParser):  # type: ignore[misc]
        def parse_header(self, header_plus: bytes) -> None:
            super().parse_header(header_plus)
            environ = {f"HTTP_{name}": value for name, value in self.headers.items()}
            try:
                page.checked(environ | {"REQUEST_METHOD": self.command, "PATH_INFO": self.path})
            except RefusedError:  # the page refuses it, and the connection with the body is closed
                self.body_rcv, self.content_length = None, 0
                self.expect_continue = False
                self.headers["CONNECTION"] = "close"  # this makes waitress close it

    class Channel(HTTPChannel):  # type: ignore[misc]
        parser_class = Parser

    # As on the status page, idle connections cannot block the reader: many are allowed, and each is closed soon.
    server = waitress.create_server(
        page, sockets=[listening], threads=4, ident="", max_request_body_size=LIMITS.log_bytes,
        connection_limit=500, channel_timeout=10, cleanup_interval=5, asyncore_use_poll=True,
    )  # fmt: skip
    server.channel_class = Channel
    return server


def serve(folder: Folder, listening: socket, token: str, first: str) -> None:
    """Serve the page until the process is stopped. first : a log to read ahead, or ''"""
    logging.getLogger("waitress.queue").setLevel(logging.ERROR)  # no warning for requests that wait for a curve
    port = listening.getsockname()[1]
    page = LocalPage(folder, hosts={f"127.0.0.1:{port}", f"localhost:{port}"}, token=token)
    server = server_of(page, listening)
    if first:
        Thread(target=page.read_ahead, args=(first,), daemon=True).start()
    server.run()
    # Requests and reading ahead may still be computing. A thread inside a C++ library would abort the process when the
    # interpreter shuts down, so the process ends before that; by then it has waited for other processes.
    atexit.register(os._exit, 0)
