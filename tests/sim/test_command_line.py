"""The commands as a person types them: what they write, and one clear line with exit code 2 when they cannot."""

import json
import sys
from datetime import UTC, datetime
from importlib import resources

import pandas as pd
import pytest
from typer.testing import CliRunner

from flightpower.analysis.sources.daemon import first_ns, fix_of_log
from flightpower.flight.aircraft import aircraft_text
from flightpower.flight.log_reader import read_log
from flightpower.sim.truth import read_truth
from flightpower.simulate import app, main

SHORT = """
title = "stand, hop, stand"
[[segment]]
kind = "stand"
duration = "2 s"
[[segment]]
kind = "take-off"
[[segment]]
kind = "hold"
duration = "3 s"
[[segment]]
kind = "land"
"""

BAD_PLANS = {
    "slow": '[[segment]]\nkind = "hold"\nduration = "2 s"\nspeed = "8 m/s"\n',
    "fast": '[[segment]]\nkind = "hold"\nduration = "2 s"\nspeed = "50 m/s"\n',
    "steep": '[[segment]]\nkind = "climb"\nheight = "200 m"\nclimb = "12 m/s"\n',
    "broken": "[[segment\n",
    "upset": '[pilot]\npitch = -3.0\n[[segment]]\nkind = "hold"\nduration = "60 s"\n',
}


@pytest.fixture
def sim(monkeypatch, capsys, tmp_path):
    """Run the command in an empty directory; return exit code and stderr."""
    monkeypatch.chdir(tmp_path)

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["sim", *arguments])
        with pytest.raises(SystemExit) as stopped:
            main()
            raise SystemExit(0)
        return stopped.value.code or 0, capsys.readouterr().err.strip()

    (tmp_path / "short.toml").write_text(SHORT, "utf-8")
    for name, text in BAD_PLANS.items():
        (tmp_path / f"{name}.toml").write_text(text, "utf-8")
    return run


@pytest.mark.slow
def test_fly_writes_truth_curve_tray_and_log(sim, tmp_path):
    code, _ = sim("fly", "--plan", "short.toml", "--seed", "3", "-o", "out")
    assert code == 0
    out = tmp_path / "out"
    truth, metadata = read_truth(out / "truth.parquet")
    assert metadata["seed"] == "3" and metadata["errors"]["seed"] == 3
    curve = pd.read_csv(out / "truth_power_required.csv")
    assert (curve["power_W"] > 0).all() and curve["speed_mps"].is_monotonic_increasing
    log = read_log(out / "log.mcap")
    assert len(log.entries["/imu"]) == pytest.approx(25 * truth["time_s"].iloc[-1], rel=0.02)
    flown = [
        e.message.differential_pressure_Pa for e in log.entries["/probe/airspeed"] if e.message.differential_pressure_Pa
    ]
    assert max(flown) > 100  # it did fly
    assert log.attachments["probe.json"] == (resources.files("flightpower.sim") / "data" / "probe.json").read_bytes()

    before = (out / "log.mcap").read_bytes()
    code, message = sim("fly", "--plan", "short.toml", "-o", "out")
    assert code == 2 and "already contains" in message and (out / "log.mcap").read_bytes() == before
    code, _ = sim("fly", "--plan", "short.toml", "-o", "out", "--replace")
    assert code == 0 and (out / "log.mcap").read_bytes() != before


def test_a_flight_has_the_date_and_the_installation_s_errors_of_its_aircraft_file(sim, tmp_path):
    """Flights of one installation share its errors without another option, and a campaign has days."""
    file = tmp_path / "named.toml"
    file.write_text(aircraft_text("nexstar")[0] + '[installation]\nname = "may"\n', "utf-8")
    recorded_errors = []
    for seed in ("1", "2"):
        words = ("--aircraft", "named.toml", "--seed", seed, "--date", f"2026-05-0{seed}")
        assert sim("fly", "-o", seed, "--plan", "short.toml", "--no-hardware", *words)[0] == 0
        log = read_log(tmp_path / seed / "log.mcap")
        assert fix_of_log(log, first_ns(log)).unix_at_zero_s == pytest.approx(
            datetime(2026, 5, int(seed), 9, 30, tzinfo=UTC).timestamp(), abs=10.0
        )
        recorded_errors.append(read_truth(tmp_path / seed / "truth.parquet")[1]["errors"])
    assert (
        recorded_errors[0]["imu_rotation"] == recorded_errors[1]["imu_rotation"]
        and recorded_errors[0]["accel_bias"] != recorded_errors[1]["accel_bias"]
    )


def test_another_probe_calibration_is_not_replaced_but_can_be_given(sim, tmp_path):
    (tmp_path / "out").mkdir()
    own_file = tmp_path / "out" / "probe.json"
    own_file.write_text('{"format": "mine"}')
    code, message = sim("fly", "--no-hardware", "--plan", "short.toml", "-o", "out")
    assert code == 2 and "another calibration" in message and "--probe" in message
    code, _ = sim("fly", "--no-hardware", "--plan", "short.toml", "--probe", str(own_file), "-o", "out")
    assert code == 0 and read_log(tmp_path / "out" / "log.mcap").attachments["probe.json"] == own_file.read_bytes()


def test_a_real_log_is_never_replaced(sim, tmp_path):
    (tmp_path / "flight").mkdir()
    (tmp_path / "flight" / "log.mcap").write_bytes(b"a day's work")
    code, message = sim("fly", "--plan", "short.toml", "-o", "flight", "--replace")
    assert code == 2 and "not a simulated flight" in message
    assert (tmp_path / "flight" / "log.mcap").read_bytes() == b"a day's work"


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["fly", "-o", "out", "--aircraft", "spitfire"], "spitfire"),
        (["fly", "-o", "out", "--plan", "missing.toml"], "missing.toml"),
        (["fly", "-o", "out", "--errors", "missing.toml"], "missing.toml"),
        (["fly", "-o", "out", "--probe", "missing.json"], "missing.json"),
        (["fly", "-o", "short.toml/out", "--plan", "short.toml"], "short.toml"),
        (["fly", "-o", "out", "--no-hardware", "--real-time"], "excludes --faults and --real-time"),
        (["fly", "-o", "out", "--as", "px4", "--real-time"], "--as excludes"),
        (["fly", "-o", "out", "--as", "px4", "--date", "2026-05-01"], "leave out --date"),
        (["fly", "-o", "out", "--date", "1 May"], 'write it as "2026-05-01"'),
        (["fly", "-o", "out", "--date", "2026-05-01T12:00"], "give the date alone"),
        (["fly", "-o", "out", "--date", "1969-07-20"], "from 1980 to 2099"),
        (["fly", "-o", "out", "--plan", "slow.toml"], "too slow: nexstar stalls at"),
        (["fly", "-o", "out", "--plan", "fast.toml"], "too fast: nexstar reaches"),
        (["fly", "-o", "out", "--plan", "steep.toml"], "the motor has"),
        (["fly", "-o", "out", "--plan", "broken.toml"], "not valid TOML"),
        (["fly", "-o", "out", "--plan", "upset.toml"], " s: V = "),
        (["trim", "--speed", "5"], "stalls at"),
        (["trim", "--rpm", "20000"], "the motor has"),
        (["modes", "--speed", "90"], "level flight is possible up to"),
        (["plot", "short.toml", "-o", "x.html"], "short.toml"),
    ],
)
def test_bad_input_is_one_line_and_code_2(sim, tmp_path, arguments, expected):
    code, err = sim(*arguments)
    assert code == 2
    assert expected in err and "\n" not in err and err.startswith("sim: ")
    assert not (tmp_path / "out").exists()


def test_trim_modes_and_plot(sim, tmp_path, flight):
    assert sim("trim", "--climb", "1")[0] == 0
    assert sim("trim", "--rpm", "6000")[0] == 0 and sim("trim", "--rpm", "6000", "--speed", "17")[0] == 0
    assert sim("modes")[0] == 0
    from flightpower.sim.truth import write_truth

    write_truth(tmp_path / "truth.parquet", flight.truth, flight.metadata, flight.power_required)
    assert sim("plot", ".", "-o", "flight.html")[0] == 0
    assert (tmp_path / "flight.html").stat().st_size > 100_000
    code, message = sim("plot", ".", "-o", "flight.html")
    assert code == 2 and "exists already" in message


def test_tunnel(sim, tmp_path):
    assert sim("tunnel", "-o", "tunnel.csv")[0] == 0
    first = (tmp_path / "tunnel.csv").read_bytes()
    code, message = sim("tunnel", "-o", "tunnel.csv", "--seed", "2")
    assert code == 2 and "exists already" in message and (tmp_path / "tunnel.csv").read_bytes() == first


def test_a_world_flies_and_its_log_has_the_table_that_the_analysis_gets(sim, tmp_path):
    code, _ = sim("fly", "--plan", "short.toml", "--world", "short-table", "--no-hardware", "-o", "out")
    assert code == 0
    _, metadata = read_truth(tmp_path / "out" / "truth.parquet")
    assert metadata["world"] == "short-table"
    text = read_log(tmp_path / "out" / "log.mcap").attachments["propeller.csv"].decode()
    assert min(float(line.split(",")[2]) for line in text.splitlines() if line[0].isdigit()) >= 0.035
    code, message = sim("fly", "--plan", "short.toml", "--world", "weight", "--errors", "bench", "-o", "again")
    assert code == 2 and "--world" in message
    code, message = sim("fly", "--plan", "short.toml", "--world", "atlantis", "-o", "again")
    assert code == 2 and "short-table" in message


def test_the_true_errors_are_printed_by_axis_and_those_of_size_zero_are_not(sim, tmp_path):
    assert sim("fly", "--plan", "short.toml", "--no-hardware", "--seed", "3", "-o", "out")[0] == 0
    done = CliRunner().invoke(app, ["errors", str(tmp_path / "out")])
    printed = dict(line.split(" = ") for line in done.stdout.splitlines())
    recorded_errors = read_truth(tmp_path / "out" / "truth.parquet")[1]["errors"]
    assert json.loads(printed["hard_iron_T"]) == recorded_errors["hard_iron"] and len(recorded_errors["hard_iron"]) == 3
    assert float(printed["V_scale"]) == recorded_errors["values"]["V_scale"] and "hard_iron" not in printed
    assert recorded_errors["values"]["updraft_mps"] == 0 and "updraft_mps" not in printed
