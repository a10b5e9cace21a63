"""Errors and intervals of the curve by an aircraft file of four keys, and by one with all of them.

    .venv/bin/python benchmarks/own_aircraft.py --flights 20

Simulated flights (without buses) of Nexstars that differ in what the short file lacks: upwash at the probe, places of
probe and IMU, each drawn evenly. The same log is analyzed with the aircraft file that it carries, and with one of name,
span, wing area and weight.
"""

import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import estimators
import flights
import numpy as np
import typer
from chain import compared, read_results, run
from rich.console import Console

from flight.aircraft import load_aircraft

FOUR_KEYS = """name = "mine"
[geometry]
span = "5.73 ft"
wing_area = "4.99 ft^2"
[mass]
weight = "8.47 lbf"
"""
FLIGHTPOWER = (sys.executable, "-m", "flightpower")
UPWASH_DEG, PROBE_M, IMU_M = (0.0, 2.0), (0.1, 0.6), (-0.1, 0.1)


def drawn_aircraft(seed: int) -> str:
    """The text of the Nexstar's file with another installation of probe and IMU."""
    rng = np.random.default_rng(seed)
    upwash, ahead = rng.uniform(*UPWASH_DEG), rng.uniform(*PROBE_M)
    imu = ", ".join(f'"{place:.3f} m"' for place in rng.uniform(*IMU_M, 3))
    text = load_aircraft("nexstar").text
    for old, new in (
        ('upwash_per_CL = "1.0 deg"', f'upwash_per_CL = "{upwash:.3f} deg"'),
        ('position = ["0.45 m",', f'position = ["{ahead:.3f} m",'),
        ('imu_position = ["0.05 m", "0.0 m", "0.02 m"]', f"imu_position = [{imu}]"),
    ):
        assert old in text
        text = text.replace(old, new)
    return text


def one_flight(folder: Path, plan: str, errors: str, seed: int, V: np.ndarray) -> np.ndarray:
    """Errors and half intervals, % of the truth, by all keys and by four: (2, 2, speeds)."""
    folder.mkdir()
    (folder / "nexstar.toml").write_text(drawn_aircraft(seed), "utf-8")
    (folder / "four.toml").write_text(FOUR_KEYS, "utf-8")
    run(*FLIGHTPOWER, "sim", "fly", "--aircraft", folder / "nexstar.toml", "--plan", plan, "--errors", errors, "--seed",
        seed, "--no-hardware", "--probe", folder.parent / "probe.json", "-o", folder / "out")  # fmt: skip
    log = folder / "out" / "log.mcap"
    run(*FLIGHTPOWER, "analyze", log, "--quiet", "-o", folder / "all")
    run(*FLIGHTPOWER, "analyze", log, "--quiet", "-o", folder / "four", "--aircraft", folder / "four.toml")
    log.unlink()
    truth = np.loadtxt(folder / "out" / "truth_power_required.csv", delimiter=",", skiprows=1, usecols=(0, 1))
    return np.stack([compared(read_results(folder / name), truth, V) for name in ("all", "four")])


def main(
    plan: Annotated[str, typer.Option(help="Flight plan.")] = "accel-decel",
    errors: Annotated[str, typer.Option(help="Error budget.")] = "study",
    count: Annotated[int, typer.Option("--flights", help="How many.")] = 20,
    first_seed: Annotated[int, typer.Option("--seed", help="The first seed.")] = 0,
    jobs: Annotated[int, typer.Option(help="Flights at a time.")] = 2,
) -> None:
    V = estimators.speeds(load_aircraft("nexstar"))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run(*FLIGHTPOWER, "sim", "tunnel", "-o", folder / "tunnel.csv")
        run(*FLIGHTPOWER, "calibrate", "probe", folder / "tunnel.csv", "-o", folder / "probe.json")
        with ThreadPoolExecutor(jobs) as pool:
            found = np.array(
                list(
                    pool.map(
                        lambda seed: one_flight(folder / str(seed), plan, errors, seed, V),
                        range(first_seed, first_seed + count),
                    )
                )
            )
    console = Console(width=120)
    console.print(
        f"{errors}, {plan}, {count} flights from seed {first_seed}; at " + " / ".join(f"{v:.1f}" for v in V) + " m/s"
    )
    for title, both in (("all keys", found[:, 0]), ("four keys", found[:, 1])):
        for name, values, form in flights.error_rows(both[:, 0], both[:, 1]):
            console.print(f"{title:9}  {name:24} " + " / ".join(form.format(value) for value in values))
    wider = found[:, 1, 1] / found[:, 0, 1]
    median = " / ".join(f"{100 * (ratio - 1):.0f}" for ratio in np.nanmedian(wider, axis=0))
    console.print(
        f"intervals by four keys are wider in {np.mean(wider[np.isfinite(wider)] > 1):.0%} of flights and speeds, by"
        f" {median} % in the median;"
        f" in {np.mean(np.nanmean(wider, axis=1) > 1):.0%} of flights in the mean over the speeds"
    )


if __name__ == "__main__":
    typer.run(main)
