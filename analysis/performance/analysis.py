"""The steps that lead from drag polar, power train and flight to the performance of the aircraft."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import msgspec
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.curve import POLAR, Condition, speed_at
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.ladder import Estimated
from flightpower.analysis.methods.thrust_prior import THRUST
from flightpower.analysis.performance.climb import (
    NOT_KNOWN,
    FullThrottlePerformance,
    available_result,
    ceilings_m,
    full_throttle_performance,
)
from flightpower.analysis.performance.full_throttle import fit_full_throttle
from flightpower.analysis.performance.level_flight import (
    LevelFlight,
    PerformanceModel,
    best_endurance,
    best_range,
    incidence,
    level_flight,
)
from flightpower.analysis.performance.power_train import (
    WHY_ASSUMED,
    fit_power_train,
    motor_is_known,
    with_assumed_motor,
)
from flightpower.analysis.performance.propagation import ParameterVector, combine_independent
from flightpower.analysis.performance.request import (
    FlownCondition,
    Request,
    TitledCondition,
    density_altitude_m,
    requested_conditions,
)
from flightpower.analysis.performance.stored_model import model_result
from flightpower.analysis.records.flight import (
    BatteryResult,
    FieldRow,
    PerformanceCase,
    PerformanceResult,
    PowerTrainResult,
)
from flightpower.analysis.settings import CURVES, EVIDENCE
from flightpower.analysis.sources.daemon import SPEED_SCALE
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller
from flightpower.flight.runs import AIRCRAFT_SIZE
from flightpower.flight.units import FOOT_M


@dataclass(frozen=True)
class ConditionPerformance:
    """Performance at one weight and density.

    sustained : full throttle holds level flight at some of the speeds, or is not known. If false, endurance and range
        of `case` ignore full throttle.
    level_flight : at the speeds flown     full_throttle : None where it is not known
    """

    case: PerformanceCase
    sustained: bool
    level_flight: LevelFlight
    full_throttle: FullThrottlePerformance | None


@dataclass(frozen=True)
class Performance:
    """Performance of a flight as results.json has it, and the model that computes it at any weight and density."""

    result: PerformanceResult
    battery: BatteryResult
    model: PerformanceModel
    flown: FlownCondition


def compute(request: Request, flight: Estimated) -> Performance | None:
    """Performance at the flight's weight and density, and at those requested.

    None where the battery's energy is not known, or the propeller's table cannot give the thrust of level flight.
    """
    aircraft, drag = flight.aircraft, flight.drag
    battery = request.battery(aircraft)
    if battery is None:
        return None
    flown = flight.rows_flown
    condition = FlownCondition(flight.condition, float(flown["static_Pa"].mean()), float(flown["temperature_K"].mean()))
    data = power_train_data(flight.trajectory, aircraft, flight.propeller)
    model = performance_model(data, drag.main, aircraft, flight.propeller, drag.flown_CL)
    result = flight_performance(model, flight.condition, requested_conditions(request, condition), battery)
    return Performance(result, battery, model, condition) if result else None


def power_train_data(trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> pd.DataFrame:
    """Data of the power train along the trajectory, five rows per second, with index t_s.

    Columns: V [m/s], alpha [rad], CL, n [rev/s], rho [kg/m^3], J, throttle (0 to 1), battery_V, battery_A, battery_W,
    height_m, covered (inside the propeller's table and above `least_height_m`). Gaps are NaN.
    """
    flight_forces = FlightForces(trajectory, aircraft, propeller)
    return _with_battery_and_coverage(flight_forces.nominal, flight_forces.block_means.means, propeller)


def _with_battery_and_coverage(forces: pd.DataFrame, mean: Mapping[str, Array], propeller: Propeller) -> pd.DataFrame:
    """Add battery and `covered` to the forces, which come from `FlightForces.forces`.

    mean : measurements by name, in the same rows; NaN where missing
    """
    data = forces[["V", "alpha", "CL", "n", "rho", "J"]].copy()
    for name in ("throttle", "battery_V", "battery_A", "height_m"):
        data[name] = mean.get(name, np.nan)
    data["battery_W"] = data["battery_V"] * data["battery_A"]
    inside = propeller.covers(data["J"].to_numpy(), 60 * data["n"].to_numpy())
    data["covered"] = (
        inside
        & (data["height_m"] > AIRCRAFT_SIZE.least_height_m * np.minimum(1.0, mean.get(SPEED_SCALE, 1.0))).to_numpy()
    )
    return data


def performance_model(
    data: pd.DataFrame,
    estimate: DynamicEstimate,
    aircraft: Aircraft,
    propeller: Propeller,
    flown_CL: tuple[float, float],
) -> PerformanceModel:
    """Combine the estimated polar and thrust correction with models of power train and full throttle.

    data : from `power_train_data`
    """
    polar = ParameterVector((*POLAR, *THRUST), estimate.values, estimate.noise + estimate.systematic)
    scale, slope = (float(estimate.values[polar.names.index(name)]) for name in THRUST)
    propulsion = with_assumed_motor(aircraft.propulsion, data, propeller)
    source = {} if motor_is_known(aircraft.propulsion) else {"motor_source": WHY_ASSUMED}
    train = fit_power_train(data, propulsion, propeller, thrust_scale=scale, thrust_slope=slope, **source)
    motor = fit_full_throttle(data, propulsion, propeller)
    parts = [polar, incidence(data), train.parameters]
    if motor.parameters is not None:
        parts.append(motor.parameters)
    return PerformanceModel(combine_independent(*parts), train, motor, propeller, flown_CL)


def flight_performance(
    model: PerformanceModel, condition: Condition, requested: Iterable[TitledCondition], battery: BatteryResult
) -> PerformanceResult | None:
    """Performance at `condition`, the flight's own weight and density, and at those requested.

    None where the propeller's table cannot give the thrust of level flight.
    """
    energy_J = battery.usable_J
    as_flown = performance_at(model, TitledCondition("as flown", condition), energy_J)
    if not np.isfinite(as_flown.level_flight.battery.value).any():
        return None
    others = [performance_at(model, titled, energy_J) for titled in requested]
    sustained = [other.case for other in others if other.sustained]
    single_changes = [case for case in sustained if _is_single_change(as_flown.case, case)]
    full, available = as_flown.full_throttle, msgspec.structs.replace(NOT_KNOWN, reason=model.full_throttle.reason)
    if full is not None:
        fastest_mps = float(speed_at(model.flown_CL[0], condition))
        ceilings = ceilings_m(model, condition, (100 * FOOT_M / 60, 0.0))
        available = available_result(full, ceilings, model.full_throttle.basis, fastest_mps)
    whole_speeds = level_flight(model, condition, _whole_speeds(as_flown.level_flight.V))
    return PerformanceResult(
        power_train=_power_train(model, condition),
        available=available,
        loadings=[as_flown.case, *sustained],
        costs=[_cost(as_flown.case, case) for case in single_changes or sustained],
        field_table=list(field_rows(whole_speeds, full, energy_J)),
        too_much=[
            f"{other.case.title}: level flight needs more than full throttle at every lift coefficient flown."
            for other in others
            if not other.sustained
        ],
        model=model_result(model),
    )


def performance_at(
    model: PerformanceModel, titled: TitledCondition, energy_J: float, speeds: int = CURVES.fine_points
) -> ConditionPerformance:
    """Performance at one weight and density, at `speeds` evenly spaced speeds over the lift coefficients flown."""
    condition = titled.condition
    flight = level_flight(model, condition, _flown_speeds(model, condition, speeds))
    full, everywhere = None, np.ones(speeds, dtype=bool)
    sustained = everywhere
    if model.full_throttle.parameters is not None:
        full = full_throttle_performance(model, condition)
        sustained = ~(np.interp(flight.V, full.V, full.climb.value) < 0)
    anywhere = bool((sustained & np.isfinite(flight.battery.value)).any())
    return ConditionPerformance(
        performance_case(titled, flight, full, (energy_J, sustained if anywhere else everywhere)),
        anywhere,
        flight,
        full,
    )


def performance_case(
    titled: TitledCondition,
    flight: LevelFlight,
    full: FullThrottlePerformance | None,
    battery: tuple[float, NDArray[np.bool_]],
) -> PerformanceCase:
    """Endurance, range and performance at full throttle. battery: its energy [J], and a mask (k,) of speeds to use."""
    endurance, range_ = best_endurance(flight, *battery), best_range(flight, *battery)
    slowest = float(flight.V[0])
    return PerformanceCase(
        title=titled.title,
        weight_N=titled.condition.weight_N,
        air_density_kgpm3=titled.condition.rho,
        density_altitude_m=float(density_altitude_m(titled.condition.rho)),
        # Where power is hardly known, a symmetric interval would reach below zero.
        endurance_s=endurance.best.interval(0.0),
        endurance_speed_mps=endurance.speed_mps.interval(slowest),
        endurance_power_W=float(endurance.power_W.value),
        endurance_at_slowest=endurance.at_slowest,
        endurance_at_fastest=endurance.at_fastest,
        range_m=range_.best.interval(0.0),
        range_speed_mps=range_.speed_mps.interval(slowest),
        range_power_W=float(range_.power_W.value),
        range_at_slowest=range_.at_slowest,
        range_at_fastest=range_.at_fastest,
        maximum_speed_mps=full.maximum_speed.interval_if_known() if full else None,
        best_climb_mps=full.best_climb.interval_if_known() if full else None,
        extrapolated=not (endurance.inside and range_.inside and (full is None or full.covers_maximum())),
    )


def _flown_speeds(model: PerformanceModel, condition: Condition, speeds: int) -> Array:
    """Evenly spaced speeds [m/s] from the largest to the smallest lift coefficient flown."""
    smallest_CL, largest_CL = model.flown_CL
    return np.linspace(speed_at(largest_CL, condition), speed_at(smallest_CL, condition), speeds)


def _whole_speeds(V: Array) -> Array:
    """At most ten whole numbers of m/s within V, so that the table for the field fits on a card."""
    slowest, fastest = np.ceil(V[0]), np.floor(V[-1])
    step = max(1.0, np.ceil((fastest - slowest + 1) / 10))
    return np.arange(slowest, fastest + 0.5, step)


def _is_single_change(as_flown: PerformanceCase, case: PerformanceCase) -> bool:
    """Whether a case differs from the flight in weight or in air density, but not in both."""
    same_weight = abs(case.weight_N / as_flown.weight_N - 1) < EVIDENCE.negligible
    same_density = abs(case.air_density_kgpm3 / as_flown.air_density_kgpm3 - 1) < EVIDENCE.negligible
    return same_weight != same_density


def _cost(as_flown: PerformanceCase, case: PerformanceCase) -> str:
    """A sentence on how endurance, range and the speed of best range change from the flight's own condition."""

    def change(before: float, after: float, unit: str, digits: int) -> str:
        return f"{before:.{digits}f} to {after:.{digits}f} {unit} ({100 * (after / before - 1):+.0f} %)"

    endurance = change(as_flown.endurance_s.value / 60, case.endurance_s.value / 60, "min", 0)
    range_ = change(as_flown.range_m.value / 1000, case.range_m.value / 1000, "km", 1)
    speed = change(as_flown.range_speed_mps.value, case.range_speed_mps.value, "m/s", 1)
    return (
        f"{case.title}: best endurance changes from {endurance}, best range from {range_},"
        f" the speed of best range from {speed}."
    )


def _power_train(model: PerformanceModel, condition: Condition) -> PowerTrainResult:
    """Losses, efficiencies measured in flight, and efficiencies of level flight at the flight's own condition."""
    flight = level_flight(model, condition, _flown_speeds(model, condition, 31))
    train = model.power_train
    return PowerTrainResult(
        measured=train.measured,
        basis=train.basis,
        parameters=train.parameter_results(),
        efficiency=flight.efficiencies(),
        points=list(train.points),
    )


def field_rows(flight: LevelFlight, full: FullThrottlePerformance | None, energy_J: float) -> Iterator[FieldRow]:
    """Rows of the table for the field, one for each speed at which battery power is known. energy_J: of the battery"""
    for i, v in enumerate(flight.V):
        battery_W = float(flight.battery.value[i])
        if np.isfinite(battery_W):
            climb = np.interp(v, full.V, full.climb.value) if full else np.nan
            yield FieldRow(
                speed_mps=float(v),
                power_required_W=float(flight.required.value[i]),
                battery_W=battery_W,
                endurance_s=energy_J / battery_W,
                range_m=energy_J / battery_W * float(v),
                climb_mps=float(climb) if np.isfinite(climb) else None,
                extrapolated=not flight.inside[i],
            )
