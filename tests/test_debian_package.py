"""The Debian package, short of building it: `make deb` and `make vm` do that."""

import importlib.util
import itertools
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
SPEC = importlib.util.spec_from_file_location("debian_package", ROOT / "debian" / "build.py")
assert SPEC and SPEC.loader
build = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(build)


def text(name: str) -> str:
    return (ROOT / "debian" / name).read_text("utf-8")


@pytest.mark.skipif(not shutil.which("dpkg"), reason="dpkg is not here")
def test_a_later_version_of_python_s_is_a_later_one_of_debian_s():
    versions = ["1.0.0.dev3+gb2bb9085e", "1.0.0rc1", "1.0.0", "1.0.1.dev2+g0123456", "1.0.1", "1.1.0"]
    for older, newer in itertools.pairwise(map(build.debian_version, versions)):
        assert subprocess.run(["dpkg", "--compare-versions", older, "lt", newer]).returncode == 0, (older, newer)


def test_the_package_has_every_file_of_the_service(tmp_path):
    """They are the units with the package's command in place of the one in /opt."""
    (tmp_path / "usr/lib/flightpower/bin").mkdir(parents=True)
    build.files_of_the_system(tmp_path)
    packed = {path.name: path for path in tmp_path.rglob("*") if path.is_file()}
    names = {"flightpower.sysusers": "flightpower.conf", "tray.sh": "flightpower-tray"}
    needed = {names.get(path.name, path.name) for path in (ROOT / "systemd").iterdir()}
    assert needed - {"install.sh", "uninstall.sh"} <= packed.keys()
    for unit in (path for name, path in packed.items() if name.endswith(".service")):
        (command,) = re.findall(r"^ExecStart=(\S+)", unit.read_text(), re.MULTILINE)
        assert (tmp_path / command[1:]).stat().st_mode & 0o111 and "/opt/" not in unit.read_text()


def test_a_command_of_the_package_starts_this_program_and_no_other(tmp_path):
    """It imports its own package, not files of the current folder or of PYTHONPATH."""
    program = tmp_path / "daq"
    program.write_text(build.PROGRAM.format("daq"))
    (tmp_path / "flight.py").write_text("raise SystemExit(77)")
    command = build.COMMAND.format("daq").replace("/usr/lib/flightpower/bin/python3", sys.executable)
    command = command.replace("/usr/lib/flightpower/bin/daq", str(program))
    where = f"import sys; sys.path.append({str(ROOT)!r})\n"
    program.write_text(where + program.read_text())
    done = subprocess.run(
        ["sh", "-c", command, "daq", "--help"], cwd=tmp_path, env=os.environ | {"PYTHONPATH": str(tmp_path)},
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0 and "Usage: daq " in done.stdout


def test_the_package_asks_for_a_python_that_its_modules_are_built_for():
    """Debian's relations are alternatives of comparisons, for the newest version, the oldest, and the gap between
    them."""
    (relations,) = re.findall(r"^Depends: ((?:.*\n)(?: .*\n)*)", text("control"), re.MULTILINE)
    parts = [part for part in relations.replace("\n", "").split(",") if "python3 " in part]

    def fits(version: tuple[int, ...]) -> bool:
        holds = {"<<": lambda limit: version < limit, ">=": lambda limit: version >= limit}
        return all(
            any(
                holds[sign](tuple(map(int, bound.split("."))))
                for sign, bound in re.findall(r"\((\S+) ([\d.]+)\)", part)
            )
            for part in parts
        )

    fitting = [f"3.{minor}" for minor in range(9, 16) if fits((3, minor))]
    assert fitting == list(build.PYTHONS)


@pytest.mark.parametrize("architecture", ["amd64", "arm64"])
def test_what_building_needs_is_named_first_and_in_one_line(tmp_path, architecture):
    """Only a Python without libraries is there: not even the environment of `make` has been made."""
    command = [sys.executable, "-I", "-S", str(ROOT / "debian/build.py"), "--architecture", architecture, "--needs"]
    done = subprocess.run(command, env={"PATH": str(tmp_path)}, capture_output=True, text=True)
    (line,) = done.stderr.splitlines()
    processor = {"amd64": "x86-64", "arm64": "aarch64"}[architecture]
    assert done.returncode == 1 and line.startswith("the package needs: sudo apt-get install")
    assert {"dpkg-dev", "debhelper", "help2man", "gcc-avr", f"binutils-{processor}-linux-gnu"} <= set(line.split())
    tools = [*build.NEEDED, build.Architecture(architecture).strip_tool]
    for tool in tools:
        (tmp_path / tool).touch(mode=0o755)
    done = subprocess.run(command, env={"PATH": str(tmp_path)}, capture_output=True, text=True)
    assert not set(done.stderr.split()) & set(build.NEEDED.values())


def test_a_purge_keeps_what_the_user_has_made(tmp_path):
    """Calibrations take a day at a wind tunnel and stay; what the package and its commands have made is removed."""
    etc, logs = tmp_path / "etc/flightpower", tmp_path / "var/lib/flightpower"
    etc.mkdir(parents=True)
    logs.mkdir(parents=True)
    script = text("flightpower.postrm").replace("/etc/", f"{tmp_path}/etc/").replace("/var/", f"{tmp_path}/var/")
    script = script.replace("/run/udev", f"{tmp_path}/run")
    for name in ("tray.toml", "zero.json", "check.json", "probe.json", "my.toml"):
        (etc / name).touch()
    (logs / "log-0001.mcap").touch()
    subprocess.run(["sh", "-c", script, "postrm", "purge"], check=True)
    assert {path.name for path in etc.iterdir()} == {"probe.json", "my.toml"} and list(logs.iterdir())
    for path in etc.iterdir():
        path.unlink()
    subprocess.run(["sh", "-c", script, "postrm", "purge"], check=True)
    assert not etc.exists()
