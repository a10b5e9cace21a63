"""The physical inputs of the sensors, which are the interface between the simulator and the fake hardware."""

from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from flightpower.flight.arrays import Array


class GpsSolution(NamedTuple):
    """What a GPS receiver reports at each requested time; arrays of shape (n,) unless stated."""

    valid_at_s: Array  # time of validity: the requested time minus the latency
    fix: NDArray[np.bool_]
    latitude_deg: Array
    longitude_deg: Array
    height_msl_m: Array
    velocity_ned_mps: Array  # (n, 3)
    horizontal_accuracy_m: Array
    vertical_accuracy_m: Array
    speed_accuracy_mps: Array


class SensorTruth(Protocol):
    """Physical input of every sensor as a function of the time `t_s` (n,) since the start, including errors and noise.

    Equal times give equal values: noise is a function of seed, channel and sample time. Outside [0, duration_s] the
    aircraft stays at its first or last state.
    """

    duration_s: float

    def imu(self, t_s: Array) -> tuple[Array, Array]:
        """Specific force [m/s^2] (n, 3) and angular rate [rad/s] (n, 3) in the sensor's axes."""

    def imu_temperature_K(self, t_s: Array) -> Array: ...

    def magnetic_field_T(self, t_s: Array) -> Array:
        """Flux density in body axes (n, 3)."""

    def absolute_pressure_Pa(self, which: str, t_s: Array) -> Array:
        """`which`: "baro" (inside the fuselage) or "static" (the probe's static line)."""

    def differential_pressure_Pa(self, which: str, t_s: Array) -> Array:
        """`which`: "alpha" (lower minus upper), "beta" (right minus left), "airspeed" (center minus static)."""

    def transducer_temperature_K(self, which: str, t_s: Array) -> Array:
        """Temperature of "baro", "static", "alpha", "beta" or "airspeed"."""

    def gps(self, t_s: Array) -> GpsSolution: ...

    def motor_speed_revps(self, t_s: Array) -> Array: ...

    def servo_pulses_us(self, t_s: Array) -> Array:
        """Pulse widths (n, 8) of servo outputs 1 to 8, as the autopilot reports them."""

    def autopilot_attitude_rad(self, t_s: Array) -> Array:
        """Roll, pitch, yaw (n, 3) as estimated by the autopilot, which takes the vertical from the accelerometer."""

    def battery(self, t_s: Array) -> tuple[Array, Array]:
        """Voltage [V] and current [A], each (n,)."""
