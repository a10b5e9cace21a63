"""Data from which the page computes endurance, range and climb at another weight, in other air or with another battery.

They describe level flight and full throttle at the lift coefficients flown, on a grid of weights and densities. Between
nodes the page interpolates quantities that hardly change along the grid: efficiency, thrust over density, drag over
weight. Speed and power required scale exactly with weight and density at equal lift coefficient.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.pages.charts.style import ORANGE
from flightpower.analysis.performance.analysis import Performance
from flightpower.analysis.performance.climb import (
    FullThrottlePerformance,
    full_throttle_performance,
    full_throttle_performances,
    full_throttle_thrust,
)
from flightpower.analysis.performance.level_flight import (
    LevelFlight,
    PerformanceModel,
    best_endurance,
    best_range,
    level_flight,
    level_flights,
)
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import height_at, pressure_at
from flightpower.flight.units import (
    GAS_CONSTANT_AIR,
    GRAVITY_MPS2,
    LAPSE_RATE,
    SEA_LEVEL_PRESSURE_PA,
    SEA_LEVEL_TEMPERATURE_K,
)

Json = dict[str, Any]


class Grid(NamedTuple):
    """The range of values that the reader may ask for, and the resolution.

    lightest, heaviest : in units of the weight flown. The curve covers the lift coefficients flown, so its speeds scale
        with the square root of weight
    nodes : along each axis, enough to interpolate power within 0.3 %
    speeds : of a curve whose best point is found by a parabola
    thrust_speeds : more, since thrust at full throttle has corners where the propeller's table has them
    """

    lightest: float = 0.5
    heaviest: float = 2.0
    lowest_m: float = -500.0
    highest_m: float = 6000.0
    coldest_K: float = 233.15
    hottest_K: float = 323.15
    nodes: int = 7
    speeds: int = 31
    thrust_speeds: int = 121


GRID = Grid()


class Control(NamedTuple):
    """A value that the reader can change: limits, step, and digits shown."""

    name: str
    label: str
    least: float
    most: float
    step: float
    digits: int


class OtherConditions(NamedTuple):
    fields: list[Control]
    embedded: Json


def other_conditions_section(performance: Performance | None) -> OtherConditions | None:
    """Return the limits of the controls around the flown values; None if performance is not known."""
    if performance is None:
        return None
    mass_kg = performance.flown.condition.weight_N / GRAVITY_MPS2
    battery_Wh = performance.battery.energy_Wh
    fields = [
        Control("mass", "mass, kg", round(GRID.lightest * mass_kg, 2), round(GRID.heaviest * mass_kg, 2), 0.01, 2),
        Control("height", "pressure altitude, m", GRID.lowest_m, GRID.highest_m, 10, 0),
        Control("temperature", "air temperature, °C", GRID.coldest_K - 273.15, GRID.hottest_K - 273.15, 0.5, 1),
        Control("battery", "battery, Wh", round(0.1 * battery_Wh, 1), round(5 * battery_Wh, 1), 0.1, 1),
        Control("share", "share used, %", 5, 100, 1, 0),
    ]
    return OtherConditions(fields, embedded(performance))


def embedded(performance: Performance) -> Json:
    """Return grid, condition and battery as JSON for `other_conditions.js`."""
    flown = performance.flown
    ideal = flown.pressure_Pa / (GAS_CONSTANT_AIR * flown.temperature_K)
    # The density flown may be measured, or that of moist air, so the controls scale it in proportion.
    moist = flown.condition.rho / ideal
    densities = [
        moist * float(pressure_at(height_m)) / (GAS_CONSTANT_AIR * temperature_K)
        for height_m, temperature_K in ((GRID.highest_m, GRID.hottest_K), (GRID.lowest_m, GRID.coldest_K))
    ]
    return {
        "grid": embedded_grid(performance.model, flown.condition, (densities[0], densities[1])),
        "flown": {
            "weight_N": flown.condition.weight_N,
            "rho": flown.condition.rho,
            "pressure_altitude_m": float(height_at(flown.pressure_Pa)),
            "temperature_K": flown.temperature_K,
        },
        "battery_Wh": performance.battery.energy_Wh,
        "usable": performance.battery.usable,
        "atmosphere": {
            "gravity_mps2": GRAVITY_MPS2,
            "gas_constant": GAS_CONSTANT_AIR,
            "lapse_rate": LAPSE_RATE,
            "sea_level_K": SEA_LEVEL_TEMPERATURE_K,
            "sea_level_Pa": SEA_LEVEL_PRESSURE_PA,
        },
        "normal_95": NORMAL_95,
        "color": ORANGE,
    }


def embedded_grid(model: PerformanceModel, flown: Condition, densities: tuple[float, float]) -> Json:
    """Return the curve flown, and at each node what depends on condition. densities: least, greatest [kg/m^3]"""
    weights = _nodes(flown.weight_N, (GRID.lightest * flown.weight_N, GRID.heaviest * flown.weight_N))
    rhos = _nodes(flown.rho, densities)
    as_flown = level_flight(model, flown, _speeds(model, flown))
    return {
        "nodes": [_nodes_at(model, [flown._replace(weight_N=W, rho=rho) for rho in rhos]) for W in weights],
        "log_weight": [float(np.log(weights[0])), float(np.log(weights[1] / weights[0]))],
        "log_density": [float(np.log(rhos[0])), float(np.log(rhos[1] / rhos[0]))],
        "V": _short(as_flown.V, 7),
        "required": _short(as_flown.required.value, 7),
        "required_error": _short(as_flown.required.standard_error, 4),
        "full": _full_throttle(model, flown, (weights, rhos)) if _throttle(model) else None,
    }


def _full_throttle(model: PerformanceModel, flown: Condition, nodes: tuple[Array, Array]) -> Json:
    """Return speeds of the climb as flown, and full-throttle thrust over density at speeds that cover all nodes.

    Thrust hardly depends on weight, and the table's corners lie at about the same speeds in air of any density.
    """
    weights, rhos = nodes
    V = full_throttle_performance(model, flown, GRID.speeds).V
    slowest, fastest = (
        float(end * np.sqrt(W / flown.weight_N / (rho / flown.rho)))
        for end, W, rho in ((V[0], weights[0], rhos[-1]), (V[-1], weights[-1], rhos[0]))
    )
    speeds = np.linspace(slowest, fastest, GRID.thrust_speeds)
    return {
        "V": _short(V, 7),
        "thrust_V": _short(speeds, 7),
        "thrust_over_density": [_short(full_throttle_thrust(model, speeds, float(rho)) / rho, 5) for rho in rhos],
    }


def _nodes(flown: float, ends: tuple[float, float]) -> Array:
    """Return nodes at equal steps of the logarithm that include the value flown and enclose both ends."""
    lo, hi = np.log(np.array(ends) / flown)
    step = (hi - lo) / (GRID.nodes - 1)
    steps = np.arange(np.floor(lo / step + 1e-9), np.ceil(hi / step - 1e-9) + 1)
    return np.asarray(flown * np.exp(step * steps))


def _throttle(model: PerformanceModel) -> bool:
    return model.full_throttle.parameters is not None


def _speeds(model: PerformanceModel, condition: Condition) -> Array:
    smallest_CL, largest_CL = model.flown_CL
    return np.linspace(speed_at(largest_CL, condition), speed_at(smallest_CL, condition), GRID.speeds)


def _nodes_at(model: PerformanceModel, conditions: Sequence[Condition]) -> list[Json]:
    flights = level_flights(model, conditions, np.array([_speeds(model, condition) for condition in conditions]))
    full: Sequence[FullThrottlePerformance | None] = [None] * len(conditions)
    if _throttle(model):
        full = full_throttle_performances(model, conditions, GRID.speeds)
    return [
        _node(flight, performance, condition.weight_N)
        for flight, performance, condition in zip(flights, full, conditions, strict=True)
    ]


def _node(flight: LevelFlight, full: FullThrottlePerformance | None, weight_N: float) -> Json:
    """Return, at speeds of equal lift coefficient, power required over battery power, the relative error of battery
    power, and whether the propeller's table covers it; errors of the best speeds; and for the climb at full throttle
    the share of thrust along the path, and drag over weight."""
    sustained = np.ones(GRID.speeds, dtype=bool)
    if full is not None:
        level = ~(np.interp(flight.V, full.V, full.climb.value) < 0)
        if (level & np.isfinite(flight.battery.value)).any():
            sustained = level
    node: Json = {
        "efficiency": _short(flight.required.value / flight.battery.value, 5),
        "battery_error": _short(flight.battery.standard_error / flight.battery.value, 3),
        "inside": "".join("1" if inside else "0" for inside in flight.inside),
        "endurance_speed_error": _error(best_endurance(flight, 1.0, sustained).speed_mps.standard_error),
        "range_speed_error": _error(best_range(flight, 1.0, sustained).speed_mps.standard_error),
    }
    if full is not None:
        along_N, sine = full.power.value / full.V, full.climb.value / full.V
        node |= {
            "along": _short(along_N / full.thrust_N, 5),
            "drag_over_weight": _short(along_N / weight_N - sine, 5),
            "maximum_speed_error": _error(full.maximum_speed.standard_error),
            "best_climb_error": _error(full.best_climb.standard_error),
        }
    return node


def _short(values: Array, digits: int) -> list[float | None]:
    """Round to a number of significant digits; None for a missing value."""
    return [float(f"{value:.{digits}g}") if np.isfinite(value) else None for value in values.tolist()]


def _error(value: object) -> float | None:
    return _short(np.atleast_1d(np.asarray(value, dtype=float)), 4)[0]
