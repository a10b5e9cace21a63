"""Fit of an energy balance: most probable parameters, motion of the air, and errors that the whole flight shares."""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from scipy.linalg import lapack, solve_triangular

from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.methods.whole_flight.airspeed_gps import (
    AirspeedErrors,
    most_probable,
    root,
    true_airspeed,
    whitened,
)
from flightpower.analysis.methods.whole_flight.energy_balance import (
    EnergyBalance,
    FlightConditions,
    Samples,
    by_air,
    by_angle,
    by_efficiency,
    by_horizontal_gusts,
    of_both,
    uncorrelated,
)
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable
from flightpower.analysis.methods.whole_flight.ground_velocity import ground_velocity
from flightpower.analysis.methods.whole_flight.parameters import (
    MEAN_WIND,
    OF_AIRSPEED,
    OF_WIND,
    WIND,
    Prior,
    Source,
    pack,
    unpack,
)
from flightpower.analysis.methods.whole_flight.settings import PRIOR, RESIDUALS, SHARED, WINDOWS
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.grid import without_gaps
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.arrays import Array

SIGMAS_MPS = tuple(0.02 * 1.25**i for i in range(26))  # 0.02 to 5
ANGLES_RAD = tuple(0.0005 * 1.25**i for i in range(22))  # 0.0005 to 0.05: errors of the angle of attack
SHARES = tuple(0.002 * 1.25**i for i in range(20))  # 0.002 to 0.14: errors of the efficiency's form
STEP = 0.2  # step of numerical derivatives, in standard deviations


class Fit(NamedTuple):
    """The fit of a balance. gain : (m, n or 2 n) change of the parameters with each residual

    minus_2_log_evidence : of the model, for comparison with another model on the same windows
    """

    parameters: Array
    covariance: Array
    gain: Array
    residual_W: Array
    gust_mps: float
    gust_s: float
    minus_2_log_evidence: float


def samples_of(flight: FlightTable, scale: float, zero_Pa: float, wind: Array | None = None) -> Samples:
    """Samples with airspeed from the pitot, corrected for scale and zero, or from GPS less a wind (4,)."""
    table = flight.table
    if wind is None:
        V = true_airspeed(table["pressure_Pa"].to_numpy(), table["rho"].to_numpy(), scale, zero_Pa)
    else:
        V = ground_velocity(table, flight.flown, pack(MEAN_WIND, unpack(WIND, wind))).airspeed(wind)
    load_factor = table["load_factor"].fillna(1.0).to_numpy()
    height, power = table["height_m"].to_numpy(), table["power_W"].to_numpy()
    revps = table[recording.MOTOR].to_numpy()
    is_measured = table[["force_x_mps2", "load_factor"]].notna().all(axis=1).to_numpy()
    force_x = without_gaps(table["force_x_mps2"].to_numpy())
    has_force = float(np.mean(is_measured[flight.flown])) > FLIGHT.measured_share
    return Samples(
        table.index.to_numpy(),
        V,
        height,
        power,
        load_factor,
        flight.airborne,
        revps,
        force_x if has_force else None,
        table["load_variance"].to_numpy(),
        table["side_variance"].to_numpy(),
    )


def most_probable_fit(
    balance: EnergyBalance,
    prior: Prior,
    measured: tuple[Array, Array] | None = None,
    least_share: float = RESIDUALS.efficiency_share.mean,
) -> Fit:
    """Estimate maximum a posteriori parameters and the sizes of errors in turns.

    The error of angle of attack is in the residuals of the balance with the accelerometer, together with the motion of
    the air, and in the sum of both balances, together with the error of the efficiency's form.
    measured: as in `most_probable`. least_share: lower limit for the error of the efficiency's form, because a flight
    shows too little of this error.
    """
    mean, sigma = (pack(balance.names, {name: bounds[part] for name, bounds in prior.items()}) for part in (0, 1))
    windows, mass_kg, V = balance.windows, balance.conditions.mass_kg, float(np.mean(balance.V_mps))
    n, with_force = len(balance.V_mps), balance.samples.force_x_mps2 is not None
    white = uncorrelated(windows)
    along_mps = 0.0 if balance.samples.ground is not None else V  # a gust along the path does not change GPS velocity
    vertical = [by_air(windows, mass_kg, along_mps, 1.0, time_s) for time_s in WINDOWS.times_s]
    angles = [by_angle(windows, mass_kg, balance.V_mps, 1.0, time_s) for time_s in WINDOWS.times_s]
    unlikely = [
        (np.log(time_s * V / RESIDUALS.gust_length_m.mean) / RESIDUALS.gust_length_m.sigma) ** 2
        for time_s in WINDOWS.times_s
    ]
    gust_mps, angle_rad = RESIDUALS.first_gust_mps, RESIDUALS.first_angle_rad
    gust_s = angle_s = RESIDUALS.first_s
    parameters, share = mean, RESIDUALS.efficiency_share.mean
    of_share = RESIDUALS.efficiency_share
    unlikely_shares = [(np.log(np.array(SHARES) / of_share.mean) / of_share.sigma) ** 2]
    horizontal: Array | None = None

    def first(stacked: Array) -> Array:
        return stacked[:n]

    def second(stacked: Array) -> Array:
        return stacked[n:]

    def of_gusts(part: Callable[[Array], Array], size_mps: float, time_s: float) -> Array | float:
        """Covariance of a part of the residuals due to horizontal gusts; zero if airspeed is measured."""
        if horizontal is None:
            return 0.0
        return by_horizontal_gusts(windows, part(horizontal), size_mps, time_s)

    for is_last in (False, False, True):
        air = by_air(windows, mass_kg, along_mps, gust_mps, gust_s)
        of_drag = by_efficiency(windows, balance.thrust_power_W(parameters), share) + white
        noise = air + of_drag
        if with_force:
            of_force = by_angle(windows, mass_kg, balance.V_mps, angle_rad, angle_s) + white
            noise = of_both(air, of_drag, of_force)
        if balance.samples.ground is not None:
            horizontal = balance.by_wind(parameters)
        noise = noise + of_gusts(lambda stacked: stacked, gust_mps, gust_s)
        factor = root(noise)
        parameters, jacobian = most_probable(balance.residual, factor, mean, sigma, parameters, measured=measured)
        residual = balance.residual(parameters)
        of_drag = by_efficiency(windows, balance.thrust_power_W(parameters), share) + white
        airs = [air + of_gusts(first, 1.0, time_s) for air, time_s in zip(vertical, WINDOWS.times_s, strict=True)]
        gust_mps, gust_s = _size_and_time(residual[:n], of_drag, airs, SIGMAS_MPS, unlikely)
        if is_last:  # the other sizes only matter for another round
            break
        air = by_air(windows, mass_kg, along_mps, gust_mps, gust_s)
        of_form = [by_efficiency(windows, balance.thrust_power_W(parameters), 1.0)]
        share = max(
            least_share,
            _size_and_time(
                residual[:n], air + of_gusts(first, gust_mps, gust_s) + white, of_form, SHARES, unlikely_shares
            )[0],
        )
        if with_force:
            # Motion of the air hides an error of the angle in the force's residual; the error of the efficiency's form
            # hides it in the sum of both residuals.
            signals = (
                (residual[n:], air + of_gusts(second, gust_mps, gust_s) + white),
                (
                    first(residual) + second(residual),
                    of_drag + of_gusts(lambda x: x[:n] + x[n:], gust_mps, gust_s) + white,
                ),
            )
            equal = [0.0] * len(WINDOWS.times_s)
            angle_rad, angle_s = max(_size_and_time(*signal, angles, ANGLES_RAD, equal) for signal in signals)
    information = jacobian.T @ jacobian
    covariance = np.asarray(np.linalg.inv(information), dtype=float)
    by_residual = solve_triangular(factor, jacobian[: len(residual)], lower=True, trans="T", check_finite=False)
    gain = -covariance @ by_residual.T
    scale = np.where(np.isfinite(sigma), sigma, 1.0)
    evidence = (
        float(np.sum(whitened(factor, residual) ** 2) + np.sum(((parameters - mean) / sigma) ** 2))
        + 2 * float(np.sum(np.log(np.diag(factor))))
        + float(np.linalg.slogdet(information * np.outer(scale, scale))[1])
    )
    return Fit(parameters, covariance, gain, residual[:n], gust_mps, gust_s, evidence)


def _size_and_time(
    residual: Array, fixed: Array, by_time: list[Array], sizes: tuple[float, ...], unlikely: Sequence[Array | float]
) -> tuple[float, float]:
    """Standard deviation and correlation time of one part of the residuals.

    They are the root mean square and the geometric mean over the candidates, weighted by their probability given the
    residuals. The most likely values would be too small more often than too large after a short flight.
    fixed: covariance of the other parts. by_time: covariance of this part at size 1, for each of WINDOWS.times_s.
    unlikely: prior cost of each of these, as chi squared.
    """
    costs_by_time, block = [], 64  # columns that LAPACK processes at once
    factor = root(fixed)
    white = whitened(factor, residual)
    for fitted, cost_of_time in zip(by_time, unlikely, strict=True):
        # The part's covariance is made relative to the other parts and turned to a tridiagonal matrix. The other parts
        # then add the unit matrix, so the sum is tridiagonal for any size of this part.
        relative, _ = lapack.dsygst(fitted, factor, lower=1)
        reflectors, diagonal, beside, scale, _ = lapack.dsytrd(relative, lower=1, lwork=block * len(fitted))
        turned = white[:, None].copy()
        turned[1:] = lapack.dormqr("L", "T", reflectors[1:, :-1], scale, turned[1:], block)[0]
        costs_by_time.append(
            np.array([_misfit(size**2 * diagonal, size**2 * beside, turned) for size in sizes]) + cost_of_time
        )
    costs = np.concatenate(costs_by_time)
    sigmas, times_s = np.tile(sizes, len(by_time)), np.repeat(WINDOWS.times_s[: len(by_time)], len(sizes))
    weight = np.exp((costs.min() - costs) / 2)
    weight /= weight.sum()
    return float(np.sqrt(weight @ sigmas**2)), float(np.exp(weight @ np.log(times_s)))


def _misfit(diagonal: Array, beside: Array, residual: Array) -> float:
    """Chi squared of residuals (n, 1) plus the logarithm of their covariance's determinant. The covariance is the unit
    matrix plus a tridiagonal matrix.
    """
    pivots, _, solved, _ = lapack.dptsv(1 + diagonal, beside, residual)
    return float(residual[:, 0] @ solved[:, 0] + np.sum(np.log(pivots)))


class SharedError(NamedTuple):
    """The effect of one standard deviation of an error that the whole flight shares: the change (m,) of the parameters,
    and the changed conditions."""

    change: Array
    conditions: FlightConditions


Quantity = Callable[[NamedValues, FlightConditions], Array]  # function of parameters and conditions that gives (n,)


class Estimate(NamedTuple):
    """Parameters of a balance with their errors.

    names, values : (m,)     covariance : (m, m) due to noise     shared : errors that the whole flight shares
    """

    names: tuple[str, ...]
    values: Array
    covariance: Array
    shared: Mapping[Source, SharedError]
    conditions: FlightConditions

    def named(self) -> NamedValues:
        """The values by name."""
        return unpack(self.names, self.values)

    def gradient(self, quantity: Quantity) -> Array:
        """Derivative (m, n) of a quantity with respect to the parameters."""
        rows = []
        for i, sigma in enumerate(np.sqrt(np.diag(self.covariance))):
            step = np.zeros(len(self.values))
            step[i] = STEP * sigma
            above, below = (
                quantity(unpack(self.names, self.values + change), self.conditions) for change in (step, -step)
            )
            rows.append(np.nan_to_num((above - below) / (2 * step[i])))
        return np.array(rows)

    def quantity(self, function: Quantity, gradient: Array | None = None) -> Uncertain:
        """A quantity with its errors; those common to the whole flight are shared errors, by source. gradient:
        derivative of the quantity, if known"""
        gradient = self.gradient(function) if gradient is None else gradient
        p = self.named()
        value = function(p, self.conditions)
        shared: dict[str, Array] = {
            source: np.nan_to_num(function(p, error.conditions) - value) + error.change @ gradient
            for source, error in self.shared.items()
        }
        return Uncertain(value, gradient.T @ self.covariance @ gradient, shared)


def estimate_of(
    flight: FlightTable,
    balance: EnergyBalance,
    fit: Fit,
    airspeed: AirspeedErrors,
    *,
    power_sigma: float = SHARED.current,
    updraft_share: float = SHARED.updraft_share,
) -> Estimate:
    """The fit, with the effect of each independent error that the whole flight shares.

    power_sigma: relative standard deviation of the electrical power. updraft_share: ratio of the standard deviations
    of mean updraft and gusts.
    """
    c = balance.conditions
    nominal = balance.residual(fit.parameters)

    def error(samples: Samples, conditions: FlightConditions) -> SharedError:
        return SharedError(fit.gain @ (balance.residual(fit.parameters, samples, conditions) - nominal), conditions)

    shared: dict[Source, SharedError] = {}
    if airspeed.wind is None:
        for source, (scale, zero_Pa) in zip(OF_AIRSPEED, np.linalg.cholesky(airspeed.covariance).T, strict=True):
            shared[source] = error(samples_of(flight, airspeed.scale + scale, airspeed.zero_Pa + zero_Pa), c)
    elif balance.samples.ground is None and airspeed.wind_covariance is not None:  # the wind is not a parameter here
        for source, change in zip(OF_WIND, np.linalg.cholesky(airspeed.wind_covariance).T, strict=True):
            shared[source] = error(samples_of(flight, 0.0, 0.0, airspeed.wind + change), c)
    heavier, warmer = 1 + SHARED.mass, 1 - flight.rho_sigma
    updraft_mps = float(np.hypot(SHARED.least_updraft_mps, updraft_share * fit.gust_mps))
    # GPS shows true airspeed. As far as it determines the scale, an error of density changes the scale, not airspeed.
    thinner = balance.samples._replace(V_mps=balance.samples.V_mps / warmer ** ((1 - airspeed.by_gps) / 2))
    shared[Source.DENSITY] = error(thinner, c._replace(rho=c.rho * warmer))
    shared[Source.MASS] = error(balance.samples, c._replace(mass_kg=c.mass_kg * heavier))
    shared[Source.CURRENT] = error(balance.samples, c._replace(power_scale=1 + power_sigma))
    idle_W = c.idle_power_W + c.idle_sigma_W
    shared[Source.IDLE_POWER] = error(balance.samples, c._replace(idle_power_W=idle_W))
    shared[Source.UPDRAFT] = error(balance.samples, c._replace(updraft_mps=updraft_mps))
    # The flight shows the angle of attack over C_L for slow changes; for gusts it stays as uncertain as in the prior.
    shared[Source.GUSTS] = error(balance.samples, c._replace(gust_scale=1 + PRIOR.alpha_per_CL_sigma))
    return Estimate(balance.names, fit.parameters, fit.covariance, shared, c)
