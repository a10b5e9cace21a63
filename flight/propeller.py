"""Thrust and power of a propeller from tables of cT and cP over advance ratio, at several speeds of rotation (3.48).

`Propeller` is physics, written with NumPy functions (floats, arrays and CasADi symbols pass through).
`load_propeller` and the `parse_*` functions read our own CSV, UIUC text tables and APC `PER3` files.
"""

import csv
import io
import re
from dataclasses import dataclass
from importlib import resources
from itertools import pairwise
from pathlib import Path

import numpy as np

from flight.errors import InputError

INCH_M = 0.0254


@dataclass(frozen=True)
class Row:
    """One speed of rotation of a table: cT and cP against J, in ascending J."""

    rpm: float
    J: tuple[float, ...]
    cT: tuple[float, ...]
    cP: tuple[float, ...]


class Propeller:
    """cT(J, rpm) and cP(J, rpm), linear between the table's points.

    Beyond the last J of a row the last segment is continued as a straight line, which takes thrust and power through
    zero into windmilling; below the first J and outside the range of rpm the nearest value is held. `covers` says
    whether a point lies inside the table.
    """

    def __init__(self, name: str, diameter_m: float, rows: tuple[Row, ...], source: str = ""):
        if not rows:
            raise InputError(f"propeller {name}: the table is empty")
        self.name, self.diameter_m, self.source = name, diameter_m, source
        self.rows = tuple(sorted(rows, key=lambda row: row.rpm))
        for row in self.rows:
            if len(row.J) < 2 or np.any(np.diff(row.J) <= 0):
                raise InputError(f"propeller {name}: J must rise through at least two points at {row.rpm:g} rpm")
        self._rpm = np.array([row.rpm for row in self.rows])
        self._knots = sorted({J for row in self.rows for J in row.J[:-1]})
        self._bends = [(_bends(row.J, row.cT), _bends(row.J, row.cP)) for row in self.rows]

    def coefficients(self, J, rpm):
        """(cT, cP) at advance ratio J and speed of rotation `rpm`, elementwise."""
        hinges = {knot: np.maximum(J - knot, 0) for knot in self._knots}  # shared by all rows
        cT, cP = 0.0, 0.0
        for weight, row, (cT_bends, cP_bends) in zip(_hats(rpm, self._rpm), self.rows, self._bends, strict=True):
            cT = cT + weight * _piecewise_linear(hinges, row.cT[0], cT_bends)
            cP = cP + weight * _piecewise_linear(hinges, row.cP[0], cP_bends)
        return cT, cP

    def thrust_and_power(self, V, n, rho):
        """Thrust [N] and shaft power [W] at axial speed V [m/s], n [rev/s], rho [kg/m^3] (3.48).

        n must be positive: a stopped propeller has no advance ratio (see `n_min` of the caller's motor).
        """
        D = self.diameter_m
        cT, cP = self.coefficients(V / (n * D), 60 * n)
        return cT * rho * n**2 * D**4, cP * rho * n**3 * D**5

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
    """A propeller shipped with the package, by name, or one from a file (our CSV, or APC's `PER3`).

    Raises InputError when there is no such propeller or the file cannot be read.
    """
    shipped = resources.files("flight") / "data" / "propellers"
    path = Path(name_or_path)
    if path.suffix == "" and (shipped / f"{name_or_path}.csv").is_file():
        return parse_csv((shipped / f"{name_or_path}.csv").read_text("utf-8"), str(name_or_path))
    if not path.is_file():
        names = sorted(f.name.removesuffix(".csv") for f in shipped.iterdir() if f.name.endswith(".csv"))
        raise InputError(f"propeller {name_or_path}: neither a file nor one of {', '.join(names)}")
    return parse_propeller(path.read_text("utf-8", errors="replace"), path.stem)


def parse_propeller(text: str, name: str) -> Propeller:
    """A propeller from the text of a file in our own format or in APC's."""
    return parse_apc(text, name) if "PROP RPM" in text else parse_csv(text, name)


def parse_csv(text: str, name: str) -> Propeller:
    """Our own format: `# diameter_m = …`, a header `rpm,J,cT,cP`, a line a point."""
    comments = [line.lstrip("# ") for line in text.splitlines() if line.startswith("#")]
    diameter = next(
        (re.match(r"diameter_m\s*=\s*([\d.eE+-]+)", c) for c in comments if c.startswith("diameter_m")), None
    )
    if diameter is None:
        raise InputError(f"propeller {name}: no line `# diameter_m = …`")
    points: dict[float, list[tuple[float, float, float]]] = {}
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    try:
        for entry in csv.DictReader(lines):
            point = (float(entry["J"]), float(entry["cT"]), float(entry["cP"]))
            points.setdefault(float(entry["rpm"]), []).append(point)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"propeller {name}: not a table of rpm,J,cT,cP ({error})") from None
    source = "\n".join(c for c in comments if not c.startswith("diameter_m"))
    return Propeller(name, float(diameter[1]), _rows(points), source)


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
            points.setdefault(rpm, []).append((float(numbers[1]), float(numbers[3]), float(numbers[4])))
    return Propeller(name, float(size[1]) * INCH_M, _rows(points), f"APC {text.split()[0]} computed performance data")


def parse_uiuc(texts: dict[float, str], name: str, diameter_m: float) -> Propeller:
    """UIUC wind-tunnel tables `J CT CP eta`, one text for each speed of rotation [rpm] (it stands in the file name)."""
    points: dict[float, list[tuple[float, float, float]]] = {}
    for rpm, text in texts.items():
        lines = [line.split() for line in text.splitlines() if line.strip()]
        if not lines or lines[0][:3] != ["J", "CT", "CP"]:
            raise InputError(f"propeller {name}: a UIUC table starts with the line `J CT CP eta`")
        points[rpm] = [(float(J), float(cT), float(cP)) for J, cT, cP, *_ in lines[1:]]
    return Propeller(name, diameter_m, _rows(points), "UIUC Propeller Database, wind-tunnel measurement")


def _rows(points: dict[float, list[tuple[float, float, float]]]) -> tuple[Row, ...]:
    rows = []
    for rpm, table in points.items():
        J, cT, cP = zip(*sorted(set(table)), strict=True)
        rows.append(Row(rpm, J, cT, cP))
    return tuple(rows)
