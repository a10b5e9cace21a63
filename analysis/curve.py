"""Power required from a drag polar, with its interval, and the speeds of least power and least drag.

Power is linear in the coefficients of C_D = A0 + A1 C_L + A2 C_L^2, so that its intervals need no linearization.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flight.arrays import Array


class Condition(NamedTuple):
    """Weight of the aircraft, density of the air [kg/m^3], and wing area."""

    weight_N: float
    rho: float
    wing_area_m2: float


POLAR = ("A0", "A1", "A2")  # first in every vector of parameters with a drag polar


class Polar(NamedTuple):
    """C_D = A0 + A1 C_L + A2 C_L^2 ; A (3,), and its covariance (3, 3)."""

    A: Array
    covariance: Array


def polar_part(array: Array) -> Array:
    """Of POLAR, (3,) or (3, 3), in a vector of parameters (m,) or in a covariance (m, m)."""
    return array[tuple(slice(len(POLAR)) for _ in array.shape)]


def drag_coefficient(A: Array, CL: ArrayLike) -> Array:
    """C_D of a polar A (3,) at C_L."""
    A0, A1, A2 = A
    CL = np.asarray(CL)
    return np.asarray(A0 + A1 * CL + A2 * CL**2)


class ClassicPolar(NamedTuple):
    """The same polar as C_D = CD0 + K (C_L - CL_minD)^2 (3.36), with Oswald's e (1.4)."""

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


def unphysical(polar: Polar, flown_CL: tuple[float, float]) -> str:
    """Why a drag polar is unphysical over the lift coefficients flown; empty where it is not."""
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
    V = np.asarray(V, dtype=float)
    CL = lift_coefficient(V, condition)
    gradient = (condition.rho * V**3 * condition.wing_area_m2 / 2)[:, None] * np.stack(
        [np.ones_like(CL), CL, CL**2], axis=1
    )
    return gradient @ polar.A, np.sqrt(np.einsum("ni,ij,nj->n", gradient, polar.covariance, gradient))


def minimum_power_lift(A: Array) -> float:
    """C_L of least power: C_D/C_L^1.5 least, A2 C_L^2 - A1 C_L - 3 A0 = 0; 3 CD0 = CDi if A1 = 0 (1.6). NaN if none."""
    A0, A1, A2 = A
    root = A1**2 + 12 * A0 * A2
    return float((A1 + np.sqrt(root)) / (2 * A2)) if root >= 0 and A2 > 0 and A0 > 0 else np.nan


def best_range_lift(A: Array) -> float:
    """C_L of least drag at constant weight: C_D/C_L least, A2 C_L^2 = A0; CD0 = CDi if A1 = 0 (1.10). NaN if none."""
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
    """The speed at the C_L that `lift_of(A)` computes, and its 95 % interval by random draws of the polar.

    Draws without such a speed count as the slowest or the fastest: where drag by lift is not positive, the curve falls
    towards speed 0; where drag without lift is not, it falls beyond the fastest speed of all other draws.
    """
    draws = np.random.default_rng(seed).multivariate_normal(polar.A, polar.covariance, 4000, method="eigh")
    CL = np.array([lift_of(A) for A in draws])
    speed = speed_at(np.where(CL > 0, CL, np.nan), condition)
    beyond = np.max(speed, initial=0.0, where=np.isfinite(speed))
    speed = np.where(np.isfinite(speed), speed, np.where(draws[:, 0] > 0, 0.0, beyond))
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
