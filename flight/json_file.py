"""Small JSON files with a field `format`: calibrations and transducer zeros, as files or attached to a log."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Generic, Protocol, TypeVar

import msgspec

from flight.errors import InputError
from flight.text_file import read_text


class _HasFormat(Protocol):
    @property
    def format(self) -> str: ...


File = TypeVar("File", bound=_HasFormat)


def json_object_text(path: Path, of: str) -> str:
    """The text of a file that holds a JSON object. of: what it should be, such as "a probe calibration".

    Raises InputError when it cannot be read or is something else.
    """
    text = read_text(path)
    try:
        found = json.loads(text)
    except ValueError as error:
        raise InputError(f"{path}: not {of} ({error})") from None
    if not isinstance(found, dict):
        raise InputError(f"{path}: not {of} (not a JSON object)")
    return text


@dataclass(frozen=True)
class JsonFormat(Generic[File]):
    """One kind of JSON file with a field `format`.

    content : the struct of its content     formats : those that are accepted, the newest first
    of : what it is, such as "a probe calibration"
    check : of content and file name, raises InputError for content that the types of its fields permit
    remedy : appended to the message
    """

    content: type[File]
    formats: tuple[str, ...]
    of: str
    check: Callable[[File, str], None] = lambda _, __: None
    remedy: str = ""

    def parsed(self, data: bytes | str, where: str) -> File:
        """The content of such a file. Raises InputError naming `where` when it is something else."""
        try:
            found = msgspec.json.decode(data, type=self.content)
        except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
            raise InputError(f"{where}: not {self.of} ({error}){self.remedy}") from None
        if found.format not in self.formats:
            raise InputError(f"{where}: format {found.format!r} is not supported; expected {self.formats[0]!r}")
        self.check(found, where)
        return found

    def parsed_if_any(self, data: bytes | None, where: str) -> File | None:
        """The same, or None without data."""
        return None if data is None else self.parsed(data, where)

    def load(self, path: Path) -> File:
        """The content of a file. Raises InputError naming it, also when it cannot be read."""
        try:
            data = path.read_bytes()
        except OSError as error:
            raise InputError(f"{path}: cannot be read ({error.strerror or error})") from None
        return self.parsed(data, str(path))
