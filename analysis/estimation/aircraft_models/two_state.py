"""Airspeed and angle of attack with measured pitch angle, the dissertation's model (3.38)."""

from typing import Any

from analysis.estimation.aircraft_models.equations import (
    measured_air_data,
    measured_specific_force,
    wind_axis_derivative,
)
from analysis.estimation.aircraft_models.parameters import (
    Constants,
    Priors,
    aerodynamic_parameters,
    gyro_bias,
    sensor_parameters,
    thrust_parameters,
)
from analysis.estimation.model import Model, NamedValues
from flight.aircraft import Aircraft


def two_state(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """States V, alpha; outputs V, alpha, ax, az; the pitch angle theta is an input (3.38).

    With bias and scale of V and alpha, and bias of ax and az (Table 3.1). Errors of the measured theta go into the
    estimates.
    """
    c = Constants.of(aircraft)

    def dynamics(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        return wind_axis_derivative(c, x.V, x.alpha, u.theta, u.q - p.q_bias, u, p, J_ref)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        return (
            *measured_air_data(x, p),
            *measured_specific_force(c, x.V, x.alpha, u.q - p.q_bias, u, p, J_ref),
        )

    return Model(
        name="two_state",
        states=("V", "alpha"),
        inputs=("thrust", "J", "elevator", "q", "theta", "phi", "p", "r", "beta", "rho"),
        outputs=("V", "alpha", "ax", "az"),
        parameters=(
            *aerodynamic_parameters(c, priors),
            *thrust_parameters(priors),
            *sensor_parameters(priors, V_bias_free=True),
            gyro_bias(priors, free=False),
        ),
        dynamics=dynamics,
        output_function=outputs,
    )
