"""What of the measurements was lost, said by topic."""

import numpy as np
import pandas as pd

from analysis.airdata.from_log import silent_topics
from analysis.signals.synchronize import COLUMNS


def flight(**lost: float) -> pd.DataFrame:
    """A hundred rows of flight with the first share of some columns missing."""
    table = pd.DataFrame({name: np.ones(100) for name in COLUMNS})
    for name, share in lost.items():
        table.loc[: round(100 * share) - 1, name] = np.nan
    return table.assign(flying=True)


def test_a_topic_is_silent_where_none_of_its_values_was_measured() -> None:
    assert silent_topics(flight(elevator_rad=0.3, throttle=0.3)) == [
        "/controls carried no value for 30 % of the flight."
    ]


def test_an_aircraft_without_a_throttle_channel_has_no_silent_controls() -> None:
    assert silent_topics(flight(throttle=1.0)) == []
