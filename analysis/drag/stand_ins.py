"""What stands in for keys that the aircraft file lacks, and what that adds to the interval of the polar.

The analysis is repeated with each stand-in moved by one standard deviation; what that changes of the estimate is a
systematic error of all runs. Upwash acts as a slope and an offset of the angle of attack, which the trajectory
estimates: so its doubt also widens the prior of that slope, and what moving it still changes is what is left of it.
"""

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.drag.dynamic import POLAR, DynamicEstimate
from analysis.drag.polar import Condition, Polar, power_required, speed_at
from analysis.estimation.aircraft_models import lift_slope
from flight.aircraft import Aircraft
from flight.propeller import FOLD, Propeller

Array = NDArray[np.float64]
# Estimates of a flight as if aircraft and propeller were these, and the slope of angle of attack this well known.
Repeat = Callable[[Aircraft, Propeller, float], DynamicEstimate]

# A horseshoe vortex of the wing gives 1 to 2 deg of upwash per unit of lift coefficient at 0.2 to 0.4 spans ahead of
# the quarter chord; at the end of a boom from the wing tip, or far ahead, it is next to nothing.
UPWASH_SIGMA_RAD = np.radians(1.0)
PROBE_SIGMA_M, IMU_SIGMA_M = 0.2, 0.1
LEAST_SHARE = 0.005  # of the interval: narrower by less is not worth a measurement


class StandIn(NamedTuple):
    """key : of the aircraft file     what : stands in     moved : aircraft and propeller with it off by one sigma"""

    key: str
    what: str
    moved: Callable[[Aircraft, Propeller], tuple[Aircraft, Propeller]]


def _probe_ahead(aircraft: Aircraft, propeller: Propeller) -> tuple[Aircraft, Propeller]:
    x, y, z = aircraft.probe.position_m
    return replace(aircraft, probe=replace(aircraft.probe, position_m=(x + PROBE_SIGMA_M, y, z))), propeller


def _more_upwash(aircraft: Aircraft, propeller: Propeller) -> tuple[Aircraft, Propeller]:
    upwash = aircraft.probe.upwash_per_CL_rad + UPWASH_SIGMA_RAD
    return replace(aircraft, probe=replace(aircraft.probe, upwash_per_CL_rad=upwash)), propeller


def _imu_moved(axis: int) -> Callable[[Aircraft, Propeller], tuple[Aircraft, Propeller]]:
    def moved(aircraft: Aircraft, propeller: Propeller) -> tuple[Aircraft, Propeller]:
        x, y, z = (part + IMU_SIGMA_M * (i == axis) for i, part in enumerate(aircraft.imu_position_m))
        return replace(aircraft, imu_position_m=(x, y, z)), propeller

    return moved


UPWASH = "probe.upwash_per_CL"
STAND_INS = (
    StandIn(UPWASH, "1 deg, ±1 deg", _more_upwash),
    StandIn("probe.position", f"0.3 m ahead of the centre of gravity, ±{PROBE_SIGMA_M:g} m", _probe_ahead),
    StandIn("imu_position", f"the centre of gravity, ±{IMU_SIGMA_M:g} m", _imu_moved(0)),
    StandIn("imu_position", f"the centre of gravity, ±{IMU_SIGMA_M:g} m", _imu_moved(2)),
)


class Doubt(NamedTuple):
    """covariance : (5, 5) of the polar and of thrust, on top of the estimate's own     notes : sentences"""

    covariance: Array
    notes: list[str]


def alpha_scale_sigma(aircraft: Aircraft) -> float:
    """Standard deviation of the slope of angle of attack by an upwash that the aircraft file does not say.

    Upwash per CL times the lift slope of the wing. 0 where the file has it.
    """
    if aircraft.has(UPWASH):
        return 0.0
    return float(UPWASH_SIGMA_RAD * lift_slope(aircraft.aspect_ratio))


def doubt(
    repeat: Repeat, aircraft: Aircraft, propeller: Propeller, at: Condition, flown_CL: tuple[float, float]
) -> Doubt | None:
    """What the stand-ins for missing keys add to the interval; None where the aircraft file has all of these keys.

    at, flown_CL : weight and density of the flight, and lift coefficients of the speeds flown.
    """
    missing = [one for one in STAND_INS if not aircraft.has(one.key)]
    upwash = alpha_scale_sigma(aircraft)
    if not missing:
        return None
    estimate = repeat(aircraft, propeller, upwash)
    own = estimate.noise + estimate.systematic
    added = {key: np.zeros(own.shape) for key in dict.fromkeys(one.key for one in missing)}
    for one in missing:
        moved = repeat(*one.moved(aircraft, propeller), upwash).values - estimate.values
        added[one.key] += np.outer(moved, moved)
    covariance = np.sum([np.zeros(own.shape), *added.values()], axis=0)

    V = np.array([speed_at(flown_CL[1], at)])

    def width(A: Array, whole: Array) -> float:
        return float(power_required(V, Polar(A, whole[: len(POLAR), : len(POLAR)]), at)[1][0])

    now = width(estimate.values[:3], own + covariance)
    notes = []
    for key, part in added.items():
        without = own
        if key == UPWASH:
            narrow = repeat(aircraft, propeller, 0.0)
            without = narrow.noise + narrow.systematic
        known = width(estimate.values[:3], without + covariance - part)
        what = next(one.what for one in missing if one.key == key)
        notes.append(_note(key, what, 1 - known / now, V[0]))
    if not aircraft.has("propulsion.beyond_zero_thrust") and propeller.beyond_zero_thrust != FOLD:
        folding = repeat(aircraft, propeller.with_beyond_zero_thrust(FOLD), upwash).values[:3]
        power, folded = (
            float(power_required(V, Polar(A, own[:3, :3]), at)[0][0]) for A in (estimate.values[:3], folding)
        )
        notes += _folding_note(folded / power - 1, V[0])
    return Doubt(covariance, notes)


def _folding_note(change: float, V: float) -> list[str]:
    """What a propeller that folds would change. No doubt of the interval: one knows which propeller was flown."""
    if abs(change) < LEAST_SHARE:
        return []
    return [
        "The aircraft file lacks propulsion.beyond_zero_thrust: the propeller is taken to windmill. If it folds, power"
        f" at {V:.1f} m/s changes by {100 * change:+.0f} %."
    ]


def _note(key: str, what: str, share: float, V: float) -> str:
    buys = (
        f"with it the interval at {V:.1f} m/s would be {100 * share:.0f} % narrower"
        if share > LEAST_SHARE
        else "on this flight it makes no difference"
    )
    return f"The aircraft file lacks {key}: {what}, stands in; {buys}."


def widened(estimate: DynamicEstimate, by: Doubt | None) -> DynamicEstimate:
    """The estimate with the doubt of stand-ins in its systematic part."""
    if by is None:
        return estimate
    systematic = estimate.systematic + by.covariance
    n = len(POLAR)
    whole = estimate.polar.covariance + by.covariance[:n, :n]
    errors = np.sqrt(np.diag(estimate.noise + systematic)).tolist()
    parameters = [
        (name, value, errors[i] if i < len(errors) else error, unit)
        for i, (name, value, error, unit) in enumerate(estimate.parameters)
    ]
    polar = Polar(estimate.polar.A, whole)
    return replace(estimate, polar=polar, parameters=parameters, systematic=systematic)
