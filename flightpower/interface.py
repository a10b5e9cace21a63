"""The functions and records that `import flightpower` gives (docs/understand/python.md).

Files are given by their paths. What is wrong with an input raises `InputError`, with one line that says what, where and
what to do. Names end with their unit, which is SI but for the options of the commands.
"""

import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import msgspec

from analysis import pipeline
from analysis.cli.plan import PlanOptions, flight_plan
from analysis.flights.comparison import Comparison, compare
from analysis.flights.pool import Pool, pool_results
from analysis.missions.search import FlightPlan
from analysis.options import Options
from analysis.pages import write
from analysis.pages.exports import tables as exports
from analysis.pipeline import Analysis as Flight
from analysis.records.flight import Results
from analysis.results.evidence import reasons_not_to_trust
from flight.errors import InputError
from flight.log_reader import Log, read_log

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


def read(path: Paths) -> Log:
    """A log of the daemon. A torn one is read as far as it goes; `torn` then says why it ends.

    Raises InputError when the file cannot be read as a log.
    """
    return read_log(Path(path))


def analyze(log: Log | Paths, options: Options = Options(), progress: Callable[[str], None] = lambda _: None) -> Flight:
    """Power required from a log. progress: called with the name of each step.

    Raises InputError when the log lacks something, or holds no run.
    """
    recorded = log if isinstance(log, Log) else read(log)
    return pipeline.analyze(
        recorded,
        options.replacements(),
        progress,
        request=options.request,
        runs_file=options.runs,
        by_likelihood=options.likelihood,
    )


def tables(flight: Flight) -> dict[str, "pd.DataFrame"]:
    """The flight as tables by name: synchronized, states, derived, runs, curves (docs/use/exports.md)."""
    return exports.tables_of(flight)


def export(flight: Flight, to: str, path: Paths) -> None:
    """Write the tables. to: parquet, csv, mat or mcap. path: a folder for csv and parquet, else a file.

    Raises InputError for another kind, or when it cannot be written.
    """
    exports.export_tables(tables(flight), flight.log, to, Path(path))


def write_report(flight: Flight, folder: Paths) -> None:
    """Write report.html, results.json and the other files of `analyze` into a folder.

    Raises InputError when it cannot be written.
    """
    write.write_report(flight, Path(folder))


def pool(flights: Sequence[Flight | Paths | Mapping[str, Any]]) -> Pool:
    """The joint estimate of flights of one aircraft: each analyzed here, or its results.json.

    Raises InputError for none, for one flight twice, and for flights of two aircraft, propellers or installations.
    """
    return pool_results([_results(flight) for flight in flights])


def _results(flight: Flight | Paths | Mapping[str, Any]) -> Path | Mapping[str, Any]:
    if isinstance(flight, Flight):
        content: dict[str, Any] = msgspec.to_builtins(flight.results)
        return content
    return flight if isinstance(flight, Mapping) else Path(flight)


def plan(aircraft: Paths, options: PlanOptions = PlanOptions()) -> FlightPlan:
    """What to fly for the narrowest interval. aircraft: a file, or the name of a shipped one.

    Raises InputError when the aircraft lacks something, or there is no such plan.
    """
    return flight_plan(os.fspath(aircraft), options)
