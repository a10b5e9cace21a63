"""The request from the command line: battery, weights, density altitudes; checked before anything is computed."""

import math
import re
from dataclasses import dataclass

from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.units import GRAVITY_MPS2, to_si, weight_to_N

USABLE = 0.8  # of a battery's energy: common for lithium polymer
HEAVIEST_KG = 1000.0  # far above any small aircraft
HIGHEST_M = 11_000.0  # the standard troposphere
CHARGE_AND_VOLTAGE = re.compile(r"(?P<charge>.*[hHC])\s*(?:,|at|@|[xX×*])?\s*(?P<voltage>[\d.]+\s*V)\s*")


@dataclass(frozen=True)
class Request:
    """Battery energy [Wh] (None: the aircraft file's), its usable share, and the conditions to compute.

    Empty weights or density altitudes: those of the flight, and some around them.
    """

    battery_Wh: float | None = None
    usable: float = USABLE
    weights_N: tuple[float, ...] = ()
    density_altitudes_m: tuple[float, ...] = ()

    def battery_energy_Wh(self, aircraft: Aircraft) -> float | None:
        """Of this request, or else of the aircraft file. None where neither gives it."""
        return aircraft.propulsion.battery_energy_Wh if self.battery_Wh is None else self.battery_Wh

    def notes(self, aircraft: Aircraft) -> list[str]:
        """A sentence where the battery's energy is not known."""
        if self.battery_energy_Wh(aircraft) is not None:
            return []
        return [
            "No endurance, range or climb: the aircraft file lacks propulsion.battery_energy, such as"
            ' battery_energy = "74 W h"; or give --battery-Wh.'
        ]


def parse_request(
    battery_Wh: str | None = None,
    usable: str | None = None,
    weights: str | None = None,
    density_altitudes: str | None = None,
) -> Request:
    """Request from the options' text: "74 Wh" or "5000 mAh, 14.8 V", "80 %", "3.8 kg, 4.1 kg", "0 m, 5000 ft".

    Plain numbers are watt hours, and a share between 0 and 1.

    Raises InputError naming the option and what it should be.
    """
    return Request(
        battery_Wh=None if battery_Wh is None else _battery_Wh(battery_Wh),
        usable=USABLE if usable is None else _share(usable),
        weights_N=() if weights is None else tuple(parse_weight(text) for text in weights.split(",")),
        density_altitudes_m=()
        if density_altitudes is None
        else tuple(_height_m(text) for text in density_altitudes.split(",")),
    )


def _battery_Wh(text: str) -> float:
    """Energy [Wh] of "74", "74 Wh", or of charge and voltage as printed on a battery: "5000 mAh, 14.8 V"."""
    found = CHARGE_AND_VOLTAGE.fullmatch(text)
    value = _si_or_nan(found["charge"], "A h") * _si_or_nan(found["voltage"], "V") if found else _number(text, "W h")
    if math.isnan(value) and not math.isnan(_si_or_nan(text, "A h")):
        raise InputError(f'--battery-Wh {text}: a charge; give the voltage as well, such as "{text.strip()}, 14.8 V"')
    if not (0 < value < math.inf):
        raise InputError(
            f'--battery-Wh {text}: should be watt hours above zero, such as 74, "74 Wh" or "5000 mAh, 14.8 V"'
        )
    return value


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
    """The weight [N] of a text such as "4.1 kg" or "40 N". Raises InputError naming the option."""
    wanted = InputError(
        f"{option} {text.strip()!r}: should be masses or weights above zero and below {HEAVIEST_KG:.0f} kg,"
        ' such as "3.8 kg, 9.5 lbf"'
        if option == "--weights"
        else f"{option} {text.strip()!r}: should be a mass or weight above zero and below {HEAVIEST_KG:.0f} kg,"
        ' such as "4.1 kg"'
    )
    try:
        value = weight_to_N(text, option)
    except InputError:
        raise wanted from None
    if not 0 < value < HEAVIEST_KG * GRAVITY_MPS2:
        raise wanted
    return value


def _height_m(text: str) -> float:
    if not abs(_si_or_nan(text, "m")) < HIGHEST_M:
        raise InputError(
            f'--density-altitudes {text.strip()!r}: should be heights below {HIGHEST_M:.0f} m, such as "0 m, 5000 ft"'
        )
    return _si_or_nan(text, "m")
