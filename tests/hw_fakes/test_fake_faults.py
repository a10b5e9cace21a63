"""Each fault does what its name says, for its duration and no longer."""

import pytest
from analytic_sensor_truth import AnalyticSensorTruth, ramp

from flightpower.flight.errors import InputError
from flightpower.hw_fakes import ms56xx
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.faults import DEVICES_OF_KIND, Fault, load_faults
from flightpower.hw_fakes.tray import ADDRESSES, PORTS, FakeTray

START_S, END_S = 2.0, 3.0


def tray_with(kind, device, **sensor_truth):
    clock = SimulatedClock()
    faults = [Fault(kind=kind, device=device, start_s=START_S, duration_s=END_S - START_S, rate=0.2)]
    return clock, FakeTray(AnalyticSensorTruth(**sensor_truth), clock, 1, faults=faults)


def advance(clock, seconds):
    clock.sleep_until_ns(round(seconds * 1e9))


def error_of(ask):
    try:
        ask()
    except OSError as error:
        return error.errno
    return None


@pytest.mark.parametrize(("kind", "number"), [("no_acknowledge", 121), ("timeout", 110), ("brown_out", 121)])
@pytest.mark.parametrize("device", ["imu", "baro", "alpha"])
def test_transfers_fail_while_it_lasts(kind, number, device):
    clock, tray = tray_with(kind, device)
    bus, address = tray.i2c("/dev/i2c-1"), ADDRESSES[device]
    seen = []
    for time_s in (1.9, 2.05, 2.95, 3.1):
        advance(clock, time_s)
        seen.append(error_of(lambda: bus.read(address, 2)))
    assert seen == [None, number, number, None]


def test_a_hanging_bus_hangs_for_all_and_costs_time():
    clock, tray = tray_with("timeout", "i2c")
    bus = tray.i2c("/dev/i2c-1")
    advance(clock, 2.1)
    for address in ADDRESSES.values():
        before_ns = clock.now_ns()
        assert error_of(lambda address=address: bus.read(address, 2)) == 110
        assert clock.now_ns() - before_ns == 20_000_000


def test_after_a_brown_out_the_imu_is_at_its_defaults_and_hides_its_magnetometer():
    clock, tray = tray_with("brown_out", "imu")
    bus = tray.i2c("/dev/i2c-1")
    advance(clock, 1.0)
    bus.write(0x68, bytes([0x19, 4, 3]))
    bus.write(0x68, bytes([0x37, 2]))
    bus.write(0x0C, bytes([0x0A, 0x16]))
    advance(clock, 3.1)
    assert bus.write_read(0x68, bytes([0x19]), 2) == b"\x00\x00"
    assert error_of(lambda: bus.read(0x0C, 1)) == 121
    bus.write(0x68, bytes([0x37, 2]))
    assert bus.write_read(0x0C, bytes([0x0A]), 1) == b"\x00"


def test_bits_flip_in_about_as_many_bytes_as_asked_for():
    """600 bytes of a constant register at a rate of 0.2 give 120, with a standard deviation of 10."""
    clock, tray = tray_with("bit_flips", "imu")
    bus = tray.i2c("/dev/i2c-1")
    advance(clock, 2.1)
    replies = [bus.write_read(0x68, bytes([0x75]), 1)[0] for _ in range(600)]
    wrong = [reply for reply in replies if reply != 0x71]
    assert 70 < len(wrong) < 170
    assert all((reply ^ 0x71).bit_count() == 1 for reply in wrong)
    advance(clock, 3.1)
    assert bus.write_read(0x68, bytes([0x75]), 1)[0] == 0x71


def test_a_stuck_value_repeats_the_last_good_one():
    clock, tray = tray_with("stuck_value", "airspeed", differential_Pa=ramp(0.0, 100.0))
    bus = tray.i2c("/dev/i2c-1")
    replies = []
    for time_s in (1.5, 2.1, 2.9, 3.1):
        advance(clock, time_s)
        replies.append(bus.read(0x28, 4))
    assert replies[0] == replies[1] == replies[2] != replies[3]


def test_a_stale_bridge_says_so():
    clock, tray = tray_with("stale", "alpha", differential_Pa=ramp(0.0, 100.0))
    bus = tray.i2c("/dev/i2c-1")
    statuses = []
    for time_s in (1.5, 2.1, 2.5, 2.9, 3.1):
        advance(clock, time_s)
        statuses.append(bus.read(0x36, 4)[0] >> 6)
    assert statuses == [0, 0, 2, 2, 0]  # the update at the instant at which updates stopped had not been read


def test_a_latched_fault_ends_with_its_supply():
    clock, tray = tray_with("latched_fault", "beta")
    bus = tray.i2c("/dev/i2c-1")
    statuses = []
    for time_s in (1.5, 2.1, 2.9, 3.1):
        advance(clock, time_s)
        statuses.append(bus.read(0x46, 4)[0] >> 6)
    assert statuses == [0, 3, 3, 0]


def test_the_prom_is_damaged_for_a_while():
    clock, tray = tray_with("wrong_prom_crc", "baro")
    bus = tray.i2c("/dev/i2c-1")
    valid = []
    for time_s in (1.5, 2.1, 3.1):
        advance(clock, time_s)
        words = [int.from_bytes(bus.write_read(0x77, bytes([0xA0 + 2 * i]), 2), "big") for i in range(8)]
        valid.append(ms56xx.crc4([*words[:7], words[7] & 0xFF00]) == words[7] & 0xF)
    assert valid == [True, False, True]


def test_another_part_at_the_address_is_not_an_imu():
    clock, tray = tray_with("wrong_device", "imu")
    advance(clock, 2.1)
    assert tray.i2c("/dev/i2c-1").write_read(0x68, bytes([0x75]), 1)[0] not in (0x71, 0x73)


def heard(port, clock, until_s):
    data = b""
    while clock.now_ns() < round(until_s * 1e9):
        clock.advance_ns(40_000_000)
        data += port.read_available()
    return data


def test_a_silent_counter_is_silent_and_comes_back():
    clock, tray = tray_with("silent", "esc_counter")
    port = tray.port(PORTS["esc_counter"], 115200)
    assert heard(port, clock, START_S)
    assert heard(port, clock, END_S - 0.05) == b""
    clock.advance_ns(60_000_000)
    port.read_available()
    assert heard(port, clock, END_S + 1.0)


def test_an_unplugged_line_is_dead_until_opened_again():
    clock, tray = tray_with("unplugged", "autopilot")
    path = PORTS["autopilot"]
    port = tray.port(path, 57600)
    advance(clock, 1.0)
    assert port.read_available()
    advance(clock, 2.5)
    assert error_of(port.read_available) == 5
    with pytest.raises(FileNotFoundError):
        tray.port(path, 57600)
    advance(clock, 3.5)
    assert error_of(port.read_available) == 5
    again = tray.port(path, 57600)
    advance(clock, 4.0)
    assert again.read_available()


def test_the_fix_is_lost_and_found_at_the_right_solutions():
    clock, tray = tray_with("no_fix", "gps")
    port = tray.port(PORTS["gps"], 38400)
    sentences = heard(port, clock, 6.5).split(b"\r\n")
    valid = {s.split(b",")[1][4:6]: s.split(b",")[2] for s in sentences if s.startswith(b"$GNRMC") and b"*" in s}
    # NMEA comes once a second; a solution is 80 ms old, so the one of 2 s is dated 01.92, which is rounded to 02.
    assert [valid[f"{s:02d}".encode()] for s in range(1, 6)] == [b"A", b"V", b"A", b"A", b"A"]


def test_checksum_errors_hit_about_as_many_bytes_as_asked_for():
    clock, tray = tray_with("checksum_errors", "esc_counter")
    healthy = FakeTray(AnalyticSensorTruth(), SimulatedClock(), 1)
    port = tray.port(PORTS["esc_counter"], 115200)
    heard(port, clock, START_S)
    damaged = heard(port, clock, END_S - 0.04)
    frame = healthy.esc_counter.output(1_000_000_000)[0][1]
    wrong = sum(damaged[i : i + 4] not in (frame, frame[:3] + b"\xcd", frame[:3] + b"\xce") for i in range(0, 260, 4))
    assert 65 * 0.35 < wrong < 65 * 0.85  # 65 frames of four bytes, each byte hit with a probability of 0.2: 59 %


def test_the_same_seed_is_the_same_misfortune():
    replies = []
    for _ in range(2):
        clock, tray = tray_with("bit_flips", "alpha")
        advance(clock, 2.1)
        replies.append([tray.i2c("/dev/i2c-1").read(0x36, 4) for _ in range(50)])
    assert replies[0] == replies[1]


def test_a_schedule_is_read_with_its_units(tmp_path):
    path = tmp_path / "faults.toml"
    path.write_text('[[fault]]\nkind = "stale"\ndevice = "alpha"\nstart = "1 min"\nduration = "500 ms"\n')
    assert load_faults(path) == (Fault(kind="stale", device="alpha", start_s=60.0, duration_s=0.5),)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ('[[fault]]\nkind = "gremlins"\ndevice = "imu"\nstart = "1 s"', "gremlins"),
        ('[[fault]]\nkind = "no_fix"\ndevice = "imu"\nstart = "1 s"', "imu"),
        ('[[fault]]\nkind = "stale"\ndevice = "alpha"\nstart = "1 m"', "start"),
        ('[[fault]]\nkind = "stale"\ndevice = "alpha"', "start is missing"),
        ('[[fault]]\nkind = "stale"\ndevice = "alpha"\nstart = "1 s"\nduration = "0 s"', "duration"),
        ('[[faults]]\nkind = "stale"', "[[fault]]"),
        ("[[fault", "TOML"),
    ],
)
def test_a_wrong_schedule_is_refused_in_one_line(tmp_path, text, named):
    path = tmp_path / "faults.toml"
    path.write_text(text)
    with pytest.raises(InputError) as caught:
        load_faults(path)
    assert "faults.toml" in str(caught.value) and named in str(caught.value) and "\n" not in str(caught.value)


def test_every_kind_can_be_put_into_a_tray():
    faults = [
        Fault(kind=kind, device=device, start_s=1.0, duration_s=1.0)
        for kind, devices in DEVICES_OF_KIND.items()
        for device in devices
    ]
    tray = FakeTray(AnalyticSensorTruth(), SimulatedClock(), faults=faults)
    assert tray.i2c("/dev/i2c-1") and tray.port(PORTS["gps"], 38400)
