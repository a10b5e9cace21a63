"""Simulates power cuts: the daemon records onto a disk whose every write is logged; then the disk is rebuilt as it was
at many instants.

    sudo .venv/bin/python benchmarks/crash_points.py --points 500 --seed 3

The disk is ext4 on a loop device on a FUSE export of qemu-storage-daemon, whose block driver `blklogwrites` logs writes
and flushes. It needs root, FUSE, and Debian's packages qemu-system-common and e2fsprogs. Kinds of cut:

    all       all writes up to the instant are on the disk: the computer stopped, the card did not
    half      a random half of the writes since the last flush is on the disk: a card with a volatile cache
    torn      none of the writes since the last flush is on the disk, except the first half of one

Each rebuilt disk is mounted, and its logs are read, completed as at the daemon's next start, and read again, also with
the stock MCAP reader. It prints how old the oldest lost message is just before the next write, and what went wrong.
Exit code 1 if more than a second is lost, or if a log is unreadable, not completed, or loses a message on completion.
"""

import io
import os
import random
import re
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import typer
from daemon import DAQ, ROOT
from mcap.reader import make_reader

from flightpower.daq.log_names import numbered_logs
from flightpower.daq.log_recovery import recovery_event
from flightpower.flight.log_reader import read_log

# The daemon has the priority of its service. Parts and disk have a higher priority, because real ones do not wait for a
# scheduler.
REAL_TIME = ("chrt", "-f")
DISK_BYTES = 300 * 2**20
LARGEST_LOSS_S = 1.0
STARTED_S = 4.0  # instants before this time after the daemon's start are not judged
SECTOR = 512
# The log of blklogwrites has the format of the kernel's dm-log-writes (Documentation/admin-guide/device-mapper).
LOG_MAGIC = 0x6A736677736872
SUPER = struct.Struct("<QQQI")  # magic, version, number of entries, sector size
ENTRY = struct.Struct("<QQQQ")  # sector, number of sectors, flags, length of data
FLUSH, DISCARD = 1, 4
KINDS = ("all", "half", "torn")


class Write(NamedTuple):
    """A logged write. end: position in the log of writes just after it"""

    offset: int
    data: bytes
    flush: bool
    end: int


class LogState(NamedTuple):
    """A log on a rebuilt disk. first_s, last_s: monotonic times of its first and last tick"""

    complete: bool
    ticks: int
    messages: int
    first_s: float | None
    last_s: float | None
    error: str


def run(*command: object) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))}: {done.stderr.strip()}")
    return done.stdout.strip()


@contextmanager
def fake_tray(folder: Path) -> Iterator[Path]:
    """Yield the tray file for fake parts on device files that another process serves."""
    command = [
        *REAL_TIME,
        "60",
        sys.executable,
        ROOT / "benchmarks" / "daemon.py",
        "serve",
        folder,
        "--file-min",
        "0.3",
    ]
    process = subprocess.Popen([str(part) for part in command], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "ready\n", "the fake tray did not start (FUSE needs root)"
        yield folder / "tray.toml"
    finally:
        process.send_signal(signal.SIGTERM)
        process.wait(10)


@contextmanager
def logged_disk(folder: Path) -> Iterator[Path]:
    """Mount a file system whose writes are appended to folder/writes.log; its initial state is in folder/before.img."""
    image, log, disk, mounted = (folder / name for name in ("disk.img", "writes.log", "disk", "mounted"))
    mounted.mkdir()
    image.touch()
    os.truncate(image, DISK_BYTES)
    run("mkfs.ext4", "-q", "-F", image)
    run("cp", "--sparse=always", image, folder / "before.img")
    log.touch()
    disk.touch()
    node = f"driver=blklogwrites,node-name=logged,file.driver=file,file.filename={image}"
    node += f",log.driver=file,log.filename={log},log-sector-size={SECTOR}"
    export = f"fuse,id=disk,node-name=logged,mountpoint={disk},writable=on"
    server = subprocess.Popen([*REAL_TIME, "60", "qemu-storage-daemon", "--blockdev", node, "--export", export])
    try:
        while disk.stat().st_size < DISK_BYTES:
            assert server.poll() is None, "qemu-storage-daemon ended"
            time.sleep(0.1)
        loop = run("losetup", "-f", "--show", disk)
        try:
            run("mount", "-o", "noatime", loop, mounted)
            try:
                yield mounted
            finally:
                run("umount", mounted)
        finally:
            run("losetup", "-d", loop)
    finally:
        server.send_signal(signal.SIGTERM)
        server.wait(20)


def record(folder: Path, seconds: float) -> tuple[list[tuple[float, int]], float]:
    """Run the daemon on the logged disk and kill it. Returns (monotonic time, size of write log) pairs, its start."""
    grown: list[tuple[float, int]] = []
    stop = threading.Event()

    def sample() -> None:
        while not stop.wait(0.01):
            grown.append((time.monotonic(), (folder / "writes.log").stat().st_size))

    with fake_tray(folder) as tray, logged_disk(folder) as mounted:
        (mounted / "logs").mkdir()
        run("sync")
        text = re.sub(r'(?m)^directory = "[^"]*"', f'directory = "{mounted}/logs"', tray.read_text())
        tray.write_text(re.sub(r"(?m)^keep_free_MB = \S+", "keep_free_MB = 5", text))
        sampler = threading.Thread(target=sample, daemon=True)
        sampler.start()
        started_s = time.monotonic()
        daemon = subprocess.Popen([*REAL_TIME, "50", str(DAQ), "run", "-c", str(tray)], stderr=subprocess.DEVNULL)
        time.sleep(seconds)
        daemon.kill()
        daemon.wait()
        stop.set()
        sampler.join()
    return grown, started_s


def writes_of(log: Path) -> list[Write]:
    """Return the logged writes in order."""
    writes = []
    with log.open("rb") as stream:
        magic, _, _, sector = SUPER.unpack(stream.read(SUPER.size))
        assert magic == LOG_MAGIC, f"not a log of writes: {magic:#x}"
        offset, end = sector, os.fstat(stream.fileno()).st_size
        while offset + ENTRY.size <= end:
            stream.seek(offset)
            first, count, flags, _ = ENTRY.unpack(stream.read(ENTRY.size))
            if not flags and not count:
                break
            stream.seek(offset + sector)
            data = b"" if flags & DISCARD else stream.read(count * sector)
            offset += sector + len(data)
            writes.append(Write(first * sector, data, bool(flags & FLUSH), offset))
    return writes


def surviving(writes: list[Write], instant: int, kind: str, rng: random.Random) -> list[Write]:
    """Return the writes that are on the disk after a power cut just after write `instant`."""
    if kind == "all":
        return writes[: instant + 1]
    flushed = max((i for i in range(instant + 1) if writes[i].flush), default=-1)
    survivors = writes[: flushed + 1]
    if kind == "half":
        return survivors + [write for write in writes[flushed + 1 : instant + 1] if rng.random() < 0.5]
    if instant > flushed:
        write = writes[instant]
        half = write.data[: len(write.data) // (2 * SECTOR) * SECTOR]
        survivors.append(write._replace(data=half))
    return survivors


@contextmanager
def rebuilt(folder: Path, writes: list[Write]) -> Iterator[Path]:
    """Rebuild the disk with these writes, and mount it, which replays its journal."""
    image, mounted = folder / "rebuilt.img", folder / "mounted"
    run("cp", "--sparse=always", folder / "before.img", image)
    with image.open("r+b") as stream:
        for write in writes:
            stream.seek(write.offset)
            stream.write(write.data)
    run("mount", "-o", "loop", image, mounted)
    try:
        yield mounted / "logs"
    finally:
        run("umount", mounted)


def state_of(path: Path) -> LogState:
    """Read a log with this program's reader and, if it is complete, with the stock reader."""
    data = path.read_bytes()
    complete = data.endswith(b"\x89MCAP0\r\n") and len(data) > 16
    try:
        log = read_log(path)
        ticks = log.entries["/daq/tick"]
        facts = log.metadata["flightpower"]
        offset_ns = int(facts["start_monotonic_ns"]) - int(facts["start_unix_ns"])
        messages = sum(len(entries) for entries in log.entries.values())
        if complete:
            stock = sum(1 for _ in make_reader(io.BytesIO(data)).iter_messages())
            assert stock == messages, f"the stock reader finds {stock} messages, not {messages}"
        first_s, last_s = ((ticks[end].time_ns + offset_ns) / 1e9 if ticks else None for end in (0, -1))
        return LogState(complete, len(ticks), messages, first_s, last_s, "")
    except Exception as error:
        return LogState(complete, 0, 0, None, None, f"{type(error).__name__}: {error}"[:100])


def judge(logs: Path, cut_s: float) -> tuple[float | None, list[str]]:
    """Return how much time before the power cut is lost [s], None if all of it, and what is wrong."""
    before = {path.name: state_of(path) for path in numbered_logs(logs)}
    last_s = max((state.last_s for state in before.values() if state.last_s is not None), default=None)
    trouble = [] if last_s is not None else ["nothing can be read"]
    for path in numbered_logs(logs):
        recovery_event(path)
    for name, first in before.items():
        after = state_of(logs / name)
        if after.messages < first.messages:
            trouble.append(f"{name}: completing it lost {first.messages - after.messages} messages")
        if first.ticks and (after.error or not after.complete):
            trouble.append(f"{name}: not completed; {after.error}")
    return None if last_s is None else cut_s - last_s, trouble


def main(points: int = 500, seconds: float = 60.0, seed: int = 3) -> None:
    """Record for `seconds`, then cut the power at `points` random writes."""
    for command in ("qemu-storage-daemon", "mkfs.ext4"):
        if shutil.which(command) is None:
            sys.exit(f"{command} is missing: apt-get install qemu-system-common e2fsprogs")
    rng = random.Random(seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        grown, started_s = record(folder, seconds)
        writes = writes_of(folder / "writes.log")
        times_s = [next((t for t, size in grown if size >= write.end), grown[-1][0]) for write in writes]
        size_MB = sum(len(write.data) for write in writes) / 1e6
        print(f"{len(writes)} writes, {size_MB:.1f} MB, {sum(write.flush for write in writes)} flushes", flush=True)
        candidates = [i for i, t in enumerate(times_s[:-1]) if t > started_s + STARTED_S]
        lost: dict[str, list[float]] = {kind: [] for kind in KINDS}
        trouble = []
        for number in range(points):
            instant, kind = rng.choice(candidates), KINDS[number % len(KINDS)]
            with rebuilt(folder, surviving(writes, instant, kind, rng)) as logs:
                loss_s, wrong = judge(logs, times_s[instant + 1])
            lost[kind] += [] if loss_s is None else [loss_s]
            trouble += [f"write {instant}, {kind}: {what}" for what in wrong]
    for kind, losses in lost.items():
        losses.sort()
        print(f"{kind:5} {len(losses):4} cuts, lost: median {losses[len(losses) // 2]:.2f} s, most {losses[-1]:.2f} s")
    print(f"{len(trouble)} troubles")
    print("\n".join(trouble[:10]))
    if trouble or max(losses[-1] for losses in lost.values()) > LARGEST_LOSS_S:
        raise typer.Exit(1)


if __name__ == "__main__":
    typer.run(main)
