"""Measures `analysis.estimation`: accuracy in turbulence, and the identifiability of CLq.

    python benchmarks/estimation.py statistics --seeds 240
    python benchmarks/estimation.py significance

docs/evidence/accuracy.md quotes the output.
"""

import sys
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pandas as pd
import typer
from rich.console import Console
from rich.table import Table
from simulation_figures import runs

from flightpower.analysis.estimation import uncertainty
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.filter_error import fit_filter_error
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.methods import aircraft_models
from flightpower.flight.aircraft import Aircraft, load_aircraft

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "analysis" / "estimation"))
import disturbed
from models import pitch_and_height

CONSOLE = Console(width=120)
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command()
def statistics(
    seeds: Annotated[int, typer.Option(help="Records of 10 s each are taken two at a time.")] = 240,
) -> None:
    """Compare filter error and output error in turbulence, per parameter: bias and scatter over bound, coverage."""
    cases = (
        (disturbed.LINEAR, disturbed.LINEAR_NOISE, disturbed.linear_record, disturbed.LINEAR_TRUTH),
        (disturbed.NONLINEAR, disturbed.NONLINEAR_NOISE, disturbed.nonlinear_record, disturbed.NONLINEAR_TRUTH),
    )
    for model, noise, record, truth in cases:
        results: dict[str, list] = {"filter error": [], "output error": []}
        m, values = len(truth), np.array(list(truth.values()))
        for seed in range(seeds):
            segments = [record(2 * seed, name="one"), record(2 * seed + 1, name="two")]
            for name, fit in (
                ("filter error", fit_filter_error(model, segments, noise, test_significance=False)),
                ("output error", fit_output_error(model, segments)),
            ):
                bound = np.diag(fit.covariance)[:m]
                corrected = np.diag(uncertainty.morelli_klein(fit).covariance)[:m]
                results[name].append((fit.values[:m] - values, bound, corrected))
        table = Table(model.name, "", *truth, box=None)
        for name, rows in results.items():
            error, bound, corrected = (np.array(part) for part in zip(*rows, strict=True))
            typical = np.sqrt(bound.mean(axis=0))
            for what, row, form in (
                ("bias / bound", error.mean(axis=0) / typical, "{:+.2f}"),
                ("scatter / bound", error.std(axis=0) / typical, "{:.2f}"),
                ("scatter", error.std(axis=0), "{:.3g}"),
                ("bound covers, %", 100 * np.mean(np.abs(error) < NORMAL_95 * np.sqrt(bound), axis=0), "{:.0f}"),
                (
                    "corrected covers, %",
                    100 * np.mean(np.abs(error) < NORMAL_95 * np.sqrt(corrected), axis=0),
                    "{:.0f}",
                ),
            ):
                table.add_row(name, what, *(form.format(x) for x in row))
                name = ""
        CONSOLE.print(table)


class Limit(NamedTuple):
    """snr : SNR of q below which CLq is not significant; NaN if never significant, 0 if always."""

    snr: float
    snr_in_flight: float  # SNR with the gyro noise of Table 4.1 times the factor
    t_quiet: float  # t of CLq with the quietest gyro


# Noise from Table 4.1; for h, a barometer's.
NOISE = {"V": 0.29, "alpha": 0.008, "ax": 0.058, "az": 0.058, "h": 0.3}
GYRO_RADPS = 0.005
OCTAVES = range(-4, 8)  # octaves of gyro noise: 0.0003 to 0.64 rad/s
DECIMATION = 2  # the truth is at 50 Hz, the measurements are at 25 Hz


def maneuvers(aircraft: str = "nexstar") -> dict[str, pd.DataFrame]:
    """Return the maneuvers of case 3: two runs and an elevator input, without the recovery after it."""
    ramp, _, step = runs("case-3", aircraft)
    elevator = runs("case-3", aircraft, kind="3-2-1-1")[0]
    return {
        "throttle ramp, height held": ramp,
        "throttle step, height wanders": step,
        "3-2-1-1 elevator": elevator[elevator["t_s"] < 7 * 0.3 + 4.0],
    }


def measured(run: pd.DataFrame, factor: float, gyro_radps: float, seed: int) -> Segment:
    """Add the noise of Table 4.1 times `factor` to a maneuver's outputs, and white noise to the gyro."""
    rng = np.random.default_rng(seed)
    rows = run.iloc[::DECIMATION]
    true = {name: rows[name].to_numpy() for name in rows.columns if name != "kind"}
    inputs = {
        "thrust": "thrust_N", "J": "advance_ratio", "elevator": "elevator_rad", "phi": "roll_rad", "p": "p_radps",
        "r": "r_radps", "beta": "beta_rad", "rho": "density_kgpm3",
    }  # fmt: skip
    outputs = {
        "V": "V_mps", "alpha": "alpha_rad", "ax": "specific_force_x_mps2", "az": "specific_force_z_mps2",
        "h": "height_m",
    }  # fmt: skip
    q = true["q_radps"] + gyro_radps * rng.standard_normal(len(rows))
    return Segment(
        name="run",
        t_s=true["t_s"],
        u={name: true[column] for name, column in inputs.items()} | {"q": q},
        z={
            name: true[column] + factor * NOISE[name] * rng.standard_normal(len(rows))
            for name, column in outputs.items()
        },
    )


def t_of_CLq(aircraft: Aircraft, run: pd.DataFrame, factor: float, gyro_radps: float, seeds: int) -> float:
    """Return the mean over seeds of CLq divided by its standard error (4.4, 4.5), without a prior on CLq."""
    model = pitch_and_height(aircraft).changed(CLq={"start": 0.0, "prior_sigma": np.inf})
    t = []
    for seed in range(seeds):
        segment = measured(run, factor, gyro_radps, seed)
        CLq = fit_output_error(model, segment, start=aircraft_models.starting_values(aircraft, segment)).parameters[
            "CLq"
        ]
        t.append(CLq.value / CLq.standard_error)
    return float(np.mean(t))


def significance_limit(aircraft: Aircraft, run: pd.DataFrame, factor: float, seeds: int = 6) -> Limit:
    """Return the SNR of q (4.6, 4.7) at which the mean t falls to 1.96 as gyro noise increases (Fig. 4.12)."""
    signal = float(run["q_radps"].var())
    snr_in_flight = signal / (factor * GYRO_RADPS) ** 2
    before: tuple[float, float] | None = None
    t_quiet = np.nan
    for octave in OCTAVES:
        ln_snr = float(np.log(signal / (GYRO_RADPS * 2.0**octave) ** 2))
        t = t_of_CLq(aircraft, run, factor, GYRO_RADPS * 2.0**octave, seeds)
        if before is None:
            t_quiet = t
            if t < NORMAL_95:
                return Limit(np.nan, snr_in_flight, t)
        elif t < NORMAL_95:
            share = (before[1] - NORMAL_95) / (before[1] - t)
            return Limit(float(np.exp(before[0] + share * (ln_snr - before[0]))), snr_in_flight, t_quiet)
        before = ln_snr, t
    return Limit(0.0, snr_in_flight, t_quiet)


@app.command()
def significance(seeds: Annotated[int, typer.Option(help="Number of draws of the noise.")] = 6) -> None:
    """Print the SNR of pitch rate at which CLq becomes significant in the maneuvers of case 3 (Fig. 4.12)."""
    aircraft = load_aircraft("nexstar")
    table = Table(
        "maneuver", "all other noise", "CLq significant above SNR", "SNR in flight", "t, quietest gyro", box=None
    )
    for name, run in maneuvers().items():
        for factor in (0.5, 1.0, 1.5):
            limit = significance_limit(aircraft, run, factor, seeds)
            text = "never" if np.isnan(limit.snr) else f"{limit.snr:.2g}" if limit.snr else "always"
            table.add_row(name, f"x {factor:g}", text, f"{limit.snr_in_flight:.0f}", f"{limit.t_quiet:.1f}")
            name = ""
    CONSOLE.print(table)


if __name__ == "__main__":
    app()
