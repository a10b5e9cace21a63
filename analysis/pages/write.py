"""Writes the files of a report: page, JSON, CSV, trajectory, table for the field; for one flight or several."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np
import pandas as pd

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.files import write_keeping_previous
from flightpower.analysis.maneuvers.kinds import Maneuvers
from flightpower.analysis.maneuvers.runs_file import blocks, head, to_toml
from flightpower.analysis.options import LEFT_OUT, stretches_text
from flightpower.analysis.pages import page
from flightpower.analysis.pages.charts.style import ORANGE, OTHER_RUN
from flightpower.analysis.pages.page import figures_by_name, run_fits
from flightpower.analysis.pages.pooled_page import render_comparison, render_pooled, render_side_by_side
from flightpower.analysis.pages.predicted_polar import PredictedPolar, check_of_aircraft, comparison
from flightpower.analysis.pages.sections import performance as field_table
from flightpower.analysis.pipeline.runs import Analysis
from flightpower.analysis.pipeline.whole_flight import WholeFlightAnalysis
from flightpower.analysis.records.flight import PerformanceResult, Results, WithCurves
from flightpower.analysis.records.pool import ComparisonResults, PooledResults, of_each_kind
from flightpower.analysis.results.files import to_csv, to_json
from flightpower.analysis.results.previous import replaced, tables_left
from flightpower.analysis.trajectory.equations import GUST_FILTER_STATES, STATES
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.arrays import Array
from flightpower.flight.files import write_files

COLUMNS = {name: f"{name}_mps" for name in STATES}
COLUMNS |= {"phi": "roll_rad", "theta": "pitch_rad", "psi": "yaw_rad", "height": "height_m"}


def trajectory_csv(trajectory: Trajectory) -> str:
    """Return every state with its standard error (`…_error`), one line each 0.2 s; units are in the header."""
    states = trajectory.states.drop(columns=[*GUST_FILTER_STATES]).rename(columns=COLUMNS)
    errors = trajectory.states_error().drop(columns=[*GUST_FILTER_STATES]).rename(columns=COLUMNS).add_suffix("_error")
    table = pd.concat([states, errors], axis=1).reset_index()
    line = ",".join(["%.6g"] * table.shape[1])
    lines = [",".join(table.columns), *(line % tuple(row) for row in table.to_numpy().tolist()), ""]
    return "\n".join(lines).replace("nan", "")


def write_report(
    analysis: Analysis | WholeFlightAnalysis, folder: Path, predicted: PredictedPolar | None = None
) -> str:
    """Write report.html, results.json and the curve as CSV into `folder`; with runs also path.csv and the field table.

    predicted : a polar to draw next to the measured polar.
    Returns a sentence on what results of another log or other options they replaced; empty if none.
    Everything is computed before the first file is written. Raises InputError when the folder cannot be written, and
    for a polar that does not belong to the aircraft.
    """
    results = analysis.results
    files: dict[str, str | bytes] = {
        "results.json": to_json(results),
        f"{results.kind}.csv": to_csv(results, results.standard),
    }
    of_runs: dict[str, Any] = {}
    if isinstance(analysis, Analysis):
        if predicted:
            check_of_aircraft(predicted, results.aircraft.span_m**2 / results.aircraft.wing_area_m2)
        files["path.csv"] = trajectory_csv(analysis.trajectory)
        files |= _field_tables(results, results.use)
        of_runs = {
            "performance": analysis.performance,
            "runs": embedded_runs(analysis),
            "limits": page.limits_in_dashes(analysis),
            "predicted": comparison(predicted, results) if predicted else "",
            "sources": page.sources_of(analysis),
        }
    before = replaced(folder, results, files)
    figures = figures_by_name(analysis, predicted)
    fits = run_fits(analysis) if isinstance(analysis, Analysis) else {}
    files["report.html"] = page.render(results, figures, fits, replaced=before, **of_runs)
    write_files({folder / name: content for name, content in files.items()})
    return before


def _field_tables(results: WithCurves, use: PerformanceResult | None) -> dict[str, str]:
    if use is None:
        return {}
    return {
        "field_table.md": field_table.to_markdown(results, use),
        "field_table.csv": field_table.to_csv(results, use),
    }


def write_left_out(analysis: WholeFlightAnalysis, folder: Path) -> Path | None:
    """Write the stretches that the user left out to left_out.txt, if there are any or an earlier file exists.

    The file becomes empty if no stretch is left out any more. Returns where different earlier content is kept, if there
    was any. Raises InputError.
    """
    path = folder / LEFT_OUT
    if not analysis.left_out_s and not path.exists():
        return None
    return write_keeping_previous(path, f"{stretches_text(analysis.left_out_s)}\n")


def write_run_list(analysis: Analysis, folder: Path, log_name: str, *, source: Path | None) -> Path | None:
    """Write runs.toml into `folder`; return where different earlier content is kept, if there was any.

    source: the list of runs that the analysis used. That list is not overwritten, since it contains the user's remarks.
    Raises InputError when the file cannot be written.
    """
    path = folder / "runs.toml"
    if source is not None and path.exists() and path.samefile(source):
        return None
    return write_keeping_previous(path, to_toml(analysis.maneuvers, log_name))


def write_candidates(maneuvers: Maneuvers, folder: Path, log_name: str) -> Path:
    """Write runs.toml for a log in which no maneuver gives a curve; return its path. Raises InputError as above."""
    path = folder / "runs.toml"
    write_keeping_previous(path, to_toml(maneuvers, log_name))
    return path


FLIGHTS_FORMAT = "flightpower-flights-1"


def write_pooled(pooled: PooledResults, folder: Path) -> str:
    """Write report.html, results.json, the curve as CSV and, if endurance and range are known, the field table.

    Returns a sentence that names the remaining tables of an earlier analysis; empty if there are none.
    Raises InputError when the folder cannot be written.
    """
    tables = {f"{pool.kind}.csv": to_csv(pool) for pool in of_each_kind(pooled)}
    tables |= _field_tables(pooled, pooled.performance)
    _write(render_pooled(pooled), pooled, folder, tables)
    return tables_left(folder, tables)


def write_side_by_side(flights: Sequence[Results], refused: str, failures: Sequence[str], folder: Path) -> str:
    """Write report.html and results.json of flights that are not pooled. refused: why

    Returns as `write_pooled` does, and raises InputError when the folder cannot be written.
    """
    content = {"format": FLIGHTS_FORMAT, "flights": flights, "refused": refused, "failures": failures}
    _write(render_side_by_side(flights, refused, failures), content, folder)
    return tables_left(folder, ())


def write_comparison(comparison: ComparisonResults, folder: Path) -> None:
    """Write report.html and results.json. Raises InputError when the folder cannot be written."""
    _write(render_comparison(comparison), comparison, folder)


def _write(page: str, content: object, folder: Path, tables: Mapping[str, str] = {}) -> None:
    text = msgspec.json.format(msgspec.json.encode(content), indent=1)
    files: dict[str, str | bytes] = {"results.json": text, "report.html": page, **tables}
    write_files({folder / name: content for name, content in files.items()})


Json = dict[str, Any]


class NamedRun(NamedTuple):
    """A run as shown on the page. name: as in the figures; says: its description."""

    name: str
    label: str
    start_s: float
    end_s: float
    says: str


def _short(values: Array) -> Any:
    """Round to twelve significant digits."""
    return [_short(row) if np.ndim(row) else float(f"{row:.12g}") for row in values]


def named_runs(results: Results) -> list[NamedRun]:
    """Return the runs in the order of the table."""
    z = {runs_against_other.run: runs_against_other.z for runs_against_other in results.runs_against_others}
    rms = {run_residual.run: run_residual.rms_mps2 for run_residual in results.run_residuals}
    runs = []
    for number, run in enumerate(results.runs, start=1):
        says = [f"{run.lowest_speed_mps:.1f} to {run.highest_speed_mps:.1f} m/s", f"{run.altitude_change_m:+.1f} m"]
        if run.name in z:
            says.append(f"{z[run.name]:+.1f} standard errors from the others of its kind")
        if run.name in rms:
            says.append(f"residuals of drag {rms[run.name]:.2f} m/s² (rms)")
        label = f"Run {number}: {run.name}"
        runs.append(NamedRun(run.name, label, run.start_s, run.end_s, "; ".join([*says, *run.notes])))
    return runs


def embedded_runs(analysis: Analysis) -> Json:
    """Return data for `runs.js`: runs, their list as a file, and their shares in the curve, if known."""
    main, results = analysis.drag.main, analysis.results
    shares: Json | None = None
    if main.shares:
        shares = {
            "information": main.shares.information,
            "by_run": {
                name: {"information": _short(information), "gradient": _short(gradient)}
                for name, (information, gradient) in main.shares.by_run.items()
            },
            "noise_factor": main.shares.noise_factor,
            "A": main.polar.A,
            "covariance": main.polar.covariance,
            "speeds": [point.speed_mps for point in results.power_required],
            "weight_N": results.test.weight_N,
            "rho": results.test.air_density_kgpm3,
            "wing_area_m2": results.aircraft.wing_area_m2,
            "normal_95": NORMAL_95,
        }
    runs = named_runs(results)
    listed, left_out = blocks(analysis.maneuvers), blocks(analysis.maneuvers, {run.name for run in runs})
    return {
        "runs": [run._asdict() for run in runs],
        "file": {
            "head": head(Path(results.log).name),
            "blocks": [
                {"run": block.run, "kept": block.text, "left_out": other.text}
                for block, other in zip(listed, left_out, strict=True)
            ],
        },
        "shares": shares,
        "colors": {"alone": ORANGE, "without": OTHER_RUN},
    }
