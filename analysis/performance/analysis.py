"""Performance of the aircraft from its drag polar, its power train and the flight: the order of the steps."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.dynamic import POLAR, DynamicEstimate
from analysis.drag.estimate import DragEstimates
from analysis.drag.forces import FlightForces
from analysis.ground.thrust_prior import THRUST
from analysis.performance.full_throttle import (
    SERVICE_CLIMB_MPS,
    FullThrottle,
    FullThrottlePerformance,
    ceilings_m,
    fit_full_throttle,
    full_throttle_performance,
)
from analysis.performance.level_flight import (
    LevelFlight,
    Optimum,
    incidence,
    level_flight,
    longest_endurance,
    longest_range,
)
from analysis.performance.power_train import (
    ASSUMED_MOTOR,
    PowerTrainModel,
    fit_power_train,
    motor_is_known,
    with_assumed_motor,
)
from analysis.performance.propagation import ParameterVector, SigmaPoints, UncertainValue, combine_independent
from analysis.performance.request import FlownCondition, Request, TitledCondition, requested_conditions
from analysis.polar import Condition, speed_at
from analysis.signals.aircraft_size import SPEED_SCALE
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.propeller import Propeller
from flight.runs import AIRCRAFT_SIZE

Array = NDArray[np.float64]

SPEEDS, EFFICIENCY_SPEEDS, FIELD_TABLE_ROWS = 121, 31, 10


@dataclass(frozen=True)
class PerformanceModel:
    """What performance is computed from.

    parameters : A0, A1, A2, thrust_scale, thrust_slope, alpha_0, alpha_CL, shaft_scale, friction, copper, meter_scale;
    then unloaded_revps and revps_per_Nm, where full throttle is known
    """

    parameters: ParameterVector
    power_train: PowerTrainModel
    full_throttle: FullThrottle
    propeller: Propeller
    flown_CL: tuple[float, float]


@dataclass(frozen=True)
class ConditionPerformance:
    """Performance at one weight and density.

    sustained : full throttle holds level flight at some of the speeds. Where it does not, `endurance` and `range`
    ignore full throttle.     full_throttle : None where full throttle is not known
    """

    title: str
    condition: Condition
    sustained: bool
    level_flight: LevelFlight
    endurance: Optimum
    range: Optimum
    full_throttle: FullThrottlePerformance | None


@dataclass(frozen=True)
class Ceilings:
    """Density altitudes [m] at which the best climb is 0.508 m/s and zero."""

    service_m: UncertainValue
    absolute_m: UncertainValue


@dataclass(frozen=True)
class FlightPerformance:
    """Performance at the flight's own condition, `as_flown`, and at those requested.

    efficiency : level flight as flown, at EFFICIENCY_SPEEDS speeds     field_table : the same at whole speeds
    ceilings : None where full throttle is not known     usable : share of the battery's energy that is used
    """

    battery_energy_Wh: float
    usable: float
    model: PerformanceModel
    as_flown: ConditionPerformance
    requested: list[ConditionPerformance]
    efficiency: LevelFlight
    field_table: LevelFlight
    ceilings: Ceilings | None

    @property
    def energy_J(self) -> float:
        """Energy of the battery that is used."""
        return usable_energy_J(self.battery_energy_Wh, self.usable)


def compute(
    request: Request,
    trajectory: Trajectory,
    drag: DragEstimates,
    aircraft: Aircraft,
    propeller: Propeller,
    condition: Condition,
    flown: pd.DataFrame,
) -> FlightPerformance | None:
    """Performance at the flight's weight and density, and at those requested.

    flown: rows of `air_data` within the maneuvers analyzed. condition: weight and density of the flight.
    None where the battery's energy is not known, or the propeller's table cannot give the thrust of level flight.
    """
    battery_Wh = request.battery_energy_Wh(aircraft)
    if battery_Wh is None:
        return None
    flight = FlownCondition(condition, float(flown["static_Pa"].mean()), float(flown["temperature_K"].mean()))
    data = power_train_data(trajectory, aircraft, propeller)
    model = performance_model(data, drag.main, aircraft, propeller, drag.flown_CL)
    requested = requested_conditions(request, flight)
    return flight_performance(model, condition, requested, battery_energy_Wh=battery_Wh, usable=request.usable)


def power_train_data(trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> pd.DataFrame:
    """What the power train did along the trajectory, five rows a second; index t_s.

    V [m/s], alpha [rad], CL, n [rev/s], rho [kg/m^3], J, throttle (0 to 1), battery_V, battery_A, battery_W, height_m,
    covered (inside the propeller's table and above `least_height_m`); NaN gaps.
    """
    flight_forces = FlightForces(trajectory, aircraft, propeller)
    return _with_battery_and_coverage(flight_forces.nominal, flight_forces.block_means.means, propeller)


def _with_battery_and_coverage(forces: pd.DataFrame, mean: Mapping[str, Array], propeller: Propeller) -> pd.DataFrame:
    """forces : of `FlightForces.forces`     mean : measurements by name, in the same rows; NaN where missing"""
    data = forces[["V", "alpha", "CL", "n", "rho", "J"]].copy()
    for name in ("throttle", "battery_V", "battery_A", "height_m"):
        data[name] = mean.get(name, np.nan)
    data["battery_W"] = data["battery_V"] * data["battery_A"]
    inside = propeller.covers(data["J"].to_numpy(), 60 * data["n"].to_numpy())
    data["covered"] = inside & (data["height_m"] > AIRCRAFT_SIZE.least_height_m * mean.get(SPEED_SCALE, 1.0)).to_numpy()
    return data


def performance_model(
    data: pd.DataFrame,
    estimate: DynamicEstimate,
    aircraft: Aircraft,
    propeller: Propeller,
    flown_CL: tuple[float, float],
) -> PerformanceModel:
    """Polar and thrust correction as estimated, with power train and full throttle. data : of `power_train_data`"""
    polar = ParameterVector((*POLAR, *THRUST), estimate.values, estimate.noise + estimate.systematic)
    scale, slope = (float(estimate.values[polar.names.index(name)]) for name in THRUST)
    propulsion = with_assumed_motor(aircraft.propulsion, data, propeller)
    known = {} if motor_is_known(aircraft.propulsion) else {"motor_source": ASSUMED_MOTOR}
    train = fit_power_train(data, propulsion, propeller, thrust_scale=scale, thrust_slope=slope, **known)
    motor = fit_full_throttle(data, propulsion, propeller)
    parts = [polar, incidence(data), train.parameters]
    if motor.parameters is not None:
        parts.append(motor.parameters)
    return PerformanceModel(combine_independent(*parts), train, motor, propeller, flown_CL)


def flight_performance(
    model: PerformanceModel,
    condition: Condition,
    requested: Iterable[TitledCondition],
    *,
    battery_energy_Wh: float,
    usable: float,
) -> FlightPerformance | None:
    """Performance at `condition`, the flight's own weight and density, and at those requested.

    None where the propeller's table cannot give the thrust of level flight.
    """
    energy_J = usable_energy_J(battery_energy_Wh, usable)
    as_flown = performance_at(model, TitledCondition("as flown", condition), energy_J)
    if not np.isfinite(as_flown.level_flight.battery.value).any():
        return None
    points = model.parameters.sigma_points()

    def level(V: Array) -> LevelFlight:
        return level_flight(points, model.power_train, model.propeller, condition, model.flown_CL, V)

    return FlightPerformance(
        battery_energy_Wh=battery_energy_Wh,
        usable=usable,
        model=model,
        as_flown=as_flown,
        requested=[performance_at(model, titled, energy_J) for titled in requested],
        efficiency=level(_flown_speeds(model, condition, EFFICIENCY_SPEEDS)),
        field_table=level(_whole_speeds(as_flown.level_flight.V)),
        ceilings=_ceilings(model, points, condition) if as_flown.full_throttle else None,
    )


def usable_energy_J(battery_energy_Wh: float, usable: float) -> float:
    """Energy that is used, of a battery's energy and the share of it that is usable."""
    return 3600 * battery_energy_Wh * usable


def performance_at(
    model: PerformanceModel, titled: TitledCondition, energy_J: float, speeds: int = SPEEDS
) -> ConditionPerformance:
    """Performance at one weight and density, at `speeds` speeds of the flown lift coefficients."""
    condition, points = titled.condition, model.parameters.sigma_points()
    V = _flown_speeds(model, condition, speeds)
    flight = level_flight(points, model.power_train, model.propeller, condition, model.flown_CL, V)
    full, everywhere = None, np.ones(len(V), dtype=bool)
    sustained = everywhere
    if model.full_throttle.parameters is not None:
        full = full_throttle_performance(points, model.propeller, condition, model.flown_CL)
        sustained = ~(np.interp(V, full.V, full.climb.value) < 0)
    anywhere = bool((sustained & np.isfinite(flight.battery.value)).any())
    allowed = sustained if anywhere else everywhere
    return ConditionPerformance(
        title=titled.title,
        condition=condition,
        sustained=anywhere,
        level_flight=flight,
        endurance=longest_endurance(flight, energy_J, allowed),
        range=longest_range(flight, energy_J, allowed),
        full_throttle=full,
    )


def _flown_speeds(model: PerformanceModel, condition: Condition, speeds: int) -> Array:
    """Evenly spaced speeds [m/s] from the largest to the smallest lift coefficient flown."""
    smallest_CL, largest_CL = model.flown_CL
    return np.linspace(speed_at(largest_CL, condition), speed_at(smallest_CL, condition), speeds)


def _whole_speeds(V: Array) -> Array:
    """Whole speeds within V [m/s], at most FIELD_TABLE_ROWS of them."""
    slowest, fastest = np.ceil(V[0]), np.floor(V[-1])
    step = max(1.0, np.ceil((fastest - slowest + 1) / FIELD_TABLE_ROWS))
    return np.arange(slowest, fastest + 0.5, step)


def _ceilings(model: PerformanceModel, points: SigmaPoints, condition: Condition) -> Ceilings:
    return Ceilings(*ceilings_m(points, model.propeller, condition, model.flown_CL, (SERVICE_CLIMB_MPS, 0.0)))
