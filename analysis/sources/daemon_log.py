"""What a log of the daemon can give, by the topics that it has."""

from flightpower.flight.log_reader import Log
from flightpower.flight.messages import TOPICS_FOR_DRAG

ELECTRICAL = ("/static", "/battery")
SPEED = ("/probe/airspeed", "/gps")  # one of them


def lacks_drag_topics(log: Log) -> bool:
    """Whether a log of the daemon gives no drag, but electrical power."""
    return not all(map(log.entries.get, TOPICS_FOR_DRAG)) and gives_electrical_power(log)


def gives_electrical_power(log: Log) -> bool:
    """Whether a log has the sensors of an energy balance."""
    return all(map(log.entries.get, ELECTRICAL)) and any(map(log.entries.get, SPEED))
