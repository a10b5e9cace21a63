"""The receiver: UBX frames out of any stream of bytes, configuration with acknowledgment, fixes and their absence."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyubx2 import GET, POLL, SET, UBXMessage, UBXReader
from scripted_parts import ScriptedPort, bring_up, pieces

from flightpower.daq.sensors import SensorFailure
from flightpower.daq.sensors.ublox import (
    ACK_ACK,
    ACK_NAK,
    CFG_NAV5,
    CFG_VALGET,
    MODEL_KEY,
    MON_VER,
    UBloxDriver,
    believed,
    configuration,
    configuration_by_keys,
    frame_of,
    solution,
    take_frames,
)
from flightpower.flight.messages import Gps, Status

TICK_NS = 40_000_000
NOT_IN_A_SOLUTION = ("status", "utc_ns", "dynamic_model")


def nav_pvt(**changes) -> bytes:
    """A NAV-PVT frame made by pyubx2."""
    values = {
        "iTOW": 123456000, "year": 2016, "month": 5, "day": 14, "hour": 9, "min": 30, "second": 1, "nano": -1000,
        "validDate": 1, "validTime": 1, "fullyResolved": 1, "fixType": 3, "gnssFixOk": 1, "numSV": 11,
        "lat": 48.1234567, "lon": -11.7654321, "height": 500123, "hMSL": 452321, "velN": 12345, "velE": -2345,
        "velD": 345, "hAcc": 1500, "vAcc": 2500, "sAcc": 320,
    }  # fmt: skip
    return UBXMessage("NAV", "NAV-PVT", GET, **{**values, **changes}).serialize()


PVT = nav_pvt()


def solution_at(tick: int) -> bytes:
    """A solution for this tick, dated a tenth of a second after the one for the previous tick."""
    return nav_pvt(iTOW=123456000 + 100 * tick)


def test_a_solution_in_si():
    message = solution(PVT)
    assert message.status is Status.OK and message.itow_ms == 123456000
    assert message.latitude_deg == pytest.approx(48.1234567, abs=1e-7)
    assert message.longitude_deg == pytest.approx(-11.7654321, abs=1e-7)
    assert message.height_m == pytest.approx(500.123)
    assert (message.velocity_north_mps, message.velocity_east_mps) == pytest.approx((12.345, -2.345))
    assert message.velocity_down_mps == pytest.approx(0.345)
    assert message.speed_accuracy_mps == pytest.approx(0.32)
    assert message.utc_ns == 1463218201 * 10**9 - 1000


@pytest.mark.parametrize("changes", [{"validDate": 0}, {"validTime": 0}, {"fullyResolved": 0}])
def test_a_date_the_receiver_does_not_vouch_for_is_not_logged(changes):
    assert solution(nav_pvt(**changes)).utc_ns is None


@pytest.mark.parametrize(
    ("changes", "status"),
    [
        ({"velN": 300_000}, Status.CORRUPT), ({"velN": 80_000, "velD": -90_000}, Status.OK),
        ({"lat": 91}, Status.CORRUPT),
        ({"lon": -181}, Status.CORRUPT), ({"height": 40_000_000}, Status.CORRUPT), ({"height": -400_000}, Status.OK),
    ],
)  # fmt: skip
def test_where_no_such_aircraft_can_be_there_is_no_position(changes, status):
    message = believed(solution(nav_pvt(**changes)))
    assert message.status is status
    assert (message.velocity_north_mps is None) == (message.latitude_deg is None) == (status is Status.CORRUPT)


@pytest.mark.parametrize("changes", [{"fixType": 0}, {"fixType": 5}, {"gnssFixOk": 0}])
def test_without_a_fix_there_is_time_but_no_position(changes):
    message = solution(nav_pvt(**changes))
    assert message.status is Status.NO_DATA
    assert message.latitude_deg is None and message.velocity_north_mps is None
    assert message.utc_ns is not None and message.satellites == 11


def test_commands_are_what_the_protocol_description_says():
    port, rate, on_uart, navigation, request = configuration(10, 38400)
    assert rate == bytes.fromhex("b56206080600640001000100 7a12")
    assert configuration(10, None)[2] == bytes.fromhex("b562060108000107010000000000 18e2")
    parsed = UBXReader.parse(port, msgmode=SET)
    assert (parsed.identity, parsed.portID, parsed.baudRate) == ("CFG-PRT", 1, 38400)
    assert (parsed.inUBX, parsed.outUBX, parsed.outNMEA) == (1, 1, 0)
    assert UBXReader.parse(on_uart, msgmode=SET).rateUART1 == 1
    parsed = UBXReader.parse(navigation, msgmode=SET)
    assert (parsed.identity, parsed.dyn, parsed.dynModel) == ("CFG-NAV5", 1, 8)
    assert not any((parsed.minEl, parsed.posFixMode, parsed.posMask, parsed.timeMask, parsed.staticHoldMask))
    assert request == UBXMessage("CFG", "CFG-NAV5", POLL).serialize()


@pytest.mark.parametrize("model", [8, 0])
def test_the_model_that_is_logged_is_what_the_receiver_says_and_not_what_was_set(model):
    port = ScriptedPort()
    sensor = UBloxDriver(port)
    bring_up(sensor)
    for tick, command in enumerate(configuration(10, 38400)):
        port.incoming.append(solution_at(tick) + frame_of(ACK_ACK, command[2:4]))
    port.incoming[-1] = frame_of(CFG_NAV5, bytes([1, 0, model]) + bytes(33)) + port.incoming[-1]
    samples = [sample for tick in range(len(configuration(10, 38400)) + 1) for sample in sensor.read(tick * TICK_NS)]
    assert samples[0].message.dynamic_model is None
    assert samples[-1].message.dynamic_model == model


@given(st.binary(max_size=300), st.lists(st.integers(0, 10_000), max_size=8))
def test_any_bytes_in_any_pieces_never_raise(noise, cuts):
    port = ScriptedPort()
    sensor = UBloxDriver(port)
    bring_up(sensor)
    port.incoming = pieces(noise, cuts)
    for tick in range(len(port.incoming) + 1):
        sensor.read(tick * TICK_NS)


@given(st.binary(max_size=200), st.lists(st.integers(0, 10_000), max_size=8))
def test_frames_after_garbage_are_found(noise, cuts):
    # Garbage may look like the head of a long frame; that frame has to be over before the next can be seen.
    buffer, result = bytearray(), []
    for piece in pieces(noise + PVT * 12, cuts):
        buffer += piece
        result += take_frames(buffer)[0]
    assert result and result[-1] == PVT


def test_what_only_looks_like_a_frame_does_not_hold_up_what_follows():
    """Two bytes of noise before an acknowledgment turn it into the head of a 261-byte frame, the rest of which never
    comes."""
    port = ScriptedPort()
    sensor = UBloxDriver(port)
    bring_up(sensor)
    commands = configuration(10, 38400)
    port.incoming = [b"", b"\xb5\x62" + frame_of(ACK_ACK, commands[0][2:4])]
    for tick in range(12):
        sensor.read(tick * TICK_NS)
    assert port.written[:2] == commands[:2]


@given(st.binary(max_size=91) | st.binary(min_size=92, max_size=92))
def test_a_frame_with_a_right_checksum_and_a_wrong_inside_is_corrupt_not_fatal(payload):
    assert solution(frame_of(b"\x01\x07", payload)).status in (Status.CORRUPT, Status.NO_DATA, Status.OK)


def test_configuration_goes_on_only_when_acknowledged():
    port = ScriptedPort()
    sensor = UBloxDriver(port)
    bring_up(sensor)
    sent = []
    for tick in range(10):
        sensor.read(tick * TICK_NS)
        if port.written:
            sent += port.written
            port.incoming.append(frame_of(ACK_ACK, port.written.pop()[2:4]))
    assert sent == configuration(10, 38400)


def test_an_unacknowledged_command_is_repeated_and_a_refused_one_is_remembered():
    port = ScriptedPort()
    sensor = UBloxDriver(port)
    bring_up(sensor)
    for tick in range(60):  # PVT keeps coming: the receiver is there, it only does not acknowledge
        port.incoming.append(solution_at(tick))
        sensor.read(tick * TICK_NS)
    assert port.written == [configuration(10, 38400)[0]] * 3
    port.incoming.append(frame_of(ACK_NAK, b"\x06\x00"))
    sensor.read(60 * TICK_NS)
    assert port.written[-1] == UBXMessage("MON", "MON-VER", POLL).serialize()
    port.incoming.append(version("18.00"))
    sensor.read(61 * TICK_NS)
    assert port.written[-1] == configuration(10, 38400)[1] and sensor.refused == ["CFG-PRT"]
    assert sensor.complaint == "refuses CFG-PRT: a u-blox M8 or M10 is needed"


def version(protocol: str) -> bytes:
    """A receiver's answer to the question for its version."""
    texts = (b"ROM SPG 5.10".ljust(30, b"\0"), b"000A0000".ljust(10, b"\0"), b"FWVER=SPG 5.10".ljust(30, b"\0"))
    return frame_of(MON_VER, b"".join(texts) + f"PROTVER={protocol}".encode().ljust(30, b"\0"))


def test_a_later_generation_is_configured_by_keys_as_its_version_says():
    port = ScriptedPort()
    sensor = UBloxDriver(port, rate_Hz=5, baud=115200)
    bring_up(sensor)
    port.incoming = [b"", frame_of(ACK_NAK, b"\x06\x00"), version("34.10")]
    sent = []
    for tick in range(12):
        sensor.read(tick * TICK_NS)
        if tick > 2:
            sent.append(port.written[-1])
            port.incoming.append(frame_of(ACK_ACK, port.written[-1][2:4]))
    expected = configuration_by_keys(5, 115200)
    assert sent[: len(expected)] == expected and sensor.complaint == ""
    model_reply = frame_of(CFG_VALGET, bytes([1, 0, 0, 0]) + MODEL_KEY.to_bytes(4, "little") + b"\x08")
    port.incoming = [model_reply + solution_at(0)]
    assert sensor.read(12 * TICK_NS)[-1].message.dynamic_model == 8


@pytest.mark.parametrize("baud", [38400, None])
def test_keys_and_values_are_those_of_pyubx2(baud):
    """Keys are compared by their names in the interface description."""
    port = "UART1" if baud else "I2C"
    named = [
        [
            (f"CFG_{port}OUTPROT_UBX", 1),
            (f"CFG_{port}OUTPROT_NMEA", 0),
            *([("CFG_UART1_BAUDRATE", baud)] if baud else []),
        ],
        [("CFG_RATE_MEAS", 200), ("CFG_RATE_NAV", 1), ("CFG_RATE_TIMEREF", 1)],
        [(f"CFG_MSGOUT_UBX_NAV_PVT_{port}", 1)],
        [("CFG_NAVSPG_DYNMODEL", 8)],
    ]
    *sets, request = configuration_by_keys(5, baud)
    assert sets == [UBXMessage.config_set(1, 0, values).serialize() for values in named]
    assert request == UBXMessage.config_poll(0, 0, ["CFG_NAVSPG_DYNMODEL"]).serialize()


class Receiver(ScriptedPort):
    """Acknowledges every command, and sends a solution every third tick; it has a rate and a model."""

    def __init__(self, period_ms: int = 100, model: int = 8, *, obeys: bool = True):
        super().__init__()
        self.period_ms, self.model, self.itow_ms, self.obeys = period_ms, model, 123456000, obeys

    def write(self, data: bytes) -> None:
        super().write(data)
        reply = frame_of(ACK_ACK, data[2:4])
        if data[2:4] == CFG_NAV5 and len(data) == 8:
            reply = frame_of(CFG_NAV5, bytes([1, 0, self.model]) + bytes(33)) + reply
        elif data[2:4] == CFG_NAV5 and self.obeys:
            self.model = data[8]
        elif data[2:4] == b"\x06\x08" and self.obeys:
            self.period_ms = int.from_bytes(data[6:8], "little")
        self.incoming.append(reply)

    def run(self, sensor: UBloxDriver, solutions: int) -> list[tuple[int | None, int]]:
        """Receive solutions; return the model that each of them claims, and the true one."""
        models = []
        for _ in range(solutions):
            self.itow_ms += self.period_ms
            self.incoming.append(nav_pvt(iTOW=self.itow_ms))
            while self.incoming:
                model = self.model
                models += [(sample.message.dynamic_model, model) for sample in sensor.read(self.itow_ms * 1_000_000)]
        return models


def running(**options) -> tuple[Receiver, UBloxDriver]:
    receiver = Receiver(**options)
    sensor = UBloxDriver(receiver, reopen=lambda baud: receiver)
    bring_up(sensor)
    assert receiver.run(sensor, 20)[-1] == (8, 8)
    return receiver, sensor


def test_a_receiver_that_starts_again_with_another_rate_is_set_again_and_its_model_unknown_until_it_is_read():
    """Its saved configuration sends one solution a second, from a filter that smooths velocity."""
    receiver, sensor = running()
    receiver.period_ms, receiver.model = 1000, 0
    models = receiver.run(sensor, 40)
    assert models[0] == (None, 0) and models[-1] == (8, 8)
    assert all(claimed in (None, true) for claimed, true in models)
    assert receiver.period_ms == 100 and sensor.complaint.startswith("had lost its settings")
    receiver.run(sensor, 60)
    assert sensor.complaint == ""


def test_a_rate_that_the_receiver_acknowledges_and_does_not_keep_is_reported():
    receiver, sensor = running(period_ms=200, obeys=False)
    receiver.run(sensor, 5)
    assert "solves 5 times a second, and is set to 10" in sensor.complaint
    receiver.run(sensor, 200)
    assert 3 <= receiver.written.count(configuration(10, 38400)[1]) <= 7  # 44 s: three times, and then seldom
    receiver.period_ms = 100
    receiver.run(sensor, 100)
    assert sensor.complaint == ""


def test_the_model_is_asked_for_every_two_seconds_and_set_again():
    receiver, sensor = running()
    receiver.run(sensor, 5)
    receiver.model = 0  # nothing else shows it
    models = receiver.run(sensor, 60)
    assert models[-1] == (8, 8) and 10 <= models.count((8, 0)) <= 20


def test_after_a_lost_solution_the_model_is_unknown_for_a_moment():
    receiver, sensor = running()
    receiver.itow_ms += 100
    models = receiver.run(sensor, 5)
    assert models[0] == (None, 8) and models[-1] == (8, 8) and sensor.complaint == ""


def test_a_receiver_that_refuses_everything_is_reported_in_one_line():
    """The receiver is of an unknown make: NMEA only."""
    port = ScriptedPort()
    port.write = lambda data: port.incoming.append(frame_of(ACK_NAK, data[2:4]))
    sensor = UBloxDriver(port, reopen=lambda baud: port)
    bring_up(sensor)
    with pytest.raises(SensorFailure, match=r"refuses CFG-PRT, CFG-RATE, CFG-MSG, CFG-NAV5: a u-blox M8 or M10"):
        for tick in range(100):
            sensor.read(tick * TICK_NS)


def test_silence_is_reported_and_the_receiver_configured_again():
    port = ScriptedPort()
    sensor = UBloxDriver(port)
    bring_up(sensor)
    for command in configuration(10, 38400):
        port.incoming.append(frame_of(ACK_ACK, command[2:4]))
    samples = [sample for tick in range(100) for sample in sensor.read(tick * TICK_NS)]
    assert [sample.message for sample in samples] == [Gps(status=Status.NO_DATA)] * 2
    assert port.written.count(configuration(10, 38400)[0]) > 1


def test_a_solution_that_the_receiver_repeats_is_none_and_the_receiver_is_configured_again():
    """The time of week never changes, so an old value would be logged as a new one."""
    port = ScriptedPort()
    sensor = UBloxDriver(port, reopen=lambda baud: port)
    bring_up(sensor)
    port.incoming = [solution_at(0) + frame_of(ACK_ACK, c[2:4]) for c in configuration(10, 38400)] + [PVT] * 200
    samples = [sample for tick in range(200) for sample in sensor.read(tick * TICK_NS)]
    assert port.written.count(configuration(10, 38400)[0]) > 8 / 1.5  # at the start, and after each 1.5 s
    assert len(samples) == 200 and samples[0].message.status is Status.OK
    assert all(sample.message == Gps(status=Status.STALE) for sample in samples[1:])


def test_without_a_fix_a_receiver_may_not_know_the_time():
    port = ScriptedPort()
    sensor = UBloxDriver(port, reopen=lambda baud: port)
    bring_up(sensor)
    port.incoming = [nav_pvt(fixType=0)] * 100
    samples = [sample for tick in range(100) for sample in sensor.read(tick * TICK_NS)]
    assert len(samples) == 100 and {sample.message.status for sample in samples} == {Status.NO_DATA}


def test_damaged_solutions_are_corrupt_rather_than_silent():
    port = ScriptedPort()
    sensor = UBloxDriver(port)
    bring_up(sensor)
    damaged = PVT[:20] + bytes([PVT[20] ^ 1]) + PVT[21:]
    samples = []
    for tick in range(50):
        port.incoming.append(damaged)
        samples += sensor.read(tick * TICK_NS)
    assert [sample.message.status for sample in samples] == [Status.CORRUPT]


class Line:
    """A receiver that understands only its own baud rate, and changes it when told to."""

    def __init__(self, baud: int):
        self.baud = baud

    def open(self, baud: int) -> ScriptedPort:
        port = ScriptedPort()
        port.write = lambda data: self.receive(baud, data)
        port.read_available = lambda: PVT if baud == self.baud else b"\x80" * 20
        return port

    def receive(self, baud: int, data: bytes) -> None:
        if baud == self.baud and data[2:4] == b"\x06\x00":
            self.baud = int.from_bytes(data[14:18], "little")


@pytest.mark.parametrize("baud", [9600, 38400])
def test_a_receiver_at_its_factory_rate_or_at_ours_ends_up_at_ours(baud):
    line = Line(baud)
    sensor = UBloxDriver(line.open(38400), reopen=line.open)
    # The command takes 29 ms, 20 + 8 bytes of 10 bits; the receiver is left three times that.
    assert 3 * 28 * 10 / 9600 < bring_up(sensor) < 0.15
    assert sensor.read(0)[0].message.status is Status.OK and line.baud == 38400


def test_a_receiver_that_falls_back_to_its_factory_rate_is_brought_up_again():
    line = Line(38400)
    sensor = UBloxDriver(line.open(38400), reopen=line.open)
    bring_up(sensor)
    sensor.read(0)
    line.baud = 9600
    with pytest.raises(SensorFailure, match="sends nothing"):
        for tick in range(100):
            sensor.read(tick * TICK_NS)


def by_pyubx2(frame: bytes) -> list:
    """The numbers of a solution with position, decoded by pyubx2."""
    pvt = UBXReader.parse(frame)
    lengths = (pvt.height, pvt.hMSL, pvt.velN, pvt.velE, pvt.velD, pvt.hAcc, pvt.vAcc, pvt.sAcc)
    return [pvt.iTOW, pvt.fixType, pvt.numSV, pvt.lat, pvt.lon, *(length / 1e3 for length in lengths)]


@given(st.binary(min_size=92, max_size=92))
@settings(max_examples=60)
def test_solutions_are_those_that_pyubx2_reads(payload):
    """Any values; only date and fix are set, so that there is a position."""
    payload = payload[:4] + PVT[10:17] + b"\x07" + payload[12:20] + b"\x03\x01" + payload[22:]
    frame = frame_of(b"\x01\x07", payload)
    message = solution(frame)
    fields = message.__struct_fields__
    assert [getattr(message, name) for name in fields if name not in NOT_IN_A_SOLUTION] == by_pyubx2(frame)
    nano = int.from_bytes(payload[16:20], "little", signed=True)
    assert message.utc_ns == 1463218201 * 10**9 + nano


def test_a_leap_second_is_a_time():
    assert solution(nav_pvt(second=60)).utc_ns == solution(nav_pvt(second=59)).utc_ns + 10**9


@given(st.floats(1, 10), st.sampled_from([9600, 38400, 115200]))
@settings(max_examples=10)
def test_commands_are_those_of_pyubx2(rate_Hz, baud):
    _, rate, messages, *_ = configuration(rate_Hz, baud)
    values = {"measRate": round(1000 / rate_Hz), "navRate": 1, "timeRef": 1}
    assert rate == UBXMessage("CFG", "CFG-RATE", SET, **values).serialize()
    assert messages == UBXMessage("CFG", "CFG-MSG", SET, msgClass=1, msgID=7, rateUART1=1).serialize()
