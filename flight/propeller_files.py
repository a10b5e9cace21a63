"""Reads propeller tables from files: our own CSV, UIUC text tables and APC `PER3` files, as downloaded.

`python -m flightpower.flight.propeller_files FILE_OR_FOLDER > mine.csv` converts any of them to our own format.
"""

import csv
import re
import sys
from pathlib import Path

import numpy as np

from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller, Row
from flightpower.flight.shipped_propellers import FOLDER, shipped_propellers

INCH_M = 0.0254
LARGEST_INCHES = 40.0  # larger numbers are millimeters, as in UIUC's names of a few small propellers (E-Flite 130x70)
COLUMNS = ("rpm", "J", "cT", "cP")
LARGEST_DIAMETER_M = 3.0  # larger numbers are inches or millimeters
SAME_RPM = 0.01  # relative difference of speeds of rotation below which two tests are put into one row
SIZE = re.compile(r"\d+(\.\d+)?x\d+(\.\d+)?")  # diameter and pitch in inches, within a name
UIUC_NAME = re.compile(r"(?P<name>.+_(?P<size>\d+(?:\.\d+)?)x\d+(?:\.\d+)?[^_]*)_(?P<test>.+)\.txt")


def load_propeller(name_or_path: str | Path) -> Propeller:
    """Load a shipped propeller by its name, or a propeller from files as downloaded.

    A path leads to our CSV, APC's `PER3`, one UIUC table (the propeller's other tables in that folder are read as
    well), or a folder with the UIUC tables of one propeller.
    Raises InputError if there is no such propeller, or a file cannot be read.
    """
    path = Path(name_or_path)
    if str(name_or_path) in shipped_propellers():
        return parse_propeller((FOLDER / f"{name_or_path}.csv").read_text("utf-8"), str(name_or_path))
    if path.is_dir():
        return _load_uiuc(path)
    if not path.is_file():
        size = SIZE.search(str(name_or_path))
        raise InputError(
            f"propeller {name_or_path}: neither a file nor one of those that `flightpower propellers"
            f"{f' {size[0]}' if size else ''}` lists"
        )
    text = _text(path)
    named = UIUC_NAME.fullmatch(path.name)
    if named and _is_uiuc(text):
        return _load_uiuc(path.parent, named["name"])
    return parse_propeller(text, path.stem)


def _text(path: Path) -> str:
    try:
        text = path.read_text("utf-8-sig", errors="replace")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
    if "\0" in text:
        raise InputError(f"{path}: not a text file; give a propeller table as in docs/use/propellers.md")
    return text


def _load_uiuc(folder: Path, name: str = "") -> Propeller:
    """Read all tables of one UIUC propeller in a folder: `apce_10x5_kt0821_5000.txt`, `…_static_….txt`."""
    tests = [(match, path) for path in sorted(folder.glob("*.txt")) if (match := UIUC_NAME.fullmatch(path.name))]
    names = sorted({match["name"] for match, _ in tests if name in ("", match["name"])})
    if not names:
        raise InputError(f"{folder}: no UIUC table here; their names are like apce_10x5_kt0821_5000.txt")
    if len(names) > 1:
        raise InputError(f"{folder}: tables of {', '.join(names)} here; give one file of the propeller that was flown")
    texts: dict[float, str] = {}
    static, size = None, 0.0
    for match, path in tests:
        if match["name"] != names[0]:
            continue
        size = float(match["size"])
        text, rpm = _text(path), re.search(r"_(\d{3,5})$", match["test"])
        if match["test"].startswith("static"):
            static = text
        elif rpm and _is_uiuc(text):
            texts[float(rpm[1])] = text
    return parse_uiuc(texts, names[0], size * INCH_M if size <= LARGEST_INCHES else size / 1000, static)


def _is_uiuc(text: str) -> bool:
    return text.split(maxsplit=3)[:3] == ["J", "CT", "CP"]


def parse_propeller(text: str, name: str) -> Propeller:
    """Read a propeller from the text of a file in our own format or in APC's. Raises InputError for any other text."""
    if _is_uiuc(text):
        raise InputError(
            f"propeller {name}: a UIUC table contains neither diameter nor speed of rotation; convert all its tables by"
            " `python -m flightpower.flight.propeller_files FOLDER > mine.csv`"
        )
    diameter_m, rows, source = _apc_table(text, name) if "PROP RPM" in text else _csv_table(text, name)
    return Propeller(name, diameter_m, rows, source)


def _csv_table(text: str, name: str) -> tuple[float, tuple[Row, ...], str]:
    """Diameter [m], rows and source of our own format: `# diameter_m = …`, a header `rpm,J,cT,cP`, one line per point.

    Raises InputError if the text is not such a table.
    """
    comments = [line.lstrip("# ") for line in text.splitlines() if line.startswith("#")]
    diameter = next((re.match(r"diameter_m\s*=\s*(\S+)", c) for c in comments if c.startswith("diameter_m")), None)
    if diameter is None:
        raise InputError(f"propeller {name}: no line `# diameter_m = …`; docs/use/propellers.md describes the formats")
    try:
        diameter_m = float(diameter[1])
    except ValueError:
        raise InputError(f"propeller {name}: diameter_m = {diameter[1]} is not a number") from None
    if diameter_m > LARGEST_DIAMETER_M:
        raise InputError(
            f"propeller {name}: diameter_m = {diameter[1]} is not that of a small propeller in meters; an inch is"
            " 0.0254 m"
        )
    points: dict[float, list[tuple[float, float, float]]] = {}
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    if lines and (missing := [column for column in COLUMNS if column not in next(csv.reader(lines))]):
        raise InputError(
            f"propeller {name}: not a table of rpm,J,cT,cP: no {', '.join(missing)} in the header {lines[0]!r}"
        )
    try:
        for entry in csv.DictReader(lines):
            point = (float(entry["J"]), float(entry["cT"]), float(entry["cP"]))
            points.setdefault(float(entry["rpm"]), []).append(point)
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"propeller {name}: not a table of rpm,J,cT,cP ({error})") from None
    source = "\n".join(c for c in comments if not c.startswith("diameter_m"))
    return diameter_m, _rows(points), source


def _apc_table(text: str, name: str) -> tuple[float, tuple[Row, ...], str]:
    """Reads APC's computed performance file (`PER3_*.dat`): blocks `PROP RPM = …`, columns V J Pe Ct Cp …"""
    size = re.search(r"^\s*(\d+(?:\.\d+)?)x\d", text)
    if size is None:
        raise InputError(f"propeller {name}: the first line must start with a size such as 12x8E")
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
                raise InputError(
                    f"propeller {name}: a line at {rpm:g} rpm has values that are not numbers: {line.strip()}"
                ) from None
            if np.isfinite(point).all():  # NaN where the computation did not converge
                points.setdefault(rpm, []).append(point)
    return float(size[1]) * INCH_M, _rows(points), f"APC {text.split()[0]} computed performance data\norigin = computed"


def parse_uiuc(texts: dict[float, str], name: str, diameter_m: float, static: str | None = None) -> Propeller:
    """Read UIUC wind-tunnel tables `J CT CP eta`: one text for each speed of rotation [1/min], which the file name
    gives.

    Two tests at one speed of rotation, one at low and one at high J, form one row. static: the table `RPM CT CP`
    measured without wind, which gives rows within its range of speeds their point at J = 0.
    """
    tests = sorted((rpm, _columns(text, ("J", "CT", "CP"), name)) for rpm, text in texts.items())
    static_points = _columns(static, ("RPM", "CT", "CP"), name) if static else []
    points: dict[float, list[tuple[float, float, float]]] = {}
    while tests:
        rpm = tests[0][0]
        same = [test for test in tests if test[0] <= rpm * (1 + SAME_RPM)]
        tests = tests[len(same) :]
        rpm_mean = float(np.mean([speed for speed, _ in same]))
        row = [point for _, table in same for point in table]
        if (
            static_points
            and static_points[0][0] <= rpm_mean * (1 + SAME_RPM)
            and rpm_mean <= static_points[-1][0] * (1 + SAME_RPM)
        ):
            speeds, cT, cP = zip(*static_points, strict=True)
            row.append((0.0, float(np.interp(rpm_mean, speeds, cT)), float(np.interp(rpm_mean, speeds, cP))))
        points[rpm_mean] = row
    return Propeller(
        name, diameter_m, _rows(points), "UIUC Propeller Database, wind-tunnel measurement\norigin = measured"
    )


def _columns(text: str, header: tuple[str, str, str], name: str) -> list[tuple[float, float, float]]:
    lines = [line.split() for line in text.splitlines() if line.strip()]
    if not lines or tuple(lines[0][:3]) != header:
        raise InputError(f"propeller {name}: a UIUC table must start with the line `{' '.join(header)}`")
    try:
        points = [(float(first), float(cT), float(cP)) for first, cT, cP, *_ in lines[1:]]
    except ValueError as error:
        raise InputError(f"propeller {name}: not a UIUC table of {', '.join(header)} ({error})") from None
    if not points:
        raise InputError(f"propeller {name}: the UIUC table has no line of numbers")
    return points


def _rows(points: dict[float, list[tuple[float, float, float]]]) -> tuple[Row, ...]:
    """Make rows in ascending J; repeated measurements at one J are averaged."""
    rows = []
    for rpm, table in points.items():
        coefficients_at_J: dict[float, list[tuple[float, float]]] = {}
        for J, *coefficients in table:
            coefficients_at_J.setdefault(J, []).append((coefficients[0], coefficients[1]))
        means = np.array([(J, *np.mean(coefficients_at_J[J], axis=0)) for J in sorted(coefficients_at_J)])
        rows.append(Row(rpm, *(tuple(column) for column in means.T.tolist())))
    return tuple(rows)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python -m flightpower.flight.propeller_files FILE_OR_FOLDER > mine.csv")
    try:
        print(load_propeller(sys.argv[1]).to_csv(), end="")
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
