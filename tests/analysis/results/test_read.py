"""Results are read into one kind of record, whatever the format of their file."""

import json
from pathlib import Path
from typing import Any

import msgspec
import pytest

from flightpower.analysis.records.fleet import FORMAT as FLEET_FORMAT
from flightpower.analysis.records.flight import FORMAT, EvidenceKind, Kind, PoolingStatistics, PowerStatistics, Trust
from flightpower.analysis.records.pool import COMPARISON_FORMAT, POOLED_FORMAT
from flightpower.analysis.results.files import to_json
from flightpower.analysis.results.read import as_record, read_results
from flightpower.flight.errors import InputError
from tests.analysis.missions.route_data import aerodynamic_flight, electrical_flight

POINT = {"speed_mps": 14.0, "power_W": 50.0, "power_lo_W": 45.0, "power_hi_W": 55.0, "extrapolated": False}
SPEED = {"speed_mps": 14.0, "lo_mps": 13.0, "hi_mps": 15.0, "inside_flown_range": True, "reason": ""}
PART = {"speed_mps": 14.0, "noise_W": 1.0, "systematic_W": 2.0}
UNKNOWN = {"speed_mps": None, "lo_mps": None, "hi_mps": None, "inside_flown_range": False, "reason": ""}
AT = {"weight_N": 37.0, "air_density_kgpm3": 1.2}


def of_format_2(**more: Any) -> dict[str, Any]:
    """Return the fields that results of both kinds had in format 2."""
    return {
        "format": "flightpower-results-2", "trust": "trusted", "evidence": [], "software_version": "1.0", "log": "log",
        "aircraft": {"name": "a", "title": "A", "wing_area_m2": 0.46, "span_m": 1.75, "propeller": "p"}, "test": AT,
        "standard": AT, "air_temperature_K": 288.0, "air_pressure_Pa": 1e5, "runs": [], "rejected": [],
        "parameters": [], "drag_polar": None, "power_required": [], "power_required_standard": [], "cross_check": [],
        "minimum_power_speed": UNKNOWN, "best_range_speed": UNKNOWN, "verdict": "converged", "warnings": [],
        "interval_parts": [], "electrical_power": [], **more,
    }  # fmt: skip


def drag() -> dict[str, Any]:
    pooling = {
        "format": "flightpower-pooling-3", "names": ["A0"], "values": [0.05], "covariance": [[1.0]],
        "weighting_covariance": [[1.0]], "prior_mean": [0.0], "prior_sigma": [None], "changes": {},
        "polar_covariance": [[1.0]], "flown_CL": [0.2, 1.0], "installation": "", "propeller_table": "",
        "probe_calibration": "",
    }  # fmt: skip
    air = {
        "wind_mps": 3.0, "wind_from_deg": 90.0, "wind_standard_error_mps": 0.2, "gust_mps": 0.3, "temperature_K": 288.0,
        "density_altitude_m": 200.0, "lowest_height_m": 40.0, "highest_height_m": 60.0,
    }  # fmt: skip
    available = {"reason": "not flown", "basis": "", "power_available": [], "climb_mps": [], "maximum_speed_mps": None,
                 "maximum_speed_extrapolated": False, "best_climb_mps": None, "best_climb_speed_mps": None,
                 "service_ceiling_m": None, "absolute_ceiling_m": None, "notes": []}  # fmt: skip
    train = {"measured": True, "basis": "", "parameters": [], "efficiency": [], "points": []}
    use = {"battery_energy_Wh": 74.0, "usable": 0.7, "power_train": train, "available": available, "loadings": [],
           "costs": [], "field_table": []}  # fmt: skip
    return of_format_2(
        power_required=[POINT], power_required_standard=[{**POINT, "power_W": 48.0}], minimum_power_speed=SPEED,
        interval_parts=[PART], pooling=pooling, air=air, use=use, electrical_power=[{**POINT, "power_W": 90.0}],
    )  # fmt: skip


def electrical() -> dict[str, Any]:
    statistics = {
        "speed_mps": [14.0], "power_W": [50.0], "own_covariance": [[1.0]],
        "shared": {"prior 0": [0.1], "prior 11": [0.3], "current": [0.2]},
    }  # fmt: skip
    results = {
        "least_power_speed": SPEED, "best_range_speed": SPEED, "interval_parts": [PART], "residual_W": 3.0,
        "endurance_s": {"value": 4320.0, "lo": 4000.0, "hi": 5000.0}, "range_m": None, "idle_power_W": 4.0,
        "airspeed_scale": None, "wind_mps": 5.0, "wind_from_deg": 180.0, "flown_s": 600.0, "withheld": ["climb"],
        "shaft_power": [{**POINT, "power_W": 40.0}], "pooling": statistics, "battery_energy_Wh": 75.0,
    }  # fmt: skip
    return of_format_2(electrical_power=[POINT], power_required=[{**POINT, "power_W": 30.0}], electrical=results)


def test_a_flight_with_runs_of_format_2_has_its_fields_where_they_are_now(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    path.write_text(json.dumps(drag()), "utf-8")
    result = read_results(path)
    required = result.curves[Kind.POWER_REQUIRED]
    assert (
        result.kind is Kind.POWER_REQUIRED and result.main is required and isinstance(result.pooling, PoolingStatistics)
    )
    assert result.power_required[0].power_W == 50.0 and result.power_required_standard[0].power_W == 48.0
    assert result.minimum_power_speed.speed_mps == 14.0 and result.best_range_speed.speed_mps is None
    assert result.interval_parts[0].systematic_W == 2.0 and result.electrical_power[0].power_W == 90.0
    assert (result.air.wind_mps, result.air_temperature_K, result.air_pressure_Pa) == (3.0, 288.0, 1e5)
    assert result.battery is not None and (result.battery.energy_Wh, result.battery.usable) == (74.0, 0.7)
    assert result.use is not None and result.use.power_train.measured


def test_a_flight_of_electrical_power_of_format_2_too_and_its_shared_errors_have_names() -> None:
    result = read_results(electrical())
    curve = result.main
    assert result.kind is Kind.ELECTRICAL and curve.points[0].power_W == 50.0 and curve.idle_power_W == 4.0
    assert isinstance(curve.statistics, PowerStatistics) and curve.statistics.shared == {
        "prior of zero-lift drag": [0.1], "prior of angle over thrust": [0.3], "current": [0.2],
    }  # fmt: skip
    assert result.points(Kind.SHAFT)[0].power_W == 40.0 and result.power_required[0].power_W == 30.0
    assert (result.air.wind_mps, result.air.pressure_Pa, result.withheld) == (5.0, 1e5, ["climb"])
    assert result.balance is not None and (result.balance.residual_W, result.balance.flown_s) == (3.0, 600.0)
    assert result.battery is not None and result.battery.energy_Wh == 75.0
    assert result.battery.usable == pytest.approx(0.8), "4320 s at 50 W are 60 Wh of 75"


def test_what_is_written_is_read_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "results.json"
    for results in (aerodynamic_flight(), electrical_flight()):
        path.write_bytes(to_json(results))
        assert read_results(path) == results == read_results(msgspec.to_builtins(results))
        assert json.loads(path.read_bytes())["format"] == FORMAT


def test_results_of_a_version_without_verdict_are_doubtful() -> None:
    content = drag()
    del content["evidence"], content["trust"]
    result = read_results(content)
    assert result.trust is Trust.DOUBTFUL and [evidence.kind for evidence in result.evidence] == [
        EvidenceKind.NO_VERDICT
    ]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"format": "flightpower-results-9"}, "format 'flightpower-results-9' is not supported"),
        ({"test": None}, "not results of `analyze`"),
        ({"power_required": [{"speed_mps": "fast"}]}, "not results of `analyze`"),
        ({"air": 3}, "not results of `analyze`"),
    ],
)
def test_what_is_no_result_is_refused_in_one_line(change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as error:
        read_results({**drag(), **change}, "a.json")
    assert str(error.value).startswith("a.json: ") and "\n" not in str(error.value)
    with pytest.raises(InputError):
        as_record({**drag(), **change}, type(aerodynamic_flight()), "a.json")


@pytest.mark.parametrize(
    ("form", "what"),
    [(POOLED_FORMAT, "the results of several flights"), (COMPARISON_FORMAT, "a comparison"), (FLEET_FORMAT, "a fleet")],
)
def test_results_of_several_flights_are_distinguished_from_those_of_one(tmp_path: Path, form: str, what: str) -> None:
    (tmp_path / "results.json").write_text(json.dumps({"format": form}))
    with pytest.raises(InputError, match=f"holds {what}, and one flight's results are needed here"):
        read_results(tmp_path / "results.json")


def test_a_folder_that_analyze_wrote_stands_for_the_results_in_it(tmp_path: Path) -> None:
    (tmp_path / "results.json").write_bytes(to_json(electrical_flight()))
    assert to_json(read_results(tmp_path)) == to_json(read_results(tmp_path / "results.json"))
