"""Weights and air densities that performance is computed for: the flight's own, and those requested."""

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from analysis.drag.polar import Condition
from analysis.performance.request import Request
from flight.atmosphere import (
    GAS_CONSTANT_AIR,
    LAPSE_RATE,
    SEA_LEVEL_DENSITY,
    SEA_LEVEL_TEMPERATURE_K,
    density,
    pressure_at,
    temperature_at,
)
from flight.units import GRAVITY_MPS2

PAYLOAD_KG, HOTTER_K, HIGHER_M = 0.3, 15.0, 1000.0  # added to the flight's own where nothing is requested


class FlownCondition(NamedTuple):
    """Weight, density and wing area of the flight; pressure and temperature of the air, means over the runs."""

    condition: Condition
    pressure_Pa: float
    temperature_K: float


class TitledCondition(NamedTuple):
    """A weight and density, and its name in results.json."""

    title: str
    condition: Condition


def density_altitude_m(rho: ArrayLike) -> NDArray[np.float64]:
    """Height in the standard troposphere at which air has density rho [kg/m^3], elementwise."""
    exponent = 1 / (GRAVITY_MPS2 / (GAS_CONSTANT_AIR * LAPSE_RATE) - 1)
    ratio = np.asarray(rho, dtype=float) / SEA_LEVEL_DENSITY
    return SEA_LEVEL_TEMPERATURE_K / LAPSE_RATE * (1 - np.power(ratio, exponent))


def requested_conditions(request: Request, flight: FlownCondition) -> list[TitledCondition]:
    """Every requested weight in every requested air, without the flight's own condition."""
    return [
        TitledCondition(
            ", ".join(part for part in (weight_title, air_title) if part),
            Condition(weight_N, rho, flight.condition.wing_area_m2),
        )
        for (air_title, rho), (weight_title, weight_N) in product(_airs(request, flight), _weights(request, flight))
        if weight_title or air_title
    ]


def _weights(request: Request, flight: FlownCondition) -> list[tuple[str, float]]:
    """Title and weight [N]; the title of the flight's own weight is empty."""
    if request.weights_N:
        return [(f"{weight_N / GRAVITY_MPS2:.2f} kg", weight_N) for weight_N in request.weights_N]
    payload_N = PAYLOAD_KG * GRAVITY_MPS2
    return [
        ("", flight.condition.weight_N),
        (f"{1000 * PAYLOAD_KG:.0f} g more", flight.condition.weight_N + payload_N),
        (f"{2000 * PAYLOAD_KG:.0f} g more", flight.condition.weight_N + 2 * payload_N),
    ]


def _airs(request: Request, flight: FlownCondition) -> list[tuple[str, float]]:
    """Title and density [kg/m^3]; the title of the flight's own air is empty."""
    if request.density_altitudes_m:
        return [(f"density altitude {h:.0f} m", _standard_density(h)) for h in request.density_altitudes_m]
    higher_m = float(density_altitude_m(flight.condition.rho)) + HIGHER_M
    return [
        ("", flight.condition.rho),
        (f"{HOTTER_K:.0f} °C hotter", float(density(flight.pressure_Pa, flight.temperature_K + HOTTER_K))),
        (f"{HIGHER_M:.0f} m higher", _standard_density(higher_m)),
    ]


def _standard_density(height_m: float) -> float:
    return float(density(pressure_at(height_m), temperature_at(height_m)))
