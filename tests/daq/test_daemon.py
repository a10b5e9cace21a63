"""The daemon end to end: the default tray of fake parts, a simulated clock, a log that is read back."""

import json
import os
import signal
import subprocess
import sys
import time
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from scripted_parts import HandClock

from flightpower.daq.config import parse_tray
from flightpower.daq.daemon import NoDeviceOpened, record
from flightpower.daq.log_list import list_logs
from flightpower.daq.log_summary import summarize
from flightpower.daq.sensors import ublox as ublox_driver
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import CUT, read_log
from flightpower.flight.messages import SECOND_TOPICS, TYPE_OF_TOPIC, Status, schema_of
from flightpower.hw_fakes import ublox as ublox_fake
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray
from flightpower.sim.sensor_truth import GpsSolution

EXAMPLE = Path(__file__).parents[2] / "daq" / "tray.example.toml"
SECONDS = 20


class SteadySensorTruth:
    """Everything is constant and nothing is symmetric, so a wrong sign or axis shows."""

    duration_s = 1e9
    force, rate = (0.5, 0.2, -9.7), (0.1, -0.2, 0.3)
    field = (20e-6, 3e-6, 40e-6)
    pressure = {"baro": 99_000.0, "static": 98_500.0}  # noqa: RUF012
    difference = {"alpha": 120.0, "beta": -45.0, "airspeed": 310.0}  # noqa: RUF012
    pulses = (1500.0, 1750.0, 1400.0, 1500.0, 1000.0, 1000.0, 1000.0, 1000.0)

    def _rows(self, t_s, *values):
        return np.tile(np.array(values, dtype=float), (len(t_s), 1))

    def imu(self, t_s):
        return self._rows(t_s, *self.force), self._rows(t_s, *self.rate)

    def imu_temperature_K(self, t_s):
        return np.full(len(t_s), 305.0)

    def magnetic_field_T(self, t_s):
        return self._rows(t_s, *self.field)

    def absolute_pressure_Pa(self, which, t_s):
        return np.full(len(t_s), self.pressure[which])

    def differential_pressure_Pa(self, which, t_s):
        return np.full(len(t_s), self.difference[which])

    def transducer_temperature_K(self, which, t_s):
        return np.full(len(t_s), 290.0)

    def gps(self, t_s):
        item = np.ones(len(t_s))
        velocity = self._rows(t_s, 12.0, -3.0, 0.5)
        return GpsSolution(t_s, item > 0, 48 * item, 11 * item, 450 * item, velocity, item, 2 * item, 0.3 * item)

    def motor_speed_revps(self, t_s):
        return np.full(len(t_s), 120.0)

    def servo_pulses_us(self, t_s):
        return self._rows(t_s, *self.pulses)

    def autopilot_attitude_rad(self, t_s):
        return self._rows(t_s, 0.1, -0.05, 2.0)

    def battery(self, t_s):
        return np.full(len(t_s), 14.8), np.full(len(t_s), 21.5)


def default_tray(tmp_path, fake, **replacements):
    """The example tray, with logs in tmp_path and each line at the speed of the fake at its end."""
    text = EXAMPLE.read_text()
    for device, part in fake.serial_devices.items():
        head, result, tail = text.partition(f'port = "{device}"')
        assert result
        before, _, after = tail.partition("baud = ")
        text = head + result + before + f"baud = {part.baud}\n" + after.partition("\n")[2]
    for old, new in replacements.items():
        text = text.replace(old, new)
    return parse_tray(text, "tray.toml", tmp_path)


def fly(tmp_path, seconds=SECONDS, **options):
    clock = SimulatedClock(start_ns=3_000_000_000, unix_at_start_ns=1_700_000_000_000_000_000)
    fake = FakeTray(SteadySensorTruth(), clock)
    tray = default_tray(tmp_path, fake)
    return record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + seconds * 10**9, **options)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    path = tmp_path_factory.mktemp("flight")
    (path / "probe.json").write_text('{"kind": "five-port"}')
    recording = fly(path)
    return recording, read_log(recording.path)


def good(log, topic):
    return [e.message for e in log.entries[topic] if e.message.status is Status.OK]


def test_every_tick_is_there_and_counted(flight):
    recording, log = flight
    assert (recording.ticks, recording.missed, recording.write_error) == (SECONDS * 25, 0, "")
    assert [entry.tick for entry in log.entries["/daq/tick"]] == list(range(SECONDS * 25))
    assert recording.path.name == "log-0001_2016-05-14_093000Z.mcap"  # the satellites' time, the clock says 2023


def test_logs_are_listed_by_the_satellites_time(flight, tmp_path):
    recording, _ = flight
    content = recording.path.read_bytes()
    (tmp_path / "log-0002.mcap").write_bytes(content)
    (tmp_path / "log-0003.mcap").write_bytes(content[:-9])
    (tmp_path / "log-0004.mcap").write_bytes(content[: len(content) // 2] + content[-30:])
    logs = list_logs(tmp_path)
    assert [log.state.partition(":")[0] for log in logs] == [
        "complete",
        CUT,
        "cannot be read",
    ]
    assert logs[1].state == f"{CUT}: {logs[1].duration_s:.1f} s read"
    assert f"the file is {CUT}: {read_log(logs[1].path).duration_s:.1f} s read" in summarize(logs[1].path).lines
    assert logs[0].by_satellites and f"{logs[0].begin:%Y-%m-%d %H:%M}" in ("2016-05-14 09:29", "2016-05-14 09:30")
    assert logs[0].duration_s == pytest.approx(SECONDS, abs=0.1)
    assert logs[1].by_satellites and logs[1].begin == logs[0].begin
    (tmp_path / "log-0005.mcap").write_bytes(content[: len(content) // 2])
    (tmp_path / "log-0006.mcap").write_bytes(content[: len(content) // 2].replace(b"/time", b"/tim\xff", 1))
    early, damaged = list_logs(tmp_path)[-2:]
    assert early.by_satellites and abs(early.begin - logs[0].begin) < timedelta(milliseconds=100)
    assert early.duration_s < 0.9 * logs[0].duration_s
    assert not damaged.by_satellites and damaged.begin.year == 2023 and damaged.state.startswith(CUT)
    assert any("2016-05-14 09:" in line and "satellites' time" in line for line in summarize(recording.path).lines)


def test_every_topic_is_there_with_its_schema(flight):
    recording, log = flight
    assert set(log.entries) == set(TYPE_OF_TOPIC) - SECOND_TOPICS - {"/analog"}
    from mcap.reader import make_reader

    with recording.path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        for channel in summary.channels.values():
            schema = json.loads(summary.schemas[channel.schema_id].data)
            assert schema == schema_of(TYPE_OF_TOPIC[channel.topic])


def test_what_the_parts_felt_is_what_the_log_says(flight):
    """They agree to a count of each part, which is its resolution: quantization is the only error here."""
    _, log = flight
    sensor_truth = SteadySensorTruth()
    imu, mag = good(log, "/imu")[-1], good(log, "/mag")[-1]
    for axis, force, rate, field in zip("xyz", sensor_truth.force, sensor_truth.rate, sensor_truth.field, strict=True):
        assert getattr(imu, f"specific_force_{axis}_mps2") == pytest.approx(force, abs=9.80665 / 4096)
        assert getattr(imu, f"angular_rate_{axis}_radps") == pytest.approx(rate, abs=np.radians(1 / 65.5))
        assert getattr(mag, f"field_{axis}_T") == pytest.approx(field, abs=2 * 4912e-6 / 32760)
    assert imu.temperature_K == pytest.approx(305, abs=0.01)
    for which, pressure_Pa in sensor_truth.pressure.items():
        message = good(log, f"/{which}")[-1]
        assert message.pressure_Pa == pytest.approx(pressure_Pa, abs=1.0)  # 0.01 mbar
        assert message.temperature_K == pytest.approx(290, abs=0.01)
    for which, range_Pa in (("alpha", 498.2), ("beta", 498.2), ("airspeed", 1245.4)):
        message = good(log, f"/probe/{which}")[-1]
        assert message.differential_pressure_Pa == pytest.approx(
            sensor_truth.difference[which], abs=2 * range_Pa / 13107
        )
    gps = good(log, "/gps")[-1]
    assert (gps.velocity_north_mps, gps.velocity_east_mps, gps.velocity_down_mps) == pytest.approx((12, -3, 0.5))
    assert good(log, "/rpm")[-1].motor_speed_revps == pytest.approx(120, rel=1e-4)  # 1 us in 11.9 ms
    controls = good(log, "/controls")[-1]
    assert controls.elevator_rad == pytest.approx(np.radians(10.8)) and controls.throttle == pytest.approx(0.4)
    assert good(log, "/attitude")[-1].pitch_rad == pytest.approx(-0.05)
    battery = good(log, "/battery")[-1]
    assert (battery.voltage_V, battery.current_A) == pytest.approx((14.8, 21.5), abs=0.01)


def test_after_the_first_two_seconds_all_is_well(flight):
    _, log = flight
    start_ns = log.entries["/daq/tick"][0].time_ns
    late = {
        topic: {e.message.status for e in entries if e.time_ns > start_ns + 2 * 10**9}
        for topic, entries in log.entries.items()
    }
    for topic, statuses in late.items():
        assert statuses <= {Status.OK, Status.BUSY} if topic in ("/baro", "/static") else statuses <= {Status.OK}, topic


def test_barometers_lose_about_one_tick_a_second_to_their_temperature(flight):
    _, log = flight
    for topic in ("/baro", "/static"):
        busy = sum(entry.message.status is Status.BUSY for entry in log.entries[topic])
        assert busy == pytest.approx(SECONDS, abs=4)


def test_imu_averages_all_samples_of_its_fifo(flight):
    _, log = flight
    counts = [message.samples for message in good(log, "/imu")]
    # 200 Hz within the part's clock tolerance of a few percent, so 8 a tick on average.
    assert sum(counts) / len(counts) == pytest.approx(8, rel=0.02)
    assert set(counts) <= {7, 8, 9} | set(counts[:2])


def test_the_log_carries_all_that_the_analysis_needs(flight, tmp_path):
    _, log = flight
    assert set(log.attachments) == {"tray.toml", "aircraft.toml", "propeller.csv"}
    assert b"driver" in log.attachments["tray.toml"] and b"span" in log.attachments["aircraft.toml"]
    assert log.attachments["propeller.csv"].startswith(b"#")
    facts = log.metadata["flightpower"]
    assert facts["tick_rate_Hz"] == "25" and facts["aircraft"] == "nexstar" and facts["version"]
    assert int(facts["start_unix_ns"]) == log.entries["/daq/tick"][0].time_ns


@pytest.mark.parametrize(
    ("of", "name"), [("probe", "probe"), ("magnetometer", "magnetometer"), ("transducer", "transducers")]
)
def test_a_calibration_travels_and_a_broken_one_is_refused_before_anything_is_written(tmp_path, of, name):
    (tmp_path / f"{name}.json").write_text('{"kind": "mine"}')
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    tray = default_tray(tmp_path, fake, **{f"# {of}_calibration": f"{of}_calibration"})
    recording = record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 10**8)
    attached = read_log(recording.path).attachments
    assert attached[f"{name}.json"] == b'{"kind": "mine"}'
    assert set(attached) == {"tray.toml", "aircraft.toml", "propeller.csv", f"{name}.json"}
    (tmp_path / f"{name}.json").write_text("[]")
    with pytest.raises(InputError, match=rf"{name}\.json: not a {of} calibration"):
        record(tray, buses=fake, clock=clock, until_ns=clock.now_ns() + 10**8)
    assert [path.name for path in (tmp_path / "logs").iterdir()] == ["log-0001.mcap"]


def test_a_lost_supply_of_the_imu_is_recovered_from_within_two_seconds(tmp_path):
    clock = SimulatedClock()
    fake = FakeTray(SteadySensorTruth(), clock)
    power = {5.0: fake.imu, 5.001: fake.magnetometer, 5.002: fake.baro}

    def progress(elapsed_s):
        for at_s in [at_s for at_s in power if at_s <= elapsed_s]:
            power.pop(at_s).power_cycle(clock.now_ns())

    recording = record(default_tray(tmp_path, fake), buses=fake, clock=clock, until_ns=10 * 10**9, progress=progress)
    assert not power
    log = read_log(recording.path)
    for topic in ("/imu", "/mag", "/baro"):
        bad = [e.tick for e in log.entries[topic] if e.message.status not in (Status.OK, Status.BUSY) and e.tick > 100]
        assert bad and max(bad) - min(bad) < 50, topic
    assert good(log, "/imu")[-1].specific_force_z_mps2 == pytest.approx(-9.7, abs=9.80665 / 4096)


class NoBuses:
    def i2c(self, device):
        raise FileNotFoundError(2, "No such file or directory", device)

    def port(self, device, baud):
        raise FileNotFoundError(2, "No such file or directory", device)


def test_when_nothing_can_be_opened_it_says_so_and_leaves_no_log(tmp_path):
    tray = parse_tray(EXAMPLE.read_text(), "tray.toml", tmp_path)
    with pytest.raises(NoDeviceOpened, match="/dev/i2c-1"):
        record(tray, buses=NoBuses(), clock=HandClock())
    assert not (tmp_path / "logs").exists()


def test_what_is_missing_is_named_before_anything_is_written(tmp_path):
    for text, message in (
        (EXAMPLE.read_text().replace('"nexstar"', '"albatross"'), "albatross"),
        (EXAMPLE.read_text().replace('aircraft = "nexstar"', ""), "pole_pairs"),
    ):
        with pytest.raises(InputError, match=message):
            record(parse_tray(text, "tray.toml", tmp_path), buses=NoBuses(), clock=HandClock())
    assert not (tmp_path / "logs").exists()


def daq(*arguments, **options):
    return subprocess.run(
        [sys.executable, "-m", "flightpower.daq", *map(str, arguments)], capture_output=True, text=True, **options
    )


def test_the_daemon_stays_light():
    heavy = "numpy", "pandas", "scipy", "casadi", "plotly"
    modules = "flightpower.daq.__main__, flightpower.daq.daemon, flightpower.daq.linux_bus, flightpower.daq.log_summary"
    code = f"import sys, {modules}; print([m for m in {heavy} if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_wrong_configurations_leave_with_code_2_and_one_line(tmp_path):
    (tmp_path / "tray.toml").write_text("rate = 3\n")
    for arguments in (["run", "-c", tmp_path / "tray.toml"], ["run", "-c", tmp_path / "no.toml"], ["info", tmp_path]):
        done = daq(*arguments)
        assert done.returncode == 2
        assert len(done.stderr.strip().splitlines()) == 1 and done.stderr.startswith("daq: ")


def test_no_devices_is_a_failure_with_code_1_and_one_line(tmp_path):
    (tmp_path / "tray.toml").write_text('[[sensors]]\ndriver="mpu9250"\nbus="/dev/i2c-no-such"\n')
    done = daq("run", "-c", tmp_path / "tray.toml")
    assert done.returncode == 1
    assert "none of the tray's buses and ports can be opened" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


def test_the_example_checks_and_prints(tmp_path):
    assert daq("config", "--example").stdout == EXAMPLE.read_text()
    assert daq("config", "--check", EXAMPLE).returncode == 0


def test_sigterm_finishes_the_file_and_a_pseudo_terminal_is_a_port(tmp_path):
    """The installed command on a real clock and a real serial line, as far as this machine has them."""
    import pty
    import tty

    master, slave = pty.openpty()
    tty.setraw(slave)
    import os

    tray = tmp_path / "tray.toml"
    tray.write_text(f'[[sensors]]\ndriver="esc_counter"\nport="{os.ttyname(slave)}"\npole_pairs=7\nframed=true\n')
    log = tmp_path / "log.mcap"
    daemon = subprocess.Popen(
        [sys.executable, "-m", "flightpower.daq", "run", "-c", tray, "-o", log], stderr=subprocess.PIPE
    )
    from flightpower.daq.sensors.esc_counter import crc8

    deadline = time.monotonic() + 120  # generous, because the machine may be busy
    sequence = 0
    while not log.exists() or log.stat().st_size < 6000:
        assert time.monotonic() < deadline
        body = bytes([sequence % 256, 0]) + (10714).to_bytes(4, "big")
        os.write(master, b"\xa5" + body + bytes([crc8(body)]))
        sequence += 1
        time.sleep(0.01)
    daemon.send_signal(signal.SIGTERM)
    _, stderr = daemon.communicate(timeout=120)
    os.close(master)
    os.close(slave)
    assert daemon.returncode == 0, stderr
    recorded = read_log(log)
    assert not recorded.torn
    assert {message.period_us for message in good(recorded, "/rpm")} == {10714}
    shown = daq("info", log)
    assert shown.returncode == 0 and "/rpm" in shown.stdout


@pytest.mark.parametrize(("year", "resolved"), [(1, True), (1970, True), (2150, True), (9999, True), (2026, False)])
def test_a_wrong_date_of_the_receiver_names_nothing_and_ends_nothing(tmp_path, monkeypatch, year, resolved):
    """Position and speed are recorded; date and name are those of a clock that nobody has set."""
    pack = ublox_fake.FakeUbloxM8._time
    moment = datetime(year, 1, 1, tzinfo=UTC)
    monkeypatch.setattr(
        ublox_fake.FakeUbloxM8, "_time", lambda self, valid_at_s: (moment, 0, pack(self, valid_at_s)[2])
    )
    if not resolved:
        read = ublox_driver.PVT_TIME.unpack_from

        class Unresolved:
            def unpack_from(self, frame):
                values = list(read(frame))
                values[7] &= ~0x04
                return values

        monkeypatch.setattr(ublox_driver, "PVT_TIME", Unresolved())
    recording = fly(tmp_path, 6)
    log = read_log(recording.path)
    assert recording.ticks == 150 and recording.path.name == "log-0001.mcap"
    assert len(good(log, "/gps")) > 20 and {m.utc_ns for m in good(log, "/gps")} == {None}
    assert {m.gps_utc_ns for m in good(log, "/time")} == {None}


def test_a_folder_whose_name_is_no_text_is_recorded_into(tmp_path):
    """A name of bytes that are not characters appears in events, in the state and on the link."""
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    folder.mkdir()
    seen = []
    recording = fly(folder, 3, report=seen.append, log_path=folder / os.fsdecode(b"\xe9.mcap"))
    assert recording.ticks == 75 and seen[-1].log == "\\udce9.mcap"
    texts = [m.text for m in good(read_log(recording.path), "/daq/event")]
    assert any("caf\\udce9" in text for text in texts)
