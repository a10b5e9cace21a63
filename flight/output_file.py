"""Whether a file can be written, before the work whose result goes into it."""

from pathlib import Path
from tempfile import TemporaryFile

from flight.errors import InputError


def check_writable(path: Path) -> None:
    """Raises InputError unless a file of this name can be written, with its folder. Leaves nothing behind."""
    made: list[Path] = []
    try:
        if path.is_dir():
            raise IsADirectoryError(0, "it is a folder")
        for folder in reversed(path.parents):
            if not folder.exists():
                folder.mkdir()
                made.append(folder)
        with TemporaryFile(dir=path.parent):
            pass
    except OSError as error:
        raise InputError(f"{path}: cannot be written ({error.strerror or error}); give another name") from None
    finally:
        for folder in reversed(made):
            folder.rmdir()
