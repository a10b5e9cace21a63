"""The files of a report: page, JSON, CSV, trajectory, table for the field; of one flight or of several."""

from pathlib import Path
from typing import Any

import msgspec
import pandas as pd

from analysis.files import write_file, write_keeping_previous
from analysis.maneuvers.kinds import Maneuvers
from analysis.maneuvers.runs_file import to_toml
from analysis.pipeline import Analysis
from analysis.pooling.results import ComparisonResults, ElectricalPooledResults, PooledResults
from analysis.report import field_table, page
from analysis.report.page import figures_by_name, run_fits
from analysis.report.pooled_page import render_comparison, render_electrical_flights, render_pooled
from analysis.report.predicted_polar import PredictedPolar, comparison
from analysis.report.runs import embedded_runs
from analysis.results.files import to_csv, to_json
from analysis.results.previous import replaced
from analysis.schema import ElectricalFlight
from analysis.trajectory.equations import GUST_FILTER_STATES, STATES
from analysis.trajectory.reconstruction import Trajectory

COLUMNS = {name: f"{name}_mps" for name in STATES}
COLUMNS |= {"phi": "roll_rad", "theta": "pitch_rad", "psi": "yaw_rad", "height": "height_m"}


def trajectory_csv(trajectory: Trajectory) -> str:
    """Every state with its standard error (`…_error`), one line each 0.2 s; units in the header."""
    states = trajectory.states.drop(columns=[*GUST_FILTER_STATES]).rename(columns=COLUMNS)
    errors = trajectory.states_error().drop(columns=[*GUST_FILTER_STATES]).rename(columns=COLUMNS).add_suffix("_error")
    table = pd.concat([states, errors], axis=1).reset_index()
    line = ",".join(["%.6g"] * table.shape[1])
    lines = [",".join(table.columns), *(line % tuple(row) for row in table.to_numpy().tolist()), ""]
    return "\n".join(lines).replace("nan", "")


def write_report(analysis: Analysis, folder: Path, predicted: PredictedPolar | None = None) -> str:
    """Write report.html, results.json, power_required.csv, path.csv and field_table.md and .csv into `folder`.

    predicted : a polar to draw beside the measured one
    Returns what of another log or of other options they replaced, in a sentence; empty where they replaced nothing.
    Everything is computed before the first file is written. Raises InputError when the folder cannot be written.
    """
    results = analysis.results
    files: dict[str, str | bytes] = {
        "results.json": to_json(results),
        "power_required.csv": to_csv(results),
        "path.csv": trajectory_csv(analysis.trajectory),
    }
    if results.use:
        files["field_table.md"] = field_table.to_markdown(results, results.use)
        files["field_table.csv"] = field_table.to_csv(results, results.use)
    before = replaced(folder, results, files)
    figures, fits = figures_by_name(analysis, predicted), run_fits(analysis)
    files["report.html"] = page.render(
        results,
        figures,
        fits,
        performance=analysis.performance,
        runs=embedded_runs(analysis),
        replaced=before,
        predicted=comparison(predicted, results) if predicted else "",
    )
    for name, content in files.items():
        write_file(folder / name, content)
    return before


def write_run_list(analysis: Analysis, folder: Path, log_name: str, *, given: Path | None) -> Path | None:
    """Write runs.toml into `folder`; returns where other content that was there is kept, if there was any.

    given: the list of runs that the analysis used. It is not overwritten, since it holds the user's remarks.
    Raises InputError when the file cannot be written.
    """
    path = folder / "runs.toml"
    if given is not None and path.exists() and path.samefile(given):
        return None
    return write_keeping_previous(path, to_toml(analysis.maneuvers, log_name))


def write_candidates(maneuvers: Maneuvers, folder: Path, log_name: str) -> Path:
    """Write runs.toml of a log in which no maneuver gives a curve; returns where. Raises InputError as above."""
    path = folder / "runs.toml"
    write_keeping_previous(path, to_toml(maneuvers, log_name))
    return path


FLIGHTS_FORMAT = "flightpower-flights-1"


def write_pooled(pooled: PooledResults, folder: Path) -> None:
    """Write report.html and results.json. Raises InputError when the folder cannot be written."""
    _write(render_pooled(pooled), pooled, folder)


def write_electrical_pool(flights: list[ElectricalFlight], pooled: ElectricalPooledResults, folder: Path) -> None:
    """Write report.html and results.json. Raises InputError when the folder cannot be written."""
    _write(render_electrical_flights(flights, [*pooled.left_out, *pooled.failures], pooled), pooled, folder)


def write_electrical_flights(contents: list[dict[str, Any]], failures: list[str], folder: Path) -> None:
    """Write report.html and results.json of flights whose electrical power stands side by side, not pooled.

    contents: of their results.json. Raises InputError when the folder cannot be written.
    """
    flights = msgspec.convert(contents, list[ElectricalFlight])
    content = {"format": FLIGHTS_FORMAT, "flights": contents, "failures": failures}
    _write(render_electrical_flights(flights, failures), content, folder)


def write_comparison(comparison: ComparisonResults, folder: Path) -> None:
    """Write report.html and results.json. Raises InputError when the folder cannot be written."""
    _write(render_comparison(comparison), comparison, folder)


def _write(page: str, content: object, folder: Path) -> None:
    write_file(folder / "results.json", msgspec.json.format(msgspec.json.encode(content), indent=1))
    write_file(folder / "report.html", page)
