"""The step of which all values of a channel are multiples is found, and no other channel has such a step."""

import numpy as np
import pytest

from flightpower.analysis.sources.daemon import synchronize
from flightpower.analysis.sources.resolution import step_of
from flightpower.flight.log_entries import Entries
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import TYPE_OF_TOPIC, Imu, Rpm

TICK_S = 0.04


def whole_pulses(seed: int, minutes: float = 2.0) -> np.ndarray:
    """Motor speed of a flight [rev/s] from the whole pulses of seven pole pairs in each tick of 0.04 s."""
    t_s = np.arange(0.0, 60 * minutes, TICK_S)
    true_revps = 95 + 25 * np.sin(0.2 * t_s + seed)
    return np.floor(true_revps * 7 * TICK_S) / (7 * TICK_S)


@pytest.mark.parametrize("seed", range(3))
def test_pulses_counted_in_a_tick_have_the_step_of_one_pulse(seed: int) -> None:
    assert step_of(whole_pulses(seed)) == pytest.approx(25 / 7, rel=1e-6)
    assert step_of(np.round(whole_pulses(seed), 3)) == pytest.approx(25 / 7, rel=1e-3), "written with three digits"
    with_gaps = np.where(np.arange(len(whole_pulses(seed))) % 9 < 2, np.nan, whole_pulses(seed))
    assert step_of(with_gaps) == pytest.approx(25 / 7, rel=1e-6)


def test_what_is_not_counted_has_no_step() -> None:
    rng = np.random.default_rng(0)
    t_s = np.arange(0.0, 120.0, TICK_S)
    assert step_of(95 + 25 * np.sin(0.2 * t_s)) == 0.0, "a smooth motor speed"
    assert step_of(rng.normal(300.0, 6.0, len(t_s))) == 0.0, "a noisy pressure"
    assert step_of(np.repeat(rng.normal(0.0, 5.0, len(t_s) // 50), 50)) == 0.0, "a slow channel that is held"
    timed_us = np.round(1e7 / (7 * (95 + 25 * np.sin(0.2 * t_s))))
    assert step_of(1e7 / (7 * timed_us)) == 0.0, "pulses timed in whole microseconds"
    assert step_of(np.full(1000, 3.0)) == step_of(np.empty(0)) == step_of(np.full(5, np.nan)) == 0.0
    assert step_of(np.array([0.0, 1.0] * 500)) == 0.0, "on and off"


def test_the_channels_of_a_log_know_their_step(tmp_path) -> None:
    counted = whole_pulses(0)
    log = Log(tmp_path / "log.mcap")
    for topic, message in (("/imu", Imu), ("/rpm", Rpm)):
        entries = Entries(TYPE_OF_TOPIC[topic])
        messages = [
            Rpm(motor_speed_revps=float(n)) if message is Rpm else Imu(specific_force_x_mps2=0.1 * np.sin(i))
            for i, n in enumerate(counted.tolist())
        ]
        times = [round(1e9 * TICK_S * i) for i in range(len(messages))]
        entries.extend(times, list(range(len(messages))), messages)
        entries.finish()
        log.entries[topic] = entries
    assert synchronize(log).resolution == {"n_revps": pytest.approx(25 / 7, rel=1e-6)}
