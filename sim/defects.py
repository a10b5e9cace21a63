"""Ordinary defects of an installation, unknown to the analysis. Each has exactly its stated value.

Most are errors of a sensor; landing gear, fading propeller, sagging battery and steady updraft change the flight.
World files give them in the section [defects] (docs/evidence/worlds.md).
"""

from dataclasses import dataclass

import numpy as np

from flightpower.flight.arrays import Array

# Motor speed for which the vibration offset is stated; the force of an imbalance is proportional to the speed squared.
VIBRATION_REVPS = 100.0


@dataclass(frozen=True, kw_only=True)
class Defects:
    """The defects of an installation. A default value means that there is no such defect.

    poles, poles_entered : number of the motor's magnets, and the number entered: motor speed is wrong by their ratio
    pulses_lost, pulses_lost_above_revps : share of the motor's pulses that are not counted, above this speed
    vibration_offset_x_mps2 … : offset of the accelerometer by vibration at 100 rev/s; it grows with the speed squared
    imu_gyro_scale, imu_accelerometer_scale : fraction by which the IMU's rates and specific force read high on all axes
    imu_roll_rad, imu_pitch_rad, imu_yaw_rad : rotation of the IMU's box, which contains accelerometer, gyroscope and
    magnetometer, relative to the aircraft
    boom_bending_rad : the probe's boom bends down by this angle under each g of load factor, so that the probe reads a
    larger angle of attack
    airspeed_per_lift : relative error of airspeed per unit of lift coefficient, due to static ports in the flow about
    the wing; up to a lift coefficient of 2
    airspeed_leak : fraction of the center port's pressure relative to the fuselage that is lost at a leaking joint
    gear_CD : drag of the landing gear, which is extended only in every second pair of runs
    thrust_loss : fraction of thrust lost by the time the battery is empty, in proportion to the energy used
    battery_sag : fraction of its voltage that the battery has lost when it is empty, also in proportion to the energy
        used
    updraft_mps : vertical motion of the air over the whole flight
    """

    poles: int = 14
    poles_entered: int = 14
    pulses_lost: float = 0.0
    pulses_lost_above_revps: float = 0.0
    vibration_offset_x_mps2: float = 0.0
    vibration_offset_y_mps2: float = 0.0
    vibration_offset_z_mps2: float = 0.0
    imu_gyro_scale: float = 0.0
    imu_accelerometer_scale: float = 0.0
    imu_roll_rad: float = 0.0
    imu_pitch_rad: float = 0.0
    imu_yaw_rad: float = 0.0
    boom_bending_rad: float = 0.0
    airspeed_per_lift: float = 0.0
    airspeed_leak: float = 0.0
    gear_CD: float = 0.0
    thrust_loss: float = 0.0
    battery_sag: float = 0.0
    updraft_mps: float = 0.0

    def counted_revps(self, motor_revps: Array) -> Array:
        """The motor speed that the counter gives, elementwise."""
        counted_share = np.where(motor_revps > self.pulses_lost_above_revps, 1 - self.pulses_lost, 1.0)
        return motor_revps * counted_share * (self.poles / self.poles_entered)

    def vibration_offset_mps2(self, motor_revps: Array) -> Array:
        """The accelerometer's offset [m/s^2] at motor speeds (n,), in its own axes (n, 3)."""
        at_100 = (self.vibration_offset_x_mps2, self.vibration_offset_y_mps2, self.vibration_offset_z_mps2)
        return np.outer((motor_revps / VIBRATION_REVPS) ** 2, at_100)

    @property
    def imu_turn_rad(self) -> tuple[float, float, float]:
        """Rotation vector of the IMU relative to the body axes; for small angles it is (roll, pitch, yaw)."""
        return (self.imu_roll_rad, self.imu_pitch_rad, self.imu_yaw_rad)


NO_DEFECTS = Defects()
