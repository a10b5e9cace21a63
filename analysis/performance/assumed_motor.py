"""The motor and battery that stand in where the aircraft file does not describe them.

Of a motor that fits its propeller a tenth of the highest power goes into friction and iron, and a tenth into copper;
losses have wide priors anyway (`power_train`), and battery data in the log replace them.
"""

import numpy as np
import pandas as pd

from flight.aircraft import Propulsion
from flight.complete_aircraft import CompletePropulsion
from flight.propeller import PropellerModel

FRICTION_SHARE, COPPER_SHARE = 0.1, 0.1  # of the highest shaft power of the flight
UNLOADED_OVER_HIGHEST = 1.25  # speed of rotation without load over the highest flown
SLOWEST_REVPS = 10.0
REFERENCE_INERTIA_KGM2, REFERENCE_DIAMETER_M = 9e-5, 0.305  # of a propeller of 12 in with the motor's bell
MOTOR = ("motor_kv_rpm_per_volt", "motor_resistance_ohm", "motor_no_load_current_A")
ASSUMED_MOTOR = (
    "assumed, because the aircraft file lacks motor_kv_rpm_per_volt, motor_resistance or motor_no_load_current; with"
    " them, or with battery voltage and current in the log, the intervals would be narrower"
)


def motor_is_known(propulsion: Propulsion) -> bool:
    """Whether the aircraft file has the three constants of the motor."""
    return all(getattr(propulsion, name) is not None for name in MOTOR)


def with_assumed_motor(propulsion: Propulsion, data: pd.DataFrame, propeller: PropellerModel) -> CompletePropulsion:
    """The power train of the aircraft file, with assumptions for what it lacks.

    data : columns V [m/s], n [rev/s], rho [kg/m^3], covered (by the propeller's table)
    """
    voltage = propulsion.battery_voltage_V or 10.0  # any will do for losses in watts
    assumed: dict[str, float] = {"battery_voltage_V": voltage, "battery_resistance_ohm": 0.0}
    assumed["propeller_inertia_kgm2"] = REFERENCE_INERTIA_KGM2 * (propeller.diameter_m / REFERENCE_DIAMETER_M) ** 5
    if not motor_is_known(propulsion):
        power_W, n = _highest_power(data, propeller)
        unloaded_revps = UNLOADED_OVER_HIGHEST * n
        k = voltage / (2 * np.pi * unloaded_revps)  # N m/A and V s/rad
        torque_Nm = power_W / (2 * np.pi * n)
        assumed["motor_kv_rpm_per_volt"] = 60 * unloaded_revps / voltage
        assumed["motor_no_load_current_A"] = FRICTION_SHARE * power_W / (2 * np.pi * n * k)
        assumed["motor_resistance_ohm"] = COPPER_SHARE * power_W * (k / torque_Nm) ** 2
    known = {name: value for name, value in vars(propulsion).items() if value is not None}
    if not motor_is_known(propulsion):  # one constant says little without the others
        known = {name: value for name, value in known.items() if name not in MOTOR}
    unused = {"propeller": "", "max_rpm": 0.0, "pole_pairs": 1, "battery_energy_Wh": 0.0}
    return CompletePropulsion(**{**unused, **assumed, **known})


def _highest_power(data: pd.DataFrame, propeller: PropellerModel) -> tuple[float, float]:
    """Highest shaft power of the flight by the propeller's table [W], and its speed of rotation [rev/s]."""
    turning = data[data["covered"] & (data["n"] > SLOWEST_REVPS)]
    if turning.empty:
        return 100.0, 100.0
    V, n, rho = (turning[name].to_numpy() for name in ("V", "n", "rho"))
    _, shaft_W = propeller.thrust_and_power(V, n, rho)
    i = int(np.nanargmax(shaft_W))
    return float(shaft_W[i]), float(n[i])
