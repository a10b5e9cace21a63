"""Energy and time of legs in wind: steady flight along one leg after another, with turns, circles, climbs and descents.

A leg's airspeed and the wind give its ground speed (wind triangle). Height changes evenly over the leg; if that
requires more than the aircraft's rate of climb, the rest is climbed in circles. Turns between legs, and circles, are
flown at a load factor. A change of speed counts as the change of height with the same energy. Wind components point
where the wind blows to, in m/s.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.missions.power import RoutePower, SteadyPower
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.flight.arrays import Array
from flightpower.flight.units import GRAVITY_MPS2


class Battery(NamedTuple):
    """energy_J : when new and full     health, health_sd : share of it still available, with standard deviation

    open_circuit_V, resistance_ohm : give the loss in the battery if both are known
    reserve : share to keep at the end
    """

    energy_J: float
    reserve: float
    health: float = 1.0
    health_sd: float = 0.0
    open_circuit_V: float | None = None
    resistance_ohm: float = 0.0

    def drawn_W(self, power_W: Array) -> Array:
        """Return the power [W] drawn from the cells: V_oc I, where V_oc I - R I^2 = P. Infinite if they cannot deliver
        P."""
        if self.open_circuit_V is None or not self.resistance_ohm:
            return power_W
        V, R = self.open_circuit_V, self.resistance_ohm
        with np.errstate(invalid="ignore"):
            current_A = (V - np.sqrt(V**2 - 4 * R * power_W)) / (2 * R)
        return np.where(np.isnan(current_A), np.inf, V * current_A)


@dataclass(frozen=True)
class Legs:
    """Arrays (k,). climb_m : including the change of speed     turn_rad : at the start of the leg, at `turn_load`

    circle_s, turns, radius_m : of circles at its end; radius 0 means the radius at `turn_load`
    rate_mps : of the steepest climb
    """

    distance_m: Array
    course_rad: Array
    climb_m: Array
    turn_rad: Array
    circle_s: Array
    turns: Array
    radius_m: Array
    rate_mps: Array
    condition: Condition
    turn_load: float

    def __len__(self) -> int:
        return len(self.distance_m)


@dataclass(frozen=True)
class World:
    """Uncertain quantities, at n draws. wind_east_mps, wind_north_mps : (n, 1) or (n, k) [m/s]

    airspeed : (n, 1) ratio of airspeed flown to airspeed commanded
    energy : (n, 1) ratio of power to the power of steady flight
    """

    power: SteadyPower
    wind_east_mps: Array
    wind_north_mps: Array
    airspeed: Array
    energy: Array


def straight_legs(distance_m: Array, course_rad: Array, condition: Condition, like: Legs) -> Legs:
    """Return level legs without turns. condition: its fields are arrays (k,)"""
    zero = np.zeros(len(distance_m))
    return replace(
        like,
        distance_m=distance_m,
        course_rad=course_rad,
        climb_m=zero,
        turn_rad=zero,
        circle_s=zero,
        turns=zero,
        radius_m=zero,
        rate_mps=zero + np.max(like.rate_mps),
        condition=condition,
    )


def ground_speed(V: Array, course_rad: Array, wind_east_mps: Array, wind_north_mps: Array) -> Array:
    """Return the speed along the course [m/s]; NaN if the crosswind exceeds the airspeed, or no progress is made."""
    along = wind_east_mps * np.sin(course_rad) + wind_north_mps * np.cos(course_rad)
    across = wind_east_mps * np.cos(course_rad) - wind_north_mps * np.sin(course_rad)
    with np.errstate(invalid="ignore"):
        speed = np.sqrt(V**2 - across**2) + along
        return np.where(speed > FLIGHT.standing_mps, speed, np.nan)


def energy_and_time(legs: Legs, V: Array, world: World, battery: Battery) -> tuple[Array, Array]:
    """Compute energy from the cells [J] and time [s], (n, k), at commanded true airspeeds V (k,) or (n, k) [m/s].

    Both are infinite where the aircraft cannot make headway against the wind.
    """
    V = V * world.airspeed
    over_ground = ground_speed(V, legs.course_rad, world.wind_east_mps, world.wind_north_mps)
    straight_s = np.where(legs.distance_m > 0, np.nan_to_num(legs.distance_m / over_ground, nan=np.inf), 0.0)
    straight_s = np.maximum(straight_s, np.abs(legs.climb_m) / legs.rate_mps)
    rise_mps = np.divide(legs.climb_m, straight_s, out=np.zeros_like(straight_s), where=straight_s > 0)
    per_speed = V / GRAVITY_MPS2
    turn_s = legs.turn_rad * per_speed / np.sqrt(legs.turn_load**2 - 1)
    tightest_m = V * per_speed / np.sqrt(legs.turn_load**2 - 1)
    radius_m = np.where(legs.radius_m > 0, legs.radius_m, tightest_m)
    circle_load = np.sqrt(1 + (V * per_speed / radius_m) ** 2)
    circle_s = legs.circle_s + legs.turns * 2 * np.pi * radius_m / V
    energy_J = np.zeros(straight_s.shape)
    phases = ((straight_s - np.minimum(turn_s, straight_s), rise_mps, 1.0), (turn_s, 0.0, legs.turn_load),
              (circle_s, 0.0, circle_load))  # fmt: skip
    for seconds, climb_mps, load in phases:
        if np.any(seconds > 0):
            power_W = world.power.battery_W(V, legs.condition, np.clip(climb_mps / V, -0.9, 0.9), load)
            with np.errstate(invalid="ignore"):
                part_J = seconds * battery.drawn_W(power_W * world.energy)
            energy_J += np.where(seconds > 0, part_J, 0.0)
    return energy_J, straight_s + circle_s + np.maximum(turn_s - straight_s, 0.0)


class SpeedLimits(NamedTuple):
    """Lowest and highest true airspeeds (k,) at which legs may be flown [m/s]."""

    slowest: Array
    fastest: Array


def speed_limits(source: RoutePower, condition: Condition, stall_CL: float, margin: float) -> SpeedLimits:
    """Return the speed limits: those of the lift coefficients flown, and never below `margin` times the stall speed."""
    smallest_CL, largest_CL = source.flown_CL
    slowest = np.maximum(speed_at(largest_CL, condition), margin * speed_at(stall_CL, condition))
    return SpeedLimits(slowest, np.maximum(speed_at(smallest_CL, condition), slowest))


def best_speeds(legs: Legs, limits: SpeedLimits, world: World, battery: Battery) -> Array:
    """Find the true airspeeds (k,) of least energy within the limits, in the world without errors (n = 1).

    A grid is searched three times, each time between the neighbors of the previous best point. If the wind allows no
    speed to reach the end of a leg, the fastest speed is used.
    """
    low, high = limits
    points = 41
    share = np.linspace(0.0, 1.0, points)[:, None]
    for _ in range(3):
        V = low + share * (high - low)
        energy_J, _ = energy_and_time(legs, V, world, battery)
        best = np.where(np.isfinite(energy_J).any(axis=0), np.argmin(energy_J, axis=0), points - 1)
        columns = np.arange(len(legs))
        low = V[np.maximum(best - 1, 0), columns]
        high = V[np.minimum(best + 1, points - 1), columns]
    return np.asarray(V[best, columns])
