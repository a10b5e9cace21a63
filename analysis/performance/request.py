"""The user's request for performance: battery, weights and density altitudes, checked before anything is computed."""

import math
import re
from dataclasses import dataclass
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightpower.analysis.curve import Condition
from flightpower.analysis.performance.settings import ASKED
from flightpower.analysis.records.flight import BatteryResult
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.atmosphere import (
    GAS_CONSTANT_AIR,
    LAPSE_RATE,
    SEA_LEVEL_DENSITY,
    SEA_LEVEL_TEMPERATURE_K,
    density,
    pressure_at,
    temperature_at,
)
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2, TROPOPAUSE_M, to_si, weight_to_N

CHARGE_AND_VOLTAGE = re.compile(r"(?P<charge>.*[hHC])\s*(?:,|at|@|[xX×*])?\s*(?P<voltage>[\d.]+\s*V)\s*")


@dataclass(frozen=True)
class Request:
    """Battery energy [Wh] (None: the aircraft file's), its usable share, and the conditions to compute.

    If weights or density altitudes are empty, the flight's own and some larger ones are used.
    """

    battery_Wh: float | None = None
    usable: float = ASKED.usable
    weights_N: tuple[float, ...] = ()
    density_altitudes_m: tuple[float, ...] = ()

    def battery(self, aircraft: Aircraft | None) -> BatteryResult | None:
        """The battery, with energy from this request or else the aircraft file; None if neither has it."""
        in_file = aircraft.propulsion.battery_energy_Wh if aircraft else None
        energy_Wh = in_file if self.battery_Wh is None else self.battery_Wh
        return None if energy_Wh is None else BatteryResult(energy_Wh=energy_Wh, usable=self.usable)

    def notes(self, aircraft: Aircraft) -> list[str]:
        """A sentence where the battery's energy is not known, and questions about values that are far from usual."""
        if self.battery(aircraft) is not None:
            return self.questions(aircraft.mass.weight_N)
        return [
            *self.questions(aircraft.mass.weight_N),
            "No endurance, range or climb: the aircraft file lacks propulsion.battery_energy, such as"
            ' battery_energy = "74 W h"; or give --battery-Wh.',
        ]

    def questions(self, flown_weight_N: float) -> list[str]:
        """Questions about requested values that are far from the aircraft's own."""
        questions = [unusual_weight("--weights", weight_N, flown_weight_N) for weight_N in self.weights_N]
        return [question for question in (*questions, unusual_battery(self.battery_Wh, flown_weight_N)) if question]


def unusual_weight(option: str, weight_N: float, flown_weight_N: float) -> str:
    """A question about a weight at least three times the weight flown or at most a third of it; else empty."""
    most = 3.0  # batteries and payload of small aircraft double the weight at most
    ratio = weight_N / flown_weight_N
    if 1 / most < ratio < most:
        return ""
    flown_kg, asked_kg = flown_weight_N / GRAVITY_MPS2, weight_N / GRAVITY_MPS2
    return (
        f"Is {option} {asked_kg:.3g} kg right? It is {ratio:.2g} times the weight flown, {flown_kg:.3g} kg, at which"
        " drag and propeller were measured."
    )


def unusual_battery(energy_Wh: float | None, weight_N: float) -> str:
    """A question about a battery that the aircraft cannot carry, or that lasts for seconds; else empty."""
    if energy_Wh is None:
        return ""
    least, most = 1.0, 300.0  # Wh/kg: a minute of hover needs the former; only the best bare cells have the latter
    share = energy_Wh * GRAVITY_MPS2 / weight_N
    if least < share < most:
        return ""
    return (
        f"Is --battery-Wh {energy_Wh:.3g} Wh right? That is {share:.2g} Wh for each kilogram of the aircraft; 20 to 150"
        " are usual."
    )


def parse_request(
    battery_Wh: str | None = None,
    usable: str | None = None,
    weights: str | None = None,
    density_altitudes: str | None = None,
) -> Request:
    """Request from the options' text: "74 Wh" or "5000 mAh, 14.8 V", "80 %", "3.8 kg, 4.1 kg", "0 m, 5000 ft".

    A plain number is an energy in watt hours, or a usable share between 0 and 1.

    Raises InputError that names the option and what it should be.
    """
    return Request(
        battery_Wh=None if battery_Wh is None else _battery_Wh(battery_Wh),
        usable=ASKED.usable if usable is None else _share(usable),
        weights_N=() if weights is None else tuple(parse_weight(text) for text in weights.split(",")),
        density_altitudes_m=()
        if density_altitudes is None
        else tuple(_height_m(text) for text in density_altitudes.split(",")),
    )


def _battery_Wh(text: str) -> float:
    """Energy [Wh] from "74", "74 Wh", or charge and voltage as printed on a battery: "5000 mAh, 14.8 V"."""
    match = CHARGE_AND_VOLTAGE.fullmatch(text)
    value = _si_or_nan(match["charge"], "A h") * _si_or_nan(match["voltage"], "V") if match else _number(text, "W h")
    if math.isnan(value) and not math.isnan(_si_or_nan(text, "A h")):
        raise InputError(f'--battery-Wh {text}: a charge; give the voltage as well, such as "{text.strip()}, 14.8 V"')
    most_Wh = 300.0 * ASKED.heaviest_kg  # only the best cells reach this
    if not (0 < value < most_Wh):
        raise InputError(
            f"--battery-Wh {text}: should be watt hours above zero and below {most_Wh:.0f}, such as 74,"
            ' "74 Wh" or "5000 mAh, 14.8 V"'
        )
    return value


def voltage_of(text: str) -> float | None:
    """The voltage [V] if the text gives the battery by charge and voltage; None if it gives an energy."""
    match = CHARGE_AND_VOLTAGE.fullmatch(text)
    return _si_or_nan(match["voltage"], "V") if match else None


def _share(text: str) -> float:
    text = text.strip()
    value = _number(text[:-1]) / 100 if text.endswith("%") else _number(text)
    if not 0 < value <= 1:
        raise InputError(f'--usable {text}: should be a share between 0 and 1, such as 0.8 or "80 %"')
    return value


def _number(text: str, unit: str = "") -> float:
    """A plain number, or a quantity converted to `unit`; NaN where it is neither."""
    try:
        return float(text)
    except ValueError:
        return _si_or_nan(text, unit) if unit else math.nan


def _si_or_nan(text: str, unit: str) -> float:
    try:
        return to_si(text, unit, "")
    except InputError:
        return math.nan


def parse_weight(text: str, option: str = "--weights") -> float:
    """The weight [N] from a text such as "4.1 kg" or "40 N". Raises InputError that names the option."""
    wanted = InputError(
        f"{option} {text.strip()!r}: should be masses or weights above zero and below {ASKED.heaviest_kg:.0f} kg,"
        ' such as "3.8 kg, 9.5 lbf"'
        if option == "--weights"
        else f"{option} {text.strip()!r}: should be a mass or weight above zero and below {ASKED.heaviest_kg:.0f} kg,"
        ' such as "4.1 kg"'
    )
    try:
        value = weight_to_N(text, option)
    except InputError:
        raise wanted from None
    if not 0 < value < ASKED.heaviest_kg * GRAVITY_MPS2:
        raise wanted
    return value


def _height_m(text: str) -> float:
    if not abs(_si_or_nan(text, "m")) < TROPOPAUSE_M:
        raise InputError(
            f"--density-altitudes {text.strip()!r}: should be heights below {TROPOPAUSE_M:.0f} m,"
            ' such as "0 m, 5000 ft"'
        )
    return _si_or_nan(text, "m")


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
    """Every requested weight combined with every requested density, without the flight's own condition."""
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
    payload_N = ASKED.payload_kg * GRAVITY_MPS2
    return [
        ("", flight.condition.weight_N),
        (f"{1000 * ASKED.payload_kg:.0f} g more", flight.condition.weight_N + payload_N),
        (f"{2000 * ASKED.payload_kg:.0f} g more", flight.condition.weight_N + 2 * payload_N),
    ]


def _airs(request: Request, flight: FlownCondition) -> list[tuple[str, float]]:
    """Title and density [kg/m^3]; the title of the flight's own air is empty."""
    if request.density_altitudes_m:
        return [(f"density altitude {h:.0f} m", _standard_density(h)) for h in request.density_altitudes_m]
    higher_m = float(density_altitude_m(flight.condition.rho)) + ASKED.higher_m
    return [
        ("", flight.condition.rho),
        (f"{ASKED.hotter_K:.0f} °C hotter", float(density(flight.pressure_Pa, flight.temperature_K + ASKED.hotter_K))),
        (f"{ASKED.higher_m:.0f} m higher", _standard_density(higher_m)),
    ]


def _standard_density(height_m: float) -> float:
    return float(density(pressure_at(height_m), temperature_at(height_m)))
