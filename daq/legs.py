"""Keeps the smoothed motion of a flight as it is measured, and divides it into legs of rising and falling speed.

The legs are those of `flight.runs`. In flight a leg is judged even before it ends, once speed is held.
"""

from typing import NamedTuple

from flightpower.flight import runs
from flightpower.flight.runs import LEVEL_RUN

JUDGED_AFTER_S = 4.0  # a leg whose last extreme of speed is this old is judged before it ends
GOING_ON_S = 1.0  # gusts can hold smoothed speed constant for this long within a run
KEPT_ROWS = 600  # two minutes; older rows are discarded


class Row(NamedTuple):
    """The smoothed motion at one time, and whether all needed quantities were measured."""

    t_s: float
    V: float  # [m/s]
    Vdot: float  # [m/s^2]
    climb: float  # [m/s]
    bank: float  # [rad]
    height_m: float
    smooth_height_m: float
    complete: bool  # whether all quantities that drag requires were measured
    drag: tuple[float, float, float, float] | None  # thrust/m [m/s^2], q S/m [m/s^2], C_L, J


class Leg(NamedTuple):
    """Rows from one turning point of speed to the next, or to the extreme so far. sign: as in `flight.runs.Leg`."""

    sign: int
    kind: str
    rows: list[Row]
    ended: bool

    def changing_part(self, changing_mps2: float) -> list[Row]:
        """The rows in which speed changes, without the rows at either end in which it is held."""
        changing = [self.sign * row.Vdot > changing_mps2 for row in self.rows]
        return self.rows[runs.changing_part([row.V for row in self.rows], changing)]


class Legs:
    """The legs in one stretch of rows without a gap."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self._legs = runs.Legs()
        self._forgotten = 0  # number of rows discarded
        self._judged_at_mps: float | None = None  # last speed of a leg that was returned before it ended

    def add(self, row: Row) -> Leg | None:
        """Add a row. Returns the leg that it ends, or a leg in which speed is now held."""
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
        """Return the leg that ends with the stretch; None if speed never changed."""
        last = self._legs.current()
        return self._with_rows(last, ended=True) if last else None

    def going_on(self) -> Leg | None:
        """The leg whose extreme of speed is at most a second old; None while speed is held or returns."""
        leg = self._legs.current()
        if leg is None or self.rows[-1].t_s - self.rows[self._row_in_list(leg.last)].t_s > GOING_ON_S:
            return None
        return self._with_rows(leg, ended=False)

    def _row_in_list(self, index: int) -> int:
        """The position of a row in the list of rows kept, or the position of the oldest."""
        return max(0, index - self._forgotten)

    def _with_rows(self, leg: runs.Leg, *, ended: bool) -> Leg:
        return Leg(leg.sign, leg.kind, self.rows[self._row_in_list(leg.first) : self._row_in_list(leg.last) + 1], ended)
