"""The functions and records that `import flightpower` provides (docs/understand/python.md).

Files are given by their paths. Wrong input raises `InputError`, with one line that says what is wrong, where, and what
to do. Names end with their unit, which is an SI unit except in the options of the commands.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flightpower.analysis import pipeline
from flightpower.analysis.cli.plan import PlanOptions, flight_plan
from flightpower.analysis.flights.comparison import Comparison
from flightpower.analysis.flights.comparison import compare as compare_pools
from flightpower.analysis.flights.pool import Pool, pool_results
from flightpower.analysis.missions.search import FlightPlan
from flightpower.analysis.options import Options
from flightpower.analysis.pages import write
from flightpower.analysis.pages.exports import tables as exports
from flightpower.analysis.pipeline.runs import Analysis
from flightpower.analysis.pipeline.whole_flight import WholeFlightAnalysis
from flightpower.analysis.records.flight import Results
from flightpower.analysis.results.evidence import reasons_not_to_trust
from flightpower.analysis.sources.open import open_source
from flightpower.analysis.sources.recording import FlightRecording as Recording
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log

if TYPE_CHECKING:
    import pandas as pd

__all__ = [
    "Comparison",
    "Flight",
    "FlightPlan",
    "InputError",
    "Log",
    "Options",
    "PlanOptions",
    "Pool",
    "Recording",
    "Results",
    "analyze",
    "compare",
    "export",
    "plan",
    "pool",
    "read",
    "reasons_not_to_trust",
    "tables",
    "write_report",
]
Paths = str | os.PathLike[str]
# A flight of either kind: drag from runs, or electrical power from the energy balance of the whole flight.
Flight = Analysis | WholeFlightAnalysis


def read(path: Paths, columns: Paths | None = None) -> Log | Recording:
    """Read a log of the daemon or a table as messages, or a log of an autopilot as channels.

    A truncated log of the daemon is read as far as it goes; `torn` then says why it ends. columns: the map of a table.
    Raises InputError when the file cannot be read.
    """
    return open_source(Path(path), Path(columns) if columns is not None else None)


def analyze(
    log: Log | Recording | Paths, options: Options = Options(), progress: Callable[[str], None] = lambda _: None
) -> Flight:
    """Estimate power required from a log with runs, flow angles and motor speed, otherwise electrical power of level
    flight.

    log : of the daemon or an autopilot, or a table     progress : called with the name of each step
    Raises InputError when the log lacks something, or holds no run.
    """
    source = log if isinstance(log, Log | Recording) else read(log, options.columns)
    return pipeline.analyze(source, options, progress)


def tables(flight: Flight) -> dict[str, "pd.DataFrame"]:
    """The flight as tables by name (docs/use/exports.md): synchronized, states, derived, runs and curves; or, for
    electrical power from a whole flight, synchronized, windows and curves."""
    return exports.tables_of(flight)


def export(flight: Flight, to: str, path: Paths) -> None:
    """Write the tables. to: parquet, csv, mat or mcap. path: a folder for csv and parquet, else a file.

    Raises InputError for another kind, or if a file cannot be written.
    """
    exports.export_tables(tables(flight), flight.log, to, Path(path))


def write_report(flight: Flight, folder: Paths) -> None:
    """Write report.html, results.json and the other files of `analyze` into a folder.

    Raises InputError when it cannot be written.
    """
    write.write_report(flight, Path(folder))
    if isinstance(flight, WholeFlightAnalysis):
        write.write_left_out(flight, Path(folder))


def pool(flights: Sequence[Flight | Paths | Mapping[str, Any]]) -> Pool:
    """Estimate jointly from flights of one aircraft. Each is a flight analyzed here, or its results.json.

    Flights with drag are pooled by drag; if other flights give only electrical power, all flights that give it are also
    pooled by electrical power (`other_kind`). Raises InputError if flights cannot be pooled, such as those of two
    aircraft or installations.
    """
    if isinstance(flights, str | os.PathLike):
        raise InputError(f"pool({os.fspath(flights)!r}): give a list of flights, or of their results.json")
    return pool_results([_results(flight) for flight in flights])


def compare(a: Pool, b: Pool) -> Comparison:
    """Compare the power of B with that of A at A's weight and density, using a kind of power that both have.

    Raises InputError if there is no such kind, if both contain the same flight, or if they have no speeds in common.
    """
    return compare_pools(a, b)


def _results(flight: Flight | Paths | Mapping[str, Any]) -> Path | Mapping[str, Any] | Results:
    if isinstance(flight, Flight):
        return flight.results
    return flight if isinstance(flight, Mapping) else Path(flight)


def plan(aircraft: Paths, options: PlanOptions = PlanOptions()) -> FlightPlan:
    """Plan what to fly for the narrowest interval. aircraft: a file, or the name of a shipped aircraft.

    Raises InputError if the aircraft file lacks a needed key, or there is no such plan.
    """
    return flight_plan(os.fspath(aircraft), options)
