"""Logs in folders, and at addresses that fsspec can reach (`s3://`, `gs://`, `https://`).

Each address is listed once. A log at an address is copied when it is analyzed, and the copy is deleted afterwards. The
library for the address finds credentials in its own ways, such as the environment or a file in the home folder.
"""

import hashlib
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path, PurePath, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TypeVar

from flightpower.analysis.flights.campaign.settings import CAMPAIGN
from flightpower.analysis.sources.open import suffixes
from flightpower.flight.errors import InputError

if TYPE_CHECKING:
    from fsspec import AbstractFileSystem

T = TypeVar("T")

ADDRESS = re.compile(r"[a-z][a-z0-9+.-]+://", re.IGNORECASE)
# Fields that show whether a store's object was rewritten; the first one that the store provides is used.
VERSIONS = (
    "ETag",
    "etag",
    "md5Hash",
    "generation",
    "LastModified",
    "Last-Modified",
    "last_modified",
    "mtime",
    "created",
)
RESULTS_HERE = ", but results of `analyze`: give the logs again, with this folder after -o; no flight is analyzed twice"
FOR_GOOD = (FileNotFoundError, PermissionError, IsADirectoryError, ImportError, ValueError)  # retrying does not help


@dataclass(frozen=True)
class RemoteLog:
    """A log as listed at its address. version: changes when the log is rewritten; empty if the store gives none."""

    address: str
    size: int | None
    version: str

    def __str__(self) -> str:
        return printable(self.address)

    @property
    def place(self) -> PurePosixPath:
        """The address in the form of a file path: bucket or host, folders, name."""
        return PurePosixPath("/", str(self).split("://", 1)[1])


Log = Path | RemoteLog


@dataclass
class FoundLogs:
    """Logs in the order of the arguments. failures: a line for each argument that cannot be listed or has no logs.

    in_folders: whether any of the arguments is a folder.
    """

    logs: list[Log] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    in_folders: bool = False


def is_address(text: str) -> bool:
    return ADDRESS.match(text) is not None


def printable(address: str) -> str:
    """Return the address without the signature that follows a question mark, so that it can be printed."""
    return address.split("?", 1)[0] if address.startswith("http") else address


def place(log: Log) -> PurePath:
    """Return the absolute path of a log, or its address as a path."""
    return log.absolute() if isinstance(log, Path) else log.place


def _has_results(folder: Path) -> bool:
    return any(folder.rglob("results.json"))


def find_logs(arguments: Sequence[str]) -> FoundLogs:
    """Return files as given, and all logs in and below each folder or folder's address, recognized by suffix."""
    listing = FoundLogs()
    for argument in arguments:
        try:
            if is_address(argument):
                listed = _listed(argument)
                listing.in_folders |= [str(log) for log in listed] != [printable(argument)]
                listing.logs += listed
            elif (folder := Path(argument)).is_dir():
                listing.in_folders = True
                inside = sorted(
                    path for path in folder.rglob("*") if path.suffix.lower() in suffixes() and path.is_file()
                )
                if not inside:
                    raise InputError(f"{folder}: no logs in this folder{RESULTS_HERE if _has_results(folder) else ''}")
                listing.logs += inside
            else:
                listing.logs.append(Path(argument))
        except InputError as error:
            listing.failures.append(str(error))
    return listing


def file_system(address: str) -> tuple["AbstractFileSystem", str]:
    """Return the file system of an address, and the path in it. Raises InputError."""
    try:
        from fsspec.core import url_to_fs
    except ModuleNotFoundError:
        raise InputError(
            f'{printable(address)}: fsspec is not installed; in the clone: pip install ".[fleet]"'
        ) from None
    try:
        fs, path = url_to_fs(address)
    except (ImportError, ValueError) as error:
        raise InputError(f"{printable(address)}: cannot be reached ({error})") from None
    return fs, path.rstrip("/")


def _listed(address: str) -> list[RemoteLog]:
    """Return the log at an address, or the logs below it. Raises InputError."""
    if "@" in address.split("://", 1)[1].split("/", 1)[0]:
        raise InputError(
            "the address contains a password: put the password where the library looks for it, such as ~/.netrc"
        )
    fs, path = file_system(address)
    fs.invalidate_cache()
    web = address.startswith("http")

    def entries() -> Mapping[str, Mapping[str, Any]]:
        if not address.endswith("/"):
            info = fs.info(path)
            if info["type"] != "directory":
                return {info["name"]: info}
        if not web:
            return dict(fs.find(path, detail=True))
        names = [name for name in fs.ls(f"{path}/", detail=False) if _is_log(name)]
        with ThreadPoolExecutor() as pool:
            return dict(zip(names, pool.map(fs.info, names), strict=True))

    listing = _answer_of(address, entries)
    logs = [
        RemoteLog(fs.unstrip_protocol(name), info.get("size"), _version(info))
        for name, info in sorted(listing.items())
        if len(listing) == 1 or _is_log(name)
    ]
    if not logs:
        raise InputError(f"{printable(address)}: no logs there")
    return logs


def _is_log(name: str) -> bool:
    return PurePosixPath(printable(name)).suffix.lower() in suffixes()


def _version(info: Mapping[str, Any]) -> str:
    return next((str(info[name]) for name in VERSIONS if info.get(name)), "")


def _answer_of(address: str, ask: Callable[[], T]) -> T:
    """Return a store's answer; a failed request, or one made too often, is retried after a pause. Raises InputError."""
    pause_s, left_s = 1.0, CAMPAIGN.connect_s
    while True:
        try:
            return ask()
        except Exception as error:  # each library raises its own kinds of errors
            if pause_s > left_s or isinstance(error, FOR_GOOD):
                message = " ".join(str(error).replace(address, printable(address)).split())
                # The error for a missing file contains only the address.
                cause = (
                    message
                    if message not in ("", printable(address))
                    else "no server answers there, or there is no such file"
                )
                raise InputError(f"{printable(address)}: cannot be read ({cause})") from None
            time.sleep(pause_s)
            pause_s, left_s = 2 * pause_s, left_s - pause_s


def fetch(log: RemoteLog, to: Path) -> str:
    """Copy a log into a file. Returns the SHA-256 digest of its content. Raises InputError."""
    fs, path = file_system(log.address)

    def copied() -> None:
        fs.get_file(path, str(to))
        if log.size is not None and to.stat().st_size != log.size:
            raise OSError(f"{to.stat().st_size} bytes of {log.size}, or it was rewritten meanwhile")

    _answer_of(log.address, copied)
    with to.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def content_digest(log: RemoteLog) -> str:
    """Return the SHA-256 digest of a log's content. Raises InputError."""
    with TemporaryDirectory(prefix="flightpower-") as folder:
        return fetch(log, Path(folder, "log"))


def name_by_address(folder: Path, copy: Path, log: Log) -> None:
    """Replace the path of a log's copy by the log's address in the results below a folder."""
    for path in folder.rglob("*") if copy != log else ():
        if path != copy and path.is_file() and str(copy).encode() in (content := path.read_bytes()):
            path.write_bytes(content.replace(str(copy).encode(), str(log).encode()))


@contextmanager
def as_file(log: Log, folder: Path) -> Iterator[tuple[Path, str]]:
    """Yield a log as a local file with the log's name, and its digest if it was copied. The copy stays below `folder`
    until the end.

    Raises InputError when it cannot be copied. InputErrors raised while the copy is in use name the log, not the copy.
    """
    if isinstance(log, Path):
        yield log, ""
        return
    with TemporaryDirectory(prefix=".log-", dir=folder) as temporary:
        copy = Path(temporary, log.place.name)
        digest = fetch(log, copy)
        try:
            yield copy, digest
        except InputError as error:
            raise InputError(str(error).replace(str(copy), str(log))) from None
