"""The barometers: datasheet vectors, the checksum, and conversions that overlap with the loop."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scripted_parts import bring_up

from flightpower.daq.sensors import SensorFailure
from flightpower.daq.sensors.ms56xx import (
    MS5607,
    MS5611,
    MS5805,
    MS56xxDriver,
    check_prom,
    compensate,
    crc4,
    oversampling_code,
)
from flightpower.flight.messages import AbsolutePressure, Status

DATASHEET = (0, 40127, 36924, 23317, 23282, 33464, 28312, 0)  # MS5611 datasheet, figure 2
TICK_NS = 40_000_000


def test_checksum_of_the_application_note():
    words = (0x3132, 0x3334, 0x3536, 0x3738, 0x3940, 0x4142, 0x4344, 0x4500)
    assert crc4(words) == 0xB
    assert check_prom((*words[:7], 0x450B), MS5611)


@pytest.mark.parametrize(
    ("d2", "degC", "mbar"),
    [(8569150, 20.07, 1000.09), (8069150, 2.05, 965.12), (7369150, -27.10, 906.13)],
)
def test_datasheet_example_and_the_two_second_order_branches(d2, degC, mbar):
    centi_degC, pressure_Pa = compensate(MS5611, DATASHEET, 9085466, d2)
    # The reference is computed in whole numbers: TEMP is cut to 0.01 degC, which moves the pressure by up to 1.3 Pa
    # below -15 degC (the slopes of OFF2 and SENS2 there), and the result is cut to 1 Pa. We compute in real numbers.
    assert centi_degC / 100 == pytest.approx(degC, abs=0.01)
    assert pressure_Pa / 100 == pytest.approx(mbar, abs=0.023)


def test_datasheet_example_of_the_ms5805():
    # MS5805-02BA01 datasheet, figure 2: C1..C6, D1 = 6465444, D2 = 8077636 give 20.00 degC and 1100.02 mbar for the
    # scale factors 2^17 and 2^16 that it shares with the MS5637.
    prom = (0, 46372, 43981, 29059, 27842, 31553, 28165)
    centi_degC, pressure_Pa = compensate(MS5805, prom, 6465444, 8077636)
    assert centi_degC == pytest.approx(2000, abs=1)
    assert pressure_Pa == pytest.approx(110002, abs=2)


@given(st.lists(st.integers(1, 0xFFFF), min_size=8, max_size=8), st.integers(0, 6 * 16 - 1))
def test_any_single_wrong_bit_of_a_calibration_is_found(words, bit):
    for variant in (MS5611, MS5805):
        good = sealed(words, variant)
        assert check_prom(good, variant) == good
        bad = list(good)
        bad[1 + bit // 16] ^= 1 << bit % 16
        with pytest.raises(SensorFailure):
            check_prom(tuple(bad), variant)


def sealed(words, variant) -> tuple[int, ...]:
    """`words` with the right checksum in its place."""
    words = list(words[: variant.prom_words])
    words[variant.crc_word] &= 0xFF00 if variant.crc_shift == 0 else 0x0FFF
    words[variant.crc_word] |= crc4(tuple(words)) << variant.crc_shift
    return tuple(words)


@pytest.mark.parametrize("variant", [MS5611, MS5805])
def test_an_all_zero_calibration_passes_its_checksum_and_is_refused(variant):
    zeros = (0,) * variant.prom_words
    assert crc4(zeros) == 0
    with pytest.raises(SensorFailure) as refused:
        check_prom(zeros, variant)
    assert refused.value.status is Status.CORRUPT


class Part:
    """A barometer that converts; it asserts that nobody reads before the conversion is over."""

    def __init__(self):
        self.now_ns = 0
        self.prom = sealed(DATASHEET, MS5611)
        self.running = None
        self.d1, self.d2 = 9085466, 8569150

    def write(self, address, data):
        if data[0] & 0xF0 in (0x40, 0x50):
            self.running = (data[0], self.now_ns)

    def read(self, address, count):
        raise AssertionError("never read bare")

    def write_read(self, address, data, count):
        if data[0] >= 0xA0:
            return self.prom[(data[0] - 0xA0) // 2].to_bytes(2, "big")
        if self.running is None:
            return bytes(3)
        command, started_ns = self.running
        assert self.now_ns - started_ns >= 9_040_000, "read too early"
        self.running = None
        return (self.d1 if command & 0xF0 == 0x40 else self.d2).to_bytes(3, "big")


def run(part: Part, sensor: MS56xxDriver, ticks: int):
    samples = []
    for _ in range(ticks):
        samples += [(part.now_ns, sample) for sample in sensor.read(part.now_ns)]
        part.now_ns += TICK_NS
    return samples


def started() -> tuple[Part, MS56xxDriver]:
    part = Part()
    sensor = MS56xxDriver(part, 0x77, MS5611, topic="/baro", period_s=0.04)
    assert bring_up(sensor) <= 0.01  # the reset; no conversion is waited for
    return part, sensor


def test_every_tick_has_a_message_and_only_temperature_ticks_have_no_pressure():
    part, sensor = started()
    samples = run(part, sensor, 100)
    assert len(samples) == 100
    busy = [i for i, (_, sample) in enumerate(samples) if sample.message.status is Status.BUSY]
    assert busy[:2] == [0, 1]  # nothing was running; then the first temperature
    assert len(busy) == 2 + 3  # and one a second for the rest of four seconds
    good = [sample.message for _, sample in samples if sample.message.status is Status.OK]
    assert all(message.pressure_Pa == pytest.approx(100009, abs=1) for message in good)
    assert all(message.temperature_counts == 8569150 for message in good)


def test_a_pressure_is_dated_to_the_middle_of_its_conversion_one_tick_ago():
    part, sensor = started()
    read_ns, sample = run(part, sensor, 3)[-1]
    assert sample.message.status is Status.OK
    assert read_ns - sample.time_ns == TICK_NS - 9_040_000 // 2


def test_a_tick_that_comes_too_soon_does_not_disturb_the_conversion():
    part, sensor = started()
    run(part, sensor, 3)
    part.now_ns += 2_000_000 - TICK_NS
    assert sensor.read(part.now_ns)[0].message == AbsolutePressure(status=Status.BUSY)
    part.now_ns += TICK_NS
    assert sensor.read(part.now_ns)[0].message.status is Status.OK


def test_a_conversion_that_was_forgotten_means_that_the_supply_was_lost():
    part, sensor = started()
    run(part, sensor, 3)
    part.running = None
    with pytest.raises(SensorFailure, match="supply"):
        sensor.read(part.now_ns)


@pytest.mark.parametrize("which", ["d1", "d2"])
def test_an_absurd_reading_is_corrupt_and_the_temperature_is_looked_at_again(which):
    part, sensor = started()
    run(part, sensor, 3)
    good = getattr(part, which)
    setattr(part, which, 0x000102)
    sensor._temperature_due_ns = part.now_ns  # so that each of pressure and temperature is converted once
    spoilt = run(part, sensor, 2)
    setattr(part, which, good)
    following = [sample.message for _, sample in spoilt + run(part, sensor, 8)]
    # A temperature is converted once more before it is believed, and no pressure depends on it.
    assert [message.status for message in following].count(Status.CORRUPT) == (which == "d1")
    assert all(m.pressure_Pa == pytest.approx(100009, abs=1) for m in following if m.status is Status.OK)
    assert [m.status for m in following[-4:]] == [Status.OK] * 4


@pytest.mark.parametrize("which", ["d1", "d2"])
def test_absurd_readings_in_a_row_are_another_part(which):
    part, sensor = started()
    run(part, sensor, 3)
    setattr(part, which, 0x000102)
    with pytest.raises(SensorFailure, match="outside the part's range") as failed:
        run(part, sensor, 60)
    assert failed.value.status is Status.CORRUPT


@pytest.mark.parametrize(("rate_Hz", "code"), [(25, 0x8), (90, 0x8), (100, 0x6), (150, 0x6), (200, 0x4)])
def test_as_much_oversampling_as_fits_into_a_tick(rate_Hz, code):
    assert oversampling_code(1 / rate_Hz) == code


def test_while_the_part_warms_up_pressure_is_compensated_at_the_temperature_of_its_own_moment():
    """D2 rises by 800 counts a second (0.027 K) and D1 rises so that pressure stays constant. A count of either is 0.02
    Pa or less.

    Compensated with the last temperature, half a second old on average, pressure would be 2.8 Pa low and saw by 5.
    """
    part, sensor = started()
    d1, d2 = part.d1, part.d2
    _, constant_Pa = compensate(MS5611, part.prom, d1, d2)
    pressures = []
    for _ in range(750):
        part.d2 = round(d2 + 800 * (part.now_ns - TICK_NS) / 1e9)  # when the conversion that is read now was started
        low_Pa, more = (compensate(MS5611, part.prom, d1 + step, part.d2)[1] for step in (0, 10_000))
        part.d1 = round(d1 + 10_000 * (constant_Pa - low_Pa) / (more - low_Pa))
        pressures += [sample.message.pressure_Pa for sample in sensor.read(part.now_ns)]
        part.now_ns += TICK_NS
    late = [pressure for pressure in pressures[100:] if pressure is not None]
    assert late == pytest.approx([constant_Pa] * len(late), abs=0.05)


@pytest.mark.parametrize(
    "damaged",
    [lambda d1: d1 >> 1, lambda d1: d1 ^ 1 << 14, lambda d1: d1 ^ 1 << 21],
    ids=["shifted", "bit 14", "bit 21"],
)
@pytest.mark.parametrize("replies", [1, 2])
def test_a_pressure_that_jumps_for_two_conversions_is_not_believed(damaged, replies):
    part, sensor = started()
    run(part, sensor, 5)
    good = part.d1
    part.d1 = damaged(good)
    assert {sample.message.status for _, sample in run(part, sensor, replies)} == {Status.CORRUPT}
    part.d1 = good
    after = [sample.message for _, sample in run(part, sensor, 5)]
    assert all(m.status is Status.OK and m.pressure_Pa == pytest.approx(100009, abs=1) for m in after)


def test_a_pressure_that_has_changed_is_believed_from_the_third_on():
    """A tube that is put on changes the pressure by 400 Pa."""
    part, sensor = started()
    run(part, sensor, 5)
    part.d1 += 20_000
    statuses = [sample.message.status for _, sample in run(part, sensor, 5)]
    assert statuses == [Status.CORRUPT, Status.CORRUPT, Status.OK, Status.OK, Status.OK]


@pytest.mark.parametrize("bit", [12, 14, 18, 22])
def test_one_wrong_bit_in_a_temperature_moves_no_pressure(bit):
    part, sensor = started()
    run(part, sensor, 60)
    part.d2 ^= 1 << bit
    sensor._temperature_due_ns = part.now_ns
    messages = [sample.message for _, sample in run(part, sensor, 2)]
    part.d2 ^= 1 << bit
    messages += [sample.message for _, sample in run(part, sensor, 30)]
    assert all(m.pressure_Pa == pytest.approx(100009, abs=1) for m in messages if m.status is Status.OK)
    assert [m.status for m in messages].count(Status.OK) >= 28


def test_an_ms5607_on_a_board_for_an_ms5611_is_reported_by_half_the_pressure():
    part, sensor = started()
    part.prom = sealed((0, 46372, 43981, 29059, 27842, 31553, 28165, 0), MS5611)
    list(sensor.start())
    part.d1, part.d2 = 6465444, 8077636  # of the example of its twin MS5637: 20.00 degC and 1100.02 mbar
    with pytest.raises(
        SensorFailure, match='MS5611 expected, but 550 hPa would be 1100 by an MS5607: set driver = "ms5607"'
    ):
        run(part, sensor, 5)
    right = MS56xxDriver(part, 0x77, MS5607, topic="/baro", period_s=0.04)
    list(right.start())
    assert run(part, right, 5)[-1][1].message.pressure_Pa == pytest.approx(110002, abs=2)


def test_an_ms5611_in_thin_air_is_not_taken_for_another_part():
    """At 3400 m the pressure is two thirds of that at sea level: an MS5607 would read 1340 hPa."""
    part, sensor = started()
    high = compensate(MS5611, part.prom, part.d1, part.d2)[1]
    part.d1 = round(part.d1 - 33_000 / (high - compensate(MS5611, part.prom, part.d1 - 1000, part.d2)[1]) * 1000)
    assert run(part, sensor, 10)[-1][1].message.pressure_Pa == pytest.approx(67_000, abs=10)
