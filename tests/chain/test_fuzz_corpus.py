"""Inputs that once found a defect in a parser, and a few ordinary ones, find none."""

from pathlib import Path

import pytest

from tests.fuzz_targets import TARGETS, text

KEPT = sorted((Path(__file__).parents[1] / "data" / "fuzz").glob("*/*"))
ORDINARY = [b"", b"\0", b"\xff" * 100, b"{}", b"[]", b"a = 1\n", bytes(range(256)) * 4]


@pytest.mark.parametrize("name", TARGETS)
def test_ordinary_nonsense_is_refused_or_ignored(name):
    for data in ORDINARY:
        TARGETS[name](data)


def test_inputs_that_once_found_a_defect_find_none():
    for path in KEPT:
        TARGETS[path.parent.name](path.read_bytes())


def test_a_defect_would_be_found():
    with pytest.raises(ZeroDivisionError):
        text(lambda content: 1 / 0)(b"")
