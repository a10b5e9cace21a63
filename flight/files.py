"""Files named by the user: read text and JSON, check whether a file can be written, and write several files as one."""

import json
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile
from typing import Generic, Protocol, TypeVar

import msgspec

from flightpower.flight.errors import STORAGE_FAILS, InputError, StorageError


def read_text(path: Path) -> str:
    """The content of a UTF-8 text file, without the mark that some editors put at its beginning (BOM).

    Raises InputError when it cannot be read or is not text.
    """
    try:
        return path.read_text("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8: give another file, or save it as text in UTF-8") from None
    except OSError as error:
        cause = "it is a folder" if path.is_dir() else error.strerror or error
        raise InputError(f"{path}: cannot be read ({cause})") from None


PARTIAL = ".part"  # suffix of files that are not complete yet


def write_error(path: Path, error: OSError) -> InputError:
    """The error to raise when a file cannot be written. Its message has the requested name and the cause."""
    kind = StorageError if error.errno in STORAGE_FAILS else InputError
    return kind(f"{path}: cannot be written ({error.strerror or error})")


def write_files(files: Mapping[Path, str | bytes]) -> None:
    """Write files and make their folders, all or none: the files get their names once all are complete.

    Raises InputError if a file cannot be written, StorageError if the disk is full or fails; no new file is left then.
    """
    made: list[Path] = []
    parts = {path: path.with_name(path.name + PARTIAL) for path in files}
    path = Path()
    try:
        for path, content in files.items():
            made += _make_folders(path)
            parts[path].write_bytes(content.encode() if isinstance(content, str) else content)
        for path, part in parts.items():
            part.replace(path)
    except OSError as error:
        _remove(parts.values(), made)
        raise write_error(path, error) from None
    except BaseException:  # Ctrl-C
        _remove(parts.values(), made)
        raise


def write_file(path: Path, data: str | bytes) -> None:
    """Write a file and make its folder; `path` never holds a partial file. Raises the errors of `write_files`."""
    write_files({path: data})


def _make_folders(path: Path) -> list[Path]:
    """Make the folders of a file; returns those that were missing."""
    missing = [folder for folder in reversed(path.parents) if not folder.exists()]
    path.parent.mkdir(parents=True, exist_ok=True)
    return missing


def _remove(files: Iterable[Path], folders: list[Path]) -> None:
    """Remove files, and then those folders that are empty."""
    for path in files:
        with suppress(OSError):
            path.unlink(missing_ok=True)
    for folder in reversed(folders):
        with suppress(OSError):
            folder.rmdir()


def check_writable(path: Path) -> None:
    """Raises InputError unless a file of this name can be written, with its folder. Leaves nothing behind."""
    made: list[Path] = []
    try:
        if path.is_dir():
            raise IsADirectoryError(0, "it is a folder")
        for folder in reversed(path.parents):
            if not folder.exists():
                folder.mkdir()
                made.append(folder)
        with TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        if error.errno in STORAGE_FAILS:
            raise write_error(path, error) from None
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); give another name") from None
    finally:
        for folder in reversed(made):
            folder.rmdir()


def check_new_file(path: Path, *, replace: bool) -> None:
    """Raises InputError if the file exists and is not to be replaced, or cannot be written."""
    if path.is_file() and not replace:
        raise InputError(f"{path}: exists already; give --replace, or another name with -o")
    check_writable(path)


# Small JSON files with a field `format`: calibrations and transducer zeros, as files or attached to a log.


class _HasFormat(Protocol):
    @property
    def format(self) -> str: ...


File = TypeVar("File", bound=_HasFormat)


def json_object_text(path: Path, meaning: str) -> str:
    """The text of a file that holds a JSON object. meaning: what it should be, such as "a probe calibration".

    Raises InputError when it cannot be read or is something else.
    """
    text = read_text(path)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: not {meaning} ({error})") from None
    if not isinstance(content, dict):
        raise InputError(f"{path}: not {meaning} (not a JSON object)")
    return text


def sha256_of(path: Path) -> str:
    """The hash of a file; empty for a folder, or a file that cannot be read."""
    import hashlib  # imported here because the daemon does not need it

    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError:
        return ""


@dataclass(frozen=True)
class JsonFormat(Generic[File]):
    """One kind of JSON file with a field `format`.

    content : the struct of its content     formats : those that are accepted, the newest first
    description : what it is, such as "a probe calibration"
    check : gets content and file name; raises InputError for wrong content that the types of its fields permit
    remedy : appended to the message
    """

    content: type[File]
    formats: tuple[str, ...]
    description: str
    check: Callable[[File, str], None] = lambda _, __: None
    remedy: str = ""

    def parsed(self, data: bytes | str, where: str) -> File:
        """The content of a file of this format. Raises InputError naming `where` if the data are something else."""
        try:
            content = msgspec.json.decode(data, type=self.content)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise InputError(f"{where}: not {self.description} ({error}){self.remedy}") from None
        if content.format not in self.formats:
            raise InputError(f"{where}: format {content.format!r} is not supported; expected {self.formats[0]!r}")
        self.check(content, where)
        return content

    def parsed_if_any(self, data: bytes | None, where: str) -> File | None:
        """Parses the file, or returns None without data."""
        return None if data is None else self.parsed(data, where)

    def load(self, path: Path) -> File:
        """The content of a file. Raises InputError naming the file if it is something else, or cannot be read."""
        try:
            data = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
        return self.parsed(data, str(path))
