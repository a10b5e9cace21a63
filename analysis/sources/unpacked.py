"""Unpacks a gzip-compressed log into a temporary file while it is read."""

import gzip
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from flightpower.flight.errors import InputError
from flightpower.flight.formats import GZIP_MAGIC, first_bytes
from flightpower.flight.log_chunk import allowed_bytes


@contextmanager
def unpacked(path: Path) -> Iterator[Path]:
    """Yield the path of the file, or if it is gzip-compressed, of a temporary file with its contents.

    Raises InputError if it cannot be unpacked, or unpacks to more than `flight.log_chunk` permits.
    """
    if not first_bytes(path, len(GZIP_MAGIC)).startswith(GZIP_MAGIC):
        yield path
        return
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as folder:
        plain = Path(folder) / path.with_suffix("").name
        _unpack(path, plain)
        yield plain


def _unpack(path: Path, plain: Path) -> None:
    left = allowed_bytes(path.stat().st_size)
    try:
        with gzip.open(path) as packed, plain.open("wb") as out:
            while block := packed.read(1 << 22):
                left -= len(block)
                if left < 0:
                    raise InputError(
                        f"{path}: unpacks to more than any log holds: unpack it yourself, and check what it is"
                    )
                out.write(block)
    except (OSError, EOFError, zlib.error) as error:
        raise InputError(f"{path}: cannot be unpacked ({error}): copy or download it again") from None
