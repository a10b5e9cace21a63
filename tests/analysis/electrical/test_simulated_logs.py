"""A simulated flight as PX4 and ArduPilot log it, with the traps of real logs: the true power is in the interval."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from analysis.autopilot_logs.ardupilot import read_ardupilot
from analysis.autopilot_logs.px4 import read_px4
from analysis.autopilot_logs.recording import FlightRecording
from analysis.electrical.estimate import ElectricalEstimate, estimate
from analysis.electrical.flight_table import FlightTable, flight_table
from analysis.estimation.intervals import NORMAL_95
from flight.complete_aircraft import load_complete_aircraft
from flight.errors import InputError
from sim.ardupilot_log import write_ardupilot_log
from sim.fly import Flight, fly
from sim.plan import load_plan
from sim.px4_log import write_px4_log
from sim.sensors import FlightSensorTruth, load_budget
from sim.sensors.budget import DrawnErrors

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from electrical import true_power
from flights import drawn

AIRCRAFT = load_complete_aircraft("nexstar")
WEIGHT_N, GEOMETRY = AIRCRAFT.mass.weight_N, AIRCRAFT.geometry


@pytest.fixture(scope="module")
def flown() -> tuple[Flight, FlightSensorTruth, DrawnErrors]:
    errors = drawn(load_budget("study"), 3)
    flight = fly(AIRCRAFT, load_plan("ordinary-flight"), seed=3, deviations=errors.deviations)
    return flight, FlightSensorTruth(flight, errors), errors


def analyzed(recording: FlightRecording) -> tuple[FlightTable, ElectricalEstimate]:
    table = flight_table(recording, WEIGHT_N, GEOMETRY.wing_area_m2)
    return table, estimate(table, WEIGHT_N, GEOMETRY.wing_area_m2, GEOMETRY.span_m)


@pytest.mark.parametrize(
    ("write", "read", "faults", "note"),
    [
        (write_ardupilot_log, read_ardupilot, ["landed", "wrong-battery-first", "appended"], "BAT 1 measures"),
        (write_ardupilot_log, read_ardupilot, ["pressure-offset", "dropouts"], ""),
        (write_ardupilot_log, read_ardupilot, ["clock-jump"], "clock jumped"),
        (write_ardupilot_log, read_ardupilot, ["airborne-start", "truncated"], ""),
        (write_px4_log, read_px4, ["pressure-offset", "appended"], ""),  # others are tested with a real log
    ],
)
def test_traps(
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
    flown: tuple[Flight, FlightSensorTruth, DrawnErrors],
    write: Callable[..., None],
    read: Callable[[Path], FlightRecording],
    faults: list[str],
    note: str,
) -> None:
    write(tmp_path / "log", *flown, faults)
    table, found = analyzed(read(tmp_path / "log"))
    true_W = true_power(AIRCRAFT, flown[0], flown[2], found.V_mps[::15], found.conditions.rho)
    assert (np.abs(found.power_W[::15] - true_W) < NORMAL_95 * found.standard_error_W[::15]).all()
    assert note in " ".join(table.notes)
    assert capfd.readouterr() == ("", "")  # the reader's library prints damaged bytes


def test_without_airspeed(tmp_path: Path, flown: tuple[Flight, FlightSensorTruth, DrawnErrors]) -> None:
    write_ardupilot_log(tmp_path / "00000001.BIN", *flown, ["no-airspeed"])
    with pytest.raises(InputError, match="lacks airspeed"):
        analyzed(read_ardupilot(tmp_path / "00000001.BIN"))


def test_motor_speed_and_parameters_are_read(
    tmp_path: Path, flown: tuple[Flight, FlightSensorTruth, DrawnErrors]
) -> None:
    write_px4_log(tmp_path / "log.ulg", *flown)
    write_ardupilot_log(tmp_path / "log.bin", *flown)
    px4, ardupilot = read_px4(tmp_path / "log.ulg"), read_ardupilot(tmp_path / "log.bin")
    assert px4.parameters["FW_AIRSPD_TRIM"] == 15.0 and ardupilot.parameters["ARSPD_RATIO"] == 2.0
    for recording in (px4, ardupilot):
        t_s, revps = recording.channels["motor_revps"]
        true = flown[1].motor_speed_revps(t_s - (35.0 if recording is px4 else 81.0))
        assert np.abs(revps - true)[50:-50].max() < 3.0
