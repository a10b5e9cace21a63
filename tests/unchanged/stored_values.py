"""Condenses the numbers and names of a result to a few storable lines, and reports changes since they were stored.

    python -m tests.unchanged                     # renews the stored references, tests/data/unchanged/*.json
    python -m tests.unchanged plans               # only that one
    python -m tests.unchanged --exact A           # instead writes every number in full into the folder A
    python -m tests.unchanged --compare A B       # to 1e-9: of two checkouts, on one computer

An array becomes its length, mean, root mean square, first and last element; records of equal names become one array a
name. Of texts only quantities (a number and a unit) and names are stored, such as statuses, kinds and units: one or
two words that begin with no digit. No sentence is: it may be written better at any time.
"""

import csv
import dataclasses
import enum
import json
import math
import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd

REFERENCES = Path(__file__).parents[1] / "data" / "unchanged"
# Rounding of another computer, relative to a number, the largest of its interval, or the root mean square of its array.
RELATIVE = 3e-5
EXACT = 1e-9  # on the same computer
ESTIMATE = ("value", "lo", "hi")  # with its interval
SHORT = 4  # an array of at most so many numbers is stored as it is
NUMBER = r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?"
QUANTITY = re.compile(rf"({NUMBER})(?:\s+([^\s\d]\S*))?")
NAME = re.compile(r"[^\W\d]\S*(?: [^\W\d]\S*)?(?<![.,:;])|[%°]")
HASH = re.compile(r"[0-9a-f]{12,}")
VERSION = re.compile(r"\bsoftware \S+")
FIGURE = re.compile(r"<script>figures\[(\".*?\")\] = \{data: (.*), layout: .*\};</script>")
# What another computer, folder or version may change without a change of any result.
LEFT_OUT = {"software_version", "versions", "probe_calibration", "log_sha256", "log_bytes"}

Leaf = float | str | None | list[float | None]


def condensed(value: object) -> dict[str, Leaf]:
    """Numbers and names by their path, such as power_required.speed_mps, arrays as their moments."""
    return {path: _short(leaf) for path, leaf in _leaves(value).items()}


def in_full(value: object) -> dict[str, Leaf]:
    """Leaves with all numbers of all arrays."""
    return {path: _full(leaf) for path, leaf in _leaves(value).items()}


def of_files(folder: Path) -> dict[str, object]:
    """What the files of a folder contain, by name: JSON, TOML, tables, and figures of pages."""
    read = {".json": _json, ".plan": _json, ".toml": _toml, ".csv": _csv, ".parquet": pd.read_parquet,
            ".html": _page, ".waypoints": _waypoints}  # fmt: skip
    return {
        path.relative_to(folder).as_posix(): read[path.suffix](path)
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix in read
    }


def numbers_printed(lines: Iterable[str]) -> list[float]:
    """Numbers that a command prints without writing a file, in their order, without the version of the software."""
    return [float(number) for number in re.findall(NUMBER, VERSION.sub("", "\n".join(lines)))]


def store(name: str, value: object) -> None:
    """Stores a result in place of the previous one; unchanged values keep their stored digits."""
    before = json.loads(_path(name).read_text("utf-8")) if _path(name).exists() else {}
    after = condensed(value)
    unchanged = {path for path in after if path in before and same(before[path], after[path])}
    _write(_path(name), {path: before[path] if path in unchanged else leaf for path, leaf in after.items()})


def store_in_full(name: str, value: object, folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / f"{name}.json", in_full(value))


def check(name: str, value: object) -> None:
    """Fails where a result is no longer what is stored under this name."""
    changed = changes(json.loads(_path(name).read_text("utf-8")), condensed(value))
    assert not changed, (
        f"{len(changed)} values of {name} changed (arrays: length, mean, rms, first, last):\n  "
        + "\n  ".join(changed[:40])
        + f"\nIf that is meant: `python -m tests.unchanged {name}` stores them, and CHANGELOG.md says why."
    )


def compare(before: Path, after: Path) -> list[str]:
    """Changes between two folders of `store_in_full` that are larger than EXACT."""
    lines = []
    for path in sorted(before.glob("*.json")):
        old, new = (json.loads((folder / path.name).read_text("utf-8")) for folder in (before, after))
        lines += [f"{path.stem}: {line[:300]}" for line in changes(old, new, EXACT)]
    return lines


def changes(before: Mapping[str, Leaf], after: Mapping[str, Leaf], relative: float = RELATIVE) -> list[str]:
    """One line for each value that changed by more than this relative amount, is gone, or is new."""
    lines = [f"{path}: {before[path]}, which is gone" for path in before if path not in after]
    for path, value in after.items():
        if path not in before:
            lines.append(f"{path}: new, {value}")
        elif not same(before[path], value, relative, _scale(before, path)):
            lines.append(f"{path}: {before[path]} -> {value}")
    return lines


def _scale(leaves: Mapping[str, Leaf], path: str) -> float:
    """The largest magnitude of an estimate and its interval's ends, since a value near zero is not known better for
    that. 0 for all others."""
    parent, _, last = path.rpartition(".")
    numbers = [leaves.get(f"{parent}.{end}") for end in ESTIMATE] if last in ESTIMATE else []
    return max((abs(number) for number in numbers if isinstance(number, float)), default=0.0)


def same(a: Leaf, b: Leaf, relative: float = RELATIVE, scale: float = 0.0) -> bool:
    """Whether two leaves are equal; `scale` is for numbers that are in no array."""
    if isinstance(a, list) and isinstance(b, list):
        moments = len(a) > SHORT and relative != EXACT
        of_array = abs(a[2] or 0.0) if moments else max((abs(x) for x in a if x is not None), default=0.0)
        return len(a) == len(b) and all(_near(x, y, of_array, relative) for x, y in zip(a, b, strict=True))
    if isinstance(a, list | str) or isinstance(b, list | str):
        return a == b
    return _near(a, b, scale, relative)


def _near(a: float | None, b: float | None, scale: float, relative: float) -> bool:
    if a is None or b is None:
        return a is b
    return abs(a - b) <= relative * max(abs(a), scale) + 1e-12


def _plain(value: Any) -> Any:
    """Plain dictionaries, lists, numbers and texts."""
    match value:
        case msgspec.Struct():
            return {name: getattr(value, name) for name in value.__struct_fields__}
        case pd.DataFrame():
            return {"index": value.index.to_numpy(), **{str(name): value[name].to_numpy() for name in value}}
        case pd.Series() | pd.Index():
            return value.to_numpy()
        case tuple() if hasattr(value, "_asdict"):
            return value._asdict()
        case np.generic():
            return value.item()
        case Path():
            return value.name
        case enum.Enum():
            return value.value
        case _ if dataclasses.is_dataclass(value) and not isinstance(value, type):
            return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    return value


def _leaves(value: object) -> dict[str, float | str | np.ndarray | None]:
    leaves: dict[str, float | str | np.ndarray | None] = {}
    _collect(_plain(value), "", leaves)
    return leaves


def _collect(value: Any, path: str, leaves: dict[str, Any]) -> None:
    match value:
        case None:
            leaves[path] = None
        case bool() | int() | float():
            leaves[path] = float(value)
        case str():
            _collect_texts([value], path, leaves)
        case Mapping():
            for name, inner in value.items():
                if name not in LEFT_OUT:
                    _collect(_plain(inner), f"{path}.{name}".lstrip("."), leaves)
        case np.ndarray() if value.dtype.kind in "fiub":
            leaves[path] = value.astype(float).ravel()
        case list() | tuple() | np.ndarray():
            _collect_list([_plain(item) for item in value], path, leaves)
        case _:
            raise TypeError(f"{path}: {type(value).__name__}")


def _collect_list(values: list[Any], path: str, leaves: dict[str, Any]) -> None:
    if all(isinstance(item, int | float | None) for item in values):
        leaves[path] = np.array([np.nan if item is None else item for item in values], dtype=float)
    elif all(isinstance(item, str) for item in values):
        _collect_texts(values, path, leaves)
    elif all(isinstance(item, Mapping) and item.keys() == values[0].keys() for item in values):
        _collect({name: [item[name] for item in values] for name in values[0]}, path, leaves)
    elif all(isinstance(item, list | tuple | np.ndarray) for item in values):
        flat = [_plain(inner) for item in values for inner in item]
        leaves[f"{path}.lengths"] = np.array([len(item) for item in values], dtype=float)
        _collect_list(flat, path, leaves)
    else:
        for i, item in enumerate(values):
            _collect(item, f"{path}[{i}]", leaves)


def _collect_texts(texts: list[str], path: str, leaves: dict[str, Any]) -> None:
    """Quantities as their numbers and units; names, each once and how often; nothing else."""
    quantities = [QUANTITY.fullmatch(text) for text in texts]
    if all(quantities):
        leaves[path] = np.array([float(quantity[1]) for quantity in quantities if quantity])
        texts = [quantity[2] or "" for quantity in quantities if quantity]
        path += " unit"
    names = Counter(text for text in texts if NAME.fullmatch(text) and not HASH.fullmatch(text))
    if names:
        leaves[path] = ", ".join(name if count == 1 else f"{name} x{count}" for name, count in names.items())


def _short(leaf: float | str | np.ndarray | None) -> Leaf:
    if isinstance(leaf, float):
        return _rounded(leaf)
    if not isinstance(leaf, np.ndarray):
        return leaf
    if leaf.size <= SHORT:
        return [_rounded(item) for item in leaf.tolist()]
    finite = leaf[np.isfinite(leaf)]
    moments = (finite.mean(), np.sqrt(np.mean(finite**2))) if finite.size else (np.nan, np.nan)
    return [float(finite.size), *(_rounded(float(item)) for item in (*moments, leaf[0], leaf[-1]))]


def _full(leaf: float | str | np.ndarray | None) -> Leaf:
    if isinstance(leaf, np.ndarray):
        return [item if math.isfinite(item) else None for item in leaf.tolist()]
    return None if isinstance(leaf, float) and not math.isfinite(leaf) else leaf


def _rounded(value: float) -> float | None:
    return float(f"{value:.7g}") if math.isfinite(value) else None


def _json(path: Path) -> Any:
    return json.loads(path.read_text("utf-8"))


def _toml(path: Path) -> Any:
    """Tables of an array as columns; a key that some of the tables lack has a shorter column."""
    return {name: _columns(value) for name, value in tomllib.loads(path.read_text("utf-8")).items()}


def _columns(value: Any) -> Any:
    if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
        return value
    return {
        name: [item[name] for item in value if name in item] for name in {name: 0 for item in value for name in item}
    }


def _csv(path: Path) -> Any:
    """Columns of numbers where all values of a column are numbers; other columns as texts."""
    lines = [line for line in path.read_text("utf-8").splitlines() if not line.startswith("#")]
    header, *rows = csv.reader(lines)
    return {name: _column([row[i] for row in rows]) for i, name in enumerate(header)}


def _column(cells: list[str]) -> Any:
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return cells


def _waypoints(path: Path) -> Any:
    """The numbers of a mission as ArduPilot's tools write it."""
    _, *rows = path.read_text("utf-8").splitlines()
    return np.array([[float(cell) for cell in row.split("\t")] for row in rows])


def _page(path: Path) -> dict[str, Any]:
    """What is drawn in the figures of a page, by name."""
    matches = FIGURE.findall(path.read_text("utf-8"))
    return {"figures": {json.loads(name): {"drawn": _trace_values(json.loads(data))} for name, data in matches}}


def _trace_values(traces: list[dict[str, Any]]) -> dict[str, Any]:
    return {f"{i}": {axis: trace[axis] for axis in ("x", "y") if axis in trace} for i, trace in enumerate(traces)}


def _path(name: str) -> Path:
    return REFERENCES / f"{name}.json"


def _write(path: Path, leaves: Mapping[str, Leaf]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(_text(leaves), "utf-8")


def _text(leaves: Mapping[str, Leaf]) -> str:
    lines = (f"{json.dumps(path)}: {json.dumps(value)}" for path, value in leaves.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"
