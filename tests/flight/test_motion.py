"""The equations of motion against the vector form they come from, derived here independently with matrices."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.flight.motion import (
    Inertia,
    attitude_derivative,
    body_from_earth,
    earth_from_body,
    flow_of,
    rate_derivative,
    specific_force_at,
    velocity_derivative,
    velocity_of,
    wind_axis_derivative,
)

SEEDS = range(20)
INERTIA = Inertia(0.18, 0.28, 0.37, 0.03, 9e-5)


def tensor(inertia: Inertia) -> np.ndarray:
    return np.array([[inertia.Ix, 0, -inertia.Ixz], [0, inertia.Iy, 0], [-inertia.Ixz, 0, inertia.Iz]])


def random_attitude(rng) -> np.ndarray:
    return rng.uniform([-np.pi, -1.4, -np.pi], [np.pi, 1.4, np.pi])


def body_to_earth(attitude) -> np.ndarray:
    """The rotation matrix from another source: intrinsic z-y-x rotations by scipy."""
    phi, theta, psi = attitude
    return Rotation.from_euler("ZYX", [psi, theta, phi]).as_matrix()


@pytest.mark.parametrize("seed", SEEDS)
def test_rotation_agrees_with_an_independent_library(seed):
    rng = np.random.default_rng(seed)
    attitude, vector = random_attitude(rng), rng.normal(size=3)
    R = body_to_earth(attitude)
    assert np.allclose(earth_from_body(vector, attitude), R @ vector, atol=1e-14)
    assert np.allclose(body_from_earth(vector, attitude), R.T @ vector, atol=1e-14)


@pytest.mark.parametrize("seed", SEEDS)
def test_velocity_derivative_is_newton_in_rotating_axes(seed):
    rng = np.random.default_rng(seed)
    velocity, omega, force = rng.normal(size=(3, 3)) * [[20], [1], [10]]
    attitude = random_attitude(rng)
    gravity = body_to_earth(attitude).T @ [0, 0, g]
    expected = force + gravity - np.cross(omega, velocity)
    assert np.allclose(velocity_derivative(velocity, omega, *attitude[:2], force), expected, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_rate_derivative_is_euler_with_the_propellers_momentum(seed):
    rng = np.random.default_rng(seed)
    omega, moment = rng.normal(size=(2, 3))
    spin = rng.uniform(0, 1000)
    momentum = tensor(INERTIA) @ omega + [INERTIA.Ip * spin, 0, 0]
    expected = np.linalg.solve(tensor(INERTIA), moment - np.cross(omega, momentum))
    assert np.allclose(rate_derivative(omega, moment, INERTIA, spin), expected, atol=1e-12)


@pytest.mark.parametrize("seed", SEEDS)
def test_attitude_derivative_turns_the_rotation_matrix(seed):
    rng = np.random.default_rng(seed)
    attitude, omega = random_attitude(rng), rng.normal(size=3)
    rate = np.array(attitude_derivative(*attitude[:2], *omega))
    h = 1e-6
    dR = (body_to_earth(attitude + h * rate) - body_to_earth(attitude - h * rate)) / (2 * h)
    p, q, r = omega
    cross = np.array([[0, -r, q], [r, 0, -p], [-q, p, 0]])
    # A central difference of step h is good to h^2 times the third derivative, here up to (|omega|/cos theta)^3.
    assert np.allclose(dR, body_to_earth(attitude) @ cross, atol=1e-7)


@pytest.mark.parametrize("seed", SEEDS)
def test_wind_axis_form_is_the_body_axis_form(seed):
    """(3.21-3.23) follow from (3.6-3.8) by the chain rule: this is where the printed signs were wrong."""
    rng = np.random.default_rng(seed)
    V, alpha, beta = rng.uniform([10, -0.4, -0.4], [40, 0.4, 0.4])
    phi, theta, _ = random_attitude(rng)
    p, q, r = rng.normal(size=3)
    CL, CD, CY, T = rng.uniform([-1, 0.02, -0.3, -5], [1.5, 0.5, 0.3, 20])
    m, qS = 3.8, 150.0
    ca, sa = np.cos(alpha), np.sin(alpha)
    force = np.array([(CL * sa - CD * ca) * qS + T, CY * qS, (-CL * ca - CD * sa) * qS]) / m
    u, v, w = velocity_of(V, alpha, beta)
    rate = np.array(velocity_derivative((u, v, w), (p, q, r), phi, theta, force))
    h = 1e-5
    ahead = flow_of(*(np.array([u, v, w]) + h * rate))
    behind = flow_of(*(np.array([u, v, w]) - h * rate))
    expected = (np.array(ahead) - np.array(behind)) / (2 * h)
    derivative = wind_axis_derivative(
        (V, alpha, beta), (phi, theta, 0.0), (p, q, r), coefficients=(CL, CD, CY), T=T, m=m, qS=qS
    )
    assert np.allclose(derivative, expected, rtol=1e-7, atol=1e-7)


def test_flow_and_velocity_are_inverses():
    flow = (23.0, 0.12, -0.07)
    assert np.allclose(flow_of(*velocity_of(*flow)), flow, atol=1e-14)


def test_torque_free_rotation_keeps_energy_and_momentum():
    """A body tumbles without air: kinetic energy and the momentum vector, seen from the ground, stay constant."""

    def rates(_, x):
        phidot = attitude_derivative(*x[3:5], *x[:3])
        return [*rate_derivative(x[:3], (0.0, 0.0, 0.0), INERTIA), *phidot]

    start = [2.0, 0.3, 1.1, 0.2, 0.1, 0.0]
    # About the axis of middle inertia it would tumble through a pitch of 90 deg, where Euler angles are singular.
    end = solve_ivp(rates, (0, 2.0), start, rtol=1e-11, atol=1e-12).y[:, -1]
    I = tensor(INERTIA)  # noqa: E741
    momenta = [body_to_earth(x[3:]) @ I @ x[:3] for x in (np.array(start), end)]
    energies = [x[:3] @ I @ x[:3] / 2 for x in (np.array(start), end)]
    assert np.linalg.norm(end[3:] - start[3:]) > 1  # it did turn
    assert np.allclose(momenta[0], momenta[1], atol=1e-9)
    assert energies[0] == pytest.approx(energies[1], abs=1e-9)


def test_a_spinning_propeller_yaws_the_aircraft_that_pitches_up():
    """The propeller turns clockwise seen from behind, so its momentum points forward. A pitch-up needs a torque that
    turns the momentum upwards; the aircraft feels the opposite, a yaw to the right."""
    _, _, rdot = rate_derivative((0.0, 1.0, 0.0), (0.0, 0.0, 0.0), INERTIA._replace(Ixz=0.0), 800.0)
    assert rdot == pytest.approx(INERTIA.Ip * 800 / INERTIA.Iz)


def test_specific_force_off_the_center_is_that_of_a_point_carried_around():
    """The point's position is differentiated twice numerically, on a body that turns ever faster about a tilted
    axis."""
    axis, rate, acceleration = np.array([0.3, -0.5, 0.8]), 1.3, 0.7
    axis = axis / np.linalg.norm(axis)
    point = np.array([0.4, -0.1, 0.2])

    def position(t):
        return Rotation.from_rotvec(axis * (rate * t + acceleration * t**2 / 2)).apply(point)

    h = 1e-4
    second = (position(h) - 2 * position(0) + position(-h)) / h**2
    omega, alpha = axis * rate, axis * acceleration
    specific_force = specific_force_at((0.0, 0.0, 0.0), omega, alpha, point)
    # Differences of step h lose eps/h^2 = 2e-8 to rounding and h^2 to curvature.
    assert np.allclose(specific_force, second, atol=1e-6)


def test_casadi_symbols_pass_through():
    ca = pytest.importorskip("casadi")
    ca.GlobalOptions.setNumpyMode(-1)
    x = ca.SX.sym("x", 9)
    parts = ca.vertsplit(x)
    f = ca.Function("f", [x], [ca.vertcat(*velocity_derivative(parts[:3], parts[3:6], *parts[6:8], parts[:3]))])
    values = np.random.default_rng(0).normal(size=9)
    assert np.allclose(
        np.array(f(values)).ravel(), velocity_derivative(values[:3], values[3:6], *values[6:8], values[:3])
    )
