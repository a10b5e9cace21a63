"""Which flights were logged by one board of an autopilot: whether names and boards of a pool agree.

An aircraft file is often that of a type, and logs of autopilots have no name in them: flights of one name may be of
several aircraft. A board may also have been exchanged, or moved to another aircraft, so that nothing is refused.
"""

from collections import defaultdict
from collections.abc import Sequence

from analysis.schema import ElectricalFlight

NOT_ONE_VEHICLE = (
    "Errors of current meter, airspeed, mass and thermometer are not taken to cancel, since A and B were logged by"
    " different autopilots: where only the board was exchanged, the interval is wider than need be."
)


def one_vehicle(a: Sequence[ElectricalFlight], b: Sequence[ElectricalFlight]) -> bool:
    """Whether the same boards logged both, as far as the logs say which."""
    of_a, of_b = ({one.vehicle for one in flights if one.vehicle} for flights in (a, b))
    return not of_a or not of_b or of_a == of_b


def vehicle_notes(flights: Sequence[ElectricalFlight]) -> list[str]:
    """A sentence for each name with flights of several boards, and for each board with flights of several names."""
    of_name, of_vehicle = (defaultdict[str, dict[str, list[str]]](lambda: defaultdict(list)) for _ in range(2))
    for one in flights:
        if one.vehicle:
            of_name[one.aircraft.title][one.vehicle].append(one.log)
            of_vehicle[one.vehicle][one.aircraft.title].append(one.log)
    notes = [
        f"{name}: flights of {len(vehicles)} autopilots, {_listed(vehicles)}. Where these are of several aircraft and"
        " no board was exchanged, analyze the logs of each into a folder of its own."
        for name, vehicles in of_name.items()
        if len(vehicles) > 1
    ]
    return notes + [
        f"Autopilot {vehicle}: flights of {len(names)} names, {_listed(names)}. Give one aircraft one name."
        for vehicle, names in of_vehicle.items()
        if len(names) > 1
    ]


def _listed(logs: dict[str, list[str]]) -> str:
    return "; ".join(f"{name} ({', '.join(of_name)})" for name, of_name in logs.items())
