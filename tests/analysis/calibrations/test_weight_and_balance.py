"""Weight and center of gravity from scales: statics, and error limits that contain the truth."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from flightpower.analysis.calibrations.weight_and_balance import ScaleErrors, Support, weighed
from flightpower.analysis.cli.calibrate import app
from flightpower.flight.aircraft import load_aircraft, parse_aircraft

ERRORS = ScaleErrors(reading_kg=0.005, gain=0.001, position_m=0.002)


def test_moments_balance() -> None:
    weight_and_balance = weighed([Support(0.1, (1.0,)), Support(0.5, (2.9, 3.1))], ERRORS)
    assert (weight_and_balance.mass_kg, weight_and_balance.position_m) == pytest.approx((4.0, 0.4))


def test_errors_are_those_of_repeated_weighings() -> None:
    """300 weighings of one aircraft on three wheels: the ratio of scatter to stated error."""
    rng = np.random.default_rng(0)
    x, mass = np.array([0.02, 0.38, 0.38]), np.array([0.5, 1.8, 1.8])
    ratios = []
    for _ in range(300):
        readings = (mass + 0.005 * rng.standard_normal(3)) * (1 + 0.001 * rng.standard_normal())
        placed_m = x + 0.002 * rng.standard_normal(3)
        supports = [Support(p, (m,)) for p, m in zip(placed_m.tolist(), readings.tolist(), strict=True)]
        balance = weighed(supports, ERRORS)
        ratios.append([(balance.mass_kg - 4.1) / balance.mass_error_kg,
                      (balance.position_m - x @ mass / 4.1) / balance.position_error_m])  # fmt: skip
    assert np.sqrt(np.mean(np.square(ratios), axis=0)) == pytest.approx([1.0, 1.0], abs=0.15)


def test_the_sections_are_ones_that_an_aircraft_file_takes(tmp_path: Path) -> None:
    output = tmp_path / "weight.toml"
    arguments = ["weight-and-balance", "--scale", "2 cm: 500 502 g", "--scale", "0.38 m: 3.6 kg", "-o", str(output)]
    outcome = CliRunner().invoke(app, arguments)
    assert outcome.exit_code == 0 and "center of gravity 336.0 ± " in outcome.output, outcome.output
    mass, uncertainty = output.read_text("utf-8").split("\n\n")
    weight = next(line for line in mass.splitlines() if line.startswith("weight"))
    lines = load_aircraft("nexstar").text.partition("[uncertainty]")[0].splitlines()
    text = "\n".join(weight if line.startswith("weight ") else line for line in lines)
    aircraft = parse_aircraft(f"{text}\n{uncertainty}", "mine.toml")
    assert aircraft.mass_kg == pytest.approx(4.101)
    assert 0.001 < aircraft.uncertainty.weight_fraction < 0.003


def test_readings_that_contradict_each_other_are_not_written(tmp_path: Path) -> None:
    output = tmp_path / "weight.toml"
    outcome = CliRunner().invoke(app, ["weight-and-balance", "--scale", "4.1 4.2 kg", "-o", str(output)])
    assert outcome.exit_code == 1 and "support 1 differ by 100 g" in outcome.output and not output.exists()


def test_a_scale_worse_than_two_per_cent_is_said_to_be() -> None:
    supports = [Support(0.1, (2.0,)), Support(0.5, (2.0,))]
    good, bad = (weighed(supports, ScaleErrors(0.0, gain, 0.002)) for gain in (0.018, 0.031))
    assert not good.unsupported and "of the weight is 3.1 %, more than 2 %" in bad.unsupported


def test_repeated_readings_average_and_their_scatter_counts_where_it_is_larger() -> None:
    """Four readings halve the error of one reading, both the stated error and the one estimated from scatter."""
    exactly = ScaleErrors(reading_kg=0.005, gain=0.0, position_m=0.0)
    four = weighed([Support(0.1, (2.0,) * 4), Support(0.5, (2.0,) * 4)], exactly)
    assert four.mass_error_kg == pytest.approx(0.005 / 2 * np.sqrt(2))
    # A reading's error moves the center of gravity, 0.2 m from either support, by 0.2 m times the error over the mass.
    assert four.position_error_m == pytest.approx(0.2 / 4.0 * 0.0025 * np.sqrt(2))
    scattered = weighed([Support(0.1, (1.98, 2.02, 1.98, 2.02))], exactly)
    assert scattered.mass_error_kg == pytest.approx(np.std([1.98, 2.02] * 2, ddof=1) / 2)
