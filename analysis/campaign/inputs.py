"""What the results of a flight depend on, as digests: contents of files, options, version of the software."""

import hashlib
import json
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path

from flight.errors import InputError

PACKAGES = ("analysis", "flight")  # their files, data included, are part of the version
LIBRARIES = ("casadi", "numpy", "pandas", "scipy")
SKIPPED_SUFFIXES = {".pyc", ".pyi"}


def digest(path: Path) -> str:
    """SHA-256 of the content of a file. Raises InputError when it cannot be read."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        cause = "it is a folder" if path.is_dir() else error.strerror or error
        raise InputError(f"{path}: cannot be read ({cause})") from None


def digests(paths: Iterable[Path], known: Callable[[Path], str | None], jobs: int) -> list[str | InputError]:
    """`digest` of each path, `jobs` at a time, where it is not known; the error where a file cannot be read."""

    def one(path: Path) -> str | InputError:
        try:
            return known(path) or digest(path)
        except InputError as error:
            return error

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(one, paths))


def key(log_digest: str, settings: str, files: Iterable[tuple[str, Path]], runs: Path | None) -> str:
    """Digest of everything that the results of one flight depend on.

    settings: the options' values. files: (option, file that it names). runs: the edited list of runs, if there is one.
    Raises InputError when a file cannot be read.
    """
    content = {
        "log": log_digest,
        "settings": settings,
        "files": [(option, digest(path)) for option, path in files],
        "runs": digest(runs) if runs else None,
        "software": software(),
    }
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


@cache
def software() -> str:
    """Digest of the software: its own files, and the versions of the libraries that compute."""
    total = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(package)
        assert spec is not None and spec.submodule_search_locations
        root = Path(spec.submodule_search_locations[0])
        for path in sorted(root.rglob("*")):
            if path.is_file() and path.suffix not in SKIPPED_SUFFIXES:
                total.update(f"{package}/{path.relative_to(root).as_posix()} {digest(path)}\n".encode())
    for library in LIBRARIES:
        total.update(f"{library} {_version(library)}\n".encode())
    return total.hexdigest()


def _version(library: str) -> str:
    try:
        return version(library)
    except PackageNotFoundError:
        return "none"
