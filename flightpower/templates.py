"""Makes the aircraft file to fill in from `flight.aircraft_keys`."""

import textwrap
import tomllib
from itertools import groupby
from pathlib import Path
from typing import Any

from flightpower.flight.aircraft import aircraft_text
from flightpower.flight.aircraft_keys import KEYS, SURFACES, Key

UNKNOWN = '"?"'
WIDTH = 110


def blank() -> str:
    """The template with required keys to fill in, and every other key as a comment."""
    lines = [
        "# An aircraft file. Fill in what is marked with ?. The rest is optional: to use a line, remove its #,",
        "# and that of the section in brackets above it. docs/use/aircraft.md says which are worth the effort.",
    ]
    for section, keys in groupby(KEYS, key=lambda key: key.rpartition(".")[0]):
        entries = [(key, KEYS[key]) for key in keys if key != "aerodynamics"]
        if not entries:
            continue
        optional = all(entry.without for _, entry in entries)
        section = section.replace("SURFACE", SURFACES[0]).replace("LINE", "alpha")
        if section:
            mark = "# " if optional and section != "propulsion" else ""
            lines += ["", f"{mark}[{section}]" + _alike(section)]
        for key, entry in entries:
            lines += ["", *_comment(entry)] if entry.without else ["", *_comment(entry, required=True)]
            name = key.rpartition(".")[2]
            lines.append(
                f"# {name} = {entry.example}"
                if entry.without
                else f"{name} = {entry.example if key == 'name' else UNKNOWN}"
            )
    return "\n".join(lines) + "\n"


def like(name: str, output: Path | None) -> str:
    """The template with all keys, filled in with the values of a shipped aircraft."""
    table: dict[str, Any] = tomllib.loads(aircraft_text(name)[0])
    table["name"] = output.stem if output else "mine"
    table["title"] = table["name"]
    table["source"] = f"after {name}: change what differs"
    lines = [f"# An aircraft file, filled in as {name}. docs/use/aircraft.md says what matters most."]
    return "\n".join([*lines, *_section(table, "")]) + "\n"


def _section(table: dict[str, Any], section: str) -> list[str]:
    lines = []
    for name, value in table.items():
        if isinstance(value, dict):
            continue
        entry = KEYS.get(_general(f"{section}{name}"))
        lines += [*(["", *_comment(entry, required=not entry.without)] if entry else []), f"{name} = {_toml(value)}"]
    for name, value in table.items():
        if isinstance(value, dict):
            inside = _section(value, f"{section}{name}.")
            plain = any(not isinstance(entry, dict) for entry in value.values())
            lines += ["", f"[{section}{name}]", *inside] if plain else inside
    return lines


def _general(key: str) -> str:
    """The key in the form of KEYS: surfaces such as elevator become SURFACE, and lines become LINE."""
    parts = key.split(".")
    if parts[0] in SURFACES:
        parts[0] = "SURFACE"
    if parts[:2] == ["probe", "lines"]:
        parts[2] = "LINE"
    return ".".join(parts)


def _alike(section: str) -> str:
    if section == SURFACES[0]:
        return f"   # {' and '.join(SURFACES[1:])} alike"
    return "   # beta, airspeed and static alike" if section.startswith("probe.lines") else ""


def _comment(entry: Key, required: bool = False) -> list[str]:
    need = "Required." if required else f"For: {entry.needed_by}. Without it: {entry.without}."
    text = f"{entry.meaning} {entry.measure} {need}"
    if required:
        text += f" Such as {entry.example}."
    return [f"# {line}" for line in textwrap.wrap(text, WIDTH)]


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_toml(entry) for entry in value) + "]"
    return f'"{value}"' if isinstance(value, str) else str(value)
