"""The u-blox M8 from its line's far end, with pyubx2 as the judge of every byte."""

import io
from datetime import UTC, datetime
from itertools import pairwise

import numpy as np
import pytest
from analytic_sensor_truth import constant, ramp
from pyubx2 import NMEA_PROTOCOL, POLL, SET, UBX_PROTOCOL, UBXMessage, UBXReader
from pyubx2.exceptions import UBXStreamError

POWER_ON_NS = 5_000_000_000
RATE_10_HZ = bytes.fromhex("b562060806006400010001007a12")


def pvt_only(rate_ms=100):
    """Commands that switch off every message but NAV-PVT."""
    return [
        UBXMessage("CFG", "CFG-RATE", SET, measRate=rate_ms, navRate=1, timeRef=1).serialize(),
        UBXMessage("CFG", "CFG-MSG", SET, msgClass=1, msgID=7, rateUART1=1).serialize(),
        *(UBXMessage("CFG", "CFG-MSG", SET, msgClass=0xF0, msgID=i, rateUART1=0).serialize() for i in range(6)),
    ]


def listen(port, clock, seconds, step_s=0.04):
    data = b""
    for _ in range(round(seconds / step_s)):
        clock.advance_ns(round(step_s * 1e9))
        data += port.read_available()
    return data


def parse(data):
    """Whole messages in order; a frame that pyubx2 refuses is an error (quitonerror=2 raises).

    Listening begins and ends anywhere, so half a message at either end is left out.
    """
    begins = [start for start in (data.find(b"\xb5\x62"), data.find(b"$G")) if start >= 0]
    stream = io.BytesIO(data[min(begins, default=0) :])
    reader = UBXReader(stream, protfilter=UBX_PROTOCOL | NMEA_PROTOCOL, quitonerror=2, validate=1)
    messages = []
    try:
        messages.extend(message for _, message in reader)
    except UBXStreamError:
        assert not stream.read(1)  # the end, not something in between
    return messages


@pytest.fixture
def gps_of(powered):
    return lambda baud=38400, **functions: powered(**functions).port("/dev/ttyAMA0", baud)


def configured(port, clock, rate_ms=100):
    for command in pvt_only(rate_ms):
        port.write(command)
    listen(port, clock, 1.5)
    return port


def test_a_new_receiver_chats_nmea_once_a_second(gps_of, clock):
    messages = parse(listen(gps_of(), clock, 5.0))
    kinds = [m.msgID for m in messages]
    assert set(kinds) == {"GGA", "GLL", "GSA", "GSV", "RMC", "VTG"}
    assert 4 <= kinds.count("RMC") <= 5


def test_every_command_is_acknowledged(gps_of, clock):
    port = gps_of()
    for command in pvt_only():
        port.write(command)
        replies = [m for m in parse(listen(port, clock, 0.2)) if m.identity.startswith("ACK")]
        assert [(m.identity, m.clsID, m.msgID) for m in replies] == [("ACK-ACK", command[2], command[3])]


def test_the_published_rate_command_is_understood(gps_of, clock):
    port = gps_of()
    port.write(RATE_10_HZ)
    assert any(m.identity == "ACK-ACK" for m in parse(listen(port, clock, 0.2)))


@pytest.mark.parametrize(
    "refused",
    [
        UBXMessage("CFG", "CFG-RATE", SET, measRate=1, navRate=1, timeRef=1).serialize(),  # faster than any M8
        UBXMessage("CFG", "CFG-MSG", SET, msgClass=0x7F, msgID=1, rateUART1=1).serialize(),  # no such message
    ],
    ids=["rate", "message"],
)
def test_nonsense_is_refused(gps_of, clock, refused):
    port = gps_of()
    port.write(refused)
    assert [m.identity for m in parse(listen(port, clock, 0.2)) if m.identity.startswith("ACK")] == ["ACK-NAK"]


def test_a_command_with_a_wrong_checksum_is_not_answered_and_the_next_one_is(gps_of, clock):
    port = gps_of()
    port.write(RATE_10_HZ[:-1] + b"\x00" + RATE_10_HZ)
    assert [m.identity for m in parse(listen(port, clock, 0.2)) if m.identity.startswith("ACK")] == ["ACK-ACK"]


@pytest.mark.parametrize("rate_ms", [100, 200])
def test_only_solutions_at_the_rate_asked_for(gps_of, clock, rate_ms):
    port = configured(gps_of(), clock, rate_ms)
    messages = parse(listen(port, clock, 3.0))
    assert {m.identity for m in messages} == {"NAV-PVT"}
    assert len(messages) == pytest.approx(3000 / rate_ms, abs=1)
    itow_ms = [m.iTOW for m in messages]
    assert {b - a for a, b in pairwise(itow_ms)} == {rate_ms}


def test_the_solution_is_the_truth_at_the_antenna(powered, clock):
    port = powered(
        geoid_m=-33.0,
        latitude_deg=ramp(35.6, 1e-5),
        longitude_deg=ramp(-78.9, -1e-5),
        height_m=ramp(100.0, 2.0),
        velocity_mps=constant([12.345, -6.789, -2.0]),
    ).port("/dev/ttyAMA0", 38400)
    messages = parse(listen(configured(port, clock), clock, 1.0))
    for m in messages:
        utc = datetime(m.year, m.month, m.day, m.hour, m.min, m.second, tzinfo=UTC).timestamp() + m.nano * 1e-9
        t_s = utc - datetime(2016, 5, 14, 9, 30, tzinfo=UTC).timestamp()  # the tray's default
        assert m.validDate and m.validTime and m.fullyResolved and m.gnssFixOk and m.fixType == 3
        assert m.lat == pytest.approx(35.6 + 1e-5 * t_s, abs=1e-7)
        assert m.lon == pytest.approx(-78.9 - 1e-5 * t_s, abs=1e-7)
        assert m.hMSL == pytest.approx(100_000 + 2000 * t_s, abs=1.0)
        assert m.height == pytest.approx(m.hMSL - 33_000, abs=1.0)
        assert (m.velN, m.velE, m.velD) == (12345, -6789, -2000)
        assert m.gSpeed == pytest.approx(1e3 * (12.345**2 + 6.789**2) ** 0.5, abs=0.6)
        gps_week_s = 604_800
        since_1980_s = (
            utc - datetime(1980, 1, 6, tzinfo=UTC).timestamp() + 18
        )  # leap seconds since 2017 as they are now
        assert m.iTOW == pytest.approx(since_1980_s % gps_week_s * 1e3, abs=1.0)


AIRBORNE = UBXMessage("CFG", "CFG-NAV5", SET, dyn=1, dynModel=8).serialize()


@pytest.mark.parametrize(("commands", "lag_s"), [([], 0.5), ([AIRBORNE], 0.0)], ids=["portable", "airborne"])
def test_velocity_lags_unless_the_receiver_knows_that_it_flies(powered, clock, commands, lag_s):
    """In a steady acceleration of 2 m/s2 a lag is a constant error of velocity."""
    port = powered(velocity_mps=lambda t_s: np.outer(t_s, [2.0, 0.0, 0.0])).port("/dev/ttyAMA0", 38400)
    for command in commands:
        port.write(command)
    listen(configured(port, clock), clock, 5.0)
    for m in parse(listen(port, clock, 1.0)):
        utc = datetime(m.year, m.month, m.day, m.hour, m.min, m.second, tzinfo=UTC).timestamp() + m.nano * 1e-9
        t_s = utc - datetime(2016, 5, 14, 9, 30, tzinfo=UTC).timestamp()
        assert m.velN == pytest.approx(2000 * (t_s - lag_s), abs=100)


def test_the_model_is_reported_when_asked(gps_of, clock):
    port = gps_of()
    for command in (UBXMessage("CFG", "CFG-NAV5", POLL).serialize(), AIRBORNE, b""):
        port.write(command or UBXMessage("CFG", "CFG-NAV5", POLL).serialize())
    answers = [m.dynModel for m in parse(listen(port, clock, 0.3)) if m.identity == "CFG-NAV5"]
    assert answers == [0, 8]


GPS, WAITING, STREAM = 0x42, b"\xfd", b"\xff"


@pytest.fixture
def ddc(powered):
    return powered(gps_on_i2c=True).i2c("/dev/i2c-1")


def drained(bus, clock, seconds):
    data = b""
    for _ in range(round(seconds / 0.04)):
        clock.advance_ns(40_000_000)
        data += bus.write_read(GPS, STREAM, int.from_bytes(bus.write_read(GPS, WAITING, 2), "big"))
    return data


def test_on_i2c_the_same_messages_come_out_of_a_register(ddc, clock):
    for command in pvt_only():
        ddc.write(GPS, command)
    ddc.write(GPS, UBXMessage("CFG", "CFG-MSG", SET, msgClass=1, msgID=7, rateDDC=1).serialize())
    drained(ddc, clock, 1.5)
    messages = parse(drained(ddc, clock, 2.0))
    assert {m.identity for m in messages} == {"NAV-PVT"} and len(messages) == pytest.approx(20, abs=1)


def test_an_idle_stream_is_ones_and_the_pointer_stays_on_it(ddc, clock):
    drained(ddc, clock, 0.5)
    waiting = int.from_bytes(ddc.write_read(GPS, WAITING, 2), "big")
    assert ddc.write_read(GPS, WAITING, 2 + waiting + 5)[:2] == waiting.to_bytes(2, "big")
    assert ddc.write_read(GPS, STREAM, 5) == ddc.read(GPS, 5) == b"\xff" * 5


def test_on_i2c_what_nobody_fetches_for_a_while_is_gone(ddc, clock):
    drained(ddc, clock, 0.1)
    clock.advance_ns(1_400_000_000)
    assert int.from_bytes(ddc.write_read(GPS, WAITING, 2), "big") > 0
    clock.advance_ns(1_600_000_000)
    assert int.from_bytes(ddc.write_read(GPS, WAITING, 2), "big") == 0


def test_on_i2c_there_is_no_line_and_on_a_line_no_address(powered):
    with pytest.raises(FileNotFoundError):
        powered(gps_on_i2c=True).port("/dev/ttyAMA0", 38400)
    with pytest.raises(OSError, match="no acknowledge"):
        powered().i2c("/dev/i2c-1").read(GPS, 1)


def test_without_fix_it_says_so_and_goes_on(gps_of, clock):
    messages = parse(listen(configured(gps_of(fix=constant(0.0)), clock), clock, 1.0))
    assert len(messages) >= 9
    assert all(m.fixType == 0 and not m.gnssFixOk and not m.validTime for m in messages)


def test_bytes_come_torn_at_the_lines_pace(gps_of, clock):
    """100 bytes of NAV-PVT take 26 ms at 38400 baud: a reader every 5 ms gets at most 20 at once."""
    port = configured(gps_of(), clock)
    sizes = []
    for _ in range(400):
        clock.advance_ns(5_000_000)
        sizes.append(len(port.read_available()))
    assert max(sizes) <= 20
    assert sum(sizes) == pytest.approx(2.0 * 10 * 100, abs=100)


def test_at_the_wrong_speed_there_is_only_noise(gps_of, clock):
    data = listen(gps_of(baud=9600), clock, 3.0)
    assert data and b"$GN" not in data and b"\xb5\x62" not in data


def test_it_changes_its_speed_when_told(powered, clock):
    tray = powered()
    port = tray.port("/dev/ttyAMA0", 38400)
    port.write(
        UBXMessage(
            "CFG",
            "CFG-PRT",
            SET,
            portID=1,
            mode=0x08D0.to_bytes(4, "little"),
            baudRate=115200,
            inProtoMask=b"\x01\x00",
            outProtoMask=b"\x01\x00",
        ).serialize()
    )
    assert tray.gps.baud == 115200
    fast = tray.port("/dev/ttyAMA0", 115200)
    fast.write(RATE_10_HZ)
    messages = parse(listen(fast, clock, 1.0))
    assert messages and all(m.identity.startswith("ACK") for m in messages)  # and its NMEA protocol is off


def test_a_line_too_slow_loses_whole_messages(powered, clock):
    tray = powered()
    tray.gps.baud = 4800
    port = tray.port("/dev/ttyAMA0", 4800)
    for command in pvt_only(50)[:2]:
        port.write(command)
    messages = parse(listen(port, clock, 30.0))
    assert len(messages) < 30 * 20 and any(m.identity == "NAV-PVT" for m in messages)


def test_same_seed_same_bytes(gps_of, clock):
    assert clock.now_ns() == POWER_ON_NS
    first = listen(gps_of(), clock, 3.0)
    # The second tray is switched on later, by a whole number of microseconds, and does the same.
    assert listen(gps_of(), clock, 3.0) == first
