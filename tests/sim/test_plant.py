"""The plant against what physics says of any aircraft: conservation, glide, order of the integrators."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.propeller import Propeller, Row
from flightpower.sim.air import Air
from flightpower.sim.drag_shape import DragShape
from flightpower.sim.integration import Stepper, rk4
from flightpower.sim.plant import AircraftState, Commands, Plant, plant_of, servo_rate
from flightpower.sim.trim import Trimmer

SPIN = 120.0  # rev/s


def tumbling(**changes) -> AircraftState:
    zeros = dict.fromkeys(AircraftState._fields, 0.0)
    motion = dict(down=-500.0, u=20.0, v=-3.0, w=2.0, phi=0.3, theta=0.2, psi=1.0, p=1.5, q=0.4, r=-0.3, motor=SPIN)
    return AircraftState(**{**zeros, **motion, **changes})


def integrate(plant: Plant, x: AircraftState, commands: Commands, dt: float, n: int) -> AircraftState:
    stepper = Stepper(plant, dt)
    stepper.start(x, commands)
    for _ in range(n):
        stepper.step()
    return AircraftState(*stepper.x.tolist())


def test_without_air_energy_and_momentum_are_kept(plant):
    """Thrown into a vacuum with the propeller running down: total angular momentum, horizontal velocity and the
    energy of the body's motion stay what they were; gravity does the rest."""
    void = replace(plant, air=Air(ground_pressure_Pa=1e-9))
    start = tumbling()
    T, n = 1.0, 500
    end = integrate(void, start, Commands(0, 0, 0, 0), T / n, n)
    I = plant.inertia  # noqa: E741
    tensor = np.array([[I.Ix, 0, -I.Ixz], [0, I.Iy, 0], [-I.Ixz, 0, I.Iz]])

    def on_earth(x, vector):
        return Rotation.from_euler("ZYX", [x.psi, x.theta, x.phi]).as_matrix() @ vector

    def momentum(x):
        spin = np.array([I.Ip * 2 * np.pi * x.motor, 0, 0])
        return on_earth(x, tensor @ [x.p, x.q, x.r] + spin)

    def velocity(x):
        return on_earth(x, [x.u, x.v, x.w])

    assert end.motor < SPIN - 5  # friction slows it down: its momentum passed into the body
    assert np.allclose(momentum(end), momentum(start), atol=1e-7)
    assert np.allclose(velocity(end) - velocity(start), [0, 0, g * T], atol=1e-8)
    fallen = velocity(start)[2] * T + g * T**2 / 2
    assert end.down - start.down == pytest.approx(fallen, abs=1e-8)


def test_a_glide_comes_down_by_drag_over_lift(plant, trimmer):
    """No thrust: height lost over distance flown is CD/CL, in the trim and in ten seconds of flying it."""
    V = 16.0
    D = plant.propeller.diameter_m
    n = brentq(lambda n: plant.propeller.thrust_and_power(V, n, trimmer.density)[0], V / D / 1.0, V / D / 0.6)
    trim = trimmer.solve(V=V, motor=n)
    stepper = Stepper(trimmer.plant, 0.02)
    start = trim.state()
    now, _ = trimmer.plant.instant(start, trim.commands)
    assert now.train.thrust_N == pytest.approx(0.0, abs=1e-6)
    stepper.start(start, trim.commands)
    for _ in range(500):
        stepper.step()
    end = AircraftState(*stepper.x)
    assert (end.down - start.down) / (end.north - start.north) == pytest.approx(now.CD / now.CL, rel=2e-3)
    assert trim.unknowns.climb / np.sqrt(V**2 - trim.unknowns.climb**2) == pytest.approx(-now.CD / now.CL, rel=1e-6)


def test_energy_balance_over_a_whole_flight(flight):
    """(2.23-2.24): in still air, the work of thrust and drag equals the gain of kinetic and potential energy at every
    step."""
    flown = flight.truth[flight.truth["phase"] == "flight"]
    t, m = flown["time_s"].to_numpy(), flight.plant.mass_kg
    V, alpha, beta = (flown[c].to_numpy() for c in ("V_mps", "alpha_rad", "beta_rad"))
    qS = flown["dynamic_pressure_Pa"].to_numpy() * flight.aircraft.geometry.wing_area_m2
    side = flown["CY"].to_numpy() * qS * np.sin(beta)
    power = (
        flown["thrust_N"] * np.cos(alpha) * np.cos(beta) - flown["drag_N"] * np.cos(beta)
    ).to_numpy() * V + side * V
    energy = m * V**2 / 2 + m * g * flown["height_m"].to_numpy()
    gained = np.concatenate([[0], np.cumsum((power[1:] + power[:-1]) / 2 * np.diff(t))])
    swing = np.ptp(energy)
    assert swing > 300  # joules: it did accelerate
    # The trapezoidal rule at 50 Hz loses some 1e-4 where the throttle has corners.
    assert np.max(np.abs(energy - energy[0] - gained)) < 1e-3 * swing


def test_rk4_is_of_order_four_and_euler_of_order_one(plant):
    """Halving the step divides the error by 16 and by 2. The propeller's table has no corners, since corners have no
    fourth derivative."""
    smooth = Propeller("smooth", 0.3, (Row(6000, (0.0, 2.0), (0.1, -0.15), (0.06, -0.04)),))
    calm = replace(plant, propeller=smooth)
    trim = Trimmer(calm, 100.0).solve(V=17.0, climb=0.0)
    start = trim.state()._replace(theta=trim.unknowns.theta + 0.05, p=0.1, r=0.05)
    disturbed = Commands(*np.add(trim.commands, [0.01, 0.005, -0.01, 0.02]))
    T = 0.64

    def end(integrator, n):
        stepper = Stepper(calm, T / n, integrator)
        stepper.start(start, disturbed)
        for _ in range(n):
            stepper.step()
        return stepper.x[:16].copy()

    exact = end("rk4", 4096)
    for integrator, order, coarse in (("rk4", 4, 256), ("euler", 1, 512)):
        errors = [np.linalg.norm(end(integrator, n) - exact) for n in (coarse, 2 * coarse)]
        assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.15)


def test_the_compiled_step_is_the_plain_one(plant, trimmer):
    """CasADi's step and NumPy's have one definition: they agree also in wind, in gusts and with everything moving."""
    windy = replace(plant, air=Air(wind_mps=4.0, wind_from_rad=1.0, turbulence_mps=6.0, thermal_mps=1.0))
    x = tumbling(elevator=0.05, aileron=-0.02, rudder=0.1, gust_u=1.0, gust_w1=-0.5, gust_v2=0.3, gust_p=0.05)
    x = x._replace(p=0.2, down=-80.0)
    commands, white = Commands(0.1, 0.0, -0.1, 0.7), (3.0, -2.0, 5.0, 1.0)
    stepper = Stepper(windy, 0.02)
    stepper.start(x, commands)
    stepper.white[:] = white
    seen = stepper.step()
    plain = rk4(lambda s: windy.derivative(s, commands, white), x, 0.02)
    assert np.allclose(stepper.x, [float(v) for v in plain], rtol=1e-12, atol=1e-12)
    assert seen == pytest.approx(stepper.start(AircraftState(*stepper.x.tolist()), commands), rel=1e-12)


def test_a_motor_faster_than_the_step_settles():
    """With a time constant of a third of the step, the motor follows a change of throttle as in fine steps."""
    survey = plant_of(load_complete_aircraft("survey-6kg"))
    trim = Trimmer(survey, 100.0).solve(V=14.0, climb=0.0)
    for change in (0.1, -0.3):
        commands = trim.commands._replace(throttle=trim.throttle + change)
        coarse, fine = (integrate(survey, trim.state(), commands, dt, round(0.06 / dt)) for dt in (0.02, 0.001))
        changed = fine.motor - trim.unknowns.motor
        assert abs(changed) > 4.0
        assert coarse.motor == pytest.approx(fine.motor, abs=0.01 * abs(changed))
        assert coarse.energy == pytest.approx(fine.energy, rel=0.03, abs=0.02)


def test_a_servo_has_rate_travel_and_lag(nexstar):
    surface = nexstar.elevator
    limits = min(surface.angle_rad), max(surface.angle_rad)
    assert servo_rate(surface, 0.0, 0.01) == pytest.approx(0.01 / surface.lag_s)
    assert servo_rate(surface, -0.3, 0.3) == pytest.approx(surface.rate_radps)
    assert servo_rate(surface, limits[1], 10.0) == pytest.approx(0.0)


def test_deviations_change_what_they_say(plant, trimmer):
    trim = trimmer.solve(V=17.0, climb=0.0)
    x, c = trim.state(), trim.commands
    base, _ = trimmer.plant.instant(x, c)

    def changed(**deviations):
        off = replace(trimmer.plant, deviations=replace(trimmer.plant.deviations, **deviations))
        return off, off.instant(x, c)[0]

    _, now = changed(thrust_scale=0.03)
    assert now.train.thrust_N == pytest.approx(1.03 * base.train.thrust_N)
    J = trim.unknowns.V / (trim.unknowns.motor * plant.propeller.diameter_m)
    _, now = changed(thrust_slope_J=0.2)
    assert now.train.thrust_N == pytest.approx((1 + 0.2 * (J - 0.5)) * base.train.thrust_N)
    heavy, now = changed(weight_scale=0.1)
    assert heavy.mass_kg == pytest.approx(1.1 * trimmer.plant.mass_kg)
    assert now.specific_force[2] == pytest.approx(base.specific_force[2] / 1.1)
    _, now = changed(updraft_mps=0.5)
    assert now.alpha - base.alpha == pytest.approx(0.5 / 17.0, rel=0.01)
    _, now = changed(drag=DragShape(quartic=0.05))
    assert now.CD - base.CD == pytest.approx(0.05 * (base.CL - plant.aero.CL_minD) ** 4)
