"""The program as a library: five functions, which `analysis` offers by name (docs/python.md)."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from analysis.airdata.magnetometer import MAGNETOMETER_FILE
from analysis.airdata.probe import PROBE_FILE
from analysis.exports import KINDS
from analysis.exports.derived import write_derived_log
from analysis.exports.tables import WRITERS, tables_of
from analysis.log_contents import LogContents, Replacements, contents
from analysis.maneuvers import runs_file as toml_file
from analysis.pipeline import Analysis
from analysis.pipeline import analyze as run_pipeline
from analysis.schema import Results
from analysis.signals.rest import ZERO_FILE
from flight.aircraft import load_aircraft
from flight.errors import InputError
from flight.log_reader import Log, read_log
from flight.propeller_files import load_propeller

Paths = str | Path


def read(path: Paths) -> Log:
    """A log of the daemon, or of other software in its format (docs/log-format.md).

    Raises flight.errors.InputError when it cannot be read.
    """
    return read_log(path)


@dataclass(frozen=True)
class Flight:
    """An analyzed log. results: in the form of results.json.

    analysis : also the air data `table`, `maneuvers`, the `trajectory` with its covariance, `drag` by every method
    contents : aircraft, propeller, calibrations and zeros that were used
    """

    log: Log
    contents: LogContents
    analysis: Analysis

    @property
    def results(self) -> Results:
        return self.analysis.results


def analyze(
    log: Log,
    *,
    aircraft: Paths | None = None,
    propeller: str | None = None,
    probe: Paths | None = None,
    zero: Paths | None = None,
    magnetometer: Paths | None = None,
    weight_N: float | None = None,
    runs: Paths | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> Flight:
    """Power required from a log. Files given are used instead of those in the log.

    propeller: the name of a shipped one, or a file. runs: an edited runs.toml. progress: called with the name of each
    step. Raises flight.errors.InputError when the log lacks something, or holds no run.
    """
    given = Replacements(
        aircraft=load_aircraft(Path(aircraft)) if aircraft else None,
        propeller=load_propeller(propeller) if propeller else None,
        probe=PROBE_FILE.load(Path(probe)) if probe else None,
        magnetometer=MAGNETOMETER_FILE.load(Path(magnetometer)) if magnetometer else None,
        zero=ZERO_FILE.load(Path(zero)).by_channel() if zero else None,
        weight_N=weight_N,
    )
    if runs:
        toml_file.load(Path(runs))  # a wrong one is refused before anything is computed
    analysis = run_pipeline(log, given, progress, runs_file=Path(runs) if runs else None)
    return Flight(log, contents(log, given), analysis)


def tables(flight: Flight) -> dict[str, pd.DataFrame]:
    """The flight as tables by name: synchronized, states, derived, runs, curves (docs/exports.md)."""
    return tables_of(flight.analysis, flight.contents.aircraft, flight.contents.propeller)


def export(flight: Flight, to: str, path: Paths) -> None:
    """Write the tables. to: one of KINDS. path: a folder for csv and parquet, a file for mat and mcap.

    Raises flight.errors.InputError for another kind, or when it cannot be written.
    """
    if to not in KINDS:
        raise InputError(f"{to!r} is not a kind of export; choose one of {', '.join(KINDS)}")
    if to == "mcap":
        write_derived_log(tables(flight), flight.log, Path(path))
    else:
        WRITERS[to](tables(flight), Path(path))


def write_report(flight: Flight, folder: Paths) -> None:
    """Write report.html, results.json and the other files of `analyze` into a folder."""
    from analysis.report.write import write_report

    write_report(flight.analysis, Path(folder))
