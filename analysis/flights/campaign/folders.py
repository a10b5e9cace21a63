"""The folders of the flights: one for each log, either complete or absent.

Each has a record with digests of the input of its results: files, options, version of the software.
"""

import contextlib
import hashlib
import json
import os
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from importlib.util import find_spec
from pathlib import Path, PurePath
from tempfile import mkdtemp

import msgspec

from flightpower.analysis.files import write_file
from flightpower.analysis.flights.campaign.addresses import Log, content_digest
from flightpower.flight.errors import InputError
from flightpower.flight.files import write_error

PACKAGES = ("analysis", "flight")  # all their files, including data, determine the version
LIBRARIES = ("casadi", "numpy", "pandas", "scipy")
SKIPPED_SUFFIXES = {".pyc", ".pyi"}


def digest(path: Path) -> str:
    """Return the SHA-256 of the content of a file. Raises InputError when it cannot be read."""
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        cause = "it is a folder" if path.is_dir() else error.strerror or error
        raise InputError(f"{path}: cannot be read ({cause})") from None


def digests(logs: Iterable[Log], earlier_digest: Callable[[Log], str | None], jobs: int) -> list[str | InputError]:
    """Return the `digest` of each log, or the error if it cannot be read; compute new ones `jobs` at a time."""

    def digest_or_error(log: Log) -> str | InputError:
        try:
            return earlier_digest(log) or (digest(log) if isinstance(log, Path) else content_digest(log))
        except InputError as error:
            return error

    with ThreadPoolExecutor(jobs) as pool:
        return list(pool.map(digest_or_error, logs))


def key(log_digest: str, inputs: str) -> str:
    """Return a digest of everything that the results of one flight depend on: its log, and `inputs_digest`."""
    return hashlib.sha256(f"{log_digest} {inputs}".encode()).hexdigest()


def inputs_digest(settings: str, files: Iterable[tuple[str, Path]], runs: Path | None) -> str:
    """Return a digest of everything except the log that the results depend on.

    settings: the options' values. files: (option, file that it names). runs: the edited list of runs, if there is one.
    Raises InputError when a file cannot be read.
    """
    content = {
        "settings": settings,
        "files": [(option, digest(path)) for option, path in files],
        "runs": digest(runs) if runs else None,
        "software": software(),
    }
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


@cache
def software() -> str:
    """Return a digest of the software: its own files, and the versions of the libraries that compute."""
    total = hashlib.sha256()
    for package in PACKAGES:
        spec = find_spec(f"flightpower.{package}")
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


RECORD, RUNS, RESULTS = "inputs.json", "runs.toml", "results.json"
PARTIAL, REPLACED = ".partial", ".replaced"  # suffixes of folders that a killed run leaves behind


class LogFile(msgspec.Struct, frozen=True, kw_only=True):
    """A log as it was when analyzed. Its content is not read again while all fields but the digest stay the same."""

    path: str  # absolute path, or the address
    size: int
    changed_ns: int  # time of the last change; 0 at an address
    version: str = ""  # at an address, the ETag or the store's equivalent
    digest: str

    @classmethod
    def of(cls, log: Log, log_digest: str) -> "LogFile":
        """Raises OSError."""
        if not isinstance(log, Path):
            return cls(path=str(log), size=log.size or 0, changed_ns=0, version=log.version, digest=log_digest)
        status = log.stat()
        return cls(path=str(log.absolute()), size=status.st_size, changed_ns=status.st_mtime_ns, digest=log_digest)


class Record(msgspec.Struct, frozen=True, kw_only=True):
    """The content of inputs.json in a flight's folder."""

    key: str  # digest of everything that the results depend on, from the function `key`
    log: LogFile
    runs_edited: bool  # whether the results use the folder's own runs.toml
    runs_digest: str | None  # digest of runs.toml when the folder was written
    results_digest: str | None = None  # digest of results.json; None in folders of earlier versions
    files: list[str]  # files that the analysis wrote


def names(absolute: Sequence[PurePath]) -> list[str]:
    """Name a folder for each log: the log's stem, preceded by as many parents as are needed to distinguish the logs."""
    repeated = _repeated([str(log.with_suffix("")) for log in absolute])  # for one flight logged in two formats
    own = [log.name if str(log.with_suffix("")).casefold() in repeated else log.stem for log in absolute]
    names = own
    for depth in range(1, max((len(log.parts) for log in absolute), default=1)):
        repeated = _repeated(names)
        if not repeated:
            break
        names = [
            "-".join([*log.parts[1:-1][-depth:], last]) if name.casefold() in repeated else name
            for name, last, log in zip(names, own, absolute, strict=True)
        ]
    return _numbered(names)


def _numbered(names: Sequence[str]) -> list[str]:
    """Add a number to each name that occurred before; `a-b/x` and `a/b-x`, for example, give the same name."""
    used, out = set[str](), []
    for name in names:
        number, own = 2, name
        while own.casefold() in used:
            own, number = f"{name}-{number}", number + 1
        used.add(own.casefold())
        out.append(own)
    return out


def _repeated(texts: Sequence[str]) -> set[str]:
    """Return the texts, case-folded, that occur more than once; some file systems do not distinguish case."""
    counts = Counter(text.casefold() for text in texts)
    return {text for text, count in counts.items() if count > 1}


def record_of(folder: Path) -> Record | None:
    """Return the record in a flight's folder; None if there is no such folder.

    Raises InputError when something else has that name, which must not be replaced.
    """
    if not folder.exists():
        return None
    try:
        return msgspec.json.decode((folder / RECORD).read_bytes(), type=Record)
    except (OSError, msgspec.DecodeError, msgspec.ValidationError):
        raise InputError(
            f"{folder}: exists, and was not written by `analyze` of several logs; move it, or give another folder with"
            " -o"
        ) from None


def records(output: Path) -> dict[Path, Record]:
    """Return the records of all flights' folders below `output`."""
    records = {}
    for path in output.glob(f"*/{RECORD}"):
        try:
            record = record_of(path.parent)
        except InputError:
            continue
        if record:
            records[path.parent] = record
    return records


def intact(folder: Path, record: Record) -> bool:
    """Whether the results in a flight's folder are unchanged since they were written with the record."""
    results = folder / RESULTS
    if record.results_digest is None:
        return True
    return results.is_file() and digest(results) == record.results_digest


def put_aside(folder: Path) -> Path:
    """Rename a flight's folder whose name another log needs. Returns the new folder. Raises InputError."""
    number = 2
    while (aside := folder.with_name(f"{folder.name}-{number}")).exists():
        number += 1
    with _as_input_error(folder):
        folder.rename(aside)
    return aside


def edited_runs(folder: Path, record: Record | None) -> Path | None:
    """Return the list of runs in a flight's folder if the user has edited it since it was written; None otherwise."""
    runs = folder / RUNS
    if record is None or not runs.is_file():
        return None
    return runs if record.runs_edited or digest(runs) != record.runs_digest else None


def partial_folder(output: Path, name: str) -> Path:
    """Make a folder for incomplete results next to the flight's folder. Raises InputError."""
    with _as_input_error(output):
        return Path(mkdtemp(prefix=f".{name}-", suffix=PARTIAL, dir=output))


def complete(partial: Path, folder: Path, *, key: str, log: LogFile, runs: Path | None) -> None:
    """Turn a partial folder into the flight's folder, replacing an earlier one.

    runs: the edited list of runs that was used. This list is kept, and so are files that the user put into the earlier
    folder. Raises InputError when the folder cannot be written.
    """
    earlier = record_of(folder)
    with _as_input_error(folder):
        if runs is not None:
            shutil.copy2(runs, partial / RUNS)
        written = sorted(path.relative_to(partial).as_posix() for path in partial.rglob("*") if path.is_file())
        if earlier:
            _carry_over(folder, partial, {*earlier.files, RECORD})
        record = Record(
            key=key,
            log=log,
            runs_edited=runs is not None,
            runs_digest=digest(partial / RUNS) if (partial / RUNS).is_file() else None,
            files=written,
            results_digest=digest(partial / RESULTS) if (partial / RESULTS).is_file() else None,
        )
        write_file(partial / RECORD, msgspec.json.format(msgspec.json.encode(record), indent=1))
        partial.chmod(0o755)  # a temporary folder has the mode 0o700
        if earlier:
            replaced = folder.with_name(f".{folder.name}{REPLACED}")
            shutil.rmtree(replaced, ignore_errors=True)
            folder.rename(replaced)
            partial.rename(folder)
            shutil.rmtree(replaced, ignore_errors=True)
        else:
            partial.rename(folder)


def _carry_over(folder: Path, partial: Path, ours: set[str]) -> None:
    """Copy what the analysis did not write: files, links and empty folders."""
    for path in folder.rglob("*"):
        name = path.relative_to(folder)
        if name.as_posix() in ours or os.path.lexists(partial / name):
            continue
        if path.is_symlink() or path.is_file():
            (partial / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(path, partial / name, follow_symlinks=False)
        elif path.is_dir() and not any(path.iterdir()):
            (partial / name).mkdir(parents=True)


@contextlib.contextmanager
def exclusive(output: Path) -> Iterator[None]:
    """Make the folder, lock it for this process, and remove what a killed run left behind.

    Raises InputError when it cannot be written or another process is working in it.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"{output}: is a file; give the folder for the results with -o")
    with _as_input_error(output):
        output.mkdir(parents=True, exist_ok=True)
        lock = (output / ".lock").open("wb")
    with lock:
        try:
            import fcntl
        except ImportError:  # Windows
            pass
        else:
            try:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                raise InputError(f"{output}: another `analyze` is writing into it; wait until it ends") from None
            except OSError:
                pass  # the file system has no locks
        _mend(output)
        try:
            yield
        finally:
            _mend(output)


def _mend(output: Path) -> None:
    """Remove incomplete folders; restore a folder that was about to be replaced if its replacement is missing."""
    for replaced in output.glob(f".*{REPLACED}"):
        complete = output / replaced.name[1 : -len(REPLACED)]
        if not complete.exists():  # the run was killed between the two renames
            replaced.rename(complete)
    for suffix in (PARTIAL, REPLACED):
        for left in output.glob(f".*{suffix}"):
            shutil.rmtree(left, ignore_errors=True)


@contextlib.contextmanager
def _as_input_error(path: Path) -> Iterator[None]:
    try:
        yield
    except OSError as error:
        raise write_error(path, error) from None
