"""The energy balance of constructed flights, and its parts against what is known of them."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.estimation.model import NamedValues
from flightpower.analysis.methods.whole_flight import energy_balance
from flightpower.analysis.methods.whole_flight.airspeed_gps import correlation, most_likely_noise
from flightpower.analysis.methods.whole_flight.energy_balance import (
    EnergyBalance,
    FlightConditions,
    QuarticPolar,
    Samples,
    by_air,
    drag_power,
    level_power,
)
from flightpower.analysis.methods.whole_flight.parameters import DRAG, LIFT, PROPELLER, pack, unpack
from flightpower.analysis.methods.whole_flight.settings import WINDOWS
from flightpower.analysis.sources.grid import smoothed
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.units import GRAVITY_MPS2 as g

PARAMETERS = np.array([np.log(0.04), np.log(0.06), 0.2, 0.01, 0.4, np.log(1.3), np.log(0.7), 0.1, 0.0, 0.0, 0.0, 0.0])
P = unpack((*DRAG, *PROPELLER, *LIFT), PARAMETERS)
POLAR = QuarticPolar.of(P, P.idle_drag)
GREATEST, X, FALL = 1 / (1 + np.exp(-0.4)), 1.3, 0.7  # of the efficiency
CONDITIONS = FlightConditions(mass_kg=3.0, wing_area_m2=0.5, rho=1.2, idle_power_W=4.0)


def named(p: NamedValues) -> dict[str, float]:
    return {name: p[name] for name in (*DRAG, *PROPELLER, *LIFT)}


def motor_power(thrust_power_W: np.ndarray, V: np.ndarray) -> np.ndarray:
    """The motor's power that gives a useful power."""
    grid = np.geomspace(5.0, 3000.0, 4000)
    gives = [
        grid * energy_balance.efficiency(energy_balance.advance(v, grid, CONDITIONS.rho), GREATEST, X, FALL) for v in V
    ]
    return np.array([np.interp(useful, row, grid) for useful, row in zip(thrust_power_W, gives, strict=True)])


@pytest.fixture(scope="module")
def samples() -> Samples:
    """Climbs, descents, changes of speed and turns at once; the balance holds at every instant."""
    t = np.arange(0, 90, 0.2)
    V, Vdot = 15 + np.sin(0.3 * t), 0.3 * np.cos(0.3 * t)
    h, hdot = 100 + 4 * np.sin(0.17 * t), 4 * 0.17 * np.cos(0.17 * t)
    load = 1.2 + 0.2 * np.sin(0.11 * t)
    qS = 1.2 * V**2 / 2 * 0.5
    CL = load * 3.0 * g / qS
    useful = qS * V * (0.04 + 0.06 * (CL - 0.2) ** 2 + 0.01 * (CL - 0.2) ** 4) + CONDITIONS.mass_kg * (
        V * Vdot + g * hdot
    )
    assert (useful > 5).all()
    return Samples(t, V, h, motor_power(useful, V) + CONDITIONS.idle_power_W, load, [slice(0, len(t))])


def test_the_balance_holds_in_climbs_accelerations_and_turns(samples: Samples) -> None:
    balance = EnergyBalance(samples, CONDITIONS)
    useful = balance.thrust_power_W(PARAMETERS)
    assert balance.residual(PARAMETERS) == pytest.approx(0.0, abs=0.01 * useful.mean())


def test_windows_are_as_long_as_they_say_and_have_a_middle(samples: Samples) -> None:
    offsets_s = EnergyBalance(samples, CONDITIONS).windows.offsets_s
    assert offsets_s[[0, -1]] == pytest.approx([-WINDOWS.length_s / 2, WINDOWS.length_s / 2])
    assert offsets_s[len(offsets_s) // 2] == 0.0 and len(offsets_s) % 2 == 1


def test_climbing_takes_weight_times_climb_unless_the_air_rises(samples: Samples) -> None:
    level = samples._replace(load_factor=np.ones(len(samples.t_s)), V_mps=np.full(len(samples.t_s), 15.0))
    climbing = level._replace(height_m=2.0 * level.t_s)
    balance, weight_N = EnergyBalance(level, CONDITIONS), CONDITIONS.mass_kg * g
    in_level_flight = balance.residual(PARAMETERS, level._replace(height_m=0 * level.t_s))
    change = balance.residual(PARAMETERS, climbing) - in_level_flight
    assert change == pytest.approx(-2.0 * weight_N, rel=1e-3)
    rising = balance.residual(PARAMETERS, climbing, CONDITIONS._replace(updraft_mps=2.0))
    assert rising == pytest.approx(in_level_flight, abs=1e-3 * weight_N)


def test_both_balances_show_the_same_rising_air(samples: Samples) -> None:
    alpha_0, per_CL, per_CT = -0.03, 0.2, -0.1
    angle = {"alpha_0": alpha_0, "ln_alpha_per_CL": np.log(per_CL), "alpha_per_CT": per_CT}
    parameters = pack((*DRAG, *PROPELLER, *LIFT), named(P) | angle)
    m, V, n = CONDITIONS.mass_kg, samples.V_mps, samples.load_factor
    motor, qS = samples.power_W - CONDITIONS.idle_power_W, CONDITIONS.rho * samples.V_mps**2 / 2 * 0.5
    x = energy_balance.advance(V, motor, CONDITIONS.rho)
    thrust_N = motor * energy_balance.efficiency(x, GREATEST, X, FALL) / V
    alpha = alpha_0 + per_CL * n * m * g / qS + per_CT * thrust_N / qS
    along_N = thrust_N - drag_power(V, n, energy_balance.idling(x, X, FALL), POLAR, CONDITIONS) / V
    force_x = (along_N / m + n * g * np.sin(alpha)) / np.cos(alpha)
    balance = EnergyBalance(samples._replace(force_x_mps2=force_x), CONDITIONS)
    of_drag, of_force = np.split(balance.residual(parameters), 2)
    assert of_force == pytest.approx(0.0, abs=0.01 * balance.thrust_power_W(parameters).mean())
    lifted = balance.samples._replace(height_m=samples.height_m + 0.5 * samples.t_s)
    for_drag, for_force = np.split(balance.residual(parameters, lifted), 2)
    assert for_drag - of_drag == pytest.approx(-0.5 * m * g)
    assert for_force - of_force == pytest.approx(0.5 * m * g)
    # The accelerometer also feels gusts, so only the balance by drag needs a term for them.
    in_gusts = balance.samples._replace(load_variance=0.05, side_variance=0.02)
    by_drag, by_force = np.split(balance.residual(parameters, in_gusts), 2)
    assert by_force == pytest.approx(of_force) and np.all(np.abs(by_drag - of_drag) > 0.1)


def test_gusts_give_power_in_proportion_to_the_variance_of_lift_and_side_force(samples: Samples) -> None:
    """Katzmayr: lift L0 + L' turned forward by alpha' = L'/(q S C_L_alpha) pulls with the mean of L' alpha'."""
    t, V, mg = np.arange(0, 200, 0.01), 15.0, CONDITIONS.mass_kg * g
    qS, slope, side_slope = 1.2 * V**2 / 2 * 0.5, 5.0, 0.6
    alpha, beta = 0.02 * np.sin(3 * np.pi * t), 0.04 * np.sin(2 * np.pi * t)
    lift_N, side_N = mg + qS * slope * alpha, qS * side_slope * beta
    pull_W = V * np.mean(lift_N * alpha + side_N * beta)
    this_samples = Samples(t, np.full_like(t, V), 0 * t, 0 * t, 1 + 0 * t, [], load_variance=np.var(lift_N / mg),
                  side_variance=np.var(side_N / mg))  # fmt: skip
    p = NamedValues("parameter", {"ln_beta_per_CY": np.log(1 / side_slope), "ln_alpha_per_CL": np.log(1 / slope)})
    assert energy_balance.by_gusts_W(this_samples, p, CONDITIONS) == pytest.approx(pull_W, rel=2e-3)
    CL, variance = lift_N / qS, np.var(lift_N / mg)
    induced_W = qS * V * np.mean(0.04 + 0.06 * (CL - 0.2) ** 2)
    without_K4 = replace(POLAR, K4=0.0)
    assert drag_power(V, 1.0, 0.0, without_K4, CONDITIONS, load_variance=variance) == pytest.approx(induced_W, rel=1e-3)


def test_thrust_that_does_not_fall_with_speed_is_a_power_law() -> None:
    """T = k sqrt(P): efficiency in proportion to V over the root of power; level power to the square of drag."""
    law = CONDITIONS._replace(power_law=energy_balance.PowerLaw(V_mps=15.0, power_W=100.0))
    of_law = {"ln_efficiency": np.log(0.9), "of_speed": 1.0, "of_power": -0.5}
    p = NamedValues("parameter", named(P) | of_law)
    V = np.array([12.0, 16.0, 24.0])
    drag_N = drag_power(V, 1.0, 0.0, QuarticPolar.of(p), law) / V
    k = 0.9 * 10 / 15.0  # of T = eta P / V at 15 m/s and 100 W
    assert level_power(V, p, law) - law.idle_power_W == pytest.approx((drag_N / k) ** 2, rel=1e-3)


def test_level_power_is_where_drag_meets_the_motor() -> None:
    V = np.array([12.0, 16.0, 20.0])
    motor = level_power(V, P, CONDITIONS) - CONDITIONS.idle_power_W
    x = energy_balance.advance(V, motor, CONDITIONS.rho)
    useful = motor * energy_balance.efficiency(x, GREATEST, X, FALL)
    assert useful == pytest.approx(drag_power(V, 1.0, 0.0, POLAR, CONDITIONS), rel=1e-3)


@pytest.mark.parametrize("name", ["apc-10x5e", "apc-12x8e"])
def test_propellers_have_the_form_of_the_efficiency(name: str) -> None:
    """Up to the advance ratio of greatest efficiency, within 0.04 of it."""
    propeller = load_propeller(name)
    n = np.full(60, 100.0)
    V = np.linspace(0.05, 1.0, 60) * n * propeller.diameter_m
    thrust, shaft = propeller.thrust_and_power(V, n, 1.2)
    efficiency, x = thrust * V / shaft, energy_balance.advance(V, shaft, 1.2)
    best = int(np.argmax(np.where(thrust > 0.1 * thrust[0], efficiency, 0.0)))
    form = energy_balance.efficiency(x[:best], float(efficiency[best]), float(x[best]), 0.7)
    assert form == pytest.approx(efficiency[:best], abs=0.04 * efficiency[best])


def test_the_covariance_is_that_of_air_motion_in_windows(samples: Samples) -> None:
    """Against many random first-order air motions put through the balance's own windows."""
    balance = EnergyBalance(samples, CONDITIONS)
    rng, sigma, time_s, step = np.random.default_rng(0), 0.5, 3.0, 0.2
    decay = np.exp(-step / time_s)
    w = np.zeros((4000, len(samples.t_s)))
    w[:, 0] = rng.normal(size=4000)
    for i in range(1, w.shape[1]):
        w[:, i] = decay * w[:, i - 1] + np.sqrt(1 - decay**2) * rng.normal(size=4000)
    count = len(balance.windows.weight)
    starts = [int(np.argmin(np.abs(samples.t_s - c))) - count // 2 for c in balance.windows.centers_s[:6]]
    means = np.stack([w[:, s : s + count] @ balance.windows.weight for s in starts], axis=1)
    covariance = np.cov((CONDITIONS.mass_kg * g * sigma * means).T)
    expected = by_air(balance.windows, CONDITIONS.mass_kg, 0.0, sigma, time_s)[:6, :6]
    assert covariance == pytest.approx(expected, abs=0.08 * expected[0, 0])


def test_noise_is_recognized() -> None:
    t = np.arange(0, 300, 1.0)
    apart = np.abs(t[:, None] - t)
    draw = np.linalg.cholesky(correlation(apart, 10.0)) @ np.random.default_rng(2).normal(size=len(t))
    sigma, time_s = most_likely_noise(2.0 * draw, apart, (2.0, 5.0, 10.0, 20.0, 40.0))
    assert sigma == pytest.approx(2.0, rel=0.25) and time_s in (5.0, 10.0, 20.0)


def test_smoothing_keeps_a_straight_line() -> None:
    line = np.arange(50.0)
    assert smoothed(line, 7)[5:-5] == pytest.approx(line[5:-5])
