"""The house stands as drawn: who may import whom, and what the aircraft's computer is spared."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
ALLOWED = {
    "flight": set(),
    "daq": {"flight"},
    "sim": {"flight"},
    "hw_fakes": {"flight", "sim"},
    "analysis": {"flight"},
}
# The one place where simulator, fake hardware and daemon meet: the command line that flies.
ALLOWED_IN_FILE = {"sim/__main__.py": {"flight", "hw_fakes", "daq"}}


def imported_packages(path: Path) -> set[str]:
    """Top-level packages a file imports, anywhere in it."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module.split(".")[0])
    return names


@pytest.mark.parametrize("package", ALLOWED)
def test_a_floor_imports_only_what_it_may(package: str) -> None:
    files = sorted((ROOT / package).rglob("*.py"))
    assert files, f"{package} has no code"
    for path in files:
        name = path.relative_to(ROOT).as_posix()
        allowed = ALLOWED_IN_FILE.get(name, ALLOWED[package]) | {package}
        strangers = (imported_packages(path) & set(ALLOWED)) - allowed
        assert not strangers, f"{name} imports {strangers}"


@pytest.mark.parametrize("module", ["daq.__main__", "daq.daemon"])
def test_the_daemon_needs_nothing_of_the_laptop(module: str) -> None:
    heavy = ["numpy", "scipy", "pandas", "casadi", "plotly", "pyarrow"]
    code = f"import sys, {module}; print([name for name in {heavy} if name in sys.modules])"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert loaded.strip() == "[]"
