"""`flightpower fleet` as it is called: a flight added twice counts once, and wrong input is reported in one line."""

import csv
import json
import re
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import msgspec
import numpy as np
import pytest
from fleet_flights import flights_of
from typer.testing import CliRunner

from flightpower.analysis.cli.fleet import app
from flightpower.analysis.pages.fleet_page import _dates
from flightpower.flight.errors import InputError
from tests.analysis.flights.test_electrical_pool import flights_with_errors


def called(*words: object) -> str:
    done = CliRunner().invoke(app, [str(word) for word in words])
    if done.exception is not None and not isinstance(done.exception, SystemExit):
        raise done.exception
    assert done.exit_code == 0, done.output
    return " ".join(done.output.split())


@pytest.fixture
def flights(tmp_path: Path) -> Path:
    """A folder with the flights of three airframes, of which one lost thrust."""
    worn = -0.06 * (np.arange(30) >= 20)
    for airframe in (flights_of("hawk-1", 1, 4), flights_of("hawk-2", 2, 4), flights_of("worn", 9, 30, thrust=worn)):
        _write(tmp_path / "flights", airframe)
    return tmp_path / "flights"


def test_flights_are_added_once_and_shown(flights: Path, tmp_path: Path) -> None:
    dataset, page = tmp_path / "fleet", tmp_path / "fleet-today"
    assert "38 flights added" in called("add", flights, "--to", dataset)
    assert "0 flights added, 38" in called("add", flights, "--to", dataset)
    called("show", dataset, "-o", page)
    shown = json.loads((page / "fleet.json").read_text())
    assert [len(airframe["changes"]) for airframe in shown["airframes"]] == [0, 0, 1]
    history = shown["airframes"][2]["history"]
    assert len(history) == 30 and np.mean([item["thrust_percent"] for item in history[20:]]) == pytest.approx(
        -6, abs=1.5
    )
    text = (page / "fleet.html").read_text()
    (row,) = re.findall(r"<tr[^>]*>(?:(?!</tr>).)*hawk-2(?:(?!</tr>).)*</tr>", text, re.DOTALL)
    least = min(shown["airframes"][1]["power_required"], key=lambda point: point["power_W"])
    half_percent = 100 * (least["power_hi_W"] - least["power_lo_W"]) / 2 / least["power_W"]
    assert 0.5 < half_percent < 20 and f">{half_percent:.1f}<" in row
    assert text.startswith("<!doctype html>") and text.count("<details open>") == 1
    assert text.index("worn, changed") < text.index("<summary>hawk-1")
    called("show", dataset, "--airframe", "hawk-1", "-o", page, "--replace")
    assert len(json.loads((page / "fleet.json").read_text())["airframes"]) == 1


def test_the_page_leads_to_the_reports_of_flights_that_are_there(flights: Path, tmp_path: Path) -> None:
    reported = sorted(flights.iterdir())[0]
    (reported / "report.html").write_text("its report")
    called("add", flights, "--to", tmp_path / "data" / "fleet")
    called("show", tmp_path / "data" / "fleet", "-o", tmp_path / "today")
    page = (tmp_path / "today" / "fleet.html").read_text("utf-8")
    (address,) = re.findall(r'<a href="([^"]*report.html)">', page)
    assert (tmp_path / "today" / unquote(address)).read_text() == "its report"
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    for name in ("data", "flights"):
        (tmp_path / name).rename(moved / name)
    called("show", moved / "data" / "fleet", "-o", moved / "today")
    assert (moved / "today" / unquote(address)).is_file(), "relative to the dataset, which moved with the flights"
    assert address in (moved / "today" / "fleet.html").read_text("utf-8")


def test_a_spreadsheet_has_a_row_for_each_flight_and_each_point(flights: Path, tmp_path: Path) -> None:
    called("add", flights, "--to", tmp_path / "fleet")
    called("show", tmp_path / "fleet", "-o", tmp_path / "today")
    rows = list(csv.DictReader((tmp_path / "today" / "flights.csv").open(encoding="utf-8")))
    assert len(rows) == 38 and {row["airframe"] for row in rows} == {"hawk-1", "hawk-2", "worn"}
    late = [float(row["thrust_percent"]) for row in rows if row["airframe"] == "worn"][20:]
    assert np.mean(late) == pytest.approx(-6, abs=1.5)
    points = list(csv.DictReader((tmp_path / "today" / "curves.csv").open(encoding="utf-8")))
    shown = json.loads((tmp_path / "today" / "fleet.json").read_text())
    first = shown["airframes"][0]["power_required"][0]
    assert float(points[0]["power_W"]) == pytest.approx(first["power_W"], rel=1e-5)
    assert sum(point["curve"] == "worn" for point in points) == len(shown["airframes"][2]["power_required"])


@pytest.mark.parametrize(("last", "texts"), [(9.9, ["2 Jan", "4 Jan", "6 Jan", "8 Jan", "10 Jan"]), (0.6, ["2 Jan"])])
def test_dates_of_a_history_are_short_and_evenly_spaced(last: float, texts: list[str]) -> None:
    new_year = datetime(2026, 1, 1, tzinfo=UTC).timestamp() / 86400
    axis = _dates(np.array([new_year + 0.4, new_year + last]))
    assert axis.ticks is not None and list(axis.ticks.values()) == texts and axis.title == "date, UTC, 2026"
    over_years = _dates(np.array([new_year, new_year + 800]))
    assert over_years.ticks is not None and list(over_years.ticks.values())[-1] == "Mar 2028"


def test_an_airframe_that_changed_is_beside_the_mean_where_three_others_are_left(tmp_path: Path) -> None:
    """Its drag is up by 30 %: in the mean it would widen the range expected for a new airframe."""
    worse = 0.3 * (np.arange(12) >= 8)
    widths = {}
    for name, others in (("four", 3), ("three", 2)):
        for i in range(others):
            _write(tmp_path / name / "flights", flights_of(f"hawk-{i}", i, 6))
        _write(tmp_path / name / "flights", flights_of("damaged", 9, 12, drag=worse))
        called("add", tmp_path / name / "flights", "--to", tmp_path / name / "fleet")
        output = called("show", tmp_path / name / "fleet", "-o", tmp_path / name)
        (curve,) = json.loads((tmp_path / name / "fleet.json").read_text())["curves"]
        assert curve["changed"] == ["damaged"]
        assert ("damaged" in curve["airframes"]) == (name == "three")
        assert ("Without damaged, changed." if name == "four" else "With damaged, changed: too few others.") in output
        point = curve["another"][len(curve["another"]) // 2]
        widths[name] = (point["power_hi_W"] - point["power_lo_W"]) / point["power_W"]
    assert widths["four"] < widths["three"] / 2


def _write(to: Path, results: list[dict[str, Any]]) -> None:
    for item in results:
        folder = to / item["log"].removesuffix(".mcap")
        folder.mkdir(parents=True)
        (folder / "results.json").write_text(json.dumps(item))


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
    """Two boards with one name give two rows, each with its own pool; a flight added twice counts once."""
    rng = np.random.default_rng(5)
    for i, vehicle in enumerate(("1", "1", "2")):
        (item,) = flights_with_errors(rng, 1, 0.0, vehicle=vehicle)
        folder = tmp_path / "flights" / f"0000000{i}"
        folder.mkdir(parents=True)
        (folder / "results.json").write_bytes(msgspec.json.encode(item))
    assert "3 flights added, 0 were already there" in called("add", tmp_path / "flights", "--to", tmp_path / "fleet")
    assert "0 flights added, 3 were already there" in called("add", tmp_path / "flights", "--to", tmp_path / "fleet")
    called("show", tmp_path / "fleet", "-o", tmp_path / "shown")
    airframes = json.loads((tmp_path / "shown" / "fleet.json").read_text("utf-8"))["airframes"]
    assert sorted(airframe["pooled_flights"] for airframe in airframes) == [1, 2]
    assert all(airframe["kind"] == "electrical_power" and airframe["power_required"] for airframe in airframes)
    assert "electrical power" in (tmp_path / "shown" / "fleet.html").read_text("utf-8")
