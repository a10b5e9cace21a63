"""Simulation of a model over a record, with exact sensitivities to the free parameters and the initial state.

CasADi derives one integration step, the outputs and their derivatives symbolically, once per model (15 to 60 ms). The
compiled function is then called for each sample with buffers: 6 us a step with 2 states and 14 unknowns. CasADi's
`mapaccum` takes 9 us and needs a new graph for each record length.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from analysis.estimation.delays import delayed
from analysis.estimation.model import Model
from flight.errors import InputError

Array = NDArray[np.float64]
Integrator = Literal["rk4", "euler", "heun", "trapezoidal"]
InputRule = Literal["linear", "mean", "held"]

NEWTON_STEPS = 3  # of the implicit rule: its error is squared in each

if hasattr(ca.GlobalOptions, "setNumpyMode"):  # from 3.8 on: keep NumPy functions on symbols as they always were
    ca.GlobalOptions.setNumpyMode(-1)


class Response(NamedTuple):
    """x : (n, states)     y : (n, outputs)     S : (n, outputs, unknowns), dy/d(free parameters), then dy/dx0."""

    x: Array
    y: Array
    S: Array


Derivative = Callable[[Any, Any], Any]
InputAt = Callable[[float], Any]  # input as a function of the elapsed fraction of the step, 0 to 1


def euler(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """Euler's explicit method, first order (3.44)."""
    return x + h * f(x, u(0))


def heun(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """Heun's method, the explicit trapezoidal rule, second order."""
    k1 = f(x, u(0))
    return x + h / 2 * (k1 + f(x + h * k1, u(1)))


def rk4(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """Classical Runge-Kutta method, fourth order."""
    k1 = f(x, u(0))
    k2 = f(x + h / 2 * k1, u(0.5))
    k3 = f(x + h / 2 * k2, u(0.5))
    k4 = f(x + h * k3, u(1))
    return x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def trapezoidal(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """The implicit trapezoidal rule, second order; stable for any step, for models with fast modes.

    x + h/2 (f(x, u) + f(x_next, u_next)) = x_next is solved by Newton's method; one step is exact for a linear model.
    """
    now, y = f(x, u(0)), ca.SX.sym("y", x.shape[0])
    rate = f(y, u(1))
    error = x + h / 2 * (now + rate) - y
    newton = y - ca.solve(ca.jacobian(error, y), error)
    x_next = x
    for _ in range(NEWTON_STEPS):
        x_next = ca.substitute(newton, y, x_next)
    return x_next


INTEGRATORS: dict[str, Callable[..., Any]] = {"rk4": rk4, "euler": euler, "heun": heun, "trapezoidal": trapezoidal}
INPUT_RULES: dict[str, Callable[[Any, Any], InputAt]] = {
    "linear": lambda u0, u1: lambda s: u0 + s * (u1 - u0),
    "mean": lambda u0, u1: lambda s: (u0 + u1) / 2,
    "held": lambda u0, u1: lambda s: u0,
}


@dataclass(frozen=True)
class Simulator:
    """A compiled model; `build_simulator` makes one. step : one integration step with outputs and sensitivities."""

    model: Model
    free: tuple[str, ...]
    step: ca.Function

    def run(self, x0: Array, U: Array, p: Array, step_s: float) -> Response:
        """The response from x0 (states,) to U (n, inputs) with parameters p (free and fixed, in model order).

        If the state overflows, the response is inf or NaN from there on; no exception is raised.
        """
        return next(self.run_in_blocks(x0, U, p, step_s, len(U)))

    def run_in_blocks(self, x0: Array, U: Array, p: Array, step_s: float, length: int) -> Iterator[Response]:
        """The response as `run` gives it, in blocks of `length` samples, of which the last may be shorter."""
        states, outputs = len(self.model.states), len(self.model.outputs)
        unknowns = len(self.free) + states
        sensitivity = np.hstack([np.zeros((states, len(self.free))), np.eye(states)])
        now = np.concatenate([x0, sensitivity.ravel("F")])
        U, constant = self._with_delays(U, p, step_s)
        following, u = np.zeros_like(now), np.zeros(2 * U.shape[1] + len(constant))
        u[2 * U.shape[1] :] = constant
        used = u[: 2 * U.shape[1]]
        observed = np.zeros(self.step.size1_out(1))

        buffer: Any
        buffer, evaluate = self.step.buffer()
        for i, argument in enumerate((now, u, np.ascontiguousarray(p), np.array([step_s]))):
            buffer.set_arg(i, argument.data)
        buffer.set_res(0, following.data)
        buffer.set_res(1, observed.data)
        for first in range(0, len(U), length):
            inputs = U[first : first + length]
            after = U[first + 1 : first + length + 1]
            inputs = np.hstack([inputs, after if len(after) == len(inputs) else np.vstack([after, U[-1:]])])
            record = np.empty((len(inputs), len(observed)))
            for k in range(len(inputs)):
                used[:] = inputs[k]
                evaluate()
                now[:] = following
                record[k] = observed
            y, x, S = np.split(record, [outputs, outputs + states], axis=1)
            yield Response(x, y, S.reshape(len(inputs), unknowns, outputs).transpose(0, 2, 1))

    def _with_delays(self, U: Array, p: Array, step_s: float) -> tuple[Array, Array]:
        """Inputs with those that act late shifted, followed by the slopes of these; and the delays (k,) [s]."""
        model = self.model
        if not model.delays:
            return U, np.zeros(0)
        names = [q.name for q in model.parameters]
        shifted, slopes, delays_s = U.copy(), [], []
        for input_name, parameter in model.delays:
            column = model.inputs.index(input_name)
            delays_s.append(float(p[names.index(parameter)]))
            shifted[:, column], slope = delayed(U[:, column], step_s, delays_s[-1])
            slopes.append(slope)
        return np.column_stack([shifted, *slopes]), np.array(delays_s)


@lru_cache(maxsize=64)
def build_simulator(
    model: Model, free: tuple[str, ...], integrator: Integrator = "rk4", inputs: InputRule = "linear"
) -> Simulator:
    """Compile a model's step and outputs, with derivatives to the parameters named in `free` and the initial state.

    inputs : between samples, "linear" interpolates, "mean" uses the mean of both samples for the whole step, "held"
    uses the sample at the start of the step

    Raises InputError for an unknown integrator or input rule, a model function that returns the wrong number of values,
    or one that does not accept CasADi symbols.
    """
    for what, choice, known in (("integrator", integrator, INTEGRATORS), ("inputs", inputs, INPUT_RULES)):
        if choice not in known:
            raise InputError(f"{what} = {choice!r}: choose one of {', '.join(known)}")
    names = [q.name for q in model.parameters]
    states, unknowns = len(model.states), len(free) + len(model.states)
    x = ca.SX.sym("x", states)
    late = len(model.delays)
    given0, given1 = (ca.SX.sym(name, len(model.inputs) + late) for name in ("u0", "u1"))
    delays_s = ca.SX.sym("delays", late)
    p = ca.SX.sym("p", len(names))
    h = ca.SX.sym("h")
    p_free = ca.vertcat(*(p[names.index(name)] for name in free))

    def at_delay(given: Any) -> Any:
        """The inputs, whose derivatives to the delays are the slopes. In value, p of a delay equals `delays_s`."""
        u = given[: len(model.inputs)]
        for k, (input_name, parameter) in enumerate(model.delays):
            slope = given[len(model.inputs) + k]
            u[model.inputs.index(input_name)] -= slope * (p[names.index(parameter)] - delays_s[k])
        return u

    u0, u1 = at_delay(given0), at_delay(given1)

    def xdot(x: Any, u: Any) -> Any:
        return ca.vertcat(*model.evaluate_dynamics(ca.vertsplit(x), ca.vertsplit(u), ca.vertsplit(p)))

    all_S = ca.SX.sym("S", states, unknowns)

    def total_derivative(expression: Any, S: Any) -> Any:
        """To all unknowns, directly and through the state: de/dtheta = partial e/partial theta + de/dx S."""
        over_parameters = ca.jacobian(expression, p_free)
        over_initial_state = ca.SX(expression.shape[0], states)
        return ca.densify(ca.horzcat(over_parameters, over_initial_state) + ca.jacobian(expression, x) @ S)

    try:
        x_next = INTEGRATORS[integrator](xdot, x, INPUT_RULES[inputs](u0, u1), h) if states else ca.SX(0, 1)
        y = ca.vertcat(*model.evaluate_outputs(ca.vertsplit(x), ca.vertsplit(u0), ca.vertsplit(p)))
    except (TypeError, NotImplementedError, RuntimeError) as error:
        raise not_differentiable(model, error) from None
    x_next, y = ca.cse(x_next), ca.cse(y)  # before their derivatives are built: a third fewer instructions
    # The state does not depend on a parameter of the outputs alone: these columns of S remain zero.
    moves_state = [bool(ca.which_depends(x_next, q)[0]) for q in ca.vertsplit(p_free)] + states * [True]
    S = ca.horzcat(*(all_S[:, k] if moves else ca.SX(states, 1) for k, moves in enumerate(moves_state)))
    following = ca.densify(ca.vertcat(x_next, ca.vec(total_derivative(x_next, S))))
    observed = ca.densify(ca.vertcat(y, x, ca.vec(total_derivative(y, S))))
    step = ca.Function(
        "step",
        [ca.vertcat(x, ca.vec(all_S)), ca.vertcat(given0, given1, delays_s), p, h],
        ca.cse([following, observed]),
    )
    check_symbols(model, step)
    return Simulator(model, free, step)


def check_symbols(model: Model, function: ca.Function) -> None:
    """Raises InputError if the model applied a function to a symbol that made a number of it: math.sin gives NaN."""
    for k in range(function.n_instructions()):
        if function.instruction_id(k) == ca.OP_CONST and np.isnan(function.instruction_constant(k)):
            raise InputError(
                f"model {model.name}: a function of the module math, or float(), lost a symbol (it gives NaN); use"
                " NumPy's functions, np.sin for math.sin"
            )


def has_branches(function: ca.Function) -> bool:
    """Whether values or derivatives depend on comparisons, as with np.where, np.sign, or np.maximum."""
    branching = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL}
    return any(function.instruction_id(k) in branching for k in range(function.n_instructions()))


def not_differentiable(model: Model, error: Exception) -> InputError:
    """The error for a model function that does not accept CasADi symbols."""
    return InputError(
        f"model {model.name}: a function cannot be differentiated: write it with NumPy functions of its arguments,"
        f" without if, float() or loops over values ({error})".replace("\n", " ")
    )
