"""Electrical power of level flight over airspeed, with its interval, from one flight's energy balance."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.electrical.air_motion import covariance
from analysis.electrical.airspeed_gps import AirspeedErrors, airspeed_errors, true_airspeed
from analysis.electrical.correlated import most_probable
from analysis.electrical.energy_balance import (
    EnergyBalance,
    FlightConditions,
    Samples,
    level_power,
)
from analysis.electrical.flight_table import FlightTable
from flight.errors import InputError
from flight.units import GRAVITY_MPS2 as g

Array = NDArray[np.float64]

# Prior means and standard deviations, order of PARAMETERS; K is that of OSWALD.
CD0, CD0_LN_SIGMA = 0.05, 0.6
OSWALD, K_LN_SIGMA = 0.75, 0.25
CL_MIN_DRAG, CL_MIN_DRAG_SIGMA = 0.2, 0.2
K4, K4_SIGMA = 0.01, 0.015
EFFICIENCY, EFFICIENCY_LOGIT_SIGMA = 0.6, 0.4
X_LN_SIGMA = 0.3
FALL, FALL_LN_SIGMA = 0.7, 0.5
IDLE_DRAG, IDLE_DRAG_SIGMA = 0.1, 0.15

# Standard deviations of errors common to the whole flight.
CURRENT_SIGMA, MASS_SIGMA, IDLE_POWER_SIGMA_W = 0.0115, 0.005, 1.0  # the first: evenly within 2 %
LEAST_UPDRAFT_MPS, UPDRAFT_SHARE = 0.01, 0.08  # mean updraft: at least, and over the size of vertical air motion

FIRST_SIGMA_MPS, FIRST_TIME_S = 0.3, 3.0
TIMES_S = (1.0, 2.0, 4.0, 8.0, 16.0)
SIGMAS_MPS = tuple(0.02 * 1.25**i for i in range(26))  # 0.02 to 5
ITERATIONS = 3
FEWEST_WINDOWS = 15
FLOWN_SHARE = (5.0, 98.0)  # percentiles of the windows' airspeed
CURVE_POINTS = 61
STEP = 0.2  # of numerical derivatives, in standard deviations


class ElectricalEstimate(NamedTuple):
    """Electrical power of level flight at the flight's weight and density.

    V_mps, power_W : (n,)      noise, systematic : (n, n) parts of its covariance; the latter is common to the flight
    residual_W : (k,) of the windows of time_s (k,)
    measured_V_mps, measured_W : (k,) the windows reduced to level flight
    gust_mps, gust_s : standard deviation and correlation time of vertical air motion
    """

    V_mps: Array
    power_W: Array
    noise: Array
    systematic: Array
    parameters: Array
    parameter_covariance: Array
    conditions: FlightConditions
    airspeed: AirspeedErrors
    time_s: Array
    residual_W: Array
    measured_V_mps: Array
    measured_W: Array
    gust_mps: float
    gust_s: float

    @property
    def standard_error_W(self) -> Array:
        return np.asarray(np.sqrt(np.diag(self.noise + self.systematic)))


def estimate(
    flight: FlightTable, weight_N: float, wing_area_m2: float, span_m: float, log: str = "log"
) -> ElectricalEstimate:
    """The curve of one flight. Raises InputError, beginning with `log`, where the flight does not determine one."""
    airspeed = airspeed_errors(flight)
    rho = float(np.median(flight.table["rho"].to_numpy()[flight.flown]))
    conditions = FlightConditions(weight_N / g, wing_area_m2, rho, flight.idle_power_W)
    samples = _samples(flight, airspeed.scale, airspeed.zero_Pa)
    balance = EnergyBalance(samples, conditions)
    if len(balance.windows.centers_s) < FEWEST_WINDOWS:
        raise InputError(f"{log}: the flight is too short or too torn for an energy balance")
    if float(np.max(balance.power_W)) < 2 * conditions.idle_power_W + 5.0:
        raise InputError(f"{log}: the motor took no power in flight; electrical power of level flight is not known")
    mean, sigma = _prior(balance, span_m)
    fit = _fit(balance, mean, sigma)
    slowest, fastest = (float(np.percentile(balance.V_mps, share)) for share in FLOWN_SHARE)
    V = np.linspace(slowest, fastest, CURVE_POINTS)
    power = level_power(V, fit.parameters, conditions)
    known = np.isfinite(power)
    if known.sum() < 2:
        raise InputError(f"{log}: the flight does not determine the power of level flight at any speed flown")
    V, power = V[known], power[known]
    gradient = _gradient(V, fit, conditions)
    effects = np.array([*_shared_effects(V, power, gradient, flight, balance, fit, airspeed)])
    level = level_power(balance.V_mps, fit.parameters, conditions)
    return ElectricalEstimate(
        V,
        power,
        gradient.T @ fit.covariance @ gradient,
        effects.T @ effects,
        fit.parameters,
        fit.covariance,
        conditions,
        airspeed,
        balance.windows.centers_s,
        fit.residual_W,
        balance.V_mps,
        level + fit.residual_W / _marginal_efficiency(balance.V_mps, fit.parameters, conditions),
        fit.gust_mps,
        fit.gust_s,
    )


class _Fit(NamedTuple):
    """gain : (m, n) change of the parameters with each window's residual"""

    parameters: Array
    covariance: Array
    gain: Array
    residual_W: Array
    gust_mps: float
    gust_s: float


def _samples(flight: FlightTable, scale: float, zero_Pa: float) -> Samples:
    table = flight.table
    V = true_airspeed(table["pressure_Pa"].to_numpy(), table["rho"].to_numpy(), scale, zero_Pa)
    load_factor = table["load_factor"].fillna(1.0).to_numpy()
    height, power = table["height_m"].to_numpy(), table["power_W"].to_numpy()
    return Samples(table.index.to_numpy(), V, height, power, load_factor, flight.airborne)


def _prior(balance: EnergyBalance, span_m: float) -> tuple[Array, Array]:
    aspect_ratio = span_m**2 / balance.conditions.wing_area_m2
    mean = [np.log(CD0), -np.log(np.pi * OSWALD * aspect_ratio), CL_MIN_DRAG, K4,
            np.log(EFFICIENCY / (1 - EFFICIENCY)), np.log(balance.powered_x()), np.log(FALL), IDLE_DRAG]  # fmt: skip
    sigma = [CD0_LN_SIGMA, K_LN_SIGMA, CL_MIN_DRAG_SIGMA, K4_SIGMA,
             EFFICIENCY_LOGIT_SIGMA, X_LN_SIGMA, FALL_LN_SIGMA, IDLE_DRAG_SIGMA]  # fmt: skip
    return np.array(mean), np.array(sigma)


def _fit(balance: EnergyBalance, mean: Array, sigma: Array) -> _Fit:
    """Maximum a posteriori parameters, and the size of the air's motion by maximum likelihood, in turns."""
    mass_kg, V = balance.conditions.mass_kg, float(np.mean(balance.V_mps))
    parameters, gust_mps, gust_s = mean, FIRST_SIGMA_MPS, FIRST_TIME_S
    for _ in range(ITERATIONS):
        noise = covariance(balance.windows, mass_kg, V, balance.useful_W(parameters), gust_mps, gust_s)
        whiten = np.linalg.inv(np.linalg.cholesky(noise))
        parameters, jacobian = most_probable(balance.residual, whiten, mean, sigma, parameters)
        residual = balance.residual(parameters)
        gust_mps, gust_s = _most_likely_air(balance, parameters, residual, mass_kg, V)
    estimate_covariance = np.asarray(np.linalg.inv(jacobian.T @ jacobian), dtype=float)
    gain = -estimate_covariance @ jacobian[: len(residual)].T @ whiten
    return _Fit(parameters, estimate_covariance, gain, residual, gust_mps, gust_s)


def _most_likely_air(
    balance: EnergyBalance, parameters: Array, residual: Array, mass_kg: float, V: float
) -> tuple[float, float]:
    useful, best = balance.useful_W(parameters), (np.inf, FIRST_SIGMA_MPS, FIRST_TIME_S)
    for time_s in TIMES_S:
        fixed = covariance(balance.windows, mass_kg, V, useful, 0.0, time_s)
        by_air = covariance(balance.windows, mass_kg, V, useful, 1.0, time_s) - fixed
        # In the eigenvectors of one matrix relative to the other both are diagonal for every size.
        factor = np.linalg.inv(np.linalg.cholesky(fixed))
        values, vectors = np.linalg.eigh(factor @ by_air @ factor.T)
        white = (vectors.T @ factor @ residual) ** 2
        for sigma in SIGMAS_MPS:
            variance = 1 + sigma**2 * np.maximum(values, 0.0)
            best = min(best, (float(np.sum(white / variance + np.log(variance))), sigma, time_s))
    return best[1], best[2]


def _gradient(V: Array, fit: _Fit, conditions: FlightConditions) -> Array:
    """Derivative (m, n) of the curve by the parameters."""
    rows = []
    for i, sigma in enumerate(np.sqrt(np.diag(fit.covariance))):
        step = np.zeros(len(fit.parameters))
        step[i] = STEP * sigma
        above, below = (level_power(V, fit.parameters + sign * step, conditions) for sign in (1, -1))
        rows.append(np.nan_to_num((above - below) / (2 * step[i])))
    return np.array(rows)


def _shared_effects(
    V: Array,
    power: Array,
    gradient: Array,
    flight: FlightTable,
    balance: EnergyBalance,
    fit: _Fit,
    airspeed: AirspeedErrors,
) -> Iterator[Array]:
    """Change of the curve (n,) with each independent error of one standard deviation that the whole flight shares."""
    c = balance.conditions
    nominal = balance.residual(fit.parameters)

    def effect(samples: Samples, given: FlightConditions) -> Array:
        change = fit.gain @ (balance.residual(fit.parameters, samples, given) - nominal)
        return np.nan_to_num(level_power(V, fit.parameters, given) - power) + change @ gradient

    for scale, zero_Pa in np.linalg.cholesky(airspeed.covariance).T:
        yield effect(_samples(flight, airspeed.scale + scale, airspeed.zero_Pa + zero_Pa), c)
    heavier, warmer = 1 + MASS_SIGMA, 1 - flight.rho_sigma
    thinner = balance.samples._replace(V_mps=balance.samples.V_mps / np.sqrt(warmer))
    yield effect(thinner, c._replace(rho=c.rho * warmer))
    yield effect(balance.samples, c._replace(mass_kg=c.mass_kg * heavier))
    yield effect(balance.samples, c._replace(power_scale=1 + CURRENT_SIGMA))
    yield effect(balance.samples, c._replace(idle_power_W=c.idle_power_W + IDLE_POWER_SIGMA_W))
    yield effect(
        balance.samples, c._replace(updraft_mps=float(np.hypot(LEAST_UPDRAFT_MPS, UPDRAFT_SHARE * fit.gust_mps)))
    )


def _marginal_efficiency(V: Array, parameters: Array, c: FlightConditions) -> Array:
    """Derivative of useful power by electrical power in level flight (n,), from the curve at two weights of drag."""
    power = level_power(V, parameters, c)
    more = np.array(parameters)
    more[0] += 0.01
    heavier = level_power(V, more, c)
    added_W = 0.01 * np.exp(parameters[0]) * c.rho * V**3 / 2 * c.wing_area_m2
    return np.asarray(added_W / np.maximum(heavier - power, 1e-6))
