"""Faults inside parts, in flight: nothing wrong is recorded as ok, the crew hears of it within 5 s, and recovery
follows.

`benchmarks/injected_faults.py` has all faults; this file has one of each kind.
"""

import importlib.util
import sys
from pathlib import Path

import pytest

BENCHMARK = Path(__file__).parents[2] / "benchmarks" / "injected_faults.py"
spec = importlib.util.spec_from_file_location("injected_faults", BENCHMARK)
assert spec is not None and spec.loader is not None
injected = sys.modules["injected_faults"] = importlib.util.module_from_spec(spec)
spec.loader.exec_module(injected)
FAULTS = {fault.name: fault for fault in injected.FAULTS}
LEAST_OK = 2300  # of 2568 readings in ten seconds, since at most one part is silent


@pytest.mark.parametrize(
    "name",
    [
        "imu_ranges_lost", "imu_fifo_lost", "imu_shifted", "imu_frozen", "static_shifted", "static_frozen",
        "airspeed_second_part", "gps_repeats", "gps_restarts_at_1_Hz", "gps_refuses_the_rate", "autopilot_gimbal",
        "autopilot_streams_slowly", "rpm_frozen",
    ],
)  # fmt: skip
def test_nothing_wrong_is_ok_and_the_crew_hears_of_it(name):
    fault = FAULTS[name]
    outcome = injected.run(fault)
    assert outcome.wrong == 0, outcome
    assert outcome.ok >= LEAST_OK and outcome.hidden <= 25
    assert injected.is_reported(fault, outcome), outcome


def test_without_a_fault_everything_is_ok():
    """The benchmark's own truths, delays and noise are right: not one reading is wrong."""
    outcome = injected.run(injected.Fault("none"))
    assert (outcome.wrong, outcome.hidden, outcome.event_s, outcome.state_s) == (0, 0, None, None)
    assert outcome.ok == pytest.approx(2568, abs=10)


def test_a_fault_that_is_over_is_over():
    """After a receiver restarted or an IMU lost its ranges, they work as before: the last second has all readings."""
    for name in ("gps_restarts_at_1_Hz", "imu_ranges_lost", "autopilot_streams_slowly"):
        assert injected.run(FAULTS[name]).last_second_ok >= 0.97 * 257, name
