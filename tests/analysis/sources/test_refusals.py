"""What cannot be analyzed is refused in one line, and damaged files never end in a traceback."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from flightpower.analysis.cli.analyze import app
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.options import Options
from flightpower.analysis.pipeline.whole_flight import analyze_recording
from flightpower.analysis.sources.px4 import read_px4
from flightpower.analysis.sources.recognize import Autopilot, autopilot_of
from flightpower.flight.errors import InputError
from flightpower.sim.ulog_writer import UlogContents, UlogTopic, write_ulog
from tests.shared_data import beside, needs

SHARED = beside("pixhawk")
WEIGHT_N, WING_AREA_M2 = 92.2, 1.499


def topic(name: str, columns: dict[str, np.ndarray], instance: int = 0) -> UlogTopic:
    n = len(next(iter(columns.values())))
    return UlogTopic(name, (1_000_000 + 200_000 * np.arange(n)).astype(np.uint64), columns, instance)


def status(kind: int, mav: int) -> UlogTopic:
    return topic(
        "vehicle_status", {"vehicle_type": np.full(100, kind, np.uint8), "system_type": np.full(100, mav, np.uint8)}
    )


def floats(value: float, n: int = 1000) -> np.ndarray:
    return np.full(n, value, dtype=np.float32) + np.random.default_rng(1).normal(0, 0.01, n).astype(np.float32)


AIRSPEED = topic("airspeed_validated", {"indicated_airspeed_m_s": floats(1.0)})
BARO = topic("vehicle_air_data", {"baro_pressure_pa": floats(1e5)})
CLIMB = topic("vehicle_air_data", {"baro_pressure_pa": floats(1e5) - np.linspace(0, 1000, 1000, dtype=np.float32)})
BATTERY = topic("battery_status", {"voltage_v": floats(15.0), "current_a": floats(1.0)})


@pytest.mark.parametrize(
    ("topics", "reason"),
    [
        ([status(1, 2)], "multicopter"),
        ([status(3, 10)], "rover"),
        ([status(2, 1), BARO, BATTERY], "lacks airspeed"),
        ([status(2, 1), AIRSPEED, BATTERY], "lacks static pressure"),
        ([status(2, 1), AIRSPEED, BARO], "lacks battery"),
        ([status(2, 1)], "airspeed.*static pressure.*battery"),
        ([AIRSPEED, BARO, BATTERY], "does not say which vehicle"),
        ([status(2, 1), AIRSPEED, BARO, BATTERY], "for 0 s in the air; 60 s"),
    ],
)
def test_refused_in_one_line(tmp_path: Path, topics: list[UlogTopic], reason: str) -> None:
    path = tmp_path / "log.ulg"
    write_ulog(path, UlogContents(topics))
    with pytest.raises(InputError, match=reason) as raised:
        flight_table(read_px4(path), WEIGHT_N, WING_AREA_M2)
    assert "\n" not in str(raised.value)


def test_nobody_is_asked_to_measure_an_aircraft_for_a_log_without_a_curve(tmp_path: Path) -> None:
    path = tmp_path / "log.ulg"
    write_ulog(path, UlogContents([status(2, 1), AIRSPEED, BARO]))
    with pytest.raises(InputError, match="the log lacks battery"):
        analyze_recording(read_px4(path), Options(), lambda _: None)
    for height, refusal in ((BARO, "for 0 s in the air; 60 s"), (CLIMB, "--mass")):
        write_ulog(path, UlogContents([status(2, 1), AIRSPEED, height, BATTERY]))
        with pytest.raises(InputError, match=refusal):
            analyze_recording(read_px4(path), Options(), lambda _: None)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """A PX4 log with everything that is read, but without a flight."""
    path = tmp_path / "log.ulg"
    pressure = topic("differential_pressure", {"differential_pressure_pa": floats(0.0), "temperature": floats(12.0)})
    force = topic("vehicle_acceleration", {f"xyz[{i}]": floats(value) for i, value in enumerate((0.0, 0.0, -9.8))})
    write_ulog(path, UlogContents([status(2, 1), AIRSPEED, BARO, BATTERY, pressure, force]))
    return path


def test_the_format_is_that_of_the_first_bytes(tmp_path: Path, log: Path) -> None:
    assert autopilot_of(log) is Autopilot.PX4
    named_wrong = tmp_path / "log.mcap"
    named_wrong.write_bytes(b"\xa3\x95\x80\x80\x59")
    assert autopilot_of(named_wrong) is Autopilot.ARDUPILOT
    named_wrong.write_bytes(b"\x89MCAP0\r\n")
    assert autopilot_of(named_wrong) is None


def test_what_the_aircraft_is_must_be_given(tmp_path: Path) -> None:
    write_ulog(tmp_path / "log.ulg", UlogContents([status(2, 1), AIRSPEED, CLIMB, BATTERY]))
    done = CliRunner().invoke(app, [str(tmp_path / "log.ulg"), "--mass", "9.4 kg"])
    assert isinstance(done.exception, InputError) and '--wing-area "1.5 m^2"' in str(done.exception)


def test_options_of_the_daemons_logs_are_refused(tmp_path: Path, log: Path) -> None:
    options = ["--mass", "9.4", "--wing-area", "1.5", "--span", "4", "-o", str(tmp_path / "report")]
    done = CliRunner().invoke(app, [str(log), *options, "--probe", "probe.json"])
    assert isinstance(done.exception, InputError) and "--probe: has no effect" in str(done.exception)
    done = CliRunner().invoke(app, [str(log), *options, "--weight", "9 kg"])
    assert isinstance(done.exception, InputError) and "--mass and --weight" in str(done.exception)
    done = CliRunner().invoke(app, [str(log), *options, "--columns", "map.toml"])
    assert isinstance(done.exception, InputError) and "--columns: only for tables" in str(done.exception)
    done = CliRunner().invoke(app, [str(log), *options[:-3], "4 kg"])
    assert isinstance(done.exception, InputError) and "--span 4 kg" in str(done.exception)


@needs(SHARED)
@pytest.mark.parametrize("name, reason", [("multicopter.ulg", "multicopter"), ("arduplane-1s.BIN", "lacks airspeed")])
def test_real_logs_that_cannot_be_analyzed(name: str, reason: str) -> None:
    arguments = ["--mass", "2 kg", "--wing-area", "0.4 m^2", "--span", "1.8 m"]
    done = CliRunner().invoke(app, [str(SHARED / name), *arguments])
    assert isinstance(done.exception, InputError) and reason in str(done.exception)


def test_damaged_files_are_read_or_refused(tmp_path: Path, log: Path) -> None:
    data, rng, path = log.read_bytes(), np.random.default_rng(0), tmp_path / "damaged.ulg"
    for _ in range(12):
        damaged = bytearray(data[: int(rng.integers(1000, 60_000))])
        for offset in rng.integers(0, len(damaged), rng.integers(0, 20)):
            damaged[offset] = rng.integers(256)
        path.write_bytes(damaged)
        try:
            flight_table(read_px4(path), WEIGHT_N, WING_AREA_M2)
        except InputError as error:
            assert "\n" not in str(error)
