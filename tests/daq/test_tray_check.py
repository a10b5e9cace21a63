"""`daq check`: a good tray passes, and every red line says what to do."""

import errno
import json
import math
import os
from pathlib import Path
from types import SimpleNamespace

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from scripted_parts import HandClock, ScriptedPort
from test_daemon import EXAMPLE, NoBuses, SteadySensorTruth, default_tray

from flightpower.daq import tray_check
from flightpower.daq.computer_check import card_check, card_speed, supply_check
from flightpower.daq.config import parse_tray
from flightpower.daq.daemon import OWN_TOPICS
from flightpower.daq.dry_run import DryRun, dry_run
from flightpower.daq.part_identity import autopilot_version, identify
from flightpower.daq.rest_check import height_comparison, receiver_problem
from flightpower.daq.sensors.autopilot import is_autopilot
from flightpower.flight.messages import (
    SECOND_TOPICS,
    TYPE_OF_TOPIC,
    AbsolutePressure,
    Attitude,
    Battery,
    Controls,
    Gps,
    Imu,
    Magnetometer,
    Rpm,
    Status,
)
from flightpower.hw_fakes.autopilot import FakeAutopilot
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.faults import Fault
from flightpower.hw_fakes.tray import FakeTray, TrayVariant
from flightpower.hw_fakes.ublox import FakeUbloxM8


class AtRest(SteadySensorTruth):
    """The aircraft is on the ground, and its probe is covered."""

    rate = (0.0, 0.0, 0.0)
    pressure = {"baro": 98_600.0, "static": 98_500.0}  # noqa: RUF012
    difference = {"alpha": 4.0, "beta": -3.0, "airspeed": 10.0}  # noqa: RUF012


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        ({}, ""),
        ({"dynamic_model": 0}, "is set to 0"),
        ({"dynamic_model": None}, "does not say its dynamic model"),
        ({"fix_type": 2}, "fix of type 2"),
        ({"satellites": 4}, "with 4 satellites"),
        ({"speed_accuracy_mps": 1.2}, "velocity known to 1.2 m/s"),
    ],
)
def test_a_receiver_is_fit_when_its_velocity_is(change, expected):
    good = {"fix_type": 3, "satellites": 12, "speed_accuracy_mps": 0.2, "dynamic_model": 8}
    problem = receiver_problem([Gps(**{**good, **change})])
    assert expected in problem and bool(expected) == bool(problem)


def checked(tmp_path, sensor_truth, **options):
    clock = SimulatedClock()
    fake = FakeTray(sensor_truth, clock)
    return tray_check.check_tray(default_tray(tmp_path, fake), buses=fake, clock=clock, seconds=1, **options)


def at_rest(**values):
    return type("Felt", (AtRest,), values)()


@pytest.mark.parametrize(
    ("sensor_truth", "topic", "expected"),
    [
        (at_rest(force=(0.0, 0.0, 9.8)), "/imu", "must be about (0, 0, -1) g, but is (0.0, 0.0, 1.0) g"),
        (at_rest(force=(9.8, 0.0, 0.0)), "/imu", "correct `axes`"),
        (at_rest(force=(0.0, 0.0, -5.0)), "/imu", "0.51 g at rest"),
        (at_rest(difference={"alpha": 4.0, "beta": -80.0, "airspeed": 10.0}), "/probe/beta", "-80 Pa at rest"),
    ],
)
def test_readings_that_cannot_be_those_of_an_aircraft_at_rest_are_not_fit(tmp_path, sensor_truth, topic, expected):
    report = checked(tmp_path, sensor_truth)
    assert [line.topic for line in report.lines if line.ok is False] == [topic] and not report.fit
    assert expected in next(line.advice for line in report.lines if line.topic == topic)


@pytest.mark.parametrize(("baro_Pa", "ok"), [(98_500.0 + 450, True), (98_500.0 - 550, False), (98_500.0 + 550, False)])
def test_barometers_that_disagree_are_not_fit(tmp_path, baro_Pa, ok):
    report = checked(tmp_path, at_rest(pressure={"baro": baro_Pa, "static": 98_500.0}))
    fact = next(fact for fact in report.facts if "hPa from /static" in fact.text)
    assert fact.ok is ok and ("blocked static line" in fact.text) is not ok


@pytest.mark.parametrize(("difference_m", "ok"), [(600, True), (-600, True), (700, False), (-700, False)])
def test_a_pressure_that_cannot_be_that_of_the_height_is_not_fit(difference_m, ok):
    pressure = [AbsolutePressure(pressure_Pa=101_325.0 * (1 - 1000 / 44_330.77) ** 5.25588)]  # 1000 m, ISO 2533
    fixes = [Gps(height_msl_m=1000.0 - difference_m, fix_type=3)]
    result, text = height_comparison({"/static": pressure, "/gps": fixes})
    assert result is ok and f"{difference_m:+d} m from the standard atmosphere" in text
    assert height_comparison({"/static": pressure, "/gps": [Gps(height_msl_m=1000.0, fix_type=2)]}) is None


@pytest.mark.parametrize(("size_T", "ok"), [(5e-6, False), (25e-6, True), (65e-6, True), (120e-6, False)])
def test_a_field_that_is_not_the_earths_is_not_fit(size_T, ok):
    x, y, z = (size_T * part for part in (2 / 3, -1 / 3, 2 / 3))
    line = tray_check.check_topic("/mag", [Magnetometer(field_x_T=x, field_y_T=y, field_z_T=z)] * 5, 1.0)
    assert line.ok is ok and ("uT, the earth's field" in line.advice) is not ok


def test_the_computers_supply_and_card_are_judged(tmp_path):
    assert supply_check(tmp_path) is None
    for number, (name, alarm) in enumerate([("cpu_thermal", "1"), ("rpi_volt", "0")]):
        (tmp_path / f"hwmon{number}").mkdir()
        (tmp_path / f"hwmon{number}" / "name").write_text(f"{name}\n")
        (tmp_path / f"hwmon{number}" / "in0_lcrit_alarm").write_text(f"{alarm}\n")
    assert supply_check(tmp_path).ok
    (tmp_path / "hwmon1" / "in0_lcrit_alarm").write_text("1\n")
    assert not supply_check(tmp_path).ok
    assert card_check(tmp_path / "absent") is None and "MB/s" in card_check(tmp_path).text
    assert not list(tmp_path.glob("*tmp*"))
    rate, _, slowest = (
        card_check(tmp_path).text.removeprefix("the disk writes ").partition(" MB/s, 0.26 MB in at most ")
    )
    assert float(rate) > 0
    assert 0 <= float(slowest.removesuffix(" s").split(" s:")[0]) < 60
    assert "writes 0.5 MB/s" in card_speed(0.5e6, 0.1).text
    assert card_speed(10e6, 0.1).ok and not card_speed(0.5e6, 0.1).ok and not card_speed(10e6, 3.0).ok


def test_an_attitude_that_is_no_number_is_not_ok(tmp_path):
    class Lost(AtRest):
        def autopilot_attitude_rad(self, t_s):
            return self._rows(t_s, math.nan, -0.05, 2.0)

    line = next(line for line in checked(tmp_path, Lost()).lines if line.topic == "/attitude")
    assert line.ok is False and "no_data" in line.trouble
    messages = [Attitude(roll_rad=0.1, pitch_rad=math.inf)] * 10
    line = tray_check.check_topic("/attitude", messages, 1.0)
    assert line.ok is False and line.trouble == "not a number 10" and line.advice == tray_check.NOT_FINITE


def test_a_tray_that_works_is_fit_to_fly(tmp_path):
    clock = SimulatedClock()
    fake = FakeTray(AtRest(), clock)
    report = tray_check.check_tray(default_tray(tmp_path, fake), buses=fake, clock=clock, seconds=5)
    assert all(line.ok for line in report.lines), report.lines
    values = {line.topic: line.values for line in report.lines}
    shown, _, unit = values["/probe/airspeed"][0].partition(" ± 0 ")
    assert float(shown) == pytest.approx(10, abs=0.19) and unit == "Pa"  # to a count
    assert report.fit == (report.free_s >= tray_check.MINIMUM_FREE_S)
    machine = json.loads(tray_check.as_json(report))
    assert machine["missed"] == 0 and machine["fit"] == report.fit
    assert {line["topic"] for line in machine["lines"]} == set(values) and machine["facts"][0]["ok"]


def test_every_part_says_who_it_is_and_where(tmp_path):
    clock = SimulatedClock()
    fake = FakeTray(AtRest(), clock)
    report = tray_check.check_tray(default_tray(tmp_path, fake), buses=fake, clock=clock, seconds=2)
    identity = {line.topic: line.identity for line in report.lines}
    assert identity["/imu"] == "MPU-9250, 0x68 on /dev/i2c-1"
    assert identity["/mag"] == "AK8963, 0x0c on /dev/i2c-1"
    assert identity["/static"].startswith("MS5805 with C1 ")
    assert (
        identity["/probe/beta"]
        == "MS4515DO-DS3AK002DP (answers; the part has no identity register), 0x46 on /dev/i2c-1"
    )
    version = "u-blox ROM CORE 3.01 (107888), hardware 00080000, FWVER=SPG 3.01, PROTVER=18.00"
    assert identity["/gps"] == f"{version}, /dev/ttyAMA0"
    assert identity["/attitude"] == "ardupilotmega 4.5.7, fixed wing, system 1, /dev/ttyUSB1"
    # 120 rev/s with seven pole pairs: ten electrical periods last 11.9 ms, 84 frames a second.
    assert identity["/rpm"] == "pulse counter, legacy frames, 84 a second, /dev/ttyUSB0"
    gps = next(line for line in report.lines if line.topic == "/gps")
    assert "3 ± 0 dimensional fix" in gps.values
    texts = [fact.text for fact in report.facts]
    assert any("50 of 50 ticks at 25 Hz" in text for text in texts)
    assert any("h of recording at" in text for text in texts) and any("is writable" in text for text in texts)


def check_line(driver: str, port, extra="", **options):
    """The line of the check about a single part on a line."""
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock, variant=TrayVariant(**options))
    clock.advance_ns(2 * 10**9)
    table = parse_tray(f'[[sensors]]\ndriver="{driver}"\n{port}\n{extra}', "tray.toml", Path()).sensors[0]
    return identify(table, fake, clock).text


def test_a_counter_that_speaks_the_other_variant_is_reported():
    message = check_line("esc_counter", 'port="/dev/ttyUSB0"', rpm_with_crc=True)
    assert message == "pulse counter, framed frames, 84 a second, but the tray says framed = false, /dev/ttyUSB0"


@pytest.mark.parametrize(
    ("topic", "message", "shown"),
    [
        ("/static", AbsolutePressure(pressure_Pa=98_650.0), ["986.5 hPa"]),
        ("/imu", Imu(specific_force_z_mps2=-9.8, angular_rate_y_radps=0.1), ["-9.8 m/s2 down", "5.7296 deg/s pitch"]),
        ("/mag", Magnetometer(field_x_T=21.5e-6), ["21.5 uT forward"]),
        ("/rpm", Rpm(motor_speed_revps=80.0), ["4800 rpm"]),
        ("/controls", Controls(elevator_rad=-0.1, throttle=0.45), ["-5.7296 deg elevator", "45 % throttle"]),
        ("/attitude", Attitude(pitch_rad=0.05), ["2.8648 deg pitch"]),
        ("/battery", Battery(voltage_V=11.1, current_A=2.5), ["11.1 V", "2.5 A"]),
    ],
)
def test_readings_are_shown_in_the_units_that_a_pilot_knows(topic, message, shown):
    assert tray_check.check_topic(topic, [message], 1.0).values == shown
    scattered = [AbsolutePressure(pressure_Pa=98_600.0), AbsolutePressure(pressure_Pa=98_800.0)]
    assert tray_check.check_topic("/baro", scattered, 0.5).values == ["987 ± 1.4 hPa"]
    assert tray_check.check_topic("/baro", scattered, 0.5).rate_Hz == 4.0


@pytest.mark.parametrize(
    ("driver", "port", "listened_s"),
    [("ublox", "/dev/ttyAMA0", 1.5), ("esc_counter", "/dev/ttyUSB0", 1.0), ("autopilot", "/dev/ttyUSB1", 2.5)],
)
def test_a_silent_line_is_listened_to_as_long_as_its_part_may_take(driver, port, listened_s):
    """A heartbeat comes once a second, a receiver answers after its next solution, a counter sends all the time."""
    clock = HandClock()
    table = parse_tray(f'[[sensors]]\ndriver="{driver}"\nport="{port}"\n', "tray.toml", Path()).sensors[0]
    begin_ns = clock.now_ns()
    identify(table, SimpleNamespace(port=lambda *_: ScriptedPort()), clock)
    assert (clock.now_ns() - begin_ns) / 1e9 == pytest.approx(listened_s, abs=0.021)


@pytest.mark.parametrize(("driver", "part"), [("ms5611", "baro"), ("ms5805", "static")])
def test_a_barometer_says_its_own_coefficient_and_checksum(driver: str, part: str):
    """Two parts of one type are distinguished by what the factory wrote into them."""
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    clock.advance_ns(2 * 10**9)
    table = parse_tray(f'[[sensors]]\ndriver="{driver}"\nbus="/dev/i2c-1"\n', "tray.toml", Path()).sensors[0]
    barometer = getattr(fake, part)
    crc = barometer.prom[barometer.part.crc_in_word] >> barometer.part.crc_shift & 0xF
    text = identify(table, fake, clock).text
    assert text.startswith(f"{driver.upper()} with C1 {barometer.prom[1]}, CRC 0x{crc:x}, ")


def test_a_receiver_on_the_bus_says_who_it_is():
    assert check_line("ublox_ddc", 'bus="/dev/i2c-1"', gps_on_i2c=True).startswith("u-blox ROM CORE 3.01 (107888), ")


@pytest.mark.parametrize(
    ("driver", "port", "expected"),
    [
        ("ublox", "/dev/ttyAMA0", "u-blox (no answer to MON-VER), /dev/ttyAMA0"),
        ("esc_counter", "/dev/ttyUSB0", "pulse counter (no frames), /dev/ttyUSB0"),
        ("autopilot", "/dev/ttyUSB1", "autopilot (no heartbeat), /dev/ttyUSB1"),
        ("autopilot", "/dev/ttyUSB7", "autopilot, /dev/ttyUSB7: No such file or directory"),
    ],
)
def test_a_line_on_which_nothing_is_heard_says_so(driver, port, expected):
    """At the wrong speed both sides hear noise."""
    assert check_line(driver, f'port="{port}"', "baud = 19200\n") == expected


def test_an_autopilot_is_not_taken_for_the_ground_station_it_passes_on():
    station = mavlink.MAVLink_heartbeat_message(mavlink.MAV_TYPE_GCS, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, 4, 3)
    assert not is_autopilot(station)
    assert autopilot_version(0x04_05_07_FF) == "4.5.7" and autopilot_version(0) == ""


def test_bus_errors_are_counted_and_a_glitch_is_no_reason_to_stay_on_the_ground(tmp_path):
    clock = SimulatedClock()
    fault = Fault(kind="no_acknowledge", device="alpha", start_s=4.0, duration_s=0.05)
    fake = FakeTray(AtRest(), clock, faults=[fault])
    report = tray_check.check_tray(default_tray(tmp_path, fake), buses=fake, clock=clock, seconds=5)
    alpha = next(line for line in report.lines if line.topic == "/probe/alpha")
    assert alpha.bus_errors in (1, 2) and alpha.ok and "no_reply" in alpha.trouble
    assert all(line.bus_errors == 0 for line in report.lines if line.topic != "/probe/alpha")


@pytest.mark.parametrize(("free", "expected"), [(10**6, "move logs to another disk"), (10**12, "is writable")])
def test_a_card_without_room_is_not_fit(tmp_path, monkeypatch, free, expected):
    monkeypatch.setattr(tray_check, "free_bytes", lambda _: free)
    clock = SimulatedClock()
    fake = FakeTray(AtRest(), clock)
    report = tray_check.check_tray(default_tray(tmp_path, fake), buses=fake, clock=clock, seconds=1)
    assert any(expected in fact.text for fact in report.facts)
    assert report.fit is (free > 10**9)


def test_nothing_there_is_not_fit_and_every_line_has_advice(tmp_path):
    tray = parse_tray(EXAMPLE.read_text(), "tray.toml", tmp_path)
    report = tray_check.check_tray(tray, buses=NoBuses(), clock=HandClock(), seconds=5)
    assert not report.fit
    assert {line.topic for line in report.lines} == set(TYPE_OF_TOPIC) - SECOND_TOPICS - {"/analog", *OWN_TOPICS}
    assert all(line.ok is False and line.advice for line in report.lines)


def test_every_status_that_is_not_a_measurement_has_advice():
    for status in Status:
        line = tray_check.check_topic("/imu", [Imu(status=status)] * 10, 1.0)
        assert (line.ok is True and not line.advice) if status is Status.OK else (line.ok is False)
        assert line.advice or status in tray_check.GOOD_STATUSES


STOP_PROGRAM = tray_check.STOP_PROGRAM


def test_a_line_that_is_in_use_is_not_a_matter_of_wiring():
    message = Gps(status=Status.NO_REPLY)
    for number in (errno.EBUSY, errno.ENOENT):

        def port(device, baud, number=number):
            raise OSError(number, os.strerror(number), device)

        table = parse_tray('[[sensors]]\ndriver="ublox"\nport="/dev/ttyAMA0"\n', "tray.toml", Path()).sensors[0]
        part = identify(table, SimpleNamespace(port=port), HandClock())
        advice = tray_check.check_topic("/gps", [message] * 10, 1.0, part).advice
        assert (advice == STOP_PROGRAM) is (number == errno.EBUSY)


@pytest.mark.parametrize(("topic", "expected"), [("/gps", tray_check.NO_FIX), ("/rpm", tray_check.MOTOR_STOPPED)])
def test_what_is_normal_on_the_ground_is_reported_as_such(topic, expected):
    message = Gps(status=Status.NO_DATA, fix_type=0) if topic == "/gps" else TYPE_OF_TOPIC[topic](status=Status.NO_DATA)
    line = tray_check.check_topic(topic, [message] * 10, 1.0)
    assert line.advice == expected and line.ok is (None if topic == "/rpm" else False)


@pytest.mark.parametrize(("good", "ok"), [(95, True), (94, False)])
def test_a_sensor_that_loses_more_than_a_twentieth_of_its_readings_is_not_fit(good, ok):
    messages = [Imu()] * good + [Imu(status=Status.NO_REPLY)] * (100 - good)
    assert tray_check.check_topic("/imu", messages, 4.0).ok is ok


def test_values_are_shown_in_the_units_beside_them() -> None:
    """The field's name ends with the unit it is measured in; the factor converts it to the one shown."""
    factors = {"uT": 1e6, "hPa": 0.01, "deg": 180 / math.pi, "deg/s": 180 / math.pi, "rpm": 60.0, "%": 100.0}
    shown = [field for fields in tray_check.SHOWN_FIELDS.values() for field in fields]
    assert {unit.split()[0] for _, _, unit in shown} > set(factors)
    for name, factor, unit in shown:
        assert factor == pytest.approx(factors.get(unit.split()[0], 1.0), rel=1e-6), name


def test_the_room_on_the_disk_is_that_beyond_what_is_kept_free(tmp_path, monkeypatch):
    """With 10 GB free, the part beyond what is kept free lasts for the default tray's bytes, 16 kB/s at 25 Hz."""
    monkeypatch.setattr(tray_check, "free_bytes", lambda folder: 10e9)
    result = checked(tmp_path, AtRest())
    clock = SimulatedClock()
    keep_free_MB = default_tray(tmp_path, FakeTray(AtRest(), clock)).files.keep_free_MB
    assert keep_free_MB > 0 and result.free_s == pytest.approx((10e9 - keep_free_MB * 1e6) / 16e3)


@pytest.mark.parametrize(
    ("readings", "free_s", "expected"),
    [
        (DryRun([], 25, 0, 3.21, []), 7200.0, ["25 of 25 ticks at 25 Hz, at most 3.2 ms late", "space for 2.0 h of"]),
        (
            DryRun([], 22, 3, 81.0, ["i2c needs 50 ms"]), 7199.0,
            ["22 of 25 ticks at 25 Hz, at most 81.0 ms late: stop other programs", "move logs", "i2c needs 50 ms"],
        ),
    ],
)  # fmt: skip
def test_ticks_and_room_are_reported_in_numbers(tmp_path, readings, free_s, expected):
    """Missed ticks count among the expected ones; two hours of recording have to fit."""
    tray = default_tray(tmp_path, FakeTray(AtRest(), SimulatedClock()))
    facts = tray_check.system_checks(tray, readings, free_s)
    assert [fact.ok for fact in facts[:2]] == [readings.missed == 0, free_s >= 7200.0]
    assert [fact.ok for fact in facts[2:]] == [False] * len(readings.slow) + [True, True]
    for fact, text in zip(facts, expected, strict=False):
        assert text in fact.text


def test_a_stall_is_counted_in_the_ticks_that_it_cost(tmp_path, monkeypatch):
    """One tick of 40 ms begins 0.1 s late: the two after it are passed over."""
    clock = SimulatedClock()
    fake = FakeTray(AtRest(), clock)
    tray, stalled = default_tray(tmp_path, fake), []
    real = clock.sleep_until_ns

    def stalls_once(time_ns: int) -> None:
        late_ns = 100_000_000 if not stalled and time_ns > clock.now_ns() and time_ns >= begin_ns + 2_500_000_000 else 0
        stalled.extend([True] if late_ns else [])
        real(time_ns + late_ns)

    begin_ns = clock.now_ns()
    monkeypatch.setattr(clock, "sleep_until_ns", stalls_once)
    result = dry_run(tray, buses=fake, clock=clock, seconds=1)
    assert stalled and result.missed == 2 and result.ticks + result.missed == 25
    assert result.late_ms == pytest.approx(100.0, abs=1.0)


def lines_of(tmp_path, *, variant=TrayVariant(), change=lambda fake: None):
    clock = SimulatedClock()
    fake = FakeTray(AtRest(), clock, variant=variant)
    change(fake)
    report = tray_check.check_tray(default_tray(tmp_path, fake), buses=fake, clock=clock, seconds=3)
    return {line.topic: line for line in report.lines}


def test_a_receiver_that_solves_less_often_than_it_is_set_is_not_fit(tmp_path, monkeypatch):
    monkeypatch.setattr(
        FakeUbloxM8, "_configure_rate", lambda self, payload, at_ns: self._set_period(200, at_ns) or True
    )
    line = lines_of(tmp_path)["/gps"]
    assert line.ok is False
    assert line.advice == "5.0 a second, 9 needed: solves 5 times a second, and is set to 10"


def test_an_autopilot_that_streams_too_slowly_is_not_fit(tmp_path, monkeypatch):
    monkeypatch.setattr(FakeAutopilot, "_command", lambda self, message, at_ns: mavlink.MAV_RESULT_DENIED)

    def slow(fake):
        fake.autopilot._period_ms |= {"ATTITUDE": 240, "SERVO_OUTPUT_RAW": 240}

    lines = lines_of(tmp_path, change=slow)
    for topic in ("/attitude", "/controls"):
        assert lines[topic].ok is False and "a second, 10 needed" in lines[topic].advice
    assert lines["/battery"].ok


def test_another_barometer_on_the_board_is_named(tmp_path):
    line = lines_of(tmp_path, variant=TrayVariant(ms5607=True))["/baro"]
    assert line.ok is False and 'set driver = "ms5607"' in line.advice
