"""One analysis among many: how it ends where the computer's memory is too small."""

import os
from pathlib import Path

import pytest

from flightpower.analysis.flights.campaign import processes
from flightpower.flight.errors import InputError


@pytest.mark.parametrize(
    ("raised", "message"),
    [
        (MemoryError(), "long.mcap: needs more than 4 GB of memory; analyze it alone"),
        (InputError("long.mcap: no flight"), "long.mcap: no flight"),
        (ValueError("out of range"), "an error of the software"),
    ],
)
def test_a_job_that_fails_says_why_in_one_line(tmp_path: Path, monkeypatch, raised: Exception, message: str) -> None:
    """An analysis may take 4 GB (docs/use/many-flights.md)."""

    def analyze(*_: object) -> None:
        raise raised

    monkeypatch.setattr(processes, "limit_memory", lambda _: None)  # the limit would hold for the whole process
    ended = processes.run_job(analyze, processes.Job("a", Path("long.mcap")), tmp_path, print)  # type: ignore[arg-type]
    assert message in ended.error and len(ended.error.splitlines()) == 1
    assert 0 <= ended.seconds < 60 and 0 <= ended.processor_seconds < 60
    assert os.name != "posix" or 10e6 < ended.peak_bytes < 1e12, "an interpreter takes some ten megabytes"
