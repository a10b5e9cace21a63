"""CPU time of each part of the daemon at each tick: threads by the kernel's account, and what the sampling thread does.

    .venv/bin/python benchmarks/daemon_parts.py threads                      # in real time on device files (needs root)
    .venv/bin/python benchmarks/daemon_parts.py threads --before HEAD~5      # and of an earlier version, by turns
    .venv/bin/python benchmarks/daemon_parts.py parts                        # the simulated clock, one thread

`threads` counts everything: system calls, the kernel's side of I2C transfers, changes of thread, cold caches. `parts`
is the Python code alone, with warm caches, without the fake parts and what counting takes.
"""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import typer
from rich.console import Console
from rich.table import Table
from speed import checked_out

ROOT = Path(__file__).resolve().parent.parent
EXAMPLE = ROOT / "daq" / "tray.example.toml"
DAEMON = ROOT / "benchmarks" / "daemon.py"
CALIBRATION_CALLS = 2000
SETTLED_S = 7.0  # after the start: imports, bringing up, configuring

app = typer.Typer(add_completion=False, no_args_is_help=True, help=__doc__)


class Usage(NamedTuple):
    """Usage of one thread since its start."""

    run_ns: int
    switches: int  # changes of thread


def threads_of(process_id: int) -> dict[int, Usage]:
    """Usage of every thread, in the order in which they were started."""
    usage = {}
    for task in sorted(Path(f"/proc/{process_id}/task").iterdir(), key=lambda path: int(path.name)):
        status = (task / "status").read_text().splitlines()
        switches = sum(int(line.split()[1]) for line in status if "ctxt_switches" in line)
        usage[int(task.name)] = Usage(int((task / "schedstat").read_text().split()[0]), switches)
    return usage


def account(code: Path, tray: Path, seconds: float, rate: float, *, fifo: bool) -> list[tuple[float, float]]:
    """CPU time [us] and changes of thread a tick, of each thread of a daemon that runs `code`."""
    module = "flightpower.daq" if (code / "flightpower" / "daq").exists() else "daq"  # in earlier versions
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


@app.command()
def threads(seconds: float = 20.0, rate: float = 25.0, fifo: bool = True, before: str = "", rounds: int = 2) -> None:
    """CPU time and changes of thread a tick of every thread, the median of the rounds."""
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
    columns = [f"{what} {version}" for version in versions for what in ("us,", "switches,")]
    title = f"CPU time and changes of thread a tick at {rate:g} Hz, load {os.getloadavg()[0]:.1f}"
    table = Table("thread", *columns, box=None, title=title, title_justify="left")
    rows = [
        [(median(run[i][0] for run in runs), median(run[i][1] for run in runs)) for runs in intervals.values()]
        for i in range(len(THREADS))
    ]
    for thread, row in zip(THREADS, rows, strict=True):
        table.add_row(thread, *(text for us, switches in row for text in (f"{us:.0f}", f"{switches:.1f}")))
    totals = [[sum(values) for values in zip(*column, strict=True)] for column in zip(*rows, strict=True)]
    table.add_row("all", *(text for us, switches in totals for text in (f"{us:.0f}", f"{switches:.1f}")))
    shares = [text for us, _ in totals for text in (f"{us * rate / 1e4:.2f} %", "")]
    table.add_row("of one core", *shares)
    Console(width=110).print(table)


class Parts:
    """Adds up the CPU time of named parts of the calling thread; a part inside another one is not counted in it.

    What counting takes is measured first, and taken out.
    """

    def __init__(self) -> None:
        self._inside_ns = self._outside_ns = 0.0  # of counting: in the part that is counted, and in the one around it
        self.spent_ns: dict[str, float] = defaultdict(float)
        self._running: list[str] = []
        self._since_ns = 0
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
        """A function whose every call is counted as `part`."""

        def timed(*arguments: Any, **options: Any) -> Any:
            self.enter(part)
            try:
                return original(*arguments, **options)
            finally:
                self.leave()

        return timed

    def wrap(self, owner: Any, method: str, part: str) -> None:
        setattr(owner, method, self.timed(getattr(owner, method), part))

    def _charge(self) -> None:
        now_ns = time.thread_time_ns()
        if self._running:
            self.spent_ns[self._running[-1]] += now_ns - self._since_ns
        self._since_ns = now_ns


FAKES = "the fake parts"


@app.command()
def parts(seconds: float = 60.0) -> None:
    """CPU time a tick of the daemon's parts, in one thread on the simulated clock."""
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
        """A bus or port whose time is that of the fake parts."""

        def __init__(self, thing: Any):
            for name in ("read", "write", "write_read", "read_available"):
                if hasattr(thing, name):
                    setattr(self, name, counted.timed(getattr(thing, name), FAKES))

    class Buses:
        def i2c(self, device: str) -> Any:
            return Wrapped(fake.i2c(device))

        def port(self, device: str, baud: int) -> Any:
            return Wrapped(fake.port(device, baud))

    begin_driver = SensorSupervisor._begin

    def begin(supervisor: SensorSupervisor) -> None:
        begin_driver(supervisor)
        counted.wrap(supervisor._sensor, "read", "drivers")

    SensorSupervisor._begin = begin  # type: ignore[method-assign]
    counted.wrap(SimulatedClock, "sleep_until_ns", FAKES)
    counted.wrap(SensorSupervisor, "read", "supervision of sensors")
    counted.wrap(BusWorker, "collect", "bus workers")
    counted.wrap(Recorder, "_close_chunk", "compressing and indexing chunks")
    counted.wrap(Recorder, "write", "encoding messages")
    counted.wrap(LogFiles, "update", "files")
    counted.wrap(TelemetryLink, "hear", "telemetry")
    with tempfile.TemporaryDirectory() as name:
        tray = parse_tray(EXAMPLE.read_text("utf-8"), "tray.toml", Path(name))
        link = TelemetryLink(TelemetryConfig(to="udp:127.0.0.1:9"), tray)
        until_ns = clock.now_ns() + round(seconds * 1e9)
        counted.enter("the loop")
        done = record(tray, buses=Buses(), clock=clock, until_ns=until_ns, listener=link, report=lambda status: None)  # type: ignore[arg-type]
        counted.leave()
        link.close()
    table = Table("part", "us a tick", box=None)
    fakes_ns = counted.spent_ns.pop(FAKES)
    for part, spent_ns in sorted(counted.spent_ns.items(), key=lambda item: -item[1]):
        table.add_row(part, f"{spent_ns / 1e3 / done.ticks:.1f}")
    table.add_row("all", f"{sum(counted.spent_ns.values()) / 1e3 / done.ticks:.1f}")
    table.add_row(f"({FAKES})", f"{fakes_ns / 1e3 / done.ticks:.1f}")
    Console().print(table)


if __name__ == "__main__":
    app()
