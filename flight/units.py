"""Converts quantities with units in files (`span = "5.73 ft"`) to numbers in SI units (`span_m`).

The name of a field ends with its unit: `static_pressure_Pa`. `read_table` converts to the unit in the name. pint knows
the units, and this module knows how fields are named. The units that aircraft files use most are converted without
pint: its import takes a third of a second, and several seconds on a small Raspberry Pi before the recording can begin.
"""

import dataclasses
import enum
import math
import re
import types
import typing
from collections.abc import Mapping
from functools import lru_cache
from typing import Any, TypeVar

from flightpower.flight.errors import InputError

# Constants of the standard atmosphere (ICAO Doc 7488/3); they are here because the daemon uses them without NumPy.
GRAVITY_MPS2 = 9.80665  # standard gravity
GAS_CONSTANT_AIR = 287.05287  # specific gas constant, J/(kg K)
SEA_LEVEL_PRESSURE_PA = 101325.0
SEA_LEVEL_TEMPERATURE_K = 288.15
SEA_LEVEL_DENSITY = SEA_LEVEL_PRESSURE_PA / (GAS_CONSTANT_AIR * SEA_LEVEL_TEMPERATURE_K)  # 1.225 kg/m^3
LAPSE_RATE = 0.0065  # lapse rate of the troposphere, K/m
TROPOPAUSE_M = 11_000.0

DAY_S = 86_400.0
EARTH_RADIUS_M = 6_371_000.0  # mean radius

FOOT_M = 0.3048
KNOT_MPS = 1852 / 3600

UNIT_OF_SUFFIX = {
    "m": "m",
    "m2": "m^2",
    "m3": "m^3",
    "N": "N",
    "kg": "kg",
    "kgm2": "kg m^2",
    "rad": "rad",
    "radps": "rad/s",
    "mps": "m/s",
    "mps2": "m/s^2",
    "s": "s",
    "Hz": "Hz",
    "Pa": "Pa",
    "K": "K",
    "V": "V",
    "A": "A",
    "ohm": "ohm",
    "Wh": "W h",
    "Nm": "N m",
    "T": "T",
    "revps": "turn/s",
    "fraction": "dimensionless",
}


def number_or_nan(value: Any) -> float:
    """A number, or a text that holds a number, as a float; NaN for anything else."""
    try:
        return float(value)
    except (TypeError, ValueError, OverflowError):
        return math.nan


# The SI unit of each of these units, and the exact factor to it.
COMMON_UNITS: Mapping[str, tuple[str, float]] = types.MappingProxyType(
    {
        **{unit: (unit, 1.0) for unit in UNIT_OF_SUFFIX.values() if unit not in ("K", "dimensionless")},
        "deg": ("rad", math.pi / 180),
        "ft": ("m", 0.3048),
        **dict.fromkeys(("ft^2", "ft2", "sqft"), ("m^2", 0.3048**2)),
        "m2": ("m^2", 1.0),
        "ft/s^2": ("m/s^2", 0.3048),
        "mm": ("m", 1e-3),
        "cm": ("m", 1e-2),
        "mm^3": ("m^3", 1e-9),
        "ms": ("s", 1e-3),
        "lbf": ("N", 0.45359237 * GRAVITY_MPS2),
        "lb": ("kg", 0.45359237),
        "g": ("kg", 1e-3),
        "%": ("dimensionless", 1e-2),
    }
)

NUMBER_AND_UNIT = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)", re.DOTALL)
FEET_AND_INCHES = re.compile(r"(\d[\d.]*\s*[a-z]+)\s+(\d[\d.]*\s*[a-z]+)")  # also matches pounds and ounces
NO_EXAMPLES: Mapping[str, str] = types.MappingProxyType({})

NO_KEY: Mapping[str, bool] = types.MappingProxyType({"key": False})  # metadata of a field that is not read from files

T = TypeVar("T")


@lru_cache(maxsize=1)
def _registry() -> Any:
    from pint import UnitRegistry  # imported here because that takes a quarter of a second

    # inH2O refers to water at 4 degC, 249.089 Pa, as in the datasheets of TE and Honeywell.
    return UnitRegistry(autoconvert_offset_to_baseunit=True)


def to_si(text: object, unit: str, where: str) -> float:
    """The value of `text` ("5.73 ft", "6 ft 2 in") in `unit` ("m").

    Raises InputError, which names `where`, when the unit is missing, unknown or of another dimension.
    """
    if not isinstance(text, str):
        raise InputError(f'{where} = {text!r}: give a number with a unit, in quotes, such as "{text} {unit}"')
    if unit in ("m", "kg") and (parts := FEET_AND_INCHES.fullmatch(text.strip())):
        return to_si(parts[1], unit, where) + to_si(parts[2], unit, where)
    try:
        match = NUMBER_AND_UNIT.fullmatch(text.strip())
        if match is None:
            raise ValueError("no number at its beginning")
        common_unit, factor = COMMON_UNITS.get(match[2], ("", 1.0))
        if common_unit == unit and math.isfinite(value := float(match[1]) * factor):
            return value
        registry = _registry()
        quantity = registry.Quantity(float(match[1]), match[2].strip() or "dimensionless")
        value = float(quantity.to(unit).magnitude)
        if not math.isfinite(value):
            raise ValueError("not finite")
        return value
    except Exception as error:  # pint raises half a dozen unrelated exceptions
        raise InputError(f"{where} = {text!r}: cannot be read as a quantity in {unit} ({error})") from None


def _is_common(text: object, unit: str) -> bool:
    match = NUMBER_AND_UNIT.fullmatch(text.strip()) if isinstance(text, str) else None
    return match is not None and COMMON_UNITS.get(match[2], ("", 1.0))[0] == unit


def weight_to_N(text: object, where: str) -> float:
    """The weight [N] of `text`, which is a force ("39 N", "8.5 lbf") or a mass ("4 kg", "9 lb").

    Raises InputError, which names `where`, when it is neither.
    """
    # The check that needs no other library comes first: a text in N or lbf is not a mass.
    try:
        return to_si(text, "N", where) if _is_common(text, "N") else GRAVITY_MPS2 * to_si(text, "kg", where)
    except InputError:
        pass
    try:
        return to_si(text, "N", where)
    except InputError:
        raise InputError(f'{where} = {text!r}: should be a weight or a mass with its unit, such as "4 kg"') from None


def read_table(kind: type[T], table: object, where: str, examples: Mapping[str, str] = NO_EXAMPLES) -> T:
    """The dataclass `kind` from a TOML table; each quantity is converted to the unit in its field's name.

    The key of a field is its name without the unit. A weight may be given as a mass. examples: the text to write for
    each key ("geometry.span"), for messages.
    Raises InputError, which names every key that is missing or unknown, or has a wrong unit or type, in one line.
    """
    problems: list[str] = []
    read = _read_table(kind, table, where, examples, problems)
    if problems:
        file = where.partition(":")[0] + ": "
        raise InputError("; ".join([problems[0], *(problem.removeprefix(file) for problem in problems[1:])]))
    return typing.cast(T, read)


def _read_table(kind: Any, table: object, where: str, examples: Mapping[str, str], problems: list[str]) -> Any:
    """Like `read_table`, but add the table's problems to `problems`, and return None if there are any."""
    if not isinstance(table, dict):
        problems.append(f"{where}: should be a table, is {table!r}")
        return None
    hints = typing.get_type_hints(kind)
    values: dict[str, Any] = {}
    accepted: list[str] = []
    problems_before = len(problems)
    for field in dataclasses.fields(kind):
        if not field.metadata.get("key", True):
            continue
        key, unit = split_unit(field.name)
        accepted.append(key)
        place = f"{where}: {key}" if ":" not in where else f"{where}.{key}"
        required = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        if key in table:
            try:
                values[field.name] = _read_value(
                    hints[field.name], table[key], unit, place, examples=examples, problems=problems
                )
            except InputError as error:
                example = examples.get(place.partition(": ")[2])
                like = f"; write it as {key} = {example}" if example and "such as" not in str(error) else ""
                problems.append(f"{error}{like}")
        elif required and dataclasses.is_dataclass(hints[field.name]):
            _read_table(hints[field.name], {}, place, examples, problems)
        elif required:
            example = examples.get(place.partition(": ")[2])
            like = f", such as {key} = {example}" if example else f" (a quantity in {unit})" if unit else ""
            problems.append(f"{place} is missing{like}")
    problems += [
        f"{where}: unknown key {key!r}; known here: {', '.join(accepted)}" for key in table if key not in accepted
    ]
    return None if len(problems) > problems_before else kind(**values)


def split_unit(name: str) -> tuple[str, str | None]:
    """Split "span_m" into ("span", "m"), and "title" into ("title", None)."""
    stem, _, suffix = name.rpartition("_")
    if stem and suffix in UNIT_OF_SUFFIX:
        return stem, UNIT_OF_SUFFIX[suffix]
    return name, None


def _read_value(
    hint: Any, value: object, unit: str | None, where: str, *, examples: Mapping[str, str], problems: list[str]
) -> Any:
    noted: dict[str, Any] = {"examples": examples, "problems": problems}
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        (hint,) = (a for a in arguments if a is not type(None))
        return _read_value(hint, value, unit, where, **noted)
    if dataclasses.is_dataclass(hint):
        return _read_table(hint, value, where, examples, problems)
    if origin is dict:
        if not isinstance(value, dict):
            raise InputError(f"{where}: should be a table, is {value!r}")
        places = {key: f"{where}.{key}" for key in value}
        return {key: _read_value(arguments[1], entry, unit, places[key], **noted) for key, entry in value.items()}
    if origin is tuple:
        fixed = Ellipsis not in arguments
        if not isinstance(value, list) or (fixed and len(value) != len(arguments)):
            raise InputError(
                f"{where}: should be a list" + (f" of {len(arguments)}" if fixed else "") + f", is {value!r}"
            )
        return tuple(_read_value(arguments[0], entry, unit, where, **noted) for entry in value)
    if hint is float:
        if unit == "N" and where.endswith("weight"):
            return weight_to_N(value, where)
        if unit is not None:
            return to_si(value, unit, where)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{where}: should be a plain number, is {value!r}")
        return float(value)
    if isinstance(hint, type) and issubclass(hint, enum.StrEnum):
        if value not in list(hint):
            raise InputError(f"{where}: {value!r} is not one of {', '.join(hint)}")
        return hint(str(value))
    if not isinstance(value, hint) or isinstance(value, bool) != (hint is bool):
        raise InputError(f"{where}: should be {'text' if hint is str else hint.__name__}, is {value!r}")
    return value
