"""With `--no-hardware` the log is written directly; it is compared with the daemon's log, message by message."""

from pathlib import Path

import numpy as np
import pytest

from flightpower.flight.log_reader import Log, read_log
from flightpower.hw_fakes.direct_log import BRIDGE_KELVIN, BRIDGES, FIRST_TICK, IMU, MAG_T
from flightpower.simulate import fly

pytestmark = pytest.mark.xdist_group("chain")

PASCAL = {f"/probe/{name}": 2 * p.range_Pa / (p.high_counts - p.low_counts) for name, p in BRIDGES.items()}
# One count of each part in the units of its message; parts not listed must agree exactly.
COUNT = {
    "/imu": {"specific_force": IMU.accel_count_mps2, "angular_rate": IMU.gyro_count_radps, "temperature_K": 1 / 333.87},
    "/mag": {"field": MAG_T},
    # The size of a barometer count follows from its coefficients: 0.02 Pa, 1e-4 K.
    "/baro": {"pressure_Pa": 0.02, "temperature_K": 1e-4},
    "/static": {"pressure_Pa": 0.02, "temperature_K": 1e-4},
    **{topic: {"differential_pressure_Pa": per, "temperature_K": BRIDGE_KELVIN} for topic, per in PASCAL.items()},
    "/gps": {"latitude_deg": 1e-7, "longitude_deg": 1e-7, "height": 1e-3, "velocity": 1e-3, "accuracy": 1e-3},
    "/rpm": {"motor_speed_revps": 0.02},  # a microsecond of the 10 ms at full speed
    "/attitude": {"rad": 1e-6},
    "/controls": {"rad": np.deg2rad(0.1), "throttle": 1e-3},  # a microsecond
    "/battery": {"voltage_V": 4e-3, "current_A": 0.01},  # a millivolt a cell
    "/time": {},
}
# Messages on a line that others use as well: once a second one is late for its tick, behind longer messages, and two
# ticks later the daemon takes the newer one.
LATE = {"/controls": 0.05}


@pytest.fixture(scope="module")
def logs(flown: Path, tmp_path_factory: pytest.TempPathFactory) -> list[Log]:
    """The demonstration flight, recorded by the daemon and written directly."""
    straight = tmp_path_factory.mktemp("straight") / "demo"
    fly(straight, plan="demo", no_hardware=True)
    return [read_log(folder / "log.mcap") for folder in (flown, straight)]


def test_the_same_topics_and_luggage(logs):
    recorded, straight = logs
    assert set(recorded.entries) - set(straight.entries) == {"/daq/tick", "/daq/event", "/daq/state"}
    assert set(straight.entries) == set(COUNT)
    assert straight.attachments == recorded.attachments
    assert straight.metadata == recorded.metadata


@pytest.mark.parametrize("topic", COUNT)
def test_every_message_is_the_same_to_within_a_count(logs, topic):
    recorded, straight = (
        {entry.tick: entry for entry in log.entries[topic] if entry.tick >= FIRST_TICK} for log in logs
    )
    assert len(straight) > 100 and not set(recorded) - set(straight)
    assert len(set(straight) - set(recorded)) <= LATE.get(topic, 0.0) * len(straight)
    for tick, entry in recorded.items():
        other = straight[tick]
        assert entry.time_ns == other.time_ns
        assert entry.message.status == other.message.status
        for name in entry.message.__struct_fields__:
            item, two = getattr(entry.message, name), getattr(other.message, name)
            if name == "stick_pulse_us" or isinstance(item, str):
                continue
            if item is None or two is None:
                assert item is two, f"{name} in tick {tick}"
                continue
            count = 1.0 if name.endswith(("counts", "_us")) else 0.0
            count = next((size for part, size in COUNT[topic].items() if part in name), count)
            off = np.max(np.abs(np.subtract(item, two)))
            assert off <= count * (1 + 1e-6), f"{name} in tick {tick}: {item}, {two}"
