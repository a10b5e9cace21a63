"""Sensor inputs that are plain functions of time, so that a test knows every answer."""

from typing import Any

import numpy as np

from flightpower.flight.arrays import Array
from flightpower.sim.sensor_truth import GpsSolution


def constant(value: Any):
    """A function of instants (n,) giving `value` at each: shape (n,) or (n, m)."""
    return lambda t_s: np.broadcast_to(value, (len(t_s), *np.shape(value))).astype(float)


def ramp(start: float, per_s: float):
    return lambda t_s: start + per_s * t_s


def sine(mean: float, amplitude: float, frequency_Hz: float):
    return lambda t_s: mean + amplitude * np.sin(2 * np.pi * frequency_Hz * t_s)


class AnalyticSensorTruth:
    """Implements `SensorTruth`. Keywords replace the functions of time [s]; one serves all sensors of a kind."""

    duration_s = 3600.0

    def __init__(self, gps_latency_s: float = 0.08, **functions: Any):
        self.gps_latency_s = gps_latency_s
        self.force_mps2 = constant([0.0, 0.0, -9.80665])
        self.rate_radps = constant([0.0, 0.0, 0.0])
        self.imu_K = constant(300.0)
        self.field_T = constant([20e-6, 1e-6, 45e-6])
        self.absolute_Pa = constant(100_000.0)
        self.differential_Pa = constant(0.0)
        self.transducer_K = constant(295.0)
        self.latitude_deg = constant(35.6)
        self.longitude_deg = constant(-78.9)
        self.height_m = constant(150.0)
        self.velocity_mps = constant([10.0, -5.0, 1.0])
        self.fix = constant(1.0)
        self.motor_revps = constant(100.0)
        self.pulses_us = constant([1500.0, 1480.0, 1200.0, 1500.0, 1000.0, 1000.0, 1000.0, 2000.0])
        self.attitude_rad = constant([0.1, 0.05, -2.0])
        self.voltage_V = constant(15.2)
        self.current_A = constant(12.34)
        for name, function in functions.items():
            assert hasattr(self, name), name
            setattr(self, name, function)

    def imu(self, t_s: Array) -> tuple[Array, Array]:
        return self.force_mps2(t_s), self.rate_radps(t_s)

    def imu_temperature_K(self, t_s: Array) -> Array:
        return self.imu_K(t_s)

    def magnetic_field_T(self, t_s: Array) -> Array:
        return self.field_T(t_s)

    def absolute_pressure_Pa(self, which: str, t_s: Array) -> Array:
        return self.absolute_Pa(t_s)

    def differential_pressure_Pa(self, which: str, t_s: Array) -> Array:
        return self.differential_Pa(t_s)

    def transducer_temperature_K(self, which: str, t_s: Array) -> Array:
        return self.transducer_K(t_s)

    def gps(self, t_s: Array) -> GpsSolution:
        valid_s = t_s - self.gps_latency_s
        return GpsSolution(
            valid_at_s=valid_s,
            fix=self.fix(valid_s) > 0,
            latitude_deg=self.latitude_deg(valid_s),
            longitude_deg=self.longitude_deg(valid_s),
            height_msl_m=self.height_m(valid_s),
            velocity_ned_mps=self.velocity_mps(valid_s),
            horizontal_accuracy_m=np.full(len(t_s), 1.5),
            vertical_accuracy_m=np.full(len(t_s), 2.5),
            speed_accuracy_mps=np.full(len(t_s), 0.3),
        )

    def motor_speed_revps(self, t_s: Array) -> Array:
        return self.motor_revps(t_s)

    def servo_pulses_us(self, t_s: Array) -> Array:
        return self.pulses_us(t_s)

    def autopilot_attitude_rad(self, t_s: Array) -> Array:
        return self.attitude_rad(t_s)

    def battery(self, t_s: Array) -> tuple[Array, Array]:
        return self.voltage_V(t_s), self.current_A(t_s)
