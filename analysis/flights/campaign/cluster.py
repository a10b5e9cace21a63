"""Jobs on a Dask cluster. Logs and files travel with them: its computers need the software, but no common folder. A log
at an address is not sent: the worker reads it with its own credentials.
"""

import os
import tempfile
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from flightpower.analysis.flights.campaign.folders import software
from flightpower.analysis.flights.campaign.process_apart import run_apart
from flightpower.analysis.flights.campaign.processes import Analyze, Computers, Job, Outcome, Returned, below
from flightpower.analysis.flights.campaign.settings import CAMPAIGN
from flightpower.flight.errors import InputError


class Parcel(NamedTuple):
    """A job for another computer. files: contents by absolute path. folder: where relative paths start."""

    analyze: Analyze
    job: Job
    folder: Path
    files: dict[Path, bytes]
    software: str


@contextmanager
def cluster(address: str, analyze: Analyze, step: Callable[[Job, str], None]) -> Iterator[Computers]:
    """Connect to the cluster of a scheduler. A job whose worker dies runs again on another worker.

    Raises InputError when there is no such scheduler.
    """
    try:
        import dask.config
        from distributed import Client
    except ModuleNotFoundError:
        raise InputError('--scheduler: distributed is not installed; in the clone: pip install ".[fleet]"') from None
    settings = {"distributed.admin.large-graph-warning-threshold": 2**31}  # bytes; each job contains its log
    with dask.config.set(settings), _client(Client, address) as client:
        executor = client.get_executor(pure=False, retries=2)  # closing the client closes it, and drops its jobs

        def submit(job: Job, folder: Path) -> "Future[Returned]":
            step(job, "on the cluster")
            submitted: Future[Returned] = executor.submit(analyze_parcel, _parcel(analyze, job))
            return submitted

        yield Computers(submit, lambda: max(1, CAMPAIGN.queued_per_thread * sum(client.nthreads().values())))


def _client(client: Callable[..., Any], address: str) -> Any:
    try:
        return client(address, timeout=CAMPAIGN.connect_s)
    except (OSError, ValueError) as error:
        cause = str(error) or type(error).__name__
        raise InputError(
            f"--scheduler {address}: no Dask scheduler answers there ({cause}); start one with `dask scheduler`"
        ) from None


def _parcel(analyze: Analyze, job: Job) -> Parcel:
    paths = [path for path in (job.log, *job.files, job.runs) if isinstance(path, Path)]
    return Parcel(analyze, job, Path.cwd(), {_absolute(path): path.read_bytes() for path in paths}, software())


def _absolute(path: Path) -> Path:
    """Make a path absolute. `..` is resolved but symbolic links are not: they are part of the requested name."""
    return Path(os.path.normpath(path.absolute()))


def analyze_parcel(parcel: Parcel) -> Returned:
    """Run the job on the worker, in its own process, as on a single computer.

    The sender's paths are recreated below a temporary folder, whose name is removed from everything returned.
    """
    if parcel.software != software():
        other = "the cluster's worker has another version of flightpower or its libraries; install the same"
        return Returned(Outcome(f"{parcel.job.log}: {other}"), {})
    with tempfile.TemporaryDirectory(prefix="flightpower-") as temporary:
        root, results = Path(temporary, "files"), Path(temporary, "results")
        for path, content in parcel.files.items():
            copy = below(root, path)
            copy.parent.mkdir(parents=True, exist_ok=True)
            copy.write_bytes(content)
        working = below(root, parcel.folder)
        for folder in (working, results):
            folder.mkdir(parents=True, exist_ok=True)
        job, runs = parcel.job, parcel.job.runs
        log = below(root, job.log) if isinstance(job.log, Path) else job.log
        job = replace(job, log=log, runs=below(root, runs) if runs else None)
        outcome = run_apart(parcel.analyze.under(root), job, working, results)
        files = {
            path.relative_to(results).as_posix(): path.read_bytes().replace(str(root).encode(), b"")
            for path in results.rglob("*")
            if path.is_file()
        }
        return Returned(outcome._replace(error=outcome.error.replace(str(root), "")), files)
