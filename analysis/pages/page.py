"""The report page of an analysis: puts sections and figures into the template `report.html`."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from flightpower.analysis.maneuvers.flown import TableLimit, limits_left
from flightpower.analysis.methods.interval_sources import variance_by_source
from flightpower.analysis.methods.whole_flight.fit import samples_of
from flightpower.analysis.methods.whole_flight.settings import CURVE
from flightpower.analysis.pages.charts import flight, power
from flightpower.analysis.pages.charts.figure import Figure
from flightpower.analysis.pages.html_page import html_figure, render_page
from flightpower.analysis.pages.other_conditions import other_conditions_section
from flightpower.analysis.pages.predicted_polar import PredictedPolar
from flightpower.analysis.pages.sections.certainty import certainty_section
from flightpower.analysis.pages.sections.curve import curve_section, methods_section
from flightpower.analysis.pages.sections.flight import (
    balance_section,
    flight_section,
    provenance_section,
    sensors_section,
)
from flightpower.analysis.pages.sections.performance import autopilot_section, performance_section
from flightpower.analysis.pages.sections.summary import summary_section, verdict_section
from flightpower.analysis.performance.analysis import Performance
from flightpower.analysis.pipeline.runs import Analysis
from flightpower.analysis.pipeline.whole_flight import WholeFlightAnalysis
from flightpower.analysis.records.flight import Kind, Results
from flightpower.analysis.results.next_flight import Sources

Drawn = Figure | Sequence[Figure]  # one figure, or several side by side


def figures_by_name(
    analysis: Analysis | WholeFlightAnalysis, predicted: PredictedPolar | None = None
) -> dict[str, Drawn]:
    """Return the figures by their names in the template `report.html`; optional figures without data are missing.
    predicted : a polar to draw next to the measured polar
    """
    if isinstance(analysis, WholeFlightAnalysis):
        return _figures_of_whole_flight(analysis)
    results = analysis.results
    figures: dict[str, Drawn] = {
        "power": power.power_required(results, predicted),
        "methods": power.every_method(results),
        "timeline": flight.timeline(analysis.table, analysis.maneuvers.maneuvers, results.rejected),
        "polar": power.drag_polar(analysis.drag.main.polar, analysis.drag.flown_CL, predicted),
    }
    if any(run.power_required for run in results.single_runs):
        figures["one_by_one"] = power.run_by_run(results)
    if analysis.drag.main.fits:
        kinds = {run.name: run.kind for run in analysis.maneuvers.maneuvers}
        figures["residuals"] = flight.residuals_of_drag(analysis.drag.main.fits, kinds)
    if any(differences.notna().any(axis=None) for differences in analysis.consistency):
        figures["consistency"] = flight.consistency(analysis.consistency)
    if results.run_residuals:
        figures["autocorrelation"] = flight.autocorrelation(results.run_residuals)
    if results.parameter_correlation:
        figures["correlation"] = flight.correlation(results.parameter_correlation)
    main, check = analysis.drag.main, analysis.drag.cross_check
    histories = {"regression of drag": main.convergence} | (
        {"output error, cross-check": check.convergence} if check else {}
    )
    if histories_with_steps := {name: history for name, history in histories.items() if history and history.steps}:
        figures["convergence"] = flight.convergence(histories_with_steps)
    if analysis.trajectory.block_means.flying.any():
        figures["air_and_path"] = flight.air_and_path(analysis.trajectory)
    if results.track:
        figures["track"] = flight.ground_track(results.track, analysis.maneuvers.maneuvers, results.air)
    if results.interval_parts:
        V = np.linspace(results.power_required[0].speed_mps, results.power_required[-1].speed_mps, 9)
        figures["parts"] = power.interval_by_source(results.power_required, V, sources_of(analysis)(V))
    if results.use:
        figures["loadings"] = power.loadings(results.use)
        figures["efficiency"] = power.efficiency(results.use)
    return figures


def _figures_of_whole_flight(analysis: WholeFlightAnalysis) -> dict[str, Drawn]:
    estimate, table = analysis.estimate, analysis.flight
    errors = estimate.airspeed
    V = samples_of(table, errors.scale, errors.zero_Pa, errors.wind).V_mps
    return {
        "power": power.electrical_power(analysis.results, estimate),
        "whole_flight": flight.whole_flight(table, V),
        "balance": flight.residuals_of_balance(estimate),
    }


def limits_in_dashes(analysis: Analysis) -> list[TableLimit]:
    """Return the limits of the propeller table that the flight exceeded at speeds where power required is dashed."""
    V = np.array([point.speed_mps for point in analysis.results.power_required if point.extrapolated])
    return limits_left(analysis.rows_flown, analysis.propeller, V)


def sources_of(analysis: Analysis) -> Sources:
    """Return a function that gives the variance of power by source, at the flight's weight and density."""
    return partial(variance_by_source, analysis.drag.main, analysis.aircraft, analysis.condition)


def run_fits(analysis: Analysis) -> dict[str, Drawn]:
    """Return the fit of each run, by the name of the run."""
    return {fit.run: flight.run_fit(*fit) for fit in analysis.drag.main.fits}


def render(
    results: Results,
    figures: Mapping[str, Figure | Sequence[Figure]],
    run_fits: Mapping[str, Figure | Sequence[Figure]],
    *,
    performance: Performance | None = None,
    runs: Mapping[str, object] | None = None,
    replaced: str = "",
    predicted: str = "",
    limits: Sequence[TableLimit] = (),
    sources: Sources | None = None,
) -> str:
    """Return the page as one HTML file. figures: by name (`figures_by_name`); run_fits: by the name of the run.
    performance: for the controls of weight, air and battery. runs: data of each run (`embedded_runs`). replaced: what
    the report replaces. predicted: how a predicted polar compares. limits: limits of the propeller table that were
    exceeded where the curve is dashed. sources: variance of power by source (`sources_of`).
    """
    return render_page(
        "report.html",
        summary=summary_section(results),
        verdict=verdict_section(results),
        certainty=certainty_section(results, sources),
        provenance=provenance_section(results),
        replaced=replaced,
        predicted=predicted,
        dashes=power.dashes(results, limits) if results.kind is Kind.POWER_REQUIRED else "",
        performance=performance_section(results, results.use),
        other_conditions=other_conditions_section(performance),
        methods=methods_section(results),
        curve=curve_section(results),
        flight=flight_section(results),
        balance=balance_section(results),
        hardly_flown=CURVE.percentiles[0],
        sensors=sensors_section(results),
        autopilot=autopilot_section(results),
        figures={name: html_figure(figure, name) for name, figure in figures.items()},
        run_fits=[html_figure(figure, f"fit-{i}", run) for i, (run, figure) in enumerate(run_fits.items())],
        runs=runs,
    )
