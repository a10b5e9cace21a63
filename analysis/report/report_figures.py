"""All figures of the report page of an analysis."""

from collections.abc import Sequence

from analysis.pipeline import Analysis
from analysis.report.figures import estimation, flight, methods, performance, power, residuals
from analysis.report.figures.figure import Figure

Drawn = Figure | Sequence[Figure]  # one, or several side by side


def figures_by_name(analysis: Analysis) -> dict[str, Drawn]:
    """The figures by their names in the template `report.html`; optional ones are missing where there are no data."""
    results = analysis.results
    figures: dict[str, Drawn] = {
        "power": power.power_required(results),
        "methods": methods.every_method(results),
        "timeline": flight.timeline(analysis.table, analysis.maneuvers.maneuvers, results.rejected),
        "polar": power.drag_polar(analysis.drag.main.polar, analysis.drag.flown_CL),
    }
    if any(run.power_required for run in results.one_by_one):
        figures["one_by_one"] = methods.run_by_run(results)
    if any(differences.notna().any(axis=None) for differences in analysis.consistency):
        figures["consistency"] = flight.consistency(analysis.consistency)
    if results.run_residuals:
        figures["autocorrelation"] = residuals.autocorrelation(results.run_residuals)
    if results.parameter_correlation:
        figures["correlation"] = estimation.correlation(results.parameter_correlation)
    main, check = analysis.drag.main, analysis.drag.cross_check
    histories = {"regression of drag": main.convergence} | (
        {f"{check.by}, cross-check": check.convergence} if check else {}
    )
    if kept := {name: history for name, history in histories.items() if history and history.steps}:
        figures["convergence"] = estimation.convergence(kept)
    if analysis.trajectory.block_means.flying.any():
        figures["air_and_path"] = residuals.air_and_path(analysis.trajectory)
    if results.track:
        figures["track"] = residuals.ground_track(results.track, analysis.maneuvers.maneuvers, results.air)
    if results.interval_parts:
        figures["parts"] = power.interval_parts(results)
    if results.use:
        figures["loadings"] = performance.loadings(results.use)
        figures["efficiency"] = performance.efficiency(results.use)
    return figures


def run_fits(analysis: Analysis) -> list[Drawn]:
    """The fit of each run."""
    return [flight.run_fit(*fit) for fit in analysis.drag.main.fits]
