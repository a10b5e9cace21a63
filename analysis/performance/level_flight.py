"""Level flight at a weight and density: from speed to thrust, speed of rotation, shaft power and battery power.

In level flight drag determines thrust (see `balance`), thrust and speed determine the speed of rotation, that the shaft
power, and that the battery power.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drag.polar import Condition, lift_coefficient
from analysis.performance.balance import drag, level_thrust
from analysis.performance.power_train import PowerTrainModel
from analysis.performance.propagation import SigmaPoints, UncertainValue, from_sigma_points
from analysis.performance.propeller_speed import revps_for_thrust
from flight.propeller import Propeller

Array = NDArray[np.float64]

ROUNDING = 1e-9  # of a lift coefficient: the ends of the flown range count as inside


@dataclass(frozen=True)
class LevelFlight:
    """Steady level flight at speeds V (k,) [m/s]; NaN where the propeller cannot give the thrust.

    required : power required, drag at lift = weight times speed [W]     shaft, battery : power [W]
    propeller, motor, overall : efficiencies (0 to 1); the motor's with its speed controller
    inside : lift coefficient flown, and propeller's table not extrapolated, (k,)
    battery_at_sigma_points : battery power [W], (2m + 1, k)
    """

    V: Array
    required: UncertainValue
    shaft: UncertainValue
    battery: UncertainValue
    propeller: UncertainValue
    motor: UncertainValue
    overall: UncertainValue
    inside: NDArray[np.bool_]
    battery_at_sigma_points: Array


def level_flight(
    parameters: SigmaPoints,
    train: PowerTrainModel,
    propeller: Propeller,
    condition: Condition,
    flown_CL: tuple[float, float],
    V: Array,
) -> LevelFlight:
    """Power at speeds V (k,) [m/s].

    parameters : A0, A1, A2, thrust_scale, thrust_slope, alpha_0, alpha_CL, shaft_scale, friction, copper, meter_scale
    """
    CL, thrust_N = lift_coefficient(V, condition), level_thrust(parameters, V, condition)
    correction = {name: parameters[name] for name in ("thrust_scale", "thrust_slope")}
    n = revps_for_thrust(propeller, V, thrust_N, condition.rho, **correction)
    _, table_shaft_W = propeller.thrust_and_power(V, n, condition.rho)
    battery_W = train.battery_power(table_shaft_W, n, parameters)
    shaft_W, thrust_power_W = train.shaft_power(table_shaft_W, parameters), thrust_N * V
    covered = propeller.covers(V / (n[0] * propeller.diameter_m), 60 * n[0])
    flown = (CL >= flown_CL[0] * (1 - ROUNDING)) & (CL <= flown_CL[1] * (1 + ROUNDING))
    return LevelFlight(
        V=V,
        required=from_sigma_points(drag(parameters, V, CL, condition) * V),
        shaft=from_sigma_points(shaft_W),
        battery=from_sigma_points(battery_W),
        propeller=from_sigma_points(thrust_power_W / shaft_W),
        motor=from_sigma_points(shaft_W / battery_W),
        overall=from_sigma_points(thrust_power_W / battery_W),
        inside=covered & flown,
        battery_at_sigma_points=battery_W,
    )
