"""`analyze` for several logs: writes each flight's results in its own folder, and those of all flights above them."""

import importlib
import io
import os
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, AttachmentIndex, Footer, SummaryOffset
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from flightpower.analysis.cli.verdict import evidence_of_kinds, report_evidence
from flightpower.analysis.flights.campaign.addresses import FoundLogs, Log, RemoteLog, file_system
from flightpower.analysis.flights.campaign.campaign import Campaign, Work, run
from flightpower.analysis.flights.campaign.folders import exclusive
from flightpower.analysis.flights.campaign.processes import Outcome, below
from flightpower.analysis.flights.campaign.processes import Progress as Step
from flightpower.analysis.options import ATTACHMENTS, Options, option_name
from flightpower.analysis.pages.one_log import analyze_log
from flightpower.analysis.performance.request import Request
from flightpower.analysis.sources.column_map import map_files
from flightpower.analysis.sources.recognize import autopilot_of
from flightpower.flight.aircraft import load_aircraft, parse_aircraft
from flightpower.flight.command_line import ExitCode
from flightpower.flight.errors import InputError, StorageError
from flightpower.flight.log_index import FOOTER_BYTES, MAGIC, RECORD_HEAD
from flightpower.flight.shipped_propellers import shipped_propellers

PRELOAD = (
    "flightpower.analysis.pipeline",
    "flightpower.analysis.pages.write",
    "flightpower.analysis.pages.terminal",
)  # modules that each analysis needs


@dataclass(frozen=True)
class FlightAnalysis:
    """`analyze_log` with its options, to be run in other processes.

    mixed : whether logs with their own aircraft file ignore the options that are for autopilots' logs
    """

    options: Options
    mixed: bool = False

    def __call__(self, log: Path, folder: Path, runs: Path | None, progress: Step) -> None:
        analyze_log(log, folder, replace(self.options_of(log), runs=runs), progress)

    def options_of(self, log: Path) -> Options:
        """Return the options that apply to this log."""
        return self.options.with_own_aircraft() if self.mixed and _has_aircraft(log) else self.options

    def under(self, root: Path) -> "FlightAnalysis":
        values = {field.name: getattr(self.options, field.name) for field in fields(Options)}
        moved: dict[str, Any] = {name: below(root, value) for name, value in values.items() if isinstance(value, Path)}
        if self.options.propeller:
            moved["propeller"] = str(below(root, Path(self.options.propeller)))
        return replace(self, options=replace(self.options, **moved))


def settings(options: Options) -> str:
    """Return the options' values as text. A file appears as its bare name: its content matters, not its folder."""
    values = (getattr(options, field.name) for field in fields(Options))
    return repr([value.name if isinstance(value, Path) else value for value in values])


def analyze_logs(
    listing: FoundLogs, output: Path | None, options: Options, *, jobs: int | None, scheduler: str | None, quiet: bool
) -> ExitCode:
    """Analyze logs and pool the flights. Returns `ExitCode.FAILURE` if some of the logs cannot be used, or if there
    are results that are not to be trusted.

    Raises InputError if none of the logs can be used, or the flights cannot be pooled.
    """
    if output is None:
        raise InputError("several logs: give the folder for the results with -o")
    if options.runs is not None:
        raise InputError(
            f"--runs {options.runs}: belongs to one log; with several, edit runs.toml in the folder of a flight and run"
            " the same command again"
        )
    if options.leave_out is not None:
        raise InputError(f"--leave-out {options.leave_out!r}: belongs to one log; analyze that log alone")
    options.replacements()  # rejects a wrong file once instead of for each log
    modules = {type(file_system(log.address)[0]).__module__ for log in listing.logs if isinstance(log, RemoteLog)}
    preload = (*PRELOAD, *sorted(modules))
    note = own_aircraft_note(listing.logs, options)
    analysis = FlightAnalysis(options, mixed=bool(note))
    values = settings(options) + (", mixed" if note else "")
    work = Work(analysis, values, lambda log: files_used(log, options), preload)
    stderr = Console(stderr=True)
    # This process is idle during the analyses, so it loads the modules for the report before the last flight ends. The
    # thread is not a daemon: C++ libraries abort a process that ends while a thread loads them.
    threading.Thread(target=_load_report).start()
    with exclusive(output):
        with ProgressOnConsole(stderr, quiet) as monitor:
            campaign = run(listing, output, work, monitor, jobs=jobs or _processors(), scheduler=scheduler)
            monitor.finished(campaign)
        for line in [*campaign.notes, *filter(None, [note])]:
            stderr.print(f"note: {line}", highlight=False, markup=False, soft_wrap=True)
        if not campaign.folders:
            raise InputError(f"{output}: none of the {len(campaign.failures)} logs can be used")
        verdict = _pool(campaign, output, quiet, options.request)
    return ExitCode.FAILURE if campaign.failures else verdict


def own_aircraft_note(logs: Sequence[Log], options: Options) -> str:
    """Return a note that options for autopilots' logs do not apply to logs with an aircraft file.

    It is empty if there is no such option, no local log from an autopilot, or no local log with an aircraft file.
    """
    if not (names := options.of_autopilots):
        return ""
    at_hand = [log for log in logs if isinstance(log, Path)]
    own = sum(_has_aircraft(log) for log in at_hand)
    if not own or not any(_of_autopilot(log) for log in at_hand):
        return ""
    return f"{names}: for the logs of autopilots; {own} of {len(logs)} logs keep the aircraft file that they hold"


def _of_autopilot(log: Path) -> bool:
    try:
        return autopilot_of(log) is not None
    except InputError:
        return False  # the analysis reports the error


def _has_aircraft(log: Path) -> bool:
    return "aircraft.toml" in _attachments(log)


def _load_report() -> None:
    for module in (
        "flightpower.analysis.flights.campaign.campaign",
        "flightpower.analysis.flights.pool",
        "flightpower.analysis.pages.write",
    ):
        importlib.import_module(module)


def _pool(campaign: Campaign, output: Path, quiet: bool, request: Request = Request()) -> ExitCode:
    """Write and print the results of all flights and the evidence against them.

    Raises InputError if they cannot be pooled.
    """
    with Console(stderr=True, quiet=quiet).status(f"pooling {len(campaign.folders)} flights …"):
        from flightpower.analysis.flights.campaign.campaign import read_flights
        from flightpower.analysis.flights.pool import pool_results
        from flightpower.analysis.pages.terminal import print_pooled
        from flightpower.analysis.pages.write import write_pooled, write_side_by_side
        from flightpower.analysis.records.flight import Kind
        from flightpower.analysis.results.evidence import worst_first

        page = output / "report.html"
        flights = read_flights(campaign.folders)
        electrical = [flight for flight in flights if Kind.ELECTRICAL in flight.curves]
        try:
            pooled = pool_results(flights).results(campaign.failures, request)
            left = write_pooled(pooled, output)
        except StorageError:
            raise
        except InputError as error:
            if not electrical or any(flight.pooling for flight in flights):
                raise
            refused = str(error)  # each flight keeps its own curve
            left = write_side_by_side(electrical, refused, campaign.failures, output)
            evidence = worst_first(evidence for flight in electrical for evidence in flight.evidence)
            _print_note(left)
            text = f"not pooled: {refused}\nreport: {page}"
            return report_evidence(
                evidence,
                lambda: None if quiet else Console().print(text, highlight=False, markup=False, soft_wrap=True),
            )

    _print_note(left)
    return report_evidence(evidence_of_kinds(pooled), lambda: None if quiet else print_pooled(pooled, page, Console()))


def _print_note(text: str) -> None:
    """Print a note to stderr; print nothing if it is empty."""
    if text:
        print(f"note: {text}", file=sys.stderr)


def _processors() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class ProgressOnConsole:
    """Shows a line for each running analysis and a bar for all; without a terminal, a line when an analysis ends."""

    def __init__(self, console: Console, quiet: bool):
        self.console, self.quiet = console, quiet
        self.jobs, self.done, self.refused = 0, 0, 0
        self.rows: dict[str, Any] = {}
        self.bars = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(20),
            MofNCompleteColumn(),
            TextColumn("{task.fields[step]}", markup=False),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=quiet or not console.is_terminal,
        )
        self.total = self.bars.add_task("flights", total=None, step="reading")

    def __enter__(self) -> "ProgressOnConsole":
        self.bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.bars.stop()

    def planned(self, jobs: int, completed: int) -> None:
        self.jobs = jobs
        self.bars.update(self.total, total=jobs + completed, completed=completed, step="")
        if completed:
            self._note(f"flights done already: {completed}; to analyze: {jobs}")

    def step(self, name: str, step: str) -> None:
        if name not in self.rows:
            self.rows[name] = self.bars.add_task(f"  {name}", total=None, step=step)
        self.bars.update(self.rows[name], step=step)

    def failed(self, error: str) -> None:
        self.console.print(f"error: {error}", highlight=False, markup=False, soft_wrap=True)

    def ended(self, name: str, outcome: Outcome) -> None:
        self.done += 1
        if name in self.rows:
            self.bars.remove_task(self.rows.pop(name))
        self.bars.advance(self.total)
        if outcome.error:
            self.refused += 1
            self.failed(outcome.error)
        else:
            self._note(f"{name}: {outcome.seconds:.1f} s ({self.done} of {self.jobs})")

    def finished(self, campaign: Campaign) -> None:
        if self.done:
            self._note(
                f"{self.done - self.refused} analyzed, {self.refused} refused in {campaign.processor_seconds:.0f} s of"
                f" processor time, with at most {campaign.peak_bytes / 1e6:.0f} MB of memory each"
            )

    def _note(self, text: str) -> None:
        if not self.quiet:
            self.console.print(text, highlight=False, markup=False, soft_wrap=True)


def files_used(log: Log, options: Options) -> list[tuple[str, Path]]:
    """Return (option, file) for every file that the analysis of `log` reads; for a remote log, only files from options.

    Raises InputError if the aircraft file cannot be used.
    """
    attached = ((option_name(field), getattr(options, field)) for field in ATTACHMENTS)
    files = [(option, path) for option, path in attached if isinstance(path, Path) and path.is_file()]
    propeller = options.propeller or _named_propeller(log, options.aircraft)
    maps = map_files(log, options.columns) if isinstance(log, Path) else [options.columns] if options.columns else []
    files += [(option_name("columns"), path) for path in maps]
    return files + [(option_name("propeller"), path) for path in _propeller_files(propeller)]


def _named_propeller(log: Log, aircraft: Path | None) -> str | None:
    """Return the propeller named in the given aircraft file, or in the log's own if the log has no propeller table."""
    if aircraft is not None:
        return load_aircraft(aircraft).propulsion.propeller
    if not isinstance(log, Path) or autopilot_of(log):
        return None
    attached = _attachments(log)
    if "propeller.csv" in attached or "aircraft.toml" not in attached:
        return None
    try:
        text = attached["aircraft.toml"].decode("utf-8", errors="replace")
        return parse_aircraft(text, f"{log}: aircraft.toml").propulsion.propeller
    except InputError:
        return None  # the analysis reports the error


def _attachments(log: Path) -> dict[str, bytes]:
    """Return a log's attachments by name, found by its index; none from a truncated log, whose index is missing."""
    try:
        with log.open("rb") as stream:
            return {attachment.name: attachment.data for attachment in _indexed_attachments(stream)}
    except Exception:  # the reader raises errors of many kinds; the analysis reports what is wrong
        return {}


def _indexed_attachments(stream: IO[bytes]) -> Iterator[Attachment]:
    """Yield attachments, found by the offsets at the end of the file without reading the index of the chunks."""
    end = stream.seek(-(RECORD_HEAD.size + FOOTER_BYTES + len(MAGIC)), os.SEEK_END)
    footer = Footer.read(_contents(stream.read(RECORD_HEAD.size + FOOTER_BYTES))[0][1])
    if not footer.summary_offset_start:
        yield from SeekingReader(stream).iter_attachments()
        return
    stream.seek(footer.summary_offset_start)
    for _, content in _contents(stream.read(end - footer.summary_offset_start)):
        group = SummaryOffset.read(content)
        if group.group_opcode == Opcode.ATTACHMENT_INDEX:
            stream.seek(group.group_start)
            for _, entry in _contents(stream.read(group.group_length)):
                index = AttachmentIndex.read(entry)
                stream.seek(index.offset)
                yield Attachment.read(_contents(stream.read(index.length))[0][1])


def _contents(records: bytes) -> list[tuple[int, ReadDataStream]]:
    """Return the operation code and content of each record."""
    contents, offset = [], 0
    while offset < len(records):
        opcode, length = RECORD_HEAD.unpack_from(records, offset)
        begin = offset + RECORD_HEAD.size
        contents.append((opcode, ReadDataStream(io.BytesIO(records[begin : begin + length]))))
        offset = begin + length
    return contents


def _propeller_files(name_or_path: str | None) -> list[Path]:
    """Return the files in which `flight.propeller_files.load_propeller` finds a propeller; none for a shipped one."""
    if name_or_path is None or name_or_path in shipped_propellers():
        return []
    path = Path(name_or_path)
    if path.is_dir() or path.suffix == ".txt":  # a UIUC table, to which the other tables in its folder belong
        return sorted((path if path.is_dir() else path.parent).glob("*.txt"))
    return [path] if path.is_file() else []
