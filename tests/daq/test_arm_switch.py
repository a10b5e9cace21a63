"""The arm switch marks the log, or starts and ends it."""

from pathlib import Path

import pytest
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq.arm_switch import ArmSwitch
from flightpower.daq.config import ArmSwitchConfig
from flightpower.daq.daemon import record
from flightpower.daq.sensors import Sample
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Controls, Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray


def texts(switch, *pulses_us):
    """The texts of events while channel 2 moves; None is a tick without signal."""
    texts = []
    for pulse in pulses_us:
        # The servo on the same channel is at the opposite end.
        heard = Controls(pulse_us=[1500, 2500 - pulse], stick_pulse_us=[1500, pulse]) if pulse is not None else None
        message = heard or Controls(status=Status.NO_DATA)
        texts += [event.text for event in switch.update([Sample("/controls", 0, message)])]
    return texts


def test_it_tells_when_it_is_moved_and_not_when_it_trembles():
    switch = ArmSwitch(ArmSwitchConfig(channel=2, above_us=1600))
    assert texts(switch, 1000, 1000, 1900, 1601, 1590, 1570, 1900) == ["armed"]
    assert texts(switch, 1500, 1590) == ["disarmed"]


def test_on_an_output_it_does_not_look_at_the_sticks():
    switch = ArmSwitch(ArmSwitchConfig(channel=2, seen_at="servos"))
    assert texts(switch, 1900, 800, 1900) == ["armed", "disarmed"]  # the output at 600, 1700, 600 us
    servos_only = [Sample("/controls", 0, Controls(pulse_us=[1500, 1900]))]
    assert [event.text for event in switch.update(servos_only)] == ["armed"]
    assert ArmSwitch(ArmSwitchConfig(channel=2)).update(servos_only) == []


def test_without_signal_it_stays_where_it_was():
    switch = ArmSwitch(ArmSwitchConfig(channel=2, action="record"))
    assert not switch.recording
    assert texts(switch, None, 0, 1900, None, 0) == ["armed"]
    assert switch.recording
    assert ArmSwitch(None).recording and ArmSwitch(ArmSwitchConfig(channel=2)).recording


class SwitchedSensorTruth(SteadySensorTruth):
    """Channel 7 is up from 5 to 10 s and from 12 to 15 s."""

    def servo_pulses_us(self, t_s):
        pulses = super().servo_pulses_us(t_s)
        up = ((t_s > 5) & (t_s < 10)) | ((t_s > 12) & (t_s < 15))
        pulses[up, 6] = 1900.0
        return pulses


def flown(tmp_path: Path, action: str, seen_at: str = "receiver"):
    clock = SimulatedClock(unix_at_start_ns=10**18)
    fake = FakeTray(SwitchedSensorTruth(), clock)
    arm = {"[[sensors]]": f'[arm]\nchannel = 7\naction = "{action}"\nseen_at = "{seen_at}"\n[[sensors]]'}
    text = default_tray(tmp_path, fake).text
    from flightpower.daq.config import parse_tray

    tray = parse_tray(text.replace("[[sensors]]", arm["[[sensors]]"], 1), "tray.toml", tmp_path)
    recording = record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 18 * 10**9)
    return recording, [read_log(path) for path in recording.paths]


@pytest.mark.parametrize("seen_at", ["receiver", "servos"])
def test_mark_records_always_and_says_when(tmp_path, seen_at):
    recording, [log] = flown(tmp_path, "mark", seen_at)
    assert len(log.entries["/daq/tick"]) == recording.ticks
    marks = [(e.message.text, e.tick / 25) for e in log.entries["/daq/event"] if e.message.sensor == "arm"]
    assert [text for text, _ in marks] == ["armed", "disarmed"] * 2
    # The autopilot sends at the rate of the ticks, so each change is seen within two of them.
    assert all(abs(at_s - expected) < 0.1 for (_, at_s), expected in zip(marks, (5, 10, 12, 15), strict=True))


def test_record_records_only_while_armed_each_time_into_a_new_log(tmp_path):
    recording, logs = flown(tmp_path, "record")
    assert recording.ticks == 18 * 25 and len(logs) == 2
    spans = [(log.entries["/daq/tick"][0].tick / 25, log.entries["/daq/tick"][-1].tick / 25) for log in logs]
    for (begin, end), (up, down) in zip(spans, ((5, 10), (12, 15)), strict=True):
        assert abs(begin - up) < 0.1 and abs(end - down) < 0.1
    assert not any(log.torn for log in logs)
