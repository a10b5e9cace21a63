"""Hand-made curves test performance in results.json: intervals, field table, flags and notes."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from flightpower.analysis.curve import Condition
from flightpower.analysis.performance.analysis import _cost, _is_single_change, field_rows, performance_case
from flightpower.analysis.performance.climb import FullThrottlePerformance, available_result
from flightpower.analysis.performance.level_flight import LevelFlight
from flightpower.analysis.performance.power_train import PowerTrainModel
from flightpower.analysis.performance.propagation import ParameterVector, UncertainValue
from flightpower.analysis.performance.request import TitledCondition
from flightpower.analysis.records.flight import AvailableResult, BatteryResult, PerformanceCase

BATTERY_W = np.array([60.0, 64.0, 70.0, 80.0])
TEST = Condition(weight_N=37.7, rho=1.2, wing_area_m2=0.4636)
V = np.array([12.0, 14.0, 16.0, 18.0])
FASTEST = V[-1]  # fastest speed flown


def uncertain(value, standard_error=0.0) -> UncertainValue:
    value = np.asarray(value, dtype=float)
    return UncertainValue(value, np.broadcast_to(np.asarray(standard_error, dtype=float), value.shape))


def level(battery_W: np.ndarray) -> LevelFlight:
    item = uncertain(np.ones(len(V)))
    return LevelFlight(
        V=V, required=uncertain([40.0, 42.0, 46.0, 52.0]), shaft=item, battery=uncertain(battery_W, 2.0),
        propeller=uncertain([0.6, 0.61, 0.62, 0.63], 0.01), motor=uncertain(np.full(4, 0.8)),
        overall=uncertain([0.48, np.nan, 0.5, 0.5]), inside=np.array([True, True, True, False]),
        battery_at_sigma_points=battery_W[None],
    )  # fmt: skip


def full_throttle(maximum: float = 22.0, covered_to: float = 30.0) -> FullThrottlePerformance:
    speeds = np.linspace(12.0, 24.0, 25)
    return FullThrottlePerformance(
        V=speeds, thrust_N=10 + 0 * speeds, power=uncertain(10 * speeds, 4.0),
        climb=uncertain((maximum - speeds) / 4, 0.1),
        covered=speeds <= covered_to, maximum_speed=uncertain(maximum, 0.2), best_climb=uncertain(2.5, 0.1),
        best_climb_speed=12.0,
    )  # fmt: skip


TITLED = TitledCondition("as flown", TEST)
EVERYWHERE = np.ones(len(V), dtype=bool)


def case(title: str, minutes: float, km: float, speed: float, condition: Condition = TEST) -> PerformanceCase:
    """Return a case of hand-made numbers, with these values in the fields that `_cost` reads."""
    complete = performance_case(TitledCondition(title, condition), level(BATTERY_W), full_throttle(), (1e5, EVERYWHERE))
    return msgspec.structs.replace(
        complete,
        endurance_s=uncertain(60 * minutes, 10.0).interval(),
        range_m=uncertain(1000 * km).interval(),
        range_speed_mps=uncertain(speed).interval(),
    )


FLOWN = case("as flown", 50, 40, 13)


def available(full: FullThrottlePerformance, service_m: float = 4000.0) -> AvailableResult:
    ceilings = [uncertain(service_m, 100.0 if np.isfinite(service_m) else np.nan), uncertain(5000.0, 100.0)]
    return available_result(full, ceilings, "from 8 s", float(FASTEST))


def test_intervals_are_of_95_percent_and_end_at_the_slowest_speed_flown() -> None:
    assert (FLOWN.endurance_s.lo, FLOWN.endurance_s.hi) == pytest.approx((3000 - 19.6, 3000 + 19.6), abs=1e-3)
    speed = uncertain(13.0, 0.1)
    assert (speed.interval().lo, speed.interval().hi) == pytest.approx((13 - 0.196, 13 + 0.196), abs=1e-5)
    assert (speed.interval(12.9).lo, speed.interval(13.5).lo) == (12.9, 13.0)


def test_the_field_table_divides_the_usable_energy_by_battery_power() -> None:
    """80 % of 50 Wh are 144 kJ, enough for 2400 s at 60 W, which is 28.8 km at 12 m/s."""
    battery = BatteryResult(energy_Wh=50.0, usable=0.8)
    flight = level(np.array([60.0, np.nan, 72.0, 80.0]))
    first, third, last = field_rows(flight, full_throttle(), battery.usable_J)
    assert (first.speed_mps, third.speed_mps, last.speed_mps) == (12.0, 16.0, 18.0), "no row without battery power"
    assert (first.endurance_s, first.range_m) == pytest.approx((2400.0, 28_800.0))
    assert (third.power_required_W, third.battery_W, third.endurance_s) == pytest.approx((46.0, 72.0, 2000.0))
    assert third.climb_mps == pytest.approx((22 - 16) / 4)
    assert last.extrapolated and not first.extrapolated
    assert [row.climb_mps for row in field_rows(flight, None, 1e5)] == [None, None, None]


def test_the_cost_of_a_change_names_endurance_range_and_speed_before_and_after() -> None:
    text = _cost(FLOWN, case("300 g more", 45, 38, 13.5))
    assert [part in text for part in ("300 g more", "50 to 45 min (-10 %)", "40.0 to 38.0 km (-5 %)")] == [True] * 3
    assert "13.0 to 13.5 m/s (+4 %)" in text


def test_a_single_change_is_of_weight_or_of_air() -> None:
    """Weights and densities within half a percent count as the same."""

    def single(weight: float, density: float) -> bool:
        condition = TEST._replace(weight_N=weight * TEST.weight_N, rho=density * TEST.rho)
        return _is_single_change(FLOWN, case("", 45, 38, 13.5, condition))

    assert single(1.1, 1.0) and single(1.004, 0.9) and single(1.006, 0.996)
    assert not single(1.1, 0.9) and not single(1.004, 0.996)


def test_density_altitude_of_thin_air_is_positive() -> None:
    """1.08 kg/m^3 is the standard atmosphere's density at 1300 m."""
    assert case("", 44, 38, 14, TEST._replace(rho=1.08)).density_altitude_m == pytest.approx(1300, abs=10)


@pytest.mark.parametrize(
    ("maximum", "covered_to", "extrapolated", "notes"),
    [
        (22.0, 30.0, True, 1),
        (17.0, 30.0, False, 0),
        (17.0, 15.0, True, 1),
        (17.0, 17.5, False, 0),
        (22.0, 15.0, True, 2),
    ],
)
def test_a_highest_speed_beyond_the_fastest_flown_or_the_table_is_an_extrapolation(
    maximum: float, covered_to: float, extrapolated: bool, notes: int
) -> None:
    """Each of the two reasons gives a note, in addition to the note on the ceilings."""
    full = full_throttle(maximum, covered_to)
    assert available(full).maximum_speed_extrapolated == extrapolated
    assert len(available(full).notes) == notes + 1
    assert performance_case(TITLED, level(BATTERY_W), full, (1e5, EVERYWHERE)).extrapolated == (covered_to < maximum)


def test_a_best_speed_outside_the_propeller_table_is_an_extrapolation() -> None:
    outside = replace(level(BATTERY_W), inside=np.zeros(len(V), dtype=bool))
    assert performance_case(TITLED, outside, None, (1e5, EVERYWHERE)).extrapolated
    assert not performance_case(TITLED, level(BATTERY_W), None, (1e5, EVERYWHERE)).extrapolated


@pytest.mark.parametrize(("maximum", "last_speed_mps"), [(17.0, 18.0), (22.0, 22.5)])
def test_power_available_is_drawn_to_the_highest_or_the_fastest_speed(maximum: float, last_speed_mps: float) -> None:
    """It is drawn to 3 % beyond the highest level speed or to the fastest flown, and extrapolated beyond the latter."""
    result = available(full_throttle(maximum=maximum))
    assert result.power_available[-1].speed_mps == last_speed_mps
    assert len(result.climb_mps) == len(result.power_available)
    for point in result.power_available:
        assert point.power_W == pytest.approx(10 * point.speed_mps)
        assert (point.power_lo_W, point.power_hi_W) == pytest.approx(
            (point.power_W - 7.84, point.power_W + 7.84), abs=0.01
        )
        assert point.extrapolated == (point.speed_mps > FASTEST)


@pytest.mark.parametrize(("climb", "text"), [(1.0, "excess power remains up to 24.0 m/s"), (-1.0, "not sustain")])
def test_without_a_highest_speed_a_note_says_which_side_it_is_on(climb: float, text: str) -> None:
    full = full_throttle()
    full = replace(full, climb=uncertain(np.full(25, climb)), maximum_speed=uncertain(np.nan, np.nan))
    result = available(full)
    assert result.maximum_speed_mps is None and not result.maximum_speed_extrapolated
    assert text in result.notes[0]


def test_service_and_absolute_ceiling_are_distinguished() -> None:
    result = available(full_throttle())
    assert result.service_ceiling_m is not None and result.absolute_ceiling_m is not None
    assert (result.service_ceiling_m.value, result.absolute_ceiling_m.value) == (4000, 5000)
    assert available(full_throttle(), np.nan).service_ceiling_m is None


def test_the_power_train_has_standard_errors_units_and_efficiencies() -> None:
    losses = ParameterVector(("shaft_scale", "friction"), np.array([1.02, 0.3]), np.diag([0.01**2, 0.05**2]))
    train = PowerTrainModel(losses, 0.0, True, "fitted", ())
    assert [(p.name, p.value, p.standard_error, p.unit) for p in train.parameter_results()] == [
        ("shaft_scale", 1.02, pytest.approx(0.01), ""),
        ("friction", 0.3, pytest.approx(0.05), "W s/rev"),
    ]
    points = level(BATTERY_W).efficiencies()
    assert [point.speed_mps for point in points] == [12.0, 16.0, 18.0], "no point where the efficiency is unknown"
    assert points[0].propeller.value == 0.6 and points[0].motor.value == 0.8
    assert [point.extrapolated for point in points] == [False, False, True]


def test_an_endurance_that_is_hardly_known_is_not_below_zero() -> None:
    """For 1000 s with a standard error of 1000 s, the 95 % interval would begin at -960 s."""
    hardly, well = (uncertain(1000.0, error).interval(0.0) for error in (1000.0, 100.0))
    assert hardly.lo == 0.0 and hardly.hi == pytest.approx(2960, abs=1)
    assert (well.lo, well.hi) == (pytest.approx(804, abs=1), pytest.approx(1196, abs=1))
