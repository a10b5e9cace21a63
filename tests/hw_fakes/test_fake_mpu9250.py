"""Register map RM-MPU-9250A-00 rev. 1.4 and product specification PS-MPU-9250A-01, from the bus's side."""

import numpy as np
import pytest
from analytic_sensor_truth import constant, ramp

IMU, MAG = 0x68, 0x0C
G = 9.80665
ACCEL_XOUT_H, USER_CTRL, PWR_MGMT_1, FIFO_COUNTH, FIFO_R_W, WHO_AM_I = 0x3B, 0x6A, 0x6B, 0x72, 0x74, 0x75
SMPLRT_DIV, CONFIG, GYRO_CONFIG, ACCEL_CONFIG, ACCEL_CONFIG_2, FIFO_EN = 0x19, 0x1A, 0x1B, 0x1C, 0x1D, 0x23
INT_PIN_CFG, INT_STATUS = 0x37, 0x3A


def set_up_200_Hz(bus, fifo_en=0xF8, config=0x03):
    bus.write(IMU, bytes([SMPLRT_DIV, 4, config, 0, 0, 3]))
    bus.write(IMU, bytes([FIFO_EN, fifo_en]))
    bus.write(IMU, bytes([USER_CTRL, 0x44]))


def fifo_count(bus):
    return int.from_bytes(bus.write_read(IMU, bytes([FIFO_COUNTH]), 2), "big")


def samples(data, columns=7):
    return np.frombuffer(data, ">i2").reshape(-1, columns)


def registers(bus):
    return np.frombuffer(bus.write_read(IMU, bytes([ACCEL_XOUT_H]), 14), ">i2")


def test_identity(bus_of):
    assert bus_of().write_read(IMU, bytes([WHO_AM_I]), 1) == b"\x71"


def test_it_is_deaf_until_it_has_started_up(powered):
    bus = powered(after_s=0.005).i2c("/dev/i2c-1")
    with pytest.raises(OSError, match="no acknowledge") as caught:
        bus.write_read(IMU, bytes([WHO_AM_I]), 1)
    assert caught.value.errno == 121


def test_the_reset_bit_brings_the_defaults_back(bus_of, clock):
    bus = bus_of()
    set_up_200_Hz(bus)
    bus.write(IMU, bytes([PWR_MGMT_1, 0x80]))
    clock.advance_ns(100_000_000)
    assert bus.write_read(IMU, bytes([SMPLRT_DIV]), 5) == bytes(5)
    assert bus.write_read(IMU, bytes([PWR_MGMT_1]), 1) == b"\x01"
    assert fifo_count(bus) == 0


@pytest.mark.parametrize(("select", "range_g"), [(0, 2), (1, 4), (2, 8), (3, 16)])
def test_specific_force_in_counts(bus_of, clock, select, range_g):
    bus = bus_of(force_mps2=constant([0.5 * G, -1.2 * G, 1.9 * G]))
    bus.write(IMU, bytes([ACCEL_CONFIG, select << 3]))
    clock.advance_ns(20_000_000)
    np.testing.assert_allclose(registers(bus)[:3], np.array([0.5, -1.2, 1.9]) * 32768 / range_g, atol=0.5)


@pytest.mark.parametrize(("select", "counts_per_dps"), [(0, 131), (1, 65.5), (2, 32.8), (3, 16.4)])
def test_angular_rate_in_counts(bus_of, clock, select, counts_per_dps):
    bus = bus_of(rate_radps=constant(np.radians([10, -200, 3])))
    bus.write(IMU, bytes([GYRO_CONFIG, select << 3]))
    clock.advance_ns(20_000_000)
    np.testing.assert_allclose(registers(bus)[4:], np.array([10, -200, 3]) * counts_per_dps, atol=0.5)


def test_temperature_in_counts(bus_of):
    assert registers(bus_of(imu_K=constant(273.15 + 31.0)))[3] == round(10 * 333.87)


def test_beyond_the_range_it_saturates(bus_of):
    assert registers(bus_of(force_mps2=constant([3 * G, -3 * G, 0])))[:3].tolist() == [32767, -32768, 0]


def test_asleep_it_keeps_its_last_sample_and_the_gyroscope_starts_late(bus_of, clock):
    bus = bus_of(rate_radps=constant([0.1, 0.1, 0.1]), force_mps2=lambda t: np.outer(t, [1.0, 0, 0]))
    bus.write(IMU, bytes([PWR_MGMT_1, 0x40]))
    before = registers(bus)
    clock.advance_ns(1_000_000_000)
    assert registers(bus).tolist() == before.tolist()
    bus.write(IMU, bytes([PWR_MGMT_1, 0x01]))
    clock.advance_ns(20_000_000)
    awake = registers(bus)
    assert awake[0] > before[0] and awake[4:].tolist() == [0, 0, 0]  # 35 ms from sleep (PS sec. 3.1)
    clock.advance_ns(20_000_000)
    assert registers(bus)[4] == round(np.degrees(0.1) * 131)


def test_the_fifo_fills_at_the_divided_rate(bus_of, clock):
    bus = bus_of()
    set_up_200_Hz(bus)
    clock.advance_ns(150_000_000)
    count = fifo_count(bus)
    assert count % 14 == 0
    assert abs(count / 14 - 30) <= 1 + 30 * 0.01  # 200 Hz, its oscillator within 1 % (PS sec. 3.4.2)


def test_fifo_samples_follow_the_registers_order_and_the_pointer_stays(bus_of, clock):
    force, rate = np.array([0.1, 0.2, -1.0]), np.array([1.0, 2.0, 3.0])
    bus = bus_of(force_mps2=constant(force * G), rate_radps=constant(np.radians(rate)), imu_K=constant(294.15))
    set_up_200_Hz(bus)
    clock.advance_ns(52_000_000)
    rows = samples(bus.write_read(IMU, bytes([FIFO_R_W]), fifo_count(bus)))
    assert len(rows) >= 10
    expected = np.concatenate([force * 16384, [0], rate * 131])
    np.testing.assert_allclose(rows, np.tile(expected, (len(rows), 1)), atol=0.5)
    assert fifo_count(bus) <= 14  # a sample may have come while these were carried over the bus


def test_only_the_enabled_sensors_go_into_the_fifo(bus_of, clock):
    bus = bus_of(force_mps2=constant([0, 0, -G]))
    set_up_200_Hz(bus, fifo_en=0x08)
    clock.advance_ns(50_000_000)
    rows = samples(bus.write_read(IMU, bytes([FIFO_R_W]), fifo_count(bus)), columns=3)
    assert rows[:, 2].tolist() == [-16384] * len(rows)


def test_an_empty_fifo_gives_its_last_byte_again(bus_of, clock):
    bus = bus_of()
    set_up_200_Hz(bus)
    clock.advance_ns(20_000_000)
    taken = bus.write_read(IMU, bytes([FIFO_R_W]), fifo_count(bus))
    assert bus.write_read(IMU, bytes([FIFO_R_W]), 3) == taken[-1:] * 3


@pytest.mark.parametrize("stop_when_full", [False, True])
def test_an_overflow_is_flagged_once_and_keeps_the_right_end(bus_of, clock, stop_when_full):
    bus = bus_of(force_mps2=lambda t: np.outer(t, [1.0, 0, 0]))
    set_up_200_Hz(bus, config=0x43 if stop_when_full else 0x03)
    bus.write_read(IMU, bytes([INT_STATUS]), 1)
    start_counts = registers(bus)[0]
    clock.advance_ns(1_000_000_000)  # 2,800 bytes into 512
    assert fifo_count(bus) == 512
    assert bus.write_read(IMU, bytes([INT_STATUS]), 1)[0] & 0x10
    assert not bus.write_read(IMU, bytes([INT_STATUS]), 1)[0] & 0x10
    now_counts = registers(bus)[0]
    data = bus.write_read(IMU, bytes([FIFO_R_W]), 512)
    per_sample = 16384 / G * 0.005
    if stop_when_full:  # the oldest stay, whole from the front
        assert samples(data[: 36 * 14])[0, 0] == pytest.approx(start_counts, abs=2 * per_sample)
    else:  # the newest stay: the end is whole, the front is torn
        assert samples(data[512 - 36 * 14 :])[-1, 0] == pytest.approx(now_counts, abs=2 * per_sample)


def test_the_low_pass_filter_delays(bus_of, clock):
    """With a ramp, a delay is an offset: 11.8 ms and 66.96 ms (RM sec. 4.7, A_DLPF_CFG 3 and 6)."""
    bus = bus_of(force_mps2=lambda t: np.outer(t, [10.0, 0, 0]))
    values = {}
    for dlpf in (3, 6):
        bus.write(IMU, bytes([SMPLRT_DIV, 0, 1, 0, 0, dlpf]))
        start_ns = clock.now_ns()
        clock.advance_ns(20_000_000)
        since_s = (clock.now_ns() - start_ns) * 1e-9
        values[dlpf] = registers(bus)[0] / 16384 * G / 10 - since_s - (start_ns - 5_000_000_000) * 1e-9
    assert values[3] - values[6] == pytest.approx(66.96e-3 - 11.80e-3, abs=1.1e-3)  # samples are 1 ms apart


def tone(frequency_Hz, amplitude_mps2=10.0):
    return lambda t: amplitude_mps2 * np.outer(np.sin(2 * np.pi * frequency_Hz * t), [1.0, 0, 0])


def heard(bus, clock, divider, seconds):
    """Specific force x [m/s^2] from the FIFO, filtered at 41 Hz (A_DLPF_CFG 3), read every 20 ms."""
    bus.write(IMU, bytes([SMPLRT_DIV, divider, 0x03, 0, 0, 3]))
    bus.write(IMU, bytes([FIFO_EN, 0x08]))
    bus.write(IMU, bytes([USER_CTRL, 0x44]))
    data = b""
    for _ in range(round(seconds / 0.02)):
        clock.advance_ns(20_000_000)
        data += bus.write_read(IMU, bytes([FIFO_R_W]), fifo_count(bus) // 6 * 6)
    return samples(data, columns=3)[:, 0] / 16384 * G


@pytest.mark.parametrize("frequency_Hz", [5.0, 41.0, 100.0, 200.0])
def test_the_low_pass_filter_takes_out_what_is_above_its_corner(bus_of, clock, frequency_Hz):
    """It is first order at 41 Hz; computed in steps of 1 ms, it passes a little more near half of 1 kHz."""
    force = heard(bus_of(force_mps2=tone(frequency_Hz)), clock, 0, 2.0)
    gain = np.sqrt(2) * force.std() / 10.0
    assert gain == pytest.approx(1 / np.hypot(1, frequency_Hz / 41.0), rel=0.02 + 0.5 * (frequency_Hz / 500) ** 2)


def test_vibration_at_the_sample_rate_folds_down_to_what_the_filter_let_through(bus_of, clock):
    """A vibration at 200 Hz, sampled at 200 Hz within 1 %, becomes a slow swing of a fifth of its size, not of all of
    it."""
    force = heard(bus_of(force_mps2=tone(200.0)), clock, 4, 5.0)
    assert 0.15 < np.abs(force).max() / 10.0 < 0.26


def test_no_seam_between_two_blocks_of_samples(bus_of, clock):
    """A tone stays a tone over the two seconds that take several blocks to make."""
    force = heard(bus_of(force_mps2=tone(10.0)), clock, 4, 4.0)
    phase = 2 * np.pi * 10.0 / 200.0 * np.arange(len(force))
    slip = np.linspace(-0.015, 0.015, 601)  # its clock: within 1 %
    fits = [np.column_stack([np.sin(phase * (1 + s)), np.cos(phase * (1 + s)), np.ones(len(phase))]) for s in slip]
    residuals = [force - fit @ np.linalg.lstsq(fit, force, rcond=None)[0] for fit in fits]
    assert (
        min(np.abs(r).max() for r in residuals) < 0.05
    )  # 0.5 % of the tone: the search for the clock's error is coarse


def test_the_magnetometer_shows_only_through_the_bypass(bus_of):
    bus = bus_of()
    with pytest.raises(OSError):
        bus.write_read(MAG, b"\x00", 1)
    bus.write(IMU, bytes([INT_PIN_CFG, 0x02]))
    assert bus.write_read(MAG, b"\x00", 1) == b"\x48"
    bus.write(IMU, bytes([USER_CTRL, 0x20]))  # its own bus master has the auxiliary bus now
    with pytest.raises(OSError):
        bus.write_read(MAG, b"\x00", 1)


def test_two_parts_differ_and_one_seed_is_one_part(powered):
    dumps = [powered(seed=s).i2c("/dev/i2c-1").write_read(IMU, b"\x00", 3) for s in (1, 1, 2)]
    assert dumps[0] == dumps[1] != dumps[2]


def test_a_ramp_is_sampled_where_the_clock_says(bus_of, clock):
    """imu_K has no filter: the register holds the value of the latest 5 ms sample."""
    bus = bus_of(imu_K=ramp(294.15, 1.0))
    set_up_200_Hz(bus)
    clock.advance_ns(2_003_000_000)
    age_s = (clock.now_ns() - 5_000_000_000) * 1e-9 - registers(bus)[3] / 333.87
    assert -0.5 / 333.87 <= age_s <= 0.005 * 1.01 + 0.5 / 333.87
