"""The covariance of hysteresis and zero steps is a sum of outer products of the change due to each transducer."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.air.transducers import AIR_DATA_CHANNELS, with_hysteresis, with_zero_step
from flightpower.analysis.methods.assumed_values import (
    ZERO_STEPS,
    AssumptionUncertainty,
    with_step_of_motor_speed,
    with_transducer_uncertainty,
)
from flightpower.flight.aircraft import load_aircraft
from tests.analysis.air.test_transducer_errors import up_and_down

AIR = up_and_down()
AIRCRAFT = load_aircraft("nexstar")
HYSTERESIS = replace(AIRCRAFT, uncertainty=replace(AIRCRAFT.uncertainty, hysteresis_fraction=0.004))


def values_from(air: pd.DataFrame) -> np.ndarray:
    """Return two values that depend on the air data, in place of a polar."""
    return np.array([air["V_mps"].iloc[250], 3 + 10 * air["alpha_rad"].iloc[750]])


def test_the_covariance_is_the_sum_over_the_transducers() -> None:
    assumption_uncertainty = with_transducer_uncertainty(None, values_from, AIR, HYSTERESIS)
    assert assumption_uncertainty is not None and len(assumption_uncertainty.changes) == len(AIR_DATA_CHANNELS)
    changes = [values_from(with_hysteresis(AIR, channel, 0.004)) - values_from(AIR) for channel in AIR_DATA_CHANNELS]
    assert np.abs(changes).max() > 1e-4
    assert assumption_uncertainty.covariance == pytest.approx(sum(np.outer(change, change) for change in changes))
    assert np.stack(list(assumption_uncertainty.changes.values())) == pytest.approx(np.stack(changes))
    other = AssumptionUncertainty(np.diag([2.0, 3.0]), ["a note"], {"upwash": np.ones(2)})
    both = with_transducer_uncertainty(other, values_from, AIR, HYSTERESIS)
    assert both is not None and both.covariance == pytest.approx(assumption_uncertainty.covariance + other.covariance)
    assert set(both.changes) == {"upwash", *assumption_uncertainty.changes} and both.notes == other.notes


def test_half_of_the_variance_of_a_zero_arises_in_mid_flight() -> None:
    """A zero that changes by 2 Pa has a step of 1.41 Pa, in addition to the hysteresis."""
    uncertainty = replace(HYSTERESIS.uncertainty, transducer_zero_Pa=2.0)
    assumption_uncertainty = with_transducer_uncertainty(
        None, values_from, AIR, replace(AIRCRAFT, uncertainty=uncertainty)
    )
    assert assumption_uncertainty is not None and len(assumption_uncertainty.changes) == 2 * len(AIR_DATA_CHANNELS)
    for channel, name in ZERO_STEPS.items():
        change = values_from(with_zero_step(AIR, channel, 2**0.5)) - values_from(AIR)
        assert np.abs(change).max() > 1e-3
        assert assumption_uncertainty.changes[name] == pytest.approx(change)
    assert assumption_uncertainty.covariance == pytest.approx(
        sum(np.outer(change, change) for change in assumption_uncertainty.changes.values())
    )


def test_transducers_without_errors_add_nothing() -> None:
    none = replace(AIRCRAFT, uncertainty=replace(AIRCRAFT.uncertainty, hysteresis_fraction=0.0, transducer_zero_Pa=0.0))
    assert with_transducer_uncertainty(None, values_from, AIR, none) is None


def test_a_motor_speed_in_steps_is_wrong_by_a_part_of_one_throughout() -> None:
    """Steps of 25/7 rev/s, truncated or rounded, are 1.26 rev/s rms, 2.5 % of thrust. 0.02 rev/s changes nothing."""
    air = AIR.assign(n_revps=np.where(np.arange(len(AIR)) < 100, 0.0, 100.0))

    def thrust(table: pd.DataFrame) -> np.ndarray:
        return np.array([table["n_revps"].iloc[500] ** 2, table["n_revps"].iloc[0]])

    assumption_uncertainty = with_step_of_motor_speed(None, thrust, air, 25 / 7)
    assert assumption_uncertainty is not None and list(assumption_uncertainty.changes) == ["step of the motor speed"]
    assert assumption_uncertainty.changes["step of the motor speed"] == pytest.approx([0.0254e4, 0.0], rel=0.01), (
        "no change while the motor stands"
    )
    assert (
        assumption_uncertainty.covariance[0, 0] == pytest.approx(0.0254e4**2, rel=0.02)
        and "3.6 rev/s" in assumption_uncertainty.notes[0]
    )
    assert with_step_of_motor_speed(None, thrust, air, 0.02) is None
    assert with_step_of_motor_speed(assumption_uncertainty, thrust, air, 0.0) is assumption_uncertainty
