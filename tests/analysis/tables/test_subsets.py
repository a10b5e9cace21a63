"""Never less from more: a flight's table with columns added gives a curve wherever it did, no worse and no wider."""

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from analysis.cli.analyze import app
from analysis.electrical.daemon_log import recording_of
from analysis.electrical.estimate import estimate
from analysis.electrical.flight_table import flight_table
from analysis.tables.column_map import load_map, mapped_channels
from analysis.tables.log_of_table import as_log
from analysis.tables.read import read_columns
from flight.errors import InputError
from flight.units import GRAVITY_MPS2 as g
from tests.analysis.tables.flown_table import (
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


@pytest.fixture(scope="module")
def found(tmp_path_factory) -> dict[frozenset[str], tuple[float, float] | None]:
    """By sensors: largest error of the curve and largest half width, relative; None where there is no curve."""
    path = written(tmp_path_factory.mktemp("flight"), flown_table(), map_text())
    channels = mapped_channels(path, read_columns(path), load_map(path.with_name(f"{path.name}.columns.toml")))
    out: dict[frozenset[str], tuple[float, float] | None] = {}
    for size in range(len(SENSORS) + 1):
        for sensors in combinations(SENSORS, size):
            names = {name for sensor in sensors for name in SENSORS[sensor]} | set(ALWAYS)
            kept = {quantity: one for quantity, one in channels.items() if quantity in names}
            try:
                flight = flight_table(recording_of(as_log(path, kept)), MASS_KG * g, AREA_M2).thinned(3)
                curve = estimate(flight, MASS_KG * g, AREA_M2, SPAN_M, most_windows=40, most_points=60)
            except InputError:
                out[frozenset(sensors)] = None
                continue
            V = np.linspace(14.0, 18.0, 5)
            power, sigma = (np.interp(V, curve.V_mps, one) for one in (curve.power_W, curve.standard_error_W))
            truth = level_power_W(V, curve.conditions.rho)
            out[frozenset(sensors)] = (float(np.abs(power / truth - 1).max()), float((1.96 * sigma / truth).max()))
    return out


def test_a_sensor_that_is_added_takes_no_curve_away(found) -> None:
    for sensors, curve in found.items():
        for more in SENSORS.keys() - sensors:
            assert curve is None or found[sensors | {more}] is not None, (sensors, more)
    assert sum(curve is not None for curve in found.values()) >= 16


def test_a_sensor_that_is_added_makes_no_curve_worse(found) -> None:
    """The error by no more than a part of the interval, which hardly widens: estimates differ within it."""
    for sensors, curve in found.items():
        for more in SENSORS.keys() - sensors:
            if curve is not None and (other := found[sensors | {more}]) is not None:
                assert other[0] < curve[0] + 0.5 * curve[1], (sensors, more)
                assert other[1] < 1.3 * curve[1], (sensors, more)


def test_the_sensors_of_drag_take_no_electrical_curve_away(tmp_path: Path) -> None:
    """By the command: a vane and a motor speed beside the rest, without aircraft file and propeller's table."""
    mine = ["--mass", f"{MASS_KG} kg", "--wing-area", f"{AREA_M2} m^2", "--span", f"{SPAN_M} m"]
    done = CliRunner().invoke(app, [str(written(tmp_path, flown_table())), *mine, "-o", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
