"""The smoothed motion of a flight, kept while it is measured and divided into legs of rising and falling speed.

The legs are those of `flight.runs`. In flight a leg is judged before it has ended, once speed is held.
"""

from typing import NamedTuple

from flightpower.flight import runs
from flightpower.flight.runs import LEVEL_RUN

JUDGED_AFTER_S = 4.0  # a leg whose fastest or slowest point is this old is judged before it has ended
GOING_ON_S = 1.0  # gusts let smoothed speed stand still for so long within a run
KEPT_ROWS = 600  # two minutes; what is older is forgotten


class Row(NamedTuple):
    """The smoothed motion at one time, and what was measured then."""

    t_s: float
    V: float  # [m/s]
    Vdot: float  # [m/s^2]
    climb: float  # [m/s]
    bank: float  # [rad]
    height_m: float
    smooth_height_m: float
    complete: bool  # whether everything was measured that drag needs
    drag: tuple[float, float, float, float] | None  # thrust/m [m/s^2], q S/m [m/s^2], C_L, J


class Leg(NamedTuple):
    """Rows from one turning point of speed to the next, or to the furthest one so far. sign: 1 for an acceleration."""

    sign: int
    kind: str
    rows: list[Row]
    ended: bool

    def changing_part(self, changing_mps2: float) -> list[Row]:
        """The rows in which speed changes, without those at either end in which it is held."""
        changing = [self.sign * row.Vdot > changing_mps2 for row in self.rows]
        return self.rows[runs.changing_part([row.V for row in self.rows], changing)]


class Legs:
    """The legs in one stretch of rows without a gap."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self._legs = runs.Legs()
        self._forgotten = 0  # rows
        self._judged_at_mps: float | None = None  # speed at the end of the leg that was given before its end

    def add(self, row: Row) -> Leg | None:
        """Adds a row. Returns the leg that ended with it, or in which speed is held now."""
        self.rows.append(row)
        if len(self.rows) > 2 * KEPT_ROWS:
            del self.rows[:KEPT_ROWS]
            self._forgotten += KEPT_ROWS
        if ended := self._legs.add(row.V):
            self._judged_at_mps = None
            return self._with_rows(ended, ended=True)
        current = self._legs.current()
        if current is None:
            return None
        furthest = self._legs.last_point.V
        held_s = row.t_s - self.rows[self._row_in_list(current.last)].t_s
        judged = self._judged_at_mps
        if held_s > JUDGED_AFTER_S and (judged is None or abs(furthest - judged) > LEVEL_RUN.held_share * furthest):
            self._judged_at_mps = furthest
            return self._with_rows(current, ended=False)
        return None

    def end(self) -> Leg | None:
        """The leg that ends with the stretch; None if speed never changed."""
        last = self._legs.current()
        return self._with_rows(last, ended=True) if last else None

    def going_on(self) -> Leg | None:
        """The leg whose furthest point is not older than a second; None while speed is held or comes back."""
        leg = self._legs.current()
        if leg is None or self.rows[-1].t_s - self.rows[self._row_in_list(leg.last)].t_s > GOING_ON_S:
            return None
        return self._with_rows(leg, ended=False)

    def _row_in_list(self, index: int) -> int:
        """The row of an index, or the oldest row kept."""
        return max(0, index - self._forgotten)

    def _with_rows(self, leg: runs.Leg, *, ended: bool) -> Leg:
        return Leg(leg.sign, leg.kind, self.rows[self._row_in_list(leg.first) : self._row_in_list(leg.last) + 1], ended)
