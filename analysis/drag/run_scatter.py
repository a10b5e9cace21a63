"""Whether runs of one kind scatter more than their noise allows."""

import numpy as np
from scipy import special

from analysis.drag.method import MethodEstimate
from analysis.drag.polar import Condition, Polar, power_required, speed_at
from analysis.maneuvers.kinds import LEVEL_RUNS

FALSE_ALARM_RATE = 0.001  # probability of a warning where there is nothing but noise
FEWEST_RUNS = 3  # of one kind, for their scatter to be tested


def run_scatter(single_runs: list[MethodEstimate], condition: Condition) -> list[str]:
    """A warning per kind of run whose powers differ by more than noise, at a speed common to all of them."""
    warnings = []
    for kind in LEVEL_RUNS:
        runs = [run for run in single_runs if run.polar is not None and run.method.title.startswith(kind)]
        if len(runs) < FEWEST_RUNS:
            continue
        low, high = max(run.flown_CL[0] for run in runs), min(run.flown_CL[1] for run in runs)
        if low >= high:
            continue
        V = speed_at([np.sqrt(low * high)], condition)
        power, error = np.array(
            [power_required(V, Polar(run.polar.A, run.noise), condition) for run in runs if run.polar is not None]
        )[:, :, 0].T
        mean = np.average(power, weights=error**-2)
        chi_square, dof = np.sum(((power - mean) / error) ** 2), len(runs) - 1
        if chi_square > special.chdtri(dof, FALSE_ALARM_RATE):
            warnings.append(
                f"The {len(runs)} {kind}s differ from each other by {100 * np.std(power, ddof=1) / mean:.1f} % at"
                f" {V[0]:.1f} m/s, {np.sqrt(chi_square / dof):.1f} times what their noise allows."
            )
    return warnings
