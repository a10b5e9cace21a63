"""Syncs a directory."""

import os
from pathlib import Path


def sync_directory(directory: Path) -> None:
    """Sync a directory, so that a new file name in it survives a power cut."""
    handle = os.open(directory, os.O_RDONLY | os.O_DIRECTORY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
