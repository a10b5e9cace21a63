"""How much processor time each test takes, and a limit for tests without the marker `slow`.

Time is that of processors, its children's included, because a busy machine makes a test longer by the clock and not by
this. `pytest --processor-times FILE` writes one line for each test and prints the slowest files.
"""

import json
import os
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

LIMIT_S = 3.0  # of a test without a marker
MARKERS = ("slow", "thorough")
LISTED = 40
LOOK_AGAIN_S = 0.1  # how much of each processor can then be missed
TICKS = os.sysconf("SC_CLK_TCK") if hasattr(os, "sysconf") else 100


class _Living:
    """Processor time of children that still run, looked up again when one has ended or after LOOK_AGAIN_S by the clock.

    A browser has hundreds of threads, and querying them all takes longer than most tests.
    """

    def __init__(self) -> None:
        self._seconds, self._looked_s, self._ended_s = 0.0, -LOOK_AGAIN_S, 0.0

    def used_s(self, ended_s: float) -> float:
        """Processor seconds of the running processes; finished ones are in `ended_s`, where a child counts once it
        ends."""
        if ended_s != self._ended_s or time.monotonic() - self._looked_s >= LOOK_AGAIN_S:
            self._seconds = sum(map(_of_process_s, _descendants(os.getpid())))
            self._looked_s, self._ended_s = time.monotonic(), ended_s
        return self._seconds


_living = _Living()


def used_s() -> float:
    """Processor time [s] of this process, of its children that ended, and of those that run: a browser is one."""
    own_s, system_s, *ended = os.times()[:4]
    return own_s + system_s + sum(ended) + _living.used_s(sum(ended))


def _descendants(process: int) -> Iterator[int]:
    for listed in Path(f"/proc/{process}/task").glob("*/children"):
        try:
            children = [int(child) for child in listed.read_text("ascii").split()]
        except OSError:  # the thread has ended
            continue
        for child in children:
            yield child
            yield from _descendants(child)


def _of_process_s(process: int) -> float:
    try:
        after_name = Path(f"/proc/{process}/stat").read_text("utf-8", "replace").rpartition(")")[2].split()
    except OSError:  # it has ended
        return 0.0
    return sum(map(int, after_name[11:15])) / TICKS  # utime, stime, cutime, cstime: proc(5)


class ProcessorTime:
    """Fail a test above the limit without its marker; keep what every test took.

    With --all no test fails for its time, because continuous integration has processors of any speed.

    A shared fixture counts for no test, because which test requests it first depends on the selection.
    """

    def __init__(self) -> None:
        self._shared_s = 0.0
        self._begin_s = 0.0

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[object]) -> Iterator[None]:
        begin, inside = used_s(), self._shared_s
        made = yield
        if fixturedef.scope != "function":
            self._shared_s = inside + used_s() - begin
        return made

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_setup(self) -> Iterator[None]:
        self._begin_s, self._shared_s = used_s(), 0.0
        return (yield)

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_teardown(self, item: pytest.Item) -> Iterator[None]:
        ended = yield
        all_s = max(used_s() - self._begin_s, 0.0)
        own_s = max(all_s - self._shared_s, 0.0)
        item.user_properties.append(("processor_s", (round(own_s, 3), round(all_s, 3))))
        exempt = item.config.getoption("--all", False) or any(item.get_closest_marker(name) for name in MARKERS)
        if own_s > LIMIT_S and not exempt:
            pytest.fail(
                f"{own_s:.1f} s of processor time, and at most {LIMIT_S:g} s without the marker slow. Make it faster, "
                "or mark it: @pytest.mark.slow",
                pytrace=False,
            )
        return ended


class TimesFile:
    """Write the times of all tests, and say which files are the slowest."""

    def __init__(self, file: Path):
        self.file = file
        self.lines: list[tuple[str, float, float]] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.when == "teardown":
            own_s, all_s = dict(report.user_properties).get("processor_s", (0.0, 0.0))
            self.lines.append((report.nodeid, own_s, all_s))

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        self.file.write_text("".join(json.dumps(line) + "\n" for line in self.lines), "utf-8")
        by_file: Counter[str] = Counter()
        for test, _, all_s in self.lines:
            by_file[test.split("::")[0]] += all_s
        terminalreporter.section(f"processor time [s], all {sum(by_file.values()):.0f}")
        for name, seconds in by_file.most_common(LISTED):
            terminalreporter.write_line(f"{seconds:7.1f}  {name}")
