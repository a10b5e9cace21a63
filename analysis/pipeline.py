"""The method, from a log to results: each step takes the record of the flight (`analysis.flight`) and adds to it."""

from dataclasses import dataclass, replace
from pathlib import Path

from msgspec import structs

from analysis.drag.estimate import Estimated, estimated
from analysis.electrical.daemon_log import WholeFlight, whole_flight
from analysis.flight import Progress, reconstructed, recorded, synchronized, with_runs
from analysis.log_contents import Replacements
from analysis.performance.analysis import Performance, compute
from analysis.performance.request import Request
from analysis.planning.next_flight import next_flight
from analysis.results.assemble import assemble
from analysis.results.trust import with_trust
from analysis.schema import Results
from analysis.trajectory.consistency import Consistency, consistency
from flight.log_reader import Log


@dataclass(frozen=True, kw_only=True)
class Analysis(Estimated):
    """All that is known of a flight, for the report; results: what is written.

    consistency : of speed and angles before and after the correction of sensor errors
    performance : None where the battery or the thrust of level flight is not known
    """

    consistency: Consistency
    performance: Performance | None
    results: Results


def analyze(
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

    replacements: files used instead of parts of the log, such as another aircraft file. request: battery, weights and
    density altitudes to compute performance for. runs_file: an edited list of runs (`maneuvers.runs_file`).
    command_line: that started the analysis, for the report. by_likelihood: with the two maximum-likelihood methods.
    Raises InputError when the log lacks something that nothing can replace, or holds no maneuver from which drag can be
    estimated.
    """
    read = recorded(log, replacements, progress)
    measured = synchronized(read)
    flown = with_runs(measured, runs_file)
    path = reconstructed(flown)
    flight = estimated(path, by_likelihood=by_likelihood)
    flight, whole_flight_energy = _with_energy_of_whole_flight(flight)
    performance = _performance(flight, request)
    flight = replace(flight, notes=(*flight.notes, *request.notes(flight.aircraft)))
    consistent = consistency(flight.trajectory)
    written = performance.result if performance else None
    results = assemble(flight, consistent, written, whole_flight_energy.electrical, command_line)
    advice = next_flight(flight.trajectory, flight.drag.main, flight.condition, flight.drag.flown_CL)
    with_advice = structs.replace(results, next_flight=list(advice.sentences), next_flight_lowers=advice.lowers)
    return Analysis(**flight.known(), consistency=consistent, performance=performance, results=with_trust(with_advice))


def _with_energy_of_whole_flight(flight: Estimated) -> tuple[Estimated, WholeFlight]:
    """One more method: it needs neither runs nor flow angles, but voltage and current."""
    flight.progress("balancing the energy of the whole flight")
    whole = whole_flight(flight.log, flight.aircraft, flight.propeller)
    drag = replace(flight.drag, methods=[*flight.drag.methods, whole.method])
    return replace(flight, drag=drag), whole


def _performance(flight: Estimated, request: Request) -> Performance | None:
    flight.progress("computing performance")
    return compute(request, flight)
