"""Each kind of fault costs no tick and no reading of any other sensor. `benchmarks/daemon.py faults` has all faults."""

import pytest
from test_daemon import SteadySensorTruth, default_tray

from flightpower.daq.daemon import record
from flightpower.flight.log_reader import read_log
from flightpower.flight.messages import Status
from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.faults import DEVICES_OF_KIND, I2C_PARTS, Fault
from flightpower.hw_fakes.tray import FakeTray

TOPICS = {
    "imu": {"/imu", "/mag"},  # the magnetometer is in the same package, behind the IMU's bypass
    "magnetometer": {"/mag"},
    "baro": {"/baro"},
    "static": {"/static"},
    "alpha": {"/probe/alpha"},
    "beta": {"/probe/beta"},
    "airspeed": {"/probe/airspeed"},
    "gps": {"/gps"},
    "esc_counter": {"/rpm"},
    "autopilot": {"/controls", "/attitude", "/battery"},
}
ON_THE_BUS = set().union(*(TOPICS[part] for part in I2C_PARTS))
SECONDS, SETTLED_S = 8, 2.5


@pytest.mark.parametrize(
    ("kind", "device"), [(kind, device) for kind, devices in DEVICES_OF_KIND.items() for device in devices[:1]]
)
def test_it_costs_its_own_sensor_only(tmp_path, kind, device):
    clock = SimulatedClock(start_ns=3_000_000_000)
    fault = Fault(kind=kind, device=device, start_s=4.0, duration_s=2.0, rate=0.05)
    fake = FakeTray(SteadySensorTruth(), clock, 2, faults=[fault])
    recording = record(default_tray(tmp_path, fake), buses=fake, clock=clock, until_ns=clock.now_ns() + SECONDS * 10**9)
    log = read_log(recording.path)
    ticks = log.entries["/daq/tick"]
    assert recording.missed == 0 and [entry.tick for entry in ticks] == list(range(SECONDS * 25))
    hit = ON_THE_BUS if kind == "timeout" else TOPICS[device]  # a timeout is that of the whole bus
    for topic, entries in log.entries.items():
        late = [entry for entry in entries if entry.time_ns - ticks[0].time_ns > SETTLED_S * 1e9]
        if topic not in hit:
            assert {entry.message.status for entry in late} <= {Status.OK, Status.BUSY}, topic
