"""The equations of the trajectory over all instants at once, with their exact derivatives from CasADi."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

from flightpower.analysis.estimation.array_function import ArrayFunction
from flightpower.analysis.trajectory.equations import (
    MEASUREMENT_INPUTS,
    MEASUREMENTS,
    PROCESS_INPUTS,
    SENSOR_ERRORS,
    STATES,
    EquationInputs,
    NamedArrays,
    measurement_model,
    process_residuals,
)
from flightpower.analysis.trajectory.smoother import Linearization
from flightpower.analysis.trajectory.sparse_jacobian import SparseJacobian
from flightpower.flight.arrays import Array

if hasattr(ca.GlobalOptions, "setNumpyMode"):  # from 3.8 on, keeps NumPy functions working on symbols
    ca.GlobalOptions.setNumpyMode(-1)


class Equations:
    """The equations over `n` instants: residuals in units of standard deviations, and exact derivatives."""

    def __init__(self, n: int):
        self.n, nx, m = n, len(STATES), len(SENSOR_ERRORS)
        a, b, c = ca.SX.sym("a", nx), ca.SX.sym("b", nx), ca.SX.sym("c", m)
        u, weight = ca.SX.sym("u", len(PROCESS_INPUTS)), ca.SX.sym("w", nx)
        process = process_residuals(
            _symbols(STATES, a), _symbols(STATES, b), _symbols(SENSOR_ERRORS, c), _symbols(PROCESS_INPUTS, u)
        )
        residual = ca.vertcat(*process) * weight
        jacobian = ca.jacobian(residual, ca.vertcat(a, b, c))
        self._process = _array_function([a, b, c, u, weight], residual, jacobian)

        z, weight = ca.SX.sym("z", len(MEASUREMENTS)), ca.SX.sym("w", len(MEASUREMENTS))
        v, v_predicted = ca.SX.sym("v", len(MEASUREMENT_INPUTS)), ca.SX.sym("v'", len(MEASUREMENT_INPUTS))
        model = measurement_model(_symbols(STATES, a), _symbols(SENSOR_ERRORS, c), _symbols(MEASUREMENT_INPUTS, v))
        residual = (ca.vertcat(*model) - z) * weight
        jacobian = ca.substitute(ca.jacobian(residual, ca.vertcat(a, c)), ca.vertcat(a, v), ca.vertcat(b, v_predicted))
        self._measurement = _array_function([a, b, c, z, weight, v, v_predicted], residual, jacobian)

    def linearize(self, x: Array, sensor_errors: Array, inputs: EquationInputs) -> Linearization:
        """Residuals and derivatives at states x (n, nx) and sensor errors (m,)."""
        errors = sensor_errors.tolist()
        process = self._process.nonzeros(
            self.n - 1, x[:-1].T, x[1:].T, errors, inputs.process_inputs.T, inputs.process_weight.T
        )
        measurement = self._measurement.nonzeros(
            self.n, x.T, inputs.predicted_states.T, errors, inputs.measured.T, inputs.measurement_weight.T,
            inputs.measurement_inputs.T, inputs.predicted_inputs.T,
        )  # fmt: skip
        nx, m = x.shape[1], len(sensor_errors)
        return Linearization(
            process[0].T,
            SparseJacobian(process[1], self._process.places[1], 2 * nx + m),
            measurement[0].T,
            SparseJacobian(measurement[1], self._measurement.places[1], nx + m),
        )


def _array_function(arguments: list[Any], residual: Any, jacobian: Any) -> ArrayFunction:
    """Build the function that returns the residuals, all elements in order, and the nonzero derivatives."""
    return ArrayFunction(ca.Function("equations", arguments, ca.cse([ca.densify(residual), jacobian])))


def _symbols(names: Sequence[str], vector: Any) -> NamedArrays:
    return NamedArrays(names, ca.vertsplit(vector))
