"""Other people's files, not part of the project: tests read them next to the checkout and are skipped where they are
missing."""

from pathlib import Path

import pytest


def beside(name: str) -> Path:
    """A file or folder of `shared/data` in the nearest folder above that has it, or else a path without a file."""
    folders = [folder / "shared" / "data" / name for folder in Path(__file__).resolve().parents]
    return next((path for path in folders if path.exists()), folders[0])


def needs(path: Path) -> pytest.MarkDecorator:
    """Skips the marked tests if a shared file is missing."""
    return pytest.mark.skipif(not path.exists(), reason=f"not beside the checkout: shared/data/{path.name}")
