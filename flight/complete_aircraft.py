"""The aircraft file with every key that the simulator requires.

The classes are those of `flight.aircraft`, but here keys that the analysis can do without are required: `field()`
removes the default that a field inherits.
"""

import re
from dataclasses import dataclass, field
from pathlib import Path

from flightpower.flight.aircraft import (
    Aircraft,
    ControlSurface,
    Geometry,
    Mass,
    PneumaticLine,
    Position,
    ProbeInstallation,
    Propulsion,
    aircraft_text,
    parse_aircraft,
    parse_as,
)
from flightpower.flight.errors import InputError


@dataclass(frozen=True, kw_only=True)
class CompleteGeometry(Geometry):
    chord_m: float = field()


@dataclass(frozen=True, kw_only=True)
class CompleteMass(Mass):
    Ix_kgm2: float = field()
    Iy_kgm2: float = field()
    Iz_kgm2: float = field()


@dataclass(frozen=True, kw_only=True)
class CompletePropulsion(Propulsion):
    propeller: str = field()
    propeller_inertia_kgm2: float = field()
    max_rpm: float = field()
    pole_pairs: int = field()
    motor_kv_rpm_per_volt: float = field()
    motor_resistance_ohm: float = field()
    motor_no_load_current_A: float = field()
    battery_voltage_V: float = field()
    battery_resistance_ohm: float = field()
    battery_energy_Wh: float = field()


@dataclass(frozen=True, kw_only=True)
class CompleteProbe(ProbeInstallation):
    position_m: Position = field()
    upwash_per_CL_rad: float = 0.0
    lines: dict[str, PneumaticLine] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CompleteAircraft(Aircraft):
    geometry: CompleteGeometry = field()
    mass: CompleteMass = field()
    propulsion: CompletePropulsion = field()
    elevator: ControlSurface = field()
    aileron: ControlSurface = field()
    rudder: ControlSurface = field()
    probe: CompleteProbe = field()


def load_complete_aircraft(name_or_path: str | Path) -> CompleteAircraft:
    """An aircraft that can be flown in the simulator, shipped or from a file.

    Raises InputError naming every key that is missing or wrong.
    """
    return as_complete(*aircraft_text(name_or_path))


def as_complete(text: str, where: str) -> CompleteAircraft:
    """Parses a complete aircraft from text. `where` names the file in an InputError."""
    parse_aircraft(text, where)  # reports errors that do not depend on the simulator first
    try:
        return parse_as(CompleteAircraft, text, where)
    except InputError as error:
        missing = ", ".join(re.findall(r"(\S+) is missing", str(error)))
        raise InputError(
            f"{where}: the simulator also needs {missing}; `sim fly --like nexstar` scales them from another aircraft,"
            " and `flightpower new aircraft --like nexstar` writes a file with every key"
        ) from None
