"""Modes and messages of an autopilot keep their times, and a receiver's position becomes a distance in meters."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.analysis.records.flight import Clock
from flightpower.analysis.results.provenance import provenance_of_file
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.autopilot import all_channels, read_autopilot_log
from flightpower.analysis.sources.position import fix_of, places, unix_of_week
from flightpower.analysis.sources.recognize import Autopilot, autopilot_of
from flightpower.analysis.sources.recording import EventKind, FlightRecording, modes
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash, write_text
from flightpower.sim.telemetry_writer import BOOTED_US, write_telemetry
from flightpower.sim.ulog_writer import UlogContents, UlogTopic, write_ulog

T_S = np.arange(10.0, 70.0, 0.2)
TIME_US = (1e6 * T_S).astype(np.uint64)
RADIUS_M = 6_371_000.0
NORTH_MPS, EAST_MPS, LATITUDE, LONGITUDE = 3.0, -12.0, 48.1, 179.9995  # across the date line
LAT = LATITUDE + np.degrees(NORTH_MPS * (T_S - T_S[0]) / RADIUS_M)
LNG = LONGITUDE - np.degrees(EAST_MPS * (T_S - T_S[0]) / RADIUS_M / np.cos(np.radians(LATITUDE)))
LNG = (LNG + 180) % 360 - 180
BOOTED_S, HEIGHT_M = 1_714_564_800.0, 512  # noon of the first of May 2024
WEEK, WEEK_S = divmod(BOOTED_S + 18 - 315_964_800, 7 * 86_400)  # of GPS, which is 18 s ahead of UTC
MESSAGE = "Airspeed sensor 1 failed"


def read(path: Path) -> FlightRecording:
    autopilot = autopilot_of(path)
    assert autopilot is not None
    return read_autopilot_log(path, autopilot)


def dataflash(path: Path) -> FlightRecording:
    def kind(name: str, codes: str, **columns: np.ndarray) -> DataflashMessages:
        return DataflashMessages(name, codes, {"TimeUS": TIME_US, **columns})

    mode = np.array([0, 5, 19])
    switched = (1e6 * np.array([10.0, 30.0, 50.0])).astype(np.uint64)
    kinds = [
        DataflashMessages("MSG", "QZ", {"TimeUS": TIME_US[100:101], "Message": np.array([MESSAGE.encode()])}),
        DataflashMessages("PARM", "QNf", {"TimeUS": TIME_US[:1], "Name": np.array([b"TECS_SPDWEIGHT"]),
                                          "Value": np.ones(1)}),
        kind("ARSP", "Qff", Airspeed=15 + np.sin(T_S), DiffPress=100 + 0 * T_S),
        kind("BARO", "Qf", Press=1e5 + 0 * T_S),
        kind("GPS", "QBfffLLeHI", Status=0 * T_S + 3, Spd=0 * T_S + 12, GCrs=0 * T_S, VZ=0 * T_S,
             Lat=LAT, Lng=LNG, Alt=0 * T_S + HEIGHT_M, GWk=0 * T_S + WEEK, GMS=(1e3 * (WEEK_S + T_S)).round()),
        DataflashMessages("MODE", "QMBB", {"TimeUS": switched, "Mode": mode, "ModeNum": mode, "Rsn": 0 * mode}),
    ]  # fmt: skip
    (write_text if path.suffix == ".log" else write_dataflash)(path, kinds)
    return read(path)


def ulog(path: Path) -> FlightRecording:
    state = np.select([T_S < 30, T_S < 50], [0, 15], 4)
    topics = [
        UlogTopic("airspeed", TIME_US, {"indicated_airspeed_m_s": (15 + np.sin(T_S)).astype(np.float32)}),
        UlogTopic("vehicle_gps_position", TIME_US, {
            "fix_type": np.full(len(T_S), 3, np.uint8), "lat": np.round(1e7 * LAT).astype(np.int32),
            "lon": np.round(1e7 * LNG).astype(np.int32), "alt": np.full(len(T_S), 1000 * HEIGHT_M, np.int32),
            "time_utc_usec": (1e6 * (BOOTED_S + T_S)).astype(np.uint64), "vel_n_m_s": np.full(len(T_S), 3, np.float32),
            "vel_e_m_s": np.full(len(T_S), -12, np.float32), "vel_d_m_s": np.zeros(len(T_S), np.float32),
        }),
        UlogTopic("vehicle_status", TIME_US, {"nav_state": state.astype(np.uint8)}),
    ]  # fmt: skip
    write_ulog(path, UlogContents(topics, appended=[MESSAGE]))
    return read(path)


@pytest.mark.parametrize(
    ("suffix", "names"), [(".BIN", ["MANUAL", "FBWA", "QLOITER"]), (".ulg", ["Manual", "Stabilized", "Loiter"])]
)
def test_modes_and_messages_stand_at_their_times(tmp_path: Path, suffix: str, names: list[str]) -> None:
    result = (ulog if suffix == ".ulg" else dataflash)(tmp_path / f"flight{suffix}")
    switched = [event for event in result.events if event.kind is EventKind.MODE]
    assert [event.text for event in switched] == names
    assert [event.t_s for event in switched] == pytest.approx([10.0, 30.0, 50.0], abs=0.21)
    (message,) = (event for event in result.events if event.kind is EventKind.MESSAGE)
    assert message.text == MESSAGE
    assert message.t_s == pytest.approx(T_S[-1] if suffix == ".ulg" else T_S[100], abs=1e-6)
    assert list(result.events) == sorted(result.events)


@pytest.mark.parametrize("suffix", [".BIN", ".log", ".ulg"])
def test_positions_are_distances_from_the_first(tmp_path: Path, suffix: str) -> None:
    """This holds across the date line, and for degrees in a text log as for the packed integers of other logs."""
    result = (ulog if suffix == ".ulg" else dataflash)(tmp_path / f"flight{suffix}")
    north, east = (result.place[name] for name in recording.PLACE)
    assert north.value == pytest.approx(NORTH_MPS * (north.t_s - T_S[0]), abs=0.05)
    assert east.value == pytest.approx(-EAST_MPS * (east.t_s - T_S[0]), abs=0.05)


@pytest.mark.parametrize("suffix", [".BIN", ".log", ".ulg"])
def test_date_and_place_are_the_receiver_s(tmp_path: Path, suffix: str) -> None:
    """GPS week and seconds less the leap seconds, or UTC, give them; some damaged dates change nothing."""
    fix = (ulog if suffix == ".ulg" else dataflash)(tmp_path / f"flight{suffix}").fix
    assert fix.by_satellites and fix.unix_at_zero_s == pytest.approx(BOOTED_S, abs=0.002)
    assert (fix.latitude_deg, fix.longitude_deg) == pytest.approx((LAT[0], LNG[0]), abs=1e-6)
    assert fix.height_msl_m == HEIGHT_M
    unix_s = np.where(np.arange(len(T_S)) % 5, BOOTED_S + T_S, 4e9)
    assert fix_of(T_S, LAT, LNG, unix_s=unix_s).unix_at_zero_s == pytest.approx(BOOTED_S, abs=1e-6)
    assert fix_of(T_S, 0 * LAT, 0 * LNG, unix_s=np.full(len(T_S), np.nan)) == recording.Fix()


@pytest.mark.parametrize(("year", "ahead_s"), [(2008, 14), (2010, 15), (2013, 16), (2016, 17), (2017, 18), (2026, 18)])
def test_leap_seconds_are_those_of_the_year(year: int, ahead_s: int) -> None:
    unix_s = datetime(year, 2, 1, tzinfo=UTC).timestamp()
    week, week_s = divmod(unix_s + ahead_s - datetime(1980, 1, 6, tzinfo=UTC).timestamp(), 604_800)
    assert unix_of_week(np.array([week]), np.array([week_s])) == pytest.approx([unix_s])


def test_the_clock_of_telemetry_is_the_autopilot_s_or_else_the_computer_s(tmp_path: Path) -> None:
    """The ground station's clock is 100 s behind that of the satellites."""
    path, frames = tmp_path / "flight.tlog", []
    for k in range(40):
        place = (3, round(1e7 * LATITUDE), round(1e7 * LONGITUDE), 1000 * HEIGHT_M)
        frames += [
            mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_FIXED_WING, 3, 0, 11, 0, 3),
            mavlink.MAVLink_system_time_message(BOOTED_US + 1_000_000 * (k + 100), 1000 * k),
            mavlink.MAVLink_gps_raw_int_message(0, *place, 1, 1, 1200, 0, 9),
            mavlink.MAVLink_global_position_int_message(0, *place[1:], 0, 0, 0, 0, 0),
            mavlink.MAVLink_scaled_pressure_message(0, 950.0, 1.0, 2000, 2000),
        ]

    def written(frames_left: list[object]) -> recording.Fix:
        plane = mavlink.MAVLink(None, 1, 1)
        times_us = [BOOTED_US + 1_000_000 * (k // 5) for k, frame in enumerate(frames) if frame in frames_left]
        content = [
            time_us.to_bytes(8, "big") + bytes(item.pack(plane))
            for time_us, item in zip(times_us, frames_left, strict=True)
        ]
        path.write_bytes(b"".join(content))
        return read(path).fix

    fix = written(frames)
    assert fix.by_satellites and fix.unix_at_zero_s == pytest.approx(100.0)
    assert (fix.latitude_deg, fix.longitude_deg, fix.height_msl_m) == pytest.approx((LATITUDE, LONGITUDE, HEIGHT_M))
    undated = written([frame for frame in frames if not isinstance(frame, mavlink.MAVLink_system_time_message)])
    assert not undated.by_satellites and undated.unix_at_zero_s == 0.0


def test_results_say_date_and_place_of_the_first_sample(tmp_path: Path) -> None:
    """The log's clock starts at boot, ten seconds before its first message."""
    result = dataflash(tmp_path / "flight.BIN")
    origin = provenance_of_file(result.path, "", None, "", result)
    assert (origin.start_utc, origin.clock, origin.duration_s) == (
        "2024-05-01T12:00:10Z",
        Clock.SATELLITES,
        pytest.approx(59.8, abs=1e-5),
    )
    assert (origin.latitude_deg, origin.height_msl_m) == (pytest.approx(LATITUDE), HEIGHT_M)
    undated = provenance_of_file(result.path, "", None, "", replace(result, fix=recording.Fix()))
    assert (undated.start_utc, undated.clock, undated.latitude_deg) == (None, Clock.NONE, None)


def test_no_position_is_no_place() -> None:
    nothing = np.zeros(50)
    assert places(np.arange(50.0), nothing, nothing) == {}


def test_a_ground_station_s_recording_has_modes_and_messages(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    write_telemetry(path, [
        DataflashMessages("BARO", "Qfc", {"TimeUS": TIME_US, "Press": 1e5 + 0 * T_S, "Temp": 0 * T_S + 20}),
        DataflashMessages("ARSP", "Qffc", {"TimeUS": TIME_US, "Airspeed": 15 + np.sin(T_S), "DiffPress": 0 * T_S + 100,
                                           "Temp": 0 * T_S}),
    ])  # fmt: skip
    plane = mavlink.MAVLink(None, 1, 1)
    frames = [
        (40.0, mavlink.MAVLink_statustext_message(4, MESSAGE.encode())),
        (45.0, mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_FIXED_WING, 3, 0, 11, 0, 3)),
    ]
    with path.open("ab") as stream:
        for t_s, frame in frames:
            stream.write((BOOTED_US + int(1e6 * t_s)).to_bytes(8, "big") + bytes(frame.pack(plane)))
    events = read(path).events
    assert [event.text for event in events] == ["MANUAL", MESSAGE, "RTL"]
    assert events[1].t_s - events[0].t_s == pytest.approx(30.0)


def test_a_mode_is_one_event_until_it_changes_and_an_unknown_one_keeps_its_number() -> None:
    all_modes = modes([0.0, 1.0, 2.0, np.nan, 3.0, 4.0], [10, 10, 99, 5, 99, 10], {10: "AUTO"})
    assert [(mode.t_s, mode.text) for mode in all_modes] == [(0.0, "AUTO"), (2.0, "mode 99"), (4.0, "AUTO")]
    assert modes([], [], {}) == []


@pytest.mark.parametrize("suffix", [".BIN", ".log", ".ulg"])
def test_every_number_of_a_log_can_be_drawn(tmp_path: Path, suffix: str) -> None:
    """This includes messages that no reader of the analysis uses; they are on the clock of the recording."""
    path = tmp_path / f"flight{suffix}"
    (ulog if suffix == ".ulg" else dataflash)(path)
    autopilot = autopilot_of(path)
    assert autopilot is not None
    channels = all_channels(path, autopilot)
    names = {".ulg": ("airspeed.indicated_airspeed_m_s", "vehicle_status.nav_state")}
    speed, mode = (channels[name]() for name in names.get(suffix, ("ARSP.Airspeed", "MODE.Rsn")))
    assert speed.t_s == pytest.approx(T_S, abs=1e-5) and speed.value == pytest.approx(15 + np.sin(T_S), rel=1e-6)
    assert mode.t_s[0] == pytest.approx(10.0) and "MSG.Message" not in channels


def test_telemetry_is_drawn_by_mavlink_s_own_names(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    plane = mavlink.MAVLink(None, 1, 1)
    frames = [(0.0, mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_FIXED_WING, 3, 0, 11, 0, 3))]
    frames += [(0.1 * k, mavlink.MAVLink_attitude_message(0, 0.01 * k, 0, 0, 0, 0, 0)) for k in range(50)]
    path.write_bytes(
        b"".join((BOOTED_US + int(1e6 * t)).to_bytes(8, "big") + bytes(item.pack(plane)) for t, item in frames)
    )
    channels = all_channels(path, Autopilot.ARDUPILOT)
    assert channels["ATTITUDE.roll"]().value == pytest.approx(0.01 * np.arange(50), abs=1e-7)


def test_paparazzi_s_unknown_fields_have_numbers(tmp_path: Path) -> None:
    path = tmp_path / "flight.data"
    path.write_text("".join(f"{k}.0 20 DL_VALUE 3 {k / 2}\n{k}.5 20 ENERGY 55 11.5 1.7\n" for k in range(40)))
    channels = all_channels(path, Autopilot.PAPARAZZI)
    assert list(channels["DL_VALUE.2"]().value) == [k / 2 for k in range(40)]
    assert set(channels["ENERGY.voltage_V"]().value) == {11.5}
