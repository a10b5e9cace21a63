"""The position that a map shows: its units, and a covariance from the two accuracies of the receiver."""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.pages.exports.derived import _by_thrust_table, _write_location
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.log_entries import LogEntry, entries_of
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import Gps, Status


class WriterInMemory:
    """Keeps the messages of an MCAP writer."""

    def __init__(self) -> None:
        self.messages: list[tuple[int, dict[str, Any]]] = []

    def register_schema(self, **_: Any) -> int:
        return 1

    def register_channel(self, **_: Any) -> int:
        return 1

    def add_message(self, _: int, *, log_time: int, publish_time: int, data: bytes) -> None:
        self.messages.append((log_time, msgspec.json.decode(data)))


def test_a_fix_has_half_the_horizontal_variance_in_each_direction() -> None:
    """The receiver's horizontal accuracy covers both directions together: 5 m is 3.5 m north and 3.5 m east."""
    good = Gps(
        latitude_deg=47.1, longitude_deg=8.2, height_m=431.0, horizontal_accuracy_m=5.0, vertical_accuracy_m=6.0,
        fix_type=3,
    )  # fmt: skip
    messages = [
        good,
        msgspec.structs.replace(good, vertical_accuracy_m=None),
        msgspec.structs.replace(good, fix_type=1),
        msgspec.structs.replace(good, status=Status.STALE),
    ]
    gps = [LogEntry(10**9 * i + 250_000_000, i, message) for i, message in enumerate(messages, start=7)]
    writer = WriterInMemory()
    _write_location(writer, Log(path=Path("flight.mcap"), entries={"/gps": entries_of(gps)}))
    (time_ns, fix), (_, unknown), *others = writer.messages
    assert not others and time_ns == 7_250_000_000 and fix["timestamp"] == {"sec": 7, "nsec": 250_000_000}
    assert (fix["latitude"], fix["longitude"], fix["altitude"]) == (47.1, 8.2, 431.0)
    assert np.reshape(fix["position_covariance"], (3, 3)) == pytest.approx(np.diag([12.5, 12.5, 36.0]))
    assert not any(unknown["position_covariance"]) and fix["position_covariance_type"] > 0
    assert unknown["position_covariance_type"] == 0


def test_an_error_of_the_thrust_s_table_turns_with_alpha_into_lift_and_drag() -> None:
    """The error has a scale, a slope over J and a part beyond the table; its sin(alpha) is lift, its cos(alpha)
    drag."""
    aircraft = load_aircraft("nexstar")
    alpha, thrust_N, J, beyond, qS_over_m = 0.2, 5.0, 0.7, 0.03, 12.0
    nominal = np.array([[alpha, 15.0, 0.0, thrust_N, 0.8, 0.06]])
    forces = pd.DataFrame(
        {"J": [J], "thrust_beyond_over_m_mps2": [beyond * np.cos(alpha)], "qS_over_m_mps2": [qS_over_m]}
    )
    of_thrust, of_CL, of_CD = _by_thrust_table(nominal, forces, aircraft)[0]
    uncertainty, m = aircraft.uncertainty, aircraft.mass_kg
    scale, slope = uncertainty.thrust_scale_fraction * thrust_N, uncertainty.thrust_slope * (J - 0.5) * thrust_N
    assert np.sqrt(of_thrust) == pytest.approx(np.sqrt(scale**2 + slope**2 + (beyond * m) ** 2))
    assert np.sqrt(of_CL / of_thrust) == pytest.approx(np.sin(alpha) / (qS_over_m * m))
    assert np.sqrt(of_CD / of_thrust) == pytest.approx(np.cos(alpha) / (qS_over_m * m))
