"""More data never give less: where a flight's table gives a curve, added columns make it no worse and no wider."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from flightpower.analysis.cli.analyze import app
from flightpower.analysis.sources.column_map import load_map, mapped_channels
from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.analysis.sources.table import as_log
from flightpower.analysis.sources.table_file import read_columns
from flightpower.flight.units import GRAVITY_MPS2 as g
from tests.analysis.added_sensors import Flown, Sensors, assert_more_is_never_less, curves_by_sensors
from tests.analysis.sources.flown_table import (
    AREA_M2,
    MAP,
    MASS_KG,
    SPAN_M,
    flown_table,
    level_power_W,
    map_text,
    written,
)

ALWAYS = ("time", "battery_voltage", "battery_current")
SENSORS = {
    "pitot": ("true_airspeed",),
    "GPS": ("velocity_north", "velocity_east", "velocity_down"),
    "barometer": ("static_pressure",),
    "IMU": tuple(name for name in MAP if name.startswith("specific_force") or name.endswith("_rate")),
    "motor": ("motor_speed", "throttle"),
}


@pytest.mark.thorough
@pytest.mark.slow
@pytest.mark.parametrize(
    ("sensors", "curves"),
    [
        pytest.param(("pitot", "GPS", "barometer", "motor"), 10, id="without IMU"),
        pytest.param(tuple(SENSORS), 16, id="all"),
    ],
)
def test_a_sensor_that_is_added_makes_no_curve_worse(sensors: tuple[str, ...], curves: int, tmp_path: Path) -> None:
    path = written(tmp_path, flown_table(), map_text())
    channels = mapped_channels(path, read_columns(path), load_map(path.with_name(f"{path.name}.columns.toml")))

    def recorded(sensors: Sensors) -> FlightRecording:
        names = {name for sensor in sensors for name in SENSORS[sensor]} | set(ALWAYS)
        return recording_of(
            as_log(path, {quantity: channel for quantity, channel in channels.items() if quantity in names})
        )

    V = np.linspace(14.0, 18.0, 5)
    aircraft = Flown(MASS_KG * g, AREA_M2, SPAN_M, V, lambda result: level_power_W(V, result.conditions.rho))
    result = curves_by_sensors(sensors, recorded, aircraft)
    assert_more_is_never_less(result)
    assert sum(curve is not None for curve in result.values()) >= curves


def test_the_sensors_of_drag_take_no_electrical_curve_away(tmp_path: Path) -> None:
    """The command also gets a vane and a motor speed, but neither an aircraft file nor a propeller table."""
    own = ["--mass", f"{MASS_KG} kg", "--wing-area", f"{AREA_M2} m^2", "--span", f"{SPAN_M} m"]
    done = CliRunner().invoke(app, [str(written(tmp_path, flown_table())), *own, "-o", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
