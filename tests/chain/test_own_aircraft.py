"""An aircraft file of four keys gives a curve from a log, and whatever a log lacks can be given."""

import json
from pathlib import Path

import numpy as np
import pytest
from running import command, done, rewritten

pytestmark = pytest.mark.xdist_group("chain")

FOUR_KEYS = """name = "mine"
[geometry]
span = "5.73 ft"
wing_area = "4.99 ft^2"
[mass]
weight = "8.47 lb"
"""


def results(folder: Path) -> dict:
    return json.loads((folder / "results.json").read_text("utf-8"))


def curve(folder: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    points = results(folder)["power_required"]
    return tuple(np.array([point[name] for point in points]) for name in ("speed_mps", "power_lo_W", "power_hi_W"))


@pytest.fixture(scope="module")
def four(flown: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("four")
    (folder / "mine.toml").write_text(FOUR_KEYS)
    done("analyze", flown / "log.mcap", "--aircraft", folder / "mine.toml", "-o", folder / "report", "--quiet")
    return folder


def test_four_keys_give_a_curve_that_contains_the_truth_and_is_wider_than_with_all(flown: Path, four: Path) -> None:
    V, low, high = curve(four / "report")
    truth = np.loadtxt(flown / "truth_power_required.csv", delimiter=",", skiprows=1, usecols=(0, 1))
    true = np.interp(V, *truth.T)
    assert np.all((low < true) & (true < high))
    all_V, all_low, all_high = curve(flown / "log.report")
    assert np.all(high - low > np.interp(V, all_V, all_high - all_low))


def test_the_results_say_what_stood_in_and_what_was_left_out(four: Path) -> None:
    warnings = " ".join(results(four / "report")["warnings"])
    for key in ("probe.upwash_per_CL", "probe.position", "imu_position", "propulsion.battery_energy"):
        assert f"lacks {key}" in warnings
    assert "narrower" in warnings and "--battery-Wh" in warnings
    assert results(four / "report")["use"] is None
    assert results(four / "report")["cross_check"]


def test_a_battery_is_enough_for_endurance(flown: Path, four: Path, tmp_path: Path) -> None:
    done(
        "analyze", flown / "log.mcap", "--aircraft", four / "mine.toml", "--battery-Wh", "74", "--quiet",
        "-o", tmp_path / "report",
    )  # fmt: skip
    mine, known = (results(path)["use"]["loadings"][0] for path in (tmp_path / "report", flown / "log.report"))
    assert mine["endurance_s"]["lo"] < known["endurance_s"]["value"] < mine["endurance_s"]["hi"]


def test_weight_replaces_that_of_the_aircraft_file(flown: Path, tmp_path: Path) -> None:
    done("analyze", flown / "log.mcap", "--weight", "4.1 kg", "-o", tmp_path / "report", "--quiet")
    assert results(tmp_path / "report")["test"]["weight_N"] == pytest.approx(4.1 * 9.80665)
    same = tmp_path / "same"
    done("analyze", flown / "log.mcap", "--weight", "8.47 lbf", "-o", same, "--quiet")
    assert results(same)["power_required"] == results(flown / "log.report")["power_required"]


def test_a_log_without_attachments_is_analysed_with_files(flown: Path, four: Path, tmp_path: Path) -> None:
    bare = tmp_path / "bare.mcap"
    rewritten(flown, bare, without_attachment="probe.json")
    done("analyze", bare, "--probe", flown / "probe.json", "-o", tmp_path / "report", "--quiet")
    assert results(tmp_path / "report")["power_required"] == results(flown / "log.report")["power_required"]


@pytest.mark.parametrize("option", ["--probe", "--zero"])
def test_a_wrong_replacement_names_its_file(flown: Path, tmp_path: Path, option: str) -> None:
    mine = tmp_path / "mine.json"
    mine.write_text("{")
    for path in (mine, tmp_path / "none.json"):
        outcome = command("analyze", flown / "log.mcap", option, path, "-o", tmp_path / "report")
        assert outcome.returncode == 2
        (line,) = outcome.stderr.strip().splitlines()
        assert line.startswith("error: ") and path.name in line
        assert not (tmp_path / "report").exists()
