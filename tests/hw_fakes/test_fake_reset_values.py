"""A dump of every part as it is after power-on, against the datasheet's table of reset values."""

import io

import pytest
from pyubx2 import POLL, UBXMessage, UBXReader

from flightpower.daq.sensors.ms56xx import MS5611, MS5805, check_prom

IMU, MAG, BARO, STATIC, ALPHA, AIRSPEED, GPS = 0x68, 0x0C, 0x77, 0x76, 0x36, 0x28, 0x42

# RM-MPU-9250A-00 rev. 1.4 sec. 3: "The reset value is 0x00 for all registers other than" 107 (0x01) and 117 (0x71).
# SELF_TEST registers hold what the factory measured; measurements and their status come by themselves.
MPU9250_RESET = {address: 0x00 for address in range(0x80)} | {0x6B: 0x01, 0x75: 0x71}
MPU9250_NOT_FIXED = {0x00, 0x01, 0x02, 0x0D, 0x0E, 0x0F, 0x3A, *range(0x3B, 0x49)}
FIFO_R_W = 0x74  # a burst stays on it

# MS1356-E-02 sec. 8.1: WIA, INFO, ST1, six bytes of measurement, ST2, CNTL1, CNTL2, ASTC.
AK8963_RESET = bytes([0x48, 0x9A, *[0x00] * 11])


def test_mpu9250(bus_of):
    bus = bus_of()
    dump = dict(enumerate(bus.write_read(IMU, b"\x00", FIFO_R_W)))
    dump |= {FIFO_R_W: bus.write_read(IMU, bytes([FIFO_R_W]), 1)[0]}
    dump |= {FIFO_R_W + 1 + i: value for i, value in enumerate(bus.write_read(IMU, bytes([FIFO_R_W + 1]), 11))}
    assert dump.keys() == MPU9250_RESET.keys()
    assert all(dump[address] for address in (0x00, 0x01, 0x02, 0x0D, 0x0E, 0x0F))
    assert dump[0x3A] == 0x01  # awake after reset, so data are ready
    assert {a: v for a, v in dump.items() if a not in MPU9250_NOT_FIXED} == {
        a: v for a, v in MPU9250_RESET.items() if a not in MPU9250_NOT_FIXED
    }


def test_ak8963(bus_of):
    bus = bus_of()
    bus.write(IMU, b"\x37\x02")
    assert bus.write_read(MAG, b"\x00", 0x0D) == AK8963_RESET


@pytest.mark.parametrize(("address", "variant"), [(BARO, MS5611), (STATIC, MS5805)], ids=["ms5611", "ms5805"])
def test_barometers(bus_of, address, variant):
    """Without a conversion they give zero (datasheet p. 11); the calibration has a checksum that is right by AN520."""
    bus = bus_of()
    assert bus.write_read(address, b"\x00", 3) == bytes(3)
    words = [int.from_bytes(bus.write_read(address, bytes([0xA0 + 2 * i]), 2), "big") for i in range(8)]
    assert check_prom(tuple(words[: variant.prom_words]), variant)
    assert not any(words[variant.prom_words :])


@pytest.mark.parametrize("address", [ALPHA, AIRSPEED])
def test_bridges(powered, clock, address):
    """Nothing is new until the first measurement, after 8.4 ms at most; then it is good, and stale when read again at
    once."""
    bus = powered(after_s=0.001).i2c("/dev/i2c-1")
    status = [bus.read(address, 4)[0] >> 6]
    clock.advance_ns(8_400_000)
    status += [bus.read(address, 4)[0] >> 6 for _ in range(2)]
    assert status == [2, 0, 2]


def polled(powered, clock, message_id, **fields):
    """The receiver's answer to a question about its configuration, parsed by pyubx2."""
    tray = powered()
    port = tray.port("/dev/ttyAMA0", tray.gps.baud)
    port.write(UBXMessage("CFG", message_id, POLL, **fields).serialize())
    clock.advance_ns(200_000_000)
    replies = [message for _, message in UBXReader(io.BytesIO(port.read_available()))]
    return next(message for message in replies if message.identity == message_id)


def test_ublox_m8(powered, clock):
    """UBX-13003221, appendix "Default settings"; the line's speed is the one kept in battery-backed memory."""
    rate = polled(powered, clock, "CFG-RATE")
    assert (rate.measRate, rate.navRate, rate.timeRef) == (1000, 1, 1)
    port = polled(powered, clock, "CFG-PRT", portID=1)
    assert (port.portID, port.charLen, port.parity, port.nStopBits) == (1, 3, 4, 0)  # 8N1
    assert port.inUBX and port.inNMEA and port.outUBX and port.outNMEA
    for message_id, on in {0: 1, 1: 1, 2: 1, 3: 1, 4: 1, 5: 1, 8: 0}.items():  # GGA GLL GSA GSV RMC VTG; not ZDA
        assert polled(powered, clock, "CFG-MSG", msgClass=0xF0, msgID=message_id).rateUART1 == on
    assert polled(powered, clock, "CFG-MSG", msgClass=1, msgID=7).rateUART1 == 0  # NAV-PVT has to be asked for


def test_ublox_m8_on_i2c(powered):
    bus = powered(gps_on_i2c=True).i2c("/dev/i2c-1")
    assert bus.write_read(GPS, b"\xfd", 3) == b"\x00\x00\xff"  # nothing waits, for nobody has asked for half a second
    assert bus.read(GPS, 1) == b"\xff"
