"""Tests the results that come with a curve of electrical power: endurance, range, best speeds, and intervals."""

from types import SimpleNamespace

import msgspec
import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Curve, maximum_lift_to_drag, power_points, speed_of_least
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.airspeed_gps import AirspeedErrors
from flightpower.analysis.methods.whole_flight.drag import DragWithheld
from flightpower.analysis.methods.whole_flight.energy_balance import FlightConditions
from flightpower.analysis.methods.whole_flight.parameters import DRAG, unpack
from flightpower.analysis.methods.whole_flight.settings import GPS
from flightpower.analysis.methods.whole_flight.simulated_truth import SimulatedTruth
from flightpower.analysis.performance.autopilot_parameters import flight_values
from flightpower.analysis.records.flight import (
    BatteryResult,
    ConditionResult,
    CurveResult,
    FieldRow,
    Kind,
    PowerPoint,
    SpeedInterval,
)
from flightpower.analysis.results.energy_balance import (
    EnergyBalanceFindings,
    _balance,
    _polar,
    _warnings,
    against_field_table,
    electrical_curve,
)
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.units import GRAVITY_MPS2

V = np.linspace(10.0, 20.0, 41)
POWER_W = 50.0 + (V - 14.0) ** 2
BATTERY = BatteryResult(energy_Wh=125.0, usable=0.8)
EFFICIENCY = Uncertain(np.log(0.7 - 0.01 * (V - 10.0)), np.diag((0.02 + 0.01 * abs(V - 14.0)) ** 2), {})
FLOWN = SimpleNamespace(flown=np.ones(3000, dtype=bool))


def estimate(
    *,
    share: float = 0.03,
    noise_W: float = 1e-6,
    wind_mps: float | None = 3.0,
    scale: float = 0.02,
    rho_sigma: float = 0.0,
):
    """Return an estimate whose curve has noise and a scale error of all power, with the standard error `share`."""
    power = Uncertain(POWER_W, noise_W**2 * np.eye(len(V)), {"current": share * POWER_W})
    curve = Curve(kind=Kind.ELECTRICAL, condition=Condition(30.0, 1.2, 0.5), V_mps=V, power_W=power)
    return SimpleNamespace(
        V_mps=V, power_W=POWER_W, curve=curve, residual_W=np.array([3.0, -4.0]),
        standard_error_W=power.standard_error,
        conditions=SimpleNamespace(idle_power_W=4.0, idle_sigma_W=1.0),
        rho_sigma=rho_sigma, among_flights=power,
        shown_efficiency=EFFICIENCY,
        airspeed=AirspeedErrors(scale, 0.0, np.diag([0.01**2, 4.0]), wind_mps, 10.0),
    )  # fmt: skip


def uncertain(value: np.ndarray, half_width: np.ndarray) -> Uncertain:
    return Uncertain(value, np.diag((half_width / NORMAL_95) ** 2))


def curve(battery: BatteryResult | None = BATTERY, **of) -> CurveResult:
    return electrical_curve(estimate(**of), Condition(30.0, SEA_LEVEL_DENSITY, 0.5), battery)


def balance(drag=DragWithheld(), **of):
    return _balance(EnergyBalanceFindings(FLOWN, estimate(), drag, "apc-12x8e", **of))


def test_endurance_is_energy_over_the_least_power_and_range_over_that_per_speed() -> None:
    result = curve()
    assert result.endurance_s.value == pytest.approx(BATTERY.usable_J / 50.0)
    assert result.range_m.value == pytest.approx(BATTERY.usable_J / np.min(POWER_W / V))
    for interval in (result.endurance_s, result.range_m):
        ends = interval.value / (1 + 1.96 * 0.03), interval.value / (1 - 1.96 * 0.03)
        assert (interval.lo, interval.hi) == pytest.approx(ends, rel=0.015)  # from 400 draws
    assert curve(battery=None).endurance_s is None


def test_efficiency_is_reported_at_the_speed_where_it_is_known_best_and_never_of_a_simulation() -> None:
    thrust_efficiency = balance().thrust_efficiency
    times = np.exp(NORMAL_95 * 0.02)
    assert (thrust_efficiency.value, thrust_efficiency.lo, thrust_efficiency.hi) == pytest.approx(
        (0.66, 0.66 / times, 0.66 * times)
    )
    nowhere = estimate()
    nowhere.shown_efficiency = Uncertain(np.full(len(V), np.nan), np.eye(len(V)), {})
    assert _balance(EnergyBalanceFindings(FLOWN, nowhere, DragWithheld(), "")).thrust_efficiency is None
    assert balance(simulated=SimulatedTruth(0.0, 0.01, 0, np.nan)).thrust_efficiency is None


def test_best_speeds_are_those_of_the_least_power_and_of_the_least_energy_per_meter() -> None:
    """Scaling all power moves neither speed; noise moves both."""
    result = curve()
    assert result.least_power_speed.speed_mps == 14.0 and result.best_range_speed.speed_mps == V[np.argmin(POWER_W / V)]
    assert (result.least_power_speed.lo_mps, result.least_power_speed.hi_mps) == (14.0, 14.0)
    assert result.best_range_speed.lo_mps == result.best_range_speed.hi_mps == result.best_range_speed.speed_mps > 15.5
    noisy = curve(noise_W=1.0).least_power_speed
    assert 12.0 < noisy.lo_mps < 13.5 and 14.5 < noisy.hi_mps < 16.0 and noisy.inside_flown_range


def test_a_power_of_less_than_a_tenth_is_not_believed() -> None:
    """If power is known only to 60 %, the interval of endurance ends at ten times its value."""
    result = curve(share=0.6)
    assert result.endurance_s.hi == pytest.approx(10 * result.endurance_s.value)
    assert result.range_m.hi == pytest.approx(10 * result.range_m.value)


def test_a_best_speed_at_the_slowest_flown_has_no_lower_end() -> None:
    rising = V.copy()
    least = speed_of_least(V, rising, np.stack([rising] * 10))
    assert (least.speed_mps, least.lo_mps, least.inside_flown_range) == (10.0, None, False)
    # With 5 % of the draws at the slowest speed, more than 2.5 %, the interval has no lower end; with 1 % it has one.
    mixed = np.stack([rising] * 5 + [(V - 14.0) ** 2] * 95)
    assert speed_of_least(V, (V - 14.0) ** 2, mixed).lo_mps is None
    few = np.stack([rising] + [(V - 14.0) ** 2] * 99)
    assert speed_of_least(V, (V - 14.0) ** 2, few).lo_mps == 14.0
    falling = np.stack([-rising] * 5 + [(V - 14.0) ** 2] * 95)
    assert speed_of_least(V, (V - 14.0) ** 2, falling).hi_mps == 20.0
    assert not speed_of_least(V, -rising, falling).inside_flown_range


def test_what_is_beside_the_curve_has_intervals_of_95_per_cent() -> None:
    result = curve(noise_W=2.0)
    first, systematic_W = result.interval_parts[0], 0.03 * POWER_W[0]
    assert (first.noise_W, first.systematic_W) == pytest.approx((NORMAL_95 * 2.0, NORMAL_95 * systematic_W))
    of_balance = balance()
    scale = of_balance.airspeed_scale
    assert (scale.value, scale.lo, scale.hi) == pytest.approx((0.02, 0.02 - 0.01 * NORMAL_95, 0.02 + 0.01 * NORMAL_95))
    assert of_balance.residual_W == pytest.approx(np.sqrt(12.5))
    assert of_balance.flown_s == pytest.approx(3000 * FLIGHT.step_s)


def test_a_power_s_interval_ends_at_zero_and_what_is_not_known_is_left_out() -> None:
    points = power_points(np.array([10.0, 11.0, 12.0]), np.full(3, 50.0), np.array([10.0, 60.0, np.inf]))
    assert [(p.power_lo_W, p.power_hi_W) for p in points] == [(40.0, 60.0), (0.0, 110.0)]


def test_the_polar_is_that_of_the_quadratic_form() -> None:
    """The polar is C_D0 + K (C_L - C_LminD)^2, with e = 1/(pi A K)."""
    p = unpack(DRAG, np.array([np.log(0.04), np.log(0.06), 0.2, 0.0]))
    aircraft = SimpleNamespace(wing_area_m2=0.5, span_m=2.0)
    polar = _polar(SimpleNamespace(parameters=SimpleNamespace(named=lambda: p)), aircraft)
    for CL in (0.0, 0.5, 1.0):
        assert polar.A0 + polar.A1 * CL + polar.A2 * CL**2 == pytest.approx(0.04 + 0.06 * (CL - 0.2) ** 2)
    assert polar.oswald_efficiency == pytest.approx(1 / (np.pi * 8.0 * 0.06))
    assert polar.maximum_lift_to_drag == pytest.approx(maximum_lift_to_drag(np.array([polar.A0, polar.A1, polar.A2])))


def test_the_basis_of_thrust_tells_the_efficiency_in_per_cent() -> None:
    for measured, text in ((True, "motor speed in the log"), (False, "motor speed by electrical power")):
        drag = SimpleNamespace(
            measured_speed=measured,
            motor_efficiency=0.72,
        )
        result = balance(drag)
        assert "an efficiency of 72 %" in result.thrust_basis and text in result.thrust_basis


@pytest.mark.parametrize(
    ("of", "messages"),
    [
        ({}, []),
        ({"scale": 0.031}, ["Airspeed reads 3 % too high by GPS"]),
        ({"scale": -0.05}, ["Airspeed reads 5 % too low by GPS"]),
        ({"scale": 0.05, "wind_mps": None}, ["No GPS in this log"]),
        ({"share": 0.127}, []),
        ({"share": 0.128}, ["The interval is wider than ±25 % at 100 % of the speeds"]),
    ],
)
def test_what_a_reader_must_know_is_reported_from_its_limit_on(of: dict, messages: list[str]) -> None:
    warnings = _warnings(estimate(**of))
    assert len(warnings) == len(messages) and all(
        text.startswith(begin) for text, begin in zip(warnings, messages, strict=True)
    )


GIVEN = FlightConditions(3.0, 0.5, 1.1, 4.0)
PARAMETERS = unpack((*DRAG, "idle_drag"), np.array([np.log(0.04), np.log(0.06), 0.0, 0.0, 0.25]))


def source(**more):
    """Return quantities with a standard error of 3 % in the flight's own conditions."""

    def quantity(of):
        value = of(PARAMETERS, GIVEN)
        return uncertain(value, 0.03 * NORMAL_95 * np.abs(value))

    return SimpleNamespace(**(more | {"parameters": SimpleNamespace(quantity=quantity)}))


def values(drag=None, best=(14.0, 13.5, 14.2), **of):
    speed, lo, hi = best
    best_range = SpeedInterval(speed_mps=speed, lo_mps=lo, hi_mps=hi, inside_flown_range=True)
    result = source(**(vars(estimate(**of)) | {"conditions": GIVEN}))
    return flight_values(result, best_range, {}, drag)


def test_a_glide_is_with_the_idling_propeller_unless_its_table_gives_the_drag() -> None:
    """Sink is D V/W at the cruise speed, from C_D0 (1 + 0.25) + K C_L^2, or without the 0.25 of the propeller."""
    weight_N = 3.0 * GRAVITY_MPS2
    qS = 1.1 * 14.0**2 / 2 * 0.5
    for drag, CD0 in ((None, 0.05), (source(), 0.04)):
        result = values(drag)
        assert result.CD0.value == pytest.approx(CD0) and result.B.value == pytest.approx(0.06)
        assert result.sink.value == pytest.approx((CD0 + 0.06 * (weight_N / qS) ** 2) * qS * 14.0 / weight_N)
        for quantity in (result.CD0, result.B, result.sink):
            assert quantity.hi / quantity.value - 1 == pytest.approx(0.03 * NORMAL_95)
            assert 1 - quantity.lo / quantity.value == pytest.approx(0.03 * NORMAL_95)


def test_drag_that_takes_more_than_the_battery_gives_is_withheld() -> None:
    """Drag takes 43.7 W at 14 m/s. 46 W for the motor means an efficiency of 95 %; 41 W means an impossible one."""
    possible = values()
    assert possible.sink and possible.CD0 and possible.B and possible.cruise_power
    weaker = estimate()
    weaker.power_W = POWER_W - 5.0
    best = SpeedInterval(speed_mps=14.0, lo_mps=13.5, hi_mps=14.2, inside_flown_range=True)
    impossible = flight_values(source(**(vars(weaker) | {"conditions": GIVEN})), best, {}, None)
    assert (impossible.sink, impossible.CD0, impossible.B) == (None, None, None)
    assert impossible.cruise_power and impossible.cruise_power.value == 45.0


def test_equivalent_airspeeds_have_the_error_of_scale_and_zero() -> None:
    """A zero error of 2 Pa changes the speed by a share of 2/(rho V^2)."""
    to_equivalent = np.sqrt(1.1 / SEA_LEVEL_DENSITY)
    result = values()
    for interval, speed in ((result.slowest, 10.0), (result.fastest, 20.0)):
        share = NORMAL_95 * np.hypot(0.01, 2.0 / (1.1 * speed**2))
        assert interval.value == pytest.approx(speed * to_equivalent)
        assert (interval.lo, interval.hi) == pytest.approx(
            (speed * to_equivalent * (1 - share), speed * to_equivalent * (1 + share))
        )


def test_the_cruise_s_interval_is_that_of_its_optimum_or_of_the_airspeed_if_that_is_wider() -> None:
    to_equivalent = np.sqrt(1.1 / SEA_LEVEL_DENSITY)
    by_airspeed = 14.0 * (1 + NORMAL_95 * np.hypot(0.01, 2.0 / (1.1 * 14.0**2)))
    for best, ends in (
        ((14.0, 13.5, 14.2), (13.5, by_airspeed)),
        ((14.0, 13.5, 18.0), (13.5, 18.0)),
        ((14.0, None, None), (10.0, by_airspeed)),
    ):
        cruise = values(best=best).cruise
        assert (cruise.lo, cruise.value, cruise.hi) == pytest.approx(
            tuple(to_equivalent * speed for speed in (ends[0], 14.0, ends[1]))
        )


def test_powers_and_the_factor_of_airspeed_have_intervals_of_95_per_cent() -> None:
    result = values(share=0.04)
    half = NORMAL_95 * 0.04 * 50.0
    assert (result.cruise_power.lo, result.cruise_power.hi) == pytest.approx((50 - half, 50 + half))
    assert result.idle_power.value == 4.0 and result.idle_power.lo == 4.0 - NORMAL_95 * 1.0
    assert result.idle_power.hi == pytest.approx(4.0 + NORMAL_95 * 1.0)
    assert result.airspeed_factor.value == pytest.approx(1 / 1.02)
    assert result.airspeed_factor.hi - result.airspeed_factor.value == pytest.approx(NORMAL_95 * 0.01)
    assert values(wind_mps=None).airspeed_factor is None


def test_half_an_error_of_the_density_is_one_of_the_airspeed_as_far_as_gps_shows_it() -> None:
    """V goes with 1/sqrt(rho). GPS reduces the standard error of the airspeed scale from 4 % to 1 %."""
    by_density = (1 - (0.01 / GPS.scale_sigma) ** 2) * 0.06 / 2
    factor = values(rho_sigma=0.06).airspeed_factor
    assert factor.hi - factor.value == pytest.approx(NORMAL_95 * np.hypot(0.01, by_density))


@pytest.mark.parametrize(("electrical_W", "is_reported"), [(126.0, False), (128.0, True), (78.0, True)])
def test_two_answers_for_the_battery_are_reported_where_errors_hardly_explain_them(
    electrical_W: float, is_reported: bool
) -> None:
    """Two half widths of 10 % combine to 14 %; 3.29 standard deviations are then 23.7 %, and exp(0.237) is 1.268."""

    def points(power_W: float) -> list[PowerPoint]:
        return [
            PowerPoint(speed_mps=V, power_W=power_W, power_lo_W=0.9 * power_W, power_hi_W=1.1 * power_W)
            for V in (11.0, 15.0, 19.0)
        ]

    condition = ConditionResult(weight_N=40.0, air_density_kgpm3=1.2)
    row = FieldRow(speed_mps=14.0, power_required_W=60.0, battery_W=100.0, endurance_s=1.0, range_m=1.0, climb_mps=None,
                   extrapolated=False)  # fmt: skip
    by_flight = CurveResult(condition=condition, points=points(electrical_W))
    table = against_field_table(by_flight, points(60.0), [row])
    assert bool(table) == is_reported
    assert all(f"at 14 m/s the energy of the whole flight gives {electrical_W:.0f} W (" in item for item in table)
    assert all("field table, 100 W (90 to 110)" in item for item in table)
    assert not against_field_table(by_flight, points(60.0), [msgspec.structs.replace(row, speed_mps=25.0)])


def test_a_difference_that_rounds_to_zero_has_no_sign() -> None:
    assert "measured power by 0.0 %." in SimulatedTruth(0.001, 0.01, 75, -0.0002).sentence()
    assert "measured power by -1.2 %." in SimulatedTruth(0.001, 0.01, 75, -0.012).sentence()
