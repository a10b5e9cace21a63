"""The fake bus as a device file: smbus2, unmodified, in another process, through the kernel's ioctl path."""

import json
import subprocess
import sys
import time
from pathlib import Path

import pytest
from analytic_sensor_truth import AnalyticSensorTruth

from flightpower.hw_fakes.fuse_i2c import UNAVAILABLE, FuseI2C
from flightpower.hw_fakes.tray import FakeTray

CLIENT = Path(__file__).with_name("smbus_client.py")


class RealClock:
    def now_ns(self):
        return time.monotonic_ns()


@pytest.fixture
def device(tmp_path):
    bus = FakeTray(AnalyticSensorTruth(), RealClock()).i2c("/dev/i2c-1")
    try:
        served = FuseI2C(bus, tmp_path / "i2c-1")
    except OSError as error:
        if error.errno not in UNAVAILABLE:
            raise
        pytest.skip(f"no FUSE here: {error}")
    with served:
        yield served.path


def test_smbus2_in_another_process(device):
    outcome = subprocess.run([sys.executable, CLIENT, device], capture_output=True, text=True, timeout=120)
    assert outcome.returncode == 0, outcome.stderr
    seen = json.loads(outcome.stdout)
    assert seen["who_am_i"] == 0x71
    assert seen["kept"] == [4, 3]
    assert seen["bridge_counts"] in (8191, 8192)  # no pressure is the middle, 50 % of 16383
    assert seen["absent"] == 121
    assert seen["longest"] == 504
    assert seen["quickest_transfer_s"] >= 17 * 9 / 400e3  # 17 bytes of nine bits at 400 kHz
