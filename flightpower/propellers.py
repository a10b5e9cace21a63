"""`flightpower propellers`: propeller tables by words and size, the nearest ones, and how far off these may be."""

import json
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from flightpower.flight.command_line import ExitCode, application
from flightpower.flight.errors import InputError
from flightpower.flight.files import check_new_file, write_files
from flightpower.flight.propeller import Origin
from flightpower.flight.propeller_search import (
    Cost,
    Query,
    Table,
    cost_of,
    flight_J,
    matching,
    nearest,
    parse_query,
    shipped_tables,
    tables_in,
)

app = application(no_args_is_help=False)
COLUMNS: tuple[str, ...] = ("table", "size", "blades", "origin", "motor speed [rpm]", "J", "published")


@app.command()
def propellers(
    words: Annotated[
        list[str] | None,
        typer.Argument(metavar="WORD", help="A size (11x5.5), a diameter (11) and words (apc); default: all."),
    ] = None,
    folder: Annotated[
        Path | None,
        typer.Option(
            "--folder", metavar="FOLDER", help="Search tables of UIUC or APC as downloaded, or your own, here too."
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", metavar="FOLDER", help="Write those found in --folder here, as CSV files."),
    ] = None,
    J: Annotated[
        tuple[float, float] | None,
        typer.Option("--J", metavar="LOW HIGH", help="Advance ratios of your flights; default: climb, level flight."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    replace: Annotated[bool, typer.Option("--replace", help="Replace existing files.")] = False,
) -> None:
    """Propeller tables by size (diameter x pitch in inches), maker and source, measured or computed.

    Where no measured table has the size, the nearest ones are listed, with how far their thrust and power may be off at
    the same airspeed and motor speed, and what to put into the aircraft file for it. Name the series, such as apc thin
    electric, for a narrower interval.

    \b
    Examples:
      flightpower propellers 11x7
      flightpower propellers graupner 11
      flightpower propellers 11x7.5 apc thin electric --J 0.3 0.6
      flightpower propellers 13x8 --folder UIUC-propDB -o tables

    A name goes into `propeller = "…"` of the aircraft file or after --propeller; so does a file that -o wrote.

    Exit code 0: tables were found. 1: there is no measured table of this size; the lines say how far off others may be.
    2: wrong input, or no table matches; one line on stderr says which.
    """
    query = parse_query(words or [])
    if J is not None and not 0 <= J[0] < J[1]:
        raise InputError(f"--J {J[0]:g} {J[1]:g}: two advance ratios in ascending order are needed, such as 0.3 0.6")
    if output is not None and folder is None:
        raise InputError("-o: writes the tables of --folder; give one, or name a listed table as it is")
    own, problems = tables_in(folder) if folder else ([], [])
    tables = [*shipped_tables(), *own]
    matches = matching(tables, query)
    if query.words and not matches and (query.diameter_in is None or query.pitch_in is None):
        raise InputError(f"no table of {' '.join(words or [])}; `flightpower propellers` lists all")
    written = _write([table for table in matches if table in own], output, replace) if output else []
    measured = any(table.origin is Origin.MEASURED for table in matches)
    near, costs = [], []
    if query.pitch_in is not None and not measured:
        near = nearest(tables, query)
        costs = [cost_of(table, query, tables, J) for table in _candidates(near)]
    elif query.diameter_in is not None and not matches:
        raise InputError(f"no table of a diameter of {query.diameter_in:g} in; give a pitch too, for the nearest ones")
    if as_json:
        content = {"tables": [_as_json(table) for table in matches], "nearest": [_as_json(table) for table in near]}
        print(json.dumps({**content, "costs": [asdict(table) for table in costs], "not_read": problems}, indent=2))
    else:
        _print(query, matches, near, costs)
        print(*(f"wrote {path}" for path in written), sep="\n", end="\n" if written else "")
        for problem in problems:
            print(f"not read: {problem}", file=sys.stderr)
    if costs:
        raise typer.Exit(ExitCode.FAILURE)


def _candidates(near: list[Table]) -> list[Table]:
    """The nearest table, and the nearest measured table."""
    return (
        list(dict.fromkeys([near[0], *(table for table in near if table.origin is Origin.MEASURED)][:2]))
        if near
        else []
    )


def _write(tables: list[Table], folder: Path, replace: bool) -> list[Path]:
    """Write the tables. Raises InputError before writing if there is none, or if a file would be replaced."""
    paths = [folder / f"{Path(table.name).stem if table.name.endswith('.csv') else table.name}.csv" for table in tables]
    if not paths:
        raise InputError("-o: no table of --folder matches; nothing was written")
    for path in paths:
        check_new_file(path, replace=replace)
    write_files({path: table.to_csv() for path, table in zip(paths, tables, strict=True)})
    return paths


def _as_json(table: Table) -> dict[str, Any]:
    return {
        "name": table.name,
        "diameter_in": round(table.diameter_in, 4),
        "pitch_in": None if table.pitch_in is None else round(table.pitch_in, 4),
        "blades": table.blades,
        "series": table.series,
        "origin": table.origin.value,
        "published": table.published,
        "rpm": table.rpm,
        "J": table.J,
        "flight_J": flight_J(table),
    }


def _print(query: Query, tables: list[Table], near: list[Table], costs: list[Cost]) -> None:
    if tables or not near:
        _print_tables(tables)
    if near:
        size = f"{query.diameter_in:g}x{query.pitch_in:g}"
        print(f"\nNo measured table of {size}{' with these words' if query.words else ''}. The nearest:\n")
        _print_tables(near, query)
    for cost in costs:
        _print_cost(cost, f"{query.diameter_in:g}x{query.pitch_in:g}")


def _print_tables(tables: list[Table], query: Query | None = None) -> None:
    lines: list[tuple[str, ...]] = [COLUMNS if query is None else (*COLUMNS, "size asked for")]
    for table in tables:
        rpm, J = (f"{low:.{digits}f}-{high:.{digits}f}" for (low, high), digits in ((table.rpm, 0), (table.J, 2)))
        line: tuple[str, ...] = (
            table.name,
            table.size,
            str(table.blades or "?"),
            table.origin.value,
            rpm,
            J,
            table.published,
        )
        lines.append(line if query is None else (*line, _apart(table, query)))
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        print("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())


def _apart(table: Table, query: Query) -> str:
    pairs = ((query.diameter_in, table.diameter_in, "diameter"), (query.pitch_in, table.pitch_in, "pitch"))
    steps = [(wanted - is_, name) for wanted, is_, name in pairs if wanted is not None and is_ is not None]
    return ", ".join(f"{step:+.2g} in {name}" for step, name in steps if abs(step) > 1e-6) or "the same"


def _print_cost(cost: Cost, size: str) -> None:
    print(
        f"\nWith {cost.table} for {size}, at the same airspeed and motor speed, J {cost.J[0]:.2f} to {cost.J[1]:.2f}:"
        f"\n  your propeller's thrust is {_percent(cost.thrust)}, its power {_percent(cost.power)} of that table's"
        f" ({cost.compared} propellers compared)."
    )
    if cost.per_inch:
        diameter, pitch = (f"{100 * change:+.0f} %" for change in cost.per_inch)
        print(f"  An inch of diameter makes {diameter} of thrust, an inch of pitch {pitch}.")
    print(
        "  In the aircraft file:\n    [uncertainty]\n"
        f'    thrust_scale = "{100 * cost.thrust_scale:.0f} %"\n    thrust_slope = {cost.thrust_slope:.2f}'
    )


def _percent(ends: tuple[float, float]) -> str:
    return " to ".join(f"{100 * (1 + end):.0f}" for end in ends) + " %"
