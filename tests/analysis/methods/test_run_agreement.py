"""A run that differs stands out from others of its kind; noise and errors that all runs share do not show."""

from dataclasses import replace

import numpy as np

from flightpower.analysis.curve import Condition, Polar
from flightpower.analysis.methods.method import MethodEstimate
from flightpower.analysis.methods.methods_from_runs import ONE_RUN
from flightpower.analysis.methods.run_agreement import one_kind_against_another, runs_against_others
from flightpower.analysis.methods.settings import COMPARISON
from flightpower.analysis.results.evidence import noise_limit
from flightpower.flight.aircraft import Uncertainty

AT = Condition(37.68, 1.2, 0.4636)
TRUTH = np.array([0.0465, -0.0195, 0.065])
NOISE = np.diag([0.001, 0.002, 0.002]) ** 2
STATED = Uncertainty()


def runs(rng: np.random.Generator, kind: str, count: int) -> list[MethodEstimate]:
    """Return estimates from single runs, each with its own noise and error of its path's slope."""
    polars = rng.multivariate_normal(TRUTH, NOISE, count)
    polars[:, 1] += rng.normal(0.0, COMPARISON.run_slope_rad, count)
    return [
        MethodEstimate(
            replace(ONE_RUN, title=f"{kind} at {i} s", kinds=(kind,)), Polar(A, NOISE), NOISE, flown_CL=(0.3, 1.0)
        )
        for i, A in enumerate(polars)
    ]


def with_gear(run: MethodEstimate) -> MethodEstimate:
    assert run.polar is not None
    return replace(run, polar=Polar(run.polar.A + np.array([0.01, 0.0, 0.0]), NOISE))


def test_noise_alone_exceeds_the_limit_at_the_stated_rate_at_most() -> None:
    """0.3 % of 1000 sets of five runs exceed the limit by chance, or up to three standard errors more."""
    rng = np.random.default_rng(5)
    limit = noise_limit(5)
    alarms = sum(
        max(
            abs(runs_against_other.z)
            for runs_against_other in runs_against_others(runs(rng, "acceleration", 5), AT, STATED)
        )
        > limit
        for _ in range(1000)
    )
    assert alarms <= 3 + 3 * np.sqrt(3)


def test_z_of_sound_runs_has_unit_variance() -> None:
    rng = np.random.default_rng(6)
    z = [
        runs_against_other.z
        for _ in range(400)
        for runs_against_other in runs_against_others(runs(rng, "deceleration", 2), AT, STATED)
    ]
    assert 0.85 < np.std(z) < 1.15


def test_the_run_with_the_landing_gear_out_stands_out() -> None:
    first, *others = runs(np.random.default_rng(7), "acceleration", 4)
    compared = runs_against_others([with_gear(first), *others], AT, STATED)
    worst = max(compared, key=lambda runs_against_other: abs(runs_against_other.z))
    assert worst.run == first.method.title and worst.z > noise_limit(4) and worst.power_W > worst.others_W


def test_errors_that_all_runs_share_do_not_make_them_differ() -> None:
    shared = [
        replace(run, trajectory_deviations=np.full((3, 2), 0.02), sensitivities={"thrust_scale": np.array([0.5, 0, 0])})
        for run in runs(np.random.default_rng(8), "acceleration", 3)
    ]
    alone = [replace(run, trajectory_deviations=np.zeros((3, 0)), sensitivities={}) for run in shared]
    with_shared, without = (runs_against_others(some, AT, STATED) for some in (shared, alone))
    np.testing.assert_allclose(
        [runs_against_other.z for runs_against_other in with_shared],
        [runs_against_other.z for runs_against_other in without],
    )


def test_a_run_is_compared_with_others_of_its_kind_that_share_lift_coefficients() -> None:
    rng = np.random.default_rng(9)
    (slow,), (fast,) = runs(rng, "acceleration", 1), runs(rng, "acceleration", 1)
    (other_kind,) = runs(rng, "deceleration", 1)
    apart = [replace(slow, flown_CL=(0.8, 1.0)), replace(fast, flown_CL=(0.3, 0.5)), other_kind]
    assert runs_against_others(apart, AT, STATED) == []
    assert len(runs_against_others([slow, fast], AT, STATED)) == 2


def test_thrust_twelve_percent_off_shows_between_accelerations_and_decelerations_and_one_stated_does_not() -> None:
    """Thrust is 1.5 times drag in an acceleration and half of the drag in a deceleration."""
    rng = np.random.default_rng(8)
    more = -TRUTH  # change of the polar per unit of thrust scale where thrust equals drag
    kinds = [
        replace(
            runs(rng, kind, 1)[0],
            polar=Polar(TRUTH - 0.12 * share * more, NOISE),
            sensitivities={"thrust_scale": share * more},
        )
        for kind, share in (("acceleration", 1.5), ("deceleration", 0.5))
    ]
    wrong = one_kind_against_another(*kinds, AT, replace(STATED, thrust_scale_fraction=0.01))
    allowed = one_kind_against_another(*kinds, AT, replace(STATED, thrust_scale_fraction=0.12))
    assert wrong is not None and allowed is not None
    assert wrong.z > noise_limit(1) > abs(allowed.z) and wrong.power_W > wrong.others_W
    assert one_kind_against_another(kinds[0], replace(kinds[1], polar=None), AT, STATED) is None
