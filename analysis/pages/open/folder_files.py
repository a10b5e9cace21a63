"""The files of the folder that was opened: logs with date, length and kind, and predicted polars."""

from collections.abc import Callable
from datetime import UTC, datetime
from functools import lru_cache
from pathlib import Path

from flightpower.analysis.pages.open.opened import report_folder
from flightpower.analysis.pages.open.request import LIMITS, Json
from flightpower.analysis.sources.extent import Extent, LogKind, extent
from flightpower.analysis.sources.open import has_log_suffix, is_table
from flightpower.flight.errors import InputError

POLARS = (".txt", ".csv", ".dat")


def logs_in(folder: Path) -> dict[str, Path]:
    """Return the logs and tables in a folder by name; links that lead out of it are left out."""
    return _inside(folder, lambda path: has_log_suffix(path.name) and not (_may_be_polar(path) and is_polar(path)))


def polars_in(folder: Path) -> dict[str, Path]:
    """Return the predicted polars in a folder by name; links that lead out of it are left out."""
    return _inside(folder, lambda path: _may_be_polar(path) and is_polar(path))


def _inside(folder: Path, wanted: Callable[[Path], bool]) -> dict[str, Path]:
    inside = folder.resolve()
    paths = (path for path in sorted(folder.iterdir()) if path.is_file() and path.resolve().parent == inside)
    return {path.name: path for path in paths if not path.name.startswith(".") and wanted(path)}


def _may_be_polar(path: Path) -> bool:
    return path.suffix.lower() in POLARS and path.stat().st_size <= LIMITS.request_bytes


def is_polar(path: Path) -> bool:
    """Whether a file holds a predicted polar."""
    stat = path.stat()
    return _is_polar(path, stat.st_mtime_ns, stat.st_size)


@lru_cache(LIMITS.entries)
def _is_polar(path: Path, mtime_ns: int, size: int) -> bool:
    """Whether one state of a file holds a predicted polar; the answer is cached."""
    from flightpower.analysis.pages.predicted_polar import read_predicted_polar

    try:
        return bool(read_predicted_polar(path))
    except InputError:
        return False


def listed(folder: Path) -> list[Json]:
    """Return name, date, length and kind of each log, and whether it has a report; newest first."""
    rows = []
    for path in logs_in(folder).values():
        stat = path.stat()
        about = _extent(path, stat.st_mtime_ns, stat.st_size)
        began_s = about.start_s if about.start_s is not None else stat.st_mtime
        rows.append(
            {
                "name": path.name,
                "began_s": began_s,
                "date": datetime.fromtimestamp(began_s, UTC).astimezone().strftime("%Y-%m-%d %H:%M"),
                "of_file": about.start_s is None,
                "length": "" if about.length_s is None else _minutes(about.length_s),
                "kind": about.kind,
                "size": f"{stat.st_size / 1e6:.1f} MB" if stat.st_size > 1e5 else f"{stat.st_size / 1e3:.1f} kB",
                "report": (report_folder(path) / "report.html").is_file(),
            }
        )
    return sorted(rows, key=lambda row: -row["began_s"])


def _minutes(length_s: float) -> str:
    return f"{length_s / 60:.0f} min" if length_s >= 120 else f"{length_s:.0f} s"


@lru_cache(LIMITS.entries)
def _extent(path: Path, mtime_ns: int, size: int) -> Extent:
    """Return date, length and kind of one state of a log; the answer is cached."""
    try:
        log_extent = extent(path)
        return log_extent if log_extent.kind is not LogKind.TABLE or is_table(path) else Extent(LogKind.UNKNOWN)
    except (OSError, InputError):
        return Extent(LogKind.UNKNOWN)
