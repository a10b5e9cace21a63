"""Throttle checks the measured power: whether the meter measures the motor, and when the motor is off."""

from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.methods.whole_flight.flight_table import Meter, flight_table, meter, power_off
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.recording import Channel, FlightRecording
from flightpower.flight.errors import InputError

N = 1500
T_S = 0.2 * np.arange(N)
FLYING = np.ones(N, dtype=bool)
THROTTLE = np.clip(0.5 + 0.6 * np.sin(0.1 * T_S), 0.0, 1.0)
POWER_W = 4.0 + 200 * THROTTLE**2.5
NOISE = np.random.default_rng(1).standard_normal(N)


def meter_of(power_W: np.ndarray, throttle: np.ndarray = THROTTLE) -> Meter:
    return meter({"power_W": power_W, recording.THROTTLE: throttle}, FLYING)


def test_power_of_a_propulsion_follows_its_throttle() -> None:
    assert meter_of(POWER_W + 10 * NOISE) is Meter.FOLLOWS
    assert meter_of(POWER_W * (1 + 0.2 * np.sin(0.03 * T_S))) is Meter.FOLLOWS  # the airspeed unloads the propeller


def test_a_meter_of_something_else_stands() -> None:
    """The avionics' current, with noise, or a value that firmware fills in."""
    assert meter_of(30.0 + 2 * NOISE) is Meter.STANDS
    assert meter_of(np.full(N, 13.4)) is Meter.STANDS


def test_throttle_of_something_else_is_distinguished_from_a_dead_meter() -> None:
    assert meter_of(POWER_W, THROTTLE[::-1] ** 2 * (NOISE > 0)) is Meter.CONTRADICTS


@pytest.mark.parametrize("throttle", [np.full(N, np.nan), np.full(N, 0.4), np.zeros(N)])
def test_throttle_that_does_not_vary_says_nothing(throttle: np.ndarray) -> None:
    assert meter_of(30.0 + 2 * NOISE, throttle) is Meter.UNCHECKED


def test_the_motor_is_off_a_second_after_the_throttle_closed() -> None:
    throttle = np.where((T_S >= 10) & (T_S < 20), 0.003, 0.5)
    throttle[T_S >= 40] = np.nan
    off = T_S[power_off(throttle)]
    assert off[0] == pytest.approx(10.8) and off[-1] == pytest.approx(19.8)


def flown(power_W: np.ndarray, throttle: np.ndarray = THROTTLE) -> FlightRecording:
    """A flight of 300 s at 15 m/s, with the pressures of height and airspeed that belong to it."""
    wave = np.sin(0.05 * T_S)
    values = {
        recording.AIRSPEED_PRESSURE: 1.225 / 2 * (15 + wave) ** 2,
        recording.STATIC: 95_000 - 100 * wave,
        recording.VOLTAGE: np.full(N, 15.0),
        recording.CURRENT: power_W / 15.0,
        recording.THROTTLE: throttle,
    }
    return FlightRecording(Path("log.BIN"), {name: Channel(T_S, x) for name, x in values.items()})


def test_a_meter_that_stands_is_refused_in_words() -> None:
    with pytest.raises(InputError, match="about 30 W in the air whatever the throttle"):
        flight_table(flown(30.0 + 2 * NOISE), 20.0, 0.45)
    with pytest.raises(
        InputError, match=r"never reads more than 8 W in flight, at up to 100 % throttle, too little for 2\.04 kg"
    ):
        flight_table(flown(7.5 + 0.01 * NOISE), 20.0, 0.45)


def test_with_the_throttle_closed_power_is_that_of_the_avionics() -> None:
    table = flight_table(flown(POWER_W + 0.5 * NOISE), 20.0, 0.45)
    off = power_off(table.table[recording.THROTTLE].to_numpy())
    assert off.sum() > 100 and table.idle_power_W == pytest.approx(4.0, abs=0.2)
    assert (table.table["power_W"][off] == table.idle_power_W).all()
    assert not (table.table["power_W"][~off] == table.idle_power_W).any()


def test_throttle_that_power_contradicts_is_not_used_and_reported() -> None:
    table = flight_table(flown(POWER_W, THROTTLE[::-1] ** 2 * (NOISE > 0)), 20.0, 0.45)
    assert table.table[recording.THROTTLE].isna().all()
    assert sum("throttle" in note for note in table.notes) == 1
