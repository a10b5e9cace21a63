"""A flight in ArduPilot's dataflash log, in its text, and in the recording of a ground station: the same channels."""

import gzip
from pathlib import Path

import numpy as np
import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.ardupilot_messages import all_channels
from flightpower.analysis.sources.recognize import Autopilot, autopilot_of
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.analysis.sources.telemetry import TelemetryLog, _complete
from flightpower.flight.errors import InputError
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash, write_text
from flightpower.sim.telemetry_writer import write_telemetry

SUFFIXES = {".BIN": write_dataflash, ".log": write_text, ".tlog": write_telemetry}
# Resolution of each channel in telemetry, from the units of its messages.
STEPS = {
    recording.AIRSPEED_PRESSURE: 1e-3,
    recording.STATIC: 0.02,
    recording.FORCE_X: 0.005,
    recording.FORCE_Z: 0.005,
    recording.VOLTAGE: 0.0006,
    recording.CURRENT: 0.006,
    recording.MOTOR: 1e-4,
    recording.THROTTLE: 0.005,
    **dict.fromkeys(recording.GPS, 0.02),
}


def flight(firmware: str = "ArduPlane V4.5.7") -> list[DataflashMessages]:
    """A minute at 10 Hz of smooth, different signals."""
    t_s = np.arange(0.0, 60.0, 0.1)
    time_us = (1e6 * (10.0 + t_s)).astype(np.uint64)
    wave = np.sin(0.3 * t_s)
    airspeed = 15.0 + 3.0 * wave

    def kind(name: str, codes: str, **columns: np.ndarray) -> DataflashMessages:
        return DataflashMessages(name, codes, {"TimeUS": time_us, **columns})

    return [
        DataflashMessages("MSG", "QZ", {"TimeUS": time_us[:1], "Message": np.array([firmware.encode()])}),
        DataflashMessages("PARM", "QNf", {"TimeUS": time_us[:1], "Name": np.array([b"ARSPD_RATIO"]),
                                          "Value": np.array([1.9])}),
        kind("ARSP", "Qffc", Airspeed=airspeed, DiffPress=airspeed**2 / 1.9, Temp=0 * t_s + 12.5),
        kind("BARO", "Qfc", Press=1e5 - 300 * wave, Temp=0 * t_s + 31.0),
        kind("BAT", "QBff", Inst=0 * t_s, Volt=15.2 - 0.3 * wave, Curr=12.0 + 5.0 * wave),
        kind("IMU", "Qfff", AccX=0.5 * wave, AccY=0.1 * wave, AccZ=-9.8 + wave),
        kind("CTUN", "Qf", ThO=50 + 40 * wave),
        kind("RPM", "Qf", RPM=6000 + 600 * wave),
        kind("GPS", "QBfff", Status=0 * t_s + 3, Spd=14 + wave, GCrs=90 + 40 * wave, VZ=0.5 * wave),
    ]  # fmt: skip


def read(folder: Path, suffix: str, kinds: list[DataflashMessages]) -> FlightRecording:
    path = folder / f"flight{suffix}"
    SUFFIXES[suffix](path, kinds)
    assert autopilot_of(path) is Autopilot.ARDUPILOT
    return read_ardupilot(path)


@pytest.fixture
def dataflash_recording(tmp_path: Path) -> FlightRecording:
    return read(tmp_path, ".BIN", flight())


def test_the_text_of_a_log_has_its_channels(tmp_path: Path, dataflash_recording: FlightRecording) -> None:
    text = read(tmp_path, ".log", flight())
    assert text.channels.keys() == dataflash_recording.channels.keys() and text.parameters == pytest.approx(
        {"ARSPD_RATIO": 1.9}
    )
    for name, channel in dataflash_recording.channels.items():
        assert text.channels[name].t_s == pytest.approx(channel.t_s, abs=1e-9)
        assert text.channels[name].value == pytest.approx(channel.value, rel=1e-5, abs=1e-5), name


def test_telemetry_has_the_channels_in_its_own_steps(tmp_path: Path, dataflash_recording: FlightRecording) -> None:
    heard = read(tmp_path, ".tlog", flight())
    assert heard.channels.keys() == dataflash_recording.channels.keys()
    for name, step in STEPS.items():
        channel, other = dataflash_recording.channels[name], heard.channels[name]
        assert np.diff(other.t_s) == pytest.approx(np.diff(channel.t_s), abs=1e-6)
        assert other.value == pytest.approx(channel.value, abs=step), name
    assert heard.parameters == pytest.approx({"ARSPD_RATIO": 1.9})
    assert heard.thermometers["ARSP 0"].value == pytest.approx(12.5 + 273.15)


def test_without_differential_pressure_the_airspeed_shown_is_no_sensors(tmp_path: Path) -> None:
    kinds = [item for item in flight() if item.name != "ARSP"]
    assert recording.AIRSPEED_PRESSURE not in read(tmp_path, ".tlog", kinds).channels


def test_multicopters_are_refused_in_text_too(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="multicopter"):
        read(tmp_path, ".log", flight("ArduCopter V4.5.7"))


@pytest.mark.parametrize("suffix", [".log", ".tlog"])
def test_altered_files_give_a_recording_or_one_line(tmp_path: Path, suffix: str) -> None:
    path, rng = tmp_path / f"flight{suffix}", np.random.default_rng(0)
    SUFFIXES[suffix](path, flight())
    data = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    for _ in range(20):
        altered = data[: rng.integers(100, len(data))].copy()
        altered[rng.integers(9, len(altered), 30)] = rng.integers(0, 256, 30)
        path.write_bytes(altered.tobytes())
        try:
            read_ardupilot(path)
        except InputError as error:
            assert "\n" not in str(error)


def test_a_damaged_frame_costs_one_message(tmp_path: Path) -> None:
    path = tmp_path / "flight.tlog"
    write_telemetry(path, flight())
    data = bytearray(path.read_bytes())
    complete = len(TelemetryLog(bytes(data)).columns("IMU")["TimeUS"])
    offset = data.index(b"\xfd", len(data) // 2)
    data[offset + 12] ^= 0xFF
    log = TelemetryLog(bytes(data))
    assert complete == 600 and complete - len(log.columns("IMU")["TimeUS"]) in (0, 1)


@pytest.mark.parametrize("cells_V", [None, 3.7])
def test_a_voltage_that_only_the_system_s_status_tells_is_taken_from_it(cells_V: float | None) -> None:
    """Each second there are messages of a second battery without voltage and of the first, with four cells or none."""
    encoder = mavlink.MAVLink(None)
    encoder.srcComponent = mavlink.MAV_COMP_ID_AUTOPILOT1
    frames = []
    for second in range(30):
        messages = [
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_FIXED_WING, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA, 0, 0, mavlink.MAV_STATE_ACTIVE, 3
            ),
            mavlink.MAVLink_sys_status_message(0, 0, 0, 500, 15_000 - 10 * second, 1234, -1, 0, 0, 0, 0, 0, 0),
            *(
                mavlink.MAVLink_battery_status_message(
                    i, 0, 0, 32767, [round(1e3 * cells_V)] * 4 + [65535] * 6 if cells_V and i == 0 else [65535] * 10,
                    1200, -1, -1, -1,
                )
                for i in (0, 1)
            ),
        ]  # fmt: skip
        at_us = (1_700_000_000_000_000 + 1_000_000 * second).to_bytes(8, "big")
        frames += [at_us + message.pack(encoder) for message in messages]
    battery = TelemetryLog(b"".join(frames)).columns("BAT")
    first = battery["Inst"] == 0
    expected = np.full(30, 14.8) if cells_V else 15.0 - 0.01 * np.arange(30)
    assert battery["Volt"][first] == pytest.approx(expected) and np.all(battery["Curr"] == pytest.approx(12.0))
    assert np.isnan(battery["Volt"][~first]).all()


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_log_in_gzip_has_the_channels_of_the_log(tmp_path: Path, suffix: str) -> None:
    plain = read(tmp_path, suffix, flight())
    packed = tmp_path / f"flight{suffix}.gz"
    packed.write_bytes(gzip.compress(plain.path.read_bytes()))
    recording = read_ardupilot(packed)
    assert recording.path == packed and recording.channels.keys() == plain.channels.keys()
    for name, channel in plain.channels.items():
        np.testing.assert_array_equal(recording.channels[name], channel)
    packed.write_bytes(packed.read_bytes()[:-2000])
    with pytest.raises(InputError, match=rf"{packed.name}: cannot be unpacked .*: copy or download it again"):
        read_ardupilot(packed)


def test_what_unpacks_to_more_than_a_log_has_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flightpower.flight.log_chunk.ALLOWED_BYTES", 0)
    path = tmp_path / "flight.BIN.gz"
    path.write_bytes(gzip.compress(b"\xa3\x95\x80\x80\x59FMT" + bytes(1 << 20)))
    with pytest.raises(InputError, match=r"flight\.BIN\.gz: unpacks to more than any log holds"):
        read_ardupilot(path)


def test_a_damaged_multiplier_is_left_out(tmp_path: Path) -> None:
    """A factor of 1e300 on the voltage, a whole number, overflowed with a warning from NumPy."""
    kinds = [item for item in flight() if item.name != "BAT"]
    time_us = kinds[2].columns["TimeUS"]
    complete = {"Volt": np.full(600, 1200.0), "Curr": np.full(600, 500.0)}
    path = tmp_path / "flight.BIN"
    write_dataflash(
        path, [*kinds, DataflashMessages("BAT", "QBHH", {"TimeUS": time_us, "Inst": 0 * time_us, **complete})]
    )
    log = path.read_bytes().replace(b"F---\0", b"F-BB\0")  # FMTU then makes both hundredths
    path.write_bytes(log)
    assert np.median(read_ardupilot(path).channels[recording.VOLTAGE].value) == pytest.approx(12.0)
    hundredth, huge = (np.float64(x).tobytes() for x in (0.01, 1e300))
    assert log.count(hundredth) == 1
    path.write_bytes(log.replace(hundredth, huge))
    assert recording.STATIC in read_ardupilot(path).channels


def test_a_term_named_like_an_instance_is_none(tmp_path: Path) -> None:
    """The integral of a controller is logged as I, as is the number of a sensor; places are shown in degrees."""
    t_us = (1e6 * (10.0 + np.arange(0.0, 60.0, 0.1))).astype(np.uint64)
    integral = np.linspace(0.0, 2.0, 600)
    controller = DataflashMessages("PIDR", "Qff", {"TimeUS": t_us, "Tar": 2 * integral, "I": integral})
    place = DataflashMessages("POS", "QLL", {"TimeUS": t_us, "Lat": integral * 0 + 48.1234567, "Lng": integral})
    path = tmp_path / "flight.BIN"
    write_dataflash(path, [*flight(), controller, place])
    channels = all_channels(path)
    assert [name for name in channels if name.startswith("PIDR")] == ["PIDR.TimeUS", "PIDR.Tar", "PIDR.I"]
    np.testing.assert_allclose(channels["PIDR.I"]().value, integral, rtol=1e-6)
    assert channels["POS.Lat"]().value[0] == pytest.approx(48.1234567) and channels["POS.Lng"]().value[
        -1
    ] == pytest.approx(2.0)


def test_px4_s_message_of_all_sensors_stands_in_for_pressure_and_acceleration() -> None:
    """Celsius becomes hundredths and m/s^2 thousandths of g, as in the messages that it replaces."""
    item = np.ones(2)
    names = ("abs_pressure", "diff_pressure", "temperature", "xacc", "yacc", "zacc")
    tables = {"HIGHRES_IMU": {"TimeUS": item} | {name: (i + 1) * item for i, name in enumerate(names)}}
    _complete(tables)
    pressure, force = tables["SCALED_PRESSURE"], tables["RAW_IMU"]
    assert (pressure["press_abs"][0], pressure["press_diff"][0], pressure["temperature"][0]) == (1.0, 2.0, 300.0)
    assert [force[f"{axis}acc"][0] * 9.80665 / 1000 for axis in "xyz"] == pytest.approx([4.0, 5.0, 6.0])
