"""Errors, intervals and coverage of one thing over many simulated flights, by the table of cases below.

    python benchmarks/study.py estimators --turbulence-kt 3 --flights 200
    python benchmarks/study.py estimators --aircraft light-1kg --plan accel-decel --seed 1000 --flights 16 --jobs 1
    python benchmarks/study.py methods --errors bench --with alpha_offset_rad=0.02
    python benchmarks/study.py autopilot-logs --turbulence-kt 0 --turbulence-kt 8 --with of=electrical,rpm

Each flight is one seed; those below 1000 are for development, figures of the documentation come from others. `--with`
gives an option of the case: the arguments of its `one_flight` are documented there.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import contextlib
import json
from collections import defaultdict
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from typing import Annotated, Any, NamedTuple

import answers
import chain
import electrical
import estimators
import methods
import numpy as np
import own_aircraft
import thrust_stand
import typer
from flights import Rows, Setup, error_rows
from rich.console import Console
from rich.progress import track
from rich.table import Table

from analysis.estimation.noise import NORMAL_95
from flight.aircraft import Aircraft, load_aircraft


def at_speeds(aircraft: Aircraft) -> list[str]:
    return [f"{v:.1f} m/s" for v in estimators.speeds(aircraft)]


class Case(NamedTuple):
    """What is computed of each flight, at what, and the plan that is flown unless another is named."""

    one_flight: Callable[..., Rows]
    plan: str
    columns: Callable[[Aircraft], Sequence[str]] = at_speeds


CASES = {
    "estimators": Case(estimators.one_flight, "full-test-flight"),
    "methods": Case(
        methods.one_flight, "full-test-flight", lambda aircraft: [f"{v:.1f} m/s" for v in methods.speeds(aircraft)]
    ),
    "answers": Case(answers.one_flight, "accel-decel", answers.columns),
    "thrust-stand": Case(thrust_stand.one_flight, "accel-decel"),
    "autopilot-logs": Case(electrical.one_flight, "ordinary-flight", electrical.columns),
    "autopilot-pools": Case(electrical.one_campaign, "ordinary-flight", electrical.columns),
    "own-aircraft": Case(own_aircraft.one_flight, "accel-decel"),
    "chain": Case(chain.one_flight, "full-test-flight"),
}


def main(
    name: Annotated[str, typer.Argument(metavar="CASE", help=", ".join(CASES))],
    plan: Annotated[str | None, typer.Option(help="Flight plan.")] = None,
    world: Annotated[str, typer.Option("--errors", "--world", help="Error budget or world.")] = "study",
    turbulence_kt: Annotated[list[float] | None, typer.Option(help="W20 of the Dryden turbulence [kt]; 0.")] = None,
    count: Annotated[int, typer.Option("--flights", help="How many; one seed each.")] = 20,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed; development uses those below 1000.")] = 0,
    aircraft: Annotated[str, typer.Option(help="Aircraft.")] = "nexstar",
    given: Annotated[
        list[str] | None, typer.Option("--with", metavar="NAME[=VALUE]", help="Option of the case.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
) -> None:
    if name not in CASES:
        raise typer.BadParameter(f"{name} is none of {', '.join(CASES)}")
    case = CASES[name]
    one_flight = partial(case.one_flight, **dict(option(text) for text in given or []))
    columns, console = case.columns(load_aircraft(aircraft)), Console(width=140, markup=False)
    for kt in turbulence_kt or [0.0]:
        seeds = range(first_seed, first_seed + count)
        todo = [Setup(aircraft, world, plan or case.plan, kt, seed) for seed in seeds]
        gathered: dict[str, list[np.ndarray]] = defaultdict(list)
        lost = 0
        with ProcessPoolExecutor(jobs) as pool:
            for rows in track(pool.map(one_flight, todo), "flights", total=count, console=Console(stderr=True)):
                lost += not rows
                for title, values in rows:
                    gathered[title].append(values)
        console.print(f"{' '.join([name, *(given or [])])}: {world}, {todo[0].plan}, W20 = {kt:g} kt, {count} flights "
                      f"from seed {first_seed}, {lost} lost")  # fmt: skip
        print_errors(console, gathered, columns)
        print_single_numbers(console, {title: one for title, one in gathered.items() if one[0].shape == (2, 1)})
        for title, one in sorted(gathered.items(), key=lambda item: -len(item[1])):
            if not one[0].size:
                console.print(f"  {len(one):3d} x {title}")


def option(text: str) -> tuple[str, Any]:
    """Name and value of an option; without a value it is switched on."""
    name, _, value = text.partition("=")
    with contextlib.suppress(ValueError):
        return name, json.loads(value or "true")
    return name, value


def print_errors(console: Console, gathered: dict[str, list[np.ndarray]], columns: Sequence[str]) -> None:
    """What is compared at several speeds: as a table, and as rows of the documentation."""
    table, rows = Table("errors in %", "", *columns, box=None), []
    for title, values in gathered.items():
        if values[0].shape[1] != len(columns):
            continue
        error, half = np.array(values).transpose(1, 0, 2)
        told = {name: (row, form) for name, row, form in error_rows(error, half)}
        title += share_covered(error, half)
        told["rms"] = np.sqrt(mean_square(error)), "{:.2f}"
        for i, (name, (row, form)) in enumerate(told.items()):
            table.add_row("" if i else title, name, *(form.format(x) if np.isfinite(x) else "-" for x in row))
        listed = {name: " / ".join(form.format(x) for x in row if np.isfinite(x)) for name, (row, form) in told.items()}
        rows.append("| " + " | ".join([title, *listed.values()]) + " |")
    console.print(table)
    print("", *rows, "", sep="\n")


def share_covered(error: np.ndarray, half: np.ndarray) -> str:
    """Coverage over all columns with its counting error, one standard deviation; the columns of a flight share its
    errors, so that flights are what is counted. Empty without intervals."""
    known = np.isfinite(error) & np.isfinite(half)
    flights = known.any(axis=1)
    if not flights.any():
        return ""
    share = np.nanmean(np.where(known, np.abs(error) < half, np.nan)[flights], axis=1)
    return f": {100 * share.mean():.0f} ± {100 * np.std(share) / np.sqrt(len(share)):.1f} % covered"


def mean_square(error: np.ndarray) -> np.ndarray:
    """Of each column; NaN where no flight has a value."""
    known = np.isfinite(error)
    return np.nansum(error**2, axis=0) / np.where(known.any(axis=0), known.sum(axis=0), np.nan)


def print_single_numbers(console: Console, gathered: dict[str, list[np.ndarray]]) -> None:
    """What a whole flight has one of, such as a sensor's error."""
    table = Table("errors", "rms", "mean", "stated, 1 sigma", "coverage, %", box=None)
    for title, values in gathered.items():
        error, half = np.array(values)[:, :, 0].T
        stated = f"{np.median(half) / NORMAL_95:.3f}", f"{100 * np.mean(np.abs(error) < half):.0f}"
        table.add_row(title, f"{np.sqrt(np.mean(error**2)):.3f}", f"{error.mean():+.3f}", *stated)
    if gathered:
        console.print(table)


if __name__ == "__main__":
    typer.run(main)
