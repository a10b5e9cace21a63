"""Computes the curve by another method, to be drawn next to the report's curve if the flight allows that method."""

from flightpower.analysis.curve import Condition
from flightpower.analysis.flight import Reconstructed
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods import likelihood
from flightpower.analysis.methods.method import MethodDescription, MethodEstimate
from flightpower.analysis.methods.methods import ALL_METHODS, one_method
from flightpower.analysis.methods.whole_flight.method import WHOLE_FLIGHT, whole_flight
from flightpower.analysis.records.flight import MethodResult
from flightpower.analysis.results.assemble import method_result
from flightpower.flight.errors import InputError

METHODS: dict[str, MethodDescription] = {
    method.name: method for method in (*ALL_METHODS, WHOLE_FLIGHT, *likelihood.METHODS)
}


def listed(runs: list[Maneuver], headline: str) -> list[dict[str, str]]:
    """Return name and title of each method but the report's; missing : kinds of runs, if none of these was flown."""
    flown = {run.kind for run in runs}
    return [
        {
            "name": name,
            "title": f"{method.title} (takes longer)" if by_likelihood(name) else method.title,
            "missing": "" if not method.kinds or flown & set(method.kinds) else " or ".join(method.kinds),
        }
        for name, method in METHODS.items()
        if name != headline
    ]


def method_curve(flight: Reconstructed, name: str, condition: Condition, largest_CL: float) -> MethodResult:
    """Return a method's curve. largest_CL : of the report's curve. Raises InputError for an unknown name."""
    if name not in METHODS:
        raise InputError(f"{name[:60]!r}: no such method; there are {', '.join(METHODS)}")
    return method_result(_estimate(flight, METHODS[name]), condition, largest_CL)


def by_likelihood(name: str) -> bool:
    """Whether `analyze` applies the method only on request."""
    return name in {method.name for method in likelihood.METHODS}


def _estimate(flight: Reconstructed, method: MethodDescription) -> MethodEstimate:
    if method is WHOLE_FLIGHT:
        return whole_flight(flight).method
    if by_likelihood(method.name):
        return likelihood.estimate(flight, (method,)).methods[0]
    maneuvers = flight.maneuvers.maneuvers
    return one_method(method.name, flight.trajectory, maneuvers, flight.aircraft, flight.propeller)
