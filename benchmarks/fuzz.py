"""Feeds millions of inputs to every parser of external bytes, guided by the code that they reach (atheris, libFuzzer).

    pip install 'flightpower[fuzz]'
    .venv/bin/python benchmarks/fuzz.py run --inputs 1000000        # each target in turn, shared out equally
    .venv/bin/python benchmarks/fuzz.py one ublox --inputs 50000    # one target

An input that finds a defect is kept in tests/data/fuzz/TARGET, which a test replays. Inputs start from shipped files
and valid frames. A defect is any exception that its target does not permit, 10 s for one input, or 1 GB of memory.
"""

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import typer

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))
KEPT = ROOT / "tests" / "data" / "fuzz"
SEEDS: dict[str, list[str]] = {
    "tray": ["daq/tray.example.toml"],
    "aircraft": ["flight/data/aircraft/*.toml"],
    "propeller": ["flight/data/propellers/*.csv", "tests/data/propellers/*"],
    "plan": ["sim/plans/*.toml"],
    "probe": ["sim/data/*.json", "flight/data/*.json"],
}
LONGEST_BYTES = 60_000  # longest input for a file
LONGEST_STREAM_BYTES = 2_000  # longest input for a driver
FILES = (
    "tray",
    "aircraft",
    "propeller",
    "zero",
    "plan",
    "probe",
    "magnetometer",
    "log",
    "ulog",
    "dataflash",
    "dataflash-text",
    "telemetry",
    "electrical",
    "electrical-ulog",
)
SLOWEST_S = 10
MEMORY_MB = 1000
# Share of the inputs, if not 1: whole files take a thousand times as long as a frame.
SHARE = {
    "log": 0.1,
    "ulog": 0.02,
    "dataflash": 0.05,
    "dataflash-text": 0.02,
    "telemetry": 0.02,
    "electrical": 0.005,
    "electrical-ulog": 0.005,
    "aircraft": 0.3,
    "propeller": 0.3,
    "plan": 0.3,
    "tray": 0.5,
}

app = typer.Typer(add_completion=False, no_args_is_help=True, help=__doc__)


def seeds(name: str, folder: Path) -> None:
    """Put the initial inputs of a target into a folder."""
    from altered_logs import TARGETS, small_log  # import it only now, after its own imports have been instrumented

    patterns = SEEDS.get(name, [])
    for number, path in enumerate(path for pattern in patterns for path in sorted(ROOT.glob(pattern))):
        (folder / f"seed-{number}").write_bytes(path.read_bytes()[:LONGEST_BYTES])
    for target in TARGETS:
        if name == target.name:
            small_log(folder / f"seed-log{target.suffix}", *target.log)
    if name == "log":
        record_a_log(folder / "seed-log")
    if name in ("ublox", "ublox-ddc", "counter", "counter-framed", "autopilot"):
        (folder / "seed-frames").write_bytes(frames(name))
    for path in (KEPT / name).glob("*"):
        shutil.copy(path, folder / path.name)


def record_a_log(path: Path) -> None:
    from flightpower.daq.config import parse_tray
    from flightpower.daq.daemon import record
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.tray import FakeTray

    sys.path.append(str(ROOT / "tests" / "hw_fakes"))
    from analytic_sensor_truth import AnalyticSensorTruth

    clock = SimulatedClock()
    tray = parse_tray((ROOT / "daq" / "tray.example.toml").read_text(), "tray.toml", path.parent)
    log = path.parent / "whole.mcap"
    record(
        tray,
        buses=FakeTray(AnalyticSensorTruth(), clock),
        clock=clock,
        log_path=log,
        until_ns=clock.now_ns() + 2 * 10**9,
    )
    path.write_bytes(log.read_bytes()[:LONGEST_BYTES])


def frames(name: str) -> bytes:
    """Return the frames that a fake part sends in a second."""
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.tray import AUTOPILOT_PORT, ESC_PORT, GPS_PORT, FakeTray, TrayVariant

    sys.path.append(str(ROOT / "tests" / "hw_fakes"))
    from analytic_sensor_truth import AnalyticSensorTruth

    clock = SimulatedClock()
    tray = FakeTray(AnalyticSensorTruth(), clock, variant=TrayVariant(rpm_with_crc=name == "counter-framed"))
    device = {"autopilot": AUTOPILOT_PORT, "ublox": GPS_PORT, "ublox-ddc": GPS_PORT}.get(name, ESC_PORT)
    port = tray.port(device, 38400 if device == GPS_PORT else 115200 if device == ESC_PORT else 57600)
    clock.advance_ns(10**9)
    return port.read_available()


@app.command("one")
def one_target(name: str, inputs: int = 50_000, seed: int = 1) -> None:
    """Fuzz one target in this process. Ends at the first defect."""
    import atheris

    with atheris.instrument_imports(
        include=[
            "daq",
            "flight",
            "flightpower.analysis.sources",
            "flightpower.analysis.air",
            "flightpower.analysis.methods.whole_flight",
        ]
    ):
        from tests.fuzz_targets import TARGETS
    folder = Path(tempfile.mkdtemp())
    corpus = folder / "corpus"
    corpus.mkdir()
    seeds(name, corpus)
    (KEPT / name).mkdir(parents=True, exist_ok=True)
    longest = LONGEST_BYTES if name in FILES else LONGEST_STREAM_BYTES
    atheris.Setup(
        [
            sys.argv[0],
            str(corpus),
            f"-runs={inputs}",
            f"-seed={seed}",
            f"-max_len={longest}",
            f"-timeout={SLOWEST_S}",
            f"-rss_limit_mb={MEMORY_MB}",
            f"-artifact_prefix={KEPT / name}/",
            "-print_final_stats=1",
            "-verbosity=0",
        ],
        TARGETS[name],
    )
    atheris.Fuzz()


@app.command()
def run(inputs: int = 1_000_000, seed: int = 1) -> None:
    """Fuzz each target in its own process; exit code 1 if one of them found a defect."""
    from tests.fuzz_targets import TARGETS

    total = sum(SHARE.get(name, 1.0) for name in TARGETS)
    defects, done = [], 0
    for name in TARGETS:
        count = round(inputs * SHARE.get(name, 1.0) / total)
        command = [sys.executable, __file__, "one", name, "--inputs", str(count), "--seed", str(seed)]
        finished = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
        done += count
        print(f"{name:15} {count:8} inputs: {'no defect' if not finished.returncode else 'DEFECT'}", flush=True)
        if finished.returncode:
            defects.append(name)
            print("\n".join(finished.stderr.splitlines()[-25:]), flush=True)
        elif not any((KEPT / name).iterdir()):
            (KEPT / name).rmdir()
    print(f"{done} inputs, {len(defects)} targets with defects: {', '.join(defects) or 'none'}")
    raise typer.Exit(bool(defects))


if __name__ == "__main__":
    app()
