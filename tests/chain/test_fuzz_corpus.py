"""Inputs that once found a defect in a parser, and a few ordinary ones, no longer find any."""

import signal
from pathlib import Path

import pytest

from tests.fuzz_targets import TARGETS, text

KEPT = sorted((Path(__file__).parents[1] / "data" / "fuzz").glob("*/*"))
ORDINARY = [b"", b"\0", b"\xff" * 100, b"{}", b"[]", b"a = 1\n", bytes(range(256)) * 4]


@pytest.mark.parametrize("name", TARGETS)
def test_ordinary_nonsense_is_refused_or_ignored(name):
    for data in ORDINARY:
        TARGETS[name](data)


class TooLong(BaseException):
    """Not an error of altered bytes, which readers would catch."""


def test_inputs_that_once_found_a_defect_find_none():
    """Each needs at most 10 s of processor time; some were once read for ever."""

    def too_long(*_):
        raise TooLong

    before = signal.signal(signal.SIGPROF, too_long)
    try:
        for path in KEPT:
            signal.setitimer(signal.ITIMER_PROF, 10.0)
            TARGETS[path.parent.name](path.read_bytes())
    except TooLong:
        pytest.fail(f"{path.name} is read for ever", pytrace=False)
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


def test_a_defect_would_be_found():
    with pytest.raises(ZeroDivisionError):
        text(lambda content: 1 / 0)(b"")
