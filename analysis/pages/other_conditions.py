"""What the page computes performance with, at another weight, in other air or with another battery.

The page's `performance.js` repeats `analysis.performance` step by step, at the same sigma points of the parameters.
"""

from typing import Any, NamedTuple

from analysis.estimation.noise import NORMAL_95
from analysis.methods.thrust_prior import J_REFERENCE
from analysis.pages.charts.style import ORANGE
from analysis.performance.analysis import Performance
from analysis.performance.level_flight import PerformanceModel
from analysis.performance.settings import PERFORMANCE
from analysis.settings import CURVES
from flight.atmosphere import height_at
from flight.propeller import FOLD, FOLDED_DRAG_AREA, Propeller
from flight.units import GAS_CONSTANT_AIR, GRAVITY_MPS2, LAPSE_RATE, SEA_LEVEL_PRESSURE_PA, SEA_LEVEL_TEMPERATURE_K

Json = dict[str, Any]


class Control(NamedTuple):
    """A value that the reader changes: limits and step, digits shown."""

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
    """Controls around what was flown. None where performance is not known."""
    if performance is None:
        return None
    mass_kg = performance.flown.condition.weight_N / GRAVITY_MPS2
    battery_Wh = performance.result.battery_energy_Wh
    # A curve is that of the lift coefficients flown: half and twice the mass move its speeds by 0.7 and 1.4.
    fields = [
        Control("mass", "mass, kg", round(0.5 * mass_kg, 2), round(2 * mass_kg, 2), 0.01, 2),
        Control("height", "pressure altitude, m", -500, 6000, 10, 0),
        Control("temperature", "air temperature, °C", -40, 50, 0.5, 1),
        Control("battery", "battery, Wh", round(0.1 * battery_Wh, 1), round(5 * battery_Wh, 1), 0.1, 1),
        Control("share", "share used, %", 5, 100, 1, 0),
    ]
    return OtherConditions(fields, embedded(performance))


def embedded(performance: Performance) -> Json:
    """Model, condition and battery as JSON for `performance.js` and `other_conditions.js`."""
    flown = performance.flown
    return {
        "model": embedded_model(performance.model),
        "flown": {
            "weight_N": flown.condition.weight_N,
            "rho": flown.condition.rho,
            "wing_area_m2": flown.condition.wing_area_m2,
            "pressure_altitude_m": float(height_at(flown.pressure_Pa)),
            "temperature_K": flown.temperature_K,
        },
        "battery_Wh": performance.result.battery_energy_Wh,
        "usable": performance.result.usable,
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


def embedded_model(model: PerformanceModel) -> Json:
    """The part that does not depend on the condition: parameters at their sigma points, propeller, losses."""
    points = {name: values[:, 0].tolist() for name, values in model.sigma_points.items()}
    return {
        "points": [dict(zip(points, values, strict=True)) for values in zip(*points.values(), strict=True)],
        "flown_CL": model.flown_CL,
        "speeds": CURVES.fine_points,
        "fastest_sought": PERFORMANCE.fastest_sought,
        "full_throttle": model.full_throttle.parameters is not None,
        "no_load_torque_Nm": model.power_train.no_load_torque_Nm,
        "J_reference": J_REFERENCE,
        "propeller": _embedded_propeller(model.propeller),
    }


def _embedded_propeller(propeller: Propeller) -> Json:
    rows = propeller.rows
    knots, (cT, cP, cT_slope, cP_slope) = propeller.lines()
    return {
        "diameter_m": propeller.diameter_m,
        "folds": propeller.beyond_zero_thrust == FOLD,
        "folded_drag_area": FOLDED_DRAG_AREA,
        "rpm": [row.rpm for row in rows],
        "knots": knots,
        "below": [knots[0], *knots],
        "first_J": [row.J[0] for row in rows],
        "last_J": [row.J[-1] for row in rows],
        "cT": {"value": cT, "slope": cT_slope},
        "cP": {"value": cP, "slope": cP_slope},
    }
