"""A log shown on the page: the part that both kinds of flight have in common."""

import os
import shlex
import time
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from flightpower.analysis.curve import Condition, Cost, Curve
from flightpower.analysis.options import Options
from flightpower.analysis.pages.one_log import Report
from flightpower.analysis.pages.open.request import LIMITS, FieldError, Json, Values
from flightpower.analysis.records.flight import Kind, PowerPoint, SpeedInterval
from flightpower.analysis.sources.column_map import map_files
from flightpower.analysis.sources.open import is_table
from flightpower.analysis.sources.recording import AllChannels, Channel
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2


class OpenedFlight(ABC):
    """A log with the results computed so far. workspace : a folder for the list of runs while it is edited"""

    kind: Kind

    def __init__(self, path: Path, workspace: Path):
        self.path, self.workspace = path, workspace
        self._stat = _stat(path)
        self._curves: dict[bytes, Json] = {}  # by the request

    def changed(self) -> bool:
        """Whether the file has changed since it was opened."""
        return _stat(self.path) != self._stat

    @cached_property
    @abstractmethod
    def shown(self) -> Json:
        """Return kind, time histories, modes and messages, and the form of the flight as recorded."""

    @abstractmethod
    def strips(self, channels: dict[str, Channel]) -> str:
        """Return the time histories, with further channels."""

    @abstractmethod
    def _curve(self, values: Values) -> Json: ...

    @abstractmethod
    def _options(self, values: Values, folder: Path) -> Options:
        """Return the options of `analyze`. Raises InputError if a value is missing or wrong."""

    @abstractmethod
    def _words(self, values: Values, folder: Path) -> list[str]:
        """Return the command-line options that give the same result."""

    @abstractmethod
    def _write_inputs(self, values: Values, folder: Path) -> Iterator[Path | None]:
        """Write the files that the command names, and yield where their earlier content is kept."""

    @cached_property
    @abstractmethod
    def channels(self) -> AllChannels:
        """Return every number of the log over time, on the page's clock. Raises InputError if it cannot be read."""

    def curve(self, values: Values) -> Json:
        """Return the curve as the report will show it. Raises InputError."""
        request = msgspec.json.encode(values)
        if request not in self._curves:
            began = time.process_time()
            curve = self._curve(values)
            curve["seconds"] = time.process_time() - began
            while len(self._curves) >= LIMITS.curves:
                self._curves.pop(next(iter(self._curves)))
            self._curves[request] = curve
        return self._curves[request]

    def drawn(self, values: Values) -> Json:
        """Return the time histories with the requested channels. Raises InputError for an unknown name."""
        if len(values.channels) > LIMITS.channels:
            raise FieldError(
                f"{len(values.channels)} channels: {LIMITS.channels} are drawn at most; remove some", "channels"
            )
        unknown = [name for name in values.channels if name not in self.channels]
        if unknown:
            raise FieldError(
                f"{unknown[0][:80]!r}: no such channel in {self.path.name}; choose one of the list", "channels"
            )
        return {"strips": self.strips({name: self.channels[name]() for name in values.channels})}

    def write(self, values: Values) -> Json:
        """Write what `analyze` writes, and return its summary. Raises InputError; then no result has been written."""
        from flightpower.analysis.pages.one_log import analyze_log

        folder = report_folder(self.path)
        self.curve(msgspec.structs.replace(values, method=""))  # reports errors before anything is written
        options = self._options(values, folder)
        backups = [path.name for path in self._write_inputs(values, folder) if path]
        done = analyze_log(self.path, folder, options, lambda _: None, self.command(values))
        self.__dict__.pop("shown", None)  # so that the next session starts with the written list
        return {"said": _summary_lines(done), "kept": backups, "command": self.command(values)}

    def command(self, values: Values) -> str:
        """Return the command that gives the same files."""
        folder = report_folder(Path(os.path.relpath(self.path)))
        return shlex.join(["analyze", os.path.relpath(self.path), *self._words(values, folder)])


def curve_json(curve: Curve) -> Json:
    """Return the data of a curve for the page."""
    return {
        "kind": curve.kind,
        "curve": columns(curve.points()),
        "least_power": _speed(curve.best(Cost.POWER)),
        "mass_kg": curve.condition.weight_N / GRAVITY_MPS2,
        "density_kgpm3": curve.condition.rho,
    }


def condition_at(flown: Condition, weight_and_density: tuple[float, float] | None) -> Condition:
    """Return the condition flown with a different mass and density. Raises InputError for impossible values."""
    if weight_and_density is None:
        return flown
    mass_kg, rho = weight_and_density
    if not (0 < mass_kg < 1000 and 0 < rho < 2):
        raise InputError(f"mass {mass_kg:g} kg in air of {rho:g} kg/m³: no flight to compare at")
    return flown._replace(weight_N=mass_kg * GRAVITY_MPS2, rho=rho)


def columns(points: list[PowerPoint]) -> Json:
    """Return the points of a curve by quantity."""
    names = ("speed_mps", "power_W", "power_lo_W", "power_hi_W")
    return {name: [getattr(point, name) for point in points] for name in names}


def shares(variances: Mapping[Any, Any]) -> list[list[Any]]:
    """Return the share of each source of error in the variance."""
    total = sum(float(np.ravel(variance)[0]) for variance in variances.values())
    return [[str(source), float(np.ravel(variance)[0]) / total] for source, variance in variances.items()]


def report_folder(log: Path) -> Path:
    """Return where `analyze` writes by default."""
    return log.parent / f"{log.stem}.report"


def _stat(path: Path) -> list[tuple[int, int]]:
    """Return time and size of a log, and of the map of a table's columns."""
    files = [path, *(map_files(path, None) if is_table(path) else [])]
    return [(stat.st_mtime_ns, stat.st_size) for stat in (file.stat() for file in files)]


def _speed(speed_interval: SpeedInterval) -> float | None:
    return speed_interval.speed_mps if speed_interval.inside_flown_range else None


def _summary_lines(done: Report) -> list[str]:
    """Return the verdict, and what was replaced."""
    results = done.results
    return [f"{results.aircraft.title}: {results.trust}"] + ([done.replaced_report] if done.replaced_report else [])
