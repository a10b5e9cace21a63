"""The classic methods from steady level points, which are means over steady runs: PIW-VIW (2.1)-(2.6), W/delta (2.11).

Speed comes from the trajectory and power from the uncorrected propeller table, so a difference between these points and
the dynamic method shows a wrong table.

PIW-VIW makes power and speed independent of weight and density. PIW VIW = m0 VIW^4 + b0 is a straight line only for a
polar with least drag at zero lift; a CL_minD adds a term m1 VIW^2. Both forms are linear in the polar:
m0 = rho_sl S A0/2, m1 = W_s A1, b0 = 2 W_s^2 A2/(rho_sl S).

W/delta: drag and weight, each over the pressure ratio, form one curve over Mach number. The low-subsonic form (2.13)
uses speed and temperature instead; both forms lack a CL_minD.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from flightpower.analysis.maneuvers.kinds import STEADY, Maneuver
from flightpower.analysis.methods.causes import CAUSES
from flightpower.analysis.methods.method import Method, SteadyPoint
from flightpower.analysis.methods.regression import THREE_TERM, TWO_TERM, PointRegression, Tables, rows_of
from flightpower.analysis.methods.settings import REGRESSION, STEADY_POINTS
from flightpower.analysis.records.flight import Cause
from flightpower.analysis.settings import EVIDENCE, FLOWN
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import GAS_CONSTANT_AIR, SEA_LEVEL_DENSITY, SEA_LEVEL_PRESSURE_PA
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g

COLUMNS = (
    "thrust_x_over_m_mps2", "alpha", "V", "Vdot", "gamma", "climb", "bank", "rho", "static_Pa", "temperature_K",
)  # fmt: skip


class SteadyMeans(NamedTuple):
    """Means over n steady runs; each array is (n,), or (k, n) for k tables."""

    V: Array  # true airspeed [m/s]
    power_W: Array  # T V cos(alpha) (3.47), less the rates of kinetic and potential energy
    power_error_W: Array  # its standard error
    lift_N: Array  # weight over the cosine of bank, less T sin(alpha)
    rho: Array  # [kg/m^3]
    static_Pa: Array
    temperature_K: Array
    start_s: Array

    def lift_coefficient(self, aircraft: Aircraft) -> Array:
        return np.asarray(2 * self.lift_N / (self.rho * self.V**2 * aircraft.geometry.wing_area_m2))


def steady_means(tables: Tables, runs: list[Maneuver], aircraft: Aircraft) -> SteadyMeans:
    """The means of all steady runs. Raises InputError when none has thrust data."""
    m = aircraft.mass_kg
    t_s, values = tables.t_s, {name: tables.columns[name] for name in COLUMNS}
    gust_mps, gust_s = (float(tables.columns[name].flat[0]) for name in ("gust_mps", "gust_s"))
    rows = []
    for run in runs:
        within = rows_of(t_s, run)
        missing = np.isnan(values["thrust_x_over_m_mps2"][..., within])
        finite = ~missing.reshape(-1, missing.shape[-1]).any(axis=0)
        if finite.sum() < REGRESSION.fewest_blocks:
            continue
        t, f = t_s[within][finite], {name: column[..., within][..., finite] for name, column in values.items()}
        thrust_over_m, alpha, V = f["thrust_x_over_m_mps2"], f["alpha"], f["V"]
        along_V, across_V = thrust_over_m * np.cos(alpha), thrust_over_m * np.sin(alpha)
        mean_Vdot = _slope(t, V)
        drag_over_m = along_V - f["Vdot"] - g * np.sin(f["gamma"])
        power_W = m * (_mean(along_V * V) - mean_Vdot * V.mean(axis=-1) - g * _mean(f["climb"]))
        scatter_W = m * _error_of_mean(drag_over_m * V, t[1] - t[0])
        gusts_W = m * g * mean_gust_mps(gust_mps, gust_s, t[-1] - t[0])
        error_W = np.sqrt(scatter_W**2 + gusts_W**2 + (EVIDENCE.negligible * power_W) ** 2)
        lift_N = m * _mean(g / np.cos(f["bank"]) - across_V)
        air = (_mean(f[name]) for name in ("rho", "static_Pa", "temperature_K"))
        rows.append(np.broadcast_arrays(V.mean(axis=-1), power_W, error_W, lift_N, *air, run.start_s))
    if not rows:
        raise InputError("no steady point has thrust data")
    return SteadyMeans(*(np.stack(column, axis=-1) for column in zip(*rows, strict=True)))


def _mean(x: Array) -> Array:
    """The mean (…) of those values (…, n) that are not NaN."""
    mean = x.mean(axis=-1)
    return np.asarray(mean if np.isfinite(mean).all() else np.nansum(x, axis=-1) / np.isfinite(x).sum(axis=-1))


def _slope(t: Array, x: Array) -> Array:
    """Slope (…) of the least-squares line of x (…, n) over t (n,)."""
    from_mean = t - t.mean()
    return np.asarray((x - x.mean(axis=-1, keepdims=True)) @ from_mean / (from_mean @ from_mean))


def require_speeds(points: SteadyMeans, terms: int) -> None:
    """Raises InputError unless all powers are positive and there are as many different speeds as terms to fit."""
    if np.any(points.power_W <= 0):
        raise InputError("by the propeller table a steady point has no positive power")
    different = min(_different(V) for V in np.atleast_2d(points.V))
    if different < terms:
        raise InputError(f"steady points at {terms} different speeds are needed, there are {different}")


def _different(speeds: Array) -> int:
    """The number of clearly different speeds among these (n,)."""
    different, last = 0, 0.0
    for V in np.sort(speeds):
        if V > last * (1 + 2 * FLOWN.nearby):
            different, last = different + 1, V
    return different


def steady_points(tables: Tables, runs: list[Maneuver], aircraft: Aircraft) -> list[SteadyPoint]:
    """The steady points as lift and drag coefficients, which hold for any weight and density."""
    points = steady_means(tables, runs, aircraft)
    unit_W = points.rho * points.V**3 * aircraft.geometry.wing_area_m2 / 2  # power at C_D = 1
    columns = (
        points.lift_coefficient(aircraft),
        points.power_W / unit_W,
        points.power_error_W / unit_W,
        points.start_s,
    )
    return [SteadyPoint(*(float(x) for x in row)) for row in zip(*columns, strict=True)]


def mean_gust_mps(gust_mps: float, gust_s: float, seconds: float) -> float:
    """Standard deviation [m/s] of the vertical gust w averaged over `seconds`; such a gust adds the power W w.

    For a first-order process with standard deviation sigma and time constant T it is sigma sqrt(2 T/seconds).
    """
    return float(gust_mps * np.sqrt(min(1.0, 2 * gust_s / seconds)))


def _error_of_mean(x: Array, step_s: float) -> Array:
    """Standard error (…) of the mean of colored records (…, n), with a Bartlett window over
    `STEADY_POINTS.correlation_s`."""
    e, n = x - x.mean(axis=-1, keepdims=True), x.shape[-1]
    window = min(n - 1, round(STEADY_POINTS.correlation_s / step_s))
    variance = np.sum(e**2, axis=-1)
    for lag in range(1, window + 1):
        variance = variance + 2 * (1 - lag / (window + 1)) * np.sum(e[..., lag:] * e[..., :-lag], axis=-1)
    return np.asarray(np.sqrt(np.maximum(variance / n, 0.0) / n))


def steady_method(
    name: str,
    title: str,
    equations: str,
    terms: Array,
    regression: Callable[[SteadyMeans, Aircraft], tuple[Array, Array]],
) -> Method:
    """A classic method: a linear regression of power or drag at steady points, with the uncorrected propeller table.

    terms : columns (3, k) of the polar's A that it fits
    regression : function of (points, aircraft) that gives X (n, 3) and z (n,), which is proportional to power
    """

    def point_regression(tables: Tables, runs: list[Maneuver], aircraft: Aircraft) -> PointRegression:
        points = steady_means(tables, runs, aircraft)
        require_speeds(points, terms.shape[1])
        X, z = regression(points, aircraft)
        sigma = z * points.power_error_W / points.power_W
        return PointRegression(X, z, sigma, terms, points.lift_coefficient(aircraft))

    return Method(
        name=name,
        title=title,
        equations=equations,
        kinds=(STEADY,),
        taken_as_measured=CAUSES[Cause.PROPELLER_TABLE],
        regression=point_regression,
        points=steady_points,
        two_term=terms is TWO_TERM,
    )


def piw_viw(points: SteadyMeans, aircraft: Aircraft) -> tuple[Array, Array]:
    """PIW (2.5) [W] and VIW (2.3) [m/s], each (n,), for the aircraft's standard weight at sea level."""
    sigma, w = points.rho / SEA_LEVEL_DENSITY, points.lift_N / aircraft.mass.standard_weight_N
    return points.power_W * np.sqrt(sigma) / w**1.5, points.V * np.sqrt(sigma / w)


def _piw_viw_regression(points: SteadyMeans, aircraft: Aircraft) -> tuple[Array, Array]:
    PIW, VIW = piw_viw(points, aircraft)
    S, Ws = aircraft.geometry.wing_area_m2, aircraft.mass.standard_weight_N
    q = SEA_LEVEL_DENSITY * S / 2
    return np.stack([q * VIW**4, Ws * VIW**2, np.full_like(VIW, Ws**2 / q)], axis=-1), PIW * VIW


PIW_VIW_THREE = steady_method(
    "piw-viw", "PIW-VIW, three terms", "(2.1)-(2.6) with the term in VIW^2", THREE_TERM, _piw_viw_regression
)
PIW_VIW_TWO = steady_method("piw-viw-two-term", "PIW-VIW, two terms", "(2.1)-(2.6)", TWO_TERM, _piw_viw_regression)


def _w_delta_regression(points: SteadyMeans, qS_over_delta_N: Array) -> tuple[Array, Array]:
    """The regression D/delta = A0 (q S/delta) + A2 (W/delta)^2 / (q S/delta)."""
    delta = points.static_Pa / SEA_LEVEL_PRESSURE_PA
    lift_over_delta = points.lift_N / delta
    X = np.stack([qS_over_delta_N, lift_over_delta, lift_over_delta**2 / qS_over_delta_N], axis=-1)
    return X, points.power_W / points.V / delta


def mach_form(points: SteadyMeans, aircraft: Aircraft) -> tuple[Array, Array]:
    """The regression (2.11), over Mach number."""
    gamma = 1.4  # ratio of specific heats of air
    M = points.V / np.sqrt(gamma * GAS_CONSTANT_AIR * points.temperature_K)
    return _w_delta_regression(points, gamma * SEA_LEVEL_PRESSURE_PA * M**2 * aircraft.geometry.wing_area_m2 / 2)


def speed_form(points: SteadyMeans, aircraft: Aircraft) -> tuple[Array, Array]:
    """The regression (2.13), over true airspeed and temperature."""
    q_over_delta_Pa = SEA_LEVEL_PRESSURE_PA * points.V**2 / (2 * GAS_CONSTANT_AIR * points.temperature_K)
    return _w_delta_regression(points, q_over_delta_Pa * aircraft.geometry.wing_area_m2)


W_DELTA = steady_method("w-delta", "W/δ", "(2.11)", TWO_TERM, mach_form)
W_DELTA_SLOW = steady_method("w-delta-low-subsonic", "W/δ, low-subsonic", "(2.13)", TWO_TERM, speed_form)
