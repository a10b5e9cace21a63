"""Small JSON files with a field `format`: calibrations and transducer zeros, as files or attached to a log."""

import json
from pathlib import Path
from typing import Protocol, TypeVar

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


def decoded(
    data: bytes | str, kind: type[File], formats: tuple[str, ...], where: str, of: str, remedy: str = ""
) -> File:
    """The content of a JSON file as the struct `kind`.

    formats: those that are accepted, the newest first. where: names the file in errors. of: what it should be, such
    as "a probe calibration". remedy: appended to the message.
    Raises InputError when the file is not `of`, or its format is not accepted.
    """
    try:
        found = msgspec.json.decode(data, type=kind)
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(f"{where}: not {of} ({error}){remedy}") from None
    if found.format not in formats:
        raise InputError(f"{where}: format {found.format!r} is not supported; expected {formats[0]!r}")
    return found
