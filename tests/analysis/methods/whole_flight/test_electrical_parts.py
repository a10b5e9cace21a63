"""Parts of the estimate from an ordinary flight, each checked against physics."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.methods.whole_flight import airspeed_gps, energy_balance
from flightpower.analysis.methods.whole_flight.airspeed_gps import AirspeedErrors, airspeed_errors
from flightpower.analysis.methods.whole_flight.curve import drag_prior, lift_prior
from flightpower.analysis.methods.whole_flight.energy_balance import (
    EnergyBalance,
    FlightConditions,
    by_air,
    by_angle,
    by_efficiency,
    level_power,
    of_both,
    uncorrelated,
)
from flightpower.analysis.methods.whole_flight.fit import Fit, _size_and_time, estimate_of, samples_of
from flightpower.analysis.methods.whole_flight.flight_table import (
    _air_temperature_K,
    _airborne,
    _idle_power_W,
    _standing_and_moving,
    _touches_ground,
    _zero,
)
from flightpower.analysis.methods.whole_flight.parameters import (
    DRAG,
    LIFT,
    OF_AIRCRAFT,
    OF_AIRSPEED,
    PROPELLER,
    Source,
    unpack,
)
from flightpower.analysis.methods.whole_flight.settings import GPS, WINDOWS
from flightpower.analysis.methods.whole_flight.thrust_balance import MotorConstants, ThrustBalance
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.grid import resampled
from flightpower.analysis.sources.recording import Channel, FlightRecording
from flightpower.flight.atmosphere import pressure_at, temperature_at
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.units import GRAVITY_MPS2 as g

V_MPS, CLIMB_MPS, MOTOR_W, IDLE_W, RHO = 15.0, 1.0, 100.0, 4.0, 1.2
CONDITIONS = FlightConditions(mass_kg=3.0, wing_area_m2=0.5, rho=RHO, idle_power_W=IDLE_W)
# No induced drag; the motor at its greatest efficiency, where small changes of power or airspeed leave it as it is.
CD0, EFFICIENCY = 0.04, 0.6
PARAMETERS = np.array([np.log(CD0), -50.0, 0.2, 0.0, np.log(EFFICIENCY / (1 - EFFICIENCY)),
                       np.log(V_MPS * np.cbrt(RHO / MOTOR_W)), np.log(0.7), 0.0,
                       0.0, 0.0, 0.0, 0.0])  # fmt: skip
DRAG_W = RHO / 2 * V_MPS**3 * 0.5 * CD0


def climbing(seconds: float = 90.0, scale: float = 0.0, zero_Pa: float = 0.0) -> SimpleNamespace:
    """A steady climb, as `flight_table` gives it, measured with these errors of the pitot."""
    t = np.arange(0, seconds, 0.2)
    table = pd.DataFrame(
        {
            "pressure_Pa": RHO / 2 * (V_MPS * (1 + scale)) ** 2 + zero_Pa, "rho": RHO, "load_factor": 1.0,
            "load_variance": 0.0, "side_variance": 0.0,
            "height_m": CLIMB_MPS * t, "power_W": MOTOR_W + IDLE_W, recording.MOTOR: np.nan, "force_x_mps2": np.nan,
        },
        index=t,
    )  # fmt: skip
    flown = np.ones(len(t), dtype=bool)
    return SimpleNamespace(table=table, airborne=[slice(0, len(t))], flown=flown, rho_sigma=0.01)


def test_each_error_that_a_flight_shares_changes_the_balance_by_its_power() -> None:
    """gain 1: the residual's change itself. Useful power less drag less that of climbing, of a standard deviation."""
    flight = climbing(scale=0.02, zero_Pa=3.0)
    balance = EnergyBalance(samples_of(flight, 0.02, 3.0), CONDITIONS)  # type: ignore[arg-type]
    nominal, n = balance.residual(PARAMETERS), len(balance.V_mps)
    assert nominal == pytest.approx(EFFICIENCY * MOTOR_W - DRAG_W - 3.0 * g * CLIMB_MPS, rel=1e-3)
    fit = Fit(PARAMETERS, np.eye(12), np.eye(n), nominal, gust_mps=0.5, gust_s=3.0, minus_2_log_evidence=0.0)
    airspeed = AirspeedErrors(0.02, 3.0, np.diag([0.01**2, 2.0**2]), None, None, prior_sigma=0.01)
    shared = estimate_of(flight, balance, fit, airspeed).shared  # type: ignore[arg-type]
    watts = {source: float(np.mean(error.change)) for source, error in shared.items()}
    by_scale, by_zero, by_density, by_mass, by_meter, by_idle, by_gusts, by_updraft = (
        watts.pop(source) for source in (*OF_AIRSPEED, *OF_AIRCRAFT, Source.UPDRAFT)
    )
    assert not watts
    # Airspeed lower by nearly 1 %: the drag's power is less by three times that.
    assert by_scale == pytest.approx((1 - (1.02 / 1.03) ** 3) * DRAG_W, rel=0.01)
    pressure_Pa = RHO / 2 * (V_MPS * 1.02) ** 2
    assert by_zero == pytest.approx(1.5 * 2.0 / pressure_Pa * DRAG_W, rel=0.03)
    # Air thinner by 1 %: the pressure stays, airspeed is higher by 0.5 %, and so is the power of the same drag.
    assert by_density == pytest.approx(-0.005 * DRAG_W, rel=0.03)
    thinner = shared[Source.DENSITY].conditions
    assert thinner.rho == pytest.approx(0.99 * RHO)
    mass = shared[Source.MASS].conditions.mass_kg
    assert by_mass == pytest.approx(-(mass - 3.0) * g * CLIMB_MPS, rel=1e-6) and 1 < mass / 3.0 < 1.01
    # Evenly distributed within 2 %.
    assert shared[Source.CURRENT].conditions.power_scale - 1 == pytest.approx(0.02 / np.sqrt(3), rel=0.01)
    assert by_meter == pytest.approx(0.02 / np.sqrt(3) * (MOTOR_W + IDLE_W) * EFFICIENCY, rel=0.02)
    more = shared[Source.IDLE_POWER].conditions.idle_power_W - IDLE_W
    assert more > 0 and by_idle == pytest.approx(-more * EFFICIENCY, rel=0.02)
    # Rising air of 8 % of the gusts, and 1 cm/s at least.
    assert by_updraft == pytest.approx(3.0 * g * np.hypot(0.01, 0.08 * 0.5), rel=1e-6)
    # Without variance of the load gusts do no work; with it 30 % of V (m g)^2 / (q S) times its variance, at 1 rad/C_L.
    assert by_gusts == 0.0
    rough = EnergyBalance(balance.samples._replace(load_variance=0.04), CONDITIONS)
    by_gusts = float(np.mean(estimate_of(flight, rough, fit, airspeed).shared[Source.GUSTS].change))  # type: ignore[arg-type]
    qS = RHO / 2 * V_MPS**2 * 0.5
    assert by_gusts == pytest.approx(0.3 * V_MPS * (3.0 * g) ** 2 / qS * 0.04, rel=1e-3)


def test_where_gps_determines_the_scale_an_error_of_density_moves_no_airspeed() -> None:
    balance = EnergyBalance(samples_of(climbing(), 0.0, 0.0), CONDITIONS)  # type: ignore[arg-type]
    nominal, n = balance.residual(PARAMETERS), len(balance.V_mps)
    fit = Fit(PARAMETERS, np.eye(12), np.eye(n), nominal, gust_mps=0.5, gust_s=3.0, minus_2_log_evidence=0.0)
    exact = AirspeedErrors(0.0, 0.0, np.diag([1e-12, 1e-12]), 0.0, 0.0)
    shared = estimate_of(climbing(), balance, fit, exact).shared  # type: ignore[arg-type]
    by_density, conditions = shared[Source.DENSITY]
    assert conditions.rho == pytest.approx(0.99 * RHO)
    # Drag falls with density; the efficiency at its maximum does not change with its argument.
    assert by_density == pytest.approx(0.01 * DRAG_W, rel=0.02)


def test_windows_are_as_far_apart_as_a_long_flight_needs_and_end_with_it() -> None:
    balance = EnergyBalance(samples_of(climbing(90.0), 0.0, 0.0), CONDITIONS, most_windows=15)  # type: ignore[arg-type]
    centers, offsets = balance.windows.centers_s, balance.windows.offsets_s
    assert np.diff(centers) == pytest.approx(6.0) and np.ptp(offsets) == pytest.approx(12.0)
    assert (centers + offsets[0]).min() == pytest.approx(0.0) and (centers + offsets[-1]).max() == pytest.approx(84.0)
    short = EnergyBalance(samples_of(climbing(30.0), 0.0, 0.0), CONDITIONS)  # type: ignore[arg-type]
    assert np.diff(short.windows.centers_s) == pytest.approx(2.0)
    exact = climbing(8.2)  # 41 samples: one window
    assert len(EnergyBalance(samples_of(exact, 0.0, 0.0), CONDITIONS).windows.centers_s) == 1  # type: ignore[arg-type]


def test_the_efficiency_s_argument_is_that_of_flight_under_power() -> None:
    samples = samples_of(climbing(), 0.0, 0.0)  # type: ignore[arg-type]
    power = np.where(np.arange(len(samples.t_s)) % 3, IDLE_W + 10.0, IDLE_W + MOTOR_W)  # most of the flight idling
    balance = EnergyBalance(samples._replace(power_W=power), CONDITIONS)
    assert balance.median_advance_with_power() == pytest.approx(V_MPS * np.cbrt(RHO / MOTOR_W))


def test_level_power_is_not_known_beyond_what_a_motor_gives() -> None:
    """At 200 m/s drag needs 96 kW; a motor of 100 kW delivers 60."""
    with np.errstate(divide="ignore"):
        power = level_power(np.array([V_MPS, 200.0]), unpack((*DRAG, *PROPELLER, *LIFT), PARAMETERS), CONDITIONS)
    assert EFFICIENCY * (power[0] - IDLE_W) >= DRAG_W * 0.999 and np.isnan(power[1])
    u = np.array([0.0, 0.5, 1.0, 1.5, 1 + 1 / np.sqrt(0.7), 4.0])
    falling = energy_balance.efficiency(u, 0.6, 1.0, 0.7)
    assert falling == pytest.approx([0.0, 0.6 * (1 - 0.5**2.3), 0.6, 0.6 * (1 - 0.7 * 0.25), 0.0, 0.0], abs=1e-9)
    zero_thrust = 1 + 1 / np.sqrt(0.7)
    idling = energy_balance.idling(np.array([1.0, zero_thrust, 1.5 * zero_thrust, 9.0]), 1.0, 0.7)
    assert idling == pytest.approx([0.0, 0.0, 0.5, 1.0], abs=1e-9), "idles only where it no longer pulls"


def test_errors_of_efficiency_and_angle_go_with_power() -> None:
    windows = EnergyBalance(samples_of(climbing(), 0.0, 0.0), CONDITIONS).windows  # type: ignore[arg-type]
    n = len(windows.centers_s)
    useful = np.linspace(50.0, 100.0, n)
    result = by_efficiency(windows, useful, 0.05)
    assert np.sqrt(np.diag(result)) == pytest.approx(0.05 * useful)
    apart = windows.centers_s[5] - windows.centers_s[0]
    assert result[0, 5] == pytest.approx(0.05**2 * useful[0] * useful[5] * np.exp(-apart / 10.0))
    # An angle's error turns the lift m g: at 15 m/s it acts like air that rises at 15 m/s times the angle.
    turned = by_angle(windows, 3.0, np.full(n, 15.0), 0.01, 4.0)
    assert turned == pytest.approx(by_air(windows, 3.0, 0.0, 0.15, 4.0), rel=1e-9)
    assert uncorrelated(windows) == pytest.approx(np.eye(n))
    both = of_both(np.full((1, 1), 2.0), np.full((1, 1), 3.0), np.full((1, 1), 5.0))
    assert both.tolist() == [[5.0, -2.0], [-2.0, 7.0]]


def test_a_gust_along_the_path_changes_kinetic_energy() -> None:
    """Random first-order gusts u, put through the window's derivative: m V du/dt."""
    windows = EnergyBalance(samples_of(climbing(30.0), 0.0, 0.0), CONDITIONS).windows  # type: ignore[arg-type]
    time_s, sigma, count = 2.0, 0.5, len(windows.offsets_s)
    decay = np.exp(-0.2 / time_s)
    rng = np.random.default_rng(1)
    u = np.zeros((20000, count))
    u[:, 0] = rng.normal(size=20000)
    for i in range(1, count):
        u[:, i] = decay * u[:, i - 1] + np.sqrt(1 - decay**2) * rng.normal(size=20000)
    variance = np.var(3.0 * V_MPS * sigma * u @ windows.slope)
    along = by_air(windows, 3.0, V_MPS, sigma, time_s) - by_air(windows, 3.0, 0.0, sigma, time_s)
    assert along[0, 0] == pytest.approx(variance, rel=0.05)


@pytest.mark.parametrize("time_s", [1.0, 16.0])
def test_the_covariance_of_the_air_is_that_of_a_process(time_s: float) -> None:
    """No combination of windows has a variance below zero: not even of a long flight in slow gusts."""
    windows = EnergyBalance(samples_of(climbing(400.0), 0.0, 0.0), CONDITIONS).windows  # type: ignore[arg-type]
    V = np.full(len(windows.centers_s), V_MPS)
    for result in (by_air(windows, 3.0, V_MPS, 1.0, time_s), by_angle(windows, 3.0, V, 1.0, time_s)):
        assert np.linalg.eigvalsh(result)[0] > -1e-12 * result.max()
        # Windows that do not overlap: exp(-lag / T), over as much more as both means have it.
        assert result[0, 150] / result[0, 100] == pytest.approx(np.exp(-100.0 / time_s), rel=1e-9)


def test_the_size_of_an_error_is_that_which_its_residuals_have() -> None:
    """Compares with the full likelihood over sizes and times, near the truth of the residuals drawn."""
    windows = EnergyBalance(samples_of(climbing(400.0), 0.0, 0.0), CONDITIONS).windows  # type: ignore[arg-type]
    white, sizes = 30.0 * uncorrelated(windows), (0.1, 0.2, 0.3, 0.5, 1.0)
    gusts = [by_air(windows, 3.0, V_MPS, 1.0, time_s) for time_s in WINDOWS.times_s]
    residuals = np.random.default_rng(2).multivariate_normal(np.zeros(len(white)), white + 0.3**2 * gusts[2])
    unlikely = [0.0, 1.0, 2.0, 3.0, 4.0]
    size, time_s = _size_and_time(residuals, white, gusts, sizes, unlikely)
    costs = np.array(
        [
            [
                residuals @ np.linalg.solve(white + s**2 * gust, residuals)
                + np.linalg.slogdet(white + s**2 * gust)[1]
                + cost
                for s in sizes
            ]
            for gust, cost in zip(gusts, unlikely, strict=True)
        ]
    )
    weight = np.exp((costs.min() - costs) / 2)
    weight /= weight.sum()
    assert size == pytest.approx(np.sqrt(weight.sum(axis=0) @ np.square(sizes)), rel=1e-9)
    assert time_s == pytest.approx(np.exp(weight.sum(axis=1) @ np.log(WINDOWS.times_s)), rel=1e-9)
    assert size == pytest.approx(0.3, rel=0.2)


def test_priors_are_those_of_wing_theory() -> None:
    """Induced drag by an Oswald factor of 0.75; lift slope by Helmbold's formula: 2 pi for an infinite wing."""
    ln_K, _ = drag_prior(span_m=2.0, wing_area_m2=0.5)["ln_K"]
    assert np.exp(ln_K) == pytest.approx(1 / (np.pi * 0.75 * 8.0))
    ln_alpha_per_CL, _ = lift_prior(2.0, 0.5)["ln_alpha_per_CL"]
    assert np.exp(-ln_alpha_per_CL) == pytest.approx(2 * np.pi * 8.0 / (2 + np.sqrt(4 + 64.0)))
    infinite, _ = lift_prior(1e6, 0.5)["ln_alpha_per_CL"]
    assert np.exp(-infinite) == pytest.approx(2 * np.pi, rel=1e-6)


def test_gps_is_compared_once_a_second_and_at_as_many_points_as_asked(monkeypatch: pytest.MonkeyPatch) -> None:
    t = np.arange(0, 300, 0.2)
    heading = 0.1 * t
    gps = dict(zip(recording.GPS, (V_MPS * np.cos(heading), V_MPS * np.sin(heading), 0 * t), strict=True))
    table = pd.DataFrame({"pressure_Pa": RHO / 2 * V_MPS**2 + 0 * t, "rho": RHO, **gps}, index=t)
    flight = SimpleNamespace(
        table=table, flown=np.ones(len(t), dtype=bool), zero_sigma_Pa=0.7, airspeed_scale_sigma=GPS.scale_sigma
    )
    apart: list[float] = []
    original = airspeed_gps.correlation

    def watched(apart_s: np.ndarray, time_s: float) -> np.ndarray:
        apart.append(float(apart_s[0, 1]))
        return original(apart_s, time_s)

    monkeypatch.setattr(airspeed_gps, "correlation", watched)
    airspeed_errors(flight)  # type: ignore[arg-type]
    assert apart[0] == pytest.approx(1.0)
    apart.clear()
    airspeed_errors(flight, most_points=60)  # type: ignore[arg-type]
    assert apart[0] == pytest.approx(5.0)
    few = SimpleNamespace(table=table, flown=t < 10.0, zero_sigma_Pa=0.7, airspeed_scale_sigma=GPS.scale_sigma)
    assert airspeed_errors(few).wind_mps is None, "ten points determine no wind"  # type: ignore[arg-type]


def test_the_coolest_believable_thermometer_in_flight_is_the_air_s() -> None:
    t = np.arange(0, 100, 0.2)
    moving = (t > 20) & (t < 80)
    shown = {
        "air": Channel(t, np.where(moving, 280.0, 310.0)), "broken": Channel(t, np.full(len(t), 0.0)),
        "oven": Channel(t, np.full(len(t), 400.0)), "near": Channel(t, np.full(len(t), 284.0)),
    }  # fmt: skip
    result, sigma, note = _air_temperature_K(_of_day(shown), moving, t)
    assert (result, sigma) == (280.0, 3.0)
    assert "7 °C" in note and "near shows" not in note, "a few kelvins more are not worth a word"
    del shown["air"], shown["near"]
    standard = temperature_at(500.0)
    assert _air_temperature_K(_of_day(shown), moving, t)[:2] == pytest.approx((standard, 8.0))
    warm = replace(_of_day({"BARO 0": Channel(t, np.full(len(t), 306.0))}), inside=frozenset({"BARO 0"}))
    assert _air_temperature_K(warm, moving, t)[:2] == pytest.approx((standard, 8.0)), "warmed by the electronics"
    cool = replace(_of_day({"BARO 0": Channel(t, np.full(len(t), 300.0))}), inside=frozenset({"BARO 0"}))
    assert _air_temperature_K(cool, moving, t)[:2] == (300.0, 8.0)
    assert _air_temperature_K(replace(cool, air_temperature_K=281.0), moving, t)[:2] == (281.0, 2.0)


def _of_day(thermometers: dict[str, Channel]) -> FlightRecording:
    """Flown 500 m high in the standard atmosphere."""
    static = Channel(np.arange(0, 100, 0.2), np.full(500, float(pressure_at(500.0))))
    return FlightRecording(Path("log"), {recording.STATIC: static}, thermometers)


def test_the_zero_is_that_of_the_ground_near_the_flight() -> None:
    """Five minutes before the flight and after it; a zero that drifts is as uncertain as its scatter."""
    t = np.arange(0, 900, 0.2)
    standing, moving = (t < 590) | (t > 750), (t > 600) & (t < 740)
    pressure = np.where(t < 250, 50.0, np.where(t < 590, 2.0, np.where(t > 750, 6.0, 130.0)))
    flight = SimpleNamespace(path="log", zeroed=False)
    zero, sigma, notes = _zero(flight, pressure, standing, moving)  # type: ignore[arg-type]
    assert 2.0 <= zero <= 6.0 and notes == []
    near = np.r_[np.full(29, 2.0), np.full(15, 6.0)]
    assert sigma == pytest.approx(np.hypot(0.7, np.std(near)), rel=0.03)
    airborne = SimpleNamespace(path="log", zeroed=True)
    zero, sigma, (note,) = _zero(airborne, pressure, 0 * standing > 1, moving)  # type: ignore[arg-type]
    assert (zero, sigma) == (0.0, 3.0) and "good to 3 Pa" in note
    with pytest.raises(InputError, match="is raw"):
        _zero(flight, pressure, 0 * standing > 1, moving)  # type: ignore[arg-type]


def test_an_aircraft_that_rolls_or_is_carried_does_not_fly() -> None:
    """Below the ground speed of walking a wind of three times the least pressure is needed to call it flight."""
    n, least_Pa = 600, 40.0
    t = np.arange(n)
    pressure = np.where(t < 200, 0.0, np.where(t < 400, 80.0, 150.0))

    def moving_at(ground_mps: float) -> np.ndarray:
        columns = {"pressure_Pa": pressure, recording.GPS[0]: np.where(t < 200, 0.0, ground_mps)}
        return _standing_and_moving(columns | {recording.GPS[1]: np.zeros(n)}, least_Pa, zeroed=False)[1]

    assert not moving_at(1.5)[220:380].any() and moving_at(1.5)[420:].all()
    assert moving_at(2.5)[220:].all()
    columns = {"pressure_Pa": pressure, recording.GPS[0]: np.full(n, np.nan), recording.GPS[1]: np.full(n, np.nan)}
    standing, moving = _standing_and_moving(columns, least_Pa, zeroed=False)
    assert standing[:180].all() and not standing[220:].any() and moving[220:].all() and not moving[:180].any()


def test_the_ground_is_looked_for_on_the_side_asked() -> None:
    moving = np.array([False] * 10 + [True] * 400)
    assert _touches_ground(moving, 20, -1) and not _touches_ground(moving, 20, 1)
    assert not _touches_ground(moving, 300, -1) and not _touches_ground(moving, 100, -1)
    assert _touches_ground(moving[::-1], 389, 1)


def test_the_idle_power_is_that_with_the_throttle_closed_or_the_least_seen() -> None:
    power = np.r_[np.full(100, 6.0), np.full(200, 80.0)]
    standing, flown, never = np.arange(300) < 100, np.arange(300) >= 100, np.zeros(300, dtype=bool)
    assert _idle_power_W(power, standing, flown, never) == (6.0, 1.0)
    idle_W, sigma_W = _idle_power_W(power, standing & False, flown, never)
    assert idle_W < 10 and sigma_W == idle_W  # not the lowest reading of a motor that was never stopped
    power[150:200] = 3.0
    assert _idle_power_W(power, standing, flown, never) == (3.0, 1.0)
    assert _idle_power_W(power, standing & False, flown, never) == (3.0, 3.0)
    closed = (np.arange(300) >= 200) & (np.arange(300) < 250)
    power[200:250] = np.tile([2.0, 5.0], 25) + 1.0  # noise of the meter
    assert _idle_power_W(power, standing, flown, closed) == pytest.approx((4.5, 1.0))


def test_gaps_are_bridged_up_to_their_length_or_four_intervals() -> None:
    t_s = np.array([0.0, 1.0, 3.0, 6.0, 9.0, 11.0])
    channel = Channel(t_s, 2 * t_s)
    result = resampled(channel, np.array([-1.0, 0.5, 2.0, 5.0, 7.5, 10.0, 12.0]), 0.0, 2.5)
    assert result == pytest.approx([np.nan, 1.0, 4.0, 10.0, 15.0, 20.0, np.nan], nan_ok=True)
    dense = Channel(np.r_[np.arange(0, 5, 0.1), 8.0], np.zeros(51))
    assert np.isnan(resampled(dense, np.array([6.0]), 0.0, 2.5)[0])
    assert resampled(dense, np.array([6.0]), 0.0, 3.2)[0] == 0.0


def test_the_motor_s_speed_follows_from_its_power() -> None:
    """Between the speeds of the table, and less where more is drawn by the rest of the aircraft."""
    motor, propeller = MotorConstants(0.015, 0.05, 1.0), load_propeller("apc-12x8e")
    flight = climbing(30.0)
    V = np.linspace(10.0, 20.0, len(flight.table))
    n = np.linspace(90.0, 130.0, len(V))
    shaft_W = propeller.thrust_and_power(V, n, RHO)[1]
    samples = samples_of(flight, 0.0, 0.0)._replace(V_mps=V, power_W=motor.electrical_W(shaft_W, n) + IDLE_W)  # type: ignore[arg-type]
    balance = ThrustBalance(samples, CONDITIONS, propeller, motor)
    assert balance._revps(samples, CONDITIONS) == pytest.approx(n, rel=0.01)
    assert balance.shaft_W() == pytest.approx(balance._mean(shaft_W), rel=0.02)
    assert balance.motor_W() == pytest.approx(balance._mean(motor.electrical_W(shaft_W, n)), rel=1e-9)
    gliding = samples._replace(power_W=np.where(np.arange(len(V)) < 60, samples.power_W, IDLE_W + 1.0))
    (rows,) = ThrustBalance(gliding, CONDITIONS, propeller, motor).samples.stretches
    assert (rows.start, rows.stop) == (0, 60)
    hungry = CONDITIONS._replace(idle_power_W=100.0)  # of which the motor has no part
    gliding = gliding._replace(power_W=gliding.power_W + 100.0 - IDLE_W)
    (rows,) = ThrustBalance(gliding, hungry, propeller, motor).samples.stretches
    assert (rows.start, rows.stop) == (0, 60)


def test_without_power_the_air_turns_the_propeller_as_fast_as_it_needs_none() -> None:
    """To a step of the speeds that are tried, 4 %."""
    motor, propeller = MotorConstants(0.015, 0.05, 1.0), load_propeller("apc-12x8e")
    flight = climbing(30.0)
    V = np.full(len(flight.table), 18.0)
    samples = samples_of(flight, 0.0, 0.0)._replace(V_mps=V, power_W=np.full(len(V), IDLE_W))  # type: ignore[arg-type]
    result = ThrustBalance(samples, CONDITIONS, propeller, motor)._revps(samples, CONDITIONS)[0]
    n = np.linspace(20.0, 120.0, 20_001)
    taken_W = motor.electrical_W(propeller.thrust_and_power(np.full_like(n, 18.0), n, RHO)[1], n)
    turned_by_air = n[np.argmax(taken_W > 0)]
    assert turned_by_air / 1.045 < result < 1.001 * turned_by_air


def test_stretches_of_twenty_seconds_clear_of_the_ground_count() -> None:
    n = 700
    columns = {"pressure_Pa": np.full(n, 130.0), "height_m": np.full(n, 50.0), "power_W": np.full(n, 80.0)}
    columns["power_W"][[101, 180]] = np.nan  # after 20.2 s, and 15.6 s later
    moving, nowhere = np.full(n, True), np.full(n, False)
    assert _airborne(columns, nowhere, moving, 40.0) == [slice(0, 101), slice(181, n)]
    standing = np.arange(n) < 20
    columns["height_m"] = np.where(standing, 10.0, 50.0)
    columns["height_m"][181:] = 12.9  # less than three meters above the ground
    assert _airborne(columns, standing, moving, 40.0) == []
    columns["height_m"][181:] = 13.1
    (rows,) = _airborne(columns, standing, moving, 40.0)
    assert (rows.start, rows.stop) == (181, n)


def test_a_log_that_begins_in_flight_has_the_autopilot_s_zero() -> None:
    """The lowest pressure occurred in flight. On the ground the lowest is the zero, whoever has corrected it before."""
    n, least_Pa = 600, 40.0
    silent = {name: np.full(n, np.nan) for name in recording.GPS}
    flown = np.full(n, 130.0)
    standing, moving = _standing_and_moving({"pressure_Pa": flown, **silent}, least_Pa, zeroed=True)
    assert moving.all() and not standing.any()
    _, moving = _standing_and_moving({"pressure_Pa": flown, **silent}, least_Pa, zeroed=False)
    assert not moving.any(), "a constant pressure may be the raw zero"
    drifted = np.where(np.arange(n) < 300, 30.0, 160.0)
    standing, moving = _standing_and_moving({"pressure_Pa": drifted, **silent}, least_Pa, zeroed=True)
    assert standing[:280].all() and moving[320:].all() and not moving[:280].any()
