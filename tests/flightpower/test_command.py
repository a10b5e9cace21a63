"""`flightpower`: its commands, each loaded only when called, and its templates of files."""

import os
import shlex
import subprocess
import sys
import tomllib
from pathlib import Path
from unittest.mock import Mock

import pytest
from typer.testing import CliRunner

import flightpower.command as umbrella
from flightpower import scripts, templates
from flightpower.daq.config import load_tray
from flightpower.flight.aircraft import load_aircraft, parse_aircraft, shipped_aircraft
from flightpower.flight.aircraft_keys import EXAMPLES
from flightpower.flight.complete_aircraft import as_complete
from flightpower.flight.errors import InputError
from flightpower.flight.version import version

THREADS = Path("/proc/self/task")
REQUIRED = ("geometry.span", "geometry.wing_area", "mass.weight")


def flightpower(*arguments: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "flightpower", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


def test_help_lists_every_command_and_loads_none() -> None:
    code = (
        "import sys; from typer.testing import CliRunner; from flightpower.command import app\n"
        "print(CliRunner().invoke(app, ['--help']).output)\n"
        "print('LOADED', [m for m in ('numpy', 'casadi', 'pandas', 'analysis', 'sim', 'daq') if m in sys.modules])"
    )
    outcome = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    for name in ("analyze", "calibrate", "sim", "daq", "new"):
        assert f" {name} " in outcome.stdout
    assert "LOADED []" in outcome.stdout


def test_a_name_in_another_encoding_is_refused_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    latin_1 = b"Fl\xfcgel.toml".decode("utf-8", "surrogateescape")
    monkeypatch.setattr(sys, "argv", ["flightpower", "new", "aircraft", "-o", latin_1])
    with pytest.raises(SystemExit, match="2"):
        umbrella.main()
    assert "Fl?gel.toml: not in the system's encoding" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("command", [[], *([name] for name in umbrella.SIDES)])
def test_every_command_tells_the_version(
    command: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "argv", ["flightpower", *command, "--version"])
    umbrella.main()
    assert capsys.readouterr().out == f"flightpower {version()}\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("analyze", "--help"), "--weight"),
        (("calibrate", "probe", "--help"), "--angle-scale"),
        (("sim", "fly", "--help"), "--plan"),
        (("daq", "config", "--example"), "rate_Hz"),
        (("new", "aircraft", "--help"), "--like"),
    ],
)
def test_each_command_is_under_it(arguments: tuple[str, ...], message: str) -> None:
    outcome = flightpower(*arguments)
    assert outcome.returncode == 0 and message in outcome.stdout


def test_bad_input_is_one_line_under_it_too(tmp_path: Path) -> None:
    outcome = flightpower("analyze", tmp_path / "none.mcap")
    assert outcome.returncode == 2
    (line,) = outcome.stderr.strip().splitlines()
    assert line.startswith("error: ") and "none.mcap" in line


def test_a_side_that_is_not_installed_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(umbrella, "find_spec", lambda name: None if name == "scipy" else object())
    with pytest.raises(InputError, match=r'scipy not installed; in the clone: pip install "\.\[analysis\]"'):
        umbrella.load("analyze")


def test_help_of_a_side_that_is_not_installed_is_shown_where_it_can_be(monkeypatch: pytest.MonkeyPatch) -> None:
    """`fleet` loads what its extra installs when it runs; a module that cannot be loaded says what to install."""
    monkeypatch.setattr(umbrella, "find_spec", lambda name: None if name == "fsspec" else object())
    shown = CliRunner().invoke(umbrella.app, ["fleet", "--help"])
    assert shown.exit_code == 0 and "Add flights to the dataset of a fleet" in shown.output
    with pytest.raises(InputError, match="fsspec not installed"):
        umbrella.load("fleet")
    monkeypatch.setattr(umbrella.importlib, "import_module", Mock(side_effect=ImportError("no fsspec")))
    with pytest.raises(InputError, match="fsspec not installed"):
        umbrella.load("fleet", help_alone=True)


def test_completion_knows_the_options_of_a_command(monkeypatch: pytest.MonkeyPatch) -> None:
    words = "flightpower analyze --pro"
    environment = {"_FLIGHTPOWER_COMPLETE": "complete_bash", "COMP_WORDS": words, "COMP_CWORD": "2"}
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    assert "--propeller" in flightpower().stdout


def test_the_blank_aircraft_asks_for_what_is_required_and_is_an_aircraft_when_filled_in() -> None:
    text = templates.blank()
    with pytest.raises(InputError) as caught:
        parse_aircraft(text, "my.toml")
    assert [key in str(caught.value) for key in REQUIRED] == [True] * len(REQUIRED)
    for key in REQUIRED:
        text = text.replace('"?"', EXAMPLES[key], 1)
    own_aircraft = parse_aircraft(text, "my.toml")
    assert own_aircraft.mass_kg == pytest.approx(4) and not own_aircraft.has("mass.Ix")


def test_the_blank_aircraft_is_printed_in_utf_8_whatever_the_terminal_s_encoding(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "cp1252")
    line = [sys.executable, "-m", "flightpower", "new", "aircraft"]
    printed = subprocess.run(line, capture_output=True, check=True, timeout=120).stdout
    assert printed.decode("utf-8").splitlines() == templates.blank().splitlines()


def test_every_line_of_the_blank_aircraft_can_be_used() -> None:
    text = templates.blank()
    for key in REQUIRED:
        text = text.replace('"?"', EXAMPLES[key], 1)
    lines = []
    for line in text.splitlines():
        bare = line.removeprefix("# ")
        lines.append(bare if bare.startswith("[") or bare.split(" = ")[0].isidentifier() else line)
    own_aircraft = parse_aircraft("\n".join(lines), "my.toml")
    alike = ("aileron", "rudder", "probe.lines.beta", "probe.lines.airspeed", "probe.lines.static", "aerodynamics")
    assert own_aircraft.keys >= {key for key in EXAMPLES if not key.startswith(alike)}


@pytest.mark.parametrize("name", shipped_aircraft())
def test_a_template_like_a_shipped_aircraft_is_that_aircraft(name: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    assert flightpower("new", "aircraft", "--like", name, "-o", path).returncode == 0
    own_aircraft, model = as_complete(path.read_text("utf-8"), "mine.toml"), load_aircraft(name)
    assert own_aircraft.name == "mine"
    for part in ("geometry", "mass", "propulsion", "elevator", "aileron", "rudder", "probe", "aerodynamics"):
        there, here = tomllib.loads(model.text)[part], tomllib.loads(own_aircraft.text)[part]
        assert there == here, part
    assert own_aircraft.imu_position_m == model.imu_position_m


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("mine")
    for kind in ("aircraft", "tray"):
        outcome = flightpower("new", kind, "-o", path)
        assert outcome.returncode == 2 and "--replace" in outcome.stderr and path.read_text() == "mine"


def test_a_new_tray_names_the_aircraft(tmp_path: Path) -> None:
    path = tmp_path / "tray.toml"
    for name in ("my.toml", r"C:\new\my.toml"):
        assert flightpower("new", "tray", "-o", path, "--aircraft", name, "--replace").returncode == 0
        assert str(load_tray(path).aircraft).endswith(name)


@pytest.mark.skipif(not THREADS.is_dir(), reason="threads are counted in /proc (Linux)")
@pytest.mark.parametrize("name", ["analyze", "flightpower export"])
def test_a_command_computes_in_one_thread_unless_the_user_asks_for_more(name: str) -> None:
    """The setting would come too late after NumPy was imported, as the modules of the commands do."""
    main, *words = name.split()
    code = (
        f"import os, sys; from flightpower import scripts; sys.argv = {[main, *words, '--version']}; scripts.{main}();"
        f"print('numpy' in sys.modules, len(os.listdir('{THREADS}')))"
    )
    unset = {key: value for key, value in os.environ.items() if not key.endswith("_NUM_THREADS")}
    output = [
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True).stdout
        for environment in (unset, unset | {"OMP_NUM_THREADS": "2"})
    ]
    assert [item.splitlines()[-1] for item in output] == ["True 1", "True 2" if (os.cpu_count() or 1) > 1 else "True 1"]


@pytest.mark.parametrize("name", ["analyze", "flightpower analyze"])
def test_the_report_keeps_the_command_as_it_was_typed(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    command_lines: list[str] = []

    def analyze_log(log: Path, folder: Path, options: object, progress: object, command_line: str) -> None:
        command_lines.append(command_line)
        raise InputError("no log")

    monkeypatch.setattr("flightpower.analysis.cli.analyze.analyze_log", analyze_log)
    typed = [*name.split(), "my log.mcap", "-q"]
    monkeypatch.setattr(sys, "argv", typed)
    with pytest.raises(SystemExit):
        getattr(scripts, typed[0])()
    assert [shlex.split(command_line) for command_line in command_lines] == [typed]
