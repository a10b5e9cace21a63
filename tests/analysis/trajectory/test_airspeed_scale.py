"""Tests when a flight supports a calibration of the airspeed, and what is reported as missing otherwise."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.trajectory.consistency import calibrate, notes_on

PRIOR = 0.01


def calibrated(*, error: float = 0.2 * PRIOR, converged: bool = True, gps: bool = True):
    """Return the calibration from a flight around a box whose trajectory has this standard error of the scale."""
    rows = np.arange(40)
    states = pd.DataFrame({"psi": np.repeat([0.0, 1.57, 3.14, -1.57], 10), "wind_north": 3.0, "wind_east": -4.0})
    trajectory = SimpleNamespace(
        block_means=SimpleNamespace(rows=rows, measured=lambda name: gps),
        states=states,
        standard_error=lambda name: error,
        prior_standard_error=lambda name: PRIOR,
        value=lambda name: 0.004,
        converged=converged,
    )
    return calibrate(pd.DataFrame({"flying": np.ones(40, dtype=bool)}), trajectory)


def test_a_determined_scale_is_supported() -> None:
    assert calibrated().unsupported == "" and calibrated().notes == []
    assert (calibrated().wind_mps, calibrated().wind_from_deg) == pytest.approx((5.0, 126.87), rel=1e-3)


@pytest.mark.parametrize(
    ("flight", "cause"),
    [
        ({"error": 0.81 * PRIOR}, "does not determine the scale (standard error 0.8 %, before the flight 1.0 %)"),
        ({"gps": False}, "fly with GPS"),
        ({"converged": False}, "did not converge"),
    ],
)
def test_otherwise_one_line_says_what_is_missing(flight: dict, cause: str) -> None:
    assert cause in calibrated(**flight).unsupported and "\n" not in calibrated(**flight).unsupported
    assert calibrated(error=0.79 * PRIOR).unsupported == ""


def test_what_limits_a_scale_is_reported_in_per_cent() -> None:
    (hardly,) = notes_on(0.3, 0.009, PRIOR)
    assert hardly.endswith("standard error 0.9 %, before the flight 1.0 %.")
    (one_way,) = notes_on(0.8, 0.001, PRIOR)
    assert one_way.startswith("Nearly all was flown in one direction")
    assert notes_on(0.7, 0.001, PRIOR) == []
    assert calibrated().one_way < 0.01 and calibrated().scale == 0.004
