"""The page interpolates performance on a grid from Python, to 0.3 % of power at any weight and density."""

import json
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from motor_data import POLAR, model_of

from flightpower.analysis.curve import Condition
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.pages.charts.svg import chart_script
from flightpower.analysis.pages.html_page import to_json
from flightpower.analysis.pages.other_conditions import embedded_grid
from flightpower.analysis.performance.analysis import ConditionPerformance, performance_at
from flightpower.analysis.performance.level_flight import PerformanceModel
from flightpower.analysis.performance.power_train import PowerTrainModel
from flightpower.analysis.performance.propagation import ParameterVector
from flightpower.analysis.performance.request import TitledCondition
from flightpower.analysis.records.flight import Interval
from flightpower.flight.propeller import FOLD, WINDMILL, Propeller
from tests.browser import CHROMIUM, Browser

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")

VALUES = POLAR | {
    "thrust_scale": 0.01, "thrust_slope": -0.03, "alpha_0": -0.07, "alpha_CL": 0.23, "shaft_scale": 1.04,
    "friction": 0.16, "copper": 56.0, "meter_scale": 0.0, "unloaded_revps": 137.0, "revps_per_Nm": 30.0,
}  # fmt: skip
ENERGY_J = 3600 * 74 * 0.8
DENSITIES = (0.5, 1.6)  # [kg/m^3], range of the page's controls
WITHIN = 3e-3  # share of power


@pytest.fixture(scope="module")
def browser(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Browser:
    script = (
        resources.files("flightpower.analysis.pages").joinpath("templates", "other_conditions.js").read_text("utf-8")
    )
    page: Path = tmp_path_factory.mktemp("page") / "page.html"
    page.write_text(f"<!doctype html><meta charset=utf-8><script>{chart_script()}{script}</script>", "utf-8")
    browser.show(page, 800)
    assert browser.complaints == []
    return browser


def model(propeller: Propeller, *, full_throttle: bool = True) -> PerformanceModel:
    """Return a model whose parameters are all uncertain, by 2 % each, and correlated."""
    names = tuple(VALUES) if full_throttle else tuple(VALUES)[:-2]
    values = np.array([VALUES[name] for name in names])
    spread = 0.02 * np.maximum(np.abs(values), 0.05)
    correlation = 0.7 * np.eye(len(names)) + 0.3
    parameters = ParameterVector(names, values, correlation * np.outer(spread, spread))
    return model_of(parameters, propeller, PowerTrainModel(parameters, 0.027, True, "", ()), (0.24, 0.96))


def answers_of(
    browser: Browser, by_python: PerformanceModel, flown: Condition, conditions: list[Condition]
) -> list[Any]:
    """Return the page's performance at each condition."""
    grid = to_json(embedded_grid(by_python, flown, DENSITIES))
    conditions_json = json.dumps([condition._asdict() for condition in conditions])
    return browser.value_of(
        f"(grid => {conditions_json}.map(at => performanceAt(grid, {json.dumps(flown._asdict())}, at, {ENERGY_J})))"
        f"({grid})"
    )


def random_conditions(flown: Condition, count: int, seed: int) -> list[Condition]:
    rng = np.random.default_rng(seed)
    weights = flown.weight_N * np.exp(rng.uniform(np.log(0.5), np.log(2.0), count))
    return [flown._replace(weight_N=float(W), rho=float(rng.uniform(*DENSITIES))) for W in weights]


@pytest.mark.parametrize("beyond_zero_thrust", [WINDMILL, FOLD])
@pytest.mark.parametrize("full_throttle", [True, False], ids=["full throttle known", "no throttle in the log"])
def test_power_is_interpolated_to_three_parts_in_a_thousand(
    browser: Browser, condition: Condition, propeller: Propeller, beyond_zero_thrust: str, full_throttle: bool
) -> None:
    """Random conditions lie anywhere within the weights and densities of the page's controls."""
    by_python = model(propeller.with_beyond_zero_thrust(beyond_zero_thrust), full_throttle=full_throttle)
    conditions = random_conditions(condition, 12, seed=5)
    compared = 0
    for requested, result in zip(conditions, answers_of(browser, by_python, condition, conditions), strict=True):
        expected = performance_at(by_python, TitledCondition("", requested), ENERGY_J)
        flight = expected.level_flight
        V = np.array(result["flight"]["V"])
        assert (V[0], V[-1]) == pytest.approx((flight.V[0], flight.V[-1]), rel=1e-6)
        required = np.interp(flight.V, V, [item["value"] for item in result["flight"]["required"]])
        assert required == pytest.approx(flight.required.value, rel=WITHIN)
        errors = np.interp(flight.V, V, [item["error"] for item in result["flight"]["required"]])
        assert errors == pytest.approx(flight.required.standard_error, rel=0.02)
        finite = [k for k, power in enumerate(result["flight"]["battery"]) if power is not None]
        battery = np.interp(V[finite], flight.V, flight.battery.value)
        assert np.array(result["flight"]["battery"], dtype=float)[finite] == pytest.approx(battery, rel=WITHIN)
        compared += len(finite)
        assert result["possible"] == expected.sustained
        agrees_at_its_best(result, expected)
    assert compared > 250, "too few of the points of 12 curves"


def agrees_at_its_best(result: Any, expected: ConditionPerformance) -> None:
    case = expected.case
    for name, best in (("endurance", case.endurance_s), ("range", case.range_m)):
        agrees(result[name]["best"], best, WITHIN)
    assert result["endurance"]["speed"]["value"] == pytest.approx(case.endurance_speed_mps.value, rel=0.02)
    assert result["range"]["speed"]["value"] == pytest.approx(case.range_speed_mps.value, rel=0.02)
    if expected.full_throttle is None:
        assert result["full"] is None
        return
    full = expected.full_throttle
    finite = [k for k, power in enumerate(result["full"]["power"]) if power is not None]
    V, power = (np.array(result["full"][name], dtype=float)[finite] for name in ("V", "power"))
    highest = float(np.nanmax(full.power.value))
    expected_W = np.interp(V, full.V, full.power.value)
    pulling = expected_W > 0.1 * highest  # a propeller brakes or folds only far beyond level flight
    assert power[pulling] == pytest.approx(expected_W[pulling], abs=WITHIN * highest) and pulling.sum() > 8
    agrees(result["full"]["maximumSpeed"], case.maximum_speed_mps, WITHIN)
    if case.best_climb_mps is not None:
        assert result["full"]["bestClimb"]["value"] == pytest.approx(case.best_climb_mps.value, abs=0.02)


def agrees(result: dict[str, float | None], expected: Interval | None, within: float) -> None:
    """Check a value, and the width of its interval to 5 %; the error must be null if Python has no interval."""
    if expected is None:
        assert result["error"] is None
        return
    assert result["value"] == pytest.approx(expected.value, rel=within)
    if result["error"] is not None:
        half = expected.hi - expected.value
        assert NORMAL_95 * result["error"] == pytest.approx(half, rel=0.05, abs=1e-3 * expected.value)


def test_what_was_flown_is_a_node(browser: Browser, condition: Condition, propeller: Propeller) -> None:
    by_python = model(propeller)
    (result,) = answers_of(browser, by_python, condition, [condition])
    case = performance_at(by_python, TitledCondition("", condition), ENERGY_J).case
    assert result["endurance"]["best"]["value"] == pytest.approx(case.endurance_s.value, rel=2e-4)
    assert result["range"]["best"]["value"] == pytest.approx(case.range_m.value, rel=2e-4)
    assert result["endurance"]["atSlowest"] == case.endurance_at_slowest
    assert result["range"]["atFastest"] == case.range_at_fastest


def test_twice_the_weight_needs_two_to_the_power_of_three_halves(
    browser: Browser, condition: Condition, propeller: Propeller
) -> None:
    """At equal lift coefficient, power grows with (W/W_s)^1.5 and speed with the square root of W/W_s."""
    light, heavy = answers_of(
        browser, model(propeller), condition, [condition, condition._replace(weight_N=2 * condition.weight_N)]
    )
    ratio = [
        b["value"] / a["value"] for a, b in zip(*(item["flight"]["required"] for item in (light, heavy)), strict=True)
    ]
    assert ratio == pytest.approx([2**1.5] * len(ratio), rel=1e-9)
    assert heavy["flight"]["V"][0] / light["flight"]["V"][0] == pytest.approx(2**0.5, rel=1e-9)
    assert heavy["range"]["best"]["value"] < light["range"]["best"]["value"]
