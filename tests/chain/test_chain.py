"""The project's main job, end to end: fly, record, analyze; the curve against the simulator's truth."""

import json
import re
from importlib import resources
from pathlib import Path

import msgspec
import numpy as np
import pandas as pd
import pytest
from mcap.reader import make_reader
from running import command, done

from flightpower.analysis.flights.pool import joint_pool
from flightpower.analysis.records.flight import Results
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.messages import SECOND_TOPICS, TYPE_OF_TOPIC
from tests.analysis.pages.named_speeds import below_slowest
from tests.documented_commands import Walk

pytestmark = pytest.mark.xdist_group("chain")

# Everything but /daq/event comes at every tick of the demonstration, or as often as its source speaks.
RAW_AND_SI = {
    "/imu": ("accel_x_counts", "specific_force_x_mps2"),
    "/mag": ("x_counts", "field_x_T"),
    "/baro": ("pressure_counts", "pressure_Pa"),
    "/static": ("pressure_counts", "pressure_Pa"),
    "/probe/alpha": ("pressure_counts", "differential_pressure_Pa"),
    "/probe/beta": ("pressure_counts", "differential_pressure_Pa"),
    "/probe/airspeed": ("pressure_counts", "differential_pressure_Pa"),
    "/gps": ("itow_ms", "velocity_north_mps"),
    "/rpm": ("period_us", "motor_speed_revps"),
    "/controls": ("pulse_us", "elevator_rad"),
    "/attitude": (None, "pitch_rad"),
    "/battery": (None, "voltage_V"),
    "/time": ("monotonic_ns", "gps_utc_ns"),
    "/daq/tick": (None, "late_ns"),
    "/daq/event": (None, "text"),
}


@pytest.fixture(scope="module")
def results(flown: Path) -> Results:
    return msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)


def test_the_curve_lies_within_ten_per_cent_of_the_truth(flown: Path, results: Results) -> None:
    truth = pd.read_csv(flown / "truth_power_required.csv")
    V = np.array([point.speed_mps for point in results.power_required])
    power = np.array([point.power_W for point in results.power_required])
    assert V[0] < 12.0 and V[-1] > 22.0, "the flown range is that of the plan"
    assert power == pytest.approx(np.interp(V, truth["speed_mps"], truth["power_W"]), rel=0.10)
    assert results.verdict.startswith("converged")


def test_the_default_probe_of_the_simulator_is_that_of_its_tunnel(walk: Walk) -> None:
    """`sim fly` without --probe puts into the log the file that `calibrate probe` makes from `sim tunnel`."""
    shipped = json.loads((resources.files("flightpower.sim") / "data" / "probe.json").read_text("utf-8"))
    made = json.loads((walk.folder / "probe.json").read_text("utf-8"))
    assert shipped.keys() == made.keys()
    for key, value in made.items():
        for name in value if isinstance(value, dict) else [None]:
            here, there = (content[key] if name is None else content[key][name] for content in (shipped, made))
            assert here == there or np.array(here) == pytest.approx(np.array(there), rel=1e-6, abs=1e-9), (key, name)


def test_the_interval_is_an_interval(results: Results) -> None:
    for point in results.power_required + results.power_required_standard:
        assert point.power_lo_W < point.power_W < point.power_hi_W
    for special in (results.minimum_power_speed, results.best_range_speed):
        ends = [v for v in (special.lo_mps, special.speed_mps, special.hi_mps) if v is not None]
        assert ends == sorted(ends) and (len(ends) == 3 or special.reason)


def test_the_battery_gives_a_curve_and_a_method_of_its_own(results: Results) -> None:
    (method,) = (item for item in results.methods if item.name == "whole-flight")
    assert len(results.electrical_power) > 10 and len(method.power_required) > 10
    V = [point.speed_mps for point in results.power_required]
    power = [point.power_W for point in results.power_required]
    for point in method.power_required:
        assert point.power_W == pytest.approx(np.interp(point.speed_mps, V, power), rel=0.15)
    for point in results.electrical_power:
        shaft = np.interp(point.speed_mps, V, power) / point.power_W
        assert 0.3 < shaft < 0.8, "efficiency of motor and propeller"


def test_one_flight_through_the_pool_equals_its_analysis_to_the_digit(flown: Path) -> None:
    path = flown / "log.report" / "results.json"
    results, pooled = json.loads(path.read_bytes()), msgspec.to_builtins(joint_pool([path]).results())
    item, other = (of["curves"]["power_required"]["points"] for of in (pooled, results))
    assert item == other
    assert pooled["test"] == results["test"]
    assert pooled["drag_polar"] == {name: results["drag_polar"][name] for name in ("A0", "A1", "A2")}


def test_nothing_names_a_speed_below_the_slowest_flown(results: Results) -> None:
    assert below_slowest(results) == []


def test_the_runs_of_the_plan_are_found(flown: Path, results: Results) -> None:
    """Each planned run has a run of its kind among those found, which covers at least three quarters of it."""
    truth = pd.read_parquet(flown / "truth.parquet", columns=["time_s", "segment", "kind", "V_mps"])
    planned = truth[truth["kind"].isin(["run", "manual"])].groupby("segment")
    assert len(planned) == 2
    for _, samples in planned:
        start, end = samples["time_s"].iloc[0], samples["time_s"].iloc[-1]
        kind = "acceleration" if samples["V_mps"].iloc[-1] > samples["V_mps"].iloc[0] else "deceleration"
        overlap = [min(r.end_s, end) - max(r.start_s, start) for r in results.runs if r.kind == kind]
        assert max(overlap) > 0.75 * (end - start)


def test_the_log_opens_with_the_stock_reader_and_explains_itself(flown: Path) -> None:
    seen = {}
    with (flown / "log.mcap").open("rb") as stream:
        reader = make_reader(stream)
        names = {attachment.name for attachment in reader.iter_attachments()}
        for schema, channel, message in reader.iter_messages():
            assert schema is not None and schema.encoding == "jsonschema"
            assert json.loads(schema.data)["type"] == "object"
            content = json.loads(message.data)
            if content["status"] == "ok":
                seen[channel.topic] = content
    assert names == {"tray.toml", "aircraft.toml", "propeller.csv", "probe.json"}
    assert set(seen) == set(TYPE_OF_TOPIC) - SECOND_TOPICS - {"/analog"}
    for topic, (raw, value) in RAW_AND_SI.items():
        assert raw is None or seen[topic][raw] is not None, topic
        assert seen[topic][value] is not None, topic


@pytest.mark.thorough
@pytest.mark.slow
def test_the_analysis_does_not_look_at_what_the_simulator_flies(flown: Path, results: Results, tmp_path: Path) -> None:
    """Doubling the aircraft file's [aerodynamics] leaves the curve the same to the last digit. (The four keys have
    none.)"""
    head, _, aerodynamics = load_aircraft("nexstar").text.partition("\n[aerodynamics]\n")
    aerodynamics, section, others = aerodynamics.partition("\n[")
    doubled = re.sub(r"= (-?[\d.]+)", lambda m: f"= {2 * float(m[1])}", aerodynamics)
    (tmp_path / "doubled.toml").write_text(head + "\n[aerodynamics]\n" + doubled + section + others)
    done("analyze", flown / "log.mcap", "--aircraft", tmp_path / "doubled.toml", "-o", tmp_path / "report", "-q")
    again = msgspec.json.decode((tmp_path / "report" / "results.json").read_bytes(), type=Results)
    assert again.power_required == results.power_required


@pytest.mark.slow
def test_a_torn_log_is_analyzed_up_to_the_tear_and_says_so(flown: Path, results: Results, tmp_path: Path) -> None:
    """The log is cut in the descent, after the last run, so all runs are there. The aircraft file given overrides the
    log's."""
    heavier = load_aircraft("nexstar").text.replace('weight = "8.47 lbf"', 'weight = "9.00 lbf"')
    (tmp_path / "heavier.toml").write_text(heavier)
    data = (flown / "log.mcap").read_bytes()
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(data[: int(0.8 * len(data))])
    printed = done("analyze", torn, "--aircraft", tmp_path / "heavier.toml", "--json").stdout
    assert json.loads(printed) == json.loads((tmp_path / "torn.report" / "results.json").read_bytes())
    again = msgspec.json.decode((tmp_path / "torn.report" / "results.json").read_bytes(), type=Results)
    assert {run.kind for run in again.runs} >= {"acceleration", "deceleration"}
    assert any(
        re.fullmatch(r"The log is still being recorded, or cut by a loss of power: \d+\.\d s read\.", warning)
        for warning in again.warnings
    )
    assert again.test.weight_N == pytest.approx(results.test.weight_N * 9.00 / 8.47)


def test_a_simulation_is_not_replaced_unasked(flown: Path) -> None:
    before = (flown / "log.mcap").read_bytes()
    outcome = command("sim", "fly", "-o", flown)
    assert outcome.returncode == 2
    assert "--replace" in outcome.stderr
    assert (flown / "log.mcap").read_bytes() == before
