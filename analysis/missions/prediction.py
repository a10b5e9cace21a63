"""Predicts a mission: speed of each leg, energy, time, charge left, probability of coming home, point of no return.

The curve's parameters (joint covariance), the mean wind, its mean over each leg in Dryden turbulence (MIL-F-8785C), the
autopilot's airspeed, the power in gusts and the battery's capacity are drawn at random, always with the same seed.
Values are medians of the draws, and intervals contain 95 % of the draws; a probability is a share of the draws. Speeds
are chosen for a world without errors, as a mission is planned before the errors are known.
"""

from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import pairwise
from math import pi
from typing import NamedTuple

import msgspec
import numpy as np

from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.methods.whole_flight.settings import GPS
from flightpower.analysis.missions.energy import (
    Battery,
    Legs,
    SpeedLimits,
    World,
    best_speeds,
    energy_and_time,
    ground_speed,
    speed_limits,
    straight_legs,
)
from flightpower.analysis.missions.inputs import RouteInput
from flightpower.analysis.missions.mission import HOME, Mission, Place, Speed, Wind, courses_rad
from flightpower.analysis.missions.plan_settings import MANEUVERS, MARGINS, PATH
from flightpower.analysis.missions.power import RoutePower, interval_of, source_of
from flightpower.analysis.records.flight import Interval
from flightpower.analysis.trajectory import dryden
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY, density, pressure_at, temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2


class Resolution(NamedTuple):
    """Numbers of draws of the uncertain quantities, directions of the map, and points per leg for the way home."""

    draws: int = 1000
    directions: int = 36
    points_per_leg: int = 8


RESOLUTION = Resolution()


class Objective(StrEnum):
    """The goal that determines the airspeeds."""

    ENERGY = "energy"
    TIME = "time"


class Air(NamedTuple):
    """Air at the home position."""

    pressure_Pa: float
    temperature_K: float

    def rho(self, height_m: Array) -> Array:
        """Return the density [kg/m^3] at heights above home [m]."""
        at_home = {"ground_pressure_Pa": self.pressure_Pa, "ground_temperature_K": self.temperature_K}
        return np.asarray(density(pressure_at(height_m, **at_home), temperature_at(height_m, self.temperature_K)))


@dataclass(frozen=True)
class Flight:
    """How the mission is flown.

    weight_N : at the start     stall_mps : equivalent airspeed at this weight; None means from the largest lift
    coefficient
    speed : of all legs, instead of the mission's speeds; with an objective, each leg's speed depends on the wind
    power_sd : relative standard deviation of the mean power over the route, from gusts and the autopilot's control of
    speed and height
    climb_mps : of steep climbs and descents; None means from the stall speed     sure : probability that counts as safe
    """

    wind: Wind
    battery: Battery
    air: Air
    weight_N: float
    stall_mps: float | None = None
    stall_margin: float = 1.2
    speed: Speed | Objective | None = None
    climb_mps: float | None = None
    idle_W: float | None = None
    sure: float = 0.95
    power_sd: float = 0.03


class LegResult(msgspec.Struct, frozen=True, kw_only=True):
    """One leg. Airspeed is equivalent; ground speed is in the mean wind; charge_left is a share (0 to 1) at its end."""

    name: str
    course_deg: float | None
    distance_m: float
    height_m: float
    airspeed_mps: float
    ground_speed_mps: float | None
    time_s: Interval
    energy_Wh: Interval
    charge_left: Interval
    probability_home: float  # of flying straight home from its end, with the reserve left


class NoReturn(msgspec.Struct, frozen=True, kw_only=True):
    """The last point of the route from which the direct way home is safe."""

    leg: str
    route_m: float
    from_home_m: float


class Direction(msgspec.Struct, frozen=True, kw_only=True):
    """How far the aircraft can go and return in one direction: the median, and the safe distance."""

    course_deg: float
    radius_m: float
    safe_radius_m: float


class RouteResult(msgspec.Struct, frozen=True, kw_only=True):
    """The energy of a route; intervals are 95 % intervals."""

    format: str = "flightpower-route-1"
    legs: list[LegResult]
    time_s: Interval
    energy_Wh: Interval
    charge_left: Interval
    probability: float  # that the route ends with the reserve left
    sure: float
    reserve: float
    no_return: NoReturn | None  # None if the way home is safe everywhere
    headwind_Wh_per_km: Interval
    directions: list[Direction]
    slowest_airspeed_mps: float  # lowest allowed, equivalent
    fastest_airspeed_mps: float
    notes: list[str]
    flights: list[str] = []  # flights whose pool gives the curve; empty for one flight
    losses_of: list[str] = []  # those of `flights` whose power-train losses are used


def predict(results: RouteInput, mission: Mission, flight: Flight, seed: int = 0) -> RouteResult:
    """Predict a route. Raises InputError if the results give no power, or a leg cannot be flown as requested."""
    rng = np.random.default_rng(seed)
    prediction = Route(source_of(results, flight.idle_W, RESOLUTION.draws, rng), mission, flight, rng).result()
    return msgspec.structs.replace(
        prediction,
        flights=[flight.log for flight in results.flights],
        losses_of=results.use.losses_of if results.use else [],
    )


class Route:
    """The legs of a mission with their speeds, and draws of the uncertain quantities."""

    def __init__(self, source: RoutePower, mission: Mission, flight: Flight, rng: np.random.Generator):
        """source: with RESOLUTION.draws draws. Raises InputError if a leg cannot be flown as the mission requires."""
        self.source, self.mission, self.flight = source, mission, flight
        if flight.stall_mps is None:
            self.stall_CL = self.source.largest_CL
        else:
            at_stall = flight.weight_N / (SEA_LEVEL_DENSITY * flight.stall_mps**2 / 2)
            self.stall_CL = at_stall / self.source.reference.wing_area_m2
        unity = np.ones((1, 1))
        wind = flight.wind
        self.nominal = World(self.source.nominal, wind.east_mps * unity, wind.north_mps * unity, unity, unity)
        self.legs = self._legs()
        self.limits = self._limits(self.legs)
        self.V = self._speeds()
        self.legs = self._with_changes_of_speed()
        self.world_draws = self._draw(rng)
        self.capacity_J = flight.battery.energy_J * np.maximum(
            rng.normal(flight.battery.health, flight.battery.health_sd, RESOLUTION.draws), 0.05
        )

    def _legs(self) -> Legs:
        steps, courses = self.mission.steps, courses_rad(self.mission)
        before = [self.mission.start, *(step.to for step in steps)]
        flown: list[float] = []  # courses; a step without distance keeps the previous one
        for course in courses:
            flown.append(course if course is not None else flown[-1] if flown else 0.0)
        turns = np.abs(np.diff(flown, prepend=flown[0]))
        dropped_kg = np.cumsum([0.0, *(step.dropped_kg for step in steps[:-1])])
        weight_N = self.flight.weight_N - GRAVITY_MPS2 * dropped_kg
        if weight_N[-1] - GRAVITY_MPS2 * steps[-1].dropped_kg <= 0:
            raise InputError(f"the mission drops more than the aircraft weighs, {weight_N[0] / GRAVITY_MPS2:.2f} kg")
        heights = np.array([(a.height_m + b.to.height_m) / 2 for a, b in zip(before, steps, strict=False)])
        condition = self._condition(weight_N, heights)
        stall_mps = speed_at(self.stall_CL, condition)
        rate_mps = PATH.climb_over_stall * stall_mps if self.flight.climb_mps is None else self.flight.climb_mps
        return Legs(
            distance_m=np.array([a.distance_m(b.to) for a, b in zip(before, steps, strict=False)]),
            course_rad=np.array(flown),
            climb_m=np.array([b.to.height_m - a.height_m for a, b in zip(before, steps, strict=False)]),
            turn_rad=np.minimum(turns, 2 * pi - turns),
            circle_s=np.array([step.circle_s for step in steps]),
            turns=np.array([step.turns for step in steps]),
            radius_m=np.array([step.radius_m or 0.0 for step in steps]),
            rate_mps=np.broadcast_to(rate_mps, heights.shape),
            condition=condition,
            turn_load=1 / np.cos(MANEUVERS.banks_rad[0]),
        )

    def _condition(self, weight_N: Array, height_m: Array) -> Condition:
        rho, area_m2 = self.flight.air.rho(height_m), self.source.reference.wing_area_m2
        return Condition(weight_N, rho, area_m2)  # type: ignore[arg-type]  # arrays, element by element

    def _limits(self, legs: Legs) -> SpeedLimits:
        return speed_limits(self.source, legs.condition, self.stall_CL, self.flight.stall_margin)

    def _equivalent(self) -> Array:
        """Return the ratio (k,) of equivalent to true airspeed."""
        return np.asarray(np.sqrt(self.legs.condition.rho / SEA_LEVEL_DENSITY))

    def _speeds(self) -> Array:
        """Return true airspeeds (k,). Raises InputError for a speed outside the limits, or beyond full throttle."""
        wanted = self.flight.speed
        best = self._fastest() if wanted is Objective.TIME else self._best(self.legs)
        V, to_equivalent = best.copy(), self._equivalent()
        for i, step in enumerate(self.mission.steps):
            requested = wanted if isinstance(wanted, Speed) else step.speed if wanted is None else None
            if requested is None:
                continue
            V[i] = self._over_ground(requested.mps, i) if requested.over_ground else requested.mps / to_equivalent[i]
            low, high = self.limits.slowest[i] * to_equivalent[i], self.limits.fastest[i] * to_equivalent[i]
            message = f"{step.name}: an airspeed of {V[i] * to_equivalent[i]:.1f} m/s"
            if V[i] * to_equivalent[i] < 0.99 * low:
                raise InputError(
                    f"{message} is below {low:.1f} m/s, the slowest flown with its stall margin;"
                    " fly faster, give the stall speed with --stall, or leave the choice with --speed energy"
                )
            if V[i] * to_equivalent[i] > 1.01 * high:
                raise InputError(
                    f"{message} is above {high:.1f} m/s, the fastest flown; fly slower, or give --speed energy"
                )
        self._check_progress(V)
        possible = self.source.nominal.best_climb_mps(V, self.legs.condition).reshape(-1)
        for step, climb_mps in zip(self.mission.steps, possible, strict=True):
            if not climb_mps > 0:
                raise InputError(
                    f"{step.name}: its airspeed needs more than full throttle; fly slower, or with less weight"
                )
        self.legs = replace(self.legs, rate_mps=np.minimum(self.legs.rate_mps, MARGINS.fastest * possible))
        self._check_circles(V)
        return V

    def _check_progress(self, V: Array) -> None:
        """Raise InputError for a leg on which the mean wind leaves no speed over the ground."""
        wind, course = self.flight.wind, self.legs.course_rad
        over_ground = ground_speed(V, course, self.nominal.wind_east_mps, self.nominal.wind_north_mps)[0]
        head = -(wind.east_mps * np.sin(course) + wind.north_mps * np.cos(course))
        across = np.abs(wind.east_mps * np.cos(course) - wind.north_mps * np.sin(course))
        for i in np.flatnonzero(np.isnan(over_ground) & (self.legs.distance_m > 0)):
            parts = ((head[i], "of head wind"), (across[i], "across"))
            blown = " and ".join(f"{mps:.0f} m/s {words}" for mps, words in parts if mps >= 0.5)
            raise InputError(
                f"{self.mission.steps[i].name} cannot be flown: {blown}, {V[i]:.0f} m/s of airspeed;"
                " wait for less wind, or fly faster"
            )

    def _check_circles(self, V: Array) -> None:
        """Raise InputError for a circle so tight that its load factor uses up the stall margin of a turn."""
        tightest = np.sqrt((self.legs.turn_load * np.maximum(V / self.limits.slowest, 1.0) ** 2) ** 2 - 1)
        for step, v, most in zip(self.mission.steps, V, tightest, strict=True):
            radius_m = step.radius_m
            if radius_m and (step.turns or step.circle_s) and v**2 / (GRAVITY_MPS2 * radius_m) > most:
                raise InputError(
                    f"{step.name}: a circle of {radius_m:.0f} m at {v:.1f} m/s leaves no stall margin;"
                    f" make it {v**2 / (GRAVITY_MPS2 * most):.0f} m or more"
                )

    def _over_ground(self, mps: float, i: int) -> float:
        """Return the true airspeed that gives this ground speed in the mean wind."""
        course, wind = self.legs.course_rad[i], self.flight.wind
        return float(np.hypot(mps * np.sin(course) - wind.east_mps, mps * np.cos(course) - wind.north_mps))

    def _best(self, legs: Legs) -> Array:
        return best_speeds(legs, self._limits(legs), self.nominal, self.flight.battery)

    def _fastest(self) -> Array:
        """Return the fastest speeds (k,) within the limits that full throttle can hold."""
        low, high = self.limits
        V = high + np.linspace(0.0, 1.0, 201)[:, None] * (low - high)
        holds = self.source.nominal.best_climb_mps(V, self.legs.condition) > 0
        return np.asarray(V[np.argmax(holds, axis=0), np.arange(len(self.legs))])

    def _with_changes_of_speed(self) -> Legs:
        begins = np.array([0.0 if step.launched else np.nan for step in self.mission.steps])
        before = np.concatenate([self.V[:1], self.V[:-1]])
        V_before = np.where(np.isnan(begins), before, begins)
        return replace(self.legs, climb_m=self.legs.climb_m + (self.V**2 - V_before**2) / (2 * GRAVITY_MPS2))

    def _draw(self, rng: np.random.Generator) -> World:
        wind = self.flight.wind
        heights = np.array([step.to.height_m for step in self.mission.steps])
        _, seconds = energy_and_time(self.legs, self.V, self.nominal, self.flight.battery)
        sigma_mps = mean_wind_sigma(wind.mps, np.maximum(heights, 1.0), self.V, seconds[0])
        mean = rng.normal(0.0, wind.sd_mps, (2, RESOLUTION.draws, 1))
        of_legs = sigma_mps * rng.standard_normal((2, RESOLUTION.draws, len(self.legs)))
        return World(
            self.source.power_draws,
            wind.east_mps + mean[0] + of_legs[0],
            wind.north_mps + mean[1] + of_legs[1],
            1 + GPS.scale_sigma * rng.standard_normal((RESOLUTION.draws, 1)),
            np.maximum(1 + self.flight.power_sd * rng.standard_normal((RESOLUTION.draws, 1)), 0.1),
        )

    def left(self) -> tuple[Array, Array, Array]:
        """Energy [J] and time [s] of each leg, and the charge left at its end as a share; each (n, k)."""
        energy_J, seconds = energy_and_time(self.legs, self.V, self.world_draws, self.flight.battery)
        return energy_J, seconds, np.maximum(1 - np.cumsum(energy_J, axis=1) / self.capacity_J[:, None], -np.inf)

    def result(self) -> RouteResult:
        energy_J, seconds, left = self.left()
        battery, steps, to_equivalent = self.flight.battery, self.mission.steps, self._equivalent()
        over_ground = ground_speed(
            self.V, self.legs.course_rad, self.nominal.wind_east_mps, self.nominal.wind_north_mps
        )
        home_J = self._home_J([step.to for step in steps], np.asarray(self.legs.condition.weight_N))
        with np.errstate(invalid="ignore"):
            home = np.mean(left - home_J / self.capacity_J[:, None] >= battery.reserve, axis=0)
        legs = [
            LegResult(
                name=step.name,
                course_deg=float(np.degrees(course) % 360) if distance > 0 else None,
                distance_m=float(distance),
                height_m=step.to.height_m,
                airspeed_mps=float(self.V[i] * to_equivalent[i]),
                ground_speed_mps=float(over_ground[0, i]) if distance > 0 and np.isfinite(over_ground[0, i]) else None,
                time_s=interval_of(seconds[:, i]),
                energy_Wh=interval_of(energy_J[:, i] / 3600),
                charge_left=interval_of(left[:, i]),
                probability_home=float(home[i]),
            )
            for i, (step, course, distance) in enumerate(
                zip(steps, self.legs.course_rad, self.legs.distance_m, strict=True)
            )
        ]
        return RouteResult(
            legs=legs,
            time_s=interval_of(seconds.sum(axis=1)),
            energy_Wh=interval_of(energy_J.sum(axis=1) / 3600),
            charge_left=legs[-1].charge_left,
            probability=float(np.mean(left[:, -1] >= battery.reserve)),
            sure=self.flight.sure,
            reserve=battery.reserve,
            no_return=self._no_return(energy_J),
            headwind_Wh_per_km=self._headwind(),
            directions=self._directions(),
            slowest_airspeed_mps=float(np.max(self.limits.slowest * to_equivalent)),
            fastest_airspeed_mps=float(np.min(self.limits.fastest * to_equivalent)),
            notes=list(self.mission.notes),
        )

    def _straight_J(self, distance_m: Array, course_rad: Array, condition: Condition) -> Array:
        """Return the energy (n, k) [J] of straight level flight at the best speeds, in the mean wind of each draw."""
        legs = straight_legs(distance_m, course_rad, condition, self.legs)
        mean = {
            name: getattr(self.world_draws, name).mean(axis=1, keepdims=True)
            for name in ("wind_east_mps", "wind_north_mps")
        }
        return energy_and_time(legs, self._best(legs), replace(self.world_draws, **mean), self.flight.battery)[0]

    def _home_J(self, places: list[Place], weight_N: Array) -> Array:
        """Return the energy (n, k) [J] to fly straight home from each place at its height."""
        distance_m = np.array([place.distance_m(HOME) for place in places])
        course_rad = np.array([np.arctan2(-place.east_m, -place.north_m) for place in places])
        heights = np.array([place.height_m for place in places])
        return self._straight_J(distance_m, course_rad, self._condition(weight_N, heights))

    def _no_return(self, energy_J: Array) -> NoReturn | None:
        """Return the last point before the first one from which the direct way home is unsafe; None if all are safe."""
        share = np.arange(1, RESOLUTION.points_per_leg + 1) / RESOLUTION.points_per_leg
        before = [self.mission.start, *(step.to for step in self.mission.steps)]
        places = [
            Place(*(a + s * (b - a) for a, b in zip(start, end, strict=True)))
            for start, end in pairwise(before)
            for s in share
        ]
        weight_N = np.repeat(np.asarray(self.legs.condition.weight_N), RESOLUTION.points_per_leg)
        spent_J = np.cumsum(np.pad(energy_J[:, :-1], ((0, 0), (1, 0))), axis=1)[:, :, None]  # spent before each leg
        spent_J = spent_J + energy_J[:, :, None] * share  # infinite in draws where a leg cannot be flown
        need_J = spent_J.reshape(RESOLUTION.draws, -1) + self._home_J(places, weight_N)
        usable_J = (1 - self.flight.battery.reserve) * self.capacity_J[:, None]
        safe = np.mean(need_J <= usable_J, axis=0) >= self.flight.sure
        if safe.all():
            return None
        last = int(np.argmin(safe)) - 1
        way_m = np.concatenate([d * share for d in self.legs.distance_m]) + np.repeat(
            np.cumsum(self.legs.distance_m) - self.legs.distance_m, RESOLUTION.points_per_leg
        )
        place = places[last] if last >= 0 else self.mission.start
        return NoReturn(
            leg=self.mission.steps[max(last, 0) // RESOLUTION.points_per_leg].name,
            route_m=float(way_m[last]) if last >= 0 else 0.0,
            from_home_m=place.distance_m(HOME),
        )

    def _cruise(self, count: int) -> Condition:
        """Return the condition with the start weight at the mean height of the legs, `count` times."""
        height_m = float(np.mean([step.to.height_m for step in self.mission.steps]))
        return self._condition(np.full(count, self.flight.weight_N), np.full(count, height_m))

    def _headwind(self) -> Interval:
        wind = self.flight.wind
        course = np.array([np.arctan2(-wind.east_mps, -wind.north_mps)])
        return interval_of(self._straight_J(np.array([1000.0]), course, self._cruise(1))[:, 0] / 3600)

    def _directions(self) -> list[Direction]:
        course = np.arange(RESOLUTION.directions) * 2 * pi / RESOLUTION.directions
        out_J = self._straight_J(np.full(RESOLUTION.directions, 1000.0), course, self._cruise(RESOLUTION.directions))
        there_and_back_J = out_J + np.roll(out_J, RESOLUTION.directions // 2, axis=1)
        radius_m = 1000.0 * (1 - self.flight.battery.reserve) * self.capacity_J[:, None] / there_and_back_J
        safe = np.quantile(radius_m, 1 - self.flight.sure, axis=0, method="inverted_cdf")
        return [
            Direction(course_deg=float(np.degrees(c)), radius_m=float(middle), safe_radius_m=float(low))
            for c, middle, low in zip(course, np.median(radius_m, axis=0), safe, strict=True)
        ]


def mean_wind_sigma(wind_mps: float, height_m: Array, V: Array, seconds: Array) -> Array:
    """Return the standard deviation (k,) [m/s] of a wind component's mean over a leg, about its mean over the flight.

    The turbulence is Dryden's for the wind at these heights above ground: sigma_w is a tenth of the wind at 20 ft,
    which follows from the given wind by the logarithmic profile.
    """
    at_20_ft = wind_mps * dryden.mean_wind_profile(6.1) / dryden.mean_wind_profile(height_m)
    gust = dryden.longitudinal(0.1 * np.asarray(at_20_ft), height_m, V)  # type: ignore[arg-type]  # elementwise
    turns_over = np.maximum(np.nan_to_num(seconds, posinf=1e9), 1e-3) / gust.time_s
    return np.asarray(gust.sigma_mps * np.sqrt(2 / turns_over * (1 - (1 - np.exp(-turns_over)) / turns_over)))
