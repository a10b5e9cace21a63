"""Numbers and words of any result, condensed to a few lines that can be stored, and what changed since they were.

    python -m tests.unchanged            # renews the stored references, tests/data/unchanged/*.json
    python -m tests.unchanged plans      # only that one

An array becomes its length, mean, root mean square, first and last element; a text the checksum of its words and, as an
array, its numbers. Records of equal names become one array a name.
"""

import csv
import dataclasses
import json
import math
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd

REFERENCES = Path(__file__).parents[1] / "data" / "unchanged"
RELATIVE = 3e-5  # of a number, or of the root mean square of its array
SHORT = 4  # an array of at most so many numbers stands as it is
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:[eE][-+]?\d+)?")
FIGURE = re.compile(r"<script>figures\[(\".*?\")\] = \{data: (.*), layout: (.*)\};</script>")
HASH = re.compile(r"\b[0-9a-f]{16,}\b")
UNSEEN = re.compile(r"<(script|style)>.*?</\1>|<[^>]*>", re.DOTALL)
# What another computer, folder or version may change without a change of any result.
LEFT_OUT = {"software_version", "versions", "probe_calibration", "log_sha256"}

Leaf = float | str | None | list[float | None]


def condensed(value: object, path: str = "") -> dict[str, Leaf]:
    """Numbers and words by their path, such as power_required.speed_mps."""
    found: dict[str, Leaf] = {}
    _collect(_plain(value), path, found)
    return found


def of_files(folder: Path) -> dict[str, object]:
    """What the files of a folder contain, by name: JSON, tables, figures of pages and what a page says."""
    read = {".json": _json, ".csv": _csv, ".parquet": pd.read_parquet, ".html": _page, ".plan": _json}
    texts = (".toml", ".md", ".waypoints", ".txt")
    return {
        path.relative_to(folder).as_posix(): read.get(path.suffix, Path.read_text)(path)  # type: ignore[operator]
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.suffix in {*read, *texts}
    }


def changes(before: Mapping[str, Leaf], after: Mapping[str, Leaf]) -> list[str]:
    """One line for each value that changed by more than RELATIVE, is gone, or is new."""
    lines = [f"{path}: {before[path]}, which is gone" for path in before if path not in after]
    for path, value in after.items():
        if path not in before:
            lines.append(f"{path}: new, {value}")
        elif not same(before[path], value):
            lines.append(f"{path}: {before[path]} -> {value}")
    return lines


def store(name: str, value: object) -> None:
    """Stores a result in place of the one before."""
    REFERENCES.mkdir(parents=True, exist_ok=True)
    (REFERENCES / f"{name}.json").write_text(_text(condensed(value)), "utf-8")


def check(name: str, value: object) -> None:
    """Fails where a result is no longer what is stored under this name."""
    stored = json.loads((REFERENCES / f"{name}.json").read_text("utf-8"))
    changed = changes(stored, json.loads(_text(condensed(value))))
    assert not changed, (
        f"{len(changed)} values of {name} changed (arrays: length, mean, rms, first, last):\n  "
        + "\n  ".join(changed[:40])
        + f"\nIf that is meant: `python -m tests.unchanged {name}` stores them, and CHANGELOG.md says why."
    )


def same(a: Leaf, b: Leaf) -> bool:
    if isinstance(a, list) and isinstance(b, list):
        scale = max((abs(x) for x in a if x is not None), default=0.0) if len(a) <= SHORT else abs(a[2] or 0.0)
        return len(a) == len(b) and all(_near(x, y, scale) for x, y in zip(a, b, strict=True))
    if isinstance(a, list | str) or isinstance(b, list | str):
        return a == b
    return _near(a, b, 0.0)


def _near(a: float | None, b: float | None, scale: float) -> bool:
    if a is None or b is None:
        return a is b
    return abs(a - b) <= RELATIVE * max(abs(a), scale) + 1e-12


def _plain(value: Any) -> Any:
    """The same of dictionaries, lists, arrays, numbers and texts."""
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
        case _ if dataclasses.is_dataclass(value) and not isinstance(value, type):
            return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    return value


def _collect(value: Any, path: str, found: dict[str, Leaf]) -> None:
    match value:
        case None | bool():
            found[path] = value if value is None else float(value)
        case int() | float():
            found[path] = _rounded(value)
        case str():
            _collect_text(value, path, found)
        case Mapping():
            for name, inner in value.items():
                if name not in LEFT_OUT:
                    _collect(_plain(inner), f"{path}.{name}".lstrip("."), found)
        case np.ndarray() if value.dtype.kind in "fiub":
            found[path] = _array(value.astype(float).ravel())
        case list() | tuple() | np.ndarray():
            _collect_list([_plain(one) for one in value], path, found)
        case _:
            raise TypeError(f"{path}: {type(value).__name__}")


def _collect_list(values: list[Any], path: str, found: dict[str, Leaf]) -> None:
    if all(isinstance(one, int | float | None) for one in values):
        found[path] = _array(np.array([np.nan if one is None else one for one in values], dtype=float))
    elif all(isinstance(one, str) for one in values):
        _collect_text("\n".join(values), path, found)
    elif all(isinstance(one, Mapping) and one.keys() == values[0].keys() for one in values):
        _collect({name: [one[name] for one in values] for name in values[0]}, path, found)
    elif all(isinstance(one, list | tuple | np.ndarray) for one in values):
        flat = [_plain(inner) for one in values for inner in one]
        found[f"{path}.lengths"] = _array(np.array([len(one) for one in values], dtype=float))
        _collect_list(flat, path, found)
    else:
        for i, one in enumerate(values):
            _collect(one, f"{path}[{i}]", found)


def _collect_text(text: str, path: str, found: dict[str, Leaf]) -> None:
    """Words as they are, or the checksum of many; the logarithms of the numbers, so that small ones count as well."""
    text = HASH.sub("hash", text)
    numbers = np.array([float(number) for number in NUMBER.findall(text)])
    words = " ".join(NUMBER.sub("#", text).split())
    found[path] = words if len(words) <= 60 else f"{len(words.split())} words {zlib.crc32(words.encode()):08x}"
    if numbers.size:
        found[f"{path} numbers"] = _array(np.sign(numbers) * np.log1p(np.abs(numbers) * 1e3))


def _array(values: np.ndarray) -> list[float | None]:
    if values.size <= SHORT:
        return [_rounded(one) for one in values.tolist()]
    finite = values[np.isfinite(values)]
    moments = (finite.mean(), np.sqrt(np.mean(finite**2))) if finite.size else (np.nan, np.nan)
    return [float(finite.size), *(_rounded(float(one)) for one in (*moments, values[0], values[-1]))]


def _rounded(value: float) -> float | None:
    return float(f"{value:.7g}") if math.isfinite(value) else None


def _json(path: Path) -> Any:
    return json.loads(path.read_text("utf-8"))


def _csv(path: Path) -> Any:
    """Columns of numbers where all of a column are; other tables as text."""
    lines = [line for line in path.read_text("utf-8").splitlines() if not line.startswith("#")]
    header, *rows = csv.reader(lines)
    return {name: _column([row[i] for row in rows]) for i, name in enumerate(header)}


def _column(cells: list[str]) -> Any:
    try:
        return np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        return "\n".join(cells)


def _page(path: Path) -> dict[str, Any]:
    """Figures by name, and the text from each heading to the next."""
    text = path.read_text("utf-8")
    figures = {json.loads(name): _figure(json.loads(data), layout) for name, data, layout in FIGURE.findall(text)}
    head, *parts = re.split(r"<h[1-6][^>]*>", UNSEEN.sub("", text[: text.index("<h1")]) + text[text.index("<h1") :])
    said = [UNSEEN.sub(" ", part) for part in parts]
    return {"figures": figures, "head": head, **{f"part {i}": " ".join(part.split()) for i, part in enumerate(said)}}


def _figure(traces: list[dict[str, Any]], layout: str) -> dict[str, Any]:
    """What is drawn; the style of lines, points and axes as one text."""
    drawn = [{name: trace.pop(name) for name in ("x", "y") if name in trace} for trace in traces]
    return {"drawn": {f"{i}": one for i, one in enumerate(drawn)}, "style": json.dumps(traces) + layout}


def _text(leaves: Mapping[str, Leaf]) -> str:
    lines = (f"{json.dumps(path)}: {json.dumps(value)}" for path, value in leaves.items())
    return "{\n" + ",\n".join(lines) + "\n}\n"
