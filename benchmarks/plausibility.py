"""What the daemon tells of readings that cannot be true together: in sound flights, and with a line of the probe off.

    python benchmarks/plausibility.py --flights 4 --seed 1000

Simulated flights of two plans, budget `study`, logs written directly; each log is fed to `daq.plausibility` as it is,
and with one defect from its middle on. Largest angle: angle of attack less attitude and climb, mean over 20 s of steady
flight.
"""

import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from itertools import groupby
from pathlib import Path
from typing import Annotated

import msgspec
import typer

from flightpower.daq.plausibility import Plausibility
from flightpower.daq.sensors import Sample
from flightpower.flight.log_reader import Log, read_log
from flightpower.flight.messages import Message
from flightpower.flight.probe_maps import ProbeMaps

PLANS = ("accel-decel", "full-test-flight")
WINDS_KT = (0.0, 3.0, 15.0)
DIFFERENCE = "differential_pressure_Pa"
Defect = Callable[[str, Message], Message]


def _pressure(of: str, change: Callable[[float], float]) -> Defect:
    def changed(topic: str, message: Message) -> Message:
        value = getattr(message, DIFFERENCE, None)
        if topic != of or value is None:
            return message
        return msgspec.structs.replace(message, **{DIFFERENCE: change(value)})

    return changed


DEFECTS: dict[str, Defect] = {
    "none": lambda _, message: message,
    "lines of alpha exchanged": _pressure("/probe/alpha", lambda dp: -dp),
    "both lines of alpha off": _pressure("/probe/alpha", lambda _: 0.0),
    "airspeed line off": _pressure("/probe/airspeed", lambda _: 0.0),
}


def ticks_of(log: Log) -> Iterator[tuple[int, list[Sample]]]:
    """Messages by time: what arrived within a tick of 40 ms."""
    entries = sorted((entry.time_ns, topic, entry) for topic, of in log.entries.items() for entry in of)
    for number, tick in groupby(entries, lambda each: each[0] // 40_000_000):
        yield number * 40_000_000, [Sample(topic, time_ns, entry.message) for time_ns, topic, entry in tick]


def doubts_of(log: Log, defect: Defect) -> tuple[Counter[str], float]:
    """How often each comparison was told, and the largest mean difference of the angle of attack [deg]."""
    plausibility = Plausibility(msgspec.json.decode(log.attachments["probe.json"], type=ProbeMaps))
    ticks = list(ticks_of(log))
    middle_ns = (ticks[0][0] + ticks[-1][0]) // 2
    counts: Counter[str] = Counter()
    largest_rad = 0.0
    for now_ns, samples in ticks:
        if now_ns >= middle_ns:
            samples = [sample._replace(message=defect(sample.topic, sample.message)) for sample in samples]
        events = plausibility.add(samples, now_ns)
        counts.update(str(event.compared) for event in events if event.severity == "warning")
        largest_rad = max(largest_rad, abs(plausibility.mean_alpha_difference_rad or 0.0))
    return counts, 57.29578 * largest_rad


def main(
    count: Annotated[int, typer.Option("--flights", help="For each plan and wind.")] = 4,
    first_seed: Annotated[int, typer.Option("--seed", help="Development uses those below 1000.")] = 0,
) -> None:
    totals: dict[str, Counter[str]] = {name: Counter() for name in DEFECTS}
    flights = 0
    with tempfile.TemporaryDirectory() as name:
        for plan in PLANS:
            for kt in WINDS_KT:
                largest = []
                for seed in range(first_seed, first_seed + count):
                    windy = Path(name) / "windy.toml"
                    text = (Path(__file__).parents[1] / "sim" / "plans" / f"{plan}.toml").read_text("utf-8")
                    windy.write_text(
                        text.replace("\n[air]\n", f'\n[air]\nturbulence = "{kt:g} kt"\n' if kt else "\n[air]\n"),
                        "utf-8",
                    )
                    command = ["fly", "--no-hardware", "--replace", "--errors", "study", "--seed", str(seed)]
                    command += ["--plan", str(windy), "-o", str(Path(name) / "flight")]
                    subprocess.run(
                        [sys.executable, "-m", "flightpower", "sim", *command], check=True, capture_output=True
                    )
                    log = read_log(Path(name) / "flight" / "log.mcap")
                    flights += 1
                    for defect, change in DEFECTS.items():
                        counts, largest_deg = doubts_of(log, change)
                        totals[defect].update(dict.fromkeys(counts, 1))
                        largest += [largest_deg] * (defect == "none")
                print(f"{plan} at {kt:g} kt: largest angle {max(largest):.1f} deg in {count} flights", flush=True)
    for defect, counts in totals.items():
        summary = ", ".join(f"{what} in {times}" for what, times in counts.items()) or "nothing"
        print(f"{defect}: of {flights} flights told {summary}")


if __name__ == "__main__":
    typer.run(main)
