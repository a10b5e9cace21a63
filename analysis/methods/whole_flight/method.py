"""Electrical power and drag from the energy of the whole flight in a log of the daemon.

The result needs neither flow angles nor motor speed. `whole_flight` gives the electrical curve, and one more drag
polar, of a complete log. The balance is that of an ordinary flight, with longer windows and fewer samples: it costs
little compared with the rest.
"""

from typing import NamedTuple

import numpy as np
from numpy.polynomial.polynomial import polyfit

from flightpower.analysis.curve import Polar
from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.methods.method import MethodDescription, MethodEstimate
from flightpower.analysis.methods.thrust_prior import stand_measurements
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, estimate
from flightpower.analysis.methods.whole_flight.drag import DragEstimate, DragWithheld, ThrustSource, drag_estimate
from flightpower.analysis.methods.whole_flight.energy_balance import FlightConditions, QuarticPolar, drag_power
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.methods.whole_flight.settings import BESIDE_A_COMPLETE_LOG
from flightpower.analysis.sources.daemon_recording import recording_of
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller import Propeller
from flightpower.flight.units import GRAVITY_MPS2 as g

WHOLE_FLIGHT = MethodDescription(
    name="whole-flight",
    title="energy, whole flight",
    equations="(2.23)-(2.26)",
    kinds=(),
    taken_as_measured=(),
)


class WholeFlight(NamedTuple):
    """electrical : None where the log has no battery, or its flight does not determine the curve"""

    electrical: ElectricalEstimate | None
    method: MethodEstimate


def whole_flight(log: Log, aircraft: Aircraft, propeller: Propeller) -> WholeFlight:
    """The electrical curve and the drag polar of a complete log, or a note of what is missing."""
    if not log.entries.get("/battery"):
        return WholeFlight(None, MethodEstimate(WHOLE_FLIGHT, notes=("the log has no voltage and current",)))
    weight_N, geometry = aircraft.mass.weight_N, aircraft.geometry
    electrical: ElectricalEstimate | None = None
    try:
        recording = recording_of(log)
        flight = flight_table(recording, weight_N, geometry.wing_area_m2).thinned(BESIDE_A_COMPLETE_LOG.every)
        electrical = estimate(
            flight, weight_N, geometry.wing_area_m2, geometry.span_m, str(log.path),
            most_windows=BESIDE_A_COMPLETE_LOG.most_windows, most_points=2 * BESIDE_A_COMPLETE_LOG.most_windows,
        )  # fmt: skip
        source = ThrustSource(propeller, None, aircraft.uncertainty, stand_measurements(aircraft))
        drag = drag_estimate(flight, electrical, geometry.span_m, source, BESIDE_A_COMPLETE_LOG.most_windows)
    except InputError as error:
        return WholeFlight(electrical, MethodEstimate(WHOLE_FLIGHT, notes=(str(error).removeprefix(f"{log.path}: "),)))
    if isinstance(drag, DragWithheld):
        return WholeFlight(electrical, MethodEstimate(WHOLE_FLIGHT, notes=(drag.sentence(),)))
    return WholeFlight(electrical, method_estimate(drag))


def method_estimate(drag: DragEstimate) -> MethodEstimate:
    """The quadratic polar over the lift coefficients of the curve, with its covariance."""
    c = drag.parameters.conditions
    V = np.linspace(drag.V_mps[-1], drag.V_mps[0], 31)
    qS = c.rho * V**2 / 2 * c.wing_area_m2
    CL = c.mass_kg * g / qS

    def polar(p: NamedValues, given: FlightConditions) -> Array:
        CD = drag_power(V, 1.0, 0.0, QuarticPolar.of(p), given) / (qS * V)
        return np.asarray(polyfit(CL, CD, 2))

    A = drag.parameters.quantity(polar)
    flown_CL = (float(CL[0]), float(CL[-1]))
    return MethodEstimate(WHOLE_FLIGHT, Polar(A.value, A.covariance), A.own, A.by_shared, flown_CL=flown_CL)
