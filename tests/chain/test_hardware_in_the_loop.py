"""The installed, unmodified `daq run` in another process, in real time, on device files: FUSE for I2C, pseudo-terminals
for the serial lines. What it recorded of the buses is then played back. Skips, saying why, only where there is no FUSE.
"""

import subprocess
import sys
import sysconfig
import time
from contextlib import ExitStack
from pathlib import Path

import pytest

from daq.config import load_tray
from daq.driver_factory import driver_factory
from flight.aircraft import load_aircraft
from flight.log_reader import read_log
from flight.messages import Status
from hw_fakes.fuse_i2c import UNAVAILABLE, FuseI2C
from hw_fakes.pty import PtyServer
from hw_fakes.replay import load_recording, replay
from hw_fakes.tray import I2C_BUS, PORTS, FakeTray

sys.path.append(str(Path(__file__).parents[1] / "hw_fakes"))
from analytic_felt import AnalyticFelt, constant

EXAMPLE = Path(__file__).parents[2] / "daq" / "tray.example.toml"
DAQ = Path(sysconfig.get_path("scripts")) / "daq"
BAUDS = {"gps": 38400, "esc_counter": 115200, "autopilot": 57600}
FORCE_MPS2, DIFFERENCE_PA, STATIC_PA, MOTOR_REVPS = [0.5, 0.2, -9.7], 120.0, 98_500.0, 90.0


class RealClock:
    def now_ns(self):
        return time.monotonic_ns()


@pytest.mark.parametrize("seconds", [4, pytest.param(60, marks=pytest.mark.slow)])
def test_the_installed_daemon_records_from_device_files(tmp_path, seconds):
    felt = AnalyticFelt(
        force_mps2=constant(FORCE_MPS2),
        differential_Pa=constant(DIFFERENCE_PA),
        absolute_Pa=constant(STATIC_PA),
        motor_revps=constant(MOTOR_REVPS),
    )
    fake = FakeTray(felt, RealClock(), 4)
    text = EXAMPLE.read_text()
    with ExitStack() as stack:
        try:
            bus = stack.enter_context(FuseI2C(fake.i2c(I2C_BUS), tmp_path / "i2c-1"))
        except OSError as error:
            if error.errno not in UNAVAILABLE:
                raise
            pytest.skip(f"no FUSE here: {error}")
        text = text.replace(f'"{I2C_BUS}"', f'"{bus.path}"')
        for name, device in PORTS.items():
            line = stack.enter_context(PtyServer(fake.port(device, BAUDS[name])))
            text = text.replace(f'"{device}"', f'"{line.path}"')
        (tmp_path / "tray.toml").write_text(text)
        command = [DAQ, "run", "--config", tmp_path / "tray.toml", "-o", tmp_path / "log.mcap"]
        outcome = subprocess.run(
            [*command, "--record-bus", tmp_path / "bench.jsonl", "--duration", str(seconds)],
            capture_output=True,
            text=True,
            timeout=seconds + 30,
        )
    assert outcome.returncode == 0, outcome.stderr
    log = read_log(tmp_path / "log.mcap")
    ticks = log.entries["/daq/tick"]
    accounted = len(ticks) + sum(entry.message.missed for entry in ticks)
    assert accounted == ticks[-1].tick + 1
    assert 25 * (seconds - 1.5) <= accounted <= 25 * seconds + 1  # opening the tray comes out of the same time

    def good(topic):
        return [e.message for e in log.entries[topic] if e.message.status is Status.OK]

    for topic, per_s in {
        "/imu": 25,
        "/mag": 25,
        "/baro": 24,
        "/static": 24,
        "/probe/alpha": 25,
        "/probe/beta": 25,
        "/probe/airspeed": 25,
        "/gps": 10,
        "/rpm": 25,
        "/controls": 25,
    }.items():
        # Bringing up takes up to 1.5 s; on a busy machine ticks are missed, which is said in /daq/tick.
        assert len(good(topic)) >= 0.8 * per_s * (seconds - 2.5), (topic, outcome.stderr)
    imu = good("/imu")[-1]
    assert [imu.specific_force_x_mps2, imu.specific_force_y_mps2, imu.specific_force_z_mps2] == pytest.approx(
        FORCE_MPS2, abs=9.80665 / 4096
    )
    assert good("/probe/alpha")[-1].differential_pressure_Pa == pytest.approx(DIFFERENCE_PA, abs=2 * 498.2 / 13107)
    assert good("/static")[-1].pressure_Pa == pytest.approx(STATIC_PA, abs=0.1)
    assert good("/rpm")[-1].motor_speed_revps == pytest.approx(MOTOR_REVPS, rel=1e-4)

    recording = load_recording(tmp_path / "bench.jsonl")
    tray, nexstar = load_tray(tmp_path / "tray.toml"), load_aircraft("nexstar")
    for table in tray.sensors:
        turns = replay(recording, table.name, lambda buses, table=table: driver_factory(table, tray, buses, nexstar)())
        played = [sample for turn in turns for sample in turn.samples]
        for topic in table.topics:
            # What came after its tick's deadline is not in the log.
            again = [s.message for s in played if s.topic == topic and s.message.status is Status.OK]
            assert len(good(topic)) <= len(again) and good(topic)[-1] in again, topic
