"""A first guess of the aircraft from its flight alone, for a plot before the user has entered the aircraft.

The guess is an aircraft with the prior's drag and a medium aspect ratio that cruises at its best glide. Electrical
power of level flight is measured, so its curve depends only roughly on the guess, through changes of height and speed.
"""

import numpy as np

from flightpower.analysis.methods.whole_flight.curve import FlownAircraft
from flightpower.analysis.methods.whole_flight.settings import CURVE, PRIOR
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.units import SEA_LEVEL_DENSITY


def guessed_aircraft(flight: FlightRecording) -> FlownAircraft:
    """Weight, wing area and span that fit airspeed and power in the faster part of a flight. Raises InputError."""
    channels = flight.channels
    needed = {recording.VOLTAGE, recording.CURRENT}
    if not channels.keys() >= needed or not (
        recording.AIRSPEED_PRESSURE in channels or channels.keys() >= set(recording.GPS)
    ):
        raise InputError(f"{flight.path}: no guess of the aircraft; the log lacks speed or power")
    t_s, q_Pa = _dynamic_pressure(flight)
    power_W = channels[recording.VOLTAGE].at(t_s) * channels[recording.CURRENT].at(t_s)
    cruising = q_Pa >= float(np.percentile(q_Pa, 95)) / 2
    q, P = float(np.median(q_Pa[cruising])), float(np.median(power_W[cruising]))
    if q <= 0 or P <= 0:
        raise InputError(f"{flight.path}: no guess of the aircraft; it did not fly, or its power is not measured")
    aspect_ratio = float(np.sqrt(CURVE.aspect_ratio[0] * CURVE.aspect_ratio[1]))
    # At the best glide half of the drag is induced: CL^2 = pi e A CD0, CD = 2 CD0.
    CL = float(np.sqrt(np.pi * PRIOR.oswald.mean * aspect_ratio * PRIOR.CD0.mean))
    V = float(np.sqrt(2 * q / SEA_LEVEL_DENSITY))
    weight_N = P * PRIOR.efficiency.mean / V * CL / (2 * PRIOR.CD0.mean)
    area_m2 = weight_N / (q * CL)
    return FlownAircraft("Guessed aircraft", weight_N, area_m2, float(np.sqrt(aspect_ratio * area_m2)))


def _dynamic_pressure(flight: FlightRecording) -> tuple[Array, Array]:
    """Times [s] and dynamic pressure [Pa] (n,), from the pitot with its zero removed, or from ground speed."""
    if (pitot := flight.channels.get(recording.AIRSPEED_PRESSURE)) is not None:
        return pitot.t_s, pitot.value - (0.0 if flight.zeroed else float(np.percentile(pitot.value, 5)))
    north, east, _ = (flight.channels[name] for name in recording.GPS)
    return north.t_s, SEA_LEVEL_DENSITY / 2 * (north.value**2 + east.at(north.t_s) ** 2)
