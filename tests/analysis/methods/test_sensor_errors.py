"""Errors of the propeller table are estimated from drag with residuals that are correlated over some blocks."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.methods.causes import _thrust_errors, error_prior_sigma
from flightpower.analysis.methods.settings import COMPARISON
from flightpower.analysis.methods.thrust_prior import J_REFERENCE
from flightpower.flight.aircraft import Uncertainty, load_aircraft

PAGE = Path(__file__).parents[3] / "docs" / "understand" / "methods.md"
BLOCKS, CORRELATED, SIGMA_MPS2 = 1000, 4, 0.02
FLIGHTS = 200
ERROR_PRIOR_SIGMA = error_prior_sigma(Uncertainty())


def forces(scale: float, slope: float, noise: np.ndarray) -> pd.DataFrame:
    """Return level runs between 12 and 24 m/s, with thrust off its table by `scale` and `slope`, and noise in drag."""
    V = 18.0 + 6.0 * np.sin(np.arange(BLOCKS) / 20)
    qS_over_m = 0.07 * V**2
    CL = 9.81 / qS_over_m
    thrust = 3.0 + 2.0 * np.cos(np.arange(BLOCKS) / 20)
    J = 0.6 + 0.15 * np.sin(np.arange(BLOCKS) / 20 + 0.5)
    drag = qS_over_m * (0.045 - 0.02 * CL + 0.065 * CL**2) - thrust * (scale + slope * (J - J_REFERENCE)) + noise
    columns = {"CL": CL, "CL_squared": CL**2, "CD": drag / qS_over_m, "qS_over_m_mps2": qS_over_m}
    return pd.DataFrame(columns | {"thrust_along_V_over_m_mps2": thrust, "J": J})


def test_standard_errors_of_thrust_are_those_of_noise_that_lasts_four_blocks() -> None:
    """True errors are drawn from their priors; noise is a moving average of four blocks, whose means have four times
    the variance of white noise. Deviations in standard errors have an rms of 1 +- 0.05; three times 0.05 is allowed."""
    rng = np.random.default_rng(0)
    off: dict[str, list[float]] = {"thrust_scale": [], "thrust_slope": []}
    for _ in range(FLIGHTS):
        true = {name: ERROR_PRIOR_SIGMA[name] * rng.standard_normal() for name in off}
        white = rng.normal(0, SIGMA_MPS2, BLOCKS + CORRELATED - 1)
        noise = np.convolve(white, np.ones(CORRELATED) / np.sqrt(CORRELATED), "valid")
        thrust_errors = _thrust_errors(
            forces(true["thrust_scale"], true["thrust_slope"], noise), load_aircraft("nexstar")
        )
        for name, (value, standard_error) in thrust_errors.items():
            assert standard_error < 0.4 * ERROR_PRIOR_SIGMA[name], "the flight must improve on the prior"
            off[name].append((value - true[name]) / standard_error)
    for name, errors in off.items():
        assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, abs=0.15), name


def test_the_errors_of_a_careful_installation_are_those_that_the_page_names() -> None:
    allowed = COMPARISON.installation_sigma
    assert allowed["alpha_bias"] == allowed["pitch"]
    message = (
        f"after a careful installation ({np.degrees(allowed['pitch']):.2f} deg of angle of attack and of pitch,"
        f" {100 * allowed['alpha_scale']:.0f} % of the slope of angle of attack,"
        f" {100 * allowed['airspeed_scale']:.1f} % of airspeed, {1000 * allowed['lag']:.0f} ms,"
        f" {100 * allowed['thrust_scale']:.0f} % of thrust, and {allowed['thrust_slope']:.2f} of its slope over J)"
    )
    assert message in " ".join(PAGE.read_text("utf-8").split())
