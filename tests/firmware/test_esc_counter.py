"""The motor speed counter's firmware, built as for the board and run in simavr, read by the daemon's driver."""

import shutil
import subprocess
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from flightpower.daq.sensors.esc_counter import EscCounterDriver
from flightpower.flight.messages import Status

HERE = Path(__file__).parent
SOURCE = HERE.parents[1] / "firmware" / "esc_counter"
HEADERS = [Path("/usr/include/simavr/sim_avr.h"), Path("/usr/include/libelf.h")]
if not (shutil.which("avr-gcc") and shutil.which("gcc") and all(header.exists() for header in HEADERS)):
    pytest.skip("needs gcc, gcc-avr, avr-libc, libsimavr-dev and libelf-dev", allow_module_level=True)


class Sent(NamedTuple):
    """Frames of the counter: time of their last byte [us], and what the daemon's driver makes of them."""

    at_us: list[float]
    samples: list
    rejected: int
    lost: int

    @property
    def periods_us(self):
        return np.array([sample.message.period_us for sample in self.samples if sample.message.period_us])

    @property
    def believed_us(self):
        """Periods that are not marked."""
        good = [sample.message for sample in self.samples if sample.message.status is Status.OK]
        return np.array([message.period_us for message in good if message.period_us])


class Bytes:
    """The port: what has arrived since it was last read."""

    def __init__(self):
        self.waiting = b""

    def read_available(self):
        data, self.waiting = self.waiting, b""
        return data


@pytest.fixture(scope="module")
def counter(tmp_path_factory):
    """Runs the firmware: counter(edges_us, end_us, crash_us=None) -> Sent."""
    folder = tmp_path_factory.mktemp("firmware")
    subprocess.run(["make", "-s", "-C", SOURCE, f"OUT={folder}"], check=True)
    runner = folder / "run"
    subprocess.run(["gcc", "-O2", "-o", runner, HERE / "run_in_simavr.c", "-lsimavr", "-lelf"], check=True)

    def run(edges_us, end_us, *crash_us):
        command = [runner, folder / "esc_counter.elf", *map(str, (end_us, *crash_us))]
        text = "\n".join(f"{t:.4f}" for t in np.sort(edges_us))
        done = subprocess.run(command, input=text, capture_output=True, text=True, check=True)
        lines = [line.split() for line in done.stdout.splitlines() if line[:1].isdigit()]
        port = Bytes()
        driver = EscCounterDriver(port, pole_pairs=14, framed=True)
        at_us, samples = [], []
        for time_us, byte in lines:
            port.waiting = bytes([int(byte)])
            for sample in driver.read(round(float(time_us) * 1000)):
                at_us.append(float(time_us))
                samples.append(sample)
        return Sent(at_us, samples, driver._parser.rejected, driver._parser.lost)

    return run


def pulses(electrical_period_us, end_us, start_us=1000.0):
    return np.arange(start_us, end_us, electrical_period_us)


@pytest.mark.parametrize("ten_periods_us", [300, 1234, 30_000, 1_000_000])
def test_ten_periods_within_a_thousandth(counter, ten_periods_us):
    """From 300 us to 1 s. The timer counts 0.5 us, the crystal is as good as simavr's: exact."""
    end_us = max(100_000, 2.2 * ten_periods_us)
    sent = counter(pulses(ten_periods_us / 10, end_us), end_us)
    assert len(sent.periods_us) >= 2
    assert sent.periods_us == pytest.approx(ten_periods_us, rel=1e-3, abs=1.0)
    assert (sent.rejected, sent.lost) == (0, 0)
    assert sent.samples[0].message.motor_speed_revps == pytest.approx(1e7 / ten_periods_us / 14, rel=4e-3)


def test_frames_come_at_most_every_10_ms(counter):
    sent = counter(pulses(30, 100_000), 100_000)
    assert np.diff(sent.at_us).min() > 9_900
    assert len(sent.at_us) >= 8


@pytest.mark.parametrize(("extra_us", "error"), [(3.0, 1e-3), (100.0, 1e-3), (250.0, 1e-3), (420.0, 0.025)])
def test_noise_pulses_change_nothing(counter, extra_us, error):
    """One pulse in twenty is followed by a false one: ringing, or crosstalk. In the last quarter of a period it may be
    mistaken for the true pulse, so the ten periods end up to a quarter period early or late."""
    true = pulses(500, 150_000)
    sent = counter(np.concatenate([true, true[30::20] + extra_us]), 150_000)
    assert len(sent.periods_us) >= 10
    assert sent.periods_us == pytest.approx(5000, rel=error)


def test_lost_pulses_change_nothing(counter):
    """One pulse in 17 does not come."""
    true = pulses(500, 150_000)
    sent = counter(np.delete(true, np.arange(25, len(true), 17)), 150_000)
    assert len(sent.periods_us) >= 10
    assert sent.periods_us == pytest.approx(5000, rel=1e-3)


def test_a_motor_that_accelerates_is_followed(counter):
    """From 100 to 1000 electrical turns a second in 0.3 s: 2 % a period, far from what is taken for noise."""
    t = np.arange(0, 0.4, 1e-6)
    rate = np.clip(100 + 3000 * t, 100, 1000)
    turns = np.cumsum(rate) * 1e-6
    edges = 1e6 * np.interp(np.arange(1, turns[-1]), turns, t)
    sent = counter(edges, 400_000)
    middle = np.array(sent.at_us[: len(sent.periods_us)]) - 700 - sent.periods_us / 2
    expected = 1e7 / np.interp(middle / 1e6, t, rate)
    assert sent.periods_us == pytest.approx(expected, rel=0.12)  # up to 10 ms old when sent: 30 turns/s of 100
    assert sent.periods_us[-1] == pytest.approx(10_000, rel=1e-3)


def test_a_sudden_change_of_speed_is_believed(counter):
    """The period halves or doubles, as no motor's does: nothing false is sent, and then the new period is sent."""
    edges = np.concatenate([pulses(500, 60_000), pulses(250, 120_000, 60_000), pulses(1000, 200_000, 120_000)])
    result = set(counter(edges, 200_000).periods_us.tolist())
    assert {2500, 5000, 10_000} <= result
    assert all(min(abs(p - q) / q for q in (2500, 5000, 10_000)) < 1e-3 for p in result), result


def test_a_stopped_motor_is_reported_every_half_second_and_starts_again(counter):
    """The time for which it was stopped is not a period."""
    edges = np.concatenate([pulses(500, 60_000), pulses(500, 1_400_000, 1_300_000)])
    sent = counter(edges, 1_400_000)
    stopped = [
        time_us for time_us, sample in zip(sent.at_us, sent.samples, strict=True) if sample.message.period_us == 0
    ]
    assert len(stopped) == 2
    assert stopped[0] == pytest.approx(560_000, abs=12_000)
    assert np.diff(stopped) == pytest.approx([500_000], abs=2000)
    assert all(sample.message.status is Status.OK for sample in sent.samples)
    assert sent.periods_us == pytest.approx(5000, rel=1e-3)


def test_without_any_pulse_the_counter_is_heard(counter):
    sent = counter([], 1_100_000)
    assert [sample.message.motor_speed_revps for sample in sent.samples] == [0.0, 0.0]


def test_the_watchdog_restarts_a_crashed_program(counter):
    """The program crashes at 100 ms; the watchdog restarts it after 250 ms, and frames come again."""
    sent = counter(pulses(500, 600_000), 600_000, 100_000)
    gaps = np.diff(sent.at_us)
    assert 240_000 < gaps.max() < 350_000
    assert sent.at_us[-1] > 580_000
    assert sent.periods_us == pytest.approx(5000, rel=1e-3)


TRUE = pulses(500, 400_000)
NOISE = np.random.default_rng(1)
EVEN = np.arange(len(TRUE)) % 2
MAGNETS = np.random.default_rng(2).uniform(-0.3, 0.3, 7)  # of a rotor with seven pairs: the same each revolution
TRAINS = {
    **{f"echo after each pulse at {f} of the period": np.concatenate([TRUE, TRUE + f * 500])
       for f in (0.1, 0.2, 0.3, 0.4, 0.6, 0.7, 0.8, 0.9)},
    **{f"{rate} noise pulses a second": np.concatenate([TRUE, NOISE.uniform(0, 400_000, int(0.4 * rate))])
       for rate in (50, 200, 500, 1000)},
    **{f"edges scattered by {s} of the period": TRUE + NOISE.normal(0, s * 500, len(TRUE)) for s in (0.02, 0.1, 0.3)},
    "intervals alternate by 30 %": TRUE + EVEN * 0.3 * 500,
    "magnets uneven by 30 %": TRUE + 500 * np.resize(MAGNETS, len(TRUE)) / 2,
    **{f"every {k}th pulse missing": np.delete(TRUE, np.arange(5, len(TRUE), k)) for k in (3, 4, 5, 9)},
}  # fmt: skip


@pytest.mark.parametrize("train", TRAINS)
def test_a_period_is_right_within_two_percent_or_marked(counter, train):
    """The exception is an echo in the middle of each period, which no counter can distinguish from twice the speed."""
    sent = counter(TRAINS[train], 400_000)
    assert len(sent.samples) > 5
    assert sent.believed_us == pytest.approx(5000, rel=0.02)


@pytest.mark.parametrize(
    "train", ["50 noise pulses a second", "edges scattered by 0.02 of the period", "every 9th pulse missing"]
)
def test_what_a_sound_counter_sees_is_not_marked(counter, train):
    sent = counter(TRAINS[train], 400_000)
    assert len(sent.believed_us) > 0.9 * len(sent.periods_us) > 20


def test_pulses_too_slow_for_a_period_are_heard_every_50_ms(counter):
    """A frame without a period is no sample, but the counter is not silent."""
    sent = counter(pulses(60_000, 580_000), 580_000)
    assert len(sent.periods_us) == 0 and (sent.rejected, sent.lost) == (0, 0)
