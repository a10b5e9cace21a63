"""The report: one HTML file that opens anywhere without a network, the same results as JSON and CSV, a field table."""

from pathlib import Path

import numpy as np
import pandas as pd

from analysis.estimation.intervals import NORMAL_95
from analysis.files import write_file
from analysis.pipeline import Analysis
from analysis.report import field, figures, page
from analysis.results.schema import to_csv, to_json
from analysis.trajectory.equations import GUST_FILTER_STATES, STATES
from analysis.trajectory.reconstruction import Trajectory

POLAR_POINTS = 60
PATH_COLUMNS = {name: f"{name}_mps" for name in STATES}
PATH_COLUMNS |= {"phi": "roll_rad", "theta": "pitch_rad", "psi": "yaw_rad", "height": "height_m"}


def write_report(analysis: Analysis, folder: Path) -> None:
    """Write report.html, results.json, power_required.csv, path.csv and field_table.md and .csv into `folder`.

    Raises InputError when the folder cannot be written.
    """
    results = analysis.results
    drawings = {
        "power": figures.power_required(results),
        "methods": figures.methods(results),
        "timeline": figures.timeline(analysis.table, analysis.maneuvers.maneuvers, results.rejected),
        "polar": _polar(analysis),
    }
    if any(method.power_required for method in results.one_by_one):
        drawings["one_by_one"] = figures.one_by_one(results)
    if any(differences.notna().any(axis=None) for differences in analysis.consistency):
        drawings["consistency"] = figures.consistency(analysis.consistency)
    if results.interval_parts:
        drawings["parts"] = figures.interval_parts(results)
    if results.use:
        drawings["loadings"] = figures.loadings(results.use)
        drawings["efficiency"] = figures.efficiency(results.use)
    fits = [figures.fit(*fit) for fit in analysis.drag.main.fits]
    html = page.render(results, drawings, fits)
    write_file(folder / "results.json", to_json(results))
    write_file(folder / "power_required.csv", to_csv(results))
    write_file(folder / "path.csv", _path(analysis.trajectory))
    if results.use:
        write_file(folder / "field_table.md", field.to_markdown(results, results.use))
        write_file(folder / "field_table.csv", field.to_csv(results, results.use))
    write_file(folder / "report.html", html)


def _polar(analysis: Analysis):
    CL = np.linspace(*analysis.drag.flown_CL, POLAR_POINTS)
    powers = np.stack([np.ones_like(CL), CL, CL**2], axis=1)
    CD = powers @ analysis.drag.main.polar.A
    half = NORMAL_95 * np.sqrt(np.einsum("ni,ij,nj->n", powers, analysis.drag.main.polar.covariance, powers))
    return figures.polar(analysis.results, CL, CD, CD - half, CD + half)


def _path(trajectory: Trajectory) -> str:
    """Every state of the flight path with its standard error, a line each 0.2 s."""
    named = trajectory.states.drop(columns=[*GUST_FILTER_STATES]).rename(columns=PATH_COLUMNS)
    errors = (
        trajectory.states_error().drop(columns=[*GUST_FILTER_STATES]).rename(columns=PATH_COLUMNS).add_suffix("_error")
    )
    return str(pd.concat([named, errors], axis=1).to_csv(float_format="%.6g", lineterminator="\n"))
