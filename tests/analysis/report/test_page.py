"""The page's words for results of every kind, without a flight."""

from dataclasses import dataclass

import numpy as np
import pytest

from analysis.drag.polar import Condition, Polar, minimum_power_lift
from analysis.report import page
from analysis.report.answers import headline_answers, optimum_speed_text
from analysis.report.figures.methods import every_method
from analysis.report.figures.power import interval_parts, power_required
from analysis.report.method_list import listed_methods
from analysis.results.curves import optimum
from analysis.results.schema import (
    AircraftResult,
    ConditionResult,
    DisagreementResult,
    DragPolar,
    IntervalPart,
    MethodPoint,
    MethodResult,
    PowerPoint,
    Results,
    RunResult,
    SpeedInterval,
    to_csv,
)


def curve(scale: float = 1.0, dashed_above: float = np.inf) -> list[PowerPoint]:
    return [
        PowerPoint(speed_mps=v, power_W=p, power_lo_W=0.95 * p, power_hi_W=1.05 * p, extrapolated=v > dashed_above)
        for v, p in ((v, scale * (0.011 * v**3 + 330 / v)) for v in np.linspace(12, 24, 13).tolist())
    ]


@pytest.fixture
def results() -> Results:
    """Without battery, full throttle or any use: what is left when the propeller's table does not allow it."""
    run = RunResult(
        kind="acceleration",
        start_s=10,
        end_s=18,
        lowest_speed_mps=12,
        highest_speed_mps=24,
        altitude_change_m=0,
        notes=[],
    )
    steady = MethodResult(
        name="piw-viw", title="PIW-VIW", equations="(2.6)", power_required=curve(1.1),
        points=[MethodPoint(speed_mps=15.0, power_W=60.0, power_lo_W=55.0, power_hi_W=65.0, start_s=100.0)],
        notes=["few points & short"],
    )  # fmt: skip
    failed = MethodResult(name="w-delta", title="W/δ", notes=["no steady points"])
    disagreement = DisagreementResult(
        methods=("dynamic", "piw-viw"), speed_mps=15.0, difference_W=6.0, allowed_W=3.0, culprit="propeller table",
        text="PIW-VIW lies 10 % above: the propeller's table <gives> too much.",
    )  # fmt: skip
    none = SpeedInterval(speed_mps=None, lo_mps=None, hi_mps=None, inside_flown_range=False)
    return Results(
        software_version="0", log="flight.mcap",
        aircraft=AircraftResult(name="n", title="A & B", wing_area_m2=0.46, span_m=1.7, propeller="p"),
        test=ConditionResult(weight_N=37.0, air_density_kgpm3=1.2),
        standard=ConditionResult(weight_N=38.0, air_density_kgpm3=1.225),
        air_temperature_K=290.0, air_pressure_Pa=1e5, runs=[run], rejected=[], parameters=[],
        drag_polar=DragPolar(
            A0=0.045, A1=0.0, A2=0.065, CD0=0.045, K=0.065, CL_minD=0.0, oswald_efficiency=0.75,
            maximum_lift_to_drag=9.2,
        ),
        power_required=curve(dashed_above=20.0), power_required_standard=curve(), cross_check=curve(1.02),
        minimum_power_speed=none,
        best_range_speed=SpeedInterval(speed_mps=13.1, lo_mps=12.8, hi_mps=13.4, inside_flown_range=True),
        verdict="converged", warnings=["mind <this>"], methods=[steady, failed], disagreements=[disagreement],
        interval_parts=[IntervalPart(speed_mps=v, noise_W=1.0, systematic_W=2.0) for v in (12.0, 18.0, 24.0)],
    )  # fmt: skip


@dataclass
class Drawn:
    dashes: set[str]
    names: list[str]


def drawn(figure) -> Drawn:
    lines = [trace for trace in figure.data if trace.line.dash]
    return Drawn({trace.line.dash for trace in lines}, [trace.name for trace in figure.data if trace.showlegend])


def test_without_battery_answers_the_aerodynamic_speeds_are_the_answers(results: Results) -> None:
    (slow, slow_answer, _), (far, far_answer, _) = headline_answers(results)
    assert slow == "Longest endurance" and slow_answer == "not found: the curve has no such point"
    assert far == "Longest range" and far_answer == "13.1 m/s (12.8 to 13.4)"


def test_the_page_says_all_of_it_and_escapes_what_users_wrote(results: Results) -> None:
    pictures = {
        "power": power_required(results),
        "methods": every_method(results),
        "timeline": interval_parts(results),
        "polar": interval_parts(results),
        "parts": interval_parts(results),
    }
    text = page.render(results, pictures, [])
    for said in (
        "A &amp; B",
        "mind &lt;this&gt;",
        "&lt;gives&gt; too much",
        "few points &amp; short",
        "no steady points",
    ):
        assert said in text, said
    assert "no curve" in text, "the method that failed is in the table"
    assert "80 % of its square is the part that all runs share" in text  # 2^2 / (2^2 + 1^2)


def test_a_curve_is_dashed_where_it_is_flagged_and_solid_elsewhere(results: Results) -> None:
    assert drawn(power_required(results)).dashes >= {"solid", "9px,6px"}
    assert drawn(every_method(results)).names[-1] == "Dynamic, two steps", "the leading one lies on top"


def test_the_table_of_the_curve_carries_the_flag(results: Results) -> None:
    header, *rows = [line.split(",") for line in to_csv(results).splitlines()]
    assert header[-1] == "extrapolated"
    flags = {row[3]: row[-1] for row in rows if row[0] == "test"}
    assert flags["12"] == "false" and flags["24"] == "true"


def test_a_flight_of_steady_points_alone_shows_their_methods_alone(results: Results) -> None:
    from msgspec.structs import replace

    steady = replace(results, runs=[replace(results.runs[0], kind="steady")], cross_check=[])
    assert [method.name for method in listed_methods(steady)] == ["piw-viw", "w-delta"]
    polar = steady.drag_polar
    leads = replace(steady.methods[1], drag_polar=[polar.A0, polar.A1, polar.A2])
    assert listed_methods(replace(steady, methods=[steady.methods[0], leads]))[0].name == "w-delta"


def test_a_speed_whose_interval_has_no_lower_end_says_so() -> None:
    """A curve may have its minimum anywhere below: no speed of 0 m/s is claimed."""
    polar = Polar(np.array([0.03, 0.0, 0.004]), np.diag([0.004, 0.01, 0.004]) ** 2)
    at = Condition(37.7, 1.2, 0.46)
    lowest = optimum(minimum_power_lift, polar, at, (0.2, 10.0))
    assert lowest.lo_mps is None and lowest.speed_mps and lowest.hi_mps
    assert optimum_speed_text(lowest) == f"{lowest.speed_mps:.1f} m/s (up to {lowest.hi_mps:.1f})"
