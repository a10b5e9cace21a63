"""More sensors never give less: compares the curves of one flight from every subset of its sensors."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.sources.recording import AIRSPEED_PRESSURE, FORCE_X, FORCE_Y, FORCE_Z, GPS, FlightRecording
from flightpower.flight.errors import InputError

Sensors = frozenset[str]
SENSORS = {"pitot": {AIRSPEED_PRESSURE}, "GPS": set(GPS), "IMU": {FORCE_X, FORCE_Y, FORCE_Z}}


class Curve(NamedTuple):
    """The largest error and the largest half width of the 95 % interval at the speeds compared, relative to power."""

    error: float
    half_width: float


class Flown(NamedTuple):
    """An aircraft, and a function of its estimate that gives the true power [W] (n,) at the speeds V_mps (n,)."""

    weight_N: float
    wing_area_m2: float
    span_m: float
    V_mps: np.ndarray
    power_W: Callable[[ElectricalEstimate], np.ndarray]


def with_sensors(recording: FlightRecording, sensors: Sensors) -> FlightRecording:
    """Return the recording without the channels of any other sensor in SENSORS."""
    missing = set[str]().union(*(SENSORS[name] for name in SENSORS.keys() - sensors))
    channels = {name: channel for name, channel in recording.channels.items() if name not in missing}
    return replace(recording, channels=channels)


def curve_of(recording: FlightRecording, flown: Flown) -> Curve:
    """Return the errors of the curve of a thinned flight; fewer windows and points take a quarter of the time."""
    table = flight_table(recording, flown.weight_N, flown.wing_area_m2).thinned(3)
    electrical = estimate(table, flown.weight_N, flown.wing_area_m2, flown.span_m, most_windows=40, most_points=60)
    truth = flown.power_W(electrical)
    power, sigma = (
        np.interp(flown.V_mps, electrical.V_mps, item) for item in (electrical.power_W, electrical.standard_error_W)
    )
    return Curve(float(np.abs(power / truth - 1).max()), float((1.96 * sigma / truth).max()))


def curves_by_sensors(
    names: Iterable[str], recorded: Callable[[Sensors], FlightRecording], flown: Flown
) -> dict[Sensors, Curve | None]:
    """Return the curve from every subset of sensors, or None where there is no curve."""
    names, result = list(names), dict[Sensors, Curve | None]()
    for sensors in (frozenset(some) for size in range(len(names) + 1) for some in combinations(names, size)):
        try:
            result[sensors] = curve_of(recorded(sensors), flown)
        except InputError:
            result[sensors] = None
    return result


def assert_more_is_never_less(curves: dict[Sensors, Curve | None]) -> None:
    """Check that another sensor removes no curve and makes none much worse. Since estimates differ within their
    intervals, the error may grow by half of the half width, and the interval may widen by less than 30 %."""
    every = frozenset().union(*curves)
    for sensors, curve in curves.items():
        for more in every - sensors:
            other = curves[sensors | {more}]
            if curve is not None:
                assert other is not None, (sensors, more)
                assert other.error < curve.error + 0.5 * curve.half_width, (sensors, more)
                assert other.half_width < 1.3 * curve.half_width, (sensors, more)
