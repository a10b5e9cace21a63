"""AK8963 datasheet MS1356-E-02, from the bus's side."""

import struct

import numpy as np
import pytest
from analytic_sensor_truth import constant

MAG = 0x0C
ST1, CNTL1, CNTL2, ASAX = 0x02, 0x0A, 0x0B, 0x10
FIELD_T = np.array([20e-6, -3e-6, 45e-6])


@pytest.fixture
def mag_of(bus_of):
    def make(**functions):
        bus = bus_of(**functions)
        bus.write(0x68, b"\x37\x02")
        return bus

    return make


def enter(bus, clock, control):
    bus.write(MAG, bytes([CNTL1, 0]))
    clock.advance_ns(100_000)
    bus.write(MAG, bytes([CNTL1, control]))


def block(bus):
    """ST1, x, y, z, ST2."""
    return struct.unpack("<B3hB", bus.write_read(MAG, bytes([ST1]), 8))


def test_the_fuse_rom_is_readable_in_its_mode_only(mag_of, clock):
    bus = mag_of()
    assert bus.write_read(MAG, bytes([ASAX]), 3) == bytes(3)
    enter(bus, clock, 0x0F)
    assert all(128 <= a < 256 for a in bus.write_read(MAG, bytes([ASAX]), 3))


def test_counts_are_on_its_own_axes_with_the_fuse_sensitivity(mag_of, clock):
    bus = mag_of(field_T=constant(FIELD_T))
    enter(bus, clock, 0x0F)
    fuse = np.frombuffer(bus.write_read(MAG, bytes([ASAX]), 3), "u1")
    enter(bus, clock, 0x16)
    clock.advance_ns(20_000_000)
    _, *counts, status2 = block(bus)
    own = FIELD_T[[1, 0, 2]] * [1, 1, -1]  # x and y change places, z turned round (PS-MPU-9250A-01 sec. 9.1)
    np.testing.assert_allclose(counts, own / (4912e-6 / 32760) / ((fuse - 128.0) / 256 + 1), atol=0.5)
    assert status2 == 0x10  # 16 bits, no overflow


def test_a_hundred_measurements_a_second_each_ready_once(mag_of, clock):
    bus = mag_of()
    enter(bus, clock, 0x16)
    ready = 0
    for _ in range(500):
        clock.advance_ns(2_000_000)
        ready += block(bus)[0] & 1
    assert ready == pytest.approx(100 * (clock.now_ns() - 5_500_000_000) * 1e-9, abs=2)


def test_without_reading_st2_it_stops_updating(mag_of, clock):
    bus = mag_of(field_T=lambda t: np.outer(t, [0, 20e-6, 0]))
    enter(bus, clock, 0x16)
    clock.advance_ns(20_000_000)
    first = bus.write_read(MAG, bytes([0x03]), 6)
    clock.advance_ns(500_000_000)
    assert bus.write_read(MAG, bytes([0x03]), 6) == first
    assert not bus.write_read(MAG, bytes([ST1]), 1)[0] & 1
    bus.write_read(MAG, bytes([0x09]), 1)
    clock.advance_ns(20_000_000)
    assert bus.write_read(MAG, bytes([ST1]), 1)[0] & 1
    assert bus.write_read(MAG, bytes([0x03]), 6) != first


def test_skipped_measurements_are_flagged(mag_of, clock):
    bus = mag_of()
    enter(bus, clock, 0x16)
    clock.advance_ns(100_000_000)
    assert block(bus)[0] == 0x03  # ready, and overrun


def test_the_sum_of_the_axes_overflows(mag_of, clock):
    bus = mag_of(field_T=constant([2000e-6, 2000e-6, 1000e-6]))
    enter(bus, clock, 0x16)
    clock.advance_ns(20_000_000)
    assert block(bus)[4] & 0x08


def test_a_mode_is_entered_through_power_down_only(mag_of, clock):
    bus = mag_of()
    enter(bus, clock, 0x0F)
    bus.write(MAG, bytes([CNTL1, 0x16]))
    assert bus.write_read(MAG, bytes([CNTL1]), 1)[0] == 0x0F


def test_soft_reset_powers_down(mag_of, clock):
    bus = mag_of()
    enter(bus, clock, 0x16)
    bus.write(MAG, bytes([CNTL2, 1]))
    assert bus.write_read(MAG, bytes([CNTL1]), 1) == b"\x00"


def test_a_single_measurement_ends_in_power_down(mag_of, clock):
    bus = mag_of()
    enter(bus, clock, 0x11)
    clock.advance_ns(9_000_000)
    assert block(bus)[0] & 1
    assert bus.write_read(MAG, bytes([CNTL1]), 1)[0] & 0x0F == 0
