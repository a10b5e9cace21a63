"""An extended Kalman filter over a record: innovations, their variances, and the exact derivatives of both.

One cycle (an update by each output in turn, then one integration step of the state and of its covariance) is traced
once with CasADi symbols, the filter's gain and all, so that derivatives hold nothing back: they are those of the very
numbers that the filter computes. Outputs' noises are independent of each other, so updating by one at a time is the
same as by all at once, needs no matrix inverse, and leaves out a missing sample by leaving it out.

References: Jategaonkar, Flight Vehicle System Identification, 2nd ed., ch. 5; Maine & Iliff, NASA RP-1138, sec. 8.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from analysis.estimation.model import Model
from analysis.estimation.simulation import INPUT_RULES, INTEGRATORS, InputRule, Integrator
from flight.errors import InputError

Array = NDArray[np.float64]


class Innovations(NamedTuple):
    """What a filter says of a record; rows of missing samples mean nothing.

    x : (n, states) after the sample's update     y : (n, outputs) predicted     e : (n, outputs) innovations z - y,
    each given the outputs before it     ln_s : (n, outputs) logarithms of their variances
    d_e, d_ln_s : (n, outputs, numbers) over free parameters, ln intensities, ln sigmas, initial states
    """

    x: Array
    y: Array
    e: Array
    ln_s: Array
    d_e: Array
    d_ln_s: Array


@dataclass(frozen=True)
class Filter:
    """A traced cycle; make one with `trace_filter`. driven: the states that process noise acts on."""

    model: Model
    free: tuple[str, ...]
    driven: tuple[str, ...]
    cycle: ca.Function

    def run(
        self, x0: Array, U: Array, Z: Array, p: Array, ln_w: Array, ln_v: Array, acted_s: Array, step_s: float
    ) -> Innovations:
        """Filter Z (n, outputs; NaN where missing) from x0 (states,), inputs U (n, inputs), parameters p.

        ln_w (driven,), ln_v (outputs,) : logarithms of the intensities of process noise, and of the standard
        deviations of the outputs' noise     acted_s (driven,) : for how long the noise has acted before the record
        Where the state leaves the finite numbers, so does everything after it; no exception is raised.
        """
        model, nx, ny = self.model, len(self.model.states), len(self.model.outputs)
        nw, nc = len(self.driven), len(self.free) + len(self.driven) + ny
        packed = nx * (nx + 1) // 2
        na = nx + packed
        where = [_place(model.states.index(state), model.states.index(state)) for state in self.driven]
        first = np.zeros(na)
        first[:nx] = x0
        first[nx + np.array(where, dtype=int)] = np.exp(2 * ln_w) * acted_s
        S = np.zeros((na, nc + nx))
        S[nx + np.array(where, dtype=int), len(self.free) + np.arange(nw)] = 2 * first[nx + np.array(where, dtype=int)]
        S[:nx, nc:] = np.eye(nx)

        n = len(U)
        present = np.isfinite(Z)
        given = np.hstack([U, np.vstack([U[1:], U[-1:]]), np.where(present, Z, 0.0), present])
        seen, J = self._evaluate(first, given, np.concatenate([p, ln_w, ln_v, [step_s]]))
        e, ln_s, y, x = np.split(seen, np.cumsum([ny, ny, ny]), axis=1)
        # The derivatives follow the same recursion: S_k+1 = A S_k + B.
        history = np.empty((n, na, nc + nx))
        A, B = J[:, :na, :na], J[:, :na, na:]
        with np.errstate(over="ignore", invalid="ignore"):
            for k in range(n):
                history[k] = S
                S = A[k] @ S
                S[:, :nc] += B[k]
            d = J[:, na:, :na] @ history
        d[:, :, :nc] += J[:, na:, na:]
        return Innovations(x, y, e, ln_s, d[:, :ny], d[:, ny:])

    def _evaluate(self, first: Array, given: Array, constants: Array) -> tuple[Array, Array]:
        """All cycles in a row: (n, seen) and the Jacobian of each (n, rows, columns)."""
        n, na = len(given), len(first)
        pattern = self.cycle.sparsity_out(2)
        now, row = first.copy(), np.empty(given.shape[1])
        then, out = np.empty(na), np.empty(self.cycle.size1_out(1))
        seen, values = np.empty((n, len(out))), np.empty((n, pattern.nnz()))
        nonzeros = np.empty(pattern.nnz())
        buffer: Any
        buffer, evaluate = self.cycle.buffer()
        for i, argument in enumerate((now, row, constants)):
            buffer.set_arg(i, argument.data)
        for i, result in enumerate((then, out, nonzeros)):
            buffer.set_res(i, result.data)
        for k in range(n):
            row[:] = given[k]
            evaluate()
            now[:] = then
            seen[k], values[k] = out, nonzeros
        J = np.zeros((n, *pattern.shape))
        rows, columns = (np.array(i) for i in pattern.get_triplet())
        J[:, rows, columns] = values
        return seen, J


def _place(i: int, j: int) -> int:
    """Where element (i, j), j <= i, of a symmetric matrix lies in the row of its lower triangle."""
    return i * (i + 1) // 2 + j


@lru_cache(maxsize=32)
def trace_filter(
    model: Model,
    free: tuple[str, ...],
    driven: tuple[str, ...],
    integrator: Integrator = "rk4",
    inputs: InputRule = "linear",
) -> Filter:
    """Trace a model's filter cycle, with derivatives to the parameters named in `free` and to all noises.

    Between samples the mean follows the model by `integrator`, the covariance the model made linear about the middle
    of the step (exact to h^4 for a linear one), with the process noise spread evenly over the step.

    Raises InputError as `simulation.trace` does, and for a model without states.
    """
    nx, ny, nu = len(model.states), len(model.outputs), len(model.inputs)
    if not nx:
        raise InputError(f"model {model.name}: it has no states, so no process noise can act on any")
    names = [q.name for q in model.parameters]
    x, packed = ca.SX.sym("x", nx), ca.SX.sym("P", nx * (nx + 1) // 2)
    u0, u1, z, there = ca.SX.sym("u0", nu), ca.SX.sym("u1", nu), ca.SX.sym("z", ny), ca.SX.sym("there", ny)
    p, ln_w, ln_v = ca.SX.sym("p", len(names)), ca.SX.sym("ln_w", len(driven)), ca.SX.sym("ln_v", ny)
    h = ca.SX.sym("h")
    P = ca.SX(nx, nx)
    for i in range(nx):
        for j in range(i + 1):
            P[i, j] = P[j, i] = packed[_place(i, j)]

    def xdot(x: Any, u: Any) -> Any:
        return ca.vertcat(*model.evaluate_dynamics(ca.vertsplit(x), ca.vertsplit(u), ca.vertsplit(p)))

    try:
        u_at = INPUT_RULES[inputs](u0, u1)
        y = ca.vertcat(*model.evaluate_outputs(ca.vertsplit(x), ca.vertsplit(u0), ca.vertsplit(p)))
        x_there, u_there = ca.SX.sym("x", nx), ca.SX.sym("u", nu)
        f = xdot(x_there, u_there)
    except (TypeError, NotImplementedError, RuntimeError) as error:
        raise InputError(
            f"model {model.name}: a function cannot be differentiated: write it with NumPy functions of its arguments,"
            f" without if, float() or loops over values ({error})".replace("\n", " ")
        ) from None
    slope = ca.Function("slope", [x_there, u_there, p], [f, ca.jacobian(f, x_there)])

    H = ca.jacobian(y, x)
    e, ln_s = [], []
    x_now, P_now = x, P
    for i in range(ny):
        Ph = P_now @ H[i, :].T
        s = H[i, :] @ Ph + ca.exp(2 * ln_v[i])
        e.append(z[i] - y[i] - H[i, :] @ (x_now - x))
        ln_s.append(ca.log(s))
        gain = there[i] * Ph / s
        x_now = x_now + gain * e[i]
        P_now = P_now - gain @ Ph.T

    x_next = INTEGRATORS[integrator](lambda x, u: slope(x, u, p)[0], x_now, u_at, h)
    hA = h * slope(x_now + h / 2 * slope(x_now, u_at(0), p)[0], u_at(0.5), p)[1]
    Phi = ca.SX.eye(nx) + hA @ (ca.SX.eye(nx) + hA / 2 @ (ca.SX.eye(nx) + hA / 3 @ (ca.SX.eye(nx) + hA / 4)))
    Q = ca.SX(nx, nx)
    for i, state in enumerate(driven):
        Q[model.states.index(state), model.states.index(state)] = h * ca.exp(2 * ln_w[i])
    # The trapezoidal rule for the integral of Phi Q Phi' over the step.
    P_next = Phi @ (P_now + Q / 2) @ Phi.T + Q / 2
    packed_next = ca.vertcat(*(P_next[i, j] for i in range(nx) for j in range(i + 1)))

    p_free = ca.vertcat(*(p[names.index(name)] for name in free))
    a_next, o = ca.vertcat(x_next, packed_next), ca.vertcat(*e, *ln_s)
    J = ca.jacobian(ca.vertcat(a_next, o), ca.vertcat(x, packed, p_free, ln_w, ln_v))
    cycle = ca.Function(
        "cycle",
        [ca.vertcat(x, packed), ca.vertcat(u0, u1, z, there), ca.vertcat(p, ln_w, ln_v, h)],
        [ca.densify(a_next), ca.densify(ca.vertcat(o, y, x_now)), J],
        {"cse": True},
    )
    return Filter(model, free, driven, cycle)
