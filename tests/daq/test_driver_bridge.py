"""Differential pressure: part numbers, bit fields, transfer functions, and frames that hold no measurement."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from flightpower.daq.sensors import honeywell, ms45xxdo
from flightpower.daq.sensors.bridge import INCH_OF_WATER_PA, BridgeTransducerDriver, FrameStatus, decode, pressure_Pa
from flightpower.flight.messages import DifferentialPressure, Status


class BareBus:
    """Answers bare reads with `reply`; anything else would spoil the part's next transfer."""

    def __init__(self, reply: bytes):
        self.reply = reply

    def write(self, address, data):
        raise AssertionError("these parts are never written to")

    def read(self, address, count):
        assert count == 4
        return self.reply

    def write_read(self, address, data, count):
        raise AssertionError("no repeated starts")


def frame(status: int, pressure: int, temperature: int) -> bytes:
    return (status << 30 | pressure << 16 | temperature << 5).to_bytes(4, "big")


def read(part: str, reply: bytes, decode_part=ms45xxdo.decode_part, **options) -> DifferentialPressure:
    address, transfer = decode_part(part)
    sensor = BridgeTransducerDriver(BareBus(reply), address, transfer, topic="/probe/alpha", **options)
    ((topic, _, message, *_),) = sensor.read(0)
    assert topic == "/probe/alpha"
    return message


ALPHA, BETA, AIRSPEED = "MS4515DO-DS5AJ002DP", "MS4515DO-DS5AK002DP", "SSCDRRN005ND2A5"


def test_the_trays_parts():
    assert ms45xxdo.decode_part(ALPHA)[0] == 0x36
    assert ms45xxdo.decode_part(BETA)[0] == 0x46
    assert honeywell.decode_part(AIRSPEED)[0] == 0x28


@pytest.mark.parametrize(
    ("part", "decode_part", "full", "fraction", "top_Pa"),
    [
        (ALPHA, ms45xxdo.decode_part, 16383, 0.9, 2 * INCH_OF_WATER_PA),
        ("MS4525DO-DS3BI001DP", ms45xxdo.decode_part, 16383, 0.95, 6894.757),
        (AIRSPEED, honeywell.decode_part, 16384, 0.9, 5 * INCH_OF_WATER_PA),
        ("HSCDRRN1.6MD2B3", honeywell.decode_part, 16384, 0.95, 160.0),
    ],
)
def test_ends_and_middle_of_the_range(part, decode_part, full, fraction, top_Pa):
    # TE states its limits in parts of 2^14 - 1, Honeywell in whole counts of 2^14.
    _, transfer = decode_part(part)
    count_Pa = 2 * top_Pa / ((2 * fraction - 1) * full)
    assert pressure_Pa(fraction * full, transfer) == pytest.approx(top_Pa, abs=count_Pa)
    assert pressure_Pa((1 - fraction) * full, transfer) == pytest.approx(-top_Pa, abs=count_Pa)
    assert pressure_Pa(full / 2, transfer) == pytest.approx(0, abs=count_Pa)


def test_a_gage_part_starts_at_zero():
    _, transfer = ms45xxdo.decode_part("4525DO-DS5AI001GP")
    assert pressure_Pa(0.1 * 16383, transfer) == pytest.approx(0, abs=1e-9)


def test_port_1_above_port_2_is_positive_unless_the_tubes_are_exchanged():
    reply = frame(0, 10000, 1000)
    assert read(ALPHA, reply).differential_pressure_Pa > 0
    assert (
        read(ALPHA, reply, reversed_ports=True).differential_pressure_Pa == -read(ALPHA, reply).differential_pressure_Pa
    )


def test_a_count_of_the_airspeed_transducer_is_a_fifth_of_a_pascal():
    _, transfer = honeywell.decode_part(AIRSPEED)
    assert pressure_Pa(8001, transfer) - pressure_Pa(8000, transfer) == pytest.approx(0.19, abs=0.001)


def test_ends_of_the_temperature():
    assert read(ALPHA, frame(0, 8000, 0)).temperature_K == pytest.approx(223.15)
    assert read(ALPHA, frame(0, 8000, 2047)).temperature_K == pytest.approx(423.15)


@pytest.mark.parametrize(("bits", "status"), [(1, Status.FAULT), (2, Status.STALE), (3, Status.FAULT)])
def test_a_frame_without_measurement_carries_no_values(bits, status):
    assert read(ALPHA, frame(bits, 8000, 1000)) == DifferentialPressure(status=status)


@pytest.mark.parametrize("counts", [0, 16383])
def test_a_pinned_bridge_is_saturated(counts):
    message = read(ALPHA, frame(0, counts, 1000))
    assert message.status is Status.SATURATED and message.pressure_counts == counts


@given(st.binary(min_size=4, max_size=4))
def test_any_reply_has_a_meaning(reply):
    assert decode(reply).status in FrameStatus
    assert read(ALPHA, reply).status in Status


@pytest.mark.parametrize(
    "part", ["MS4515DO-DS5CJ002DP", "MS4515DO-DS5AX002DP", "MS4515DO-DS5AJ000DP", "SSCDRRN005ND2A5", ""]
)
def test_an_unknown_te_part_is_refused_and_supported_ones_are_named(part):
    with pytest.raises(ValueError, match="supported are MS4515DO"):
        ms45xxdo.decode_part(part)


@pytest.mark.parametrize("part", ["SSCDRRN005NDSA5", "SSCDRRN005NAAA5", "ABPDRRN005ND2A5", "SSCDRRN000ND2A5", ""])
def test_an_unknown_honeywell_part_is_refused_and_supported_ones_are_named(part):
    with pytest.raises(ValueError, match="supported are SSC or HSC"):
        honeywell.decode_part(part)


class RepliesBus(BareBus):
    """Answers with these replies, one after another."""

    def __init__(self):
        super().__init__(b"")
        self.replies: list[bytes] = []

    def read(self, address, count):
        assert count == 4
        return self.replies.pop(0)


def statuses(*ticks: list[bytes]) -> list[tuple[Status, int | None]]:
    """Status and pressure counts of ticks, each with its replies, after 5 s of about 8000 counts at 22 degC."""
    bus = RepliesBus()
    address, transfer = honeywell.decode_part(AIRSPEED)
    sensor = BridgeTransducerDriver(bus, address, transfer, topic="/probe/airspeed")
    results = []
    for tick, replies in enumerate([[frame(0, 8000 + i % 3, 735)] for i in range(125)] + [*ticks]):
        bus.replies = list(replies)
        ((_, _, message, *_),) = sensor.read(tick * 40_000_000)
        assert bus.replies == []
        results.append((message.status, message.pressure_counts))
    return results[125:]


def shifted(reply: bytes) -> bytes:
    return (int.from_bytes(reply, "big") >> 1).to_bytes(4, "big")


@pytest.mark.parametrize("pressure", [8000, 8001, 1000, 16000])
def test_a_reply_shifted_by_a_bit_is_read_again(pressure):
    """The second reading is stale if the part has not measured since; its value still counts for this tick."""
    sound = frame(0, 8001, 735)
    assert statuses([shifted(frame(0, pressure, 735)), frame(2, 8001, 735)], [sound]) == [(Status.OK, 8001)] * 2
    both = [shifted(frame(0, pressure, 735))] * 2
    assert statuses(both, [sound]) == [(Status.CORRUPT, None), (Status.OK, 8001)]


@pytest.mark.parametrize("bit", [7, 8, 10, 13])  # 24 Pa and more
def test_one_wrong_bit_in_a_pressure_is_read_again(bit):
    wrong = frame(0, 8000 ^ 1 << bit, 735)
    assert statuses([wrong, frame(2, 8000, 735)]) == [(Status.OK, 8000)]


def test_a_gust_is_believed_at_once():
    """The pressure changes by 30 Pa within a tick, and both readings show it."""
    assert statuses([frame(0, 8160, 735), frame(0, 8163, 735)], [frame(0, 8170, 735)]) == [
        (Status.OK, 8163),
        (Status.OK, 8170),
    ]


def test_a_second_part_at_the_address_is_corrupt_for_as_long_as_it_answers():
    """Both parts pull the line down, so a bit is 0 if it is 0 in either."""
    both = bytes(a & b for a, b in zip(frame(0, 8001, 735), frame(0, 8192, 900), strict=True))
    assert set(statuses(*[[both, both]] * 2500)) == {(Status.CORRUPT, None)}


def test_what_was_damaged_from_the_start_is_not_believed_for_longer_than_it_lasted():
    address, transfer = honeywell.decode_part(AIRSPEED)
    bus = RepliesBus()
    sensor = BridgeTransducerDriver(bus, address, transfer, topic="/probe/airspeed")
    bus.replies = [bytes(4)] * 10
    for tick in range(10):
        sensor.read(tick * 40_000_000)
    bus.replies = [frame(0, 8000, 735)] * 60
    after = [sensor.read(tick * 40_000_000)[0].message.status for tick in range(10, 30)]
    assert after[:9] == [Status.CORRUPT] * 9 and after[-10:] == [Status.OK] * 10
