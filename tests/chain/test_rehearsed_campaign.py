"""The campaign that docs/use/many-flights.md rehearses: its first flights, and printed values against the truth."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from flightpower.sim.truth import read_truth
from tests.documented_commands import ROOT, do, every_one_of, run, same, steps_in

# tests/sim/test_command_line.py also tests the errors of an installation, and tests/analysis/flights the comparison.
pytestmark = [pytest.mark.xdist_group("chain"), pytest.mark.thorough]

PAGE = ROOT / "docs" / "use" / "many-flights.md"
ROW = re.compile(r"│ +([\d.]+) │ +[\d.]+ │ +[\d.]+ │ +([-+\d.]+) │ +([-+\d.]+) to ([-+\d.]+) │")
SAID = re.compile(r"is ([\d.]+) %; at 11.5 m/s it is ([\d.]+) %")
OF_THE_INSTALLATION = ("alpha_offset_rad", "V_scale", "thrust_scale")


def truth_W(folder: Path, V: np.ndarray) -> np.ndarray:
    curve = np.loadtxt(folder / "truth_power_required.csv", delimiter=",", skiprows=1, usecols=(0, 1))
    return np.asarray(np.interp(V, *curve.T))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder after the page's steps up to the first flight of each configuration, which it compares."""
    folder = tmp_path_factory.mktemp("rehearsal")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for step in steps_in(PAGE):
            if step.command.startswith("for "):
                code, printed = run(every_one_of(step.command)[0])
                assert code == 0 and same(step.shown[0], printed[0]), printed
            elif not step.command:
                do(step)
        for name in ("gear/1", "clean/6"):
            code, printed = run(f"analyze {name}/log.mcap --quiet -o out/{name.partition('/')[0]}")
            assert code == 0, printed
        code, printed = run("analyze compare out/clean out/gear -o out/difference")
        assert code == 0, printed
    return folder


def test_the_page_shows_ten_flights_and_a_comparison_that_contains_the_truth(folder: Path) -> None:
    """To renew the outputs: python -m tests.documented_commands docs/use/many-flights.md"""
    loops = [step for step in steps_in(PAGE) if step.command.startswith("for ")]
    assert [len(every_one_of(step.command)) for step in loops] == [5, 5]
    shown = steps_in(PAGE)[-1].shown
    V, percent, low, high = np.array([row.groups() for line in shown if (row := ROW.match(line))], dtype=float).T
    true = 100 * (truth_W(folder / "gear" / "1", V) / truth_W(folder / "clean" / "6", V) - 1)
    assert len(V) > 5 and np.all((low < true) & (true < high))
    assert np.all(low > 0) and np.all(np.abs(percent - true) < 4)
    (match,) = SAID.findall(PAGE.read_text("utf-8"))
    assert np.allclose(np.array(match, dtype=float), true[[-1, 0]], atol=0.1)


def test_a_flight_of_each_configuration_shows_the_difference_less_accurately(folder: Path) -> None:
    differences = json.loads((folder / "out" / "difference" / "results.json").read_text("utf-8"))["differences"]
    V, low, high = (
        np.array([difference[name] for difference in differences]) for name in ("speed_mps", "lo_percent", "hi_percent")
    )
    true = 100 * (truth_W(folder / "gear" / "1", V) / truth_W(folder / "clean" / "6", V) - 1)
    assert np.all((low < true) & (true < high))


def test_errors_of_probe_and_propeller_are_those_of_the_installation(folder: Path) -> None:
    item, other = (read_truth(folder / name / "truth.parquet")[1]["errors"] for name in ("gear/1", "clean/6"))
    for name in OF_THE_INSTALLATION:
        assert item["values"][name] == other["values"][name] != 0
    assert item["imu_rotation"] == other["imu_rotation"] and item["accel_bias"] != other["accel_bias"]
