"""Verdicts in words, the methods in the order that the report shows them, and the meanings of parameters."""

from collections.abc import Sequence
from typing import NamedTuple, TypeVar

from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS
from flightpower.analysis.records.flight import Evidence, MethodResult, Results, Trust
from flightpower.analysis.results.evidence import sentences
from flightpower.analysis.trajectory.observability import SENSOR_ERROR_KINDS

T = TypeVar("T")

# For each verdict, its heading and the heading's class in page.css.
VERDICT = {
    Trust.TRUSTED: ("Trusted", "good"),
    Trust.DOUBTFUL: ("Doubtful", "doubt"),
    Trust.NOT_TO_BE_TRUSTED: ("Not to be trusted as it stands", "bad"),
}


class Verdict(NamedTuple):
    """The first lines of a report: heading, its class in page.css, and the evidence, or that there is none."""

    heading: str
    color_class: str
    reasons: list[str]


OF_A_POOL = "No evidence against these flights, nor against pooling them."


def verdict(trust: Trust, evidence: Sequence[Evidence], none: str = OF_A_POOL) -> Verdict:
    """Return the verdict. none: the text if there is no evidence"""
    heading, color_class = VERDICT[trust]
    return Verdict(heading, color_class, sentences(evidence) or [none])


def every(points: Sequence[T], rows: int = 12) -> Sequence[T]:
    """Return about so many points of a curve, for a table on a page."""
    return points[:: max(1, len(points) // rows)]


def listed_methods(results: Results) -> list[MethodResult]:
    """Return all methods; the first is the one whose curve is `results.power_required`."""
    if not any(run.kind in LEVEL_RUNS for run in results.runs):
        polar = results.drag_polar  # without level runs, another method gives the curve
        main = [polar.A0, polar.A1, polar.A2] if polar else []
        return sorted(results.methods, key=lambda m: m.drag_polar != main)
    from_level_runs = (
        MethodResult(
            name="dynamic", title="dynamic, two steps", equations="(3.45), trajectory and forces",
            power_required=results.power_required,
        ),
        MethodResult(
            name="cross-check", title="output error, runs alone", equations="(3.24-3.45)",
            power_required=results.cross_check,
        ),
    )  # fmt: skip
    others = {method.name for method in results.methods}
    return [*(method for method in from_level_runs if method.name not in others), *results.methods]


def capitalized_title(method: MethodResult) -> str:
    return method.title[:1].upper() + method.title[1:]


MEANING = {
    "A0": "drag polar, constant term",
    "A1": "drag polar, linear term",
    "A2": "drag polar, quadratic term",
    "thrust_scale": "thrust over that of the propeller table, less 1, at the reference advance ratio J = 0.5",
    "thrust_slope": "change of this for each 1 of J",
    "static_thrust_ratio": "thrust at rest over that of the propeller table, by flight and stand together",
    "thrust_beyond": "thrust beyond the propeller table, in standard deviations assumed",
    **{name: kind.title for name, kind in SENSOR_ERROR_KINDS.items()},
    "shaft_scale": "shaft power over that of the propeller table",
    "friction": "friction loss of the motor for each rev/s",
    "copper": "resistive loss of the motor for each (N m)² of torque",
    "meter_scale": "relative error of the battery meter",
}
SHORT_NAME = {
    "alpha_bias": "offset of angle of attack",
    "alpha_scale": "slope of angle of attack",
    "pitch": "pitch attitude",
    "airspeed_scale": "airspeed",
    "lag": "air-data lag",
    "thrust_scale": "thrust of the table",
    "thrust_slope": "its change with J",
}


def meaning(parameter: str) -> str:
    """Return the meaning of a parameter; without an entry here, its name in words."""
    return MEANING.get(parameter, parameter.replace("_", " "))


def short_name(error: str) -> str:
    """Return what a method takes as measured, in two or three words."""
    return SHORT_NAME.get(error, error.replace("_", " "))
