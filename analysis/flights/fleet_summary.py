"""The contents of a fleet's files and figures: builds `fleet.json` from the airframes."""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from datetime import UTC, datetime
from itertools import pairwise

from flightpower.analysis.curve import polar_curve
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.airframes import Airframe, fleet_curve
from flightpower.analysis.flights.changes import Change
from flightpower.analysis.flights.evidence import CONTRADICTIONS, undated_text
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
    """Return tables and figures of a fleet. report_of : gives the address of a flight's page, "" if there is none"""
    kinds: dict[tuple[float, str], list[Airframe]] = defaultdict(list)
    for airframe in fleet:
        kinds[airframe.kind].append(airframe)
    return FleetResults(
        software_version=version(),
        flights=sum(len(airframe.flights) for airframe in fleet),
        airframes=[_airframe(airframe, report_of) for airframe in fleet],
        curves=[
            _curve(of_kind)
            for of_kind in kinds.values()
            if len(of_kind) > 2 and all(isinstance(airframe.pool, JointPool) for airframe in of_kind)
        ],
        contradictions=_contradictions(fleet),
        notes=[
            f"{airframe.name}: {undated_text(airframe.flights)}"
            for airframe in fleet
            if airframe.dated < len(airframe.flights)
        ],
        left_out=list(left_out),
    )


def _contradictions(fleet: Sequence[Airframe]) -> list[ContradictionResult]:
    """Return the first contradiction, by date, of each kind for each airframe."""
    contradictions: list[ContradictionResult] = []
    by_name: dict[str, list[PoolFlight]] = defaultdict(list)
    for airframe in fleet:
        by_name[airframe.name] += airframe.flights
    for name, flights in by_name.items():
        flights.sort(key=lambda flight: (flight.start_unix_s or 0.0, flight.name))
        first = flights[0]
        size = first.aircraft.wing_area_m2, first.aircraft.span_m
        other = next(
            (flight for flight in flights if (flight.aircraft.wing_area_m2, flight.aircraft.span_m) != size), None
        )
        if other:
            contradictions.append(_contradiction(Contradiction.SIZE, name, other, first))
        left: dict[str, FlightStatistics] = {}
        drag = [flight for flight in flights if isinstance(flight, FlightStatistics)]
        dated = [flight for flight in drag if flight.dated and flight.installation]
        for before, flight in pairwise(dated):
            if flight.installation in left:
                kind, earlier = Contradiction.INSTALLATION, left[flight.installation]
                contradictions.append(_contradiction(kind, name, flight, earlier, between=before))
                break
            if flight.installation != before.installation:
                left[before.installation] = before
    return [*contradictions, *_shared_flights(by_name)]


def _shared_flights(by_name: dict[str, list[PoolFlight]]) -> Iterator[ContradictionResult]:
    """Yield a contradiction for each airframe's first flight that also belongs to another airframe."""
    owners: dict[bytes, tuple[str, PoolFlight]] = {}
    for name, flights in by_name.items():
        shared = [flight for flight in flights if owners.setdefault(flight.key, (name, flight))[0] != name]
        if shared:
            owner, earlier = owners[shared[0].key]
            of_owner = f"and {len(shared) - 1} more are flights of {owner}" if shared[1:] else f"is a flight of {owner}"
            yield _contradiction(Contradiction.FLIGHT, name, shared[0], earlier, of_owner=of_owner)


def _contradiction(
    kind: Contradiction, airframe: str, later: PoolFlight, earlier: PoolFlight, **more: object
) -> ContradictionResult:
    text = CONTRADICTIONS[kind].format(airframe=airframe, later=later, earlier=earlier, **more)
    return ContradictionResult(kind=kind, airframe=airframe, log=later.name, earlier_log=earlier.name, text=text)


def _airframe(airframe: Airframe, report_of: Callable[[PoolFlight], str]) -> AirframeResult:
    first, last = airframe.flights[0], airframe.flights[airframe.dated - 1]
    return AirframeResult(
        name=airframe.name,
        title=last.aircraft.title,
        configuration=airframe.configuration,
        kind=airframe.pool.kind,
        installation=first.installation if isinstance(first, FlightStatistics) else "",
        propeller=last.aircraft.propeller,
        flights=len(airframe.flights),
        pooled_flights=len(airframe.pool.flights),
        first_unix_s=first.start_unix_s,
        last_unix_s=last.start_unix_s,
        test=_condition(airframe.pool),
        power_required=airframe.pool.curve.points(),
        trust=trust_by(airframe.pool.evidence),
        evidence=airframe.pool.evidence,
        changes=[_change(airframe, change) for change in airframe.changes],
        history=_history(airframe),
        logs=[
            FleetFlightResult(log=flight.name, start_unix_s=flight.start_unix_s, report=report_of(flight))
            for flight in airframe.flights
        ],
    )


def _history(airframe: Airframe) -> list[FlightShareResult]:
    if airframe.shares is None:
        return []
    percent, half_widths = 100 * airframe.shares.values, 100 * NORMAL_95 * airframe.shares.errors
    rows = zip(airframe.flights, percent.tolist(), half_widths.tolist(), strict=False)
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
    """Return the fleet's curve at the weight and density of the airframe with the most flights in its pool.

    Airframes that have changed are left out of the mean if at least three others remain.
    """
    unchanged = [airframe for airframe in airframes if not airframe.changes]
    in_mean = unchanged if len(unchanged) > 2 else airframes
    curve = fleet_curve(in_mean)
    largest_pool = max(
        (airframe.pool for airframe in in_mean if isinstance(airframe.pool, JointPool)),
        key=lambda pool: len(pool.flights),
    )
    return FleetCurveResult(
        airframes=[airframe.name for airframe in in_mean],
        changed=[airframe.name for airframe in airframes if airframe.changes],
        test=_condition(largest_pool),
        mean=polar_curve(curve.mean, largest_pool.condition, largest_pool.flown_CL).points(),
        another=polar_curve(curve.of_another, largest_pool.condition, largest_pool.flown_CL).points(),
    )


def _change(airframe: Airframe, change: Change) -> ChangeResult:
    since, detected = airframe.flights[change.since], airframe.flights[change.detected]
    drag_error, thrust_error = change.errors
    drag, thrust = 100 * change.drag, 100 * change.thrust
    drag_half, thrust_half = 100 * NORMAL_95 * drag_error, 100 * NORMAL_95 * thrust_error
    message = " and ".join(
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
        found_log=detected.name,
        drag_percent=drag,
        drag_half_width_percent=drag_half,
        thrust_percent=thrust,
        thrust_half_width_percent=thrust_half,
        text=f"{message} {slowly}since {when}{unchanged}",
    )
