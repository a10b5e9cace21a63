"""An extended Kalman filter over a record: innovations, their variances, and the exact derivatives of both.

CasADi builds one filter cycle symbolically, once per model: the measurement update, then one integration step of state
and covariance. The derivatives include those of the gain and the covariance. The noises of the outputs are independent,
so the update processes one output after the other; this is equivalent to a joint update, needs no matrix inverse, and
skips missing samples.

The cycle is differentiated block by block: each scalar update, and each part of the integration step. The chain rule
then multiplies the blocks for all samples at once. With six states this takes an eighth of the operations of
differentiating the cycle as a whole.

References: Jategaonkar, Flight Vehicle System Identification, 2nd ed., ch. 5; Maine & Iliff, NASA RP-1138, sec. 8.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from flightpower.analysis.estimation.array_function import check_symbols, not_differentiable
from flightpower.analysis.estimation.integration import INPUT_RULES, Record
from flightpower.analysis.estimation.model import Model
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.estimation.simulation import INTEGRATORS
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


class Innovations(NamedTuple):
    """The filter's result for a record. Elements of missing samples have no meaning.

    x : (n, states) after the measurement update
    y : (n, outputs) predicted from the samples before
    e : (n, outputs) innovations: z minus its prediction from earlier samples and from outputs already updated
    ln_s : (n, outputs) logarithms of the variances of e
    d_e, d_ln_s : (n, outputs, unknowns) derivatives with respect to free parameters, ln w, ln v, initial states
    """

    x: Array
    y: Array
    e: Array
    ln_s: Array
    d_e: Array
    d_ln_s: Array


class NoiseLevels(NamedTuple):
    """Logarithms of the intensities of process noise (driven,) and of the standard deviations of measurement noise
    (outputs,), and the time [s] for which each process noise has acted before the record (driven,)."""

    ln_w: Array
    ln_v: Array
    active_before_s: Array


@dataclass(frozen=True)
class KalmanFilter:
    """A compiled filter cycle; `build_filter` makes one.

    driven : the states with process noise
    cycle : (state and packed covariance; inputs, z, present; constants) to (next state and packed covariance; e, ln_s,
    y, updated x; nonzeros of all Jacobian blocks)
    blocks : sparsity of the Jacobian of each block, in the order of their nonzeros in `cycle`
    """

    model: Model
    free: tuple[str, ...]
    driven: tuple[str, ...]
    cycle: ca.Function
    blocks: tuple[ca.Sparsity, ...]

    def run(self, record: Record, Z: Array, noise: NoiseLevels) -> Innovations:
        """Filter Z (n, outputs; NaN where missing).

        If the state overflows, everything is inf or NaN from there on; no exception is raised.
        """
        model, nx, ny = self.model, len(self.model.states), len(self.model.outputs)
        nw, nc = len(self.driven), len(self.free) + len(self.driven) + ny
        na = nx + nx * (nx + 1) // 2
        variances = nx + np.array([_packed_index(i, i) for i in map(model.states.index, self.driven)], dtype=int)
        first = np.zeros(na)
        first[:nx] = record.x0
        first[variances] = np.exp(2 * noise.ln_w) * noise.active_before_s
        S = np.zeros((na, nc + nx))
        S[variances, len(self.free) + np.arange(nw)] = 2 * first[variances]
        S[:nx, nc:] = np.eye(nx)

        U, n = record.U, len(record.U)
        present = np.isfinite(Z)
        step_inputs = np.hstack([U, np.vstack([U[1:], U[-1:]]), np.where(present, Z, 0.0), present])
        results, nonzeros = self._evaluate(
            first, step_inputs, np.concatenate([record.p, noise.ln_w, noise.ln_v, [record.step_s]])
        )
        e, ln_s, y, x = np.split(results, np.cumsum([ny, ny, ny]), axis=1)
        with np.errstate(over="ignore", invalid="ignore"):
            step, observed = self._chain_rule(nonzeros)
            # Recursion of the derivatives S of state and covariance: S_k+1 = A_k S_k + B_k.
            history = np.empty((n, na, nc + nx))
            A, B = np.ascontiguousarray(step[:, :, :na]), step[:, :, na:]
            for k in range(n):
                history[k] = S
                S = A[k] @ S
                S[:, :nc] += B[k]
            d = observed[:, :, :na] @ history
        d[:, :, :nc] += observed[:, :, na:]
        return Innovations(x, y, e, ln_s, d[:, :ny], d[:, ny:])

    def _evaluate(self, first: Array, step_inputs: Array, constants: Array) -> tuple[Array, Array]:
        """All cycles in sequence: e, ln_s, y, x (n, 3 outputs + states), and the blocks' nonzeros (n, nonzeros)."""
        n = len(step_inputs)
        now, row = first.copy(), np.empty(step_inputs.shape[1])
        following, out, values = (np.empty(self.cycle.size1_out(i)) for i in range(3))
        results, nonzeros = np.empty((n, len(out))), np.empty((n, len(values)))
        buffer: Any
        buffer, evaluate = self.cycle.buffer()
        for i, argument in enumerate((now, row, constants)):
            buffer.set_arg(i, argument.data)
        for i, result in enumerate((following, out, values)):
            buffer.set_res(i, result.data)
        for k in range(n):
            row[:] = step_inputs[k]
            evaluate()
            now[:] = following
            results[k], nonzeros[k] = out, values
        return results, nonzeros

    def _chain_rule(self, nonzeros: Array) -> tuple[Array, Array]:
        """Derivatives of the next state and covariance, and of e and ln_s, for each sample.

        They are derivatives with respect to the state and covariance before the cycle and to the constants (free
        parameters, ln w, ln v): (n, states + packed covariance, width) and (n, 2 outputs, width).
        """
        nx, ny, nw, nf = len(self.model.states), len(self.model.outputs), len(self.driven), len(self.free)
        na = nx + nx * (nx + 1) // 2
        blocks = iter(self._dense(nonzeros))
        n, width = len(nonzeros), na + nf + nw + ny
        free = slice(na, na + nf)

        def through(block: Array, *parts: Array) -> Array:
            """A block's Jacobian times the derivatives of its first arguments."""
            offset, total = 0, np.zeros((n, block.shape[1], width))
            for part in parts:
                rows = part.shape[1]
                total += block[:, :, offset : offset + rows] @ part
                offset += rows
            return total

        def direct(block: Array, columns: slice) -> Array:
            """A block's Jacobian with respect to arguments that are constants."""
            total = np.zeros((n, block.shape[1], width))
            total[:, :, columns] = block
            return total

        T = np.zeros((n, na, width))
        T[:, np.arange(na), np.arange(na)] = 1.0
        outputs = next(blocks)
        linearized = through(outputs[:, :, :nx], T[:, :nx]) + direct(outputs[:, :, nx:], free)
        observed = np.empty((n, 2 * ny, width))
        offset = 0
        for i in range(ny):
            block = next(blocks)
            size = block.shape[2] - na - 1  # the offset and the nonzeros of H's row
            after = through(block[:, :, :-1], T, linearized[:, offset : offset + size])
            after[:, :, width - ny + i] += block[:, :, -1]
            offset += size
            T, observed[:, i], observed[:, ny + i] = after[:, :na], after[:, na], after[:, na + 1]
        mean, middle, dynamics, transition, covariance = blocks
        x = T[:, :nx]
        x_next = through(mean[:, :, :nx], x) + direct(mean[:, :, nx:], free)
        x_middle = through(middle[:, :, :nx], x) + direct(middle[:, :, nx:], free)
        A = through(dynamics[:, :, :nx], x_middle) + direct(dynamics[:, :, nx:], free)
        Phi = through(transition, A)
        P_next = through(covariance[:, :, : covariance.shape[2] - nw], Phi, T[:, nx:])
        P_next[:, :, na + nf : na + nf + nw] += covariance[:, :, covariance.shape[2] - nw :]
        return np.concatenate([x_next, P_next], axis=1), observed

    def _dense(self, nonzeros: Array) -> list[Array]:
        """The Jacobian of each block as a dense array (n, rows, columns)."""
        result, offset = [], 0
        for pattern in self.blocks:
            J = np.zeros((len(nonzeros), *pattern.shape))
            rows, columns = (np.array(i, dtype=int) for i in pattern.get_triplet())
            J[:, rows, columns] = nonzeros[:, offset : offset + pattern.nnz()]
            offset += pattern.nnz()
            result.append(J)
        return result


def _packed_index(i: int, j: int) -> int:
    """Index of element (i, j), j <= i, of a symmetric matrix in its lower triangle stored row by row."""
    return i * (i + 1) // 2 + j


def _unpacked(packed: Any, nx: int) -> Any:
    P = ca.SX(nx, nx)
    for i in range(nx):
        for j in range(i + 1):
            P[i, j] = P[j, i] = packed[_packed_index(i, j)]
    return P


def _packed(P: Any) -> Any:
    return ca.vertcat(*(P[i, j] for i in range(P.shape[0]) for j in range(i + 1)))


@lru_cache(maxsize=32)
def build_filter(
    model: Model,
    free: tuple[str, ...],
    driven: tuple[str, ...],
    options: FitOptions = FitOptions(),
) -> KalmanFilter:
    """Compile a model's filter cycle, with derivatives for the parameters named in `free` and for ln w and ln v.

    The mean is integrated by `options.integrator`. The covariance uses the transition matrix of the model linearized at
    the middle of the step, a Taylor series of exp(A h) up to h^4. The process noise is integrated by the trapezoidal
    rule.

    Raises InputError as `simulation.build_simulator` does, and for a model without states.
    """
    nx, ny, nu, nw = len(model.states), len(model.outputs), len(model.inputs), len(driven)
    if model.delays:
        raise InputError(f"model {model.name}: filter error has no delays; fix the delay and shift the input itself")
    if not nx:
        raise InputError(f"model {model.name}: it has no states for process noise to act on; use output error")
    names = [q.name for q in model.parameters]
    sym = ca.SX.sym
    x, packed, p, h = sym("x", nx), sym("P", nx * (nx + 1) // 2), sym("p", len(names)), sym("h")
    u0, u1, z, present = sym("u0", nu), sym("u1", nu), sym("z", ny), sym("present", ny)
    ln_w, ln_v = sym("ln_w", nw), sym("ln_v", ny)
    p_free = ca.vertcat(*(p[names.index(name)] for name in free))
    try:
        y = ca.vertcat(*model.evaluate_outputs(ca.vertsplit(x), ca.vertsplit(u0), ca.vertsplit(p)))
        f = ca.vertcat(*model.evaluate_dynamics(ca.vertsplit(x), ca.vertsplit(u0), ca.vertsplit(p)))
        xdot = ca.Function("xdot", [x, u0, p], [f])
    except (TypeError, NotImplementedError, RuntimeError) as error:
        raise not_differentiable(model.name, error) from None

    patterns, nonzeros = [], []

    def call(value: Any, over: list[Any], arguments: list[Any], position: list[Any]) -> Any:
        """Return a block's value at actual arguments; keep the nonzeros of its Jacobian with respect to `over`."""
        J = ca.jacobian(value, ca.vertcat(*over))
        result, J_result = ca.Function("block", arguments, [value, J], {"cse": True})(*position)
        patterns.append(J.sparsity())
        nonzeros.append(ca.vertcat(*J_result.nonzeros()))  # a function's output keeps its sparsity
        return result

    # Outputs linearized about the predicted state: offset + H x.
    H = ca.jacobian(y, x)
    rows: list[Any] = [H[i, :] for i in range(ny)]
    linearized = ca.vertcat(*(ca.vertcat(y[i] - rows[i] @ x, *rows[i].nonzeros()) for i in range(ny)))
    linearized_now = call(linearized, [x, p_free], [x, u0, p], [x, u0, p])
    x_now, packed_now, e, ln_s, position = x, packed, [], [], 0
    offset, ln_sigma, z_i, present_i = sym("offset"), sym("ln_sigma"), sym("z"), sym("present")
    for i in range(ny):
        size = 1 + rows[i].nnz()
        values = sym("row", size - 1)
        row = ca.SX(rows[i].sparsity(), values)
        P = _unpacked(packed, nx)
        Ph = P @ row.T
        s = row @ Ph + ca.exp(2 * ln_sigma)
        innovation = z_i - offset - row @ x
        gain = present_i * Ph / s
        after = ca.vertcat(x + gain * innovation, _packed(P - gain @ Ph.T), innovation, ca.log(s))
        updated = call(
            ca.densify(after), [x, packed, offset, values, ln_sigma],
            [x, packed, offset, values, ln_sigma, z_i, present_i],
            [x_now, packed_now, linearized_now[position], linearized_now[position + 1 : position + size], ln_v[i],
             z[i], present[i]],
        )  # fmt: skip
        position += size
        x_now, packed_now = updated[:nx], updated[nx : nx + packed.shape[0]]
        e.append(updated[-2])
        ln_s.append(updated[-1])

    u_at = INPUT_RULES[options.inputs](u0, u1)
    x_next = INTEGRATORS[options.integrator](lambda x, u: xdot(x, u, p), x, u_at, h)
    x_next = call(ca.densify(x_next), [x, p_free], [x, u0, u1, p, h], [x_now, u0, u1, p, h])
    middle = call(ca.densify(x + h / 2 * xdot(x, u0, p)), [x, p_free], [x, u0, p, h], [x_now, u_at(0), p, h])
    A: Any = ca.jacobian(f, x)
    A_now = call(ca.vertcat(*A.nonzeros()), [x, p_free], [x, u0, p], [middle, u_at(0.5), p])
    values, identity = sym("A", A.nnz()), ca.SX.eye(nx)
    hA = h * ca.SX(A.sparsity(), values)
    Phi: Any = identity + hA @ (identity + hA / 2 @ (identity + hA / 3 @ (identity + hA / 4)))
    Phi_now = call(ca.vertcat(*Phi.nonzeros()), [values], [values, h], [A_now, h])
    values = sym("Phi", Phi.nnz())
    F = ca.SX(Phi.sparsity(), values)
    Q = ca.SX(nx, nx)
    for i, state in enumerate(driven):
        Q[model.states.index(state), model.states.index(state)] = h * ca.exp(2 * ln_w[i])
    # The trapezoidal rule for the integral of Phi Q Phi' over the step.
    P_next = F @ (_unpacked(packed, nx) + Q / 2) @ F.T + Q / 2
    packed_next = call(
        ca.densify(_packed(P_next)), [values, packed, ln_w], [values, packed, ln_w, h], [Phi_now, packed_now, ln_w, h]
    )
    cycle = ca.Function(
        "cycle",
        [ca.vertcat(x, packed), ca.vertcat(u0, u1, z, present), ca.vertcat(p, ln_w, ln_v, h)],
        [
            ca.vertcat(x_next, packed_next),
            ca.densify(ca.vertcat(*e, *ln_s, y, x_now)),
            ca.densify(ca.vertcat(*nonzeros)),
        ],
        {"cse": True},
    )
    check_symbols(model.name, cycle)
    return KalmanFilter(model, free, driven, cycle, tuple(patterns))
