"""Motor speed from frames in torn bytes, in both variants, and from silence."""

from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scripted_parts import ScriptedPort, bring_up, pieces

from flightpower.daq.sensors.esc_counter import EscCounterDriver, FramedParser, LegacyParser, crc8, motor_speed_revps
from flightpower.flight.messages import Status

TICK_NS = 40_000_000


def legacy(period_us: int) -> bytes:
    return b"x" + period_us.to_bytes(3, "big")


def framed(sequence: int, period_us: int, flags: int = 0, pulses: tuple[int, int, int] = (10, 0, 0)) -> bytes:
    body = bytes([sequence % 256, flags]) + period_us.to_bytes(4, "big") + bytes(pulses)
    return b"\xa6" + body + bytes([crc8(body)])


def periods_of(parser: FramedParser | LegacyParser, data: bytes) -> list[int | None]:
    return [frame.period_us for frame in parser.feed(data)]


def test_speed_of_a_seven_pole_pair_motor():
    # 8000 rpm: 133.3 rev/s, 933.3 electrical periods a second, ten of them last 10714 us.
    assert motor_speed_revps(10714, 7) * 60 == pytest.approx(8000, rel=1e-4)


def test_check_value_of_the_crc():
    assert crc8(b"123456789") == 0xF4


@given(st.binary(max_size=200), st.lists(st.integers(0, 10_000), max_size=8), st.booleans())
def test_any_bytes_in_any_pieces_never_raise(noise, cuts, with_crc):
    parser = FramedParser() if with_crc else LegacyParser()
    for piece in pieces(noise, cuts):
        assert all((frame.period_us or 0) >= 0 for frame in parser.feed(piece))
        if sum(piece) % 3 == 0:
            parser.pause()


CUTS = st.lists(st.integers(0, 10_000), max_size=8)


@given(st.binary(max_size=100), CUTS, st.integers(0x1000, 0x7FFF))
def test_legacy_frames_after_garbage_are_found_however_they_are_torn(noise, cuts, period_us):
    # A real motor's period wanders by more than a count, which distinguishes frames from their shifted images.
    periods = [period_us + 37 * (i * i % 11) for i in range(20)]
    parser = LegacyParser()
    results = [p for piece in pieces(noise + b"".join(map(legacy, periods)), cuts) for p in periods_of(parser, piece)]
    assert results[-10:] == periods[-10:]


@given(st.binary(max_size=100), CUTS, st.integers(300, 2**32 - 1))
def test_framed_frames_after_garbage_are_found_however_they_are_torn(noise, cuts, period_us):
    parser = FramedParser()
    data = noise + b"".join(framed(i, period_us) for i in range(20))
    results = [p for piece in pieces(data, cuts) for p in periods_of(parser, piece)]
    assert results[-10:] == [period_us] * 10


def test_the_letter_inside_the_data_does_not_mislead():
    parser = LegacyParser()
    periods = [0x007805 + i % 3 for i in range(30)]  # 'x' in the middle byte, a low last byte: plausible when shifted
    data = b"".join(map(legacy, periods))[2:]  # the line is opened in the middle of a frame
    assert periods_of(parser, data)[-20:] == periods[-20:]


def test_a_motor_that_spins_up_is_heard_from_its_first_frame():
    """Pulses of a shaft that speeds up evenly come at the square roots of their number: no two periods agree."""
    port, sensor = counter()
    pulse_s = [2.0 + 0.2 * number**0.5 for number in range(60)]  # it was stopped for two seconds
    frames = [(pulse, round((pulse - before) * 1e6)) for before, pulse in pairwise([0.0, *pulse_s])]
    texts = []
    for tick in range(100):
        at_s = tick * TICK_NS * 1e-9
        sent = [period_us for when_s, period_us in frames if at_s - 0.04 < when_s <= at_s]
        port.incoming = [b"".join(map(legacy, sent))]
        texts += [(at_s, sample.message) for sample in sensor.read(tick * TICK_NS)]
    assert {message.status for at_s, message in texts if at_s < 2.19} == {Status.NO_DATA}
    turning = [message for at_s, message in texts if at_s > 2.19]
    assert {message.status for message in turning} == {Status.OK}
    assert turning[0].period_us == 200_000  # the first whole period; two seconds are not a speed


def test_a_frame_torn_by_the_line_is_not_taken_for_the_end_of_one():
    """A read that finds nothing for 5 ms is not a pause: adapters hand over bytes in pieces."""
    port, sensor = counter()
    stream = b"".join(legacy(9000 + i) for i in range(20))
    port.incoming = [piece for i in range(0, len(stream), 3) for piece in (stream[i : i + 3], b"")]
    period_uses = [s.message.period_us for i in range(54) for s in sensor.read(i * 5_000_000)]
    assert period_uses[-10:] == list(range(9010, 9020))


def test_noise_after_a_pause_is_not_believed():
    parser = LegacyParser()
    parser.pause()
    assert parser.feed(b"boot: ready\r\n") == []


def test_lost_frames_of_the_variant_are_counted():
    parser = FramedParser()
    parser.feed(framed(254, 9000) + framed(255, 9000) + framed(2, 9000))
    assert parser.lost == 2


def test_a_damaged_frame_of_the_variant_is_dropped():
    good = framed(1, 9000)
    for i in range(len(good)):
        damaged = good[:i] + bytes([good[i] ^ 0x10]) + good[i + 1 :]
        assert periods_of(FramedParser(), damaged + framed(2, 8000)) == [8000]


def counter(**options) -> tuple[ScriptedPort, EscCounterDriver]:
    port = ScriptedPort()
    sensor = EscCounterDriver(port, pole_pairs=7, **options)
    bring_up(sensor)
    return port, sensor


def statuses(sensor: EscCounterDriver, ticks: int) -> list[Status]:
    return [sample.message.status for tick in range(ticks) for sample in sensor.read(tick * TICK_NS)]


def test_silence_is_no_data_and_not_zero():
    _, sensor = counter()
    assert statuses(sensor, 13) == [Status.NO_DATA] * 0
    ((_, _, message, *_),) = sensor.read(13 * TICK_NS)
    assert message.status is Status.NO_DATA and message.motor_speed_revps is None


def test_noise_is_corrupt_and_not_silence():
    port, sensor = counter()
    port.incoming = [b"noise"] * 20
    assert statuses(sensor, 14)[-1] is Status.CORRUPT


def test_a_standing_motor_is_zero_only_when_the_counter_says_so():
    port, sensor = counter(framed=True)
    port.incoming = [framed(0, 0, flags=1)]
    ((_, _, message, *_),) = sensor.read(0)
    assert (message.status, message.motor_speed_revps) == (Status.OK, 0.0)
    assert sensor.read(25 * TICK_NS) == []  # the next such frame is due every half second
    assert sensor.read(40 * TICK_NS)[0].message.status is Status.NO_DATA


def test_the_latest_of_several_frames_counts():
    port, sensor = counter(framed=True)
    port.incoming = [framed(0, 10714) + framed(1, 10000)]
    ((topic, time_ns, message, *_),) = sensor.read(77)
    assert (topic, time_ns, message.period_us) == ("/rpm", 77, 10000)
    assert message.motor_speed_revps == pytest.approx(142.857, abs=0.001)


@pytest.mark.parametrize(
    ("flags", "pulses", "believed"),
    [
        (0, (10, 0, 0), True),
        (0, (12, 2, 1), True),  # noise on one in six
        (0, (20, 10, 0), False),  # an echo after every pulse
        (0, (10, 0, 5), False),
        (2, (10, 0, 0), False),  # the counter says so itself
    ],
)
def test_a_period_whose_pulses_do_not_agree_is_no_speed(flags, pulses, believed):
    port, sensor = counter(framed=True)
    port.incoming = [framed(0, 10714, flags, pulses)]
    ((_, _, message, *_),) = sensor.read(0)
    assert (message.status is Status.OK) == believed == (message.motor_speed_revps is not None)
    assert (message.pulses_captured, message.pulses_rejected, message.pulses_inserted) == pulses


def test_pulses_without_a_period_are_neither_a_speed_nor_a_stop():
    port, sensor = counter(framed=True)
    port.incoming = [framed(0, 0, flags=4, pulses=(3, 0, 0))]
    assert sensor.read(0) == []


def test_earlier_firmware_is_read_without_counts():
    body = bytes([7, 0]) + (10714).to_bytes(4, "big")
    port, sensor = counter(framed=True)
    port.incoming = [b"\xa5" + body + bytes([crc8(body)])]
    ((_, _, message, *_),) = sensor.read(0)
    assert (message.status, message.period_us, message.pulses_captured) == (Status.OK, 10714, None)


def legacy_stream(periods: list[int]) -> list[int | None]:
    """The period reported in each tick, with one legacy frame a tick."""
    port = ScriptedPort()
    sensor = EscCounterDriver(port, pole_pairs=7)
    bring_up(sensor)
    messages = []
    for tick, period in enumerate([10714] * 10 + periods):
        port.incoming = [b"x" + period.to_bytes(3, "big")]
        samples = sensor.read(tick * 15_000_000)
        messages.append(samples[0].message.period_us if samples else None)
    return messages[10:]


@pytest.mark.parametrize("bit", range(10, 20))
def test_one_wrong_bit_in_a_legacy_period_is_withheld(bit):
    """The bit changes the speed by 5 % or more."""
    assert legacy_stream([10714, 10714 ^ 1 << bit, 10714, 10715]) == [10714, None, 10714, 10715]


def test_a_motor_that_speeds_up_within_a_few_frames_is_followed():
    """Speed rises from 100 to 160 rev/s by a fifth each frame and then stays: every second period is reported, then
    every one."""
    periods = [round(14286 / 1.17**i) for i in range(4)] + [8920, 8915]
    stream = legacy_stream([14286, 14280, *periods])
    assert stream[-2:] == [8920, 8915] and [stream[i] for i in (1, 2, 4)] == [14280, 14286, periods[2]]
