"""Jobs on a Dask cluster. Logs and files travel with them: its computers need the software, but no common folder."""

import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from analysis.campaign.folders import software
from analysis.campaign.process_apart import run_apart
from analysis.campaign.processes import Analyze, Job, Outcome, below
from flight.errors import InputError

CONNECT_S = 10
QUEUED_PER_THREAD = 2  # jobs at the scheduler for each thread of a worker: enough to keep it busy
LARGEST_JOB_BYTES = 2**31  # above which Dask warns that a job is large


class Parcel(NamedTuple):
    """A job for another computer. files: contents by absolute path. folder: in which relative paths begin."""

    analyze: Analyze
    job: Job
    folder: Path
    files: dict[Path, bytes]
    software: str


class Returned(NamedTuple):
    outcome: Outcome
    files: dict[str, bytes]  # of the flight's folder, by name


def run_on_cluster(
    jobs: Sequence[Job],
    analyze: Analyze,
    address: str,
    new_folder: Callable[[str], Path],
    progress: Callable[[Job, str], None],
) -> Iterator[tuple[Job, Path, Outcome]]:
    """Run jobs on the cluster of a scheduler; yields each with its folder when it ends.

    A job whose worker dies runs again on another. Raises InputError when there is no such scheduler.
    """
    try:
        import dask.config
        from distributed import Client, as_completed
    except ModuleNotFoundError:
        raise InputError('--scheduler: distributed is not installed; run: pip install "flightpower[cluster]"') from None
    settings = {"distributed.admin.large-graph-warning-threshold": LARGEST_JOB_BYTES}
    with dask.config.set(settings), _client(Client, address) as client:
        waiting, running = list(reversed(jobs)), dict[Any, Job]()
        ended = as_completed()

        def submit() -> None:
            threads = sum(client.nthreads().values())
            while waiting and len(running) < max(1, QUEUED_PER_THREAD * threads):
                job = waiting.pop()
                progress(job, "on the cluster")
                future = client.submit(analyze_parcel, _parcel(analyze, job), pure=False, retries=2)
                running[future] = job
                ended.add(future)

        submit()
        for future in ended:
            job = running.pop(future)
            folder = new_folder(job.name)
            yield job, folder, _unpack(future, job, folder)
            future.release()
            submit()


def _client(client: Callable[..., Any], address: str) -> Any:
    try:
        return client(address, timeout=CONNECT_S)
    except (OSError, ValueError) as error:
        cause = str(error) or type(error).__name__
        raise InputError(
            f"--scheduler {address}: no Dask scheduler answers there ({cause}); start one with `dask scheduler`"
        ) from None


def _parcel(analyze: Analyze, job: Job) -> Parcel:
    paths = [job.log, *job.files, *([job.runs] if job.runs else [])]
    return Parcel(analyze, job, Path.cwd(), {_absolute(path): path.read_bytes() for path in paths}, software())


def _absolute(path: Path) -> Path:
    """Without `..`, but with its symbolic links: they are part of the name by which a file is asked for."""
    return Path(os.path.normpath(path.absolute()))


def _unpack(future: Any, job: Job, folder: Path) -> Outcome:
    try:
        returned: Returned = future.result()
    except Exception as error:
        return Outcome(f"{job.log}: the cluster could not analyze it ({type(error).__name__}: {error})".splitlines()[0])
    for name, content in returned.files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return returned.outcome


def analyze_parcel(parcel: Parcel) -> Returned:
    """On the worker: the job in a process of its own, as on one computer.

    Paths are those of the sender below a temporary folder, whose name is taken out of everything that returns.
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
        job = replace(job, log=below(root, job.log), runs=below(root, runs) if runs else None)
        outcome = run_apart(parcel.analyze.under(root), job, working, results)
        files = {
            path.relative_to(results).as_posix(): path.read_bytes().replace(str(root).encode(), b"")
            for path in results.rglob("*")
            if path.is_file()
        }
        return Returned(outcome._replace(error=outcome.error.replace(str(root), "")), files)
