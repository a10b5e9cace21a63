"""Electrical power of level flight over airspeed, with its interval, from one flight's energy balance.

`flown_aircraft` takes mass, wing area and span, which the balance needs, from an aircraft file or from options.

`estimate` corrects the airspeed, fits the balance with a propeller's efficiency and with a power law, of which the
latter needs overwhelming evidence, and gives the curve between the slowest and the fastest speed flown.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from analysis.estimation.noise import NORMAL_95
from analysis.methods.whole_flight.airspeed_gps import AirspeedErrors, airspeed_errors, by_wind
from analysis.methods.whole_flight.energy_balance import (
    PARAMETERS,
    EnergyBalance,
    FlightConditions,
    Samples,
    level_power,
)
from analysis.methods.whole_flight.fit import (
    Fit,
    SharedErrors,
    derivatives,
    most_probable_fit,
    samples_of,
    shared_errors,
    with_standard_error,
)
from analysis.methods.whole_flight.flight_table import FlightTable
from analysis.methods.whole_flight.ground_velocity import WIND, ground_velocity, wind_prior
from analysis.methods.whole_flight.settings import CURVE, GPS, PRIOR, SHARED, WINDOWS
from analysis.settings import CURVES
from flight.aircraft import Aircraft
from flight.arrays import Array
from flight.errors import InputError
from flight.units import GRAVITY_MPS2 as g


@dataclass(frozen=True)
class FlownAircraft:
    name: str
    weight_N: float
    wing_area_m2: float
    span_m: float


def flown_aircraft(
    aircraft: Aircraft | None, weight_N: float | None, wing_area_m2: float | None, span_m: float | None, log: str
) -> FlownAircraft:
    """From an aircraft file, with values that are not None instead of the file's.

    Raises InputError, in one line, when a value is missing or the aspect ratio impossible.
    """
    given = {"weight_N": weight_N, "wing_area_m2": wing_area_m2, "span_m": span_m}
    values = {name: value for name, value in given.items() if value is not None}
    if aircraft is None:
        if len(values) < len(given):
            raise InputError(
                f"{log}: a log of an autopilot has no aircraft file in it; give"
                ' --mass "9.4 kg" --wing-area "1.5 m^2" --span "4 m" of your aircraft, or --aircraft FILE'
            )
        flown = FlownAircraft(name="Aircraft", **values)
    else:
        geometry = aircraft.geometry
        in_file = {"weight_N": aircraft.mass.weight_N, "wing_area_m2": geometry.wing_area_m2, "span_m": geometry.span_m}
        flown = FlownAircraft(name=aircraft.title, **(in_file | values))
    aspect_ratio = flown.span_m**2 / flown.wing_area_m2
    if not CURVE.aspect_ratio[0] < aspect_ratio < CURVE.aspect_ratio[1]:
        raise InputError(
            f"span {flown.span_m:g} m and wing area {flown.wing_area_m2:g} m^2 make an aspect ratio of"
            f" {aspect_ratio:.2g}, which no aircraft has; check both"
        )
    return flown


class ElectricalEstimate(NamedTuple):
    """Electrical power of level flight at the flight's weight and density.

    V_mps, power_W : (n,)      noise, systematic : (n, n) parts of its covariance; the latter is common to the flight
    shared : of each error that the whole flight shares, by one standard deviation: change of the parameters, conditions
    residual_W : (k,) of the windows of time_s (k,)
    measured_V_mps, measured_W : (k,) the windows reduced to level flight
    gust_mps, gust_s : standard deviation and correlation time of vertical air motion
    rho_sigma : standard deviation of the air density, relative
    own : (n, n) the part of the covariance that another flight of the aircraft has anew
    common : (n,) by name, changes of power with one standard deviation of an error that all its flights share
    """

    V_mps: Array
    power_W: Array
    noise: Array
    systematic: Array
    parameters: Array
    parameter_covariance: Array
    shared: SharedErrors
    conditions: FlightConditions
    airspeed: AirspeedErrors
    time_s: Array
    residual_W: Array
    measured_V_mps: Array
    measured_W: Array
    gust_mps: float
    gust_s: float
    rho_sigma: float
    own: Array
    common: dict[str, Array]

    def quantity(self, of: Callable[[Array, FlightConditions], Array]) -> tuple[Array, Array]:
        """A quantity (n,) of parameters and conditions, and its standard error."""
        return with_standard_error(of, self.parameters, self.parameter_covariance, self.shared, self.conditions)

    @property
    def standard_error_W(self) -> Array:
        return np.asarray(np.sqrt(np.diag(self.noise + self.systematic)))


def estimate(
    flight: FlightTable,
    weight_N: float,
    wing_area_m2: float,
    span_m: float,
    log: str = "log",
    *,
    most_windows: int = WINDOWS.most,
    most_points: int = GPS.most_points,
) -> ElectricalEstimate:
    """The curve of one flight. most_windows, most_points: of the energy balance and of airspeed against GPS.

    Raises InputError, beginning with `log`, where the flight does not determine one.
    """
    try:
        return _estimate(
            flight, weight_N, wing_area_m2, span_m, log, most_windows=most_windows, most_points=most_points
        )
    except (np.linalg.LinAlgError, ValueError) as error:
        raise InputError(
            f"{log}: no curve follows from this flight ({error}); airspeed, height or power hardly vary, or are noise"
        ) from None


def _estimate(
    flight: FlightTable,
    weight_N: float,
    wing_area_m2: float,
    span_m: float,
    log: str,
    *,
    most_windows: int,
    most_points: int,
) -> ElectricalEstimate:
    rho = float(np.median(flight.table["rho"].to_numpy()[flight.flown]))
    conditions = FlightConditions(
        weight_N / g, wing_area_m2, rho, flight.idle_power_W, idle_sigma_W=flight.idle_sigma_W
    )
    if flight.first_wind_mps is None:
        airspeed = airspeed_errors(flight, most_points)
        balance, fit = _fitted(
            samples_of(flight, airspeed.scale, airspeed.zero_Pa), conditions, span_m, log, most_windows
        )
    else:
        ground = ground_velocity(flight.table, flight.flown, flight.first_wind_mps)
        wind, _ = wind_prior(flight.first_wind_mps)
        for _ in range(2):  # the first wind may be wrong by as much as legs differ in airspeed
            samples = samples_of(flight, 0.0, 0.0, wind)._replace(ground=ground)
            balance, fit = _fitted(samples, conditions, span_m, log, most_windows)
            wind = fit.parameters[-len(WIND) :]
        airspeed = by_wind(wind, fit.covariance[-len(WIND) :, -len(WIND) :])
    conditions = balance.conditions
    slowest, fastest = (float(np.percentile(balance.V_mps, share)) for share in CURVE.percentiles)
    V = np.linspace(slowest, fastest, CURVES.points)
    power = level_power(V, fit.parameters, conditions)
    known = np.isfinite(power)
    if known.sum() < 2:
        raise InputError(f"{log}: the flight does not determine the power of level flight at any speed flown")
    V, power = V[known], power[known]
    if airspeed.wind_covariance is not None:
        wind_sigma_mps = float(np.sqrt(np.linalg.eigvalsh(airspeed.wind_covariance[:2, :2])[-1]))
        if wind_sigma_mps > GPS.known_wind * slowest:
            raise InputError(
                f"{log}: the log lacks airspeed, and headings hardly change: the wind is known to"
                f" ±{NORMAL_95 * wind_sigma_mps:.1f} m/s only; fly turns, or mount a pitot tube and its sensor"
            )
    shared = [*shared_errors(flight, balance, fit, airspeed)]

    def curve(parameters: Array, given: FlightConditions) -> Array:
        return level_power(V, parameters, given)

    gradient, effects = derivatives(curve, fit.parameters, fit.covariance, shared, conditions)
    own, common = _own_and_common(gradient, effects, fit, _prior(balance, span_m)[1], airspeed)
    level = level_power(balance.V_mps, fit.parameters, conditions)
    return ElectricalEstimate(
        V,
        power,
        gradient.T @ fit.covariance @ gradient,
        effects.T @ effects,
        fit.parameters,
        fit.covariance,
        shared,
        conditions,
        airspeed,
        balance.windows.centers_s,
        fit.residual_W,
        balance.V_mps,
        level + fit.residual_W / _marginal_efficiency(balance.V_mps, fit.parameters, conditions),
        fit.gust_mps,
        fit.gust_s,
        flight.rho_sigma,
        own,
        common,
    )


def _own_and_common(
    gradient: Array, effects: Array, fit: Fit, prior_sigma: Array, airspeed: AirspeedErrors
) -> tuple[Array, dict[str, Array]]:
    """The covariance (n, n) by a flight's own errors, and changes (n,) by those that all flights of an aircraft share.

    The estimate lies between data and prior: as far as it is the prior's, all flights err to the same side. Of the
    airspeed's scale that is the sensor's error as known before the flight; what GPS adds is a flight's own, and so is
    the wind. gradient (m, n), effects (k, n): of `derivatives`, with the errors in the order of `shared_errors`.
    """
    C = fit.covariance
    of_aircraft = len(C) - (len(WIND) if airspeed.wind is not None else 0)
    common = {f"prior {i}": gradient.T @ C[:, i] / prior_sigma[i] for i in range(of_aircraft)}
    own = gradient.T @ C @ gradient
    if airspeed.wind is None:
        by_scale_and_zero = np.linalg.solve(np.linalg.cholesky(airspeed.covariance).T, effects[:2])
        common["airspeed"] = airspeed.covariance[0] @ by_scale_and_zero / airspeed.prior_sigma
        own = own + effects[:2].T @ effects[:2] - np.outer(common["airspeed"], common["airspeed"])
    own = own - sum(np.outer(common[f"prior {i}"], common[f"prior {i}"]) for i in range(of_aircraft))
    common |= dict(zip(("density", "mass", "current", "idle power"), effects[-5:-1], strict=True))
    return np.asarray(own + np.outer(effects[-1], effects[-1])), common


def _fitted(
    samples: Samples, conditions: FlightConditions, span_m: float, log: str, most_windows: int
) -> tuple[EnergyBalance, Fit]:
    """With a propeller's efficiency, or with the power law where that is far more probable."""
    balance = EnergyBalance(samples, conditions, most_windows)
    if len(balance.windows.centers_s) < len(PARAMETERS) + 3:  # a few more than there are parameters
        raise InputError(f"{log}: the flight is too short or too torn for an energy balance")
    if float(np.max(balance.power_W)) < 2 * conditions.idle_power_W + SHARED.unseen_idle_W:
        raise InputError(f"{log}: the motor took no power in flight; electrical power of level flight is not known")
    fit = most_probable_fit(balance, *_prior(balance, span_m))
    other = EnergyBalance(samples, conditions._replace(power_law=balance.middle()), most_windows)
    by_power_law = most_probable_fit(other, *_prior(other, span_m), least_share=0.0)
    if by_power_law.minus_2_log_evidence < fit.minus_2_log_evidence - PRIOR.law_evidence:
        return other, most_probable_fit(other, *_prior(other, span_m))
    return balance, fit


def _prior(balance: EnergyBalance, span_m: float) -> tuple[Array, Array]:
    p = PRIOR
    drag, lift = (of(span_m, balance.conditions.wing_area_m2) for of in (drag_prior, lift_prior))
    if balance.conditions.power_law is None:
        logit = float(np.log(p.efficiency.mean / (1 - p.efficiency.mean)))
        efficiency = [(logit, p.efficiency.sigma), (np.log(balance.powered_x()), p.x_sigma)]
        efficiency.append((np.log(p.fall.mean), p.fall.sigma))
    else:
        efficiency = [(np.log(p.law_efficiency.mean), p.law_efficiency.sigma), p.law_speed, p.law_power]
    mean, sigma = np.array([*efficiency, p.idle_drag]).T
    parts = [drag, (mean, sigma), lift]
    if balance.samples.ground is not None:
        parts.append(wind_prior(balance.samples.ground.first_wind_mps))
    means, sigmas = zip(*parts, strict=True)
    return np.concatenate(means), np.concatenate(sigmas)


def drag_prior(span_m: float, wing_area_m2: float) -> tuple[Array, Array]:
    """Of the first four parameters, those of the drag polar."""
    ln_K = -np.log(np.pi * PRIOR.oswald.mean * span_m**2 / wing_area_m2)
    sigma = [PRIOR.CD0.sigma, PRIOR.oswald.sigma, PRIOR.CL_of_least_drag.sigma, PRIOR.K4.sigma]
    return np.array([np.log(PRIOR.CD0.mean), ln_K, PRIOR.CL_of_least_drag.mean, PRIOR.K4.mean]), np.array(sigma)


def lift_prior(span_m: float, wing_area_m2: float) -> tuple[Array, Array]:
    """Of the last four parameters, those of sideslip and angle of attack; lift slope of a straight wing (Helmbold)."""
    A = span_m**2 / wing_area_m2
    slope = 2 * np.pi * A / (2 + np.sqrt(4 + A**2))
    beta = PRIOR.beta_per_CY
    sigma = [beta.sigma, PRIOR.alpha_0_sigma, PRIOR.alpha_per_CL_sigma, PRIOR.alpha_per_CT_sigma]
    return np.array([np.log(beta.mean), 0.0, -np.log(slope), 0.0]), np.array(sigma)


def _marginal_efficiency(V: Array, parameters: Array, c: FlightConditions) -> Array:
    """Derivative of useful power by electrical power in level flight (n,), from the curve at two weights of drag."""
    power = level_power(V, parameters, c)
    more = np.array(parameters)
    more[0] += 0.01
    heavier = level_power(V, more, c)
    added_W = 0.01 * np.exp(parameters[0]) * c.rho * V**3 / 2 * c.wing_area_m2
    return np.asarray(added_W / np.maximum(heavier - power, 1e-6))
