"""Repeats each result of the source's chapters 4 and 7 that a log can show, on simulated flights: `make dissertation`.

    python benchmarks/dissertation.py
    python benchmarks/dissertation.py --docs      also write the figures shown in dissertation.md into docs/figures

It flies Astraeus LS, HS and Nexstar (seed 1001), writes their logs, analyzes the logs with `--likelihood`, and draws
figures. Flights and analyses are kept in out/dissertation/flights and not repeated; remove the folder to start over.
The tables are printed and written to out/dissertation/tables.md.
"""

import json
import shutil
import warnings
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path
from typing import Annotated

import dissertation_figures as figures
import estimation
import numpy as np
import typer
from dissertation_flights import (
    AIRCRAFT,
    COEFFICIENTS,
    FLIGHTS,
    NOISE_FACTORS,
    FlightFigures,
    FlightName,
    flight_figures,
    true_estimates,
)
from records import Record, markdown, rounded
from rich.console import Console
from rich.progress import track
from simulation_figures import picture

from flightpower.flight.aircraft import load_aircraft

OUT, DOCS = Path("out/dissertation"), Path("docs/figures")
FACTORS, DRAWS = (0.5, 1.0, 1.5), 3
FT_LBF_PER_S_W = 1.3558
Flights = dict[FlightName, FlightFigures]


def significance_limits(folder: Path) -> dict[str, list[tuple[float, float]]]:
    """Return Fig. 4.12 for the Astraeus HS by maneuver: noise factors, and SNRs above which C_Lq is significant."""
    cache = folder / "significance.json"
    if not cache.exists():
        aircraft = load_aircraft("astraeus-hs")
        limits = {
            name: [(factor, estimation.significance_limit(aircraft, run, factor, DRAWS).snr) for factor in FACTORS]
            for name, run in estimation.maneuvers("astraeus-hs").items()
        }
        cache.write_text(json.dumps(limits), "utf-8")
    return {name: [(f, snr) for f, snr in points] for name, points in json.loads(cache.read_text("utf-8")).items()}


def of_curve(flight: FlightFigures, method: str) -> Record:
    """Return a curve's largest errors of power, and the share of speeds whose 95 % interval contains the truth."""
    curve = flight.curves.get(method)
    if curve is None:
        return {}
    truth = np.interp(curve.V, flight.truth.V, flight.truth.power)
    error = curve.power - truth
    middle = np.abs(error)[len(error) // 4 : -len(error) // 4].max()
    return {
        "largest error, %": rounded(100 * np.abs(error / truth).max(), 1),
        "in the middle half of the speeds, W": rounded(middle, 1),
        "speeds covered, %": rounded(100 * np.mean(np.abs(error) <= curve.half)),
    }


def tables(flights: Flights, limits: dict[str, list[tuple[float, float]]]) -> dict[str, list[Record]]:
    """Return tables by name: curves, significance of C_Lq by run, noise, estimates, limits, noise against error."""
    curves, significance = [], []
    for name, flight in flights.items():
        methods = ["piw-viw"] if name.plan == "steady-points" else ["dynamic", "two-state", "force-models"]
        setup = {"aircraft": name.aircraft, "plan": name.plan, "noise": name.noise}
        curves += [{**setup, "method": method, **of_curve(flight, method)} for method in methods]
        significance += [{**setup, "run": fit.run, "SNR of q": rounded(fit.snr, 1), "C_Lq": rounded(fit.CLq, 1),
                          "t": rounded(fit.t_CLq, 1)} for fit in flight.fits]  # fmt: skip
        significance.append({**setup, "run": "all runs", "t": rounded(flight.t_CLq, 1)})
    channels, estimates = [], []
    for title, aircraft in AIRCRAFT.items():
        flight = flights[FlightName(aircraft, "two-pairs")]
        for channel in ("ax", "az", "q", "alpha", "V"):
            means = {
                kind: rounded(
                    np.mean([noise[channel] for run, noise in flight.noise.items() if run.startswith(kind)]), 5
                )
                for kind in ("standing", "acceleration", "deceleration")
            }
            channels.append({"aircraft": title, "channel": channel, **means})
        for name in COEFFICIENTS:
            values = np.array([fit.estimates[name] for fit in flight.fits])
            mean, white, colored = values.mean(axis=0)
            estimates.append({
                "aircraft": title, "parameter": name, "true": rounded(true_estimates(aircraft)[name], 3),
                "mean of the runs": rounded(mean, 3), "standard error": rounded(white, 3),
                "colored": rounded(colored, 3), "scatter": rounded(values[:, 0].std(ddof=1), 3),
            })  # fmt: skip
    by_noise = []
    for factor in NOISE_FACTORS:
        flight, rows = flights[FlightName("nexstar", "two-pairs", factor)], []
        for fit in flight.fits:
            truth = np.interp(fit.curve.V, flight.truth.V, flight.truth.power)
            rows.append(100 * np.abs(fit.curve.power / truth - 1).max())
        of_dynamic = of_curve(flight, "dynamic").get("largest error, %")
        by_noise.append({"noise": factor, "each run by two states, %": rounded(rows, 1), "dynamic, %": of_dynamic})
    of_limits = [{"maneuver": name, "noise": factor, "significant above an SNR of": rounded(snr, 2)}
                 for name, points in limits.items() for factor, snr in points]  # fmt: skip
    return {"curves": curves, "significance": significance, "channels": channels, "estimates": estimates,
            "limits": of_limits, "by_noise": by_noise}  # fmt: skip


def analyzed(folder: Path, jobs: int = 1) -> tuple[Flights, dict[str, list[tuple[float, float]]]]:
    """Return all flights, which are flown and analyzed if the folder lacks them, and the limits of significance."""
    cache = folder / "flights"
    cache.mkdir(parents=True, exist_ok=True)
    with ProcessPoolExecutor(jobs) as pool:
        limits = pool.submit(significance_limits, folder)
        done = track(
            pool.map(partial(figures_quietly, folder=cache), FLIGHTS),
            "flights",
            len(FLIGHTS),
            console=Console(stderr=True),
        )
        return dict(zip(FLIGHTS, done, strict=True)), limits.result()


def figures_quietly(name: FlightName, folder: Path) -> FlightFigures:
    """Run `flight_figures` without warnings about means over gaps in a channel."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return flight_figures(name, folder)


def main(
    docs: Annotated[bool, typer.Option("--docs", help="Copy the figures to docs/figures as well.")] = False,
) -> None:
    progress = Console(stderr=True)
    flights, limits = analyzed(OUT)
    figures_by_name = {name: draw(flights) for name, draw in figures.FIGURES.items()}
    figures_by_name["7-8-snr"] = figures.signal_to_noise(flights, limits)
    for name, figure in track(figures_by_name.items(), "figures", console=progress):
        path = OUT / f"dissertation-{name}.png"
        picture(figure, path)
        if docs:
            shutil.copy(path, DOCS / path.name)
    text = "\n\n".join(markdown(records) for records in tables(flights, limits).values())
    (OUT / "tables.md").write_text(text + "\n", "utf-8")
    print(text)
    print(f"{OUT}: {len(figures_by_name)} figures, tables.md")


if __name__ == "__main__":
    typer.run(main)
