"""Performance in the form of `results.json`, with the notes and sentences that a reader needs."""

import dataclasses
from collections.abc import Iterator

import numpy as np

from analysis.performance.analysis import ConditionPerformance, FlightPerformance
from analysis.performance.full_throttle import FullThrottlePerformance
from analysis.performance.level_flight import LevelFlight
from analysis.performance.power_train import PowerTrainModel
from analysis.performance.propagation import UncertainValue
from analysis.performance.request import density_altitude_m
from analysis.polar import Condition, speed_at
from analysis.results.schema import (
    AvailableResult,
    FieldRow,
    Interval,
    LevelEfficiencyPoint,
    MeasuredEfficiencyPoint,
    ParameterResult,
    PerformanceCase,
    PerformanceResult,
    PowerPoint,
    PowerTrainResult,
)

SAME_SHARE = 0.005  # weights, and densities, closer than this count as equal
BEYOND_MAXIMUM = 1.03  # power available is drawn up to this times the highest level speed
ROUNDING = 1e-9
POWER_TRAIN_UNITS = {"friction": "W s/rev", "copper": "W/(N m)^2"}


def performance_result(performance: FlightPerformance) -> PerformanceResult:
    as_flown = _case(performance.as_flown)
    requested = [_case(one) for one in performance.requested if one.sustained]
    single_changes = [case for case in requested if _is_single_change(as_flown, case)]
    return PerformanceResult(
        battery_energy_Wh=performance.battery_energy_Wh,
        usable=performance.usable,
        power_train=_power_train(performance.model.power_train, performance.efficiency),
        available=_available(performance),
        loadings=[as_flown, *requested],
        costs=[_cost(as_flown, case) for case in single_changes or requested],
        field_table=list(_field_rows(performance)),
        too_much=[
            f"{one.title}: level flight needs more than full throttle at every lift coefficient flown."
            for one in performance.requested
            if not one.sustained
        ],
    )


def _interval(value: UncertainValue) -> Interval | None:
    """None where the standard error is not known."""
    if not np.isfinite(value.standard_error):
        return None
    return Interval(value=float(value.value), lo=float(value.lo), hi=float(value.hi))


def _interval_or_value(value: UncertainValue) -> Interval:
    """An interval of no width where the standard error is not known."""
    return _interval(value) or Interval(value=float(value.value), lo=float(value.value), hi=float(value.value))


def _time_or_distance(value: UncertainValue) -> Interval:
    """Its interval ends at zero. Where power is hardly known, the symmetric interval would reach below."""
    interval = _interval_or_value(value)
    return Interval(value=interval.value, lo=max(interval.lo, 0.0), hi=interval.hi)


def _flown_speed(value: UncertainValue, slowest: float) -> Interval:
    """A best speed among those flown; its interval ends at the slowest."""
    speed = _interval_or_value(value)
    return Interval(value=speed.value, lo=max(speed.lo, min(slowest, speed.value)), hi=speed.hi)


def _case(one: ConditionPerformance) -> PerformanceCase:
    slowest = float(one.level_flight.V[0])
    full = one.full_throttle
    maximum = _interval(full.maximum_speed) if full else None
    return PerformanceCase(
        title=one.title,
        weight_N=one.condition.weight_N,
        air_density_kgpm3=one.condition.rho,
        density_altitude_m=float(density_altitude_m(one.condition.rho)),
        endurance_s=_time_or_distance(one.endurance.best),
        endurance_speed_mps=_flown_speed(one.endurance.speed_mps, slowest),
        endurance_power_W=float(one.endurance.power_W.value),
        endurance_at_slowest=one.endurance.at_slowest,
        endurance_at_fastest=one.endurance.at_fastest,
        range_m=_time_or_distance(one.range.best),
        range_speed_mps=_flown_speed(one.range.speed_mps, slowest),
        range_power_W=float(one.range.power_W.value),
        range_at_slowest=one.range.at_slowest,
        range_at_fastest=one.range.at_fastest,
        maximum_speed_mps=maximum,
        best_climb_mps=_interval(full.best_climb) if full else None,
        extrapolated=not (one.endurance.inside and one.range.inside and _maximum_covered(full, maximum)),
    )


def _maximum_covered(full: FullThrottlePerformance | None, maximum: Interval | None) -> bool:
    """Whether the propeller's table covers the highest level speed; true where that speed is not known."""
    return full is None or maximum is None or full.covers(maximum.value)


def _is_single_change(as_flown: PerformanceCase, case: PerformanceCase) -> bool:
    """Whether a case changes the weight or the air density, but not both."""
    same_weight = abs(case.weight_N / as_flown.weight_N - 1) < SAME_SHARE
    same_density = abs(case.air_density_kgpm3 / as_flown.air_density_kgpm3 - 1) < SAME_SHARE
    return same_weight != same_density


def _cost(as_flown: PerformanceCase, case: PerformanceCase) -> str:
    """The change of endurance, range and its speed from the flight's own condition, in a sentence."""

    def change(before: float, after: float, unit: str, digits: int) -> str:
        return f"{before:.{digits}f} to {after:.{digits}f} {unit} ({100 * (after / before - 1):+.0f} %)"

    endurance = change(as_flown.endurance_s.value / 60, case.endurance_s.value / 60, "min", 0)
    range_ = change(as_flown.range_m.value / 1000, case.range_m.value / 1000, "km", 1)
    speed = change(as_flown.range_speed_mps.value, case.range_speed_mps.value, "m/s", 1)
    return (
        f"{case.title}: longest endurance changes from {endurance}, longest range from {range_},"
        f" the speed of longest range from {speed}."
    )


def _power_train(train: PowerTrainModel, efficiency: LevelFlight) -> PowerTrainResult:
    errors = np.sqrt(np.diag(train.parameters.covariance))
    names_and_values = zip(train.parameters.names, train.parameters.values, errors, strict=True)
    return PowerTrainResult(
        measured=train.measured,
        basis=train.basis,
        parameters=[
            ParameterResult(
                name=name, value=float(value), standard_error=float(error), unit=POWER_TRAIN_UNITS.get(name, "")
            )
            for name, value, error in names_and_values
        ],
        efficiency=[
            LevelEfficiencyPoint(
                speed_mps=float(v),
                propeller=_interval_or_value(efficiency.propeller.at(i)),
                motor=_interval_or_value(efficiency.motor.at(i)),
                overall=_interval_or_value(efficiency.overall.at(i)),
                extrapolated=not efficiency.inside[i],
            )
            for i, v in enumerate(efficiency.V)
            if np.isfinite(efficiency.overall.value[i])
        ],
        points=[MeasuredEfficiencyPoint(**dataclasses.asdict(point)) for point in train.efficiencies],
    )


def _available(performance: FlightPerformance) -> AvailableResult:
    full, ceilings, motor = performance.as_flown.full_throttle, performance.ceilings, performance.model.full_throttle
    if full is None or ceilings is None:
        return AvailableResult(
            reason=motor.reason, basis="", power_available=[], climb_mps=[], maximum_speed_mps=None,
            maximum_speed_extrapolated=False, best_climb_mps=None, best_climb_speed_mps=None,
            service_ceiling_m=None, absolute_ceiling_m=None, notes=[],
        )  # fmt: skip
    fastest = _fastest_flown(performance.as_flown.condition, performance.model.flown_CL)
    maximum, service = _interval(full.maximum_speed), _interval(ceilings.service_m)
    covered = _maximum_covered(full, maximum)
    end = max(BEYOND_MAXIMUM * maximum.value, fastest) if maximum else np.inf
    drawn = [i for i, v in enumerate(full.V) if np.isfinite(full.power.standard_error[i]) and v <= end]
    return AvailableResult(
        reason="",
        basis=motor.basis,
        power_available=[
            PowerPoint(
                speed_mps=float(full.V[i]),
                power_W=float(full.power.value[i]),
                power_lo_W=float(full.power.lo[i]),
                power_hi_W=float(full.power.hi[i]),
                extrapolated=bool(full.V[i] > fastest * (1 + ROUNDING) or not full.covered[i]),
            )
            for i in drawn
        ],
        climb_mps=[float(full.climb.value[i]) for i in drawn],
        maximum_speed_mps=maximum,
        maximum_speed_extrapolated=maximum is not None and (maximum.value > fastest or not covered),
        best_climb_mps=_interval(full.best_climb),
        best_climb_speed_mps=full.best_climb_speed,
        service_ceiling_m=service,
        absolute_ceiling_m=_interval(ceilings.absolute_m),
        notes=_full_throttle_notes(full, maximum, service, fastest),
    )


def _fastest_flown(condition: Condition, flown_CL: tuple[float, float]) -> float:
    return float(speed_at(flown_CL[0], condition))


def _full_throttle_notes(
    full: FullThrottlePerformance, maximum: Interval | None, service: Interval | None, fastest: float
) -> list[str]:
    """What limits the highest level speed and the ceiling. fastest : speed flown [m/s]"""
    notes = []
    if maximum is None and np.nanmax(full.climb.value) > 0:
        notes.append(f"No highest level speed: excess power remains up to {full.V[-1]:.1f} m/s.")
    elif maximum is None:
        notes.append("No highest level speed: full throttle does not sustain level flight at any speed.")
    elif maximum.value > fastest:
        notes.append(f"The highest level speed is above the fastest speed flown, {fastest:.1f} m/s: an extrapolation.")
    if not _maximum_covered(full, maximum):
        notes.append("The highest level speed lies outside the propeller's table: an extrapolation.")
    if service is None:
        notes.append("The service ceiling is above the troposphere or below sea level: not computed.")
    else:
        notes.append(
            "The ceilings assume the battery charge of the runs and the lift coefficients flown, and neglect the lower"
            " Reynolds numbers of thin air."
        )
    return notes


def _field_rows(performance: FlightPerformance) -> Iterator[FieldRow]:
    level, full = performance.field_table, performance.as_flown.full_throttle
    for i, v in enumerate(level.V):
        battery_W = float(level.battery.value[i])
        if np.isfinite(battery_W):
            climb = np.interp(v, full.V, full.climb.value) if full else np.nan
            yield FieldRow(
                speed_mps=float(v),
                power_required_W=float(level.required.value[i]),
                battery_W=battery_W,
                endurance_s=performance.energy_J / battery_W,
                range_m=performance.energy_J / battery_W * float(v),
                climb_mps=float(climb) if np.isfinite(climb) else None,
                extrapolated=not level.inside[i],
            )
