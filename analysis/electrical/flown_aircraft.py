"""What the electrical power curve needs to know of an aircraft."""

from dataclasses import dataclass

from flight.aircraft import Aircraft
from flight.errors import InputError

LEAST_ASPECT_RATIO, GREATEST_ASPECT_RATIO = 0.5, 60.0


@dataclass(frozen=True)
class FlownAircraft:
    name: str
    weight_N: float
    wing_area_m2: float
    span_m: float


def flown_aircraft(
    aircraft: Aircraft | None, weight_N: float | None, wing_area_m2: float | None, span_m: float | None, log: str
) -> FlownAircraft:
    """From an aircraft file, with values that are not None instead of the file's.

    Raises InputError, in one line, when a value is missing or the aspect ratio impossible.
    """
    given = {"weight_N": weight_N, "wing_area_m2": wing_area_m2, "span_m": span_m}
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
