"""What ArduPilot marks in its messages: the sensor in use, no thermometer, units of old versions."""

from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.sim import dataflash_writer
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash
from tests.analysis.sources.firmware import firmware

T_US = 20_000 * np.arange(2000)
CELSIUS = 273.15


def messages(name: str, codes: str, **columns: np.ndarray | float) -> DataflashMessages:
    arrays = {field: np.broadcast_to(np.asarray(values, dtype=float), len(T_US)) for field, values in columns.items()}
    return DataflashMessages(name, codes, {"TimeUS": T_US, **arrays})  # type: ignore[dict-item]


def airspeed(instance: int, speed: np.ndarray | float, **marks: np.ndarray | float) -> DataflashMessages:
    fields = {"I": instance, "Airspeed": speed, "DiffPress": 1.0, "Temp": 0.0, "U": 1.0, "H": 1.0, "Pri": 0.0, **marks}
    return messages("ARSP", "QBfffBBB", **fields)


BARO = messages("BARO", "QBff", I=0, Press=95_000.0, Temp=20.0 + 0.001 * np.arange(len(T_US)))
BATTERY = messages("BAT", "QBff", Inst=0, Volt=12.0, Curr=5.0)


def speed_of(path: Path, *kinds: DataflashMessages) -> np.ndarray:
    write_dataflash(path, [firmware(), *kinds, BARO, BATTERY])
    channel = read_ardupilot(path).channels[recording.AIRSPEED_PRESSURE]
    return np.sqrt(2 * channel.value / 1.225)


def test_airspeed_is_that_of_the_sensor_in_use_and_follows_a_switch(tmp_path: Path) -> None:
    wild = 15.0 + 4.0 * np.sin(1e-6 * T_US)  # varies most, but is not in use
    primary = 15.0 + 0.5 * np.sin(1e-6 * T_US)
    assert speed_of(tmp_path / "a", airspeed(0, primary), airspeed(1, wild, U=0.0)) == pytest.approx(primary, rel=1e-5)
    second = 16.0 + 0 * primary
    later = (T_US > 20_000_000).astype(float)
    switched = speed_of(tmp_path / "b", airspeed(0, primary, Pri=later), airspeed(1, second, Pri=later))
    assert switched == pytest.approx(np.where(later, second, primary), rel=1e-5)
    failed = np.where(later, 0.0, 1.0)
    healthy = speed_of(tmp_path / "c", airspeed(0, primary, H=failed))
    assert len(healthy) == (failed == 1).sum()


def test_a_sensor_that_is_never_used_is_better_than_none(tmp_path: Path) -> None:
    speed = 15.0 + 0.5 * np.sin(1e-6 * T_US)
    assert speed_of(tmp_path / "a", airspeed(0, speed, U=0.0)) == pytest.approx(speed, rel=1e-5)
    assert any("used no airspeed sensor" in note for note in read_ardupilot(tmp_path / "a").notes)


def test_exactly_zero_degrees_throughout_is_no_thermometer(tmp_path: Path) -> None:
    speed_of(tmp_path / "a", airspeed(0, 15.0 + 0.5 * np.sin(1e-6 * T_US)))
    read = read_ardupilot(tmp_path / "a")
    assert set(read.thermometers) == {"BARO 0"} == set(read.inside)


def test_the_ground_temperature_that_the_user_set_is_one(tmp_path: Path) -> None:
    setting = DataflashMessages(
        "PARM", "QNf", {"TimeUS": np.zeros(1), "Name": np.array([b"BARO_GND_TEMP"]), "Value": np.array([12.0])}
    )
    speed_of(tmp_path / "a", airspeed(0, 15.0 + 0.5 * np.sin(1e-6 * T_US)), setting)
    shown = read_ardupilot(tmp_path / "a").thermometers["BARO_GND_TEMP"]
    assert shown.value == pytest.approx(12.0 + CELSIUS)


def test_a_kind_has_number_0(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(dataflash_writer, "FIRST_TYPE", 0)
    speed = 15.0 + 0.5 * np.sin(1e-6 * T_US)
    assert speed_of(tmp_path / "a", airspeed(0, speed)) == pytest.approx(speed, rel=1e-5)


def test_the_truth_of_a_simulation_is_apart_from_what_was_measured(tmp_path: Path) -> None:
    speed = 15.0 + 0.5 * np.sin(1e-6 * T_US)
    truth = messages("SIM2", "Qf", As=99.0)
    assert speed_of(tmp_path / "a", airspeed(0, speed), truth) == pytest.approx(speed, rel=1e-5)
    assert read_ardupilot(tmp_path / "a").truth[recording.TRUE_AIRSPEED].value == pytest.approx(99.0)


def test_dropped_messages_are_reported(tmp_path: Path) -> None:
    dropped = messages("DSF", "Qf", Dp=np.minimum(np.arange(len(T_US)), 70))
    speed_of(tmp_path / "a", airspeed(0, 15.0 + 0.5 * np.sin(1e-6 * T_US)), dropped)
    assert "The autopilot dropped 70 messages." in read_ardupilot(tmp_path / "a").notes
