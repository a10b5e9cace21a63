"""Whether reports of simulated flights name a speed below the slowest one flown.

    .venv/bin/python benchmarks/slowest_speed.py --flights 50

Each flight is simulated without buses and analyzed, with another aircraft, air and set of errors; short plans, since
the shorter a flight, the wider the intervals of its best speeds. Whatever `below_slowest` finds is printed.
"""

import tempfile
from importlib import resources
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import typer
from chain import run
from named_speeds import below_slowest
from own_aircraft import FLIGHTPOWER

from analysis.schema import Results

AIRCRAFT = ("nexstar", "astraeus-ls", "light-1kg", "survey-6kg")
TURBULENCE_KT = (0.0, 3.0, 8.0)
PLANS = ("accel-decel", "steady-points")
REFUSED = "refused"


def one_flight(folder: Path, seed: int) -> list[str]:
    """What the report of a flight drawn by the seed names below the slowest speed flown."""
    rng = np.random.default_rng(seed)
    aircraft, plan, turbulence_kt = (str(rng.choice(choices)) for choices in (AIRCRAFT, PLANS, TURBULENCE_KT))
    folder.mkdir()
    text = (resources.files("sim") / "plans" / f"{plan}.toml").read_text("utf-8")
    (folder / "plan.toml").write_text(text.replace("[air]\n", f'[air]\nturbulence = "{turbulence_kt} kt"\n'), "utf-8")
    run(*FLIGHTPOWER, "sim", "fly", "--aircraft", aircraft, "--plan", folder / "plan.toml", "--errors", "study",
        "--seed", seed, "--no-hardware", "--probe", folder.parent / "probe.json", "-o", folder / "out")  # fmt: skip
    log, report = folder / "out" / "log.mcap", folder / "report"
    if not run(*FLIGHTPOWER, "analyze", log, "--quiet", "-o", report, may_refuse=True):
        return [REFUSED]
    log.unlink()
    results = msgspec.json.decode((report / "results.json").read_bytes(), type=Results)
    return [f"{aircraft}, {plan}, {turbulence_kt} kt, seed {seed}: {found}" for found in below_slowest(results)]


def main(
    count: Annotated[int, typer.Option("--flights", help="How many.")] = 50,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed.")] = 0,
) -> None:
    refused = 0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(*FLIGHTPOWER, "sim", "tunnel", "-o", folder / "tunnel.csv")
        run(*FLIGHTPOWER, "calibrate", "probe", folder / "tunnel.csv", "-o", folder / "probe.json")
        for seed in range(first_seed, first_seed + count):
            found = one_flight(folder / str(seed), seed)
            refused += found == [REFUSED]
            print(f"seed {seed}: {len(found)}", *found, sep="\n  ", flush=True)
    print(f"{count} flights from seed {first_seed}, {refused} refused")


if __name__ == "__main__":
    typer.run(main)
