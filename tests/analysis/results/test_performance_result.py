"""Performance in the results: intervals, field table, flags, notes and sentences of a hand-made performance."""

from dataclasses import replace

import numpy as np
import pytest

from analysis.performance.analysis import Ceilings, ConditionPerformance, FlightPerformance, PerformanceModel
from analysis.performance.full_throttle import FullThrottle, FullThrottlePerformance
from analysis.performance.level_flight import LevelFlight, Optimum
from analysis.performance.power_train import MeasuredEfficiency, PowerTrainModel
from analysis.performance.propagation import ParameterVector, UncertainValue, exact
from analysis.polar import Condition, lift_coefficient
from analysis.results.performance import _time_or_distance, performance_result
from analysis.results.schema import PerformanceCase
from flight.propeller_files import load_propeller

TEST = Condition(weight_N=37.7, rho=1.2, wing_area_m2=0.4636)
V = np.array([12.0, 14.0, 16.0, 18.0])
FASTEST = V[-1]  # flown


def uncertain(value, standard_error=0.0) -> UncertainValue:
    value = np.asarray(value, dtype=float)
    return UncertainValue(value, np.broadcast_to(np.asarray(standard_error, dtype=float), value.shape))


def level(battery_W: np.ndarray) -> LevelFlight:
    one = uncertain(np.ones(len(V)))
    return LevelFlight(
        V=V, required=uncertain([40.0, 42.0, 46.0, 52.0]), shaft=one, battery=uncertain(battery_W, 2.0),
        propeller=uncertain([0.6, 0.61, 0.62, 0.63], 0.01), motor=uncertain(np.full(4, 0.8)),
        overall=uncertain([0.48, np.nan, 0.5, 0.5]), inside=np.array([True, True, True, False]),
        battery_at_sigma_points=battery_W[None],
    )  # fmt: skip


def optimum(speed: float, best: float, *, inside: bool = True) -> Optimum:
    return Optimum(uncertain(speed, 0.1), uncertain(best, 10.0), uncertain(70.0), False, False, inside)


def full_throttle(maximum: float = 22.0, covered_to: float = 30.0) -> FullThrottlePerformance:
    speeds = np.linspace(12.0, 24.0, 25)
    return FullThrottlePerformance(
        V=speeds, power=uncertain(10 * speeds, 4.0), climb=uncertain((maximum - speeds) / 4, 0.1),
        covered=speeds <= covered_to, maximum_speed=uncertain(maximum, 0.2), best_climb=uncertain(2.5, 0.1),
        best_climb_speed=12.0,
    )  # fmt: skip


def at(
    title: str, minutes: float, km: float, speed: float, *, weight_N: float = TEST.weight_N, rho: float = TEST.rho,
    sustained: bool = True, full: FullThrottlePerformance | None = None, inside: bool = True,
) -> ConditionPerformance:  # fmt: skip
    return ConditionPerformance(
        title, TEST._replace(weight_N=weight_N, rho=rho), sustained, level(np.array([60.0, 64.0, 70.0, 80.0])),
        optimum(12.0, 60 * minutes), optimum(speed, 1000 * km, inside=inside), full or full_throttle(),
    )  # fmt: skip


def performance(*requested: ConditionPerformance, full: FullThrottlePerformance | None = None) -> FlightPerformance:
    CL = lift_coefficient(V, TEST)
    losses = ParameterVector(("shaft_scale", "friction"), np.array([1.02, 0.3]), np.diag([0.01**2, 0.05**2]))
    train = PowerTrainModel(losses, 0.0, True, "fitted", (MeasuredEfficiency(5.0, 13.0, 0.6, 0.8, 0.48),))
    motor = FullThrottle(exact(unloaded_revps=150.0, revps_per_Nm=40.0), basis="from 8 s")
    model = PerformanceModel(losses, train, motor, load_propeller("apc-12x8e"), (float(CL[-1]), float(CL[0])))
    return FlightPerformance(
        battery_energy_Wh=50.0,
        usable=0.8,
        model=model,
        as_flown=at("as flown", 50, 40, 13, full=full),
        requested=list(requested),
        efficiency=level(np.array([60.0, 64.0, 70.0, 80.0])),
        field_table=level(np.array([60.0, np.nan, 72.0, 80.0])),
        ceilings=Ceilings(uncertain(4000.0, 100.0), uncertain(5000.0, 100.0)),
    )


HEAVIER = at("300 g more", 45, 38, 13.5, weight_N=40.6)
BOTH = at("300 g more, 1000 m higher", 44, 38, 14, weight_N=40.6, rho=1.08)


def test_intervals_are_of_95_percent() -> None:
    flown: PerformanceCase = performance_result(performance()).loadings[0]
    assert (flown.endurance_s.lo, flown.endurance_s.hi) == pytest.approx((3000 - 19.6, 3000 + 19.6), abs=1e-3)
    assert (flown.range_speed_mps.lo, flown.range_speed_mps.hi) == pytest.approx((13 - 0.196, 13 + 0.196), abs=1e-5)


def test_the_field_table_divides_the_usable_energy_by_battery_power() -> None:
    """50 Wh of which 80 % are used are 144 kJ: at 60 W 2400 s, in which 12 m/s make 28.8 km."""
    first, third, last = performance_result(performance()).field_table
    assert (first.speed_mps, third.speed_mps, last.speed_mps) == (12.0, 16.0, 18.0), "no row without battery power"
    assert (first.endurance_s, first.range_m) == pytest.approx((2400.0, 28_800.0))
    assert (third.power_required_W, third.battery_W, third.endurance_s) == pytest.approx((46.0, 72.0, 2000.0))
    assert third.climb_mps == pytest.approx((22 - 16) / 4)
    assert last.extrapolated and not first.extrapolated


def test_a_condition_that_full_throttle_does_not_sustain_is_named_and_not_tabulated() -> None:
    heavy = at("9.00 kg", 10, 5, 20, weight_N=88.0, sustained=False)
    found = performance_result(performance(HEAVIER, heavy))
    assert [case.title for case in found.loadings] == ["as flown", "300 g more"]
    (text,) = found.too_much
    assert text.startswith("9.00 kg: ") and "full throttle" in text
    assert len(found.costs) == 1


def test_costs_are_those_of_single_changes_where_there_are_any() -> None:
    (text,) = performance_result(performance(HEAVIER, BOTH)).costs
    assert text.startswith("300 g more: ") and "50 to 45 min (-10 %)" in text and "40.0 to 38.0 km (-5 %)" in text
    assert "13.0 to 13.5 m/s (+4 %)" in text
    (text,) = performance_result(performance(BOTH)).costs
    assert text.startswith("300 g more, 1000 m higher: ")
    # Within half a per cent, weights and densities are the same.
    thinner = at("higher", 48, 41, 13.8, weight_N=1.004 * TEST.weight_N, rho=0.9 * TEST.rho)
    (text,) = performance_result(performance(thinner, BOTH)).costs
    assert text.startswith("higher: ")
    heavier = at("heavier", 48, 41, 13.8, weight_N=1.006 * TEST.weight_N, rho=0.996 * TEST.rho)
    (text,) = performance_result(performance(heavier, BOTH)).costs
    assert text.startswith("heavier: ")


def test_density_altitude_of_thin_air_is_positive() -> None:
    """1.08 kg/m^3 is the standard atmosphere's density at 1300 m."""
    case = performance_result(performance(BOTH)).loadings[1]
    assert case.density_altitude_m == pytest.approx(1300, abs=10)


def test_a_highest_speed_beyond_the_fastest_flown_is_an_extrapolation() -> None:
    available = performance_result(performance()).available
    assert available.maximum_speed_extrapolated
    assert any(f"{FASTEST:.1f} m/s" in note and "extrapolation" in note for note in available.notes)
    available = performance_result(performance(full=full_throttle(maximum=17.0))).available
    assert not available.maximum_speed_extrapolated
    assert not any("extrapolation" in note for note in available.notes)


def test_a_highest_speed_outside_the_propeller_table_is_an_extrapolation() -> None:
    found = performance_result(performance(full=full_throttle(maximum=17.0, covered_to=15.0)))
    assert found.available.maximum_speed_extrapolated and found.loadings[0].extrapolated
    assert any("propeller's table" in note for note in found.available.notes)
    found = performance_result(performance(full=full_throttle(maximum=17.0, covered_to=17.5)))
    assert not found.available.maximum_speed_extrapolated


def test_a_best_speed_outside_the_propeller_table_is_an_extrapolation() -> None:
    outside = at("300 g more", 45, 38, 13.5, weight_N=40.6, inside=False)
    flown, other = performance_result(performance(outside)).loadings
    assert other.extrapolated and not flown.extrapolated


@pytest.mark.parametrize(("maximum", "last"), [(17.0, 18.0), (22.0, 22.5)])
def test_power_available_is_drawn_to_the_highest_or_the_fastest_speed(maximum: float, last: float) -> None:
    """To 3 % beyond the highest level speed, and at least to the fastest flown; extrapolated from there on."""
    available = performance_result(performance(full=full_throttle(maximum=maximum))).available
    assert available.power_available[-1].speed_mps == last
    assert len(available.climb_mps) == len(available.power_available)
    for point in available.power_available:
        assert point.power_W == pytest.approx(10 * point.speed_mps)
        assert (point.power_lo_W, point.power_hi_W) == pytest.approx(
            (point.power_W - 7.84, point.power_W + 7.84), abs=0.01
        )
        assert point.extrapolated == (point.speed_mps > FASTEST)


@pytest.mark.parametrize(("climb", "text"), [(1.0, "excess power remains up to 24.0 m/s"), (-1.0, "not sustain")])
def test_without_a_highest_speed_a_note_says_which_side_it_is_on(climb: float, text: str) -> None:
    full = full_throttle()
    full = replace(full, climb=uncertain(np.full(25, climb)), maximum_speed=uncertain(np.nan, np.nan))
    available = performance_result(performance(full=full)).available
    assert available.maximum_speed_mps is None and not available.maximum_speed_extrapolated
    assert text in available.notes[0]


def test_service_and_absolute_ceiling_are_told_apart() -> None:
    found = performance()
    available = performance_result(found).available
    assert available.service_ceiling_m is not None and available.absolute_ceiling_m is not None
    assert (available.service_ceiling_m.value, available.absolute_ceiling_m.value) == (4000, 5000)
    none = replace(found, ceilings=Ceilings(uncertain(np.nan, np.nan), uncertain(5000.0, 100.0)))
    available = performance_result(none).available
    assert available.service_ceiling_m is None and "service ceiling" in available.notes[-1]


def test_without_full_throttle_the_reason_is_given() -> None:
    found = performance()
    unknown = replace(
        found,
        model=replace(found.model, full_throttle=FullThrottle(None, reason="no throttle")),
        as_flown=replace(found.as_flown, full_throttle=None),
        ceilings=None,
    )
    result = performance_result(unknown)
    assert result.available.reason == "no throttle" and result.available.power_available == []
    assert result.loadings[0].maximum_speed_mps is None
    assert [row.climb_mps for row in result.field_table] == [None, None, None]


def test_the_power_train_has_standard_errors_units_and_efficiencies() -> None:
    train = performance_result(performance()).power_train
    assert [(p.name, p.value, p.standard_error, p.unit) for p in train.parameters] == [
        ("shaft_scale", 1.02, pytest.approx(0.01), ""),
        ("friction", 0.3, pytest.approx(0.05), "W s/rev"),
    ]
    assert [point.speed_mps for point in train.efficiency] == [12.0, 16.0, 18.0], "none where the thrust is too large"
    assert train.efficiency[0].propeller.value == 0.6 and train.efficiency[0].motor.value == 0.8
    assert [point.extrapolated for point in train.efficiency] == [False, False, True]
    (measured,) = train.points
    assert (measured.time_s, measured.speed_mps, measured.overall) == (5.0, 13.0, 0.48)


def test_an_endurance_that_is_hardly_known_is_not_below_zero() -> None:
    """A thousand seconds with a standard error of a thousand: 95 % would begin at -960 s."""
    hardly, well = (_time_or_distance(UncertainValue(np.array(1000.0), np.array(e))) for e in (1000.0, 100.0))
    assert hardly.lo == 0.0 and hardly.hi == pytest.approx(2960, abs=1)
    assert (well.lo, well.hi) == (pytest.approx(804, abs=1), pytest.approx(1196, abs=1))
