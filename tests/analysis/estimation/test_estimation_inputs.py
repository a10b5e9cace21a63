"""User errors raise InputError with one line that names the model, segment or parameter."""

import math
import warnings

import numpy as np
import pytest

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Finding
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import MeasurementNoise, fit_output_error
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.flight.errors import InputError

T_S = np.arange(20) * 0.1


def decay(**changes):
    parts = {
        "name": "decay",
        "states": ("x",),
        "inputs": ("u",),
        "outputs": ("x",),
        "parameters": (Parameter(name="k", start=1.0),),
        "dynamics": lambda x, u, p: (u.u - p.k * x.x,),
        "output_function": lambda x, u, p: (x.x,),
    }
    return Model(**(parts | changes))


def record(**changes):
    rng = np.random.default_rng(0)
    parts = {
        "name": "run 1",
        "t_s": T_S,
        "u": {"u": np.zeros(20)},
        "z": {"x": np.exp(-T_S) + 0.01 * rng.normal(size=20)},
    }
    return Segment(**(parts | changes))


def holed(index, value=np.nan):
    signal = np.ones(20)
    signal[index] = value
    return signal


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: record(u={"u": holed(3)}), r"run 1: input u is nan at t = 0\.3 s"),
        (lambda: record(z={"x": holed(3, np.inf)}), "run 1: output x is infinite"),
        (lambda: record(z={"x": np.ones(19)}), "run 1: x has 19 samples, the time base 20"),
        (lambda: record(t_s=np.delete(np.arange(21) * 0.1, 7)), r"run 1: the time base is not uniform.*t = 0\.6 s"),
        (lambda: record(t_s=-T_S), "run 1: the time base is not uniform"),
        (lambda: record(t_s=T_S * np.nan), "run 1: the time base is not uniform"),
        (lambda: record(t_s=[0.0]), "run 1: at least two samples"),
        (lambda: record(z={"x": ["a"] * 20}), "run 1: x: not numbers"),
        (lambda: decay(parameters=(Parameter(name="k", start=1.0),) * 2), "decay: two parameters are named 'k'"),
        (lambda: decay(states=("x", "x")), "decay: two states are named 'x'"),
        (lambda: decay(dynamics=None), "decay: it has states but no dynamics"),
        (lambda: decay(outputs=()), "decay: it has no outputs"),
        (lambda: Parameter(name="k", start=2.0, upper=1.0), r"k: start 2 lies outside \[-inf, 1\]"),
        (lambda: Parameter(name="k", start=np.nan), "k: start must be a finite number"),
        (lambda: Parameter(name="k", start=1.0, prior_sigma=0.0), "k: prior_sigma must be greater than zero"),
        (lambda: decay().changed(j={"free": False}), "decay: no parameter is named 'j'"),
        (lambda: decay(states="x"), "decay: states must be a tuple of names, with a comma if it is one; is 'x'"),
        (lambda: decay(parameters=Parameter(name="k", start=1.0)), "decay: parameters must be a tuple of Parameter"),
        (lambda: decay(parameters=("k",)), "decay: parameters must be a tuple of Parameter"),
        (lambda: MeasurementNoise(structure="full", tail_dof=4.0), "tail_dof"),
        (lambda: Parameter(name="k", start="1"), "k: start must be a number, is '1'"),
    ],
)
def test_invalid_models_and_segments_are_refused(make, message):
    with pytest.raises(InputError, match=message):
        make()


@pytest.mark.parametrize(
    ("model", "segments", "options", "message"),
    [
        (
            {"output_function": lambda x, u, p: (x.x, x.x)},
            [{}],
            {},
            r"decay: outputs returned 2 values for 1 names \(x\)",
        ),
        ({"dynamics": lambda x, u, p: (p.k * x.y,)}, [{}], {}, "decay: dynamics: no state is named 'y'; known: x"),
        (
            {"dynamics": lambda x, u, p: (1.0 if x.x > 0 else 0.0,)},
            [{}],
            {},
            "decay: a function cannot be differentiated",
        ),
        (
            {"inputs": ("v",), "dynamics": lambda x, u, p: (p.k * u.v,)},
            [{}],
            {},
            "run 1: input v, which model decay needs",
        ),
        ({"dynamics": lambda x, u, p: p.k * x.x}, [{}], {}, "decay: dynamics must return a tuple"),
        ({"output_function": lambda x, u, p: x.x}, [{}], {}, "decay: outputs must return a tuple"),
        ({"output_function": lambda x, u, p: (math.sin(x.x),)}, [{}], {}, "decay: a function of the module math"),
        ({}, [{}], {"start": [1.0]}, "start must give values by name"),
        ({"outputs": ("y",)}, [{"x0": {"x": 1.0}}], {}, "run 1: output y, which model decay needs"),
        ({"outputs": ("y",)}, [{"z": {"y": T_S}}], {}, "run 1: no starting value for state x"),
        ({}, [{}, {}], {}, "two segments are named 'run 1'"),
        ({}, [], {}, "no segment to fit"),
        ({}, [{"z": {"x": holed(slice(None))}, "x0": {"x": 1.0}}], {}, "output x has no samples"),
        ({}, [{}], {"options": FitOptions(integrator="simpson")}, "integrator = 'simpson': choose one of rk4"),
        ({}, [{}], {"options": FitOptions(initial_states=("v",))}, "initial_states"),
        ({}, [{}], {"options": FitOptions(initial_states="some")}, "initial_states"),
        ({}, [{}], {"start": {"j": 1.0}}, "start: 'j' is not among the unknowns"),
        ({}, [{}], {"noise": MeasurementNoise(covariance=[1.0, 1.0])}, "noise_covariance must be"),
        (
            {"parameters": (Parameter(name="k", start=1.0, free=False),)},
            [{}],
            {"options": FitOptions(initial_states="given")},
            "nothing is free",
        ),
        ({}, [{"z": {"x": holed(slice(2, None))}}], {"noise": MeasurementNoise(structure="full")}, None),
    ],
)
def test_invalid_fits_are_refused(model, segments, options, message):
    fit = lambda: fit_output_error(decay(**model), [record(**s) for s in segments], **options)  # noqa: E731
    if message is None:
        assert fit().samples == 2  # two samples of one output suffice for its variance
        return
    with pytest.raises(InputError, match=message) as caught:
        fit()
    assert "\n" not in str(caught.value)


def test_names_and_parameters_may_be_lists():
    model = decay(states=["x"], inputs=["u"], outputs=["x"], parameters=[Parameter(name="k", start=1.0)])
    assert model == decay(
        dynamics=model.dynamics, output_function=model.output_function, parameters=(Parameter(name="k", start=1.0),)
    )
    assert fit_output_error(model, record()).verdict.ok


def test_something_else_than_a_segment_is_refused():
    with pytest.raises(InputError, match="segments: give Segment objects, not 'x'"):
        fit_output_error(decay(), [record(), "x"])


def test_a_jump_in_the_model_is_named():
    model = decay(dynamics=lambda x, u, p: (np.where(x.x > 0.5, 1.0, -2.0) * p.k,))
    assert Finding.MODEL_HAS_BRANCHES in fit_output_error(model, record()).verdict.findings


@pytest.mark.parametrize("start", [1e100, 1e160, 1e200])
def test_a_response_that_overflows_is_one_line_without_warnings(start):
    k = Parameter(name="k", start=start)
    model = decay(states=(), dynamics=None, parameters=(k,), output_function=lambda x, u, p: (p.k * (1 + u.u),))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            assert fit_output_error(model, record()).iterations
        except InputError as error:
            assert "not finite" in str(error)
