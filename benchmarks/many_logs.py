"""Tests many logs: two processors against one, kill and resume, one more flight, a Dask cluster that loses a worker.

    python benchmarks/many_logs.py --flights 100 --logs 4 --out /var/tmp/campaign

`--logs` short flights are simulated (seeds from 1000). Their copies differ in the weight in the aircraft file, so that
each is analyzed and no two are equal. Every part checks that the results are equal to the byte. `--part` runs one part;
`--log` uses copies of your own log, such as one of twenty minutes.
"""

import io
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import typer
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment
from rich.console import Console

from flightpower.analysis.cli.several_logs import files_used, settings
from flightpower.analysis.flights.campaign.addresses import FoundLogs
from flightpower.analysis.flights.campaign.campaign import Work, run
from flightpower.analysis.flights.campaign.folders import exclusive
from flightpower.analysis.flights.campaign.processes import Outcome
from flightpower.analysis.options import Options
from flightpower.flight.log_index import MAGIC, RECORD_HEAD
from flightpower.flight.log_writer import LogWriter

SCRIPTS = Path(sysconfig.get_path("scripts"))
ANALYZE = (sys.executable, "-m", "flightpower.analysis.cli.analyze")
FIRST_SEED, PORT = 1000, 8797
PARTS = ["processors", "killed", "one-more", "cluster", "hundred", "memory"]
console = Console(width=120, highlight=False)


def command(*words: object) -> list[str]:
    return [str(word) for word in words]


def analyze(logs: Sequence[Path | str], out: Path, *options: object) -> float:
    """Run a campaign that must succeed, and return the elapsed seconds."""
    start = time.monotonic()
    subprocess.run(command(*ANALYZE, *logs, "-o", out, "-q", *options), check=True)
    return time.monotonic() - start


def simulated(folder: Path, count: int) -> list[Path]:
    logs = []
    for seed in range(FIRST_SEED, FIRST_SEED + count):
        log = folder / f"seed-{seed}" / "log.mcap"
        if not log.exists():
            words = command(
                sys.executable, "-m", "flightpower", "sim", "fly", "--plan", "demo", "--no-hardware", "--seed", seed
            )
            subprocess.run([*words, "-o", str(log.parent), "--replace"], check=True, stdout=subprocess.DEVNULL)
        logs.append(log)
    return logs


def copies(logs: list[Path], folder: Path, count: int) -> list[Path]:
    folder.mkdir(parents=True, exist_ok=True)
    made = []
    for k in range(count):
        made.append(folder / f"flight-{k:03d}.mcap")
        if not made[-1].exists():
            copy(logs[k % len(logs)], made[-1], k // len(logs))
    return made


def copy(log: Path, to: Path, number: int) -> None:
    """Copy a log with another weight in the aircraft file, so that no two copies have equal estimates."""
    data, offset = log.read_bytes(), len(MAGIC)
    with to.open("wb") as target:
        writer = LogWriter(target)
        while True:
            opcode, length = RECORD_HEAD.unpack_from(data, offset)
            end = offset + RECORD_HEAD.size + length
            if opcode == Opcode.DATA_END:
                break
            if opcode == Opcode.ATTACHMENT:
                attachment = Attachment.read(ReadDataStream(io.BytesIO(data[offset + RECORD_HEAD.size : end])))
                content = heavier(attachment.data, number) if attachment.name == "aircraft.toml" else attachment.data
                writer.attach(attachment.name, content, attachment.media_type, attachment.create_time)
            elif opcode != Opcode.HEADER:
                writer.append(data[offset:end])
            offset = end
        writer.finish()


def heavier(aircraft: bytes, number: int) -> bytes:
    """Return an aircraft file whose weight is 0.1 % larger for each number."""

    def more(match: re.Match[str]) -> str:
        return f'{match[1]}"{float(match[2]) * (1 + 0.001 * number):.5f} {match[3]}"'

    return re.sub(r'^(weight = )"([\d.]+) (\w+)"', more, aircraft.decode(), count=1, flags=re.MULTILINE).encode()


def contents(out: Path) -> dict[str, bytes]:
    """Return every file of a campaign except the lock and the records, which name the logs."""
    paths = (path for path in out.rglob("*") if path.is_file() and path.name not in ("inputs.json", ".lock"))
    return {path.relative_to(out).as_posix(): path.read_bytes() for path in paths}


def equal(out: Path, other: Path) -> str:
    return "equal to the byte" if contents(out) == contents(other) else "DIFFERENT"


def written_at(out: Path) -> dict[str, int]:
    return {path.parent.name: path.stat().st_mtime_ns for path in out.glob("[!.]*/inputs.json")}


def wait_for(condition: Callable[[], bool], process: subprocess.Popen[bytes]) -> None:
    while not condition():
        if process.poll() is not None:
            raise RuntimeError(f"ended too early, with exit code {process.returncode}")
        time.sleep(0.05)


def processors(logs: list[Path], folder: Path) -> None:
    """Measure the elapsed time with one job and two, and estimate it from processor times for an idle machine."""
    elapsed, ideal = {}, {}
    for jobs in (1, 2):
        out = folder / f"jobs-{jobs}"
        shutil.rmtree(out, ignore_errors=True)
        before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
        result = subprocess.run(command(*ANALYZE, *logs, "-o", out, "--jobs", jobs), check=True, capture_output=True)
        elapsed[jobs] = time.monotonic() - start
        used = resource.getrusage(resource.RUSAGE_CHILDREN)
        alone = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime  # first process, without jobs
        analyses = float(re.search(rb"analyzed in ([\d.]+) s", result.stderr)[1])  # type: ignore[index]
        ideal[jobs] = alone + analyses / jobs
        console.print(
            f"--jobs {jobs}: {len(logs)} flights in {elapsed[jobs]:.0f} s; processor time {alone:.1f} s of the first"
            f" process, {analyses:.1f} s of the analyses; load of the machine {os.getloadavg()[0]:.1f}"
        )
    console.print(
        f"two jobs: {elapsed[1] / elapsed[2]:.2f} times faster, {ideal[1] / ideal[2]:.2f} by processor time;"
        f" {equal(folder / 'jobs-1', folder / 'jobs-2')}"
    )


def killed(logs: list[Path], folder: Path, reference: Path) -> None:
    """Send SIGKILL when half is done, then run the same command again."""
    out = folder / "killed"
    shutil.rmtree(out, ignore_errors=True)
    with subprocess.Popen(command(*ANALYZE, *logs, "-o", out, "-q")) as process:
        wait_for(lambda: len(written_at(out)) >= len(logs) // 2, process)
        process.send_signal(signal.SIGKILL)
    done = written_at(out)
    partial = len(list(out.glob(".*.partial")))
    analyze(logs, out)
    unchanged = sum(written_at(out)[name] == when for name, when in done.items())
    console.print(
        f"SIGKILL with {len(done)} of {len(logs)} done, {partial} begun; resumed: {unchanged} kept,"
        f" {len(logs) - unchanged} analyzed; {equal(out, reference)}"
    )


def one_more(logs: list[Path], folder: Path, more: Path, reference: Path) -> None:
    """Measure a campaign in which only one log is left to do, and that log alone."""
    out = folder / "one-more"
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(reference, out)
    nothing = analyze(logs, out)
    added = analyze([*logs, more], out)
    start = time.monotonic()
    subprocess.run(command(*ANALYZE, more, "-o", folder / "alone", "-q"), check=True)
    alone = time.monotonic() - start
    console.print(
        f"one flight more than {len(logs)}: {added:.1f} s; none more: {nothing:.1f} s; the one alone: {alone:.1f} s"
    )


def cluster(logs: list[Path], folder: Path, reference: Path) -> None:
    """Run a scheduler and two workers, and kill one worker when a quarter is done."""
    out = folder / "cluster"
    shutil.rmtree(out, ignore_errors=True)
    address = f"tcp://127.0.0.1:{PORT}"
    with (folder / "dask.log").open("w") as log:
        options = {"stdout": log, "stderr": log, "start_new_session": True}
        scheduler = command(SCRIPTS / "dask", "scheduler", "--port", PORT, "--no-dashboard")
        worker = command(
            SCRIPTS / "dask", "worker", address, "--nthreads", 1, "--no-dashboard", "--no-nanny",
            "--local-directory", folder / "dask",
        )  # fmt: skip
        started = [subprocess.Popen(words, **options) for words in (scheduler, worker, worker)]  # type: ignore[call-overload]
        try:
            time.sleep(10)
            words = command(*ANALYZE, *logs, "-o", out, "-q", "--scheduler", address)
            with subprocess.Popen(words) as process:
                wait_for(lambda: len(written_at(out)) >= len(logs) // 4, process)
                started[2].kill()
            console.print(
                f"cluster of two workers, one killed with {len(logs) // 4} of {len(logs)} done: exit code"
                f" {process.returncode}, {equal(out, reference)}"
            )
        finally:
            for process in started:
                process.kill()
                process.wait()


def memory(log: Path, folder: Path) -> None:
    """Measure the peak memory of one analysis, as `analyze` reports it."""
    out = folder / "memory"
    shutil.rmtree(out, ignore_errors=True)
    words = command(*ANALYZE, *copies([log], folder / "two", 2), "-o", out, "--jobs", 1)
    output = subprocess.run(words, check=True, capture_output=True, text=True).stderr
    line = next(line for line in output.splitlines() if "memory" in line)
    console.print(f"{log.stat().st_size / 1e6:.0f} MB of log: {line}")


@dataclass(frozen=True)
class Scattered:
    """Replaces an analysis: gives another flight's results, with estimates scattered by half their covariance."""

    flights: list[Path]

    def __call__(self, log: Path, folder: Path, runs: Path | None, progress: Callable[[str], None]) -> None:
        number = int(log.stem.rpartition("-")[2])
        source = self.flights[number % len(self.flights)]
        content = msgspec.json.decode((source / "results.json").read_bytes())
        statistics = content["curves"]["power_required"]["statistics"]
        lower = np.zeros((len(statistics["values"]),) * 2)
        for i, row in enumerate(statistics["covariance"]):
            lower[i, : i + 1] = row
        covariance = lower + np.tril(lower, -1).T
        noise = np.random.default_rng(number).multivariate_normal(np.zeros(len(lower)), covariance / 2)
        statistics["values"] = (np.array(statistics["values"]) + noise).tolist()
        content["log"] = str(log)
        (folder / "results.json").write_bytes(msgspec.json.encode(content))
        shutil.copy(source / "report.html", folder)

    def under(self, root: Path) -> "Scattered":
        return self


class Silent:
    def planned(self, jobs: int, completed: int) -> None: ...

    def step(self, name: str, step: str) -> None: ...

    def failed(self, error: str) -> None: ...

    def ended(self, name: str, outcome: Outcome) -> None: ...


def hundred(folder: Path, reference: Path, count: int = 100) -> None:
    """Measure the cost of a pool of a hundred flights and of its page, in addition to the analyses."""
    out, logs = folder / "hundred", folder / "hundred-logs"
    for old in (out, logs):
        shutil.rmtree(old, ignore_errors=True)
    logs.mkdir()
    names = [logs / f"2026-05-01-{k:03d}.mcap" for k in range(count)]
    for name in names:
        name.write_text(name.stem)
    options = Options()
    done = Work(
        Scattered([path.parent for path in sorted(reference.glob("[!.]*/inputs.json"))]),
        settings(options),
        lambda log: files_used(log, options),
    )
    with exclusive(out):
        run(FoundLogs([*names]), out, done, Silent(), jobs=2)
    before, start = resource.getrusage(resource.RUSAGE_CHILDREN), time.monotonic()
    analyze(names, out)
    elapsed, used = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    page = out / "report.html"
    console.print(
        f"{count} flights that are analyzed: pooled and reported in {elapsed:.1f} s, {busy:.1f} s of processor time;"
        f" the page has {page.stat().st_size / 1e6:.2f} MB"
    )
    before, start = used, time.monotonic()
    words = command(
        "chromium",
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--virtual-time-budget=10000",
        "--dump-dom",
        page.resolve().as_uri(),
    )
    printed = subprocess.run(words, check=True, capture_output=True, text=True).stdout
    elapsed, used = time.monotonic() - start, resource.getrusage(resource.RUSAGE_CHILDREN)
    busy = used.ru_utime + used.ru_stime - before.ru_utime - before.ru_stime
    console.print(
        f"opened with {printed.count('main-svg')} layers of figures in {elapsed:.1f} s, {busy:.1f} s of processor time,"
        f" the start of Chromium included; load of the machine {os.getloadavg()[0]:.1f}"
    )


def main(
    flights: Annotated[int, typer.Option(help="Copies to analyze.")] = 100,
    logs: Annotated[int, typer.Option(help="Simulated flights that are copied.")] = 4,
    log: Annotated[Path | None, typer.Option(help="Copy this log instead.")] = None,
    out: Annotated[Path, typer.Option(help="Folder to work in; what is there already is used.")] = Path("out/campaign"),
    part: Annotated[list[str] | None, typer.Option(help=f"{', '.join(PARTS)}; may repeat")] = None,
) -> None:
    out.mkdir(parents=True, exist_ok=True)
    originals = [log] if log else simulated(out, logs)
    *log_paths, more = copies(originals, out / "logs", flights + 1)
    reference = out / "jobs-2"
    wanted = part or PARTS
    if "processors" in wanted:
        processors(log_paths, out)
    elif not reference.exists():
        analyze(log_paths, reference)
    if "killed" in wanted:
        killed(log_paths, out, reference)
    if "one-more" in wanted:
        one_more(log_paths, out, more, reference)
    if "cluster" in wanted:
        cluster(log_paths, out, reference)
    if "hundred" in wanted:
        hundred(out, reference)
    if "memory" in wanted:
        memory(originals[0], out)


if __name__ == "__main__":
    typer.run(main)
