"""What the page knows of each run: where it is marked, and what the curve would be without it."""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from analysis.estimation.noise import NORMAL_95
from analysis.maneuvers.runs_file import blocks, head
from analysis.pipeline import Analysis
from analysis.report.figures.style import ORANGE, OTHER_RUN
from analysis.schema import Results
from flight.arrays import Array

Json = dict[str, Any]


class NamedRun(NamedTuple):
    """A run as the page shows it; name: as in the figures; says: what is known of it, in words."""

    name: str
    label: str
    start_s: float
    end_s: float
    says: str


def _short(values: Array) -> Any:
    """With twelve significant digits."""
    return [_short(row) if np.ndim(row) else float(f"{row:.12g}") for row in values]


def named_runs(results: Results) -> list[NamedRun]:
    """The runs in the order of the table."""
    z = {one.run: one.z for one in results.runs_against_others}
    rms = {one.run: one.rms_mps2 for one in results.run_residuals}
    runs = []
    for number, run in enumerate(results.runs, start=1):
        says = [f"{run.lowest_speed_mps:.1f} to {run.highest_speed_mps:.1f} m/s", f"{run.altitude_change_m:+.1f} m"]
        if run.name in z:
            says.append(f"{z[run.name]:+.1f} standard errors from the others of its kind")
        if run.name in rms:
            says.append(f"residuals of drag {rms[run.name]:.2f} m/s² (rms)")
        label = f"Run {number}: {run.name}"
        runs.append(NamedRun(run.name, label, run.start_s, run.end_s, "; ".join([*says, *run.notes])))
    return runs


def embedded_runs(analysis: Analysis) -> Json:
    """For `runs.js`: the runs, the list of runs as a file, and the shares of the runs in the curve, where known."""
    main, results = analysis.drag.main, analysis.results
    shares: Json | None = None
    if main.shares:
        shares = {
            "information": main.shares.information,
            "by_run": {
                name: {"information": _short(information), "gradient": _short(gradient)}
                for name, (information, gradient) in main.shares.by_run.items()
            },
            "noise_factor": main.shares.noise_factor,
            "A": main.polar.A,
            "covariance": main.polar.covariance,
            "speeds": [point.speed_mps for point in results.power_required],
            "weight_N": results.test.weight_N,
            "rho": results.test.air_density_kgpm3,
            "wing_area_m2": results.aircraft.wing_area_m2,
            "normal_95": NORMAL_95,
        }
    runs = named_runs(results)
    kept, left_out = blocks(analysis.maneuvers), blocks(analysis.maneuvers, {run.name for run in runs})
    return {
        "runs": [run._asdict() for run in runs],
        "file": {
            "head": head(Path(results.log).name),
            "blocks": [
                {"run": block.run, "kept": block.text, "left_out": other.text}
                for block, other in zip(kept, left_out, strict=True)
            ],
        },
        "shares": shares,
        "colors": {"alone": ORANGE, "without": OTHER_RUN},
    }
