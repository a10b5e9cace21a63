import pytest
from analytic_sensor_truth import AnalyticSensorTruth

from flightpower.hw_fakes.clock import SimulatedClock
from flightpower.hw_fakes.tray import FakeTray, TrayVariant


@pytest.fixture
def clock():
    return SimulatedClock(start_ns=5_000_000_000)


@pytest.fixture
def powered(clock):
    """A function that makes a tray on an `AnalyticSensorTruth`, half a second after power-on."""

    def make(seed=1, after_s=0.5, **functions):
        options = {
            k: functions.pop(k) for k in ("rpm_with_crc", "pole_pairs", "geoid_m", "gps_on_i2c") if k in functions
        }
        tray = FakeTray(
            AnalyticSensorTruth(**functions), clock, seed, variant=TrayVariant(powered_for_s=0.0, **options)
        )
        clock.advance_ns(round(after_s * 1e9))
        return tray

    return make


@pytest.fixture
def bus_of(powered):
    """A function that makes such a tray and returns its I2C bus."""
    return lambda **functions: powered(**functions).i2c("/dev/i2c-1")
