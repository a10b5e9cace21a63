"""A fleet of synthetic flights: time and memory of adding and showing, delays and false alarms of changes.

    python benchmarks/fleet.py size --flights 10000 --airframes 50
    python benchmarks/fleet.py changes --airframes 40 --seed 1000

Flights are drawn from the model of the pool, with errors like those of short flights in 3 kt (`--noise 1`) or of long
ones in calm air (0.3): `tests/analysis/pooling/synthetic_flights.py`.
"""

import resource
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from records import Record, markdown, rounded

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "analysis" / "fleet"))

from fleet_flights import POLAR, flights_of

from analysis.fleet.airframes import airframes
from analysis.fleet.changes import find_changes, series
from analysis.fleet.dataset import Dataset
from analysis.fleet.results import What
from analysis.fleet.summary import fleet_results
from analysis.pooling.pool import pool_results
from analysis.report.fleet_page import render_fleet

A_YEAR, BEFORE = 200, 100  # flights; and before the change
CASES = (
    ("none", 0.0, 0.0, False),
    ("drag +2 %", 0.02, 0.0, False),
    ("drag +5 %", 0.05, 0.0, False),
    ("thrust -2 %", 0.0, -0.02, False),
    ("thrust -5 %", 0.0, -0.05, False),
    ("drag +3 % in 200 flights", 0.03, 0.0, True),
    ("thrust -3 % in 200 flights", 0.0, -0.03, True),
)
app = typer.Typer(add_completion=False)


@app.command()
def size(
    flights: Annotated[list[int], typer.Option()] = [100, 1000, 10000],  # noqa: B006
    airframes_: Annotated[int, typer.Option("--airframes")] = 50,
    seed: int = 1000,
) -> None:
    """Processor seconds to add flights, one more, to show all; the page's size."""
    print(markdown(size_records(flights, airframes_, seed)))


def size_records(flights: Sequence[int], airframes_: int, seed: int) -> list[Record]:
    rng, records = np.random.default_rng(seed), []
    for total in flights:
        with tempfile.TemporaryDirectory() as folder:
            dataset, added = Dataset(folder), 0.0
            for i in range(airframes_):
                polar = POLAR * (1 + 0.04 * rng.standard_normal())
                drawn = flights_of(f"airframe-{i:02d}", seed + i, max(total // airframes_, 1), polar=polar)
                start = time.process_time()
                dataset.add(drawn)
                added += time.process_time() - start
            one = flights_of("airframe-00", seed - 1, 1)
            start = time.process_time()
            dataset.add(one)
            one_more = time.process_time() - start
            start = time.process_time()
            results = fleet_results(airframes(dataset, 1.0, []), [])
            page = render_fleet(results)
            shown = time.process_time() - start
            disk = sum(path.stat().st_size for path in Path(folder).rglob("*.parquet"))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        records.append({
            "flights": total, "airframes": airframes_, "added, s": rounded(added, 1),
            "one more, s": rounded(one_more, 2), "shown, s": rounded(shown, 1), "bytes a flight": rounded(disk / total),
            "page, MB": rounded(len(page) / 1e6, 1), "memory, MB": rounded(memory),
        })  # fmt: skip
    return records


@app.command()
def changes(
    airframes_: Annotated[int, typer.Option("--airframes")] = 40,
    seed: int = 1000,
    noise: list[float] = [1.0, 0.3],  # noqa: B006
) -> None:
    """Delay to the first alarm after a change, what it names, and false alarms in as many flights as one is allowed."""
    print(markdown(change_records(airframes_, seed, noise)))


def change_records(airframes_: int, seed: int, noise: Sequence[float]) -> list[Record]:
    """Of each change: airframes that show it, flights until then, and false alarms. Counting errors: of a count k of n
    sqrt(k (n - k) / n); of the rate of alarms, the root of their number."""
    records = []
    for factor in noise:
        for name, drag, thrust, slowly in CASES:
            count = BEFORE + A_YEAR
            grown = np.clip((np.arange(count) - BEFORE) / A_YEAR, 0, 1) if slowly else np.arange(count) >= BEFORE
            delays, right, false = [], 0, 0
            for i in range(airframes_):
                drawn = flights_of("one", seed + i, count, drag=drag * grown, thrust=thrust * grown, noise=factor)
                found = find_changes(series(pool_results(drawn)), np.arange(float(count)), A_YEAR)
                early = [one for one in found if one.found < BEFORE]
                late = [one for one in found if one.found >= BEFORE]
                false += len(found) if name == "none" else len(early)
                if late and name != "none":
                    delays.append(late[0].found - BEFORE + 1)
                    right += late[0].what is (What.DRAG if drag else What.PROPULSION)
            flown = airframes_ * (count if name == "none" else BEFORE)
            record: Record = {"change": name, "noise": factor, "airframes": airframes_}
            if name != "none":
                record |= {"found": len(delays), "flights until then, median": rounded(np.median(delays or [np.nan])),
                           "named right": right}  # fmt: skip
            rate = A_YEAR / flown
            records.append(record | {"false alarms in 200 flights": rounded(false * rate, 2),
                                     "±": rounded(np.sqrt(max(false, 1)) * rate, 2)})  # fmt: skip
    columns = list(dict.fromkeys(name for record in records[::-1] for name in record))
    return [{name: record.get(name) for name in columns} for record in records]


if __name__ == "__main__":
    app()
