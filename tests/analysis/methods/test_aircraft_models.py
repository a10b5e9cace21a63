"""The aircraft models agree with a Nexstar simulated here with an adaptive integrator and a simple control law."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from flightpower.analysis.estimation import uncertainty
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.simulation import build_simulator
from flightpower.analysis.methods import aircraft_models
from flightpower.analysis.methods.aircraft_models import level_flight_state
from flightpower.flight import motion
from flightpower.flight.aerodynamics import aerodynamics_of, body_axes, lift_and_drag, lift_slope
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.atmosphere import GRAVITY_MPS2
from tests.analysis.estimation.models import longitudinal, pitch_and_height

NEXSTAR = load_aircraft("nexstar")
AERO = replace(aerodynamics_of(NEXSTAR), stall_angle_rad=1.5)  # attached flow only, like the models
TRUE_POLAR = (AERO.CD0 + AERO.K * AERO.CL_minD**2, -2 * AERO.K * AERO.CL_minD, AERO.K)
RHO, STEP_S = 1.2, 0.04
m, S, chord = NEXSTAR.mass_kg, NEXSTAR.geometry.wing_area_m2, NEXSTAR.geometry.chord_m
# Bench noise of Table 4.1, and the noise of a barometer.
BENCH_NOISE = {"V": 0.29, "alpha": 0.008, "ax": 0.058, "az": 0.058, "h": 0.3, "q": 0.005}


def trim(V):
    """Return alpha and elevator [rad] of level flight."""
    CL = m * GRAVITY_MPS2 / (RHO * V**2 / 2 * S)
    # CL0 + CLa a + CLde de = CL, Cm0 + Cma a + Cmde de = 0
    matrix = [[AERO.CLa, AERO.CLde], [AERO.Cma, AERO.Cmde]]
    return np.linalg.solve(matrix, [CL - AERO.CL0, -AERO.Cm0])


def fly(V, thrust, elevator, duration_s, stop_at=None):
    """Return the true signals by name at 25 Hz. thrust(V, t) [N]; elevator(x, t) [rad], x = V, alpha, theta, q, h."""

    def forces(x, t):
        V, alpha, _, q, _ = x
        CL, CD = lift_and_drag(AERO, alpha, elevator(x, t), q * chord / (2 * V))
        return CL, CD, RHO * V**2 / 2 * S

    def derivative(t, x):
        V, alpha, theta, q, _ = x
        CL, CD, qS = forces(x, t)
        Vdot, alphadot, _ = motion.wind_axis_derivative(
            (V, alpha, 0), (0, theta, 0), (0, q, 0), coefficients=(CL, CD, 0), T=thrust(V, t), m=m, qS=qS
        )
        Cm = AERO.Cm0 + AERO.Cma * alpha + AERO.Cmq * q * chord / (2 * V) + AERO.Cmde * elevator(x, t)
        return [Vdot, alphadot, q, qS * chord * Cm / NEXSTAR.mass.Iy_kgm2, V * np.sin(theta - alpha)]

    reached = None
    if stop_at is not None:
        reached = lambda t, x: x[0] - stop_at  # noqa: E731
        reached.terminal = True
    alpha, _ = trim(V)
    path = solve_ivp(
        derivative, (0, duration_s), [V, alpha, alpha, 0, 0], rtol=1e-8, atol=1e-9, dense_output=True, events=reached,
        max_step=0.1,
    )  # fmt: skip
    t = np.arange(0, path.t[-1], STEP_S)
    x = path.sol(t)
    CL, CD, qS = np.array([forces(state, now) for state, now in zip(x.T, t, strict=True)]).T
    T = np.array([thrust(state[0], now) for state, now in zip(x.T, t, strict=True)])
    CX, CZ = body_axes(CL, CD, x[1])
    return {
        **dict(zip(("V", "alpha", "theta", "q", "h"), x, strict=True)),
        "t_s": t,
        "elevator": np.array([elevator(state, now) for state, now in zip(x.T, t, strict=True)]),
        "thrust": T,
        "J": x[0] / 22,  # about right for a 10-inch propeller
        "ax": (qS * CX + T) / m,
        "az": qS * CZ / m,
        "CL": CL,
    }


def hold_height(x, t):
    V, _, theta, q, h = x
    alpha_trim, elevator = trim(V)
    return elevator + 0.3 * q + 0.3 * (theta - alpha_trim + 0.03 * h)


def three_two_one_one(x, t):
    """Return a 3-2-1-1 elevator. Its ramps begin and end on samples, so linear interpolation reproduces it exactly."""
    corners = STEP_S * np.array([25, 27, 48, 50, 64, 66, 73, 75, 82, 84])
    return trim(18.0)[1] + np.deg2rad(2.0) * np.interp(t, corners, [0, 1, 1, -1, -1, 1, 1, -1, -1, 0])


@pytest.fixture(scope="module")
def runs():
    """Fly one acceleration and one deceleration through most of the speed range, without noise."""
    return {
        "acceleration": fly(12, lambda V, t: 14 * min(1, 0.4 + t / 2) * (1 - V / 40), hold_height, 20, stop_at=23),
        "deceleration": fly(24, lambda V, t: 4 * max(0, 1 - t / 2) * (1 - V / 40), hold_height, 20, stop_at=12),
    }


@pytest.fixture(scope="module")
def maneuver():
    thrust = 0.5 * RHO * 18**2 * S * (TRUE_POLAR @ np.array([1, 0.5, 0.25]))
    return fly(18, lambda V, t: thrust, three_two_one_one, 8)


def measured(name, truth, noise=None, seed=0, wrong=None):
    """Return a segment with noise (standard deviations by channel) and systematic errors (by model parameter)."""
    rng = np.random.default_rng(seed)
    noise, wrong = noise or {}, wrong or {}
    signal = {k: v + noise.get(k, 0.0) * rng.standard_normal(len(v)) for k, v in truth.items()}
    signal["V"] = signal["V"] + wrong.get("V_scale", 0) * truth["V"]
    signal["alpha"] = signal["alpha"] + wrong.get("alpha_scale", 0) * truth["alpha"] + wrong.get("alpha_bias", 0)
    for channel in ("ax", "az", "q"):
        signal[channel] = signal[channel] + wrong.get(f"{channel}_bias", 0)
    signal["thrust"] = truth["thrust"] / (1 + wrong.get("thrust_scale", 0))
    zero = np.zeros(len(truth["t_s"]))
    inputs = {"phi": zero, "p": zero, "r": zero, "beta": zero, "rho": zero + RHO}
    inputs |= {k: signal[k] for k in ("thrust", "J", "elevator", "q")} | {"theta": truth["theta"]}
    outputs = {k: signal[k] for k in ("V", "alpha", "ax", "az", "h", "q")}
    return Segment(name=name, t_s=truth["t_s"], u=inputs, z=outputs)


def power_W(p, V):
    CL = m * GRAVITY_MPS2 / (RHO * V**2 / 2 * S)
    return RHO * V**3 / 2 * S * (p.A0 + p.A1 * CL + p.A2 * CL**2)


SPEEDS = np.array([38, 55, 75]) * 0.3048
TRUE_POWER_W = RHO * SPEEDS**3 / 2 * S * np.array(
    [np.polyval(TRUE_POLAR[::-1], m * GRAVITY_MPS2 / (RHO * V**2 / 2 * S)) for V in SPEEDS]
)  # fmt: skip


ALL_MODELS = {
    "two_state": aircraft_models.two_state(NEXSTAR),
    "pitch_and_height": pitch_and_height(NEXSTAR),
    "pitch_and_height with climb rate": pitch_and_height(NEXSTAR, with_climb_rate=True),
    "longitudinal": longitudinal(NEXSTAR),
    "level_run": aircraft_models.level_run(NEXSTAR),
}


@pytest.mark.parametrize("name", ALL_MODELS)
def test_sensitivities_are_those_of_a_complex_step(name):
    """Each shipped model, banked and sideslipping, agrees with RK4 in complex arithmetic to 1e-8."""
    model = ALL_MODELS[name].changed(CLq={"free": True, "start": 4.0})
    rng = np.random.default_rng(0)
    n = 60
    typical = {
        "V": 18.0,
        "V_ref": 18.0,
        "thrust": 6.0,
        "thrust_per_speed": -0.3,
        "J": 0.5,
        "rho": 1.2,
        "alpha": 0.05,
        "theta": 0.05,
    }
    wobble = 0.05 * np.sin(np.linspace(0, 9, n)[:, None] + 2 * np.pi * rng.random(len(model.inputs)))
    U = np.array([typical.get(i, 0.0) for i in model.inputs]) + wobble
    x0 = np.array([typical.get(s, 0.02) for s in model.states])
    p = np.array([q.start for q in model.parameters]) + 0.01 * rng.standard_normal(len(model.parameters))
    names = tuple(q.name for q in model.parameters)
    S = build_simulator(model, names).run(x0, U, p, STEP_S).S

    def respond(x, p):
        y = np.zeros((n, len(model.outputs)), dtype=complex)

        def f(x, u):
            return np.array(model.evaluate_dynamics(x, u, p))

        for k in range(n):
            y[k] = model.evaluate_outputs(x, U[k], p)
            if k < n - 1 and len(x):
                middle = (U[k] + U[k + 1]) / 2
                k1 = f(x, U[k])
                k2 = f(x + STEP_S / 2 * k1, middle)
                k3 = f(x + STEP_S / 2 * k2, middle)
                k4 = f(x + STEP_S * k3, U[k + 1])
                x = x + STEP_S / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
        return y

    numbers = np.concatenate([p, x0])
    for i in range(len(numbers)):
        shifted = numbers.astype(complex)
        shifted[i] += 1e-30j
        column = respond(shifted[len(p) :], shifted[: len(p)]).imag / 1e-30
        assert np.abs(S[:, :, i] - column).max() <= 1e-8 * max(1.0, np.abs(column).max())


def test_the_models_do_not_use_the_simulator_s_aerodynamics(runs):
    stripped = replace(NEXSTAR, aerodynamics=None)
    segments = [measured(name, truth) for name, truth in runs.items()]
    assert aircraft_models.starting_values(stripped, segments) == aircraft_models.starting_values(NEXSTAR, segments)
    for build in (
        aircraft_models.two_state,
        pitch_and_height,
        longitudinal,
    ):
        assert [q.start for q in build(stripped).parameters] == [q.start for q in build(NEXSTAR).parameters]


def test_pitch_and_height_estimates_power_in_spite_of_sensor_errors(runs):
    """Systematic errors are drawn from their priors; all channels but the gyro, which the model takes as exact, have
    bench noise. At low, middle and high speed, power lies within four of its standard errors and within 10 %."""
    model = pitch_and_height(NEXSTAR)
    spread = {q.name: q.prior_sigma for q in model.parameters if np.isfinite(q.prior_sigma) and q.name != "CLde"}
    deviation = []
    for seed in range(4):
        rng = np.random.default_rng(100 + seed)
        wrong = {name: sigma * rng.standard_normal() for name, sigma in spread.items()}
        noise = BENCH_NOISE | {"q": 0.0}
        segments = [measured(k, truth, noise, 2 * seed + i, wrong) for i, (k, truth) in enumerate(runs.items())]
        fit = fit_output_error(model, segments, start=aircraft_models.starting_values(NEXSTAR, segments))
        assert fit.verdict.ok
        power = uncertainty.delta_method(uncertainty.cramer_rao(fit), lambda p: power_W(p, SPEEDS))
        deviation.append((power.value - TRUE_POWER_W) / power.standard_error)
        assert power.value == pytest.approx(TRUE_POWER_W, rel=0.10)
    # The rms of 12 deviations of unit variance, correlated among the three speeds, is 1 +- 0.3.
    assert np.abs(deviation).max() < 4
    assert np.sqrt(np.mean(np.square(deviation))) < 1.9


def test_with_gyro_noise_power_is_right_within_15_percent(runs):
    model = pitch_and_height(NEXSTAR)
    for seed in range(2):
        segments = [measured(k, truth, BENCH_NOISE, 2 * seed + i) for i, (k, truth) in enumerate(runs.items())]
        fit = fit_output_error(model, segments, start=aircraft_models.starting_values(NEXSTAR, segments))
        assert fit.verdict.ok
        assert power_W(fit.shared(), SPEEDS) == pytest.approx(TRUE_POWER_W, rel=0.15)


def test_two_states_with_true_pitch_angle(runs):
    segments = [measured(k, t, BENCH_NOISE | {"q": 0.0}, i) for i, (k, t) in enumerate(runs.items())]
    fit = fit_output_error(
        aircraft_models.two_state(NEXSTAR), segments, start=aircraft_models.starting_values(NEXSTAR, segments)
    )
    assert fit.verdict.ok
    power = uncertainty.delta_method(uncertainty.cramer_rao(fit), lambda p: power_W(p, SPEEDS))
    assert np.all(np.abs(power.value - TRUE_POWER_W) < 4 * power.standard_error)


def test_a_3211_input_identifies_pitching_moment_and_lift_due_to_pitch_rate(maneuver):
    model = longitudinal(NEXSTAR)
    quiet = {"V": 0.1, "alpha": 0.001, "q": 0.001, "ax": 0.03, "az": 0.03, "h": 0.1}
    fit = fit_output_error(model, measured("3211", maneuver, quiet))
    assert fit.verdict.ok
    for name in ("CLa", "CLde", "CLq", "Cm0", "Cma", "Cmq", "Cmde"):
        estimate = fit.parameters[name]
        assert abs(estimate.value - getattr(AERO, name)) < 4 * estimate.standard_error, name
    for name in ("Cma", "Cmq", "Cmde"):
        assert fit.parameters[name].standard_error < 0.05 * abs(fit.parameters[name].value)
    assert uncertainty.t_tests(uncertainty.cramer_rao(fit))["Cma"].significant


def test_quick_start_are_close_on_clean_data_and_the_defaults_on_nonsense(runs):
    clean = aircraft_models.starting_values(NEXSTAR, [measured(k, t) for k, t in runs.items()])
    assert (clean["A0"], clean["A2"]) == pytest.approx((TRUE_POLAR[0], TRUE_POLAR[2]), rel=0.02)
    assert clean["CLa"] == pytest.approx(AERO.CLa, rel=0.05)
    upside_down = measured("nonsense", runs["acceleration"] | {"az": -runs["acceleration"]["az"]})
    generic = aircraft_models.starting_values(NEXSTAR, upside_down)
    assert generic["CLa"] == lift_slope(NEXSTAR.aspect_ratio)


def test_lift_slope_of_long_and_of_vanishing_wings():
    """An endless wing has 2 pi (thin airfoil theory); a wing of vanishing span has pi AR / 2 (Jones, slender wing)."""
    assert lift_slope(1e6) == pytest.approx(2 * np.pi, rel=1e-4)
    assert lift_slope(1e-3) == pytest.approx(np.pi / 2 * 1e-3, rel=1e-3)


def test_state_at_the_start_of_a_climb():
    t = np.arange(50) * STEP_S
    segment = Segment(name="climb", t_s=t, u={}, z={"V": 20 + 0 * t, "alpha": 0.05 + 0 * t, "h": 100 + 2 * t})
    state = aircraft_models.level_flight_state(segment)
    assert state["theta"] == pytest.approx(0.05 + np.arcsin(2 / 20))
    assert state["h"] == pytest.approx(100)


def test_a_start_in_level_flight_is_that_of_the_segment_s_first_sample() -> None:
    """Time may begin anywhere. Theta is the angle of attack plus the climb angle, 2 m/s at 20 m/s."""
    t = 100.0 + 0.04 * np.arange(100)
    z = {"V": 20 + 0.5 * (t - t[0]), "alpha": np.full(100, 0.05), "h": 70 + 2.0 * (t - t[0])}
    start = level_flight_state(Segment(name="late", t_s=t, u={}, z=z))
    assert start["V"] == pytest.approx(20.0) and start["h"] == pytest.approx(70.0) and start["q"] == 0.0
    assert start["theta"] == pytest.approx(0.05 + np.arcsin(0.1))


@pytest.mark.parametrize("name", ["two_state", "pitch_and_height", "level_run"])
def test_a_gyro_bias_is_what_the_gyro_shows_of_no_rotation(name):
    """A pitch rate input that is larger by the bias gives the same derivatives and outputs. (The longitudinal model,
    whose pitch rate is a state, adds the bias to the predicted gyro reading instead.)"""
    model = ALL_MODELS[name]
    flown = {"V": 18.0, "V_ref": 18.0, "thrust": 6.0, "J": 0.5, "rho": 1.2, "alpha": 0.05, "theta": 0.06, "q": 0.3}
    u = np.array([flown.get(i, 0.01) for i in model.inputs])
    x = np.array([flown.get(s, 0.02) for s in model.states])
    p = np.array([3.0 if q.name == "CLq" else q.start for q in model.parameters])
    biased, faster = p.copy(), u.copy()
    biased[[q.name for q in model.parameters].index("q_bias")] += 0.02
    faster[model.inputs.index("q")] += 0.02
    same = (model.evaluate_dynamics(x, u, p), model.evaluate_outputs(x, u, p))
    result = (model.evaluate_dynamics(x, faster, biased), model.evaluate_outputs(x, faster, biased))
    for item, other in zip(same, result, strict=True):
        assert [float(v) for v in other] == pytest.approx([float(v) for v in item], rel=1e-12)
    unbiased = model.evaluate_outputs(x, faster, p)
    assert [float(v) for v in unbiased] != pytest.approx([float(v) for v in same[1]], rel=1e-6)


def test_sensors_show_scale_times_the_truth_plus_bias():
    """Equation (3.43) holds for every model with states V and alpha; ax and az have biases."""
    for model in ALL_MODELS.values():
        names = [q.name for q in model.parameters]
        if "gamma" in model.states:  # in level runs, angle of attack is no state
            continue
        u = np.array([{"thrust": 6.0, "J": 0.5, "rho": 1.2}.get(i, 0.0) for i in model.inputs])
        x = np.array([{"V": 18.0, "alpha": 0.05}.get(s, 0.02) for s in model.states])
        p = np.array([q.start for q in model.parameters])
        wrong = p.copy()
        errors = {
            "V_scale": 0.03,
            "V_bias": 0.4,
            "alpha_scale": 0.1,
            "alpha_bias": 0.02,
            "ax_bias": 0.3,
            "az_bias": -0.5,
        }
        for error, value in errors.items():
            wrong[names.index(error)] += value
        true = dict(zip(model.outputs, map(float, model.evaluate_outputs(x, u, p)), strict=True))
        shown = dict(zip(model.outputs, map(float, model.evaluate_outputs(x, u, wrong)), strict=True))
        assert (true["V"], true["alpha"]) == (18.0, 0.05)
        assert shown["V"] == pytest.approx(18.0 * 1.03 + 0.4) and shown["alpha"] == pytest.approx(0.05 * 1.1 + 0.02)
        assert (shown["ax"] - true["ax"], shown["az"] - true["az"]) == pytest.approx((0.3, -0.5))


def test_each_derivative_of_the_forces_multiplies_what_it_is_named_after() -> None:
    """Equations (2.14) and (2.15) are evaluated at an angle of attack of 0.1 rad and an elevator of 0.2 rad."""
    names = ("CX0", "CXa", "CXa2", "CXde", "CZ0", "CZa", "CZa2", "CZde")
    shares = (1.0, 0.1, 0.01, 0.2)
    for i, name in enumerate(names):
        force_coefficients = aircraft_models.force_coefficients(
            0.1, 0.2, SimpleNamespace(**(dict.fromkeys(names, 0.0) | {name: 3.0}))
        )
        expected = [0.0, 0.0]
        expected[i // 4] = 3.0 * shares[i % 4]
        assert force_coefficients == pytest.approx(expected)
