"""Tests a fleet of synthetic flights: time and memory to add and show them, detection delays, and false alarms.

    python benchmarks/fleet.py size --flights 10000 --airframes 50
    python benchmarks/fleet.py page --flights 10000
    python benchmarks/fleet.py changes --airframes 40 --seed 1000
    python benchmarks/fleet.py coverage --airframes 50 --draws 20
    python benchmarks/fleet.py generator --flights 30
    python benchmarks/fleet.py cluster --flights 300 --logs 30
    python benchmarks/fleet.py listing --keys 100000

Flights are drawn from the model of the pool. Their rows resemble those of simulated and analyzed flights of 21 minutes
in 3 kt (`tests/analysis/flights/measured_row.py`); `generator` compares the two. `--noise 3` draws flights with three
times the errors. `cluster` analyzes logs of simulated flights with Dask, from a store that speaks S3.
"""

import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated, Any

import campaigns
import flights as simulated_flights
import many_logs
import numpy as np
import typer
from numpy.typing import NDArray
from records import Record, counted, markdown, rounded
from scipy.stats import norm

sys.path.insert(0, str(Path(__file__).parents[1]))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "analysis" / "flights"))

from fleet_flights import POLAR, flights_of
from measured_row import FILE, RowModel, mean_row, measured_row, written

from flightpower.analysis.curve import Polar, power_required
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.airframes import airframe, airframes, fleet_curve
from flightpower.analysis.flights.campaign.addresses import find_logs, place
from flightpower.analysis.flights.campaign.folders import names
from flightpower.analysis.flights.changes import Series, find_changes, least_gain, series
from flightpower.analysis.flights.dataset import Dataset
from flightpower.analysis.flights.fleet_summary import fleet_results
from flightpower.analysis.flights.flight_statistics import read_statistics
from flightpower.analysis.flights.pool import joint_pool
from flightpower.analysis.pages.fleet_page import render_fleet
from flightpower.analysis.records.fleet import What
from tests import browser, s3_server

A_YEAR, BEFORE = 200, 100  # flights in a year, and before a change
AMONG = 0.04  # standard deviation of drag among airframes
CASES = (
    ("none", 0.0, 0.0, False),
    ("drag +2 %", 0.02, 0.0, False),
    ("drag +5 %", 0.05, 0.0, False),
    ("thrust -2 %", 0.0, -0.02, False),
    ("thrust -5 %", 0.0, -0.05, False),
    ("drag +3 % in 200 flights", 0.03, 0.0, True),
    ("thrust -3 % in 200 flights", 0.0, -0.03, True),
)
OPENED = """(() => {
  const [opened] = performance.getEntriesByType("navigation");
  const [painted] = performance.getEntriesByName("first-contentful-paint");
  return [painted.startTime, opened.domComplete, opened.loadEventEnd];
})()"""  # ms since navigation began
app = typer.Typer(add_completion=False)


@app.command()
def size(
    flights: Annotated[list[int], typer.Option()] = [100, 1000, 10000],  # noqa: B006
    airframes_: Annotated[int, typer.Option("--airframes")] = 50,
    seed: int = 1000,
) -> None:
    """Measure processor seconds to add flights, to add one more and to show all, and the page's size."""
    print(markdown(size_records(flights, airframes_, seed)))


def size_records(flights: Sequence[int], airframes_: int, seed: int) -> list[Record]:
    """Return records for each number of flights, with the exponent by which the time to show them grows."""
    rng, records = np.random.default_rng(seed), list[Record]()
    like, before = RowModel(measured_row()), None
    for total in flights:
        with tempfile.TemporaryDirectory() as folder:
            dataset, added = Dataset(folder), 0.0
            for i in range(airframes_):
                polar = POLAR * (1 + AMONG * rng.standard_normal())
                new_flights = flights_of(
                    f"airframe-{i:02d}", seed + i, max(total // airframes_, 1), polar=polar, like=like
                )
                start = time.process_time()
                dataset.add(new_flights)
                added += time.process_time() - start
            later = flights_of("airframe-00", seed - 1, 1, like=like)
            start = time.process_time()
            dataset.add(later)
            one_more = time.process_time() - start
            start = time.process_time()
            results = fleet_results(airframes(dataset, 1.0, []), [])
            page = render_fleet(results)
            show_s = time.process_time() - start
            disk = sum(path.stat().st_size for path in Path(folder).rglob("*.parquet"))
        memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        growth = np.log(show_s / before[1]) / np.log(total / before[0]) if before else np.nan
        before = (total, show_s)
        records.append({
            "flights": total, "airframes": airframes_, "added, s": rounded(added, 1),
            "one more, s": rounded(one_more, 2), "shown, s": rounded(show_s, 1),
            "exponent of it": rounded(growth, 2), "bytes a flight": rounded(disk / total),
            "page, MB": rounded(len(page) / 1e6, 1), "memory, MB": rounded(memory),
        })  # fmt: skip
    return records


@app.command()
def page(
    flights: int = 10_000,
    airframes_: Annotated[int, typer.Option("--airframes")] = 50,
    rounds: int = 5,
    seed: int = 1000,
) -> None:
    """Measure the time until Chromium has drawn a fleet's page, as a median of rounds; 2 s are required."""
    like, rng = RowModel(measured_row()), np.random.default_rng(seed)
    fleet = []
    for i in range(airframes_):
        polar = POLAR * (1 + AMONG * rng.standard_normal())
        new_flights = flights_of(f"airframe-{i:02d}", seed + i, flights // airframes_, polar=polar, like=like)
        fleet.append(airframe(f"airframe-{i:02d}", "", [read_statistics(flight) for flight in new_flights], 1.0))
    with tempfile.TemporaryDirectory() as folder, browser.started() as window:
        file = Path(folder) / "fleet.html"
        file.write_text(render_fleet(fleet_results(fleet, [])), "utf-8")
        lines = []
        for _ in range(rounds):
            window.show(file, 1280)
            window.wait_for("performance.getEntriesByName('first-contentful-paint').length")
            lines.append(window.value_of(OPENED))
        size = file.stat().st_size / 1e6
    record: Record = {"flights": flights, "airframes": airframes_, "page, MB": rounded(size, 1)}
    record |= {
        f"{name}, s": rounded(np.median(of_rounds) / 1000, 2)
        for name, of_rounds in zip(("first paint", "DOM complete", "loaded"), zip(*lines, strict=True), strict=True)
    }
    print(markdown([record | {"within 2 s": "met" if record["loaded, s"] < 2 else "not met"}]))


@app.command()
def changes(
    airframes_: Annotated[int, typer.Option("--airframes")] = 40,
    seed: int = 1000,
    noise: list[float] = [1.0],  # noqa: B006
) -> None:
    """Measure the delay to the first alarm after a change, the cause it names, and false alarms in a year.

    Next to both are the values from theory: the first flight after which the detector's mean statistic exceeds its
    limit, and the rate of false alarms for which the limit was set.
    """
    print(markdown(change_records(airframes_, seed, noise)))


def change_records(airframes_: int, seed: int, noise: Sequence[float]) -> list[Record]:
    """Return for each change: airframes that show it, flights until then, and the rate of false alarms.

    The counting error of a count k of n is sqrt(k (n - k) / n); for the rate it follows from the root of the count.
    """
    records = []
    for factor in noise:
        like = RowModel(measured_row(), factor)
        like_these = series(joint_pool(flights_of("one", seed, 10, like=like)))
        for name, drag, thrust, slowly in CASES:
            count = BEFORE + A_YEAR
            grown = np.clip((np.arange(count) - BEFORE) / A_YEAR, 0, 1) if slowly else np.arange(count) >= BEFORE
            delays, right, false = [], 0, 0
            by_theory = expected_delay(like_these, grown, (drag, thrust))
            for i in range(airframes_):
                new_flights = flights_of("one", seed + i, count, drag=drag * grown, thrust=thrust * grown, like=like)
                changes = find_changes(series(joint_pool(new_flights)), np.arange(float(count)), A_YEAR)
                early = [change for change in changes if change.detected < BEFORE]
                late = [change for change in changes if change.detected >= BEFORE]
                false += len(changes) if name == "none" else len(early)
                if late and name != "none":
                    delays.append(late[0].detected - BEFORE + 1)
                    right += late[0].what is (What.DRAG if drag else What.PROPULSION)
            flown = airframes_ * (count if name == "none" else BEFORE)
            record: Record = {"change": name, "noise": factor, "airframes": airframes_}
            if name != "none":
                record |= {"found": len(delays), "flights until then, median": rounded(np.median(delays or [np.nan])),
                           "by theory": by_theory, "named right": right}  # fmt: skip
            rate = A_YEAR / flown
            records.append(record | {f"false alarms in {A_YEAR} flights": rounded(false * rate, 2),
                                     "±": rounded(np.sqrt(max(false, 1)) * rate, 2), "accepted": 1})  # fmt: skip
    columns = list(dict.fromkeys(name for record in records[::-1] for name in record))
    return [{name: record.get(name) for name in columns} for record in records]


def expected_delay(of_flights: Series, grown: NDArray[np.float64], change: tuple[float, float]) -> int | None:
    """Return how many flights after a change the detector's mean statistic exceeds its limit; None if it never does.

    grown : (n,) fraction of the change reached in each of n flights that are like the mean of `of_flights`. Errors
    shared by all flights move all of them alike and cancel. For the best step or drift the statistic is chi-square,
    with as many degrees of freedom as the change has parts. Its noncentrality is the change squared over the covariance
    of one flight, times the sum of squares of `grown` about its mean (Basseville and Nikiforov 1993, sec. 7.2.4).
    """
    seen = of_flights.by_truth.mean(axis=0) @ change
    of_one = float(seen @ np.linalg.solve(of_flights.errors.own.mean(axis=0), seen))
    limit = least_gain(A_YEAR) - len(change)
    passed = (n for n in range(BEFORE + 1, len(grown) + 1) if of_one * n * np.var(grown[:n]) > limit)
    return next((n - BEFORE for n in passed), None)


@app.command()
def coverage(
    airframes_: Annotated[int, typer.Option("--airframes")] = 50,
    flights: Annotated[int, typer.Option(help="Of each airframe.")] = 10,
    draws: Annotated[int, typer.Option(help="Fleets.")] = 20,
    seed: int = 1000,
) -> None:
    """Measure how often intervals of `fleet show` contain the truth: each airframe, the mean, another airframe."""
    print(markdown(coverage_records(airframes_, flights, draws, seed)))


def coverage_records(airframes_: int, flights: int, draws: int, seed: int) -> list[Record]:
    """Return shares of covered speeds with counting errors: one share per airframe, for the others one per fleet.

    95 % within 2 % is required; the counting error is added to this tolerance.
    """
    like, errors = RowModel(measured_row()), defaultdict[str, list[float]](list)
    widths, zero = defaultdict[str, list[float]](list), np.zeros((len(POLAR), len(POLAR)))
    for draw in range(draws):
        rng = np.random.default_rng(seed + draw)
        polars = [POLAR * (1 + AMONG * rng.standard_normal()) for _ in range(airframes_ + 1)]
        fleet = []
        for i, polar in enumerate(polars[:-1]):
            new_flights = flights_of(f"{i:02d}", int(rng.integers(2**31)), flights, polar=polar, like=like)
            fleet.append(airframe(f"{i:02d}", "", [read_statistics(flight) for flight in new_flights], 1.0))
        curve = fleet_curve(fleet)
        first_pool = fleet[0].pool
        V, condition = first_pool.curve.V_mps, first_pool.condition
        compared = [
            ("each airframe", airframe.pool.polar, polar) for airframe, polar in zip(fleet, polars, strict=False)
        ]
        compared += [("mean of the fleet", curve.mean, POLAR), ("another airframe", curve.of_another, polars[-1])]
        for name, polar_reported, polar in compared:
            power, error = power_required(V, polar_reported, condition)
            true, _ = power_required(V, Polar(polar, zero), condition)
            errors[name].append(float(np.mean(np.abs(power - true) < NORMAL_95 * error)))
            widths[name].append(float(np.mean(100 * NORMAL_95 * error / true)))
    records = []
    for name, shares in errors.items():
        share, error = counted(shares)
        records.append({
            "interval": name, "drawn": len(shares), "half width, %": rounded(np.mean(widths[name]), 2),
            "coverage, %": rounded(share, 1), "±": rounded(error, 1),
            "93 to 97 %": "met" if abs(share - 95) < 2 + error else "not met",
        })  # fmt: skip
    return records


@app.command()
def generator(
    flights: int = 30,
    first: Annotated[int, typer.Option("--seed", help="The first of three campaigns of benchmarks/campaigns.py.")] = 41,
    noise: list[float] = [1.0],  # noqa: B006
    file: Annotated[Path, typer.Option(help="Where flights are kept.")] = Path("out/fleet-flights.jsonl"),
    fly: Annotated[bool, typer.Option(help="Fly what is missing; or take what is in the file.")] = True,
    keep: Annotated[bool, typer.Option(help="Take the mean of their rows for all flights drawn from now on.")] = False,
) -> None:
    """Compare simulated and analyzed flights of three airframes (21 minutes in 3 kt) with 30 drawn airframes."""
    study = campaigns.Study(["study"], [3.0], range(first, first + 3), {"A": flights // 3})
    flown = defaultdict[int, list[dict[str, Any]]](list)
    for line in campaigns.flown(study, file, 1) if fly else simulated_flights.known_lines(file):
        if "results" in line:
            flown[line["campaign"]].append(line["results"])
    if keep:
        rows = [read_statistics(content) for of_airframe in flown.values() for content in of_airframe]
        FILE.write_text(written(mean_row(rows), "python benchmarks/fleet.py generator --keep"), "utf-8")
    print(markdown(generator_records(list(flown.values()), noise)))


def generator_records(flown: Sequence[list[dict[str, Any]]], noise: Sequence[float]) -> list[Record]:
    """Return mean and spread of each figure, and the difference of the means over its standard error.

    It is met below the size that chance gives once in 100 such sets of comparisons.
    """
    real, row, records = figures_of(flown), measured_row(), []
    figures_by_factor = {
        factor: figures_of([flights_of("one", 1000 + i, 10, like=RowModel(row, factor)) for i in range(30)])
        for factor in noise
    }
    limit = norm.isf(0.01 / (2 * len(real)))
    for name, figure in real.items():
        record: Record = {"figure": name, f"of {len(figure)} flights": _mean_and_spread(figure)}
        for factor, figures in figures_by_factor.items():
            other = figures[name]
            error = np.sqrt(figure.var(ddof=1) / len(figure) + other.var(ddof=1) / len(other))
            z = (figure.mean() - other.mean()) / error
            record[f"drawn, noise {factor:g}"] = _mean_and_spread(other)
            verdict = "met" if abs(z) < limit else "not met"
            record |= {f"z, {factor:g}": rounded(z, 1), f"z below {limit:.1f}, {factor:g}": verdict}
        records.append(record)
    return records


def _mean_and_spread(figure: NDArray[np.float64]) -> str:
    return f"{figure.mean():.2f} ± {figure.std(ddof=1):.2f}"


def figures_of(fleet: Iterable[list[dict[str, Any]]]) -> dict[str, NDArray[np.float64]]:
    """Return figures (flights,): drag and thrust from each flight of an airframe, and the scatter of its estimates."""
    by_name = defaultdict[str, list[float]](list)
    for of_airframe in fleet:
        values, by_truth, errors = series(joint_pool(of_airframe))
        n, sigma, weights = len(values), np.sqrt(np.einsum("fkk->fk", errors.own)), np.linalg.inv(errors.own)
        mean = np.linalg.solve(weights.sum(axis=0), np.einsum("fij,fj->i", weights, values))
        residual = (values - mean) * np.sqrt(n / (n - 1))
        for k, name in enumerate(("drag", "thrust")):
            by_name[f"stated error of {name}, %"] += (100 * sigma[:, k]).tolist()
            by_name[f"share of a change of {name} that is seen"] += by_truth[:, k, k].tolist()
            by_name[f"(scatter of {name} / its stated error)²"] += ((residual[:, k] / sigma[:, k]) ** 2).tolist()
        by_name["correlation of both errors"] += (errors.own[:, 0, 1] / sigma.prod(axis=1)).tolist()
        by_name["misfit of both: chi-square by degree"] += (
            np.einsum("fi,fij,fj->f", residual, weights, residual) / 2
        ).tolist()
    return {name: np.array(of_flights) for name, of_flights in by_name.items()}


@app.command()
def cluster(
    flights: int = 300,
    logs: Annotated[int, typer.Option(help="Simulated flights that are copied, with other weights.")] = 30,
    out: Annotated[Path, typer.Option(help="Folder to work in.")] = Path("out/fleet"),
) -> None:
    """Analyze logs in a store that speaks S3 by two workers, one of which is killed and started again."""
    out.mkdir(parents=True, exist_ok=True)
    logs_in_store = many_logs.copies(many_logs.simulated(out, logs), out / f"logs-{flights}", flights)
    local, remote, address = out / "local", out / "cluster", f"tcp://127.0.0.1:{many_logs.PORT}"
    for old in (local, remote):
        shutil.rmtree(old, ignore_errors=True)
    dask = [str(many_logs.SCRIPTS / "dask")]
    scheduler = [*dask, "scheduler", "--port", str(many_logs.PORT), "--no-dashboard"]
    worker = [*dask, "worker", address, "--nthreads", "1", "--no-dashboard", "--no-nanny"]
    worker += ["--local-directory", str(out / "dask")]
    with s3_server.running() as store, (out / "dask.log").open("w") as log_file:
        store.objects |= {f"fleet/{path.name}": path.read_bytes() for path in logs_in_store}
        os.environ |= store.environment

        def begin(words: list[str]) -> subprocess.Popen[bytes]:
            return subprocess.Popen(words, stdout=log_file, stderr=log_file, start_new_session=True)

        def done(share: float, process: subprocess.Popen[bytes]) -> None:
            many_logs.wait_for(lambda: len(many_logs.written_at(remote)) >= share * flights, process)

        seconds = many_logs.analyze(["s3://fleet/"], local)
        started = [begin(scheduler)]
        try:
            time.sleep(10)
            started += [begin(worker), begin(worker)]
            words = many_logs.command(*many_logs.ANALYZE, "s3://fleet/", "-o", remote, "-q", "--scheduler", address)
            with subprocess.Popen(words) as process:
                done(1 / 3, process)
                started[-1].kill()
                done(1 / 2, process)
                started.append(begin(worker))
            print(
                f"{flights} logs of {logs} simulated flights in a store: by this computer in {seconds:.0f} s; by two"
                f" workers, one killed with a third done and started again with a half: exit code {process.returncode},"
                f" {len(many_logs.contents(remote))} files {many_logs.equal(remote, local)}"
            )
        finally:
            for computer in started:
                computer.kill()
                computer.wait()


@app.command()
def listing(keys: int = 100_000) -> None:
    """Measure time and memory to list a bucket and name the folders of its logs."""
    with s3_server.running() as store:
        store.objects |= {f"fleet/airframe-{i % 50:02d}/{i:06d}.mcap": b"1" for i in range(keys)}
        os.environ |= store.environment
        start = time.process_time()
        logs = find_logs(["s3://fleet/"])
        listed = time.process_time() - start
        count = len(set(names([place(log) for log in logs.logs])))
        named = time.process_time() - start - listed
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(
        f"{count} logs: listed in {listed:.1f} s of processor time, the store's included, with"
        f" {store.requests['fleet']} requests; named in {named:.1f} s; at most {memory:.0f} MB"
    )


if __name__ == "__main__":
    app()
