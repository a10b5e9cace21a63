"""Only a log that identifies a plane gives a curve; PX4's telemetry and converted logs are read like others."""

from pathlib import Path

import numpy as np
import pytest
from pymavlink import DFReader
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scipy.io import savemat

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.open import open_source
from flightpower.analysis.sources.recognize import Autopilot, autopilot_of
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash, write_text
from tests.analysis.sources.firmware import firmware
from tests.analysis.sources.test_ground_station_files import flight

MEASURED = [item for item in flight() if item.name not in ("MSG", "PARM")]


def parameters(**values: float) -> DataflashMessages:
    names = {"Name": np.array([name.encode() for name in values]), "Value": np.array([*values.values()])}
    return DataflashMessages("PARM", "QNf", {"TimeUS": np.zeros(len(values)), **names})


def version(text: str) -> DataflashMessages:
    return DataflashMessages("VER", "QZ", {"TimeUS": np.zeros(1), "FWS": np.array([text.encode()])})


@pytest.mark.parametrize("write", [write_dataflash, write_text])
@pytest.mark.parametrize(
    "messages",
    [
        [],
        [firmware("System.Byte[]"), firmware("System.Byte[]")],
        [firmware("GPS 1: detected u-blox"), parameters(ARSPD_RATIO=2.0, BATT_MONITOR=4.0, MOT_THST_HOVER=0.3)],
    ],
    ids=["nothing", "garbled texts", "of a copter alone"],
)
def test_a_vehicle_that_is_not_known_gives_no_curve(messages: list[DataflashMessages], write, tmp_path: Path) -> None:
    write(tmp_path / "log", [*messages, *MEASURED])
    with pytest.raises(InputError, match="does not say which vehicle"):
        read_ardupilot(tmp_path / "log")


@pytest.mark.parametrize(
    "messages",
    [
        [firmware()],
        [firmware("System.Byte[]"), version("ArduPlane V4.6.0 (1a2b3c4d)")],
        [firmware("APM:Plane 3.9.9")],
        [parameters(TECS_CLMB_MAX=5.0)],
        [DataflashMessages("TECS", "Qf", {"TimeUS": np.arange(30) * 1e5, "h": np.zeros(30)})],
    ],
    ids=["text", "version", "old text", "parameter", "message of its controller"],
)
def test_a_plane_is_known_by_any_of_its_marks(messages: list[DataflashMessages], tmp_path: Path) -> None:
    write_dataflash(tmp_path / "log", [*messages, *MEASURED])
    assert recording.VOLTAGE in read_ardupilot(tmp_path / "log").channels


def test_a_copter_is_known_by_its_version_alone(tmp_path: Path) -> None:
    write_dataflash(tmp_path / "log", [version("ArduCopter V4.6.0"), *MEASURED])
    with pytest.raises(InputError, match="multicopter"):
        read_ardupilot(tmp_path / "log")


PRESSURE_PA, SPEED_MPS = 96_000.0, 15.0


def px4_telemetry(kind: int, seconds: int = 40, lifted_s: int = 0) -> bytes:
    """Heartbeats of a station before the autopilot's, a gimbal beside it, and fourteen cells in two fields."""
    encoders = {sender: mavlink.MAVLink(None, *sender) for sender in ((255, 190), (1, 154), (1, 1))}
    lifted, flown = mavlink.MAV_VTOL_STATE_MC, mavlink.MAV_VTOL_STATE_FW
    frames = []
    for i in range(5 * seconds):
        wave = np.sin(0.3 * i / 5)
        sent = [
            ((255, 190), mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, 8, 0, 0, 4, 3)),
            ((1, 154), mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GIMBAL, 8, 0, 0, 4, 3)),
            ((1, 1), mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_PX4, 0, 0x40000, 4, 3)),
            ((1, 1), mavlink.MAVLink_highres_imu_message(
                i, 0.5, 0.1, -g + wave, 0, 0, 0, 0, 0, 0, PRESSURE_PA / 100, 1.4, 300.0, 25.0, 0xFFFF)),
            ((1, 1), mavlink.MAVLink_vfr_hud_message(SPEED_MPS + wave, 14.0, 90, 55, 300.0, 0.0)),
            ((1, 1), mavlink.MAVLink_battery_status_message(
                0, 0, 0, 2500, [3700] * 10, 1200 + round(500 * wave), -1, -1, 60, 0, 1, [3700, 3700, 0, 0])),
            ((1, 1), mavlink.MAVLink_extended_sys_state_message(lifted if i < 5 * lifted_s else flown, 0)),
            ((1, 1), mavlink.MAVLink_param_value_message(
                b"SYS_AUTOSTART", float(np.int32(2100).view(np.float32)), mavlink.MAV_PARAM_TYPE_INT32, 2, 0)),
            ((1, 1), mavlink.MAVLink_param_value_message(
                b"FW_AIRSPD_TRIM", 15.5, mavlink.MAV_PARAM_TYPE_REAL32, 2, 1)),
        ]  # fmt: skip
        at_us = 1_700_000_000_000_000 + 200_000 * i
        frames += [at_us.to_bytes(8, "big") + bytes(item.pack(encoders[sender])) for sender, item in sent]
    return b"".join(frames)


def test_telemetry_of_px4_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.tlog").write_bytes(px4_telemetry(mavlink.MAV_TYPE_FIXED_WING))
    ardupilot = read_ardupilot(tmp_path / "a.tlog")
    mean = {name: float(np.mean(channel.value)) for name, channel in ardupilot.channels.items()}
    assert mean[recording.STATIC] == pytest.approx(PRESSURE_PA, rel=1e-6)
    assert mean[recording.VOLTAGE] == pytest.approx(12 * 3.7) and mean[recording.CURRENT] == pytest.approx(
        12.0, abs=0.5
    )
    assert mean[recording.FORCE_Z] == pytest.approx(-g, abs=0.1) and mean[recording.FORCE_X] == pytest.approx(0.5)
    speed = np.sqrt(2 * ardupilot.channels[recording.AIRSPEED_PRESSURE].value / 1.225)
    assert np.mean(speed) == pytest.approx(SPEED_MPS, abs=0.2) and np.ptp(speed) == pytest.approx(2.0, abs=0.1)
    assert ardupilot.parameters == {"SYS_AUTOSTART": 2100.0, "FW_AIRSPD_TRIM": 15.5}


def test_a_copter_of_px4_is_refused_by_its_telemetry(tmp_path: Path) -> None:
    (tmp_path / "a.tlog").write_bytes(px4_telemetry(mavlink.MAV_TYPE_QUADROTOR))
    with pytest.raises(InputError, match="multicopter"):
        read_ardupilot(tmp_path / "a.tlog")


def test_hover_of_a_vtol_of_px4_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "a.tlog").write_bytes(px4_telemetry(mavlink.MAV_TYPE_VTOL_TILTROTOR, lifted_s=15))
    ardupilot = read_ardupilot(tmp_path / "a.tlog")
    t_s = ardupilot.channels[recording.AIRSPEED_PRESSURE].t_s
    assert t_s[0] - ardupilot.channels[recording.STATIC].t_s[0] == pytest.approx(15.8, abs=0.5)


def by_pymavlink(path: Path) -> dict[str, dict[str, list[object]]]:
    """The messages of a log by field, as pymavlink reads them."""
    reader, result = DFReader.DFReader_binary(str(path)), dict[str, dict[str, list[object]]]()
    while (message := reader.recv_match()) is not None:
        columns = result.setdefault(message.get_type(), {})
        for field in message.get_fieldnames():
            columns.setdefault(field, []).append(getattr(message, field))
    return result


def as_structures(messages: dict[str, dict[str, list[object]]]) -> dict[str, object]:
    return {name: columns for name, columns in messages.items() if name != "FMT"}


def as_labeled_matrices(messages: dict[str, dict[str, list[object]]]) -> dict[str, object]:
    made: dict[str, object] = {}
    for name, columns in messages.items():
        if name == "PARM":
            pairs = list(zip(columns["Name"], columns["Value"], strict=True))
            made[name] = np.empty((len(pairs), 2), dtype=object)
            made[name][:] = pairs  # type: ignore[index]
        elif name not in ("FMT", "MSG", "FMTU", "MULT", "UNIT"):
            values = np.array([columns[field] for field in columns], dtype=float).T
            made[name] = np.column_stack([np.arange(len(values)), values])
            made[f"{name}_label"] = np.array(["LineNo", *columns], dtype=object)
    return made


@pytest.mark.parametrize("converted", [as_structures, as_labeled_matrices])
def test_a_log_converted_for_matlab_has_the_channels_of_the_log(
    converted, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "flightpower.sim.dataflash_writer._units", lambda kinds, types: []
    )  # pymavlink stumbles over them first
    bat = next(item for item in MEASURED if item.name == "BAT")
    second = DataflashMessages(
        "BAT", bat.codes, bat.columns | {"Inst": bat.columns["Inst"] + 1, "Curr": bat.columns["Curr"] / 50}
    )
    kinds = [*MEASURED, second, parameters(TECS_CLMB_MAX=5.0, ARSPD_RATIO=1.9), firmware()]
    write_dataflash(tmp_path / "log.BIN", kinds)
    savemat(tmp_path / "log.mat", converted(by_pymavlink(tmp_path / "log.BIN")))
    assert autopilot_of(tmp_path / "log.mat") is Autopilot.ARDUPILOT
    expected, result = (open_source(tmp_path / name) for name in ("log.BIN", "log.mat"))
    assert isinstance(expected, FlightRecording) and isinstance(result, FlightRecording)
    assert result.channels.keys() == expected.channels.keys()
    for name, channel in expected.channels.items():
        assert result.channels[name].t_s == pytest.approx(channel.t_s)
        assert result.channels[name].value == pytest.approx(channel.value, rel=1e-6), name
    assert result.parameters == pytest.approx(expected.parameters)


def test_a_structure_of_other_fields_is_a_table_and_no_log(tmp_path: Path) -> None:
    savemat(tmp_path / "a.mat", {"GPS": {"time": np.arange(50.0), "v": np.arange(50.0)}})
    assert autopilot_of(tmp_path / "a.mat") is None


@pytest.mark.filterwarnings("error")
def test_a_number_that_no_quantity_has_is_damage(tmp_path: Path) -> None:
    t_us = 1e5 * np.arange(1.0, 61.0)
    true = 15.0 + np.sin(1e-6 * t_us)
    speed = np.where(t_us == t_us[30], 1e300, true)
    parts = {"ARSP": np.column_stack([t_us, speed]), "ARSP_label": np.array(["TimeUS", "Airspeed"], dtype=object)}
    only = np.array([["TECS_CLMB_MAX", 5.0]], dtype=object)
    savemat(tmp_path / "log.mat", parts | {"PARM": only})
    ardupilot = read_ardupilot(tmp_path / "log.mat")
    pressure = ardupilot.channels[recording.AIRSPEED_PRESSURE]
    assert pressure.value == pytest.approx(1.225 / 2 * np.delete(true, 30) ** 2)
    assert ardupilot.parameters == {"TECS_CLMB_MAX": 5.0}


@pytest.mark.filterwarnings("error")
def test_the_number_of_a_mode_that_damage_made_is_left_out() -> None:
    modes = recording.modes([0.0, 1.0, 2.0, 3.0], [10.0, 1e20, np.nan, 11.0], {10: "AUTO", 11: "RTL"})
    assert [mode.text for mode in modes] == ["AUTO", "RTL"]
