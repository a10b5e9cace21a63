"""Converts quantities with units in files (`span = "5.73 ft"`) to numbers in SI units (`span_m`).

The name of a field ends with its unit: `static_pressure_Pa`. `read_table` takes the unit from there and converts to it.
pint knows the units; this module knows the naming.
"""

import dataclasses
import types
import typing
from functools import lru_cache
from typing import Any, TypeVar

from flight.errors import InputError

GRAVITY_MPS2 = 9.80665  # standard gravity (ICAO Doc 7488/3); here because the daemon uses it without NumPy

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
}

T = TypeVar("T")


@lru_cache(maxsize=1)
def _registry() -> Any:
    from pint import UnitRegistry  # takes a quarter of a second to import

    # inH2O is that of water at 4 degC, 249.089 Pa, as in the datasheets of TE and Honeywell.
    return UnitRegistry(autoconvert_offset_to_baseunit=True)


def to_si(text: object, unit: str, where: str) -> float:
    """The value of `text` ("5.73 ft") in `unit` ("m").

    Raises InputError, which names `where`, when the unit is missing, unknown or of another dimension.
    """
    if not isinstance(text, str):
        raise InputError(f'{where} = {text!r}: give a number with a unit, in quotes, such as "{text} {unit}"')
    registry = _registry()
    try:
        number, _, name = text.strip().partition(" ")
        quantity = registry.Quantity(float(number), name.strip() or "dimensionless")
        return float(quantity.to(unit).magnitude)
    except Exception as error:  # pint raises half a dozen unrelated exceptions
        raise InputError(f"{where} = {text!r}: cannot be read as a quantity in {unit} ({error})") from None


def read_table(kind: type[T], table: object, where: str) -> T:
    """The dataclass `kind` from a TOML table; each quantity is converted to the unit in its field's name.

    The key of a field is its name without the unit. Raises InputError, which names the key, for a missing or unknown
    key, a wrong unit or a wrong type.
    """
    if not isinstance(table, dict):
        raise InputError(f"{where}: should be a table, is {table!r}")
    hints = typing.get_type_hints(kind)
    values: dict[str, Any] = {}
    known: list[str] = []
    for field in dataclasses.fields(kind):  # type: ignore[arg-type]
        key, unit = split_unit(field.name)
        known.append(key)
        at = f"{where}: {key}" if ":" not in where else f"{where}.{key}"
        if key in table:
            values[field.name] = _read_value(hints[field.name], table[key], unit, at)
        elif field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING:
            raise InputError(f"{at} is missing" + (f" (a quantity in {unit})" if unit else ""))
    for key in table:
        if key not in known:
            raise InputError(f"{where}: unknown key {key!r}; known here: {', '.join(known)}")
    return kind(**values)


def split_unit(name: str) -> tuple[str, str | None]:
    """("span", "m") of "span_m"; ("title", None) of "title"."""
    stem, _, suffix = name.rpartition("_")
    if stem and suffix in UNIT_OF_SUFFIX:
        return stem, UNIT_OF_SUFFIX[suffix]
    return name, None


def _read_value(hint: Any, value: object, unit: str | None, where: str) -> Any:
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (types.UnionType, typing.Union):
        return _read_value(next(a for a in arguments if a is not type(None)), value, unit, where)
    if dataclasses.is_dataclass(hint):
        return read_table(hint, value, where)  # type: ignore[arg-type]
    if origin is dict:
        if not isinstance(value, dict):
            raise InputError(f"{where}: should be a table, is {value!r}")
        at = {key: f"{where}.{key}" for key in value}
        return {key: _read_value(arguments[1], entry, unit, at[key]) for key, entry in value.items()}
    if origin is tuple:
        fixed = Ellipsis not in arguments
        if not isinstance(value, list) or (fixed and len(value) != len(arguments)):
            raise InputError(
                f"{where}: should be a list" + (f" of {len(arguments)}" if fixed else "") + f", is {value!r}"
            )
        return tuple(_read_value(arguments[0], entry, unit, where) for entry in value)
    if hint is float:
        if unit is not None:
            return to_si(value, unit, where)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"{where}: should be a plain number, is {value!r}")
        return float(value)
    if not isinstance(value, hint) or isinstance(value, bool) != (hint is bool):
        raise InputError(f"{where}: should be {'text' if hint is str else hint.__name__}, is {value!r}")
    return value
