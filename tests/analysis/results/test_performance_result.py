"""Performance in the results: sentences, notes and flags."""

from analysis.results.performance import _cost, _is_single_change
from analysis.results.schema import Interval, PerformanceCase


def case(title: str, weight_N: float, rho: float, minutes: float, km: float, speed: float) -> PerformanceCase:
    sure = {name: Interval(value=v, lo=v, hi=v) for name, v in (("t", 60 * minutes), ("x", 1000 * km), ("v", speed))}
    return PerformanceCase(
        title=title, weight_N=weight_N, air_density_kgpm3=rho, density_altitude_m=0.0, endurance_s=sure["t"],
        endurance_speed_mps=sure["v"], endurance_power_W=70.0, endurance_at_slowest=False, range_m=sure["x"],
        range_speed_mps=sure["v"], range_power_W=80.0, maximum_speed_mps=None, best_climb_mps=None,
    )  # fmt: skip


def test_a_cost_gives_both_numbers_and_the_change_in_percent() -> None:
    before, after = case("as flown", 37.7, 1.2, 50, 40, 13), case("300 g more", 40.6, 1.2, 45, 38, 13.5)
    said = _cost(before, after)
    assert said.startswith("300 g more") and "50 to 45 min (-10 %)" in said and "40.0 to 38.0 km (-5 %)" in said
    assert _is_single_change(before, after)
    assert not _is_single_change(before, case("both", 40.6, 1.1, 44, 37, 14))
