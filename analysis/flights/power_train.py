"""A pool's inputs for the energy of a mission: its polar and thrust, and the mean of its flights' power trains.

Flights share the motor, the controller, the battery's meter and the priors of their losses, so their errors are
correlated to an unknown degree. Whatever the correlation, the covariance of the mean is at most the mean of the
covariances, which is used here.
"""

from collections.abc import Sequence
from typing import Protocol

import numpy as np
from msgspec.structs import replace

from flightpower.analysis.curve import POLAR, Condition, Polar, speed_at
from flightpower.analysis.flights.flight_statistics import FlightStatistics
from flightpower.analysis.flights.joint import PooledEstimate
from flightpower.analysis.methods.thrust_prior import THRUST
from flightpower.analysis.performance.analysis import flight_performance
from flightpower.analysis.performance.full_throttle import FullThrottle
from flightpower.analysis.performance.level_flight import PerformanceModel
from flightpower.analysis.performance.power_train import PowerTrainModel
from flightpower.analysis.performance.propagation import ParameterVector, combine_independent
from flightpower.analysis.performance.request import FlownCondition, Request, requested_conditions
from flightpower.analysis.performance.stored_model import FULL_THROTTLE, INCIDENCE, LOSSES, model_of, model_result, part
from flightpower.analysis.records.flight import (
    AirFound,
    BatteryResult,
    ComputationModel,
    PerformanceResult,
    SlowestFlown,
)
from flightpower.analysis.records.pool import PooledUse

NO_FULL_THROTTLE = "No flight of these has two seconds of settled full throttle within the propeller's table."


class DragPool(Protocol):
    """The part of the joint estimate of drag (`joint_pool`) that is used here."""

    @property
    def flights(self) -> Sequence[FlightStatistics]: ...
    @property
    def estimate(self) -> PooledEstimate: ...
    @property
    def polar(self) -> Polar: ...
    @property
    def condition(self) -> Condition: ...
    @property
    def flown_CL(self) -> tuple[float, float]: ...
    @property
    def battery(self) -> BatteryResult | None: ...


def pooled_use(pool: DragPool) -> PooledUse | None:
    """Pool power trains; None if no flight has one. Measured losses are used if there are any, else assumed ones."""
    candidates = [
        (candidate, candidate.content.use, candidate.content.use.model)
        for candidate in pool.flights
        if candidate.content.use
    ]
    having = [(candidate, use, model) for candidate, use, model in candidates if model is not None]
    chosen = [candidate for candidate in having if candidate[1].power_train.measured] or having
    if not chosen:
        return None
    return PooledUse(
        losses_of=[flight.name for flight, _, _ in chosen],
        losses_measured=chosen[0][1].power_train.measured,
        model=model_result(_pooled_model(pool, [model for _, _, model in chosen])),
    )


def pooled_performance(
    pool: DragPool, use: PooledUse, air: AirFound, request: Request = Request()
) -> PerformanceResult | None:
    """Compute endurance, range and full throttle at the pool's weight and density, and at any requested; None if
    battery or air is not known, or if the propeller's table cannot give the thrust of level flight."""
    if pool.battery is None or air.temperature_K is None or air.pressure_Pa is None:
        return None
    condition = FlownCondition(pool.condition, air.pressure_Pa, air.temperature_K)
    performance = flight_performance(
        model_of(use.model), pool.condition, requested_conditions(request, condition), pool.battery
    )
    if performance is None:
        return None
    basis = f"The losses of motor and battery are the mean of {', '.join(use.losses_of)}."
    train = replace(performance.power_train, measured=use.losses_measured, basis=basis)
    available = performance.available
    if not available.power_available:
        available = replace(available, reason=NO_FULL_THROTTLE)
    return replace(performance, power_train=train, available=available, model=None)


def _pooled_model(pool: DragPool, flights: Sequence[ComputationModel]) -> PerformanceModel:
    models = [model_of(flight) for flight in flights]
    n = len(POLAR) + len(THRUST)
    values, covariance = pool.estimate.parameters.value[:n].copy(), pool.estimate.parameters.covariance[:n, :n].copy()
    values[: len(POLAR)], covariance[: len(POLAR), : len(POLAR)] = pool.polar.A, pool.polar.covariance
    losses = _mean([part(model.parameters, LOSSES) for model in models])
    parts = [
        ParameterVector((*POLAR, *THRUST), values, covariance),
        _mean([part(model.parameters, INCIDENCE) for model in models]),
        losses,
    ]
    motor = [model.full_throttle.parameters for model in models if model.full_throttle.parameters is not None]
    if motor:
        parts.append(_mean([part(parameters, FULL_THROTTLE) for parameters in motor]))
    no_load_Nm = float(np.mean([model.power_train.no_load_torque_Nm for model in models]))
    return PerformanceModel(
        combine_independent(*parts),
        PowerTrainModel(losses, no_load_Nm, measured=False, basis="", points=()),
        FullThrottle(parts[-1] if motor else None),
        models[-1].propeller,
        pool.flown_CL,
    )


def _mean(parts: Sequence[ParameterVector]) -> ParameterVector:
    values, covariances = (
        np.mean([getattr(parameter_vector, field) for parameter_vector in parts], axis=0)
        for field in ("values", "covariance")
    )
    return ParameterVector(parts[0].names, values, covariances)


def slowest_flown(pool: DragPool) -> SlowestFlown | None:
    """Return the slowest speed at the pool's condition and the largest lift coefficient flown; None if unknown."""
    slowest = [
        flight.content.slowest_flown.largest_lift_coefficient for flight in pool.flights if flight.content.slowest_flown
    ]
    largest_CL = pool.flown_CL[1]
    if not slowest:
        return None
    return SlowestFlown(
        speed_mps=float(speed_at(largest_CL, pool.condition)),
        lift_coefficient=largest_CL,
        largest_lift_coefficient=max(slowest),
    )
