"""The names that `import flightpower` gives to programs."""

import ast
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import flightpower
from flightpower import interface
from tests.documented_commands import ROOT

PAGE = (ROOT / "docs" / "understand" / "python.md").read_text("utf-8")


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
    assert {item.name for item in imported.names} <= {*flightpower.__all__}


def test_the_program_on_the_page_is_the_one_whose_types_are_checked() -> None:
    """`make types` checks it, and also what is right and wrong in typed_program.py."""
    (program,) = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    assert Path(__file__).with_name("typed_page.py").read_text("utf-8").partition("\n")[2] == program
    checked = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["tool"]["mypy"]["files"]
    assert {f"tests/flightpower/typed_{name}.py" for name in ("page", "program")} <= {*checked}


@pytest.mark.parametrize("name", ["analysis", pytest.param("flight", marks=pytest.mark.thorough)])
def test_a_module_of_the_user_with_the_name_of_a_part_is_not_in_the_way(name: str, tmp_path: Path) -> None:
    (tmp_path / f"{name}.py").write_text("raise SystemExit(3)", "utf-8")
    code = "import flightpower; flightpower.read; from flightpower.scripts import flightpower as run; run()"
    ended = subprocess.run([sys.executable, "-c", code, "--version"], capture_output=True, text=True, cwd=tmp_path)
    assert ended.returncode == 0 and ended.stdout.startswith("flightpower "), ended.stderr


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("weight_N", "3.9 kg", "give a number above zero"),
        ("weight_N", -3.0, "give a number above zero"),
        ("mass_kg", float("nan"), "give a number above zero"),
        ("span_m", float("inf"), "give a number above zero"),
        ("battery_Wh", 74, "give a text, as to the command, such as '74'"),
        ("usable", 0.8, "give a text, as to the command, such as '0.8'"),
    ],
)
def test_an_option_of_the_wrong_kind_is_one_line(name: str, value: object, message: str) -> None:
    with pytest.raises(flightpower.InputError, match=rf"^Options: {name} = .*{message}"):
        flightpower.Options(**{name: value})  # type: ignore[arg-type]


def test_one_path_is_no_list_of_flights() -> None:
    with pytest.raises(flightpower.InputError, match="give a list of flights"):
        flightpower.pool("log.report/results.json")
