"""Longitudinal models of an aircraft with systematic sensor errors (Table 3.1), built on `flight.motion`.

Drag is C_D = A0 + A1 C_L + A2 C_L^2, the parabolic polar (3.36) rewritten to be well conditioned. Measured specific
force is that at the center of gravity. Starting values come from the wing's geometry and from the data, never from the
aerodynamics that the simulator uses.

Inputs by name: thrust [N], advance ratio J, elevator [rad], body rates p, q, r [rad/s] as measured by the gyro, bank
phi [rad], sideslip beta [rad], density rho [kg/m^3]. `two_state` also needs the pitch angle theta [rad]; `level_run`
the airspeed V_ref [m/s] at which thrust and J are given, and there the slope thrust_per_speed [N s/m].
Outputs by name: airspeed V [m/s], alpha [rad], specific force ax, az [m/s^2], pitch rate q [rad/s], height h [m], climb
rate hdot [m/s]; of `wind_axis_forces` drag and lift per unit mass [m/s^2].
"""

from analysis.estimation.aircraft_models.forces import Constants, Priors, force_coefficients, force_models, lift_slope
from analysis.estimation.aircraft_models.level_run import (
    gust_noise,
    level_flight_state,
    level_run,
    starting_values,
    two_state,
)
from analysis.estimation.aircraft_models.longitudinal import longitudinal
from analysis.estimation.aircraft_models.pitch_and_height import pitch_and_height
from analysis.estimation.aircraft_models.wind_axis_forces import wind_axis_forces, wind_axis_outputs

__all__ = [
    "Constants",
    "Priors",
    "force_coefficients",
    "force_models",
    "gust_noise",
    "level_flight_state",
    "level_run",
    "lift_slope",
    "longitudinal",
    "pitch_and_height",
    "starting_values",
    "two_state",
    "wind_axis_forces",
    "wind_axis_outputs",
]
