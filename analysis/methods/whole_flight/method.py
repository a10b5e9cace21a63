"""Electrical power and drag from the energy of the whole flight in a log of the daemon.

`recording_of` reads the log as the recording of an ordinary flight; the result needs neither flow angles nor motor
speed.

`whole_flight` gives the electrical curve, and one more drag polar, of a complete log. The balance is that of an
ordinary flight, with longer windows and fewer samples: it costs little beside the rest.
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
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.daemon import events, fix_of_log, samples
from flightpower.analysis.sources.position import places
from flightpower.analysis.sources.recording import Channel, FlightRecording, in_order
from flightpower.analysis.sources.rest import ZERO_FILE
from flightpower.analysis.sources.table import TABLE
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.log_entries import NO_ENTRIES
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import TOPICS_FOR_DRAG
from flightpower.flight.propeller import Propeller
from flightpower.flight.units import GRAVITY_MPS2 as g

CHANNELS = {
    recording.AIRSPEED_PRESSURE: ("/probe/airspeed", "differential_pressure_Pa"),
    recording.STATIC: ("/static", "pressure_Pa"),
    recording.FORCE_X: ("/imu", "specific_force_x_mps2"),
    recording.FORCE_Y: ("/imu", "specific_force_y_mps2"),
    recording.FORCE_Z: ("/imu", "specific_force_z_mps2"),
    recording.VOLTAGE: ("/battery", "voltage_V"),
    recording.CURRENT: ("/battery", "current_A"),
    recording.MOTOR: ("/rpm", "motor_speed_revps"),
    recording.GPS[0]: ("/gps", "velocity_north_mps"),
    recording.GPS[1]: ("/gps", "velocity_east_mps"),
    recording.GPS[2]: ("/gps", "velocity_down_mps"),
}
NOTE = "The pitot's pressure is taken as dynamic pressure: without flow angles the probe's calibration cannot be used."


def recording_of(log: Log) -> FlightRecording:
    """The channels of a log of the daemon; its clock starts at the first airspeed, or at the first GPS without one."""
    start_ns = next(log.entries[topic][0].time_ns for topic in ("/probe/airspeed", "/gps") if log.entries.get(topic))
    channels: dict[str, Channel] = {}
    for name, (topic, field) in CHANNELS.items():
        channel = Channel(*samples(log.entries.get(topic, NO_ENTRIES), field, start_ns))
        if len(channel.t_s) >= READABLE.fewest_samples:
            channels[name] = channel
    zero = ZERO_FILE.parsed_if_any(log.attachments.get("zero.json"), f"{log.path}: zero.json")
    zero_Pa = zero.by_channel().get("q_c_Pa") if zero else None
    if zero_Pa is not None and (pitot := channels.get(recording.AIRSPEED_PRESSURE)) is not None:
        channels[recording.AIRSPEED_PRESSURE] = Channel(pitot.t_s, pitot.value - zero_Pa)
    warm = Channel(*samples(log.entries.get("/static", NO_ENTRIES), "temperature_K", start_ns))
    first = float(np.mean(warm.value[:50])) if len(warm.value) else float("nan")
    # The tray warms up: its first reading is that of the air.
    air = Channel(warm.t_s, np.full(len(warm.t_s), first))
    missing = ", ".join(topic for topic in TOPICS_FOR_DRAG if not log.entries.get(topic))
    lacks = f"The log lacks {missing}, which drag needs: the electrical power of level flight is given instead."
    notes = (*log.metadata.get(TABLE, {}).values(), *((lacks, NOTE) if missing else (NOTE,)))
    return FlightRecording(
        log.path,
        channels,
        {"/static": air},
        notes,
        zeroed=zero_Pa is not None,
        place=_place(log, start_ns),
        events=in_order(events(log, start_ns)),
        fix=fix_of_log(log, start_ns),
    )


def _place(log: Log, start_ns: int) -> dict[str, Channel]:
    latitude, longitude = (
        Channel(*samples(log.entries.get("/gps", NO_ENTRIES), field, start_ns))
        for field in ("latitude_deg", "longitude_deg")
    )
    if not len(latitude.t_s) or not len(longitude.t_s):
        return {}
    return places(latitude.t_s, latitude.value, np.interp(latitude.t_s, *longitude))


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
