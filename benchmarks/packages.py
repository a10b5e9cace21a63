"""Tests packages as a user gets them: builds the wheel twice, and runs it without a checkout on several Pythons.

    make packages                                                     # python3.11 to python3.14, each must be here
    .venv/bin/python benchmarks/packages.py --python /opt/python3.14  # this Python only
    .venv/bin/python benchmarks/packages.py --px4-log ../flight3.ulg  # and this real log, of the Seaway Mini
    .venv/bin/python benchmarks/packages.py --tests                   # and the tests of the unpacked sdist

With each Python, from the wheel, in an empty folder, beside the packages `analysis` and `daq` of the index: the
demonstration, an aircraft of the user's own flown and analyzed, flights pooled and added to a fleet, the page in the
browser, and with the extra [autopilot] only, without CasADi, a log of PX4; then neighbors and wheel are uninstalled by
turns, and the other must still work. Packages come from pip's index, the newest that pyproject.toml allows. Exit code 1
if a command fails, if the wheels differ in a byte, if twine, check-wheel-contents or pyroma find a fault, or if a
license is unknown or the GPL. In
build/packages/dist are the packages, a bill of materials (CycloneDX), the licenses, and hashes.txt, which fixes every
file that is installed: `pip install --require-hashes -r hashes.txt`, then `pip install --no-deps WHEEL`.
"""

import hashlib
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
import urllib.request
from functools import partial
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

ROOT = Path(__file__).resolve().parent.parent
PYTHONS = ("python3.11", "python3.12", "python3.13", "python3.14")
TOOLS = ("build", "check-wheel-contents", "cyclonedx-bom", "pip-licenses", "pyroma", "twine", "uv")
HASHED = ("fleet", "sim", "plot", "status")  # the extras that are meant for users
LEAST_RATING = 8  # of pyroma's 10; two are for addresses of home page and authors, which pyproject.toml lacks
NEIGHBORS = ("analysis", "daq")  # others' packages on the index, named like our parts; `flight` cannot be installed
# Checks that each module of the named packages is as it was installed. (The index's `daq` cannot be imported without
# Dask. Its command has our command's name, and the last one installed wins: README then says `flightpower daq`.)
INTACT = """
import base64, hashlib, sys
from importlib.metadata import files
for name in sys.argv[1:]:
    for file in files(name):
        if file.hash and ".." not in file.parts:
            assert base64.urlsafe_b64decode(file.hash.value + "=") == hashlib.sha256(file.read_binary()).digest(), file
"""
MINE = """name = "mine"
[geometry]
span = "1.75 m"
wing_area = "0.464 m^2"
[mass]
weight = "3.84 kg"
"""
OF_THE_AIRCRAFT = ("--mass", "3.84 kg", "--wing-area", "0.464 m^2", "--span", "1.75 m")
OF_THE_SEAWAY = ("--mass", "9.4 kg", "--wing-area", "1.499 m^2", "--span", "4 m")
FLIGHTS = 3
REFUSED = re.compile(r"UNKNOWN|Affero|AGPL|(?<!Lesser )General Public|(?<!L)GPL-")


class Row(NamedTuple):
    what: str
    good: bool
    seen: str


class Bench:
    """Runs commands in a folder and keeps a row for each; the output of all goes to a log next to it."""

    def __init__(self, folder: Path):
        self.folder = folder
        self.rows: list[Row] = []

    def run(self, what: str, *command: object, cwd: Path | None = None, **environment: str) -> str:
        """Return the command's output, and add a row with its time or its error."""
        begin_s = time.monotonic()
        done = subprocess.run(
            [str(word) for word in command], cwd=cwd or self.folder, capture_output=True, text=True,
            stdin=subprocess.DEVNULL, env=clean_environment() | environment,
        )  # fmt: skip
        output = (done.stdout + done.stderr).strip()
        seen = f"{time.monotonic() - begin_s:.0f} s" if done.returncode == 0 else f"{done.returncode}: {output[-300:]}"
        self.add(what, done.returncode == 0, seen)
        return output

    def add(self, what: str, good: bool, seen: str) -> None:
        self.rows.append(Row(what, good, seen))
        print(f"{'ok    ' if good else 'FAILED'} {what}: {seen}", flush=True)


def clean_environment() -> dict[str, str]:
    """Return the environment of a user, who has no checkout on the path."""
    return {name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "VIRTUAL_ENV")}


def main(
    folder: Path = ROOT / "build" / "packages",
    python: Annotated[list[str] | None, typer.Option(help="Try this Python; may be given several times.")] = None,
    tests: Annotated[bool, typer.Option("--tests", help="Run the tests of the unpacked sdist, too.")] = False,
    wheel: Annotated[Path | None, typer.Option(help="A wheel that was built before, in place of building.")] = None,
    px4_log: Annotated[Path | None, typer.Option(help="Analyze this log of the Seaway Mini, too.")] = None,
) -> None:
    """Build and try the packages."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    bench = Bench(folder.resolve())
    sdist = None
    if wheel is None:
        wheel, sdist = built(bench)
    interpreters = {name: shutil.which(name) for name in python or PYTHONS}
    for name, path in interpreters.items():
        if path is None or subprocess.run([path, "-c", ""], capture_output=True).returncode:
            bench.add(f"{name}", False, "is not here; give its path with --python")
        else:
            tried(bench, Path(path), wheel.resolve(), px4_log and px4_log.resolve())
    if sdist is not None:
        supply(bench, hashed(bench, wheel.resolve()))
    if tests and sdist is not None:
        test_sdist(bench, sdist)
    failed = [row for row in bench.rows if not row.good]
    print(f"{len(bench.rows) - len(failed)} of {len(bench.rows)} good")
    sys.exit(bool(failed))


def built(bench: Bench) -> tuple[Path, Path]:
    """Build and check wheel and sdist; build the wheel a second time, from the sdist, and compare."""
    tools = bench.folder / "tools" / "bin"
    bench.run("tools", sys.executable, "-m", "venv", tools.parent)
    bench.run("tools installed", tools / "pip", "install", "--quiet", *TOOLS)
    committed = subprocess.run(
        ["git", "log", "-1", "--format=%ct"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    epoch = {"SOURCE_DATE_EPOCH": committed.stdout.strip()}
    bench.run("sdist and wheel", tools / "python", "-m", "build", "--outdir", "dist", ROOT, **epoch)
    (sdist,), (wheel,) = ((bench.folder / "dist").glob(pattern) for pattern in ("*.tar.gz", "*.whl"))
    source = unpacked(sdist, bench.folder / "sdist")
    bench.run("wheel again", tools / "python", "-m", "build", "--wheel", "--outdir", "again", source, **epoch)
    again = bench.folder / "again" / wheel.name
    digests = [hashlib.sha256(path.read_bytes()).hexdigest()[:12] for path in (wheel, again)]
    bench.add("wheels equal to the byte", digests[0] == digests[1], " ".join(digests))
    bench.run("twine", tools / "twine", "check", "--strict", sdist, wheel)
    bench.run("check-wheel-contents", tools / "check-wheel-contents", "--config", ROOT / "pyproject.toml", wheel)
    output = bench.run("pyroma", tools / "pyroma", "--min", LEAST_RATING, sdist)
    bench.add("pyroma's rating", "rating" in output, "".join(re.findall(r"rating: (\S+)", output)))
    return wheel, sdist


def unpacked(sdist: Path, folder: Path) -> Path:
    """Unpack an sdist into `folder`, and return the project's folder in it."""
    folder.mkdir(parents=True, exist_ok=True)
    subprocess.run(["tar", "-xf", sdist, "-C", folder], check=True)
    (source,) = folder.iterdir()
    return source


def environment(bench: Bench, python: Path, wheel: Path, extras: str, folder: Path) -> Path:
    """Make a new environment with the wheel and packages of the same names, and return its command folder."""
    what = f"{folder.parent.name} [{extras}]"
    bench.run(f"{what} environment", python, "-m", "venv", folder)
    pip = (folder / "bin" / "pip", "install", "--quiet")
    bench.run(f"{what} neighbors installed", *pip, *NEIGHBORS)
    bench.run(f"{what} installed", *pip, f"{wheel}[{extras}]")
    return folder / "bin"


def tried(bench: Bench, python: Path, wheel: Path, px4_log: Path | None) -> None:
    """Do what a user does, from the wheel, with one Python."""
    outcome = subprocess.run([python, "-c", "import sys; print(*sys.version_info[:2], sep='.')"], capture_output=True)
    version = outcome.stdout.decode().strip()
    place = bench.folder / version
    work = place / "work"
    work.mkdir(parents=True)
    commands = environment(bench, python, wheel, "fleet,sim", place / "venv")
    if not (commands / "flightpower").exists():
        return

    def step(what: str, program: str, *words: object) -> None:
        bench.run(f"{version} {what}", commands / program, *words, cwd=work)

    step("version", "flightpower", "--version")
    step("demo: fly", "sim", "fly", "--plan", "demo", "-o", "demo")
    step("demo: analyze", "analyze", "demo/log.mcap")
    (work / "my.toml").write_text(MINE)
    step("own aircraft, five keys", "analyze", "demo/log.mcap", "--aircraft", "my.toml", "-o", "mine")
    step("own aircraft: file", "flightpower", "new", "aircraft", "--like", "nexstar", "-o", "like.toml")
    step("own aircraft: fly", "sim", "fly", "--aircraft", "like.toml", "--plan", "demo", "-o", "like")
    step("own aircraft: analyze", "analyze", "like/log.mcap", "--aircraft", "like.toml")
    for seed in range(FLIGHTS):
        step(f"flight {seed}", "sim", "fly", "--plan", "demo", "--no-hardware", "--seed", seed, "-o", f"flights/{seed}")
    logs = [f"flights/{seed}/log.mcap" for seed in range(FLIGHTS)]
    step("flights pooled", "analyze", *logs, "-o", "pool")
    step("fleet: add", "flightpower", "fleet", "add", "pool", "--to", "fleet")
    step("fleet: show", "flightpower", "fleet", "show", "fleet", "-o", "fleet-today")
    step("PX4: fly", "sim", "fly", "--plan", "ordinary-flight", "--as", "px4", "-o", "px4")
    page(bench, version, commands, work)
    light = environment(bench, python, wheel, "autopilot", place / "light")
    bench.add(f"{version} [autopilot] is without CasADi", not list(light.parent.rglob("casadi")), "")
    bench.run(f"{version} PX4: analyze", light / "analyze", "px4/log.ulg", *OF_THE_AIRCRAFT, cwd=work)
    if px4_log is not None:
        bench.run(f"{version} PX4, a real log", light / "analyze", px4_log, *OF_THE_SEAWAY, "-o", "real", cwd=work)
    bench.run(f"{version} neighbors uninstalled", commands / "pip", "uninstall", "--quiet", "--yes", *NEIGHBORS)
    step("analyze without neighbors", "analyze", "demo/log.mcap", "-o", "again")
    step("flightpower daq without neighbors", "flightpower", "daq", "--help")
    bench.run(f"{version} wheel uninstalled", light / "pip", "uninstall", "--quiet", "--yes", "flightpower")
    bench.run(f"{version} neighbors without the wheel", light / "python", "-c", INTACT, *NEIGHBORS)
    left = [path.name for path in light.iterdir() if path.name in ("analyze", "daq", "flightpower", "sim")]
    bench.add(f"{version} nothing is left of the wheel", not left, ", ".join(left))
    for name, used in (("[fleet,sim]", place / "venv"), ("[autopilot]", place / "light")):
        bytes_ = sum(path.lstat().st_size for path in used.rglob("*") if path.is_file())
        bench.add(f"{version} {name}", True, f"{bytes_ / 1e6:.0f} MB")


def supply(bench: Bench, python: Path) -> None:
    """Write a bill of materials and the licenses of what hashes.txt and the wheel install into dist."""
    tools, dist = bench.folder / "tools" / "bin", bench.folder / "dist"
    bill = ("--output-reproducible", "--output-format", "JSON", "--output-file", dist / "bom.json")
    bench.run("bill of materials", tools / "cyclonedx-py", "environment", *bill, python)
    licenses = ("--format=json", "--output-file", dist / "licenses.json")
    bench.run("licenses", tools / "pip-licenses", "--python", python, *licenses)
    license_by_name = {row["Name"]: row["License"] for row in json.loads((dist / "licenses.json").read_text())}
    refused = [f"{name}: {text}" for name, text in license_by_name.items() if REFUSED.search(text)]
    bench.add(
        "licenses are known, none is the GPL", not refused, ", ".join(refused) or f"{len(license_by_name)} packages"
    )


def hashed(bench: Bench, wheel: Path) -> Path:
    """Write the versions in constraints.txt with the hash of every file into dist.

    Returns the Python of an environment with only these packages and the wheel.
    """
    tools, folder, lock = bench.folder / "tools" / "bin", bench.folder / "hashed", bench.folder / "dist" / "hashes.txt"
    extras = [word for extra in HASHED for word in ("--extra", extra)]
    options = ("--universal", "--python-version", "3.11", "--generate-hashes", "--no-header", "--no-annotate", *extras)
    requirements = ("--constraint", ROOT / "constraints.txt", ROOT / "pyproject.toml")
    bench.run("hashes", tools / "uv", "pip", "compile", "--quiet", *options, *requirements, "--output-file", lock)
    bench.run("environment of hashed files", sys.executable, "-m", "venv", folder)
    pip = (folder / "bin" / "pip", "install", "--quiet")
    bench.run("hashed files installed", *pip, "--require-hashes", "-r", lock)
    bench.run("wheel beside hashed files", *pip, "--no-deps", wheel)
    bench.run("nothing is missing", folder / "bin" / "pip", "check")
    return folder / "bin" / "python"


def page(bench: Bench, version: str, commands: Path, work: Path) -> None:
    """Check that the page of the demonstration's flight is served, and that the server ends on request."""
    command = [commands / "flightpower", "open", "demo/log.mcap", "--no-browser"]
    served = subprocess.Popen(
        command, cwd=work, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=clean_environment(),
        preexec_fn=partial(signal.signal, signal.SIGINT, signal.SIG_DFL),  # a shell's background job ignores Ctrl-C
    )  # fmt: skip
    assert served.stdout is not None
    lines, address = [], None
    for line in served.stdout:
        lines.append(line)
        if address := re.search(r"http://\S+", line):
            break
    try:
        text = urllib.request.urlopen(address[0], timeout=60).read().decode() if address else ""
    except OSError as error:
        text, lines = "", [*lines, str(error)]
    finally:
        served.send_signal(signal.SIGINT)
        code = served.wait(60)
    good = "<html" in text and code == 0
    bench.add(f"{version} page", good, f"{len(text) / 1e3:.0f} kB" if good else f"{code}: {''.join(lines)[-300:]}")


def test_sdist(bench: Bench, sdist: Path) -> None:
    """Run `make test` in the unpacked sdist, which is not a checkout."""
    source = unpacked(sdist, bench.folder / "tested")
    output = bench.run("tests of the sdist", "make", "test", cwd=source)
    bench.add("tests of the sdist counted", " passed" in output, "".join(re.findall(r"\d+ passed.*", output)[-1:]))


if __name__ == "__main__":
    typer.run(main)
