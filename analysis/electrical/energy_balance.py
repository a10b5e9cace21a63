"""Efficiency from battery to propeller thrust for an unknown motor and propeller.

Propellers are alike when efficiency is drawn against V (rho D^2 / P)^(1/3) = J / c_P^(1/3), relative to its maximum:
the APC 10x5E and 12x8E agree with the form below within 0.02 up to the maximum. Beyond it they differ, and so the fall
is a parameter. The unknown diameter and the motor's losses are in the two scales.

Covariance of the energy balance's residuals.

Air rising at w does the work m g w per second, and a gust u along the path changes the kinetic energy relative to the
air by m V u. Both are first-order noise, averaged by the balance's windows. The efficiency is not exactly a function of
its argument; that error is in proportion to the useful power. The balance with the accelerometer has the same motion of
the air with the opposite sign, and the errors of an angle of attack that follows from C_L.

Energy balance of an ordinary flight (2.23)-(2.26): P eta = D V + dE/dt, averaged over windows.

P is the motor's electrical power, eta its efficiency to thrust, E = m (g h + V^2/2). The derivative is moved to the
window's weight (integration by parts), so nothing noisy is differentiated. C_L comes from the accelerometer.

A second balance, m V a = dE/dt with the specific force a along the path, has the same gusts in its residuals and no
drag: both together show the motion of the air.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.electrical.settings import PRIOR, RESIDUALS, WINDOWS
from flight.units import GRAVITY_MPS2 as g

Array = NDArray[np.float64]


def advance(V: Array, power_W: Array, rho: Array | float) -> Array:
    """V (rho / P)^(1/3), proportional to J / c_P^(1/3) [m^(-2/3)]."""
    return np.asarray(V * np.cbrt(rho / np.maximum(power_W, 1e-3)))


def efficiency(x: Array, maximum: float, x_at_maximum: float, fall: float) -> Array:
    """Thrust times airspeed over the motor's electrical power; zero where the propeller no longer pulls."""
    u = x / x_at_maximum
    rising = 1 - np.abs(1 - np.minimum(u, 1.0)) ** PRIOR.rise_exponent
    falling = 1 - fall * (np.maximum(u, 1.0) - 1) ** 2
    return np.asarray(maximum * np.maximum(np.where(u < 1, rising, falling), 0.0))


def idling(x: Array, x_at_maximum: float, fall: float) -> Array:
    """How far the propeller idles: 0 where it pulls, 1 where it hardly takes power."""
    zero_thrust = 1 + 1 / np.sqrt(fall)
    return np.asarray(np.clip((x / x_at_maximum - zero_thrust) / zero_thrust, 0.0, 1.0))


@dataclass(frozen=True)
class Windows:
    """Windows of one shape. centers_s : (n,)     offsets_s, weight, slope : (k,) weight and its derivative in a window,
    each summing with the step to averages"""

    centers_s: Array
    offsets_s: Array
    weight: Array
    slope: Array


def by_air(windows: Windows, mass_kg: float, V_mps: float, sigma_w_mps: float, time_s: float) -> Array:
    """Covariance (n, n) [W^2] by vertical and longitudinal air motion of this size and correlation time."""
    lags = _lags(windows)
    vertical = (mass_kg * g * sigma_w_mps) ** 2 * _at_lags(lags, windows, windows.weight, time_s)
    along = (mass_kg * V_mps * sigma_w_mps) ** 2 * _at_lags(lags, windows, windows.slope, time_s)
    return np.asarray(vertical + along)


def by_efficiency(windows: Windows, useful_W: Array) -> Array:
    """Covariance (n, n) [W^2] by the form of the efficiency."""
    return np.asarray(
        RESIDUALS.efficiency_share**2 * np.outer(useful_W, useful_W) * np.exp(-_lags(windows) / RESIDUALS.efficiency_s)
    )


def by_angle(windows: Windows, mass_kg: float, V_mps: Array, sigma_rad: float, time_s: float) -> Array:
    """Covariance (n, n) [W^2] by errors of the angle of attack, at the airspeeds V_mps (n,) of the windows."""
    lift_W = mass_kg * g * V_mps * sigma_rad
    return np.asarray(np.outer(lift_W, lift_W) * _at_lags(_lags(windows), windows, windows.weight, time_s))


def uncorrelated(windows: Windows) -> Array:
    return np.asarray(RESIDUALS.white_W**2 * np.eye(len(windows.centers_s)))


def of_both(air: Array, of_drag: Array, of_force: Array) -> Array:
    """Covariance (2 n, 2 n) of both balances: the air's motion with opposite signs, and what only one contains."""
    return np.block([[air + of_drag, -air], [-air, air + of_force]])


def _lags(windows: Windows) -> Array:
    return np.asarray(np.abs(windows.centers_s[:, None] - windows.centers_s))


def _at_lags(lags: Array, windows: Windows, weight: Array, time_s: float) -> Array:
    """Covariance of two weighted means of first-order noise of variance 1, whose windows are `lags` apart."""
    step = float(windows.offsets_s[1] - windows.offsets_s[0])
    overlap = np.convolve(weight, weight[::-1])  # sum over the pairs of offsets with one difference
    differences = step * (np.arange(len(overlap)) - len(weight) + 1)
    beyond = np.arange(0.0, windows.offsets_s[-1] * 2 + 6 * time_s + step, step)
    values = np.exp(-np.abs(beyond[:, None] + differences) / time_s) @ overlap
    return np.asarray(np.interp(lags, beyond, values, right=0.0))


# The natural logarithms of CD0, K, x_at_maximum, fall and angle over C_L, and the logit of the efficiency, keep them
# possible. The last two are those of the angle of attack, alpha_0 + C_L (angle over C_L).
PARAMETERS = ("ln_CD0", "ln_K", "CL_minD", "K4", "logit_efficiency", "ln_x", "ln_fall", "idle_drag", "alpha_0",
              "ln_alpha_per_CL", "alpha_per_CT")  # fmt: skip


class FlightConditions(NamedTuple):
    """What stays the same in a flight.

    updraft_mps : mean over the flight          power_scale : true over measured electrical power
    """

    mass_kg: float
    wing_area_m2: float
    rho: float
    idle_power_W: float
    updraft_mps: float = 0.0
    power_scale: float = 1.0


class Samples(NamedTuple):
    """Measurements (n,), uniform in time within each stretch. stretches: slices of rows

    force_x_mps2 : specific force along the accelerometer's first axis; None where it is not measured
    """

    t_s: Array
    V_mps: Array
    height_m: Array
    power_W: Array
    load_factor: Array
    stretches: list[slice]
    motor_revps: Array | None = None
    force_x_mps2: Array | None = None


@dataclass(frozen=True)
class DragAndEfficiency:
    """The parameters in their usual form. CD = CD0 + K (CL - CL_minD)^2 + K4 (CL - CL_minD)^4 above CL_minD"""

    CD0: float
    K: float
    CL_minD: float
    K4: float
    efficiency: float
    x_at_maximum: float
    fall: float
    idle_drag: float  # drag of the idling propeller over that of CD0

    @classmethod
    def of(cls, parameters: Array) -> "DragAndEfficiency":
        CD0, K, CL_minD, K4, efficiency, x, fall, idle = parameters[:8]
        exp = np.exp
        return cls(exp(CD0), exp(K), CL_minD, K4, 1 / (1 + exp(-efficiency)), exp(x), exp(fall), idle)


class EnergyBalance:
    """The balance of one flight. windows: of `air_motion`; V_mps, power_W: (n,) their means"""

    def __init__(self, samples: Samples, conditions: FlightConditions, most_windows: int = WINDOWS.most):
        self.samples, self.conditions = samples, conditions
        step_s = float(np.median(np.diff(samples.t_s)))
        length_s = sum(rows.stop - rows.start for rows in samples.stretches) * step_s
        spacing_s = step_s * round(max(WINDOWS.length_s / 4, length_s / most_windows) / step_s)
        window_s = max(WINDOWS.length_s, 2 * spacing_s)
        count = 2 * round(window_s / step_s / 2) + 1
        u = (np.arange(count) - count // 2) / (count - 1)
        weight = 1 + np.cos(2 * np.pi * u)
        offsets_s = u * (count - 1) * step_s
        slope = np.sin(2 * np.pi * u)
        slope = slope / -(slope @ offsets_s)  # exact for a straight line
        starts = [
            start
            for rows in samples.stretches
            for start in range(rows.start, rows.stop - count + 1, round(spacing_s / step_s))
        ]
        self._rows = np.array(starts, dtype=int)[:, None] + np.arange(count)
        centers_s = samples.t_s[self._rows[:, count // 2]]
        self.windows = Windows(centers_s, offsets_s, weight / weight.sum(), slope)
        self.V_mps, self.power_W = self._mean(samples.V_mps), self._mean(samples.power_W)
        self._x = advance(samples.V_mps, self._motor_power(conditions), conditions.rho)

    def residual(
        self, parameters: Array, samples: Samples | None = None, given: FlightConditions | None = None
    ) -> Array:
        """Useful power less that of drag and of the change of energy, mean of each window (n,) [W]; then, where the
        accelerometer shows it, the change of energy less the power of the force along the path: (2 n,) together.

        samples, given: perturbed ones, for the effect of an error.
        """
        s, c = samples or self.samples, given or self.conditions
        drag_W, useful_W = self._drag_and_useful_W(parameters, s, c)
        energy = c.mass_kg * (g * s.height_m + s.V_mps**2 / 2)
        change = -energy[self._rows] @ self.windows.slope - c.mass_kg * g * c.updraft_mps
        of_drag = self._mean(useful_W - drag_W) - change
        if s.force_x_mps2 is None:
            return of_drag
        return np.concatenate([of_drag, change - self._mean(_along_path_W(s, s.force_x_mps2, useful_W, parameters, c))])

    def useful_W(self, parameters: Array) -> Array:
        """Thrust times airspeed, mean of each window (n,) [W]."""
        return self._mean(self._drag_and_useful_W(parameters, self.samples, self.conditions)[1])

    def powered_x(self) -> float:
        """Median argument of the efficiency where the motor works."""
        motor = self._motor_power(self.conditions)
        rows = np.unique(self._rows)
        working = rows[motor[rows] > 0.2 * np.percentile(motor[rows], 95)]
        return float(np.median(self._x[working])) if len(working) else 1.0

    def _motor_power(self, c: FlightConditions) -> Array:
        return np.asarray(np.maximum(c.power_scale * self.samples.power_W - c.idle_power_W, 0.0))

    def _drag_and_useful_W(self, parameters: Array, s: Samples, c: FlightConditions) -> tuple[Array, Array]:
        p, motor = DragAndEfficiency.of(parameters), self._motor_power(c)
        x = advance(s.V_mps, motor, c.rho)
        useful = motor * efficiency(x, p.efficiency, p.x_at_maximum, p.fall)
        idle = idling(x, p.x_at_maximum, p.fall)
        return drag_power(s.V_mps, s.load_factor, idle, p, c), useful

    def _mean(self, values: Array) -> Array:
        return np.asarray(values[self._rows] @ self.windows.weight)


def _along_path_W(s: Samples, force_x_mps2: Array, useful_W: Array, parameters: Array, c: FlightConditions) -> Array:
    """Power (n,) [W] of thrust less drag, by the accelerometer turned by the angle of attack."""
    alpha_0, ln_alpha_per_CL, alpha_per_CT = parameters[-3:]
    lift_N, qS = s.load_factor * c.mass_kg * g, c.rho * s.V_mps**2 / 2 * c.wing_area_m2
    alpha = alpha_0 + np.exp(ln_alpha_per_CL) * lift_N / qS + alpha_per_CT * useful_W / s.V_mps / qS
    return np.asarray(s.V_mps * (c.mass_kg * force_x_mps2 * np.cos(alpha) - lift_N * np.sin(alpha)))


def drag_power(
    V: Array, load_factor: Array | float, idle: Array | float, p: DragAndEfficiency, c: FlightConditions
) -> Array:
    """Drag times airspeed [W]."""
    qS = c.rho * V**2 / 2 * c.wing_area_m2
    above = load_factor * c.mass_kg * g / qS - p.CL_minD
    CD = p.CD0 * (1 + idle * p.idle_drag) + p.K * above**2 + p.K4 * np.maximum(above, 0.0) ** 4
    return np.asarray(qS * V * CD)


def level_power(V: Array, parameters: Array, c: FlightConditions) -> Array:
    """Electrical power of steady level flight (n,) [W]; NaN where the motor cannot give it."""
    p = DragAndEfficiency.of(parameters)
    drag_W = drag_power(V, 1.0, 0.0, p, c)
    motor = np.geomspace(0.5, 1e5, 600)
    x = advance(V[:, None], motor, c.rho)
    surplus = motor * efficiency(x, p.efficiency, p.x_at_maximum, p.fall) - drag_W[:, None]
    enough = surplus >= 0
    first = np.maximum(np.argmax(enough, axis=1), 1)
    at = np.arange(len(V))
    low, high = surplus[at, first - 1], surplus[at, first]
    share = low / (low - high)
    found = motor[first - 1] + share * (motor[first] - motor[first - 1])
    return np.where(enough.any(axis=1), found + c.idle_power_W, np.nan)
