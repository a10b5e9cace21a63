"""A motor speed that is late against the IMU, or early: smoothed, sent by a slow link, or stamped by another clock.

Thrust follows motor speed at once, and the accelerometer measures it at once. A motor speed that is late by a time
makes thrust too small while the motor speeds up and too large while it slows down, by the rate of thrust times that
time.
Known delays are corrected before; what is left is tested in every flight, and estimated with the rest where the runs
show it beyond doubt. A late IMU looks the same with the other sign.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from analysis.estimation.fit import Fit
from analysis.estimation.model import Model, NamedValues, Parameter
from analysis.methods import consider as covariance
from analysis.methods.forces import THRUST_RATE
from analysis.methods.settings import MOTOR_SPEED
from analysis.trajectory.settings import CONSISTENCY

PARAMETER = "motor_lag"


def with_motor_lag(model: Model) -> Model:
    """The drag model with the lag of the motor speed [s]."""

    def drag(x: NamedValues, u: NamedValues, p: NamedValues) -> Sequence[Any]:
        (without,) = model.output_function(x, u, p)
        return (without - u.thrust_rate * p.motor_lag,)

    return replace(
        model,
        name=f"{model.name}, motor lag",
        inputs=(*model.inputs, THRUST_RATE),
        output_function=drag,
        parameters=(*model.parameters, Parameter(name=PARAMETER, start=0.0)),
    )


def beyond_doubt(fit: Fit) -> bool:
    """Whether a lag is more than MOTOR_SPEED.least_errors of its standard errors, and long enough to matter.

    fit: of the model with it
    """
    i = fit.names.index(PARAMETER)
    error = float(np.sqrt(covariance.of_noise(fit)[i, i]))
    least_s = max(MOTOR_SPEED.least_errors * error, CONSISTENCY.least_shift_s)
    return bool(fit.verdict.ok and abs(fit.values[i]) > least_s)
