"""Tests what the results say about turbulence, and when a single run is refused."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.maneuvers.runs_file import nearest_miss
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import gust_notes
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.errors import InputError


def trajectory(gust_mps: float, alpha_sigma_deg: float) -> Trajectory:
    sigma = np.ones(len(SENSOR_ERRORS))
    sigma[SENSOR_ERRORS.index("alpha_bias")] = np.radians(alpha_sigma_deg)
    nothing = np.zeros((0, len(SENSOR_ERRORS)))
    return Trajectory(
        pd.DataFrame(),
        np.zeros(len(SENSOR_ERRORS)),
        np.diag(sigma**2),
        sigma,
        nothing,
        None,
        nothing,
        nothing,
        gust_mps,
        {},
        True,
        None,
    )


def test_one_run_alone_in_strong_gusts_is_refused_with_the_reason() -> None:
    with pytest.raises(InputError, match=r"log.mcap: one run alone, and vertical gusts of 0.8 m/s .* by 0.5 deg"):
        gust_notes(trajectory(0.8, 0.5), 1, "log.mcap")


def test_more_runs_are_taken_with_a_warning_and_a_calm_flight_without_a_word() -> None:
    (note,) = gust_notes(trajectory(0.8, 0.5), 2, "log.mcap")
    assert "0.5 deg" in note
    assert gust_notes(trajectory(0.8, 0.2), 1, "log.mcap") == []  # a long flight determines its angle of attack
    assert gust_notes(trajectory(0.02, 0.5), 1, "log.mcap") == []  # a short flight in still air needs no note


def test_a_log_in_which_nothing_flew_says_which_transducer_was_dead() -> None:
    table = pd.DataFrame({"flying": [False] * 3, "q_c_Pa": [np.nan] * 3, "dp_alpha_Pa": 1.0, "static_Pa": 1e5})
    assert nearest_miss([], table) == ": /probe/airspeed showed nothing (a broken transducer or a blocked tube)"
    assert "no flight in it" in nearest_miss([], table.assign(q_c_Pa=1.0))
    assert "speed never changed" in nearest_miss([], table.assign(flying=True))
