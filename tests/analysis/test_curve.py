"""Curves at other conditions, their points and best speeds agree with the physics of a parabolic polar."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.curve import (
    Condition,
    Cost,
    Curve,
    Kind,
    Polar,
    classic_form,
    polar_curve,
    power_points,
    power_required,
    ratios,
)
from flightpower.analysis.uncertain import Uncertain

AT = Condition(weight_N=37.7, rho=1.19, wing_area_m2=0.4636)
OTHER = Condition(weight_N=45.0, rho=0.95, wing_area_m2=0.55)
CD0, K = 0.04, 0.06
POLAR = Polar(np.array([CD0, 0.0, K]), np.diag([0.001**2, 0.0, 0.003**2]))
CURVE = polar_curve(POLAR, AT, (0.3, 1.2))


def electrical(idle_W: float) -> Curve:
    """Return a curve of twice the power required plus the idle power with the motor off."""
    power = CURVE.power_W.through(2 * np.eye(len(CURVE.V_mps)))
    power = Uncertain(power.value + idle_W, power.own, {"current": 0.02 * power.value})
    return Curve(kind=Kind.ELECTRICAL, condition=AT, V_mps=CURVE.V_mps, power_W=power, idle_W=idle_W)


def test_at_another_weight_density_and_area_the_polar_is_the_same() -> None:
    """It is exact: at each lift coefficient, speed, power and its error all scale with the condition."""
    there = CURVE.at(OTHER)
    power, error = power_required(there.V_mps, POLAR, OTHER)
    assert there.power_W.value == pytest.approx(power, rel=1e-12)
    assert there.power_W.standard_error == pytest.approx(error, rel=1e-9)
    assert there.V_mps == pytest.approx(polar_curve(POLAR, OTHER, CURVE.flown_CL).V_mps, rel=1e-12)
    assert there.at(AT).power_W.value == pytest.approx(CURVE.power_W.value, rel=1e-12)


def test_idle_power_does_not_go_with_the_weight() -> None:
    heavier = AT._replace(weight_N=2 * AT.weight_N)
    here, there = electrical(8.0), electrical(8.0).at(heavier)
    assert there.V_mps == pytest.approx(np.sqrt(2) * here.V_mps)
    assert there.power_W.value - 8.0 == pytest.approx(2**1.5 * (here.power_W.value - 8.0))
    assert there.power_W.shared["current"] == pytest.approx(2**1.5 * here.power_W.shared["current"])
    faster, more = ratios(AT, AT._replace(rho=AT.rho / 4))
    assert (float(faster), float(more)) == pytest.approx((2.0, 2.0))


@pytest.mark.parametrize(("cost", "share"), [(Cost.POWER, 3.0), (Cost.ENERGY_PER_METER, 1.0)])
def test_best_speeds_are_those_of_the_textbook(cost: Cost, share: float) -> None:
    """CDi is 3 CD0 (1.6) for least power and CD0 (1.10) for least energy per meter, which idle power makes faster."""
    wide = polar_curve(POLAR, AT, (0.2, 2.5))
    exact = wide.best(cost).speed_mps
    assert exact is not None
    assert exact == pytest.approx(np.sqrt(2 * AT.weight_N / (AT.rho * AT.wing_area_m2 * np.sqrt(share * CD0 / K))))
    plain = Curve(kind=Kind.POWER_REQUIRED, condition=AT, V_mps=wide.V_mps, power_W=wide.power_W)
    step = wide.V_mps[1] - wide.V_mps[0]
    speed_interval = plain.best(cost)
    assert speed_interval.speed_mps == pytest.approx(exact, abs=step) and speed_interval.inside_flown_range
    assert (
        speed_interval.lo_mps is not None
        and speed_interval.hi_mps is not None
        and speed_interval.lo_mps <= exact <= speed_interval.hi_mps + step
    )
    idling = replace(plain, power_W=Uncertain(wide.power_W.value + 20.0, wide.power_W.own), idle_W=20.0).best(cost)
    faster = cost is Cost.ENERGY_PER_METER  # a constant power costs less per meter at higher speed
    assert idling.speed_mps is not None and speed_interval.speed_mps is not None
    assert bool(idling.speed_mps > speed_interval.speed_mps + step) is faster


def test_best_endurance_and_range_are_energy_over_the_least_cost() -> None:
    curve, energy_J = electrical(8.0), 3.6e5
    endurance, distance = (curve.longest(cost, energy_J) for cost in (Cost.POWER, Cost.ENERGY_PER_METER))
    assert endurance.value == pytest.approx(energy_J / curve.power_W.value.min())
    assert distance.value == pytest.approx(energy_J * np.max(curve.V_mps / curve.power_W.value))
    for item in (endurance, distance):
        assert item.lo < item.value < item.hi


def test_endurance_and_range_are_as_uncertain_as_power() -> None:
    """For power uncertain by 4 % at all speeds alike, 95 of 100 draws lie within 1.96 times 4 %."""
    curve = Curve(
        kind=Kind.ELECTRICAL, condition=AT, V_mps=CURVE.V_mps,
        power_W=Uncertain(CURVE.power_W.value, 0.0 * CURVE.power_W.own, {"current": 0.04 * CURVE.power_W.value}),
    )  # fmt: skip
    for cost in Cost:
        interval = curve.longest(cost, 3.6e5)
        assert (interval.hi - interval.lo) / (2 * interval.value) == pytest.approx(1.96 * 0.04, rel=0.1)
        assert interval.value / interval.lo - 1 == pytest.approx(1.96 * 0.04, rel=0.12)


def test_no_end_is_known_where_power_falls_to_the_slowest_speed() -> None:
    """The interval of the best speed has no lower end where slower speeds were not flown."""
    V = np.linspace(12.0, 20.0, 9)
    rising = Curve(kind=Kind.ELECTRICAL, condition=AT, V_mps=V, power_W=Uncertain(10 * V, 1e-6 * np.eye(9)))
    speed_interval = rising.best(Cost.POWER)
    assert (
        speed_interval.speed_mps,
        speed_interval.lo_mps,
        speed_interval.hi_mps,
        speed_interval.inside_flown_range,
    ) == (12.0, None, 12.0, False)
    falling = replace(rising, power_W=Uncertain(300 - 10 * V, 1e-6 * np.eye(9))).best(Cost.POWER)
    assert (falling.speed_mps, falling.lo_mps, falling.inside_flown_range) == (20.0, 20.0, False)


def test_the_classic_form_has_its_least_drag_where_the_parabola_has() -> None:
    """The polar is 0.03 + 0.05 (C_L - 0.2)^2, with an aspect ratio of 7."""
    classic = classic_form(np.array([0.03 + 0.05 * 0.2**2, -2 * 0.05 * 0.2, 0.05]), 7.0)
    assert classic == pytest.approx((0.03, 0.05, 0.2, 1 / (np.pi * 0.05 * 7)))


def test_a_point_s_interval_ends_at_zero_and_what_is_not_known_is_left_out() -> None:
    V, power = np.array([10.0, 11.0, 12.0, 13.0]), np.array([50.0, 50.0, np.nan, 50.0])
    points = power_points(V, power, np.array([10.0, 60.0, 1.0, np.inf]), [True, False, False, False])
    assert [(p.speed_mps, p.power_lo_W, p.power_hi_W, p.extrapolated) for p in points] == [
        (10.0, 40.0, 60.0, True),
        (11.0, 0.0, 110.0, False),
    ]
