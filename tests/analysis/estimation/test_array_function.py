"""CasADi functions as array operations give the numbers of CasADi's own evaluation, sample by sample."""

import casadi as ca
import numpy as np
import pytest

from flightpower.analysis.estimation.array_function import OPERATIONS, SAMPLES, ArrayFunction
from flightpower.flight.errors import InputError

X, P = ca.SX.sym("x", 2), ca.SX.sym("p", 2)
A, B, C, D = X[0], X[1], P[0], P[1]
INSIDE = (A / 4, B / 4)  # within the domain of arcsine and arctanh
EXPRESSIONS = [
    -A, A * A, ca.fabs(A), ca.sign(A), A + A, 1 / A, ca.floor(A), ca.ceil(A), A + B, A - B, A * B, A / B,
    ca.fmod(A, B), ca.fmin(A, B), ca.fmax(A, B), ca.copysign(A, B), ca.hypot(A, B), ca.sqrt(ca.fabs(A)),
    ca.fabs(A) ** B, ca.fabs(A) ** 1.7, ca.exp(A), ca.log(ca.fabs(A)), ca.expm1(A), ca.log1p(ca.fabs(A)), ca.sin(A),
    ca.cos(A), ca.tan(A), ca.asin(INSIDE[0]), ca.acos(INSIDE[0]), ca.atan(A), ca.atan2(A, B), ca.sinh(A), ca.cosh(A),
    ca.tanh(A), ca.asinh(A), ca.acosh(1 + ca.fabs(A)), ca.atanh(INSIDE[1]), A < B, A <= C, ca.eq(ca.floor(A), 1),
    ca.ne(ca.floor(A), 1), ca.logic_not(A < B), ca.logic_and(A < B, A < C), ca.logic_or(A < B, A < C),
    ca.if_else(A < B, C, D), (A < B) + (A < C),
]  # fmt: skip


def by_casadi(function, n, *arguments):
    """Return each result (n, rows, columns), evaluated one sample at a time."""
    samples = [[np.array([np.broadcast_to(e, n)[k] for e in argument]) for argument in arguments] for k in range(n)]
    results = [function.call([ca.DM(item) for item in sample]) for sample in samples]
    return [np.array([np.array(results[i]) for results in results]) for i in range(function.n_out())]


def both(outputs, n=12):
    function = ca.Function("f", [X, P], outputs)
    rng = np.random.default_rng(2)
    x, p = rng.uniform(-3, 3, (2, n)), [1.3, -0.4]
    return ArrayFunction(function)(n, x, p), by_casadi(function, n, x, p)


def test_every_operation_gives_the_numbers_of_casadi():
    function = ca.Function("f", [X, P], [ca.vertcat(*EXPRESSIONS)])
    used = {function.instruction_id(k) for k in range(function.n_instructions())}
    assert set(OPERATIONS) - used <= {ca.OP_ASSIGN}, "an operation of OPERATIONS is not tried here"
    ours, theirs = both([ca.vertcat(*EXPRESSIONS)])
    assert ours[0] == pytest.approx(theirs[0], rel=1e-12, abs=1e-14)


def test_a_sparse_jacobian_stands_in_the_right_rows_and_columns():
    outputs = ca.vertcat(A * B, ca.sin(B) * C, 3 * D, A**2 * D)
    ours, theirs = both([outputs, ca.jacobian(outputs, X), ca.jacobian(outputs, P)])
    assert [item.shape for item in ours] == [(12, 4, 1), (12, 4, 2), (12, 4, 2)]
    for item, expected in zip(ours, theirs, strict=True):
        assert item == pytest.approx(expected, rel=1e-13)


def test_more_samples_than_are_computed_at_once_and_the_nonzeros_alone():
    n = SAMPLES + 3
    function = ArrayFunction(ca.Function("f", [X, P], [ca.vertcat(A * C, ca.SX(1, 1), B + D)]))
    a, b, d = np.linspace(0, 1, n), np.linspace(2, 5, n), np.linspace(-1, 1, n)
    [result] = function(n, (a, b), (2.0, d))
    assert result[:, :, 0] == pytest.approx(np.column_stack([2 * a, 0 * a, b + d]))
    [nonzeros] = function.nonzeros(n, (a, b), (2.0, d))
    assert function.places == [[(0, 0), (2, 0)]]
    assert nonzeros == pytest.approx(np.stack([2 * a, b + d]))


def test_an_operation_without_counterpart_is_named():
    with pytest.raises(InputError, match=f"function odd: CasADi's operation {ca.OP_ERF} "):
        ArrayFunction(ca.Function("odd", [X], [ca.erf(A)]))
