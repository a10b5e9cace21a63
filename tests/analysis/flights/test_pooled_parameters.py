"""A pool gives an autopilot's values and tables, as a single flight does."""

import csv
from pathlib import Path

import msgspec
import numpy as np
import pytest
from synthetic_flights import flight as drag_flight
from synthetic_flights import truth
from test_electrical_pool import flight as electrical_flight
from typer.testing import CliRunner

from flightpower.analysis.cli.parameters import app
from flightpower.analysis.cli.several_logs import _pool
from flightpower.analysis.flights.campaign.campaign import Campaign
from flightpower.analysis.flights.pool import pool_results
from flightpower.analysis.performance.autopilot_parameters import (
    FlightValues,
    around,
    mean_interval,
    typed_in,
    wing_loading_of,
)
from flightpower.analysis.records.flight import AutopilotParameter, Results
from flightpower.analysis.results.read import read_results
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY

WING_AREA_M2, CD0, B = 0.46, 0.04, 0.05


def sink_mps(true_mps: float, weight_N: float, rho: float) -> float:
    """The sink rate D V / W with C_D = CD0 + B C_L^2."""
    qS = rho / 2 * true_mps**2 * WING_AREA_M2
    return qS * (CD0 + B * (weight_N / qS) ** 2) * true_mps / weight_N


def flight(log: str, cruise_mps: float, weight_N: float, rho: float, **changed: object) -> Results:
    """An electrical flight with the values of `sink_mps`'s polar at its own cruise speed, weight and density."""
    to_equivalent = (rho / SEA_LEVEL_DENSITY) ** 0.5
    sink = sink_mps(cruise_mps, weight_N, rho)
    values = {
        "cruise": around(cruise_mps * to_equivalent, 0.2), "slowest": around(12.0 * to_equivalent, 0.24),
        "fastest": around(20.0 * to_equivalent, 0.4), "wing_loading": wing_loading_of(weight_N, WING_AREA_M2),
        "sink": around(sink, 0.1 * sink), "CD0": around(CD0, 0.004), "B": around(B, 0.005),
        "idle_power": around(8.0, 0.5), "airspeed_factor": around(1.02, 0.01), "logged": {"ARSPD_RATIO": 2.0},
    } | changed  # fmt: skip
    parameters, withheld = typed_in(FlightValues(**values))  # type: ignore[arg-type]
    return msgspec.structs.replace(
        electrical_flight(log, 1e-6 * ord(log), weight_N=weight_N, rho=rho),  # no two curves are equal
        autopilot_parameters=parameters,
        autopilot_parameters_withheld=withheld,
    )


def pooled(flights: list[Results]) -> dict[str, AutopilotParameter]:
    return {parameter.name: parameter for parameter in pool_results(flights).results().autopilot_parameters}


def test_sink_is_that_of_the_polar_at_the_cruise_weight_and_density_of_the_pool() -> None:
    """No flight flew at the pool's weight, density and cruise: each flight's own polar carries its sink there."""
    flights = [flight("a", 13.0, 34.0, 1.10), flight("b", 17.0, 42.0, 1.22)]
    values, condition = pooled(flights), pool_results(flights).condition
    cruise_mps = values["FW_AIRSPD_TRIM"].value * (SEA_LEVEL_DENSITY / condition.rho) ** 0.5
    assert values["FW_T_SINK_MIN"].value == pytest.approx(
        sink_mps(cruise_mps, condition.weight_N, condition.rho), rel=1e-6
    )
    assert not any(
        each.autopilot_parameters[3].value == pytest.approx(values["FW_T_SINK_MIN"].value, rel=0.02) for each in flights
    )
    assert values["SOAR_POLAR_CD0"].value == pytest.approx(CD0) and values["SOAR_POLAR_B"].value == pytest.approx(B)


def test_intervals_of_means_are_as_wide_as_the_flights_own() -> None:
    """Errors may be shared, so for values that their curves do not pool, four flights are no more certain than one."""
    single, four = (pooled([flight(name, 14.0, 38.0, 1.2) for name in names]) for names in ("a", "bcde"))
    for name in ("FW_T_SINK_MIN", "SOAR_POLAR_B", "idle_power", "ASPD_SCALE_1", "AIRSPEED_MAX"):
        assert four[name].hi - four[name].lo == pytest.approx(single[name].hi - single[name].lo, rel=1e-6)
    assert single["AIRSPEED_MIN"].hi / single["AIRSPEED_MIN"].value == pytest.approx(1.02, rel=1e-3)
    width = [values["cruise_power"].hi - values["cruise_power"].lo for values in (single, four)]
    assert width[1] < 0.9 * width[0]  # the errors of each flight's own curve average out
    assert mean_interval([]) is None


def test_a_factor_of_airspeed_over_different_ratios_is_withheld() -> None:
    other = {"logged": {"ARSPD_RATIO": 1.8}}
    values = pooled([flight("a", 14.0, 38.0, 1.2), flight("b", 14.0, 38.0, 1.2, **other)])
    assert not {"ASPD_SCALE_1", "ARSPD_RATIO"} & values.keys() and "AIRSPEED_CRUISE" in values
    alike = pooled([flight("a", 14.0, 38.0, 1.2), flight("b", 14.0, 38.0, 1.2)])
    assert alike["ARSPD_RATIO"].value == pytest.approx(2.0 * 1.02**2) and alike["ARSPD_RATIO"].logged == 2.0


def test_a_flight_without_a_polar_takes_no_part_in_the_sink() -> None:
    without = flight("b", 17.0, 42.0, 1.2, CD0=None, B=None, sink=around(9.0, 0.1))
    alone, both = pooled([flight("a", 13.0, 42.0, 1.2)]), pooled([flight("a", 13.0, 42.0, 1.2), without])
    assert both["TECS_SINK_MIN"].value == pytest.approx(alone["TECS_SINK_MIN"].value, rel=1e-6)


def test_a_pool_of_drag_gives_what_its_polar_gives() -> None:
    rng = np.random.default_rng(11)
    x = truth(rng)
    flights = [read_results(drag_flight(x, rng, name)) for name in "abc"]
    results = pool_results(flights).results()
    values = {parameter.name: parameter for parameter in results.autopilot_parameters}
    last = results.power_required[-1]
    to_equivalent = (results.test.air_density_kgpm3 / SEA_LEVEL_DENSITY) ** 0.5
    assert values["FW_AIRSPD_MAX"].value == pytest.approx(last.speed_mps * to_equivalent)
    cruise_mps = values["FW_AIRSPD_TRIM"].value / to_equivalent
    sink = np.interp(cruise_mps, *zip(*((p.speed_mps, p.power_W) for p in results.power_required), strict=True))
    assert values["FW_T_SINK_MIN"].value == pytest.approx(sink / results.test.weight_N)
    assert values["SOAR_POLAR_CD0"].lo < values["SOAR_POLAR_CD0"].value < values["SOAR_POLAR_CD0"].hi


def test_the_commands_write_the_curve_and_the_parameters_of_a_pool(tmp_path: Path, capsys) -> None:
    flights = [flight("a", 13.0, 34.0, 1.10), flight("b", 17.0, 42.0, 1.22)]
    for each in flights:
        (tmp_path / each.log).mkdir()
        (tmp_path / each.log / "results.json").write_bytes(msgspec.json.encode(each))
    (tmp_path / "power_required.csv").write_text("of an earlier pool", "utf-8")
    _pool(Campaign(folders=[tmp_path / "a", tmp_path / "b"]), tmp_path, quiet=True)
    assert "power_required.csv in" in capsys.readouterr().err
    rows = list(csv.DictReader((tmp_path / "electrical_power.csv").open(encoding="utf-8")))
    results = pool_results(flights).results()
    assert [float(row["power_W"]) for row in rows] == pytest.approx(
        [point.power_W for point in results.electrical_power], rel=1e-5
    )
    assert "TECS_SINK_MIN" in (tmp_path / "report.html").read_text("utf-8")
    written = tmp_path / "my.param"
    done = CliRunner().invoke(app, [str(tmp_path), "--for", "ardupilot", "--stall", "9 m/s", "-o", str(written)])
    assert done.exit_code == 0, done.output
    text = written.read_text("utf-8")
    assert "from 2 flights together" in text
    assert f"\nTECS_SINK_MIN,{pooled(flights)['TECS_SINK_MIN'].value:.5g}\n" in text
