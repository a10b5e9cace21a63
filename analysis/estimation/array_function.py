"""CasADi functions of a model: checked, and evaluated for many samples at once, one NumPy operation per instruction.

CasADi's own interpreter takes 4 to 6 ns per instruction and sample, NumPy's operations on arrays take 1 ns.
"""

from collections.abc import Callable, Sequence
from enum import Enum, auto
from typing import Any, NamedTuple

import casadi as ca
import numpy as np

from flightpower.analysis.estimation.integration import SAMPLES
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


def _as_number(comparison: Callable[..., Any]) -> Callable[..., Any]:
    """Make a comparison return 1.0 for true and 0.0 for false, which can be added and multiplied."""
    return lambda *operands: np.multiply(comparison(*operands), 1.0)


OPERATIONS: dict[int, Callable[..., Any]] = {
    ca.OP_ASSIGN: np.positive, ca.OP_NEG: np.negative, ca.OP_SQ: np.square, ca.OP_FABS: np.abs, ca.OP_SIGN: np.sign,
    ca.OP_TWICE: lambda x: x + x, ca.OP_INV: lambda x: 1.0 / x, ca.OP_FLOOR: np.floor, ca.OP_CEIL: np.ceil,
    ca.OP_ADD: np.add, ca.OP_SUB: np.subtract, ca.OP_MUL: np.multiply, ca.OP_DIV: np.divide, ca.OP_FMOD: np.fmod,
    ca.OP_FMIN: np.fmin, ca.OP_FMAX: np.fmax, ca.OP_COPYSIGN: np.copysign, ca.OP_HYPOT: np.hypot,
    ca.OP_SQRT: np.sqrt, ca.OP_POW: np.power, ca.OP_CONSTPOW: np.power, ca.OP_EXP: np.exp, ca.OP_LOG: np.log,
    ca.OP_EXPM1: np.expm1, ca.OP_LOG1P: np.log1p, ca.OP_SIN: np.sin, ca.OP_COS: np.cos, ca.OP_TAN: np.tan,
    ca.OP_ASIN: np.arcsin, ca.OP_ACOS: np.arccos, ca.OP_ATAN: np.arctan, ca.OP_ATAN2: np.arctan2,
    ca.OP_SINH: np.sinh, ca.OP_COSH: np.cosh, ca.OP_TANH: np.tanh,
    ca.OP_ASINH: np.arcsinh, ca.OP_ACOSH: np.arccosh, ca.OP_ATANH: np.arctanh,
    ca.OP_LT: _as_number(np.less), ca.OP_LE: _as_number(np.less_equal), ca.OP_EQ: _as_number(np.equal),
    ca.OP_NE: _as_number(np.not_equal), ca.OP_NOT: _as_number(np.logical_not), ca.OP_AND: _as_number(np.logical_and),
    ca.OP_OR: _as_number(np.logical_or), ca.OP_IF_ELSE_ZERO: lambda condition, x: np.where(condition, x, 0.0),
}  # fmt: skip


class _Kind(Enum):
    CONSTANT, INPUT, OUTPUT, UNARY, BINARY = auto(), auto(), auto(), auto(), auto()


class _Instruction(NamedTuple):
    """One operation between places of CasADi's working memory; the kind determines what `a`, `b` and `to` are."""

    kind: _Kind
    operation: Any
    to: int
    a: int
    b: int


class ArrayFunction:
    """A function of CasADi's scalar symbols (SX)."""

    def __init__(self, function: ca.Function):
        """Raises InputError for an operation that is not in OPERATIONS."""
        self._shapes = [function.size_out(i) for i in range(function.n_out())]
        # Rows and columns of the nonzero elements, in CasADi's order.
        self.places = [
            [(int(row), int(column)) for row, column in zip(*function.sparsity_out(i).get_triplet(), strict=True)]
            for i in range(function.n_out())
        ]
        self._w_size = function.sz_w()
        self._instructions = [_instruction(function, k) for k in range(function.n_instructions())]

    def __call__(self, n: int, *arguments: Sequence[Any] | Array) -> list[Array]:
        """The results for n samples, each (n, rows, columns).

        arguments : the elements of each argument, floats or arrays (n,)
        """
        results = [np.zeros((n, *shape)) for shape in self._shapes]
        elements = [
            [result[:, row, column] for row, column in places]
            for result, places in zip(results, self.places, strict=True)
        ]
        self._write(n, arguments, elements)
        return results

    def nonzeros(self, n: int, *arguments: Sequence[Any] | Array) -> list[Array]:
        """The nonzero elements of the results for n samples, each (number of nonzeros, n), in the order of `places`."""
        results = [np.empty((len(places), n)) for places in self.places]
        self._write(n, arguments, results)
        return results

    def _write(self, n: int, arguments: Sequence[Any], elements: Sequence[Sequence[Array] | Array]) -> None:
        """Write the nonzero elements of each result, (n,)."""
        w: list[Any] = [None] * self._w_size
        binary, unary, given_in, constant = _Kind.BINARY, _Kind.UNARY, _Kind.INPUT, _Kind.CONSTANT
        for first in range(0, n, SAMPLES):
            rows = slice(first, first + SAMPLES)
            for kind, operation, to, a, b in self._instructions:
                if kind is binary:
                    w[to] = operation(w[a], w[b])
                elif kind is unary:
                    w[to] = operation(w[a])
                elif kind is given_in:
                    argument = arguments[a][b]
                    w[to] = argument[rows] if np.ndim(argument) else argument
                elif kind is constant:
                    w[to] = operation
                else:
                    elements[to][b][rows] = w[a]


def _instruction(function: ca.Function, k: int) -> _Instruction:
    operation, to, inputs = function.instruction_id(k), function.instruction_output(k), function.instruction_input(k)
    if operation == ca.OP_OUTPUT:
        return _Instruction(_Kind.OUTPUT, None, to[0], inputs[0], to[1])
    if operation == ca.OP_INPUT:
        return _Instruction(_Kind.INPUT, None, to[0], inputs[0], inputs[1])
    if operation == ca.OP_CONST:
        return _Instruction(_Kind.CONSTANT, function.instruction_constant(k), to[0], 0, 0)
    if operation not in OPERATIONS:
        raise InputError(f"function {function.name()}: CasADi's operation {operation} has no counterpart in NumPy")
    if len(inputs) == 1:
        return _Instruction(_Kind.UNARY, OPERATIONS[operation], to[0], inputs[0], 0)
    return _Instruction(_Kind.BINARY, OPERATIONS[operation], to[0], inputs[0], inputs[1])


def check_symbols(model: str, function: ca.Function) -> None:
    """Raise InputError if the model applied a function that turned a symbol into a number: math.sin gives NaN."""
    for k in range(function.n_instructions()):
        if function.instruction_id(k) == ca.OP_CONST and np.isnan(function.instruction_constant(k)):
            raise InputError(
                f"model {model}: a function of the module math, or float(), lost a symbol (it gives NaN); use"
                " NumPy's functions, np.sin for math.sin"
            )


def has_branches(function: ca.Function) -> bool:
    """Whether values or derivatives depend on comparisons, as with np.where, np.sign, or np.maximum."""
    branching = {ca.OP_LT, ca.OP_LE, ca.OP_EQ, ca.OP_NE, ca.OP_SIGN, ca.OP_FLOOR, ca.OP_CEIL}
    return any(function.instruction_id(k) in branching for k in range(function.n_instructions()))


def not_differentiable(model: str, error: Exception) -> InputError:
    """The error for a model function that does not accept CasADi symbols."""
    return InputError(
        f"model {model}: a function cannot be differentiated: write it with NumPy functions of its arguments,"
        f" without if, float() or loops over values ({error})".replace("\n", " ")
    )
