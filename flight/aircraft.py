"""The aircraft file: what is known of an aircraft before its flight, in TOML with units.

`load_aircraft` takes the name of a shipped aircraft or a path. A key is the field's name without its unit:
`span = "5.73 ft"` becomes `span_m`. Only the simulator reads the section [aerodynamics]; the file of a real aircraft
does not need it, and the analysis does not use it.
"""

import tomllib
from bisect import bisect_right
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

from flight import units
from flight.errors import InputError
from flight.units import GRAVITY_MPS2

Position = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Geometry:
    span_m: float
    chord_m: float  # mean aerodynamic chord
    wing_area_m2: float


@dataclass(frozen=True, kw_only=True)
class Mass:
    weight_N: float
    standard_weight_N: float  # W_s of PIW and VIW (2.3)
    Ix_kgm2: float
    Iy_kgm2: float
    Iz_kgm2: float
    Ixz_kgm2: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Propulsion:
    """Propeller on a brushless motor with speed controller and battery."""

    propeller: str  # name of a shipped table, or a file
    propeller_inertia_kgm2: float
    max_rpm: float
    pole_pairs: int
    motor_kv_rpm_per_volt: float
    motor_resistance_ohm: float
    motor_no_load_current_A: float
    battery_voltage_V: float
    battery_resistance_ohm: float
    battery_energy_Wh: float
    throttle_channel: int = 3
    beyond_zero_thrust: str = "windmill"  # or "fold": behaviour of the propeller at negative thrust


@dataclass(frozen=True, kw_only=True)
class ControlSurface:
    """A control surface: its servo channel and the measured table from pulse width to angle.

    rate_radps and lag_s describe the servo in the simulator.
    """

    channel: int
    pulse_us: tuple[float, ...]  # ascending
    angle_rad: tuple[float, ...]
    rate_radps: float = 5.0
    lag_s: float = 0.02

    def angle_of_pulse_rad(self, pulse_us: float) -> float:
        """Surface angle [rad] at a pulse width [us]: linear interpolation, constant beyond the ends of the table."""
        return _interpolate(pulse_us, self.pulse_us, self.angle_rad)

    def pulse_of_angle_us(self, angle_rad: float) -> float:
        """Pulse width [us] at a surface angle [rad]; the inverse of `angle_of_pulse_rad`."""
        if self.angle_rad[0] > self.angle_rad[-1]:
            return _interpolate(angle_rad, self.angle_rad[::-1], self.pulse_us[::-1])
        return _interpolate(angle_rad, self.angle_rad, self.pulse_us)


def _interpolate(x: float, xs: tuple[float, ...], ys: tuple[float, ...]) -> float:
    if x <= xs[0]:
        return ys[0]
    if x >= xs[-1]:
        return ys[-1]
    i = bisect_right(xs, x)
    return ys[i - 1] + (x - xs[i - 1]) * (ys[i] - ys[i - 1]) / (xs[i] - xs[i - 1])


@dataclass(frozen=True, kw_only=True)
class PneumaticLine:
    """One pneumatic line of the probe: the tube and the cavity of the transducer at its end."""

    length_m: float
    diameter_m: float
    cavity_m3: float


@dataclass(frozen=True, kw_only=True)
class ProbeInstallation:
    """Installation of the five-port probe: position of its tip, upwash there, and its pneumatic lines."""

    position_m: Position  # from the centre of gravity, body axes
    upwash_per_CL_rad: float = 0.0  # (alpha at the probe - alpha of the aircraft) / CL
    lines: dict[str, PneumaticLine] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Aircraft:
    name: str
    title: str
    geometry: Geometry
    mass: Mass
    propulsion: Propulsion
    elevator: ControlSurface
    aileron: ControlSurface
    rudder: ControlSurface
    probe: ProbeInstallation
    imu_position_m: Position = (0.0, 0.0, 0.0)
    source: str = ""
    aerodynamics: dict[str, object] | None = None
    text: str = field(default="", repr=False)  # text of the file, which the log contains

    @property
    def mass_kg(self) -> float:
        return self.mass.weight_N / GRAVITY_MPS2

    @property
    def aspect_ratio(self) -> float:
        return self.geometry.span_m**2 / self.geometry.wing_area_m2


def load_aircraft(name_or_path: str | Path) -> Aircraft:
    """An aircraft shipped with the package, by its name, or one from a file.

    Raises InputError, which names file and key, when something is missing, malformed, or has a wrong unit.
    """
    shipped = resources.files("flight") / "data" / "aircraft"
    path = Path(name_or_path)
    if path.suffix == "" and (shipped / f"{name_or_path}.toml").is_file():
        return parse_aircraft((shipped / f"{name_or_path}.toml").read_text("utf-8"), f"{name_or_path}.toml")
    if not path.is_file():
        names = sorted(f.name.removesuffix(".toml") for f in shipped.iterdir() if f.name.endswith(".toml"))
        raise InputError(f"aircraft {name_or_path}: neither a file nor one of {', '.join(names)}")
    try:
        text = path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    return parse_aircraft(text, str(path))


def parse_aircraft(text: str, where: str) -> Aircraft:
    """The aircraft described by the text of a file. `where` names the file in the InputErrors that are raised."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not valid TOML ({error})") from None
    aerodynamics = table.pop("aerodynamics", None)
    aircraft = units.read_table(Aircraft, {**table, "aerodynamics": aerodynamics or {}, "text": text}, where)
    for name in ("elevator", "aileron", "rudder"):
        surface: ControlSurface = getattr(aircraft, name)
        rising = all(a < b for a, b in zip(surface.pulse_us, surface.pulse_us[1:], strict=False))
        if len(surface.pulse_us) != len(surface.angle_rad) or len(surface.pulse_us) < 2 or not rising:
            raise InputError(
                f"{where}: {name}: pulse_us must be ascending and have as many entries as angle, two or more"
            )
    for key, value in (
        ("mass.weight", aircraft.mass.weight_N),
        ("mass.standard_weight", aircraft.mass.standard_weight_N),
        ("geometry.span", aircraft.geometry.span_m),
        ("geometry.chord", aircraft.geometry.chord_m),
        ("geometry.wing_area", aircraft.geometry.wing_area_m2),
    ):
        if value <= 0:
            raise InputError(f"{where}: {key}: must be greater than zero")
    return aircraft
