"""The report: one HTML file that opens anywhere without a network, the same results as JSON and CSV, a field table."""

from pathlib import Path

import numpy as np

from analysis import commands
from analysis.chain import Analysis
from analysis.power.curve import NORMAL_95
from analysis.report import field, figures, page
from analysis.results import to_csv, to_json

POLAR_POINTS = 60


def write_report(analysis: Analysis, folder: Path) -> None:
    """Write report.html, results.json, power_required.csv and field_table.md and .csv into `folder`.

    Raises InputError when the folder cannot be written.
    """
    results = analysis.results
    drawings = {
        "power": figures.power_required(results),
        "methods": figures.methods(results),
        "timeline": figures.timeline(analysis.table, analysis.found.runs, results.rejected),
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
    fits = [figures.fit(*fit) for fit in analysis.estimate.fits]
    html = page.render(results, drawings, fits)
    commands.write_file(folder / "results.json", to_json(results))
    commands.write_file(folder / "power_required.csv", to_csv(results))
    if results.use:
        commands.write_file(folder / "field_table.md", field.to_markdown(results, results.use))
        commands.write_file(folder / "field_table.csv", field.to_csv(results, results.use))
    commands.write_file(folder / "report.html", html)


def _polar(analysis: Analysis):
    CL = np.linspace(*analysis.flown_CL, POLAR_POINTS)
    powers = np.stack([np.ones_like(CL), CL, CL**2], axis=1)
    CD = powers @ analysis.polar.A
    half = NORMAL_95 * np.sqrt(np.einsum("ni,ij,nj->n", powers, analysis.polar.covariance, powers))
    return figures.polar(analysis.results, CL, CD, CD - half, CD + half)
