"""The page computes performance itself (`performance.js`): the same numbers as Python, at any weight, in any air."""

import json
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from motor_data import POLAR, model_of

from analysis.curve import Condition
from analysis.estimation.noise import NORMAL_95
from analysis.pages.html_page import to_json
from analysis.pages.other_conditions import embedded_model
from analysis.performance.analysis import performance_at
from analysis.performance.climb import full_throttle_performance
from analysis.performance.level_flight import PerformanceModel
from analysis.performance.power_train import PowerTrainModel
from analysis.performance.propagation import ParameterVector
from analysis.performance.request import TitledCondition
from analysis.records.flight import Interval
from flight.propeller import FOLD, WINDMILL, Propeller
from tests.browser import CHROMIUM, Browser

pytestmark = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")

VALUES = POLAR | {
    "thrust_scale": 0.01, "thrust_slope": -0.03, "alpha_0": -0.07, "alpha_CL": 0.23, "shaft_scale": 1.04,
    "friction": 0.16, "copper": 56.0, "meter_scale": 0.0, "unloaded_revps": 137.0, "revps_per_Nm": 30.0,
}  # fmt: skip
ENERGY_J = 3600 * 74 * 0.8


@pytest.fixture(scope="module")
def browser(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Browser:
    script = resources.files("analysis.pages").joinpath("templates", "performance.js").read_text("utf-8")
    page: Path = tmp_path_factory.mktemp("page") / "page.html"
    page.write_text(f"<!doctype html><script>{script}</script>")
    browser.show(page, 800)
    return browser


def model(propeller: Propeller, *, full_throttle: bool = True) -> PerformanceModel:
    """All parameters uncertain, by 2 % each and correlated."""
    names = tuple(VALUES) if full_throttle else tuple(VALUES)[:-2]
    values = np.array([VALUES[name] for name in names])
    spread = 0.02 * np.maximum(np.abs(values), 0.05)
    correlation = 0.7 * np.eye(len(names)) + 0.3
    parameters = ParameterVector(names, values, correlation * np.outer(spread, spread))
    return model_of(parameters, propeller, PowerTrainModel(parameters, 0.027, True, "", ()), (0.24, 0.96))


@pytest.mark.parametrize("beyond_zero_thrust", [WINDMILL, FOLD])
@pytest.mark.parametrize(
    ("weight", "density", "full_throttle"),
    [(1.0, 1.0, True), (1.3, 0.85, True), (0.7, 1.1, False), (2.0, 0.6, True)],
    ids=["as flown", "heavier and higher", "lighter, no throttle in the log", "too heavy to climb"],
)
def test_the_page_computes_what_python_does(
    browser: Browser, at: Condition, propeller: Propeller, beyond_zero_thrust: str, weight, density, full_throttle
) -> None:
    by_python = model(propeller.with_beyond_zero_thrust(beyond_zero_thrust), full_throttle=full_throttle)
    asked = at._replace(weight_N=weight * at.weight_N, rho=density * at.rho)
    expected = performance_at(by_python, TitledCondition("", asked), ENERGY_J)
    call = f"performanceAt({to_json(embedded_model(by_python))}, {json.dumps(asked._asdict())}, {ENERGY_J})"
    found = browser.value_of(call)

    case = expected.case
    agrees(found["endurance"]["best"], case.endurance_s)
    agrees(found["endurance"]["speed"], case.endurance_speed_mps)
    agrees(found["range"]["best"], case.range_m)
    agrees(found["range"]["speed"], case.range_speed_mps)
    assert found["endurance"]["atSlowest"] == case.endurance_at_slowest
    assert found["range"]["atFastest"] == case.range_at_fastest
    assert found["possible"] == expected.sustained
    flight = expected.level_flight
    assert found["flight"]["V"] == pytest.approx(flight.V.tolist(), rel=1e-9)
    assert found["flight"]["inside"] == flight.inside.tolist()
    required = found["flight"]["required"]
    assert [one["value"] for one in required] == pytest.approx(flight.required.value.tolist(), rel=1e-6)
    assert [one["error"] for one in required] == pytest.approx(flight.required.standard_error.tolist(), rel=1e-6)
    if not full_throttle:
        assert found["full"] is None
        return
    full = full_throttle_performance(by_python, asked)
    assert [one["value"] for one in found["full"]["climb"]] == pytest.approx(full.climb.value.tolist(), rel=1e-6)
    assert [one["error"] for one in found["full"]["power"]] == pytest.approx(
        full.power.standard_error.tolist(), rel=1e-6
    )
    agrees(found["full"]["maximumSpeed"], case.maximum_speed_mps)
    agrees(found["full"]["bestClimb"], case.best_climb_mps)


def agrees(found: dict[str, float | None], expected: Interval | None) -> None:
    """A value and its interval to 1e-6; NaN, which Chromium hands over as null, where Python has none."""
    if expected is None:
        assert found["error"] is None
        return
    assert found["value"] == pytest.approx(expected.value, rel=1e-6)
    if found["error"] is not None:
        assert found["value"] + NORMAL_95 * found["error"] == pytest.approx(expected.hi, rel=1e-6)
