"""Named worlds, which state how a simulated flight differs from the analysis's assumptions.

A world is an error budget, with differences in the air, the pilot, and the propeller table that the analysis gets.
Every error budget is also a world, without such differences. `worlds` lists all worlds.
"""

import math
import tomllib
from dataclasses import dataclass, field, fields, replace
from importlib import resources
from typing import Any

from flightpower.flight.aircraft import Propulsion, Uncertainty
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.units import read_table, split_unit
from flightpower.sim.air import Air
from flightpower.sim.defects import NO_DEFECTS
from flightpower.sim.pilot import PilotWander
from flightpower.sim.plan import Plan
from flightpower.sim.sensors.budget import AS_GIVEN, ErrorBudget, Systematic, load_budget, shipped_budgets
from flightpower.sim.true_propeller import table_until, true_propeller


@dataclass(frozen=True, kw_only=True)
class PropellerTable:
    """The table that the analysis gets, if it is not the aircraft file's table.

    ends_at_cT : each row of the table ends before the first point with less thrust. If it is negative, the table
    includes the windmilling branch of the propeller that is flown.
    """

    ends_at_cT: float | None = None


@dataclass(frozen=True)
class World:
    """title : one sentence     air : the differences from a plan's air, by the names of `Air`
    uncertainty : what the user states about this world in the aircraft file; None for the defaults
    """

    name: str
    title: str
    errors: ErrorBudget
    air: dict[str, Any] = field(default_factory=dict)
    pilot: PilotWander | None = None
    propeller_table: PropellerTable = PropellerTable()
    uncertainty: Uncertainty | None = None

    def plan(self, plan: Plan, seed: int) -> Plan:
        """The plan in this world's air, by this world's pilot. seed: draws the places of updrafts and downdrafts."""
        air = replace(plan.air, **self.air, convection_seed=seed) if self.air else plan.air
        return replace(plan, air=air, wander=self.pilot or plan.wander)

    def table(self, propulsion: Propulsion) -> Propeller | None:
        """The propeller table that the analysis gets; None for the table that the aircraft file names."""
        least_cT = self.propeller_table.ends_at_cT
        if least_cT is None or propulsion.propeller is None:
            return None
        table = load_propeller(propulsion.propeller)
        if least_cT < 0:
            table = true_propeller(table, windmilling=self.errors.systematic.windmilling)
        return table_until(table, least_cT)

    def uncertainty_section(self) -> str:
        """The aircraft file's [uncertainty] with the values that differ from the defaults; empty if none differs."""
        if self.uncertainty is None:
            return ""
        lines = ["[uncertainty]"]
        for entry in fields(self.uncertainty):
            value, (key, unit) = getattr(self.uncertainty, entry.name), split_unit(entry.name)
            if value != entry.default:
                lines.append(f"{key} = {_in_a_file(value, unit)}")
        return "\n".join(lines) + "\n"

    def aircraft_text(self, text: str) -> str:
        """Add these uncertainties to the text of an aircraft file; its other uncertainties stay."""
        uncertainty = self.uncertainty_section()
        head, *lines = uncertainty.splitlines() or [""]
        if not uncertainty or head not in text.splitlines():
            return f"{text}\n{uncertainty}" if uncertainty else text
        before = text.splitlines()
        first = before.index(head) + 1
        end = next((i for i in range(first, len(before)) if before[i][:1] == "["), len(before))
        said_keys = {line.split(" = ")[0] for line in lines}
        own = [line for line in before[first:end] if line.split(" = ")[0] not in said_keys]
        return "\n".join([*before[:first], *lines, *own, *before[end:]]) + "\n"


def _in_a_file(value: float, unit: str | None) -> str:
    """The text for a value in an SI unit, as a user would write it in a file."""
    if unit is None:
        return repr(float(value))
    if unit == "dimensionless":
        return f'"{100 * value:.12g} %"'
    if unit == "rad":
        return f'"{math.degrees(value):.12g} deg"'
    return f'"{value:.12g} {unit}"'


@dataclass(frozen=True, kw_only=True)
class _File:
    """errors : the budget that [noise], [systematic] and [defects] modify     times : factor on systematic errors"""

    title: str
    errors: str = "study"
    times: float = 1.0
    air: Air = field(default_factory=Air)
    pilot: PilotWander | None = None
    propeller_table: PropellerTable = PropellerTable()
    uncertainty: Uncertainty | None = None


def worlds() -> list[str]:
    """Names of all worlds: the error budgets first."""
    folder = resources.files("flightpower.sim") / "data" / "worlds"
    return shipped_budgets() + sorted(
        f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml")
    )


def worlds_with_defects() -> list[str]:
    """Names of the worlds with a defect that the analysis does not know of."""
    return [name for name in worlds() if load_world(name).errors.defects != NO_DEFECTS]


def world_of(name: str | None, errors: str | None) -> World:
    """The named world, or the assumed one with an error budget, by default "bench". Raises InputError given both."""
    if name is not None and errors is not None:
        raise InputError("--world has an error budget of its own: leave out --errors")
    if name is not None:
        return load_world(name)
    budget = load_budget(errors or "bench")
    return World(errors or "bench", budget.title, budget)


def load_world(name: str) -> World:
    """A shipped world by its name. Raises InputError when there is none."""
    if name in shipped_budgets():
        errors = load_budget(name)
        return World(name, errors.title, errors)
    shipped = resources.files("flightpower.sim") / "data" / "worlds" / f"{name}.toml"
    if name not in worlds():
        raise InputError(f"world {name}: not one of {', '.join(worlds())}")
    return parse_world(shipped.read_text("utf-8"), name)


def parse_world(text: str, name: str) -> World:
    """The world described by the text of a file. Raises InputError naming the key that is wrong."""
    where = f"world {name}"
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{where}: not valid TOML ({error})") from None
    changed = {section: table.pop(section, {}) for section in ("noise", "systematic", "defects")}
    file = read_table(_File, table, where)
    budget, changes = _times(load_budget(file.errors), file.times), read_table(ErrorBudget, changed, where)
    errors = replace(
        budget,
        noise=replace(budget.noise, **_fields_present(changes.noise, changed["noise"])),
        systematic=replace(budget.systematic, **_fields_present(changes.systematic, changed["systematic"])),
        defects=replace(budget.defects, **_fields_present(changes.defects, changed["defects"])),
    )
    air = _fields_present(file.air, table.get("air", {}))
    return World(name, file.title, errors, air, file.pilot, file.propeller_table, file.uncertainty)


def _fields_present(read: Any, table: dict[str, Any]) -> dict[str, Any]:
    """The fields of a dataclass whose keys the table has."""
    return {f.name: getattr(read, f.name) for f in fields(read) if split_unit(f.name)[0] in table}


def _times(budget: ErrorBudget, factor: float) -> ErrorBudget:
    """The budget with its systematic errors times a factor, except errors that are stated directly instead of drawn."""
    sizes = {f.name: getattr(budget.systematic, f.name) for f in fields(Systematic) if f.name not in AS_GIVEN}
    larger = {name: factor * size for name, size in sizes.items()}
    return replace(budget, systematic=replace(budget.systematic, **larger))
