"""The aircraft file: a TOML file with units that states what is known about an aircraft before its flight.

`load_aircraft` takes the name of a shipped aircraft or a path. A key is the field's name without its unit:
`span = "5.73 ft"` becomes `span_m`. Only name, span, wing area and weight are required. Any other key is required only
by the code that uses it: `flight.complete_aircraft` has the classes of the simulator, which uses all keys. Where the
analysis can do without a key, the default of its field is used, and `Aircraft.has` tells whether the file has the key.
`flight.aircraft_keys` describes every key.
"""

import math
import tomllib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, TypeVar

from flightpower.flight import units
from flightpower.flight.aircraft_keys import EXAMPLES, SURFACES
from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.units import GRAVITY_MPS2, NO_KEY

Position = tuple[float, float, float]
VIBRATION_REVPS = 100.0  # motor speed [1/s] for which the accelerometers' vibration offsets are stated
LEAST_RATIO, LARGEST_RATIO = 0.9, 60.0  # aspect ratios of a disk and a glider; an area ten times too large falls below


@dataclass(frozen=True, kw_only=True)
class Geometry:
    span_m: float
    chord_m: float | None = None  # mean aerodynamic chord
    wing_area_m2: float

    @property
    def mean_chord_m(self) -> float:
        """The mean aerodynamic chord, or the mean geometric one (area over span) where the file does not have it."""
        return self.wing_area_m2 / self.span_m if self.chord_m is None else self.chord_m


@dataclass(frozen=True, kw_only=True)
class Mass:
    weight_N: float
    standard_weight_N: float  # W_s of PIW and VIW (2.3); equals the weight if the file does not state it
    Ix_kgm2: float | None = None
    Iy_kgm2: float | None = None
    Iz_kgm2: float | None = None
    Ixz_kgm2: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Propulsion:
    """Propeller on a brushless motor with speed controller and battery."""

    propeller: str | None = None  # name of a shipped table, or path of a file
    propeller_inertia_kgm2: float | None = None
    max_rpm: float | None = None
    pole_pairs: int | None = None
    motor_kv_rpm_per_volt: float | None = None
    motor_resistance_ohm: float | None = None
    motor_no_load_current_A: float | None = None
    battery_voltage_V: float | None = None
    battery_resistance_ohm: float | None = None
    battery_energy_Wh: float | None = None
    throttle_channel: int = 3
    beyond_zero_thrust: str = "windmill"  # behavior of the propeller at negative thrust; the alternative is "fold"
    static_thrust_ratio: float | None = None  # static thrust measured on a stand, divided by the table's static thrust


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
    """Installation of the five-port probe: position of its tip, upwash there, bending of its boom, pneumatic lines.

    The defaults are those of a probe on the nose of a small aircraft; `analysis.methods.assumed_values` has their
    standard deviations.
    """

    position_m: Position = (0.3, 0.0, 0.0)  # from the center of gravity, body axes
    upwash_per_CL_rad: float = 0.017453292519943295  # (alpha at the probe - alpha of the aircraft) / CL; 1 deg
    boom_bending_rad: float = 0.0  # downward bending per g of load factor; `calibrate boom` measures it
    lines: dict[str, PneumaticLine] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Uncertainty:
    """Standard deviations of quantities that the data alone do not determine: priors, which the user may change.

    weight_fraction : a scale with divisions of 5 g may be wrong by two divisions at 4 kg (OIML R 76-1, class III in
        service)
    updraft_mps : mean vertical motion of the air over the runs of one flight; by default before sunrise on a plain, in
        up to 5 m/s of wind, in twenty minutes. If the file does not state it, the analysis of a flight derives it from
        duration, hour, sun and wind (`analysis.trajectory.updraft`)
    air_density_fraction : uniform errors of up to 1.5 hPa and 0.8 K: absolute accuracy of the MS5611 at 25 degC (data
        sheet)
    gust_length : scale length of vertical gusts divided by the height. The standard's ratio is 1 (MIL-F-8785C); that of
        convection is 1.4 at 40 m under an inversion at 1 km, 0.28 sqrt(z z_i) (Lenschow & Stankov 1986, J. Atmos. Sci.
        43)
    transducer_zero_Pa : change of a differential pressure transducer's zero between rest and flight; half of its
        variance arises in mid-flight
    hysteresis_fraction : hysteresis of the differential pressure transducers, divided by the range of pressure in the
        flight

    The flight partly determines the following errors; it adds information to these priors:
    angle_of_attack_offset_rad : a probe that is aligned by eye
    angle_of_attack_slope_fraction : uniform within 5 %, for probes made to one drawing in a flow other than the
        tunnel's
    airspeed_scale_fraction : uniform within 2 % of airspeed, or 4 % of dynamic pressure; from transducer and static
        ports
    air_data_lag_s : tubes with a lag of up to 20 ms, and the lag that filters add
    accelerometer_offset_mps2 : of each axis; uniform within 0.3 m/s^2 (30 mg), plus 0.5 deg of misalignment under 1 g
    accelerometer_vibration_mps2 : of the forward and of the downward axis at a motor speed of 100 rev/s; it grows with
        the square of the speed, as the force of an imbalance does. 2 mg, assumed: data sheets of cheap accelerometers
        do not state how vibration shifts their zero (the effect: Analog Devices, Vibration Rectification in MEMS
        Accelerometers)
    accelerometer_scale_fraction : of each axis; the MPU-9250's data sheet (PS-MPU-9250A-01, table 2) allows 3 % at most
    boom_bending_rad : angle by which the probe's boom bends down under each g: m g l^2/(2 E I) of a carbon tube of
        10 mm, walls of 1 mm, 0.3 m long with 30 g at its end is 0.026 deg
    airspeed_per_lift_fraction : relative error of airspeed per unit of lift coefficient, caused by static ports in the
        flow about wing and fuselage. 0.1 %, assumed, for a probe far ahead of the wing
    thrust_scale_fraction : of the propeller's table; uniform within 3 %, for repetitions in one tunnel. Tables from
        different tunnels differ by 5 % or more (Brandt & Selig, AIAA 2011-1255)
    thrust_slope : change of the ratio of true thrust to the table's thrust per unit of advance ratio; uniform within
        0.25
    static_thrust_ratio_fraction : error of `Propulsion.static_thrust_ratio`, which `calibrate thrust` measures; by
        default the scale error of a load cell
    thrust_curvature_fraction : departure of the static thrust ratio from the straight line over advance ratio by which
        thrust is corrected in flight. Tables of an APC 10x5E at two of the speeds 5000, 6010 and 6710 rpm (UIUC
        Propeller Database): their ratios at rest are 0.8, 2.3 and 3.1 % off the straight line through J = 0.2 to 0.55
    """

    weight_fraction: float = 0.002
    updraft_mps: float = 0.004
    air_density_fraction: float = 0.002
    gust_length: float = 1.4
    transducer_zero_Pa: float = 0.0
    hysteresis_fraction: float = 0.0
    angle_of_attack_offset_rad: float = math.radians(1.0)
    angle_of_attack_slope_fraction: float = 0.03
    airspeed_scale_fraction: float = 0.0125
    air_data_lag_s: float = 0.012
    accelerometer_offset_mps2: float = 0.19
    accelerometer_vibration_mps2: float = 0.02
    accelerometer_scale_fraction: float = 0.01
    boom_bending_rad: float = math.radians(0.03)
    airspeed_per_lift_fraction: float = 0.001
    thrust_scale_fraction: float = 0.018
    thrust_slope: float = 0.15
    static_thrust_ratio_fraction: float = 0.01
    thrust_curvature_fraction: float = 0.03


@dataclass(frozen=True, kw_only=True)
class Installation:
    """An installation of probe, tubes and tray. Flights with the same installation name were made without moving any of
    these.

    accelerometer_offset_mps2, accelerometer_scale_fraction : the accelerometers' readings at zero force, and the
        fraction by which they read high, along the axes forward, right and down. `calibrate imu` measures both

    accelerometer_vibration_mps2 : the increase of the accelerometers' readings, forward, right and down, while the
        motor turns at VIBRATION_REVPS; it grows with the square of the speed. `calibrate run-up` measures it
    """

    name: str = ""
    accelerometer_offset_mps2: Position = (0.0, 0.0, 0.0)
    accelerometer_scale_fraction: Position = (0.0, 0.0, 0.0)
    accelerometer_vibration_mps2: Position = (0.0, 0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Aircraft:
    """The content of an aircraft file. keys: the keys that the file has, with their sections ("mass.Ix")."""

    name: str
    title: str
    geometry: Geometry
    mass: Mass
    propulsion: Propulsion = Propulsion()
    elevator: ControlSurface | None = None
    aileron: ControlSurface | None = None
    rudder: ControlSurface | None = None
    probe: ProbeInstallation = ProbeInstallation()
    imu_position_m: Position = (0.0, 0.0, 0.0)
    uncertainty: Uncertainty = Uncertainty()
    installation: Installation = Installation()
    source: str = ""
    aerodynamics: dict[str, object] | None = None
    text: str = field(default="", repr=False, metadata=NO_KEY)  # text of the file, as attached to the log
    keys: frozenset[str] = field(default=frozenset(), repr=False, compare=False, metadata=NO_KEY)

    @property
    def mass_kg(self) -> float:
        return self.mass.weight_N / GRAVITY_MPS2

    @property
    def wing_loading_Pa(self) -> float:
        return self.mass.weight_N / self.geometry.wing_area_m2

    @property
    def aspect_ratio(self) -> float:
        return self.geometry.span_m**2 / self.geometry.wing_area_m2

    @property
    def static_thrust_excess(self) -> tuple[float, float] | None:
        """Measured static thrust divided by the table's, minus one, and its standard deviation, which includes the
        departure from a straight line over advance ratio. None if thrust was not measured on a stand."""
        ratio, uncertainty = self.propulsion.static_thrust_ratio, self.uncertainty
        if ratio is None:
            return None
        return ratio - 1, math.hypot(
            ratio * uncertainty.static_thrust_ratio_fraction, uncertainty.thrust_curvature_fraction
        )

    def has(self, *keys: str) -> bool:
        """Whether the file has all of these keys or sections, such as "probe.upwash_per_CL"."""
        return self.keys.issuperset(keys)

    def weighing(self, weight_N: float) -> "Aircraft":
        """Return this aircraft with another weight."""
        return replace(self, mass=replace(self.mass, weight_N=weight_N))


AnyAircraft = TypeVar("AnyAircraft", bound=Aircraft)


def load_aircraft(name_or_path: str | Path) -> Aircraft:
    """Load a shipped aircraft by its name, or an aircraft from a file.

    Raises InputError, which names the file and the keys, if a key is missing or malformed, or has a wrong unit.
    """
    return parse_aircraft(*aircraft_text(name_or_path))


def shipped_aircraft() -> list[str]:
    """The names of the aircraft that come with the package."""
    shipped = resources.files("flightpower.flight") / "data" / "aircraft"
    return sorted(f.name.removesuffix(".toml") for f in shipped.iterdir() if f.name.endswith(".toml"))


def aircraft_text(name_or_path: str | Path) -> tuple[str, str]:
    """The text of an aircraft file, and the file's name in messages. Raises InputError if there is no such file."""
    shipped = resources.files("flightpower.flight") / "data" / "aircraft"
    path = Path(name_or_path)
    if path.suffix == "" and (shipped / f"{name_or_path}.toml").is_file():
        return (shipped / f"{name_or_path}.toml").read_text("utf-8"), f"{name_or_path}.toml"
    if not path.is_file():
        raise InputError(f"aircraft {name_or_path}: neither a file nor one of {', '.join(shipped_aircraft())}")
    return read_text(path), str(path)


def parse_aircraft(text: str, where: str) -> Aircraft:
    """The aircraft described by the text of a file. `where` names the file in the InputErrors that are raised."""
    return parse_as(Aircraft, text, where)


def parse_as(kind: type[AnyAircraft], text: str, where: str) -> AnyAircraft:
    """Parses an aircraft file as one of the classes of aircraft, which differ in the keys they require."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not valid TOML ({error})") from None
    keys = frozenset(_keys(table))
    aerodynamics = table.pop("aerodynamics", None)
    table.setdefault("title", table.get("name", ""))
    mass = table.get("mass", {})
    by_weight = isinstance(mass, dict) and "standard_weight" not in mass
    if by_weight:
        table["mass"] = {**mass, "standard_weight": "1 kg"}  # a placeholder until the weight is read
    read = units.read_table(kind, {**table, "aerodynamics": aerodynamics or {}}, where, EXAMPLES)
    aircraft = replace(read, text=text, keys=keys)
    if by_weight:
        aircraft = replace(aircraft, mass=replace(read.mass, standard_weight_N=read.mass.weight_N))
    problems = [*_implausible(aircraft), *_bad_surfaces(aircraft)]
    if problems:
        raise InputError(f"{where}: {'; '.join(problems)}")
    return aircraft


def _keys(table: dict[str, Any], section: str = "") -> Iterator[str]:
    for key, value in table.items():
        yield section + key
        if isinstance(value, dict):
            yield from _keys(value, f"{section}{key}.")


def _bad_surfaces(aircraft: Aircraft) -> Iterator[str]:
    for name in SURFACES:
        surface: ControlSurface | None = getattr(aircraft, name)
        if surface is None:
            continue
        rising = all(a < b for a, b in zip(surface.pulse_us, surface.pulse_us[1:], strict=False))
        if len(surface.pulse_us) != len(surface.angle_rad) or len(surface.pulse_us) < 2 or not rising:
            yield f"{name}: pulse_us must be ascending and have as many entries as angle, two or more"


def _implausible(aircraft: Aircraft) -> Iterator[str]:
    geometry, mass, propulsion = aircraft.geometry, aircraft.mass, aircraft.propulsion
    uncertainty = aircraft.uncertainty
    for key, value in (
        ("mass.weight", mass.weight_N),
        ("mass.standard_weight", mass.standard_weight_N),
        ("geometry.span", geometry.span_m),
        ("geometry.chord", geometry.chord_m),
        ("geometry.wing_area", geometry.wing_area_m2),
        ("propulsion.motor_kv_rpm_per_volt", propulsion.motor_kv_rpm_per_volt),
        ("propulsion.pole_pairs", propulsion.pole_pairs),
        ("propulsion.battery_energy", propulsion.battery_energy_Wh),
        ("propulsion.battery_voltage", propulsion.battery_voltage_V),
        ("propulsion.static_thrust_ratio", propulsion.static_thrust_ratio),
        ("uncertainty.angle_of_attack_offset", uncertainty.angle_of_attack_offset_rad),
        ("uncertainty.angle_of_attack_slope", uncertainty.angle_of_attack_slope_fraction),
        ("uncertainty.airspeed_scale", uncertainty.airspeed_scale_fraction),
        ("uncertainty.air_data_lag", uncertainty.air_data_lag_s),
        ("uncertainty.accelerometer_offset", uncertainty.accelerometer_offset_mps2),
        ("uncertainty.accelerometer_vibration", uncertainty.accelerometer_vibration_mps2),
        ("uncertainty.accelerometer_scale", uncertainty.accelerometer_scale_fraction),
        ("uncertainty.boom_bending", uncertainty.boom_bending_rad),
        ("uncertainty.thrust_scale", uncertainty.thrust_scale_fraction),
        ("uncertainty.thrust_slope", uncertainty.thrust_slope),
        ("uncertainty.static_thrust_ratio", uncertainty.static_thrust_ratio_fraction),
    ):
        if value is not None and not value > 0:
            yield f"{key}: must be greater than zero"
    if geometry.span_m > 0 and geometry.wing_area_m2 > 0 and not LEAST_RATIO < aircraft.aspect_ratio < LARGEST_RATIO:
        yield (
            f"geometry.span of {geometry.span_m:g} m and geometry.wing_area of {geometry.wing_area_m2:g} m^2 make an"
            f" aspect ratio of {aircraft.aspect_ratio:.2g}; check their units"
        )
    for key, value in (
        ("uncertainty.weight", uncertainty.weight_fraction),
        ("uncertainty.updraft", uncertainty.updraft_mps),
        ("uncertainty.air_density", uncertainty.air_density_fraction),
        ("uncertainty.transducer_zero", uncertainty.transducer_zero_Pa),
        ("uncertainty.hysteresis", uncertainty.hysteresis_fraction),
        ("uncertainty.airspeed_per_lift", uncertainty.airspeed_per_lift_fraction),
        ("uncertainty.gust_length", uncertainty.gust_length),
        ("uncertainty.thrust_curvature", uncertainty.thrust_curvature_fraction),
    ):
        if value < 0:
            yield f"{key}: must not be negative"
