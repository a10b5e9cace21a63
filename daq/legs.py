"""Divides speed into legs while it is measured, like `analysis.maneuvers.find_level`. A run is the changing part of it.

In gusts the slope of speed changes sign every few seconds within a run. A leg continues through that; it ends when
speed has come back by a share of its value and by a share of what the leg gained.
"""

from typing import NamedTuple

OF_SPEED, OF_GAIN = 0.12, 0.25
HELD = 0.05  # speed is held while it is within this share of the leg's first or last speed
HELD_FOR_S = 4.0  # a leg whose fastest or slowest point is this old is judged before it has ended
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
    rows: list[Row]
    ended: bool


class Legs:
    """The turning points of speed in one stretch of rows without a gap."""

    def __init__(self) -> None:
        self.rows: list[Row] = []
        self._direction = self._low = self._high = self._first = 0
        self._told: float | None = None  # speed at the end of the leg that was given before its end

    def add(self, row: Row) -> Leg | None:
        """Adds a row. Returns the leg that ended with it, or in which speed is held now."""
        self.rows.append(row)
        self._forget()
        rows, i, V = self.rows, len(self.rows) - 1, row.V
        self._high = i if V > rows[self._high].V else self._high
        self._low = i if V < rows[self._low].V else self._low
        low, high = rows[self._low].V, rows[self._high].V
        if self._direction == 0:
            if high - low > OF_SPEED * high:
                self._direction = 1 if self._high > self._low else -1
                self._first = self._low if self._direction > 0 else self._high
            return None
        at = self._furthest
        furthest = rows[at].V
        if abs(furthest - V) > max(OF_SPEED * furthest, OF_GAIN * abs(furthest - rows[self._first].V)):
            leg = self._leg(ended=True)
            self._first, self._told = at, None
            self._direction, self._low, self._high = -self._direction, i, i
            return leg
        if row.t_s - rows[at].t_s > HELD_FOR_S and (self._told is None or abs(furthest - self._told) > HELD * furthest):
            self._told = furthest
            return self._leg(ended=False)
        return None

    def end(self) -> Leg | None:
        """The leg that ends with the stretch; None if speed never changed."""
        return self._leg(ended=True) if self._direction else None

    @property
    def _furthest(self) -> int:
        return self._high if self._direction > 0 else self._low

    def _leg(self, *, ended: bool) -> Leg:
        return Leg(self._direction, self.rows[self._first : self._furthest + 1], ended)

    def _forget(self) -> None:
        if len(self.rows) > 2 * KEPT_ROWS:
            dropped = KEPT_ROWS
            del self.rows[:dropped]
            self._first, self._low, self._high = (
                max(0, index - dropped) for index in (self._first, self._low, self._high)
            )


def changing_part(leg: Leg, changing_mps2: float) -> list[Row]:
    """The rows of a leg in which speed changes, without those at either end in which it is held.

    From the last row near the first speed to the first row near the last speed, extended while speed goes on changing.
    """
    rows = leg.rows
    first, last = rows[0].V, rows[-1].V
    begin = max(i for i, row in enumerate(rows) if abs(row.V - first) <= HELD * first)
    end = next(i for i in range(begin, len(rows)) if i == len(rows) - 1 or abs(rows[i].V - last) <= HELD * last)
    while begin > 0 and leg.sign * rows[begin - 1].Vdot > changing_mps2:
        begin -= 1
    while end < len(rows) - 1 and leg.sign * rows[end + 1].Vdot > changing_mps2:
        end += 1
    return rows[begin : end + 1]
