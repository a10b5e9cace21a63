"""A job in a new interpreter: the worker of a cluster may not start processes with `multiprocessing`."""

import os
import pickle
import shutil
import subprocess
import sys
import threading
from pathlib import Path

from flightpower.analysis.flights.campaign.processes import Analyze, Job, Outcome, run_job

OUTCOME = "outcome.pickle"


def run_apart(analyze: Analyze, job: Job, working: Path, results: Path) -> Outcome:
    """Run a job in a process that starts in the folder `working` and writes into `results`."""
    outcome = results.with_name(OUTCOME)
    environment = {"OMP_NUM_THREADS": "1"} | dict(os.environ) | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    command = [sys.executable, "-m", __name__]
    with subprocess.Popen(command, stdin=subprocess.PIPE, cwd=working, env=environment) as process:
        assert process.stdin is not None
        pickle.dump((analyze, job, results, outcome), process.stdin)
        process.stdin.flush()
        code = process.wait()  # keeps stdin open: its end tells the process that nobody is waiting
    if not outcome.is_file():
        return Outcome(f"{job.log}: its process ended with exit code {code}; is there enough memory? Analyze it alone")
    result: Outcome = pickle.loads(outcome.read_bytes())
    return result


def main() -> None:
    analyze, job, results, outcome = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_parent, args=(results.parent,), daemon=True).start()
    outcome.write_bytes(pickle.dumps(run_job(analyze, job, results, lambda _: None)))


def _end_with_parent(temporary: Path) -> None:
    while os.read(sys.stdin.fileno(), 4096):  # not a buffered read: its lock would keep this process from exiting
        pass
    shutil.rmtree(temporary, ignore_errors=True)
    os._exit(1)


if __name__ == "__main__":
    main()
