"""A pilot whose bank and height wander about what a segment of the plan asks for."""

from dataclasses import dataclass
from math import cos, pi, sin

import numpy as np

from sim.pilot import Targets

# Three sines of incommensurable periods: share of the amplitude, and period over the longest one.
SINES = ((0.5, 1.0), (0.3, 0.618), (0.2, 0.368))


@dataclass(frozen=True, kw_only=True)
class PilotWander:
    """Largest deviations of bank, height and speed, and the longest period of each."""

    bank_rad: float = 0.0
    bank_period_s: float = 12.0
    height_m: float = 0.0
    height_period_s: float = 25.0
    speed_mps: float = 0.0
    speed_period_s: float = 20.0

    def wandering(self, targets: Targets, t_s: float, phases: tuple[float, ...]) -> Targets:
        """The targets of a segment at time t_s since the start, with the deviations. phases: `drawn_phases`."""
        bank, _ = _sines(t_s, self.bank_rad, self.bank_period_s, phases[:3])
        height, climb = _sines(t_s, self.height_m, self.height_period_s, phases[3:6])
        if targets.height_m is not None:
            targets = targets._replace(height_m=targets.height_m + height, climb_mps=targets.climb_mps + climb)
        if targets.speed_mps is not None:
            speed, _ = _sines(t_s, self.speed_mps, self.speed_period_s, phases[6:])
            targets = targets._replace(speed_mps=targets.speed_mps + speed)
        return targets._replace(bank_wander_rad=bank)


def drawn_phases(seed: int) -> tuple[float, ...]:
    """Phases [rad] of the nine sines on one flight."""
    return tuple(np.random.default_rng([seed, 0xB4]).uniform(0, 2 * pi, 9).tolist())


def _sines(t_s: float, amplitude: float, period_s: float, phases: tuple[float, ...]) -> tuple[float, float]:
    """A sum of three sines, and its rate [1/s]."""
    value = rate = 0.0
    for (share, ratio), phase in zip(SINES, phases, strict=True):
        omega = 2 * pi / (ratio * period_s)
        value += share * amplitude * sin(omega * t_s + phase)
        rate += share * amplitude * omega * cos(omega * t_s + phase)
    return value, rate
