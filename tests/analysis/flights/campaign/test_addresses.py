"""Logs in object storage and on servers are listed once and read once; a failure costs only its own log and one
line."""

import multiprocessing.forkserver
import threading
from collections.abc import Iterator
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from stub_analysis import Stub
from test_campaign import Silent

from flightpower.analysis.cli.analyze import app
from flightpower.analysis.flights.campaign import addresses
from flightpower.analysis.flights.campaign.addresses import RemoteLog, fetch, find_logs
from flightpower.analysis.flights.campaign.campaign import Campaign, Work, run
from flightpower.analysis.flights.campaign.folders import exclusive, record_of
from flightpower.flight.errors import InputError
from tests.s3_server import Store, running

pytest.importorskip("s3fs")


@pytest.fixture(scope="module")
def server() -> Iterator[Store]:
    forkserver = multiprocessing.forkserver._forkserver  # type: ignore[attr-defined]  # its processes have its environment
    forkserver._stop()
    with running() as store, pytest.MonkeyPatch.context() as patch:
        for name, value in store.environment.items():
            patch.setenv(name, value)
        yield store
    forkserver._stop()


@pytest.fixture
def store(server: Store, monkeypatch: pytest.MonkeyPatch) -> Store:
    """An empty store, whose requests this process repeats without pauses."""
    for contents in (server.objects, server.failing, server.torn, server.requests):
        contents.clear()
    monkeypatch.setattr(addresses.time, "sleep", lambda _: None)
    return server


@pytest.fixture
def work(tmp_path: Path) -> Work:
    return Work(Stub(tmp_path / "calls"), preload=("s3fs",))


def run_in(folder: Path, work: Work, *arguments: str, scheduler: str | None = None) -> Campaign:
    with exclusive(folder):
        return run(find_logs(arguments), folder, work, Silent(), jobs=2, scheduler=scheduler)


def analyzed(work: Work) -> list[str]:
    path = work.analyze.calls  # type: ignore[attr-defined]
    words = sorted(path.read_text().split()) if path.exists() else []
    path.unlink(missing_ok=True)
    return words


@pytest.mark.slow
def test_a_bucket_is_listed_once_and_each_log_is_read_once(tmp_path: Path, store: Store, work: Work) -> None:
    out, flights = tmp_path / "out", "s3://fleet/flights/"
    store.objects |= {"fleet/flights/a.mcap": b"1", "fleet/flights/may/b.mcap": b"22", "fleet/flights/notes.txt": b"-"}
    run = run_in(out, work, flights)
    assert [folder.name for folder in run.folders] == ["a", "b"] and not run.failures
    assert store.requests == {"fleet": 1, "fleet/flights/a.mcap": 1, "fleet/flights/may/b.mcap": 1}
    assert analyzed(work) == ["a.mcap", "b.mcap"] and not list(out.rglob(".log-*"))
    store.requests.clear()
    assert run_in(out, work, flights).completed == 2 and store.requests == {"fleet": 1}, "by size and ETag"
    store.objects["fleet/flights/a.mcap"] = b"5"
    assert run_in(out, work, flights).completed == 1 and analyzed(work) == ["a.mcap"]
    assert (out / "a" / "results.json").read_text().startswith("s3://fleet/flights/a.mcap ['5']")


def test_an_object_is_known_by_its_content_wherever_it_is(tmp_path: Path, store: Store, work: Work) -> None:
    """This holds if it is moved, copied, or on this computer."""
    out = tmp_path / "out"
    store.objects |= {"fleet/a.mcap": b"1", "fleet/b.mcap": b"22"}
    run_in(out, work, "s3://fleet/")
    analyzed(work)
    store.objects["fleet/later/c.mcap"] = store.objects.pop("fleet/b.mcap")
    store.objects["fleet/copy.mcap"] = b"1"
    run = run_in(out, work, "s3://fleet/")
    assert [folder.name for folder in run.folders] == ["a", "c"] and len(run.notes) == 1 and analyzed(work) == []
    (tmp_path / "c.mcap").write_bytes(b"22")
    assert run_in(out, work, str(tmp_path / "c.mcap")).completed == 1 and analyzed(work) == []


def test_a_store_that_fails_costs_its_own_logs(tmp_path: Path, store: Store, work: Work) -> None:
    """If it refuses some requests because there are too many, this costs only time."""
    store.objects |= {f"fleet/{name}.mcap": name.encode() * size for size, name in enumerate("abcd", start=1)}
    store.failing |= {"fleet": 2, "fleet/a.mcap": 2}
    store.torn.add("fleet/c.mcap")
    store.objects["fleet/wrong.mcap"] = b"wrong words"
    find_logs(["s3://fleet/"])
    local = tmp_path / "local.mcap"
    local.write_text("here")
    logs = find_logs(["s3://fleet/", "s3://no-bucket/", "s3://fleet/none.mcap", "s4://fleet/", str(local)])
    store.objects.pop("fleet/d.mcap")  # after the listing
    with exclusive(tmp_path / "out"):
        result = run(logs, tmp_path / "out", work, Silent(), jobs=2)
    assert [folder.name for folder in result.folders] == ["a", "b", "local"]
    messages = [line.partition(": ")[0] for line in result.failures]
    lost = [
        "s3://fleet/c.mcap",
        "s3://fleet/d.mcap",
        "s3://fleet/none.mcap",
        "s3://fleet/wrong.mcap",
        "s3://no-bucket/",
    ]
    assert messages == [*lost, "s4://fleet/"] and all("\n" not in line for line in result.failures)


def test_a_store_that_goes_on_failing_is_not_asked_for_ever(store: Store, tmp_path: Path) -> None:
    store.objects["fleet/a.mcap"] = b"1"
    (log,) = find_logs(["s3://fleet/a.mcap"]).logs
    store.torn.add("fleet/a.mcap")
    store.requests.clear()
    with pytest.raises(InputError, match=r"s3://fleet/a\.mcap: cannot be read"):
        fetch(log, tmp_path / "a.mcap")  # type: ignore[arg-type]
    assert 3 <= store.requests["fleet/a.mcap"] <= 30


def test_a_listing_of_several_pages_is_whole(store: Store) -> None:
    store.objects |= {f"fleet/{i:05d}.ulg": bytes(i % 7) for i in range(1100)}
    logs = find_logs(["s3://fleet"])
    assert len(logs.logs) == 1100 and logs.in_folders and store.requests["fleet"] <= 3


@pytest.mark.thorough
@pytest.mark.slow
def test_a_cluster_is_sent_files_and_reads_addresses_itself(tmp_path: Path, store: Store, work: Work) -> None:
    """A job that fails there costs only its own flight."""
    distributed = pytest.importorskip("distributed")
    store.objects |= {"fleet/b.mcap": b"killed", "fleet/c.mcap": b"333"}
    local = tmp_path / "a.mcap"
    local.write_text("1")
    options = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": None}
    with distributed.LocalCluster(**options) as cluster:
        run = run_in(tmp_path / "out", work, str(local), "s3://fleet/", scheduler=cluster.scheduler_address)
    assert [folder.name for folder in run.folders] == ["a", "c"]
    assert len(run.failures) == 1 and run.failures[0].startswith("s3://fleet/b.mcap: ")
    run_in(tmp_path / "here", work, str(local))
    results = [(tmp_path / where / "a" / "results.json").read_bytes() for where in ("out", "here")]
    assert results[0] == results[1]
    record = record_of(tmp_path / "out" / "c")
    assert record and record.log.path == "s3://fleet/c.mcap" and len(record.log.digest) == 64


@pytest.fixture
def website(tmp_path: Path) -> Iterator[str]:
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None: ...

    (tmp_path / "site").mkdir()
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(Quiet, directory=str(tmp_path / "site"))) as http:
        threading.Thread(target=http.serve_forever, args=(0.05,), daemon=True).start()
        yield f"http://127.0.0.1:{http.server_port}/"
        http.shutdown()


def test_a_page_of_links_is_a_folder_and_signatures_are_not_written(tmp_path: Path, website: str, work: Work) -> None:
    for name, text in {"a.mcap": "1", "b.ulg": "22", "index.txt": "no log"}.items():
        (tmp_path / "site" / name).write_text(text)
    assert [str(log) for log in find_logs([website]).logs] == [f"{website}a.mcap", f"{website}b.ulg"]
    run = run_in(tmp_path / "out", work, f"{website}a.mcap?signature=secret", f"{website}lost.mcap?signature=secret")
    assert [folder.name for folder in run.folders] == ["a"] and run.failures[0].startswith(f"{website}lost.mcap: ")
    assert "secret" not in run.failures[0] + (tmp_path / "out" / "a" / "inputs.json").read_text()
    with_password = website.replace("//", "//user:secret@")
    assert "secret" not in find_logs([with_password]).failures[0]
    assert run_in(tmp_path / "out", work, f"{website}a.mcap?signature=other").completed == 1, "by time of change"


def test_one_log_at_an_address_is_refused_by_its_address(store: Store, tmp_path: Path, monkeypatch) -> None:
    from typer.testing import CliRunner

    monkeypatch.chdir(tmp_path)
    store.objects["fleet/a.mcap"] = b"not a log"
    outcome = CliRunner().invoke(app, ["s3://fleet/a.mcap"])
    assert isinstance(outcome.exception, InputError) and str(outcome.exception).startswith("s3://fleet/a.mcap: ")
    assert not list(tmp_path.iterdir())


def test_a_folder_of_this_computer_is_its_logs(tmp_path: Path) -> None:
    (tmp_path / "may").mkdir()
    for name in ("a.mcap", "may/b.BIN", "may/notes.txt"):
        (tmp_path / name).write_text("1")
    assert find_logs([str(tmp_path)]).logs == [tmp_path / "a.mcap", tmp_path / "may" / "b.BIN"]
    assert find_logs([str(tmp_path / "none.mcap")]).logs == [tmp_path / "none.mcap"]


def test_a_folder_of_results_is_distinguished_from_one_without_logs(tmp_path: Path) -> None:
    assert find_logs([str(tmp_path)]).failures == [f"{tmp_path}: no logs in this folder"]
    (tmp_path / "flight").mkdir()
    (tmp_path / "flight" / "results.json").write_text("{}")
    (failure,) = find_logs([str(tmp_path)]).failures
    assert "but results of `analyze`" in failure and "with this folder after -o" in failure


def test_the_same_content_at_another_address_is_another_place() -> None:
    remote_log = RemoteLog("s3://fleet/may/log.mcap", 1, "x")
    assert remote_log.place.parts == ("/", "fleet", "may", "log.mcap")


@pytest.mark.parametrize(("failures", "requested", "answered"), [(3, 4, True), (9, 4, False)])
def test_what_fails_for_a_while_is_asked_again(monkeypatch, failures: int, requested: int, answered: bool) -> None:
    """This also holds for libraries that do not retry by themselves; it takes at most ten seconds."""
    pauses: list[float] = []
    monkeypatch.setattr(addresses.time, "sleep", pauses.append)
    calls = 0

    def ask() -> str:
        nonlocal calls
        calls += 1
        if calls <= failures:
            raise OSError("busy")
        return "there"

    if answered:
        assert addresses._answer_of("s3://fleet/", ask) == "there"
    else:
        with pytest.raises(InputError):
            addresses._answer_of("s3://fleet/", ask)
    assert calls == requested and sum(pauses) < 10
