"""`flightpower open` as it is called: what it opens, and that it closes with its terminal."""

import gzip
import os
import signal
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from urllib.error import HTTPError, URLError
from urllib.request import urlopen

import pytest

from flightpower.analysis.pages.open.command import opened_folder
from flightpower.analysis.pages.open.flights import open_flight
from flightpower.analysis.pages.open.runs_flight import RunsFlight
from flightpower.flight.errors import InputError
from flightpower.flight.log_index import MAGIC
from flightpower.flight.log_reader import read_log
from tests.browser import HANGS_S


def test_logs_of_one_folder_are_opened_and_others_refused(tmp_path: Path) -> None:
    (tmp_path / "a").mkdir()
    for name in ("one.mcap", "two.mcap", "a/three.mcap"):
        (tmp_path / name).write_bytes(MAGIC)
    path, two, three = tmp_path / "one.mcap", tmp_path / "two.mcap", tmp_path / "a" / "three.mcap"
    assert opened_folder([path, two]) == (tmp_path, "one.mcap")
    assert opened_folder([tmp_path]) == (tmp_path, "") and opened_folder([]) == (Path(), "")
    for wrong in ([path, three], [tmp_path / "missing.mcap"]):
        with pytest.raises(InputError):
            opened_folder(wrong)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("readme.txt", b"Flights of May.\n", "text, which is not read: logs are"),
        ("empty.ulg", b"", "the file is empty"),
        ("photo.mcap", b"\x89PNG\r\n\x1a\n" + bytes(9), "an image, which is not read"),
        ("flight.txt", b"t_s,v_mps\n0,1\n1,2\n2,3\n", "rename it to end in .mcap"),
        ("flight.ulg.old", b"ULog\x01\x12\x35" + bytes(9), "rename it to end in .mcap"),
        ("flight.mcap.gz", gzip.compress(MAGIC, mtime=0), "a compressed file, which is not read: unpack it"),
    ],
)
def test_a_file_that_is_no_log_is_refused_before_a_page_is_served(
    tmp_path: Path, name: str, content: bytes, message: str
) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        opened_folder([tmp_path / name])


def test_a_packed_log_and_a_table_are_opened(tmp_path: Path) -> None:
    (tmp_path / "a.ulg.gz").write_bytes(gzip.compress(b"ULog\x01\x12\x35" + bytes(9)))
    (tmp_path / "b.csv").write_text("t_s,v_mps\n0,1\n1,2\n2,3\n")
    for name in ("a.ulg.gz", "b.csv"):
        assert opened_folder([tmp_path / name]) == (tmp_path, name)


def test_a_log_that_is_being_read_is_not_read_again(flown: bytes, tmp_path: Path) -> None:
    log = tmp_path / "log.mcap"
    log.write_bytes(flown)
    source = read_log(log)
    opened = open_flight(log, tmp_path, lambda: source)
    assert isinstance(opened, RunsFlight) and opened.log is source


@pytest.mark.parametrize("closing", [signal.SIGHUP, signal.SIGINT])
def test_the_page_closes_with_the_terminal_and_leaves_nothing(
    flown: bytes, tmp_path: Path, closing: signal.Signals
) -> None:
    """This includes the process that reads the log."""
    for name in ("flights", "temporary"):
        (tmp_path / name).mkdir()
    (tmp_path / "flights" / "log.mcap").write_bytes(flown)
    command = [sys.executable, "-m", "flightpower", "open", str(tmp_path / "flights" / "log.mcap"), "--no-browser"]
    environment = os.environ | {"TMPDIR": str(tmp_path / "temporary")}
    with (
        subprocess.Popen(
            command,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
            env=environment,
            preexec_fn=lambda: signal.signal(closing, signal.SIG_DFL),  # a shell's job in the background ignores it
        ) as page,
        ExitStack() as at_the_end,
    ):
        at_the_end.callback(page.kill)
        assert page.stdout is not None
        address = page.stdout.readline().strip()
        assert address.startswith("http://127.0.0.1:") and len(address.split("/")[3]) >= 32, "this computer, a secret"
        with urlopen(address, timeout=HANGS_S) as answer:
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        with pytest.raises(HTTPError):
            urlopen(address.rsplit("/", 2)[0] + "/", timeout=HANGS_S)
        page.send_signal(closing)
        assert page.wait(HANGS_S) in (0, 130)
    with pytest.raises(URLError):
        urlopen(address, timeout=HANGS_S)
    assert [*(tmp_path / "temporary").iterdir()] == []
