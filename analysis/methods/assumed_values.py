"""Values assumed for keys that the aircraft file lacks, and their contribution to the interval of the polar.

The analysis is repeated with each assumed value changed by one standard deviation. The change of the estimate is a
systematic error common to all runs. Upwash acts as a slope and an offset of the angle of attack, which the trajectory
reconstruction estimates, so its standard deviation is added to the prior of that slope. The reconstruction also
estimates from turns how far ahead the probe sits. So only the remainder of these two errors changes the estimate.

Errors of the pressure transducers that no residual shows are treated in the same way.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple, Protocol

import msgspec
import numpy as np
import pandas as pd
from numpy.typing import NDArray

from flightpower.analysis.air.transducers import AIR_DATA_CHANNELS, with_hysteresis, with_zero_step
from flightpower.analysis.curve import Condition, Polar, polar_part, power_required, speed_at
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.settings import COVARIANCE
from flightpower.analysis.settings import EVIDENCE
from flightpower.analysis.trajectory.priors import PROBE_POSITION, UPWASH, upwash_slope_sigma
from flightpower.analysis.trajectory.settings import PRIORS
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import FOLD, Propeller
from flightpower.flight.runs import STANDING


class Rerun(Protocol):
    """Repeats the estimate of a flight for another aircraft and propeller, as `rerun.EstimateRerun` does."""

    def estimate(self, aircraft: Aircraft, propeller: Propeller, slope_sigma: float) -> DynamicEstimate: ...

    def values(self, aircraft: Aircraft, propeller: Propeller, slope_sigma: float) -> Array: ...


class AssumedValue(NamedTuple):
    """A value assumed for a missing key.

    key : missing key of the aircraft file     description : the value and its standard deviation, in words
    perturbed : the aircraft with this value changed by one standard deviation
    """

    key: str
    description: str
    perturbed: Callable[[Aircraft], Aircraft]


def _probe_ahead(aircraft: Aircraft) -> Aircraft:
    x, y, z = aircraft.probe.position_m
    return replace(aircraft, probe=replace(aircraft.probe, position_m=(x + PRIORS.probe_ahead_m, y, z)))


def _more_upwash(aircraft: Aircraft) -> Aircraft:
    upwash = aircraft.probe.upwash_per_CL_rad + PRIORS.upwash_rad
    return replace(aircraft, probe=replace(aircraft.probe, upwash_per_CL_rad=upwash))


def _imu_displaced(axis: int) -> Callable[[Aircraft], Aircraft]:
    def perturbed(aircraft: Aircraft) -> Aircraft:
        x, y, z = (part + COVARIANCE.imu_position_m * (i == axis) for i, part in enumerate(aircraft.imu_position_m))
        return replace(aircraft, imu_position_m=(x, y, z))

    return perturbed


ASSUMED_VALUES = (
    AssumedValue(UPWASH, "1 deg, ±1 deg", _more_upwash),
    AssumedValue(PROBE_POSITION, f"0.3 m ahead of the center of gravity, ±{PRIORS.probe_ahead_m:g} m", _probe_ahead),
    AssumedValue("imu_position", f"the center of gravity, ±{COVARIANCE.imu_position_m:g} m", _imu_displaced(0)),
    AssumedValue("imu_position", f"the center of gravity, ±{COVARIANCE.imu_position_m:g} m", _imu_displaced(2)),
)


def missing_values(aircraft: Aircraft) -> list[AssumedValue]:
    """The assumed values whose keys the aircraft file lacks."""
    return [assumed for assumed in ASSUMED_VALUES if not aircraft.has(assumed.key)]


class AssumptionUncertainty(NamedTuple):
    """Uncertainty due to assumed values and to errors that no residual shows.

    covariance : (5, 5) of polar and thrust, to be added to the estimate's     notes : sentences for the reader
    changes : by name of the error, the change (5,) of polar and thrust that one standard deviation of it makes
    """

    covariance: Array
    notes: list[str]
    changes: Mapping[str, Array] = MappingProxyType({})


def assumption_uncertainty(
    rerun: Rerun,
    aircraft: Aircraft,
    propeller: Propeller,
    condition: Condition,
    flown_CL: tuple[float, float],
) -> AssumptionUncertainty | None:
    """The contribution of assumed values to the interval; None where the aircraft file has all of these keys.

    condition, flown_CL : weight and density of the flight, and lift coefficients of the speeds flown.
    """
    missing = missing_values(aircraft)
    slope_sigma = upwash_slope_sigma(aircraft)
    if not missing:
        return None
    estimate = rerun.estimate(aircraft, propeller, slope_sigma)
    own_covariance = estimate.noise + estimate.systematic
    added = {key: np.zeros(own_covariance.shape) for key in dict.fromkeys(assumed.key for assumed in missing)}
    changes: dict[str, Array] = {}
    for i, assumed in enumerate(ASSUMED_VALUES):
        if assumed not in missing:
            continue
        change = rerun.values(assumed.perturbed(aircraft), propeller, slope_sigma) - estimate.values
        changes[f"{assumed.key} {i}"] = change
        added[assumed.key] += np.outer(change, change)
    covariance = np.sum([np.zeros(own_covariance.shape), *added.values()], axis=0)

    V = np.array([speed_at(flown_CL[1], condition)])

    def standard_error(A: Array, covariance: Array) -> float:
        """Standard error of power required at V."""
        return float(power_required(V, Polar(A, polar_part(covariance)), condition)[1][0])

    without_keys = standard_error(estimate.polar.A, own_covariance + covariance)
    notes = []
    for key, part in added.items():
        known_covariance = own_covariance
        if key == UPWASH:
            known_upwash = rerun.estimate(aircraft, propeller, 0.0)
            known_covariance = known_upwash.noise + known_upwash.systematic
        description = next(assumed.description for assumed in missing if assumed.key == key)
        with_key = standard_error(estimate.polar.A, known_covariance + covariance - part)
        notes.append(_note(key, description, 1 - with_key / without_keys, V[0]))
    if not aircraft.has("propulsion.beyond_zero_thrust") and propeller.beyond_zero_thrust != FOLD:
        folding = polar_part(rerun.values(aircraft, propeller.with_beyond_zero_thrust(FOLD), slope_sigma))
        power, folded = (
            float(power_required(V, Polar(A, polar_part(own_covariance)), condition)[0][0])
            for A in (estimate.polar.A, folding)
        )
        notes += _folding_note(folded / power - 1, V[0])
    return AssumptionUncertainty(covariance, notes, changes)


def _folding_note(change: float, V: float) -> list[str]:
    """A note on the change if the propeller folds. The interval leaves this out: the pilot knows the propeller."""
    if abs(change) < EVIDENCE.negligible:
        return []
    return [
        "The aircraft file lacks propulsion.beyond_zero_thrust: the propeller is taken to windmill. If it folds, power"
        f" at {V:.1f} m/s changes by {100 * change:+.0f} %."
    ]


def _note(key: str, description: str, share: float, V: float) -> str:
    benefit = (
        f"with it the interval at {V:.1f} m/s would be {100 * share:.0f} % narrower"
        if share > EVIDENCE.negligible
        else "on this flight it makes no difference"
    )
    return f"The aircraft file lacks {key}: {description}, is assumed; {benefit}."


def with_assumption_uncertainty(estimate: DynamicEstimate, added: AssumptionUncertainty | None) -> DynamicEstimate:
    """The estimate with the uncertainty from assumed values added to its systematic part."""
    if added is None:
        return estimate
    systematic = estimate.systematic + added.covariance
    polar_covariance = estimate.polar.covariance + polar_part(added.covariance)
    errors = np.sqrt(np.diag(estimate.noise + systematic)).tolist()
    parameters = [
        msgspec.structs.replace(parameter, standard_error=errors[i]) if i < len(errors) else parameter
        for i, parameter in enumerate(estimate.parameters)
    ]
    polar = Polar(estimate.polar.A, polar_covariance)
    joint = estimate.joint and estimate.joint.with_changes(added.changes)
    return replace(estimate, polar=polar, parameters=parameters, systematic=systematic, joint=joint)


ZERO_STEPS = {channel: f"zero step {channel}" for channel in AIR_DATA_CHANNELS}  # names of zero steps


def with_transducer_uncertainty(
    added: AssumptionUncertainty | None,
    values_from: Callable[[pd.DataFrame], NDArray[np.float64]],
    air: pd.DataFrame,
    aircraft: Aircraft,
) -> AssumptionUncertainty | None:
    """Add the uncertainty due to hysteresis and to a step of the zero in mid-flight, for each transducer.

    Their standard deviations follow from [uncertainty] hysteresis and transducer_zero in the aircraft file. A change of
    the zero at take-off is among the sensor errors that are estimated.
    values_from: estimates polar and thrust (5,) from air data, including the trajectory.
    """
    uncertainty = aircraft.uncertainty
    fraction, step_Pa = (
        uncertainty.hysteresis_fraction,
        np.sqrt(COVARIANCE.zero_share_in_flight) * uncertainty.transducer_zero_Pa,
    )
    perturbed: dict[str, pd.DataFrame] = {}
    if fraction:
        perturbed |= {f"hysteresis {channel}": with_hysteresis(air, channel, fraction) for channel in AIR_DATA_CHANNELS}
    if step_Pa:
        perturbed |= {name: with_zero_step(air, channel, step_Pa) for channel, name in ZERO_STEPS.items()}
    if not perturbed:
        return added
    return _with_other_air(added, values_from, air, perturbed)


MOTOR_SPEED_STEP = "step of the motor speed"  # name of the error of a motor speed counted in steps


def with_step_of_motor_speed(
    added: AssumptionUncertainty | None,
    values_from: Callable[[pd.DataFrame], NDArray[np.float64]],
    air: pd.DataFrame,
    step_revps: float,
) -> AssumptionUncertainty | None:
    """Add the uncertainty of motor speed counted in steps, unless the steps are too small to change thrust.

    Pulses per interval are either truncated, which loses half a step on average, or rounded, which loses none. No
    reading shows which of the two it is, so even odds are assumed. Scatter about this error is in the residuals.
    values_from: as for `with_transducer_uncertainty`.
    """
    turning = air["n_revps"].to_numpy(dtype=float)
    turning = turning[turning > STANDING.motor_revps]
    error_revps = float(np.sqrt(0.5)) * step_revps / 2
    if not len(turning) or 2 * error_revps < EVIDENCE.negligible * float(np.median(turning)):  # 2: thrust varies as n^2
        return added
    motor_revps = air["n_revps"].to_numpy(dtype=float)
    faster = air.assign(n_revps=np.where(motor_revps > STANDING.motor_revps, motor_revps + error_revps, motor_revps))
    uncertainty = _with_other_air(added, values_from, air, {MOTOR_SPEED_STEP: faster})
    note = (
        f"Motor speed is recorded in steps of {step_revps:.2g} rev/s, as of whole pulses counted in a time: the"
        " interval contains half a step to either side. A counter that times pulses has none."
    )
    return uncertainty._replace(notes=[*uncertainty.notes, note])


def _with_other_air(
    added: AssumptionUncertainty | None,
    values_from: Callable[[pd.DataFrame], NDArray[np.float64]],
    air: pd.DataFrame,
    perturbed: Mapping[str, pd.DataFrame],
) -> AssumptionUncertainty:
    """Add the changes of the estimate that perturbed air data make. perturbed : air data by name of the error"""
    nominal = values_from(air)
    changes = {name: values_from(other) - nominal for name, other in perturbed.items()}
    covariance = np.sum([np.outer(change, change) for change in changes.values()], axis=0)
    if added is None:
        return AssumptionUncertainty(covariance, [], changes)
    return added._replace(covariance=added.covariance + covariance, changes={**added.changes, **changes})
