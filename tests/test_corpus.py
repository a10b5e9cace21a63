"""A simulated flight is flown once for all tests, and again when what flies it has changed."""

import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests import corpus


@pytest.mark.skipif(sys.platform == "win32", reason="no locks of files")
def test_all_who_ask_get_one_flight(tmp_path: Path) -> None:
    flown: list[int] = []

    def fly() -> list[int]:
        flown.append(len(flown))
        return list(flown)

    with ThreadPoolExecutor(8) as pool:
        requests = [pool.submit(corpus.cached, tmp_path, b"a", fly) for _ in range(8)]
        assert [request.result() for request in requests] == [[0]] * 8
    assert corpus.cached(tmp_path, b"b", fly) == [0, 1]
    assert len(flown) == 2


def test_a_flight_that_failed_is_flown_again(tmp_path: Path) -> None:
    def fall() -> int:
        raise ArithmeticError

    with pytest.raises(ArithmeticError):
        corpus.cached(tmp_path, b"a", fall)
    assert corpus.cached(tmp_path, b"a", lambda: 3) == 3


def test_another_source_or_value_is_another_corpus(tmp_path: Path) -> None:
    (tmp_path / "sim").mkdir()
    seen = set()
    for name, text in (("fly.py", "1"), ("fly.py", "2"), ("wind.toml", "1"), ("wind.toml", ""), ("fly.pyc", "1")):
        (tmp_path / "sim" / name).write_text(text, "utf-8")
        seen.add(corpus.of_sources(tmp_path, ("sim",)))
    assert len(seen) == 4, "each but compiled code"


def test_equal_values_have_one_key_in_whatever_order_a_process_keeps_a_set() -> None:
    item, other = {0, 8}, {8, 0}
    assert list(item) != list(other), "as the texts of two processes"
    upper = "seed".upper()
    assert corpus.key_of(item, upper, upper) == corpus.key_of(other, upper, "seed".upper())
    assert corpus.key_of(frozenset(item)) == corpus.key_of(frozenset(other))
    different = ({0, 8}, {0, 16}, [0, 8], 0.1, 0.1 + 1e-16, "0.1")
    assert len({corpus.key_of(value) for value in different}) == len(different)
