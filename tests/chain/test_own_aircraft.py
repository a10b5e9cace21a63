"""An aircraft file of four keys gives a curve from a log, and whatever a log lacks can be given."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from running import done, read_once, rewritten

from flightpower.analysis.flights.campaign.campaign import read_flights
from flightpower.analysis.flights.pool import joint_pool
from flightpower.analysis.performance.analysis import compute
from flightpower.analysis.performance.request import Request
from flightpower.flight.aircraft import load_aircraft

pytestmark = pytest.mark.xdist_group("chain")


def results(folder: Path) -> dict:
    return json.loads((folder / "results.json").read_text("utf-8"))


def curve(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    points = results(folder)["curves"]["power_required"]["points"]
    return tuple(np.array([point[name] for point in points]) for name in ("speed_mps", "power_lo_W", "power_hi_W"))


def test_four_keys_give_a_curve_that_contains_the_truth_and_is_wider_than_with_all(flown: Path, four: Path) -> None:
    V, low, high = curve(four / "four")
    truth = np.loadtxt(flown / "truth_power_required.csv", delimiter=",", skiprows=1, usecols=(0, 1))
    true = np.interp(V, *truth.T)
    assert np.all((low < true) & (true < high))
    all_V, all_low, all_high = curve(flown / "log.report")
    assert np.all(high - low > np.interp(V, all_V, all_high - all_low))


def test_the_results_say_what_stood_in_and_what_was_left_out(four: Path) -> None:
    warnings = " ".join(results(four / "four")["warnings"])
    for key in ("probe.upwash_per_CL", "probe.position", "imu_position"):
        assert f"lacks {key}" in warnings
    assert "narrower" in warnings
    assert results(four / "four")["cross_check"]


def test_without_a_battery_s_energy_endurance_is_left_out_and_the_option_is_named(four: Path) -> None:
    aircraft = load_aircraft(four / "four.toml")
    (note,) = Request().notes(aircraft)
    assert "No endurance" in note and "--battery-Wh" in note
    flight: Any = SimpleNamespace(aircraft=aircraft, drag=None)
    assert compute(Request(), flight) is None
    assert Request(battery_Wh=74.0).notes(aircraft) == []


def test_a_battery_is_enough_for_endurance(flown: Path, four: Path) -> None:
    ours, reference = (results(path)["use"]["loadings"][0] for path in (four / "four", flown / "log.report"))
    assert ours["endurance_s"]["lo"] < reference["endurance_s"]["value"] < ours["endurance_s"]["hi"]


@pytest.mark.slow
def test_options_replace_what_a_log_has_or_lacks(flown: Path, tmp_path: Path) -> None:
    """A heavier aircraft file, with the true weight and the log's own probe given by options, leaves the curve the
    same."""
    heavier, probe, bare = tmp_path / "heavier.toml", tmp_path / "mine.json", tmp_path / "bare.mcap"
    heavier.write_text(load_aircraft("nexstar").text.replace('weight = "8.47 lbf"', 'weight = "9.00 lbf"'))
    probe.write_bytes(read_once(flown / "log.mcap").attachments["probe.json"])
    rewritten(flown, bare, without_attachment="probe.json")
    arguments = ("--aircraft", heavier, "--weight", "8.47 lbf", "--probe", probe)
    done("analyze", bare, *arguments, "-o", tmp_path / "report", "--quiet")
    item, other = (results(of)["curves"]["power_required"] for of in (tmp_path / "report", flown / "log.report"))
    assert item["points"] == other["points"]


def test_the_evidence_against_a_flight_is_read_for_its_pool(four: Path, tmp_path: Path) -> None:
    content = json.loads((four / "four" / "results.json").read_text("utf-8"))
    against = {"kind": "not converged", "level": "not to be trusted", "part": "the whole curve", "text": "No."}
    of_today = ("trust", "evidence", "kind", "curves", "air", "battery", "balance", "withheld")
    curve = content["curves"]["power_required"]
    of_0_1 = {name: value for name, value in content.items() if name not in of_today} | {
        "format": "flightpower-results-2", "power_required": curve["points"],
        "interval_parts": curve["interval_parts"], "pooling": curve["statistics"],
    }  # fmt: skip
    for written, result in (
        (content, content["trust"]),
        (content | {"evidence": [against]}, "not to be trusted"),
        (of_0_1, "doubtful"),
    ):
        (tmp_path / "results.json").write_text(json.dumps(written), "utf-8")
        assert joint_pool(read_flights([tmp_path])).results().trust == result
