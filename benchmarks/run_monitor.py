"""Compares runs that the daemon calls good in flight with those that the analysis finds; measures a tick's cost.

    python benchmarks/run_monitor.py --flights 4 --seed 1000

The simulated flights are `full-test-flight` in calm air, 3 kt and 15 kt. A stretch is an interval that the analysis
lists as a run or rejects.
"""

import time
from collections.abc import Iterator
from typing import Annotated, NamedTuple

import flights
import msgspec
import numpy as np
import pandas as pd
import typer

from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.daq.run_monitor import RunMonitor, Verdict
from flightpower.daq.sensors import Sample
from flightpower.daq.tick_means import FIELDS, Means, TickMeans
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.messages import TYPE_OF_TOPIC
from flightpower.flight.probe_maps import ProbeMaps
from flightpower.sim.sensors import load_budget


def samples_of(table: pd.DataFrame) -> Iterator[tuple[int, list[Sample]]]:
    """Yield each tick's time [ns] and the messages that the daemon would have read."""
    for t_s, row in zip(table.index, table.to_dict("records"), strict=True):
        now_ns = round(t_s * 1e9)
        yield (
            now_ns,
            [
                Sample(topic, now_ns, TYPE_OF_TOPIC[topic](**{field: row[name] for name, field in fields}))
                for topic, fields in FIELDS.items()
            ],
        )


class Monitored(NamedTuple):
    """The monitor's reports on one flight, and its processor times [s] per tick and per mean."""

    verdicts: list[Verdict]
    texts: list[str]
    monitor: RunMonitor
    adding_s: list[float]
    judging_s: list[float]


def monitored(table: pd.DataFrame, aircraft: Aircraft, probe: ProbeMaps) -> Monitored:
    """Feed a flight to the monitor tick by tick."""
    monitor, means = RunMonitor(aircraft, probe), TickMeans()
    verdicts: list[Verdict] = []
    texts, adding, judging = [], [], []
    for now_ns, samples in samples_of(table):
        begin = time.thread_time()
        finished = means.add(now_ns, samples)
        adding.append(time.thread_time() - begin)
        if finished is None:
            continue
        finished = msgspec.json.decode(msgspec.json.encode(finished), type=Means)
        begin = time.thread_time()
        new_verdicts = monitor.add(finished)
        verdicts += new_verdicts
        for verdict in new_verdicts:
            texts.append(verdict.text)
            if verdict.good:
                texts.append(monitor.interval_text())
        judging.append(time.thread_time() - begin)
    return Monitored(verdicts, texts, monitor, adding, judging)


def overlap(a: tuple[float, float], b: tuple[float, float]) -> float:
    """Return the overlap of two intervals, as a fraction of the shorter one."""
    return (min(a[1], b[1]) - max(a[0], b[0])) / max(1e-9, min(a[1] - a[0], b[1] - b[0]))


def last_word(kind: str, start_s: float, end_s: float, verdicts: list[Verdict]) -> Verdict | None:
    """Return the last verdict on a stretch; None if there was none."""
    near = [v for v in verdicts if v.kind == kind and overlap((v.start_s, v.end_s), (start_s, end_s)) > 0.5]
    return near[-1] if near else None


def main(
    count: Annotated[int, typer.Option("--flights", help="For each wind.")] = 4,
    first_seed: Annotated[int, typer.Option("--seed", help="Development uses those below 1000.")] = 0,
    aircraft_name: Annotated[str, typer.Option("--aircraft")] = "nexstar",
    plan: Annotated[str, typer.Option(help="A plan of the simulator.")] = "full-test-flight",
    winds: Annotated[str, typer.Option(help="W20 [kt], separated by commas.")] = "0,3,15",
    show: Annotated[bool, typer.Option("--show", help="Print what the pilot reads, and each disagreement.")] = False,
) -> None:
    """Fly, monitor, analyze and compare."""
    aircraft, calibration = load_aircraft(aircraft_name), flights.tunnel_probe()
    probe = msgspec.json.decode(msgspec.json.encode(calibration), type=ProbeMaps)
    adding, judging, ticks = [], [], 0
    columns = [
        "W20, kt",
        "flights",
        "runs",
        "runs announced as good",
        "announced as good, but no run",
        "rejected, and announced as lost",
        "error, %",
    ]
    print("| " + " | ".join([*columns, "half width, %"]) + " |\n" + 8 * "|---" + "|")
    for kt in map(float, winds.split(",")):
        runs = agreed = wrongly_good = lost = 0
        errors, widths = [], []
        for seed in range(first_seed, first_seed + count):
            flown = flights.flown(aircraft, flights.draw_errors(load_budget("study"), seed), plan, seed, kt)
            verdicts = monitored(flown.table, aircraft, probe)
            air, _, _ = flights.air_of(flown.table, aircraft, calibration)
            accepted, rejected = find_runs(air)
            words = [last_word(run.kind, run.start_s, run.end_s, verdicts.verdicts) for run in accepted]
            runs += len(accepted)
            agreed += sum(word is not None and word.good for word in words)
            reported = {word for word in words if word is not None}
            for verdict in verdicts.verdicts:
                superseded = last_word(verdict.kind, verdict.start_s, verdict.end_s, verdicts.verdicts) is not verdict
                wrongly_good += verdict.good and verdict not in reported and not superseded
            of_rejected = [last_word(r.kind, r.start_s, r.end_s, verdicts.verdicts) for r in rejected]
            lost += sum(word is not None and not word.good for word in of_rejected)
            if show:
                print(kt, seed, *verdicts.texts, sep="\n  ")
                for run, word in zip(accepted, words, strict=True):
                    if word is None or not word.good:
                        print("  MISSED", run.kind, run.start_s, run.end_s, word)
                for verdict in verdicts.verdicts:
                    if verdict.good and verdict not in reported:
                        near = [r for r in rejected if overlap((r.start_s, r.end_s), verdict[1:3]) > 0.3]
                        print("  WRONGLY GOOD", verdict, near)
            interval = verdicts.monitor.energy.at_endurance_speed(
                verdicts.monitor.slowest_mps, verdicts.monitor.fastest_mps
            )
            if interval is not None:
                truth = flown.flight.power_required
                V = interval.speed_mps
                power = verdicts.monitor.energy.power_W(V, aircraft.mass_kg)
                errors.append(100 * (power / float(np.interp(V, truth["speed_mps"], truth["power_W"])) - 1))
                widths.append(100 * interval.half_width)
            adding += verdicts.adding_s
            judging += verdicts.judging_s
            ticks += len(flown.table)
        row = f"{np.mean(errors):+.1f} ± {np.std(errors):.1f} | {np.median(widths):.1f}" if errors else " | "
        print(f"| {kt:g} | {count} | {runs} | {agreed} | {wrongly_good} | {lost} | {row} |")
    for where, seconds in (("sampling thread, each tick", adding), ("telemetry's process, each fifth tick", judging)):
        median, mean, most = 1e6 * np.median(seconds), 1e6 * np.mean(seconds), 1e6 * np.percentile(seconds, 99.9)
        print(f"{where}: median {median:.0f} us, mean {mean:.0f} us, 99.9 % below {most:.0f} us")
    print(f"both, of a tick: mean {1e6 * (np.sum(adding) + np.sum(judging)) / ticks:.0f} us")


if __name__ == "__main__":
    typer.run(main)
