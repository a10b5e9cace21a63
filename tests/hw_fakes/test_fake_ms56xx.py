"""MS5611-01BA03 and MS5805-02BA01 datasheets, from the bus's side."""

import pytest
from analytic_sensor_truth import constant

from flightpower.hw_fakes import ms56xx

BARO, STATIC = 0x77, 0x76
# The datasheets' own integer arithmetic, forwards (MS5611 fig. 2 and 3, MS5805 p. 8-9): TEMP [0.01 degC] and P [Pa].


def datasheet_ms5611(prom, d1, d2):
    _, c1, c2, c3, c4, c5, c6 = prom[:7]
    dT = d2 - (c5 << 8)
    temp = 2000 + (dT * c6 >> 23)
    off = (c2 << 16) + (c4 * dT >> 7)
    sens = (c1 << 15) + (c3 * dT >> 8)
    t2 = 0
    if temp < 2000:
        t2 = dT**2 >> 31
        off2, sens2 = 5 * (temp - 2000) ** 2 >> 1, 5 * (temp - 2000) ** 2 >> 2
        if temp < -1500:
            off2, sens2 = off2 + 7 * (temp + 1500) ** 2, sens2 + (11 * (temp + 1500) ** 2 >> 1)
        off, sens = off - off2, sens - sens2
    return temp - t2, (d1 * sens >> 21) - off >> 15


def datasheet_ms5805(prom, d1, d2):
    _, c1, c2, c3, c4, c5, c6 = prom[:7]
    dT = d2 - (c5 << 8)
    temp = 2000 + (dT * c6 >> 23)
    off = (c2 << 17) + (c4 * dT >> 6)
    sens = (c1 << 16) + (c3 * dT >> 7)
    t2 = 0
    if temp < 2000:
        t2 = 11 * dT**2 >> 35
        off -= 31 * (temp - 2000) ** 2 >> 3
        sens -= 63 * (temp - 2000) ** 2 >> 5
    return temp - t2, (d1 * sens >> 21) - off >> 15


def words(bus, address, count=8):
    return [int.from_bytes(bus.write_read(address, bytes([0xA0 + 2 * i]), 2), "big") for i in range(count)]


def adc(bus, address):
    return int.from_bytes(bus.write_read(address, b"\x00", 3), "big")


def convert(bus, clock, address, command):
    bus.write(address, bytes([command]))
    clock.advance_ns(20_000_000)
    return adc(bus, address)


def test_crc_of_the_application_note():
    assert ms56xx.crc4([0x3132, 0x3334, 0x3536, 0x3738, 0x3940, 0x4142, 0x4344, 0x4500]) == 0xB


@pytest.mark.parametrize(
    ("d2", "centi_degC", "pascal"), [(8569150, 2007, 100009), (8069150, 205, 96512), (7369150, -2710, 90613)]
)
def test_the_arithmetic_used_below_meets_the_published_vectors(d2, centi_degC, pascal):
    prom = [0, 40127, 36924, 23317, 23282, 33464, 28312]
    assert datasheet_ms5611(prom, 9085466, d2) == (centi_degC, pascal)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize(
    ("part", "forwards"), [(ms56xx.MS5611, datasheet_ms5611), (ms56xx.MS5805, datasheet_ms5805)], ids=["5611", "5805"]
)
def test_the_compensation_backwards_is_the_inverse_of_the_datasheets(part, forwards, seed):
    """They agree to the last digit when warm. Below 20 degC the datasheet squares TEMP after cutting it to 0.01 degC;
    the slopes of the squares at -40 degC make that up to 4 Pa, and cutting TEMP and T2 separately makes another 0.01
    degC."""
    prom = ms56xx.draw_prom(part, seed)
    for degC in range(-40, 86, 5):
        for pascal in (30_000, 70_000, 100_000, 110_000):
            d2 = ms56xx.temperature_counts(part, prom, degC + 273.15)
            temperature, pressure = forwards(prom, ms56xx.pressure_counts(part, prom, pascal, d2), d2)
            assert abs(temperature - 100 * degC) <= (1 if degC >= 20 else 2)
            assert abs(pressure - pascal) <= (1 if degC >= 20 else 1 + 4)


def test_the_place_of_the_checksum(bus_of):
    bus = bus_of()
    prom = words(bus, BARO)
    assert ms56xx.crc4([*prom[:7], prom[7] & 0xFF00]) == prom[7] & 0xF
    prom = words(bus, STATIC)
    assert ms56xx.crc4([prom[0] & 0x0FFF, *prom[1:7], 0]) == prom[0] >> 12
    assert prom[7] == 0  # seven words only


def test_coefficients_are_drawn_per_part(powered):
    proms = [words(powered(seed=s).i2c("/dev/i2c-1"), BARO) for s in (1, 1, 2)]
    assert proms[0] == proms[1] != proms[2]


@pytest.mark.parametrize("command", [0x40, 0x42, 0x44, 0x46, 0x48, 0x50, 0x58])
def test_a_conversion_takes_between_its_typical_and_its_longest_time(bus_of, clock, command):
    typical_ns, longest_ns = ms56xx.CONVERSION_NS[command & 0xF]
    bus = bus_of()
    bus.write(BARO, bytes([command]))
    clock.advance_ns(typical_ns - 100_000)
    assert adc(bus, BARO) == 0
    bus.write(BARO, bytes([0x1E]))
    clock.advance_ns(4_000_000)
    bus.write(BARO, bytes([command]))
    clock.advance_ns(longest_ns)
    assert adc(bus, BARO) > 0


def test_reading_too_early_gives_zero_and_spoils_the_result(bus_of, clock):
    bus = bus_of()
    good = convert(bus, clock, BARO, 0x48)
    bus.write(BARO, b"\x48")
    assert adc(bus, BARO) == 0
    clock.advance_ns(20_000_000)
    assert adc(bus, BARO) != good


def test_a_result_is_given_once(bus_of, clock):
    bus = bus_of()
    assert convert(bus, clock, BARO, 0x58) > 0
    assert adc(bus, BARO) == 0


def test_it_is_deaf_while_the_prom_is_reloaded(bus_of, clock):
    bus = bus_of()
    bus.write(BARO, b"\x1e")
    with pytest.raises(OSError):
        words(bus, BARO)
    clock.advance_ns(2_800_000)
    assert any(words(bus, BARO))


def test_only_the_ms5805_oversamples_8192(bus_of, clock):
    bus = bus_of()
    assert convert(bus, clock, BARO, 0x4A) == 0
    assert convert(bus, clock, STATIC, 0x4A) > 0


def test_a_conversion_holds_the_pressure_of_its_middle(bus_of, clock):
    bus = bus_of(absolute_Pa=lambda t: 90_000 + 1000 * t)
    prom = words(bus, BARO)
    d2 = convert(bus, clock, BARO, 0x58)
    bus.write(BARO, b"\x48")
    start_s = (clock.now_ns() - 5_000_000_000) * 1e-9
    clock.advance_ns(20_000_000)
    low, high = (
        ms56xx.pressure_counts(ms56xx.MS5611, prom, 90_000 + 1000 * (start_s + after_s), d2)
        for after_s in (8.22e-3 / 2 - 0.5e-3, 9.04e-3 / 2 + 0.5e-3)
    )
    assert low <= adc(bus, BARO) <= high


def test_a_hot_and_a_cold_part_stay_within_their_counts(bus_of, clock):
    for kelvin in (233.15, 358.15):
        for pascal in (30_000.0, 110_000.0):
            bus = bus_of(transducer_K=constant(kelvin), absolute_Pa=constant(pascal))
            for address in (BARO, STATIC):
                for command in (0x48, 0x58):
                    assert 0 < convert(bus, clock, address, command) < 2**24 - 1
