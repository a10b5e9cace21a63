""" "All well" is said while all is well, and only then: on the page, on the link and in the log alike."""

import os

import pytest
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq.arm_switch import ArmSwitch
from flightpower.daq.config import ArmSwitchConfig, parse_tray
from flightpower.daq.daemon import record
from flightpower.daq.missed_ticks import MissedTicks
from flightpower.daq.recording_status import RecordingState, RecordingStatus, StatusFile
from flightpower.daq.sampling_loop import GridTick
from flightpower.daq.sensors import Sample
from flightpower.daq.status_page import page, sources_of
from flightpower.daq.telemetry import LOGGING_BIT, SensorBits, Snapshot, newest_lines, without_news
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Controls
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray

SECOND_NS = 10**9


def status(**changes) -> RecordingStatus:
    values = {
        "state": RecordingState.RECORDING, "log": "log-0001.mcap", "elapsed_s": 60.0, "ticks": 1501, "missed": 0,
        "rate_Hz": 25.0, "free_bytes": None, "error": "", "sensors": {}, "slow": [],
    }  # fmt: skip
    return RecordingStatus(**(values | changes))


@pytest.mark.parametrize(("changes", "expected"), [
    ({}, "recording 1 min, 25 Hz, all well"),
    ({"rate_Hz": 22.6}, "recording 1 min, 23 Hz, all well"),
    ({"rate_Hz": 22.4}, "recording 1 min, 22 Hz: 22.4 of 25.0 Hz"),
    ({"ticks": 601, "missed": 900, "rate_Hz": 2.4}, "recording 1 min, 2 Hz: 2.4 of 25.0 Hz"),
    ({"ticks": 1500, "missed": 1}, "recording 1 min, 25 Hz, all well"),  # the miss was long ago
    ({"ticks": 1500, "missed": 1, "recent_missed": 1}, "recording 1 min, 25 Hz: 1 tick missed in 10 s"),
    ({"ticks": 1500, "missed": 2, "recent_missed": 2}, "recording 1 min, 25 Hz: 2 ticks missed in 10 s"),
    ({"age_s": 2.9}, "recording 1 min, 25 Hz, all well"),
    ({"age_s": 3.1}, "No news from the daemon for 3 s"),
    ({"trouble": ["supply"]}, "recording 1 min, 25 Hz: supply"),
    ({"error": "log: Input/output error"}, "recording to memory 1 min, 25 Hz: log: Input/output error"),
    ({"state": RecordingState.WAITING}, "waiting for the arm switch, all well"),
    ({"state": RecordingState.WAITING, "rate_Hz": 2.0}, "waiting for the arm switch: 2.0 of 25.0 Hz"),
    ({"state": RecordingState.CARD_FULL}, "NOT RECORDING: the card is full"),
    ({"elapsed_s": 0.0, "ticks": 1}, "recording 0 min, 25 Hz, all well"),
    ({"elapsed_s": 1.0, "ticks": 2, "rate_Hz": 1.0}, "recording 0 min, 1 Hz, all well"),
])  # fmt: skip
def test_the_summary_and_the_verdict_agree(changes, expected):
    now = status(**changes)
    assert now.summary == expected
    assert now.well is expected.endswith("all well") and now.message.well is now.well and now.message.text == expected
    if now.age_s <= 3.0 and now.state is not RecordingState.CARD_FULL:
        assert now.line.endswith("; all well") is now.well


def test_missed_ticks_are_reported_for_ten_seconds():
    missed = MissedTicks(40_000_000)
    missed.add(GridTick(100, 0, 3), 4 * SECOND_NS)
    assert missed.recent(4 * SECOND_NS) == 3
    missed.add(GridTick(250, 0, 2), 10 * SECOND_NS)
    assert [missed.recent(at_s * SECOND_NS) for at_s in (10, 14, 15, 20, 21)] == [5, 5, 2, 2, 0]


def test_a_stall_is_reported_on_the_page_and_in_the_log_and_forgotten_after_ten_seconds(tmp_path):
    """The tray hangs for six seconds; the daemon sees a computer that was busy as a clock that jumps."""
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    tray = default_tray(tmp_path, fake)
    sources = sources_of(tray, tmp_path / "status.json")
    file, start_ns = StatusFile(sources.status), clock.now_ns()
    pages, stalled = {}, []

    def report(now):
        file.write(now)
        pages[round(now.elapsed_s)] = page(sources, sources.status.stat().st_mtime)
        if now.elapsed_s > 5 and not stalled:
            stalled.append(now)
            clock.sleep_until_ns(clock.now_ns() + 6 * SECOND_NS)

    result = record(tray, buses=fake, clock=clock, until_ns=start_ns + 30 * SECOND_NS, report=report)
    assert 148 <= result.missed <= 151
    states = {round((e.time_ns - clock.unix_ns() + clock.now_ns() - start_ns) / 1e9): e.message
              for e in read_log(result.path).entries["/daq/state"]}  # fmt: skip
    assert states[5].well and 'class="good"' in pages[5]
    after = [at_s for at_s in states if 11 < at_s <= 21]
    assert after and all(not states[at_s].well and "ticks missed in 10 s" in states[at_s].text for at_s in after)
    assert all("ticks missed in 10 s" in pages[at_s] and '<h1 class="bad">' in pages[at_s] for at_s in after)
    assert "missed in" not in states[max(states)].text and "missed in" not in pages[max(pages)]


def test_an_arm_switch_that_nothing_moves_is_reported():
    """The switch is channel 9 of 8, or a channel without pulses while others have them. No signal at all is another
    matter."""
    switch = ArmSwitch(ArmSwitchConfig(channel=9, action="record"))

    def on_cycle(at_s, *pulses):
        controls = Controls(stick_pulse_us=list(pulses))
        return [event.text for event in switch.update([Sample("/controls", round(at_s * SECOND_NS), controls)])]

    assert on_cycle(0, *[0] * 8) == on_cycle(9, *[0] * 8) == [] and not switch.trouble
    assert on_cycle(10, *[1500] * 8) == on_cycle(11.9, *[1500] * 8) == [] and not switch.trouble
    assert on_cycle(12, *[1500] * 8) == ["arm switch: no pulse on channel 9: correct [arm]"] == switch.trouble
    assert on_cycle(13, *[1500] * 8, 0) == [] and switch.trouble
    assert on_cycle(14, *[1500] * 8, 1900) == ["armed"] and not switch.trouble


def test_an_arm_switch_on_a_channel_that_is_not_there_is_not_all_well(tmp_path):
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    text = default_tray(tmp_path, fake).text + '\n[arm]\nchannel = 16\naction = "record"\nseen_at = "receiver"\n'
    seen = []
    record(
        parse_tray(text, "tray.toml", tmp_path), buses=fake, clock=clock, until_ns=clock.now_ns() + 6 * SECOND_NS,
        report=seen.append,
    )  # fmt: skip
    assert seen[-1].state is RecordingState.WAITING and not seen[-1].well
    assert "no pulse on channel 16" in seen[-1].summary


def test_the_link_tells_of_a_daemon_that_is_silent(monkeypatch):
    monkeypatch.setattr("flightpower.daq.telemetry.NO_NEWS_S", 0.05)
    monkeypatch.setattr("flightpower.daq.telemetry.HEARTBEAT_PERIOD_S", 0.05)
    read_end, write_end = os.pipe()
    lines = newest_lines(read_end)
    os.write(write_end, b"one\ntwo\nth")
    assert [next(lines), next(lines), next(lines)] == [[b"one", b"two"], [], []]
    os.write(write_end, b"ree\n")
    assert next(lines) == [b"three"]
    os.close(write_end)
    assert list(lines) == []
    os.close(read_end)
    last = Snapshot(elapsed_s=100.0, status=status(), bits=SensorBits(LOGGING_BIT | 1, LOGGING_BIT | 1))
    first = without_news(last, 3.5)
    second = without_news(first, 4.5)
    assert (first.elapsed_s, second.elapsed_s) == (103.5, 104.5)
    assert not first.status.well and second.status.summary == "No news from the daemon for 4 s"
    assert second.bits == (LOGGING_BIT | 1, 1)
