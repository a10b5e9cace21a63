"""What a user does with the curve: from an estimate and a flight to the answers in the results.

Builds the numbers, asks `power.propulsion`, `power.available` and `power.answers`, and says it in the results' form.
"""

import dataclasses
from itertools import product
from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.airdata.air import LEAST_HEIGHT_M
from analysis.drag import dynamic
from analysis.drag import polar as curve
from analysis.drag.estimate import DragEstimates
from analysis.drag.forces import BlockMeans
from analysis.performance import available, balance
from analysis.performance import endurance_range as answers
from analysis.performance import power_train as propulsion
from analysis.performance.propagation import Estimate, Numbers, joined
from analysis.performance.request import Request
from analysis.results.schema import (
    AvailableResult,
    EfficiencyMeasured,
    EfficiencyPoint,
    FieldRow,
    Interval,
    Loading,
    ParameterResult,
    PowerPoint,
    PowerTrainResult,
    Use,
)
from analysis.trajectory.reconstruction import Trajectory
from flight.aircraft import Aircraft
from flight.atmosphere import density, pressure_at, temperature_at
from flight.propeller import Propeller
from flight.units import GRAVITY_MPS2

Array = NDArray[np.float64]

PAYLOAD_KG, HOTTER_K, HIGHER_M = 0.3, 15.0, 1000.0  # what is asked of when nobody asks
EFFICIENCY_POINTS, FIELD_ROWS = 31, 10
SAME = 0.005  # of a weight, of a density


class Day(NamedTuple):
    """What the aircraft weighed and flew in; pressure and temperature of the air are means over the runs."""

    test: curve.Condition
    pressure_Pa: float
    temperature_K: float


def flight_data(table: pd.DataFrame, trajectory: Trajectory, aircraft: Aircraft, propeller: Propeller) -> pd.DataFrame:
    """The power train's side of a flight along its path, five rows a second.

    V [m/s], alpha [rad], CL, n [rev/s], rho, J, throttle (0 to 1), covered (by the table, well above the ground),
    battery_W; NaN gaps.
    """
    blocks = BlockMeans(table, trajectory, aircraft, propeller)
    data = blocks.forces(trajectory.states.to_numpy(), trajectory.sensor_errors)[
        ["V", "alpha", "CL", "n", "rho", "J"]
    ].copy()
    for name in ("throttle", "battery_V", "battery_A", "height_m"):
        data[name] = blocks.mean.get(name, np.nan)
    data["battery_W"] = data["battery_V"] * data["battery_A"]
    inside = propeller.covers(data["J"].to_numpy(), 60 * data["n"].to_numpy())
    data["covered"] = inside & (data["height_m"] > LEAST_HEIGHT_M).to_numpy()
    return data


class Known(NamedTuple):
    """What answers are computed of. motor : or why nothing is known of full throttle."""

    numbers: Numbers
    train: propulsion.PowerTrain
    motor: available.FullThrottle | str


def known(data: pd.DataFrame, estimate: dynamic.DynamicEstimate, aircraft: Aircraft, propeller: Propeller) -> Known:
    """Polar and thrust as estimated, the power train, and the motor at full throttle. data : of `flight_data`"""
    polar = Numbers((*dynamic.POLAR, *dynamic.THRUST), estimate.values, estimate.noise + estimate.systematic)
    thrust = (float(estimate.values[3]), float(estimate.values[4]))
    train = propulsion.power_train(data, aircraft.propulsion, propeller, thrust)
    motor = available.full_throttle(data, aircraft.propulsion, propeller)
    parts = [polar, balance.incidence(data), train.numbers]
    if isinstance(motor, available.FullThrottle):
        parts.append(motor.numbers)
    return Known(joined(*parts), train, motor)


def performance_result(
    request: Request,
    table: pd.DataFrame,
    trajectory: Trajectory,
    drag: DragEstimates,
    aircraft: Aircraft,
    propeller: Propeller,
    at: curve.Condition,
    flown: pd.DataFrame,
) -> Use | None:
    """Performance at the flight's weight and density, and at those requested.

    flown: rows of `air_data` within the maneuvers analysed. None where the propeller's table cannot give the thrust of
    level flight.
    """
    day = Day(at, float(flown["static_Pa"].mean()), float(flown["temperature_K"].mean()))
    data = flight_data(table, trajectory, aircraft, propeller)
    return use(request, data, drag.main, aircraft, propeller, day, drag.flown_CL)


def use(
    questions: Request,
    data: pd.DataFrame,
    estimate: dynamic.DynamicEstimate,
    aircraft: Aircraft,
    propeller: Propeller,
    day: Day,
    flown_CL: tuple[float, float],
) -> Use | None:
    """The answers; None where the propeller's table cannot give the thrust that level flight takes.

    data : of `flight_data`     day : of the runs
    """
    test = day.test
    numbers, train, motor = known(data, estimate, aircraft, propeller)
    full = isinstance(motor, available.FullThrottle)
    energy_Wh = questions.battery_Wh or aircraft.propulsion.battery_energy_Wh
    energy_J = 3600 * energy_Wh * questions.usable

    def answer(at: curve.Condition) -> answers.Answer:
        return answers.answer(numbers, train, propeller, at, flown_CL, energy_J, full_throttle=full)

    flown = answer(test)
    if not np.isfinite(flown.flight.battery.value).any():
        return None
    cases = _cases(questions, day)
    others = [(title, answer(at)) for title, at in cases]
    loadings = [_loading("as flown", flown)] + [_loading(title, other) for title, other in others if other.flies]
    alone = [other for other in loadings[1:] if _one_change(loadings[0], other)]
    return Use(
        battery_energy_Wh=energy_Wh,
        usable=questions.usable,
        power_train=_power_train(train, numbers, propeller, test, flown_CL),
        available=_available(motor, numbers, propeller, test, flown, flown_CL),
        loadings=loadings,
        costs=[_cost(loadings[0], other) for other in alone or loadings[1:]],
        field_table=_field_table(numbers, train, propeller, test, flown, energy_J, flown_CL),
        too_much=[
            f"{title}: more than full throttle holds level, at the lift coefficients flown."
            for title, other in others
            if not other.flies
        ],
    )


def _cases(questions: Request, day: Day) -> list[tuple[str, curve.Condition]]:
    """What besides the flight's own condition is answered: every weight in every air."""
    test = day.test
    if questions.weights_N:
        weights = [(_mass(W), W) for W in questions.weights_N]
    else:
        more = PAYLOAD_KG * GRAVITY_MPS2
        weights = [("", test.weight_N), (f"{1000 * PAYLOAD_KG:.0f} g more", test.weight_N + more)]
        weights.append((f"{2000 * PAYLOAD_KG:.0f} g more", test.weight_N + 2 * more))
    if questions.density_altitudes_m:
        airs = [
            (f"density altitude {h:.0f} m", float(density(pressure_at(h), temperature_at(h))))
            for h in questions.density_altitudes_m
        ]
    else:
        here = float(answers.density_altitude_m(test.rho))
        higher = here + HIGHER_M
        airs = [
            ("", test.rho),
            (f"{HOTTER_K:.0f} °C hotter", float(density(day.pressure_Pa, day.temperature_K + HOTTER_K))),
            (f"{HIGHER_M:.0f} m higher", float(density(pressure_at(higher), temperature_at(higher)))),
        ]
    return [
        (", ".join(part for part in (of_weight, of_air) if part), curve.Condition(W, rho, test.wing_area_m2))
        for (of_air, rho), (of_weight, W) in product(airs, weights)
        if of_weight or of_air
    ]


def _mass(weight_N: float) -> str:
    return f"{weight_N / GRAVITY_MPS2:.2f} kg"


def _interval(value: Estimate) -> Interval | None:
    if not np.isfinite(value.standard_error):
        return None
    return Interval(value=float(value.value), lo=float(value.lo), hi=float(value.hi))


def _sure(value: Estimate) -> Interval:
    """An interval that is there: where the error is not known, it is the value alone."""
    return _interval(value) or Interval(value=float(value.value), lo=float(value.value), hi=float(value.value))


def _loading(title: str, answer: answers.Answer) -> Loading:
    performance = answer.performance
    maximum = _interval(performance.maximum_speed) if performance else None
    return Loading(
        title=title,
        weight_N=answer.at.weight_N,
        air_density_kgpm3=answer.at.rho,
        density_altitude_m=float(answers.density_altitude_m(answer.at.rho)),
        endurance_s=_sure(answer.endurance.gives),
        endurance_speed_mps=_sure(answer.endurance.speed_mps),
        endurance_power_W=float(answer.endurance.power_W.value),
        endurance_at_slowest=answer.endurance.at_slowest,
        endurance_at_fastest=answer.endurance.at_fastest,
        range_m=_sure(answer.range.gives),
        range_speed_mps=_sure(answer.range.speed_mps),
        range_power_W=float(answer.range.power_W.value),
        range_at_slowest=answer.range.at_slowest,
        range_at_fastest=answer.range.at_fastest,
        maximum_speed_mps=maximum,
        best_climb_mps=_interval(performance.best_climb) if performance else None,
        extrapolated=not (answer.endurance.inside and answer.range.inside and _covers(performance, maximum)),
    )


def _covers(performance: available.Performance | None, speed: Interval | None) -> bool:
    """Whether the propeller's table covers full throttle at a speed; what is not known is not outside of it."""
    if performance is None or speed is None:
        return True
    return bool(performance.covered[np.argmin(np.abs(performance.V - speed.value))])


def _one_change(flown: Loading, other: Loading) -> bool:
    """Another weight in the same air, or another air at the same weight: the rest stands in the table."""
    same_weight = abs(other.weight_N / flown.weight_N - 1) < SAME
    return same_weight != (abs(other.air_density_kgpm3 / flown.air_density_kgpm3 - 1) < SAME)


def _cost(flown: Loading, other: Loading) -> str:
    """What another weight or air costs, in a sentence."""

    def change(now: float, then: float, unit: str, digits: int) -> str:
        return f"{now:.{digits}f} to {then:.{digits}f} {unit} ({100 * (then / now - 1):+.0f} %)"

    time = change(flown.endurance_s.value / 60, other.endurance_s.value / 60, "min", 0)
    way = change(flown.range_m.value / 1000, other.range_m.value / 1000, "km", 1)
    speed = change(flown.range_speed_mps.value, other.range_speed_mps.value, "m/s", 1)
    return f"{other.title}: longest endurance goes from {time}, range from {way}, its speed from {speed}."


def _power_train(
    train: propulsion.PowerTrain,
    numbers: Numbers,
    propeller: Propeller,
    at: curve.Condition,
    flown_CL: tuple[float, float],
) -> PowerTrainResult:
    V = np.linspace(curve.speed_at(flown_CL[1], at), curve.speed_at(flown_CL[0], at), EFFICIENCY_POINTS)
    level = answers.level_flight(numbers.nudged(), train, propeller, at, flown_CL, V)
    units = {"friction": "W s/rev", "copper": "W/(N m)^2"}
    errors = np.sqrt(np.diag(train.numbers.covariance))
    return PowerTrainResult(
        measured=train.measured,
        basis=train.basis,
        parameters=[
            ParameterResult(name=name, value=float(value), standard_error=float(error), unit=units.get(name, ""))
            for name, value, error in zip(train.numbers.names, train.numbers.values, errors, strict=True)
        ],
        efficiency=[
            EfficiencyPoint(
                speed_mps=float(v),
                propeller=_sure(_at(level.propeller, i)),
                motor=_sure(_at(level.motor, i)),
                overall=_sure(_at(level.overall, i)),
                extrapolated=not level.inside[i],
            )
            for i, v in enumerate(V)
            if np.isfinite(level.overall.value[i])
        ],
        points=[EfficiencyMeasured(**dataclasses.asdict(point)) for point in train.points],
    )


def _at(values: Estimate, i: int) -> Estimate:
    return Estimate(values.value[i], values.standard_error[i])


def _available(
    motor: available.FullThrottle | str,
    numbers: Numbers,
    propeller: Propeller,
    at: curve.Condition,
    flown: answers.Answer,
    flown_CL: tuple[float, float],
) -> AvailableResult:
    performance = flown.performance
    if isinstance(motor, str) or performance is None:
        return AvailableResult(
            reason=str(motor), basis="", power_available=[], climb_mps=[], maximum_speed_mps=None,
            maximum_speed_extrapolated=False, best_climb_mps=None, best_climb_speed_mps=None,
            service_ceiling_m=None, absolute_ceiling_m=None, notes=[],
        )  # fmt: skip
    row = numbers.nudged()
    fastest = float(curve.speed_at(flown_CL[0], at))
    maximum = _interval(performance.maximum_speed)
    service, absolute = (
        _interval(height)
        for height in available.ceilings_m(row, propeller, at, flown_CL, (available.SERVICE_CLIMB_MPS, 0.0))
    )
    notes = []
    covered = _covers(performance, maximum)
    if maximum is None:
        left = np.nanmax(performance.climb.value) > 0
        why = f"power is left over up to {performance.V[-1]:.1f} m/s" if left else "full throttle is too little for any"
        notes.append(f"No highest level speed: {why}.")
    elif maximum.value > fastest:
        notes.append(f"The highest level speed lies beyond the fastest flown, {fastest:.1f} m/s: an extrapolation.")
    if not covered:
        notes.append("The highest level speed lies outside the propeller's table: an extrapolation.")
    if service is not None:
        notes.append(
            "The ceiling assumes the battery's charge of the runs and lift coefficients as flown; Reynolds numbers of"
            " thin air are not in it."
        )
    else:
        notes.append("The service ceiling lies above the troposphere, or below sea level: not computed.")
    drawn = [i for i in range(len(performance.V)) if np.isfinite(performance.power.standard_error[i])]
    last = maximum.value * 1.03 if maximum else np.inf
    drawn = [i for i in drawn if performance.V[i] <= max(last, fastest)]
    return AvailableResult(
        reason="",
        basis=motor.basis,
        power_available=[
            PowerPoint(
                speed_mps=float(performance.V[i]),
                power_W=float(performance.power.value[i]),
                power_lo_W=float(performance.power.lo[i]),
                power_hi_W=float(performance.power.hi[i]),
                extrapolated=bool(performance.V[i] > fastest * (1 + 1e-9) or not performance.covered[i]),
            )
            for i in drawn
        ],
        climb_mps=[float(performance.climb.value[i]) for i in drawn],
        maximum_speed_mps=maximum,
        maximum_speed_extrapolated=maximum is not None and (maximum.value > fastest or not covered),
        best_climb_mps=_interval(performance.best_climb),
        best_climb_speed_mps=performance.best_climb_speed,
        service_ceiling_m=service,
        absolute_ceiling_m=absolute,
        notes=notes,
    )


def _field_table(
    numbers: Numbers,
    train: propulsion.PowerTrain,
    propeller: Propeller,
    at: curve.Condition,
    flown: answers.Answer,
    energy_J: float,
    flown_CL: tuple[float, float],
) -> list[FieldRow]:
    """Whole speeds within the flown range, at most FIELD_ROWS of them."""
    slowest, fastest = np.ceil(flown.flight.V[0]), np.floor(flown.flight.V[-1])
    step = max(1.0, np.ceil((fastest - slowest + 1) / FIELD_ROWS))
    V = np.arange(slowest, fastest + 0.5, step)
    level = answers.level_flight(numbers.nudged(), train, propeller, at, flown_CL, V)
    rows = []
    for i, v in enumerate(V):
        battery = float(level.battery.value[i])
        if np.isfinite(battery):
            climb = np.interp(v, flown.performance.V, flown.performance.climb.value) if flown.performance else np.nan
            rows.append(
                FieldRow(
                    speed_mps=float(v),
                    power_required_W=float(level.required.value[i]),
                    battery_W=battery,
                    endurance_s=energy_J / battery,
                    range_m=energy_J / battery * float(v),
                    climb_mps=float(climb) if np.isfinite(climb) else None,
                    extrapolated=not level.inside[i],
                )
            )
    return rows
