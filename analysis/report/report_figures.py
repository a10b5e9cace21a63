"""All figures of the report page of an analysis."""

import plotly.graph_objects as go

from analysis.pipeline import Analysis
from analysis.report.figures import flight, methods, performance, power


def figures_by_name(analysis: Analysis) -> dict[str, go.Figure]:
    """The figures by their names in the template `report.html`; optional ones are missing where there are no data."""
    results = analysis.results
    figures = {
        "power": power.power_required(results),
        "methods": methods.every_method(results),
        "timeline": flight.timeline(analysis.table, analysis.maneuvers.maneuvers, results.rejected),
        "polar": power.drag_polar(analysis.drag.main.polar, analysis.drag.flown_CL),
    }
    if any(run.power_required for run in results.one_by_one):
        figures["one_by_one"] = methods.run_by_run(results)
    if any(differences.notna().any(axis=None) for differences in analysis.consistency):
        figures["consistency"] = flight.consistency(analysis.consistency)
    if results.interval_parts:
        figures["parts"] = power.interval_parts(results)
    if results.use:
        figures["loadings"] = performance.loadings(results.use)
        figures["efficiency"] = performance.efficiency(results.use)
    return figures


def run_fits(analysis: Analysis) -> list[go.Figure]:
    """The fit of each run."""
    return [flight.run_fit(*fit) for fit in analysis.drag.main.fits]
