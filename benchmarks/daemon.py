"""Measures the installed daemon in real time on another process's device files: ticks, lateness, CPU, memory.

    .venv/bin/python benchmarks/daemon.py soak --seconds 600 --rate 25      # two buses (FUSE), three lines (ptys)
    .venv/bin/python benchmarks/daemon.py faults                            # every fault of the schedule, figures
    .venv/bin/python benchmarks/daemon.py day                               # 24 h on the simulated clock
    .venv/bin/python benchmarks/daemon.py mend                              # how long the next start takes

`soak` needs root (FUSE). The fake tray runs in its own process, so that its work does not count as the daemon's.
"""

import os
import signal
import statistics
import subprocess
import sys
import sysconfig
import tempfile
import time
from collections.abc import Sequence
from contextlib import ExitStack
from itertools import pairwise
from pathlib import Path

import numpy as np
import typer
from records import Record, markdown, rounded

ROOT = Path(__file__).resolve().parent.parent
sys.path += [str(ROOT / "tests" / "hw_fakes"), str(ROOT / "tests" / "daq")]

EXAMPLE = ROOT / "daq" / "tray.example.toml"
DAQ = Path(sysconfig.get_path("scripts")) / "daq"
SECOND_BUS = "/dev/i2c-3"
ON_SECOND_BUS = ("honeywell", "ms5805")  # drivers of parts on the second bus
BAUDS = {"gps": 38400, "esc_counter": 115200, "autopilot": 57600}
OPENING_S = 1.0  # time to open buses and load libraries before the first tick
CLOCK_TICKS = os.sysconf("SC_CLK_TCK")
WEIGHED_AT_S = 60.0  # memory is measured this long after a change of file
DISK_DONE_S = 0.1  # counted in real time

app = typer.Typer(add_completion=False, no_args_is_help=True, help=__doc__)


@app.command()
def soak(
    seconds: float = 600.0,
    rate: float = 25.0,
    fifo: bool = False,
    file_min: float = 4.0,
    bit_rate: float = 0.0,
    busy: int = 0,
) -> None:
    """Record in real time; print what the log and the kernel say about it.

    --fifo: use real-time priority, as the service does. --bit-rate: put all parts on one bus with this many bits a
    second, instead of on two with 400,000. --busy: run this many processes at the same time that compute constantly.
    """
    beside = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(busy)]
    try:
        serve = ["--file-min", str(file_min), "--bit-rate", str(bit_rate)]
        print(markdown([soaked(seconds, rate, fifo=fifo, serve=serve)]))
    finally:
        for process in beside:
            process.kill()


def soaked(seconds: float, rate: float, *, fifo: bool, serve: Sequence[str] = ()) -> Record:
    """Record in real time, and check the recording by its log and the kernel; print which ticks were missed and why."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        # With --fifo the fake parts have a higher priority than the daemon: real parts do not wait for a scheduler.
        tray = subprocess.Popen(
            [
                *(["chrt", "-f", "60"] if fifo else []),
                sys.executable,
                __file__,
                "serve",
                str(folder),
                "--rate",
                str(rate),
                *serve,
            ],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert tray.stdout is not None
        try:
            assert tray.stdout.readline() == "ready\n", "the fake tray did not come up (FUSE needs root)"
            command = [DAQ, "run", "-c", folder / "tray.toml", "--duration", str(seconds + OPENING_S)]
            command = [*(["chrt", "-f", "50"] if fifo else []), *command]
            daemon = subprocess.Popen([str(part) for part in command], stderr=subprocess.PIPE, text=True)
            memory, cpu = watch(daemon)
            assert daemon.stderr is not None
            log_text = daemon.stderr.read()
        finally:
            tray.send_signal(signal.SIGTERM)
            tray.wait(10)
        print(log_text.strip(), file=sys.stderr)
        ticks = ticks_of(sorted((folder / "logs").glob("*.mcap")))
    begin, end = next((s for s in cpu if s[0] > 5.0), cpu[0]), cpu[-1]
    after_minute = next((kib for at_s, kib in memory if at_s >= min(60.0, seconds / 3)), memory[-1][1])
    return {
        "Hz": rate, "min": rounded(seconds / 60, 1), **ticks,
        "processor, % of a core": rounded(100 * (end[1] - begin[1]) / (end[0] - begin[0]), 1),
        "memory, MB": rounded(memory[-1][1] / 1024, 1), "since the first minute, KiB": memory[-1][1] - after_minute,
        "load beside": rounded(os.getloadavg()[0], 1),
    }  # fmt: skip


def watch(daemon: subprocess.Popen) -> tuple[list[tuple[float, int]], list[tuple[float, float]]]:
    """Return resident memory [KiB] and CPU time [s] of the daemon over time [s], until it ends."""
    memory, cpu = [], []
    start_s = time.monotonic()
    while daemon.poll() is None:
        at_s = time.monotonic() - start_s
        try:
            status = Path(f"/proc/{daemon.pid}/status").read_text()
            fields = Path(f"/proc/{daemon.pid}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            break
        rss = [int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS")]
        if rss:
            memory.append((at_s, rss[0]))
            cpu.append((at_s, (int(fields[11]) + int(fields[12])) / CLOCK_TICKS))
        time.sleep(0.5)
    return memory[:-1], cpu[:-1]  # the last values may be from its shutdown


def ticks_of(paths: list[Path]) -> Record:
    """Return counts of ticks, missed ticks and messages without measurement, and how late the ticks were."""
    from flightpower.flight.log_reader import read_log
    from flightpower.flight.messages import Status

    logs = [read_log(path) for path in paths]
    ticks = [entry for log in logs for entry in log.entries["/daq/tick"]]
    late_us = [entry.message.late_ns / 1e3 for entry in ticks]
    after = {b.tick: a for a, b in pairwise(ticks) if b.message.missed}
    for tick, before in list(after.items())[:10]:
        took = {name: round(ns / 1e6, 1) for name, ns in before.message.duration_ns.items() if ns > 2e6}
        print(f"before tick {tick} one was missed; in the one before, more than 2 ms: {took or '-'}", file=sys.stderr)
    fine = (Status.OK, Status.BUSY, Status.STARTING)
    entries = [entry for log in logs for of_topic in log.entries.values() for entry in of_topic]
    p50, p99, most = np.quantile(late_us, [0.5, 0.99, 1.0])
    return {
        "ticks": len(ticks), "missed": sum(entry.message.missed for entry in ticks),
        "holes": sum(b.tick - a.tick != 1 for a, b in pairwise(ticks)),
        "late p50 / p99 / most, us": rounded([p50, p99, most]),
        "without measurement": sum(getattr(entry.message, "status", Status.OK) not in fine for entry in entries),
    }  # fmt: skip


@app.command()
def faults() -> None:
    """Inject every fault of the schedule on the simulated clock: ticks lost, and values that other sensors lost."""
    print(markdown(fault_records()))


def fault_records() -> list[Record]:
    from analytic_sensor_truth import AnalyticSensorTruth

    from flightpower.daq.config import parse_tray
    from flightpower.daq.daemon import record
    from flightpower.flight.log_reader import read_log
    from flightpower.flight.messages import Status
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.faults import DEVICES_OF_KIND, Fault
    from flightpower.hw_fakes.tray import FakeTray

    topics = {
        "imu": ["/imu"], "magnetometer": ["/mag"], "baro": ["/baro"], "static": ["/static"], "alpha": ["/probe/alpha"],
        "beta": ["/probe/beta"], "airspeed": ["/probe/airspeed"], "gps": ["/gps"], "esc_counter": ["/rpm"],
        "autopilot": ["/controls", "/attitude", "/battery"],
    }  # fmt: skip
    on_bus = {topic for name in list(topics)[:7] for topic in topics[name]}
    start_s, lasts_s, seconds = 4.0, 2.5, 10
    good = (Status.OK, Status.BUSY)
    records = []
    for kind, devices in DEVICES_OF_KIND.items():
        for device in devices:
            with tempfile.TemporaryDirectory() as folder:
                clock = SimulatedClock(start_ns=3_000_000_000)
                fault = Fault(kind=kind, device=device, start_s=start_s, duration_s=lasts_s, rate=0.05)
                fake = FakeTray(AnalyticSensorTruth(), clock, 2, faults=[fault])
                tray = parse_tray(EXAMPLE.read_text(), "tray.toml", Path(folder))
                begin_ns = clock.now_ns()
                done = record(tray, buses=fake, clock=clock, until_ns=begin_ns + seconds * 10**9)
                log = read_log(done.path)
            hit = on_bus if device == "i2c" else set(topics[device])
            if device == "imu":
                hit = hit | {"/mag"}  # it is in the same package, and is reached through the IMU's bypass
            if kind == "timeout" and device != "i2c":
                hit = on_bus  # the bus hangs
            first_ns = log.entries["/daq/tick"][0].time_ns
            others = own = 0
            back_s = 0.0
            for topic, entries in log.entries.items():
                for entry in entries:
                    at_s = (entry.time_ns - first_ns) / 1e9
                    if at_s < 2.5 or entry.message.status in good:
                        continue
                    own, others = own + (topic in hit), others + (topic not in hit)
                    back_s = max(back_s, at_s - start_s - lasts_s)
            records.append({
                "fault": kind, "part": device, "ticks": done.ticks, "missed": done.missed, "lost by others": others,
                "own lost": own, "back after, s": rounded(max(back_s, 0.0), 2),
            })  # fmt: skip
    return records


@app.command()
def day(rate: float = 25.0, hours: float = 24.0, file_min: float = 60.0) -> None:
    """Record a day on the simulated clock with two transducers on a scripted bus: files, drift, memory."""
    print(markdown([day_record(rate, hours, file_min)]))


def day_record(rate: float, hours: float, file_min: float) -> Record:
    """Memory is measured a simulated minute after each change of file, when the disk thread is idle."""
    from flightpower.daq import disk_writer
    from flightpower.daq.__main__ import prepare_process
    from flightpower.daq.config import parse_tray
    from flightpower.daq.daemon import record
    from flightpower.flight.log_reader import read_log

    class Bus:
        def read(self, address: int, count: int) -> bytes:
            return bytes([0x20, 0x00, 0x60, 0x00])

        def i2c(self, device: str) -> "Bus":
            return self

    from flightpower.hw_fakes.clock import SimulatedClock

    sensors = "".join(
        f'[[sensors]]\ndriver="{driver}"\nbus="b"\npart="{part}"\nmeasures="{measures}"\n'
        for driver, part, measures in (
            ("ms45xxdo", "MS4515DO-DS5AJ002DP", "alpha"),
            ("honeywell", "SSCDRRN005ND2A5", "airspeed"),
        )
    )
    memory: list[tuple[float, int]] = []
    clock = SimulatedClock(unix_at_start_ns=10**18)
    # A sync lasts minutes of simulated time, and data waiting for it use memory, so here the disk is infinitely fast.
    disk_writer.SYNC_EVERY_S = 0.0
    os.fdatasync = lambda file: None

    def progress(elapsed_s: float) -> None:
        if elapsed_s % (60 * file_min) == WEIGHED_AT_S:
            time.sleep(DISK_DONE_S)
            memory.append((elapsed_s / 3600, resident_KiB()))

    with tempfile.TemporaryDirectory() as folder:
        tray = parse_tray(
            f"rate_Hz = {rate:g}\n[files]\nnew_after_min = {file_min:g}\n{sensors}", "tray.toml", Path(folder)
        )
        prepare_process()
        begin_s, period_ns = time.monotonic(), round(1e9 / rate)
        done = record(tray, buses=Bus(), clock=clock, until_ns=round(hours * 3600e9), progress=progress)
        wall_s = time.monotonic() - begin_s
        count = worst_ns = 0
        expected = 0
        for path in done.paths:
            log = read_log(path)
            assert not log.torn
            for entry in log.entries["/daq/tick"]:
                assert entry.tick == expected
                expected += 1
                worst_ns = max(worst_ns, abs(entry.time_ns - 10**18 - entry.tick * period_ns))
                count += 1
    print("resident memory [KiB], file by file:", *(kib for _, kib in memory))
    later = [kib for _, kib in memory[1:]]
    return {
        "hours": hours, "Hz": rate, "ticks": count, "missed": done.missed, "files": len(done.paths),
        "grid off by, ns": worst_ns, "elapsed, s": rounded(wall_s), "memory, MB": rounded(later[-1] / 1024, 1),
        "KiB a file": rounded(statistics.linear_regression(range(len(later)), later).slope, 1) if later[1:] else None,
        "one number a tick would be, KiB a file": rounded(60 * file_min * rate * sys.getsizeof(0.0) / 1024),
    }  # fmt: skip


@app.command()
def mend(hours: float = 1.0) -> None:
    """Measure how long the next start takes to complete a default-tray log that a power cut left."""
    print(markdown([mend_record(hours)]))


def mend_record(hours: float) -> Record:
    from analytic_sensor_truth import AnalyticSensorTruth
    from mcap.opcode import Opcode

    from flightpower.daq.config import parse_tray
    from flightpower.daq.daemon import record
    from flightpower.daq.log_recovery import recover
    from flightpower.flight.log_index import RECORD_HEAD
    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.tray import FakeTray

    with tempfile.TemporaryDirectory() as folder:
        clock = SimulatedClock()
        fake = FakeTray(AnalyticSensorTruth(), clock, 2)
        tray = parse_tray(EXAMPLE.read_text(), "tray.toml", Path(folder))
        data = record(tray, buses=fake, clock=clock, until_ns=60 * 10**9).path.read_bytes()
        offset, first, end = 8, 0, 0
        while data[offset] != Opcode.DATA_END:
            opcode, length = RECORD_HEAD.unpack_from(data, offset)
            first = first or (offset if opcode == Opcode.CHUNK else 0)
            offset = end = offset + RECORD_HEAD.size + length
        path = Path(folder) / "log-0009.mcap"
        with path.open("wb") as stream:
            stream.write(data[:first])
            for _ in range(round(hours * 60)):
                stream.write(data[first:end])
            stream.write(data[first : first + 1000])
        begin_s = time.perf_counter()
        done = recover(path)
        assert done is not None
        return {"hours": hours, "kept, MB": rounded(done.kept_bytes / 1e6, 1), "cut, bytes": done.cut_bytes,
                "s": rounded(time.perf_counter() - begin_s, 2)}  # fmt: skip


def resident_KiB() -> int:
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))


@app.command(hidden=True)
def serve(folder: Path, rate: float = 25.0, file_min: float = 4.0, bit_rate: float = 0.0) -> None:
    """Serve the fake tray on device files until SIGTERM."""
    from analytic_sensor_truth import AnalyticSensorTruth, sine

    from flightpower.hw_fakes.fuse_i2c import FuseI2C
    from flightpower.hw_fakes.pty import PtyServer
    from flightpower.hw_fakes.tray import I2C_BUS, PORTS, FakeTray

    class RealClock:
        def now_ns(self) -> int:
            return time.monotonic_ns()

    fake = FakeTray(AnalyticSensorTruth(differential_Pa=sine(100.0, 20.0, 0.5)), RealClock(), 4)
    text = EXAMPLE.read_text().replace("rate_Hz = 25 ", f"rate_Hz = {rate:g} ", 1)
    text = text.replace("new_after_min = 60 ", f"new_after_min = {file_min:g} ")
    stop = []
    signal.signal(signal.SIGTERM, lambda *_: stop.append(1))
    with ExitStack() as stack:
        first = stack.enter_context(FuseI2C(fake.i2c(I2C_BUS), folder / "i2c-1", bit_rate or 400e3))
        second = stack.enter_context(FuseI2C(fake.i2c(I2C_BUS), folder / "i2c-3"))
        text = text.replace(f'"{I2C_BUS}"', f'"{first.path}"')
        for driver in () if bit_rate else ON_SECOND_BUS:
            text = text.replace(
                f'driver = "{driver}"\nbus = "{first.path}"', f'driver = "{driver}"\nbus = "{second.path}"'
            )
        for name, device in PORTS.items():
            line = stack.enter_context(PtyServer(fake.port(device, BAUDS[name])))
            text = text.replace(f'"{device}"', f'"{line.path}"')
        (folder / "tray.toml").write_text(text)
        print("ready", flush=True)
        while not stop:
            time.sleep(0.1)


if __name__ == "__main__":
    app()
