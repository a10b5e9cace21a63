"""Averages the readings over 0.2 s in the sampling thread; the telemetry process judges runs by these means."""

from collections.abc import Iterable

import msgspec

from flightpower.daq.sensors import Sample
from flightpower.flight.messages import OK

MEAN_OVER_NS = 200_000_000
FIELDS: dict[str, tuple[tuple[str, str], ...]] = {
    "/probe/airspeed": (("q_c_Pa", "differential_pressure_Pa"),),
    "/probe/alpha": (("dp_alpha_Pa", "differential_pressure_Pa"),),
    "/probe/beta": (("dp_beta_Pa", "differential_pressure_Pa"),),
    "/static": (("static_Pa", "pressure_Pa"), ("static_temperature_K", "temperature_K")),
    "/imu": (
        *((f"a{axis}_mps2", f"specific_force_{axis}_mps2") for axis in "xyz"),
        *((f"{rate}_radps", f"angular_rate_{axis}_radps") for rate, axis in zip("pqr", "xyz", strict=True)),
    ),
    "/rpm": (("n_revps", "motor_speed_revps"),),
}
DIGITS = 5  # digits after the point: below the resolution of every part


class Means(msgspec.Struct, array_like=True, kw_only=True):
    """Means over MEAN_OVER_NS; None where nothing was measured. t_s: middle of the interval, since the first tick."""

    t_s: float
    q_c_Pa: float | None = None
    dp_alpha_Pa: float | None = None
    dp_beta_Pa: float | None = None
    static_Pa: float | None = None
    static_temperature_K: float | None = None
    ax_mps2: float | None = None
    ay_mps2: float | None = None
    az_mps2: float | None = None
    p_radps: float | None = None
    q_radps: float | None = None
    r_radps: float | None = None
    n_revps: float | None = None


class TickMeans:
    """Sums the readings of ticks to make means."""

    def __init__(self) -> None:
        self._start_ns: int | None = None
        self._begin_ns = 0
        self._sums: dict[str, tuple[float, int]] = {}

    def add(self, now_ns: int, samples: Iterable[Sample]) -> Means | None:
        """Add a tick that began at now_ns. Returns the means of an interval if this is the first tick after it."""
        finished = None
        if self._start_ns is None:
            self._start_ns = self._begin_ns = now_ns
        elif now_ns - self._begin_ns >= MEAN_OVER_NS:
            middle_s = (self._begin_ns - self._start_ns + MEAN_OVER_NS / 2) / 1e9
            means = {name: round(total / count, DIGITS) for name, (total, count) in self._sums.items()}
            finished = Means(t_s=round(middle_s, DIGITS), **means)
            self._sums = {}
            self._begin_ns += MEAN_OVER_NS * ((now_ns - self._begin_ns) // MEAN_OVER_NS)
        sums = self._sums
        for topic, _, message, _ in samples:
            if topic in FIELDS and message.status is OK:
                for name, field in FIELDS[topic]:
                    value = getattr(message, field)
                    if value is not None:
                        total, count = sums.get(name, (0.0, 0))
                        sums[name] = (total + value, count + 1)
        return finished
