"""The command `analyze` on a real flight under PX4 against a published analysis of it."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from flightpower.analysis.cli.analyze import app
from flightpower.analysis.cli.calibrate import app as calibrate
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.curve import estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.sources.px4 import read_px4
from flightpower.analysis.sources.recording import AIRSPEED_PRESSURE
from flightpower.flight.command_line import ExitCode
from flightpower.flight.units import GRAVITY_MPS2
from tests.shared_data import beside, needs

LOG = beside("pixhawk/seaway-mini-flight3.ulg")
pytestmark = needs(LOG)
AIRCRAFT = ["--mass", "9.4 kg", "--wing-area", "1.499 m^2", "--span", "4.0 m"]
# Electrical power [W] of level flight by P. Sharpe's method (smoothed energy balance, four-term drag polar, efficiency
# over V / I^(1/3)), which his figure power_curve_with_physics shows, at 9 to 16 m/s.
SPEEDS = np.arange(9.0, 17.0)
PUBLISHED_W = np.array([96.1, 91.9, 103.3, 124.7, 154.1, 190.3, 233.3, 282.9])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    done = CliRunner().invoke(app, [str(LOG), *AIRCRAFT, "--battery-Wh", "300", "-o", str(folder), "--quiet"])
    assert done.exit_code == 0, done.output
    return folder


@pytest.fixture(scope="module")
def results(folder: Path) -> dict:
    return json.loads((folder / "results.json").read_text("utf-8"))


def at_speeds(results: dict, name: str) -> np.ndarray:
    curve = results["curves"]["electrical_power"]["points"]
    return np.interp(SPEEDS, [point["speed_mps"] for point in curve], [point[name] for point in curve])


def test_the_curve_agrees_with_the_published_one(results: dict) -> None:
    power = at_speeds(results, "power_W")
    assert np.abs(power / PUBLISHED_W - 1)[:4] == pytest.approx(0.0, abs=0.10)  # 9 to 12 m/s
    assert (at_speeds(results, "power_lo_W") < PUBLISHED_W).all()
    assert (at_speeds(results, "power_hi_W") > PUBLISHED_W).all()


def test_the_interval_is_useful(results: dict) -> None:
    half_width = (at_speeds(results, "power_hi_W") - at_speeds(results, "power_lo_W")) / 2
    assert (half_width / at_speeds(results, "power_W"))[1:6].max() < 0.25  # 10 to 14 m/s
    assert results["balance"]["residual_W"] < 36.0


def test_drag_is_withheld_with_what_it_would_take(results: dict, folder: Path) -> None:
    assert results["drag_polar"] is None and list(results["curves"]) == ["electrical_power"]
    (drag, *_) = results["withheld"]
    assert "motor speed" in drag
    assert drag.replace("'", "&#39;") in (folder / "report.html").read_text("utf-8")


def test_what_the_log_does_is_noted(results: dict) -> None:
    """The first battery monitor reads 0 A, and the barometer 40 °C beside air of 9 °C."""
    notes = " ".join(results["warnings"])
    assert "battery_status 1 measures the propulsion" in notes
    assert "Air temperature 9 °C" in notes and "vehicle_air_data 0 shows 40 °C" in notes
    assert results["test"]["air_density_kgpm3"] == pytest.approx(1.232, abs=0.002)


def test_wind_is_that_of_the_autopilot(results: dict) -> None:
    """PX4's own estimate in flight is about 4 m/s from the east."""
    air = results["air"]
    assert air["wind_mps"] == pytest.approx(4.4, abs=0.7)
    assert air["wind_from_deg"] == pytest.approx(96, abs=10)


def test_calibrate_airspeed_of_an_autopilots_log(tmp_path: Path, results: dict) -> None:
    """The flight knows the scale no better than before it: its result is printed, and no calibration is written."""
    done = CliRunner().invoke(calibrate, ["airspeed", str(LOG), "-o", str(tmp_path / "airspeed.json")])
    scale = re.search(r"airspeed reads (\S+) ± \S+ % too (high|low)", done.output)
    wind = re.search(r"wind (\S+) m/s from (\S+) deg", done.output)
    assert scale and wind, done.output
    sign = 1 if scale[2] == "high" else -1
    assert sign * float(scale[1]) / 100 == pytest.approx(results["balance"]["airspeed_scale"]["value"], abs=0.002)
    assert float(wind[1]) == pytest.approx(results["air"]["wind_mps"], abs=0.2)
    assert "flown in one direction" not in done.output  # circles
    assert done.exit_code == ExitCode.FAILURE
    assert not (tmp_path / "airspeed.json").exists()


@pytest.mark.thorough
@pytest.mark.slow
def test_without_its_airspeed_sensor_the_flight_gives_the_same_curve(results: dict) -> None:
    """GPS on circles gives the curve; intervals are at most two and a half times those with the sensor."""
    complete, weight_N = read_px4(LOG), 9.4 * GRAVITY_MPS2
    blind = replace(complete, channels={k: x for k, x in complete.channels.items() if k != AIRSPEED_PRESSURE})
    electrical = estimate(flight_table(blind, weight_N, 1.499), weight_N, 1.499, 4.0)
    power, error = (np.interp(SPEEDS, electrical.V_mps, x) for x in (electrical.power_W, electrical.standard_error_W))
    half_W = (at_speeds(results, "power_hi_W") - at_speeds(results, "power_lo_W")) / 2
    assert (np.abs(power - at_speeds(results, "power_W")) < NORMAL_95 * error).all()
    assert (np.abs(power - PUBLISHED_W) < NORMAL_95 * error).all()
    assert (NORMAL_95 * error < 2.5 * half_W).all()
    assert electrical.airspeed.wind_mps == pytest.approx(results["air"]["wind_mps"], abs=0.5)


def test_endurance_is_the_battery_at_least_power(results: dict) -> None:
    least = min(point["power_W"] for point in results["curves"]["electrical_power"]["points"])
    assert results["curves"]["electrical_power"]["endurance_s"]["value"] == pytest.approx(0.8 * 300 * 3600 / least)


def test_values_to_type_in_follow_from_the_curve(results: dict, folder: Path) -> None:
    result = {parameter["name"]: parameter for parameter in results["autopilot_parameters"]}
    curve = results["curves"]["electrical_power"]
    slowest, fastest = (curve["points"][end]["speed_mps"] for end in (0, -1))
    to_equivalent = (results["test"]["air_density_kgpm3"] / 1.225) ** 0.5
    assert result["FW_AIRSPD_MIN"]["value"] == pytest.approx(slowest * to_equivalent, rel=1e-3)
    assert result["FW_AIRSPD_MAX"]["value"] == pytest.approx(fastest * to_equivalent, rel=1e-3)
    cruise = curve["best_range_speed"]["speed_mps"]
    assert result["nav_fw_cruise_speed"]["value"] == pytest.approx(100 * cruise * to_equivalent, rel=1e-3)
    power = (
        min(point["power_W"] / point["speed_mps"] for point in results["curves"]["electrical_power"]["points"]) * cruise
    )
    assert result["cruise_power"]["value"] == pytest.approx(100 * power, rel=1e-3)
    assert 0.3 < result["FW_T_SINK_MIN"]["value"] < 0.9  # a glide ratio of 12 to 30 at 10 m/s
    assert "FW_AIRSPD_TRIM" in (folder / "report.html").read_text("utf-8")
