"""`daq check`: a good tray is fit, and every red line says what to do."""

import json

import pytest
from scripted_parts import HandClock
from test_daemon import EXAMPLE, NoBuses, SteadyFelt, default_tray

from daq import check
from daq.config import parse_tray
from flight.messages import TYPE_OF_TOPIC, Gps, Imu, Status
from hw_fakes.clock import SimulatedClock
from hw_fakes.tray import FakeTray


def test_a_tray_that_works_is_fit_to_fly(tmp_path):
    clock = SimulatedClock()
    fake = FakeTray(SteadyFelt(), clock)
    report = check.examine(default_tray(tmp_path, fake), buses=fake, clock=clock)
    assert all(line.ok for line in report.lines), report.lines
    values = {line.topic: line.values for line in report.lines}
    assert values["/probe/airspeed"] == ["309.94 ± 0 Pa"]  # 310 Pa to a count, 0.19 Pa
    assert report.fit == (report.free_s >= check.ENOUGH_ROOM_S)
    assert json.loads(check.as_json(report))["missed"] == 0


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
