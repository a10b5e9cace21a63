"""Turns a log of the daemon into the recording of an ordinary flight: without flow angles, with electrical power."""

from dataclasses import replace

import numpy as np
import pandas as pd

from flightpower.analysis.sources import recording
from flightpower.analysis.sources.autopilot_settings import READABLE
from flightpower.analysis.sources.daemon import COLUMNS, events, fix_of_log, samples, speed_scale_of
from flightpower.analysis.sources.position import places
from flightpower.analysis.sources.recording import AIRSPEED_PRESSURE, Channel, FlightRecording, channel, in_order
from flightpower.analysis.sources.rest import ZERO_FILE
from flightpower.analysis.sources.table import TABLE
from flightpower.flight.log_entries import NO_ENTRIES
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import TOPICS_FOR_DRAG
from flightpower.flight.runs import flying_Pa

# Topic and field for each channel of a recording.
CHANNELS = {recording.AIRSPEED_PRESSURE: COLUMNS["q_c_Pa"], recording.MOTOR: COLUMNS["n_revps"]}
CHANNELS |= {
    name: COLUMNS[name] for name in (recording.STATIC, recording.FORCE_X, recording.FORCE_Y, recording.FORCE_Z)
}
CHANNELS |= {name: COLUMNS[name] for name in (recording.VOLTAGE, recording.CURRENT, *recording.GPS)}
NOTE = "The pitot's pressure is taken as dynamic pressure: without flow angles the probe's calibration cannot be used."


def recording_of(log: Log) -> FlightRecording:
    """Return a daemon log's channels. Their clock starts at the first airspeed message, or else the first GPS one."""
    recorded = _recording(log)
    return replace(recorded, notes=(*recorded.notes, NOTE))


def _recording(log: Log) -> FlightRecording:
    """Return the channels as recorded, with notes on the log but none on the airspeed."""
    start_ns = _start_ns(log)
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
    # The tray warms up, so only its first readings show the air's temperature.
    air = Channel(warm.t_s, np.full(len(warm.t_s), first))
    version = log.metadata.get("flightpower", {}).get("version", "")
    missing = ", ".join(topic for topic in TOPICS_FOR_DRAG if not log.entries.get(topic))
    lacks = f"The log lacks {missing}, which drag needs: the electrical power of level flight is given instead."
    notes = (*log.metadata.get(TABLE, {}).values(), *((lacks,) if missing else ()))
    if log.torn:
        notes = (f"The log is {log.incomplete}.", *notes)
    return FlightRecording(
        log.path,
        channels,
        {"/static": air},
        notes,
        zeroed=zero_Pa is not None,
        place=_place(log, start_ns),
        events=in_order(events(log, start_ns)),
        recorded_by=f"flightpower {version}" if version else "",
        fix=fix_of_log(log, start_ns),
    )


def recording_with_air_data(log: Log, table: pd.DataFrame) -> FlightRecording:
    """Return the recording of a log with flow angles, with the dynamic pressure that the calibrated probe gives.

    The pressure at a probe's center port falls with angle of attack, by 5 % at 8 deg for a hemisphere. Outside the
    probe's calibrated angles there are no samples. table : from `air.air_data`
    """
    recorded = _recording(log)
    on_ground = table["q_c_Pa"].to_numpy() <= flying_Pa(speed_scale_of(table))
    ground_Pa = np.where(on_ground, table["q_c_Pa"], np.nan)
    pressure_Pa = np.where(table["flying"], table["qbar_Pa"], ground_Pa)
    after_start_s = (log.entries["/imu"][0].time_ns - _start_ns(log)) / 1e9
    pressure = channel(table.index.to_numpy() + after_start_s, pressure_Pa)
    return replace(recorded, channels={**recorded.channels, AIRSPEED_PRESSURE: pressure}, zeroed=True)


def _start_ns(log: Log) -> int:
    """Return the log time of the first airspeed message [ns], or if there is none, of the first GPS message."""
    return next(log.entries[topic][0].time_ns for topic in ("/probe/airspeed", "/gps") if log.entries.get(topic))


def _place(log: Log, start_ns: int) -> dict[str, Channel]:
    latitude, longitude = (
        Channel(*samples(log.entries.get("/gps", NO_ENTRIES), field, start_ns))
        for field in ("latitude_deg", "longitude_deg")
    )
    if not len(latitude.t_s) or not len(longitude.t_s):
        return {}
    return places(latitude.t_s, latitude.value, longitude.at(latitude.t_s))
