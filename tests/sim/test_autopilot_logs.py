"""A simulated flight as PX4 and ArduPilot log it: their rates, their messages, and what the sensors measured."""

from pathlib import Path

import numpy as np
import pytest
from pymavlink import DFReader
from pyulog import ULog
from typer.testing import CliRunner

from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.px4 import read_px4
from flightpower.analysis.sources.recording import CURRENT, VOLTAGE
from flightpower.flight.errors import InputError
from flightpower.sim.ardupilot_log import write_ardupilot_log
from flightpower.sim.px4_log import BOOT_US, RATES_HZ, write_px4_log
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget
from flightpower.sim.sensors.budget import of_installation
from flightpower.simulate import app


@pytest.fixture(scope="module")
def errors():
    return draw(load_budget("none"), 0)


@pytest.fixture(scope="module")
def px4(tmp_path_factory, flight, errors) -> ULog:
    path = tmp_path_factory.mktemp("px4") / "log.ulg"
    write_px4_log(path, flight, FlightSensorTruth(flight, errors), errors, ["wrong-battery-first", "landed"])
    return ULog(str(path))


def columns(log: ULog, name: str, instance: int = 0) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    data = log.get_dataset(name, instance).data
    return (data["timestamp"].astype(float) - BOOT_US) * 1e-6, data


def test_px4_logs_at_its_default_rates(px4: ULog, flight) -> None:
    assert not px4.file_corruption
    for name, rate_Hz in RATES_HZ.items():
        t_s, _ = columns(px4, name)
        assert len(t_s) == pytest.approx(rate_Hz * flight.duration_s, abs=2), name
        assert (np.diff(t_s) > 0).all()


def test_px4_shows_indicated_airspeed(px4: ULog, flight) -> None:
    t_s, data = columns(px4, "airspeed_validated")
    qbar = np.interp(
        t_s, flight.truth["time_s"], np.nan_to_num(flight.truth["dynamic_pressure_Pa"].to_numpy(dtype=float))
    )
    fast = qbar > 50
    assert 1.225 / 2 * data["indicated_airspeed_m_s"][fast] ** 2 == pytest.approx(qbar[fast], abs=8)


def test_px4_measures_raw_pressure_in_steps_from_an_offset(px4: ULog) -> None:
    _, data = columns(px4, "differential_pressure")
    assert np.unique(np.round(np.diff(np.unique(data["differential_pressure_pa"])) / 6.3, 3) % 1.0) == pytest.approx(0)
    assert data["differential_pressure_pa"][0] == pytest.approx(100, abs=10)


def test_traps(px4: ULog, flight) -> None:
    assert columns(px4, "vehicle_land_detected")[1]["landed"].all()
    assert not columns(px4, "battery_status")[1]["current_a"].any()
    _, battery = columns(px4, "battery_status", 1)
    energy_J = flight.truth["battery_energy_J"].iloc[-1]
    assert np.mean(battery["voltage_v"] * battery["current_a"]) * flight.duration_s == pytest.approx(energy_J, rel=0.05)


def test_ardupilot(tmp_path: Path, flight, errors) -> None:
    write_ardupilot_log(tmp_path / "log.BIN", flight, FlightSensorTruth(flight, errors), errors)
    reader = DFReader.DFReader_binary(str(tmp_path / "log.BIN"))
    force, first = [], None
    while (message := reader.recv_match(type=["IMU", "MSG"])) is not None:
        first = first or message
        if message.get_type() == "IMU":
            force.append(message.AccZ)
    assert first.Message.startswith("ArduPlane")
    assert len(force) == pytest.approx(25 * flight.duration_s, abs=2)
    assert np.mean(force[:50]) == pytest.approx(-9.8, abs=0.1)


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (["--as", "inav"], "give px4 or ardupilot or ardupilot-telemetry"),
        (["--log-faults", "landed"], "needs --as px4 or --as ardupilot"),
        (["--as", "px4", "--log-faults", "gremlins"], "known: landed"),
    ],
)
def test_unknown_recorders_and_faults_are_refused(tmp_path: Path, options: list[str], reason: str) -> None:
    done = CliRunner().invoke(app, ["fly", "-o", str(tmp_path), *options])
    assert isinstance(done.exception, InputError) and reason in str(done.exception)


@pytest.mark.parametrize("write", [write_px4_log, write_ardupilot_log])
def test_power_of_the_speed_controller_alone_is_that_of_the_battery(tmp_path: Path, flight, errors, write) -> None:
    path = tmp_path / "log"
    write(path, flight, FlightSensorTruth(flight, errors), errors, ["esc-power"])
    channels = {write_px4_log: read_px4, write_ardupilot_log: read_ardupilot}[write](path).channels
    t_s, current = channels[CURRENT]
    energy_J = np.trapezoid(current * np.interp(t_s, *channels[VOLTAGE]), t_s)
    assert energy_J == pytest.approx(flight.truth["battery_energy_J"].iloc[-1], rel=0.05)


@pytest.mark.parametrize(
    ("write", "read", "name", "faults"),
    [
        (write_px4_log, read_px4, "log.ulg", ()),
        (write_ardupilot_log, read_ardupilot, "log.BIN", ()),
        (write_ardupilot_log, read_ardupilot, "log.BIN", ("old-firmware",)),
        (write_ardupilot_log, read_ardupilot, "log.log", ()),
    ],
)
def test_the_board_that_logged_is_known_by_a_hash_of_its_number(
    tmp_path: Path, flight, errors, write, read, name, faults
) -> None:
    """The hash is equal in all flights of an installation, and differs between installations."""
    path, vehicles, another = tmp_path / name, [], draw(load_budget("none"), 1)
    for sensor_errors in (errors, of_installation(another, errors), another):
        write(path, flight, FlightSensorTruth(flight, sensor_errors), sensor_errors, faults)
        vehicles.append(read(path).vehicle)
    assert vehicles[0] == vehicles[1] != vehicles[2] and all(len(vehicle) == 8 for vehicle in vehicles)


def test_a_log_that_does_not_say_its_board_has_none(tmp_path: Path, flight, errors) -> None:
    path = tmp_path / "log.log"
    write_ardupilot_log(path, flight, FlightSensorTruth(flight, errors), errors)
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if "SimulatedBoard" not in line))
    assert read_ardupilot(path).vehicle == ""
