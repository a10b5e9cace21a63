"""What people ask of a power curve: how slow for longest endurance, how fast for longest range, how long and how far
with this battery, and what more weight or thinner air costs.

Everything is computed of `nudged` numbers (see `propagation`), so that each answer carries what is not known of the
polar, of thrust, of the motor and of the battery's meter, with their correlations.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.drag.polar import Condition, lift_coefficient, speed_at
from analysis.performance.available import Performance, performance
from analysis.performance.balance import drag, level_thrust
from analysis.performance.power_train import PowerTrain, revps_for, thrust_and_power
from analysis.performance.propagation import Estimate, Numbers, estimate
from flight.atmosphere import GAS_CONSTANT_AIR, LAPSE_RATE, SEA_LEVEL_DENSITY, SEA_LEVEL_TEMPERATURE_K
from flight.propeller import Propeller
from flight.units import GRAVITY_MPS2

Array = NDArray[np.float64]

SPEEDS = 121


def density_altitude_m(rho):
    """Height in the standard atmosphere at which air has density rho [kg/m^3], in the troposphere, elementwise."""
    exponent = 1 / (GRAVITY_MPS2 / (GAS_CONSTANT_AIR * LAPSE_RATE) - 1)
    return SEA_LEVEL_TEMPERATURE_K / LAPSE_RATE * (1 - np.power(rho / SEA_LEVEL_DENSITY, exponent))


@dataclass(frozen=True)
class LevelFlight:
    """Steady level flight at speeds V (k,), one weight and density; NaN where the propeller cannot give the thrust.

    required : drag at lift = weight times speed [W]     shaft : the propeller takes [W]     battery : gives [W]
    inside : both lift coefficient and advance ratio were flown or tabulated
    """

    V: Array
    required: Estimate
    shaft: Estimate
    battery: Estimate
    propeller: Estimate  # efficiencies, 0 to 1
    motor: Estimate
    overall: Estimate
    inside: NDArray[np.bool_]
    battery_rows: Array  # (2m + 1, k), for what follows


def level_flight(
    row: dict[str, Array],
    train: PowerTrain,
    propeller: Propeller,
    at: Condition,
    flown_CL: tuple[float, float],
    V: Array,
) -> LevelFlight:
    """From speed to thrust, speed of rotation, shaft power and the battery's power.

    row : nudged numbers (2m + 1, 1): A0, A1, A2, thrust_scale, thrust_slope, alpha_0, alpha_CL and those of `train`
    """
    CL, thrust = lift_coefficient(V, at), level_thrust(row, V, at)
    correction = {name: row[name] for name in ("thrust_scale", "thrust_slope")}
    n = revps_for(propeller, V, thrust, at.rho, **correction)
    _, shaft = thrust_and_power(propeller, V, n, at.rho)
    losses = {name: row[name] for name in ("shaft_scale", "friction", "copper", "meter_scale")}
    battery = train.battery_power(shaft, n, **losses)
    turned, useful = shaft * row["shaft_scale"] / (1 + row["meter_scale"]), thrust * V
    J = V / (n[0] * propeller.diameter_m)
    inside = propeller.covers(J, 60 * n[0]) & (CL >= flown_CL[0] * (1 - 1e-9)) & (CL <= flown_CL[1] * (1 + 1e-9))
    return LevelFlight(
        V,
        estimate(drag(row, V, CL, at) * V),
        estimate(turned),
        estimate(battery),
        estimate(useful / turned),
        estimate(turned / battery),
        estimate(useful / battery),
        inside,
        battery,
    )


@dataclass(frozen=True)
class Optimum:
    """The best speed within the speeds flown, what it gives, whether it lies at the end of them, and whether the
    propeller's table covers it."""

    speed_mps: Estimate
    gives: Estimate  # endurance [s] or range [m]
    power_W: Estimate  # from the battery, at the estimate's speed
    at_slowest: bool
    at_fastest: bool
    inside: bool


def longest(
    flight: LevelFlight, energy_J: float, holds: NDArray[np.bool_] | bool = True, *, range_wanted: bool
) -> Optimum:
    """Longest endurance, or range, with an energy [J] from the battery, in still air, where the motor `holds` level.

    The optimum of each row of nudged numbers: what it gives is known better than where it is.
    """
    wanted = np.where(holds, flight.V if range_wanted else 1.0, np.nan)
    tops = [_top(flight.V, energy_J / power * wanted) for power in flight.battery_rows]
    speed, gives = (estimate(values) for values in zip(*tops, strict=True))
    here = [np.interp(float(speed.value), flight.V, power) for power in flight.battery_rows]
    margin = 1.01 * (flight.V[1] - flight.V[0])
    return Optimum(
        speed,
        gives,
        estimate(here),
        bool(speed.value <= flight.V[0] + margin),
        bool(speed.value >= flight.V[-1] - margin),
        bool(flight.inside[np.argmin(np.abs(flight.V - speed.value))]),
    )


def _top(x: Array, y: Array) -> tuple[float, float]:
    """Place and height of the highest point, by a parabola through it and its neighbours."""
    if np.isnan(y).all():
        return np.nan, np.nan
    i = int(np.nanargmax(y))
    if i in (0, len(x) - 1) or not np.isfinite(y[i - 1 : i + 2]).all():
        return float(x[i]), float(y[i])
    before, after = y[i - 1] - y[i], y[i + 1] - y[i]
    shift = (before - after) / (2 * (before + after)) if before + after < 0 else 0.0
    return float(x[i] + shift * (x[1] - x[0])), float(y[i] - (after - before) * shift / 4)


@dataclass(frozen=True)
class Answer:
    """All that is said of one weight and density. flies : level, at some of the speeds flown"""

    at: Condition
    flies: bool
    flight: LevelFlight
    endurance: Optimum
    range: Optimum
    performance: Performance | None


def answer(
    numbers: Numbers,
    train: PowerTrain,
    propeller: Propeller,
    at: Condition,
    flown_CL: tuple[float, float],
    energy_J: float,
    *,
    full_throttle: bool,
    speeds: int = SPEEDS,
) -> Answer:
    """numbers : as `level_flight` has them; with full_throttle, those of the motor too."""
    row = numbers.nudged()
    V = np.linspace(speed_at(flown_CL[1], at), speed_at(flown_CL[0], at), speeds)
    flight = level_flight(row, train, propeller, at, flown_CL, V)
    full = performance(row, propeller, at, flown_CL) if full_throttle else None
    holds = ~(np.interp(V, full.V, full.climb.value) < 0) if full else np.ones(len(V), dtype=bool)
    flies = bool((holds & np.isfinite(flight.battery.value)).any())
    where = holds if flies else np.ones(len(V), dtype=bool)
    return Answer(
        at,
        flies,
        flight,
        longest(flight, energy_J, where, range_wanted=False),
        longest(flight, energy_J, where, range_wanted=True),
        full,
    )
