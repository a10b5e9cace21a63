"""The analysis of runs, from a log to results: each step takes the record of the flight and adds to it."""

from dataclasses import dataclass, replace
from pathlib import Path

from flightpower.analysis.air.contents import Replacements
from flightpower.analysis.beside import beside
from flightpower.analysis.flight import Progress, as_measured, reconstructed, recorded, synchronized, with_runs
from flightpower.analysis.methods.ladder import Estimated, by_simpler_method, estimated
from flightpower.analysis.methods.whole_flight.method import WholeFlight, whole_flight
from flightpower.analysis.performance.analysis import Performance, compute
from flightpower.analysis.performance.request import Request
from flightpower.analysis.records.flight import Results, Trust
from flightpower.analysis.results.assemble import assemble
from flightpower.analysis.results.evidence import with_trust
from flightpower.analysis.trajectory.consistency import Consistency, consistency
from flightpower.analysis.trajectory.observability import misfit
from flightpower.flight.log_reader import Log


@dataclass(frozen=True, kw_only=True)
class Analysis(Estimated):
    """Everything known about a flight, for the report.

    results : as written to `results.json`
    consistency : agreement of speed and angles before and after the correction of sensor errors
    performance : None where the battery or the thrust of level flight is not known
    """

    consistency: Consistency
    performance: Performance | None
    results: Results


def analyze_runs(
    log: Log,
    replacements: Replacements = Replacements(),
    progress: Progress = lambda _: None,
    *,
    request: Request = Request(),
    runs_file: Path | None = None,
    command_line: str = "",
    by_likelihood: bool = False,
) -> Analysis:
    """Power required and performance from a log.

    The curve comes from the best method that gives one. If it is not to be trusted and the flight path does not fit the
    measurements, the curve of a simpler method replaces it, unless that is not to be trusted either.
    replacements: files used instead of parts of the log, such as another aircraft file. request: battery, weights and
    density altitudes to compute performance for. runs_file: an edited list of runs (`maneuvers.runs_file`).
    command_line: the command that started the analysis, for the report. by_likelihood: also use the two
    maximum-likelihood methods.
    Raises InputError when the log lacks something that nothing can replace, or holds no maneuver from which drag can be
    estimated.
    """
    read = recorded(log, replacements, progress)
    measured = synchronized(read)
    flown = with_runs(measured, runs_file)
    path = reconstructed(flown)
    balancing = beside(lambda: whole_flight(path))
    flight = estimated(path, by_likelihood=by_likelihood)
    flight.progress("balancing the energy of the whole flight")
    flight_energy = balancing()
    analysis = _analysis(flight, flight_energy, request, command_line)
    if analysis.results.trust is not Trust.NOT_TO_BE_TRUSTED or not misfit(path.trajectory):
        return analysis
    simpler = by_simpler_method(as_measured(flown, path.trajectory), flight.drag)
    if simpler is None:
        return analysis
    other = _analysis(simpler, flight_energy, request, command_line)
    return analysis if other.results.trust is Trust.NOT_TO_BE_TRUSTED else other


def _analysis(flight: Estimated, flight_energy: WholeFlight, request: Request, command_line: str) -> Analysis:
    """Add performance, results and verdict to the estimate of drag. flight_energy: one more method, which needs voltage
    and current but neither runs nor flow angles."""
    flight = replace(flight, drag=replace(flight.drag, methods=[*flight.drag.methods, flight_energy.method]))
    flight.progress("computing performance")
    performance = compute(request, flight)
    flight = replace(flight, notes=(*flight.notes, *request.notes(flight.aircraft)))
    consistent = consistency(flight.trajectory)
    battery = request.battery(flight.aircraft)
    results = assemble(
        flight, consistent, performance.result if performance else None, flight_energy.electrical, battery, command_line
    )
    return Analysis(
        **flight.fields_so_far(), consistency=consistent, performance=performance, results=with_trust(results)
    )
