"""A log whose messages are not those of docs/understand/log-format.md is refused in one line that names the mistake."""

import json
import re
from pathlib import Path

import pytest
from mcap.writer import Writer

from flightpower.analysis.air.contents import Replacements, contents, damage
from flightpower.analysis.options import Options
from flightpower.analysis.pages.one_log import analyze_log
from flightpower.analysis.pipeline.runs import analyze_runs
from flightpower.analysis.sources.structure import check_messages
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log, read_log
from flightpower.flight.messages import Controls, Gps
from flightpower.flight.undecodable import Undecodable


def file_of(path: Path, messages: dict[str, bytes], *, encoding: str = "json", profile: str = "flightpower") -> Path:
    """A log with the same message thirty times on each topic."""
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile=profile)
        for topic, data in messages.items():
            channel = writer.register_channel(topic, encoding, schema_id=0)
            for number in range(30 if data else 0):
                writer.add_message(channel, number * 40_000_000, data, number * 40_000_000)
        writer.finish()
    return path


IMU: dict[str, object] = dict.fromkeys(
    [
        f"{name}_{axis}_{unit}"
        for name, unit in (("specific_force", "mps2"), ("angular_rate", "radps"))
        for axis in "xyz"
    ],
    1.0,
)
REQUIRED = {
    "/imu": json.dumps(IMU).encode(),
    **dict.fromkeys(("/probe/alpha", "/probe/airspeed"), b'{"differential_pressure_Pa": 1.0}'),
    "/static": b'{"pressure_Pa": 1e5, "temperature_K": 288.0}',
    "/rpm": b'{"motor_speed_revps": 70.0}',
}


def imu(**fields: object) -> dict[str, bytes]:
    return {"/imu": json.dumps(IMU | fields).encode()}


UNREADABLE: dict[str, tuple[dict[str, bytes], dict[str, str], str]] = {
    "strings": (
        imu(specific_force_x_mps2="1.0"),
        {},
        "none of its 30 messages can be decoded; /imu: specific_force_x_mps2 is a string; write a number "
        "without quotation marks",
    ),
    "strings of one topic": (
        REQUIRED | {"/probe/beta": b'{"differential_pressure_Pa": "1"}'},
        {},
        "/probe/beta: 30 of 30 messages cannot be decoded: differential_pressure_Pa is a string; write a "
        "number without quotation marks",
    ),
    "fractions of one topic": (
        REQUIRED | {"/gps": b'{"itow_ms": 1.5}'},
        {},
        "/gps: 30 of 30 messages cannot be decoded: itow_ms has a fraction; write an integer",
    ),
    "capitals": (
        imu(status="OK"),
        {},
        'none of its 30 messages can be decoded; /imu: status is "OK"; write one of ok, starting, stale, '
        "fault, saturated, no_reply, timeout, busy, corrupt, wrong_device, no_data",
    ),
    "not a number": (
        imu(specific_force_y_mps2=float("nan")),
        {},
        "none of its 30 messages can be decoded; /imu: NaN is not JSON; write null where nothing was measured",
    ),
    "list": (
        {"/imu": b"[1, 2]"},
        {},
        "none of its 30 messages can be decoded; /imu: a message is not a JSON object with the names of its fields",
    ),
    "protobuf": (
        {"/imu": b"\x08\x01"},
        {"encoding": "protobuf"},
        "/imu: its messages are encoded as 'protobuf'; write JSON with the message encoding 'json'",
    ),
    "ROS 2": (
        imu(),
        {"encoding": "cdr"},
        "/imu: its messages are encoded as 'cdr'; write JSON with the message encoding 'json'",
    ),
    "ROS 2 profile": (
        imu(),
        {"profile": "ros2"},
        "an MCAP file, but not a log of this program: the profile in its header is 'ros2', not 'flightpower' "
        "(docs/understand/log-format.md describes the format)",
    ),
    "no profile": (
        imu(),
        {"profile": ""},
        "an MCAP file, but not a log of this program: the profile in its header is '', not 'flightpower' "
        "(docs/understand/log-format.md describes the format)",
    ),
    "other topics": (
        {"imu": b"{}", "baro": b"{}"},
        {},
        "holds no message of a topic that docs/understand/log-format.md has; its topics: imu, baro",
    ),
    "a topic is missing": (imu(), {}, "no topic /probe/alpha, which the power curve needs"),
    "empty": ({"/imu": b""}, {}, "holds no message (it is complete, but nothing was recorded)"),
    "never measured": (
        REQUIRED | {"/rpm": b'{"status": "no_reply"}'},
        {},
        "/rpm: motor_speed_revps was never measured (its status: no_reply)",
    ),
    "without its value": (
        REQUIRED | {"/rpm": b'{"motor_speed_revps": null}'},
        {},
        "/rpm: motor_speed_revps never carried a value (its status: ok)",
    ),
    "without a field": (
        REQUIRED | {"/static": b'{"pressure_Pa": 1e5}'},
        {},
        "/static: temperature_K is missing; it is required",
    ),
    "without two fields": (
        REQUIRED | {"/static": b"{}"},
        {},
        "/static: pressure_Pa, temperature_K are missing; they are required",
    ),
    "a string for an integer, beside 3.0 for another": (
        REQUIRED | {"/gps": b'{"fix_type": 3.0, "itow_ms": "4"}'},
        {},
        "/gps: 30 of 30 messages cannot be decoded: itow_ms is a string; write an integer without quotation marks",
    ),
}


@pytest.mark.parametrize(("messages", "options", "message"), UNREADABLE.values(), ids=UNREADABLE.keys())
def test_what_cannot_be_read_is_refused_with_its_mistake(
    tmp_path: Path, messages: dict[str, bytes], options: dict[str, str], message: str
) -> None:
    path = file_of(tmp_path / "flight.mcap", messages, **options)
    with pytest.raises(InputError) as caught:
        check_messages(read_log(path))
    assert str(caught.value) == f"{path}: {message}"


BATTERY = {"/battery": b'{"voltage_V": 15.0, "current_A": 4.0}'}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        (imu(specific_force_x_mps2="1.0"), "/imu: 30 of 30 messages cannot be decoded: specific_force_x_mps2 is a"),
        ({"/rpm": b'{"status": "OK"}'}, '/rpm: 30 of 30 messages cannot be decoded: status is "OK"'),
        ({"/imu": None, "imu": b"{}"}, "no topic /imu, which the power curve needs; is it imu? Rename it"),
        ({"/rpm": None, "/motor/rpm": b"{}"}, "no topic /rpm, which the power curve needs; is it /motor/rpm?"),
    ],
    ids=["strings", "status", "without slash", "longer name"],
)
def test_a_topic_written_wrongly_is_not_replaced_by_electrical_power(
    tmp_path: Path, changed: dict[str, bytes | None], message: str
) -> None:
    topics = {topic: data for topic, data in (REQUIRED | BATTERY | changed).items() if data is not None}
    log = file_of(tmp_path / "flight.mcap", topics)
    with pytest.raises(InputError, match=re.escape(f"{log}: {message}")):
        analyze_log(log, tmp_path / "report", Options(), lambda _: None)
    assert not (tmp_path / "report").exists()


def test_numbers_without_a_fraction_are_integers(tmp_path: Path) -> None:
    path = file_of(
        tmp_path / "flight.mcap",
        {"/gps": b'{"fix_type": 3.0, "velocity_north_mps": 12.0}', "/controls": b'{"pulse_us": [1500.0, 1.1e3]}'},
    )
    log = read_log(path)
    gps, controls = (log.entries[topic][0].message for topic in ("/gps", "/controls"))
    assert gps == Gps(fix_type=3, velocity_north_mps=12.0) and controls == Controls(pulse_us=[1500, 1100])
    assert log.undecodable == 0


def test_all_that_a_log_lacks_is_named_at_once(tmp_path: Path) -> None:
    log = read_log(file_of(tmp_path / "flight.mcap", REQUIRED))
    message = missing(log, Replacements())
    assert message.startswith(f"{log.path}: no aircraft.toml, propeller.csv, probe.json in the log; attach them to the")
    assert all(option in message for option in ("--aircraft FILE", "--propeller NAME", "--probe FILE"))


@pytest.mark.parametrize("name", ["Aircraft.toml", "config/aircraft.toml"])
def test_an_attachment_of_almost_the_name_is_named(tmp_path: Path, name: str) -> None:
    log = read_log(file_of(tmp_path / "flight.mcap", REQUIRED))
    log.attachments[name] = b""
    assert missing(log, Replacements()) == f"{log.path}: the attachment {name} is not aircraft.toml: rename it"


def test_the_few_messages_left_out_are_named_with_their_mistake(tmp_path: Path) -> None:
    log = read_log(file_of(tmp_path / "flight.mcap", REQUIRED))
    assert damage(log) == []
    log.undecodable_of["/rpm"] = Undecodable(b'{"motor_speed_revps": NaN}', "", 2)
    log.undecodable_of["/imu"] = Undecodable(b"[1]", "Expected `object`, got `array`", 1)
    item, two = damage(log)
    assert item.startswith("1 message is left out: /imu: a message is not a JSON object")
    assert two == "2 messages are left out: /rpm: NaN is not JSON; write null where nothing was measured."


def test_only_what_a_log_lacks_is_named(tmp_path: Path) -> None:
    log = read_log(file_of(tmp_path / "flight.mcap", REQUIRED))
    named = Replacements(aircraft=load_aircraft("nexstar"))  # its propeller is a shipped one
    assert missing(log, named).startswith(f"{log.path}: no probe.json in the log; attach it to the log")
    log.attachments["propeller.csv"] = b""
    assert ": no aircraft.toml, probe.json in the log" in missing(log, Replacements())


def test_a_malformed_aircraft_file_matters_only_where_no_other_is_given(tmp_path: Path) -> None:
    log = read_log(file_of(tmp_path / "flight.mcap", REQUIRED))
    log.attachments["aircraft.toml"] = b"[geometry"
    assert "not valid TOML" in missing(log, Replacements())
    assert ": no probe.json in the log" in missing(log, Replacements(aircraft=load_aircraft("nexstar")))


def test_messages_that_cannot_be_decoded_are_refused_before_missing_attachments(tmp_path: Path) -> None:
    log = read_log(file_of(tmp_path / "flight.mcap", REQUIRED | {"/gps": b'{"itow_ms": 1.5}'}))
    with pytest.raises(InputError, match="/gps: 30 of 30 messages cannot be decoded"):
        analyze_runs(log)


def missing(log: Log, replacements: Replacements) -> str:
    with pytest.raises(InputError) as caught:
        contents(log, replacements)
    return str(caught.value)


def test_messages_out_of_order_are_sorted(tmp_path: Path) -> None:
    with (tmp_path / "flight.mcap").open("wb") as stream:
        writer = Writer(stream)
        writer.start(profile="flightpower")
        channel = writer.register_channel("/rpm", "json", schema_id=0)
        for time_ns in (3, 1, 2):
            writer.add_message(channel, time_ns, b"{}", time_ns)
        writer.finish()
    assert [entry.time_ns for entry in read_log(tmp_path / "flight.mcap").entries["/rpm"]] == [1, 2, 3]
