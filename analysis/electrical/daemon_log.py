"""A log of the daemon as the recording of an ordinary flight, for what needs neither flow angles nor motor speed."""

import numpy as np

from analysis.autopilot_logs import recording
from analysis.autopilot_logs.recording import Channel, FlightRecording
from analysis.signals.log_fields import samples
from analysis.signals.synchronize import NEEDED
from flight.log_entries import NO_ENTRIES
from flight.log_reader import Log

CHANNELS = {
    recording.AIRSPEED_PRESSURE: ("/probe/airspeed", "differential_pressure_Pa"),
    recording.STATIC: ("/static", "pressure_Pa"),
    recording.FORCE_X: ("/imu", "specific_force_x_mps2"),
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
    """The channels of a log of the daemon; its clock starts at the first airspeed."""
    start_ns = log.entries["/probe/airspeed"][0].time_ns
    channels: dict[str, Channel] = {}
    for name, (topic, field) in CHANNELS.items():
        one = Channel(*samples(log.entries.get(topic, NO_ENTRIES), field, start_ns))
        if len(one.t_s) >= recording.FEWEST_SAMPLES:
            channels[name] = one
    warm = Channel(*samples(log.entries.get("/static", NO_ENTRIES), "temperature_K", start_ns))
    first = float(np.mean(warm.value[:50])) if len(warm.value) else float("nan")
    # The tray warms up: its first reading is that of the air.
    air = Channel(warm.t_s, np.full(len(warm.t_s), first))
    missing = ", ".join(topic for topic in NEEDED if not log.entries.get(topic))
    note = f"The log lacks {missing}, which drag needs: the electrical power of level flight is given instead."
    return FlightRecording(log.path, channels, {"/static": air}, (note, NOTE), zeroed=False)
