"""`daq info` and `daq list`: lengths, rates, sizes and lateness of a log whose numbers are known."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from flightpower.daq.__main__ import app
from flightpower.daq.log_summary import summarize
from flightpower.flight.log_writer import LogWriter
from flightpower.flight.messages import AbsolutePressure, Status, Tick

STEP_NS = 40_000_000  # 25 Hz


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sixty seconds: 1501 ticks, late by 0 to 3 ms, two missed with each 500th; one of five readings of /baro stale."""
    path = tmp_path_factory.mktemp("logs") / "log-0007.mcap"
    with path.open("wb") as stream:
        writer = LogWriter(stream)
        for i in range(1501):
            tick = Tick(late_ns=1_000_000 * (i % 4), missed=2 if i % 500 == 0 else 0)
            writer.write("/daq/tick", tick, time_ns=i * STEP_NS, tick=i)
            if i % 5 == 0:
                status = Status.STALE if i % 25 == 0 else Status.OK
                message = AbsolutePressure(pressure_Pa=1e5, temperature_K=290.0, status=status)
                writer.write("/baro", message, time_ns=i * STEP_NS, tick=i)
        writer.finish()
    return path


def test_a_summary_gives_length_rates_and_lateness(log: Path) -> None:
    summary = summarize(log)
    assert summary.lines[0].startswith(f"{log}: 60.0 s from 1970-01-01 00:00:00 (system clock, UTC)")
    assert "1501 ticks, 8 missed; late by 1.00 ms (median), 3.00 ms (maximum)" in summary.lines
    baro, ticks = summary.topics
    assert (baro.topic, baro.messages, baro.failures) == ("/baro", 301, "stale 61")
    assert baro.rate_Hz == pytest.approx(301 / 60) and ticks.rate_Hz == pytest.approx(1501 / 60)


def test_a_list_gives_minutes_and_megabytes(log: Path) -> None:
    outcome = CliRunner().invoke(app, ["list", str(log.parent)], env={"COLUMNS": "120"})
    assert outcome.exit_code == 0, outcome.output
    (line,) = (line for line in outcome.output.splitlines() if "log-0007" in line)
    name, date, time, mark, minutes, megabytes, state = line.split()
    assert (name, date, time, mark, minutes, state) == (
        "log-0007.mcap",
        "1970-01-01",
        "00:00",
        "?",
        "1.0",
        "complete",
    )
    assert float(megabytes) == pytest.approx(log.stat().st_size / 1e6, abs=0.06)
    (log.parent / "log-0008.mcap").write_bytes(bytes(3_400_000))
    outcome = CliRunner().invoke(app, ["list", str(log.parent)], env={"COLUMNS": "120"})
    assert " 3.4 " in next(line for line in outcome.output.splitlines() if "log-0008" in line)


def test_a_full_card_is_listed_from_its_end_and_says_so(log: Path, tmp_path: Path) -> None:
    for number in range(1, 54):
        (tmp_path / f"log-{number:04}.mcap").hardlink_to(log)
    lines = CliRunner().invoke(app, ["list", str(tmp_path)], env={"COLUMNS": "80"}).output.splitlines()
    assert sum("complete" in line for line in lines) == 50 and not any("log-0003" in line for line in lines)
    assert lines[-1].startswith("3 earlier")
    every = CliRunner().invoke(app, ["list", "--all", str(tmp_path)], env={"COLUMNS": "80"}).output
    assert every.count("complete") == 53 and "earlier" not in every


def test_logs_of_any_name_are_listed_before_the_numbered_ones(log: Path, tmp_path: Path) -> None:
    """Copies named by a browser or a person count as logs; other files do not."""
    for name in ("flight[1].mcap", "log-0010.mcap", "log-0009_2026-05-01_100000Z.mcap", "notes.txt", ".part.mcap"):
        (tmp_path / name).write_bytes(log.read_bytes())
    outcome = CliRunner().invoke(app, ["list", str(tmp_path)], env={"COLUMNS": "120"})
    names = [line.split()[0] for line in outcome.output.splitlines()[1:]]
    assert names == ["flight[1].mcap", "log-0009_2026-05-01_100000Z.mcap", "log-0010.mcap"]
    empty = CliRunner().invoke(app, ["list", str(log.parent.parent)], env={"COLUMNS": "120"})
    assert empty.exit_code == 0 and "no log (.mcap) is in it" in empty.output
