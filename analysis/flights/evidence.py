"""What contradicts a pool or a comparison: evidence against each flight, and against pooling the flights."""

from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from enum import Enum

from msgspec.structs import replace

from flightpower.analysis.flights.agreement import Compared, LikelyCause, Test, least_p, outlier_level
from flightpower.analysis.flights.flight_statistics import PoolFlight
from flightpower.analysis.records.fleet import Contradiction
from flightpower.analysis.records.flight import Evidence, EvidenceKind, Results, Trust
from flightpower.analysis.results.settings import TRUST
from flightpower.analysis.trajectory.observability import SENSOR_ERROR_KINDS, SensorErrorKind


def against_flights(flights: Sequence[PoolFlight]) -> Iterator[Evidence]:
    """Yield the evidence in each flight's own results, with the flight's name."""
    for flight in flights:
        for evidence in flight.content.evidence:
            yield replace(evidence, log=flight.name)


def against_polars(test: Test | None) -> Iterator[Evidence]:
    """Yield evidence from the test of whether the flights' curves agree; the test is None for a single flight."""
    if test and test.doubtful:
        yield _doubt(EvidenceKind.FLIGHTS_DIFFER, test.p, polars_text(test))


def against_installation(test: Test | None) -> Iterator[Evidence]:
    """Yield evidence from the test of whether the flights share one installation; None if they do not claim to."""
    if test and test.doubtful:
        yield _doubt(EvidenceKind.INSTALLATIONS_DIFFER, test.p, installations_text(test))


def against_thrust(test: Test | None) -> Iterator[Evidence]:
    """Yield evidence from the test of whether both sides of a comparison have the same thrust; None if they may."""
    if test and test.doubtful:
        yield _doubt(EvidenceKind.THRUST_TABLE, test.p, thrust_text(test))


def against_outliers(flights: Sequence[PoolFlight], outliers: Mapping[int, tuple[Compared, str]]) -> Iterator[Evidence]:
    """Yield evidence against flights that differ from all others. outliers: difference and likely reason by number"""
    for i, (compared, reason) in sorted(outliers.items()):
        limit = outlier_level(compared, len(flights), TRUST.false_alarm_rate)
        kind = EvidenceKind.FLIGHTS_DIFFER if compared.p < limit else EvidenceKind.INSTALLATIONS_DIFFER
        text = f"It differs from the other flights: {reason}"
        yield _doubt(kind, least_p(compared), text, log=flights[i].name, limit=limit)


def _doubt(
    kind: EvidenceKind, p: float, text: str, *, log: str = "", limit: float = TRUST.false_alarm_rate
) -> Evidence:
    return Evidence(
        kind=kind,
        level=Trust.DOUBTFUL,
        log=log,
        figure=p,
        limit=limit,
        false_alarm_rate=TRUST.false_alarm_rate,
        text=text,
    )


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
    """Say why a flight is likely to differ from the others."""
    if cause is None:
        return (
            "no sensor or thrust error stands out: weight, rising or sinking air, or something changed on the aircraft"
            " (surface, gear, flaps)?"
        )
    kind = _KINDS[cause.parameter]
    factor, unit = kind.display_unit
    return (
        f"the {kind.title} differs by {factor * cause.difference:+.2g} {unit}, {cause.standard_deviations:.1f} standard"
        f" deviations: {_CAUSES[cause.parameter]}"
    )


def polars_text(test: Test, outliers: Sequence[str] = ()) -> str:
    """Say whether the curves of the flights agree. outliers: names of flights that differ from all others."""
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
    """Say whether the errors of the installation are the same in all flights."""
    if not test.differs:
        return f"The errors of the installation are the same in all flights within their errors (p = {test.p:.2g})."
    if not test.doubtful:
        return (
            f"The errors of the installation may differ between flights (p = {test.p:.2g}): they are pooled as"
            " remounted, and the interval includes this."
        )
    return (
        f"The errors of the installation differ between flights (p = {test.p:.2g}): probe, tubes or tray were moved,"
        " and they are treated as remounted. Give the flights before and after different [installation] names,"
        " or none."
    )


def thrust_text(test: Test) -> str:
    """Return the note for a comparison whose sides differ in thrust although propeller and table are the same."""
    return (
        f"Thrust over that of the propeller's table differs between A and B (p = {test.p:.2g}), though both name one"
        " propeller: its errors do not cancel, and the interval contains them. Check motor speed (pulses, poles),"
        " propeller and stated weight of both."
    )


NOT_NAMED = (
    "The aircraft file has no [installation] name: the probe is treated as remounted for each flight. Give flights"
    " between which nothing was moved one name."
)


# Texts on flights that cannot be from one airframe; `earlier`, `between` and `later` are flights in order of time.
CONTRADICTIONS = {
    Contradiction.SIZE: (
        "{airframe}: {later.name} has another wing area or span than {earlier.name}: two aircraft of one name? Give"
        " each its own."
    ),
    Contradiction.INSTALLATION: (
        "{airframe}: {later.name} names the installation {later.installation!r} of {earlier.name} again, after"
        " {between.name} with {between.installation!r}: if the instruments were remounted, give the installation a new"
        " name; if these are two airframes, name each."
    ),
    Contradiction.FLIGHT: (
        "{airframe}: {later.name} {of_owner}, too (their figures are identical): give each log to one airframe"
        " only, then analyze and add them again."
    ),
}


class SharedErrors(Enum):
    """Which errors two configurations share, so that they cancel in the difference."""

    COMMON_PART = (
        "The files name no installation: the probe is treated as remounted for each flight, and only the common"
        " part of these errors cancels."
    )
    INSTALLATION_AND_PROPELLER = (
        "Errors of installation and propeller table cancel, since both share them and the flights do not contradict it."
    )
    INSTALLATION = (
        "Errors of the installation cancel, since both share it; those of the two propeller tables do not. Power is"
        " drag times airspeed, whatever the propeller's efficiency: which propeller takes less from the battery, the"
        " tables for the field in both reports say."
    )
    NOT_THRUST = "Errors of the installation cancel; those of thrust do not, since the flights show that it differs."
    NEITHER = "No error cancels: the installations differ, and the flights show that thrust also differs."
    PROPELLER = "Errors of the propeller table cancel; those of the two installations do not."
    AIRCRAFT = "Errors of current meter, airspeed, mass and thermometer cancel, since both are of one aircraft."
    NONE = "No error cancels: installations and propellers differ."
    NO_AIRCRAFT = "No error cancels: A and B are of two aircraft or autopilots."


NOT_ONE_VEHICLE = (
    "Errors of current meter, airspeed, mass and thermometer are assumed not to cancel, since A and B were logged by"
    " different autopilots: if only the board was replaced, the interval is wider than necessary."
)


def shape_text(share: float, error: float) -> str:
    """Say why a curve of electrical power is likely to differ. share, error: how far it lies above the others"""
    where = "higher" if share > 0 else "lower"
    return (
        f"its power is {abs(100 * share):.0f} ± {100 * error:.0f} % {where} over the speeds:"
        " weight, propeller, current meter, rising or sinking air, or something changed on the aircraft (surface, gear,"
        " flaps)?"
    )


def one_vehicle(a: Sequence[Results], b: Sequence[Results]) -> bool:
    """Whether the same boards logged both groups of flights; also True if one group's logs identify none."""
    of_a, of_b = ({flight.vehicle for flight in flights if flight.vehicle} for flights in (a, b))
    return not of_a or not of_b or of_a == of_b


def vehicle_notes(flights: Sequence[Results]) -> list[str]:
    """Return a sentence for each name with flights of several boards, and for each board with several names."""
    of_name, of_vehicle = (defaultdict[str, dict[str, list[str]]](lambda: defaultdict(list)) for _ in range(2))
    for results in flights:
        if results.vehicle:
            of_name[results.aircraft.title][results.vehicle].append(results.log)
            of_vehicle[results.vehicle][results.aircraft.title].append(results.log)
    notes = [
        f"{name}: flights of {len(vehicles)} autopilots, {_listed(vehicles)}. Where these are of several aircraft and"
        " no board was exchanged, analyze the logs of each into a folder of its own."
        for name, vehicles in of_name.items()
        if len(vehicles) > 1
    ]
    return notes + [
        f"Autopilot {vehicle}: flights of {len(names)} names, {_listed(names)}. Use one name for one aircraft."
        for vehicle, names in of_vehicle.items()
        if len(names) > 1
    ]


def _listed(logs: dict[str, list[str]]) -> str:
    return "; ".join(f"{name} ({', '.join(of_name)})" for name, of_name in logs.items())


def undated_text(flights: Sequence[PoolFlight]) -> str:
    """Say which flights are left out of changes in time. flights: at least one must be undated"""
    undated = [flight.name for flight in flights if not flight.dated]
    return (
        f"{len(undated)} of {len(flights)} flights have no date ({undated[0]}{', …' if len(undated) > 1 else ''}): they"
        " are left out of changes in time. GPS, or a clock with a battery, dates a log."
    )
