"""Synthetic flights of airframes that stay as they are, or change."""

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).parents[1] / "pooling"))

from measured_row import RowModel
from synthetic_flights import POLAR, flight, truth

from flightpower.analysis.flights.flight_statistics import POOLED

Array = NDArray[np.float64]
FIRST_UNIX_S = datetime(2026, 1, 5, 9, tzinfo=UTC).timestamp()
DAY_S = 86400.0


def flights_of(
    airframe: str,
    seed: int,
    count: int,
    *,
    drag: Array | float = 0.0,
    thrust: Array | float = 0.0,
    noise: float = 1.0,
    polar: Array = POLAR,
    every_days: float = 1.8,
    like: RowModel | None = None,
) -> list[dict[str, Any]]:
    """The results of flights of one airframe. drag, thrust: relative change of each flight (count,) from the airframe's
    values.

    like : the model that the flights' rows come from, instead of short flights with this noise
    """
    rng = np.random.default_rng(seed)
    x = like.truth(rng, polar) if like else truth(rng, polar)
    shared = like.shared_errors(rng) if like else None
    more_drag, more_thrust = np.broadcast_to(drag, count), np.broadcast_to(thrust, count)
    flights = []
    for i in range(count):
        now = x.copy()
        now[:3] *= 1 + more_drag[i]
        now[POOLED.index("thrust_scale")] += more_thrust[i]
        start = FIRST_UNIX_S + i * every_days * DAY_S
        this_flight = flight(now, rng, f"{airframe}-{i:03d}", noise, aircraft=airframe, start_unix_s=start)
        if like and shared is not None:
            this_flight["pooling"] |= like.pooling(now, shared, rng)
        flights.append(this_flight)
    return flights
