"""A chunk that decompresses to more than the limit is refused without decompressing it all."""

import lz4.frame
import pytest
import zstandard

from flightpower.flight import log_chunk
from flightpower.flight.log_chunk import LogTooLarge, allowed_bytes, decompressed

LIMIT = 2**21  # no less than the window of a compressor
COMPRESSORS = {
    "zstd": zstandard.ZstdCompressor().compress,
    "zstd of unknown size": zstandard.ZstdCompressor(write_content_size=False).compress,
    "lz4": lz4.frame.compress,
    "": bytes,
}


@pytest.mark.parametrize("kind", COMPRESSORS)
def test_the_limit_is_the_largest_chunk_that_is_read(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(log_chunk, "MAX_CHUNK_BYTES", LIMIT)
    name, records = kind.partition(" ")[0], bytes(LIMIT)
    assert decompressed(name, COMPRESSORS[kind](records)) == records
    with pytest.raises(LogTooLarge):
        decompressed(name, COMPRESSORS[kind](records + b"x"))


def test_the_limit_of_all_chunks_grows_with_the_file() -> None:
    """Logs of this program shrink to a fifth; ten times that ratio is permitted, and 16 MiB more for any file."""
    assert allowed_bytes(0) == 16 * 2**20
    assert allowed_bytes(1000) - allowed_bytes(0) == 50 * 1000
