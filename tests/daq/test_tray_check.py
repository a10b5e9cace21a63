"""`daq check`: a good tray is fit, and every red line says what to do."""

import json

import pytest
from scripted_parts import HandClock
from test_daemon import EXAMPLE, NoBuses, SteadyFelt, default_tray

from daq import check
from daq.config import parse_tray
from flight.messages import TYPE_OF_TOPIC, Gps, Imu, Status
from hw_fakes.clock import SimulatedClock
from hw_fakes.faults import Fault
from hw_fakes.tray import FakeTray


def test_a_tray_that_works_is_fit_to_fly(tmp_path):
    clock = SimulatedClock()
    fake = FakeTray(SteadyFelt(), clock)
    report = check.examine(default_tray(tmp_path, fake), buses=fake, clock=clock)
    assert all(line.ok for line in report.lines), report.lines
    values = {line.topic: line.values for line in report.lines}
    assert values["/probe/airspeed"] == ["309.94 ± 0 Pa"]  # 310 Pa to a count, 0.19 Pa
    assert report.fit == (report.free_s >= check.ENOUGH_ROOM_S)
    machine = json.loads(check.as_json(report))
    assert machine["missed"] == 0 and machine["fit"] == report.fit
    assert {line["topic"] for line in machine["lines"]} == set(values) and machine["facts"][0]["ok"]


def test_every_part_says_who_it_is_and_where(tmp_path):
    clock = SimulatedClock()
    fake = FakeTray(SteadyFelt(), clock)
    report = check.examine(default_tray(tmp_path, fake), buses=fake, clock=clock, seconds=2)
    identity = {line.topic: line.identity for line in report.lines}
    assert identity["/imu"] == "MPU-9250, 0x68 on /dev/i2c-1"
    assert identity["/mag"] == "AK8963, 0x0c on /dev/i2c-1"
    assert identity["/static"].startswith("MS5805 with C1 ")
    assert identity["/probe/beta"] == "MS4515DO-DS5AK002DP (answers; it has no identity), 0x46 on /dev/i2c-1"
    assert identity["/gps"] == "ublox, /dev/ttyAMA0"
    gps = next(line for line in report.lines if line.topic == "/gps")
    assert "3 ± 0 dimensional fix" in gps.values
    texts = [fact.text for fact in report.facts]
    assert any("50 of 50 ticks at 25 Hz" in text for text in texts)
    assert any("h of log at" in text for text in texts) and any("can be written" in text for text in texts)


def test_bus_errors_are_counted_and_a_glitch_is_no_reason_to_stay_on_the_ground(tmp_path):
    clock = SimulatedClock()
    fault = Fault(kind="no_acknowledge", device="alpha", start_s=4.0, duration_s=0.05)
    fake = FakeTray(SteadyFelt(), clock, faults=[fault])
    report = check.examine(default_tray(tmp_path, fake), buses=fake, clock=clock)
    alpha = next(line for line in report.lines if line.topic == "/probe/alpha")
    assert alpha.bus_errors in (1, 2) and alpha.ok and "no_reply" in alpha.trouble
    assert all(line.bus_errors == 0 for line in report.lines if line.topic != "/probe/alpha")


@pytest.mark.parametrize(("free", "said"), [(10**6, "move logs away"), (10**12, "can be written")])
def test_a_card_without_room_is_not_fit(tmp_path, monkeypatch, free, said):
    monkeypatch.setattr(check, "free_bytes", lambda _: free)
    clock = SimulatedClock()
    fake = FakeTray(SteadyFelt(), clock)
    report = check.examine(default_tray(tmp_path, fake), buses=fake, clock=clock, seconds=1)
    assert any(said in fact.text for fact in report.facts)
    assert report.fit is (free > 10**9)


def test_nothing_there_is_not_fit_and_every_line_has_advice(tmp_path):
    tray = parse_tray(EXAMPLE.read_text(), "tray.toml", tmp_path)
    report = check.examine(tray, buses=NoBuses(), clock=HandClock())
    assert not report.fit
    assert len(report.lines) == len(TYPE_OF_TOPIC) - 3
    assert all(line.ok is False and line.advice for line in report.lines)


def test_every_status_that_is_not_a_measurement_has_advice():
    for status in Status:
        line = check.judge("/imu", [Imu(status=status)] * 10, 1.0)
        assert (line.ok is True and not line.advice) if status is Status.OK else (line.ok is False)
        assert line.advice or status in check.FINE


@pytest.mark.parametrize(("topic", "said"), [("/gps", check.NO_FIX), ("/rpm", check.STANDING)])
def test_what_is_normal_on_the_ground_is_told_as_such(topic, said):
    message = Gps(status=Status.NO_DATA, fix_type=0) if topic == "/gps" else TYPE_OF_TOPIC[topic](status=Status.NO_DATA)
    line = check.judge(topic, [message] * 10, 1.0)
    assert line.advice == said and line.ok is (None if topic == "/rpm" else False)
