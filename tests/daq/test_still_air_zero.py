"""`daq zero`: a zero is accepted only if all was still; it is kept in a small file and travels in every log."""

import json

import numpy as np
import pytest
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq.daemon import record
from flightpower.daq.dry_run import dry_run
from flightpower.daq.sensors import Sample
from flightpower.daq.still_air_zero import (
    FORCE,
    PRESSURE,
    RATE,
    NotStill,
    parse_zero,
    rest_problems,
    save_zero,
    zero_from_samples,
)
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import DifferentialPressure
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray

SECONDS = 10.0
OFFSET_PA = {"alpha": 3.0, "beta": -2.0, "airspeed": 4.0}
NORMAL = np.random.default_rng(5).normal(size=2**16)
BIAS_RADPS = (0.01, -0.02, 0.005)


class StandingSensorTruth(SteadySensorTruth):
    """At rest, with the noise of the bench (dissertation, Table 4.1) and a zero that is off. `extra` is added."""

    rate = BIAS_RADPS
    force = (0.0, 0.0, -9.80665)
    difference = OFFSET_PA

    def __init__(self, **extra):
        self.extra = extra
        self.motor_revps = extra.pop("motor", 0.0)

    def _noise(self, t_s, seed):
        """White noise, equal for equal instants (to 10 us)."""
        place = (np.asarray(t_s) * 1e5).astype(np.int64) * 2654435761 + seed * 7919
        return NORMAL[place % len(NORMAL)]

    def imu(self, t_s):
        force, rate = super().imu(t_s)
        for axis in range(3):
            rate[:, axis] += 0.005 * self._noise(t_s, axis)
            force[:, axis] += 0.06 * self._noise(t_s, 3 + axis)
        rate[:, 1] += self.extra.get("rate", lambda t: 0 * t)(np.asarray(t_s))
        return force, rate

    def differential_pressure_Pa(self, which, t_s):
        quiet = super().differential_pressure_Pa(which, t_s) + 0.5 * self._noise(t_s, 7)
        return quiet + self.extra.get("pressure", lambda t: 0 * t)(np.asarray(t_s))

    def motor_speed_revps(self, t_s):
        return np.full(len(t_s), self.motor_revps)


def taken(tmp_path, sensor_truth, **changes):
    clock = SimulatedClock(unix_at_start_ns=10**18)
    fake = FakeTray(sensor_truth, clock)
    readings = dry_run(default_tray(tmp_path, fake, **changes), buses=fake, clock=clock, seconds=SECONDS)
    return zero_from_samples(readings.samples, ticks=readings.ticks, seconds=SECONDS, unix_ns=clock.unix_ns())


def test_a_zero_taken_in_still_air_is_what_the_parts_are_off(tmp_path):
    zero = taken(tmp_path, StandingSensorTruth())
    for which, offset_Pa in OFFSET_PA.items():
        reading = zero.readings[f"/probe/{which}"]["differential_pressure_Pa"]
        # The limits are half a count of the coarsest part, 0.19 Pa, and four standard errors of the mean.
        assert reading.mean == pytest.approx(offset_Pa, abs=0.1 + 4 * reading.standard_deviation / 250**0.5)
        assert reading.samples == pytest.approx(250, abs=2)
    for axis, bias in zip("xyz", BIAS_RADPS, strict=True):
        reading = zero.readings["/imu"][f"angular_rate_{axis}_radps"]
        assert reading.mean == pytest.approx(bias, abs=4 * 0.005 / 250**0.5)
    assert set(zero.readings["/imu"]) == {f"angular_rate_{axis}_radps" for axis in "xyz"}  # gravity is no bias
    assert zero.temperature_K["/imu"] == pytest.approx(305, abs=0.01)


@pytest.mark.parametrize(
    ("sensor_truth", "expected"),
    [
        (
            StandingSensorTruth(rate=lambda t: 0.1 * np.sin(2 * np.pi * 1.5 * t)),
            "/imu angular_rate_y_radps is not steady",
        ),
        (StandingSensorTruth(rate=lambda t: 0.15 + 0 * t), "limit 0.09"),
        (StandingSensorTruth(rate=lambda t: 0.003 * t), "/imu angular_rate_y_radps drifts"),
        (StandingSensorTruth(pressure=lambda t: 20 * np.sin(2 * np.pi * 0.3 * t)), "/probe/airspeed differential"),
        (StandingSensorTruth(pressure=lambda t: 0.7 * t), "drifts"),
        (StandingSensorTruth(pressure=lambda t: 100 + 0 * t), "cover the probe"),
        (StandingSensorTruth(pressure=lambda t: -100 + 0 * t), "cover the probe"),
        (StandingSensorTruth(motor=100.0), "the motor is running"),
    ],
    ids=[
        "hand on the wing",
        "turning",
        "slow turn",
        "gusts",
        "rising wind",
        "steady wind",
        "wind from behind",
        "motor",
    ],
)
def test_what_was_not_still_is_refused_with_what_to_do(tmp_path, sensor_truth, expected):
    with pytest.raises(NotStill) as refused:
        taken(tmp_path, sensor_truth)
    assert expected in str(refused.value)


def test_a_dead_transducer_is_no_zero(tmp_path):
    with pytest.raises(NotStill, match="/probe/beta gave 0 measurements"):
        taken(tmp_path, StandingSensorTruth(), **{"MS4515DO-DS3AK002DP": "MS4515DO-DS3A0002DP"})


def test_it_travels_in_every_log_and_the_readings_stay_raw(tmp_path):
    save_zero(taken(tmp_path, StandingSensorTruth()), tmp_path / "zero.json")
    clock = SimulatedClock(unix_at_start_ns=10**18)
    fake = FakeTray(StandingSensorTruth(), clock)
    recording = record(default_tray(tmp_path, fake), buses=fake, clock=clock, until_ns=clock.now_ns() + 4 * 10**9)
    log = read_log(recording.path)
    zero = parse_zero(log.attachments["zero.json"].decode(), "zero.json")
    assert zero.format == "flightpower-zero-1" and zero.readings
    raw = [e.message.differential_pressure_Pa for e in log.entries["/probe/alpha"] if e.message.status == "ok"]
    assert np.mean(raw) == pytest.approx(OFFSET_PA["alpha"], abs=0.3)


def test_a_broken_zero_is_refused_before_anything_is_written(tmp_path):
    good = json.loads(save_and_read(tmp_path))
    for text in ("{", json.dumps({**good, "format": "flightpower-zero-9"}), "[]"):
        (tmp_path / "zero.json").write_text(text)
        clock = SimulatedClock()
        fake = FakeTray(SteadySensorTruth(), clock)
        with pytest.raises(InputError, match=r"zero\.json"):
            record(default_tray(tmp_path, fake), buses=fake, clock=clock, until_ns=10**9)
    assert not (tmp_path / "logs").exists()


def save_and_read(tmp_path) -> str:
    save_zero(taken(tmp_path, StandingSensorTruth()), tmp_path / "zero.json")
    assert [path.name for path in tmp_path.glob("zero*")] == ["zero.json"]
    return (tmp_path / "zero.json").read_text()


def test_a_tray_without_anything_to_zero_says_so():
    with pytest.raises(NotStill, match="no differential transducer"):
        zero_from_samples([], ticks=100, seconds=4.0, unix_ns=0)


@pytest.mark.parametrize(("measured", "enough"), [(90, True), (89, False)])
def test_nine_tenths_of_the_ticks_must_have_a_measurement(measured, enough):
    samples = [
        Sample("/probe/alpha", tick, DifferentialPressure(differential_pressure_Pa=1.0)) for tick in range(measured)
    ]
    if enough:
        zero = zero_from_samples(samples, ticks=100, seconds=4.0, unix_ns=0)
        assert zero.readings["/probe/alpha"]["differential_pressure_Pa"].samples == measured
    else:
        with pytest.raises(NotStill, match="89 measurements in 100 ticks"):
            zero_from_samples(samples, ticks=100, seconds=4.0, unix_ns=0)


def test_limits_of_a_zero_are_those_of_the_parts_and_of_what_a_flight_bears():
    """Datasheets: SSC 2 % of 10 inH2O, MPU-9250 5 deg/s. Noise on the bench: 0.005 rad/s, 0.06 m/s^2."""
    for limit, of_part in ((PRESSURE.offset, 0.02 * 10 * 249.089), (RATE.offset, np.radians(5.0))):
        assert of_part < limit < 1.1 * of_part
    for limit, noise in ((RATE.spread, 0.005), (FORCE.spread, 0.06)):
        assert 3 * noise < limit < 6 * noise, "several times the noise is a hand on the wing"
    # 1 Pa is 0.3 % of airspeed at 16 m/s; a wind of 3 m/s, which must not pass for a zero, gives 5.5 Pa.
    n = 20_000
    drifting = [[2.0 + drift * (i >= n // 2) for i in range(n)] for drift in (0.9, 1.1)]
    assert rest_problems("dp", drifting[0], PRESSURE) == []
    (rest_problem,) = rest_problems("dp", drifting[1], PRESSURE)
    assert "drifts by 1.1 Pa" in rest_problem and PRESSURE.shift < 5.5 < PRESSURE.spread


def test_a_drift_counts_beyond_four_standard_errors_of_the_halves():
    """With noise of 0.01 rad/s in halves of 50, the difference of two means is good to 0.002; four times that is
    allowed."""
    noise = np.tile([0.01, -0.01], 50)
    criteria = RATE._replace(shift=0.0)
    allowed = 4 * 0.01 * np.sqrt(2 / 50)
    for share, refused in ((0.9, False), (1.2, True)):
        shifted = noise + share * allowed * (np.arange(100) >= 50)
        assert bool(rest_problems("p", shifted.tolist(), criteria)) == refused
