"""No card, table, figure or interval names a speed below the slowest flown, for 50 random polars and conditions."""

import numpy as np
from msgspec.structs import replace

from flightpower.analysis.curve import Condition, Polar, speed_at
from flightpower.analysis.pages.answers import headline_answers
from flightpower.analysis.pages.sections.performance import to_markdown
from flightpower.analysis.performance.analysis import flight_performance
from flightpower.analysis.performance.full_throttle import FullThrottle
from flightpower.analysis.performance.level_flight import PerformanceModel
from flightpower.analysis.performance.power_train import PowerTrainModel
from flightpower.analysis.performance.propagation import ParameterVector, combine_independent, exact
from flightpower.analysis.performance.request import TitledCondition
from flightpower.analysis.records.flight import (
    BatteryResult,
    ConditionResult,
    Kind,
    MethodResult,
    Results,
    SlowestFlown,
    SpeedReason,
)
from flightpower.analysis.results.curves import curve_result, drag_polar, power_curve
from tests.analysis.pages.named_speeds import below_slowest

SEEDS = range(50)
BATTERY = BatteryResult(energy_Wh=50.0, usable=0.8)
LOSSLESS = PowerTrainModel(exact(shaft_scale=1.0, friction=0.0, copper=0.0, meter_scale=0.0), 0.0, True, "", ())
REST = exact(thrust_scale=0.0, thrust_slope=0.0, alpha_0=0.0, alpha_CL=0.0)


def results_of(seed: int, template: Results, nexstar, propeller, performs: bool = True) -> Results:
    """Results with a random polar, covariance, weight, density and range of lift coefficients."""
    rng = np.random.default_rng(seed)
    A = np.array([rng.uniform(0.02, 0.06), rng.uniform(-0.03, 0.01), rng.uniform(0.03, 0.09)])
    root = rng.uniform(0.02, 0.2) * np.diag(np.abs(A)) @ rng.standard_normal((3, 3))
    polar = Polar(A, root @ root.T)
    condition = Condition(nexstar.mass.weight_N * rng.uniform(0.6, 1.2), rng.uniform(0.95, 1.25), 0.46)
    flown_CL = (rng.uniform(0.2, 0.35), rng.uniform(0.6, 1.8))
    parameters = combine_independent(ParameterVector(("A0", "A1", "A2"), *polar), REST, LOSSLESS.parameters)
    model = PerformanceModel(parameters, LOSSLESS, FullThrottle(None, reason="not flown"), propeller, flown_CL)
    heavier = TitledCondition("heavier", condition._replace(weight_N=1.1 * condition.weight_N, rho=0.9 * condition.rho))
    performance = flight_performance(model, condition, [heavier], BATTERY) if performs else None
    result = power_curve(polar, condition, flown_CL)
    curve = result.points()
    method = MethodResult(name="direct", title="direct", drag_polar=A.tolist(), power_required=curve)
    standard = condition._replace(rho=1.225)
    return replace(
        template,
        test=ConditionResult(weight_N=condition.weight_N, air_density_kgpm3=condition.rho),
        standard=ConditionResult(weight_N=condition.weight_N, air_density_kgpm3=1.225),
        aircraft=replace(template.aircraft, wing_area_m2=condition.wing_area_m2),
        drag_polar=drag_polar(polar, nexstar),
        curves={Kind.POWER_REQUIRED: curve_result(result, standard, parts=[])},
        battery=BATTERY,
        cross_check=curve,
        slowest_flown=SlowestFlown(
            speed_mps=float(speed_at(flown_CL[1], condition)),
            lift_coefficient=flown_CL[1],
            largest_lift_coefficient=1.1 * flown_CL[1],
        ),
        methods=[method],
        single_runs=[method],
        disagreements=[],
        use=performance,
    )


def test_nothing_names_a_speed_below_the_slowest_flown(results: Results, nexstar, propeller) -> None:
    """Some of them have performance, and some the figures, which take longest."""
    reports = [results_of(seed, results, nexstar, propeller, performs=seed % 5 == 0) for seed in SEEDS]
    assert [result for i, report in enumerate(reports) for result in below_slowest(report, figures=i % 10 == 0)] == []
    assert sum(report.minimum_power_speed.reason is SpeedReason.BELOW_SLOWEST for report in reports) > 10
    assert sum(report.minimum_power_speed.speed_mps is not None for report in reports) > 10
    assert sum(report.use is not None for report in reports) == 10


def test_a_best_speed_that_was_not_flown_is_replaced_by_the_slowest_with_its_margin(
    results: Results, nexstar, propeller
) -> None:
    """The largest lift coefficient is 10 % above that of the slowest speed, or 4.9 % of speed: the margin is at least 4
    %."""
    drawings = (results_of(seed, results, nexstar, propeller) for seed in SEEDS)
    results = next(
        drawing
        for drawing in drawings
        if drawing.minimum_power_speed.reason is SpeedReason.BELOW_SLOWEST
        and drawing.use
        and drawing.use.loadings[0].endurance_at_slowest
    )
    assert results.slowest_flown is not None and results.use is not None
    slowest = results.slowest_flown
    for shown in (results, replace(results, use=None)):
        endurance = headline_answers(shown)[0]
        assert endurance.speed_mps is not None and round(endurance.speed_mps - slowest.speed_mps, 1) == 0
        assert "no slower flight was measured; at least 4 % above the stall. Hold no speed below" in endurance.note
        assert endurance.note.endswith(" 16.0 m/s.")
        at_most = replace(slowest, largest_lift_coefficient=1.004 * slowest.lift_coefficient)
        note = headline_answers(replace(shown, slowest_flown=at_most))[0].note
        assert note.endswith("its margin to the stall is not known.")
    assert f"{slowest.speed_mps:.1f}\u00a0(slowest)" in to_markdown(results, results.use)
