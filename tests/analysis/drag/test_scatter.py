"""Runs that scatter more than their noise raise a warning, and noise alone does not."""

from dataclasses import replace

import numpy as np

from analysis.drag.estimate import run_scatter
from analysis.drag.method import MethodEstimate
from analysis.drag.methods_from_runs import ONE_RUN
from analysis.polar import Condition, Polar
from analysis.settings import EVIDENCE

AT = Condition(37.68, 1.2, 0.4636)
TRUTH = np.array([0.0465, -0.0195, 0.065])
NOISE = np.diag([0.001, 0.002, 0.002]) ** 2


def runs(rng: np.random.Generator, kind: str, count: int, *, wider: float = 1.0) -> list[MethodEstimate]:
    """Single runs whose polars scatter `wider` times as much as their noise says."""
    drawn = rng.multivariate_normal(TRUTH, NOISE * wider**2, count)
    return [
        MethodEstimate(
            replace(ONE_RUN, title=f"{kind} at {i} s", kinds=(kind,)), Polar(A, NOISE), NOISE, flown_CL=(0.3, 1.0)
        )
        for i, A in enumerate(drawn)
    ]


def test_noise_alone_raises_a_warning_at_the_false_alarm_rate_at_most() -> None:
    """Five runs, 1000 times: the stated rate by chance, plus three standard errors of it."""
    rng = np.random.default_rng(5)
    alarms = sum(bool(run_scatter(runs(rng, "acceleration", 5), AT)) for _ in range(1000))
    assert alarms / 1000 <= EVIDENCE.rare_false_alarms + 3 * np.sqrt(EVIDENCE.rare_false_alarms / 1000)


def test_runs_that_scatter_four_times_their_noise_raise_a_warning() -> None:
    rng = np.random.default_rng(6)
    (said,) = run_scatter([*runs(rng, "acceleration", 8, wider=4), *runs(rng, "deceleration", 8)], AT)
    assert "8 accelerations differ" in said


def test_two_runs_are_too_few_for_a_warning() -> None:
    assert run_scatter(runs(np.random.default_rng(7), "acceleration", 2, wider=9), AT) == []


def test_the_warning_tells_the_scatter_in_per_cent_of_power_and_of_what_noise_allows() -> None:
    """Drag without induced drag of 0.03, 0.04 and 0.05, each known to 0.001: 25 % apart, ten times the noise."""
    small = np.diag([0.001, 0.0, 0.0]) ** 2
    three = [
        MethodEstimate(
            replace(ONE_RUN, title=f"acceleration at {i} s", kinds=("acceleration",)),
            Polar(np.array([CD, 0.0, 0.0]), small), small, flown_CL=(0.25, 1.0),
        )
        for i, CD in enumerate((0.03, 0.04, 0.05))
    ]  # fmt: skip
    (said,) = run_scatter(three, AT)
    V = np.sqrt(2 * AT.weight_N / (AT.rho * 0.5 * AT.wing_area_m2))  # at the geometric mean of the lift coefficients
    assert said == (
        f"The 3 accelerations differ from each other by 25.0 % at {V:.1f} m/s, 10.0 times what their noise allows."
    )
    apart = [replace(run, flown_CL=CL) for run, CL in zip(three, ((0.2, 0.3), (0.4, 0.5), (0.6, 0.7)), strict=True)]
    assert run_scatter(apart, AT) == [], "no speed is common to all"
