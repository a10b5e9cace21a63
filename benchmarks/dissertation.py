"""Every result of the source's chapters 4 and 7 that a log can show, from simulated flights: `make dissertation`.

    python benchmarks/dissertation.py
    python benchmarks/dissertation.py --docs      the figures into docs/figures too, as dissertation.md shows them

Flies Astraeus LS, HS and Nexstar (seed 1001), writes their logs, analyses these with `--likelihood`, and draws. Flights
and analyses are kept in out/dissertation/flights and are not repeated; remove the folder to begin anew. The tables
that docs/evidence/dissertation.md quotes are printed and written to out/dissertation/tables.md.
"""

import json
import shutil
import warnings
from pathlib import Path
from typing import Annotated

import dissertation_figures as figures
import estimation
import numpy as np
import typer
from dissertation_flights import (
    AIRCRAFT,
    FLIGHTS,
    NOISE_FACTORS,
    SHOWN,
    FlightName,
    Shown,
    shown,
    true_estimates,
)
from rich.console import Console
from rich.progress import track
from simulation_figures import picture

from flight.aircraft import load_aircraft

OUT, DOCS = Path("out/dissertation"), Path("docs/figures")
FACTORS, DRAWS = (0.5, 1.0, 1.5), 3
FT_LBF_PER_S_W = 1.3558
Flights = dict[FlightName, Shown]


def significance_limits(folder: Path) -> dict[str, list[tuple[float, float]]]:
    """Fig. 4.12 for the Astraeus HS: by maneuver (factor on the noise, SNR above which C_Lq is significant)."""
    kept = folder / "significance.json"
    if not kept.exists():
        aircraft = load_aircraft("astraeus-hs")
        found = {
            name: [(factor, estimation.significance_limit(aircraft, run, factor, DRAWS).snr) for factor in FACTORS]
            for name, run in estimation.maneuvers("astraeus-hs").items()
        }
        kept.write_text(json.dumps(found), "utf-8")
    return {name: [(f, snr) for f, snr in points] for name, points in json.loads(kept.read_text("utf-8")).items()}


def errors_percent(flight: Shown, method: str) -> str:
    """Largest error of power over the method's speeds, in % and W, and whether its 95 % interval contains the truth."""
    curve = flight.curves.get(method)
    if curve is None:
        return "no estimate | | "
    truth = np.interp(curve.V, flight.truth.V, flight.truth.power)
    error = curve.power - truth
    middle = np.abs(error)[len(error) // 4 : -len(error) // 4].max()
    covered = 100 * np.mean(np.abs(error) <= curve.half)
    return f"{100 * np.abs(error / truth).max():.1f} | {middle:.1f} | {covered:.0f}"


def tables(flights: Flights, limits: dict[str, list[tuple[float, float]]]) -> str:
    lines = ["flight | method | largest error, % | largest in the middle half of the speeds, W | speeds covered, %"]
    lines += ["---|---|---|---|---"]
    for name, flight in flights.items():
        methods = ["piw-viw"] if name.plan == "steady-points" else ["dynamic", "two-state", "force-models"]
        lines += [f"{name} | {method} | {errors_percent(flight, method)}" for method in methods]
    lines += ["", "flight | run | SNR of q | C_Lq | t", "---|---|---|---|---"]
    for name, flight in flights.items():
        lines += [f"{name} | {fit.run} | {fit.snr:.2g} | {fit.CLq:.1f} | {fit.t_CLq:.1f}" for fit in flight.fits]
        lines += [f"{name} | all runs | | | {flight.t_CLq:.1f}"]
    lines += ["", "standard deviation of one sample | at rest | acceleration | deceleration", "---|---|---|---"]
    for title, aircraft in AIRCRAFT.items():
        by_run = flights[FlightName(aircraft, "two-pairs")].noise
        for channel in ("ax", "az", "q", "alpha", "V"):
            means = [
                np.mean([noise[channel] for run, noise in by_run.items() if run.startswith(kind)])
                for kind in ("standing", "acceleration", "deceleration")
            ]
            lines.append(f"{title}, {channel} | " + " | ".join(f"{mean:.3g}" for mean in means))
    lines += ["", "parameter | " + " | ".join(f"{name} | true" for name in AIRCRAFT), "---|" + "---|---|" * 3]
    for name in SHOWN:
        row = [name]
        for aircraft in AIRCRAFT.values():
            fits = flights[FlightName(aircraft, "two-pairs")].fits
            values = np.array([fit.estimates[name] for fit in fits])
            row += [f"{values[:, 0].mean():.3f} ± {values[:, 1].mean():.3f} ({values[:, 2].mean():.3f}), scatter"
                    f" {values[:, 0].std(ddof=1):.3f}", f"{true_estimates(aircraft)[name]:.3f}"]  # fmt: skip
        lines.append(" | ".join(row))
    lines += ["", f"limits of SNR at noise x {FACTORS}: {limits}"]
    lines += ["", "noise | largest error of each run, %", "---|---"]
    for factor in NOISE_FACTORS:
        flight = flights[FlightName("nexstar", "two-pairs", factor)]
        found = []
        for fit in flight.fits:
            truth = np.interp(fit.curve.V, flight.truth.V, flight.truth.power)
            found.append(100 * np.abs(fit.curve.power / truth - 1).max())
        lines.append(f"x {factor:g} | " + ", ".join(f"{x:.1f}" for x in found))
    return "\n".join(lines) + "\n"


def main(
    docs: Annotated[bool, typer.Option("--docs", help="Copy the figures to docs/figures as well.")] = False,
) -> None:
    folder = OUT / "flights"
    folder.mkdir(parents=True, exist_ok=True)
    progress = Console(stderr=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # means over gaps of a channel
        flights = {name: shown(name, folder) for name in track(FLIGHTS, "flights", console=progress)}
    limits = significance_limits(OUT)
    drawn = {name: draw(flights) for name, draw in figures.FIGURES.items()}
    drawn["7-8-snr"] = figures.signal_to_noise(flights, limits)
    for name, figure in track(drawn.items(), "figures", console=progress):
        path = OUT / f"dissertation-{name}.png"
        picture(figure, path)
        if docs:
            shutil.copy(path, DOCS / path.name)
    text = tables(flights, limits)
    (OUT / "tables.md").write_text(text, "utf-8")
    print(text, end="")
    print(f"{OUT}: {len(drawn)} figures, tables.md")


if __name__ == "__main__":
    typer.run(main)
