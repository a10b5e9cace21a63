"""The IMU driver against registers: identity, configuration, FIFO arithmetic, and a part that misbehaves."""

import math
import struct

import pytest
from scripted_parts import RegisterBus, bring_up

from flightpower.daq.sensors import SensorFailure
from flightpower.daq.sensors.axes import parse_axes
from flightpower.daq.sensors.mpu9250 import MPU9250Driver, Ranges, mean
from flightpower.flight.messages import Imu, Status

ADDRESS = 0x68
ONE_G_DOWN = (0, 0, -4096, 0, 0, 0, 0)  # at rest, +-8 g, z down: the part is pushed up, along -z


class Chip(RegisterBus):
    """Registers of an MPU-9250 and a FIFO that is filled by hand."""

    def __init__(self, identity: int = 0x71):
        super().__init__({ADDRESS: {0x75: identity, 0x6B: 0x01}})
        self.fifo = b""
        self.bursts_fail = False

    def put(self, *samples: tuple[int, ...]) -> None:
        self.fifo += b"".join(struct.pack(">7h", *sample) for sample in samples)

    def write(self, address: int, data: bytes) -> None:
        super().write(address, data)
        if data[0] == 0x6A and data[1] & 0x04:
            self.fifo = b""

    def write_read(self, address: int, data: bytes, count: int) -> bytes:
        if data[0] == 0x74:
            taken, self.fifo = self.fifo[:count], self.fifo[count:]
            if self.bursts_fail:
                self.fifo = self.fifo[5:]
                raise OSError(121, "Remote I/O error")
            return taken
        self.registers[address][0x72], self.registers[address][0x73] = divmod(len(self.fifo), 256)
        return super().write_read(address, data, count)


def started(**options) -> tuple[Chip, MPU9250Driver]:
    chip = Chip()
    sensor = MPU9250Driver(chip, ADDRESS, **options)
    bring_up(sensor)
    return chip, sensor


def read(sensor: MPU9250Driver) -> Imu:
    (sample,) = sensor.read(123)
    assert sample.topic == "/imu" and sample.time_ns == 123
    return sample.message


def test_the_part_is_given_the_time_of_its_datasheet_to_start():
    """The gyroscope needs 35 ms to wake (PS 3.1) and gives zeros meanwhile."""
    chip = Chip()
    waits_s = {0x80: 0.0, 0x01: 0.0}  # by power management: after the reset, after waking
    for wait_s in MPU9250Driver(chip, ADDRESS).start():
        waits_s[chip.registers[ADDRESS][0x6B]] += wait_s
    assert waits_s[0x80] >= 0.1 and waits_s[0x01] >= 0.035


def test_one_g_at_rest_in_any_range():
    for range_g, counts in ((2, 16384), (4, 8192), (8, 4096), (16, 2048)):
        chip, sensor = started(ranges=Ranges(g=range_g))
        chip.put((0, 0, -counts, 0, 0, 0, 0))
        assert read(sensor).specific_force_z_mps2 == pytest.approx(-9.80665)


def test_rate_scale_of_each_range():
    for range_dps, counts in ((250, 1310), (500, 655), (1000, 328), (2000, 164)):
        chip, sensor = started(ranges=Ranges(dps=range_dps))
        chip.put((0, 0, 0, 0, counts, 0, 0))
        assert read(sensor).angular_rate_x_radps == pytest.approx(math.radians(10))


def test_a_tick_is_the_mean_of_what_the_fifo_held():
    chip, sensor = started()
    chip.put(*[(100 * i, 0, -4096, 334, 0, i, 0) for i in range(8)])
    message = read(sensor)
    assert message.samples == 8
    assert message.accel_x_counts == 350
    assert message.gyro_y_counts == 3.5
    assert message.temperature_K == pytest.approx(295.15, abs=0.01)
    # Eight samples 5 ms apart are 20 ms old on average, to which the filters add 9.9 and 11.8 ms.
    assert message.group_delay_s == pytest.approx(0.0299)
    assert message.specific_force_group_delay_s == pytest.approx(0.0318)


def test_a_fifo_that_has_grown_is_read_in_parts_and_nothing_is_lost():
    """After a passed-over tick at 25 Hz, 16 samples wait. Each part has the age of its own samples."""
    chip, sensor = started(period_s=0.04)
    chip.put(*[(number, 0, -4096, 0, 0, 0, 0) for number in range(16)])
    first, following = 16, []
    while len(chip.fifo) or not following:
        following.append(read(sensor))
        if len(following) < 8:
            chip.put(*[(first + number, 0, -4096, 0, 0, 0, 0) for number in range(8)])
            first += 8
    assert max(message.samples for message in following) == 9
    assert sum(message.samples for message in following) == first
    assert sum(message.samples * message.accel_x_counts for message in following) == pytest.approx(
        first * (first - 1) / 2
    )
    # The first nine samples are on average 5 ms times (4.5 + 7) old, since seven samples follow them.
    assert following[0].group_delay_s == pytest.approx(0.0099 + 0.005 * (4.5 + 7))
    assert following[-1].group_delay_s < 0.0099 + 0.005 * 4.5 + 1e-9


def test_half_a_sample_is_left_for_the_next_tick():
    chip, sensor = started()
    chip.put(ONE_G_DOWN, ONE_G_DOWN)
    complete, chip.fifo = chip.fifo, chip.fifo[:20]
    assert read(sensor).samples == 1
    chip.fifo += complete[20:]
    message = read(sensor)
    assert (message.samples, message.accel_z_counts) == (1, -4096)


def test_an_empty_fifo_is_stale_not_an_old_value():
    _, sensor = started()
    assert read(sensor) == Imu(status=Status.STALE)


def test_overflow_is_reported_and_recovered_from():
    chip, sensor = started()
    chip.put(*[ONE_G_DOWN] * 36)
    assert read(sensor) == Imu(status=Status.CORRUPT)
    chip.put(ONE_G_DOWN)
    assert read(sensor).status is Status.OK


def test_a_burst_torn_by_the_bus_does_not_shift_the_following_samples():
    chip, sensor = started()
    chip.put(*[ONE_G_DOWN] * 4)
    chip.bursts_fail = True
    with pytest.raises(OSError):
        sensor.read(0)
    chip.bursts_fail = False
    chip.put(ONE_G_DOWN)
    assert read(sensor).status is Status.STALE
    chip.put(ONE_G_DOWN)
    assert read(sensor).accel_z_counts == -4096


def test_counts_at_the_end_of_the_range_are_a_bound_not_a_measurement():
    chip, sensor = started()
    chip.put(ONE_G_DOWN, (32767, 0, 0, 0, 0, 0, 0))
    assert read(sensor).status is Status.SATURATED


@pytest.mark.parametrize("fifo", [True, False])
def test_a_part_back_at_its_defaults_is_not_read_as_if_configured(fifo):
    chip, sensor = started(fifo=fifo)
    chip.registers[ADDRESS] = {0x75: 0x71, 0x6B: 0x01}
    with pytest.raises(SensorFailure, match="supply"):
        sensor.read(0)


def test_another_part_at_the_address_is_refused():
    with pytest.raises(SensorFailure) as refused:
        bring_up(MPU9250Driver(Chip(identity=0x68), ADDRESS))
    assert refused.value.status is Status.WRONG_DEVICE
    bring_up(MPU9250Driver(Chip(identity=0x73), ADDRESS))


def test_a_part_that_does_not_take_its_settings_is_refused():
    chip = Chip()
    chip.hook = lambda address, data: chip.registers[ADDRESS].update({0x1C: 0})
    with pytest.raises(SensorFailure, match="settings"):
        bring_up(MPU9250Driver(chip, ADDRESS))


def test_single_reads_take_the_narrow_filters_and_say_so():
    chip, sensor = started(fifo=False)
    for i, byte in enumerate(struct.pack(">7h", *ONE_G_DOWN)):
        chip.registers[ADDRESS][0x3B + i] = byte
    message = read(sensor)
    assert (message.samples, message.accel_z_counts) == (1, -4096)
    assert message.group_delay_s == pytest.approx(0.03348)
    assert message.specific_force_group_delay_s == pytest.approx(0.0357)


def test_a_chip_mounted_turned_round_gives_body_axes():
    chip, sensor = started(axes=parse_axes(("y", "-x", "z")))
    chip.put((4096, 0, 0, 0, 0, 131, 0))
    message = read(sensor)
    assert message.specific_force_y_mps2 == pytest.approx(-9.80665)
    assert message.angular_rate_x_radps == pytest.approx(math.radians(2))


@pytest.mark.parametrize("names", [("x", "y", "-z"), ("y", "x", "z"), ("x", "x", "z"), ("x", "y", "w"), ("", "y", "z")])
def test_axes_that_no_mounting_can_have_are_refused(names):
    with pytest.raises(ValueError, match="axes"):
        parse_axes(names)


@pytest.mark.parametrize("later", [20, 40])
def test_samples_that_fill_the_fifo_before_the_burst_give_no_wrong_value(later):
    """A full FIFO of 512 bytes overwrites its oldest ones, and 512 is no multiple of 14: the burst begins within a
    sample. A reader that is only late, without an overflow, loses nothing."""
    chip, sensor = started()
    chip.put(*[ONE_G_DOWN] * 8)
    whole_read = chip.write_read

    def late_read(address: int, data: bytes, count: int) -> bytes:
        if data[0] == 0x74:
            chip.put(*[ONE_G_DOWN] * later)
            chip.fifo = chip.fifo[-512:]
        return whole_read(address, data, count)

    chip.write_read = late_read  # type: ignore[method-assign]
    message = read(sensor)
    chip.write_read = whole_read  # type: ignore[method-assign]
    if later == 40:
        assert message.status is Status.CORRUPT
        chip.put(*[ONE_G_DOWN] * 8)
        message = read(sensor)
    assert message.status is Status.OK
    assert message.specific_force_z_mps2 == pytest.approx(-9.80665)


@pytest.mark.parametrize("limit", [32767, -32768])
def test_a_single_sample_at_either_end_of_a_range_saturates_and_the_temperature_does_not(limit):
    """Ten samples of three forces, temperature and three rates."""
    for channel in range(7):
        counts = [[0] * 7 for _ in range(10)]
        counts[4][channel] = limit
        result = mean(b"".join(struct.pack(">7h", *sample) for sample in counts))
        assert result.saturated == (channel != 3) and result[1][channel] == limit / 10


LOST = {"gyroscope's range": 0x1B, "accelerometer's range": 0x1C, "rate": 0x19, "filter": 0x1A}


@pytest.mark.parametrize("register", LOST.values(), ids=LOST)
def test_samples_of_other_settings_are_not_recorded_and_the_settings_are_restored(register):
    chip, sensor = started()
    chip.put(ONE_G_DOWN)
    assert read(sensor).status is Status.OK and sensor.complaint == ""
    chip.registers[ADDRESS][register] ^= 0x18
    chip.put(*[(0, 0, -16384, 0, 0, 0, 0)] * 4)
    assert read(sensor) == Imu(status=Status.FAULT) and "ranges" in sensor.complaint
    chip.put(ONE_G_DOWN)
    assert read(sensor).specific_force_z_mps2 == pytest.approx(-9.80665)
    chip.put(ONE_G_DOWN)
    sensor.read(10_000_000_000)
    assert sensor.complaint == ""


def test_a_part_that_loses_its_settings_again_and_again_is_started_again():
    chip, sensor = started()
    with pytest.raises(SensorFailure, match="does not keep"):
        for _ in range(4):
            chip.registers[ADDRESS][0x1C] = 0
            chip.put(ONE_G_DOWN)
            assert read(sensor).status is Status.FAULT


@pytest.mark.parametrize(("register", "lost"), [(0x23, "ranges"), (0x37, "bypass")])
def test_what_the_fifo_takes_and_the_way_to_the_magnetometer_are_audited_in_turn(register, lost):
    chip, sensor = started()
    chip.registers[ADDRESS][register] = 0
    for tick in range(50):
        chip.put(ONE_G_DOWN)
        sensor.read(tick)
    assert chip.registers[ADDRESS][register] and lost in sensor.complaint


def flipped_once(chip: Chip, register: int, byte: int, bit: int) -> None:
    """Flip one bit in the next reply that starts at `register`."""
    original, pending = chip.write_read, [True]

    def damaged(address, data, count):
        reply = bytearray(original(address, data, count))
        if data[0] == register and pending:
            pending.pop()
            reply[byte] ^= 1 << bit
        return bytes(reply)

    chip.write_read = damaged


@pytest.mark.parametrize(("register", "byte"), [(0x6A, 0), (0x6A, 1), (0x19, 2), (0x19, 3)])
def test_one_wrong_bit_in_a_reply_is_no_loss_of_supply(register, byte):
    """Starting the part again would cost the magnetometer 22 ticks."""
    for bit in range(8):
        chip, sensor = started()
        flipped_once(chip, register, byte, bit)
        chip.put(ONE_G_DOWN)
        assert read(sensor).accel_z_counts == -4096 and sensor.complaint == ""


def test_one_wrong_bit_in_the_count_costs_nothing():
    """Eight samples wait; a wrong count would give another mean, of bytes that are not there, with another delay."""
    for byte, bit in [(8, 0), (9, 7), (9, 6), (9, 5)]:
        chip, sensor = started(period_s=0.04)
        for tick in range(1, 4):
            chip.put(*[ONE_G_DOWN] * 8)
            if tick == 2:
                flipped_once(chip, 0x6A, byte, bit)
            (sample,) = sensor.read(tick * 40_000_000)
            assert (sample.message.samples, sample.message.accel_z_counts) == (8, -4096)


@pytest.mark.parametrize("bit", range(8, 16))
def test_one_wrong_bit_in_a_sample_is_corrupt(bit):
    chip, sensor = started()
    for place in range(8):
        samples = [(20 * i, -10 * i, -4096 + 5 * i, 100, i, -i, 0) for i in range(8)]
        wrong = list(samples[place])
        word = (wrong[2] & 0xFFFF) ^ 1 << bit
        wrong[2] = word - 0x10000 if word & 0x8000 else word
        samples[place] = tuple(wrong)
        chip.put(*samples)
        assert read(sensor) == Imu(status=Status.CORRUPT)


def test_vibration_is_not_taken_for_damage():
    """2 g at 35 Hz, which the low-pass filter of 41 Hz passes: each sample is far from its neighbors."""
    chip, sensor = started()
    for tick in range(100):
        times_s = [0.005 * (8 * tick + i) for i in range(8)]
        chip.put(*[(round(8192 * math.sin(2 * math.pi * 35 * t)), 0, -4096, 100, 0, 0, 0) for t in times_s])
        assert read(sensor).status is Status.OK


def test_a_burst_that_is_shifted_by_a_bit_is_corrupt():
    chip, sensor = started()
    sample = (40, -60, -4097, 2000, 15, 8, -3)
    for _ in range(2):
        chip.put(*[sample] * 8)
        assert read(sensor).status is Status.OK
    chip.put(*[sample] * 8)
    chip.fifo = (int.from_bytes(chip.fifo, "big") >> 1).to_bytes(len(chip.fifo), "big")
    assert read(sensor) == Imu(status=Status.CORRUPT)
    chip.put(*[sample] * 8)
    assert read(sensor).accel_z_counts == -4097
