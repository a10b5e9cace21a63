"""Reads the whole tray for a few seconds without recording: for `daq check` and `daq zero`."""

import threading
from pathlib import Path
from typing import NamedTuple

from flightpower.daq.attachments import load_attachments
from flightpower.daq.bus import Buses
from flightpower.daq.clock import Clock
from flightpower.daq.config import Tray
from flightpower.daq.daemon import refuse_devices_in_use, sensor_supervisors
from flightpower.daq.sampling_loop import cycles
from flightpower.daq.sensors import Sample
from flightpower.flight.errors import InputError

SETTLING_S = 2.0  # time for the sensors to start; readings from this time are discarded


class DryRun(NamedTuple):
    """The readings of a tray after it has settled."""

    samples: list[Sample]
    ticks: int
    missed: int
    late_ms: float  # delay of the latest tick
    slow: list[str]  # advice on buses that are too slow
    troubles: dict[str, str] = {}  # noqa: RUF012  at the end, by topic: why a sensor failed, or what is wrong with it


def check_devices_here(tray: Tray) -> None:
    """Raises InputError if the tray has several device files and none exists, as on another computer."""
    devices = list(dict.fromkeys(table.device for table in tray.sensors))
    missing = [device for device in devices if device.startswith("/") and not Path(device).exists()]
    if len(missing) == len(devices) > 1:  # a single missing device is unplugged
        raise InputError(
            f"none of the tray's devices is here ({', '.join(missing)}): run this on the aircraft's computer, or"
            " correct `bus` and `port` in the tray file"
        )


def dry_run(tray: Tray, *, buses: Buses, clock: Clock, seconds: float, threaded: bool = False) -> DryRun:
    """Read every sensor for `seconds`. threaded: see `cycles`.

    Raises InputError when the configuration is incomplete, or another program has one of the devices open.
    """
    refuse_devices_in_use(tray, buses)
    supervisors = sensor_supervisors(tray, buses, load_attachments(tray).aircraft)
    settled_ns = clock.now_ns() + round(SETTLING_S * 1e9)
    until_ns = settled_ns + round(seconds * 1e9)
    samples: list[Sample] = []
    ticks, missed, late_ns = 0, 0, 0
    slow: list[str] = []
    for cycle in cycles(
        supervisors, rate_Hz=tray.rate_Hz, clock=clock, stop=threading.Event(), until_ns=until_ns, threaded=threaded
    ):
        if cycle.now_ns >= settled_ns:
            ticks, missed, late_ns = ticks + 1, missed + cycle.tick.missed, max(late_ns, cycle.tick.late_ns)
            samples += cycle.samples
            slow = cycle.slow
    troubles = {topic: each.health.trouble for each in supervisors for topic in each.topics}
    return DryRun(samples, ticks, missed, late_ns / 1e6, slow, troubles)
