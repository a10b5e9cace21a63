"""Low supply voltage and a hot processor are reported while they last, on the page and in the log."""

import pytest
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq import daemon
from flightpower.daq.computer_watch import ComputerWatch, read_computer
from flightpower.daq.daemon import record
from flightpower.daq.recording_status import StatusFile
from flightpower.daq.status_page import page, sources_of
from flightpower.flight.log_reader import read_log
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray

FIRMWARE = "devices/platform/soc/soc:firmware/get_throttled"


@pytest.fixture
def sysfs(tmp_path):
    """Files of a Pi in good order, at 48 °C."""
    root = tmp_path / "sys"
    for name, text in {FIRMWARE: "0", "class/thermal/thermal_zone0/temp": "48312"}.items():
        (root / name).parent.mkdir(parents=True, exist_ok=True)
        (root / name).write_text(text + "\n")
    return root


def with_voltage_driver(sysfs, alarm: str):
    monitor = sysfs / "class/hwmon/hwmon1"
    monitor.mkdir(parents=True, exist_ok=True)
    (monitor / "name").write_text("rpi_volt\n")
    (monitor / "in0_lcrit_alarm").write_text(f"{alarm}\n")


def test_what_the_computer_says(sysfs, tmp_path):
    assert read_computer(tmp_path / "none") == (None, None, None)
    assert read_computer(sysfs) == (False, False, pytest.approx(321.462))
    for bits, low, slowed in (("1", True, False), ("50000", False, False), ("50005", True, True), ("8", False, True)):
        (sysfs / FIRMWARE).write_text(f"{bits}\n")  # hexadecimal; bits from 16 on are what occurred since power-on
        assert read_computer(sysfs)[:2] == (low, slowed)
    (sysfs / FIRMWARE).write_text("nonsense\n")
    assert read_computer(sysfs)[:2] == (None, None)
    with_voltage_driver(sysfs, "1")
    assert read_computer(sysfs).supply_low is True
    with_voltage_driver(sysfs, "0")
    assert read_computer(sysfs).supply_low is False


def test_a_dip_is_reported_once_and_for_ten_seconds(sysfs):
    watch = ComputerWatch(sysfs)
    messages = {}
    for second in range(30):
        (sysfs / FIRMWARE).write_text("1" if second == 5 else "10000")
        watch.check(float(second))
        messages[second] = (watch.trouble, [event.text for event in watch.events()])
    assert [second for second, (trouble, _) in messages.items() if trouble] == list(range(5, 15))
    events = {second: events for second, (_, events) in messages.items() if events}
    assert events == {
        5: ["the supply is below 4.63 V"], 15: ["supply and heat of the computer are in order again"],
    }  # fmt: skip


@pytest.mark.parametrize(("milli_celsius", "hot"), [("79900", False), ("80100", True)])
def test_heat_is_reported_where_the_firmware_begins_to_slow_down(sysfs, milli_celsius, hot):
    (sysfs / "class/thermal/thermal_zone0/temp").write_text(milli_celsius)
    watch = ComputerWatch(sysfs)
    watch.check(0.0)
    assert watch.trouble == (["the processor is hot or slowed down, 80 °C"] if hot else [])


def test_an_undervoltage_in_flight_is_in_state_page_and_log_within_five_seconds(sysfs, tmp_path, monkeypatch):
    monkeypatch.setattr(daemon, "ComputerWatch", lambda: ComputerWatch(sysfs))
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    tray = default_tray(tmp_path, fake)
    sources = sources_of(tray, tmp_path / "status.json")
    file, states, pages = StatusFile(sources.status), {}, {}

    def report(now):
        file.write(now)
        states[round(now.elapsed_s)] = now
        pages[round(now.elapsed_s)] = page(sources, sources.status.stat().st_mtime)
        (sysfs / FIRMWARE).write_text("50005" if 3 <= now.elapsed_s < 5 else "50000")

    result = record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 25 * 10**9, report=report)
    assert states[2].trouble == [] and states[2].well
    assert not states[8].well and "the supply is below 4.63 V" in states[8].summary and "48 °C" in pages[8]
    assert "the supply is below 4.63 V" in pages[8] and '<h1 class="bad">' in pages[8]
    assert states[24].trouble == []
    log = read_log(result.path)
    assert [e.message.supply_low for e in log.entries["/daq/state"]][2:7] == [False, False, True, True, False]
    assert log.entries["/daq/state"][0].message.processor_temperature_K == pytest.approx(321.462)
    assert any(e.message.text == "the supply is below 4.63 V" for e in log.entries["/daq/event"])
