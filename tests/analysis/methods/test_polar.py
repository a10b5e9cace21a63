"""Tests power required, where it is known exactly, and its interval."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.curve import (
    Condition,
    Polar,
    best_range_lift,
    classic_form,
    lift_coefficient,
    maximum_lift_to_drag,
    minimum_power_lift,
    optimum_speed,
    power_required,
    speed_at,
    unphysical,
)
from flightpower.analysis.maneuvers.flown import check_lift, flown_condition, flown_lift, largest_lift
from flightpower.analysis.sources.daemon import SPEED_SCALE
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.units import GRAVITY_MPS2

NEXSTAR = Condition(weight_N=37.68, rho=1.225, wing_area_m2=0.4636)
NO_DOUBT = np.zeros((3, 3))


def test_symmetric_polar_gives_the_closed_form_of_1_5() -> None:
    CD0, K = 0.045, 0.065
    V = np.linspace(11, 25, 30)
    q = NEXSTAR.rho * V**2 / 2
    expected = q * V * NEXSTAR.wing_area_m2 * CD0 + K * NEXSTAR.weight_N**2 * V / (q * NEXSTAR.wing_area_m2)
    power, _ = power_required(V, Polar(np.array([CD0, 0, K]), NO_DOUBT), NEXSTAR)
    assert power == pytest.approx(expected, rel=1e-12)


def test_least_power_is_three_parts_induced_to_one_part_parasite() -> None:
    A = np.array([0.045, 0.0, 0.065])
    CL = minimum_power_lift(A)
    assert A[2] * CL**2 == pytest.approx(3 * A[0], rel=1e-12)  # (1.6)
    assert A[2] * best_range_lift(A) ** 2 == pytest.approx(A[0], rel=1e-12)  # (1.10)
    ratio = speed_at(minimum_power_lift(A), NEXSTAR) / speed_at(best_range_lift(A), NEXSTAR)
    assert ratio == pytest.approx(3**-0.25, rel=1e-12)


@pytest.mark.parametrize("CL_minD", [0.0, 0.15, 0.4])
def test_special_speeds_are_the_minima_of_the_curve_itself(CL_minD: float) -> None:
    CD0, K = 0.045, 0.065
    A = np.array([CD0 + K * CL_minD**2, -2 * K * CL_minD, K])
    V = np.linspace(8, 30, 200_001)
    power, _ = power_required(V, Polar(A, NO_DOUBT), NEXSTAR)
    grid = V[1] - V[0]
    assert speed_at(minimum_power_lift(A), NEXSTAR) == pytest.approx(V[np.argmin(power)], abs=2 * grid)
    assert speed_at(best_range_lift(A), NEXSTAR) == pytest.approx(V[np.argmin(power / V)], abs=2 * grid)
    CL = lift_coefficient(V, NEXSTAR)
    assert maximum_lift_to_drag(A) == pytest.approx(np.max(CL / (A[0] + A[1] * CL + A[2] * CL**2)), rel=1e-9)


def test_classic_form_gives_back_what_the_polar_was_made_of() -> None:
    CD0, K, CL_minD, aspect_ratio = 0.045, 0.065, 0.15, 6.58
    classic = classic_form(np.array([CD0 + K * CL_minD**2, -2 * K * CL_minD, K]), aspect_ratio)
    assert classic == pytest.approx((CD0, K, CL_minD, 1 / (np.pi * K * aspect_ratio)), rel=1e-12)


def test_power_scales_exactly_with_weight_and_density() -> None:
    """P sqrt(sigma)/W^1.5 is a function of V sqrt(sigma/W) alone (PIW and VIW, 2.3 and 2.5)."""
    polar = Polar(np.array([0.0465, -0.0195, 0.065]), NO_DOUBT)
    heavy = Condition(weight_N=1.3 * NEXSTAR.weight_N, rho=0.8 * NEXSTAR.rho, wing_area_m2=NEXSTAR.wing_area_m2)
    V = np.linspace(11, 25, 20)
    power, _ = power_required(V, polar, NEXSTAR)
    scaled, _ = power_required(V * np.sqrt(1.3 / 0.8), polar, heavy)
    assert scaled == pytest.approx(power * 1.3**1.5 / np.sqrt(0.8), rel=1e-12)


@pytest.mark.thorough
def test_interval_of_a_special_speed_covers_as_often_as_it_says() -> None:
    """500 polars are drawn around the truth; 95 % +- 3 standard errors of a binomial share (2.9 %) must be covered."""
    truth = np.array([0.0465, -0.0195, 0.065])
    sigma = np.array([0.001, 0.002, 0.002])
    covariance = np.diag(sigma**2)
    true_speed = speed_at(minimum_power_lift(truth), NEXSTAR)
    rng = np.random.default_rng(1)
    hits = 0
    for estimate in rng.multivariate_normal(truth, covariance, 500):
        speed = optimum_speed(minimum_power_lift, Polar(estimate, covariance), NEXSTAR)
        hits += speed.lo_mps <= true_speed <= speed.hi_mps
    assert hits / 500 == pytest.approx(0.95, abs=3 * np.sqrt(0.95 * 0.05 / 500))


def test_speeds_of_draws_without_drag_at_zero_lift_lie_at_the_fast_end() -> None:
    """A0 is as uncertain as it is large, so one draw in six has no finite best-range speed; none has a speed of 0."""
    A0, A2 = 0.02, 0.065
    speed = optimum_speed(best_range_lift, Polar(np.array([A0, 0, A2]), np.diag([A0**2, 0, 1e-12])), NEXSTAR)
    slowest_of_all = speed_at(np.sqrt(4 * A0 / A2), NEXSTAR)  # A0 three standard deviations higher
    assert slowest_of_all < speed.lo_mps < speed.speed_mps and speed.hi_mps > 4 * speed.speed_mps


def test_a_polar_without_a_minimum_has_no_special_speed() -> None:
    assert np.isnan(minimum_power_lift(np.array([0.05, 0.0, -0.01])))
    assert np.isnan(best_range_lift(np.array([0.05, 0.0, -0.01])))


@pytest.mark.parametrize(
    ("A", "variance", "message"),
    [
        ([0.045, -0.02, 0.065], 1e-6, ""),
        ([-0.01, 0.02, 0.065], 1e-6, ""),  # sound at the lift coefficients flown
        ([0.045, 0.1, -0.02], 1e-6, "curves downward"),
        ([-0.05, -0.02, 0.065], 1e-6, "negative"),
        ([0.045, -0.02, 0.065], np.nan, "too narrow"),
    ],
)
def test_an_unphysical_polar_is_recognized(A: list[float], variance: float, message: str) -> None:
    result = unphysical(Polar(np.array(A), variance * np.eye(3)), (0.3, 1.1))
    assert (message in result) and bool(result) == bool(message)


def aloft(**columns) -> pd.DataFrame:
    """Return four minutes of level flight at 15 m/s and 1 g, starting at 100 s, with 25 rows per second."""
    t = 100 + 0.04 * np.arange(6000)
    usual = {"V_mps": 15.0, "rho": 1.2, "qbar_Pa": 135.0, "az_mps2": -GRAVITY_MPS2, "flying": True, "height_m": 60.0}
    return pd.DataFrame({n: np.broadcast_to(x, t.shape) for n, x in (usual | columns).items()}, index=t)


def for_seconds(seconds: float, value: float, otherwise: float) -> np.ndarray:
    return np.where(
        np.arange(6000) - 3000 < 25 * seconds, np.where(np.arange(6000) >= 3000, value, otherwise), otherwise
    )


def test_the_largest_lift_is_what_a_pull_up_held_for_half_a_second() -> None:
    """A pull of 2.5 g for a second counts, a bump of a fifth of a second is averaged, and low heights do not count."""
    level = NEXSTAR.weight_N / (135.0 * NEXSTAR.wing_area_m2)
    assert largest_lift(aloft(), NEXSTAR) == pytest.approx(level)
    pulled = for_seconds(1.0, -2.5 * GRAVITY_MPS2, -GRAVITY_MPS2)
    assert largest_lift(aloft(az_mps2=pulled), NEXSTAR) == pytest.approx(2.5 * level)
    slower = aloft(az_mps2=pulled, qbar_Pa=for_seconds(1.0, 100.0, 135.0))
    assert largest_lift(slower, NEXSTAR) == pytest.approx(2.5 * level * 135 / 100)
    bump = for_seconds(0.2, -2.5 * GRAVITY_MPS2, -GRAVITY_MPS2)
    assert largest_lift(aloft(az_mps2=bump), NEXSTAR) == pytest.approx((1 + 1.5 * 5 / 12) * level, rel=0.01)
    assert largest_lift(aloft(az_mps2=pulled, height_m=for_seconds(1.0, 19.0, 60.0)), NEXSTAR) < 2 * level
    assert largest_lift(aloft(height_m=19.0), NEXSTAR) == np.inf


def test_the_range_of_lift_flown_is_that_of_level_flight_at_the_speeds_flown() -> None:
    """The fastest and slowest one percent of the samples are left out."""
    aircraft = load_aircraft("nexstar")
    W, S = aircraft.mass.weight_N, aircraft.geometry.wing_area_m2
    V = np.linspace(12.0, 22.0, 6000)
    V[:30], V[-30:] = 5.0, 60.0
    low, high = flown_lift(aloft(V_mps=V), aircraft)
    assert (high, low) == pytest.approx([W / (0.6 * v**2 * S) for v in (12.1, 21.9)], rel=0.005)
    assert flown_condition(aloft(rho=np.linspace(1.1, 1.3, 6000)), aircraft) == pytest.approx((W, 1.2, S))


def test_a_gust_that_takes_airspeed_makes_no_slower_speed_flown() -> None:
    """The wing carries less than the weight during the gust, so that speed must not be recommended."""
    aircraft = load_aircraft("nexstar")
    slow = for_seconds(4.0, 0.6, 1.0)
    gusty = aloft(V_mps=15 * slow, qbar_Pa=135 * slow**2, az_mps2=-GRAVITY_MPS2 * slow**2)
    flown = gusty.iloc[2900:3200]
    carried = largest_lift(gusty, NEXSTAR)
    level = aircraft.mass.weight_N / (135.0 * aircraft.geometry.wing_area_m2)
    assert carried == pytest.approx(NEXSTAR.weight_N / (135.0 * NEXSTAR.wing_area_m2), rel=0.01)
    assert flown_lift(flown, aircraft)[1] == pytest.approx(level / 0.36, rel=0.01)
    assert flown_lift(flown, aircraft, carried)[1] == pytest.approx(carried)


def test_of_slow_aircraft_the_mean_speed_counts() -> None:
    """At half the speed, noise matters sixteen times as much, so means are taken over sixteen samples."""
    aircraft = load_aircraft("nexstar")
    noisy = 7.5 * np.where(np.arange(6000) % 2, 1.1, 0.9)
    small = flown_lift(aloft(V_mps=noisy).assign(**{SPEED_SCALE: 0.5}), aircraft)
    large = flown_lift(aloft(V_mps=noisy), aircraft)
    assert small[1] / small[0] == pytest.approx(1.0, abs=0.02) and large[1] / large[0] == pytest.approx(
        (1.1 / 0.9) ** 2
    )


@pytest.mark.parametrize(("largest", "refused"), [(0.6, False), (2.5, False), (11.0, True), (2e-4, True)])
def test_a_weight_that_no_wing_carries_is_refused(largest: float, refused: bool) -> None:
    condition = Condition(294.2, 1.2, 0.5)
    if not refused:
        check_lift((0.3, largest), condition, "flight.mcap")
        return
    with pytest.raises(InputError, match=r"flight\.mcap: a weight of 294 N .* 0\.5 m\^2 .* check mass\.weight"):
        check_lift((1e-4, largest), condition, "flight.mcap")
