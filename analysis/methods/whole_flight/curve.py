"""Electrical power of level flight over airspeed, with its interval, from one flight's energy balance.

`flown_aircraft` takes mass, wing area and span, which the balance needs, from an aircraft file or from options.

`estimate` corrects the airspeed, fits the balance with a propeller's efficiency and with a power law, which it accepts
only on overwhelming evidence, and gives the curve between the slowest and the fastest speed flown.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np

from flightpower.analysis.curve import Condition, Curve
from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.airspeed_gps import AirspeedErrors, airspeed_errors, by_wind
from flightpower.analysis.methods.whole_flight.energy_balance import (
    EnergyBalance,
    FlightConditions,
    Samples,
    level_power,
)
from flightpower.analysis.methods.whole_flight.fit import Estimate, Fit, estimate_of, most_probable_fit, samples_of
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable
from flightpower.analysis.methods.whole_flight.ground_velocity import ground_velocity, wind_prior
from flightpower.analysis.methods.whole_flight.parameters import (
    AIRSPEED,
    DRAG,
    LIFT,
    OF_AIRCRAFT,
    OF_AIRSPEED,
    POWER_LAW,
    PROPELLER,
    WIND,
    Prior,
    Source,
    block,
    pack,
    prior_error,
    unpack,
)
from flightpower.analysis.methods.whole_flight.settings import CURVE, GPS, PRIOR, SHARED, WINDOWS
from flightpower.analysis.methods.whole_flight.shown_efficiency import shown_efficiency
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.settings import CURVES
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g


@dataclass(frozen=True)
class FlownAircraft:
    name: str
    weight_N: float
    wing_area_m2: float
    span_m: float


def flown_aircraft(
    aircraft: Aircraft | None, weight_N: float | None, wing_area_m2: float | None, span_m: float | None, log: str
) -> FlownAircraft:
    """The aircraft of a file, in which each value given here replaces the file's.

    Raises InputError, in one line, when a value is missing or the aspect ratio is impossible.
    """
    options = {"weight_N": weight_N, "wing_area_m2": wing_area_m2, "span_m": span_m}
    values = {name: value for name, value in options.items() if value is not None}
    if aircraft is None:
        if len(values) < len(options):
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


@dataclass(frozen=True)
class CurveOfFlight:
    """The curve of a whole flight, and the parameters from which it follows."""

    curve: Curve
    parameters: Estimate

    @property
    def V_mps(self) -> Array:
        return self.curve.V_mps

    @property
    def power_W(self) -> Array:
        return self.curve.power_W.value

    @property
    def standard_error_W(self) -> Array:
        return self.curve.power_W.standard_error

    @property
    def conditions(self) -> FlightConditions:
        return self.parameters.conditions


@dataclass(frozen=True)
class ElectricalEstimate(CurveOfFlight):
    """Electrical power of level flight at the flight's weight and density.

    curve : its own errors are noise; errors that the whole flight shares are named by `Source`
    among_flights : the curve's power; its own errors are those that differ between flights, and errors of the aircraft
        are shared by name
    residual_W : (k,) residuals of the windows with centers time_s (k,)
    measured_V_mps, measured_W : (k,) airspeed and electrical power of the windows, reduced to level flight
    gust_mps, gust_s : standard deviation and correlation time of vertical air motion
    rho_sigma : relative standard deviation of the air density
    shown_efficiency : (n,) natural logarithm of the efficiency from battery to thrust, from the flight's energy alone
    """

    among_flights: Uncertain
    airspeed: AirspeedErrors
    time_s: Array
    residual_W: Array
    measured_V_mps: Array
    measured_W: Array
    gust_mps: float
    gust_s: float
    rho_sigma: float
    shown_efficiency: Uncertain


def estimate(
    flight: FlightTable,
    weight_N: float,
    wing_area_m2: float,
    span_m: float,
    log: str = "log",
    *,
    most_windows: int = WINDOWS.most,
    most_points: int = GPS.most_points,
    airspeed: AirspeedErrors | None = None,
) -> ElectricalEstimate:
    """The curve of one flight.

    most_windows, most_points: limits for the energy balance and for the comparison of airspeed with GPS
    airspeed: errors of a measured airspeed, if they are known better than from GPS alone
    Raises InputError, with a message that begins with `log`, if the flight does not determine a curve.
    """
    try:
        return _estimate(
            flight, weight_N, wing_area_m2, span_m, log, most_windows=most_windows, most_points=most_points,
            airspeed=airspeed,
        )  # fmt: skip
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
    airspeed: AirspeedErrors | None,
) -> ElectricalEstimate:
    rho = float(np.median(flight.table["rho"].to_numpy()[flight.flown]))
    conditions = FlightConditions(
        weight_N / g, wing_area_m2, rho, flight.idle_power_W, idle_sigma_W=flight.idle_sigma_W
    )
    if flight.first_wind_mps is None:
        airspeed = airspeed or airspeed_errors(flight, most_points)
        samples = samples_of(flight, airspeed.scale, airspeed.zero_Pa)
        balance, fit, by_propeller = _fitted(samples, conditions, span_m, log, most_windows)
    else:
        ground = ground_velocity(flight.table, flight.flown, flight.first_wind_mps)
        wind = pack(WIND, {name: mean for name, (mean, _) in wind_prior(flight.first_wind_mps).items()})
        for _ in range(2):  # the first wind may be wrong by the differences of airspeed between legs
            samples = samples_of(flight, 0.0, 0.0, wind)._replace(ground=ground)
            balance, fit, by_propeller = _fitted(samples, conditions, span_m, log, most_windows)
            wind = pack(WIND, unpack(balance.names, fit.parameters))
        airspeed = by_wind(wind, block(balance.names, fit.covariance, WIND))
    conditions, p = balance.conditions, unpack(balance.names, fit.parameters)
    slowest, fastest = (float(np.percentile(balance.V_mps, share)) for share in CURVE.percentiles)
    V = np.linspace(slowest, fastest, CURVES.points)
    power = level_power(V, p, conditions)
    finite = np.isfinite(power)
    if finite.sum() < 2:
        raise InputError(f"{log}: the flight does not determine the power of level flight at any speed flown")
    V = V[finite]
    if airspeed.mean_wind_covariance is not None:
        wind_sigma_mps = float(np.sqrt(np.max(np.linalg.eigvalsh(airspeed.mean_wind_covariance))))
        if wind_sigma_mps > GPS.known_wind * slowest:
            raise InputError(
                f"{log}: the log lacks airspeed, and headings hardly change: the wind is known to"
                f" ±{NORMAL_95 * wind_sigma_mps:.1f} m/s only; fly turns, or mount a pitot tube and its sensor"
            )
    parameters = estimate_of(flight, balance, fit, airspeed)
    gradient = parameters.gradient(partial(level_power, V))
    power_W = parameters.quantity(partial(level_power, V), gradient)
    level = level_power(balance.V_mps, p, conditions)
    condition = Condition(weight_N, rho, wing_area_m2)
    return ElectricalEstimate(
        Curve(kind=Kind.ELECTRICAL, condition=condition, V_mps=V, power_W=power_W, idle_W=conditions.idle_power_W),
        parameters,
        _among_flights(power_W, gradient, parameters, _prior(balance, span_m), airspeed),
        airspeed,
        balance.windows.centers_s,
        fit.residual_W,
        balance.V_mps,
        level + fit.residual_W / _marginal_efficiency(balance.V_mps, parameters),
        fit.gust_mps,
        fit.gust_s,
        flight.rho_sigma,
        shown_efficiency(flight, by_propeller, _prior(by_propeller, span_m), airspeed, V),
    )


def _among_flights(
    power: Uncertain, gradient: Array, estimate: Estimate, prior: Prior, airspeed: AirspeedErrors
) -> Uncertain:
    """Power (n,) whose own errors are those of this flight, and whose shared errors are those of the aircraft.

    The estimate lies between data and prior; the prior's share of the error has the same sign in all flights. For the
    airspeed's scale this share is the sensor's error as known before the flight. The error that GPS adds and the error
    of the wind are the flight's own. gradient : (m, n) derivative of power with respect to the parameters
    """
    C = estimate.covariance
    of_aircraft = [(i, name) for i, name in enumerate(estimate.names) if name not in WIND]
    common = {prior_error(name): gradient.T @ C[:, i] / prior[name][1] for i, name in of_aircraft}
    of_prior = sum(np.outer(change, change) for change in common.values())
    own = power.own
    if airspeed.wind is None:
        effects = np.stack([power.shared[source] for source in OF_AIRSPEED])
        by_scale_and_zero = np.linalg.solve(np.linalg.cholesky(airspeed.covariance).T, effects)
        scale = airspeed.covariance[AIRSPEED.index("scale")]
        by_scale = scale @ by_scale_and_zero / airspeed.prior_sigma
        common[Source.AIRSPEED] = by_scale
        own = own + effects.T @ effects - np.outer(by_scale, by_scale)
    own = own - of_prior
    common |= {source: power.shared[source] for source in OF_AIRCRAFT}
    by_updraft = power.shared[Source.UPDRAFT]
    return Uncertain(power.value, np.asarray(own + np.outer(by_updraft, by_updraft)), common)


def _fitted(
    samples: Samples, conditions: FlightConditions, span_m: float, log: str, most_windows: int
) -> tuple[EnergyBalance, Fit, EnergyBalance]:
    """The balance with its fit, by a propeller's efficiency or, if far more probable, by the power law; and the balance
    by a propeller's efficiency in either case."""
    balance = EnergyBalance(samples, conditions, most_windows)
    if len(balance.windows.centers_s) < len((*DRAG, *PROPELLER, *LIFT)) + 3:  # a few more than the number of parameters
        raise InputError(f"{log}: the flight is too short for an energy balance, or has too many gaps")
    if float(np.max(balance.power_W)) < 2 * conditions.idle_power_W + SHARED.unseen_idle_W:
        raise InputError(f"{log}: the motor took no power in flight; electrical power of level flight is not known")
    fit = most_probable_fit(balance, _prior(balance, span_m))
    other = EnergyBalance(samples, conditions._replace(power_law=balance.middle()), most_windows)
    by_power_law = most_probable_fit(other, _prior(other, span_m), least_share=0.0)
    if by_power_law.minus_2_log_evidence < fit.minus_2_log_evidence - PRIOR.law_evidence:
        return other, most_probable_fit(other, _prior(other, span_m)), balance
    return balance, fit, balance


def _prior(balance: EnergyBalance, span_m: float) -> Prior:
    p = PRIOR
    drag, lift = (prior(span_m, balance.conditions.wing_area_m2) for prior in (drag_prior, lift_prior))
    idle = (p.idle_drag.mean, p.idle_drag.sigma)
    if balance.conditions.power_law is None:
        logit = float(np.log(p.efficiency.mean / (1 - p.efficiency.mean)))
        x, fall = (
            (float(np.log(balance.median_advance_with_power())), p.x_sigma),
            (float(np.log(p.fall.mean)), p.fall.sigma),
        )
        efficiency = dict(zip(PROPELLER, [(logit, p.efficiency.sigma), x, fall, idle], strict=True))
    else:
        greatest = (float(np.log(p.law_efficiency.mean)), p.law_efficiency.sigma)
        speed, power = ((parameter.mean, parameter.sigma) for parameter in (p.law_speed, p.law_power))
        efficiency = dict(zip(POWER_LAW, [greatest, speed, power, idle], strict=True))
    wind = {} if balance.samples.ground is None else wind_prior(balance.samples.ground.first_wind_mps)
    return {**drag, **efficiency, **lift, **wind}


def drag_prior(span_m: float, wing_area_m2: float) -> Prior:
    """Prior of the drag polar's parameters."""
    p = PRIOR
    ln_K = float(-np.log(np.pi * p.oswald.mean * span_m**2 / wing_area_m2))
    mean = [float(np.log(p.CD0.mean)), ln_K, p.CL_of_least_drag.mean, p.K4.mean]
    sigma = [p.CD0.sigma, p.oswald.sigma, p.CL_of_least_drag.sigma, p.K4.sigma]
    return dict(zip(DRAG, zip(mean, sigma, strict=True), strict=True))


def lift_prior(span_m: float, wing_area_m2: float) -> Prior:
    """Prior of the parameters of sideslip and angle of attack, with the lift slope of a straight wing (Helmbold)."""
    A = span_m**2 / wing_area_m2
    slope = 2 * np.pi * A / (2 + np.sqrt(4 + A**2))
    beta = PRIOR.beta_per_CY
    mean = [float(np.log(beta.mean)), 0.0, float(-np.log(slope)), 0.0]
    sigma = [beta.sigma, PRIOR.alpha_0_sigma, PRIOR.alpha_per_CL_sigma, PRIOR.alpha_per_CT_sigma]
    return dict(zip(LIFT, zip(mean, sigma, strict=True), strict=True))


def _marginal_efficiency(V: Array, estimate: Estimate) -> Array:
    """Derivative (n,) of useful power with respect to electrical power in level flight, from curves at two values of
    CD0."""
    c, p = estimate.conditions, estimate.named()
    power = level_power(V, p, c)
    values = {name: p[name] for name in estimate.names}
    draggier = NamedValues("parameter", {**values, "ln_CD0": p.ln_CD0 + 0.01})
    heavier = level_power(V, draggier, c)
    added_W = 0.01 * np.exp(p.ln_CD0) * c.rho * V**3 / 2 * c.wing_area_m2
    return np.asarray(added_W / np.maximum(heavier - power, 1e-6))
