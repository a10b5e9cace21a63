"""Lost measurements are reported by topic."""

import numpy as np
import pandas as pd

from flightpower.analysis.air.flight_data import silent_topics
from flightpower.analysis.sources.daemon import COLUMNS, TOPICS


def flight(**lost: float) -> pd.DataFrame:
    """A hundred rows of flight, in which the first share of some columns is missing."""
    table = pd.DataFrame({name: np.ones(100) for name in COLUMNS})
    for name, share in lost.items():
        table.loc[: round(100 * share) - 1, name] = np.nan
    return table.assign(flying=True)


def test_a_topic_is_silent_where_none_of_its_values_was_measured() -> None:
    assert silent_topics(flight(elevator_rad=0.3, throttle=0.3), TOPICS) == [
        "/controls carried no value for 30 % of the flight."
    ]


def test_an_aircraft_without_a_throttle_channel_has_no_silent_controls() -> None:
    assert silent_topics(flight(throttle=1.0), TOPICS) == []


def test_a_log_without_an_optional_topic_is_reported_what_it_lacks() -> None:
    without = flight(elevator_rad=1.0, throttle=1.0, gps_north_mps=1.0, gps_east_mps=1.0, gps_down_mps=1.0)
    assert silent_topics(without, ("/imu",)) == [
        "No /controls in this log: the cross-check takes the elevator as fixed, and full throttle is not recognized."
    ]
    assert silent_topics(without, TOPICS) == [
        "/controls carried no value for 100 % of the flight.",
        "/gps carried no value for 100 % of the flight.",
    ]
