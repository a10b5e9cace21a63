"""Simulation of a model over records, with exact sensitivities to the free parameters and the initial state.

CasADi builds one integration step, the outputs and their derivatives symbolically, once per model (15 to 60 ms). Only
the states have to be integrated in order, in 3 us per step with 4 states. The derivatives follow from them for all
samples at once as array operations, and the sensitivities from the derivatives by a linear recursion.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from flightpower.analysis.estimation.array_function import (
    ArrayFunction,
    check_symbols,
    has_branches,
    not_differentiable,
)
from flightpower.analysis.estimation.data import delayed
from flightpower.analysis.estimation.integration import (
    INPUT_RULES,
    Derivative,
    InputAt,
    InputRule,
    Integrator,
    Record,
    Response,
    euler,
    heun,
    rk4,
)
from flightpower.analysis.estimation.model import Model
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

if hasattr(ca.GlobalOptions, "setNumpyMode"):  # from 3.8 on: keep NumPy functions on symbols as they always were
    ca.GlobalOptions.setNumpyMode(-1)


def trapezoidal(f: Derivative, x: Any, u: InputAt, h: Any) -> Any:
    """The implicit trapezoidal rule, second order; stable for any step, for models with fast modes.

    x + h/2 (f(x, u) + f(x_next, u_next)) = x_next is solved by Newton's method, for a linear model in one iteration.
    """
    now, y = f(x, u(0)), ca.SX.sym("y", x.shape[0])
    rate = f(y, u(1))
    error = x + h / 2 * (now + rate) - y
    newton = y - ca.solve(ca.jacobian(error, y), error)
    x_next = x
    for _ in range(3):  # each of these squares the error
        x_next = ca.substitute(newton, y, x_next)
    return x_next


INTEGRATORS: dict[str, Callable[..., Any]] = {"rk4": rk4, "euler": euler, "heun": heun, "trapezoidal": trapezoidal}


@dataclass(frozen=True)
class Simulator:
    """A compiled model; `build_simulator` makes one.

    next_state : function of state, inputs at both ends of the step, parameters, step
    derivatives : function of the same arguments; returns outputs, and the Jacobians of next state and of outputs with
    respect to state and to free parameters
    has_branches : whether values or derivatives depend on comparisons, as with np.where, np.sign, or np.maximum
    """

    model: Model
    free: tuple[str, ...]
    next_state: ca.Function
    derivatives: ArrayFunction
    has_branches: bool

    def run(self, x0: Array, U: Array, p: Array, step_s: float) -> Response:
        """The response of one record. If the state overflows, it is inf or NaN from there on."""
        return self.run_all([Record(x0, U, p, step_s)])[0]

    def run_all(self, records: Sequence[Record]) -> list[Response]:
        """The responses of several records."""
        records = [record._replace(U=self._at_both_ends(record)) for record in records]
        initial = np.stack([self._initial_sensitivity()] * len(records))
        return [response for response, _ in self._responses(records, initial)]

    def run_in_blocks(self, x0: Array, U: Array, p: Array, step_s: float, length: int) -> Iterator[Response]:
        """The response of one record in blocks of `length` samples, of which the last may be shorter."""
        at_both_ends = self._at_both_ends(Record(x0, U, p, step_s))
        S = self._initial_sensitivity()
        for first in range(0, len(U), length):
            # The last sample of a block is the first one of the next.
            record = Record(x0, at_both_ends[first : first + length + 1], p, step_s)
            [(response, S_of_states)] = self._responses([record], S[None])
            x0, S = response.x[-1], S_of_states[-1]
            yield Response(*(part[:length] for part in response))

    def _initial_sensitivity(self) -> Array:
        """Derivative (states, unknowns) of the initial state with respect to the free parameters and to itself."""
        states = len(self.model.states)
        return np.hstack([np.zeros((states, len(self.free))), np.eye(states)])

    def _responses(self, records: Sequence[Record], S0: Array) -> list[tuple[Response, Array]]:
        """The responses of records with inputs from `_at_both_ends`, and the sensitivities (n, states, unknowns) of
        the states. S0 : (records, states, unknowns), those at the first samples"""
        states, free = len(self.model.states), len(self.free)
        lengths = [len(record.U) for record in records]
        with np.errstate(all="ignore"):
            x = np.concatenate([self._integrated(record) for record in records])
            y, x_by_x, x_by_p, y_by_x, y_by_p = self.derivatives(
                len(x), x.T, np.concatenate([record.U for record in records]).T, *_of_samples(records)
            )
            B = np.concatenate([x_by_p, np.zeros((len(x), states, states))], axis=2)
            S_of_states = linear_recursion(x_by_x, B, S0, lengths)
            S = y_by_x @ S_of_states
            S[:, :, :free] += y_by_p
        ends = np.cumsum(lengths)[:-1]
        parts = (np.split(part, ends) for part in (x, y[:, :, 0], S, S_of_states))
        return [(Response(*response), of_states) for *response, of_states in zip(*parts, strict=True)]

    def _integrated(self, record: Record) -> Array:
        """States (n, states) of a record with inputs from `_at_both_ends`."""
        x = np.empty((len(record.U), len(record.x0)))
        if not x.size:
            return x
        now, following = np.array(record.x0, dtype=float), np.empty(len(record.x0))
        u = np.empty(record.U.shape[1])
        buffer: Any
        buffer, evaluate = self.next_state.buffer()
        for i, argument in enumerate((now, u, np.ascontiguousarray(record.p), np.array([record.step_s]))):
            buffer.set_arg(i, argument.data)
        buffer.set_res(0, following.data)
        for k in range(len(x)):
            x[k] = now
            u[:] = record.U[k]
            evaluate()
            now[:] = following
        return x

    def _at_both_ends(self, record: Record) -> Array:
        """Inputs at both ends of every step, with the slopes of the delayed inputs, and the delays."""
        U, delays_s = self._with_delays(record.U, record.p, record.step_s)
        return np.hstack([U, np.vstack([U[1:], U[-1:]]), np.tile(delays_s, (len(U), 1))])

    def _with_delays(self, U: Array, p: Array, step_s: float) -> tuple[Array, Array]:
        """Inputs, with delayed ones shifted, followed by the slopes of the delayed ones; and the delays (k,) [s]."""
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


def _of_samples(records: Sequence[Record]) -> tuple[list[Any], list[Any]]:
    """The elements of the parameters and the step, as numbers if all records share them, else as arrays (samples,)."""
    rows = np.array([[*record.p, record.step_s] for record in records])
    if (rows == rows[0]).all():
        elements = rows[0].tolist()
    else:
        elements = list(np.repeat(rows, [len(record.U) for record in records], axis=0).T)
    return elements[:-1], elements[-1:]


def linear_recursion(A: Array, B: Array, initial: Array, lengths: list[int], *, block: int = 32) -> Array:
    """Solve S_(k+1) = A_k S_k + B_k for S (n, s, m) in consecutive records of these lengths.

    The last step of each record is not used.

    A : (n, s, s)     B : (n, s, m)     initial : (records, s, m), S at each record's first sample
    Within a block of samples, S is linear in the block's first S. The coefficients are computed for all blocks
    together, then the first S from block to block.
    """
    n, s, m = B.shape
    firsts, first_of_record, ends = [], [], []
    begin = 0
    for length in lengths:
        within = range(begin, begin + length, block)
        firsts += list(within)
        first_of_record += [True] + [False] * (len(within) - 1)
        begin += length
        ends += [begin] * len(within)
    samples = np.array(firsts)[:, None] + np.arange(block)
    used = samples < np.array(ends)[:, None]
    samples = np.minimum(samples, n - 1)  # a record's last block is filled up with samples that are not used
    # The factor of the block's first S, and what is added to it.
    products = np.zeros((block + 1, len(firsts), s, s + m))
    products[0, :, range(s), range(s)] = 1.0
    for k in range(block):
        np.matmul(A[samples[:, k]], products[k], out=products[k + 1])
        products[k + 1, :, :, s:] += B[samples[:, k]]
    factor, added = products[..., :s], products[..., s:]
    start = np.empty((len(firsts), s, m))
    records = iter(initial)
    for i, begins in enumerate(first_of_record):
        start[i] = next(records) if begins else factor[block, i - 1] @ start[i - 1] + added[block, i - 1]
    S = factor[:block] @ start + added[:block]
    return np.asarray(S.transpose(1, 0, 2, 3)[used])


@lru_cache(maxsize=64)
def build_simulator(
    model: Model, free: tuple[str, ...], integrator: Integrator = "rk4", inputs: InputRule = "linear"
) -> Simulator:
    """Compile a model's step and outputs, with derivatives for the parameters named in `free` and the initial state.

    inputs : between samples, "linear" interpolates, "mean" uses the mean of both samples for the whole step, "held"
    uses the sample at the start of the step

    Raises InputError for an unknown integrator or input rule, a model function that returns the wrong number of values,
    or one that does not accept CasADi symbols.
    """
    for what, choice, choices in (("integrator", integrator, INTEGRATORS), ("inputs", inputs, INPUT_RULES)):
        if choice not in choices:
            raise InputError(f"{what} = {choice!r}: choose one of {', '.join(choices)}")
    names = [q.name for q in model.parameters]
    states = len(model.states)
    x = ca.SX.sym("x", states)
    late = len(model.delays)
    given0, given1 = (ca.SX.sym(name, len(model.inputs) + late) for name in ("u0", "u1"))
    delays_s = ca.SX.sym("delays", late)
    p = ca.SX.sym("p", len(names))
    h = ca.SX.sym("h")
    p_free = ca.vertcat(*(p[names.index(name)] for name in free))

    def at_delay(rows: Any) -> Any:
        """The inputs, whose derivatives with respect to the delays in p are minus the slopes; p equals `delays_s`."""
        u = rows[: len(model.inputs)]
        for k, (input_name, parameter) in enumerate(model.delays):
            slope = rows[len(model.inputs) + k]
            u[model.inputs.index(input_name)] -= slope * (p[names.index(parameter)] - delays_s[k])
        return u

    u0, u1 = at_delay(given0), at_delay(given1)

    def xdot(x: Any, u: Any) -> Any:
        return ca.vertcat(*model.evaluate_dynamics(ca.vertsplit(x), ca.vertsplit(u), ca.vertsplit(p)))

    try:
        x_next = INTEGRATORS[integrator](xdot, x, INPUT_RULES[inputs](u0, u1), h) if states else ca.SX(0, 1)
        y = ca.vertcat(*model.evaluate_outputs(ca.vertsplit(x), ca.vertsplit(u0), ca.vertsplit(p)))
    except (TypeError, NotImplementedError, RuntimeError) as error:
        raise not_differentiable(model.name, error) from None
    x_next, y = ca.cse(x_next), ca.cse(y)  # before their derivatives are built: a third fewer instructions
    arguments = [x, ca.vertcat(given0, given1, delays_s), p, h]
    jacobians = [ca.jacobian(output, by) for output in (x_next, y) for by in (x, p_free)]
    next_state = ca.Function("next_state", arguments, [x_next])
    derivatives = ca.Function("derivatives", arguments, ca.cse([y, *jacobians]))
    for function in (next_state, derivatives):
        check_symbols(model.name, function)
    branches = has_branches(next_state) or has_branches(derivatives)
    return Simulator(model, free, next_state, ArrayFunction(derivatives), branches)
