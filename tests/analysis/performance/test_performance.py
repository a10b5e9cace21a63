"""What the results say of an estimate's use: the propeller's coverage, the share of noise, weights and airs."""

import numpy as np
import pandas as pd
import pytest

from analysis.drag.polar import Condition
from analysis.drag.thrust_coverage import thrust_coverage, thrust_known
from analysis.performance.request import Request
from analysis.results.performance import Day, _cases, _cost, _one_change
from analysis.results.schema import Interval, Loading
from flight.errors import InputError
from flight.propeller_files import load_propeller

TEST = Condition(weight_N=37.7, rho=1.19, wing_area_m2=0.4636)
DAY = Day(TEST, 100_000.0, 290.0)


def flown(J: np.ndarray, covered: np.ndarray) -> pd.DataFrame:
    V, n = np.linspace(12, 24, len(J)), np.linspace(50, 140, len(J))
    return pd.DataFrame({"V_mps": V, "J": J, "n_revps": n, "propeller_covered": covered})


def test_a_table_that_holds_all_of_the_runs_needs_no_word() -> None:
    data = flown(np.linspace(0.4, 0.8, 100), np.ones(100, dtype=bool))
    assert thrust_coverage(data, load_propeller("apc-12x8e")) == []


def test_a_table_that_leaves_out_some_is_warned_of_with_both_ranges() -> None:
    data = flown(np.linspace(0.5, 1.1, 100), np.arange(100) < 70)
    (warning,) = thrust_coverage(data, load_propeller("apc-12x8e"))
    assert "30 % of the runs" in warning and "J = 0.88" in warning and "0.52 to 1.08" in warning


def test_a_table_that_is_left_by_speed_of_rotation_says_so() -> None:
    """J is inside it all the time."""
    data = flown(np.linspace(0.4, 0.6, 100), np.arange(100) >= 20)
    (warning,) = thrust_coverage(data, load_propeller("apc-12x8e"))
    assert "20 % of the runs" in warning and "rpm (flown: 3135 to 8265)" in warning


def test_a_propeller_that_was_not_flown_is_refused() -> None:
    data = flown(np.linspace(0.5, 1.1, 100), np.arange(100) < 20)
    with pytest.raises(InputError, match=r"apc-10x5e.*80 % of the runs.*was flown\?"):
        thrust_coverage(data, load_propeller("apc-10x5e"))


def test_the_curve_is_flagged_where_only_a_continued_table_stands_behind_it() -> None:
    V = np.linspace(12, 24, 400)
    data = pd.DataFrame({"V_mps": V, "propeller_covered": V > 16})
    known = thrust_known(data, np.array([12.5, 14.0, 18.0, 23.0, 30.0]))
    assert known.tolist() == [False, False, True, True, True], "nothing was flown at 30: flagged for another reason"


def test_unasked_there_is_more_payload_a_hotter_day_and_a_higher_field() -> None:
    cases = dict(_cases(Request(), DAY))
    assert cases["300 g more"].weight_N == pytest.approx(37.7 + 0.3 * 9.80665)
    assert cases["300 g more"].rho == TEST.rho
    assert cases["15 °C hotter"].weight_N == TEST.weight_N
    assert cases["15 °C hotter"].rho == pytest.approx(100_000 / (287.05287 * 305.0))
    assert cases["1000 m higher"].rho < 0.92 * TEST.rho
    assert len(cases) == 8


def test_asked_there_is_every_weight_in_every_air() -> None:
    asked = Request(weights_N=(30.0, 40.0), density_altitudes_m=(0.0, 2000.0))
    cases = _cases(asked, DAY)
    assert len(cases) == 4
    assert {round(at.rho, 3) for _, at in cases} == {1.225, 1.006}
    assert {at.weight_N for _, at in cases} == {30.0, 40.0}


def loading(title: str, weight_N: float, rho: float, minutes: float, km: float, speed: float) -> Loading:
    sure = {name: Interval(value=v, lo=v, hi=v) for name, v in (("t", 60 * minutes), ("x", 1000 * km), ("v", speed))}
    return Loading(
        title=title, weight_N=weight_N, air_density_kgpm3=rho, density_altitude_m=0.0, endurance_s=sure["t"],
        endurance_speed_mps=sure["v"], endurance_power_W=70.0, endurance_at_slowest=False, range_m=sure["x"],
        range_speed_mps=sure["v"], range_power_W=80.0, maximum_speed_mps=None, best_climb_mps=None,
    )  # fmt: skip


def test_a_cost_is_said_with_both_numbers_and_the_share() -> None:
    before, after = loading("as flown", 37.7, 1.2, 50, 40, 13), loading("300 g more", 40.6, 1.2, 45, 38, 13.5)
    said = _cost(before, after)
    assert said.startswith("300 g more") and "50 to 45 min (-10 %)" in said and "40.0 to 38.0 km (-5 %)" in said
    assert _one_change(before, after)
    assert not _one_change(before, loading("both", 40.6, 1.1, 44, 37, 14))
