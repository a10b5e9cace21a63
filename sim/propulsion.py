"""Propeller, brushless motor, speed controller and battery.

The functions accept floats, arrays and CasADi symbols.
"""

from typing import Any, NamedTuple

import numpy as np

from flightpower.flight.complete_aircraft import CompletePropulsion
from flightpower.flight.number import Number
from flightpower.flight.propeller import PropellerModel

# Below this speed the advance ratio is meaningless: thrust changes linearly to the thrust of stopped blades, and the
# motor's friction decreases to zero, so that the motor can stop.
SLOWEST_REVPS = 5.0


class PowerTrainState(NamedTuple):
    """State of the power train at one instant."""

    thrust_N: Any
    shaft_power_W: Any  # power absorbed by the propeller
    propeller_torque_Nm: Any  # torque of the air on the propeller
    motor_acceleration_revps2: Any
    battery_voltage_V: Any  # voltage at the battery's terminals under load
    battery_current_A: Any


class ThrustFactor(NamedTuple):
    """The factor of thrust: cT is the table's cT times scale (1 + slope_J (J - 0.5))."""

    scale: Any = 1.0
    slope_J: Any = 0.0


def torque_constant(propulsion: CompletePropulsion) -> float:
    """Torque per unit of current [N m/A], which equals voltage per unit of angular speed [V s/rad]."""
    return 60 / (2 * np.pi * propulsion.motor_kv_rpm_per_volt)


def motor_time_constant(propulsion: CompletePropulsion) -> float:
    """Time constant of motor speed after a change of throttle [s], without propeller and battery."""
    k = torque_constant(propulsion)
    return propulsion.propeller_inertia_kgm2 * propulsion.motor_resistance_ohm / k**2


def power_train(
    propulsion: CompletePropulsion,
    propeller: PropellerModel,
    *,
    V: Number,
    n: Number,
    throttle: Number,
    rho: Number,
    thrust_factor: ThrustFactor = ThrustFactor(),
) -> PowerTrainState:
    """Thrust, torque balance and currents at airspeed V [m/s], n [rev/s], throttle 0 to 1.

    The speed controller is an ideal step-down converter: motor voltage = throttle times battery voltage, and battery
    current = throttle times motor current; it freewheels and does not brake, so current never flows back. The
    motor is a resistance, a back-EMF and a friction torque equal to that of its no-load current.

    thrust_factor: deviation of the propeller from its table.
    """
    n_air = np.maximum(n, SLOWEST_REVPS)
    thrust_N, shaft_power_W = propeller.thrust_and_power(V, n_air, rho)
    J = V / (n_air * propeller.diameter_m)
    thrust_N = thrust_N * thrust_factor.scale * (1 + thrust_factor.slope_J * (J - 0.5))
    turning = np.clip(n / SLOWEST_REVPS, 0, 1)
    thrust_N = turning * thrust_N + (1 - turning) * propeller.standing_thrust(V, rho)
    torque_Nm = shaft_power_W / (2 * np.pi * n_air)

    k = torque_constant(propulsion)
    resistance = propulsion.motor_resistance_ohm + throttle**2 * propulsion.battery_resistance_ohm
    motor_current = np.maximum((throttle * propulsion.battery_voltage_V - 2 * np.pi * n * k) / resistance, 0)
    friction = k * propulsion.motor_no_load_current_A * turning
    acceleration = (k * motor_current - friction - torque_Nm) / (2 * np.pi * propulsion.propeller_inertia_kgm2)
    battery_current = throttle * motor_current
    voltage = propulsion.battery_voltage_V - battery_current * propulsion.battery_resistance_ohm
    return PowerTrainState(thrust_N, shaft_power_W, torque_Nm, acceleration, voltage, battery_current)


def throttle_for(
    propulsion: CompletePropulsion, propeller: PropellerModel, *, V: Number, n: Number, rho: Number
) -> Number:
    """The throttle that holds n [rev/s] at airspeed V [m/s], elementwise.

    It is zero where the propeller windmills faster than n, and infinite where the battery cannot supply the power.
    """
    _, shaft_power_W = propeller.thrust_and_power(V, n, rho)
    k = torque_constant(propulsion)
    current = np.maximum(shaft_power_W / (2 * np.pi * n) / k + propulsion.motor_no_load_current_A, 0.0)
    resistance, sagging = propulsion.motor_resistance_ohm, propulsion.battery_resistance_ohm
    motor_voltage = np.where(current > 0, 2 * np.pi * n * k + current * resistance, 0.0)
    # throttle U - emf = i (R_m + throttle^2 R_b): the smaller root is the stable one.
    discriminant = propulsion.battery_voltage_V**2 - 4 * current * sagging * motor_voltage
    root = np.sqrt(np.maximum(discriminant, 0.0))
    return np.where(discriminant >= 0, 2 * motor_voltage / (propulsion.battery_voltage_V + root), np.inf)
