"""The curve of power required or electrical power over airspeed, with its interval and its best speeds.

Power required is linear in the coefficients of C_D = A0 + A1 C_L + A2 C_L^2, so its intervals need no linearization.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum, auto
from functools import cached_property
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightpower.analysis.records.flight import (
    CurveResult,
    Interval,
    Kind,
    PowerPoint,
    PowerStatistics,
    SpeedInterval,
    SpeedReason,
)
from flightpower.analysis.settings import CURVES
from flightpower.analysis.uncertain import Uncertain, variances
from flightpower.flight.arrays import Array


class Condition(NamedTuple):
    """Weight of the aircraft [N], density of the air [kg/m^3], and wing area [m^2]."""

    weight_N: float
    rho: float
    wing_area_m2: float


POLAR = ("A0", "A1", "A2")  # these come first in every vector of parameters with a drag polar


class Polar(NamedTuple):
    """C_D = A0 + A1 C_L + A2 C_L^2 ; A (3,), and its covariance (3, 3)."""

    A: Array
    covariance: Array


def polar_part(array: Array) -> Array:
    """Return the part for POLAR, (3,) or (3, 3), of a vector of parameters (m,) or of a covariance (m, m)."""
    return array[tuple(slice(len(POLAR)) for _ in array.shape)]


def drag_coefficient(A: Array, CL: ArrayLike) -> Array:
    """Return C_D at C_L, by the polar A (3,)."""
    A0, A1, A2 = A
    CL = np.asarray(CL)
    return np.asarray(A0 + A1 * CL + A2 * CL**2)


class ClassicPolar(NamedTuple):
    """A polar written as C_D = CD0 + K (C_L - CL_minD)^2 (3.36), with Oswald's e (1.4)."""

    CD0: float
    K: float
    CL_minD: float
    oswald: float


def lift_coefficient(V: ArrayLike, condition: Condition) -> Array:
    """C_L at which lift equals weight at true airspeed V [m/s]."""
    return 2 * condition.weight_N / (condition.rho * np.square(V) * condition.wing_area_m2)


def speed_at(CL: ArrayLike, condition: Condition) -> Array:
    """True airspeed [m/s] at which lift equals weight at C_L."""
    return np.sqrt(2 * condition.weight_N / (condition.rho * np.asarray(CL) * condition.wing_area_m2))


def inside(x: Array, ends: tuple[float, float]) -> NDArray[np.bool_]:
    """Mark the speeds or lift coefficients (n,) between two ends; the ends count as inside despite rounding."""
    low, high = ends
    return np.asarray((x >= low * (1 - 1e-9)) & (x <= high * (1 + 1e-9)))


def drag_terms(CL: Array) -> Array:
    """Derivative (n, 3) of the drag coefficient at C_L (n,) with respect to the coefficients of the polar."""
    return np.stack([np.ones_like(CL), CL, CL**2], axis=1)


def drag_and_error(polar: Polar, CL: Array) -> tuple[Array, Array]:
    """Drag coefficient and its standard error, each (n,), at C_L (n,)."""
    terms = drag_terms(CL)
    return terms @ polar.A, np.sqrt(variances(terms, polar.covariance))


def unphysical(polar: Polar, flown_CL: tuple[float, float]) -> str:
    """The reason why a drag polar is unphysical over the lift coefficients flown; empty if it is physical."""
    CL = np.linspace(*flown_CL, 61)
    if not np.isfinite(polar.covariance).all():
        return "the range of lift coefficients flown is too narrow to determine the drag polar"
    _, _, A2 = polar.A
    if A2 <= 0:
        return "the drag polar curves downward"
    if np.min(drag_coefficient(polar.A, CL)) <= 0:
        return "drag is negative"
    return ""


def power_required(V: ArrayLike, polar: Polar, condition: Condition) -> tuple[Array, Array]:
    """Power required in level flight (3.45) and its standard error [W], each (n,), at speeds V (n,) [m/s]."""
    gradient = power_gradient(V, condition)
    return gradient @ polar.A, np.sqrt(variances(gradient, polar.covariance))


def power_gradient(V: ArrayLike, condition: Condition) -> Array:
    """Derivative (n, 3) of power required at speeds V (n,) [m/s] with respect to the coefficients of the polar."""
    V = np.asarray(V, dtype=float)
    CL = lift_coefficient(V, condition)
    unit_W = condition.rho * V**3 * condition.wing_area_m2 / 2
    return np.asarray(unit_W[:, None] * drag_terms(CL))


def minimum_power_lift(A: Array) -> float:
    """C_L of least power, where C_D/C_L^1.5 is least: A2 C_L^2 - A1 C_L - 3 A0 = 0, so 3 CD0 = CDi if A1 = 0 (1.6).

    NaN if there is none.
    """
    A0, A1, A2 = A
    root = A1**2 + 12 * A0 * A2
    return float((A1 + np.sqrt(root)) / (2 * A2)) if root >= 0 and A2 > 0 and A0 > 0 else np.nan


def best_range_lift(A: Array) -> float:
    """C_L of least drag at constant weight, where C_D/C_L is least: A2 C_L^2 = A0, so CD0 = CDi if A1 = 0 (1.10).

    NaN if there is none.
    """
    A0, _, A2 = A
    return float(np.sqrt(A0 / A2)) if A0 > 0 and A2 > 0 else np.nan


class SpeedWithInterval(NamedTuple):
    """A speed and its 95 % interval."""

    speed_mps: float
    lo_mps: float
    hi_mps: float


def optimum_speed(
    lift_of: Callable[[Array], float], polar: Polar, condition: Condition, seed: int = 0
) -> SpeedWithInterval:
    """Return the speed at the C_L that `lift_of(A)` computes, with a 95 % interval from random draws of the polar.

    A draw that has no such speed counts as speed 0 if its drag without lift is positive, because its curve then falls
    towards speed 0. Otherwise its curve falls towards high speed, and it counts as the fastest of all other draws.
    """
    draws = np.random.default_rng(seed).multivariate_normal(polar.A, polar.covariance, 4000, method="eigh")
    CL = np.array([lift_of(A) for A in draws])
    speed = speed_at(np.where(CL > 0, CL, np.nan), condition)
    fastest = np.max(speed, initial=0.0, where=np.isfinite(speed))
    speed = np.where(np.isfinite(speed), speed, np.where(draws[:, 0] > 0, 0.0, fastest))
    lo, hi = np.percentile(speed, [2.5, 97.5])
    return SpeedWithInterval(float(speed_at(lift_of(polar.A), condition)), float(lo), float(hi))


def classic_form(A: Array, aspect_ratio: float) -> ClassicPolar:
    """CD0, K, CL_minD and Oswald's e of a polar (3.36)."""
    A0, A1, A2 = A
    CL_minD = -A1 / (2 * A2)
    return ClassicPolar(float(A0 - A2 * CL_minD**2), float(A2), float(CL_minD), float(1 / (np.pi * A2 * aspect_ratio)))


def maximum_lift_to_drag(A: Array) -> float:
    """C_L/C_D at the C_L of `best_range_lift`; NaN if none."""
    CL = best_range_lift(A)
    return float(CL / drag_coefficient(A, CL))


class Cost(Enum):
    """The quantity that a best speed minimizes."""

    POWER = auto()  # the best endurance
    ENERGY_PER_METER = auto()  # the best range


def ratios(reference: Condition, condition: Condition, load_factor: Array | float = 1.0) -> tuple[Array, Array]:
    """Return the ratios of speed and of power, without idle power, at `condition` over those at `reference`.

    Both are at the same C_L (VIW and PIW, 2.3 and 2.5), so drag coefficient and efficiency are the same.
    load_factor : load factor at `condition`
    """
    heavier = condition.weight_N * load_factor / reference.weight_N
    thinner = reference.rho / condition.rho * (reference.wing_area_m2 / condition.wing_area_m2)
    return np.asarray(np.sqrt(heavier * thinner)), np.asarray(heavier**1.5 * np.sqrt(thinner))


@dataclass(frozen=True, kw_only=True)
class Curve:
    """Power of level flight at one weight and density.

    V_mps, power_W : (n,)     idle_W : part of power_W that is drawn with the motor off; independent of weight
    extrapolated : (n,) True where power is less certain than its interval says; None if that is so nowhere
    """

    kind: Kind
    condition: Condition
    V_mps: Array
    power_W: Uncertain
    idle_W: float = 0.0
    extrapolated: NDArray[np.bool_] | None = None

    def at(self, condition: Condition) -> Self:
        """Return this curve at another weight, density or wing area, at equal lift coefficients."""
        faster, more = ratios(self.condition, condition)
        value = self.idle_W + more * (self.power_W.value - self.idle_W)
        power = self.power_W.through(more * np.eye(len(value)), value)
        return replace(self, condition=condition, V_mps=faster * self.V_mps, power_W=power)

    def covers(self, V: Array) -> NDArray[np.bool_]:
        """Mark the speeds (n,) that lie within the curve's range of speeds."""
        return inside(V, (self.V_mps[0], self.V_mps[-1]))

    def points(self) -> list[PowerPoint]:
        """The points for results.json; speeds with unknown power or interval are left out."""
        return power_points(self.V_mps, self.power_W.value, self.power_W.half_width, self.extrapolated)

    def best(self, cost: Cost) -> SpeedInterval:
        """The speed of least cost among those of the curve, with its 95 % interval."""
        return speed_of_least(self.V_mps, *(self._costs(cost, power) for power in (self.power_W.value, self._draws)))

    def longest(self, cost: Cost, energy_J: float) -> Interval:
        """The best endurance [s] or range [m] with the energy `energy_J`, and its 95 % interval."""
        least, of_draws = (np.min(self._costs(cost, power), axis=-1) for power in (self.power_W.value, self._draws))
        low, high = np.percentile(energy_J / of_draws, [2.5, 97.5])
        return Interval(value=energy_J / float(least), lo=float(low), hi=float(high))

    @cached_property
    def _draws(self) -> Array:
        """Random draws of the power (400, n), for intervals of best speeds; none is below a tenth of the value."""
        value = self.power_W.value
        draws = np.random.default_rng(0).multivariate_normal(value, self.power_W.covariance, 400, method="eigh")
        return np.asarray(np.maximum(draws, 0.1 * value))

    def _costs(self, cost: Cost, power_W: Array) -> Array:
        return power_W if cost is Cost.POWER else power_W / self.V_mps


def speed_of_least(V: Array, cost: Array, draws: Array) -> SpeedInterval:
    """The speed at which the cost (n,) is least, with an interval that holds it for 95 % of the draws (k, n)."""
    index = int(np.argmin(cost))
    low, high = np.percentile(V[np.argmin(draws, axis=1)], [2.5, 97.5])
    return SpeedInterval(
        speed_mps=float(V[index]),
        lo_mps=float(low) if low > V[0] else None,
        hi_mps=float(high),
        inside_flown_range=0 < index < len(V) - 1,
    )


@dataclass(frozen=True, kw_only=True)
class PolarCurve(Curve):
    """Power required from a drag polar. flown_CL : smallest and largest lift coefficient of its speeds"""

    polar: Polar
    flown_CL: tuple[float, float]

    def best(self, cost: Cost) -> SpeedInterval:
        """The speed of least cost, computed exactly from the polar.

        No speed below the slowest of the curve is given, because the curve there is unknown and the stall may be near.
        """
        lift_of = minimum_power_lift if cost is Cost.POWER else best_range_lift
        smallest_CL, largest_CL = self.flown_CL
        CL = lift_of(self.polar.A)
        if not np.isfinite(CL):
            return _unknown(SpeedReason.NO_OPTIMUM)
        slowest = float(speed_at(largest_CL, self.condition))
        speed, lo, hi = optimum_speed(lift_of, self.polar, self.condition)
        if speed < slowest:
            return _unknown(SpeedReason.BELOW_SLOWEST, hi if hi >= slowest else None)
        return SpeedInterval(
            speed_mps=speed,
            lo_mps=lo if lo >= slowest else None,
            hi_mps=hi,
            inside_flown_range=bool(smallest_CL <= CL <= largest_CL),
            reason=SpeedReason.NONE if lo >= slowest else SpeedReason.INTERVAL_BELOW_SLOWEST,
        )


def _unknown(reason: SpeedReason, hi_mps: float | None = None) -> SpeedInterval:
    return SpeedInterval(speed_mps=None, lo_mps=None, hi_mps=hi_mps, inside_flown_range=False, reason=reason)


def polar_curve(
    polar: Polar,
    condition: Condition,
    flown_CL: tuple[float, float],
    extrapolated: NDArray[np.bool_] | None = None,
) -> PolarCurve:
    """The curve of a drag polar over a range of lift coefficients, at CURVES.points evenly spaced speeds."""
    slowest, fastest = (float(speed_at(CL, condition)) for CL in reversed(flown_CL))
    V = np.linspace(slowest, fastest, CURVES.points)
    return PolarCurve(
        kind=Kind.POWER_REQUIRED,
        condition=condition,
        V_mps=V,
        power_W=Uncertain(polar.A, polar.covariance).through(power_gradient(V, condition)),
        extrapolated=extrapolated,
        polar=polar,
        flown_CL=flown_CL,
    )


def stored_curve(result: CurveResult, wing_area_m2: float, idle_W: float | None = None) -> Curve | None:
    """The electrical curve stored in results, with the errors that flights share; None if it lacks statistics.

    idle_W : replaces the stored value
    """
    statistics = result.statistics
    if not isinstance(statistics, PowerStatistics):
        return None
    shared = {name: np.array(change) for name, change in statistics.shared.items()}
    return Curve(
        kind=Kind.ELECTRICAL,
        condition=Condition(result.condition.weight_N, result.condition.air_density_kgpm3, wing_area_m2),
        V_mps=np.array(statistics.speed_mps),
        power_W=Uncertain(np.array(statistics.power_W), np.array(statistics.own_covariance), shared),
        idle_W=result.idle_power_W if idle_W is None else idle_W,
    )


def power_points(
    V_mps: Array, power_W: Array, half_width_W: Array, extrapolated: Sequence[bool] | NDArray[np.bool_] | None = None
) -> list[PowerPoint]:
    """Points of a curve (n,), without those whose power or interval is not known. No interval reaches below zero."""
    is_extrapolated = [False] * len(V_mps) if extrapolated is None else list(extrapolated)
    return [
        PowerPoint(
            speed_mps=v, power_W=p, power_lo_W=max(p - h, min(p, 0.0)), power_hi_W=p + h, extrapolated=bool(outside)
        )
        for v, p, h, outside in zip(
            V_mps.tolist(), power_W.tolist(), half_width_W.tolist(), is_extrapolated, strict=True
        )
        if np.isfinite(p + h)
    ]
