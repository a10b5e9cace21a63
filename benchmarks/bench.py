"""Measures time and memory of daemon, simulator, analysis and estimation by the benches in the table below.

    python benchmarks/bench.py                                    # all
    python benchmarks/bench.py drivers optimizers                 # these
    python benchmarks/bench.py analysis --with before=HEAD~5      # with an option, an argument of its function

Most results are ratios: to a limit, to real time, to another optimizer, or to an earlier version that is measured by
turns in the same run. Exit code 1 if a ratio exceeds its "at most" or is below its "at least".
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import daemon_parts
import drivers
import estimation_speed
import simulator
import speed
import typer
from records import Record, markdown, option


def analysis(*, log: str = "", before: str = "", hours: float = 0.0, rounds: int = 3) -> list[Record]:
    """Measure an analysis step by step, as ratios to an earlier version if one is named."""
    return speed.records(Path(log) if log else None, [before] if before else [], hours, rounds)


BENCHES: Mapping[str, Callable[..., list[Record]]] = {
    "drivers": drivers.records,
    "daemon-parts": daemon_parts.part_records,
    "daemon-threads": daemon_parts.thread_records,
    "simulator": simulator.records,
    "analysis": analysis,
    "trajectory": estimation_speed.trajectory_records,
    "fits": estimation_speed.fit_records,
    "optimizers": estimation_speed.optimizer_records,
    "growth": estimation_speed.growth_records,
}


def missed(records: Sequence[Record]) -> list[Record]:
    """Return the rows whose ratio is beyond its limit."""
    return [
        record
        for record in records
        if record.get("ratio") is not None
        and not record.get("at least", 0.0) <= record["ratio"] <= record.get("at most", float("inf"))
    ]


def main(
    names: Annotated[list[str] | None, typer.Argument(metavar="[BENCH]...", help=", ".join(BENCHES))] = None,
    option_texts: Annotated[
        list[str] | None, typer.Option("--with", metavar="NAME[=VALUE]", help="Option of the bench.")
    ] = None,
) -> None:
    for name in names or ():
        if name not in BENCHES:
            raise typer.BadParameter(f"{name} is not one of {', '.join(BENCHES)}")
    options: dict[str, Any] = dict(option(text) for text in option_texts or [])
    above: list[str] = []
    for name in names or BENCHES:
        records = BENCHES[name](**options)
        print(f"\n{name}", markdown(records), sep="\n\n", flush=True)
        above += [f"{name}: {next(iter(record.values()))}" for record in missed(records)]
    for line in above:
        print(f"beyond its limit: {line}")
    raise typer.Exit(bool(above))


if __name__ == "__main__":
    typer.run(main)
