"""`calibrate airspeed` on a log from the daemon finds the flight's wind and scale within its own errors."""

import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from running import command, done

from flightpower.sim.sensors import draw, load_budget

pytestmark = pytest.mark.xdist_group("chain")


def test_wind_and_scale_are_those_of_the_flight(flown: Path, tmp_path: Path) -> None:
    """The demonstration flies one way only, so the scale is known to a percent or two, and the output says so."""
    outcome = done("calibrate", "airspeed", flown / "log.mcap", "-o", tmp_path / "airspeed.json")
    assert "one direction" in outcome.stdout.replace("\n", " ")
    content = json.loads((tmp_path / "airspeed.json").read_text())
    true_scale = draw(load_budget("bench"), 0).values.V_scale
    assert abs(content["scale"] - true_scale) < 4 * content["scale_error"]
    truth = pd.read_parquet(flown / "truth.parquet", columns=["phase", "wind_north_mps", "wind_east_mps"])
    north, east = truth.loc[truth["phase"] == "flight", ["wind_north_mps", "wind_east_mps"]].mean()
    # On a single heading a scale error at 18 m/s appears as a wind error.
    assert content["wind_mps"] == pytest.approx(np.hypot(north, east), abs=0.3 + 4 * 18 * content["scale_error"])
    assert content["format"] == "flightpower-airspeed-1"
    assert content["aircraft"] == "nexstar"


@pytest.mark.slow
def test_analyze_begins_with_the_scale_of_another_flight(flown: Path, tmp_path: Path) -> None:
    """The scale goes from the command's file into an analysis' prior and speeds; the flight that gave it is refused."""
    done("calibrate", "airspeed", flown / "log.mcap", "-o", tmp_path / "airspeed.json")
    refused = command("analyze", flown / "log.mcap", "--airspeed", tmp_path / "airspeed.json", "-o", tmp_path / "same")
    assert refused.returncode == 2 and "would count twice" in refused.stderr
    content = json.loads((tmp_path / "airspeed.json").read_text())
    content |= {"log_sha256": "another flight's", "scale": 0.012, "scale_error": 0.006}
    (tmp_path / "airspeed.json").write_text(json.dumps(content))
    command("analyze", flown / "log.mcap", "--airspeed", tmp_path / "airspeed.json", "-o", tmp_path / "new")
    new, plain = (
        json.loads((folder / "results.json").read_text()) for folder in (tmp_path / "new", flown / "log.report")
    )
    slowest = [results["slowest_flown"]["speed_mps"] for results in (new, plain)]
    # GPS corrects less than half of it in this flight.
    assert 1.006 < slowest[1] / slowest[0] < 1.013
    (scale,) = (error for error in new["path"]["sensor_errors"] if error["name"] == "V_scale")
    assert scale["assumed_sigma"] == pytest.approx(100 * np.hypot(0.006, 0.003), rel=0.01)
    assert "airspeed calibration" in {file["role"] for file in new["provenance"]["files"]}


def test_a_second_result_does_not_replace_the_first(flown: Path, tmp_path: Path) -> None:
    (tmp_path / "airspeed.json").write_text("mine")
    outcome = command("calibrate", "airspeed", flown / "log.mcap", "-o", tmp_path / "airspeed.json")
    assert outcome.returncode == 2 and outcome.stderr.startswith("error: ") and "--replace" in outcome.stderr
    assert (tmp_path / "airspeed.json").read_text() == "mine"
