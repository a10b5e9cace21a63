"""Which package may import which, no circular imports, and no heavy libraries in the daemon."""

import ast
import subprocess
import sys
from functools import cache
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests.our_files import dotted_path, nodes_of

pytestmark = pytest.mark.xdist_group("sources")

ROOT = Path(__file__).parent.parent
ALLOWED = {
    "flight": set(),
    "daq": {"flight"},
    "flightpower": {"flight"},
    "sim": {"flight"},
    "hw_fakes": {"flight", "sim"},
    "analysis": {"flight"},
}
# Only the command `sim` combines simulator, fake sensors and daemon; programs get the analysis by `flightpower`.
ALLOWED_IN_FILE = {
    "flightpower/simulate.py": {"flight", "sim", "hw_fakes", "daq"},
    "flightpower/__init__.py": {"analysis"},  # for type checkers
    "flightpower/interface.py": {"flight", "analysis"},
}


@cache
def import_statements(path: Path) -> list[ast.Import | ast.ImportFrom]:
    """Packages that a file imports, anywhere in it."""
    return [node for node in nodes_of(path) if isinstance(node, ast.Import | ast.ImportFrom)]


def imported_packages(path: Path) -> set[str]:
    """Top-level packages a file imports, anywhere in it."""
    names = set()
    for node in import_statements(path):
        if isinstance(node, ast.Import):
            names |= {dotted_path(alias.name).split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            imported = (dotted_path(f"{node.module}.{alias.name}") for alias in node.names)
            names |= {name.split(".")[0] for name in imported}
    return names


@pytest.mark.parametrize("package", ALLOWED)
def test_a_package_imports_only_what_it_may(package: str) -> None:
    files = sorted((ROOT / package).rglob("*.py"))
    assert files, f"{package} has no code"
    for path in files:
        name = path.relative_to(ROOT).as_posix()
        allowed = ALLOWED_IN_FILE.get(name, ALLOWED[package]) | {package}
        others = (imported_packages(path) & set(ALLOWED)) - allowed
        assert not others, f"{name} imports {others}"


@pytest.mark.parametrize("module", ["flightpower.daq.__main__", "flightpower.daq.daemon"])
def test_the_daemon_imports_no_library_of_the_analysis(module: str) -> None:
    heavy = ["numpy", "scipy", "pandas", "casadi", "plotly", "pyarrow"]
    code = f"import sys, {module}; print([name for name in {heavy} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert loaded.strip() == "[]"


def test_the_analysis_of_an_autopilot_s_log_imports_no_casadi() -> None:
    """Its 280 MB are then not needed, as with the extra [autopilot]. Lists the modules that such an analysis loads.

    pymavlink, which takes a third of a second, is for telemetry and text alone.
    """
    modules = (
        "flightpower.analysis.sources.ardupilot,"
        "flightpower.analysis.pages.one_log, flightpower.analysis.pipeline.whole_flight,"
        "flightpower.analysis.methods.whole_flight.drag,"
        "flightpower.analysis.methods.whole_flight.simulated_truth, flightpower.analysis.pages.write,"
        "flightpower.analysis.results.energy_balance, flightpower.analysis.flights.pool,"
        "flightpower.analysis.pages.pooled_page,"
        "flightpower.analysis.cli.route, flightpower.analysis.cli.parameters,"
        "flightpower.analysis.pages.open.whole_flight, flightpower.analysis.pages.open.server"
    )
    code = f"import sys, {modules}; print([name for name in ('casadi', 'plotly', 'pymavlink') if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert loaded.strip() == "[]"


def test_importing_flightpower_imports_no_library_and_not_even_our_own_packages() -> None:
    heavy = ["numpy", "typer", "flightpower.flight", "flightpower.analysis"]
    code = f"import sys, flightpower; print([name for name in {heavy} if name in sys.modules])"
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert printed.strip() == "[]"


def test_an_analysis_loads_no_library_that_it_does_not_use() -> None:
    """PyArrow also still reads what pandas writes with it afterwards."""
    heavy = ["scipy.optimize", "scipy.ndimage", "scipy.signal", "scipy.stats", "scipy.constants"]
    heavy += ["numpy.f2py", "numpy.testing", "pyarrow"]
    code = (
        "import sys, flightpower.analysis.cli.analyze;"
        "from flightpower.analysis.pages.lean_imports import import_lean; import_lean();"
        "import flightpower.analysis.pipeline, flightpower.analysis.pages.write;"
        f"print([name for name in {heavy} if name in sys.modules]);"
        "import io, numpy, pandas;"
        "file = io.BytesIO(); pandas.DataFrame({'V_mps': [1.5]}, index=['a']).to_parquet(file);"
        "print(pandas.read_parquet(file).loc['a', 'V_mps'], numpy.testing.__name__)"
    )
    printed = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT).stdout
    assert printed.split("\n")[:2] == ["[]", "1.5 numpy.testing"]


def imports_in(path: Path) -> set[str]:
    """Modules of this project that a file imports, as dotted names that may end in a name of the module."""
    names = set()
    for node in import_statements(path):
        if isinstance(node, ast.Import):
            names |= {dotted_path(alias.name) for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names |= {
                dotted_path(name) for name in (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
            }
    return {name for name in names if name.split(".")[0] in ALLOWED}


def import_graph() -> dict[str, set[str]]:
    """Which file of this project imports which, by dotted name; a package stands for its `__init__.py`."""
    files = {
        ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
        for package in ALLOWED
        for path in (ROOT / package).rglob("*.py")
    }
    return {
        name: {other for other in imports_in(path) if other in files and other != name} for name, path in files.items()
    }


def folders(graph: dict[str, set[str]]) -> dict[str, set[str]]:
    """The import graph of folders; a file at the root of a top-level package is a node of its own."""

    def folder(name: str) -> str:
        parts = name.split(".")
        return ".".join(parts[:2]) if len(parts) > 2 or (ROOT / Path(*parts)).is_dir() else name

    out: dict[str, set[str]] = {}
    for name, others in graph.items():
        out.setdefault(folder(name), set()).update(folder(other) for other in others)
    return {name: others - {name} for name, others in out.items()}


@pytest.mark.parametrize("of", [import_graph, lambda: folders(import_graph())], ids=["files", "folders"])
def test_imports_make_no_circle(of) -> None:
    try:
        tuple(TopologicalSorter(of()).static_order())
    except CycleError as error:
        pytest.fail(f"imports go in a circle: {' -> '.join(error.args[1])}")


def test_the_rooms_of_the_analysis_stand_on_twelve_floors() -> None:
    """A room's floor is above those of all rooms that it imports; each further floor is one more to climb."""
    graph = folders(import_graph())
    rooms = {name: {other for other in graph[name] if other.startswith("analysis.")} for name in graph}
    floor: dict[str, int] = {}
    for room in TopologicalSorter(rooms).static_order():
        floor[room] = 1 + max((floor[other] for other in rooms.get(room, ())), default=0)
    floor = {room: of for room, of in floor.items() if room.startswith("analysis.")}
    assert len(floor) > 15
    assert max(floor.values()) <= 12, sorted(floor.items(), key=lambda of: of[1])
