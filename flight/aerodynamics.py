"""The aerodynamic model: coefficients from the state of flight (3.35, 3.36 and the lateral counterparts).

Simulator, trim and estimator use this one definition; the functions accept floats, arrays and CasADi symbols. Angles
are in radians, derivatives per radian; rates are made dimensionless with b/2V and cbar/2V.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from flightpower.flight.aircraft import Aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.number import Number, Vector
from flightpower.flight.units import read_table


@dataclass(frozen=True, kw_only=True)
class Aerodynamics:
    """Coefficients and derivatives, all dimensionless or per radian: the section [aerodynamics] of an aircraft file."""

    CL0: float
    CLa: float
    CLde: float
    CLq: float = 0.0
    CD0: float
    K: float
    CL_minD: float
    stall_angle_rad: float
    stall_width_rad: float
    CYb: float
    CYp: float = 0.0
    CYr: float = 0.0
    CYdr: float = 0.0
    Clb: float
    Clp: float
    Clr: float
    Clda: float
    Cldr: float = 0.0
    Cm0: float
    Cma: float
    Cmq: float
    Cmde: float
    Cnb: float
    Cnp: float
    Cnr: float
    Cnda: float = 0.0
    Cndr: float


class Coefficients(NamedTuple):
    """CL, CD in stability axes (rotated by alpha alone), CY along body y; moments about body axes."""

    CL: Any
    CD: Any
    CY: Any
    Cl: Any
    Cm: Any
    Cn: Any


def drag_coefficient(CL: Number, *, CD0: Number, K: Number, CL_minD: Number) -> Number:
    """Parabolic drag polar (3.36)."""
    return CD0 + K * (CL - CL_minD) ** 2


def stalled_fraction(alpha: Number, aero: Aerodynamics) -> Number:
    """A smooth step at the positive and the negative stall angle, from 0 in attached to 1 in fully separated flow."""
    above = np.tanh((alpha - aero.stall_angle_rad) / aero.stall_width_rad)
    below = np.tanh((alpha + aero.stall_angle_rad) / aero.stall_width_rad)
    return 1 + (above - below) / 2


def lift_and_drag(aero: Aerodynamics, alpha: Number, elevator: Number, q_hat: Number = 0.0) -> tuple[Number, Number]:
    """(CL, CD) by (3.35) with CLq and (3.36); beyond the stall they blend into the coefficients of a flat plate.

    alpha, elevator [rad]; q_hat = q cbar/2V [-]. Elementwise.
    """
    attached_CL = aero.CL0 + aero.CLa * alpha + aero.CLde * elevator + aero.CLq * q_hat
    attached_CD = drag_coefficient(attached_CL, CD0=aero.CD0, K=aero.K, CL_minD=aero.CL_minD)
    plate_CN = 2 * np.sin(alpha)
    s = stalled_fraction(alpha, aero)
    CL = (1 - s) * attached_CL + s * plate_CN * np.cos(alpha)
    CD = (1 - s) * attached_CD + s * (aero.CD0 + plate_CN * np.sin(alpha))
    return CL, CD


def coefficients(
    aero: Aerodynamics, *, alpha: Number, beta: Number, reduced_rates: Vector, surfaces: Vector
) -> Coefficients:
    """All six coefficients at one flight condition, elementwise.

    alpha, beta [rad]; reduced_rates: p_hat = p b/2V, q_hat = q cbar/2V, r_hat = r b/2V [-]; surfaces: elevator,
    aileron, rudder [rad].
    Signs: elevator trailing edge down positive (more lift, nose down), aileron positive rolls right,
    rudder trailing edge left positive (nose left).
    """
    (p_hat, q_hat, r_hat), (elevator, aileron, rudder) = reduced_rates, surfaces
    CL, CD = lift_and_drag(aero, alpha, elevator, q_hat)
    return Coefficients(
        CL=CL,
        CD=CD,
        CY=aero.CYb * beta + aero.CYp * p_hat + aero.CYr * r_hat + aero.CYdr * rudder,
        Cl=aero.Clb * beta + aero.Clp * p_hat + aero.Clr * r_hat + aero.Clda * aileron + aero.Cldr * rudder,
        Cm=aero.Cm0 + aero.Cma * alpha + aero.Cmq * q_hat + aero.Cmde * elevator,
        Cn=aero.Cnb * beta + aero.Cnp * p_hat + aero.Cnr * r_hat + aero.Cnda * aileron + aero.Cndr * rudder,
    )


def body_axes(CL: Number, CD: Number, alpha: Number) -> tuple[Number, Number]:
    """(CX, CZ) from (CL, CD), (3.41) and (3.42)."""
    return CL * np.sin(alpha) - CD * np.cos(alpha), -CL * np.cos(alpha) - CD * np.sin(alpha)


def stability_axes(CX: Number, CZ: Number, alpha: Number) -> tuple[Number, Number]:
    """(CL, CD) from (CX, CZ), (2.16): the inverse of `body_axes`."""
    return CX * np.sin(alpha) - CZ * np.cos(alpha), -CX * np.cos(alpha) - CZ * np.sin(alpha)


def aerodynamics_of(aircraft: Aircraft) -> Aerodynamics:
    """The aerodynamic model in the section [aerodynamics] of the aircraft file; only the simulator uses it.

    Raises InputError when the section is missing or malformed.
    """
    if not aircraft.aerodynamics:
        raise InputError(f"{aircraft.name}: the aircraft file has no section [aerodynamics]; the simulator needs it")
    return read_table(Aerodynamics, aircraft.aerodynamics, f"{aircraft.name}: aerodynamics")


def lift_slope(aspect_ratio: float) -> float:
    """Lift slope of a straight wing [1/rad]: Helmbold's equation (McCormick, Aerodynamics, 2nd ed., eq. 3.74)."""
    return float(2 * np.pi * aspect_ratio / (2 + np.sqrt(aspect_ratio**2 + 4)))
