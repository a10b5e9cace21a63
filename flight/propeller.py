"""Thrust and power of a propeller from tables of cT and cP over advance ratio, at several speeds of rotation (3.48).

`Propeller` is physics, written with NumPy functions (floats, arrays and CasADi symbols pass through).
`load_propeller` and the `parse_*` functions read our own CSV, UIUC text tables and APC `PER3` files, as downloaded.
`python -m flight.propeller FILE_OR_FOLDER > mine.csv` makes one table in our own format of any of them.
"""

import csv
import io
import re
import sys
from bisect import bisect_right
from dataclasses import dataclass
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from flight.errors import InputError

INCH_M = 0.0254
LARGEST_INCHES = 40.0  # UIUC gives a few small propellers in millimetres (E-Flite 130x70): above this it is those
SAME_RPM = 0.01  # tests of a tunnel at speeds of rotation closer than this are one
UIUC_NAME = re.compile(r"(?P<name>.+_(?P<size>\d+(?:\.\d+)?)x\d+(?:\.\d+)?[^_]*)_(?P<test>.+)\.txt")

WINDMILL, FOLD = "windmill", "fold"
BEYOND_ZERO_THRUST = (WINDMILL, FOLD)
# Drag areas over the square of the diameter. Folded blades lie along the nacelle: two of 0.07 by 0.5 diameters, wetted
# on both sides, with the friction of a turbulent plate (0.011; Hoerner, Fluid-Dynamic Drag, ch. 2). Standing blades are
# flat plates across the flow (drag coefficient 1.2; Hoerner ch. 3) with half of that area in its way: at the pitch of a
# model propeller they stand at some 30 deg.
FOLDED_DRAG = 2 * 2 * 0.07 * 0.5 * 0.011
STANDING_DRAG = 2 * 0.07 * 0.5 * 0.5 * 1.2


@dataclass(frozen=True)
class Row:
    """One speed of rotation of a table: cT and cP against J, in ascending J."""

    rpm: float
    J: tuple[float, ...]
    cT: tuple[float, ...]
    cP: tuple[float, ...]


class PropellerModel:
    """What thrust and power follow from: coefficients over advance ratio and speed of rotation, and what is beyond.

    beyond_zero_thrust: "windmill", the flow pulls back on the blades and drives them; "fold", they fold, and neither
    pull back (but for a little friction) nor drive the motor.
    """

    diameter_m: Any
    beyond_zero_thrust: str

    def table(self, J, rpm):
        """(cT, cP) with the blades open, elementwise."""
        raise NotImplementedError

    def coefficients(self, J, rpm):
        """(cT, cP) at advance ratio J and speed of rotation `rpm`, elementwise."""
        cT, cP = self.table(J, rpm)
        if self.beyond_zero_thrust == FOLD:
            # A drag D = q f is cT = -J^2 f / (2 D^2).
            return np.maximum(cT, -FOLDED_DRAG / 2 * J**2), np.maximum(cP, 0)
        return cT, cP

    def thrust_and_power(self, V, n, rho):
        """Thrust [N] and shaft power [W] at axial speed V [m/s], n [rev/s], rho [kg/m^3] (3.48).

        n must be positive: a stopped propeller has no advance ratio (see `standing_thrust`).
        """
        D = self.diameter_m
        cT, cP = self.coefficients(V / (n * D), 60 * n)
        return cT * rho * n**2 * D**4, cP * rho * n**3 * D**5

    def standing_thrust(self, V, rho):
        """Thrust [N] of the propeller when it stands: minus the drag of its blades, elementwise."""
        share = FOLDED_DRAG if self.beyond_zero_thrust == FOLD else STANDING_DRAG
        return -rho * V**2 / 2 * share * self.diameter_m**2


class Propeller(PropellerModel):
    """cT(J, rpm) and cP(J, rpm), linear between the table's points.

    Beyond the last J of a row the last segment is continued as a straight line, which takes thrust and power through
    zero into windmilling; below the first J and outside the range of rpm the nearest value is held. `covers` says
    whether a point lies inside the table.
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
            raise InputError(f"propeller {name}: a diameter of {diameter_m:g} m is none")
        for row in self.rows:
            if not np.isfinite([row.rpm, *row.J, *row.cT, *row.cP]).all():
                raise InputError(f"propeller {name}: not a number at {row.rpm:g} rpm")
            if len(row.J) < 2 or np.any(np.diff(row.J) <= 0):
                raise InputError(f"propeller {name}: J must rise through at least two points at {row.rpm:g} rpm")
        self._rpm = np.array([row.rpm for row in self.rows])
        self._knots = sorted({J for row in self.rows for J in row.J[:-1]})
        self._bends = [(_bends(row.J, row.cT), _bends(row.J, row.cP)) for row in self.rows]

    def table(self, J, rpm):
        hinges = {knot: np.maximum(J - knot, 0) for knot in self._knots}  # shared by all rows
        cT, cP = 0.0, 0.0
        for weight, row, (cT_bends, cP_bends) in zip(_hats(rpm, self._rpm), self.rows, self._bends, strict=True):
            cT = cT + weight * _piecewise_linear(hinges, row.cT[0], cT_bends)
            cP = cP + weight * _piecewise_linear(hinges, row.cP[0], cP_bends)
        return cT, cP

    def beyond(self, behaviour: str) -> "Propeller":
        """The same table with another behaviour beyond zero thrust."""
        return Propeller(self.name, self.diameter_m, self.rows, self.source, behaviour)

    def covers(self, J, rpm):
        """True where (J, rpm) lies inside the table, so that nothing was held or continued; elementwise."""
        J_max = np.interp(rpm, self._rpm, [row.J[-1] for row in self.rows])
        J_min = np.interp(rpm, self._rpm, [row.J[0] for row in self.rows])
        return (J_min <= J) & (J <= J_max) & (self._rpm[0] <= rpm) & (rpm <= self._rpm[-1])

    def to_csv(self) -> str:
        """The table in our own format; `parse_csv` gives back the same propeller."""
        out = io.StringIO()
        for line in self.source.splitlines():
            out.write(f"# {line}\n")
        out.write(f"# diameter_m = {self.diameter_m!r}\nrpm,J,cT,cP\n")
        for row in self.rows:
            for J, cT, cP in zip(row.J, row.cT, row.cP, strict=True):
                out.write(f"{row.rpm:g},{J!r},{cT!r},{cP!r}\n")
        return out.getvalue()


@dataclass(frozen=True)
class Cell(PropellerModel):
    """One cell of a propeller's table, where cT and cP are bilinear: (a + b J) + (c + d J) rpm; beyond it, continued.

    A few products instead of the whole table, for whoever knows in which cell J and rpm are (see `Cells`).
    """

    diameter_m: Any
    beyond_zero_thrust: str
    numbers: Any  # a, b, c, d of cT, then of cP

    def table(self, J, rpm):
        a, b, c, d, e, f, g, h = self.numbers
        return (a + b * J) + (c + d * J) * rpm, (e + f * J) + (g + h * J) * rpm


Place = tuple[int, int]


class Cells:
    """All cells of a propeller's table: `place` finds the one around a point, `numbers` those of `Cell`."""

    def __init__(self, propeller: Propeller):
        self._J, self._rpm = propeller._knots, propeller._rpm.tolist()
        J, rpm = np.array(_spans(self._J)), np.array(_spans(self._rpm))
        self._numbers = _bilinear(propeller, J[:, None, :, None], rpm[None, :, None, :])

    def place(self, J: float, rpm: float) -> Place:
        return bisect_right(self._J, J), bisect_right(self._rpm, rpm)

    def numbers(self, place: Place) -> NDArray[np.float64]:
        """(8,)."""
        return self._numbers[place]


def _spans(knots: list[float]) -> list[tuple[float, float]]:
    """The intervals between knots, and one beyond either end."""
    return [(knots[0] - 1.0, knots[0]), *pairwise(knots), (knots[-1], knots[-1] + 1.0)]


def _bilinear(propeller: Propeller, J, rpm) -> NDArray[np.float64]:
    """Numbers (n, m, 8) of the bilinear functions through the table's values at the corners of n times m cells.

    J : (n, 1, 2, 1), rpm : (1, m, 1, 2), the sides of the cells.
    """
    J, rpm = np.broadcast_arrays(J, rpm)
    corners = np.stack([np.ones(J.shape), J, rpm, J * rpm], axis=-1)
    values = np.stack(propeller.table(J, rpm), axis=-1)
    n, m = values.shape[:2]
    solved = np.linalg.solve(corners.reshape(n, m, 4, 4), values.reshape(n, m, 4, 2))
    return np.ascontiguousarray(solved.swapaxes(2, 3).reshape(n, m, 8))


def _hats(x, knots):
    """Weights of linear interpolation, one for each knot; held at the ends. x may be a symbol."""
    if len(knots) == 1:
        return [1.0]
    position = 0.0  # of x on a scale where knot i stands at i
    for low, high in pairwise(knots):
        position = position + np.clip((x - low) / (high - low), 0, 1)
    return [np.maximum(1 - np.abs(position - i), 0) for i in range(len(knots))]


def _bends(knots: tuple[float, ...], values: tuple[float, ...]) -> dict[float, float]:
    """By how much the slope changes at each knot but the last, beyond which it stays."""
    slopes = np.diff(values) / np.diff(knots)
    return dict(zip(knots[:-1], np.diff(slopes, prepend=0.0).tolist(), strict=True))


def _piecewise_linear(hinges, first, bends: dict[float, float]):
    """Linear interpolation as a sum of hinges max(x - knot, 0); held below the first knot, continued above the last."""
    result = first
    for knot, bend in bends.items():
        result = result + bend * hinges[knot]
    return result


def load_propeller(name_or_path: str | Path) -> Propeller:
    """A propeller shipped with the package, by name, or one from files as they are downloaded.

    A file is our CSV, APC's `PER3`, or any of a propeller's UIUC tables, whose siblings are read along with it; so is a
    folder with the UIUC tables of one propeller.
    Raises InputError when there is no such propeller or a file cannot be read.
    """
    shipped = resources.files("flight") / "data" / "propellers"
    path = Path(name_or_path)
    if path.suffix == "" and (shipped / f"{name_or_path}.csv").is_file():
        return parse_csv((shipped / f"{name_or_path}.csv").read_text("utf-8"), str(name_or_path))
    if path.is_dir():
        return _load_uiuc(path)
    if not path.is_file():
        names = sorted(f.name.removesuffix(".csv") for f in shipped.iterdir() if f.name.endswith(".csv"))
        raise InputError(f"propeller {name_or_path}: neither a file nor one of {', '.join(names)}")
    text = _text(path)
    named = UIUC_NAME.fullmatch(path.name)
    if named and _is_uiuc(text):
        return _load_uiuc(path.parent, named["name"])
    return parse_propeller(text, path.stem)


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None


def _load_uiuc(folder: Path, name: str = "") -> Propeller:
    """All tables of one propeller of the UIUC database in a folder: `apce_10x5_kt0821_5000.txt`, `…_static_….txt`."""
    tests = [(found, path) for path in sorted(folder.glob("*.txt")) if (found := UIUC_NAME.fullmatch(path.name))]
    names = sorted({found["name"] for found, _ in tests if name in ("", found["name"])})
    if not names:
        raise InputError(f"{folder}: holds no UIUC tables, which are named like apce_10x5_kt0821_5000.txt")
    if len(names) > 1:
        raise InputError(f"{folder}: holds tables of {', '.join(names)}; give one file of the one that was flown")
    texts: dict[float, str] = {}
    static, size = None, 0.0
    for found, path in tests:
        if found["name"] != names[0]:
            continue
        size = float(found["size"])
        text, rpm = _text(path), re.search(r"_(\d{3,5})$", found["test"])
        if found["test"].startswith("static"):
            static = text
        elif rpm and _is_uiuc(text):
            texts[float(rpm[1])] = text
    return parse_uiuc(texts, names[0], size * INCH_M if size <= LARGEST_INCHES else size / 1000, static)


def _is_uiuc(text: str) -> bool:
    return text.split(maxsplit=3)[:3] == ["J", "CT", "CP"]


def parse_propeller(text: str, name: str) -> Propeller:
    """A propeller from the text of one file, in our own format or in APC's."""
    if _is_uiuc(text):
        raise InputError(
            f"propeller {name}: one UIUC table alone says neither diameter nor speed of rotation; make one table of all"
            " of them by `python -m flight.propeller FOLDER > mine.csv`"
        )
    return parse_apc(text, name) if "PROP RPM" in text else parse_csv(text, name)


def parse_csv(text: str, name: str) -> Propeller:
    """Our own format: `# diameter_m = …`, a header `rpm,J,cT,cP`, a line a point."""
    comments = [line.lstrip("# ") for line in text.splitlines() if line.startswith("#")]
    diameter = next((re.match(r"diameter_m\s*=\s*(\S+)", c) for c in comments if c.startswith("diameter_m")), None)
    if diameter is None:
        raise InputError(f"propeller {name}: no line `# diameter_m = …`")
    try:
        diameter_m = float(diameter[1])
    except ValueError:
        raise InputError(f"propeller {name}: diameter_m = {diameter[1]} is not a number") from None
    points: dict[float, list[tuple[float, float, float]]] = {}
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    try:
        for entry in csv.DictReader(lines):
            point = (float(entry["J"]), float(entry["cT"]), float(entry["cP"]))
            points.setdefault(float(entry["rpm"]), []).append(point)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"propeller {name}: not a table of rpm,J,cT,cP ({error})") from None
    source = "\n".join(c for c in comments if not c.startswith("diameter_m"))
    return Propeller(name, diameter_m, _rows(points), source)


def parse_apc(text: str, name: str) -> Propeller:
    """APC's computed performance file (`PER3_*.dat`): blocks headed `PROP RPM = …`, columns V J Pe Ct Cp …"""
    size = re.search(r"^\s*(\d+(?:\.\d+)?)x\d", text)
    if size is None:
        raise InputError(f"propeller {name}: the first line does not start with a size such as 12x8E")
    points: dict[float, list[tuple[float, float, float]]] = {}
    rpm = None
    for line in text.splitlines():
        heading = re.match(r"\s*PROP RPM\s*=\s*([\d.]+)", line)
        if heading:
            rpm = float(heading[1])
            continue
        numbers = line.split()
        if rpm is not None and len(numbers) >= 8 and re.fullmatch(r"[\d.]+", numbers[0]):
            try:
                point = (float(numbers[1]), float(numbers[3]), float(numbers[4]))
            except ValueError:
                raise InputError(f"propeller {name}: not numbers at {rpm:g} rpm: {line.strip()}") from None
            if np.isfinite(point).all():  # the computation did not converge where it prints NaN
                points.setdefault(rpm, []).append(point)
    return Propeller(name, float(size[1]) * INCH_M, _rows(points), f"APC {text.split()[0]} computed performance data")


def parse_uiuc(texts: dict[float, str], name: str, diameter_m: float, static: str | None = None) -> Propeller:
    """UIUC wind-tunnel tables `J CT CP eta`, one text for each speed of rotation [rpm] (it stands in the file name).

    Two tests at one speed of rotation, one at low and one at high J, make one row. static : the table `RPM CT CP`
    measured without wind, which gives the rows that lie within its speeds their point at J = 0.
    """
    tests = sorted((rpm, _columns(text, ("J", "CT", "CP"), name)) for rpm, text in texts.items())
    still = _columns(static, ("RPM", "CT", "CP"), name) if static else []
    points: dict[float, list[tuple[float, float, float]]] = {}
    while tests:
        rpm = tests[0][0]
        same = [test for test in tests if test[0] <= rpm * (1 + SAME_RPM)]
        tests = tests[len(same) :]
        at = float(np.mean([speed for speed, _ in same]))
        row = [point for _, table in same for point in table]
        if still and still[0][0] <= at * (1 + SAME_RPM) and at <= still[-1][0] * (1 + SAME_RPM):
            speeds, cT, cP = zip(*still, strict=True)
            row.append((0.0, float(np.interp(at, speeds, cT)), float(np.interp(at, speeds, cP))))
        points[at] = row
    return Propeller(name, diameter_m, _rows(points), "UIUC Propeller Database, wind-tunnel measurement")


def _columns(text: str, header: tuple[str, str, str], name: str) -> list[tuple[float, float, float]]:
    lines = [line.split() for line in text.splitlines() if line.strip()]
    if not lines or tuple(lines[0][:3]) != header:
        raise InputError(f"propeller {name}: a UIUC table starts with the line `{' '.join(header)}`")
    try:
        points = [(float(first), float(cT), float(cP)) for first, cT, cP, *_ in lines[1:]]
    except ValueError as error:
        raise InputError(f"propeller {name}: not a UIUC table of {', '.join(header)} ({error})") from None
    if not points:
        raise InputError(f"propeller {name}: a UIUC table without a line of numbers")
    return points


def _rows(points: dict[float, list[tuple[float, float, float]]]) -> tuple[Row, ...]:
    """Rows in ascending J; what was measured twice at one J is averaged."""
    rows = []
    for rpm, table in points.items():
        at: dict[float, list[tuple[float, float]]] = {}
        for J, *coefficients in table:
            at.setdefault(J, []).append((coefficients[0], coefficients[1]))
        means = np.array([(J, *np.mean(at[J], axis=0)) for J in sorted(at)])
        rows.append(Row(rpm, *(tuple(column) for column in means.T.tolist())))
    return tuple(rows)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m flight.propeller FILE_OR_FOLDER > mine.csv")
    try:
        print(load_propeller(sys.argv[1]).to_csv(), end="")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
