"""MS4515DO and Honeywell SSC, from the bus's side."""

import pytest
from analytic_sensor_truth import constant, ramp

ALPHA, BETA, AIRSPEED = 0x36, 0x46, 0x28
INH2O = 249.089


def fields(reply):
    """Status, pressure counts, temperature counts."""
    word = int.from_bytes(reply, "big")
    return word >> 30, word >> 16 & 0x3FFF, word >> 5 & 0x7FF


@pytest.mark.parametrize(
    ("address", "inH2O", "counts"),
    [
        (ALPHA, -2, 0.10 * 16383),
        (ALPHA, 0, 0.50 * 16383),
        (BETA, 2, 0.90 * 16383),
        (AIRSPEED, -5, 1638),
        (AIRSPEED, 0, 8192),
        (AIRSPEED, 5, 14746),
    ],
)
def test_type_a_output(bus_of, address, inH2O, counts):
    status, pressure, _ = fields(bus_of(differential_Pa=constant(inH2O * INH2O)).read(address, 4))
    assert status == 0
    assert pressure == pytest.approx(counts, abs=0.5 + 1e-9)


@pytest.mark.parametrize("kelvin", [223.15, 273.15, 300.0, 423.15])
def test_temperature(bus_of, kelvin):
    counts = fields(bus_of(transducer_K=constant(kelvin)).read(AIRSPEED, 4))[2]
    assert counts * 200 / 2047 - 50 == pytest.approx(kelvin - 273.15, abs=0.5 * 200 / 2047)


def test_beyond_the_counts_it_is_pinned(bus_of):
    assert fields(bus_of(differential_Pa=constant(4 * INH2O)).read(ALPHA, 4))[1] == 16383
    assert fields(bus_of(differential_Pa=constant(-4 * INH2O)).read(ALPHA, 4))[1] == 0


def test_read_again_before_the_next_update_it_says_stale(bus_of, clock):
    bus = bus_of(differential_Pa=ramp(-400.0, 500.0))
    clock.advance_ns(600_000)
    clock.sleep_until_ns(clock.now_ns() // 500_000 * 500_000 + 500_000)  # just updated; a read takes 0.11 ms
    first, second = bus.read(AIRSPEED, 4), bus.read(AIRSPEED, 4)
    assert (fields(first)[0], fields(second)[0]) == (0, 2)
    assert fields(first)[1:] == fields(second)[1:]
    clock.advance_ns(500_000)
    assert fields(bus.read(AIRSPEED, 4))[0] == 0


def test_before_the_first_data_it_says_stale(powered):
    assert fields(powered(after_s=0.008).i2c("/dev/i2c-1").read(ALPHA, 4))[0] == 2
    assert fields(powered(after_s=0.009).i2c("/dev/i2c-1").read(ALPHA, 4))[0] == 0


def test_a_fault_stays_until_the_supply_is_gone(powered, clock):
    tray = powered()
    bus = tray.i2c("/dev/i2c-1")
    tray.alpha.fault = True
    for _ in range(3):
        clock.advance_ns(10_000_000)
        assert fields(bus.read(ALPHA, 4))[0] == 3
    tray.alpha.power_cycle(clock.now_ns() - 5_000_000_000)
    clock.advance_ns(10_000_000)
    assert fields(bus.read(ALPHA, 4))[0] == 0


def test_two_bytes_are_the_pressure_alone(bus_of, clock):
    bus = bus_of()
    four = bus.read(ALPHA, 4)
    clock.advance_ns(500_000)
    assert bus.read(ALPHA, 2) == four[:2]


@pytest.mark.parametrize("upset", [lambda bus: bus.write(ALPHA, b""), lambda bus: bus.write_read(ALPHA, b"\x00", 4)])
def test_a_probe_or_a_repeated_start_spoils_the_next_transfer(bus_of, clock, upset):
    bus = bus_of()
    upset(bus)
    clock.advance_ns(1_000_000)
    with pytest.raises(OSError):
        bus.read(ALPHA, 4)
    assert fields(bus.read(ALPHA, 4))[0] == 0
