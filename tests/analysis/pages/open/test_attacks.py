"""What other pages, programs and wrong files may try on the local page: refused, nothing written, nothing read."""

import gzip
import io
import json
import os
import socket
from collections.abc import Iterator
from pathlib import Path
from threading import Thread
from typing import Any, NamedTuple

import pytest

from flightpower.analysis.pages.open.flights import Folder
from flightpower.analysis.pages.open.request import LIMITS
from flightpower.analysis.pages.open.server import LocalPage, server_of
from tests.browser import HANGS_S
from tests.unchanged.commands import flight

HOST, TOKEN = "127.0.0.1:5555", "the-secret-of-this-page"
VALUES = {"file": "log.mcap"}
OUTSIDE = "../secret.mcap"


class Answer(NamedTuple):
    status: int
    headers: dict[str, str]
    body: bytes


@pytest.fixture
def page(opened: Folder) -> LocalPage:
    return LocalPage(opened, {HOST}, TOKEN)


def answer_to(page: LocalPage, method: str, path: str, body: bytes = b"", **changed: Any) -> Answer:
    """The answer to a request by the page itself; `changed` replaces entries of the WSGI environment, None removes
    one."""
    environ = {
        "REQUEST_METHOD": method, "PATH_INFO": path, "HTTP_HOST": HOST, "wsgi.input": io.BytesIO(body),
        "CONTENT_LENGTH": str(len(body)), "HTTP_SEC_FETCH_SITE": "same-origin",
    }  # fmt: skip
    if method != "GET":
        environ |= {"HTTP_ORIGIN": f"http://{HOST}", "CONTENT_TYPE": "application/json"}
    environ |= changed
    environ = {key: value for key, value in environ.items() if value is not None}
    result: list[Any] = []
    content = b"".join(page(environ, lambda status, headers: result.extend((status, headers))))
    return Answer(int(result[0].split()[0]), dict(result[1]), content)


def of(name: str) -> str:
    return f"/{TOKEN}/{name}"


def values(**changed: Any) -> bytes:
    return json.dumps(VALUES | changed).encode()


def test_the_page_itself_is_answered(page: LocalPage) -> None:
    """If it were not, the table below would pass whatever the request."""
    for name, kind in (("", "text/html"), ("page.js", "text/javascript"), ("page.css", "text/css")):
        answer = answer_to(page, "GET", of(name))
        assert answer.status == 200 and answer.headers["Content-Type"].startswith(kind)
    assert json.loads(answer_to(page, "GET", of("logs")).body)["logs"][0]["name"] == "log.mcap"
    assert json.loads(answer_to(page, "POST", of("open"), values()).body)["file"] == "log.mcap"
    assert json.loads(answer_to(page, "POST", of("curve"), values()).body)["curve"]["power_W"]


RUN = {"kind": "deceleration", "start_s": 77.0, "end_s": 89.0, "keep": True}
ATTACKS: dict[str, tuple[str, str, bytes, dict[str, Any]]] = {
    "without the secret": ("GET", "/", b"", {}),
    "without a path": ("GET", "", b"", {}),
    "another secret": ("GET", "/guess/", b"", {}),
    "a part of the secret": ("GET", f"/{TOKEN[:-1]}/", b"", {}),
    "a secret of other letters": ("GET", "/\xff\xfe/", b"", {}),
    "the secret elsewhere": ("GET", f"/x/{TOKEN}/", b"", {}),
    "a foreign name that leads here": ("GET", of(""), b"", {"HTTP_HOST": "evil.example:5555"}),
    "another port": ("GET", of(""), b"", {"HTTP_HOST": "127.0.0.1:80"}),
    "no host": ("GET", of(""), b"", {"HTTP_HOST": None}),
    "a name that begins like ours": ("GET", of(""), b"", {"HTTP_HOST": HOST + ".evil.example"}),
    "a link on another page": ("GET", of("logs"), b"", {"HTTP_SEC_FETCH_SITE": "cross-site"}),
    "another server of this computer": ("GET", of("logs"), b"", {"HTTP_SEC_FETCH_SITE": "same-site"}),
    "a form on another page": ("POST", of("write"), values(), {"HTTP_ORIGIN": "http://evil.example"}),
    "a request without origin": ("POST", of("write"), values(), {"HTTP_ORIGIN": None}),
    "a report that asks": ("POST", of("write"), values(), {"HTTP_ORIGIN": "null"}),
    "the origin over https": ("POST", of("write"), values(), {"HTTP_ORIGIN": f"https://{HOST}"}),
    "another port's origin": ("POST", of("write"), values(), {"HTTP_ORIGIN": "http://127.0.0.1:80"}),
    "a plain form": ("POST", of("write"), values(), {"CONTENT_TYPE": "application/x-www-form-urlencoded"}),
    "text as JSON": ("POST", of("write"), values(), {"CONTENT_TYPE": "text/plain"}),
    "writing by GET": ("GET", of("write"), b"", {}),
    "deleting": ("DELETE", of("file/log.mcap"), b"", {}),
    "options": ("OPTIONS", of("write"), b"", {}),
    "no such page": ("GET", of("etc/passwd"), b"", {}),
    "a template by path": ("GET", of("../server.py"), b"", {}),
    "up by a report": ("GET", of("report/../../secret.mcap"), b"", {}),
    "up in one word": ("GET", of("report/..%2f..%2fsecret.mcap"), b"", {}),
    "up by backslashes": ("GET", of("report/..\\secret.mcap"), b"", {}),
    "the report of a log that has none": ("GET", of("report/log.mcap"), b"", {}),
    "a file outside": ("POST", of("open"), values(file=OUTSIDE), {}),
    "an absolute file": ("POST", of("open"), values(file="/etc/passwd"), {}),
    "an end of text in the name": ("POST", of("open"), values(file="log.mcap\0.txt"), {}),
    "the folder itself": ("POST", of("open"), values(file="."), {}),
    "a link that leads out": ("POST", of("open"), values(file="link.mcap"), {}),
    "no JSON": ("POST", of("open"), b"{", {}),
    "another form of JSON": ("POST", of("open"), b"[1, 2]", {}),
    "unknown fields": ("POST", of("open"), values(command="rm -rf"), {}),
    "deep JSON": ("POST", of("open"), b"[" * 100_000, {}),
    "no length": ("POST", of("open"), values(), {"CONTENT_LENGTH": None}),
    "a negative length": ("POST", of("open"), values(), {"CONTENT_LENGTH": "-1"}),
    "a length beyond the limit": ("POST", of("open"), values(), {"CONTENT_LENGTH": str(LIMITS.request_bytes + 1)}),
    "runs without end": ("POST", of("curve"), values(runs=[RUN] * (LIMITS.entries + 1)), {}),
    "times that are no numbers": ("POST", of("curve"), values(runs=[RUN | {"start_s": "NaN"}]), {}),
    "a list of nothing": ("POST", of("write"), values(runs=[]), {}),
    "a propeller by path": ("POST", of("write"), values(propeller=OUTSIDE), {}),
    "a key that is a section": ("POST", of("write"), values(aircraft={"mass]\nweight": "1"}), {}),
    "a log that is none": ("PUT", of("file/new.mcap"), b"not a log", {}),
    "an empty log": ("PUT", of("file/new.mcap"), b"", {}),
    "a log cut short": ("PUT", of("file/new.mcap"), b"\x89MCAP0\r\n", {"CONTENT_LENGTH": "1000"}),
    "a log beyond the limit": ("PUT", of("file/new.mcap"), b"", {"CONTENT_LENGTH": str(LIMITS.log_bytes + 1)}),
    "a log over another": ("PUT", of("file/log.mcap"), b"x", {}),
    "a log with a path": ("PUT", of("file/../new.mcap"), b"x", {}),
    "a log outside by backslash": ("PUT", of("file/..\\new.mcap"), b"x", {}),
    "a hidden log": ("PUT", of("file/.new.mcap"), b"x", {}),
    "a polar that is none": ("PUT", of("file/polar.csv"), b"name,value\na,1\n", {}),
    "a polar beyond the limit": (
        "PUT", of("file/polar.txt"), b"", {"CONTENT_LENGTH": str(LIMITS.request_bytes + 1)}
    ),
    "a polar outside": ("POST", of("curve"), values(polar=OUTSIDE), {}),
    "a polar by an absolute path": ("POST", of("write"), values(polar="/etc/passwd"), {}),
    "a log as a polar": ("POST", of("curve"), values(polar="log.mcap"), {}),
    "a program": ("PUT", of("file/run.sh"), b"x", {}),
    "a name with a control character": ("PUT", of("file/new\x07.mcap"), b"x", {}),
    "a map of columns that is none": ("PUT", of("file/new.columns.toml"), b"[speed]\n", {}),
    "an aircraft file": ("PUT", of("file/new.toml"), b"x = 1\n", {}),
    "a table without numbers": ("PUT", of("file/new.parquet"), b"PAR1 and nothing", {}),
    "a channel that is none": ("POST", of("strips"), values(channels=["../secret"]), {}),
    "channels without end": ("POST", of("strips"), values(channels=["/imu status"] * 100), {}),
    "a stretch of a flight with runs": ("POST", of("curve"), values(aircraft={"mass": "1 kg"}), {}),
    "a log with a device's name": ("PUT", of("file/new.mcap:stream"), b"x", {}),
    "a log whose name is too long": ("PUT", of(f"file/{'n' * 300}.mcap"), b"x", {}),
    "a log from another page": ("PUT", of("file/new.mcap"), b"x", {"HTTP_ORIGIN": "http://evil.example"}),
}  # fmt: skip


def files_in(folder: Path) -> dict[Path, tuple[int, int]]:
    """Every file and folder but the workspace, with size and time of change."""
    paths = [path for path in folder.rglob("*") if path.parent.name != "workspace"]
    stat = {path: path.lstat() for path in paths}
    return {path: (0, 0) if path.is_dir() else (item.st_size, item.st_mtime_ns) for path, item in stat.items()}


@pytest.mark.parametrize("name", ATTACKS)
def test_an_attack_is_refused_in_words_and_leaves_everything_as_it_was(page: LocalPage, name: str) -> None:
    folder = page.folder.path
    (folder / "link.mcap").symlink_to(folder.parent / "secret.mcap")
    before = files_in(folder.parent)
    method, path, body, changed = ATTACKS[name]
    answer = answer_to(page, method, path, body, **changed)
    assert 400 <= answer.status < 500 and answer.headers["Content-Type"].startswith("text/plain")
    content = answer.body.decode()
    assert content and "\n" not in content and "Traceback" not in content
    assert "SECRET" not in content and "root:" not in content and TOKEN not in content
    assert "unsafe" not in answer.headers["Content-Security-Policy"]
    assert files_in(folder.parent) == before


def test_a_dropped_log_is_kept_and_opens(page: LocalPage, flown: bytes) -> None:
    answer = answer_to(page, "PUT", of("file/dropped flight (2).mcap"), flown)
    assert answer.status == 200
    assert (
        json.loads(answer_to(page, "POST", of("open"), values(file="dropped flight (2).mcap")).body)["kind"]
        == "power_required"
    )


def test_a_text_that_is_dropped_is_refused_as_a_log_too(page: LocalPage) -> None:
    answer = answer_to(page, "PUT", of("file/readme.txt"), b"Flights of May.\n")
    content = answer.body.decode()
    assert answer.status == 422 and content.startswith("readme.txt: no log by its name (.mcap, .ulg, ")
    assert "and no polar: neither columns CL and CD" in content
    assert "readme.txt" not in files_in(page.folder.path)


@pytest.mark.parametrize(
    "name", ["полёт.mcap", "उड़ान 3.mcap", "飛行.mcap", "vol d'été (2).MCAP", "رحلة.mcap", "u\u0308bung.mcap"]
)
def test_names_in_any_script_are_kept(page: LocalPage, flown: bytes, name: str) -> None:
    """The percent-encoded bytes of a path arrive as Latin-1 (PEP 3333)."""
    sent = of(f"file/{name}").encode().decode("latin-1")
    assert json.loads(answer_to(page, "PUT", sent, flown).body)["file"] == name
    assert name in page.folder.logs()
    refused = answer_to(page, "PUT", sent, flown)
    assert refused.status == 422 and b"rename the file" in refused.body


def test_a_message_says_at_which_field_it_belongs(page: LocalPage) -> None:
    answer = answer_to(page, "POST", of("curve"), values(aircraft={"mass.weight": "heavy", "geometry.span": "1.8 m"}))
    assert (answer.status, answer.headers["X-Field"]) == (422, "mass.weight")
    answer = answer_to(page, "POST", of("curve"), values(runs=[RUN | {"start_s": 99.0}]))
    assert (answer.status, answer.headers["X-Field"]) == (422, "run%200")
    assert answer_to(page, "POST", of("open"), values()).headers["X-Field"] == ""


def test_every_format_that_is_analyzed_can_be_dropped(page: LocalPage) -> None:
    """Each is listed with its kind; a table without a map gets one drafted from its column names."""
    t_s = [k / 5 for k in range(60)]
    table = "time [s],airspeed [m/s],pressure [Pa],voltage [V],current [A]\n"
    table += "".join(f"{t},{15 + t / 10},{101000 - t},12.5,{5 + t / 100}\n" for t in t_s)
    lines = "".join(f"{t:.3f} 20 ENERGY 55 11.5 1.7\n" for t in t_s).encode()
    flown = flight("ordinary-flight", "--as", "ardupilot", "--seed", "3")
    kinds = {
        "flight.csv": (table.encode(), "table"), "flight.csv.gz": (gzip.compress(table.encode()), "table"),
        "radio.data": (lines, "log"), "radio.data.gz": (gzip.compress(lines), "log"),
        "flight.BIN": (flown, "log"), "packed.BIN.gz": (gzip.compress(flown), "log"),
        "mine.columns.toml": (b'[time]\ncolumn = "t"\nunit = "s"\n', "map"),
        "polar.csv": (b"CL,CD\n0.2,0.03\n0.6,0.04\n1.0,0.08\n", "polar"),
    }  # fmt: skip
    for name, (content, kind) in kinds.items():
        answer = answer_to(page, "PUT", of(f"file/{name}"), content)
        assert answer.status == 200, (name, answer.body)
        assert json.loads(answer.body)["kind"] == kind
    drafted = (page.folder.path / "flight.csv.columns.toml").read_text("utf-8")
    assert 'column = "current [A]"' in drafted
    listed = {log["name"]: log["kind"] for log in json.loads(answer_to(page, "GET", of("logs")).body)["logs"]}
    assert listed == {
        "flight.csv": "table", "flight.csv.gz": "table", "radio.data": "Paparazzi", "radio.data.gz": "Paparazzi",
        "flight.BIN": "ArduPilot", "packed.BIN.gz": "ArduPilot", "log.mcap": "flightpower",
    }  # fmt: skip


def test_logs_are_listed_by_date_with_length_and_kind(page: LocalPage, flown: bytes) -> None:
    folder = page.folder.path
    for name, mtime_s in (("old.data", 1.5e9), ("new.data", 1.7e9)):
        (folder / name).write_text("".join(f"{k / 2:.3f} 20 ENERGY 55 11.5 1.7\n" for k in range(600)))
        os.utime(folder / name, (mtime_s, mtime_s))
    answer = json.loads(answer_to(page, "GET", of("logs")).body)
    assert answer["folder"] == str(folder)
    results = [log for log in answer["logs"] if log["name"] != "log.mcap"]
    assert [log["name"] for log in results] == ["new.data", "old.data"]
    assert results[0]["date"].startswith("2023-11-1") and results[0]["of_file"]
    assert results[0]["length"] == "5 min" and results[0]["kind"] == "Paparazzi" and not results[0]["report"]


def test_a_report_is_shown_where_it_can_reach_nothing(page: LocalPage) -> None:
    (page.folder.path / "log.report").mkdir()
    (page.folder.path / "log.report" / "report.html").write_text("<!doctype html><title>Report</title>", "utf-8")
    answer = answer_to(page, "GET", of("report/log.mcap"))
    assert answer.body.lstrip().lower().startswith(b"<!doctype html>")
    policy = answer.headers["Content-Security-Policy"].split("; ")
    assert policy[0] == "sandbox allow-scripts allow-downloads" and "default-src 'none'" in policy
    assert not any("connect-src" in word for word in policy)


def test_a_linked_report_folder_that_leads_out_is_not_read(page: LocalPage, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "report.html").write_text("SECRET", "utf-8")
    (page.folder.path / "log.report").symlink_to(tmp_path / "elsewhere")
    assert answer_to(page, "GET", of("report/log.mcap")).status == 422


@pytest.fixture
def address(opened: Folder) -> Iterator[tuple[str, int]]:
    """Address of the page on a real server, with HOST as its host."""
    with socket.create_server(("127.0.0.1", 0), backlog=256) as listening:
        server = server_of(LocalPage(opened, {HOST}, TOKEN), listening)
        Thread(target=server.run, daemon=True).start()
        yield listening.getsockname()
        server.close()


def head(path: str, host: str = HOST, **lines: object) -> bytes:
    """The head of a request that announces a body of the largest accepted size."""
    lines = {"Host": host, "Origin": f"http://{host}", "Content-Length": LIMITS.log_bytes - 1} | lines
    return "\r\n".join(
        [f"PUT {path} HTTP/1.1", *(f"{name}: {value}" for name, value in lines.items()), "", ""]
    ).encode()


@pytest.mark.parametrize(("sent", "status"), [
    (head(of("file/new.mcap"), "evil.example:5555"), b"403"),
    (head("/guess/file/new.mcap"), b"404"),
    (head(of("file/new.mcap"), Origin="http://evil.example"), b"403"),
    (head("/guess/file/new.mcap", Expect="100-continue"), b"404"),
])  # fmt: skip
def test_the_body_of_a_request_that_is_refused_is_not_taken(
    address: tuple[str, int], sent: bytes, status: bytes
) -> None:
    """The answer comes before the first byte of the body, and the connection is closed."""
    with socket.create_connection(address, timeout=HANGS_S) as attacker:
        attacker.sendall(sent)
        answer = b""
        while part := attacker.recv(4096):
            answer += part
    assert answer.startswith(b"HTTP/1.1 " + status) and b"100 Continue" not in answer
    assert b"\r\nConnection: close\r\n" in answer, "at once, not after the ten seconds of a silent connection"


def test_a_body_that_the_page_wants_is_taken(address: tuple[str, int], flown: bytes, opened: Folder) -> None:
    with socket.create_connection(address, timeout=HANGS_S) as reader:
        announced = str(LIMITS.log_bytes - 1).encode()
        reader.sendall(head(of("file/new.mcap")).replace(announced, str(len(flown)).encode()) + flown)
        assert reader.recv(12) == b"HTTP/1.1 200"
    assert (opened.path / "new.mcap").read_bytes() == flown


def test_connections_that_ask_for_nothing_do_not_shut_the_reader_out(address: tuple[str, int]) -> None:
    idle = [socket.create_connection(address) for _ in range(150)]
    for connection in idle[:75]:
        connection.sendall(b"GET /")
    with socket.create_connection(address, timeout=HANGS_S) as reader:
        reader.sendall(f"GET {of('')} HTTP/1.1\r\nHost: {HOST}\r\n\r\n".encode())
        assert reader.recv(12) == b"HTTP/1.1 200"
    for connection in idle:
        connection.close()
