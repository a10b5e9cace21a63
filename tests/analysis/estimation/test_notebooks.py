"""The notebooks on estimation in docs/notebooks run from top to bottom, and their own assertions hold."""

import json
from pathlib import Path

import pytest

NOTEBOOKS = sorted((Path(__file__).parents[3] / "docs" / "notebooks").glob("0*.ipynb"))


def test_there_are_three() -> None:
    assert [file.name[:2] for file in NOTEBOOKS] == ["01", "02", "03"]


@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_it_runs(file: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Cells run in this process, because a kernel would take two seconds to start. Figures are made, not rendered."""
    names: dict[str, object] = {}
    for i, cell in enumerate(json.loads(file.read_text(encoding="utf-8"))["cells"]):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{file.name}, cell {i}", "exec"), names)
    assert "converged in" in capsys.readouterr().out
