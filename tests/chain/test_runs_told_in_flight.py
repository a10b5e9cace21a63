"""What the aircraft reported to the pilot during the demonstration flight agrees with the later analysis."""

from collections import defaultdict
from pathlib import Path

import msgspec
import pytest

from flightpower.analysis.maneuvers.kinds import LEVEL_RUNS
from flightpower.analysis.records.flight import Results
from flightpower.daq.run_monitor import RunMonitor
from flightpower.daq.sensors import Sample
from flightpower.daq.tick_means import FIELDS, TickMeans
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.log_reader import read_log
from flightpower.flight.probe_maps import ProbeMaps

pytestmark = pytest.mark.xdist_group("chain")


def test_a_run_that_was_told_to_be_good_is_one_of_the_analysis(flown: Path) -> None:
    log = read_log(flown / "log.mcap")
    results = msgspec.json.decode((flown / "log.report" / "results.json").read_bytes(), type=Results)
    ticks: dict[int, list[Sample]] = defaultdict(list)
    for topic in FIELDS:
        for entry in log.entries[topic]:
            ticks[entry.tick].append(Sample(topic, entry.time_ns, entry.message))
    probe = msgspec.json.decode(log.attachments["probe.json"], type=ProbeMaps)
    monitor, means, verdicts = RunMonitor(load_aircraft("nexstar"), probe), TickMeans(), []
    for tick in sorted(ticks):
        finished = means.add(tick * 40_000_000, ticks[tick])
        verdicts += monitor.add(finished) if finished else []
    good = [verdict for verdict in verdicts if verdict.good]
    runs = [run for run in results.runs if run.kind in LEVEL_RUNS]
    assert len(runs) == len(good) == monitor.runs
    for run, verdict in zip(runs, good, strict=True):
        assert verdict.kind == run.kind
        assert (verdict.start_s, verdict.end_s) == pytest.approx((run.start_s, run.end_s), abs=1.0)
