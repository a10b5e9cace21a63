"""Energy balance with the thrust of a propeller's table: T V = D V + dE/dt.

Motor speed is measured, or follows from the electrical power and the motor's constants, because the motor takes the
power (omega k + R I) I for the shaft torque k (I - I_0).
"""

from dataclasses import dataclass

import numpy as np

from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.methods.thrust_prior import J_REFERENCE
from flightpower.analysis.methods.whole_flight.energy_balance import (
    EnergyBalance,
    FlightConditions,
    QuarticPolar,
    Samples,
    Useful,
    drag_power,
)
from flightpower.analysis.methods.whole_flight.parameters import DRAG, LIFT, THRUST_ERRORS
from flightpower.analysis.methods.whole_flight.settings import THRUST, WINDOWS
from flightpower.analysis.sources.autopilot_settings import INSTANCES
from flightpower.analysis.sources.grid import stretches
from flightpower.flight.aircraft import Propulsion
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller

PARAMETERS = (*DRAG, *THRUST_ERRORS, *LIFT)


@dataclass(frozen=True)
class MotorConstants:
    """Constants of a motor. torque_constant: N m/A, which is also V s/rad. The resistance includes the controller's."""

    torque_constant: float
    resistance_ohm: float
    no_load_A: float

    def electrical_W(self, shaft_W: Array, revps: Array) -> Array:
        """Electrical power (n,) that the motor takes to give a shaft power; zero where the air drives the motor."""
        omega = 2 * np.pi * revps
        current = np.maximum(shaft_W / omega / self.torque_constant + self.no_load_A, 0.0)
        return np.asarray((omega * self.torque_constant + self.resistance_ohm * current) * current)


def motor_constants(propulsion: Propulsion) -> MotorConstants | None:
    """The motor's constants; None if the aircraft file lacks one of them."""
    kv, resistance = propulsion.motor_kv_rpm_per_volt, propulsion.motor_resistance_ohm
    no_load = propulsion.motor_no_load_current_A
    if kv is None or resistance is None or no_load is None:
        return None
    return MotorConstants(60 / (2 * np.pi * kv), resistance, no_load)


class ThrustBalance(EnergyBalance):
    """The balance of one flight with the propeller's table. motor: given if motor speed is not measured"""

    def __init__(
        self,
        samples: Samples,
        conditions: FlightConditions,
        propeller: Propeller,
        motor: MotorConstants | None = None,
        most_windows: int = WINDOWS.most,
    ):
        if motor is not None:
            samples = samples._replace(stretches=_powered(samples, conditions))
        super().__init__(samples, conditions, most_windows)
        self._propeller, self._motor = propeller, motor
        self._cached: tuple[Samples, FlightConditions, Array, Array] | None = None

    def _names(self) -> tuple[str, ...]:
        return PARAMETERS

    def shaft_W(self) -> Array:
        """Shaft power (n,) [W] from the table, as means over the windows."""
        s, c = self.samples, self.conditions
        revps = np.maximum(self._revps(s, c), INSTANCES.turning_revps)
        return self._mean(self._propeller.thrust_and_power(s.V_mps, revps, c.rho)[1])

    def motor_W(self) -> Array:
        """Electrical power (n,) [W] of the motor, as means over the windows."""
        return self._mean(self._motor_power(self.conditions))

    def _useful(self, p: NamedValues, s: Samples, c: FlightConditions) -> Useful:
        thrust_N, J = self._thrust(s, c)
        return Useful(thrust_N * (1 + p.thrust_scale + p.thrust_slope * (J - J_REFERENCE)) * s.V_mps, idle=0.0)

    def _drag_W(self, p: NamedValues, s: Samples, c: FlightConditions, idle: Array | float) -> Array:
        """Drag of the airframe alone, because the table's thrust contains the drag of an idling propeller."""
        return drag_power(s.V_mps, s.load_factor, idle, QuarticPolar.of(p), c, load_variance=s.load_variance)

    def _thrust(self, s: Samples, c: FlightConditions) -> tuple[Array, Array]:
        """Thrust from the table and advance ratio, each (n,), which do not depend on the parameters."""
        if self._cached is None or self._cached[0] is not s or self._cached[1] is not c:
            revps = self._revps(s, c)
            turning, n = np.clip(revps / INSTANCES.turning_revps, 0.0, 1.0), np.maximum(revps, INSTANCES.turning_revps)
            thrust_N, _ = self._propeller.thrust_and_power(s.V_mps, n, c.rho)
            standing_N = self._propeller.standing_thrust(s.V_mps, c.rho)
            J = np.minimum(s.V_mps / (n * self._propeller.diameter_m), THRUST.greatest_J)
            self._cached = (s, c, turning * thrust_N + (1 - turning) * standing_N, J)
        return self._cached[2], self._cached[3]

    def _revps(self, s: Samples, c: FlightConditions) -> Array:
        if self._motor is None:
            assert s.motor_revps is not None
            return s.motor_revps
        power_W = np.maximum(c.power_scale * s.power_W - c.idle_power_W, 0.0)
        revps = np.geomspace(INSTANCES.turning_revps, 600.0, 120)
        speed_mps = np.linspace(0.0, float(np.nanmax(s.V_mps)) + 1.0, 40)
        speeds = np.full((len(speed_mps), len(power_W)), np.nan)
        for i, V in enumerate(speed_mps):
            _, shaft_W = self._propeller.thrust_and_power(np.full_like(revps, V), revps, c.rho)
            taken_W = np.maximum.accumulate(self._motor.electrical_W(shaft_W, revps))
            driven = max(int(np.argmax(taken_W > 0)) - 1, 0)  # the fastest motor speed that air alone drives
            speeds[i] = np.interp(power_W, taken_W[driven:], revps[driven:])
        grid_place = np.clip(np.nan_to_num(s.V_mps) / (speed_mps[1] - speed_mps[0]), 0, len(speed_mps) - 1.001)
        low, samples = grid_place.astype(int), np.arange(len(power_W))
        share = grid_place - low
        return np.asarray((1 - share) * speeds[low, samples] + share * speeds[low + 1, samples])


def _powered(samples: Samples, c: FlightConditions) -> list[slice]:
    """The parts of the stretches in which the motor draws enough power to determine its speed."""
    power_W = samples.power_W - c.idle_power_W
    flown = np.zeros(len(power_W), dtype=bool)
    for rows in samples.stretches:
        flown[rows] = True
    return stretches(flown & (power_W > THRUST.least_power * np.percentile(power_W[flown], 95)))
