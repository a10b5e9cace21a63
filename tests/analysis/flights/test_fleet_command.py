"""`flightpower fleet` as it is called: flights added twice are one, and wrong input is one line."""

import json
from pathlib import Path

import msgspec
import numpy as np
import pytest
from fleet_flights import flights_of
from typer.testing import CliRunner

from flightpower.analysis.cli.fleet import app
from flightpower.flight.errors import InputError
from tests.analysis.flights.test_electrical_pool import drawn


def called(*words: object) -> str:
    done = CliRunner().invoke(app, [str(word) for word in words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split())


@pytest.fixture
def flights(tmp_path: Path) -> Path:
    """The folder of three airframes' flights, of which one lost thrust."""
    worn = -0.06 * (np.arange(30) >= 20)
    for one in (*flights_of("hawk-1", 1, 4), *flights_of("hawk-2", 2, 4), *flights_of("worn", 9, 30, thrust=worn)):
        folder = tmp_path / "flights" / one["log"].removesuffix(".mcap")
        folder.mkdir(parents=True)
        (folder / "results.json").write_text(json.dumps(one))
    return tmp_path / "flights"


def test_flights_are_added_once_and_shown(flights: Path, tmp_path: Path) -> None:
    dataset, page = tmp_path / "fleet", tmp_path / "fleet-today"
    assert "38 flights added" in called("add", flights, "--to", dataset)
    assert "0 flights added, 38" in called("add", flights, "--to", dataset)
    called("show", dataset, "-o", page)
    shown = json.loads((page / "fleet.json").read_text())
    assert [len(one["changes"]) for one in shown["airframes"]] == [0, 0, 1]
    history = shown["airframes"][2]["history"]
    assert len(history) == 30 and np.mean([one["thrust_percent"] for one in history[20:]]) == pytest.approx(-6, abs=1.5)
    text = (page / "fleet.html").read_text()
    assert text.startswith("<!doctype html>") and text.count("<details open>") == 1
    assert text.index("worn, changed") < text.index("<summary>hawk-1")
    called("show", dataset, "--airframe", "hawk-1", "-o", page, "--replace")
    assert len(json.loads((page / "fleet.json").read_text())["airframes"]) == 1


def test_a_page_that_is_there_is_not_replaced_unasked(flights: Path, tmp_path: Path) -> None:
    called("add", flights, "--to", tmp_path / "fleet")
    called("show", tmp_path / "fleet", "-o", tmp_path)
    with pytest.raises(InputError):
        called("show", tmp_path / "fleet", "-o", tmp_path)


@pytest.mark.parametrize(
    "words",
    [
        ("add", "missing", "--to", "fleet"), ("add", ".", "--to", ""), ("show", "missing"), ("show", "."),
        ("show", __file__), ("show", "s3x://there"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_one_line(
    words: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError):
        called(*words)
    assert [*tmp_path.iterdir()] == []


def test_flights_of_electrical_power_are_a_fleet_by_aircraft_and_autopilot(tmp_path: Path) -> None:
    """Two boards of one name are two rows, each with the pool of its own flights; a flight added twice is one."""
    rng = np.random.default_rng(5)
    for i, vehicle in enumerate(("1", "1", "2")):
        (one,) = drawn(rng, 1, 0.0, vehicle=vehicle)
        folder = tmp_path / "flights" / f"0000000{i}"
        folder.mkdir(parents=True)
        (folder / "results.json").write_bytes(msgspec.json.encode(one))
    assert "3 flights added, 0 were there" in called("add", tmp_path / "flights", "--to", tmp_path / "fleet")
    assert "0 flights added, 3 were there" in called("add", tmp_path / "flights", "--to", tmp_path / "fleet")
    called("show", tmp_path / "fleet", "-o", tmp_path / "shown")
    found = json.loads((tmp_path / "shown" / "fleet.json").read_text("utf-8"))["airframes"]
    assert sorted(one["pooled_flights"] for one in found) == [1, 2]
    assert all(one["kind"] == "electrical_power" and one["power_required"] for one in found)
    assert "electrical power" in (tmp_path / "shown" / "fleet.html").read_text("utf-8")
