"""What a plan assumes about an aircraft before the flight: stall, drag polar, lift curve, thrust."""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.curve import drag_coefficient
from flightpower.analysis.methods.whole_flight.settings import PRIOR
from flightpower.analysis.missions.plan_settings import MANEUVERS, MARGINS, TRAINER
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density, pressure_at, temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.propeller_search import with_table_error


@dataclass(frozen=True)
class ExpectedAircraft:
    """Speeds, drag and thrust with which a plan is computed, at the height of the flight.

    A : (3,) drag polar C_D = A0 + A1 C_L + A2 C_L^2       rho : air density [kg/m^3]
    stall_mps, fastest_mps : level flight, wings level; fastest_mps is lower if the propeller's table ends sooner, so
    that the fastest speed planned (92 % of it) lies in the table
    acceleration_throttle : of runs     full_throttle : whether the table covers full throttle
    basis : where drag and thrust come from, in words
    stall_basis : where the stall speed comes from, in words
    """

    aircraft: Aircraft
    propeller: Propeller
    rho: float
    A: Array
    stall_mps: float
    fastest_mps: float
    acceleration_throttle: float
    full_throttle: bool
    basis: str
    stall_basis: str
    _grid_V: Array = field(repr=False)  # evenly spaced
    _grid_thrust_N: Array = field(repr=False)  # (throttles, speeds)

    @property
    def cruise_mps(self) -> float:
        """Speed between maneuvers, and in the turn after a run."""
        return min(MARGINS.cruise * self.stall_mps, MARGINS.fastest * self.fastest_mps)

    @property
    def least_mps(self) -> float:
        """Forces are not computed below this speed; an aircraft without enough thrust stays at it."""
        return 0.5 * self.stall_mps

    @property
    def lift_slope(self) -> float:
        """dC_L/dalpha of a straight wing (Helmbold's equation) [1/rad]."""
        AR = self.aircraft.aspect_ratio
        return float(2 * np.pi * AR / (2 + np.sqrt(AR**2 + 4)))

    def lift_coefficient(self, V: Array | float, load_factor: Array | float = 1.0) -> Array:
        """C_L at a speed [m/s] and a load factor."""
        S = self.aircraft.geometry.wing_area_m2
        return np.asarray(2 * load_factor * self.aircraft.mass.weight_N / (self.rho * np.square(V) * S))

    def alpha_rad(self, V: Array | float, load_factor: Array | float = 1.0) -> Array:
        """Angle of attack of the body axes [rad]."""
        return np.asarray((self.lift_coefficient(V, load_factor) - TRAINER.CL_at_zero_alpha) / self.lift_slope)

    def drag_N(self, V: Array | float, load_factor: Array | float = 1.0) -> Array:
        """Drag [N] at a speed [m/s] and a load factor."""
        return _drag_N(self.aircraft, self.rho, self.A, V, load_factor)

    def thrust_N(self, throttle: float, V: float) -> float:
        """Thrust [N] at a throttle from 0 to 1."""
        rows, columns = self._grid_thrust_N.shape
        row = throttle * (rows - 1)
        i = min(int(row), rows - 2)
        column = (V - self._grid_V[0]) / (self._grid_V[1] - self._grid_V[0])
        column = min(max(float(column), 0.0), columns - 1.0)
        k = min(int(column), columns - 2)
        (a, b), (c, d) = self._grid_thrust_N[i : i + 2, k : k + 2].tolist()
        below, above = a + (column - k) * (b - a), c + (column - k) * (d - c)
        return float(below + (row - i) * (above - below))

    def revps_of_thrust(self, V: Array, thrust_N: Array) -> Array:
        """Speed of rotation [rev/s] at which the propeller gives a thrust [N]."""
        low, high = np.full_like(V, 5.0), np.full_like(V, 400.0)
        for _ in range(30):
            middle = (low + high) / 2
            less = self.propeller.thrust_and_power(V, middle, self.rho)[0] < thrust_N
            low, high = np.where(less, middle, low), np.where(less, high, middle)
        return (low + high) / 2


def expected_aircraft(
    aircraft: Aircraft,
    height_m: float,
    *,
    A: Array | None = None,
    stall_mps: float | None = None,
    fastest_mps: float | None = None,
) -> ExpectedAircraft:
    """Return the aircraft assumed in a plan. A: polar of an earlier flight.

    Raises InputError if the file has no propeller, if weight, wing and stall speed contradict each other, or if full
    throttle cannot hold level flight.
    """
    if aircraft.propulsion.propeller is None:
        raise InputError(
            f"{aircraft.name}: the aircraft file names no propeller, which a plan needs;"
            " add propulsion.propeller, or give --propeller"
        )
    propeller = load_propeller(aircraft.propulsion.propeller)
    uncertainty, _ = with_table_error(aircraft.uncertainty, aircraft.keys, propeller)
    aircraft = replace(aircraft, uncertainty=uncertainty)
    rho = float(density(pressure_at(height_m), temperature_at(height_m)))
    basis = []
    if A is None:
        CD0, oswald, CL_of_least_drag = PRIOR.CD0.mean, PRIOR.oswald.mean, PRIOR.CL_of_least_drag.mean
        K = 1 / (np.pi * oswald * aircraft.aspect_ratio)
        A = np.array([CD0 + K * CL_of_least_drag**2, -2 * K * CL_of_least_drag, K])
        basis.append(f"drag of a small electric aircraft (C_D0 {CD0}, e {oswald})")
    else:
        basis.append("drag of the earlier flights")
    if stall_mps is None:
        S = aircraft.geometry.wing_area_m2
        stall_mps = float(np.sqrt(2 * aircraft.mass.weight_N / (rho * S * TRAINER.largest_CL)))
        stall_basis = f"assumed from a largest lift coefficient of {TRAINER.largest_CL}"
    else:
        stall_basis = "as given"
        _check_stall(aircraft, rho, stall_mps)
    V = np.linspace(0.8 * stall_mps, 4.5 * stall_mps, 24)
    if aircraft.has(*(f"propulsion.{key}" for key in MOTOR)):
        thrust, motor = _motor_thrust(aircraft, propeller, V, rho), "the motor of the aircraft file"
    else:
        top = fastest_mps or TRAINER.fastest_over_stall * stall_mps
        thrust, motor = (
            _assumed_thrust(aircraft, propeller, V, rho, A, fastest_mps=top),
            f"a motor that gives {top:.0f} m/s",
        )
    if fastest_mps is None:
        excess = thrust[-1] - _drag_N(aircraft, rho, A, V)
        can = np.flatnonzero(excess > 0)
        if not len(can):
            raise InputError(f"{aircraft.name}: full throttle does not carry the aircraft; check propeller and motor")
        i = int(can[-1])
        fastest_mps = float(np.interp(0.0, -excess[i : i + 2], V[i : i + 2]))  # or the last V if it has excess thrust
    expectation = ExpectedAircraft(
        aircraft=aircraft, propeller=propeller, rho=rho, A=A, stall_mps=stall_mps, fastest_mps=fastest_mps,
        acceleration_throttle=MANEUVERS.acceleration_throttle, full_throttle=True, basis="; ".join([*basis, motor]),
        stall_basis=stall_basis, _grid_V=V, _grid_thrust_N=thrust,
    )  # fmt: skip
    return _inside_the_table(expectation)


def _check_stall(aircraft: Aircraft, rho: float, stall_mps: float, least: float = 0.25, most: float = 4.0) -> None:
    """Raise InputError for an impossible stall speed. least, most: limits of the largest lift coefficient"""
    S, W = aircraft.geometry.wing_area_m2, aircraft.mass.weight_N
    CL = 2 * W / (rho * S * stall_mps**2)
    if not least <= CL <= most:
        speeds = " to ".join(f"{(2 * W / (rho * S * CL)) ** 0.5:.1f}" for CL in (most, least))
        raise InputError(
            f"{aircraft.name}: a stall speed of {stall_mps:g} m/s takes a lift coefficient of {CL:.2g} at {W:.1f} N and"
            f" {S:g} m²; {speeds} m/s is possible: check --stall, weight and wing area"
        )


def _inside_the_table(expected: ExpectedAircraft) -> ExpectedAircraft:
    """Limit the speed, and the throttle in runs, to what the propeller's table covers: in level flight, in turns, and
    in porpoising by 1 g, which has the mean drag of a turn. If the table does not reach a speed that leaves room for
    runs, nothing is limited, and the card says what is not covered."""
    slowest = MARGINS.slowest * expected.stall_mps
    V = np.linspace(slowest, MARGINS.fastest * expected.fastest_mps, 41)
    level = expected.revps_of_thrust(V, expected.drag_N(V))
    load = np.minimum(1 / np.cos(MANEUVERS.banks_rad[0]), (V / slowest) ** 2)
    turning = expected.revps_of_thrust(V, expected.drag_N(V, load))
    spare = np.minimum(turning / MARGINS.fastest, _revps(expected, 1.0, V))  # rev/s that hold the speed in gusts
    covered = _covered(expected, V, level) & _covered(expected, V, spare)
    first = int(np.argmax(covered))  # in slower flight the propeller may be too slow for the table
    full = bool(np.all(_covered(expected, V[-1:], _revps(expected, 1.0, V[-1:]))))
    slower = V[: first + int(np.argmin(covered[first:]))] if not covered[first:].all() else V
    if not covered[first] or not V[first] < 1.3 * slowest <= slower[-1]:
        return replace(expected, full_throttle=full)
    throttles = np.linspace(0.0, 1.0, 101)
    throttles = throttles[throttles <= MANEUVERS.acceleration_throttle + 1e-9]
    at_fastest = np.array([_covered(expected, slower[-1:], _revps(expected, t, slower[-1:]))[0] for t in throttles])
    if not at_fastest.any():
        return replace(expected, full_throttle=full)
    limited = not (covered.all() and at_fastest[-1])
    return replace(
        expected,
        fastest_mps=float(slower[-1] / MARGINS.fastest),
        acceleration_throttle=float(throttles[at_fastest][-1]) if limited else MANEUVERS.acceleration_throttle,
        full_throttle=full,
        basis=expected.basis + (f"; no faster than {slower[-1]:.1f} m/s for the propeller's table" if limited else ""),
    )


def _revps(expected: ExpectedAircraft, throttle: float, V: Array) -> Array:
    return expected.revps_of_thrust(V, np.array([expected.thrust_N(throttle, v) for v in V]))


def _covered(expected: ExpectedAircraft, V: Array, revps: Array) -> NDArray[np.bool_]:
    return np.asarray(expected.propeller.covers(V / (revps * expected.propeller.diameter_m), 60 * revps))


MOTOR = ("motor_kv_rpm_per_volt", "motor_resistance", "motor_no_load_current", "battery_voltage")


def _drag_N(aircraft: Aircraft, rho: float, A: Array, V: Array | float, load_factor: Array | float = 1.0) -> Array:
    qS = rho * V**2 / 2 * aircraft.geometry.wing_area_m2
    CL = load_factor * aircraft.mass.weight_N / qS
    return np.asarray(qS * drag_coefficient(A, CL))


def _motor_thrust(aircraft: Aircraft, propeller: Propeller, V: Array, rho: float) -> Array:
    """Return thrust [N] (throttles, speeds) of an ideal step-down converter, a motor, and a battery with resistance."""
    p = aircraft.propulsion
    assert p.motor_kv_rpm_per_volt and p.motor_resistance_ohm and p.battery_voltage_V
    k = 60 / (2 * np.pi * p.motor_kv_rpm_per_volt)
    throttle = np.linspace(0.0, 1.0, 21)[:, None]
    low, high = np.full((len(throttle), len(V)), 3.0), np.full((len(throttle), len(V)), 400.0)
    resistance = p.motor_resistance_ohm + throttle**2 * (p.battery_resistance_ohm or 0.0)
    for _ in range(30):
        n = (low + high) / 2
        current = np.maximum((throttle * p.battery_voltage_V - 2 * np.pi * n * k) / resistance, 0)
        _, shaft_W = propeller.thrust_and_power(V, n, rho)
        spare = k * (current - (p.motor_no_load_current_A or 0.0)) - shaft_W / (2 * np.pi * n)
        low, high = np.where(spare > 0, n, low), np.where(spare > 0, high, n)
    return np.asarray(propeller.thrust_and_power(V, (low + high) / 2, rho)[0])


def _assumed_thrust(
    aircraft: Aircraft, propeller: Propeller, V: Array, rho: float, A: Array, *, fastest_mps: float
) -> Array:
    """Return thrust [N] (throttles, speeds) of a motor with speed proportional to throttle, fit to `fastest_mps`."""
    needed = float(_drag_N(aircraft, rho, A, fastest_mps))
    low, high = 5.0, 400.0
    for _ in range(40):
        n = (low + high) / 2
        low, high = (n, high) if propeller.thrust_and_power(fastest_mps, n, rho)[0] < needed else (low, n)
    n_of_throttle = np.maximum(low * np.linspace(0.0, 1.0, 21), 5.0)[:, None]
    return np.asarray(propeller.thrust_and_power(V, n_of_throttle, rho)[0])
