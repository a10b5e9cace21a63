"""Many logs: finished analyses stay, a failure costs only its own flight, and a folder is complete or absent."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from stub_analysis import SLOW_S, Stub

from flightpower.analysis.flights.campaign.addresses import FoundLogs
from flightpower.analysis.flights.campaign.campaign import Campaign, Work, run
from flightpower.analysis.flights.campaign.cluster import Parcel, analyze_parcel
from flightpower.analysis.flights.campaign.folders import exclusive, names, software
from flightpower.analysis.flights.campaign.processes import Job
from flightpower.flight.errors import InputError, StorageError

pytestmark = pytest.mark.skipif(os.name != "posix", reason="processes are ended by signals")


class Silent:
    def planned(self, jobs: int, completed: int) -> None: ...

    def step(self, name: str, step: str) -> None: ...

    def failed(self, error: str) -> None: ...

    def ended(self, name: str, outcome) -> None: ...


@pytest.fixture
def work(tmp_path: Path) -> Work:
    return Work(Stub(tmp_path / "calls"))


@pytest.fixture
def analyzed(tmp_path: Path, work: Work) -> Callable[[], list[str]]:
    """A function that returns the logs analyzed since it was last called."""

    def calls() -> list[str]:
        path = tmp_path / "calls"
        words = sorted(path.read_text().split()) if path.exists() else []
        path.unlink(missing_ok=True)
        return words

    return calls


def logs(folder: Path, **words: str) -> list[Path]:
    folder.mkdir(exist_ok=True)
    for name, text in words.items():
        (folder / f"{name}.mcap").write_text(text)
    return sorted(folder.glob("*.mcap"))


def run_in(folder: Path, paths: list[Path], work: Work) -> Campaign:
    with exclusive(folder):
        return run(FoundLogs([*paths]), folder, work, Silent(), jobs=2)


def test_a_log_that_fails_costs_its_own_flight_and_is_one_line(tmp_path: Path, work: Work) -> None:
    paths = logs(tmp_path / "in", good="a", wrong="wrong", broken="broken", killed="killed", last="b", big="large")
    run = run_in(tmp_path / "out", [*paths, tmp_path / "in" / "missing.mcap"], work)
    assert [folder.name for folder in run.folders] == ["good", "last"]
    assert len(run.failures) == 5 and all("\n" not in line and ".mcap: " in line for line in run.failures)
    message = "\n".join(run.failures)
    for cause in ("wrong words", "ZeroDivisionError", "SIGKILL", "4 GB of memory", "cannot be read"):
        assert cause in message
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == [".lock", "good", "last"]


def test_a_full_disk_ends_all_at_once_by_the_name_that_was_asked_for(tmp_path: Path, work: Work, analyzed) -> None:
    """The other logs would fail too, each after minutes."""
    paths = logs(tmp_path / "in", a="slow", b="full", **{f"later{i}": "x" for i in range(20)})
    report = tmp_path / "out" / "b" / "report.html"
    with pytest.raises(StorageError, match=rf"^{report}: cannot be written"):
        run_in(tmp_path / "out", paths, work)
    begun = analyzed()
    assert "b.mcap" in begun and len(begun) < 10, "only those that began at once"
    assert [path.name for path in (tmp_path / "out").iterdir()] == [".lock"]


def test_only_what_changed_is_analyzed_again(tmp_path: Path, work: Work, analyzed) -> None:
    out, aircraft = tmp_path / "out", tmp_path / "aircraft.toml"
    aircraft.write_text("span")
    work = replace(work, files=lambda log: [("--aircraft", aircraft)])
    run_in(out, logs(tmp_path / "in", a="1", b="2"), work)
    assert analyzed() == ["a.mcap", "b.mcap"]
    assert run_in(out, logs(tmp_path / "in"), work).completed == 2 and analyzed() == []
    assert len(run_in(out, logs(tmp_path / "in", c="3"), work).folders) == 3
    assert analyzed() == ["c.mcap"]
    run_in(out, logs(tmp_path / "in", b="20"), work)
    assert analyzed() == ["b.mcap"] and "20" in (out / "b" / "results.json").read_text()
    aircraft.write_text("other span")
    run_in(out, logs(tmp_path / "in"), work)
    assert len(analyzed()) == 3
    run_in(out, logs(tmp_path / "in"), replace(work, settings="--weight 4 kg"))
    assert len(analyzed()) == 3


def test_a_log_that_moved_or_got_a_namesake_keeps_its_results(tmp_path: Path, work: Work, analyzed) -> None:
    out = tmp_path / "out"
    (old,) = logs(tmp_path / "monday", log="1")
    run_in(out, [old], work)
    (new,) = logs(tmp_path / "tuesday", log="2")
    run = run_in(out, [old, new], work)
    assert [folder.name for folder in run.folders] == ["monday-log", "tuesday-log"]
    assert analyzed() == ["log.mcap", "log.mcap"]
    assert sorted(path.name for path in out.iterdir()) == [".lock", "monday-log", "tuesday-log"]


def test_a_folder_follows_its_log_to_another_name_and_keeps_the_users_files(
    tmp_path: Path, work: Work, analyzed
) -> None:
    """This holds below the folder of results, whatever the working folder is; two logs may also exchange their
    names."""
    out = tmp_path / "out"
    item, two = logs(tmp_path / "in", a="1", b="2")
    run_in(out, [item, two], work)
    (out / "a" / "remarks.txt").write_text("mine")
    analyzed()
    moved = item.rename(tmp_path / "in" / "c.mcap")
    run = run_in(out, [moved, two], work)
    assert [folder for folder in run.folders] == [out / "b", out / "c"] and run.completed == 2 and analyzed() == []
    assert sorted(path.name for path in out.iterdir()) == [".lock", "b", "c"]
    assert (out / "c" / "remarks.txt").read_text() == "mine"
    two.rename(item), moved.rename(two)
    run = run_in(out, logs(tmp_path / "in"), work)
    assert run.completed == 2 and analyzed() == [] and not run.notes
    assert (out / "b" / "remarks.txt").read_text() == "mine" and not (out / "a" / "remarks.txt").exists()


def test_ctrl_c_ends_the_analyses_that_run_at_once(tmp_path: Path, work: Work) -> None:
    class Interrupted(Silent):
        def ended(self, name: str, outcome) -> None:
            raise KeyboardInterrupt

    out, begun = tmp_path / "out", time.monotonic()
    with exclusive(out), pytest.raises(KeyboardInterrupt):
        run(FoundLogs([*logs(tmp_path / "in", a="1", b="slow")]), out, work, Interrupted(), jobs=2)
    assert time.monotonic() - begun < SLOW_S
    assert [path.name for path in out.iterdir() if path.name != ".lock"] == ["a"]


def test_an_edited_list_of_runs_stays_with_its_log(tmp_path: Path, work: Work, analyzed) -> None:
    """A log keeps it when another log gets the same name, and the other log does not inherit it."""
    out = tmp_path / "out"
    (monday,) = logs(tmp_path / "monday", log="1")
    run_in(out, [monday], work)
    (out / "log" / "runs.toml").write_text("by hand")
    (out / "log" / "remarks.txt").write_text("mine")
    (tuesday,) = logs(tmp_path / "tuesday", log="2")
    run = run_in(out, [monday, tuesday], work)
    assert "by hand" in (out / "monday-log" / "results.json").read_text()
    assert (out / "monday-log" / "remarks.txt").read_text() == "mine"
    assert "by hand" not in (out / "tuesday-log" / "results.json").read_text() and not run.notes
    assert sorted(path.name for path in out.iterdir()) == [".lock", "monday-log", "tuesday-log"]
    run_in(out, [monday], work)
    (note,) = run_in(out, [tuesday], work).notes
    assert "monday" in note and (out / "log-2" / "remarks.txt").read_text() == "mine"
    assert "by hand" not in (out / "log" / "results.json").read_text()
    run_in(out, [monday], work)
    assert "by hand" in (out / "log" / "results.json").read_text()


def test_a_log_written_anew_does_not_get_the_runs_of_its_earlier_content(tmp_path: Path, work: Work) -> None:
    out = tmp_path / "out"
    run_in(out, logs(tmp_path / "in", a="1"), work)
    (out / "a" / "runs.toml").write_text("by hand")
    (note,) = run_in(out, logs(tmp_path / "in", a="2"), work).notes
    assert "by hand" not in (out / "a" / "results.json").read_text() and str(out / "a-2") in note
    assert (out / "a-2" / "runs.toml").read_text() == "by hand"


def test_results_that_something_else_replaced_are_made_again(tmp_path: Path, work: Work, analyzed) -> None:
    out, paths = tmp_path / "out", logs(tmp_path / "in", a="1", b="2")
    run_in(out, paths, work)
    analyzed()
    (out / "a" / "results.json").write_text("of another command")
    run_in(out, paths, work)
    assert analyzed() == ["a.mcap"] and "['1']" in (out / "a" / "results.json").read_text()


def test_a_folder_written_anew_keeps_the_users_links_and_empty_folders(tmp_path: Path, work: Work) -> None:
    out, paths = tmp_path / "out", logs(tmp_path / "in", a="1")
    run_in(out, paths, work)
    (out / "a" / "video").symlink_to(tmp_path / "in", target_is_directory=True)
    (out / "a" / "photos").mkdir()
    run_in(out, logs(tmp_path / "in", a="10"), work)
    assert (out / "a" / "video").readlink() == tmp_path / "in" and (out / "a" / "photos").is_dir()


def test_a_log_given_twice_counts_once(tmp_path: Path, work: Work, analyzed) -> None:
    (path,) = logs(tmp_path / "in", a="1")
    (copy,) = logs(tmp_path / "copies", b="1")
    run = run_in(tmp_path / "out", [path, path, copy], work)
    assert len(run.folders) == 1 and len(run.notes) == 2 and not run.failures
    assert analyzed() == ["a.mcap"]


def test_an_edited_list_of_runs_is_used_and_kept(tmp_path: Path, work: Work, analyzed) -> None:
    out, paths = tmp_path / "out", logs(tmp_path / "in", a="1", b="2")
    run_in(out, paths, work)
    (out / "a" / "runs.toml").write_text("edited")
    (out / "a" / "remarks.txt").write_text("mine")
    analyzed()
    for calls in (["a.mcap"], []):
        run_in(out, paths, work)
        assert analyzed() == calls
        assert "edited" in (out / "a" / "results.json").read_text()
        assert (out / "a" / "runs.toml").read_text() == "edited"
        assert (out / "a" / "remarks.txt").read_text() == "mine"
    (out / "a" / "runs.toml").unlink()
    run_in(out, paths, work)
    assert analyzed() == ["a.mcap"] and (out / "a" / "runs.toml").read_text() == "found"


def test_a_killed_campaign_goes_on_where_it_stopped(tmp_path: Path, work: Work, analyzed) -> None:
    out, calls = tmp_path / "out", tmp_path / "calls"
    logs(tmp_path / "in", a="1", b="2", c="slow", d="slow too", e="5")
    code = (
        "import sys; from pathlib import Path; from test_campaign import *;"
        f"run_in(Path({str(out)!r}), logs(Path({str(tmp_path / 'in')!r})), Work(Stub(Path({str(calls)!r}))))"
    )
    search = os.pathsep.join([str(Path(__file__).parent), *sys.path])
    with subprocess.Popen([sys.executable, "-c", code], env={**os.environ, "PYTHONPATH": search}) as process:
        deadline = time.monotonic() + SLOW_S / 2  # an idle machine needs 2 s
        while len(list(out.glob(".[cd]-*.partial/path.csv"))) < 2:
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.02)
        process.send_signal(signal.SIGKILL)
    assert sorted(path.name for path in out.glob("[!.]*")) == ["a", "b"]
    assert analyzed() == ["a.mcap", "b.mcap", "c.mcap", "d.mcap"]
    run = run_in(out, logs(tmp_path / "in", c="3", d="4"), work)
    assert analyzed() == ["c.mcap", "d.mcap", "e.mcap"] and run.completed == 2 and len(run.folders) == 5
    assert not list(out.glob(".*.partial"))


def test_a_folder_that_was_being_replaced_comes_back(tmp_path: Path, work: Work, analyzed) -> None:
    out, paths = tmp_path / "out", logs(tmp_path / "in", a="1")
    run_in(out, paths, work)
    (out / "a").rename(out / ".a.replaced")  # killed between the two renames
    assert run_in(out, paths, work).completed == 1 and analyzed() == ["a.mcap"]


def test_two_at_once_in_one_folder_are_refused(tmp_path: Path) -> None:
    with exclusive(tmp_path / "out"), pytest.raises(InputError, match="another `analyze`"), exclusive(tmp_path / "out"):
        pass


def test_a_folder_of_something_else_is_not_replaced(tmp_path: Path, work: Work) -> None:
    (tmp_path / "out" / "a").mkdir(parents=True)
    run = run_in(tmp_path / "out", logs(tmp_path / "in", a="1", b="2"), work)
    assert [folder.name for folder in run.folders] == [
        "b"
    ] and "was not written by `analyze` of several logs" in run.failures[0]


@pytest.mark.parametrize("way", ["absolute", "relative"])
def test_a_worker_without_the_senders_files_gives_the_same(tmp_path: Path, monkeypatch, capfd, way: str) -> None:
    (log,) = logs(tmp_path / "in", a="1")
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    if way == "relative":
        log = Path("..") / "in" / "a.mcap"
    aircraft = tmp_path / "aircraft.toml"
    aircraft.write_text("span")
    stub = Stub(tmp_path / "calls", aircraft)
    stub(log, here, None, lambda _: None)
    files = {tmp_path / "in" / "a.mcap": b"1", aircraft: b"span"}
    (tmp_path / "in" / "a.mcap").unlink()
    aircraft.unlink()
    returned = analyze_parcel(Parcel(stub, Job("a", log), here, files, software()))
    assert returned.outcome.error == "" and returned.outcome.peak_bytes > 0
    assert returned.files == {path.name: path.read_bytes() for path in here.iterdir()}
    other = analyze_parcel(Parcel(stub, Job("a", log), here, files, "older"))
    assert "another version" in other.outcome.error
    assert capfd.readouterr().err == ""


def test_folders_have_the_shortest_names_that_tell_logs_apart() -> None:
    logs = [Path("/x/1/log.mcap"), Path("/y/1/log.mcap"), Path("/y/2/log.mcap"), Path("/y/2/other.ulg")]
    assert names(logs) == ["x-1-log", "y-1-log", "2-log", "other"]
    assert names([Path("/x/a.mcap"), Path("/x/a.ulg")]) == ["a.mcap", "a.ulg"]
    many = [Path("/a/b-x.mcap"), Path("/q/b-x.mcap"), Path("/a-b/x.mcap"), Path("/q/x.mcap")]
    assert names(many) == ["a-b-x", "q-b-x", "a-b-x-2", "q-x"]
