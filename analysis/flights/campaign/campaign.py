"""Analyzes many logs, each into its own folder: finished folders stay, the other logs are analyzed, and each failure is
one line. Then reads all results for the pool."""

import contextlib
import shutil
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple, Protocol

import msgspec
from msgspec import structs

from flightpower.analysis.flights.campaign.addresses import FoundLogs, Log, RemoteLog, place
from flightpower.analysis.flights.campaign.cluster import cluster
from flightpower.analysis.flights.campaign.folders import (
    RESULTS,
    LogFile,
    Record,
    complete,
    digests,
    edited_runs,
    inputs_digest,
    intact,
    key,
    names,
    partial_folder,
    put_aside,
    record_of,
    records,
)
from flightpower.analysis.flights.campaign.processes import Analyze, Job, Outcome, load_ahead, processors, run_jobs
from flightpower.analysis.flights.flight_statistics import without_details
from flightpower.analysis.records.flight import Results
from flightpower.analysis.results.read import read_json, read_results
from flightpower.flight.errors import InputError, StorageError


@dataclass(frozen=True)
class Work:
    """The work for each log. settings: the values that results depend on, as text.

    files: returns (option, file) for every other file that the analysis of a log reads; for a log at an address, only
    the files that options name. Raises InputError. preload: modules that all analyses need.
    """

    analyze: Analyze
    settings: str = ""
    files: Callable[[Log], Sequence[tuple[str, Path]]] = lambda log: ()
    preload: Sequence[str] = ()


class Monitor(Protocol):
    """Is notified of the progress of the jobs."""

    def planned(self, jobs: int, completed: int) -> None: ...

    def step(self, name: str, step: str) -> None: ...

    def failed(self, error: str) -> None: ...

    def ended(self, name: str, outcome: Outcome) -> None: ...


@dataclass
class Campaign:
    """folders: the folders of complete flights, sorted by name. failures, notes: one line each."""

    folders: list[Path] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    completed: int = 0  # number of folders that were complete before
    processor_seconds: float = 0.0  # sum over all analyses
    peak_bytes: int = 0  # the most memory used by any process


class Planned(NamedTuple):
    job: Job
    inputs: str  # digest of everything except the log that the results depend on
    log: LogFile  # as it was before the analysis


def run(
    listing: FoundLogs, output: Path, work: Work, monitor: Monitor, *, jobs: int, scheduler: str | None = None
) -> Campaign:
    """Analyze logs into folders below `output`, `jobs` at a time, or on the cluster of a scheduler.

    `output` belongs to the caller (`folders.exclusive`). Raises InputError when it cannot be written, and StorageError
    when the disk is full or fails; the remaining logs are not analyzed then.
    """
    if scheduler is None:
        load_ahead(work.preload)
    campaign = Campaign(failures=list(listing.failures))
    planned = {planned_job.job.name: planned_job for planned_job in _plan(listing.logs, output, work, jobs, campaign)}
    campaign.completed = len(campaign.folders)
    for failure in campaign.failures:
        monitor.failed(failure)
    monitor.planned(len(planned), campaign.completed)

    def new_folder(name: str) -> Path:
        return partial_folder(output, name)

    def step(job: Job, text: str) -> None:
        monitor.step(job.name, text)

    place = processors(work.analyze, jobs, step) if scheduler is None else cluster(scheduler, work.analyze, step)
    with place as workers:
        for job, partial, outcome in run_jobs(
            (planned_job.job for planned_job in planned.values()), workers, new_folder
        ):
            if outcome.storage:
                raise StorageError(outcome.error.replace(str(partial), str(output / job.name)))
            if outcome.error:
                shutil.rmtree(partial, ignore_errors=True)
                campaign.failures.append(outcome.error)
            else:
                _, inputs, log = planned[job.name]
                log = msgspec.structs.replace(log, digest=outcome.digest or log.digest)
                complete(partial, output / job.name, key=key(log.digest, inputs), log=log, runs=job.runs)
                campaign.folders.append(output / job.name)
            campaign.processor_seconds += outcome.processor_seconds
            campaign.peak_bytes = max(campaign.peak_bytes, outcome.peak_bytes)
            monitor.ended(job.name, outcome)
    campaign.folders.sort(key=lambda folder: folder.name)
    campaign.failures.sort()
    return campaign


def _plan(logs: Sequence[Log], output: Path, work: Work, jobs: int, campaign: Campaign) -> list[Planned]:
    """Return the jobs that remain. `campaign` receives complete folders, and lines on unreadable or repeated logs."""
    by_digest: dict[str, Log] = {}
    earlier = records(output)
    earlier_digest = _known_digest(logs, earlier.values())
    for log, digest in zip(logs, digests(logs, earlier_digest, jobs), strict=True):
        if isinstance(digest, InputError):
            campaign.failures.append(str(digest))
        elif digest in by_digest:
            campaign.notes.append(f"{log}: has the same content as {by_digest[digest]}; used once")
        else:
            by_digest[digest] = log
    named = list(zip(by_digest.items(), names([place(log) for log in by_digest.values()]), strict=True))
    with contextlib.suppress(OSError, InputError):  # a folder that cannot be renamed is rejected below
        campaign.notes += _rename(output, {name: LogFile.of(log, digest) for (digest, log), name in named}, earlier)
    planned = []
    for (file_digest, log), name in named:
        folder = output / name
        try:
            record = record_of(folder)
            file = LogFile.of(log, file_digest)
            if record and not _belongs(folder, record, file):
                raise InputError(f"{folder}: is of another log, {record.log.path}; move it")
            runs = edited_runs(folder, record)
            files = work.files(log)
            inputs = inputs_digest(work.settings, files, runs)
            done = record is not None and record.key == key(file_digest, inputs) and intact(folder, record)
        except (InputError, OSError) as error:
            campaign.failures.append(str(error))
            continue
        if done:
            campaign.folders.append(folder)
        else:
            planned.append(Planned(Job(name, log, runs, tuple(path for _, path in files)), inputs, file))
    return planned


def _rename(output: Path, logs: Mapping[str, LogFile], earlier: Mapping[Path, Record]) -> list[str]:
    """Rename the logs' earlier folders to their current names, which change when a log is moved or gets a namesake.

    logs : by folder name. A folder that has one of these names but is from another log is moved aside. The notes
    returned report this unless that log is also in `logs`. Raises OSError, InputError.
    """
    notes = []
    records, wanted = dict(earlier), {log.digest for log in logs.values()}
    of_digest = {record.log.digest: folder for folder, record in reversed(list(earlier.items()))}  # the first copy
    for name, log in logs.items():
        folder = output / name
        if folder in records and not _belongs(folder, records[folder], log):
            aside = put_aside(folder)
            records[aside] = other = records.pop(folder)
            if of_digest[other.log.digest] == folder:
                of_digest[other.log.digest] = aside
            if other.log.digest not in wanted:
                notes.append(f"{folder}: was of another log, {other.log.path}; is {aside} now")
        own = of_digest.get(log.digest)
        if own and not folder.exists():
            own.rename(folder)
            records[folder], of_digest[log.digest] = records.pop(own), folder
    return notes


def _belongs(folder: Path, record: Record, log: LogFile) -> bool:
    """Whether a folder is from this log, or from earlier content of the same file with no hand-edited list of runs."""
    same_file = record.log.path == log.path and edited_runs(folder, record) is None
    return record.log.digest == log.digest or same_file


def _known_digest(logs: Iterable[Log], records: Iterable[Record]) -> Callable[[Log], str | None]:
    """Return a function that gives the digest of each log that was analyzed before and is unchanged since, else None.

    A log at an address whose size differs from all others cannot be a copy of another log. It is not read just for its
    digest: a unique placeholder stands for the digest until the analysis reads the log.
    """
    by_path = {record.log.path: record.log for record in records}
    sizes = Counter(log.size for log in by_path.values())
    for log in logs:
        with contextlib.suppress(OSError):
            sizes[log.stat().st_size if isinstance(log, Path) else log.size or 0] += 1

    def earlier_digest(log: Log) -> str | None:
        same_file = by_path.get(str(log.absolute() if isinstance(log, Path) else log))
        with contextlib.suppress(OSError):
            if (
                same_file
                and (same_file.changed_ns or same_file.version)
                and same_file == LogFile.of(log, same_file.digest)
            ):
                return same_file.digest
        return f"unread {log}" if isinstance(log, RemoteLog) and log.size and sizes[log.size] == 1 else None

    return earlier_digest


def read_flights(folders: Sequence[Path]) -> list[Results]:
    """Return the results in flights' folders, with the folder's name as `log`. Raises InputError for a damaged file."""
    flights = []
    for folder in folders:
        content = read_results(folder / RESULTS)
        values = content.autopilot_parameters  # kept for the pool, which takes their mean
        flights.append(structs.replace(without_details(content), log=folder.name, autopilot_parameters=values))
    return flights


def flight_folders_of(folder: Path) -> list[Path]:
    """Return the flights' folders of a pool or of a folder with several flights, or a single flight's folder itself.

    Raises InputError when there are no results.
    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is not a folder; give one that `analyze` wrote")
    if not (folder / RESULTS).is_file():
        folders = sorted(path.parent for path in folder.glob(f"*/{RESULTS}"))
        if not folders:
            raise InputError(f"{folder}: no {RESULTS} in it; give a folder that `analyze` wrote")
        return folders
    results = read_json(folder / RESULTS)
    flights = results.get("flights")
    if flights is None:
        return [folder]
    flights += (results.get("other_kind") or {}).get("flights", [])
    return [folder / name for name in dict.fromkeys(str(flight["log"]) for flight in flights)]
