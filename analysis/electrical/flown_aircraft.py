"""What the electrical power curve needs to know of an aircraft."""

from dataclasses import dataclass

from flight.aircraft import Aircraft
from flight.errors import InputError
from flight.units import GRAVITY_MPS2, to_si, weight_to_N

HEAVIEST_KG, LARGEST_M2, LARGEST_M = 1000.0, 200.0, 100.0
LEAST_ASPECT_RATIO, GREATEST_ASPECT_RATIO = 0.5, 60.0


@dataclass(frozen=True)
class FlownAircraft:
    name: str
    weight_N: float
    wing_area_m2: float
    span_m: float


def flown_aircraft(
    aircraft: Aircraft | None, mass: str | None, wing_area: str | None, span: str | None, log: str
) -> FlownAircraft:
    """From an aircraft file, or from options such as "9.4 kg", "1.5 m^2", "4 m", which replace the file's values.

    Raises InputError, in one line, when a value is missing, malformed or impossible.
    """
    given = {
        "weight_N": None if mass is None else _weight_N(mass),
        "wing_area_m2": None if wing_area is None else _size(wing_area, "m^2", "--wing-area", LARGEST_M2),
        "span_m": None if span is None else _size(span, "m", "--span", LARGEST_M),
    }
    values = {name: value for name, value in given.items() if value is not None}
    if aircraft is None:
        if len(values) < len(given):
            raise InputError(
                f"{log}: a log of an autopilot has no aircraft file in it; give"
                ' --mass "9.4 kg" --wing-area "1.5 m^2" --span "4 m" of your aircraft, or --aircraft FILE'
            )
        flown = FlownAircraft(name="Aircraft", **values)
    else:
        geometry = aircraft.geometry
        in_file = {"weight_N": aircraft.mass.weight_N, "wing_area_m2": geometry.wing_area_m2, "span_m": geometry.span_m}
        flown = FlownAircraft(name=aircraft.title, **(in_file | values))
    aspect_ratio = flown.span_m**2 / flown.wing_area_m2
    if not LEAST_ASPECT_RATIO < aspect_ratio < GREATEST_ASPECT_RATIO:
        raise InputError(
            f"span {flown.span_m:g} m and wing area {flown.wing_area_m2:g} m^2 make an aspect ratio of"
            f" {aspect_ratio:.2g}, which no aircraft has; check both"
        )
    return flown


def _weight_N(text: str) -> float:
    weight = weight_to_N(text, "--mass")
    if not 0 < weight < HEAVIEST_KG * GRAVITY_MPS2:
        raise InputError(f'--mass {text!r}: should be above zero and below {HEAVIEST_KG:.0f} kg, such as "9.4 kg"')
    return weight


def _size(text: str, unit: str, option: str, largest: float) -> float:
    value = to_si(text, unit, option)
    if not 0 < value < largest:
        raise InputError(f"{option} {text!r}: should be above zero and below {largest:g} {unit}")
    return value
