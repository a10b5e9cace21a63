"""What is written and drawn of a fleet: `fleet.json` from its airframes."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from itertools import pairwise

from flightpower.analysis.curve import polar_curve
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.airframes import Airframe, fleet_curve
from flightpower.analysis.flights.changes import Change
from flightpower.analysis.flights.evidence import undated_text
from flightpower.analysis.flights.flight_statistics import FlightStatistics, PoolFlight
from flightpower.analysis.flights.joint_pool import JointPool
from flightpower.analysis.flights.pooled import Pool
from flightpower.analysis.records.fleet import (
    AirframeResult,
    ChangeResult,
    Contradiction,
    ContradictionResult,
    FleetCurveResult,
    FleetFlightResult,
    FleetResults,
    FlightShareResult,
    Shape,
    What,
)
from flightpower.analysis.records.flight import ConditionResult
from flightpower.analysis.results.evidence import trust_by
from flightpower.flight.version import version


def fleet_results(
    fleet: Sequence[Airframe], left_out: Sequence[str], report_of: Callable[[PoolFlight], str] = lambda flight: ""
) -> FleetResults:
    """What is written and drawn of a fleet. report_of : the address of a flight's page, "" where there is none"""
    kinds: dict[tuple[float, str], list[Airframe]] = defaultdict(list)
    for one in fleet:
        kinds[one.kind].append(one)
    return FleetResults(
        software_version=version(),
        flights=sum(len(one.flights) for one in fleet),
        airframes=[_airframe(one, report_of) for one in fleet],
        curves=[
            _curve(of_kind)
            for of_kind in kinds.values()
            if len(of_kind) > 2 and all(isinstance(one.pool, JointPool) for one in of_kind)
        ],
        contradictions=_contradictions(fleet),
        notes=[f"{one.name}: {undated_text(one.flights)}" for one in fleet if one.dated < len(one.flights)],
        left_out=list(left_out),
    )


def _contradictions(fleet: Sequence[Airframe]) -> list[ContradictionResult]:
    """The first contradiction of each kind for each airframe, by date."""
    found: list[ContradictionResult] = []
    by_name: dict[str, list[PoolFlight]] = defaultdict(list)
    for airframe in fleet:
        by_name[airframe.name] += airframe.flights
    for name, flights in by_name.items():
        flights.sort(key=lambda one: (one.start_unix_s or 0.0, one.name))
        first = flights[0]
        size = first.aircraft.wing_area_m2, first.aircraft.span_m
        other = next((one for one in flights if (one.aircraft.wing_area_m2, one.aircraft.span_m) != size), None)
        if other:
            said = f"{name}: {other.name} has another wing area or span than {first.name}: two aircraft of one name?"
            found.append(_contradiction(Contradiction.SIZE, name, other, first, f"{said} Give each its own."))
        left: dict[str, FlightStatistics] = {}
        drag = [one for one in flights if isinstance(one, FlightStatistics)]
        dated = [one for one in drag if one.dated and one.installation]
        for before, one in pairwise(dated):
            if one.installation in left:
                earlier = left[one.installation]
                text = (
                    f"{name}: {one.name} names the installation {one.installation!r} of {earlier.name} again,"
                    f" after {before.name} with {before.installation!r}: give what was mounted anew a new name,"
                    " or two airframes their own names."
                )
                found.append(_contradiction(Contradiction.INSTALLATION, name, one, earlier, text))
                break
            if one.installation != before.installation:
                left[before.installation] = before
    return [*found, *_shared_flights(by_name)]


def _shared_flights(by_name: dict[str, list[PoolFlight]]) -> Iterator[ContradictionResult]:
    """The first flight of each airframe that is another airframe's as well."""
    owners: dict[bytes, tuple[str, PoolFlight]] = {}
    for name, flights in by_name.items():
        shared = [one for one in flights if owners.setdefault(one.key, (name, one))[0] != name]
        if shared:
            owner, earlier = owners[shared[0].key]
            more = f" and {len(shared) - 1} more are flights" if len(shared) > 1 else " is a flight"
            text = (
                f"{name}: {shared[0].name}{more} of {owner}, too, equal to the digit: give each log to one airframe,"
                " and analyze and add them again."
            )
            yield _contradiction(Contradiction.FLIGHT, name, shared[0], earlier, text)


def _contradiction(
    kind: Contradiction, airframe: str, later: PoolFlight, earlier: PoolFlight, text: str
) -> ContradictionResult:
    return ContradictionResult(kind=kind, airframe=airframe, log=later.name, earlier_log=earlier.name, text=text)


def _airframe(one: Airframe, report_of: Callable[[PoolFlight], str]) -> AirframeResult:
    first, last = one.flights[0], one.flights[one.dated - 1]
    return AirframeResult(
        name=one.name,
        title=last.aircraft.title,
        configuration=one.configuration,
        kind=one.pool.kind,
        installation=first.installation if isinstance(first, FlightStatistics) else "",
        propeller=last.aircraft.propeller,
        flights=len(one.flights),
        pooled_flights=len(one.pool.flights),
        first_unix_s=first.start_unix_s,
        last_unix_s=last.start_unix_s,
        test=_condition(one.pool),
        power_required=one.pool.curve.points(),
        trust=trust_by(one.pool.evidence),
        evidence=one.pool.evidence,
        changes=[_change(one, change) for change in one.changes],
        history=_history(one),
        logs=[
            FleetFlightResult(log=flight.name, start_unix_s=flight.start_unix_s, report=report_of(flight))
            for flight in one.flights
        ],
    )


def _history(one: Airframe) -> list[FlightShareResult]:
    if one.shares is None:
        return []
    percent, half_widths = 100 * one.shares.values, 100 * NORMAL_95 * one.shares.errors
    rows = zip(one.flights, percent.tolist(), half_widths.tolist(), strict=False)
    return [
        FlightShareResult(
            log=flight.name,
            start_unix_s=flight.start_unix_s,
            drag_percent=drag,
            drag_half_width_percent=drag_half,
            thrust_percent=thrust,
            thrust_half_width_percent=thrust_half,
        )
        for flight, (drag, thrust), (drag_half, thrust_half) in rows
        if flight.start_unix_s is not None and math.isfinite(drag)
    ]


def _condition(pool: Pool) -> ConditionResult:
    return ConditionResult(weight_N=pool.condition.weight_N, air_density_kgpm3=pool.condition.rho)


def _curve(airframes: Sequence[Airframe]) -> FleetCurveResult:
    """The fleet's curve at weight and density of the airframe with the most flights.

    An airframe that has changed is no draw of the others: the mean is of the rest, where three are left.
    """
    unchanged = [one for one in airframes if not one.changes]
    in_mean = unchanged if len(unchanged) > 2 else airframes
    curve = fleet_curve(in_mean)
    at = max((one.pool for one in in_mean if isinstance(one.pool, JointPool)), key=lambda one: len(one.flights))
    return FleetCurveResult(
        airframes=[one.name for one in in_mean],
        changed=[one.name for one in airframes if one.changes],
        test=_condition(at),
        mean=polar_curve(curve.mean, at.condition, at.flown_CL).points(),
        another=polar_curve(curve.of_another, at.condition, at.flown_CL).points(),
    )


def _change(airframe: Airframe, change: Change) -> ChangeResult:
    since, found = airframe.flights[change.since], airframe.flights[change.found]
    drag_error, thrust_error = change.errors
    drag, thrust = 100 * change.drag, 100 * change.thrust
    drag_half, thrust_half = 100 * NORMAL_95 * drag_error, 100 * NORMAL_95 * thrust_error
    said = " and ".join(
        f"{name} {'up' if percent > 0 else 'down'} {abs(percent):.1f} % ± {half:.1f}"
        for name, percent, half, alone in (
            ("drag", drag, drag_half, What.PROPULSION),
            ("thrust", thrust, thrust_half, What.DRAG),
        )
        if change.what is not alone
    )
    when = f"flight {change.since + 1}, {since.name}"
    if since.start_unix_s is not None:
        when = datetime.fromtimestamp(since.start_unix_s, UTC).strftime("%d %B %Y").lstrip("0")
    unchanged = {What.DRAG: ", thrust unchanged", What.PROPULSION: ", drag unchanged", What.BOTH: ""}[change.what]
    slowly = "slowly " if change.shape is Shape.DRIFT else ""
    return ChangeResult(
        what=change.what,
        shape=change.shape,
        since_log=since.name,
        since_unix_s=since.start_unix_s,
        found_log=found.name,
        drag_percent=drag,
        drag_half_width_percent=drag_half,
        thrust_percent=thrust,
        thrust_half_width_percent=thrust_half,
        text=f"{said} {slowly}since {when}{unchanged}",
    )
