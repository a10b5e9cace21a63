"""Flight plans: TOML files with a list of segments. `load_plan` takes the name of a shipped plan or a path."""

import tomllib
from dataclasses import dataclass, field, fields
from importlib import resources
from pathlib import Path
from typing import Any

from flightpower.flight.errors import InputError
from flightpower.flight.files import read_text
from flightpower.flight.units import read_table
from flightpower.sim.air import Air
from flightpower.sim.pilot import Gains, PilotWander, pilot_named
from flightpower.sim.segments import AIRBORNE, GROUND

DT_S = 0.02
LONGEST_S = 4 * 3600.0  # duration of a segment
STRONGEST_WIND_MPS = 60.0
KINDS = AIRBORNE | GROUND


@dataclass(frozen=True, kw_only=True)
class Plan:
    name: str
    title: str
    segments: tuple[Any, ...]
    air: Air = field(default_factory=Air)
    pilot: Gains = field(default_factory=Gains)
    wander: PilotWander = field(default_factory=PilotWander)
    heading_rad: float = 0.0
    # The state at the start of a plan that begins in the air.
    height_m: float = 100.0
    speed_over_stall: float = 1.6
    integrator: str = "rk4"


def shipped_plans() -> list[str]:
    folder = resources.files("flightpower.sim") / "plans"
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def load_plan(name_or_path: str | Path) -> Plan:
    """A plan shipped with the package, by name, or one from a file.

    Raises InputError, which names file, segment and key, if a key is missing or unknown, or has a wrong unit.
    """
    shipped = resources.files("flightpower.sim") / "plans" / f"{name_or_path}.toml"
    path = Path(name_or_path)
    if path.suffix == "" and shipped.is_file():
        return parse_plan(shipped.read_text("utf-8"), str(name_or_path))
    if not path.is_file():
        raise InputError(f"plan {name_or_path}: neither a file nor one of {', '.join(shipped_plans())}")
    return parse_plan(read_text(path), path.stem)


def parse_plan(text: str, name: str) -> Plan:
    """The plan described by the text of a file; `name` identifies it in the InputErrors that are raised."""
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"plan {name}: not valid TOML ({error})") from None
    where = f"plan {name}"
    raw = table.pop("segment", None)
    segments = tuple(_segments(raw, where))
    if not segments:
        raise InputError(f"{where}: has no [[segment]]")
    air = read_table(Air, table.pop("air", {}), f"{where}: air")
    if not 0 <= air.wind_mps < STRONGEST_WIND_MPS:
        raise InputError(f"{where}: air: wind should be at least zero and below {STRONGEST_WIND_MPS:g} m/s")
    pilot = table.pop("pilot", "good")
    gains = pilot_named(pilot) if isinstance(pilot, str) else _gains(pilot, f"{where}: pilot")
    wander = read_table(PilotWander, table.pop("wander", {}), f"{where}: wander")
    head = read_table(_Head, table, where)
    if head.integrator not in ("rk4", "euler"):
        raise InputError(f"{where}: integrator: {head.integrator!r} is neither rk4 nor euler")
    values = {f.name: getattr(head, f.name) for f in fields(_Head)}
    return Plan(name=name, segments=segments, air=air, pilot=gains, wander=wander, **values)


@dataclass(frozen=True, kw_only=True)
class _Head:
    title: str = ""
    heading_rad: float = 0.0
    height_m: float = 100.0
    speed_over_stall: float = 1.6
    integrator: str = "rk4"


def _gains(table: Any, where: str) -> Gains:
    types = {f.name: f.type for f in fields(Gains)}
    if not isinstance(table, dict):
        raise InputError(f"{where}: should be a name or a table, is {table!r}")
    for key, value in table.items():
        if key not in types:
            raise InputError(f"{where}: unknown key {key!r}; known here: {', '.join(types)}")
        if types[key] is bool and not isinstance(value, bool):
            raise InputError(f"{where}: {key}: should be true or false, is {value!r}")
        if types[key] is not bool and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise InputError(f"{where}: {key}: should be a plain number, is {value!r}")
    return Gains(**table)


def _segments(raw: Any, where: str) -> list[Any]:
    if not isinstance(raw, list):
        raise InputError(f"{where}: has no [[segment]]")
    segments: list[Any] = []
    for i, entry in enumerate(raw, start=1):
        place = f"{where}: segment {i}"
        if not isinstance(entry, dict):
            raise InputError(f"{place}: should be a table, is {entry!r}")
        entry = dict(entry)
        kind = entry.pop("kind", None)
        if kind == "repeat":
            times = entry.pop("times", None)
            if not isinstance(times, int) or isinstance(times, bool) or times < 1:
                raise InputError(f"{place}: repeat: times should be a whole number, one or more, is {times!r}")
            inner = _segments(entry.pop("segment", None), place)
            if entry:
                raise InputError(f"{place}: repeat: unknown key {next(iter(entry))!r}; known here: times, segment")
            segments += inner * times
        elif kind in KINDS:
            segment: Any = read_table(KINDS[kind], entry, f"{place} ({kind})")
            if not 0 < getattr(segment, "duration_s", 1.0) < LONGEST_S:
                raise InputError(f"{place} ({kind}): duration should be above zero and below {LONGEST_S / 3600:g} h")
            if not getattr(segment, "climb_mps", 1.0) > 0:
                raise InputError(f"{place} ({kind}): climb should be above zero; the height says whether up or down")
            segments.append(segment)
        else:
            raise InputError(f"{place}: kind = {kind!r} is not one of {', '.join([*KINDS, 'repeat'])}")
    return segments
