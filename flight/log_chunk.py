"""Decompresses the chunks of a log with a limit: a file of 55 kB can hold a chunk of 1 GB.

Chunks of this program hold less than 0.5 MB, those of other MCAP tools 1 to 4 MiB.
"""

from collections.abc import Callable

import zstandard

MAX_CHUNK_BYTES = 16 * 2**20
# All chunks of a log together: the logs of this program are compressed to a fifth of their size.
ALLOWED_COMPRESSION = 50
ALLOWED_BYTES = 16 * 2**20


class LogTooLarge(Exception):
    """A log needs more memory than permitted. The message names the part that is too large, and the limit."""


def decompressed(compression: str, data: bytes) -> bytes:
    """The records in a chunk. compression: "zstd", "lz4" or "" for none.

    Raises LogTooLarge when they exceed MAX_CHUNK_BYTES, without decompressing them all. Raises ValueError for another
    compression; damaged data raise the exceptions of the decompressors.
    """
    if compression not in _DECOMPRESSORS:
        raise ValueError(f"a chunk has the unknown compression {compression!r}")
    records = _DECOMPRESSORS[compression](data)
    if len(records) > MAX_CHUNK_BYTES:
        raise _too_large()
    return records


def allowed_bytes(file_bytes: int) -> int:
    """The limit for all decompressed chunks of a log of `file_bytes`."""
    return ALLOWED_BYTES + ALLOWED_COMPRESSION * file_bytes


def _zstd(data: bytes) -> bytes:
    size = zstandard.get_frame_parameters(data).content_size
    if size == zstandard.CONTENTSIZE_UNKNOWN:
        reader = zstandard.ZstdDecompressor(max_window_size=MAX_CHUNK_BYTES).stream_reader(data)
        return reader.read(MAX_CHUNK_BYTES + 1)
    if size > MAX_CHUNK_BYTES:
        raise _too_large()
    return zstandard.decompress(data)


def _lz4(data: bytes) -> bytes:
    import lz4.frame  # type: ignore[import-untyped]

    return bytes(lz4.frame.LZ4FrameDecompressor().decompress(data, max_length=MAX_CHUNK_BYTES + 1))


_DECOMPRESSORS: dict[str, Callable[[bytes], bytes]] = {"zstd": _zstd, "lz4": _lz4, "": lambda data: data}


def _too_large() -> LogTooLarge:
    return LogTooLarge(f"a chunk decompresses to more than {MAX_CHUNK_BYTES // 2**20} MiB, the limit")
