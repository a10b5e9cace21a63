"""Electrical power and drag from the energy of the whole flight in a complete log of the daemon.

`whole_flight` gives the electrical curve and another drag polar. The balance is the same as for an ordinary flight, but
with longer windows and fewer samples, so that it costs little compared with the rest of the analysis. The airspeed
comes from the calibrated probe, corrected for the scale error that the trajectory shows.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyfit

from flightpower.analysis.curve import Polar
from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.flight import Reconstructed
from flightpower.analysis.methods.method import MethodDescription, MethodEstimate
from flightpower.analysis.methods.thrust_prior import stand_measurements
from flightpower.analysis.methods.whole_flight.airspeed_gps import AirspeedErrors
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, estimate
from flightpower.analysis.methods.whole_flight.drag import DragEstimate, DragWithheld, ThrustSource, drag_estimate
from flightpower.analysis.methods.whole_flight.energy_balance import FlightConditions, QuarticPolar, drag_power
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.methods.whole_flight.settings import COARSER
from flightpower.analysis.sources.daemon_recording import recording_with_air_data
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2 as g

WHOLE_FLIGHT = MethodDescription(
    name="whole-flight",
    title="energy, whole flight",
    equations="(2.23)-(2.26)",
    kinds=(),
    taken_as_measured=(),
)


class WholeFlight(NamedTuple):
    """Results of the energy balance. electrical : None if the log has no battery or does not determine the curve"""

    electrical: ElectricalEstimate | None
    method: MethodEstimate


def whole_flight(flight: Reconstructed) -> WholeFlight:
    """The electrical curve and the drag polar of a complete log, or a note on the cause if one of them is missing."""
    log, aircraft, propeller = flight.log, flight.aircraft, flight.propeller
    if not log.entries.get("/battery"):
        return WholeFlight(None, MethodEstimate(WHOLE_FLIGHT, notes=("the log has no voltage and current",)))
    weight_N, geometry = aircraft.mass.weight_N, aircraft.geometry
    electrical: ElectricalEstimate | None = None
    try:
        recording = recording_with_air_data(log, flight.table)
        table = flight_table(recording, weight_N, geometry.wing_area_m2).thinned(COARSER.every)
        electrical = estimate(
            table, weight_N, geometry.wing_area_m2, geometry.span_m, str(log.path),
            most_windows=COARSER.most_windows, most_points=2 * COARSER.most_windows,
            airspeed=airspeed_by_trajectory(flight.trajectory, table.zero_sigma_Pa),
        )  # fmt: skip
        source = ThrustSource(propeller, None, aircraft.uncertainty, stand_measurements(aircraft))
        drag = drag_estimate(table, electrical, geometry.span_m, source, COARSER.most_windows)
    except InputError as error:
        return WholeFlight(electrical, MethodEstimate(WHOLE_FLIGHT, notes=(str(error).removeprefix(f"{log.path}: "),)))
    if isinstance(drag, DragWithheld):
        return WholeFlight(electrical, MethodEstimate(WHOLE_FLIGHT, notes=(drag.sentence(),)))
    return WholeFlight(electrical, method_estimate(drag))


def airspeed_by_trajectory(trajectory: Trajectory, zero_sigma_Pa: float) -> AirspeedErrors | None:
    """Errors of the airspeed from the trajectory, which uses GPS with its latency, wind and inertial sensors. None if
    no trajectory explains the measurements."""
    if trajectory.as_measured:
        return None
    covariance = np.diag([trajectory.standard_error("V_scale"), zero_sigma_Pa]) ** 2
    prior_sigma = trajectory.prior_standard_error("V_scale")
    return AirspeedErrors(trajectory.value("V_scale"), 0.0, covariance, None, None, prior_sigma)


def method_estimate(drag: DragEstimate) -> MethodEstimate:
    """The estimate as a quadratic polar over the lift coefficients of the curve, with its covariance."""
    c = drag.parameters.conditions
    V = np.linspace(drag.V_mps[-1], drag.V_mps[0], 31)
    qS = c.rho * V**2 / 2 * c.wing_area_m2
    CL = c.mass_kg * g / qS

    def polar(p: NamedValues, conditions: FlightConditions) -> Array:
        CD = drag_power(V, 1.0, 0.0, QuarticPolar.of(p), conditions) / (qS * V)
        return np.asarray(polyfit(CL, CD, 2))

    A = drag.parameters.quantity(polar)
    flown_CL = (float(CL[0]), float(CL[-1]))
    return MethodEstimate(WHOLE_FLIGHT, Polar(A.value, A.covariance), A.own, A.by_shared, flown_CL=flown_CL)
