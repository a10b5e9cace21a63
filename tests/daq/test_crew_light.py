"""The crew's light: what the lamp says, and that a button begins a new log once."""

import threading
import time
from itertools import pairwise
from types import SimpleNamespace

import pytest
from test_daemon import SteadySensorTruth, default_tray
from test_recording_status import status

from flightpower.daq import gpio
from flightpower.daq.config import LightConfig, parse_tray
from flightpower.daq.crew_light import STEP_S, CrewLight, Light, light_of
from flightpower.daq.daemon import record
from flightpower.daq.recording_status import RecordingState
from flightpower.daq.systemd_unit import unit_drop_in
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import read_log
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.gpio import FakeGpioChip
from flightpower.hw_fakes.tray import FakeTray

CHIP, LED, BUTTON = "/dev/gpiochip0", 17, 27
GIVE_UP_S = 60.0  # generous, because the machine may be busy


@pytest.fixture
def chip(monkeypatch):
    fake = FakeGpioChip(CHIP)
    names = {"open": fake.open, "close": fake.close, "O_RDWR": gpio.os.O_RDWR, "O_CLOEXEC": gpio.os.O_CLOEXEC}
    monkeypatch.setattr(gpio, "os", SimpleNamespace(**names))
    monkeypatch.setattr(gpio, "fcntl", SimpleNamespace(ioctl=fake.ioctl))
    return fake


def wait_for(condition):
    deadline = time.monotonic() + GIVE_UP_S
    while not condition():
        assert time.monotonic() < deadline, "waited in vain"
        time.sleep(0.01)


@pytest.mark.parametrize(("changes", "age_s", "light"), [
    ({}, 0.0, Light.RECORDING),
    ({}, 3.1, Light.FAULT),  # the sampling hangs
    ({"state": RecordingState.WAITING}, 0.0, Light.WAITING),
    ({"state": RecordingState.WAITING, "trouble": ["supply"]}, 0.0, Light.FAULT),
    ({"state": RecordingState.CARD_FULL}, 0.0, Light.FAULT),
    ({"error": "Input/output error"}, 0.0, Light.FAULT),
])  # fmt: skip
def test_the_lamp_says_what_the_page_says(changes, age_s, light):
    assert light_of(status(**changes), age_s) is light
    assert light_of(None, 0.0) is Light.FAULT


def test_three_patterns_are_distinguished_within_two_seconds_and_none_of_them_stands_still():
    steps = [i * STEP_S for i in range(round(2 / STEP_S))]
    changes = {}
    for light in Light:
        shown = [light.lit(at_s + 100.0) for at_s in steps]
        changes[light] = sum(a != b for a, b in pairwise(shown))
        assert any(shown) and not all(shown)
        changes[light] = changes[light], sum(shown) * STEP_S
    assert changes[Light.FAULT][0] >= 15 > 2 >= changes[Light.RECORDING][0]
    assert changes[Light.RECORDING][1] == pytest.approx(1.0, abs=STEP_S)
    assert changes[Light.WAITING][1] == pytest.approx(0.1, abs=1.5 * STEP_S)


def test_the_lamp_blinks_and_is_off_at_the_end(chip):
    light = CrewLight(LightConfig(led=LED), on_press=lambda: None)
    wait_for(lambda: len(chip.driven.get(LED, [])) > 6)  # no status yet: a fault
    begun = len(chip.driven[LED])
    light.show(status(state=RecordingState.WAITING))
    wait_for(lambda: len(chip.driven[LED]) > begun)
    light.close()
    assert chip.driven[LED][-1] is False and set(chip.driven) == {LED} and not light.events()


def test_a_press_of_the_button_is_one_new_log_however_long_it_lasts(chip, monkeypatch):
    pressed, looks, look = [], [], gpio.GpioLine.get
    monkeypatch.setattr(gpio.GpioLine, "get", lambda line: looks.append(line) or look(line))

    def wait_for_looks():
        enough = len(looks) + 4  # two looks see a change that is no bounce
        wait_for(lambda: len(looks) >= enough)

    light = CrewLight(LightConfig(led=LED, button=BUTTON), on_press=lambda: pressed.append(1))
    wait_for(lambda: LED in chip.driven)
    for count in (1, 2):
        chip.grounded.add(BUTTON)
        wait_for(lambda count=count: len(pressed) >= count)
        wait_for_looks()
        chip.grounded.clear()
        wait_for_looks()
    light.close()
    assert len(pressed) == 2
    assert [e.text for e in light.events()] == ["the button was pressed: a new log begins"] * 2


@pytest.mark.parametrize(("config", "expected"), [
    ({"led": 60}, "Invalid argument"),
    ({"led": LED, "chip": "/dev/gpiochip9"}, "No such file or directory"),
    ({"led": LED, "button": LED}, "Device or resource busy"),
])  # fmt: skip
def test_a_light_that_cannot_be_had_is_reported(chip, config, expected):
    light = CrewLight(LightConfig(**config), on_press=lambda: None)
    light._thread.join(GIVE_UP_S)
    (event,) = light.events()
    assert event.severity == "warning" and expected in event.text
    light.close()


def test_a_chip_that_fails_in_flight_costs_the_light(chip):
    light = CrewLight(LightConfig(led=LED), on_press=lambda: None)
    wait_for(lambda: LED in chip.driven)
    chip.failing = True
    light._thread.join(GIVE_UP_S)
    assert [event.severity for event in light.events()] == ["warning"]


def test_a_recording_shows_its_state_and_logs_the_button(chip, tmp_path):
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    text = default_tray(tmp_path, fake).text + f"\n[light]\nled = {LED}\nbutton = {BUTTON}\n"
    tray = parse_tray(text, "tray.toml", tmp_path)
    new_file = threading.Event()
    light = CrewLight(tray.light, on_press=new_file.set)
    chip.grounded.add(BUTTON)
    wait_for(new_file.is_set)
    result = record(
        tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 5 * 10**9, new_file=new_file, light=light
    )  # fmt: skip
    assert light_of(light._status[0], 0.0) is Light.RECORDING
    light.close()
    assert len(result.paths) == 2
    texts = [e.message.text for path in result.paths for e in read_log(path).entries["/daq/event"]]
    assert "the button was pressed: a new log begins" in texts
    assert "DeviceAllow=char-gpiochip rw" in unit_drop_in(tray)
    with pytest.raises(InputError, match="led and button are both line 17"):
        parse_tray(text.replace(f"button = {BUTTON}", f"button = {LED}"), "tray.toml", tmp_path)
