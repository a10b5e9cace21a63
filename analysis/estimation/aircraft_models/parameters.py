"""What the aircraft models share: known constants, priors, and the parameters with their starting values."""

from dataclasses import dataclass

import numpy as np

from analysis.estimation.model import Parameter
from flight.aircraft import Aircraft
from flight.motion import Inertia

DEGREE = np.pi / 180


@dataclass(frozen=True, kw_only=True)
class Priors:
    """Standard deviations of the systematic errors before a flight, about zero or about the given mean."""

    alpha_bias_rad: float = 1 * DEGREE
    alpha_scale: float = 0.03
    accelerometer_bias_mps2: float = 0.19  # a bias of 0.17 m/s^2 and 0.5 deg of misalignment under 1 g
    gyro_bias_radps: float = 0.001  # after subtraction of the value on the ground
    V_scale: float = 0.0125
    V_bias_mps: float = 0.3
    air_data_lag_s: float = 0.01  # lag of tubes and filters that remains after the correction for the known lag
    air_data_lag_mean_s: float = 0.01
    thrust_scale: float = 0.018
    thrust_slope: float = 0.15  # error of the slope of thrust over advance ratio, relative to thrust
    CLde_mean: float = 0.4  # tail with 15 to 20 % of the wing's area
    CLde: float = 0.2
    CLq_mean: float = 5.0  # 2 a_t V_H for a tail with lift slope a_t = 4 and tail volume V_H = 0.6
    CLq: float = 3.0


@dataclass(frozen=True, kw_only=True)
class Constants:
    """What the models take as known of an aircraft."""

    m: float  # kg
    S: float  # m^2
    chord: float  # m
    aspect_ratio: float
    inertia: Inertia | None  # None where the aircraft file lacks it

    @classmethod
    def of(cls, aircraft: Aircraft) -> "Constants":
        mass = aircraft.mass
        Ix, Iy, Iz = mass.Ix_kgm2, mass.Iy_kgm2, mass.Iz_kgm2
        return cls(
            m=aircraft.mass_kg,
            S=aircraft.geometry.wing_area_m2,
            chord=aircraft.geometry.mean_chord_m,
            aspect_ratio=aircraft.aspect_ratio,
            inertia=None if Ix is None or Iy is None or Iz is None else Inertia(Ix, Iy, Iz, mass.Ixz_kgm2),
        )


def lift_slope(aspect_ratio: float) -> float:
    """Lift slope of a straight wing [1/rad]: Helmbold's equation (McCormick, Aerodynamics, 2nd ed., eq. 3.74)."""
    return float(2 * np.pi * aspect_ratio / (2 + np.sqrt(aspect_ratio**2 + 4)))


def aerodynamic_parameters(c: Constants, priors: Priors) -> tuple[Parameter, ...]:
    """Lift (3.35) and drag (3.36). CLq is fixed at zero; see `CLq_with_prior`."""
    # Starting values of a cambered wing with fuselage and landing gear; a span efficiency of 0.8 is usual.
    return (
        Parameter(name="CL0", start=0.25),
        Parameter(name="CLa", start=lift_slope(c.aspect_ratio), unit="1/rad"),
        Parameter(name="CLde", start=priors.CLde_mean, prior_sigma=priors.CLde, unit="1/rad"),
        Parameter(name="CLq", start=0.0, unit="1/rad", free=False),
        Parameter(name="A0", start=0.04),
        Parameter(name="A1", start=0.0),
        Parameter(name="A2", start=1 / (np.pi * 0.8 * c.aspect_ratio)),
    )


def CLq_with_prior(priors: Priors) -> dict[str, float | bool]:
    """Changes that free CLq with its prior, for `Model.changed`."""
    return {"free": True, "start": priors.CLq_mean, "prior_sigma": priors.CLq}


def thrust_parameters(priors: Priors) -> tuple[Parameter, ...]:
    """Relative errors of the thrust table: a scale, and a slope over advance ratio."""
    return (
        Parameter(name="thrust_scale", start=0.0, prior_sigma=priors.thrust_scale),
        Parameter(name="thrust_slope", start=0.0, prior_sigma=priors.thrust_slope),
    )


def sensor_parameters(priors: Priors, *, V_bias_free: bool) -> tuple[Parameter, ...]:
    """Scales and biases of air data and accelerometers (Table 3.1)."""
    return (
        Parameter(name="V_scale", start=0.0, prior_sigma=priors.V_scale),
        Parameter(name="V_bias", start=0.0, prior_sigma=priors.V_bias_mps, unit="m/s", free=V_bias_free),
        Parameter(name="alpha_scale", start=0.0, prior_sigma=priors.alpha_scale),
        Parameter(name="alpha_bias", start=0.0, prior_sigma=priors.alpha_bias_rad, unit="rad"),
        Parameter(name="ax_bias", start=0.0, prior_sigma=priors.accelerometer_bias_mps2, unit="m/s^2"),
        Parameter(name="az_bias", start=0.0, prior_sigma=priors.accelerometer_bias_mps2, unit="m/s^2"),
    )


def gyro_bias(priors: Priors, *, free: bool) -> Parameter:
    return Parameter(name="q_bias", start=0.0, prior_sigma=priors.gyro_bias_radps, unit="rad/s", free=free)
