"""Tests the package from outside: its names, what it loads and imports, and the page that shows its use."""

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

from flightpower.analysis import estimation

ROOT = Path(__file__).parents[3]
BLOCKS = re.findall(
    r"```python\n(.*?)```", (ROOT / "docs" / "understand" / "estimation.md").read_text("utf-8"), re.DOTALL
)
OURS = ("analysis", "daq", "flight", "flightpower", "hw_fakes", "sim")


def test_every_name_exists_and_is_what_it_is_called() -> None:
    for name in estimation.__all__:
        assert getattr(estimation, name).__name__.rpartition(".")[2] == name
    with pytest.raises(AttributeError, match="known: Segment, Model"):
        _ = estimation.estimate


def test_importing_it_loads_no_library() -> None:
    heavy = "[m for m in ('numpy', 'casadi', 'scipy') if m in sys.modules]"
    code = f"import sys; from flightpower.analysis import estimation; print({heavy})"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT)
    assert ran.stdout.strip() == "[]"


def test_it_imports_nothing_of_ours_but_arrays_errors_and_settings() -> None:
    for path in (ROOT / "analysis" / "estimation").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text("utf-8"))):
            module = node.module if isinstance(node, ast.ImportFrom) else None
            if module and module.partition(".")[0] in OURS and not module.startswith("flightpower.analysis.estimation"):
                assert module in (
                    "flightpower.flight.arrays",
                    "flightpower.flight.errors",
                    "flightpower.flight.settings",
                ), f"{path.name} imports {module}"


def test_the_page_uses_every_name_and_its_examples_run(capsys: pytest.CaptureFixture[str]) -> None:
    scope: dict[str, object] = {}
    for i, block in enumerate(BLOCKS):
        exec(compile(block, f"docs/understand/estimation.md, block {i + 1}", "exec"), scope)
    shown = "\n".join(BLOCKS)
    assert [name for name in estimation.__all__ if not re.search(rf"\b{name}\b", shown)] == []
    assert "converged in" in capsys.readouterr().out
