"""Measures how much of a tick a bus needs, and advises what to do when it needs too much."""

from collections import deque
from collections.abc import Mapping

from flightpower.flight.messages import Event

READINGS = 25  # readings of the whole bus to find its need; a longer series of too great a need is reported
NEED_RANK = 22  # rank among the sorted durations: a tenth of the readings take longer
SLOW_FRACTION, FAST_FRACTION = 0.75, 0.65  # of a tick: a bus above the first is slow until it is below the second
MOVED_FRACTION = 0.5  # the advice moves sensors until the rest needs less than this fraction of a tick


class BusLoad:
    """The time that a bus needs in a tick: nine of ten of its latest readings take no longer. name: of the bus."""

    def __init__(self, name: str, period_ns: int):
        self._name, self._period_ns = name, period_ns
        self._latest: deque[Mapping[str, int]] = deque(maxlen=READINGS)
        self._totals_ns: deque[int] = deque(maxlen=READINGS)  # total durations of the same readings
        self._fast_in_a_row = 0
        self._above = 0  # number of successive readings with too great a need
        self.slow = ""  # advice in one clause; empty while the bus is fast enough

    def add(self, durations_ns: Mapping[str, int]) -> list[Event]:
        """Take the durations of one reading, by sensor. Returns an event when the bus becomes slow or fast enough."""
        total_ns = sum(durations_ns.values())
        self._latest.append(durations_ns)
        self._totals_ns.append(total_ns)
        self._fast_in_a_row = self._fast_in_a_row + 1 if total_ns <= SLOW_FRACTION * self._period_ns else 0
        if len(self._latest) < READINGS or (self._fast_in_a_row >= READINGS and not self.slow and not self._above):
            return []
        need_ns = sorted(self._totals_ns)[NEED_RANK]
        was_slow = bool(self.slow)
        if need_ns > (FAST_FRACTION if was_slow else SLOW_FRACTION) * self._period_ns:
            self._above += 1
            self.slow = self._advice(need_ns) if self._above > READINGS else ""
            return [Event(severity="warning", sensor="daq", text=self.slow)] if self.slow and not was_slow else []
        self._above, self.slow = 0, ""
        text = f"{self._name} needs {_ms(need_ns)} ms of {_ms(self._period_ns)}: fast enough again"
        return [Event(sensor="daq", text=text)] if was_slow else []

    def _advice(self, need_ns: int) -> str:
        """Name the slowest sensors, as many as must be moved."""
        names = self._latest[-1]
        means = {name: sum(each.get(name, 0) for each in self._latest) / READINGS for name in names}
        moved: list[str] = []
        rest_ns: float = need_ns
        for name, sensor_ns in sorted(means.items(), key=lambda item: -item[1]):
            if rest_ns < MOVED_FRACTION * self._period_ns:
                break
            moved.append(name)
            rest_ns -= sensor_ns
        return (
            f"{self._name} needs {_ms(need_ns)} ms of {_ms(self._period_ns)}: raise i2c_arm_baudrate, "
            f"or move {' and '.join(moved)} to another bus"
        )


def _ms(duration_ns: float) -> str:
    return f"{duration_ns / 1e6:.0f}"
