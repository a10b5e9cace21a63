"""A flight without noise, whose truth is known: each channel is what its sensor would have read."""

import dataclasses
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np
import pytest

from flightpower.analysis.estimation.model import NamedValues, PriorMeasurement
from flightpower.analysis.methods.whole_flight.airspeed_gps import airspeed_errors, by_wind, one_way
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, FlownAircraft, estimate
from flightpower.analysis.methods.whole_flight.drag import (
    DragEstimate,
    DragLacks,
    DragWithheld,
    ThrustSource,
    drag_estimate,
)
from flightpower.analysis.methods.whole_flight.energy_balance import FlightConditions
from flightpower.analysis.methods.whole_flight.fit import Estimate, SharedError
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable, flight_table
from flightpower.analysis.methods.whole_flight.parameters import Source
from flightpower.analysis.methods.whole_flight.simulated_truth import compared
from flightpower.analysis.methods.whole_flight.thrust_balance import PARAMETERS, MotorConstants
from flightpower.analysis.options import Options
from flightpower.analysis.performance.autopilot_parameters import flight_values
from flightpower.analysis.pipeline.whole_flight import analyze_recording
from flightpower.analysis.records.flight import BatteryResult, EvidenceKind, Kind, Provenance, SpeedInterval, Trust
from flightpower.analysis.results.energy_balance import EnergyBalanceFindings, _warnings, assemble_energy_balance
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.recording import Channel, FlightRecording
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import height_at, pressure_at, temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.propeller_speed import revps_for_thrust
from flightpower.flight.units import GRAVITY_MPS2 as g

MASS_KG, AREA_M2, SPAN_M = 3.0, 0.5, 2.0
GROUND_S, FLOWN_S, STEP_S = 60.0, 400.0, 0.1
AIR_K, IDLE_W, ZERO_PA, SCALE = 295.0, 4.0, 7.0, 0.02
WIND_NORTH_MPS, WIND_EAST_MPS = 3.0, -4.0
LATENCY_S = 0.15
CD0, K, CL_MIND = 0.045, 0.06, 0.2
MOTOR = MotorConstants(torque_constant=0.015, resistance_ohm=0.05, no_load_A=1.0)
PROPELLER = load_propeller("apc-12x8e")


class Truth(NamedTuple):
    """The true motion of the aircraft, (n,) each."""

    t_s: Array
    V_mps: Array
    height_m: Array
    rho: Array
    load_factor: Array
    electrical_W: Array
    revps: Array


def drag_W(V: Array, load_factor: Array | float, rho: Array | float) -> Array:
    qS = rho * V**2 / 2 * AREA_M2
    CL = load_factor * MASS_KG * g / qS
    return qS * V * (CD0 + K * (CL - CL_MIND) ** 2)


def electrical_W(thrust_N: Array, V: Array, rho: Array) -> tuple[Array, Array]:
    revps = revps_for_thrust(PROPELLER, V, thrust_N, rho)
    _, shaft_W = PROPELLER.thrust_and_power(V, revps, rho)
    return MOTOR.electrical_W(shaft_W, revps) + IDLE_W, revps


@pytest.fixture(scope="module")
def truth() -> Truth:
    """Sixty seconds on the ground, then speeds from 12 to 20 m/s with climbs and descents, and the ground again."""
    t = np.arange(0, 2 * GROUND_S + FLOWN_S, STEP_S)
    s = t - GROUND_S
    flying = (s > 0) & (s < FLOWN_S)
    V = np.where(flying, 16 + 4 * np.sin(0.035 * s), 0.0)
    h = np.where(flying, np.minimum(np.minimum(s, FLOWN_S - s) * 0.6, 60.0) + 2 * np.sin(0.08 * s), 0.0)
    air_h = np.maximum(h, 0.0)
    rho = pressure_at(air_h, ground_temperature_K=AIR_K) / (287.05287 * AIR_K)
    load = np.where(flying, 1.05 + 0.05 * np.sin(0.07 * s), 1.0)
    power, revps = np.full(len(t), IDLE_W), np.zeros(len(t))
    V_dot, h_dot = np.gradient(V, STEP_S), np.gradient(air_h, STEP_S)
    inside = flying & (s > 1) & (s < FLOWN_S - 1)
    thrust = drag_W(V[inside], load[inside], rho[inside]) / V[inside] + MASS_KG * (
        V_dot[inside] + g * h_dot[inside] / V[inside]
    )
    pulling = thrust > 0.1
    rows = np.flatnonzero(inside)[pulling]
    power[rows], revps[rows] = electrical_W(thrust[pulling], V[rows], rho[rows])
    return Truth(t, V, air_h, rho, load, power, revps)


def flown(truth: Truth, *, gps: bool = True, motor: bool = True) -> FlightRecording:
    t = truth.t_s
    heading = 0.05 * t
    moving = (truth.V_mps > 0).astype(float)
    read = truth.rho / 2 * (truth.V_mps * (1 + SCALE)) ** 2 + ZERO_PA
    volts = np.full(len(t), 12.0)
    channels = {
        recording.AIRSPEED_PRESSURE: Channel(t, read),
        recording.STATIC: Channel(t, pressure_at(truth.height_m, ground_temperature_K=AIR_K)),
        recording.FORCE_Z: Channel(t, -g * truth.load_factor),
        recording.VOLTAGE: Channel(t, volts),
        recording.CURRENT: Channel(t, truth.electrical_W / volts),
    }
    if motor:
        channels[recording.MOTOR] = Channel(t, truth.revps)
    if gps:
        down = -np.gradient(truth.height_m, STEP_S)
        along = np.sqrt(np.maximum(truth.V_mps**2 - down**2, 0.0))
        velocity = (
            along * np.cos(heading) + WIND_NORTH_MPS * moving,
            along * np.sin(heading) + WIND_EAST_MPS * moving,
            down,
        )
        channels |= {name: Channel(t + LATENCY_S, x) for name, x in zip(recording.GPS, velocity, strict=True)}
    thermometers = {"board": Channel(t, np.full(len(t), AIR_K + 20.0)), "air": Channel(t, np.full(len(t), AIR_K))}
    return FlightRecording(Path("constructed"), channels, thermometers, zeroed=False)


@pytest.fixture(scope="module")
def table(truth: Truth) -> FlightTable:
    return flight_table(flown(truth), MASS_KG * g, AREA_M2)


@pytest.fixture(scope="module")
def electrical(table: FlightTable) -> ElectricalEstimate:
    return estimate(table, MASS_KG * g, AREA_M2, SPAN_M)


def test_the_table_is_what_the_aircraft_did(table: FlightTable, truth: Truth) -> None:
    t = table.table.index.to_numpy()
    rows = table.flown

    def on_table(values: Array) -> Array:
        return np.interp(t[rows], truth.t_s, values)

    result = table.table[rows]
    assert result["rho"].to_numpy() == pytest.approx(on_table(truth.rho), rel=1e-3)
    assert result["load_factor"].to_numpy() == pytest.approx(on_table(truth.load_factor), rel=1e-3)
    assert result["power_W"].to_numpy() == pytest.approx(on_table(truth.electrical_W), rel=0.02, abs=1.0)
    pressure = on_table(truth.rho) / 2 * (on_table(truth.V_mps) * (1 + SCALE)) ** 2
    assert result["pressure_Pa"].to_numpy() == pytest.approx(pressure, abs=1.0)
    assert np.ptp(result["height_m"].to_numpy() - on_table(truth.height_m)) < 0.5
    assert table.idle_power_W == pytest.approx(IDLE_W, abs=0.01)
    assert table.zero_sigma_Pa == pytest.approx(0.7, abs=0.01)  # what a zero of a minute on the ground is good for
    assert table.air_temperature_K == AIR_K and table.rho_sigma == pytest.approx(3.0 / AIR_K)
    assert "22 °C, by the coolest thermometer, air (board shows 42 °C)" in table.notes[-1]


def test_flight_begins_clear_of_the_ground(table: FlightTable, truth: Truth) -> None:
    """Eight seconds after and before the three meters above the ground; one stretch between."""
    (rows,) = table.airborne
    first, last = (table.table.index[i] for i in (rows.start, rows.stop - 1))
    high = truth.t_s[truth.height_m > 3.0]
    assert (first - high[0], high[-1] - last) == pytest.approx((8.0, 8.0), abs=0.5)
    assert table.flown.sum() == rows.stop - rows.start


def test_without_a_thermometer_and_too_short_a_flight_it_is_reported(truth: Truth) -> None:
    complete = flown(truth)
    blind = FlightRecording(complete.path, complete.channels, {}, zeroed=False)
    table = flight_table(blind, MASS_KG * g, AREA_M2)
    standard_K = temperature_at(height_at(float(np.median(complete.channels[recording.STATIC].value))))
    assert table.air_temperature_K == pytest.approx(standard_K, abs=1e-6)
    assert table.rho_sigma == pytest.approx(8.0 / standard_K)
    assert "taken as 15 °C" in table.notes[-1]
    short = {
        name: Channel(*(x[truth.t_s < GROUND_S + 60] for x in channel)) for name, channel in complete.channels.items()
    }
    with pytest.raises(InputError, match=r"for [0-9]+ s in the air; 60 s clear"):
        flight_table(FlightRecording(complete.path, short, {}, zeroed=False), MASS_KG * g, AREA_M2)
    late = {
        name: channel._replace(t_s=channel.t_s + 1e5) for name, channel in complete.channels.items()
    }  # on for a day
    assert flight_table(FlightRecording(complete.path, late, {}, zeroed=False), MASS_KG * g, AREA_M2).flown.any()
    late = {
        name: Channel(channel.t_s + 1e5 + 4e4 * (channel.t_s > 100.0), channel.value)
        for name, channel in complete.channels.items()
    }
    with pytest.raises(InputError, match=f"its clock spans {4e4 + truth.t_s[-1]:.0f} s; longer than any flight"):
        flight_table(FlightRecording(complete.path, late, {}, zeroed=False), MASS_KG * g, AREA_M2)
    hot = FlightRecording(
        complete.path, complete.channels, {"bay": Channel(truth.t_s, 0 * truth.t_s + 305.0)}, zeroed=False
    )
    assert flight_table(hot, MASS_KG * g, AREA_M2).rho_sigma == pytest.approx(8.0 / 305.0)


@pytest.mark.parametrize(
    ("end_s", "refused"),
    [(GROUND_S + 50.0, r"for 5[01] s in the air; 60 s"), (GROUND_S, "for 0 s in the air"), (300, "--mass")],
)
def test_a_log_too_short_for_any_aircraft_is_refused_before_its_mass_is_asked(
    truth: Truth, end_s: float, refused: str
) -> None:
    complete = flown(truth)
    until = {name: Channel(*(x[truth.t_s < end_s] for x in channel)) for name, channel in complete.channels.items()}
    with pytest.raises(InputError, match=refused):
        analyze_recording(replace(complete, channels=until), Options(), lambda step: None)


def test_circles_against_gps_show_scale_and_wind(table: FlightTable) -> None:
    errors = airspeed_errors(table)
    assert errors.scale == pytest.approx(SCALE, abs=0.001)
    assert errors.zero_Pa == pytest.approx(0.0, abs=1.5)
    assert errors.wind_mps == pytest.approx(5.0, abs=0.1)
    assert errors.wind_from_deg == pytest.approx(np.degrees(np.arctan2(4, -3)) % 360, abs=1.0)
    assert np.sqrt(errors.covariance[0, 0]) < 0.3 * 0.0125
    north, east = (table.table[name].to_numpy()[table.flown] for name in recording.GPS[:2])
    assert one_way(north, east, errors) < 0.15
    assert one_way(np.full(9, 12.0) + WIND_NORTH_MPS, np.full(9, WIND_EAST_MPS), errors) > 0.99


def test_without_gps_the_airspeed_is_believed_to_its_prior(truth: Truth) -> None:
    errors = airspeed_errors(flight_table(flown(truth, gps=False), MASS_KG * g, AREA_M2))
    assert (errors.scale, errors.zero_Pa, errors.wind_mps) == (0.0, 0.0, None)
    assert np.sqrt(np.diag(errors.covariance)) == pytest.approx([0.0125, 0.7], rel=0.02)


def test_a_simulation_without_a_pitot_is_compared_with_its_truth(truth: Truth) -> None:
    """The recording then starts with the GPS receiver, which is late."""
    flight = flown(truth)
    channels = {name: channel for name, channel in flight.channels.items() if name != recording.AIRSPEED_PRESSURE}
    airspeed = {recording.TRUE_AIRSPEED: Channel(truth.t_s, truth.V_mps)}
    without_pitot = replace(flight, channels=channels, truth=airspeed)
    rows = flight_table(without_pitot, MASS_KG * g, AREA_M2)
    result = compared(without_pitot, rows, estimate(rows, MASS_KG * g, AREA_M2, SPAN_M))
    assert result is not None and abs(result.airspeed_error) < 0.005


def level_truth_W(V: Array, rho: float) -> Array:
    return electrical_W(drag_W(V, 1.0, rho) / V, V, np.full(len(V), rho))[0]


def test_the_electrical_power_of_level_flight_is_found(electrical: ElectricalEstimate) -> None:
    V = electrical.V_mps
    inside = (V > 13) & (V < 19)
    expected = level_truth_W(V[inside], electrical.conditions.rho)
    assert electrical.power_W[inside] == pytest.approx(expected, rel=0.05)
    relative = electrical.standard_error_W[inside] / electrical.power_W[inside]
    assert 0.012 < relative.min() and relative.max() < 0.06
    near = (electrical.measured_V_mps > 13) & (electrical.measured_V_mps < 19)
    measured = electrical.measured_W[near] / level_truth_W(electrical.measured_V_mps[near], electrical.conditions.rho)
    assert np.median(measured) == pytest.approx(1.0, abs=0.03) and np.std(measured) < 0.08
    assert electrical.gust_mps < 0.15


@pytest.fixture(scope="module", params=["measured speed", "motor constants"])
def drag(request: pytest.FixtureRequest, truth: Truth, electrical: ElectricalEstimate, table: FlightTable) -> Iterator:
    measured = request.param == "measured speed"
    flight = table if measured else flight_table(flown(truth, motor=False), MASS_KG * g, AREA_M2)
    yield drag_estimate(flight, electrical, SPAN_M, ThrustSource(PROPELLER, None if measured else MOTOR)), measured


def test_power_required_and_shaft_power_are_found_by_the_propeller_s_table(
    drag: tuple[DragEstimate, bool],
) -> None:
    result, measured = drag
    assert isinstance(result, DragEstimate) and result.measured_speed is measured
    V = result.V_mps
    inside = (V > 13) & (V < 19)
    V, rho = V[inside], result.curve.condition.rho
    expected = drag_W(V, 1.0, rho)
    assert result.power_W[inside] == pytest.approx(expected, rel=0.01)
    assert np.abs(result.power_W[inside] - expected).max() < 2 * result.curve.power_W.standard_error[inside].max()
    revps = revps_for_thrust(PROPELLER, V, expected / V, rho)
    assert result.shaft.value[inside] == pytest.approx(PROPELLER.thrust_and_power(V, revps, rho)[1], rel=0.04)
    assert 0.7 < result.motor_efficiency < 0.95
    relative = result.curve.power_W.standard_error[inside] / result.power_W[inside]
    assert 0.01 < relative.min() and relative.max() < 0.06


def test_thrust_on_a_stand_is_a_prior_of_the_table_s_errors(table: FlightTable, electrical: ElectricalEstimate) -> None:
    """A nearly exact stand measures thrust at rest 10 % above the table; the parameters then say the same."""
    stand = PriorMeasurement(
        name="stand", coefficients={"thrust_scale": 1, "thrust_slope": -0.5}, value=0.1, sigma=1e-3
    )
    estimate = drag_estimate(table, electrical, SPAN_M, ThrustSource(PROPELLER, stand=(stand,)))
    assert isinstance(estimate, DragEstimate)
    row = np.array([{"thrust_scale": 1.0, "thrust_slope": -0.5}.get(name, 0.0) for name in PARAMETERS])
    assert row @ estimate.parameters.values == pytest.approx(0.1, abs=1e-3)
    assert np.sqrt(row @ estimate.parameters.covariance @ row) == pytest.approx(1e-3, rel=0.01)


def test_a_wrong_number_of_poles_is_found_by_the_efficiency(table: FlightTable, electrical: ElectricalEstimate) -> None:
    doubled = table._replace(table=table.table.assign(**{recording.MOTOR: 2 * table.table[recording.MOTOR]}))
    estimate = drag_estimate(doubled, electrical, SPAN_M, ThrustSource(PROPELLER))
    assert isinstance(estimate, DragWithheld) and estimate.lacks is DragLacks.POSSIBLE_EFFICIENCY
    assert estimate.motor_efficiency is not None
    assert 4 * 0.7 < estimate.motor_efficiency < 20, (
        "by twice the speed, at the same airspeed: four times the power at least"
    )
    assert drag_estimate(table, electrical, SPAN_M, ThrustSource()) == DragWithheld(DragLacks.PROPELLER)
    aircraft = FlownAircraft("test", MASS_KG * g, AREA_M2, SPAN_M)
    results = assemble_energy_balance(
        Path("log"), aircraft, EnergyBalanceFindings(table, electrical, estimate), cast(Provenance, None)
    )
    assert [(evidence.kind, evidence.figure) for evidence in results.evidence] == [
        (EvidenceKind.MOTOR_EFFICIENCY, estimate.motor_efficiency)
    ]
    assert results.trust is Trust.DOUBTFUL


def test_standard_errors_add_what_the_flight_shares() -> None:
    """A linear quantity: its variance is the part from the parameters plus the squared change by each shared error."""
    conditions = FlightConditions(MASS_KG, AREA_M2, 1.2, IDLE_W)
    heavier = conditions._replace(mass_kg=MASS_KG + 0.1)

    def quantity(p: NamedValues, c: FlightConditions) -> Array:
        return np.array([2 * p.x - p.y, 10 * c.mass_kg + p.y])

    covariance = np.array([[0.04, 0.01], [0.01, 0.09]])
    shared = {Source.MASS: SharedError(np.array([0.0, 0.5]), heavier)}
    estimate = Estimate(("x", "y"), np.array([1.0, 2.0]), covariance, shared, conditions)
    assert estimate.gradient(quantity) == pytest.approx(np.array([[2.0, 0.0], [-1.0, 1.0]]))
    result = estimate.quantity(quantity)
    assert result.shared[Source.MASS] == pytest.approx([-0.5, 1.5])
    assert result.value == pytest.approx([0.0, 32.0])
    assert result.standard_error**2 == pytest.approx([4 * 0.04 - 4 * 0.01 + 0.09 + 0.25, 0.09 + 2.25])


def test_a_motor_s_electrical_power_is_that_of_its_constants() -> None:
    """omega k + R I volts, I amperes; k (I - I0) is the shaft's torque. Driven by the air it absorbs no power."""
    omega, current = 600.0, 12.0
    shaft_W = MOTOR.torque_constant * (current - MOTOR.no_load_A) * omega
    taken = MOTOR.electrical_W(np.array([shaft_W, -1000.0]), np.array([omega, omega]) / (2 * np.pi))
    assert taken == pytest.approx([(omega * 0.015 + 0.05 * current) * current, 0.0])


def test_the_results_are_those_of_the_estimate(
    drag: tuple[DragEstimate, bool], table: FlightTable, electrical: ElectricalEstimate
) -> None:
    result, _ = drag
    aircraft, battery = FlownAircraft("test", MASS_KG * g, AREA_M2, SPAN_M), BatteryResult(energy_Wh=125.0, usable=0.8)
    provenance = cast(Provenance, None)
    findings = EnergyBalanceFindings(table, electrical, result, "apc-12x8e", battery)
    results = assemble_energy_balance(Path("log"), aircraft, findings, provenance)
    beside, balance = results.curves[Kind.ELECTRICAL], results.balance
    assert balance is not None and balance.airspeed_scale is not None
    assert beside.endurance_s is not None and beside.range_m is not None and beside.best_range_speed is not None
    V, power = electrical.V_mps, electrical.power_W
    assert beside.endurance_s.value == pytest.approx(battery.usable_J / power.min())
    assert beside.range_m.value == pytest.approx(battery.usable_J * np.max(V / power))
    assert 0.9 < beside.range_m.lo / beside.range_m.value < 0.995
    assert 1.005 < beside.range_m.hi / beside.range_m.value < 1.1
    assert beside.best_range_speed.speed_mps == pytest.approx(V[np.argmin(power / V)])
    assert balance.airspeed_scale.hi - balance.airspeed_scale.value == pytest.approx(
        1.96 * np.sqrt(electrical.airspeed.covariance[0, 0]), rel=1e-3
    )
    assert balance.flown_s == pytest.approx(table.flown.sum() * 0.2)
    for point, p, error in zip(results.electrical_power, power, electrical.standard_error_W, strict=True):
        assert (point.power_hi_W - p, p - point.power_lo_W) == pytest.approx((1.96 * error,) * 2, rel=1e-3)
    parts = beside.interval_parts[10]
    both = np.hypot(parts.noise_W, parts.systematic_W)
    assert both == pytest.approx(1.96 * electrical.standard_error_W[10], rel=1e-3)
    polar = results.drag_polar
    assert polar is not None
    CL = np.array([0.3, 0.8])
    quadratic = polar.CD0 + polar.K * (CL - polar.CL_minD) ** 2
    assert polar.A0 + polar.A1 * CL + polar.A2 * CL**2 == pytest.approx(quadratic)
    assert polar.oswald_efficiency == pytest.approx(AREA_M2 / (np.pi * polar.K * SPAN_M**2))


@pytest.mark.parametrize("scale", [0.25, 0.5, 1.0, 2.0, 4.4])
def test_efficiency_from_battery_to_thrust_is_as_wrong_as_the_current(
    truth: Truth, table: FlightTable, electrical: ElectricalEstimate, scale: float
) -> None:
    """Only a sound current is trusted; one that reads a quarter or half makes an efficiency that nothing has."""
    if scale != 1.0:
        right = flown(truth)
        t_s, current_A = right.channels[recording.CURRENT]
        wrong = replace(right, channels={**right.channels, recording.CURRENT: Channel(t_s, scale * current_A)})
        table = flight_table(wrong, MASS_KG * g, AREA_M2)
        electrical = estimate(table, MASS_KG * g, AREA_M2, SPAN_M, most_windows=100)
    aircraft = FlownAircraft("test", MASS_KG * g, AREA_M2, SPAN_M)
    findings = EnergyBalanceFindings(table, electrical)
    results = assemble_energy_balance(Path("log"), aircraft, findings, cast(Provenance, None))
    V, rho = electrical.V_mps, np.full(len(electrical.V_mps), electrical.conditions.rho)
    required_W = drag_W(V, 1.0, rho)
    true = required_W / (electrical_W(required_W / V, V, rho)[0] - IDLE_W)
    thrust_efficiency = results.balance.thrust_efficiency if results.balance else None
    assert thrust_efficiency is not None
    assert thrust_efficiency.lo < np.max(true) / scale and thrust_efficiency.hi > np.min(true) / scale
    assert thrust_efficiency.value == pytest.approx(np.mean(true) / scale, rel=0.05)
    N, D, T = Trust.NOT_TO_BE_TRUSTED, Trust.DOUBTFUL, Trust.TRUSTED
    assert results.trust is {0.25: N, 0.5: N, 1.0: T, 2.0: D, 4.4: N}[scale]
    assert [evidence.kind for evidence in results.evidence] == [EvidenceKind.THRUST_EFFICIENCY] * (scale != 1.0)


def test_an_autopilot_is_reported_equivalent_airspeeds_and_the_sink_of_gliding(
    drag: tuple[DragEstimate, bool], electrical: ElectricalEstimate
) -> None:
    result, _ = drag
    V, rho = electrical.V_mps, electrical.conditions.rho
    best = SpeedInterval(speed_mps=16.0, lo_mps=15.0, hi_mps=17.0, inside_flown_range=True)
    values = flight_values(electrical, best, {}, result)
    to_equivalent = np.sqrt(rho / 1.225)
    assert values.cruise.value == pytest.approx(16.0 * to_equivalent, rel=1e-4)
    assert (values.slowest.value, values.fastest.value) == pytest.approx((V[0] * to_equivalent, V[-1] * to_equivalent))
    # GPS shows true airspeed; equivalent airspeed also has half the error of density.
    sigma = np.hypot(np.sqrt(electrical.airspeed.covariance[0, 0]), electrical.rho_sigma / 2)
    assert values.slowest.hi / values.slowest.value - 1 == pytest.approx(1.96 * sigma, rel=0.5)
    assert values.cruise_power is not None and values.sink is not None and values.airspeed_factor is not None
    assert values.cruise_power.value == pytest.approx(np.interp(16.0, V, electrical.power_W))
    weight_N = MASS_KG * g
    assert values.sink.value == pytest.approx(np.interp(16.0, result.V_mps, result.power_W) / weight_N, rel=1e-3)
    assert values.airspeed_factor.value == pytest.approx(1 / 1.02, rel=2e-3)
    assert values.wing_loading.value == pytest.approx(2 * weight_N / (1.225 * AREA_M2), rel=1e-3)
    assert values.CD0 is not None and values.B is not None
    CL = 2 * weight_N / (rho * V**2 * AREA_M2)
    CD = 2 * result.power_W / (rho * V**3 * AREA_M2)
    assert values.CD0.value + values.B.value * CL**2 == pytest.approx(CD, rel=0.05)


def test_an_airspeed_by_gps_less_wind_is_as_uncertain_as_the_wind_and_half_the_density(
    electrical: ElectricalEstimate,
) -> None:
    """Variances of 0.36 and 0.64 m^2/s^2 north and east are 0.5 along a path of any direction."""
    airspeed = by_wind(np.array([3.0, -4.0, 0.0, 0.0]), np.diag([0.36, 0.64, 0.0, 0.0]))
    best = SpeedInterval(speed_mps=16.0, lo_mps=15.0, hi_mps=17.0, inside_flown_range=True)
    values = flight_values(replace(electrical, airspeed=airspeed), best, {})
    to_equivalent = np.sqrt(electrical.conditions.rho / 1.225)
    for result, V in ((values.slowest, electrical.V_mps[0]), (values.fastest, electrical.V_mps[-1])):
        half = 1.96 * np.sqrt(0.5 + (V * electrical.rho_sigma / 2) ** 2) * to_equivalent
        assert result.hi - result.value == pytest.approx(half, rel=1e-3)


def test_what_a_reader_must_know_is_reported(electrical: ElectricalEstimate) -> None:
    def text_of(**change: object) -> str:
        return " ".join(_warnings(dataclasses.replace(electrical, **change)))

    assert text_of() == ""
    assert "GPS" in text_of(airspeed=electrical.airspeed._replace(wind_mps=None))
    assert "5 % too low by GPS" in text_of(airspeed=electrical.airspeed._replace(scale=-0.05))
    assert "2 % too high" not in text_of(airspeed=electrical.airspeed._replace(scale=0.02))
    unsure = Uncertain(electrical.power_W, np.diag((0.2 * electrical.power_W) ** 2), electrical.curve.power_W.shared)
    assert "wider than ±25 % at 100 %" in text_of(curve=dataclasses.replace(electrical.curve, power_W=unsure))


def test_a_stretch_that_the_user_leaves_out_does_not_count(truth: Truth, electrical: ElectricalEstimate) -> None:
    """The meter reads 30 % too much from 200 to 260 s: with these the curve is higher, without them as it was."""
    wrong = flown(truth)
    current = wrong.channels[recording.CURRENT]
    bad = (current.t_s > 200) & (current.t_s < 260)
    channels = {**wrong.channels, recording.CURRENT: Channel(current.t_s, current.value * np.where(bad, 1.3, 1.0))}
    wrong = replace(wrong, channels=channels)

    def power_at_15(left_out_s: list[tuple[float, float]]) -> float:
        table = flight_table(wrong, MASS_KG * g, AREA_M2, left_out_s)
        electrical = estimate(table, MASS_KG * g, AREA_M2, SPAN_M)
        return float(np.interp(15.0, electrical.V_mps, electrical.power_W))

    true = float(np.interp(15.0, electrical.V_mps, electrical.power_W))
    assert power_at_15([]) > 1.03 * true
    assert power_at_15([(195.0, 265.0)]) == pytest.approx(true, rel=0.01)


def test_left_out_stretches_cut_the_airborne_ones_and_are_reported(table: FlightTable, truth: Truth) -> None:
    left_out = [(0.0, 100.0), (200.0, 260.0)]
    cut = flight_table(flown(truth), MASS_KG * g, AREA_M2, left_out)
    seconds = cut.table.index.to_numpy()
    flown_s = seconds[cut.flown]
    assert len(cut.airborne) == 2 and cut.start_s == 0.0
    assert not any(((flown_s >= start) & (flown_s <= end)).any() for start, end in left_out)
    expected = table.flown & ~((seconds <= 100) | ((seconds >= 200) & (seconds <= 260)))
    assert np.array_equal(cut.flown, expected), "nothing else is trimmed"
    assert cut.notes[-1] == table.notes[-1] and "Left out by hand: 0.0 to 100.0 s, 200.0 to 260.0 s." in cut.notes
    with pytest.raises(InputError, match="left out by hand"):
        flight_table(flown(truth), MASS_KG * g, AREA_M2, [(0.0, 500.0)])
