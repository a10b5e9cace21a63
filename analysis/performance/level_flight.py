"""Balance of forces in steady flight, in which thrust carries part of the weight.

L + T sin(alpha) = W cos(gamma) and T cos(alpha) = D + W sin(gamma): (3.21) and (3.22) without accelerations. Power
required is D V at L = W by its definition (1.3). The thrust of level flight and the climb at full throttle follow from
this balance.

The angle of attack is a straight line over C_L, fitted by `incidence` and treated as exact, because an error of a
quarter of a degree changes a climb by only 0.1 %.

In level flight drag determines thrust; thrust and speed determine the speed of rotation, which gives the shaft power,
which gives the battery power. Best endurance and range on a battery, in still air, follow from that.

Units: thrust and drag in N, V in m/s, angles in rad.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.curve import Condition, inside, lift_coefficient
from flightpower.analysis.methods.settings import REGRESSION
from flightpower.analysis.performance.full_throttle import FullThrottle
from flightpower.analysis.performance.power_train import PowerTrainModel
from flightpower.analysis.performance.propagation import (
    ParameterVector,
    SigmaPoints,
    UncertainValue,
    exact,
    from_sigma_points,
)
from flightpower.analysis.records.flight import LevelEfficiencyPoint
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_speed import revps_for_thrust

Floats = float | Array


@dataclass(frozen=True)
class PerformanceModel:
    """Inputs for computing performance.

    parameters : A0, A1, A2, thrust_scale, thrust_slope, alpha_0, alpha_CL, shaft_scale, friction, copper, meter_scale;
        then unloaded_revps and revps_per_Nm if full throttle is known
    """

    parameters: ParameterVector
    power_train: PowerTrainModel
    full_throttle: FullThrottle
    propeller: Propeller
    flown_CL: tuple[float, float]

    @cached_property
    def sigma_points(self) -> SigmaPoints:
        """Sigma points of the parameters, the input of every function of performance."""
        return self.parameters.sigma_points()


def incidence(data: pd.DataFrame) -> ParameterVector:
    """alpha_0 and alpha_CL of alpha [rad] = alpha_0 + alpha_CL C_L, fitted to the flight.

    data : columns CL, alpha, covered (inside the propeller's table, well above the ground); gaps are NaN. With fewer
    than REGRESSION.fewest_blocks_of_flight rows both are zero, so thrust acts along the flight path.
    """
    flown = data.loc[data["covered"], ["CL", "alpha"]].dropna()
    if len(flown) < REGRESSION.fewest_blocks_of_flight:
        return exact(alpha_0=0.0, alpha_CL=0.0)
    slope, offset = np.polyfit(flown["CL"], flown["alpha"], 1)
    return exact(alpha_0=float(offset), alpha_CL=float(slope))


def drag(parameters: SigmaPoints, V: Array, CL: Array, condition: Condition) -> Array:
    """Drag [N], (2m + 1, k), of the polar at V (k,) [m/s] and C_L. parameters : A0, A1, A2"""
    return _qS(V, condition) * (parameters["A0"] + parameters["A1"] * CL + parameters["A2"] * CL**2)


def steady_thrust(
    parameters: SigmaPoints, V: Array, condition: Condition, sine: Floats = 0.0, load_factor: Floats = 1.0
) -> Array:
    """Thrust [N], (2m + 1, k), of steady flight at V (k,) [m/s]. parameters : A0, A1, A2, alpha_0, alpha_CL

    Flight is level and straight by default. `sine` is the sine of the climb angle; a turn has a load factor of 1/cos of
    the bank. In level flight thrust exceeds drag by the factor 1/cos(alpha), but the weight that it carries reduces
    lift, and thereby drag. Thrust is below zero in a descent steeper than a glide.
    """
    carried_N = np.zeros(1)
    normal_N = condition.weight_N * load_factor * np.sqrt(1 - np.square(sine))
    for _ in range(6):  # each pass changes the result by a tenth of the change in the pass before
        CL = (normal_N - carried_N) / _qS(V, condition)
        alpha = parameters["alpha_0"] + parameters["alpha_CL"] * CL
        thrust_N = (drag(parameters, V, CL, condition) + condition.weight_N * sine) / np.cos(alpha)
        carried_N = thrust_N * np.sin(alpha)
    return np.asarray(thrust_N)


def climb_angle(parameters: SigmaPoints, thrust_N: Array, V: Array, condition: Condition) -> tuple[Array, Array]:
    """The sine of the climb angle and the thrust along the flight path [N], each (2m + 1, k), at V (k,) [m/s].

    parameters : A0, A1, A2, alpha_0, alpha_CL     thrust_N : (2m + 1, k), along the propeller's axis
    """
    carried_N, sine = np.zeros(1), np.zeros(1)
    for _ in range(6):  # each pass changes the result by a tenth of the change in the pass before
        CL = (condition.weight_N * np.sqrt(1 - sine**2) - carried_N) / _qS(V, condition)
        alpha = parameters["alpha_0"] + parameters["alpha_CL"] * CL
        along_path_N, carried_N = thrust_N * np.cos(alpha), thrust_N * np.sin(alpha)
        excess_N = along_path_N - drag(parameters, V, CL, condition)
        sine = np.clip(excess_N / condition.weight_N, -0.99, 0.99)  # never quite vertical
    return sine, along_path_N


def _qS(V: Array, condition: Condition) -> Array:
    """Dynamic pressure times wing area [N]."""
    return condition.rho * V**2 / 2 * condition.wing_area_m2


@dataclass(frozen=True)
class LevelFlight:
    """Steady level flight at speeds V (k,) [m/s]; NaN where the propeller cannot give the thrust.

    required : power required [W], which is speed times the drag at lift = weight     shaft, battery : power [W]
    propeller, motor, overall : efficiencies (0 to 1); the motor's includes its speed controller
    inside : (k,) whether the lift coefficient was flown and the propeller's table is not extrapolated
    battery_at_sigma_points : battery power [W], (2m + 1, k)
    """

    V: Array
    required: UncertainValue
    shaft: UncertainValue
    battery: UncertainValue
    propeller: UncertainValue
    motor: UncertainValue
    overall: UncertainValue
    inside: NDArray[np.bool_]
    battery_at_sigma_points: Array

    def efficiencies(self) -> list[LevelEfficiencyPoint]:
        """Efficiencies as results.json has them, at the speeds at which the propeller can give the thrust."""
        return [
            LevelEfficiencyPoint(
                speed_mps=float(v),
                propeller=self.propeller.at(i).interval(),
                motor=self.motor.at(i).interval(),
                overall=self.overall.at(i).interval(),
                extrapolated=not self.inside[i],
            )
            for i, v in enumerate(self.V)
            if np.isfinite(self.overall.value[i])
        ]


def level_flight(model: PerformanceModel, condition: Condition, V: Array) -> LevelFlight:
    """Level flight at one weight and density and at speeds V (k,) [m/s]."""
    (flight,) = level_flights(model, [condition], V[None])
    return flight


def at_each_speed(conditions: Sequence[Condition], V: Array) -> Condition:
    """Repeat the weights, densities and wing areas of conditions (c,) for each of their speeds V (c, k), as (c k,)."""
    return Condition(*np.repeat(np.array(conditions), V.shape[1], axis=0).T)


def level_flights(model: PerformanceModel, conditions: Sequence[Condition], speeds: Array) -> list[LevelFlight]:
    """Compute level flight for c conditions, each at its own speeds (c, k) [m/s], in one step."""
    condition, V = at_each_speed(conditions, speeds), speeds.ravel()
    parameters, propeller, train = model.sigma_points, model.propeller, model.power_train
    CL, thrust_N = lift_coefficient(V, condition), steady_thrust(parameters, V, condition)
    correction = {name: parameters[name] for name in ("thrust_scale", "thrust_slope")}
    n = revps_for_thrust(propeller, V, thrust_N, condition.rho, **correction)
    _, table_shaft_W = propeller.thrust_and_power(V, n, condition.rho)
    battery_W = train.battery_power(table_shaft_W, n, parameters)
    shaft_W, thrust_power_W = train.shaft_power(table_shaft_W, parameters), thrust_N * V
    covered = propeller.covers(V / (n[0] * propeller.diameter_m), 60 * n[0])
    flown = inside(CL, model.flown_CL)
    required, shaft, battery = (
        from_sigma_points(power_W) for power_W in (drag(parameters, V, CL, condition) * V, shaft_W, battery_W)
    )
    shares = (thrust_power_W / shaft_W, shaft_W / battery_W, thrust_power_W / battery_W)
    of_propeller, of_motor, overall = (from_sigma_points(share) for share in shares)
    k = speeds.shape[1]
    return [
        LevelFlight(
            V=V[rows],
            required=required.at(rows),
            shaft=shaft.at(rows),
            battery=battery.at(rows),
            propeller=of_propeller.at(rows),
            motor=of_motor.at(rows),
            overall=overall.at(rows),
            inside=(covered & flown)[rows],
            battery_at_sigma_points=battery_W[:, rows],
        )
        for rows in (slice(i * k, (i + 1) * k) for i in range(len(conditions)))
    ]


@dataclass(frozen=True)
class Optimum:
    """The best speed among those of a `LevelFlight`.

    speed_mps : the best speed     best : endurance [s] or range [m] there     power_W : from the battery there
    at_slowest, at_fastest : whether the best speed is at that end     inside : `LevelFlight.inside` there
    """

    speed_mps: UncertainValue
    best: UncertainValue
    power_W: UncertainValue
    at_slowest: bool
    at_fastest: bool
    inside: bool


def best_endurance(flight: LevelFlight, energy_J: float, sustained: NDArray[np.bool_]) -> Optimum:
    """The speed of best endurance. energy_J : from the battery     sustained : (k,) mask of speeds to choose from"""
    return _optimum(flight, sustained, energy_J / flight.battery_at_sigma_points)


def best_range(flight: LevelFlight, energy_J: float, sustained: NDArray[np.bool_]) -> Optimum:
    """The speed of best range. energy_J : from the battery     sustained : (k,) mask of speeds to choose from"""
    return _optimum(flight, sustained, energy_J / flight.battery_at_sigma_points * flight.V)


def _optimum(flight: LevelFlight, sustained: NDArray[np.bool_], objective: Array) -> Optimum:
    """The speed at which the objective (2m + 1, k) is largest.

    Every sigma point has its own optimum, because the value at the optimum is known better than its speed.
    """
    speed, best = (from_sigma_points(values) for values in _maxima(flight.V, np.where(sustained, objective, np.nan)))
    power_W = [np.interp(float(speed.value), flight.V, values) for values in flight.battery_at_sigma_points]
    margin = 1.01 * (flight.V[1] - flight.V[0])
    return Optimum(
        speed_mps=speed,
        best=best,
        power_W=from_sigma_points(power_W),
        at_slowest=bool(speed.value <= flight.V[0] + margin),
        at_fastest=bool(speed.value >= flight.V[-1] - margin),
        inside=bool(flight.inside[np.argmin(np.abs(flight.V - speed.value))]),
    )


def _maxima(x: Array, y: Array) -> tuple[Array, Array]:
    """Place and height (m,) of the maximum of each row of y (m, k) over evenly spaced x (k,); NaN for rows of NaN.

    The maximum is the vertex of a parabola through the highest point and its neighbors, if it has both.
    """
    rows = np.arange(len(y))
    highest = np.argmax(np.where(np.isnan(y), -np.inf, y), axis=1)
    place, height = np.where(np.isnan(y).all(axis=1), np.nan, x[highest]), y[rows, highest]
    middle = np.clip(highest, 1, len(x) - 2)
    before, after = y[rows, middle - 1] - height, y[rows, middle + 1] - height
    bend = before + after
    curved = (middle == highest) & (bend < 0) & np.isfinite(bend)
    shift = np.divide(before - after, 2 * bend, out=np.zeros(len(y)), where=curved)
    return place + shift * (x[1] - x[0]), height + np.where(curved, after - before, 0.0) * shift / 4
