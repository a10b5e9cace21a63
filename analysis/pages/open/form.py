"""The values of a flight as a form: groups and labels for keys of the aircraft file and for options of `analyze`."""

import json
import tomllib
from collections.abc import Callable, Collection, Iterator, Mapping
from typing import Any, NamedTuple, get_type_hints

import msgspec

from flightpower.analysis.options import Options
from flightpower.analysis.pages.open.request import FieldError, Json, Values
from flightpower.flight.aircraft import parse_aircraft
from flightpower.flight.aircraft_keys import KEYS, LINES
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log
from flightpower.flight.shipped_propellers import shipped_propellers

PROPELLER = "propeller"  # the field for choosing a shipped table
FIRST = "Weight, propeller, battery"
# Labels of aircraft-file keys that the analysis of a log uses; the page shows no other keys. LINE as in KEYS.
AIRCRAFT: dict[str, dict[str, str]] = {
    FIRST: {
        "mass.weight": "weight in flight",
        PROPELLER: "propeller flown",
        "propulsion.battery_energy": "battery energy",
        "geometry.span": "wing span",
        "geometry.wing_area": "wing area",
    },
    "Motor and propeller": {
        "propulsion.motor_kv_rpm_per_volt": "motor's speed constant, rpm/V",
        "propulsion.motor_resistance": "motor's resistance",
        "propulsion.motor_no_load_current": "motor's current without load",
        "propulsion.propeller_inertia": "inertia of propeller and motor",
        "propulsion.beyond_zero_thrust": "propeller below zero thrust",
        "propulsion.static_thrust_ratio": "thrust at rest over the table's",
    },
    "Probe, tubes and IMU": {
        "probe.position": "probe's tip: forward, right, down",
        "probe.upwash_per_CL": "upwash per lift coefficient",
        "probe.boom_bending": "bending of the boom per g",
        "probe.lines.LINE.length": "tube of LINE: length",
        "probe.lines.LINE.diameter": "tube of LINE: inner diameter",
        "probe.lines.LINE.cavity": "tube of LINE: volume at its end",
        "imu_position": "IMU: forward, right, down",
        "installation.accelerometer_offset": "offset of the accelerometers: forward, right, down",
        "installation.accelerometer_scale": "scale of the accelerometers: forward, right, down",
        "installation.accelerometer_vibration": "offset by vibration: forward, right, down",
    },
    "Names and the standard condition": {
        "title": "title",
        "name": "short name",
        "installation.name": "installation",
        "mass.standard_weight": "standard weight",
        "geometry.chord": "mean chord",
    },
    "Standard deviations": {
        "uncertainty.weight": "weight",
        "uncertainty.updraft": "mean updraft",
        "uncertainty.air_density": "air density",
        "uncertainty.gust_length": "length of gusts over height",
        "uncertainty.transducer_zero": "zeros of the transducers",
        "uncertainty.hysteresis": "hysteresis of the transducers",
        "uncertainty.angle_of_attack_offset": "offset of the angle of attack",
        "uncertainty.angle_of_attack_slope": "slope of the angle of attack",
        "uncertainty.airspeed_scale": "scale of the airspeed",
        "uncertainty.airspeed_per_lift": "airspeed by lift",
        "uncertainty.air_data_lag": "lag of the air data",
        "uncertainty.accelerometer_offset": "offset of the accelerometers",
        "uncertainty.accelerometer_vibration": "offset of the accelerometers by vibration",
        "uncertainty.accelerometer_scale": "scale of the accelerometers",
        "uncertainty.boom_bending": "bending of the boom",
        "uncertainty.thrust_scale": "scale of thrust",
        "uncertainty.thrust_slope": "slope of thrust",
        "uncertainty.static_thrust_ratio": "thrust at rest",
        "uncertainty.thrust_curvature": "curvature of thrust",
    },
}
LINE_NAMES = dict(
    zip(LINES, ("the angle of attack", "the sideslip", "the airspeed", "the static pressure"), strict=True)
)
# Keys that the form offers even if the file lacks them, since a value narrows the interval or gives an answer.
OFFERED = ("imu_position", "probe.position", "probe.upwash_per_CL", "propulsion.battery_energy")
OF_WHOLE_FLIGHTS = (FIRST, "Motor and propeller")  # groups used by an energy balance


class OptionField(NamedTuple):
    """A value of the form that is an option of `analyze`. field : its field in `Options`"""

    label: str
    field: str
    example: str
    meaning: str

    @property
    def unit(self) -> str:
        """The unit, which is the last word of the example."""
        return self.example.split()[-1]

    def parsed(self, text: str) -> Any:
        """Parse a value as the command does. Raises InputError."""
        parser: Callable[[str], Any] | None = (
            get_type_hints(Options, include_extras=True)[self.field].__metadata__[0].parser
        )
        return text if parser is None else parser(text)


# Fields by the name of the option, without its dashes.
OPTIONS: dict[str, OptionField] = {
    "mass": OptionField("mass in flight", "mass_kg", "9.4 kg", "Ready to fly, with battery."),
    "wing-area": OptionField("wing area", "wing_area_m2", "1.5 m^2", "Including the part inside the fuselage."),
    "span": OptionField("wing span", "span_m", "4 m", "From tip to tip."),
    "battery-Wh": OptionField(
        "battery energy, Wh", "battery_Wh", "5000 mAh, 14.8 V", "Charged; for endurance and range."
    ),
    "air-temperature": OptionField(
        "air temperature",
        "air_temperature_K",
        "20 degC",
        "In flight; default: from the log, or the standard atmosphere.",
    ),
}
NEEDED = ("mass", "wing-area", "span")  # required for an energy balance


def aircraft_form(keys: Mapping[str, Any], groups: Collection[str] = tuple(AIRCRAFT)) -> list[Json]:
    """Return the groups of fields for an aircraft file's values, by key; keys that it lacks are shown if in OFFERED."""
    sections = []
    for title in groups:
        fields = [
            _field(key, label, typed(keys.get(key, "")), _meaning(pattern))
            for pattern, named in AIRCRAFT[title].items()
            for key, label in _expanded(pattern, named)
            if key in keys or key in OFFERED or key == PROPELLER
        ]
        sections += [{"title": title, "fields": fields}] if fields else []
    return sections


def options_form() -> list[Json]:
    """Return the single group of fields for a log without an aircraft file."""
    fields = [_field(key, option.label, "", option.meaning, option.example) for key, option in OPTIONS.items()]
    return [{"title": FIRST, "fields": [*fields, _field(PROPELLER, "propeller flown", "", _meaning(PROPELLER))]}]


def _expanded(pattern: str, label: str) -> Iterator[tuple[str, str]]:
    if "LINE" not in pattern:
        yield pattern, label
        return
    for line, name in LINE_NAMES.items():
        yield pattern.replace("LINE", line), label.replace("LINE", name)


def _field(key: str, label: str, value: str, meaning: str, example: str = "") -> Json:
    return {"key": key, "label": label, "value": value, "meaning": meaning, "example": example}


def _meaning(pattern: str) -> str:
    entry = KEYS.get("propulsion.propeller" if pattern == PROPELLER else pattern)
    if entry is None:
        return ""
    return f"{entry.meaning} {entry.measure}" + (f" Without it: {entry.without}." if entry.without else "")


def pattern_of(key: str) -> str:
    """Return the entry of KEYS for a key of an aircraft file."""
    for line in LINES:
        if key.startswith(f"probe.lines.{line}."):
            return key.replace(f".{line}.", ".LINE.")
    return key


def typed(value: object) -> str:
    """Return a TOML value as a user types it: text without quotation marks, a list with commas."""
    if isinstance(value, list) and all(isinstance(part, str | int | float) for part in value):
        return ", ".join(typed(part) for part in value)
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)


def as_toml(key: str, text: str) -> str:
    """Return typed text as a TOML value: a list if the key has one; numbers, true and false unquoted, else text."""
    if _is_list(key) and not text.lstrip().startswith("["):
        parts = text.split(";" if ";" in text else ",")
        return f"[{', '.join(_parsed_value(part.strip()) for part in parts)}]"
    return _parsed_value(text)


def _parsed_value(text: str) -> str:
    try:
        value = tomllib.loads(f"value = {text}")
        if len(value) == 1 and isinstance(value["value"], bool | int | float | list):
            return json.dumps(value["value"], ensure_ascii=False)
    except (tomllib.TOMLDecodeError, ValueError):
        pass
    return json.dumps(text, ensure_ascii=False)


def _is_list(key: str) -> bool:
    entry = KEYS.get(pattern_of(key))
    return entry is not None and isinstance(tomllib.loads(f"value = {entry.example}")["value"], list)


def option_values(texts: Mapping[str, str]) -> Json:
    """Return fields of `Options` from typed text by key. Raises FieldError for a value that cannot be used."""
    values: Json = {}
    for key, text in texts.items():
        if key not in OPTIONS:
            raise InputError(f"{key[:60]!r}: not a value of the form")
        if not text.strip():
            continue
        option = OPTIONS[key]
        try:
            values[option.field] = option.parsed(text)
            Options(**{option.field: values[option.field]})
        except InputError as error:
            raise FieldError(str(error), key) from None
    return values


def shipped(propeller: str) -> bool:
    """Whether a propeller was chosen. Raises FieldError for a propeller that is not shipped."""
    if propeller and propeller not in shipped_propellers():
        raise FieldError(f"propeller {propeller[:60]!r}: none that `flightpower propellers` lists", PROPELLER)
    return bool(propeller)


def aircraft_keys(log: Log) -> Json:
    """Return keys and values of the log's aircraft file; empty if it has none. Raises InputError."""
    text = log.attachments.get("aircraft.toml", b"").decode("utf-8", errors="replace")
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{log.path}: aircraft.toml: not valid TOML ({error})") from None
    return dict(_leaves(table))


def aircraft_text(recorded_keys: Json, values: Values, log: str) -> str:
    """Return the aircraft file with the values of the page. Raises InputError for an unknown key."""
    unknown = [key for key in values.aircraft if key not in {*recorded_keys, *OFFERED}]
    if unknown:
        raise InputError(f"{unknown[0][:60]!r}: no such key in the aircraft file of {log}")
    lines = {key: json.dumps(value, ensure_ascii=False) for key, value in recorded_keys.items()}
    lines |= {key: as_toml(key, text) if text.strip() else "" for key, text in values.aircraft.items()}
    return "".join(f"{key} = {value}\n" for key, value in lines.items() if value)


def check_fields(recorded_keys: Json, values: Values, log: str) -> None:
    """Raise FieldError for a changed value of the aircraft file that is unusable even without the other changes."""
    for key, text in values.aircraft.items():
        alone = msgspec.structs.replace(values, aircraft={key: text})
        try:
            parse_aircraft(aircraft_text(recorded_keys, alone, log), "aircraft file")
        except InputError as error:
            raise FieldError(str(error), key) from None


def _leaves(table: Json, section: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, f"{section}{key}.")
        else:
            yield section + key, value
