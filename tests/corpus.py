"""One corpus of simulated flights: each is flown once for all processes and runs of the tests.

A flight lies in build/test-flights, in a folder named by the sources that fly it. What other sources flew is removed
after a day.
"""

import contextlib
import hashlib
import io
import os
import pickle
import shutil
import time
from collections.abc import Callable, Iterator
from functools import cache, wraps
from importlib.metadata import version
from pathlib import Path
from typing import Any, TypeVar

try:
    import fcntl
except ImportError:  # on Windows two processes may fly the same flight
    fcntl = None  # type: ignore[assignment]

Made = TypeVar("Made")

ROOT = Path(__file__).parents[1]
FLIGHTS = ROOT / "build" / "test-flights"
# The files that make a flight and its log, among them data of aircraft, worlds and plans.
SOURCES = ("sim", "flight", "flightpower", "hw_fakes", "daq", "benchmarks/flights.py")
DAY_S = 86400
LIBRARIES = ("numpy", "scipy", "pandas", "casadi")


def of_sources(root: Path, names: tuple[str, ...] = SOURCES) -> str:
    """A fingerprint of all files that a flight comes from, and of the libraries' versions."""
    digest = hashlib.sha256(" ".join(version(name) for name in LIBRARIES).encode())
    for name in names:
        files = sorted((root / name).rglob("*")) if (root / name).is_dir() else [root / name]
        for path in files:
            if path.is_file() and path.suffix != ".pyc":
                digest.update(f"{path.relative_to(root)} {path.stat().st_size} ".encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def folder() -> Path:
    """The folder for flights of these sources; others are removed after a day, when no process still reads them."""
    own_folder = FLIGHTS / of_sources(ROOT)
    own_folder.mkdir(parents=True, exist_ok=True)
    for other in FLIGHTS.iterdir():
        if other != own_folder and time.time() - other.stat().st_mtime > DAY_S:
            shutil.rmtree(other, ignore_errors=True)
    return own_folder


def cached(directory: Path, key: bytes, make: Callable[[], Made]) -> Made:
    """The result of `make`, computed by the first process that needs this key while the others wait."""
    path = directory / hashlib.sha256(key).hexdigest()[:24]
    with _alone(path.with_suffix(".lock")):
        with contextlib.suppress(FileNotFoundError):
            return pickle.loads(path.read_bytes())  # type: ignore[no-any-return]
        made = make()
        written = path.with_suffix(f".{os.getpid()}")
        written.write_bytes(pickle.dumps(made))
        written.replace(path)
    return made


@contextlib.contextmanager
def _alone(lock: Path) -> Iterator[None]:
    with lock.open("wb") as stream:
        if fcntl is not None:
            fcntl.flock(stream, fcntl.LOCK_EX)
        yield


def from_corpus(make: Callable[..., Made]) -> Callable[..., Made]:
    """Wraps a function of picklable arguments so that its results come from the corpus."""

    @wraps(make)
    def taken(*arguments: Any) -> Made:
        return cached(folder(), key_of(make.__qualname__, *arguments), lambda: make(*arguments))

    return taken


def key_of(*values: object) -> bytes:
    """Bytes that differ for different values and agree for equal values in any process, although sets are ordered
    differently in each."""
    written = io.BytesIO()
    pickler = _InOrder(written)
    pickler.fast = True  # no back references, which depend on object identity
    pickler.dump(values)
    return written.getvalue()


class _InOrder(pickle._Pickler):  # the pickler in C cannot be told how to write a set
    dispatch = pickle._Pickler.dispatch.copy()

    def save_in_order(self, values: frozenset[Any] | set[Any]) -> None:
        self.save(["set", *sorted(values)])

    dispatch[set] = dispatch[frozenset] = save_in_order
