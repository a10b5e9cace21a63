"""One flight recorded by PX4, ArduPilot and the daemon gives one curve."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.methods.whole_flight.curve import estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.daemon_log import lacks_drag_topics
from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.analysis.sources.px4 import read_px4
from flightpower.analysis.sources.recording import Channel, FlightRecording
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.log_entries import Entries, LogEntry, entries_of
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import AbsolutePressure, Battery, DifferentialPressure, Gps, Imu, Message
from flightpower.sim.autopilot_pitot import indicated_airspeed
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash
from flightpower.sim.px4_log import write_px4_log
from flightpower.sim.sensors import load_budget
from tests.analysis.sources.firmware import firmware

sys.path.insert(0, str(Path(__file__).parents[3] / "benchmarks"))
from flights import draw_errors, flown

AIRCRAFT = load_complete_aircraft("nexstar")
WEIGHT_N, WING_AREA_M2, SPAN_M = AIRCRAFT.mass.weight_N, AIRCRAFT.geometry.wing_area_m2, AIRCRAFT.geometry.span_m
SPEEDS = np.linspace(15.0, 21.0, 8)


@pytest.fixture(scope="module")
def px4(tmp_path_factory: pytest.TempPathFactory) -> FlightRecording:
    path, errors = tmp_path_factory.mktemp("px4") / "log.ulg", draw_errors(load_budget("study"), 3)
    flight, sensors, _ = flown(AIRCRAFT, errors, "ordinary-flight", 3)
    write_px4_log(path, flight, sensors, errors)
    return read_px4(path)


def power(flight: FlightRecording) -> np.ndarray:
    electrical = estimate(flight_table(flight, WEIGHT_N, WING_AREA_M2), WEIGHT_N, WING_AREA_M2, SPAN_M)
    return np.interp(SPEEDS, electrical.V_mps, electrical.power_W)


@pytest.fixture(scope="module")
def expected(px4: FlightRecording) -> np.ndarray:
    return power(px4)


def test_ardupilot(tmp_path: Path, px4: FlightRecording, expected: np.ndarray) -> None:
    def kind(name: str, codes: str, sampled: Channel, **columns: np.ndarray) -> DataflashMessages:
        time_us = np.round(sampled.t_s * 1e6).astype(np.uint64)
        return DataflashMessages(name, codes, {"TimeUS": time_us, **columns})

    def on(name: str, times: Channel) -> np.ndarray:
        return np.interp(times.t_s, *px4.channels[name])

    pitot, static, battery = (
        px4.channels[name] for name in (recording.AIRSPEED_PRESSURE, recording.STATIC, "battery_A")
    )
    air = px4.thermometers["differential_pressure 0"]
    gps, imu = px4.channels[recording.GPS[0]], px4.channels[recording.FORCE_Z]
    north, east, down = (on(name, gps) for name in recording.GPS)
    path = tmp_path / "00000042.BIN"
    write_dataflash(
        path,
        [
            kind("ARSP", "Qfff", pitot, Airspeed=np.abs(indicated_airspeed(pitot.value)), DiffPress=pitot.value,
                 Temp=np.interp(pitot.t_s, air.t_s, air.value) - 273.15),
            kind("BARO", "Qff", static, Press=static.value, Temp=0 * static.value + 40.0),
            kind("BAT", "QBff", battery, Inst=0 * battery.value, Volt=on("battery_V", battery), Curr=0 * battery.value),
            kind("BAT", "QBff", battery, Inst=0 * battery.value + 1, Volt=on("battery_V", battery), Curr=battery.value),
            kind("IMU", "Qfff", imu, AccX=on(recording.FORCE_X, imu), AccY=on(recording.FORCE_Y, imu), AccZ=imu.value),
            kind("GPS", "QBfff", gps, Status=0 * north + 3, Spd=np.hypot(north, east),
                 GCrs=np.degrees(np.arctan2(east, north)) % 360, VZ=down),
            firmware(),
        ],
    )  # fmt: skip
    flight = read_ardupilot(path)
    assert "BAT 1 measures the propulsion" in flight.notes[0]
    assert power(flight) == pytest.approx(expected, rel=0.005)


def test_a_log_of_the_daemon_without_flow_angles_and_motor_speed(px4: FlightRecording, expected: np.ndarray) -> None:
    def entries(channel: Channel, message: type[Message], **fields: np.ndarray) -> Entries:
        rows = zip(*fields.values(), strict=True)
        return entries_of(
            [
                LogEntry(round(t * 1e9), i, message(**dict(zip(fields, map(float, row), strict=True))))
                for i, (t, row) in enumerate(zip(channel.t_s, rows, strict=True))
            ]
        )

    def sampled(name: str, times: Channel) -> np.ndarray:
        return np.interp(times.t_s, *px4.channels[name])

    pitot, static, current = (
        px4.channels[name] for name in (recording.AIRSPEED_PRESSURE, recording.STATIC, "battery_A")
    )
    gps, imu = px4.channels[recording.GPS[0]], px4.channels[recording.FORCE_Z]
    velocity = dict(
        zip(
            ("velocity_north_mps", "velocity_east_mps", "velocity_down_mps"),
            (sampled(n, gps) for n in recording.GPS),
            strict=True,
        )
    )
    air_K = 0 * static.value + flight_table(px4, WEIGHT_N, WING_AREA_M2).air_temperature_K
    log = Log(
        Path("log.mcap"),
        {
            "/probe/airspeed": entries(pitot, DifferentialPressure, differential_pressure_Pa=pitot.value + 7.0),
            "/static": entries(static, AbsolutePressure, pressure_Pa=static.value, temperature_K=air_K),
            "/battery": entries(current, Battery, current_A=current.value, voltage_V=sampled("battery_V", current)),
            "/imu": entries(
                imu,
                Imu,
                specific_force_x_mps2=sampled(recording.FORCE_X, imu),
                specific_force_y_mps2=sampled(recording.FORCE_Y, imu),
                specific_force_z_mps2=imu.value,
            ),
            "/gps": entries(gps, Gps, **velocity),
        },
    )
    assert lacks_drag_topics(log)
    flight = recording_of(log)
    assert "/probe/alpha, /rpm" in flight.notes[0]
    assert flight.recorded_by == ""
    assert recording_of(replace(log, metadata={"flightpower": {"version": "1.2"}})).recorded_by == "flightpower 1.2"
    assert power(flight) == pytest.approx(expected, rel=0.005)
