"""Makes the fake parts as on the ground: at rest, probe covered, motor off."""

import time
from datetime import UTC, datetime

from analytic_sensor_truth import AnalyticSensorTruth, constant

from flightpower.hw_fakes.tray import FakeTray, TrayVariant

SEED = 1003


class RealClock:
    def now_ns(self) -> int:
        return time.monotonic_ns()


def parts_at_rest() -> FakeTray:
    """Return all parts of the tray, in real time."""
    truth = AnalyticSensorTruth(
        velocity_mps=constant([0.0, 0.0, 0.0]), motor_revps=constant(0.0), attitude_rad=constant([0.0, 0.0, 0.0])
    )
    return FakeTray(truth, RealClock(), SEED, variant=TrayVariant(utc_at_start=datetime.now(UTC)))
