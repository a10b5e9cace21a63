"""A second analysis into the same folder: the report is replaced, what was edited by hand is kept."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from flightpower.analysis.cli.analyze import app
from tests.analysis.sources.flown_table import AREA_M2, MAP, MASS_KG, SPAN_M, flown_table, map_text, written

AIRCRAFT = ["--mass", f"{MASS_KG} kg", "--wing-area", f"{AREA_M2} m^2", "--span", f"{SPAN_M} m"]


@pytest.mark.slow
def test_replace_is_understood_and_edited_stretches_are_kept(tmp_path: Path) -> None:
    names = ("time", "true_airspeed", "height", "battery_voltage", "battery_current")
    path, folder = written(tmp_path, flown_table(), map_text({name: MAP[name] for name in names})), tmp_path / "out"

    def analyzed(*more: str) -> str:
        outcome = CliRunner().invoke(app, [str(path), *AIRCRAFT, "-o", str(folder), *more])
        assert outcome.exit_code == 0, outcome.output
        return outcome.stderr

    assert "left_out" not in analyzed("--leave-out", "40 to 50 s")
    edited = "60.0 to 75.0 s\n"
    (folder / "left_out.txt").write_text(edited)
    before = (folder / "results.json").read_bytes()
    assert "left_out.txt was written; the previous file is now left_out-1.txt" in analyzed("--replace").replace(
        "\n", " "
    )
    assert (folder / "left_out-1.txt").read_text() == edited and not (folder / "left_out.txt").read_text().strip()
    assert (folder / "results.json").read_bytes() != before
    assert not analyzed("--replace").count("left_out"), "nothing has changed since"
    assert [*folder.glob("left_out-*")] == [folder / "left_out-1.txt"]
