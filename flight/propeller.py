"""Thrust and power of a propeller from tables of cT and cP against advance ratio, at several speeds of rotation (3.48).

The functions accept floats, arrays and CasADi symbols. `flight.propeller_files` reads the tables.
"""

import io
from bisect import bisect_right
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.errors import InputError
from flightpower.flight.number import Number

# The analysis corrects a table's thrust by the factor 1 + thrust_scale + thrust_slope (J - J_REFERENCE).
J_REFERENCE = 0.5
WINDMILL, FOLD = "windmill", "fold"
BEYOND_ZERO_THRUST = (WINDMILL, FOLD)
LEAST_STEP, LARGEST_NUMBER = 1e-9, 1e9  # least step of J and largest number in a table; anything beyond is damage
# Drag areas divided by the square of the diameter. Folded blades lie along the nacelle: two blades of 0.07 by 0.5
# diameters, wetted on both sides, with the friction coefficient of a turbulent plate (0.011; Hoerner, Fluid-Dynamic
# Drag, ch. 2). Blades of a stopped propeller are flat plates across the flow (drag coefficient 1.2; Hoerner ch. 3)
# whose frontal area is half of that blade area: the pitch angle of a model propeller is some 30 deg.
FOLDED_DRAG_AREA = 2 * 2 * 0.07 * 0.5 * 0.011
STANDING_DRAG_AREA = 2 * 0.07 * 0.5 * 0.5 * 1.2
# Relative error (one standard deviation) of the change of cT beyond the table: that of the slope, plus an increase per
# unit of J from the end. If the shipped tables are cut off anywhere below half the static thrust, the line through the
# last segment misses the points that follow by 5 % (rms) at 0.05 beyond the end, 10 % at 0.2 and 12 % at 0.3. Beyond
# zero thrust the blades stall: an element at 3/4 of the radius departs from the line by 10 % at 0.2, 19 % at 0.3 and 35
# % at 0.5.
CONTINUATION_SLOPE_ERROR, CONTINUATION_ERROR_PER_J = 0.05, 0.4


class Origin(StrEnum):
    """Where a table comes from, as the line `# origin = …` of its head says."""

    MEASURED = "measured"
    COMPUTED = "computed"
    ASSUMED = "assumed"  # for simulated aircraft: no real propeller
    UNKNOWN = "not stated"


@dataclass(frozen=True)
class Row:
    """The part of a table at one speed of rotation: cT and cP against J, in ascending J."""

    rpm: float
    J: tuple[float, ...]
    cT: tuple[float, ...]
    cP: tuple[float, ...]


class PropellerModel:
    """Thrust and power from cT and cP as functions of advance ratio and speed of rotation, even beyond zero thrust.

    beyond_zero_thrust: "windmill": the flow drives the blades, thrust and power become negative; "fold": the blades
    fold, thrust is a small friction drag and power is zero.
    """

    diameter_m: Any
    beyond_zero_thrust: str

    def table(self, J: Number, rpm: Number) -> tuple[Number, Number]:
        """(cT, cP) of the unfolded propeller, elementwise. rpm: speed of rotation [1/min]."""
        raise NotImplementedError

    def coefficients(self, J: Number, rpm: Number) -> tuple[Number, Number]:
        """(cT, cP) at advance ratio J [-] and speed of rotation `rpm` [1/min], elementwise; folded blades included."""
        cT, cP = self.table(J, rpm)
        if self.beyond_zero_thrust == FOLD:
            # The drag of a drag area f at dynamic pressure rho V^2/2 corresponds to cT = -J^2/2 f/diameter^2.
            return np.maximum(cT, -FOLDED_DRAG_AREA / 2 * J**2), np.maximum(cP, 0)
        return cT, cP

    def thrust_and_power(self, V: Number, n: Number, rho: Number) -> tuple[Number, Number]:
        """Thrust [N] and shaft power [W] at axial speed V [m/s], n [rev/s], rho [kg/m^3] (3.48).

        Elementwise. n must be positive: a stopped propeller has no advance ratio (see `standing_thrust`).
        """
        D = self.diameter_m
        cT, cP = self.coefficients(V / (n * D), 60 * n)
        return cT * rho * n**2 * D**4, cP * rho * n**3 * D**5

    def standing_thrust(self, V: Number, rho: Number) -> Number:
        """Thrust [N] of the stopped propeller: minus the drag of its blades, elementwise. V [m/s], rho [kg/m^3]."""
        drag_area_ratio = FOLDED_DRAG_AREA if self.beyond_zero_thrust == FOLD else STANDING_DRAG_AREA
        return -rho * V**2 / 2 * drag_area_ratio * self.diameter_m**2


class Propeller(PropellerModel):
    """cT(J, rpm) and cP(J, rpm), linear between the table's points.

    Beyond the last J of a row the last segment is extrapolated linearly, through zero thrust into windmilling. Below
    the first J and outside the range of rpm the nearest value is used. `covers` says whether a point is in the table.
    """

    def __init__(
        self,
        name: str,
        diameter_m: float,
        rows: tuple[Row, ...],
        source: str = "",
        beyond_zero_thrust: str = WINDMILL,
    ):
        if not rows:
            raise InputError(f"propeller {name}: the table is empty")
        if beyond_zero_thrust not in BEYOND_ZERO_THRUST:
            raise InputError(f"propeller {name}: {beyond_zero_thrust!r} is not one of {', '.join(BEYOND_ZERO_THRUST)}")
        self.name, self.diameter_m, self.source = name, diameter_m, source
        self.beyond_zero_thrust = beyond_zero_thrust
        self.rows = tuple(sorted(rows, key=lambda row: row.rpm))
        if not (np.isfinite(diameter_m) and diameter_m > 0):
            raise InputError(f"propeller {name}: a diameter of {diameter_m:g} m is not positive")
        for row in self.rows:
            if not np.all(np.abs([row.rpm, *row.J, *row.cT, *row.cP]) < LARGEST_NUMBER):
                raise InputError(
                    f"propeller {name}: a number at {row.rpm:g} rpm is impossible for a propeller: correct the table"
                )
            if len(row.J) < 2 or np.any(np.diff(row.J) <= LEAST_STEP):
                raise InputError(
                    f"propeller {name}: the row at {row.rpm:g} rpm needs at least two points with ascending J"
                )
        self._rpm = np.array([row.rpm for row in self.rows])
        self._knots = sorted({J for row in self.rows for J in row.J[:-1]})
        self._slope_changes = [(_slope_changes(row.J, row.cT), _slope_changes(row.J, row.cP)) for row in self.rows]
        self._below = np.array([self._knots[0], *self._knots])
        self._lines = np.stack([_lines(row, self._knots) for row in self.rows], axis=1).reshape(4, -1)

    @property
    def head(self) -> dict[str, str]:
        """The values by key of the lines `key = value` in the table's source."""
        return dict(line.split(" = ", 1) for line in self.source.splitlines() if " = " in line)

    @property
    def origin(self) -> Origin:
        """Where the table comes from; UNKNOWN if its header does not say so, or has a word that is not in `Origin`."""
        origin = self.head.get("origin", "")
        return Origin(origin) if origin in set(Origin) else Origin.UNKNOWN

    @property
    def is_thrust_column(self) -> bool:
        """Whether the speed of rotation stands for a thrust: cT is the same everywhere, unlike any propeller's cT."""
        return len({cT for row in self.rows for cT in row.cT}) == 1

    def table(self, J: Number, rpm: Number) -> tuple[Number, Number]:
        if isinstance(J, np.ndarray) and isinstance(rpm, np.ndarray):
            return self._table_of_arrays(J, rpm)
        ramps = {knot: np.maximum(J - knot, 0) for knot in self._knots}  # all rows share these ramps
        cT, cP = 0.0, 0.0
        for weight, row, (cT_changes, cP_changes) in zip(
            _interpolation_weights(rpm, self._rpm), self.rows, self._slope_changes, strict=True
        ):
            cT = cT + weight * _piecewise_linear(ramps, row.cT[0], cT_changes)
            cP = cP + weight * _piecewise_linear(ramps, row.cP[0], cP_changes)
        return cT, cP

    def _table_of_arrays(self, J: Number, rpm: Number) -> tuple[Number, Number]:
        """Evaluate `table` by looking up the cell of each element, in a tenth of the time."""
        J, rpm = np.broadcast_arrays(J, rpm)
        interval = np.searchsorted(self._knots, J, side="right")
        from_knot = J - self._below.take(interval)
        row = np.searchsorted(self._rpm[1:-1], rpm, side="right")
        cell = row * (1 + len(self._knots)) + interval
        weight, next_cell = 0.0, cell
        if len(self.rows) > 1:
            below, above = self._rpm.take(row), self._rpm.take(row + 1)
            weight, next_cell = np.clip((rpm - below) / (above - below), 0, 1), cell + 1 + len(self._knots)

        def interpolated(value: Number, slope: Number) -> Number:
            at_row = value.take(cell) + slope.take(cell) * from_knot
            at_next = value.take(next_cell) + slope.take(next_cell) * from_knot
            return (1 - weight) * at_row + weight * at_next

        cT, cP, cT_slope, cP_slope = self._lines
        return interpolated(cT, cT_slope), interpolated(cP, cP_slope)

    def lines(self) -> tuple[list[float], NDArray[np.float64]]:
        """The knots of J, ascending, and the straight lines between them, (4, rows, 1 + knots): cT, cP and their
        slopes.

        Each line starts at the knot below its interval, except the first line: its interval is below all knots, and it
        starts at the first knot.
        """
        return self._knots, self._lines.reshape(4, len(self.rows), -1)

    def with_beyond_zero_thrust(self, behavior: str) -> "Propeller":
        """Return this table with another behavior beyond zero thrust."""
        return Propeller(self.name, self.diameter_m, self.rows, self.source, behavior)

    def covers(self, J: Number, rpm: Number) -> Number:
        """True where (J, rpm) lies inside the table, without extrapolation; elementwise."""
        J_max = np.interp(rpm, self._rpm, [row.J[-1] for row in self.rows])
        J_min = np.interp(rpm, self._rpm, [row.J[0] for row in self.rows])
        return (J_min <= J) & (J <= J_max) & (self._rpm[0] <= rpm) & (rpm <= self._rpm[-1])

    def continuation_error(self, J: Number, rpm: Number) -> Number:
        """Standard deviation of cT as extrapolated by a straight line beyond the last J of the table; elementwise.

        It grows with the distance from the last J and with its square. It is 0 inside the table and where the blades
        are folded.
        """
        last_J = np.interp(rpm, self._rpm, [row.J[-1] for row in self.rows])
        slope = np.interp(rpm, self._rpm, [(row.cT[-1] - row.cT[-2]) / (row.J[-1] - row.J[-2]) for row in self.rows])
        J_excess = np.maximum(J - last_J, 0)
        error = (CONTINUATION_SLOPE_ERROR + CONTINUATION_ERROR_PER_J * J_excess) * np.abs(slope) * J_excess
        if self.beyond_zero_thrust == FOLD:
            return np.where(self.table(J, rpm)[0] < 0, 0.0, error)
        return error

    def to_csv(self) -> str:
        """Return the table as CSV, which `parse_propeller` reads back without loss."""
        out = io.StringIO()
        for line in self.source.splitlines():
            out.write(f"# {line}\n")
        out.write(f"# diameter_m = {self.diameter_m!r}\nrpm,J,cT,cP\n")
        for row in self.rows:
            for J, cT, cP in zip(row.J, row.cT, row.cP, strict=True):
                out.write(f"{row.rpm:g},{J!r},{cT!r},{cP!r}\n")
        return out.getvalue()


@dataclass(frozen=True)
class TableCell(PropellerModel):
    """One cell of a propeller's table, where cT and cP are bilinear: a + b J + c rpm + d J rpm; extrapolated outside.

    It is cheaper to evaluate than the whole table if the cell of J and rpm is known (see `TableCells`).
    """

    diameter_m: Any
    beyond_zero_thrust: str
    numbers: Any  # a, b, c, d of cT, then a, b, c, d of cP

    def table(self, J: Number, rpm: Number) -> tuple[Number, Number]:
        a, b, c, d, e, f, g, h = self.numbers
        return (a + b * J) + (c + d * J) * rpm, (e + f * J) + (g + h * J) * rpm


CellIndex = tuple[int, int]


class TableCells:
    """All cells of a propeller's table: `index` of the cell around a point, `numbers` for its `TableCell`."""

    def __init__(self, propeller: Propeller):
        self._J, self._rpm = propeller._knots, propeller._rpm.tolist()
        J, rpm = np.array(_spans(self._J)), np.array(_spans(self._rpm))
        self._numbers = _bilinear(propeller, J[:, None, :, None], rpm[None, :, None, :])

    def index(self, J: float, rpm: float) -> CellIndex:
        return bisect_right(self._J, J), bisect_right(self._rpm, rpm)

    def numbers(self, index: CellIndex) -> NDArray[np.float64]:
        """The coefficients of the cell's two bilinear functions, (8,)."""
        numbers: NDArray[np.float64] = self._numbers[index]
        return numbers


def _spans(knots: list[float]) -> list[tuple[float, float]]:
    """The intervals between knots, and one interval beyond each end."""
    return [(knots[0] - 1.0, knots[0]), *pairwise(knots), (knots[-1], knots[-1] + 1.0)]


def _bilinear(propeller: Propeller, J: Number, rpm: Number) -> NDArray[np.float64]:
    """Coefficients (n, m, 8) of the bilinear functions through the table's values at the corners of n times m cells.

    J : (n, 1, 2, 1), rpm : (1, m, 1, 2), the bounds of the cells.
    """
    J, rpm = np.broadcast_arrays(J, rpm)
    corners = np.stack([np.ones(J.shape), J, rpm, J * rpm], axis=-1)
    values = np.stack(propeller.table(J, rpm), axis=-1)
    n, m = values.shape[:2]
    solved = np.linalg.solve(corners.reshape(n, m, 4, 4), values.reshape(n, m, 4, 2))
    return np.ascontiguousarray(solved.swapaxes(2, 3).reshape(n, m, 8))


def _interpolation_weights(x: Number, knots: Number) -> Number:
    """Weights of linear interpolation at x, one for each knot; constant beyond the ends. x may be a CasADi symbol."""
    if len(knots) == 1:
        return [1.0]
    position = 0.0  # position of x on a scale where knot i has the value i
    for low, high in pairwise(knots):
        position = position + np.clip((x - low) / (high - low), 0, 1)
    return [np.maximum(1 - np.abs(position - i), 0) for i in range(len(knots))]


def _slope_changes(knots: tuple[float, ...], values: tuple[float, ...]) -> dict[float, float]:
    """The change of slope at each knot except the last, where the line continues straight."""
    slopes = np.diff(values) / np.diff(knots)
    return dict(zip(knots[:-1], np.diff(slopes, prepend=0.0).tolist(), strict=True))


def _lines(row: Row, knots: list[float]) -> NDArray[np.float64]:
    """The lines of a row, (4, intervals): cT, cP and their slopes, below the first knot and from each knot on."""
    first = np.searchsorted(row.J, knots, side="right") - 1
    segment = np.clip(first, 0, len(row.J) - 2)
    values, slopes = [], []
    for column in (np.array(row.cT), np.array(row.cP)):
        slope = np.where(first >= 0, (np.diff(column) / np.diff(row.J))[segment], 0.0)
        value = column[segment] + slope * (np.array(knots) - np.array(row.J)[segment])
        values.append(np.append(column[0], value))
        slopes.append(np.append(0.0, slope))
    return np.stack([*values, *slopes])


def _piecewise_linear(ramps: Number, first: Number, slope_changes: dict[float, float]) -> Number:
    """Interpolate by a sum of ramps max(x - knot, 0): constant below the first knot, linear beyond the last."""
    result = first
    for knot, change in slope_changes.items():
        result = result + change * ramps[knot]
    return result
