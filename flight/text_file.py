"""Reads text files that people write."""

from pathlib import Path

from flight.errors import InputError


def read_text(path: Path) -> str:
    """The content of a UTF-8 text file, without the mark that some editors put at its beginning (BOM).

    Raises InputError when it cannot be read or is not text.
    """
    try:
        return path.read_text("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path}: not a text file in UTF-8; save it as text in UTF-8") from None
    except OSError as error:
        cause = "it is a folder" if path.is_dir() else error.strerror or error
        raise InputError(f"{path}: cannot be read ({cause})") from None
