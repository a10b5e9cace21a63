"""PIW-VIW: power and speed made independent of weight and density, from steady level points (2.1-2.6).

PIW VIW = m0 VIW^4 + b0 is a straight line only for a polar whose drag is least at no lift; with CL_minD a term
m1 VIW^2 appears. Both forms are linear in the polar: m0 = rho_sl S A0/2, m1 = W_s A1, b0 = 2 W_s^2 A2/(rho_sl S).

Speed comes from the path, power from the propeller's table as it is: where these points and the dynamic method differ,
the table is wrong.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.method import Method
from analysis.drag.regression import THREE_TERM, TWO_TERM, Point, Points
from analysis.drag.sensor_errors import lifted_mps
from analysis.maneuvers.kinds import STEADY, Maneuver
from flight.aircraft import Aircraft
from flight.atmosphere import GRAVITY_MPS2 as g
from flight.atmosphere import SEA_LEVEL_DENSITY
from flight.errors import InputError

Array = NDArray[np.float64]

ALIKE_S = 2.0  # readings closer than this are not independent
TABLE_SHARE = 0.005  # what a table is good to between its lines: a point's power is known no better
APART = 0.08  # speeds that differ by more than this, relatively, count as two


class Steady(NamedTuple):
    """Steady points, each (n,): means over a stretch."""

    V: Array  # true airspeed [m/s]
    power: Array  # T V cos(alpha) (3.47), less what went into speed and height [W]
    error: Array  # its standard error [W]
    lift: Array  # what the wing carries: weight less T sin(alpha), over the cosine of bank [N]
    rho: Array
    static_Pa: Array
    temperature_K: Array
    start_s: Array


def steady_points(given: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft) -> Steady:
    """The points of all steady runs. Raises InputError when not one has thrust data."""
    m = aircraft.mass_kg
    rows = []
    for run in runs:
        f = given.loc[run.start_s : run.end_s]
        f = f[f["thrust"].notna()]
        if len(f) < 10:
            continue
        pull, rise = f["thrust"] * np.cos(f["alpha"]), f["thrust"] * np.sin(f["alpha"])
        t, V = f.index.to_numpy(), f["V"].to_numpy()
        gained = np.polyfit(t - t[0], V, 1)[0]
        excess = pull - f["Vdot"] - g * np.sin(f["gamma"])
        power = m * float((pull * V).mean() - gained * V.mean() - g * f["climb"].mean())
        shown = m * _error_of_mean((excess * V).to_numpy(), t[1] - t[0])
        lifted = m * g * lifted_mps(given, t[-1] - t[0])
        error = np.sqrt(shown**2 + lifted**2 + (TABLE_SHARE * power) ** 2)
        lift = m * float((g / np.cos(f["bank"]) - rise).mean())
        air = (float(f[name].mean()) for name in ("rho", "static_Pa", "temperature_K"))
        rows.append((V.mean(), power, error, lift, *air, run.start_s))
    if not rows:
        raise InputError("no steady point has thrust data")
    return Steady(*np.array(rows).T)


def piw_viw(points: Steady, aircraft: Aircraft) -> tuple[Array, Array]:
    """PIW (2.5) [W] and VIW (2.3) [m/s], each (n,), for the aircraft's standard weight at sea level."""
    sigma, w = points.rho / SEA_LEVEL_DENSITY, points.lift / aircraft.mass.standard_weight_N
    return points.power * np.sqrt(sigma) / w**1.5, points.V * np.sqrt(sigma / w)


def _problem(terms: Array):
    def problem(given: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft) -> Points:
        points = steady_points(given, runs, aircraft)
        enough(points, terms.shape[1])
        PIW, VIW = piw_viw(points, aircraft)
        S, Ws = aircraft.geometry.wing_area_m2, aircraft.mass.standard_weight_N
        q = SEA_LEVEL_DENSITY * S / 2
        X = np.stack([q * VIW**4, Ws * VIW**2, np.full_like(VIW, Ws**2 / q)], axis=1)
        z = PIW * VIW
        return Points(X, z, z * points.error / points.power, terms, lift_coefficient(points, aircraft))

    return problem


def enough(points: Steady, terms: int) -> None:
    """Raises InputError unless there are as many different speeds as terms to fit, and positive powers."""
    if np.any(points.power <= 0):
        raise InputError("a steady point has no positive power: the propeller's table gives no thrust there")
    different, last = 0, 0.0
    for V in np.sort(points.V):
        if V > last * (1 + APART):
            different, last = different + 1, V
    if different < terms:
        raise InputError(f"steady points at {terms} different speeds are needed, there are {different}")


def lift_coefficient(points: Steady, aircraft: Aircraft) -> Array:
    return 2 * points.lift / (points.rho * points.V**2 * aircraft.geometry.wing_area_m2)


def as_points(given: pd.DataFrame, runs: list[Maneuver], aircraft: Aircraft) -> list[Point]:
    """The steady points as lift and drag coefficients, which hold for any weight and density."""
    points = steady_points(given, runs, aircraft)
    unit = points.rho * points.V**3 * aircraft.geometry.wing_area_m2 / 2
    columns = (lift_coefficient(points, aircraft), points.power / unit, points.error / unit, points.start_s)
    return [Point(*(float(x) for x in row)) for row in zip(*columns, strict=True)]


def _error_of_mean(x: Array, step_s: float) -> float:
    """Standard error of the mean of a coloured record, by Bartlett's window over ALIKE_S."""
    e, n = x - x.mean(), len(x)
    window = min(n - 1, round(ALIKE_S / step_s))
    variance = float(e @ e) / n
    for lag in range(1, window + 1):
        variance += 2 * (1 - lag / (window + 1)) * float(e[lag:] @ e[:-lag]) / n
    return float(np.sqrt(max(variance, 0.0) / n))


PIW_VIW_THREE = Method(
    name="piw-viw",
    title="PIW-VIW, three terms",
    equations="(2.1)-(2.6) with the term in VIW^2",
    kinds=(STEADY,),
    takes=("thrust_scale", "thrust_slope"),
    problem=_problem(THREE_TERM),
    points=as_points,
)
PIW_VIW_TWO = Method(
    name="piw-viw-two-term",
    title="PIW-VIW, two terms",
    equations="(2.1)-(2.6)",
    kinds=(STEADY,),
    takes=("thrust_scale", "thrust_slope"),
    problem=_problem(TWO_TERM),
    points=as_points,
    two_term=True,
)
