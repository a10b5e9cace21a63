"""The notebooks of docs/notebooks run from top to bottom; their own assertions hold."""

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[3]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("0*.ipynb"))  # one-flight.ipynb: tests/chain/test_exports.py


def test_there_are_three() -> None:
    assert [file.name[:2] for file in NOTEBOOKS] == ["01", "02", "03"]


@pytest.mark.xdist_group("notebooks")
def test_they_run() -> None:
    """All in one process, to import and start once; each begins with no names defined."""
    together = nbformat.v4.new_notebook()
    for file in NOTEBOOKS:
        cells = nbformat.read(file, as_version=4).cells
        together.cells += [nbformat.v4.new_code_cell("%reset -f"), *(c for c in cells if c.cell_type == "code")]
    together.cells.insert(0, nbformat.v4.new_code_cell(f"import sys; sys.path.insert(0, {str(ROOT)!r})"))
    NotebookClient(together, timeout=60, kernel_name="python3").execute()
    assert any("converged in" in str(cell.outputs) for cell in together.cells)
