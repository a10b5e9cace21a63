"""Errors that no residual of the flight shows: consider terms (Schmidt 1966; Tapley et al. 2004, ch. 6).

Each has a size that the user gives in [uncertainty] of the aircraft file, or its default there. The estimate is
repeated with each error of one standard deviation, and the outer product of its change is added to the covariance.
"""

from collections.abc import Callable

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.drag.forces import FlightForces
from flight.aircraft import Aircraft

Array = NDArray[np.float64]
UPDRAFT, WEIGHT, DENSITY = "updraft", "weight", "air density"  # names of these errors


def changes(values_of: Callable[[pd.DataFrame], Array], values: Array, flight_forces: FlightForces) -> dict[str, Array]:
    """By error, UPDRAFT and WEIGHT, the change of an estimate (m,) of A0, A1, A2 and others.

    values_of : the estimate from forces, `values` from the nominal ones
    """
    aircraft = flight_forces.aircraft
    in_still_air = values_of(without_updraft(flight_forces.nominal, aircraft))
    of_heavier = values_of(heavier(flight_forces).nominal)
    return {UPDRAFT: in_still_air - values, WEIGHT: at_nominal_weight(of_heavier, aircraft) - values}


def without_updraft(forces: pd.DataFrame, aircraft: Aircraft) -> pd.DataFrame:
    """Forces as in still air, if the air rose by one standard deviation. forces: of `FlightForces.forces`.

    Air that rises by w carries the aircraft: drag is larger than measured by lift times w/V.
    """
    return forces.assign(CD=forces["CD"] + forces["CL"] * aircraft.uncertainty.updraft_mps / forces["V"])


def heavier(flight_forces: FlightForces) -> FlightForces:
    """The forces of the aircraft `weighing_more`."""
    return FlightForces(flight_forces.trajectory, weighing_more(flight_forces.aircraft), flight_forces.propeller)


def weighing_more(aircraft: Aircraft) -> Aircraft:
    """The aircraft heavier by one standard deviation of its weight."""
    return aircraft.weighing(_factor(aircraft) * aircraft.mass.weight_N)


def at_nominal_weight(values: Array, aircraft: Aircraft) -> Array:
    """An estimate (m,) of A0, A1, A2 and others for `weighing_more`, so that it gives the same power at each speed.

    The lift coefficient at a speed is larger by the same factor as the weight.
    """
    factor = _factor(aircraft)
    return values * np.concatenate([[1.0, factor, factor**2], np.ones(len(values) - 3)])


def by_density(values_of: Callable[[pd.DataFrame], Array], values: Array, flight_forces: FlightForces) -> Array:
    """Change of an estimate (m,) by a measured density that is one standard deviation too high, at right airspeeds.

    Airspeed from dynamic pressure is too low by half of it. That is an error of the airspeed scale of this flight, and
    is estimated as such.
    """
    return values_of(denser(flight_forces).nominal) - values


def denser(flight_forces: FlightForces) -> FlightForces:
    """The forces in air that is denser by one standard deviation."""
    f = flight_forces
    return FlightForces(f.trajectory, f.aircraft, f.propeller, density_factor=_density_factor(f.aircraft))


def at_nominal_density(values: Array, aircraft: Aircraft) -> Array:
    """An estimate (m,) of A0, A1, A2 and others in `denser` air, so that it gives the same power at each speed.

    Dynamic pressure at a speed is larger by the factor of the density, the lift coefficient smaller.
    """
    factor = _density_factor(aircraft)
    return values * np.concatenate([[factor, 1.0, 1 / factor], np.ones(len(values) - 3)])


def airspeed_scale_by_density(aircraft: Aircraft) -> float:
    """Change of the estimated airspeed scale by a density that is one standard deviation too high."""
    return -aircraft.uncertainty.air_density_fraction / 2


def _density_factor(aircraft: Aircraft) -> float:
    return 1 + aircraft.uncertainty.air_density_fraction


def _factor(aircraft: Aircraft) -> float:
    return 1 + aircraft.uncertainty.weight_fraction
