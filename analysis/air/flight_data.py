"""From a log to air data at the center of gravity: synchronizes channels, corrects for line lags and zeros."""

from collections.abc import Collection, Mapping
from types import MappingProxyType
from typing import NamedTuple

import pandas as pd

from flightpower.analysis.air import magnetometer
from flightpower.analysis.air.air import air_data, specific_force_at_cg
from flightpower.analysis.air.airspeed_scale import AirspeedScale
from flightpower.analysis.air.lines import line_responses, without_remainder
from flightpower.analysis.air.magnetometer import Compass, MagnetometerCalibration
from flightpower.analysis.air.probe import ProbeCalibration
from flightpower.analysis.air.transducers import TransducerCalibration, air_data_errors
from flightpower.analysis.sources.daemon import COLUMNS, speed_scale, synchronize
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.analysis.sources.rest import rest_segments, without_zeros, zeros
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller import Propeller
from flightpower.flight.runs import flying_Pa

OPTIONAL_TOPICS = ("/battery", "/mag")
# Optional topics, and what a log without them lacks; empty if another note says it.
LOST_WITHOUT = {
    "/controls": "the cross-check takes the elevator as fixed, and full throttle is not recognized",
    "/gps": "",
    "/probe/beta": "",
}


class FlightData(NamedTuple):
    """The measurements of one flight.

    table : from `air_data`, index t_s        rest : rows in which the aircraft stood still
    zeroed : whether zeros at rest were subtracted        compass : None where no calibrated magnetometer can be used
    notes : what was lost, assumed or corrected, in sentences
    calibrated : by sensor error, its standard error from the calibrations of transducers and airspeed
    resolution : steps of the values as recorded, by column
    """

    table: pd.DataFrame
    rest: list[slice]
    zeroed: bool
    compass: Compass | None
    notes: list[str]
    calibrated: Mapping[str, float] = MappingProxyType({})
    resolution: Mapping[str, float] = MappingProxyType({})


class Calibrations(NamedTuple):
    """Calibrations of the sensors; None for a sensor without one.

    zero : by channel, the reading in still air that `daq zero` took before the flight
    """

    probe: ProbeCalibration
    magnetometer: MagnetometerCalibration | None = None
    zero: dict[str, float] | None = None
    transducers: TransducerCalibration | None = None
    airspeed: AirspeedScale | None = None


def flight_data(log: Log, aircraft: Aircraft, propeller: Propeller, calibrations: Calibrations) -> FlightData:
    """All measurements of a log on one time base, in SI units, at the center of gravity.

    log: a log that `analysis.sources` accepts.
    """
    probe, magnetometer_calibration, zero, transducers, airspeed = calibrations
    lines = line_responses(log, aircraft)
    channels = synchronize(log, {line.topic: line.lag_s for line in lines})
    table, calibrated = channels.table, {}
    if transducers:
        table = transducers.corrected(table)
        zero = transducers.corrected_zero(zero) if zero else zero
        calibrated = air_data_errors(transducers)._asdict()
    table, line_notes = without_remainder(table, lines)
    scale = speed_scale(aircraft)
    flown_Pa = flying_Pa(scale)
    rest = rest_segments(table, channels.rate_Hz, flown_Pa)
    at_rest = zeros(table, rest, zero, flown_Pa)
    table, zero_notes = without_zeros(table, at_rest)
    if airspeed:
        table = airspeed.corrected(table)
        calibrated = {**calibrated, "V_scale": airspeed.scale_error}
    table = specific_force_at_cg(table, aircraft)
    air = air_data(table, aircraft, probe, propeller, scale)
    recorded = [topic for topic, entries in log.entries.items() if entries]
    notes = channels.notes + line_notes + zero_notes + air.notes + silent_topics(air.table, recorded)
    compass = None
    if magnetometer_calibration:
        compass, compass_notes = magnetometer.compass(air.table, magnetometer_calibration)
        notes += compass_notes
    return FlightData(air.table, rest, at_rest is not None, compass, notes, calibrated, channels.resolution)


def silent_topics(table: pd.DataFrame, recorded: Collection[str]) -> list[str]:
    """A note for each topic that the log lacks, or that carried no value for a notable share of the flight.

    recorded: the topics in the log
    """
    lost = table.loc[table["flying"], list(COLUMNS)].isna()
    columns: dict[str, list[str]] = {}
    for name, (topic, _) in COLUMNS.items():
        if topic not in OPTIONAL_TOPICS:
            columns.setdefault(topic, []).append(name)
    by_topic = {topic: float(lost[names].all(axis=1).mean()) for topic, names in columns.items()}
    absent = [topic for topic in LOST_WITHOUT if topic not in recorded]
    return [f"No {topic} in this log: {LOST_WITHOUT[topic]}." for topic in absent if LOST_WITHOUT[topic]] + [
        f"{topic} carried no value for {100 * share:.0f} % of the flight."
        for topic, share in by_topic.items()
        if share > STATISTICS.unmentioned_share and topic not in absent
    ]
