"""Which of several batteries, motors and airspeed sensors is taken, and what is said of the others."""

import numpy as np
import pytest

from analysis.autopilot_logs import px4
from analysis.autopilot_logs.instances import Battery, measuring_battery, most_varying, turning_motor
from analysis.autopilot_logs.recording import Channel

T = np.arange(0, 100, 1.0)


def constant(value: float) -> Channel:
    return Channel(T, np.full(len(T), value))


def battery(name: str, current_A: float) -> Battery:
    return Battery(name, constant(12.0), constant(current_A))


@pytest.mark.parametrize(
    ("second_A", "said"),
    [(1.5, ["b carries 15 % of the power of a"]), (0.5, []), (30.0, ["b measures", "a carries 33 %"])],
)
def test_the_battery_of_most_power_is_taken_and_a_tenth_beside_it_is_told(second_A: float, said: list[str]) -> None:
    taken, notes = measuring_battery([battery("a", 10.0), battery("b", second_A)])
    assert taken is not None and taken.name == ("b" if second_A > 10 else "a")
    assert len(notes) == len(said) and all(note.startswith(text) for note, text in zip(notes, said, strict=True))


def test_a_battery_without_discharge_does_not_measure() -> None:
    empty = Battery("c", Channel(T[:0], T[:0]), constant(3.0))
    assert measuring_battery([battery("a", -5.0), empty]) == (None, [])


def test_the_one_motor_that_turns_is_taken() -> None:
    found, notes = turning_motor([constant(1.0), constant(80.0)])
    assert found is not None and found.value[0] == 80.0 and notes == []
    assert turning_motor([constant(4.0)]) == (None, [])
    none, (note,) = turning_motor([constant(80.0), constant(90.0)])
    assert none is None and note.startswith("2 motors turn")


def test_the_airspeed_sensor_that_varies_most_is_the_connected_one() -> None:
    connected = Channel(T, 100 + 20 * np.sin(T))
    taken = most_varying([constant(3.0), Channel(T, np.sin(T)), connected])
    assert taken is connected and most_varying([constant(3.0)]) is None


def px4_topics(**fields: np.ndarray) -> dict[str, list[px4._Topic]]:
    return {"sensor_baro": [px4._Topic({"timestamp": 1e6 * T, **fields}, 0)]}


@pytest.mark.parametrize("in_unit", [95_000.0, 950.0])
def test_static_pressure_of_old_firmware_is_in_hectopascal(in_unit: float) -> None:
    (static,) = px4._static(px4_topics(pressure=np.full(len(T), in_unit))).values()
    assert static.value == pytest.approx(95_000.0) and static.t_s == pytest.approx(T)
