"""Simulated flights have one defect each, unknown to the analysis, and the verdict names it."""

import msgspec
import pytest
from flights import tunnel_probe
from worlds import Cell, Job, one_flight

from flightpower.analysis.records.flight import EvidenceKind, Trust

COUNTED, RUNS = EvidenceKind.COUNTED_SPEED, EvidenceKind.RUN_AGAINST_OTHERS
SENSOR = EvidenceKind.SENSOR_ERROR


# `make test` has quicker tests: that the tutorial's flight is trusted, and that each method finds its own defect.
@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize(
    ("world", "trust", "first"),
    [
        ("study", Trust.TRUSTED, None),
        ("poles-12-for-14", Trust.NOT_TO_BE_TRUSTED, COUNTED),
        ("landing-gear", Trust.NOT_TO_BE_TRUSTED, RUNS),
        ("pulses-lost", Trust.DOUBTFUL, COUNTED),
        ("vibration-forward", Trust.NOT_TO_BE_TRUSTED, SENSOR),
        ("airspeed-leak", Trust.NOT_TO_BE_TRUSTED, SENSOR),
    ],
)
def test_a_defect_is_named_and_a_sound_flight_is_trusted(world: str, trust: Trust, first: EvidenceKind | None) -> None:
    line = one_flight(Job(Cell(world, 0.0, "two-pairs"), 0, "", msgspec.json.encode(tunnel_probe()).decode(), False))
    assert line["trust"] is trust
    assert line["evidence"][:1] == ([first] if first else [])
