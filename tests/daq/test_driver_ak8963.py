"""The magnetometer driver: its axes, the discipline of ST2, its overflow flag, and a lost supply."""

import struct

import pytest
from scripted_parts import RegisterBus, bring_up

from flightpower.daq.sensors import SensorFailure
from flightpower.daq.sensors.ak8963 import AK8963Driver, field_T, sensitivity
from flightpower.flight.messages import Status


def registers(fuse=(128, 128, 128)) -> RegisterBus:
    return RegisterBus({0x0C: {0x00: 0x48, 0x10: fuse[0], 0x11: fuse[1], 0x12: fuse[2]}})


def measured(bus: RegisterBus, x: int, y: int, z: int, *, ready: int = 1, status2: int = 0x10) -> None:
    for i, byte in enumerate(struct.pack("<B3hB", ready, x, y, z, status2)):
        bus.registers[0x0C][0x02 + i] = byte


def test_full_scale_is_4912_microtesla_and_the_axes_become_those_of_the_body():
    bus = registers()
    sensor = AK8963Driver(bus)
    bring_up(sensor)
    measured(bus, 32760, 100, -200)
    ((topic, _, message, _),) = sensor.read(0)
    assert topic == "/mag" and message.status is Status.OK
    assert message.field_y_T == pytest.approx(4912e-6)
    assert message.field_x_T == pytest.approx(100 * 4912e-6 / 32760)
    assert message.field_z_T == pytest.approx(200 * 4912e-6 / 32760)


def test_sensitivity_of_the_fuse_memory():
    # Datasheet 8.3.11: 128 leaves the value, 0 halves it, 255 is just below one and a half.
    assert sensitivity(128) == 1
    assert sensitivity(0) == 0.5
    assert field_T((1000, 0, 0), (sensitivity(192), 1, 1))[1] == pytest.approx(1000 * 1.25 * 4912e-6 / 32760)


def test_status_2_is_read_with_the_data_every_time():
    bus = registers()
    sensor = AK8963Driver(bus)
    bring_up(sensor)
    measured(bus, 1, 2, 3)
    requests = []
    plain = bus.write_read
    bus.write_read = lambda address, data, count: (requests.append((data[0], count)), plain(address, data, count))[1]
    sensor.read(0)
    assert all(first <= 0x09 < first + count for first, count in requests)


def test_a_mode_is_only_left_through_power_down():
    bus = registers()
    bring_up(AK8963Driver(bus))
    modes = [data[1] & 0xF for _, data in bus.written if data[0] == 0x0A]
    assert modes == [0xF, 0x0, 0x6]


@pytest.fixture
def started():
    """Registers, and a driver that has been brought up."""
    bus = registers()
    sensor = AK8963Driver(bus)
    bring_up(sensor)
    return bus, sensor


def test_overflow_of_the_sensor_is_saturation(started):
    bus, sensor = started
    measured(bus, 30000, 30000, 0, status2=0x18)
    assert sensor.read(0)[0].message.status is Status.SATURATED


def test_nothing_new_is_stale_and_a_part_that_stopped_is_brought_up_again(started):
    bus, sensor = started
    measured(bus, 1, 2, 3, ready=0)
    assert sensor.read(0)[0].message.status is Status.STALE
    with pytest.raises(SensorFailure, match="stopped"):
        for _ in range(25):
            sensor.read(0)


def test_a_lost_supply_is_noticed(started):
    bus, sensor = started
    bus.registers[0x0C][0x0A] = 0
    with pytest.raises(SensorFailure, match="supply"):
        sensor.read(0)


@pytest.mark.parametrize("bus", [RegisterBus({0x0C: {0x00: 0x00}}), registers(fuse=(0, 0, 0))])
def test_a_wrong_part_or_an_unreadable_fuse_memory_is_refused(bus):
    with pytest.raises(SensorFailure):
        bring_up(AK8963Driver(bus))


def test_one_wrong_bit_in_a_reply_is_no_loss_of_supply():
    """Taking it for one would cost 22 ticks, in which the part starts again."""
    bus = registers()
    sensor = AK8963Driver(bus)
    bring_up(sensor)
    measured(bus, 1, 2, 3)
    plain, replies = bus.write_read, [0x01, 0x00]

    def damaged(address, data, count):
        reply = plain(address, data, count)
        return reply[:-1] + bytes([reply[-1] ^ replies.pop(0)]) if replies else reply

    bus.write_read = damaged
    assert sensor.read(0)[0].message.z_counts == 3 and replies == []
    replies += [0x01, 0x01]
    with pytest.raises(SensorFailure, match="supply"):
        sensor.read(1)


@pytest.mark.parametrize("bit", range(7, 16))
def test_one_wrong_bit_in_the_field_is_corrupt_and_a_field_that_has_changed_is_believed_at_the_second_reading(
    started, bit
):
    bus, sensor = started
    statuses = []
    for z in (-300, -300, -300 ^ 1 << bit if bit < 15 else -300 + 0x8000, -300, 400, 405, 410):
        measured(bus, 100, 20, z)
        statuses.append(sensor.read(0)[0].message.status)
    assert statuses == [Status.OK] * 2 + [Status.CORRUPT, Status.OK, Status.CORRUPT, Status.OK, Status.OK]
