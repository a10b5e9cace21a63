"""A table with a map of its columns gives the curve of its flight; files are known by content; maps are drafted."""

import gzip
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from flightpower.analysis.air.contents import Replacements
from flightpower.analysis.cli.analyze import app
from flightpower.analysis.methods.whole_flight.curve import estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.sources.column_map import load_map
from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.analysis.sources.map_draft import draft
from flightpower.analysis.sources.position import EARTH_RADIUS_M, velocity_by_position
from flightpower.analysis.sources.recording import Channel
from flightpower.analysis.sources.resolution import without_steps
from flightpower.analysis.sources.table import log_of_table
from flightpower.analysis.sources.table_file import read_columns, table_kind
from flightpower.command import app as flightpower
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY, density, pressure_at
from flightpower.flight.errors import InputError
from flightpower.flight.formats import Format
from flightpower.flight.units import GRAVITY_MPS2 as g
from tests.analysis.sources.flown_table import (
    AREA_M2,
    MAP,
    MASS_KG,
    SPAN_M,
    flown_table,
    level_power_W,
    map_text,
    write_csv,
    written,
)
from tests.shared_data import beside, needs

TRUE = flown_table()
CYCLONE, CITATION = (beside("real-flights") / name for name in ("cyclone-test.mat", "citation-reference-flight.csv.gz"))
AIRCRAFT = ["--mass", f"{MASS_KG} kg", "--wing-area", f"{AREA_M2} m^2", "--span", f"{SPAN_M} m"]


def curve_errors(path: Path) -> np.ndarray:
    flight = flight_table(recording_of(log_of_table(path)), MASS_KG * g, AREA_M2)
    electrical = estimate(flight, MASS_KG * g, AREA_M2, SPAN_M)
    V = np.linspace(electrical.V_mps[0], electrical.V_mps[-1], 5)
    truth = level_power_W(V, electrical.conditions.rho)
    return np.asarray(np.interp(V, electrical.V_mps, electrical.power_W) / truth - 1)


GPS_BY_COURSE = {"ground_speed": ("gs", "m/s"), "course": ("track", "deg")}
WITHOUT_IMU = {name: MAP[name] for name in ("time", "true_airspeed", "height", "battery_voltage", "battery_current")}
VELOCITIES = {name: MAP[name] for name in ("velocity_north", "velocity_east", "velocity_down")}
POSITION = {"latitude": ("lat_deg", "deg"), "longitude": ("lon_deg", "deg")}
BY_POSITION = {name: item for name, item in MAP.items() if name not in VELOCITIES} | POSITION


def with_position(digits: int = 7, every: int = 1) -> pd.DataFrame:
    """TRUE with positions that the table repeats until the receiver gives the next one; they cross 180 degrees east."""
    degrees = np.degrees(0.1 / EARTH_RADIUS_M)
    latitude = 52 + degrees * np.cumsum(TRUE["vn_mps"])
    longitude = (180.01 + degrees * np.cumsum(TRUE["ve_mps"]) / np.cos(np.radians(52)) + 180) % 360 - 180
    last = np.arange(len(TRUE)) // every * every
    return TRUE.assign(
        lat_deg=np.round(latitude.to_numpy()[last], digits), lon_deg=np.round(longitude.to_numpy()[last], digits)
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("entries", "within"),
    [
        (MAP, 0.05),
        (WITHOUT_IMU, 0.06),
        pytest.param(
            {name: item for name, item in MAP.items() if name not in ("height", "static_pressure")},
            0.05,
            marks=pytest.mark.thorough,
        ),
        pytest.param({**WITHOUT_IMU, **GPS_BY_COURSE}, 0.06, marks=pytest.mark.thorough),
        pytest.param(
            {name: item for name, item in MAP.items() if name != "true_airspeed"}, 0.08, marks=pytest.mark.thorough
        ),
        pytest.param(
            {name: item for name, item in BY_POSITION.items() if name != "true_airspeed"},
            0.08,
            marks=pytest.mark.thorough,
        ),
    ],
    ids=["all", "without IMU and GPS", "height by GPS", "speed and course", "without airspeed", "position alone"],
)
def test_inputs_are_interchangeable(entries: dict[str, tuple[str, str]], within: float, tmp_path: Path) -> None:
    """One flight gives its electrical curve from whatever quantities its table has."""
    north, east = TRUE["vn_mps"], TRUE["ve_mps"]
    more = with_position().assign(gs=np.hypot(north, east), track=np.degrees(np.arctan2(east, north)))
    assert np.abs(curve_errors(written(tmp_path, more, map_text(entries)))).max() < within


@pytest.mark.parametrize(("digits", "every", "within_mps"), [(7, 1, 0.2), (5, 1, 0.5), (7, 10, 0.9)])
def test_velocity_by_position(digits: int, every: int, within_mps: float) -> None:
    """The last digit is 1 cm or 1 m at 10 Hz; at 1 Hz, turns of 0.5 rad/s are cut short."""
    table = with_position(digits, every)
    t_s = TRUE["t_s"].to_numpy()
    position = (Channel(t_s, np.radians(table[name].to_numpy())) for name in ("lat_deg", "lon_deg"))
    for channel, true in zip(velocity_by_position(*position), ("vn_mps", "ve_mps"), strict=True):
        error = np.interp(t_s, *channel) - TRUE[true].to_numpy()
        assert np.sqrt(np.mean(error[50:-50] ** 2)) < within_mps


@pytest.mark.parametrize("wrong", [{"lat_deg": "lon_deg", "lon_deg": "lat_deg"}, {"lat_deg": "lat_deg"}])
def test_a_wrong_position_is_reported(wrong: dict[str, str], tmp_path: Path) -> None:
    """The columns are swapped, or one is from another flight."""
    table = with_position()
    taken = {name: table[of].to_numpy()[:: -1 if name == of else 1] for name, of in wrong.items()}
    with pytest.raises(InputError) as raised:
        log_of_table(written(tmp_path, table.assign(**taken), map_text(BY_POSITION)))
    assert "latitude (column lat_deg)" in str(raised.value)


def test_a_delay_in_the_map_is_taken_out(tmp_path: Path) -> None:
    """The GPS shows the motion of 1.5 s ago, and the map says so."""
    names = ["vn_mps", "ve_mps", "vd_mps"]
    late = TRUE.assign(**{name: TRUE[name].shift(15) for name in names})
    delays = dict.fromkeys(VELOCITIES, 'delay = "1.5 s"')
    assert np.abs(curve_errors(written(tmp_path, late, map_text(**delays)))).max() < 0.05
    with pytest.raises(InputError):
        log_of_table(written(tmp_path, late))


def test_current_keeps_its_own_times_where_voltage_is_slower(tmp_path: Path) -> None:
    """Voltage is in every hundredth row, every 10 s, and current in each row."""
    slow = TRUE.assign(voltage_V=TRUE["voltage_V"].where(TRUE.index % 100 == 0))
    battery_A = recording_of(log_of_table(written(tmp_path, slow))).channels["battery_A"]
    assert np.interp(
        TRUE["t_s"], battery_A.t_s + TRUE["t_s"].iloc[0] - battery_A.t_s[0], battery_A.value
    ) == pytest.approx(TRUE["current_A"].to_numpy(), abs=1e-6)


def test_one_of_two_motors_counts_twice(tmp_path: Path) -> None:
    half = written(tmp_path, TRUE.assign(current_A=TRUE["current_A"] / 2), map_text(battery_current="factor = 2"))
    current = recording_of(log_of_table(half)).channels["battery_A"].value
    assert np.mean(current) == pytest.approx(TRUE["current_A"].mean(), rel=1e-3)


def test_thrust_and_vane_become_motor_speed_and_probe(tmp_path: Path) -> None:
    """Its own propeller table and probe calibration turn the log's values back into thrust and angle of attack."""
    from flightpower.analysis.air.contents import contents
    from flightpower.analysis.air.flight_data import flight_data
    from flightpower.flight.aircraft import parse_aircraft

    thrust = 3 + np.sin(0.1 * TRUE["t_s"])
    text = map_text({name: item for name, item in MAP.items() if name != "motor_speed"} | {"thrust": ("T_N", "N")})
    log = log_of_table(written(tmp_path, TRUE.assign(T_N=thrust), text))
    aircraft = parse_aircraft(
        f'name = "a"\n[geometry]\nspan = "{SPAN_M} m"\nwing_area = "{AREA_M2} m^2"\n[mass]\nweight = "{MASS_KG} kg"\n'
        '[probe]\nposition = ["0 m", "0 m", "0 m"]\nupwash_per_CL = "0 deg"\n',
        "a.toml",
    )
    flight_contents = contents(log, Replacements(aircraft=aircraft))
    table = flight_data(
        log, flight_contents.aircraft, flight_contents.propeller, flight_contents.calibrations
    ).table.iloc[100:-100]
    rows = np.searchsorted(TRUE["t_s"], table.index)
    assert np.degrees(table["alpha_rad"].to_numpy()) == pytest.approx(TRUE["alpha_deg"].to_numpy()[rows], abs=0.5)
    assert table["V_mps"].to_numpy() == pytest.approx(TRUE["tas_mps"].to_numpy()[rows], abs=1.0)
    V, n, rho = (table[name].to_numpy() for name in ("V_mps", "n_revps", "rho"))
    T, _ = flight_contents.propeller.thrust_and_power(V, n, rho)
    assert np.asarray(T) == pytest.approx(thrust.to_numpy()[rows], rel=0.02)


def test_files_are_known_by_their_content(tmp_path: Path) -> None:
    few = TRUE.iloc[:50]
    few.to_parquet(tmp_path / "a.csv")
    savemat(tmp_path / "b.csv", {"data": {name: few[name].to_numpy() for name in few}})
    (tmp_path / "c.mat").write_bytes(gzip.compress(few.to_csv(index=False).encode()))
    (tmp_path / "d.csv").write_bytes(b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(600))
    (tmp_path / "e.csv").write_bytes(bytes(range(256)))
    kinds = [table_kind(tmp_path / name) for name in ("a.csv", "b.csv", "c.mat", "d.csv", "e.csv")]
    assert kinds == [Format.PARQUET, Format.MAT, Format.TEXT, Format.MAT_7_3, None]
    for name, prefix in (("a.csv", ""), ("b.csv", "data."), ("c.mat", "")):
        assert read_columns(tmp_path / name)[f"{prefix}tas_mps"] == pytest.approx(few["tas_mps"].to_numpy())
    with pytest.raises(InputError, match="-v7"):
        read_columns(tmp_path / "d.csv")


def test_a_spreadsheet_of_another_country(tmp_path: Path) -> None:
    """Semicolons, decimal commas, a line of units, dates as times, and a comment."""
    rows = [f"2024-05-01T10:00:{i:02d};{20 + i / 10:.1f};{i}".replace(".", ",") for i in range(30)]
    (tmp_path / "a.csv").write_text("\n".join(["# a comment", "time;airspeed;motor", "s;km/h;1/min", *rows]))
    columns = read_columns(tmp_path / "a.csv")
    assert list(columns) == ["time [s]", "airspeed [km/h]", "motor [1/min]"]
    assert columns["airspeed [km/h]"] == pytest.approx(20 + np.arange(30) / 10)
    assert columns["time [s]"] == pytest.approx(np.arange(30))


def drafted(tmp_path: Path, table: pd.DataFrame) -> dict[str, tuple[str, str, float]]:
    path = tmp_path / "flight.csv"
    write_csv(path, table)
    (tmp_path / "map.toml").write_text(draft(path))
    return {
        name: (column.column, column.unit, column.factor)
        for name, column in load_map(tmp_path / "map.toml").columns.items()
    }


def test_a_draft_by_names(tmp_path: Path) -> None:
    assert drafted(tmp_path, TRUE) == {name: (*item, 1.0) for name, item in MAP.items()}


def test_a_draft_takes_position_for_velocity(tmp_path: Path) -> None:
    table = with_position().drop(columns=[column for column, _ in VELOCITIES.values()])
    assert drafted(tmp_path, table) == {name: (*item, 1.0) for name, item in BY_POSITION.items()}


def test_a_draft_reads_short_names_units_in_names_and_a_clock_by_its_course(tmp_path: Path) -> None:
    """A flight-test engineer's names: gx to gz show 1 g, so they are not gyros; AoA is one word; the clock has no
    name."""
    fahrenheit = (TRUE["oat_K"] - 273.15) * 1.8 + 32
    table = pd.DataFrame(
        {
            "ticker": TRUE["t_s"], "V (kt)": TRUE["tas_mps"] / 0.514444, "hgt_ft": TRUE["height_m"] / 0.3048,
            "AoA": TRUE["alpha_deg"], "phi": TRUE["roll_deg"], "tht": TRUE["pitch_deg"], "psi": TRUE["heading_deg"],
            "gx": TRUE["ax_mps2"] / g, "gy": TRUE["ay_mps2"] / g, "gz": TRUE["az_mps2"] / g,
            "vs_fpm": -TRUE["vd_mps"] / 0.3048 * 60, "oat_degF": fahrenheit, "static_inHg": TRUE["ps_Pa"] / 3386.389,
            "vbat": TRUE["voltage_V"], "ibat": TRUE["current_A"],
        }
    )  # fmt: skip
    expected = {
        "time": ("ticker", "s", 1), "true_airspeed": ("V (kt)", "knot", 1), "height": ("hgt_ft", "ft", 1),
        "angle_of_attack": ("AoA", "deg", 1), "roll": ("phi", "deg", 1), "pitch": ("tht", "deg", 1),
        "heading": ("psi", "deg", 1), "specific_force_forward": ("gx", "standard_gravity", 1),
        "specific_force_right": ("gy", "standard_gravity", 1), "specific_force_down": ("gz", "standard_gravity", 1),
        "velocity_down": ("vs_fpm", "ft/min", -1), "air_temperature": ("oat_degF", "degF", 1),
        "static_pressure": ("static_inHg", "inHg", 1), "battery_voltage": ("vbat", "V", 1),
        "battery_current": ("ibat", "A", 1),
    }  # fmt: skip
    assert drafted(tmp_path, table.iloc[:2000]) == expected
    rates = table.assign(gx=TRUE["gyro_p_degps"], gy=TRUE["gyro_q_degps"], gz=TRUE["gyro_r_degps"])
    assert "specific_force_down" not in drafted(tmp_path, rates.iloc[:2000])


def test_temperature_and_height_named_by_static_pressure_are_no_pressure(tmp_path: Path) -> None:
    """288 K are as possible as 288 hPa, and a height of 1000 m as 1000 hPa."""
    names = {"oat_K": "static_temperature_K", "height_m": "pressure_altitude_m"}
    result = drafted(tmp_path, TRUE.drop(columns="ps_Pa").rename(columns=names).iloc[:2000])
    assert "static_pressure" not in result
    assert result["air_temperature"] == ("static_temperature_K", "K", 1.0)
    assert result["height"] == ("pressure_altitude_m", "m", 1.0)


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_small_angles_have_the_unit_of_the_others(tmp_path: Path, unit: str) -> None:
    """A heading of 15 to 25 degrees may be one in radians that has no wraps; a pitch of 2 degrees may not be in
    radians. In radians a heading beyond two pi has come there without a jump."""
    t_s = TRUE["t_s"]
    angles = {"pitch": 2 + np.sin(t_s), "psi": 20 + 5 * np.sin(t_s / 9), "phi": 0.5 * np.sin(t_s / 5)}
    if unit == "rad":
        angles = {"pitch": 0.04 + 0.02 * np.sin(t_s), "psi": 0.1 * t_s, "phi": 0.5 * np.sin(t_s / 5)}
    result = drafted(tmp_path, pd.DataFrame({"time_s": t_s, **angles}))
    assert {result[name][1] for name in ("pitch", "heading", "roll")} == {unit}


def test_a_heading_beyond_two_pi_alone_is_in_degrees(tmp_path: Path) -> None:
    north = pd.DataFrame({"time_s": TRUE["t_s"], "psi": 20 + 5 * np.sin(TRUE["t_s"] / 9)})
    assert drafted(tmp_path, north)["heading"][1] == "deg"


@pytest.mark.slow
def test_a_draft_by_physics(tmp_path: Path) -> None:
    """Units that names lack are inferred: knots and feet by GPS, deg/s by attitude, g by gravity; signs by motion."""
    table = pd.DataFrame(
        {
            "time": TRUE["t_s"] * 1000, "airspeed": TRUE["tas_mps"] * 1.9438, "altitude": TRUE["height_m"] / 0.3048,
            "acc_x": TRUE["ax_mps2"] / g, "acc_y": TRUE["ay_mps2"] / g, "acc_z": -TRUE["az_mps2"] / g,
            "gyro_p": TRUE["gyro_p_degps"], "gyro_q": -TRUE["gyro_q_degps"], "gyro_r": TRUE["gyro_r_degps"],
            "roll": TRUE["roll_deg"], "pitch": TRUE["pitch_deg"], "yaw": TRUE["heading_deg"],
            "vel_n": TRUE["vn_mps"], "vel_e": TRUE["ve_mps"], "vel_d": TRUE["vd_mps"],
            "voltage": TRUE["voltage_V"] * 1000, "current": TRUE["current_A"], "rpm": TRUE["motor_rpm"],
        }
    )  # fmt: skip
    result = drafted(tmp_path, table.iloc[:1000])
    units = {name: (unit, factor) for name, (_, unit, factor) in result.items()}
    assert units["time"] == ("ms", 1)
    assert units["true_airspeed"] == ("knot", 1)
    assert units["height"] == ("ft", 1)
    assert [units[f"specific_force_{axis}"] for axis in ("forward", "right")] == [("standard_gravity", 1)] * 2
    assert units["specific_force_down"] == ("standard_gravity", -1)
    assert [units[f"{axis}_rate"] for axis in ("roll", "pitch", "yaw")] == [("deg/s", 1), ("deg/s", -1), ("deg/s", 1)]
    assert units["battery_voltage"] == ("mV", 1)


def test_the_command_needs_a_map_and_says_how_to_draft_it(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    write_csv(path, TRUE)
    refused = CliRunner().invoke(app, [str(path), *AIRCRAFT])
    assert isinstance(refused.exception, InputError)
    assert "flightpower new columns" in str(refused.exception)
    made = CliRunner().invoke(flightpower, ["new", "columns", str(path), "-o", f"{path}.columns.toml"])
    assert made.exit_code == 0, made.output
    done = CliRunner().invoke(app, [str(path), *AIRCRAFT, "-o", str(tmp_path / "out")])
    assert done.exit_code == 0, done.output
    assert (tmp_path / "out" / "results.json").exists()


@needs(CYCLONE)
def test_a_tailsitter_from_its_file_as_it_is(tmp_path: Path) -> None:
    """One of two motors is measured, half the power; by the publication, 0.87 of the power is shaft power."""
    (tmp_path / "map.toml").write_text(draft(CYCLONE).replace('"A"', '"A"\nfactor = 2'))
    flight = flight_table(recording_of(log_of_table(CYCLONE, tmp_path / "map.toml")), 1.0 * g, 0.18)
    electrical = estimate(flight, 1.0 * g, 0.18, 0.9)
    table = flight.table[flight.flown]
    level = table[np.abs(np.gradient(table["height_m"], table.index)) < 0.5]
    level_W = np.interp(16.5, electrical.V_mps, electrical.power_W)
    half = 1.96 * np.interp(16.5, electrical.V_mps, electrical.standard_error_W)
    assert abs(level_W - level["power_W"].median()) < half < 0.3 * level_W


@needs(CITATION)
def test_the_draft_of_a_large_aircraft_finds_the_sign_of_its_vertical_force(tmp_path: Path) -> None:
    (tmp_path / "map.toml").write_text(draft(CITATION))
    columns = load_map(tmp_path / "map.toml").columns
    assert {"true_airspeed", "height", "angle_of_attack", "thrust", "roll", "pitch", "yaw_rate"} <= set(columns)
    assert all(column.factor == (-1 if name == "specific_force_down" else 1) for name, column in columns.items())


def test_a_table_of_blackbox_decode_needs_no_map_by_hand(tmp_path: Path) -> None:
    """Names, units and axes are those of INAV's blackbox_decode --unit-acceleration m/s2 --merge-gps: up, and
    centimeters."""
    n = len(TRUE)
    indicated_mps = TRUE["tas_mps"] * np.sqrt(density(TRUE["ps_Pa"], TRUE["oat_K"]) / SEA_LEVEL_DENSITY)
    columns = {
        "loopIteration": 64 * np.arange(n), "time (us)": np.round(1e6 * TRUE["t_s"]).astype(int),
        "vbat (V)": TRUE["voltage_V"].round(2), "amperage (A)": TRUE["current_A"].round(2),
        "BaroAlt (cm)": (100 * TRUE["height_m"]).astype(int), "accSmooth[0] (m/s/s)": TRUE["ax_mps2"].round(2),
        "accSmooth[1] (m/s/s)": -TRUE["ay_mps2"].round(2), "accSmooth[2] (m/s/s)": -TRUE["az_mps2"].round(2),
        "attitude[0]": (10 * TRUE["roll_deg"]).astype(int), "GPS_numSat": [12] * n,
        "navVel[0]": (100 * TRUE["vn_mps"]).astype(int), "navVel[1]": (100 * TRUE["ve_mps"]).astype(int),
        "navVel[2]": (-100 * TRUE["vd_mps"]).astype(int), "AirSpeed": (100 * indicated_mps).astype(int),
        "flightModeFlags (flags)": ["ANGLE_MODE|ARM"] * n,
    }  # fmt: skip
    path = tmp_path / "LOG00001.01.csv"
    lines = (", ".join(map(str, row)) for row in zip(*columns.values(), strict=True))
    path.write_text("\n".join([", ".join(columns), *lines]) + "\n", "utf-8")
    beside_it = Path(f"{path}.columns.toml")
    beside_it.write_text(draft(path), "utf-8")
    results = {quantity.value: column for quantity, column in load_map(beside_it).columns.items()}
    assert {"battery_voltage", "battery_current", "indicated_airspeed", "velocity_north", "specific_force_down"} <= set(
        results
    )
    assert results["height"].unit == results["velocity_down"].unit.partition("/")[0] == "cm"
    assert results["velocity_down"].factor == results["specific_force_down"].factor == -1
    assert np.abs(curve_errors(path)).max() < 0.06


DAEMON_NAMES = {
    "ax_mps2": "specific_force_x_mps2", "ay_mps2": "specific_force_y_mps2", "az_mps2": "specific_force_z_mps2",
    "gyro_p_degps": "angular_rate_x_degps", "gyro_q_degps": "angular_rate_y_degps",
    "gyro_r_degps": "angular_rate_z_degps",
}  # fmt: skip


def test_the_draft_knows_the_names_that_the_daemon_writes(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    write_csv(path, TRUE.rename(columns=DAEMON_NAMES))
    text = draft(path)
    for quantity, column in (("specific_force_down", "specific_force_z_mps2"), ("roll_rate", "angular_rate_x_degps")):
        assert f'[{quantity}]\ncolumn = "{column}"' in text


def test_a_heading_without_its_sign_costs_the_heading_alone(tmp_path: Path) -> None:
    """Some recorders write its absolute value. Bank and pitch follow the gyros without it."""
    path = tmp_path / "flight.csv"
    degrees = (TRUE["heading_deg"] + 180) % 360 - 180
    assert (degrees < 0).any() and (degrees > 0).any()
    write_csv(path, TRUE.assign(heading_deg=degrees.abs()))
    drafted = tmp_path / "drafted.toml"
    drafted.write_text(draft(path))
    columns = load_map(drafted).columns
    assert {"roll", "pitch", "roll_rate", "yaw_rate"} <= columns.keys() and "heading" not in columns


def large_slow_aircraft() -> pd.DataFrame:
    """A straight flight at 90 m/s and 5 km whose static pressure changes in steps of 26 Pa; columns of MAP.

    Its path follows the pitch with a time constant of V C_L / (g C_La) = 1.5 s.
    """
    t = np.arange(0, 200, 0.1)
    V, heave_s = 90 + 6 * np.sin(0.07 * t), 1.5
    pitch = np.radians(6 + 2 * np.sin(0.2 * t) + 1.0 * np.sin(0.5 * t + 1))
    path = np.zeros(len(t))
    for i in range(1, len(t)):
        path[i] = path[i - 1] + 0.1 / heave_s * (pitch[i - 1] - np.radians(6) - path[i - 1])
    alpha, h = pitch - path, 5000 + np.cumsum(90 * path) * 0.1
    normal, along = g + V * np.gradient(path, 0.1), np.gradient(V, 0.1) + g * path
    return pd.DataFrame({
        "t_s": t, "tas_mps": V, "ps_Pa": 26 * np.round(pressure_at(h) / 26), "alpha_deg": np.degrees(alpha),
        "ax_mps2": along * np.cos(alpha) + normal * np.sin(alpha), "ay_mps2": 0 * t,
        "az_mps2": along * np.sin(alpha) - normal * np.cos(alpha),
        "gyro_q_degps": np.degrees(np.gradient(pitch, 0.1)), "pitch_deg": np.degrees(pitch),
        "roll_deg": 0.5 * np.sin(0.9 * t),
    })  # fmt: skip


def test_steps_of_pressure_and_a_slow_heave_contradict_nothing(tmp_path: Path) -> None:
    """Without straight lines between the steps, the angle of attack has a correlation of 0.8 with pitch less path, and
    the load factor lags the pitch rate by more than a second."""
    table = large_slow_aircraft()
    entries = {name: item for name, item in MAP.items() if item[0] in table}
    path = written(tmp_path, table, map_text(entries))
    assert log_of_table(path).entries["/static"]
    without_alpha = {name: entry for name, entry in entries.items() if name != "angle_of_attack"}
    assert log_of_table(written(tmp_path, table, map_text(without_alpha))).entries["/imu"]


def test_straight_lines_through_steps_are_nearer_to_the_truth() -> None:
    t_s = np.arange(0, 100, 0.04)
    true = 52_000 + 400 * np.sin(0.1 * t_s)
    steps = Channel(t_s, 26 * np.round(true / 26))
    error, left = (item.value - true for item in (steps, without_steps(steps)))
    assert np.std(error) == pytest.approx(26 / np.sqrt(12), rel=0.1) and np.std(left) < 0.6 * np.std(error)
    assert np.std(left[10:] - left[:-10]) < np.std(error[10:] - error[:-10]) / 4  # errors of the slope over 0.4 s
    noisy = Channel(t_s, true + np.random.default_rng(0).normal(size=len(t_s)))
    assert without_steps(noisy) is noisy
