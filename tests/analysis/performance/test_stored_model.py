"""The model read from results.json computes the same as the model that was written."""

import msgspec
import numpy as np
import pytest
from motor_data import NO_CORRECTION, POLAR, full_throttle_run, incidence_of, model_of, steady_points

from flightpower.analysis.performance import stored_model
from flightpower.analysis.performance.climb import full_throttle_performance
from flightpower.analysis.performance.full_throttle import fit_full_throttle
from flightpower.analysis.performance.level_flight import level_flight
from flightpower.analysis.performance.power_train import fit_power_train
from flightpower.analysis.performance.propagation import combine_independent, exact
from flightpower.analysis.records.flight import ComputationModel


@pytest.mark.parametrize("with_full_throttle", [False, True])
def test_power_and_climb_are_the_same_after_writing_and_reading(
    nexstar, propeller, condition, with_full_throttle
) -> None:
    train = fit_power_train(steady_points(nexstar, propeller), nexstar.propulsion, propeller, **NO_CORRECTION)
    motor = fit_full_throttle(full_throttle_run(nexstar, propeller), nexstar.propulsion, propeller).parameters
    parts = [exact(**POLAR, **NO_CORRECTION), incidence_of(nexstar), train.parameters]
    parts += [motor] if with_full_throttle and motor is not None else []
    model = model_of(combine_independent(*parts), propeller, train)
    written = msgspec.json.encode(stored_model.model_result(model))
    read = stored_model.model_of(msgspec.json.decode(written, type=ComputationModel))
    V = np.linspace(12.0, 22.0, 11)
    before, after = level_flight(model, condition, V).battery, level_flight(read, condition, V).battery
    np.testing.assert_allclose(after.value, before.value, rtol=1e-12)
    np.testing.assert_allclose(after.standard_error, before.standard_error, rtol=1e-9)
    assert (read.full_throttle.parameters is not None) is with_full_throttle
    if with_full_throttle:
        climbs = [full_throttle_performance(this_model, condition).climb.value for this_model in (model, read)]
        np.testing.assert_allclose(climbs[1], climbs[0], rtol=1e-9)
