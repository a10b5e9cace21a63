"""The benches of `benchmarks/bench.py` run on the current code and hold ratios to their limits."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
import bench
import daemon_parts
import drivers
import speed
from records import ratio


def test_every_part_of_the_daemon_is_counted() -> None:
    """Parts are wrapped by the names of their methods: a renamed method fails here, not in `make bench`."""
    us_a_tick = {row["part"]: row["us a tick"] for row in daemon_parts.part_records(seconds=2.0)}
    assert all(us_a_tick[part] > 0 for part in ("drivers", "bus workers", "encoding messages", "telemetry", "the loop"))
    parts = [us for part, us in us_a_tick.items() if part not in ("all", f"({daemon_parts.FAKES})")]
    assert us_a_tick["all"] == pytest.approx(sum(parts), abs=0.05 * len(parts))


def test_the_drivers_are_held_to_their_limit() -> None:
    rows = {row["driver"]: row for row in drivers.records(seconds=1.0)}
    assert {"imu", "gps", "rpm", "all drivers"} <= set(rows)
    assert rows["all drivers"]["mean, us"] > rows["imu"]["mean, us"] > 0
    assert rows["all drivers"]["ratio"] == pytest.approx(rows["all drivers"]["99 %, us"] / drivers.LIMIT_US, abs=0.006)


@pytest.mark.parametrize(
    ("measured", "limit", "is_missed"),
    [(21.0, {"at_most": 1.0}, True), (19.0, {"at_most": 1.0}, False), (1900.0, {"at_least": 100.0}, True),
     (2100.0, {"at_least": 100.0}, False), (1e6, {}, False)],
)  # fmt: skip
def test_a_ratio_beyond_its_limit_is_missed(measured: float, limit: dict[str, float], is_missed: bool) -> None:
    row = ratio("a fit", measured, 20.0, "ms", **limit)
    assert row["ratio"] == pytest.approx(measured / 20, rel=5e-3)
    assert bench.missed([row]) == ([row] if is_missed else [])


@pytest.mark.parametrize("place", [".", "parts"])
def test_a_version_is_measured_where_its_own_modules_are(tmp_path: Path, place: str) -> None:
    """Modules have moved between versions: the steps to measure are those that the version itself names."""
    code = tmp_path / "version"
    (code / "benchmarks").mkdir(parents=True)
    (code / place).mkdir(exist_ok=True)
    (code / place / "version_of_place.py").write_text(f"PLACE = {place!r}\n", "utf-8")
    module = "version_of_place" if place == "." else f"{place}.version_of_place"
    program = f"import json, sys\nfrom {module} import PLACE\nprint(json.dumps({{PLACE: sys.argv[1:]}}))\n"
    (code / "benchmarks" / "speed.py").write_text(f"import missing\nMEASURED = {program!r}\n", "utf-8")
    assert speed.measured(code, Path("log"), Path("report"), tmp_path) == {place: ["log", "report"]}


def test_a_version_without_steps_to_measure_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SystemExit, match="no MEASURED"):
        speed.measured_steps(tmp_path)


def test_the_analysis_of_now_is_measured_by_what_exists() -> None:
    imported = [line for line in speed.MEASURED.splitlines() if line.startswith(("import ", "from "))]
    assert speed.measured_steps(speed.ROOT) == speed.MEASURED
    assert sum("flightpower" in line for line in imported) >= 4
    exec("\n".join(imported), {})
