"""How tests are distributed among processes, and which skips are expected.

Skips that are not expected fail the run: `pytest --expected-skips FILE`, as continuous integration does. A line of the
file is a pattern (`*` and `?`) for "test id: reason"; empty lines and lines that start with # are ignored.
"""

import gc
import os
import re
from collections import Counter
from collections.abc import Iterator
from fnmatch import fnmatchcase
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from tests.browser import Browser

# This comes before the first test imports NumPy; `make test` sets the same, and so do the commands themselves.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--expected-skips", metavar="FILE", help="fail when a test is skipped that FILE does not list")
    parser.addoption("--all", action="store_true", help="also the tests marked `thorough`, as `make test-all`")
    parser.addoption("--processor-times", metavar="FILE", help="write the processor time of each test")


def pytest_configure(config: pytest.Config) -> None:
    from tests.processor_time import ProcessorTime, TimesFile

    config.pluginmanager.register(ProcessorTime(), "processor-time")
    times = config.getoption("--processor-times")
    if times is not None and not hasattr(config, "workerinput"):
        config.pluginmanager.register(TimesFile(config.rootpath / times), "processor-times")
    file = config.getoption("--expected-skips")
    if file is None or hasattr(config, "workerinput"):
        return
    try:
        lines = (config.rootpath / file).read_text("utf-8").splitlines()
    except OSError as error:
        raise pytest.UsageError(f"--expected-skips {file}: cannot be read ({error.strerror})") from None
    patterns = [line.strip() for line in lines if line.strip() and not line.startswith("#")]
    config.pluginmanager.register(SkipWatch(patterns), "skip-watch")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put groups of modules first, then modules by their number of slow tests: at the end processes wait for short
    ones.

    Without --all the tests marked `thorough` are left out.
    """
    thorough = [] if config.getoption("--all") else [item for item in items if item.get_closest_marker("thorough")]
    if thorough:
        config.hook.pytest_deselected(items=thorough)
        items[:] = [item for item in items if not item.get_closest_marker("thorough")]
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: (item.get_closest_marker("xdist_group") is None, -slow[item.path]))


def pytest_collection_finish() -> None:
    """Tests and imported libraries live to the end, so the garbage collector need not look at them again and again."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """`--dist loadgroup` also keeps the tests of a module together, so the module's fixtures are made once."""
    if config.getoption("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling

    class ModulesTogether(LoadGroupScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return group_of(config.rootpath / nodeid.split("::")[0])

    config.option.loadscopereorder = False
    return ModulesTogether(config, log)


@lru_cache
def group_of(module: Path) -> str:
    """The group that the module's `pytestmark` names, or the module itself.

    It is read from the text: pytest-xdist 3.8 does not tell the scheduler of groups under pytest 9.2.
    """
    named = re.search(r'xdist_group\("(\w+)"\)', module.read_text("utf-8"))
    return named[1] if named else str(module)


@pytest.fixture(scope="session")
def browser() -> "Iterator[Browser]":
    """One browser for all tests of a process; each test opens its own page."""
    from tests.browser import started

    with started() as browser:
        yield browser


class SkipWatch:
    def __init__(self, expected: list[str]):
        self.expected = expected
        self.unexpected: list[str] = []

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        self.look_at(report)

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        self.look_at(report)

    def look_at(self, report: pytest.TestReport | pytest.CollectReport) -> None:
        """Note a skip; an expected failure (xfail) does not count."""
        if report.skipped and not hasattr(report, "wasxfail") and isinstance(report.longrepr, tuple):
            skip = f"{report.nodeid}: {report.longrepr[2].removeprefix('Skipped: ')}"
            if not any(fnmatchcase(skip, pattern) for pattern in self.expected):
                self.unexpected.append(skip)

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        if self.unexpected and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        for skip in self.unexpected:
            terminalreporter.write_line(f"ERROR: skipped, and not in --expected-skips: {skip}", red=True)
