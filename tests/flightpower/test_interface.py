"""The names that `import flightpower` gives to programs."""

import ast
import json
import re
import subprocess
import sys
from pathlib import Path

import pytest

import flightpower
from flightpower import interface
from tests.documented_commands import ROOT

PAGE = (ROOT / "docs" / "understand" / "python.md").read_text("utf-8")
# Of the libraries the interface needs little, and checking them takes half a minute.
LIBRARIES = "numpy.*,scipy.*,pandas.*,casadi.*,plotly.*,jinja2.*,mcap.*,rich.*,pint.*,pyulog.*,pymavlink.*"
PROGRAM = """
from pathlib import Path
from flightpower import Comparison, Flight, Options, Pool, analyze, compare, estimation, plan, pool, read, tables

flight: Flight = analyze(read("log.mcap"), Options(aircraft=Path("my.toml"), weight_N=39.2))
power_W: float = flight.results.power_required[0].power_W
many: Pool = pool([flight, "results.json"])
difference: Comparison = compare(many, many)
p: float = difference.results().p
names: list[str] = list(tables(flight))
wind_kt: float = plan("nexstar").request.wind_kt
reveal_type(estimation)
wrong: str = flight.results.power_required[0].power_W
analyze("log.mcap", Options(mass="9 kg"))
"""


def test_the_names_are_those_of_the_interface_and_of_its_page() -> None:
    assert {*flightpower.__all__} == {*interface.__all__, "estimation"}
    for name in flightpower.__all__:
        assert getattr(flightpower, name) is not None
        assert re.search(rf"\b{name}\b", PAGE), name
    with pytest.raises(AttributeError):
        _ = flightpower.nothing  # type: ignore[attr-defined]


def test_the_program_on_the_page_imports_names_that_exist_and_calls_what_they_take() -> None:
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    imported = next(node for node in ast.parse(program).body if getattr(node, "module", "") == "flightpower")
    assert isinstance(imported, ast.ImportFrom)
    assert {one.name for one in imported.names} <= {*flightpower.__all__}


@pytest.mark.slow
def test_a_type_checker_sees_the_names(tmp_path: Path) -> None:
    """What is right passes; a float taken for a text and an option that does not exist are found."""
    for name, program in (("user", PROGRAM), ("page", re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)[0])):
        (tmp_path / f"{name}.py").write_text(program, "utf-8")
    (tmp_path / "mypy.ini").write_text(f"[mypy]\nfollow_imports = silent\n[mypy-{LIBRARIES}]\nfollow_imports = skip\n")
    command = [sys.executable, "-m", "mypy", "--config-file", str(tmp_path / "mypy.ini"), "--output", "json"]
    found = subprocess.run(
        [*command, str(tmp_path / "user.py"), str(tmp_path / "page.py")], capture_output=True, text=True, cwd=ROOT
    )
    lines = [json.loads(line) for line in found.stdout.splitlines() if line.startswith("{")]
    errors = {(Path(one["file"]).name, one["code"]) for one in lines if one["severity"] == "error"}
    assert errors == {("user.py", "assignment"), ("user.py", "call-arg")}, found.stdout


@pytest.mark.parametrize("name", ["analysis", "flight"])
def test_a_module_of_the_user_that_hides_ours_is_named(name: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.py").write_text("", "utf-8")
    environment = {"PYTHONPATH": str(ROOT)}
    for code, expected in (
        ("from flightpower.scripts import analyze; analyze()", 2),
        ("from flightpower.scripts import flightpower; flightpower()", 2),
        ("import flightpower; flightpower.read", 1),
    ):
        ended = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, text=True, env=environment, cwd=tmp_path
        )
        assert ended.returncode == expected
        said = ended.stderr.splitlines()
        assert f"{tmp_path / name}.py: hides the package {name} of flightpower" in said[-1]
        assert expected == 1 or len(said) == 1
