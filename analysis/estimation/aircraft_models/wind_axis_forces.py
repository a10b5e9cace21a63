"""Regression of drag and lift on a reconstructed trajectory."""

from typing import Any

from analysis.estimation.aircraft_models.forces import (
    Constants,
    Priors,
    aerodynamic_parameters,
    specific_force,
    thrust_parameters,
)
from analysis.estimation.model import Model, NamedValues
from flight.aerodynamics import stability_axes
from flight.aircraft import Aircraft


def wind_axis_forces(aircraft: Aircraft, *, priors: Priors = Priors(), J_ref: float = 0.5) -> Model:
    """A model without states; V and alpha of the reconstructed trajectory are inputs.

    Outputs, per unit mass [m/s^2]: `drag` = -(ax cos alpha + az sin alpha) and `lift` = ax sin alpha - az cos alpha, of
    the specific force, thrust included (see `wind_axis_outputs`). The biases of accelerometers and alpha belong to the
    trajectory reconstruction. Estimating them here again would cost far more accuracy than it gains.
    """
    c = Constants.of(aircraft)

    def outputs(x: NamedValues, u: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        ax, az = specific_force(c, u.V, u.alpha, u.q, u, p, J_ref)
        lift, drag = stability_axes(ax, az, u.alpha)
        return drag, lift

    return Model(
        name="wind_axis_forces",
        inputs=("V", "alpha", "thrust", "J", "elevator", "q", "rho"),
        outputs=("drag", "lift"),
        parameters=(*aerodynamic_parameters(c, priors), *thrust_parameters(priors)),
        output_function=outputs,
    )


def wind_axis_outputs(ax: Any, az: Any, alpha: Any) -> dict[str, Any]:
    """Measured outputs of `wind_axis_forces`, elementwise, from bias-free specific force [m/s^2] and alpha [rad]."""
    lift, drag = stability_axes(ax, az, alpha)
    return {"drag": drag, "lift": lift}
