"""Power available at full throttle: highest level speed, rate of climb, ceilings (Fig. 1.2).

The motor's model is that of `full_throttle`; with the propeller's table it gives the speed of rotation, thrust and
power at any speed and density. Limit: in the table Reynolds number depends on the speed of rotation alone, so the lower
Reynolds numbers of thin air are neglected.

Units: V and climb in m/s, thrust in N, power in W, n in rev/s.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.curve import Condition, power_points, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.performance.level_flight import PerformanceModel, at_each_speed, climb_angle
from flightpower.analysis.performance.propagation import SigmaPoints, UncertainValue, from_sigma_points
from flightpower.analysis.performance.settings import PERFORMANCE
from flightpower.analysis.records.flight import AvailableResult, Interval
from flightpower.analysis.settings import CURVES
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import density, pressure_at, temperature_at
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_speed import corrected_thrust, full_throttle_revps
from flightpower.flight.units import TROPOPAUSE_M


@dataclass(frozen=True)
class FullThrottlePerformance:
    """Full throttle at one weight and density; NaN where the motor does not turn the propeller.

    V : (k,) [m/s]     thrust_N : along the propeller's axis, (k,)     power : available [W], (k,)
    climb : rate of climb [m/s], (k,)
    covered : whether the propeller's table covers it, (k,)     maximum_speed, best_climb : [m/s]; NaN if there is none
    """

    V: Array
    thrust_N: Array
    power: UncertainValue
    climb: UncertainValue
    covered: NDArray[np.bool_]
    maximum_speed: UncertainValue
    best_climb: UncertainValue
    best_climb_speed: float

    def covers_maximum(self) -> bool:
        """Whether the propeller's table covers the highest level speed; true if that speed is not known."""
        maximum = self.maximum_speed.interval_if_known()
        return maximum is None or bool(self.covered[np.argmin(np.abs(self.V - maximum.value))])


def full_throttle_performance(
    model: PerformanceModel, condition: Condition, speeds: int = CURVES.fine_points
) -> FullThrottlePerformance:
    """Power available, climb and highest level speed from a model that has parameters of full throttle."""
    (performance,) = full_throttle_performances(model, [condition], speeds)
    return performance


def full_throttle_performances(
    model: PerformanceModel, conditions: Sequence[Condition], speeds: int
) -> list[FullThrottlePerformance]:
    """Compute `full_throttle_performance` for all conditions in one step."""
    smallest_CL, largest_CL = model.flown_CL
    slowest, fastest = (np.array([speed_at(CL, c) for c in conditions]) for CL in (largest_CL, smallest_CL))
    V = np.linspace(slowest, PERFORMANCE.fastest_sought * fastest, speeds, axis=1)
    n, thrust_N, power_W, climb = _climb(model.sigma_points, model.propeller, V.ravel(), at_each_speed(conditions, V))
    covered = model.propeller.covers(V.ravel() / (n[0] * model.propeller.diameter_m), 60 * n[0])
    return [
        _performance(V[i], thrust_N[0, rows], power_W[:, rows], climb[:, rows], covered[rows])
        for i, rows in enumerate(slice(i * speeds, (i + 1) * speeds) for i in range(len(conditions)))
    ]


def _performance(
    V: Array, thrust_N: Array, power_W: Array, climb: Array, covered: NDArray[np.bool_]
) -> FullThrottlePerformance:
    """Full throttle at one condition, from power available and climb at the sigma points, each (2m + 1, k)."""
    return FullThrottlePerformance(
        V=V,
        thrust_N=thrust_N,
        power=from_sigma_points(power_W),
        climb=from_sigma_points(climb),
        covered=covered,
        # The highest level speed is the last speed at which climb turns into descent.
        maximum_speed=from_sigma_points(_last_crossings(V, climb)),
        best_climb=from_sigma_points(np.fmax.reduce(climb, axis=1)),
        best_climb_speed=float(V[np.argmax(np.nan_to_num(climb[0], nan=-np.inf))]),
    )


def _climb(
    parameters: SigmaPoints, propeller: Propeller, V: Array, condition: Condition
) -> tuple[Array, Array, Array, Array]:
    """n [rev/s], thrust [N], power available T V cos(alpha) [W] (3.47) and rate of climb V sin(gamma) [m/s], each
    (2m + 1, k).
    """
    n, thrust_N = _thrust(parameters, propeller, V, condition.rho)
    sine, along_path_N = climb_angle(parameters, thrust_N, V, condition)
    return n, thrust_N, along_path_N * V, V * sine


def full_throttle_thrust(model: PerformanceModel, V: Array, rho: float) -> Array:
    """Thrust [N] along the propeller's axis at full throttle and V (k,) [m/s]; NaN if the motor does not turn it."""
    estimate = {name: points[:1] for name, points in model.sigma_points.items()}
    return np.asarray(_thrust(estimate, model.propeller, V, rho)[1][0])


def _thrust(parameters: SigmaPoints, propeller: Propeller, V: Array, rho: float) -> tuple[Array, Array]:
    """n [rev/s] and thrust [N] at full throttle, each (2m + 1, k)."""
    motor = {name: parameters[name] for name in ("unloaded_revps", "revps_per_Nm")}
    n = full_throttle_revps(propeller, V, rho, **motor)
    correction = {name: parameters[name] for name in ("thrust_scale", "thrust_slope")}
    return n, corrected_thrust(propeller, V, n, rho, **correction)


def _last_crossings(x: Array, y: Array) -> Array:
    """The last x at which each sigma point's y (2m + 1, k) falls through zero over x (k,), linear between points.

    A sigma point that does not cross within x gets a first-order value: the estimate's crossing, shifted by the
    difference of y over the slope there. It is NaN if the estimate itself does not cross.
    """
    falls = (y[:, :-1] > 0) & (y[:, 1:] <= 0)
    crosses, rows = np.asarray(falls.any(axis=1)), np.arange(len(y))
    last = falls.shape[1] - 1 - np.argmax(falls[:, ::-1], axis=1)
    above, below = y[rows, last], y[rows, last + 1]
    share = np.divide(above, above - below, out=np.full(len(y), np.nan), where=crosses)
    crossings = x[last] + (x[last + 1] - x[last]) * share
    if crosses[0] and not crosses.all():
        i = last[0]
        slope = (y[0, i + 1] - y[0, i]) / (x[i + 1] - x[i])
        y_there = y[:, i] + share[0] * (y[:, i + 1] - y[:, i])
        crossings = np.where(crosses, crossings, crossings[0] - y_there / slope)
    return np.asarray(crossings)


def ceilings_m(model: PerformanceModel, condition: Condition, climbs_mps: tuple[float, ...]) -> list[UncertainValue]:
    """Density altitudes [m] in the standard atmosphere at which the best climb has fallen to each of `climbs_mps`.

    They are NaN above the troposphere and below sea level. The climb is the best over the lift coefficients flown, with
    the motor's voltage as in the flight. condition: its weight and wing area are used, its density is not
    """
    heights_m = np.linspace(0.0, TROPOPAUSE_M, 23)  # 500 m apart: climb is linear between
    rhos = density(pressure_at(heights_m), temperature_at(heights_m))
    conditions = [condition._replace(rho=float(rho)) for rho in rhos]
    smallest_CL, largest_CL = model.flown_CL
    CL = np.linspace(largest_CL, smallest_CL, 25)
    V = np.array([speed_at(CL, at_height) for at_height in conditions])
    *_, climb = _climb(model.sigma_points, model.propeller, V.ravel(), at_each_speed(conditions, V))
    best = np.fmax.reduce(climb.reshape(len(climb), *V.shape), axis=2)
    return [from_sigma_points(_last_crossings(heights_m, best - least)) for least in climbs_mps]


NOT_KNOWN = AvailableResult(
    reason="", basis="", power_available=[], climb_mps=[], maximum_speed_mps=None, maximum_speed_extrapolated=False,
    best_climb_mps=None, best_climb_speed_mps=None, service_ceiling_m=None, absolute_ceiling_m=None, notes=[],
)  # fmt: skip


def available_result(
    full: FullThrottlePerformance, ceilings: list[UncertainValue], basis: str, fastest_mps: float
) -> AvailableResult:
    """Performance at full throttle as results.json has it, with notes for the reader.

    ceilings: service and absolute. basis: what the motor was fitted to, in words. fastest_mps: fastest speed flown.
    """
    maximum = full.maximum_speed.interval_if_known()
    service, absolute = (ceiling.interval_if_known() for ceiling in ceilings)
    end = max(1.03 * maximum.value, fastest_mps) if maximum else np.inf
    indices = [i for i, v in enumerate(full.V) if np.isfinite(full.power.standard_error[i]) and v <= end]
    return AvailableResult(
        reason="",
        basis=basis,
        power_available=power_points(
            full.V[indices],
            full.power.value[indices],
            NORMAL_95 * full.power.standard_error[indices],
            (full.V > fastest_mps * (1 + 1e-9))[indices] | ~full.covered[indices],
        ),
        climb_mps=[float(full.climb.value[i]) for i in indices],
        maximum_speed_mps=maximum,
        maximum_speed_extrapolated=maximum is not None and (maximum.value > fastest_mps or not full.covers_maximum()),
        best_climb_mps=full.best_climb.interval_if_known(),
        best_climb_speed_mps=full.best_climb_speed,
        service_ceiling_m=service,
        absolute_ceiling_m=absolute,
        notes=[*_notes_on_speed(full, maximum, fastest_mps), _note_on_ceilings(service)],
    )


def _notes_on_speed(full: FullThrottlePerformance, maximum: Interval | None, fastest_mps: float) -> list[str]:
    """Notes on a highest level speed that does not exist or is an extrapolation."""
    if maximum is None and np.nanmax(full.climb.value) > 0:
        return [f"No highest level speed: excess power remains up to {full.V[-1]:.1f} m/s."]
    if maximum is None:
        return ["No highest level speed: full throttle does not sustain level flight at any speed."]
    notes = []
    if maximum.value > fastest_mps:
        notes.append(
            f"The highest level speed is above the fastest speed flown, {fastest_mps:.1f} m/s: an extrapolation."
        )
    if not full.covers_maximum():
        notes.append("The highest level speed lies outside the propeller's table: an extrapolation.")
    return notes


def _note_on_ceilings(service: Interval | None) -> str:
    if service is None:
        return "The service ceiling is above the troposphere or below sea level: not computed."
    return (
        "The ceilings assume the battery charge of the runs and the lift coefficients flown, and neglect the lower"
        " Reynolds numbers of thin air."
    )
