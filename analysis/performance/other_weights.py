"""Sentences on endurance and range at other weights, from a curve of electrical power; no propeller table is needed."""

from collections.abc import Iterable

from flightpower.analysis.curve import Cost, Curve
from flightpower.analysis.records.flight import BatteryResult
from flightpower.flight.arrays import Array
from flightpower.flight.units import GRAVITY_MPS2

NO_BATTERY = (
    "No endurance, range or climb at other weights: no flight states the energy of its battery; give --battery-Wh, or"
    ' battery_energy = "74 W h" under [propulsion] of the aircraft file.'
)
NO_MODEL = (
    "No endurance, range or climb at other weights: in no flight do the propeller's table and the motor give the power"
    " from the battery."
)


def electrical_at_weights(curve: Curve, weights_N: Iterable[float], battery: BatteryResult | None) -> list[str]:
    """A sentence for each weight [N] on least power and least energy per distance, at equal lift coefficients.

    battery : adds endurance and range; None if it is not known
    """
    return [_sentence(curve.at(curve.condition._replace(weight_N=W)), battery) for W in weights_N]


def _sentence(curve: Curve, battery: BatteryResult | None) -> str:
    parts = []
    for title, cost, cost_W in (
        ("least power", Cost.POWER, curve.power_W.value),
        ("best range", Cost.ENERGY_PER_METER, curve.power_W.value / curve.V_mps),
    ):
        i = int(cost_W.argmin())
        part = f"{title} {_power(curve, i)} at {curve.V_mps[i]:.1f} m/s"
        if i == 0:
            part += ", the slowest of the curve"
        if battery:
            longest = curve.longest(cost, battery.usable_J)
            per, unit = (60.0, "min") if cost is Cost.POWER else (1000.0, "km")
            value, lo, hi = (end / per for end in (longest.value, longest.lo, longest.hi))
            part += f", {value:.0f} {unit} ({lo:.0f} to {hi:.0f})"
        parts.append(part)
    return f"With {curve.condition.weight_N / GRAVITY_MPS2:.2f} kg: {'; '.join(parts)}."


def _power(curve: Curve, i: int) -> str:
    half_W: Array = curve.power_W.half_width
    value_W = curve.power_W.value[i]
    return f"{value_W:.0f} W ({value_W - half_W[i]:.0f} to {value_W + half_W[i]:.0f})"
