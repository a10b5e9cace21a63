"""Tests the table of coverage by world, and which flights the study does not repeat."""

import json

import numpy as np
import pytest
from flights import known_lines
from study import curve, single
from worlds import Cell, cell_records, cells, key, points_by_world, verdict_records, world_records

from flightpower.analysis.records.flight import Trust


def line(seed: int, error: list[float | None], half: list[float | None], alarm: bool = False) -> dict[str, object]:
    result: dict[str, object] = {
        "trust": Trust.DOUBTFUL if alarm else Trust.TRUSTED,
        "evidence": ["x"] if alarm else [],
    }
    result |= {"world": "weight", "weather_kt": 3.0, "plan": "two-pairs", "seed": seed, "version": "v"}
    return result | {"error": error, "half": half, "warnings": ["x"], "alarm": alarm}


def test_coverage_is_counted_at_each_speed_and_over_all():
    """Five of seven points are covered; only one flight reached the fastest speed. Two flights covered at 2/3 and
    3/4 of the speeds, and an added one at 1/2, scatter by 0.104."""
    lines = [line(0, [1.0, -3.0, 0.5, None], [2.0] * 3 + [None], True), line(1, [1.0, 1.0, -2.5, 0.1], [2.0] * 4)]
    (row,), (of_world,) = cell_records(lines), world_records(points_by_world(lines, "two-pairs"))
    for item in (row, of_world):
        assert (item["flights"], item["coverage, %"], item["at each speed"]) == (2, 71, [100, 50, 50, 100])
        assert item["±"] == 6.0
    assert (row["alarms, %"], row["verdicts"], row["evidence"]) == (50, [1, 1, 0], "x")


def test_coverage_by_world_is_over_all_weathers_and_in_each():
    results = {
        "weight": {0.0: [([1.0, 3.0], [2.0, 2.0])], 15.0: [([1.0, 1.0], [2.0, 2.0]), ([3.0, None], [2.0, None])]}
    }
    (row,) = world_records(results)
    assert (row["flights"], row["coverage, %"], row["at 0 / 15 kt"]) == (3, 60, [50, 67])
    assert (row["at each speed"], row["error"], row["half width"]) == ([67, 50], [2.8, 2.9], [2.0, 2.0])


def test_verdicts_of_a_world_stand_beside_its_coverage_at_each_weather():
    calm = line(0, [1.0, -3.0], [2.0, 2.5]) | {"weather_kt": 0.0}
    gusty = [line(0, [1.0, 1.0], [2.0, 4.0]), line(1, [5.0, None], [2.0, None], True)]
    (row,) = verdict_records([calm, *gusty])
    assert row["coverage at 0 / 3 kt, %"] == [50, 67] and row["error"] == [3.0, 4.8]
    assert row["half width"] == ["2.0 to 2.5", "2.0 to 4.0"]
    assert row["verdicts, 0 kt"] == [1, 0, 0] and row["verdicts, 3 kt"] == [1, 1, 0]


def test_refused_flights_are_counted_and_not_averaged():
    refused = {name: value for name, value in line(1, [], []).items() if name not in ("error", "half")}
    (row,) = cell_records([line(0, [1.0], [2.0]), refused | {"refused": "too rough"}])
    assert (row["flights"], row["refused"], row["coverage, %"]) == (1, 1, 100)


def test_a_line_cut_off_by_an_interruption_is_flown_again(tmp_path):
    path = tmp_path / "study.jsonl"
    path.write_text(json.dumps(line(0, [1.0], [2.0])) + "\n" + json.dumps(line(1, [1.0], [2.0]))[:40], "utf-8")
    assert [key(line) for line in known_lines(path)] == [("weight", 3.0, "two-pairs", 0, "v", False)]
    assert known_lines(tmp_path / "none.jsonl") == []


@pytest.mark.parametrize(("world", "flown"), [("gusts", [3.0, 15.0]), ("weight", [0.0, 3.0, 15.0])])
def test_a_world_of_other_gusts_is_not_flown_in_calm_air(world, flown):
    assert list(cells([world], [0.0, 3.0, 15.0], ["two-pairs"])) == [Cell(world, kt, "two-pairs") for kt in flown]


def test_a_curve_counts_flights_not_speeds():
    """Flights covered at 2 of 2, 1 of 2 and 1 of 1 speeds have a mean coverage of 83 %."""
    flights = [np.array(item) for item in ([[1.0, -1], [2, 2]], [[3.0, 1], [2, 2]], [[1.0, np.nan], [2, np.nan]])]
    row = curve("dynamic", flights)
    assert (row["flights"], row["coverage, %"], row["at each speed"]) == (3, 83, [67, 100])
    assert row["±"] == pytest.approx(100 * np.std([1, 0.5, 1, 0.5]) / 2, abs=0.05)
    assert row["mean"] == [1.7, 0.0] and row["rms"] == [1.91, 1.0]
    assert curve("without intervals", [np.array([[1.0], [np.nan]])])["coverage, %"] is None


def test_a_single_number_has_its_stated_standard_error():
    row = single("lag", [np.array([[1.0], [1.96]]), np.array([[-3.0], [1.96]])])
    assert (row["rms"], row["mean"], row["coverage, %"]) == (2.236, -1.0, 50)
    assert row["stated, 1 sigma"] == pytest.approx(1.0, abs=1e-3)
