"""Completes a short aircraft file for the simulator: missing values are scaled from a shipped model."""

from dataclasses import fields, replace
from math import pi
from typing import Any, TypeVar

from flightpower.flight.aerodynamics import aerodynamics_of
from flightpower.flight.aircraft import Aircraft, parse_aircraft
from flightpower.flight.aircraft_keys import SURFACES
from flightpower.flight.complete_aircraft import (
    CompleteAircraft,
    CompleteGeometry,
    CompleteMass,
)
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.units import split_unit

Section = TypeVar("Section")


def scaled_from(text: str, where: str, model: CompleteAircraft) -> CompleteAircraft:
    """The aircraft of a file's text; every key that the file lacks is scaled from a model by span, weight and
    propeller.

    Lengths grow with the span, moments of inertia with weight times span squared. Aerodynamic coefficients, angles of
    surfaces and battery voltage are those of the model, but the induced drag K = 1/(pi e AR) has the file's aspect
    ratio and the model's e. The motor turns fast enough to give at least the model's ratio of thrust to weight, n^2 D^4
    / W, and its ratio of the speed of zero thrust to the stalling speed, n D J / sqrt(W/S). Its currents and the
    battery's energy grow in proportion to the propeller's power, n^3 D^5, and its resistances fall in proportion. The
    aircraft's text, which is attached to the log, lists in comments which keys are scaled. `where` names the file in
    the InputErrors that are raised.
    """
    own = parse_aircraft(text, where)
    scaled = _scaled(own, model)
    taken: list[str] = []

    def filled(section: str, defaults: Section) -> Section:
        """The section of the scaled model, overridden by the file's own values."""
        settings = {f.name: getattr(getattr(own, section), f.name) for f in fields(defaults)}  # type: ignore[arg-type]
        keys = {name: f"{section}.{split_unit(name)[0]}" for name in settings}
        taken.extend(
            key for name, key in keys.items() if not own.has(key) and settings[name] != getattr(defaults, name)
        )
        return replace(defaults, **{name: value for name, value in settings.items() if own.has(keys[name])})  # type: ignore[type-var]

    aerodynamics = {**(scaled.aerodynamics or {}), **(own.aerodynamics or {})}
    surfaces: dict[str, Any] = {name: getattr(own, name) or getattr(model, name) for name in SURFACES}
    taken += [name for name in SURFACES if getattr(own, name) is None or not own.has(name)]
    taken += [f"aerodynamics.{name}" for name in aerodynamics if name not in (own.aerodynamics or {})]
    values = {f.name: getattr(own, f.name) for f in fields(Aircraft)}
    values |= surfaces | {
        "geometry": filled("geometry", scaled.geometry),
        "mass": filled("mass", scaled.mass),
        "propulsion": filled("propulsion", scaled.propulsion),
        "probe": filled("probe", scaled.probe),
        "aerodynamics": aerodynamics,
    }
    scaled_text = f"{text.rstrip()}\n\n# Simulated like {model.name}; scaled from it by span, weight and propeller:\n"
    scaled_text += "".join(f"#   {key}\n" for key in sorted(set(taken)))
    if "aerodynamics.K" in taken:
        K, e = aerodynamics_of(scaled).K, oswald_factor(model)
        scaled_text += (
            f"# Induced drag K = {K:.4f}: 1/(pi e AR), AR {own.aspect_ratio:.2f}, e {e:.3f} of {model.name}.\n"
        )
    return CompleteAircraft(**values | {"text": scaled_text})


def oswald_factor(aircraft: CompleteAircraft) -> float:
    """The factor e of the induced drag C_L^2/(pi e AR) of an aircraft in the simulator."""
    return 1 / (pi * aerodynamics_of(aircraft).K * aircraft.aspect_ratio)


def _scaled(own: Aircraft, model: CompleteAircraft) -> CompleteAircraft:
    """The model scaled to the size of another aircraft."""
    length, weight = own.geometry.span_m / model.geometry.span_m, own.mass.weight_N / model.mass.weight_N
    area = own.geometry.wing_area_m2 / model.geometry.wing_area_m2
    table, of_model = (load_propeller(p or "") for p in (_propeller(own, model), model.propulsion.propeller))
    diameter = table.diameter_m / of_model.diameter_m
    pitch = max(row.J[-1] for row in table.rows) / max(row.J[-1] for row in of_model.rows)
    speed = max((weight / diameter**4) ** 0.5, (weight / area) ** 0.5 / (diameter * pitch))
    power = speed**3 * diameter**5
    m, p, (x, y, z) = model.mass, model.propulsion, model.probe.position_m
    return replace(
        model,
        geometry=CompleteGeometry(
            span_m=own.geometry.span_m,
            wing_area_m2=own.geometry.wing_area_m2,
            chord_m=model.geometry.chord_m * area / length,
        ),
        aerodynamics={
            **(model.aerodynamics or {}),
            "K": aerodynamics_of(model).K * model.aspect_ratio / own.aspect_ratio,
        },
        mass=CompleteMass(
            weight_N=own.mass.weight_N,
            standard_weight_N=own.mass.standard_weight_N,
            Ix_kgm2=m.Ix_kgm2 * weight * length**2,
            Iy_kgm2=m.Iy_kgm2 * weight * length**2,
            Iz_kgm2=m.Iz_kgm2 * weight * length**2,
            Ixz_kgm2=m.Ixz_kgm2 * weight * length**2,
        ),
        propulsion=replace(
            p,
            propeller=_propeller(own, model),
            propeller_inertia_kgm2=p.propeller_inertia_kgm2 * diameter**5,
            max_rpm=p.max_rpm * speed,
            motor_kv_rpm_per_volt=p.motor_kv_rpm_per_volt * speed,
            motor_resistance_ohm=p.motor_resistance_ohm / power,
            motor_no_load_current_A=p.motor_no_load_current_A * power,
            battery_resistance_ohm=p.battery_resistance_ohm / power,
            battery_energy_Wh=p.battery_energy_Wh * power,
        ),
        probe=replace(model.probe, position_m=(length * x, length * y, length * z)),
    )


def _propeller(own: Aircraft, model: CompleteAircraft) -> str:
    return own.propulsion.propeller or model.propulsion.propeller


def with_installation(aircraft: CompleteAircraft, name: str) -> CompleteAircraft:
    """The aircraft with this installation name added to its file. Raises InputError if the file has another name."""
    present = aircraft.installation.name
    if present == name:
        return aircraft
    if aircraft.has("installation.name"):
        raise InputError(f'--installation {name}: the aircraft file has installation name = "{present}"')
    section, line = "[installation]\n", f'name = "{name}"\n'
    if aircraft.has("installation"):
        text = aircraft.text.replace(section, section + line, 1)
    else:
        text = f"{aircraft.text.rstrip()}\n\n{section}{line}"
    keys = aircraft.keys | {"installation", "installation.name"}
    return replace(aircraft, installation=replace(aircraft.installation, name=name), text=text, keys=keys)
