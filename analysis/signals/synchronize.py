"""From a log to synchronized channels: all on one uniform grid of the tick rate, each corrected for its delay.

Samples that failed, were stale or saturated are left out. Long gaps are not interpolated: the channel is NaN there.
"""

from typing import NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.signals.cubic_spline import on_grid
from analysis.signals.log_fields import losses, samples, tick_period_s, times_ns
from flight.log_entries import NO_ENTRIES
from flight.log_reader import Log

Array = NDArray[np.float64]

# Column of the table: (topic, field).
COLUMNS = {
    "ax_mps2": ("/imu", "specific_force_x_mps2"),
    "ay_mps2": ("/imu", "specific_force_y_mps2"),
    "az_mps2": ("/imu", "specific_force_z_mps2"),
    "p_radps": ("/imu", "angular_rate_x_radps"),
    "q_radps": ("/imu", "angular_rate_y_radps"),
    "r_radps": ("/imu", "angular_rate_z_radps"),
    "dp_alpha_Pa": ("/probe/alpha", "differential_pressure_Pa"),
    "dp_beta_Pa": ("/probe/beta", "differential_pressure_Pa"),
    "q_c_Pa": ("/probe/airspeed", "differential_pressure_Pa"),
    "static_Pa": ("/static", "pressure_Pa"),
    "static_temperature_K": ("/static", "temperature_K"),
    "n_revps": ("/rpm", "motor_speed_revps"),
    "elevator_rad": ("/controls", "elevator_rad"),
    "throttle": ("/controls", "throttle"),
    "gps_north_mps": ("/gps", "velocity_north_mps"),
    "gps_east_mps": ("/gps", "velocity_east_mps"),
    "gps_down_mps": ("/gps", "velocity_down_mps"),
    "mag_x_T": ("/mag", "field_x_T"),
    "mag_y_T": ("/mag", "field_y_T"),
    "mag_z_T": ("/mag", "field_z_T"),
    "battery_V": ("/battery", "voltage_V"),
    "battery_A": ("/battery", "current_A"),
}
TOPICS = tuple(dict.fromkeys(topic for topic, _ in COLUMNS.values()))
NEEDED = ("/imu", "/probe/alpha", "/probe/airspeed", "/static", "/rpm")


class Channels(NamedTuple):
    """Synchronized channels of a log."""

    table: pd.DataFrame  # index: t_s since the first tick; columns: COLUMNS, NaN where nothing was measured
    rate_Hz: float
    start_ns: int  # Unix time of t_s = 0
    notes: list[str]  # clipping and long gaps, in sentences


def synchronize(log: Log, lag_s: dict[str, float] | None = None) -> Channels:
    """Every channel of a log on one uniform grid.

    log: accepted by `analysis.log_checks`.
    lag_s: by topic, a known delay of its quantity [s], in addition to the delay in its messages.
    Raises InputError if the log's metadata have a wrong rate.
    """
    ticks_ns, period_s = times_ns(log.entries["/imu"]), tick_period_s(log)
    start_ns = int(ticks_ns[0])
    t_s: Array = np.arange(int((ticks_ns[-1] - start_ns) / 1e9 / period_s) + 1, dtype=float) * period_s

    table: dict[str, Array] = {}
    of_topic = {topic: log.entries.get(topic, NO_ENTRIES) for topic in TOPICS}
    notes = [note for topic, entries in of_topic.items() for note in losses(topic, entries, start_ns)]
    for name, (topic, field) in COLUMNS.items():
        taken_s, value = samples(of_topic[topic], field, start_ns)
        table[name] = on_grid(t_s, taken_s - (lag_s or {}).get(topic, 0.0), value)
    return Channels(pd.DataFrame(table, index=pd.Index(t_s, name="t_s")), 1 / period_s, start_ns, notes)
