"""Measures the CPU time of each part of the daemon per tick: of threads as counted by the kernel, and of the sampling
thread's steps.

`python benchmarks/bench.py daemon-threads` counts everything in real time on device files (needs root): system calls,
the kernel's side of I2C transfers, thread switches, cold caches. `--with before=HEAD~5` also measures an earlier
version, by turns. `daemon-parts` measures only the Python code, on the simulated clock in one thread with warm caches,
without the fake parts and the cost of counting.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple
from unittest.mock import patch

from records import Record, rounded
from speed import checked_out

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / "daq" / "tray.example.toml"
DAEMON = ROOT / "benchmarks" / "daemon.py"
CALIBRATION_CALLS = 2000
SETTLED_S = 7.0  # time for imports, startup and configuration, which is not counted


class Usage(NamedTuple):
    """Usage of one thread since its start."""

    run_ns: int
    switches: int  # number of thread switches


def threads_of(process_id: int) -> dict[int, Usage]:
    """Return the usage of every thread, in the order in which the threads were started."""
    usage = {}
    for task in sorted(Path(f"/proc/{process_id}/task").iterdir(), key=lambda path: int(path.name)):
        status = (task / "status").read_text().splitlines()
        switches = sum(int(line.split()[1]) for line in status if "ctxt_switches" in line)
        usage[int(task.name)] = Usage(int((task / "schedstat").read_text().split()[0]), switches)
    return usage


def account(code: Path, tray: Path, seconds: float, rate: float, *, fifo: bool) -> list[tuple[float, float]]:
    """Return CPU time [us] and thread switches per tick for each thread of a daemon that runs `code`."""
    module = "flightpower.daq" if (code / "flightpower" / "daq").exists() else "daq"  # its name in earlier versions
    command = [*(["chrt", "-f", "50"] if fifo else []), sys.executable, "-m", module, "run", "-c", str(tray)]
    environment = os.environ | {"PYTHONPATH": str(code)}
    daemon = subprocess.Popen(command, cwd=code, env=environment, stderr=subprocess.DEVNULL)
    try:
        time.sleep(SETTLED_S)
        before, begin_s = threads_of(daemon.pid), time.monotonic()
        time.sleep(seconds)
        after, ticks = threads_of(daemon.pid), (time.monotonic() - begin_s) * rate
    finally:
        daemon.send_signal(signal.SIGTERM)
        daemon.wait(20)
    return [
        ((new.run_ns - before[id].run_ns) / 1e3 / ticks, (new.switches - before[id].switches) / ticks)
        for id, new in after.items()
        if id in before
    ]


THREADS = ["sampling: collect, encode, compress", "disk: write, sync", "free space", "bus 1: eight transfers",
           "bus 2: three transfers", "three serial lines"]  # fmt: skip


def thread_records(
    *, seconds: float = 20.0, rate: float = 25.0, fifo: bool = True, before: str = "", rounds: int = 2
) -> list[Record]:
    """Return CPU time and thread switches per tick for every thread, as medians of the rounds."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        command = [sys.executable, str(DAEMON), "serve", str(folder), "--rate", str(rate)]
        command = [*(["chrt", "-f", "60"] if fifo else []), *command]
        fakes = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert fakes.stdout is not None
        try:
            assert fakes.stdout.readline() == "ready\n", "the fake tray did not come up (FUSE needs root)"
            versions = {"now": ROOT}
            if before:
                versions = {before: checked_out(before, folder / "before"), **versions}
            intervals: dict[str, list[list[tuple[float, float]]]] = defaultdict(list)
            for _ in range(rounds):
                for version, code in versions.items():
                    intervals[version].append(account(code, folder / "tray.toml", seconds, rate, fifo=fifo))
        finally:
            fakes.send_signal(signal.SIGTERM)
            fakes.wait(10)
    rows = []
    for i, thread in enumerate([*THREADS, "all"]):
        row: Record = {"thread": thread}
        us = []
        for version, runs in intervals.items():
            of_runs = [run[i] if i < len(THREADS) else tuple(map(sum, zip(*run, strict=True))) for run in runs]
            us.append(median(usage[0] for usage in of_runs))
            row |= {f"us, {version}": rounded(us[-1])}
            row |= {f"switches, {version}": rounded(median(usage[1] for usage in of_runs), 1)}
        rows.append(row | ({"ratio": rounded(us[-1] / us[0], 2)} if before else {}))
    shares = {name: f"{us * rate / 1e4:.2f} %" for name, us in rows[-1].items() if name.startswith("us, ")}
    return [*rows, {"thread": "all, of one core", **shares}]


class Parts:
    """Adds up the CPU time of named parts of the calling thread; an outer part does not count the parts inside it.

    The cost of counting is measured first and subtracted.
    """

    def __init__(self) -> None:
        self._inside_ns = self._outside_ns = 0.0  # cost of counting, in the counted part and in the part around it
        self.spent_ns: dict[str, float] = defaultdict(float)
        self._running: list[str] = []
        self._since_ns = 0
        self.wrappers = ExitStack()
        nothing = self.timed(lambda: None, "inside")
        self.enter("outside")
        for _ in range(CALIBRATION_CALLS):
            nothing()
        self.leave()
        inside_ns, outside_ns = self.spent_ns["inside"], self.spent_ns["outside"]
        self.spent_ns.clear()
        self._inside_ns, self._outside_ns = inside_ns / CALIBRATION_CALLS, outside_ns / CALIBRATION_CALLS

    def enter(self, part: str) -> None:
        self._charge()
        self._running.append(part)

    def leave(self) -> None:
        self._charge()
        self.spent_ns[self._running.pop()] -= self._inside_ns
        if self._running:
            self.spent_ns[self._running[-1]] -= self._outside_ns

    def timed(self, original: Callable[..., Any], part: str) -> Callable[..., Any]:
        """Return a function whose every call is counted as `part`."""

        def timed(*arguments: Any, **options: Any) -> Any:
            self.enter(part)
            try:
                return original(*arguments, **options)
            finally:
                self.leave()

        return timed

    def wrap(self, owner: Any, method: str, part: str) -> None:
        """Count every call of a method as `part` until `wrappers` is closed."""
        self.wrappers.enter_context(patch.object(owner, method, self.timed(getattr(owner, method), part)))

    def _charge(self) -> None:
        now_ns = time.thread_time_ns()
        if self._running:
            self.spent_ns[self._running[-1]] += now_ns - self._since_ns
        self._since_ns = now_ns


FAKES = "the fake parts"


def part_records(*, seconds: float = 60.0) -> list[Record]:
    """Return the CPU time per tick of the daemon's parts, in one thread on the simulated clock."""
    sys.path.append(str(ROOT / "tests" / "hw_fakes"))
    from analytic_sensor_truth import AnalyticSensorTruth

    from flightpower.daq.bus_worker import BusWorker
    from flightpower.daq.config import TelemetryConfig, parse_tray
    from flightpower.daq.daemon import record
    from flightpower.daq.log_files import LogFiles
    from flightpower.daq.recorder import Recorder
    from flightpower.daq.sensor_supervisor import SensorSupervisor
    from flightpower.daq.telemetry import TelemetryLink
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.tray import FakeTray

    counted, clock = Parts(), SimulatedClock()
    fake = FakeTray(AnalyticSensorTruth(), clock, 2)

    class Wrapped:
        """A bus or port whose time counts as the fake parts' time."""

        def __init__(self, transport: Any):
            for name in ("read", "write", "write_read", "read_available"):
                if hasattr(transport, name):
                    setattr(self, name, counted.timed(getattr(transport, name), FAKES))

    class Buses:
        def i2c(self, device: str) -> Any:
            return Wrapped(fake.i2c(device))

        def port(self, device: str, baud: int) -> Any:
            return Wrapped(fake.port(device, baud))

    begin_driver = SensorSupervisor._begin

    def begin(supervisor: SensorSupervisor) -> None:
        begin_driver(supervisor)
        counted.wrap(supervisor._sensor, "read", "drivers")

    with tempfile.TemporaryDirectory() as name, counted.wrappers as wrappers:
        wrappers.enter_context(patch.object(SensorSupervisor, "_begin", begin))
        counted.wrap(SimulatedClock, "sleep_until_ns", FAKES)
        counted.wrap(SensorSupervisor, "read", "supervision of sensors")
        counted.wrap(BusWorker, "collect", "bus workers")
        counted.wrap(Recorder, "_close_chunk", "compressing and indexing chunks")
        counted.wrap(Recorder, "write", "encoding messages")
        counted.wrap(LogFiles, "update", "files")
        counted.wrap(TelemetryLink, "on_cycle", "telemetry")
        tray = parse_tray(EXAMPLE.read_text("utf-8"), "tray.toml", Path(name))
        link = TelemetryLink(TelemetryConfig(to="udp:127.0.0.1:9"), tray)
        until_ns = clock.now_ns() + round(seconds * 1e9)
        counted.enter("the loop")
        done = record(tray, buses=Buses(), clock=clock, until_ns=until_ns, listener=link, report=lambda status: None)  # type: ignore[arg-type]
        counted.leave()
        link.close()
    fakes_ns = counted.spent_ns.pop(FAKES)
    spent_ns = dict(sorted(counted.spent_ns.items(), key=lambda item: -item[1]))
    spent_ns |= {"all": sum(spent_ns.values()), f"({FAKES})": fakes_ns}
    return [{"part": part, "us a tick": rounded(ns / 1e3 / done.ticks, 1)} for part, ns in spent_ns.items()]
