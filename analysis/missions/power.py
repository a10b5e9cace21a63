"""Battery power in steady flight at any weight, density, climb angle and load factor, with draws of its errors.

There are two sources. One is the model of performance (`analysis.performance`): balance of forces, propeller's table,
losses of the power train. The other is a curve of electrical power in level flight: at a different weight, density or
load factor the same lift coefficient is flown at a different speed (PIW and VIW, 2.3 and 2.5), and a climb adds the
power that lifts the weight, divided by the efficiency from battery to thrust. In a descent steeper than a glide, the
idle power remains.
"""

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from scipy.interpolate import CubicSpline

from flightpower.analysis.curve import Condition, lift_coefficient, ratios, stored_curve
from flightpower.analysis.methods.whole_flight.settings import PRIOR
from flightpower.analysis.missions.inputs import RouteInput
from flightpower.analysis.performance.level_flight import Floats, PerformanceModel, climb_angle, steady_thrust
from flightpower.analysis.performance.propagation import ParameterVector, SigmaPoints
from flightpower.analysis.performance.stored_model import model_of
from flightpower.analysis.records.flight import Interval, Kind, PowerPoint
from flightpower.analysis.settings import CURVES
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_speed import corrected_thrust, full_throttle_revps, revps_for_thrust


class SteadyPower(Protocol):
    """Gives battery power [W] at n draws: (n, k) at V (k,) or (n, k) [m/s], for a condition with arrays (k,)."""

    def battery_W(self, V: Array, condition: Condition, sine: Floats, load_factor: Floats) -> Array: ...

    def best_climb_mps(self, V: Array, condition: Condition) -> Array:
        """Return the best rate of climb at full throttle [m/s]; infinite if unknown."""
        ...


@dataclass(frozen=True)
class AerodynamicPower:
    """Power from the model of performance. parameters : each (n, 1)     idle_W : power with the motor off"""

    parameters: SigmaPoints
    model: PerformanceModel
    idle_W: float

    def battery_W(self, V: Array, condition: Condition, sine: Floats, load_factor: Floats) -> Array:
        p, propeller = self.parameters, self.model.propeller
        thrust_N = steady_thrust(p, V, condition, sine, load_factor)
        V = np.broadcast_to(V, thrust_N.shape)
        pulls = thrust_N > 0
        n = revps_for_thrust(propeller, V, np.where(pulls, thrust_N, 1.0), condition.rho, **_correction(p))
        _, shaft_W = propeller.thrust_and_power(V, n, condition.rho)
        power_W = self.model.power_train.battery_power(np.maximum(shaft_W, 0.0), n, p)
        return np.where(pulls, np.maximum(np.nan_to_num(power_W, nan=np.inf), self.idle_W), self.idle_W)

    def best_climb_mps(self, V: Array, condition: Condition) -> Array:
        p, propeller = self.parameters, self.model.propeller
        if self.model.full_throttle.parameters is None:
            return np.full(V.shape, np.inf)
        motor = {name: p[name] for name in ("unloaded_revps", "revps_per_Nm")}
        n = full_throttle_revps(propeller, V, condition.rho, **motor)
        thrust_N = corrected_thrust(propeller, V, n, condition.rho, **_correction(p))
        return V * climb_angle(p, thrust_N, V, condition)[0]


def _correction(parameters: SigmaPoints) -> SigmaPoints:
    return {name: parameters[name] for name in ("thrust_scale", "thrust_slope")}


@dataclass(frozen=True)
class ElectricalPower:
    """Power from a curve of level flight.

    V_mps : (g,) evenly spaced     power_W : (n, g), including idle_W     efficiency : (n, 1) from battery to thrust
    """

    V_mps: Array
    power_W: Array
    efficiency: Array
    reference: Condition
    idle_W: float

    def battery_W(self, V: Array, condition: Condition, sine: Floats, load_factor: Floats) -> Array:
        faster, more = ratios(self.reference, condition, load_factor)
        level_W = (self._curve_W(V / faster) - self.idle_W) * more
        climb_W = condition.weight_N * V * sine / self.efficiency
        return np.asarray(self.idle_W + np.maximum(level_W + climb_W, 0.0))

    def best_climb_mps(self, V: Array, condition: Condition) -> Array:
        return np.full(V.shape, np.inf)

    def _curve_W(self, V: Array) -> Array:
        """Return the curve at V (n, k); its first and last segments are extended as straight lines."""
        V = np.broadcast_to(V, (len(self.power_W), V.shape[-1])) if len(self.power_W) > 1 else V
        grid_place = (V - self.V_mps[0]) / (self.V_mps[1] - self.V_mps[0])
        low = np.clip(np.floor(grid_place).astype(int), 0, len(self.V_mps) - 2)
        if len(self.power_W) == 1:
            below, above = self.power_W[0][low], self.power_W[0][low + 1]
        else:
            below, above = (np.take_along_axis(self.power_W, low + step, axis=1) for step in (0, 1))
        return np.asarray(below + (grid_place - low) * (above - below))


@dataclass(frozen=True)
class RoutePower:
    """What results provide: power without errors and at draws, the condition flown, and lift coefficients.

    flown_CL : smallest and largest in level flight     largest_CL : the largest that the wing has carried, even briefly
    """

    reference: Condition
    flown_CL: tuple[float, float]
    largest_CL: float
    nominal: SteadyPower
    power_draws: SteadyPower


def source_of(results: RouteInput, idle_W: float | None, draws: int, rng: np.random.Generator) -> RoutePower:
    """Return power from a model of performance if the results have one, else from a curve of electrical power.

    idle_W: None means the value in the results, or zero. Raises InputError if the results have neither source.
    """
    reference = Condition(results.test.weight_N, results.test.air_density_kgpm3, results.aircraft.wing_area_m2)
    idle = results.main.idle_power_W if idle_W is None else idle_W
    largest_CL = results.slowest_flown.largest_lift_coefficient if results.slowest_flown else 0.0
    if results.use is not None and results.use.model is not None:
        return aerodynamic_source(model_of(results.use.model), reference, largest_CL, (draws, rng), idle_W=idle)
    electrical = results.curves.get(Kind.ELECTRICAL)
    curve = stored_curve(electrical, results.aircraft.wing_area_m2, idle) if electrical else None
    if curve is None:
        raise InputError(
            "these results know neither battery power at other weights and climbs nor electrical power;"
            " analyze the logs again with this version and the battery's energy, --battery-Wh"
        )
    V, power = curve.V_mps, curve.power_W
    fine = np.linspace(V[0], V[-1], CURVES.fine_points)
    mean, sigma = PRIOR.efficiency.mean, PRIOR.efficiency.sigma
    if results.power_required and results.electrical_power:
        mean = _overall_efficiency(results.power_required, results.electrical_power, idle)
    logit = np.log(mean / (1 - mean)) + sigma * rng.standard_normal((draws, 1))

    def power_at(values: Array, efficiency: Array) -> ElectricalPower:
        least_W = np.maximum(values, idle)
        return ElectricalPower(fine, CubicSpline(V, least_W, axis=1)(fine), efficiency, reference, idle)

    flown = tuple(float(CL) for CL in lift_coefficient(V[[-1, 0]], reference))
    return RoutePower(
        reference,
        (flown[0], flown[1]),
        largest_CL or flown[1],
        power_at(power.value[None], np.array([[mean]])),
        power_at(_draw(power.value, power.covariance, (draws, rng)), 1 / (1 + np.exp(-logit))),
    )


def aerodynamic_source(
    model: PerformanceModel,
    reference: Condition,
    largest_CL: float,
    draws: tuple[int, np.random.Generator],
    *,
    idle_W: float = 0.0,
) -> RoutePower:
    """Return power from a model of performance. draws: number of draws, random generator

    largest_CL: the largest lift coefficient that the wing has carried; 0 means unknown, and the largest in level flight
    is used instead. That may exceed what the wing ever carried, as it may come from the low airspeed of a gust.
    """
    parameters = model.parameters
    parameter_draws = _draw(parameters.values, parameters.covariance, draws)
    return RoutePower(
        reference,
        model.flown_CL,
        largest_CL or model.flown_CL[1],
        AerodynamicPower(_as_columns(parameters, parameters.values[None]), model, idle_W),
        AerodynamicPower(_as_columns(parameters, parameter_draws), model, idle_W),
    )


def _draw(values: Array, covariance: Array, draws: tuple[int, np.random.Generator]) -> Array:
    count, rng = draws
    return rng.multivariate_normal(values, covariance, count, method="eigh")


def _as_columns(parameters: ParameterVector, values: Array) -> SigmaPoints:
    return {name: values[:, i : i + 1] for i, name in enumerate(parameters.names)}


def _overall_efficiency(required: list[PowerPoint], battery: list[PowerPoint], idle_W: float) -> float:
    """Return power required over the motor's electrical power, the mean over the speeds of `required`."""
    V = np.array([power_point.speed_mps for power_point in required])
    drawn_W = (
        np.interp(
            V, [power_point.speed_mps for power_point in battery], [power_point.power_W for power_point in battery]
        )
        - idle_W
    )
    return float(np.clip(np.mean([power_point.power_W for power_point in required] / drawn_W), 0.1, 0.9))


def interval_of(draws: Array) -> Interval:
    """Return median and 95 % interval of draws (n,), some of which may be infinite."""
    low, middle, high = np.quantile(draws, [0.025, 0.5, 0.975], method="inverted_cdf")
    return Interval(value=float(middle), lo=float(low), hi=float(high))
