"""Whether a model's functions accept CasADi symbols, and whether their values jump."""

import casadi as ca
import numpy as np

from analysis.estimation.model import Model
from flight.errors import InputError


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
