"""Sentences about pools and comparisons, made last from what was found."""

from collections.abc import Sequence
from enum import Enum

from analysis.flights.agreement import LikelyCause, Test
from analysis.flights.flight_statistics import FlightStatistics
from analysis.trajectory.observability import SENSOR_ERROR_KINDS, SensorErrorKind

_PROPELLER = "another or a damaged propeller?"
_CAUSES = {
    "alpha_bias": "was the probe or the tray touched?",
    "beta_bias": "was the probe touched?",
    "alpha_scale": "a tube of the probe partly blocked or loose, or another calibration?",
    "V_scale": "a leak or water in the lines of airspeed or static pressure?",
    "air_data_lag": "a tube kinked, exchanged, or with water in it?",
    "thrust_scale": "another or a damaged propeller, or a wrong number of pole pairs?",
    "thrust_slope": _PROPELLER,
    "thrust_beyond": _PROPELLER,
}
_KINDS = SENSOR_ERROR_KINDS | {
    "thrust_scale": SensorErrorKind("scale of thrust", ""),
    "thrust_slope": SensorErrorKind("slope of thrust", ""),
    "thrust_beyond": SensorErrorKind("thrust beyond the propeller's table", ""),
}


def cause_text(cause: LikelyCause | None) -> str:
    """Why a flight is likely to differ from the others."""
    if cause is None:
        return (
            "no sensor or thrust error stands out: weight, rising or sinking air, or something changed on the aircraft"
            " (surface, gear, flaps)?"
        )
    kind = _KINDS[cause.parameter]
    factor, unit = kind.shown
    return (
        f"the {kind.title} differs by {factor * cause.difference:+.2g} {unit}, {cause.standard_deviations:.1f} standard"
        f" deviations: {_CAUSES[cause.parameter]}"
    )


def polars_text(test: Test, outliers: Sequence[str] = ()) -> str:
    """Whether the curves of the flights agree. outliers: names of those that differ from all others."""
    named = f" {' and '.join(outliers)} {'differ' if len(outliers) > 1 else 'differs'} from the others."
    if not test.doubtful:
        agree = f"The curves of the flights agree within their errors (p = {test.p:.2g})"
        return f"{agree}, taken together, but{named}" if outliers else f"{agree}."
    return (
        f"The curves of the flights differ by more than their errors explain (p = {test.p:.2g}): the interval of the"
        f" pooled curve may be too narrow.{named if outliers else ''} Look at the outliers and trends: something"
        " changed between flights, or an error is larger than assumed."
    )


def installations_text(test: Test) -> str:
    """Whether the errors of the installation are the same in all flights."""
    if not test.differs:
        return f"The errors of the installation are the same in all flights within their errors (p = {test.p:.2g})."
    if not test.doubtful:
        return (
            f"The errors of the installation may differ between flights (p = {test.p:.2g}): they are taken to be"
            " mounted anew, which is no doubt but widens the interval."
        )
    return (
        f"The errors of the installation differ between flights (p = {test.p:.2g}): probe, tubes or tray were moved,"
        " and they are taken to be mounted anew. Give the flights before and after different [installation] names,"
        " or none."
    )


NOT_NAMED = (
    "The aircraft file has no [installation] name: the probe is taken to be mounted anew for each flight. Give flights"
    " between which nothing was moved one name."
)


def undated_text(flights: Sequence[FlightStatistics]) -> str:
    """Which of them are left out of changes in time. flights: one without a date, at least"""
    undated = [one.name for one in flights if not one.dated]
    return (
        f"{len(undated)} of {len(flights)} flights have no date ({undated[0]}{', …' if len(undated) > 1 else ''}): they"
        " are left out of changes in time. GPS, or a clock with a battery, dates a log."
    )


class SharedErrors(Enum):
    """Which errors two configurations share, so that they cancel in the difference."""

    COMMON_PART = (
        "The files name no installation: the probe is taken to be mounted anew for each flight, and only the common"
        " part of these errors cancels."
    )
    INSTALLATION_AND_PROPELLER = "Errors of installation and propeller table cancel, since both share them."
    INSTALLATION = "Errors of the installation cancel, since both share it; those of the two propeller tables do not."
    PROPELLER = "Errors of the propeller table cancel; those of the two installations do not."
    AIRCRAFT = "Errors of current meter, airspeed, mass and thermometer cancel, since both are of one aircraft."
    NONE = "No error cancels: installations and propellers differ."
