"""`analyze` leads from any source of a flight to its results. It decides which method gives the curve of a log."""

import contextlib
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

from flightpower.analysis.options import Options, refuse_autopilot_options, refuse_drag_options
from flightpower.analysis.sources.daemon_log import gives_electrical_power, lacks_drag_topics
from flightpower.analysis.sources.open import is_table
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log

if TYPE_CHECKING:
    from flightpower.analysis.maneuvers.runs_file import NoCurve
    from flightpower.analysis.pipeline.runs import Analysis
    from flightpower.analysis.pipeline.whole_flight import WholeFlightAnalysis
    from flightpower.analysis.records.flight import Kind, MethodTried
    from flightpower.analysis.sources.recording import FlightRecording

Progress = Callable[[str], None]


class Way(NamedTuple):
    """The kind of curve that a log gives.

    without_drag : why options for drag have no effect; empty where they may have one
    reason : sentence on why the sensors for drag give no drag; empty if they are missing or do give it
    """

    kind: "Kind"
    without_drag: str = ""
    reason: str = ""


def way_of(source: "Log | FlightRecording", options: Options = Options()) -> Way:
    """Return the kind of curve that `analyze` makes: drag from the runs, or electrical power of the whole flight."""
    from flightpower.analysis.records.flight import Kind

    if not isinstance(source, Log):
        return Way(Kind.ELECTRICAL, "the log is an autopilot's")
    if lacks_drag_topics(source):
        return Way(Kind.ELECTRICAL, "the log lacks flow angles or motor speed, and gives no drag")
    if reason := _why_power_only(source, options):
        return Way(Kind.ELECTRICAL, reason=reason)
    return Way(Kind.POWER_REQUIRED)


def analyze(
    source: "Log | FlightRecording",
    options: Options = Options(),
    progress: Progress = lambda _: None,
    *,
    command_line: str = "",
    message_of: "Callable[[NoCurve], str]" = str,
) -> "Analysis | WholeFlightAnalysis":
    """Analyze the runs of a flight that has the sensors for drag, or else the energy balance of the whole flight.

    source : from `sources.open.open_source`     command_line : the command that started the analysis, for the report
    message_of : makes the message if no run gives a curve
    Raises InputError when the source or a file of the options cannot be used.
    """
    if options.mass_kg is not None and options.weight_N is not None:
        raise InputError(f"{source.path}: --mass and --weight: one quantity in two units; give one of them")
    from flightpower.analysis.records.flight import Kind

    method = way_of(source, options)
    if method.without_drag:
        refuse_drag_options(source.path, method.without_drag, **options.for_drag())
    if not isinstance(source, Log):
        from flightpower.analysis.pipeline.whole_flight import analyze_recording

        return analyze_recording(source, options, progress, command_line=command_line)
    if is_table(source.path) and not method.without_drag:
        from flightpower.analysis.sources.table import refuse_without_method

        refuse_without_method(source)
    if method.kind is Kind.ELECTRICAL:
        return _by_energy(source, options, progress, command_line, method.reason)
    if options.leave_out is not None:
        raise InputError(
            f"{source.path}: --leave-out: has no effect, since the curve is by runs; leave runs out with --runs FILE"
        )
    refuse_autopilot_options(source.path, options)
    replacements = options.replacements()
    from flightpower.analysis.maneuvers.runs_file import NoCurve
    from flightpower.analysis.pipeline.runs import analyze_runs

    try:
        return analyze_runs(
            source, replacements, progress, request=options.request, runs_file=options.runs, command_line=command_line,
            by_likelihood=options.likelihood,
        )  # fmt: skip
    except NoCurve as error:
        cause = message_of(error)
        if not options.runs and gives_electrical_power(source):
            with contextlib.suppress(InputError):  # the message on the runs names the cause and is raised below
                reason = f"No drag: {cause.removeprefix(f'{source.path}: ')}."
                return _by_energy(source, options, progress, command_line, reason, error.tried)
        raise InputError(cause) from None


def _by_energy(
    log: Log,
    options: Options,
    progress: Progress,
    command_line: str,
    reason: str = "",
    tried: "Sequence[MethodTried]" = (),
) -> "WholeFlightAnalysis":
    from flightpower.analysis.pipeline.whole_flight import analyze_daemon_log  # loads pandas

    return analyze_daemon_log(log, options, progress, reason=reason, tried=tried, command_line=command_line)


def _why_power_only(log: Log, options: Options) -> str:
    """A sentence if a table has the sensors for drag but not the files, and so gives only electrical power; else empty.

    It is empty for a log of the daemon, which lacks these files only by mistake and is refused.
    """
    if not gives_electrical_power(log) or not is_table(log.path):
        return ""
    if options.aircraft is None:
        return "No drag: that needs --aircraft FILE, and with a column of motor speed the propeller's table."
    from flightpower.analysis.air.contents import contents

    try:
        contents(log, options.replacements())
    except InputError as error:
        return f"No drag: {str(error).removeprefix(f'{log.path}: ')}."
    return ""
