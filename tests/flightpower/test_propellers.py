"""`flightpower propellers`: what it lists, writes and refuses, and how it ends."""

import csv
import json
import sys
from itertools import groupby
from operator import itemgetter
from pathlib import Path

import pytest

import flightpower.command
from flightpower.flight.propeller_files import load_propeller

DATA = Path(__file__).parents[1] / "data" / "propellers"


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    """Exit code, stdout and stderr of `flightpower propellers …`."""

    def called(*words: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["flightpower", "propellers", *map(str, words)])
        code = 0
        try:
            flightpower.command.main()
        except SystemExit as stop:
            code = int(stop.code or 0)
        return code, *capsys.readouterr()

    return called


@pytest.fixture
def downloaded(tmp_path: Path) -> Path:
    """A folder with UIUC's tables of the 10x5 in it, under another name, as a database is unpacked."""
    folder = tmp_path / "UIUC-propDB" / "volume-9" / "data"
    folder.mkdir(parents=True)
    lines = [line for line in (DATA / "uiuc-apce-10x5.csv").read_text("utf-8").splitlines() if line[0] != "#"]
    for test, points in groupby(csv.DictReader(lines), key=itemgetter("test")):
        columns = ("rpm", "CT", "CP") if test.startswith("static") else ("J", "CT", "CP", "eta")
        table = ["  ".join("RPM" if column == "rpm" else column for column in columns)]
        table += ["  ".join(point[column] for column in columns) for point in points]
        (folder / f"newmake_10x5_{test}.txt").write_text("\n".join(table), "utf-8")
    (folder / "newmake_10x5_geom.txt").write_text("r/R c/R beta\n0.15 0.1 20\n", "utf-8")
    (folder / "PER3_9x9E.dat").write_text("cut off", "utf-8")
    return tmp_path / "UIUC-propDB"


def test_a_measured_table_is_found_with_all_that_is_needed_to_choose(run) -> None:
    code, out, err = run("11x7")
    line = next(line for line in out.splitlines() if line.startswith("apc-11x7e "))
    assert code == 0 and not err
    assert all(word in line for word in ("11x7", "measured", "3003-5996", "0.09-0.81", "UIUC vol. 1, apce_11x7"))
    assert "uncertainty" not in out


def test_without_words_all_are_listed(run) -> None:
    code, out, _ = run()
    assert code == 0 and len(out.splitlines()) > 50 and "blade-11x5" in out


def test_the_nearest_are_reported_with_what_they_may_cost(run) -> None:
    code, out, _ = run("11x7.2", "apc", "thin")
    assert code == 1 and "+0.2 in pitch" in out and "thrust_scale = " in out and "An inch of diameter" in out
    code, text, _ = run("11x7.2", "apc", "thin", "--json")
    content = json.loads(text)
    assert code == 1 and content["tables"] == [] and content["nearest"][0]["name"] == "apc-11x7e"
    cost = content["costs"][0]
    assert f'thrust_scale = "{100 * cost["thrust_scale"]:.0f} %"' in out
    assert cost["thrust"][0] < 0 < cost["thrust"][1] and cost["per_inch"][0] > 0


def test_at_the_advance_ratios_of_a_flight_it_is_another_cost(run) -> None:
    low, high = (json.loads(run("13x8", "--json", "--J", *J)[1])["costs"][0] for J in ((0.2, 0.3), (0.4, 0.5)))
    assert low["J"] == [0.2, 0.3] and low["thrust"] != high["thrust"]


def test_only_computed_tables_of_a_size_are_reported_as_such(run) -> None:
    code, out, _ = run("13x8")
    assert code == 1 and "No measured table of 13x8" in out and "apc-13x8e-computed" in out


def test_a_downloaded_folder_is_searched_and_turned_into_own_tables(run, downloaded: Path, tmp_path: Path) -> None:
    code, out, err = run("newmake", "--folder", downloaded, "-o", tmp_path / "tables")
    assert code == 0 and "newmake_10x5" in out and "measured" in out
    assert err.count("\n") == 1 and "9x9e" in err.lower()
    written = load_propeller(tmp_path / "tables" / "newmake_10x5.csv")
    there = load_propeller(downloaded / "volume-9" / "data" / "newmake_10x5_kt0821_5000.txt")
    assert written.rows == there.rows and written.diameter_m == there.diameter_m
    code, out, _ = run("newmake", "10x5", "--folder", tmp_path / "tables")
    assert code == 0 and "UIUC, newmake_10x5" in out and "10x5" in out and "measured" in out
    code, _, err = run("newmake", "--folder", downloaded, "-o", tmp_path / "tables")
    assert code == 2 and "--replace" in err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("xoar",), "no table of xoar"),
        (("55",), "in inches"),
        (("31",), "give a pitch too"),
        (("11x7", "--J", "0.6", "0.3"), "ascending"),
        (("11x7", "-o", "there"), "--folder"),
        (("11x7", "--folder", "none"), "no folder"),
    ],
)
def test_what_is_wrong_is_one_line(run, words: tuple[str, ...], message: str) -> None:
    code, out, err = run(*words)
    assert code == 2 and not out and err.startswith("error: ") and err.count("\n") == 1 and message in err
