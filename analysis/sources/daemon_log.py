"""Says what results a log of the daemon can give, from the topics that it has."""

from flightpower.flight.log_reader import Log
from flightpower.flight.messages import TOPICS_FOR_DRAG

ELECTRICAL = ("/static", "/battery")
SPEED = ("/probe/airspeed", "/gps")  # topics of which a log needs one


def lacks_drag_topics(log: Log) -> bool:
    """Return whether a log of the daemon lacks topics for drag but gives electrical power."""
    return not all(map(log.entries.get, TOPICS_FOR_DRAG)) and gives_electrical_power(log)


def gives_electrical_power(log: Log) -> bool:
    """Return whether a log has the sensors that an energy balance needs."""
    return all(map(log.entries.get, ELECTRICAL)) and any(map(log.entries.get, SPEED))
