"""Small JSON files with a field `format`: calibrations and transducer zeros, as files or attached to a log."""

from typing import Protocol, TypeVar

import msgspec

from flight.errors import InputError


class _HasFormat(Protocol):
    @property
    def format(self) -> str: ...


File = TypeVar("File", bound=_HasFormat)


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
    except msgspec.MsgspecError as error:
        raise InputError(f"{where}: not {of} ({error}){remedy}") from None
    if found.format not in formats:
        raise InputError(f"{where}: format {found.format!r} is not supported; expected {formats[0]!r}")
    return found
