"""Counts the instructions of a daemon tick on a Raspberry Pi: its Python runs under user-mode emulation of aarch64.

    .venv/bin/python benchmarks/instructions.py      # 3 min; root; makes out/aarch64 from packages of Debian and PyPI

The fake tray's replies are recorded here and played back to the daemon in Debian's Python for aarch64, on a simulated
clock. A QEMU plugin counts instructions; two recordings of different lengths are compared, so that the startup cancels.
The kernel's work for a transfer is not counted. The times follow from the processors' clocks and from instructions per
cycle, which are assumed for an interpreter: measure them with `perf stat` on the computer itself.
"""

import itertools
import os
import pickle
import re
import shutil
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
LENGTHS_S = (10.0, 30.0)
COMMANDS = {"mmdebstrap": "mmdebstrap", "qemu-aarch64": "qemu-user", "gcc": "gcc"}
WHEELS = ("msgspec", "zstandard", "lz4")
PURE = ("mcap", "smbus2")  # packages of pure Python, the same on every computer
PLUGIN = """
#include <stdint.h>
#include <stdio.h>
#include <stddef.h>
/* QEMU's plugin interface, version 1; Debian has no header of it. */
typedef uint64_t plugin_id;
struct qemu_plugin_tb;
void qemu_plugin_register_vcpu_tb_trans_cb(plugin_id, void (*)(plugin_id, struct qemu_plugin_tb *));
size_t qemu_plugin_tb_n_insns(const struct qemu_plugin_tb *);
void qemu_plugin_register_vcpu_tb_exec_inline(struct qemu_plugin_tb *, int, void *, uint64_t);
void qemu_plugin_register_atexit_cb(plugin_id, void (*)(plugin_id, void *), void *);
__attribute__((visibility("default"))) int qemu_plugin_version = 1;
static uint64_t count;
static void translated(plugin_id id, struct qemu_plugin_tb *block)
{
    qemu_plugin_register_vcpu_tb_exec_inline(block, 0, &count, qemu_plugin_tb_n_insns(block));
}
static void ended(plugin_id id, void *nothing) { fprintf(stderr, "instructions %lu\\n", (unsigned long)count); }
__attribute__((visibility("default"))) int qemu_plugin_install(plugin_id id, const void *info, int argc, char **argv)
{
    qemu_plugin_register_vcpu_tb_trans_cb(id, translated);
    qemu_plugin_register_atexit_cb(id, ended, NULL);
    return 0;
}
"""


class Computer(NamedTuple):
    """A Raspberry Pi: its core, its clock, and the instructions per cycle that an interpreter is assumed to reach."""

    name: str
    core: str
    clock_GHz: float
    per_cycle: float


COMPUTERS = (
    Computer("Zero 2 W", "Cortex-A53", 1.0, 0.6),
    Computer("3 B", "Cortex-A53", 1.2, 0.6),
    Computer("4 B", "Cortex-A72", 1.5, 1.0),
    Computer("5", "Cortex-A76", 2.4, 1.8),
)


class Replies:
    """Buses and ports that record the fake tray's replies and their times, or play back such a recording."""

    def __init__(self, clock: Any, replies: dict[Any, list[Any]], fake: Any = None):
        self._clock, self.replies, self._fake = clock, replies, fake
        self._again: dict[Any, Any] = {}
        self._opened: dict[str, Any] = {}

    def i2c(self, device: str) -> "Opened":
        return self._opened.setdefault(device, Opened(self, device, self._fake and self._fake.i2c(device)))

    def port(self, device: str, baud: int) -> "Opened":
        return self._opened.setdefault(device, Opened(self, device, self._fake and self._fake.port(device, baud)))

    def reply(self, part: Any, key: tuple[Any, ...]) -> Any:
        """Return a reply, recorded or played back; an error is kept as its number."""
        if part is None:
            reply, spent_ns = next(self._again.setdefault(key, itertools.cycle(self.replies[key])))
            self._clock.advance_ns(spent_ns)
        else:
            begin_ns = self._clock.now_ns()
            try:
                reply = getattr(part, key[1])(*key[2:])
            except OSError as error:
                reply = error.errno
            self.replies[key].append((reply, self._clock.now_ns() - begin_ns))
        if isinstance(reply, int):
            raise OSError(reply, os.strerror(reply))
        return reply


class Opened:
    """One bus or port of `Replies`."""

    def __init__(self, replies: Replies, device: str, part: Any):
        self._replies, self._device, self._part = replies, device, part

    def read(self, address: int, count: int) -> bytes:
        return self._replies.reply(self._part, (self._device, "read", address, count))

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        return self._replies.reply(self._part, (self._device, "write_read", address, data, count))

    def read_available(self) -> bytes:
        return self._replies.reply(self._part, (self._device, "read_available"))

    def write(self, *arguments: Any) -> None:
        self._replies.reply(self._part, (self._device, "write", *arguments))

    def close(self) -> None:
        pass


def ticks_of(replies: Replies, clock: Any, seconds: float) -> int:
    """Return the number of ticks in a recording of the example tray."""
    from flightpower.daq.config import parse_tray
    from flightpower.daq.daemon import record

    with tempfile.TemporaryDirectory() as folder:
        tray = parse_tray((ROOT / "daq" / "tray.example.toml").read_text("utf-8"), "tray.toml", Path(folder))
        done = record(tray, buses=replies, clock=clock, until_ns=clock.now_ns() + round(seconds * 1e9))
    late = {name: count for name, count in done.errors.items() if count > 2}
    assert not late, f"lost readings: {late}"
    return done.ticks


def record_replies(seconds: float, file: Path) -> None:
    sys.path.append(str(ROOT / "tests" / "hw_fakes"))
    from analytic_sensor_truth import AnalyticSensorTruth, sine

    from flightpower.hw_fakes.clock import SimulatedClock
    from flightpower.hw_fakes.tray import FakeTray

    clock = SimulatedClock(start_ns=3_000_000_000)
    fake = FakeTray(AnalyticSensorTruth(differential_Pa=sine(100.0, 20.0, 0.5)), clock, 4)
    replies = Replies(clock, defaultdict(list), fake)
    ticks_of(replies, clock, seconds)
    file.write_bytes(pickle.dumps(dict(replies.replies)))


def play_back(file: Path, seconds: float) -> None:
    from flightpower.hw_fakes.clock import SimulatedClock

    clock = SimulatedClock(start_ns=3_000_000_000)
    print("ticks", ticks_of(Replies(clock, pickle.loads(file.read_bytes())), clock, seconds))


def run(*command: object) -> str:
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))[:200]}: {done.stderr.strip()[-500:]}")
    return done.stdout + done.stderr


def made(folder: Path) -> Path:
    """Make a folder with Debian's Python for aarch64, the daemon's libraries and the plugin, unless it exists."""
    debian, library = folder / "debian", folder / "library"
    folder.mkdir(parents=True, exist_ok=True)
    if not (debian / "usr" / "bin" / "python3.11").exists():
        run("mmdebstrap", "--mode=root", "--variant=extract", "--arch=arm64", "--include=python3.11,libc6", "bookworm",
            debian)  # fmt: skip
    if not library.exists():
        pip = (
            sys.executable,
            "-m",
            "pip",
            "install",
            "--quiet",
            "--no-deps",
            "--only-binary=:all:",
            "--target",
            library,
        )
        tags = ("manylinux2014_aarch64", "manylinux_2_17_aarch64", "manylinux_2_28_aarch64")
        platforms = [f"--platform={tag}" for tag in tags]
        run(*pip, *platforms, "--python-version=3.11", "--constraint", ROOT / "constraints.txt", *WHEELS, *PURE)
    (folder / "count.c").write_text(PLUGIN)
    run("gcc", "-shared", "-fPIC", "-O2", "-o", folder / "count.so", folder / "count.c")
    return debian


def main() -> None:
    missing = [package for command, package in COMMANDS.items() if shutil.which(command) is None]
    if missing:
        sys.exit(f"needs packages: sudo apt-get install --no-install-recommends {' '.join(missing)}")
    folder = ROOT / "out" / "aarch64"
    debian, counted = made(folder), []
    for length_s in LENGTHS_S:
        record_replies(length_s, folder / "replies")
        output = run(
            "qemu-aarch64", "-L", debian, "-plugin", folder / "count.so", "-d", "plugin",
            "-E", f"PYTHONHOME={debian}/usr", "-E", f"PYTHONPATH={folder}/library:{ROOT}",
            debian / "usr/bin/python3.11", __file__, "play", folder / "replies", str(length_s),
        )  # fmt: skip
        counted.append(tuple(int(re.search(rf"{what} (\d+)", output)[1]) for what in ("instructions", "ticks")))  # type: ignore[index]
    (few, few_ticks), (many, many_ticks) = counted
    each = (many - few) / (many_ticks - few_ticks)
    print(
        f"{each / 1e6:.2f} million instructions a tick; {(few - few_ticks * each) / 1e9:.2f} thousand million to start"
    )
    print("| Raspberry Pi | core | clock, GHz | instructions a cycle | ms a tick | share of a core at 25 Hz |")
    print("|---" * 6 + "|")
    for name, core, clock_GHz, per_cycle in COMPUTERS:
        tick_ms = each / (clock_GHz * per_cycle) / 1e6
        print(f"| {name} | {core} | {clock_GHz} | {per_cycle} | {tick_ms:.2f} | {tick_ms * 2.5:.1f} % |")


if __name__ == "__main__":
    if sys.argv[1:2] == ["play"]:
        play_back(Path(sys.argv[2]), float(sys.argv[3]))
    else:
        main()
