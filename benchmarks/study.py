"""Finds errors, intervals and coverage over many simulated flights, for one of the cases in the table below.

    python benchmarks/study.py estimators --turbulence-kt 3 --flights 200
    python benchmarks/study.py estimators --aircraft light-1kg --plan accel-decel --seed 1000 --flights 16 --jobs 1
    python benchmarks/study.py methods --errors bench --with alpha_offset_rad=0.02
    python benchmarks/study.py autopilot-logs --turbulence-kt 0 --turbulence-kt 8 --with data=electrical,rpm

Each flight has its own seed; seeds below 1000 are for development, figures in the documentation come from others.
`--with` gives an option of the case; the docstring of its `one_flight` describes these.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
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
import parameters
import thrust_stand
import typer
from flights import Rows, Setup, error_rows
from records import Record, counted, markdown, option, rounded
from rich.console import Console
from rich.progress import track

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.flight.aircraft import Aircraft, load_aircraft


def at_speeds(aircraft: Aircraft) -> list[str]:
    return [f"{v:.1f} m/s" for v in estimators.speeds(aircraft)]


class Case(NamedTuple):
    """The function that is computed for each flight, its speeds, and the default plan."""

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
    "parameters": Case(parameters.one_flight, "full-test-flight"),
    "chain": Case(chain.one_flight, "full-test-flight"),
}


class Figures(NamedTuple):
    """Figures of many flights: errors at several speeds, values with one number per flight, and counts of findings."""

    curves: list[Record]
    numbers: list[Record]
    counts: list[Record]


def figures(name: str, todo: Sequence[Setup], options: Mapping[str, Any], jobs: int) -> Figures:
    """Compute a case for the flights in one weather."""
    case = CASES[name]
    columns = case.columns(load_aircraft(todo[0].aircraft))
    gathered: dict[str, list[np.ndarray]] = defaultdict(list)
    lost = 0
    with ProcessPoolExecutor(jobs) as pool:
        lines = pool.map(partial(case.one_flight, **options), todo)
        for rows in track(lines, name, total=len(todo), console=Console(stderr=True)):
            lost += not rows
            for title, values in rows:
                gathered[title].append(values)
    counts = [{"found": title, "flights": len(values)} for title, values in gathered.items() if not values[0].size]
    return Figures(
        [curve(title, values) for title, values in gathered.items() if values[0].shape[1] == len(columns)],
        [single(title, values) for title, values in gathered.items() if values[0].shape == (2, 1)],
        sorted(counts, key=lambda count: -count["flights"]) + ([{"found": "lost", "flights": lost}] if lost else []),
    )


def curve(title: str, values: list[np.ndarray]) -> Record:
    """Return errors at several speeds, % of the truth, with the counting error of their coverage.

    All columns of a flight share its errors, so flights are counted, not columns.
    """
    error, half = np.array(values).transpose(1, 0, 2)
    rows = {name: rounded(row, 1 if "coverage" not in name else 0) for name, row, _ in error_rows(error, half)}
    finite = np.isfinite(error) & np.isfinite(half)
    of_flights = np.where(finite, np.abs(error) < half, np.nan)[finite.any(axis=1)]
    share, counting = counted(np.nanmean(of_flights, axis=1)) if len(of_flights) else (np.nan, np.nan)
    return {
        "of": title,
        "flights": int(np.isfinite(error).any(axis=1).sum()),
        "coverage, %": rounded(share),
        "±": rounded(counting, 1),
        "at each speed": rows.get("coverage, %"),
        "95 % of errors below": rows["95 % of errors below"],
        "half width": rows.get("half width of intervals"),
        "mean": rows["mean"],
        "rms": rounded(np.sqrt(mean_square(error)), 2),
    }


def mean_square(error: np.ndarray) -> np.ndarray:
    """Return the mean square of each column; NaN if no flight has a value."""
    finite = np.isfinite(error)
    return np.nansum(error**2, axis=0) / np.where(finite.any(axis=0), finite.sum(axis=0), np.nan)


def single(title: str, values: list[np.ndarray]) -> Record:
    """Return a record for a quantity with one value per flight, such as a sensor error."""
    error, half = np.array(values)[:, :, 0].T
    return {
        "of": title,
        "flights": len(error),
        "rms": rounded(np.sqrt(np.mean(error**2)), 3),
        "mean": rounded(error.mean(), 3),
        "stated, 1 sigma": rounded(np.median(half) / NORMAL_95, 3),
        "coverage, %": rounded(100 * np.mean(np.abs(error) < half)),
    }


def main(
    name: Annotated[str, typer.Argument(metavar="CASE", help=", ".join(CASES))],
    plan: Annotated[str | None, typer.Option(help="Flight plan.")] = None,
    world: Annotated[str, typer.Option("--errors", "--world", help="Error budget or world.")] = "study",
    turbulence_kt: Annotated[list[float] | None, typer.Option(help="W20 of the Dryden turbulence [kt]; 0.")] = None,
    count: Annotated[int, typer.Option("--flights", help="How many; one seed each.")] = 20,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed; development uses those below 1000.")] = 0,
    aircraft: Annotated[str, typer.Option(help="Aircraft.")] = "nexstar",
    option_texts: Annotated[
        list[str] | None, typer.Option("--with", metavar="NAME[=VALUE]", help="Option of the case.")
    ] = None,
    jobs: Annotated[int, typer.Option(help="Processes.")] = 2,
) -> None:
    if name not in CASES:
        raise typer.BadParameter(f"{name} is not one of {', '.join(CASES)}")
    for kt in turbulence_kt or [0.0]:
        seeds = range(first_seed, first_seed + count)
        todo = [Setup(aircraft, world, plan or CASES[name].plan, kt, seed) for seed in seeds]
        tables = figures(name, todo, dict(option(text) for text in option_texts or []), jobs)
        columns = ", ".join(CASES[name].columns(load_aircraft(aircraft)))
        print(f"\n{' '.join([name, *(option_texts or [])])}: {world}, {todo[0].plan}, W20 = {kt:g} kt, {count} flights"
              f" from seed {first_seed}; at {columns}")  # fmt: skip
        for records in tables:
            if records:
                print("", markdown(records), sep="\n")


if __name__ == "__main__":
    typer.run(main)
