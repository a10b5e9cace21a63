"""A mission from several flights uses the pooled polar with its covariance, and the mean of their power trains."""

import json
import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from flightpower.analysis.cli import route
from flightpower.analysis.flights.flight_statistics import POOLED
from flightpower.analysis.flights.joint_pool import JointPool
from flightpower.analysis.flights.pool import joint_pool, pool_results
from flightpower.analysis.missions.inputs import RouteInput
from flightpower.analysis.missions.power import source_of
from flightpower.analysis.missions.prediction import predict
from flightpower.analysis.performance.stored_model import LOSSES, model_of, part
from flightpower.analysis.results.read import upgraded
from tests.analysis.flights.synthetic_flights import flight as statistics_of
from tests.analysis.flights.synthetic_flights import truth
from tests.analysis.missions.route_data import (
    aerodynamic_flight,
    electrical_flight,
    electrical_results,
    flight,
    legs,
    route_of,
)

SCALES = (0.9, 1.0, 1.04)  # factor on the shaft power of each flight


def contents(*, measured: tuple[bool, ...] = (True, True, True), use: bool = True) -> list[dict[str, Any]]:
    """Return results of flights of one aircraft, each with its own errors of drag and one of SCALES on shaft power."""
    rng = np.random.default_rng(3)
    x = truth(rng)
    contents = []
    for number, (scale, has_power_train) in enumerate(zip(SCALES, measured, strict=True)):
        content = msgspec.to_builtins(aerodynamic_flight())
        index = content["use"]["model"]["names"].index("shaft_scale")
        content["use"]["model"]["values"][index] = scale
        content["use"]["power_train"]["measured"] = has_power_train
        content["slowest_flown"]["largest_lift_coefficient"] += 0.1 * number
        taken = {name: content[name] for name in ("air", "slowest_flown", "battery", *(["use"] if use else []))}
        contents.append({**upgraded(statistics_of(x, rng, str(number))), **taken})
    return contents


def route_input(pool: JointPool) -> RouteInput:
    """Return the results of a pool as they are after writing and reading."""
    return msgspec.convert(upgraded(msgspec.to_builtins(pool.results())), RouteInput)


def test_polar_and_thrust_are_those_of_the_pool_with_their_joint_covariance() -> None:
    pool = joint_pool(contents())
    use = pool.results().use
    assert use is not None
    parameters = model_of(use.model).parameters
    index = [POOLED.index(name) for name in parameters.names[:5]]
    assert parameters.names[:5] == ("A0", "A1", "A2", "thrust_scale", "thrust_slope")
    assert parameters.values[:3] == pytest.approx(pool.polar.A)
    assert parameters.covariance[:3, :3] == pytest.approx(pool.polar.covariance)
    np.testing.assert_allclose(
        parameters.covariance[:5, 3:5], pool.estimate.parameters.covariance[np.ix_(index, index[3:])]
    )
    assert np.any(parameters.covariance[:3, 3:5]), "errors of thrust and drag must be correlated"
    assert use.model.flown_CL == pool.flown_CL
    largest = pool.results().slowest_flown
    assert largest is not None and largest.largest_lift_coefficient == pytest.approx(1.4), "the largest of all flights"


def test_losses_are_the_mean_of_the_flights_that_measured_them_and_no_surer_than_one() -> None:
    for measured, scale, logs in (
        ((True, True, True), np.mean(SCALES), ["0.mcap", "1.mcap", "2.mcap"]),
        ((True, False, True), np.mean([SCALES[0], SCALES[2]]), ["0.mcap", "2.mcap"]),
        ((False, False, False), np.mean(SCALES), ["0.mcap", "1.mcap", "2.mcap"]),
    ):
        use = joint_pool(contents(measured=measured)).results().use
        assert use is not None and use.losses_of == logs and use.losses_measured == any(measured)
        losses, single = (part(model_of(item).parameters, LOSSES) for item in (use.model, _model_of_one()))
        assert losses.values[0] == pytest.approx(scale)
        assert np.diag(losses.covariance) == pytest.approx(np.diag(single.covariance))


def _model_of_one() -> Any:
    use = aerodynamic_flight().use
    assert use is not None
    return use.model


def test_power_by_a_pool_has_the_spread_of_the_pool_and_less_than_that_of_a_flight() -> None:
    def spread(number: int) -> float:
        flights = contents()[:number]
        for content in flights:  # leaves only the errors of drag
            content["use"]["model"]["covariance"] = np.zeros((13, 13)).tolist()
        route = route_of(route_input(joint_pool(flights)), legs("3 km 000"), flight(power_sd=0.0))
        power_W = route.source.power_draws.battery_W(route.V, route.legs.condition, 0.0, 1.0)
        return float(np.std(power_W) / np.mean(power_W))

    assert 0.002 < spread(3) < 0.8 * spread(1)


def test_a_pool_of_one_flight_of_electrical_power_is_that_flight() -> None:
    written = msgspec.to_builtins(pool_results([electrical_flight()]).results())
    pooled_input = msgspec.convert(upgraded(written), RouteInput)
    item, pooled = (
        source_of(results, None, 2000, np.random.default_rng(2)) for results in (electrical_results(), pooled_input)
    )
    V, condition = np.array([12.0, 15.0, 20.0]), item.reference
    assert pooled.flown_CL == pytest.approx(item.flown_CL)
    for of in ("nominal", "power_draws"):
        powers = [getattr(source, of).battery_W(V, condition, 0.0, 1.0) for source in (item, pooled)]
        assert powers[1].mean(axis=0) == pytest.approx(powers[0].mean(axis=0), rel=3e-3)
        assert powers[1].std(axis=0) == pytest.approx(powers[0].std(axis=0), rel=0.08)
    heavier = predict(pooled_input, legs("3 km 000"), flight(weight_N=1.2 * condition.weight_N))
    assert heavier.energy_Wh.value > 1.1 * predict(electrical_results(), legs("3 km 000"), flight()).energy_Wh.value


def test_the_command_takes_a_pool_and_says_whose_losses_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    def run(content: list[dict[str, Any]]) -> int:
        file = tmp_path / "results.json"
        file.write_bytes(msgspec.json.encode(joint_pool(content).results()))
        words = ["--legs", "1 km 000, 1 km 180", "--results", str(file), "--wind", "0", "--json"]
        monkeypatch.setattr(sys, "argv", ["route", *words])
        try:
            route.main()
        except SystemExit as stopped:
            return int(stopped.code or 0)
        return 0

    assert run(contents(measured=(True, False, True))) == 0
    content = json.loads(capsys.readouterr().out)
    assert content["flights"] == ["0.mcap", "1.mcap", "2.mcap"] and content["losses_of"] == ["0.mcap", "2.mcap"]
    assert run(contents(use=False)) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_a_pool_gives_endurance_and_range_as_a_flight_does() -> None:
    """They use the pooled polar and the last flight's battery, also at other weights, and need power-train models."""
    result = joint_pool(contents()).results()
    assert result.performance is not None and result.battery is not None and result.battery.energy_Wh == 74.0
    flown = result.performance.loadings[0]
    assert flown.endurance_s.value * flown.endurance_power_W == pytest.approx(3600 * 74.0 * 0.8, rel=1e-3)
    heavier = max(result.performance.loadings, key=lambda case: case.weight_N)
    assert heavier.weight_N > 1.05 * flown.weight_N and heavier.endurance_s.value < flown.endurance_s.value
    assert result.performance.power_train.measured and "0.mcap, 1.mcap, 2.mcap" in result.performance.power_train.basis
    assert joint_pool(contents(use=False)).results().performance is None
