"""Endurance, range and full throttle of a pool, and why one of them is missing."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from flightpower.analysis.curve import POLAR, Condition
from flightpower.analysis.flights.power_train import DragPool, pooled_performance, pooled_use
from flightpower.analysis.methods.thrust_prior import THRUST
from flightpower.analysis.performance.propagation import exact
from flightpower.analysis.performance.stored_model import model_result
from flightpower.analysis.records.flight import AirFound, BatteryResult
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.propeller import Propeller
from tests.analysis.performance.motor_data import FLOWN_CL, RHO, incidence_of, model_of
from tests.analysis.performance.motor_data import POLAR as VALUES


def test_a_pool_without_full_throttle_says_what_it_lacks(nexstar: Aircraft, propeller: Propeller) -> None:
    losses = {"shaft_scale": 1.0, "friction": 0.2, "copper": 0.5, "meter_scale": 0.0}
    thrust = dict.fromkeys(THRUST, 0.0)
    incidence = incidence_of(nexstar)
    parameters = exact(**VALUES, **thrust, **dict(zip(incidence.names, incidence.values, strict=True)), **losses)
    use = SimpleNamespace(
        model=model_result(model_of(parameters, propeller)), power_train=SimpleNamespace(measured=True)
    )
    values = np.array([*VALUES.values(), *thrust.values()])
    pool: Any = SimpleNamespace(
        flights=[SimpleNamespace(name="may", content=SimpleNamespace(use=use))],
        estimate=SimpleNamespace(parameters=SimpleNamespace(value=values, covariance=1e-8 * np.eye(len(values)))),
        polar=SimpleNamespace(A=values[: len(POLAR)], covariance=1e-8 * np.eye(len(POLAR))),
        condition=Condition(37.7, RHO, 0.4636),
        flown_CL=FLOWN_CL,
        battery=BatteryResult(energy_Wh=74.0, usable=0.8),
    )
    pooled = pooled_use(cast(DragPool, pool))
    assert pooled is not None
    performance = pooled_performance(pool, pooled, AirFound(temperature_K=288.0, pressure_Pa=98_000.0))
    assert performance is not None and "two seconds of settled full throttle" in performance.available.reason
