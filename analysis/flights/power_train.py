"""What the energy of a mission is computed from, of a pool: its polar and thrust, and the mean of its power trains.

Flights have the motor, the controller, the battery's meter and the priors of their losses in common, to a part that
nobody knows. Whatever it is, the covariance of a mean is at most the mean of the covariances, which stands here.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from analysis.curve import POLAR, speed_at
from analysis.methods.thrust_prior import THRUST
from analysis.performance.full_throttle import FullThrottle
from analysis.performance.level_flight import PerformanceModel
from analysis.performance.power_train import PowerTrainModel
from analysis.performance.propagation import ParameterVector, combine_independent
from analysis.performance.stored_model import FULL_THROTTLE, INCIDENCE, LOSSES, model_of, model_result, part
from analysis.records.flight import ComputationModel, SlowestFlown
from analysis.records.pool import PooledUse

if TYPE_CHECKING:
    from analysis.flights.joint_pool import JointPool


def pooled_use(pool: "JointPool") -> PooledUse | None:
    """None where no flight has a power train. Losses that are measured count, where there are any, or else assumed."""
    known = [(one, one.content.use, one.content.use.model) for one in pool.flights if one.content.use]
    having = [(one, use, model) for one, use, model in known if model is not None]
    chosen = [one for one in having if one[1].power_train.measured] or having
    if not chosen:
        return None
    return PooledUse(
        losses_of=[flight.name for flight, _, _ in chosen],
        losses_measured=chosen[0][1].power_train.measured,
        model=model_result(_pooled_model(pool, [model for _, _, model in chosen])),
    )


def _pooled_model(pool: "JointPool", flights: Sequence[ComputationModel]) -> PerformanceModel:
    models = [model_of(one) for one in flights]
    n = len(POLAR) + len(THRUST)
    values, covariance = pool.estimate.parameters.value[:n].copy(), pool.estimate.parameters.covariance[:n, :n].copy()
    values[: len(POLAR)], covariance[: len(POLAR), : len(POLAR)] = pool.polar.A, pool.polar.covariance
    losses = _mean([part(one.parameters, LOSSES) for one in models])
    parts = [
        ParameterVector((*POLAR, *THRUST), values, covariance),
        _mean([part(one.parameters, INCIDENCE) for one in models]),
        losses,
    ]
    motor = [one.full_throttle.parameters for one in models if one.full_throttle.parameters is not None]
    if motor:
        parts.append(_mean([part(one, FULL_THROTTLE) for one in motor]))
    no_load_Nm = float(np.mean([one.power_train.no_load_torque_Nm for one in models]))
    return PerformanceModel(
        combine_independent(*parts),
        PowerTrainModel(losses, no_load_Nm, measured=False, basis="", points=()),
        FullThrottle(parts[-1] if motor else None),
        models[-1].propeller,
        pool.flown_CL,
    )


def _mean(parts: Sequence[ParameterVector]) -> ParameterVector:
    values, covariances = (np.mean([getattr(one, of) for one in parts], axis=0) for of in ("values", "covariance"))
    return ParameterVector(parts[0].names, values, covariances)


def slowest_flown(pool: "JointPool") -> SlowestFlown | None:
    """At the pool's condition, with the largest lift coefficient of any flight; None where no flight tells it."""
    known = [one.content.slowest_flown.largest_lift_coefficient for one in pool.flights if one.content.slowest_flown]
    largest_CL = pool.flown_CL[1]
    if not known:
        return None
    return SlowestFlown(
        speed_mps=float(speed_at(largest_CL, pool.condition)),
        lift_coefficient=largest_CL,
        largest_lift_coefficient=max(known),
    )
