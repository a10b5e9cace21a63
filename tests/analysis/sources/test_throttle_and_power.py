"""Throttle, mode and propulsion power, from whichever message of a firmware has them."""

from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.sources import px4, recording
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.sim.dataflash_writer import DataflashMessages, write_dataflash, write_text
from tests.analysis.sources.firmware import firmware

T_US = 100_000 * np.arange(1, 2001)
T_S = 1e-6 * T_US
THROTTLE = np.clip(0.5 + 0.6 * np.sin(0.1 * T_S), 0.0, 1.0)
WAVE = np.sin(0.3 * T_S)


def kind(name: str, codes: str, **columns: np.ndarray) -> DataflashMessages:
    return DataflashMessages(name, codes, {"TimeUS": T_US, **columns})


ARSP = kind("ARSP", "Qff", Airspeed=15 + WAVE, DiffPress=(15 + WAVE) ** 2 / 2)
BARO = kind("BARO", "Qf", Press=95_000 + 30 * WAVE)
BAT = kind("BAT", "Qff", Volt=15 + 0 * WAVE, Curr=10 * THROTTLE)


def settings(**values: float) -> DataflashMessages:
    named = {"Name": np.array([name.encode() for name in values]), "Value": np.array([*values.values()])}
    return DataflashMessages("PARM", "QNf", {"TimeUS": np.zeros(len(values)), **named})


def read(folder: Path, *kinds: DataflashMessages) -> FlightRecording:
    write_dataflash(folder / "log.BIN", [firmware(), ARSP, BARO, *kinds])
    return read_ardupilot(folder / "log.BIN")


@pytest.mark.parametrize(
    "kinds",
    [
        [kind("CTUN", "Qf", ThO=100 * THROTTLE), kind("AETR", "Qf", Thr=0 * THROTTLE)],
        [kind("CTUN", "Qh", ThrOut=np.round(100 * THROTTLE))],  # before 2016
        [kind("AETR", "Qf", Thr=100 * THROTTLE)],
        [
            kind("RCOU", "QHH", C1=0 * T_S + 1500, C5=np.round(1900 - 800 * THROTTLE)),
            settings(SERVO5_FUNCTION=70, SERVO5_MIN=1100, SERVO5_MAX=1900, SERVO5_REVERSED=1),
        ],
        [kind("RCOU", "QH", Chan3=np.round(1000 + 1000 * THROTTLE)), settings(RC3_MIN=1000, RC3_MAX=2000)],
    ],
)
def test_throttle_is_that_of_the_propulsion(tmp_path: Path, kinds: list[DataflashMessages]) -> None:
    assert read(tmp_path, BAT, *kinds).channels[recording.THROTTLE].value == pytest.approx(THROTTLE, abs=0.006)


def test_px4_throttle_is_that_of_the_wing() -> None:
    def topic(**fields: np.ndarray) -> list[px4._Topic]:
        return [px4._Topic({"timestamp": 1e6 * T_S, **fields}, 0)]

    older = {
        "actuator_controls_0": topic(**{"control[3]": 0 * T_S}),
        "actuator_controls_1": topic(**{"control[3]": T_S}),
    }
    vtol = {"vehicle_status": topic(is_vtol=np.ones(len(T_S)))}
    assert px4._throttles(older)[0].value.max() == 0 and px4._throttles(older | vtol)[0].value.max() == T_S[-1]
    newer = {"vehicle_thrust_setpoint": topic(**{"xyz[0]": THROTTLE})}
    assert px4._throttles(older | newer)[0].value == pytest.approx(THROTTLE)


def test_modes_on_lifting_motors_are_left_out(tmp_path: Path) -> None:
    """The log has QLOITER from 50 to 90 s, LOITER_ALT_QLAND, which flies on the wing, after 150 s, and no QTUN."""
    changes_us = np.array([1, 50, 90, 150]) * 1_000_000
    modes = DataflashMessages("MODE", "QMB", {"TimeUS": changes_us, "Mode": np.array([10, 19, 10, 25]),
                                              "ModeNum": np.array([10, 19, 10, 25])})  # fmt: skip
    left = read(tmp_path, BAT, modes).channels[recording.AIRSPEED_PRESSURE].t_s
    assert not ((left > 49.1) & (left < 90.8)).any() and left[0] < 0.2 and left[-1] > 199.0
    assert ((left > 48) & (left < 49)).any() and ((left > 91.1) & (left < 92)).any()


def test_power_of_the_speed_controllers_counts_where_no_battery_measures_current(tmp_path: Path) -> None:
    controller = kind("ESC", "QBfff", Instance=0 * T_S, Volt=15 + 0 * T_S, Curr=9 * THROTTLE, RPM=0 * T_S)
    second = kind("ESC", "QBfff", Instance=0 * T_S + 1, Volt=15 + 0 * T_S, Curr=6 * THROTTLE, RPM=0 * T_S)
    dead = kind("BAT", "Qff", Volt=15 + 0 * T_S, Curr=0 * T_S)
    assert read(tmp_path, dead, controller, second).channels[recording.CURRENT].value == pytest.approx(15 * THROTTLE)
    assert read(tmp_path, BAT, controller).channels[recording.CURRENT].value == pytest.approx(10 * THROTTLE)
    filled_in = kind("ESC", "QBff", Instance=0 * T_S, Volt=16.8 + 0 * T_S, Curr=0.8 + 0 * T_S)
    assert recording.CURRENT not in read(tmp_path, dead, filled_in).channels


@pytest.mark.parametrize("suffix", [".BIN", ".log"])
def test_whole_numbers_are_in_the_units_that_the_log_gives(tmp_path: Path, suffix: str) -> None:
    """Voltage is in mV and current in cA, as the log's FMTU says; without it they would be read as hundredths."""
    start = np.array([100_000])
    texts = {
        "FMTU": ("QBNN", {"FmtType": np.array([133]), "UnitIds": np.array([b"svA"]), "MultIds": np.array([b"FCB"])}),
        "MULT": ("Qbd", {"Id": np.array([ord("F"), ord("C"), ord("B")]), "Mult": np.array([1e-6, 1e-3, 1e-2])}),
    }
    kinds = [DataflashMessages(name, codes, {"TimeUS": np.repeat(start, len(columns[next(iter(columns))])), **columns})
             for name, (codes, columns) in texts.items()]  # fmt: skip
    bat = kind("BAT", "QHH", Volt=np.full(len(T_S), 15_000.0), Curr=np.round(1000 * THROTTLE))
    path = tmp_path / f"log{suffix}"
    {".BIN": _without_own_units, ".log": write_text}[suffix](path, [kinds[0], kinds[1], ARSP, BARO, bat, firmware()])
    channels = read_ardupilot(path).channels
    assert channels[recording.VOLTAGE].value == pytest.approx(15.0)
    assert channels[recording.CURRENT].value == pytest.approx(10 * THROTTLE, abs=0.006)


@pytest.mark.parametrize(
    ("name", "codes", "columns"),
    [
        ("FMTU", "QB", {"FmtType": np.array([132])}),
        ("FMTU", "QBf", {"FmtType": np.array([132]), "MultIds": np.array([1.0])}),
        ("MULT", "QN", {"Mult": np.array([b"0.01"])}),
        ("PARM", "QfN", {"Name": np.array([1.0]), "Value": np.array([b"text"])}),
        ("DSF", "QN", {"Dp": np.array([b"many"])}),
        ("DSF", "Qf", {"Dp": np.array([np.nan])}),
    ],
)
def test_definitions_that_damage_altered_are_passed_over(
    tmp_path: Path, name: str, codes: str, columns: dict[str, np.ndarray]
) -> None:
    bat = kind("BAT", "QHH", Volt=np.full(len(T_S), 15.0), Curr=np.round(10 * THROTTLE))
    damaged = DataflashMessages(name, codes, {"TimeUS": np.array([100_000]), **columns})
    _without_own_units(tmp_path / "log.BIN", [damaged, ARSP, BARO, bat, firmware()])
    assert len(read_ardupilot(tmp_path / "log.BIN").channels[recording.AIRSPEED_PRESSURE].t_s) == len(T_S)


def _without_own_units(path: Path, kinds: list[DataflashMessages]) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("flightpower.sim.dataflash_writer._units", lambda kinds, types: [])
        write_dataflash(path, kinds)
