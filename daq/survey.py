"""Reading the whole tray for a few seconds without recording: for `daq check` and `daq zero`."""

import threading
from typing import NamedTuple

from daq import luggage
from daq.bus import Buses
from daq.clock import Clock
from daq.config import Tray
from daq.daemon import stations
from daq.loop import turns
from daq.sensors import Sample

SETTLING_S = 2.0  # parts are brought up meanwhile; not looked at


class Survey(NamedTuple):
    """What the tray gave after it had settled."""

    samples: list[Sample]
    ticks: int
    missed: int
    late_ms: float  # the worst tick


def survey(tray: Tray, *, buses: Buses, clock: Clock, seconds: float, watched: bool = False) -> Survey:
    """Read every sensor for `seconds`. Raises InputError when the configuration lacks something."""
    places = stations(tray, buses, luggage.pack(tray).aircraft)
    settled_ns = clock.now_ns() + round(SETTLING_S * 1e9)
    until_ns = settled_ns + round(seconds * 1e9)
    samples: list[Sample] = []
    ticks, missed, late_ns = 0, 0, 0
    for turn in turns(
        places, rate_Hz=tray.rate_Hz, clock=clock, stop=threading.Event(), until_ns=until_ns, watched=watched
    ):
        if turn.now_ns >= settled_ns:
            ticks, missed, late_ns = ticks + 1, missed + turn.beat.missed, max(late_ns, turn.beat.late_ns)
            samples += turn.samples
    return Survey(samples, ticks, missed, late_ns / 1e6)
