"""Each table is wrong in another way: it is refused in one line and never gives a curve."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.analysis.sources.map_draft import draft
from flightpower.analysis.sources.table import TABLE, log_of_table
from flightpower.flight.errors import InputError
from tests.analysis.sources.flown_table import MAP, flown_table, map_text, write_csv, written

Table = pd.DataFrame
TRUE = flown_table()
COLUMN = {quantity: column for quantity, (column, _) in MAP.items()}


def times(quantity: str, factor: float, offset: float = 0.0) -> Callable[[Table], Table]:
    return lambda t: t.assign(**{COLUMN[quantity]: t[COLUMN[quantity]] * factor + offset})


def late(*quantities: str, seconds: float) -> Callable[[Table], Table]:
    """The columns, delayed by this time."""

    def shifted(t: Table) -> Table:
        n = round(seconds / 0.1)
        names = [COLUMN[quantity] for quantity in quantities]
        return t.assign(**{name: t[name].shift(n) for name in names})

    return shifted


def exchanged(item: str, other: str) -> Callable[[Table], Table]:
    a, b = COLUMN[item], COLUMN[other]
    return lambda t: t.assign(**{a: t[b], b: t[a]})


def of_another_flight(*quantities: str) -> Callable[[Table], Table]:
    """The columns of another flight with the same statistics: this flight played backward."""
    return lambda t: t.assign(**{COLUMN[quantity]: t[COLUMN[quantity]].to_numpy()[::-1] for quantity in quantities})


GYROS = ("roll_rate", "pitch_rate", "yaw_rate")
GROUND = ("velocity_north", "velocity_east", "velocity_down")
WRONG: dict[str, Callable[[Table], Table]] = {
    # Units.
    "airspeed in knots": times("true_airspeed", 1.944),
    "airspeed in km/h": times("true_airspeed", 3.6),
    "height in feet": times("height", 3.281),
    "static pressure in hPa": times("static_pressure", 0.01),
    "temperature in degrees Celsius": times("air_temperature", 1, -273.15),
    "roll rate in rad/s": times("roll_rate", 0.01745),
    "pitch rate in hundredths": times("pitch_rate", 100),
    "roll angle in rad": times("roll", 0.01745),
    "angle of attack in rad": times("angle_of_attack", 0.01745),
    "forces in g": lambda t: t.assign(**{f"a{axis}_mps2": t[f"a{axis}_mps2"] / 9.80665 for axis in "xyz"}),
    "ground velocity in cm/s": lambda t: t.assign(**{n: 100 * t[n] for n in ("vn_mps", "ve_mps", "vd_mps")}),
    "times in milliseconds": times("time", 1000),
    "voltage in mV": times("battery_voltage", 1000),
    "climb in ft/min": times("velocity_down", 196.85),
    # Signs.
    "roll rate": times("roll_rate", -1),
    "pitch rate": times("pitch_rate", -1),
    "yaw rate": times("yaw_rate", -1),
    "gravity": times("specific_force_down", -1),
    "forward force": times("specific_force_forward", -1),
    "roll angle": times("roll", -1),
    "climb positive": times("velocity_down", -1),
    "east is west": times("velocity_east", -1),
    "angle of attack": times("angle_of_attack", -1),
    "current of discharge negative": times("battery_current", -1),
    # Columns exchanged.
    "roll and yaw rate": exchanged("roll_rate", "yaw_rate"),
    "roll and pitch angle": exchanged("roll", "pitch"),
    "forward and down force": exchanged("specific_force_forward", "specific_force_down"),
    "north and east": exchanged("velocity_north", "velocity_east"),
    "voltage and current": exchanged("battery_voltage", "battery_current"),
    "airspeed and height": exchanged("true_airspeed", "height"),
    "airspeed is that of the motor": lambda t: t.assign(tas_mps=t["motor_rpm"] / 60),
    # Delays.
    "airspeed 2 s late": late("true_airspeed", seconds=2.0),
    "gyros 1 s late": late(*GYROS, seconds=1.0),
    "height 3 s late": late("height", seconds=3.0),
    "GPS 2 s late": late(*GROUND, seconds=2.0),
    "motor speed 2 s late": late("motor_speed", seconds=2.0),
    # Several flights or aircraft in one.
    "two flights one after another": lambda t: pd.concat([t, t]),
    "rows of two aircraft in turns": lambda t: pd.concat([t, t.assign(tas_mps=25.0)]).sort_values("t_s"),
    "gyros of another flight": of_another_flight(*GYROS),
    "GPS of another flight": of_another_flight(*GROUND),
    "times of a constant": lambda t: t.assign(t_s=1.0),
}


def test_the_true_table_is_accepted(tmp_path: Path) -> None:
    for seed in range(1, 6):
        log = log_of_table(written(tmp_path, flown_table(seed)))
        assert log.entries["/imu"]


@pytest.mark.parametrize("mistake", WRONG)
def test_told_in_one_line(mistake: str, tmp_path: Path) -> None:
    with pytest.raises(InputError) as raised:
        log_of_table(written(tmp_path, WRONG[mistake](TRUE.copy())))
    message = str(raised.value)
    assert "\n" not in message
    assert "flight.csv" in message


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (map_text().replace('"tas_mps"', '"airspeed"'), "has no column airspeed"),
        (map_text().replace('unit = "m/s"', 'unit = "kg"', 1), "true_airspeed.unit"),
        (map_text().replace("[roll]", "[rol]"), "rol is not a quantity"),
        (map_text().replace("[time]", "[throttle_2]"), "throttle_2"),
        (map_text(true_airspeed='delay = "2 s"'), "early by 2.0 s"),
        (map_text(height="factor = -1"), "height"),
        ("[time", "not a TOML file"),
    ],
)
def test_a_wrong_map_is_reported_in_one_line(text: str, message: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=message) as raised:
        log_of_table(written(tmp_path, TRUE, text))
    assert "\n" not in str(raised.value)


def test_two_aircraft_by_their_number(tmp_path: Path) -> None:
    number = np.where(np.arange(len(TRUE)) % 2, 7, 8)
    text = map_text({**MAP, "aircraft_number": ("ac_id", "")})
    with pytest.raises(InputError, match="2 aircraft"):
        log_of_table(written(tmp_path, TRUE.assign(ac_id=number), text))
    assert log_of_table(written(tmp_path, TRUE.assign(ac_id=7), text))


BARE = {name: MAP[name] for name in ("time", "true_airspeed", "height", "battery_voltage", "battery_current")}


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"height_m": 1 / 0.3048}, r"height \(column height_m\) gains 3\.\d times the energy .* feet"),
        ({"height_m": 0.3048}, r"height .* gains 0\.3\d* times the energy .* feet"),
        ({"tas_mps": 1 / 0.514444}, r"height .* gains 0\.2\d* times the energy that true_airspeed \(column tas_mps\)"),
    ],
)
def test_energy_tells_a_unit_where_the_table_has_no_climb(
    wrong: dict[str, float], message: str, tmp_path: Path
) -> None:
    """g dh/dt is compared with V dV/dt at equal power: feet are 3.28 times as many, knots squared 3.8 times."""
    table = TRUE.assign(**{name: TRUE[name] * factor for name, factor in wrong.items()})
    with pytest.raises(InputError, match=message):
        log_of_table(written(tmp_path, table, map_text(BARE)))


def test_energy_rejects_no_sound_flight_and_leaves_no_note(tmp_path: Path) -> None:
    for seed in range(1, 9):
        assert not log_of_table(written(tmp_path, flown_table(seed), map_text(BARE))).metadata[TABLE], seed


def test_units_that_nothing_checks_are_named(tmp_path: Path) -> None:
    """Steady circles do not exchange height for speed, and no law contains the air temperature."""
    level = TRUE.assign(tas_mps=15.0 + 0.2 * np.sin(TRUE["t_s"]), height_m=100 + 0.5 * np.sin(0.7 * TRUE["t_s"]))
    text = map_text({**BARE, "air_temperature": ("oat_K", "K")})
    notes = log_of_table(written(tmp_path, level, text)).metadata[TABLE]
    assert notes["height"].startswith("The unit of height (column height_m) is not checked")
    assert "shows whether it is K" in notes["air_temperature"]
    recording = recording_of(log_of_table(written(tmp_path, level, text)))
    assert set(notes.values()) <= set(recording.notes)


def test_a_draft_takes_height_in_feet_by_energy(tmp_path: Path) -> None:
    names = {"height_m": "altitude", "t_s": "time", "tas_mps": "tas", "voltage_V": "voltage", "current_A": "current"}
    feet = TRUE[list(names)].assign(height_m=TRUE["height_m"] / 0.3048).rename(columns=names)
    write_csv(tmp_path / "flight.csv", feet)
    assert '[height]\ncolumn = "altitude"\nunit = "ft"' in draft(tmp_path / "flight.csv")
