"""Tables as radios, decoders, ground stations, spreadsheets and MATLAB write them, read with their numbers."""

import io
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat
from typer.testing import CliRunner

from flightpower.analysis.cli.analyze import app
from flightpower.analysis.sources.column_map import load_map
from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.analysis.sources.jeti import read_jeti
from flightpower.analysis.sources.map_draft import draft
from flightpower.analysis.sources.open import open_source
from flightpower.analysis.sources.table import log_of_table
from flightpower.analysis.sources.table_file import read_columns, read_table
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY, density
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from tests.analysis.sources.flown_table import AREA_M2, MAP, MASS_KG, SPAN_M, flown_table, map_text, written

TRUE = flown_table()
FEW = TRUE.iloc[:60]
AIRCRAFT = ["--mass", f"{MASS_KG} kg", "--wing-area", f"{AREA_M2} m^2", "--span", f"{SPAN_M} m"]
INDICATED_MPS = TRUE["tas_mps"] * np.sqrt(density(TRUE["ps_Pa"], TRUE["oat_K"]) / SEA_LEVEL_DENSITY)
NORTH_DEG = np.degrees(0.1 * np.cumsum(TRUE["vn_mps"]) / 6_371_000)
EAST_DEG = np.degrees(0.1 * np.cumsum(TRUE["ve_mps"]) / 6_371_000 / np.cos(np.radians(48.0)))


def text_of(table: pd.DataFrame, **options: object) -> str:
    return str(table.to_csv(index=False, **options))  # type: ignore[call-overload]


def european(table: pd.DataFrame) -> str:
    """Semicolons, decimal commas, and a date whose points are not decimal points."""
    return text_of(table.assign(Datum="01.05.2024"), sep=";", decimal=",")


WRITTEN: dict[str, Callable[[pd.DataFrame], bytes]] = {
    "comma": lambda t: text_of(t).encode(),
    "tab": lambda t: text_of(t, sep="\t").encode(),
    "decimal comma beside a date": lambda t: european(t).encode(),
    "UTF-16 of a spreadsheet": lambda t: text_of(t, sep="\t").encode("utf-16"),
    "UTF-16, the other order": lambda t: b"\xfe\xff" + text_of(t).encode("utf-16-be"),
    "with a mark": lambda t: text_of(t).encode("utf-8-sig"),
    "a degree sign of Windows": lambda t: text_of(t.rename(columns={"roll_deg": "roll (°)"})).encode("cp1252"),
    "sep= of a spreadsheet": lambda t: b"sep=;\r\n" + text_of(t, sep=";").replace("\n", "\r\n").encode(),
    "lines before the names": lambda t: b"Logger v1.2\nAircraft: mine\nStart: 2024-05-01\n\n" + text_of(t).encode(),
    "settings before the names": lambda t: b'"Product","recorder"\n"pid","40,50,23"\n' + text_of(t).encode(),
    "comments between": lambda t: b"# made by hand\n" + text_of(t).replace("\n", "\n# pause\n", 1).encode(),
    "a separator at the end of each row": lambda t: text_of(t).replace("\n", ",\n").encode(),
    "names alone without it": lambda t: text_of(t).replace("\n", ",\n").replace(",\n", "\n", 1).encode(),
    "spaces after separators": lambda t: text_of(t).replace(",", ", ").encode(),
    "quoted": lambda t: text_of(t, quoting=1).encode(),
    "names again in the middle": lambda t: (text_of(t[:30]) + text_of(t[30:])).encode(),
    "a truncated last row": lambda t: (text_of(t) + "1.5,2").encode(),
}


@pytest.mark.parametrize("habit", WRITTEN)
def test_numbers_are_those_that_were_written(habit: str, tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    path.write_bytes(WRITTEN[habit](FEW))
    columns = read_columns(path)
    for name in ("t_s", "tas_mps", "voltage_V"):
        assert columns[name][: len(FEW)] == pytest.approx(FEW[name].to_numpy(), abs=1e-9), habit


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (text_of(FEW).replace("t_s,", "", 1), "21 names for 22 cells in a row"),
        (text_of(FEW).replace("t_s,", "t_s,more,", 1), "23 names for 22 cells in most rows"),
        (text_of(FEW) + "9.9," * 21 + "9.9,8\n", "22 names for 23 cells"),
        ("a,b\n" + "1,2,3\n" * 50, "2 names for 3 cells"),
    ],
)
def test_cells_without_a_name_are_no_column(text: str, message: str, tmp_path: Path) -> None:
    (tmp_path / "flight.csv").write_text(text)
    with pytest.raises(InputError, match=message):
        read_columns(tmp_path / "flight.csv")


@pytest.mark.parametrize(
    "times",
    [
        lambda moment: moment.strftime("%H:%M:%S.%f"),
        lambda moment: moment.strftime("%Y-%m-%d %H:%M:%S.%f"),
        lambda moment: moment.strftime("%Y-%m-%dT%H:%M:%S.%fZ"),
        lambda moment: moment.strftime("%d.%m.%Y %H:%M:%S.%f"),
        lambda moment: moment.strftime("%m/%d/%Y %I:%M:%S.%f %p"),
        lambda moment: moment.strftime("%H:%M:%S,%f"),
    ],
    ids=["time of day", "ISO", "ISO with T and Z", "European", "American, 12 hours", "decimal comma"],
)
def test_times_of_day_are_seconds_also_past_midnight(times: Callable[[pd.Timestamp], str], tmp_path: Path) -> None:
    start = pd.Timestamp("2024-05-01 23:59:57.500")
    cells = [times(start + pd.Timedelta(seconds=float(t))) for t in FEW["t_s"]]
    pd.DataFrame({"Time": cells, "x": FEW["tas_mps"]}).to_csv(tmp_path / "a.csv", index=False, sep=";")
    assert read_columns(tmp_path / "a.csv")["Time"] == pytest.approx(FEW["t_s"].to_numpy(), abs=1e-6)


@pytest.mark.parametrize(
    ("named", "quantity", "unit"),
    [
        ("Airspeed (m/s)", "true_airspeed", "m/s"),
        ("Airspeed [m/s]", "true_airspeed", "m/s"),
        ("airspeed (kt)", "true_airspeed", "knot"),
        ("ARSP_Airspeed", "true_airspeed", "m/s"),
        ("ASpd(kmh)", "indicated_airspeed", "km/h"),
        ("VFAS(V)", "battery_voltage", "V"),
        ("Batt (mV)", "battery_voltage", "mV"),
        ("Curr(A)", "battery_current", "A"),
        ("Curr", "battery_current", "A"),
        ("Alt(ft)", "height", "ft"),
        ("seconds", "time", "s"),
    ],
)
def test_a_known_name_is_known_with_its_unit_in_brackets(named: str, quantity: str, unit: str, tmp_path: Path) -> None:
    scale = {"knot": 1 / 0.514444, "km/h": 3.6, "mV": 1000.0, "ft": 1 / 0.3048}.get(unit, 1.0)
    column = "tas_mps" if quantity == "indicated_airspeed" else MAP[quantity][0]
    needed = [MAP[name][0] for name in ("time", "true_airspeed", "height", "battery_voltage", "battery_current")]
    table = TRUE[needed].assign(**{column: scale * TRUE[column]}).rename(columns={column: named})
    table.to_csv(tmp_path / "flight.csv", index=False)
    (tmp_path / "map.toml").write_text(draft(tmp_path / "flight.csv"))
    columns = load_map(tmp_path / "map.toml").columns
    assert {name.value: column for name, column in columns.items()}[quantity].column == named
    assert columns[quantity].unit == unit  # type: ignore[index]


@pytest.mark.parametrize("named", ["Curr used (mAh)", "servo current (A)", "current time", "TxBat(V)", "Climb (ft)"])
def test_what_only_resembles_a_name_is_not_taken(named: str, tmp_path: Path) -> None:
    columns = TRUE[["t_s", "tas_mps", "height_m"]].assign(**{named: 7.0 + np.arange(len(TRUE)) % 2})
    columns.to_csv(tmp_path / "flight.csv", index=False)
    text = draft(tmp_path / "flight.csv")
    assert f"# Not used: {named}" in text


def radio(crossfire: bool) -> pd.DataFrame:
    """The log of a radio with EdgeTX: a date, times of day, position in one cell, a receiver's supply of 5 V."""
    moment = pd.Timestamp("2024-05-01 12:34:56") + pd.to_timedelta(TRUE["t_s"], unit="s")
    course_deg = np.degrees(np.arctan2(TRUE["ve_mps"], TRUE["vn_mps"])) % 360
    table = pd.DataFrame({
        "Date": moment.dt.strftime("%Y-%m-%d"), "Time": moment.dt.strftime("%H:%M:%S.%f").str[:-3],
        **({"RQly(%)": 100, "RxBt(V)": TRUE["voltage_V"].round(2)} if crossfire else {"RSSI(dB)": 80, "RxBt(V)": 5.1}),
        "GPS": [f"{48 + n:.6f} {11 + e:.6f}" for n, e in zip(NORTH_DEG, EAST_DEG, strict=True)],
        "GSpd(kmh)": (3.6 * np.hypot(TRUE["vn_mps"], TRUE["ve_mps"])).round(1), "Hdg(°)": course_deg.round(1),
        "Alt(m)": TRUE["height_m"].round(1), "ASpd(kts)": (INDICATED_MPS / 0.514444).round(1),
        "Curr(A)": TRUE["current_A"].round(2), "Capa(mAh)": (TRUE["current_A"].cumsum() / 36).round(), "Thr": 100,
    })  # fmt: skip
    return table if crossfire else table.assign(**{"VFAS(V)": TRUE["voltage_V"].round(2)})


def blackbox() -> pd.DataFrame:
    """Columns of blackbox_decode --merge-gps --unit-acceleration m/s2."""
    return pd.DataFrame({
        "loopIteration": 64 * np.arange(len(TRUE)), "time (us)": np.round(1e6 * TRUE["t_s"]).astype(int),
        "vbatLatest (V)": TRUE["voltage_V"].round(2), "amperageLatest (A)": TRUE["current_A"].round(2),
        "BaroAlt (cm)": (100 * TRUE["height_m"]).astype(int), "accSmooth[0] (m/s/s)": TRUE["ax_mps2"].round(2),
        "accSmooth[1] (m/s/s)": -TRUE["ay_mps2"].round(2), "accSmooth[2] (m/s/s)": -TRUE["az_mps2"].round(2),
        "GPS_speed (m/s)": np.hypot(TRUE["vn_mps"], TRUE["ve_mps"]).round(2),
        "GPS_ground_course": (np.degrees(np.arctan2(TRUE["ve_mps"], TRUE["vn_mps"])) % 360).round(1),
    })  # fmt: skip


def printed_telemetry() -> pd.DataFrame:
    """mavlogdump.py --format csv: a row for each message, with empty cells for those of other messages."""
    unix_s = 1.7e9 + TRUE["t_s"]
    kinds = [
        pd.DataFrame({"timestamp": unix_s, "VFR_HUD.airspeed": INDICATED_MPS, "VFR_HUD.alt": 0.0}),
        pd.DataFrame({"timestamp": unix_s + 0.01, "SCALED_PRESSURE.press_abs": TRUE["ps_Pa"] / 100}),
        pd.DataFrame({"timestamp": unix_s + 0.02, "SYS_STATUS.voltage_battery": (1000 * TRUE["voltage_V"]).round(),
                      "SYS_STATUS.current_battery": (100 * TRUE["current_A"]).round()}),
        pd.DataFrame({"timestamp": unix_s + 0.03, "GLOBAL_POSITION_INT.vx": (100 * TRUE["vn_mps"]).round(),
                      "GLOBAL_POSITION_INT.vy": (100 * TRUE["ve_mps"]).round(),
                      "GLOBAL_POSITION_INT.vz": (100 * TRUE["vd_mps"]).round()}),
    ]  # fmt: skip
    return pd.concat(kinds).sort_values("timestamp")


def station() -> pd.DataFrame:
    """The CSV file of QGroundControl, in SI units."""
    moment = pd.Timestamp("2024-05-01 12:34:56") + pd.to_timedelta(TRUE["t_s"], unit="s")
    return pd.DataFrame({
        "Timestamp": moment.dt.strftime("%Y-%m-%d %H:%M:%S.%f").str[:-3], "roll": TRUE["roll_deg"],
        "groundSpeed": np.hypot(TRUE["vn_mps"], TRUE["ve_mps"]), "airSpeed": INDICATED_MPS,
        "climbRate": -TRUE["vd_mps"], "altitudeRelative": TRUE["height_m"], "throttlePct": TRUE["throttle_percent"],
        "gps.lat": 48 + NORTH_DEG, "gps.lon": 11 + EAST_DEG, "battery0.voltage": TRUE["voltage_V"],
        "battery0.current": TRUE["current_A"], "battery0.mahConsumed": TRUE["current_A"].cumsum() / 36,
        "clock.currentTime": moment.dt.strftime("%H:%M:%S"),
    })  # fmt: skip


KNOWN = {"EdgeTX": radio(False), "EdgeTX with ELRS": radio(True), "blackbox": blackbox(),
         "mavlogdump.py": printed_telemetry(), "QGroundControl": station()}  # fmt: skip


@pytest.mark.parametrize("recorder", KNOWN)
def test_a_table_of_a_known_program_needs_no_map(recorder: str, tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    KNOWN[recorder].to_csv(path, index=False)
    flight_recording = recording_of(open_source(path))  # type: ignore[arg-type]
    t_s, volt = flight_recording.channels["battery_V"]
    power = volt * np.interp(t_s, *flight_recording.channels["battery_A"])
    true_W = (TRUE["voltage_V"] * TRUE["current_A"]).to_numpy()
    assert np.mean(power) == pytest.approx(np.mean(true_W), rel=0.005)
    for name, column in (("static_Pa", "ps_Pa"), ("gps_north_mps", "vn_mps"), ("gps_east_mps", "ve_mps")):
        channel = flight_recording.channels[name]
        shown = np.interp(TRUE["t_s"], channel.t_s - channel.t_s[0], channel.value)
        assert np.corrcoef(shown, TRUE[column])[0, 1] > 0.98, name
    if recorder != "blackbox":
        pitot = flight_recording.channels["airspeed_pressure_Pa"]
        assert np.mean(np.sqrt(2 * pitot.value / SEA_LEVEL_DENSITY)) == pytest.approx(INDICATED_MPS.mean(), rel=0.003)
    assert any("names of" in note for note in flight_recording.notes)


@pytest.mark.parametrize(
    ("recorder", "change"),
    [
        ("QGroundControl", lambda t: t.assign(airSpeed=t["airSpeed"] * 1.94, groundSpeed=t["groundSpeed"] * 1.94)),
        ("QGroundControl", lambda t: t.assign(altitudeRelative=t["altitudeRelative"] / 0.3048)),
        ("EdgeTX", lambda t: t.assign(**{"ASpd(kts)": t["ASpd(kts)"].to_numpy()[::-1]})),
        ("blackbox", lambda t: t.assign(**{"accSmooth[2] (m/s/s)": -t["accSmooth[2] (m/s/s)"]})),
    ],
    ids=["knots", "feet", "airspeed of another flight", "gravity upside down"],
)
def test_what_the_laws_contradict_needs_a_map_all_the_same(
    recorder: str, change: Callable[[pd.DataFrame], pd.DataFrame], tmp_path: Path
) -> None:
    path = tmp_path / "flight.csv"
    change(KNOWN[recorder]).to_csv(path, index=False)
    with pytest.raises(InputError, match="columns need a map"):
        open_source(path)


def test_a_receiver_s_supply_is_no_battery(tmp_path: Path) -> None:
    path = tmp_path / "flight.csv"
    radio(False).drop(columns="VFAS(V)").to_csv(path, index=False)
    refused = CliRunner().invoke(app, [str(path), *AIRCRAFT])
    assert isinstance(refused.exception, InputError) and "[battery_voltage]" in str(refused.exception)


@pytest.mark.parametrize("missing", [("battery_voltage",), ("height", "static_pressure", "velocity_down")])
def test_a_map_that_lacks_what_a_curve_needs_is_reported_so(missing: tuple[str, ...], tmp_path: Path) -> None:
    quantities = ("time", "true_airspeed", "height", "static_pressure", "velocity_north", "velocity_east",
                  "velocity_down", "battery_voltage", "battery_current")  # fmt: skip
    path = written(tmp_path, TRUE, map_text({name: MAP[name] for name in quantities if name not in missing}))
    refused = CliRunner().invoke(app, [str(path), *AIRCRAFT])
    assert isinstance(refused.exception, InputError) and f"[{missing[0]}]" in str(refused.exception)
    assert "--mass" not in str(refused.exception)


def test_matrices_are_read_along_either_axis(tmp_path: Path) -> None:
    velocity = FEW[["vn_mps", "ve_mps", "vd_mps"]].to_numpy()
    for name, matrix in (("down.mat", velocity), ("across.mat", velocity.T)):
        inside = {"times": FEW["t_s"].to_numpy(), "response": {"v": matrix, "slow": np.arange(30.0)}}
        savemat(tmp_path / name, {"data": inside})
        table = read_table(tmp_path / name)
        for i in range(3):
            assert table.columns[f"data.response.v({i + 1})"] == pytest.approx(velocity[:, i])
        assert "data.response.slow (30 values)" in table.left_out[0] and "data.response.slow" not in table.columns


def test_a_structure_of_matlab_is_drafted(tmp_path: Path) -> None:
    inside = {
        "times": TRUE["t_s"].to_numpy(), "airspeed": TRUE["tas_mps"].to_numpy(),
        "v": TRUE[["vn_mps", "ve_mps", "vd_mps"]].to_numpy().T, "altitude": TRUE["height_m"].to_numpy(),
        "battery_voltage": TRUE["voltage_V"].to_numpy(), "battery_current": TRUE["current_A"].to_numpy(),
    }  # fmt: skip
    path = tmp_path / "flight.mat"
    savemat(path, {"log": inside})
    (tmp_path / "flight.mat.columns.toml").write_text(draft(path))
    flight_recording = recording_of(open_source(path))  # type: ignore[arg-type]
    assert flight_recording.channels["battery_A"].value == pytest.approx(TRUE["current_A"].to_numpy())
    assert flight_recording.channels["gps_down_mps"].value == pytest.approx(TRUE["vd_mps"].to_numpy())


def test_telemetry_that_mission_planner_wrote_as_a_mat_file_is_reported(tmp_path: Path) -> None:
    days = 739000 + TRUE["t_s"].to_numpy() / 86400
    savemat(tmp_path / "a.mat", {"airspeed_mavlink_vfr_hud_t": np.column_stack([days, TRUE["tas_mps"]])})
    with pytest.raises(InputError, match=r"analyze the \.tlog"):
        draft(tmp_path / "a.mat")


def test_pandas_reads_the_same(tmp_path: Path) -> None:
    """pandas is a second reader of a plain table."""
    path = tmp_path / "flight.csv"
    path.write_text(text_of(TRUE))
    other = pd.read_csv(io.StringIO(path.read_text()))
    for name, value in read_columns(path).items():
        assert value == pytest.approx(other[name].to_numpy(), abs=0)


def test_a_table_with_nothing_but_times_is_drafted_with_them_alone(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time [s],x\n" + "".join(f"{0.1 * i:.1f},{i % 3}\n" for i in range(50)))
    assert "[time]" in draft(tmp_path / "a.csv") and "# Not used: x" in draft(tmp_path / "a.csv")


def test_marks_below_the_names_are_no_names(tmp_path: Path) -> None:
    """A speed controller's log has a line of True below its names. It has no time, which the message says with its
    names."""
    head = "# Sample Time: 0.200\nThrottle , Voltage , Current \nTrue , True , True \n"
    path = tmp_path / "controller.csv"
    path.write_text(head + "".join(f"{1 + k % 3}.0 , {40 + k % 2}.5 , {k % 7}.1 \n" for k in range(60)))
    assert [*read_columns(path)] == ["Throttle", "Voltage", "Current"] and read_columns(path)["Voltage"].max() == 41.5
    with pytest.raises(
        InputError, match="none ascends as one; it has Throttle, Voltage, Current: write the clock into a column"
    ):
        draft(path)


def test_single_impossible_heights_are_left_out(tmp_path: Path) -> None:
    """A height of 60 km, where the formula of the atmosphere has no pressure, made NumPy warn."""
    table = TRUE.assign(height_m=TRUE["height_m"].where(TRUE.index % 50 != 7, 60_000.0))
    path = tmp_path / "flight.csv"
    table.drop(columns="ps_Pa").to_csv(path, index=False)
    Path(f"{path}.columns.toml").write_text(draft(path))
    pressure = np.array(log_of_table(path).entries["/static"].columns["pressure_Pa"].numbers)
    assert np.isfinite(pressure).all() and pressure.min() > 98_000


def jeti_log(table: pd.DataFrame) -> str:
    """A log of a Jeti radio: each sensor at its own times, whole numbers with a count of decimals, packed positions."""
    sensors = {  # device, number: names, unit, type, decimals, values, and how often they are sent
        ("4290001", "1"): ("MSPEED", "Velocity", "km/h", 1, 1, 3.6 * INDICATED_MPS, 2),
        ("4290002", "2"): ("MVario2", "Altitude", "m", 4, 1, table["height_m"], 3),
        ("4290003", "1"): ("MUI-75", "Voltage", "V", 1, 2, table["voltage_V"], 5),
        ("4290003", "2"): ("MUI-75", "Current", "A", 1, 1, table["current_A"], 5),
    }  # fmt: skip
    head = ["# A model", *(f"000000000;{device};0;{names[0]};" for (device, _), names in sensors.items())]
    head += [f"000000000;{device};{number};{of[1]};{of[2]}" for (device, number), of in sensors.items()]
    head += ["000000000;4290004;0;MGPS;", "000000000;4290004;2;Latitude; ", "000000000;4290004;3;Longitude; "]
    lines = []
    for i, t_s in enumerate(table["t_s"]):
        ms = f"{round(1000 * t_s) + 5000:09d}"
        for (device, number), (_, _, _, kind, decimals, values, every) in sensors.items():
            if i % every == 0:
                lines.append(f"{ms};{device};{number};{kind};{decimals};{round(10**decimals * values.iloc[i])}")
        if i % 10 == 0:
            north, west = (divmod(abs(x.iloc[i] + origin), 1) for x, origin in ((NORTH_DEG, 48.0), (EAST_DEG, -11.5)))
            places = [(int(degrees) << 16) + round(60_000 * part) for degrees, part in (north, west)]
            lines.append(f"{ms};4290004;2;9;0;{places[0]};3;9;3;{places[1]}")
    return "\n".join([*head, *lines, "000099999;4290001;1;1", "000100000;4290003;2;1;x;12"])


def test_a_log_of_a_jeti_radio_needs_no_map(tmp_path: Path) -> None:
    """Its numbers are those of the sensors, each at its own times; South and West are negative."""
    path = tmp_path / "flight.log"
    path.write_text(jeti_log(TRUE), "latin-1")
    columns = read_columns(path)
    t_s = columns["Time [s]"]
    for name, truth, step in (
        ("MUI-75 Current [A]", TRUE["current_A"], 0.1), ("MVario2 Altitude [m]", TRUE["height_m"], 0.1),
        ("MGPS Latitude [°]", 48.0 + NORTH_DEG, 1 / 60_000), ("MGPS Longitude [°]", EAST_DEG - 11.5, 1 / 60_000),
    ):  # fmt: skip
        finite = np.isfinite(columns[name])
        assert np.abs(columns[name][finite] - np.interp(t_s[finite], TRUE["t_s"], truth)).max() < 0.51 * step
    assert np.isfinite(columns["MUI-75 Voltage [V]"]).sum() == len(TRUE) // 5
    log = open_source(path)
    assert isinstance(log, Log) and log.entries["/battery"] and "a Jeti radio" in log.metadata["table"]["note"]
    q_Pa = np.array(log.entries["/probe/airspeed"].columns["differential_pressure_Pa"].numbers)
    assert np.median(q_Pa) == pytest.approx(SEA_LEVEL_DENSITY / 2 * np.median(INDICATED_MPS) ** 2, rel=0.005)
    assert len(log.entries["/gps"])


def test_a_radio_that_logs_no_motion_needs_a_map(tmp_path: Path) -> None:
    """Its known column names include neither airspeed nor position; other columns may exist."""
    table = pd.DataFrame({"Time": TRUE["t_s"], "RSSI(dB)": 80, "VFAS(V)": TRUE["voltage_V"], "v": TRUE["tas_mps"]})
    table.to_csv(tmp_path / "flight.csv", index=False)
    with pytest.raises(InputError, match="a table, whose columns need a map"):
        log_of_table(tmp_path / "flight.csv")


def test_matlab_structures_keep_their_own_times(tmp_path: Path) -> None:
    """Air data at 10 Hz, a battery at 1 Hz and a receiver at 5 Hz half a step later: each value is at its own time."""
    slow, later = TRUE.iloc[::10], TRUE.iloc[1::2]
    structures = {
        "air": {"t": TRUE["t_s"], "airspeed": TRUE["tas_mps"], "altitude": TRUE["height_m"]},
        "battery": {"t": slow["t_s"], "voltage": slow["voltage_V"], "current": slow["current_A"]},
        "gps": {"t": later["t_s"] + 0.05, "vn": later["vn_mps"], "ve": later["ve_mps"], "vd": later["vd_mps"]},
    }
    arrays = {name: {field: x.to_numpy() for field, x in of.items()} for name, of in structures.items()}
    savemat(tmp_path / "log.mat", {"log": arrays, "notes": np.arange(33.0)})
    table = read_table(tmp_path / "log.mat")
    for name, of in arrays.items():
        for field in of.keys() - {"t"}:
            finite = np.isfinite(table.columns[f"log.{name}.{field}"])
            np.testing.assert_allclose(table.columns["t"][finite], of["t"], atol=1e-5)
            np.testing.assert_array_equal(table.columns[f"log.{name}.{field}"][finite], of[field])
    assert table.left_out == ("Left out, since they have no clock of their own: notes (33 values)",)
    path = tmp_path / "columns.toml"
    path.write_text(draft(tmp_path / "log.mat"))
    assert {"battery_current", "velocity_north", "true_airspeed", "height"} <= set(load_map(path).columns)
    log = log_of_table(tmp_path / "log.mat")
    current = np.array(log.entries["/battery"].columns["current_A"].numbers)
    np.testing.assert_allclose(current, arrays["battery"]["current"])


def test_a_matlab_vector_without_numbers_is_named(tmp_path: Path) -> None:
    columns = {name: TRUE[name].to_numpy() for name in ("t_s", "tas_mps", "height_m")}
    savemat(tmp_path / "flight.mat", columns | {"empty": np.full(len(TRUE), np.nan)})
    table = read_table(tmp_path / "flight.mat")
    assert table.columns.keys() == columns.keys() and "empty (of 4200 values too few are numbers)" in table.left_out[0]


@pytest.mark.parametrize(("decimals", "sign"), [(0, 1), (1, 1), (2, -1), (3, -1)])
def test_jeti_marks_south_and_west_by_the_second_bit(decimals: int, sign: int) -> None:
    """The first bit distinguishes longitude from latitude; the value is 11 degrees and 30.5 minutes."""
    packed = (11 << 16) + 30_500
    columns = read_jeti(f"000000000;7;0;MGPS;\n000000000;7;2;Place; \n000000100;7;2;9;{decimals};{packed}\n")
    assert columns["MGPS Place [°]"] == pytest.approx([sign * (11 + 30.5 / 60)])
