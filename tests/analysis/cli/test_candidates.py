"""If no maneuver of a log gives a curve, the candidates are written with their reasons, ready to be kept."""

from pathlib import Path

import pytest

from flightpower.analysis.maneuvers.kinds import Maneuvers, RejectedManeuver
from flightpower.analysis.maneuvers.runs_file import NoCurve
from flightpower.analysis.options import Options
from flightpower.analysis.pages import one_log
from flightpower.flight.errors import InputError
from flightpower.flight.log_entries import LogEntry, entries_of
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import Rpm
from flightpower.flight.runs import ACCELERATION, Rejection, RunRejected

REJECTED = RejectedManeuver(ACCELERATION, 12.0, 15.5, Rejection(RunRejected.TOO_SHORT, 3.5, 5.0))


def refusal(monkeypatch, folder: Path, candidates: list[RejectedManeuver], options: Options, topics=None) -> str:
    def none(*_: object, **__: object) -> None:
        raise NoCurve("flight.mcap: no run", Maneuvers([], candidates))

    path = folder / "flight.mcap"
    entries = entries_of([LogEntry(0, 0, Rpm())])
    log = Log(path, {topic: entries for topic in topics or TOPICS})
    monkeypatch.setattr(one_log, "open_source", lambda *_: log)
    monkeypatch.setattr("flightpower.analysis.pipeline.runs.analyze_runs", none)
    with pytest.raises(InputError) as refused:
        one_log.analyze_log(path, folder / "out", options, lambda _: None)
    return str(refused.value)


TOPICS = ("/imu", "/probe/alpha", "/probe/airspeed", "/static", "/rpm")


def test_candidates_are_written_where_there_are_some(monkeypatch, tmp_path: Path) -> None:
    message = refusal(monkeypatch, tmp_path, [REJECTED], Options())
    written = tmp_path / "out" / "runs.toml"
    assert f"--runs {written}" in message
    assert 'start = "12.00 s"' in written.read_text() and "keep = false" in written.read_text()


def test_without_candidates_nothing_is_written(monkeypatch, tmp_path: Path) -> None:
    assert refusal(monkeypatch, tmp_path, [], Options()) == "flight.mcap: no run"
    assert not (tmp_path / "out" / "runs.toml").exists()


def test_a_list_that_was_given_is_not_written_over(monkeypatch, tmp_path: Path) -> None:
    own_file = tmp_path / "mine.toml"
    own_file.write_text('[[run]]\nkind = "acceleration"\nstart = "12 s"\nend = "15 s"\n')
    assert refusal(monkeypatch, tmp_path, [REJECTED], Options(runs=own_file)) == "flight.mcap: no run"
    assert not (tmp_path / "out" / "runs.toml").exists()


def test_an_option_without_effect_is_refused(monkeypatch, tmp_path: Path) -> None:
    """A log without flow angles gives no drag, so a zero of the transducers would be ignored."""
    electrical = ("/probe/airspeed", "/static", "/battery")
    assert "--zero: has no effect" in refusal(monkeypatch, tmp_path, [], Options(zero=tmp_path), electrical)
