"""`calibrate thrust`: the ratio of thrust on a stand to the table, its error, what it refuses, and its use."""

import re
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from flightpower.analysis.air.contents import Replacements, contents
from flightpower.analysis.air.thrust_stand import THRUST_STAND_FILE
from flightpower.analysis.calibrations.thrust import StandReadings, calibrate, doubts, read_stand
from flightpower.analysis.cli.calibrate import app
from flightpower.flight.aircraft import load_aircraft, parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller import Propeller, Row
from flightpower.flight.propeller_files import load_propeller

TABLE = load_propeller("apc-12x8e")
RPM = np.array([3000.0, 4000, 5000, 6000, 7000, 6500, 5500, 4500, 3500])
RHO = 1.2


def readings(ratio: float = 1.03, noise: float = 0.0, by_speed: float = 0.0, seed: int = 0) -> StandReadings:
    """Readings of `ratio` times the table's thrust, with relative noise; the ratio grows by `by_speed` per 1000 rpm."""
    n = RPM / 60
    table_N = TABLE.thrust_and_power(np.zeros(len(n)), n, RHO)[0]
    factor = ratio + by_speed * (RPM - RPM.mean()) / 1000 + noise * np.random.default_rng(seed).standard_normal(len(n))
    return StandReadings(n, table_N * factor, np.full(len(n), RHO))


def write(path: Path, stand_readings: StandReadings, header: str = "motor_speed_rpm,thrust_N") -> Path:
    lines = [f"{60 * n},{thrust}" for n, thrust in zip(stand_readings.revps, stand_readings.thrust_N, strict=True)]
    path.write_text("\n".join([header, *lines]))
    return path


def run(*arguments: object):
    return CliRunner().invoke(app, ["thrust", *map(str, arguments)])


AIR = ("--pressure", "1013.25 hPa", "--temperature", "15 degC")


def test_errors_are_those_of_repeated_measurements() -> None:
    """500 stands with 1 % of noise and 1 % of scale error: errors over stated errors scatter as Student's t."""
    rng = np.random.default_rng(1)
    off = []
    for seed in range(500):
        result, unsupported = calibrate(
            readings(1.03 * (1 + 0.01 * rng.standard_normal()), 0.01, seed=seed), TABLE, 0.01, ""
        )
        assert not unsupported
        off.append((result.ratio - 1.03) / result.ratio_error)
    assert 0.85 < np.sqrt(np.mean(np.square(off))) < 1.05
    assert 0.93 < np.mean(np.abs(off) < 1.96) < 0.99


def test_a_ratio_that_changes_with_motor_speed_is_less_certain() -> None:
    constant, _ = calibrate(readings(noise=0.003), TABLE, 0.01, "stand.csv")
    result, _ = calibrate(readings(noise=0.003, by_speed=0.02), TABLE, 0.01, "stand.csv")
    assert constant.speed_error == 0 and constant.ratio_error < 0.011
    assert result.speed_error == pytest.approx(0.02 * 4 / 2, rel=0.1)
    assert result.scatter_error < 0.005 and result.ratio_error > result.speed_error
    change = 100 * 0.02 * 4  # percent, from 3000 to 7000 rpm
    (doubt,) = doubts(result, readings(), TABLE, None)
    assert float(re.findall(r"changes by (\S+) %", doubt)[0]) == pytest.approx(change, rel=0.1)
    assert not doubts(constant, readings(), TABLE, None)


def test_the_command_writes_a_file_that_replaces_the_aircraft_files_ratio(tmp_path: Path) -> None:
    """Density of the standard atmosphere is 1.225, so thrust at 1.2 is 2 % less; the printed lines have the same
    effect."""
    table, output = write(tmp_path / "stand.csv", readings(1.03 * 1.225 / 1.2)), tmp_path / "stand.json"
    arguments = (table, "--propeller", "apc-12x8e", *AIR, "-o", output)
    outcome = run(*arguments)
    assert outcome.exit_code == 0 and "thrust at rest is 1.030 ± 0.020 (95 % interval)" in outcome.output
    result = THRUST_STAND_FILE.load(output)
    aircraft = result.applied_to(load_aircraft("nexstar"))
    assert aircraft.propulsion.static_thrust_ratio == pytest.approx(1.03)
    assert aircraft.uncertainty.static_thrust_ratio_fraction == pytest.approx(0.01)
    sections = outcome.output.split("aircraft file:\n")[1]
    propulsion, uncertainty = sections.split("\n\n")
    text = (
        load_aircraft("nexstar").text.partition("[uncertainty]")[0].replace("[propulsion]", propulsion)
        + "\n"
        + uncertainty
    )
    assert parse_aircraft(text, "mine.toml").propulsion.static_thrust_ratio == pytest.approx(1.03, abs=1e-4)
    again = run(*arguments)
    assert "exists already; give --replace" in str(again.exception)
    result.check_table(TABLE, "stand.json")
    with pytest.raises(InputError, match=r"stand.json: thrust .* another table \(apc-12x8e\) .* \(blade-11x5\)"):
        result.check_table(load_propeller("blade-11x5"), "stand.json")


def test_units_are_those_of_the_header_and_density_may_be_in_the_file(tmp_path: Path) -> None:
    header = "motor_speed [rev/min],thrust [kN],pressure [hPa],temperature_degC"
    n, thrust, _ = readings(1.03 * 1.225 / 1.2)
    lines = [f"{60 * a},{b / 1000},1013.25,15" for a, b in zip(n, thrust, strict=True)]
    (tmp_path / "stand.csv").write_text("\n".join([header, *lines]))
    outcome = run(tmp_path / "stand.csv", "--propeller", "apc-12x8e", "-o", tmp_path / "stand.json")
    assert "thrust at rest is 1.030" in outcome.output, outcome.output


SHORT = Propeller("short", TABLE.diameter_m, tuple(replace(r, J=r.J[1:], cT=r.cT[1:], cP=r.cP[1:]) for r in TABLE.rows))


@pytest.mark.parametrize(
    ("chosen", "table", "factor", "message"),
    [
        (slice(0, 4), TABLE, 1.0, "4 readings at 4 motor speeds; measure 5 at 3 speeds"),
        ([0, 0, 0, 1, 1, 1], TABLE, 1.0, "6 readings at 2 motor speeds"),
        (slice(None), SHORT, 1.0, "propeller short: its table begins at J = 0.06"),
        (slice(None), TABLE, 9.81, "thrust is 10 times that of propeller apc-12x8e; check the units"),
    ],
)
def test_readings_and_tables_that_cannot_be_compared_are_refused(chosen, table, factor, message: str) -> None:
    n, thrust, rho = (values[chosen] for values in readings())
    with pytest.raises(InputError, match=message):
        calibrate(StandReadings(n, factor * thrust, rho), table, 0.01, "stand.csv")


@pytest.mark.parametrize(
    ("header", "options", "message"),
    [
        ("motor_speed_rpm,thrust_N", (), "the air density is not known"),
        ("motor_speed_rpm,power_W", AIR, "column 'power_W': must be one of"),
        ("motor_speed_rpm,thrust_furlong", AIR, "cannot be read as a quantity in N"),
        ("motor_speed_rpm", AIR, "no column thrust"),
        ("motor_speed_rpm,thrust_N,pressure_hPa", AIR, "not a number in every line"),
    ],
)
def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path, header: str, options, message: str) -> None:
    outcome = run(
        write(tmp_path / "s.csv", readings(), header), "--propeller", "apc-12x8e", *options, "-o", tmp_path / "o"
    )
    assert isinstance(outcome.exception, InputError) and message in str(outcome.exception)


def test_a_thrust_that_pulls_backward_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "s.csv"
    file.write_text("# on the bench\nmotor_speed [rev/min],thrust_gf\n6000,500\n5000,-350\n")
    with pytest.raises(InputError, match=r"s\.csv: thrust_N is -3\.432 in a line; it must be positive"):
        read_stand(file, 1.2)


def test_a_ratio_that_stays_uncertain_is_not_written(tmp_path: Path) -> None:
    table, output = write(tmp_path / "stand.csv", readings(noise=0.4)), tmp_path / "stand.json"
    outcome = run(table, "--propeller", "apc-12x8e", *AIR, "-o", output)
    assert outcome.exit_code == 1 and "the standard error of the ratio is" in outcome.output and not output.exists()


def test_the_error_of_a_ratio_is_reported_relative_to_it(tmp_path: Path) -> None:
    """If all thrusts are scaled by four fifths, so is the ratio, with the same error in percent."""
    outcomes = [
        run(write(tmp_path / "s.csv", readings(ratio, noise)), "--propeller", "apc-12x8e", *AIR, "-o", tmp_path / "o")
        for ratio, noise in ((1.0, 0.4), (0.8, 0.32))
    ]
    first, second = (re.findall(r"error of the ratio is ([\d.]+) %", outcome.output) for outcome in outcomes)
    assert first == second and len(first) == 1


def test_a_table_with_one_speed_of_rotation_is_compared() -> None:
    row = Row(5000.0, (0.0, 0.4, 0.8), (0.1, 0.07, 0.01), (0.05, 0.05, 0.02))
    table = Propeller("one row", 0.3, (row,))
    n = RPM / 60
    result, _ = calibrate(StandReadings(n, 1.02 * 0.1 * RHO * n**2 * 0.3**4, np.full(len(n), RHO)), table, 0.0, "s")
    assert result.ratio == pytest.approx(1.02) and result.ratio_error == pytest.approx(0, abs=1e-12)


def test_an_analysis_takes_the_file_in_place_of_the_aircraft_files_ratio_and_of_no_other_table() -> None:
    """Keys of the aircraft file belong to its own propeller: with another table they are ignored, and a note says
    so."""
    text = (
        load_aircraft("nexstar")
        .text.partition("[uncertainty]")[0]
        .replace("[propulsion]", "[propulsion]\nstatic_thrust_ratio = 1.07")
    )
    log = Log(Path("log.mcap"), attachments={"aircraft.toml": text.encode(), "propeller.csv": TABLE.to_csv().encode()})
    with_probe = Replacements(probe=SimpleNamespace())  # type: ignore[arg-type]
    result, _ = calibrate(readings(), TABLE, 0.01, "stand.csv")
    assert contents(log, with_probe).aircraft.propulsion.static_thrust_ratio == 1.07
    replaced = contents(log, with_probe._replace(thrust_stand=result))
    assert replaced.aircraft.propulsion.static_thrust_ratio == result.ratio and replaced.thrust_stand is result
    other = load_propeller("blade-11x5")
    left_out = contents(log, with_probe._replace(propeller=other))
    assert left_out.aircraft.propulsion.static_thrust_ratio is None
    assert "belongs to the propeller apc-12x8e and is not used with blade-11x5" in left_out.notes[0]
    with pytest.raises(InputError, match=r"mine/stand.json: thrust on the stand was compared with another table"):
        files = {"thrust_stand.json": "mine/stand.json"}
        contents(log, with_probe._replace(propeller=other, thrust_stand=result, files=files))
