"""The model of performance in `results.json`, from which performance can be computed again without the log."""

import numpy as np

from flightpower.analysis.performance.full_throttle import FullThrottle
from flightpower.analysis.performance.level_flight import PerformanceModel
from flightpower.analysis.performance.power_train import PowerTrainModel
from flightpower.analysis.performance.propagation import ParameterVector
from flightpower.analysis.records.flight import ComputationModel, PropellerRow, PropellerTable
from flightpower.flight.propeller import Propeller, Row

INCIDENCE = ("alpha_0", "alpha_CL")
LOSSES = ("shaft_scale", "friction", "copper", "meter_scale")
FULL_THROTTLE = ("unloaded_revps", "revps_per_Nm")


def model_result(model: PerformanceModel) -> ComputationModel:
    """The model in the form of `results.json`."""
    parameters, propeller = model.parameters, model.propeller
    rows = [PropellerRow(rpm=row.rpm, J=list(row.J), cT=list(row.cT), cP=list(row.cP)) for row in propeller.rows]
    return ComputationModel(
        names=list(parameters.names),
        values=parameters.values.tolist(),
        covariance=parameters.covariance.tolist(),
        no_load_torque_Nm=model.power_train.no_load_torque_Nm,
        flown_CL=model.flown_CL,
        propeller=PropellerTable(
            name=propeller.name,
            diameter_m=propeller.diameter_m,
            beyond_zero_thrust=propeller.beyond_zero_thrust,
            rows=rows,
        ),
    )


def model_of(result: ComputationModel) -> PerformanceModel:
    """The model from `results.json`, without parts only for pages. Raises InputError for an impossible propeller."""
    parameters = ParameterVector(
        tuple(result.names), np.array(result.values), np.array(result.covariance).reshape(2 * (len(result.names),))
    )
    table = result.propeller
    rows = tuple(Row(row.rpm, tuple(row.J), tuple(row.cT), tuple(row.cP)) for row in table.rows)
    motor = part(parameters, FULL_THROTTLE) if set(FULL_THROTTLE) <= set(parameters.names) else None
    return PerformanceModel(
        parameters,
        PowerTrainModel(part(parameters, LOSSES), result.no_load_torque_Nm, measured=False, basis="", points=()),
        FullThrottle(motor),
        Propeller(table.name, table.diameter_m, rows, beyond_zero_thrust=table.beyond_zero_thrust),
        result.flown_CL,
    )


def part(parameters: ParameterVector, names: tuple[str, ...]) -> ParameterVector:
    """Some of the parameters, with their covariance."""
    index = [parameters.names.index(name) for name in names]
    return ParameterVector(names, parameters.values[index], parameters.covariance[np.ix_(index, index)])
