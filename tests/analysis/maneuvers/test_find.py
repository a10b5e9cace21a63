"""Runs are found where speed changes in level flight; other changes of speed are rejected with a reason."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.air.air import bank_angle
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.flight.runs import LEVEL_RUN, RunRejected

RATE_HZ = 25.0


def flight(speed, height=None, turn_radps=None, **gone) -> pd.DataFrame:
    """Return a table like that of `air_data` for a speed history, with Table 4.1's noise; `gone` gives missing rows."""
    n = len(speed)
    rng = np.random.default_rng(7)
    t = np.arange(n) / RATE_HZ
    table = pd.DataFrame(
        {
            "V_mps": speed + rng.normal(0, 0.29, n),
            "height_m": (np.full(n, 50.0) if height is None else height) + rng.normal(0, 0.2, n),
            "alpha_rad": 0.05,
            "beta_rad": 0.0,
            "ax_mps2": 0.0,
            "ay_mps2": 0.0,
            "az_mps2": -9.8,
            "p_radps": 0.0,
            "q_radps": 0.0,
            "r_radps": 0.0 if turn_radps is None else turn_radps,
            "thrust_N": 5.0,
            "rho": 1.2,
            "flying": True,
            "propeller_covered": True,
        },
        index=pd.Index(t, name="t_s"),
    )
    for name, rows in gone.items():
        table.loc[table.index[rows], name] = np.nan
    return table.assign(bank_rad=bank_angle(table))


def up_and_down(low=12.0, high=23.0, seconds=12.0) -> np.ndarray:
    """Return speeds: steady, accelerating, steady, decelerating, steady; each change takes `seconds`."""
    n, hold = round(seconds * RATE_HZ), round(8 * RATE_HZ)
    return np.concatenate(
        [
            np.full(hold, low),
            np.linspace(low, high, n),
            np.full(hold, high),
            np.linspace(high, low, n),
            np.full(hold, low),
        ]
    )


def test_an_acceleration_and_a_deceleration_are_found_where_they_are() -> None:
    runs, rejected = find_runs(flight(up_and_down()))
    assert [run.kind for run in runs] == ["acceleration", "deceleration"]
    assert not rejected
    for run, start in zip(runs, (8.0, 28.0), strict=True):
        # An edge is found to within about half of the smoothing window.
        assert run.start_s == pytest.approx(start, abs=LEVEL_RUN.smoothing_s / 2)
        assert run.end_s == pytest.approx(start + 12, abs=LEVEL_RUN.smoothing_s / 2)
        assert run.lowest_speed_mps == pytest.approx(12, abs=0.5)
        assert run.highest_speed_mps == pytest.approx(23, abs=0.5)
        assert run.altitude_change_m == pytest.approx(0, abs=0.3)


@pytest.mark.parametrize("period_s", [3.0, 5.0, 8.0])
def test_gusts_do_not_cut_a_run_in_two(period_s: float) -> None:
    """Speed waves by 1.2 m/s, sigma of horizontal gusts in W20 = 15 kt, so it even falls during an acceleration."""
    speed = up_and_down(seconds=18.0)
    runs, _ = find_runs(flight(speed + 1.2 * np.sin(2 * np.pi * np.arange(len(speed)) / RATE_HZ / period_s)))
    for kind, start in (("acceleration", 8.0), ("deceleration", 34.0)):
        (run,) = (run for run in runs if run.kind == kind and run.end_s > start and run.start_s < start + 18)
        # At either end, a wave may hide the change until speed has changed by more than the wave.
        assert min(run.end_s, start + 18) - max(run.start_s, start) > 18 - period_s


def test_steady_flight_has_no_run() -> None:
    runs, rejected = find_runs(flight(np.full(2000, 15.0)))
    assert not runs
    assert not rejected


@pytest.mark.parametrize(("climb_mps", "level"), [(0.9, True), (1.5, False), (-1.5, False)])
def test_a_run_climbs_or_descends_by_no_more_than_1_2_mps_on_average(climb_mps: float, level: bool) -> None:
    """The height limit alone is not enough: at 1.5 m/s, height changes by about 15 m here, and 20 m are allowed."""
    speed = up_and_down(seconds=8.0)
    runs, rejected = find_runs(flight(speed, height=100.0 + climb_mps * np.arange(len(speed)) / RATE_HZ))
    if level:
        assert [run.kind for run in runs] == ["acceleration", "deceleration"]
        assert [run.altitude_change_m for run in runs] == pytest.approx([9 * climb_mps] * 2, abs=1.5)
    else:
        assert not runs
        assert [stretch.rejection.reason for stretch in rejected] == [RunRejected.CLIMBED] * 2
        assert [stretch.rejection.measured for stretch in rejected] == pytest.approx([climb_mps] * 2, abs=0.05)


@pytest.mark.parametrize(
    ("table", "reason"),
    [
        (flight(up_and_down(seconds=2.5)), RunRejected.TOO_SHORT),
        (flight(up_and_down(low=18.0, high=21.0, seconds=5)), RunRejected.SPEED_CHANGED_LITTLE),
        (flight(up_and_down(), height=np.interp(np.arange(1200), [200, 500], [50, 95])), RunRejected.CLIMBED),
        (flight(up_and_down(), turn_radps=np.where(np.arange(1200) < 600, 0.4, 0.0)), RunRejected.BANKED),
        (flight(up_and_down(), thrust_N=slice(260, 400)), RunRejected.DATA_MISSING),
        (flight(up_and_down(), height=np.full(1200, 12.0)), RunRejected.TOO_LOW),
    ],
)
def test_what_is_no_run_says_why(table: pd.DataFrame, reason: RunRejected) -> None:
    _, rejected = find_runs(table)
    assert reason in [stretch.rejection.reason for stretch in rejected]
