"""Longest endurance and longest range with a battery, at one weight and density, in still air."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analysis.performance.level_flight import LevelFlight
from analysis.performance.propagation import UncertainValue, from_sigma_points

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Optimum:
    """The best speed among those of a `LevelFlight`.

    speed_mps : the best speed     best : endurance [s] or range [m] there     power_W : from the battery there
    at_slowest, at_fastest : the best speed lies at that end     inside : as `LevelFlight.inside` there
    """

    speed_mps: UncertainValue
    best: UncertainValue
    power_W: UncertainValue
    at_slowest: bool
    at_fastest: bool
    inside: bool


def longest_endurance(flight: LevelFlight, energy_J: float, sustained: NDArray[np.bool_]) -> Optimum:
    """The speed of longest endurance. energy_J : from the battery     sustained : (k,) speeds to choose from"""
    return _optimum(flight, sustained, energy_J / flight.battery_at_sigma_points)


def longest_range(flight: LevelFlight, energy_J: float, sustained: NDArray[np.bool_]) -> Optimum:
    """The speed of longest range. energy_J : from the battery     sustained : (k,) speeds to choose from"""
    return _optimum(flight, sustained, energy_J / flight.battery_at_sigma_points * flight.V)


def _optimum(flight: LevelFlight, sustained: NDArray[np.bool_], objective: Array) -> Optimum:
    """Where the objective (2m + 1, k) is largest.

    Every sigma point has its own optimum: the value there is known better than the speed.
    """
    maxima = [_maximum(flight.V, values) for values in np.where(sustained, objective, np.nan)]
    speed, best = (from_sigma_points(values) for values in zip(*maxima, strict=True))
    power_W = [np.interp(float(speed.value), flight.V, values) for values in flight.battery_at_sigma_points]
    margin = 1.01 * (flight.V[1] - flight.V[0])
    return Optimum(
        speed_mps=speed,
        best=best,
        power_W=from_sigma_points(power_W),
        at_slowest=bool(speed.value <= flight.V[0] + margin),
        at_fastest=bool(speed.value >= flight.V[-1] - margin),
        inside=bool(flight.inside[np.argmin(np.abs(flight.V - speed.value))]),
    )


def _maximum(x: Array, y: Array) -> tuple[float, float]:
    """Place and height of the maximum, by a parabola through the highest point and its neighbors."""
    if np.isnan(y).all():
        return np.nan, np.nan
    i = int(np.nanargmax(y))
    if i in (0, len(x) - 1) or not np.isfinite(y[i - 1 : i + 2]).all():
        return float(x[i]), float(y[i])
    before, after = y[i - 1] - y[i], y[i + 1] - y[i]
    shift = (before - after) / (2 * (before + after)) if before + after < 0 else 0.0
    return float(x[i] + shift * (x[1] - x[0])), float(y[i] + (after - before) * shift / 4)
