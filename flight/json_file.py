"""Small JSON files that say of what format they are: calibrations and zeros, beside a log or within it."""

from typing import Protocol, TypeVar

import msgspec

from flight.errors import InputError


class _Named(Protocol):
    @property
    def format(self) -> str: ...


File = TypeVar("File", bound=_Named)


def decoded(
    data: bytes | str, kind: type[File], formats: tuple[str, ...], where: str, of: str, remedy: str = ""
) -> File:
    """The content of such a file, in one of the formats, the newest first.

    Raises InputError naming `where`: that it is not `of` ("a probe calibration") and the remedy, or of a format
    unknown here.
    """
    try:
        found = msgspec.json.decode(data, type=kind)
    except msgspec.MsgspecError as error:
        raise InputError(f"{where}: not {of} ({error}){remedy}") from None
    if found.format not in formats:
        raise InputError(f"{where}: format {found.format!r} is not understood here ({formats[0]} is)")
    return found
