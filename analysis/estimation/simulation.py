"""A model over a record, with the exact sensitivities of its outputs to the free parameters and the initial state.

One integration step, the outputs and their derivatives are traced once with CasADi symbols (15 to 60 ms), then called
along the record by buffer: 6 us a step with 2 states and 14 free numbers, against 9 us through `mapaccum`, whose graph
would also have to be built anew for every length of record.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from analysis.estimation.model import Model
from flight.errors import InputError

Array = NDArray[np.float64]
Integrator = Literal["rk4", "euler", "trapezoidal"]
InputRule = Literal["linear", "mean", "held"]

if hasattr(ca.GlobalOptions, "setNumpyMode"):  # from 3.8 on: keep NumPy functions on symbols as they always were
    ca.GlobalOptions.setNumpyMode(-1)


class Response(NamedTuple):
    """x : (n, states)     y : (n, outputs)     S : (n, outputs, numbers), dy over the free parameters, then x0."""

    x: Array
    y: Array
    S: Array


Derivative = Callable[[Any, Any], Any]
InputAt = Callable[[float], Any]  # from the fraction of the step that has gone


def euler(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """First order, as in (3.44)."""
    return x + h * f(x, u(0))


def trapezoidal(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """Second order, explicit (Heun): the mean of the slopes at both ends, the far one predicted by Euler."""
    k1 = f(x, u(0))
    return x + h / 2 * (k1 + f(x + h * k1, u(1)))


def rk4(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """The classical fourth-order Runge-Kutta step."""
    k1 = f(x, u(0))
    k2 = f(x + h / 2 * k1, u(0.5))
    k3 = f(x + h / 2 * k2, u(0.5))
    k4 = f(x + h * k3, u(1))
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


INTEGRATORS: dict[str, Callable[..., Any]] = {"rk4": rk4, "euler": euler, "trapezoidal": trapezoidal}
INPUT_RULES: dict[str, Callable[[Any, Any], InputAt]] = {
    "linear": lambda u0, u1: lambda s: u0 + s * (u1 - u0),
    "mean": lambda u0, u1: lambda s: (u0 + u1) / 2,
    "held": lambda u0, u1: lambda s: u0,
}


@dataclass(frozen=True)
class Simulator:
    """A traced model; make one with `trace`."""

    model: Model
    free: tuple[str, ...]
    step: ca.Function

    def run(self, x0: Array, U: Array, p: Array, step_s: float) -> Response:
        """The model's response from x0 (states,) to U (n, inputs) with parameters p (all of them, in model order).

        Where the state leaves the finite numbers, so does everything after it; no exception is raised.
        """
        states, outputs = len(self.model.states), len(self.model.outputs)
        numbers = len(self.free) + states
        n = len(U)
        inputs = np.hstack([U, np.vstack([U[1:], U[-1:]])])
        sensitivity = np.hstack([np.zeros((states, len(self.free))), np.eye(states)])
        now = np.concatenate([x0, sensitivity.ravel("F")])
        then, u = np.zeros_like(now), np.zeros(inputs.shape[1])
        seen = np.zeros(self.step.size1_out(1))
        record = np.empty((n, len(seen)))

        buffer: Any
        buffer, evaluate = self.step.buffer()
        for i, argument in enumerate((now, u, np.ascontiguousarray(p), np.array([step_s]))):
            buffer.set_arg(i, argument.data)
        buffer.set_res(0, then.data)
        buffer.set_res(1, seen.data)
        for k in range(n):
            u[:] = inputs[k]
            evaluate()
            now[:] = then
            record[k] = seen
        y, x, S = np.split(record, [outputs, outputs + states], axis=1)
        return Response(x, y, S.reshape(n, numbers, outputs).transpose(0, 2, 1))


@lru_cache(maxsize=64)
def trace(
    model: Model, free: tuple[str, ...], integrator: Integrator = "rk4", inputs: InputRule = "linear"
) -> Simulator:
    """Trace a model's step and outputs, with derivatives to the parameters named in `free` and to the initial state.

    inputs : between samples, "linear" interpolates (RK4 then uses the mean at mid-step), "mean" takes the mean of both
    ends for the whole step, "held" the value at its start.

    Raises InputError for an unknown integrator or rule, a model function that returns the wrong number of values, or
    one that symbols cannot pass.
    """
    for what, choice, known in (("integrator", integrator, INTEGRATORS), ("inputs", inputs, INPUT_RULES)):
        if choice not in known:
            raise InputError(f"{what} = {choice!r}: choose one of {', '.join(known)}")
    names = [q.name for q in model.parameters]
    states, numbers = len(model.states), len(free) + len(model.states)
    x = ca.SX.sym("x", states)
    S = ca.SX.sym("S", states, numbers)
    u0, u1 = ca.SX.sym("u0", len(model.inputs)), ca.SX.sym("u1", len(model.inputs))
    p = ca.SX.sym("p", len(names))
    h = ca.SX.sym("h")
    p_free = ca.vertcat(*(p[names.index(name)] for name in free))

    def xdot(x: Any, u: Any) -> Any:
        return ca.vertcat(*model.evaluate_dynamics(ca.vertsplit(x), ca.vertsplit(u), ca.vertsplit(p)))

    def total(expression: Any) -> Any:  # derivative to all numbers, through the state and directly
        direct = ca.jacobian(expression, p_free)
        own = ca.SX(expression.shape[0], states)
        return ca.densify(ca.horzcat(direct, own) + ca.jacobian(expression, x) @ S)

    try:
        x_next = INTEGRATORS[integrator](xdot, x, INPUT_RULES[inputs](u0, u1), h) if states else ca.SX(0, 1)
        y = ca.vertcat(*model.evaluate_outputs(ca.vertsplit(x), ca.vertsplit(u0), ca.vertsplit(p)))
    except (TypeError, NotImplementedError, RuntimeError) as error:
        raise InputError(
            f"model {model.name}: a function cannot be differentiated: write it with NumPy functions of its arguments,"
            f" without if, float() or loops over values ({error})".replace("\n", " ")
        ) from None
    step = ca.Function(
        "step",
        [ca.vertcat(x, ca.vec(S)), ca.vertcat(u0, u1), p, h],
        [
            ca.densify(ca.vertcat(x_next, ca.vec(total(x_next)))),
            ca.densify(ca.vertcat(y, x, ca.vec(total(y)))),
        ],
    )
    return Simulator(model, free, step)
