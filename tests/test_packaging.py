"""What is installed: every import is declared, every package says that it is typed and brings its files along."""

import ast
import re
import runpy
import sys
import tomllib
from importlib import metadata
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

from flightpower.command import SIDES
from tests.our_files import PARTS, nodes_of, syntax_of

pytestmark = pytest.mark.xdist_group("sources")

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))
# Each package and the extras, any one of which has to be enough; the aircraft's computer installs none.
EXTRAS: dict[str, tuple[str, ...]] = {
    "daq": (),
    "flightpower": (),
    "flight": ("analysis", "sim"),
    "analysis": ("analysis",),
    "sim": ("sim",),
    "hw_fakes": ("sim",),
}
OURS = {"flightpower", *EXTRAS}
IMPORTED_AS = {"pytest-xdist": "xdist", "pyserial": "serial"}  # where that is not the distribution's name


def declared(*extras: str) -> set[str]:
    """Import names of the dependencies of the base and of these extras, and of extras that these include."""
    optional = PROJECT["project"]["optional-dependencies"]
    wanted = PROJECT["project"]["dependencies"] + [line for extra in extras for line in optional[extra]]
    nested = [name for line in wanted if line.startswith("flightpower[") for name in line[12:].rstrip("]").split(",")]
    names = [re.split(r"[^\w-]", line)[0] for line in wanted]
    return {IMPORTED_AS.get(name, name.replace("-", "_")) for name in names} | (declared(*nested) if nested else set())


def foreign_imports(path: Path, at_import: bool) -> set[str]:
    """Packages of others that a file imports: when it is imported itself, or anywhere in it."""
    names: set[str] = set()
    for node in syntax_of(path).body if at_import else nodes_of(path):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module.split(".")[0])
    return names - sys.stdlib_module_names - EXTRAS.keys()


@pytest.mark.slow
@pytest.mark.parametrize("package", EXTRAS)
def test_a_package_imports_only_what_is_declared(package: str) -> None:
    """An import inside a function may need another extra, which the command then says."""
    allowed = set.intersection(*(declared(extra) for extra in EXTRAS[package])) if EXTRAS[package] else declared()
    for path in sorted((ROOT / package).rglob("*.py")):
        assert foreign_imports(path, at_import=True) <= allowed, path
        assert foreign_imports(path, at_import=False) <= declared("fleet", "plot", "status"), path


@pytest.mark.slow
@pytest.mark.parametrize("folder", ["tests", "benchmarks"])
def test_tests_and_benchmarks_import_only_what_the_developers_extra_has(folder: str) -> None:
    folders = ("tests", "benchmarks", "docs/examples")
    own = {"tests", "benchmarks"} | {path.stem for name in folders for path in (ROOT / name).rglob("*.py")}
    for path in sorted((ROOT / folder).rglob("*.py")):
        assert foreign_imports(path, at_import=False) - own <= declared("fuzz"), path


@pytest.mark.parametrize("package", EXTRAS)
def test_every_file_of_a_package_is_installed(package: str) -> None:
    patterns = PROJECT["tool"]["setuptools"]["package-data"]
    installed = {
        file
        for pattern in patterns["*"] + patterns.get(f"flightpower.{package}", [])
        for file in (ROOT / package).glob(pattern)
    }
    present = {file for file in (ROOT / package).rglob("*") if file.is_file() and "__pycache__" not in file.parts}
    assert ROOT / package / "py.typed" in present
    assert {file for file in present if file.suffix != ".py"} <= installed


def test_every_part_is_installed_inside_flightpower(monkeypatch: pytest.MonkeyPatch) -> None:
    """Other packages are also called `analysis` or `daq`, and their files would mix with ours in one folder."""
    arguments: dict[str, Any] = {}
    setuptools = pytest.importorskip("setuptools")  # of the builder; environments of Python 3.12 have none
    monkeypatch.setattr(setuptools, "setup", arguments.update)
    runpy.run_path(str(ROOT / "setup.py"))
    folders = {path.parent.relative_to(ROOT) for part in PARTS for path in (ROOT / part).rglob("__init__.py")}
    assert set(arguments["packages"]) == {
        "flightpower",
        *(f"flightpower.{'.'.join(folder.parts)}" for folder in folders),
    }
    assert arguments["package_dir"] == {f"flightpower.{part}": part for part in PARTS}
    for part in PARTS:
        assert (ROOT / "flightpower" / part).resolve() == ROOT / part


@pytest.mark.parametrize("folder", ["systemd", "firmware/esc_counter"])
def test_what_the_aircraft_s_computer_needs_is_in_the_wheel(folder: str) -> None:
    """The files are beside the program, in share/flightpower of the environment, where `systemd/install.sh` finds
    them."""
    installed: dict[str, list[str]] = PROJECT["tool"]["setuptools"]["data-files"]
    there = {path for patterns in installed.values() for pattern in patterns for path in ROOT.glob(pattern)}
    assert {path for path in (ROOT / folder).iterdir() if path.is_file()} <= there


def test_an_editable_installation_shows_its_types() -> None:
    """Type checkers follow a path in a .pth file, but not an import hook: `import flightpower` has no types then."""
    installed = metadata.distribution("flightpower")
    for file in installed.files or ():
        if file.suffix == ".pth":
            text = file.read_text()
            assert Path(text.strip()).is_dir(), f"{file}: an import hook; run `make .venv/.ready` again"
    (ROOT / "flightpower" / "py.typed").stat()


def test_the_extra_for_autopilots_has_no_casadi() -> None:
    assert "casadi" in declared("analysis") and not declared("autopilot") & {"casadi", "plotly", "pyarrow"}


def test_an_extra_installs_what_its_commands_need_and_the_demonstration_s_the_page_in_the_browser() -> None:
    """`make demo` installs [analysis,sim], so the command it suggests next works."""
    missing = {name: set(side.needs) - declared(*filter(None, [side.extra])) for name, side in SIDES.items()}
    assert not any(missing.values()), missing
    assert "'.[analysis,sim]'" in (ROOT / "Makefile").read_text("utf-8")
    assert set(SIDES["open"].needs) <= declared("analysis") == declared("page")


def test_all_that_is_declared_has_a_fixed_version() -> None:
    """constraints.txt fixes what any extra needs. It has no hashes: with one, pip refuses the folder of the project."""
    text = (ROOT / "constraints.txt").read_text("utf-8")
    fixed = re.findall(r"^([\w.-]+)==[\w.]+$", text, re.MULTILINE)
    assert len(fixed) == sum(not line.startswith("#") for line in text.splitlines()) and "--hash" not in text
    imported = {IMPORTED_AS.get(name, re.sub(r"[-_.]+", "_", name)).lower() for name in fixed}
    needed = declared("dev", "docs", "fleet", "plot", "sim", "status") - {"flightpower"}
    assert {name.lower() for name in needed} - imported == set()


def test_every_version_of_python_that_is_tried_is_a_classifier() -> None:
    workflow = (ROOT / ".github" / "workflows" / "tests.yml").read_text("utf-8")
    (matrix,) = re.findall(r"matrix: \{python: \[(.*)\]\}", workflow)
    tried = {version.strip('" ') for version in matrix.split(",")}
    named = {line.rsplit(" ", 1)[1] for line in PROJECT["project"]["classifiers"] if ":: Python :: 3." in line}
    assert tried == named and f">={min(tried)}" == PROJECT["project"]["requires-python"]


def started_modules(path: Path) -> set[str]:
    """Our modules whose names follow "-m" in a list of words or arguments of a file."""
    sequences = [node.elts for node in nodes_of(path) if isinstance(node, ast.List | ast.Tuple)]
    words = [[word.value if isinstance(word, ast.Constant) else None for word in sequence] for sequence in sequences]
    pairs = {pair for sequence in words for pair in pairwise(sequence)}
    return {name for option, name in pairs if option == "-m" and isinstance(name, str) and name.split(".")[0] in OURS}


def can_be_started(module: str) -> bool:
    """Whether `python -m` runs the module: a package has `__main__`, any other a line that asks whether it is run."""
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        return False
    if spec.submodule_search_locations is not None:
        return find_spec(f"{module}.__main__") is not None
    return '__name__ == "__main__"' in Path(spec.origin).read_text("utf-8")


def test_modules_that_scripts_start_can_be_started() -> None:
    paths = [path for folder in ("benchmarks", "debian", "docs", "tests") for path in (ROOT / folder).rglob("*.py")]
    started = {(module, path.name) for path in paths for module in started_modules(path)}
    assert {module for module, _ in started} >= {"flightpower", "flightpower.daq"}
    assert [where for where in sorted(started) if not can_be_started(where[0])] == []


def test_no_script_of_benchmarks_is_left_to_itself() -> None:
    """Each script is imported or started by another one, or is named in the Makefile, a page, a test or a file
    header."""
    scripts = {path.stem: path.read_text("utf-8") for path in (ROOT / "benchmarks").glob("*.py")}
    pages = [
        ROOT / "Makefile",
        ROOT / "CONTRIBUTING.md",
        *(ROOT / "docs").rglob("*.md"),
        *(ROOT / "tests").rglob("*.py"),
    ]
    named = "\n".join(
        path.read_text("utf-8") for path in [*pages, *(ROOT / "flight" / "data" / "propellers").glob("*.csv")]
    )

    def reached(name: str) -> bool:
        by_script = rf"^\s*(?:import|from) {name}\b|_alone\(\"{name}\""
        others = "\n".join(text for other, text in scripts.items() if other != name)
        return bool(re.search(by_script, f"{others}\n{named}", re.MULTILINE) or re.search(rf"\b{name}\.py\b", named))

    assert [name for name in sorted(scripts) if not reached(name)] == []
