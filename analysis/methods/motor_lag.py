"""Lag of the motor speed behind the IMU, because it is smoothed, sent by a slow link, or stamped by another clock.

Thrust follows motor speed at once, and the accelerometer measures it at once. A late motor speed makes thrust too small
while the motor speeds up and too large while it slows down, by the rate of change of thrust times the lag.
Known delays are corrected first. Every flight is tested for a remaining lag, which is estimated if the runs show it
clearly. A late IMU looks the same with the opposite sign.
"""

from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.methods.forces import THRUST_RATE
from flightpower.analysis.methods.motor_speed import value_and_error, with_thrust_error
from flightpower.analysis.methods.settings import MOTOR_SPEED
from flightpower.analysis.trajectory.settings import CONSISTENCY

PARAMETER = "motor_lag"


def with_motor_lag(model: Model) -> Model:
    """The drag model with the lag of the motor speed [s] as another parameter."""
    return with_thrust_error(model, THRUST_RATE, Parameter(name=PARAMETER, start=0.0))


def beyond_doubt(fit: Fit) -> bool:
    """Whether a lag exceeds MOTOR_SPEED.least_errors standard errors and is long enough to matter.

    fit: the fit of the model that includes the lag
    """
    lag_s, error_s = value_and_error(fit, PARAMETER)
    return bool(fit.verdict.ok and abs(lag_s) > max(MOTOR_SPEED.least_errors * error_s, CONSISTENCY.least_shift_s))
