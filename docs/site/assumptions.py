"""The page of assumed values, which the site has, made from the settings of the code; or their number.

python docs/site/assumptions.py            # prints the page
python docs/site/assumptions.py --count    # settings, and numbers of modules that are none, by folder
"""

import ast
import importlib
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT))

from flightpower.flight.settings import Settings  # noqa: E402

FOLDERS = (
    "flight", "analysis/sources", "analysis/air", "analysis/trajectory", "analysis/maneuvers", "analysis/methods",
    "analysis/estimation", "analysis/performance", "analysis/results", "analysis/missions", "analysis/flights",
    "analysis/pages", "analysis/calibrations", "analysis/cli", "analysis", "daq",
)  # fmt: skip
HEAD = """\
# Assumed values and limits

What the analysis assumes where a flight does not say, and limits of what it uses: each with its unit and the reason for
its value, by folder and subject. Results depend on these numbers. The page is made from the code; a value is changed in
the file named. Unit 1: a ratio. Standard deviations are named `…_sigma`.
"""


class Record(NamedTuple):
    """The settings of one subject, and the file that has them."""

    path: str
    name: str
    settings: Settings


def records() -> list[Record]:
    """All records of settings in the order of FOLDERS."""
    files = [path for package in ("analysis", "daq", "flight") for path in sorted((ROOT / package).rglob("*.py"))]
    paths = [path.relative_to(ROOT).as_posix() for path in files if "(Settings)" in path.read_text("utf-8")]
    return [
        record
        for path in sorted(paths, key=lambda path: FOLDERS.index(_folder(path)))
        for record in _records_of(path)
        if path != "flight/settings.py"
    ]


def page() -> str:
    parts, folder = [HEAD], None
    for path, name, settings in records():
        if _folder(path) != folder:
            folder = _folder(path)
            parts.append(f"## `{folder}/`\n")
        parts.append(f"### {name}\n\n{_says(settings)} `{path}`\n")
        rows = [
            f"| `{line.name}` | {_value(getattr(settings, line.name))} | {line.unit} | {_cell(line.reason)} |"
            for line in settings.described()
        ]
        parts.append("\n".join(["| name | value | unit | reason |", "|---|---|---|---|", *rows, ""]))
    return "\n".join(parts)


def remaining_numbers() -> Counter[str]:
    """Assignments with numbers at the level of modules of `analysis`, by folder."""
    counts: Counter[str] = Counter()
    for path in sorted((ROOT / "analysis").rglob("*.py")):
        for node in ast.parse(path.read_text("utf-8")).body:
            value = getattr(node, "value", None)
            if isinstance(node, ast.Assign | ast.AnnAssign) and value is not None:
                numbers = [node for node in ast.walk(value) if isinstance(node, ast.Constant)]
                counts[_folder(path.relative_to(ROOT).as_posix())] += any(
                    type(node.value) in (int, float) for node in numbers
                )
    return counts


def settings_by_folder() -> Counter[str]:
    counts: Counter[str] = Counter()
    for path, _, settings in records():
        if path.startswith("analysis/"):
            counts[_folder(path)] += len(list(settings.described()))
    return counts


def _records_of(path: str) -> Iterator[Record]:
    """Each record of a module; one without an instance there as its class."""
    module = importlib.import_module("flightpower." + path.removesuffix(".py").replace("/", "."))
    instances = {name: var for name, var in vars(module).items() if isinstance(var, Settings)}
    for cls in vars(module).values():
        if isinstance(cls, type) and issubclass(cls, Settings) and cls.__module__ == module.__name__:
            named = {name: instance for name, instance in instances.items() if type(instance) is cls}
            for name, instance in (named or {cls.__name__: cls()}).items():
                yield Record(path, name, instance)


def _folder(path: str) -> str:
    """The longest of FOLDERS that contains a file."""
    return max((folder for folder in FOLDERS if path.startswith(folder + "/")), key=len)


def _says(settings: Settings) -> str:
    return " ".join((type(settings).__doc__ or "").split())


def _value(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.0f}" if value.is_integer() and abs(value) < 1e7 else f"{value:.4g}"
    if isinstance(value, tuple | list):
        return ", ".join(_value(part) for part in value)
    if isinstance(value, dict):
        return ", ".join(f"{_cell(str(name))}: {_value(part)}" for name, part in value.items())
    return _cell(str(value))


def _cell(text: str) -> str:
    return text.replace("|", r"\|")


if __name__ == "__main__":
    if sys.argv[1:] == ["--count"]:
        settings, numbers = settings_by_folder(), remaining_numbers()
        for folder in FOLDERS:
            if settings[folder] or numbers[folder]:
                print(f"{folder:28}{settings[folder]:5} settings{numbers[folder]:5} other numbers")
        print(f"{'all':28}{settings.total():5} settings{numbers.total():5} other numbers")
    else:
        print(page())
