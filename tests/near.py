"""The tests nearest to a file, by the graph of imports: `python -m tests.near FILE [COUNT]`, or `make near FILE=…`.

Nearest are tests that import the file itself, then those that import what imports it. Among equally distant tests,
those come first that mirror the file's folder and name, then those that import little else.
"""

import re
import sys
from collections import deque
from pathlib import Path

from tests.our_files import module_of

ROOT = Path(__file__).parents[1]
FOLDERS = ("analysis", "daq", "flight", "flightpower", "hw_fakes", "sim", "tests", "benchmarks")
COUNT = 5
STATEMENT = re.compile(r"^[ \t]*(?:from ([\w.]+) import (\([^)]*\)|[^\n(]+)|import ([^\n]+))", re.MULTILINE)


def files_of(root: Path) -> list[Path]:
    """Every Python file of the project, from its root."""
    return [path.relative_to(root) for folder in FOLDERS for path in sorted((root / folder).rglob("*.py"))]


def imports(root: Path) -> dict[Path, set[Path]]:
    """Which file imports which. Tests import files of their own folder, and benchmarks, by bare name."""
    files = files_of(root)
    by_name = {module_of(".".join(path.with_suffix("").parts).removesuffix(".__init__")): path for path in files}
    graph: dict[Path, set[Path]] = {}
    for path in files:
        beside = [".".join(folder.parts) + "." for folder in path.parents if folder.parts] + ["benchmarks."]
        prefixes = ["", *(beside if path.parts[0] in ("tests", "benchmarks") else [])]
        result = set()
        for name in _names_imported((root / path).read_text("utf-8")):
            result |= {by_name[prefix + name] for prefix in prefixes if prefix + name in by_name}
        graph[path] = result - {path}
    return graph


def _names_imported(text: str) -> set[str]:
    """Dotted names of imported modules and of the names imported from them, which may also be modules.

    They are found by the look of the statements, since parsing every file takes twenty times as long.
    """
    names = set()
    for module, taken, modules in STATEMENT.findall(text):
        listed = [word.split(" as ")[0].strip() for word in re.sub(r"#.*|[()]", "", taken or modules).split(",")]
        names |= {f"{module}.{item}" for item in listed} | {module} if module else set(listed)
    return names


def _naming(root: Path, file: Path, graph: dict[Path, set[Path]]) -> list[Path]:
    """Python files that name a page, a script or another file that cannot be imported."""
    return [path for path in graph if file.name in (root / path).read_text("utf-8")]


def nearest(file: Path, graph: dict[Path, set[Path]], begin: list[Path], count: int = COUNT) -> list[Path]:
    """The nearest test files, the nearest first.

    begin : the file itself, or what stands for it in the graph
    """
    importers: dict[Path, set[Path]] = {path: set() for path in graph}
    for path, result in graph.items():
        for other in result:
            importers[other].add(path)
    steps = dict.fromkeys(begin, 0)
    waiting = deque(begin)
    while waiting:
        path = waiting.popleft()
        for other in importers[path] - steps.keys():
            steps[other] = steps[path] + 1
            waiting.append(other)
    tests = [path for path in steps if path.name.startswith("test_") and path.parts[0] == "tests"]
    return sorted(tests, key=lambda test: (steps[test], -_likeness(test, file), len(graph[test]), test))[:count]


def _likeness(test: Path, file: Path) -> int:
    """The number of folders that a test mirrors of a file, plus twice that of the words of its name."""
    words = set(test.stem.split("_")) & set(file.stem.split("_"))
    return len(set(test.parts[1:-1]) & set(file.parts[:-1])) + 2 * len(words)


def tests_near(root: Path, file: Path, count: int = COUNT) -> list[Path]:
    """The nearest test files of a file of the project.

    Raises LookupError where no test reaches it.
    """
    graph = imports(root)
    begin = [file] if file in graph else _naming(root, file, graph)
    result = nearest(file, graph, begin, count)
    if not result:
        raise LookupError(f"{file}: no test imports it, nor a file that does; give a file of {', '.join(FOLDERS)}")
    return result


def main() -> None:
    file = Path(sys.argv[1])
    if not (ROOT / file).is_file():
        sys.exit(f"{file}: no such file below {ROOT}")
    try:
        print(*tests_near(ROOT, file, int(sys.argv[2]) if len(sys.argv) > 2 else COUNT), sep="\n")
    except LookupError as error:
        sys.exit(str(error))


if __name__ == "__main__":
    main()
