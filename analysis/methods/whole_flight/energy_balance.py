"""Energy balance of an ordinary flight: electrical power against drag and change of energy, (2.23)-(2.26).

The balance is P eta = D V + dE/dt, averaged over windows. P is the motor's electrical power, eta is the efficiency from
there to thrust, and E = m (g h + V^2/2). The derivative is moved to the window's weight (integration by parts), so
nothing noisy is differentiated. C_L comes from the accelerometer. A second balance, m V a = dE/dt with the specific
force a along the path, has the same gusts in its residuals but no drag, so both together show the motion of the air.

Efficiency of an unknown motor and propeller (`efficiency`): propellers are alike when their efficiency, relative to its
maximum, is plotted against V (rho D^2 / P)^(1/3) = J / c_P^(1/3). The APC 10x5E and 12x8E agree with the form within
0.02 up to the maximum. Beyond it they differ, so the decrease is a parameter. The scales of both axes contain the
unknown diameter and the motor's losses. `PowerLaw` replaces this form where no propeller gives the thrust.

Covariance of the residuals (`by_air`, `by_efficiency`, `by_angle`, `of_both`): air rising at w does the work m g w per
second, and a gust u along the path changes the kinetic energy relative to the air by m V u. Both are first-order noise,
averaged over the windows. The efficiency is not exactly a function of its argument; this error is in proportion to the
useful power. The balance with the accelerometer contains the same motion of the air with the opposite sign, and the
errors of an angle of attack that follows from C_L.
"""

from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.methods.whole_flight.ground_velocity import GroundVelocity, gusts
from flightpower.analysis.methods.whole_flight.kept_values import Kept
from flightpower.analysis.methods.whole_flight.parameters import (
    DRAG,
    LIFT,
    MEAN_WIND,
    POWER_LAW,
    PROPELLER,
    WIND,
    pack,
    unpack,
)
from flightpower.analysis.methods.whole_flight.settings import PRIOR, RESIDUALS, SHARED, WINDOWS
from flightpower.flight.arrays import Array
from flightpower.flight.units import GRAVITY_MPS2 as g


def advance(V: Array, power_W: Array, rho: Array | float) -> Array:
    """The argument of the efficiency, V (rho / P)^(1/3) [m^(-2/3)], which is proportional to J / c_P^(1/3)."""
    return np.asarray(V * np.cbrt(rho / np.maximum(power_W, 1e-3)))


def efficiency(x: Array, maximum: float, x_at_maximum: float, fall: float) -> Array:
    """Thrust times airspeed over the motor's electrical power; zero where the propeller no longer pulls."""
    u = x / x_at_maximum
    rising = 1 - np.abs(1 - np.minimum(u, 1.0)) ** PRIOR.rise_exponent
    falling = 1 - fall * (np.maximum(u, 1.0) - 1) ** 2
    return np.asarray(maximum * np.maximum(np.where(u < 1, rising, falling), 0.0))


def idling(x: Array, x_at_maximum: float, fall: float) -> Array:
    """The degree to which the propeller idles: 0 where it pulls, 1 where it absorbs hardly any power."""
    zero_thrust = 1 + 1 / np.sqrt(fall)
    return np.asarray(np.clip((x / x_at_maximum - zero_thrust) / zero_thrust, 0.0, 1.0))


@dataclass(frozen=True)
class Windows:
    """Windows of one shape, with centers_s (n,) and samples at offsets_s (k,) from the center.

    weight, slope : (k,) values @ weight is the mean over a window, and -values @ slope is the mean rate of change
    """

    centers_s: Array
    offsets_s: Array
    weight: Array
    slope: Array


def by_air(windows: Windows, mass_kg: float, V_mps: float, sigma_w_mps: float, time_s: float) -> Array:
    """Covariance (n, n) [W^2] due to vertical and longitudinal air motion of this size and correlation time."""
    lags = _lags(windows)
    vertical = (mass_kg * g * sigma_w_mps) ** 2 * _at_lags(lags, windows, windows.weight, time_s)
    along = (mass_kg * V_mps * sigma_w_mps) ** 2 * _at_lags(lags, windows, windows.slope, time_s)
    return np.asarray(vertical + along)


def by_efficiency(windows: Windows, thrust_power_W: Array, share: float) -> Array:
    """Covariance (n, n) [W^2] of an efficiency whose curve has another shape, wrong by the fraction `share` of it."""
    return np.asarray(
        share**2 * np.outer(thrust_power_W, thrust_power_W) * np.exp(-_lags(windows) / RESIDUALS.efficiency_s)
    )


def by_angle(windows: Windows, mass_kg: float, V_mps: Array, sigma_rad: float, time_s: float) -> Array:
    """Covariance (n, n) [W^2] due to errors of the angle of attack, at the airspeeds V_mps (n,) of the windows."""
    lift_W = mass_kg * g * V_mps * sigma_rad
    return np.asarray(np.outer(lift_W, lift_W) * _at_lags(_lags(windows), windows, windows.weight, time_s))


def by_horizontal_gusts(windows: Windows, change: Array, sigma_w_mps: float, time_s: float) -> Array:
    """Covariance (n, n) or (2 n, 2 n) [W^2] due to horizontal gusts that accompany vertical gusts.

    sigma_w_mps, time_s: standard deviation and correlation time of the vertical gusts. change: change of the residuals
    with the wind, as from `EnergyBalance.by_wind`.
    """
    size, scale = gusts()
    correlation = (size * sigma_w_mps) ** 2 * _at_lags(_lags(windows), windows, windows.weight, scale * time_s)
    times = len(change) // len(correlation)
    return np.asarray(change @ change.T * np.tile(correlation, (times, times)))


def uncorrelated(windows: Windows) -> Array:
    return np.asarray(RESIDUALS.white_W**2 * np.eye(len(windows.centers_s)))


def of_both(air: Array, of_drag: Array, of_force: Array) -> Array:
    """Covariance (2 n, 2 n) of both balances: the air's motion has opposite signs in them; other errors are in one."""
    return np.block([[air + of_drag, -air], [-air, air + of_force]])


def _lags(windows: Windows) -> Array:
    return np.asarray(np.abs(windows.centers_s[:, None] - windows.centers_s))


def _at_lags(lags: Array, windows: Windows, weight: Array, time_s: float) -> Array:
    """Covariance of two weighted means of first-order noise with variance 1, whose windows are `lags` apart.

    Beyond lags at which windows overlap it falls as exp(-lag / time_s). It must not be truncated at a long lag, because
    a matrix of truncated covariances would have eigenvalues far below zero.
    """
    step = float(windows.offsets_s[1] - windows.offsets_s[0])
    overlap = np.convolve(weight, weight[::-1])  # sums over pairs of offsets with equal difference
    differences = step * (np.arange(len(overlap)) - len(weight) + 1)
    apart = step * np.arange(len(weight))  # up to windows that just touch
    values = np.exp(-np.abs(apart[:, None] + differences) / time_s) @ overlap
    beyond_s = np.maximum(lags - apart[-1], 0.0)
    return np.asarray(np.interp(lags, apart, values) * np.exp(-beyond_s / time_s))


class PowerLaw(NamedTuple):
    """Efficiency in proportion to powers of airspeed and motor power. V_mps, power_W : reference speed and power"""

    V_mps: float
    power_W: float


class FlightConditions(NamedTuple):
    """Quantities that are constant during a flight.

    idle_sigma_W : standard deviation of idle_power_W     updraft_mps : mean over the flight
    power_scale : true over measured electrical power     gust_scale : true over computed work of gusts
    power_law : replaces a propeller's efficiency; None for a propeller
    """

    mass_kg: float
    wing_area_m2: float
    rho: float
    idle_power_W: float
    updraft_mps: float = 0.0
    power_scale: float = 1.0
    gust_scale: float = 1.0
    power_law: PowerLaw | None = None
    idle_sigma_W: float = SHARED.idle_power_W


class Samples(NamedTuple):
    """Measurements (n,), uniform in time within each stretch. stretches: slices of rows

    force_x_mps2 : specific force along the accelerometer's first axis; None where it is not measured
    load_variance, side_variance : variances of load factor and of side force over weight within a smoothing window
    ground : ground velocity if airspeed is not measured; the last parameters then describe the wind
    """

    t_s: Array
    V_mps: Array
    height_m: Array
    power_W: Array
    load_factor: Array
    stretches: list[slice]
    motor_revps: Array | None = None
    force_x_mps2: Array | None = None
    load_variance: Array | float = 0.0
    side_variance: Array | float = 0.0
    ground: GroundVelocity | None = None


@dataclass(frozen=True)
class QuarticPolar:
    """The parameters of drag in their usual form: CD = CD0 + K (CL - CL_minD)^2 + K4 max(CL - CL_minD, 0)^4.

    idle_drag : drag coefficient of the idling propeller over CD0; 0 where thrust contains this drag
    """

    CD0: float
    K: float
    CL_minD: float
    K4: float
    idle_drag: float = 0.0

    @classmethod
    def of(cls, p: NamedValues, idle_drag: float = 0.0) -> "QuarticPolar":
        return cls(float(np.exp(p.ln_CD0)), float(np.exp(p.ln_K)), float(p.CL_minD), float(p.K4), float(idle_drag))


class Useful(NamedTuple):
    """Useful power. power_W : thrust times airspeed (n,)     idle : degree to which the propeller idles (n,)"""

    power_W: Array
    idle: Array | float


class _Powers(NamedTuple):
    """The terms of a balance as functions of its parameters. along_path_W : power of the force along the path"""

    samples: Kept[Samples]
    useful: Kept[Useful]
    drag_W: Kept[Array]
    gusts_W: Kept[Array]
    along_path_W: Kept[Array]


class EnergyBalance:
    """The balance of one flight, averaged over `windows`. V_mps, power_W : (n,) means over the windows"""

    def __init__(self, samples: Samples, conditions: FlightConditions, most_windows: int = WINDOWS.most):
        self.samples, self.conditions, self.most_windows = samples, conditions, most_windows
        step_s = float(np.median(np.diff(samples.t_s)))
        length_s = sum(rows.stop - rows.start for rows in samples.stretches) * step_s
        spacing_s = step_s * round(max(WINDOWS.length_s / 4, length_s / most_windows) / step_s)
        window_s = max(WINDOWS.length_s, 2 * spacing_s)
        count = 2 * round(window_s / step_s / 2) + 1
        u = (np.arange(count) - count // 2) / (count - 1)
        weight = 1 + np.cos(2 * np.pi * u)
        offsets_s = u * (count - 1) * step_s
        slope = np.sin(2 * np.pi * u)
        slope = slope / -(slope @ offsets_s)  # makes the derivative of a straight line exact
        starts = [
            start
            for rows in samples.stretches
            for start in range(rows.start, rows.stop - count + 1, round(spacing_s / step_s))
        ]
        self._rows = np.array(starts, dtype=int)[:, None] + np.arange(count)
        centers_s = samples.t_s[self._rows[:, count // 2]]
        self.windows = Windows(centers_s, offsets_s, weight / weight.sum(), slope)
        self.V_mps, self.power_W = self._mean(samples.V_mps), self._mean(samples.power_W)
        self.names = self._names()
        self._nominal = self._powers(samples, conditions)
        self._x = advance(samples.V_mps, self._motor_power(conditions), conditions.rho)

    def _names(self) -> tuple[str, ...]:
        """Names of the parameters, in the order of their vector."""
        efficiency = PROPELLER if self.conditions.power_law is None else POWER_LAW
        return (*DRAG, *efficiency, *LIFT, *(() if self.samples.ground is None else WIND))

    def residual(
        self, parameters: Array, samples: Samples | None = None, conditions: FlightConditions | None = None
    ) -> Array:
        """Useful power less the power of drag and of the change of energy, as means (n,) [W] over the windows.

        If the force along the path is measured, the change of energy less the power of this force follows: (2 n,).
        samples, conditions: perturbed samples and conditions, for the effect of an error.
        """
        c, p = conditions or self.conditions, unpack(self.names, parameters)
        perturbed = samples is not None or conditions is not None
        powers = self._powers(samples or self.samples, c) if perturbed else self._nominal
        s, gusts_W = powers.samples(p), powers.gusts_W(p)
        energy = c.mass_kg * (g * s.height_m + s.V_mps**2 / 2)
        by_air_W = c.mass_kg * g * c.updraft_mps + self._mean(gusts_W)
        change = -energy[self._rows] @ self.windows.slope - by_air_W
        of_drag = self._mean(powers.useful(p).power_W - powers.drag_W(p)) - change
        if s.force_x_mps2 is None:
            return np.asarray(of_drag)
        return np.concatenate([of_drag, change - self._mean(powers.along_path_W(p) - gusts_W)])

    def _powers(self, original: Samples, c: FlightConditions) -> "_Powers":
        """The terms of the balance with these samples and conditions, as functions of the parameters."""
        samples = Kept(partial(_with_airspeed, original))
        useful = Kept(lambda p: self._useful(p, samples(p), c))
        return _Powers(
            samples,
            useful,
            Kept(lambda p: self._drag_W(p, samples(p), c, useful(p).idle)),
            Kept(lambda p: by_gusts_W(samples(p), p, c)),
            Kept(lambda p: _along_path_W(samples(p), useful(p).power_W, p, c)),
        )

    def by_wind(self, parameters: Array) -> Array:
        """Derivative (n or 2 n, 2) [W s/m] of the residuals with respect to the wind to the north and to the east."""
        columns = []
        for name in MEAN_WIND:
            changed = np.array(parameters)
            changed[self.names.index(name)] += 0.1
            columns.append((self.residual(changed) - self.residual(parameters)) / 0.1)
        return np.stack(columns, axis=1)

    def thrust_power_W(self, parameters: Array) -> Array:
        """Thrust times airspeed (n,) [W], as means over the windows."""
        useful = self._useful(unpack(self.names, parameters), self.samples, self.conditions)
        return self._mean(useful.power_W)

    def middle(self) -> PowerLaw:
        """Median airspeed, and median motor power of the windows in which the motor works."""
        motor_W = self._mean(self._motor_power(self.conditions))
        working = motor_W[motor_W > 0.2 * np.percentile(motor_W, 95)]
        return PowerLaw(float(np.median(self.V_mps)), max(float(np.median(working)) if len(working) else 0.0, 1.0))

    def median_advance_with_power(self) -> float:
        """Median argument of the efficiency where the motor works."""
        motor = self._motor_power(self.conditions)
        rows = np.unique(self._rows)
        working = rows[motor[rows] > 0.2 * np.percentile(motor[rows], 95)]
        return float(np.median(self._x[working])) if len(working) else 1.0

    def _motor_power(self, c: FlightConditions) -> Array:
        return np.asarray(np.maximum(c.power_scale * self.samples.power_W - c.idle_power_W, 0.0))

    def _useful(self, p: NamedValues, s: Samples, c: FlightConditions) -> "Useful":
        return Useful(*useful_power(s.V_mps, self._motor_power(c), p, c))

    def _drag_W(self, p: NamedValues, s: Samples, c: FlightConditions, idle: Array | float) -> Array:
        polar = QuarticPolar.of(p, p.idle_drag)
        return drag_power(s.V_mps, s.load_factor, idle, polar, c, load_variance=s.load_variance)

    def _mean(self, values: Array) -> Array:
        return np.asarray(values[self._rows] @ self.windows.weight)


def by_gusts_W(s: Samples, p: NamedValues, c: FlightConditions) -> Array:
    """Power (n,) [W] that the aircraft gains from gusts (Katzmayr effect).

    A gust turns lift forward by the angle of attack that it adds, and side force by the sideslip that it adds. The
    means of these products follow from the variances of both forces, as far as forces follow gusts at once
    (`gust_scale`).
    """
    qS = c.rho * s.V_mps**2 / 2 * c.wing_area_m2
    angles = np.exp(p.ln_alpha_per_CL) * s.load_variance + np.exp(p.ln_beta_per_CY) * s.side_variance
    return np.asarray(c.gust_scale * s.V_mps * (c.mass_kg * g) ** 2 / qS * angles)


def useful_power(V: Array, motor_W: Array, p: NamedValues, c: FlightConditions) -> tuple[Array, Array]:
    """Thrust times airspeed [W], and the degree to which the propeller idles, from airspeed and motor power.

    p : contains PROPELLER, or POWER_LAW if the conditions have a power law
    """
    if c.power_law is None:
        x, greatest = advance(V, motor_W, c.rho), 1 / (1 + np.exp(-p.logit_efficiency))
        x_at_maximum, fall = np.exp(p.ln_x), np.exp(p.ln_fall)
        return motor_W * efficiency(x, greatest, x_at_maximum, fall), idling(x, x_at_maximum, fall)
    share = np.maximum(motor_W, 1e-3) / c.power_law.power_W
    useful = motor_W * np.exp(p.ln_efficiency + p.of_speed * np.log(V / c.power_law.V_mps) + p.of_power * np.log(share))
    return np.asarray(useful), np.asarray(np.clip(1 - 10 * share, 0.0, 1.0))


def _with_airspeed(s: Samples, p: NamedValues) -> Samples:
    """Samples whose airspeed is GPS velocity less the wind, if airspeed is not measured."""
    return s if s.ground is None else s._replace(V_mps=s.ground.airspeed(pack(WIND, p)))


def _along_path_W(s: Samples, thrust_power_W: Array, p: NamedValues, c: FlightConditions) -> Array:
    """Power (n,) [W] of thrust less drag, gusts included, from the accelerometer turned by the angle of attack."""
    assert s.force_x_mps2 is not None
    lift_N, qS = s.load_factor * c.mass_kg * g, c.rho * s.V_mps**2 / 2 * c.wing_area_m2
    alpha = p.alpha_0 + np.exp(p.ln_alpha_per_CL) * lift_N / qS + p.alpha_per_CT * thrust_power_W / s.V_mps / qS
    forward_N = c.mass_kg * s.force_x_mps2 * np.cos(alpha) - lift_N * np.sin(alpha)
    return np.asarray(s.V_mps * forward_N)


def drag_power(
    V: Array,
    load_factor: Array | float,
    idle: Array | float,
    p: QuarticPolar,
    c: FlightConditions,
    *,
    load_variance: Array | float = 0.0,
) -> Array:
    """Drag times airspeed [W]. load_variance: variance of the load factor about its mean, which also induces drag."""
    qS = c.rho * V**2 / 2 * c.wing_area_m2
    above = load_factor * c.mass_kg * g / qS - p.CL_minD
    CL_variance = load_variance * (c.mass_kg * g / qS) ** 2
    CD = p.CD0 * (1 + idle * p.idle_drag) + p.K * (above**2 + CL_variance) + p.K4 * np.maximum(above, 0.0) ** 4
    return np.asarray(qS * V * CD)


def level_power(V: Array, p: NamedValues, c: FlightConditions) -> Array:
    """Electrical power of steady level flight (n,) [W]; NaN where no motor power gives enough thrust."""
    drag_W = drag_power(V, 1.0, 0.0, QuarticPolar.of(p), c)
    motor = np.geomspace(0.5, 1e5, 600)
    thrust_power_W, _ = useful_power(V[:, None], motor, p, c)
    surplus = thrust_power_W - drag_W[:, None]
    enough = surplus >= 0
    first = np.maximum(np.argmax(enough, axis=1), 1)
    rows = np.arange(len(V))
    low, high = surplus[rows, first - 1], surplus[rows, first]
    share = low / (low - high)
    power_W = motor[first - 1] + share * (motor[first] - motor[first - 1])
    return np.where(enough.any(axis=1), power_W + c.idle_power_W, np.nan)


def level_efficiency(V: Array, p: NamedValues, c: FlightConditions) -> Array:
    """Drag times airspeed over the motor's electrical power, in steady level flight (n,); NaN as for `level_power`."""
    drag_W = drag_power(V, 1.0, 0.0, QuarticPolar.of(p), c)
    return np.asarray(drag_W / (level_power(V, p, c) - c.idle_power_W))
