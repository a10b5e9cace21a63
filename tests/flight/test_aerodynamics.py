"""The aerodynamic model: what a polar, a stall and an axis change have to do."""

import dataclasses

import numpy as np
import pytest

from flightpower.flight.aerodynamics import (
    Aerodynamics,
    aerodynamics_of,
    body_axes,
    coefficients,
    drag_coefficient,
    lift_and_drag,
    stability_axes,
)
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError

AIRCRAFT = ("nexstar", "astraeus-ls", "astraeus-hs")


@pytest.mark.parametrize("name", AIRCRAFT)
def test_below_the_stall_lift_is_linear_and_drag_parabolic(name):
    aero = aerodynamics_of(load_aircraft(name))
    # Four widths before the stall, the step, which is a tanh, has reached only 3e-4 of its height.
    alpha = np.linspace(0, aero.stall_angle_rad - 4 * aero.stall_width_rad, 20)
    CL, CD = lift_and_drag(aero, alpha, elevator=0.05)
    assert np.allclose(CL, aero.CL0 + aero.CLa * alpha + aero.CLde * 0.05, atol=2e-3)
    assert np.allclose(CD, drag_coefficient(CL, CD0=aero.CD0, K=aero.K, CL_minD=aero.CL_minD), atol=2e-3)


@pytest.mark.parametrize("name", AIRCRAFT)
def test_lift_breaks_away_beyond_the_stall_and_drag_rises(name):
    aero = aerodynamics_of(load_aircraft(name))
    alpha = np.linspace(0, np.deg2rad(40), 400)
    CL, CD = lift_and_drag(aero, alpha, elevator=0.0)
    top = int(np.argmax(CL))
    assert abs(alpha[top] - aero.stall_angle_rad) < 2 * aero.stall_width_rad
    assert CL[-1] > 0 and CL[np.searchsorted(alpha, alpha[top] + 4 * aero.stall_width_rad)] < 0.95 * CL[top]
    assert np.all(np.diff(CD[top:]) > 0)
    # The curve is smooth: a tanh of this width falls no faster than its height over twice the width, and the rest
    # rises.
    attached = aero.CL0 + aero.CLa * alpha[top]
    fastest = (attached - np.sin(2 * alpha[top])) / (2 * aero.stall_width_rad) + aero.CLa
    assert np.max(np.abs(np.diff(CL) / np.diff(alpha))) < fastest


def test_axis_change_is_undone_by_its_inverse_and_keeps_the_length():
    CX, CZ = body_axes(0.8, 0.07, 0.15)
    assert np.allclose(stability_axes(CX, CZ, 0.15), (0.8, 0.07), atol=1e-15)
    assert np.hypot(CX, CZ) == pytest.approx(np.hypot(0.8, 0.07))
    assert body_axes(0.8, 0.07, 0.0) == (-0.07, -0.8)  # drag backwards, lift upwards


@pytest.mark.parametrize("name", AIRCRAFT)
def test_signs_of_the_controls_and_of_static_stability(name):
    aero = aerodynamics_of(load_aircraft(name))
    calm = {**AT_REST, "alpha": 0.05}
    base = coefficients_at(aero, **calm)

    def change(**moved):
        return np.subtract(coefficients_at(aero, **{**calm, **moved}), base)

    CL, _, CY, Cl, Cm, Cn = range(6)
    assert change(elevator=0.1)[Cm] < 0 < change(elevator=0.1)[CL]
    assert change(aileron=0.1)[Cl] > 0
    assert change(rudder=0.1)[Cn] < 0  # trailing edge left: nose left
    assert change(alpha=0.06)[Cm] < 0
    assert change(beta=0.1)[Cn] > 0 > change(beta=0.1)[Cl]
    assert change(beta=0.1)[CY] < 0
    for rate, moment in (("p_hat", Cl), ("q_hat", Cm), ("r_hat", Cn)):
        assert change(**{rate: 0.05})[moment] < 0  # damping


def test_an_aircraft_without_aerodynamics_cannot_be_simulated():
    real = dataclasses.replace(load_aircraft("nexstar"), aerodynamics=None)
    with pytest.raises(InputError, match=r"nexstar.*\[aerodynamics\]"):
        aerodynamics_of(real)


# All derivatives differ, so that none can stand in for another.
DISTINCT = Aerodynamics(
    CL0=0.3, CLa=5.0, CLde=0.4, CLq=4.0, CD0=0.03, K=0.06, CL_minD=0.2, stall_angle_rad=0.25, stall_width_rad=0.01,
    CYb=-0.51, CYp=-0.12, CYr=0.23, CYdr=0.14, Clb=-0.055, Clp=-0.46, Clr=0.17, Clda=0.28, Cldr=0.019,
    Cm0=0.01, Cma=-0.83, Cmq=-12.1, Cmde=-1.22, Cnb=0.064, Cnp=-0.035, Cnr=-0.096, Cnda=-0.027, Cndr=-0.078,
)  # fmt: skip
AT_REST = dict.fromkeys(("alpha", "beta", "p_hat", "q_hat", "r_hat", "elevator", "aileron", "rudder"), 0.0)


def coefficients_at(aero, *, p_hat, q_hat, r_hat, elevator, aileron, rudder, **flow):
    return coefficients(aero, **flow, reduced_rates=(p_hat, q_hat, r_hat), surfaces=(elevator, aileron, rudder))


DERIVATIVES = {
    ("CL", "alpha"): "CLa", ("CL", "elevator"): "CLde", ("CL", "q_hat"): "CLq",
    ("CY", "beta"): "CYb", ("CY", "p_hat"): "CYp", ("CY", "r_hat"): "CYr", ("CY", "rudder"): "CYdr",
    ("Cl", "beta"): "Clb", ("Cl", "p_hat"): "Clp", ("Cl", "r_hat"): "Clr", ("Cl", "aileron"): "Clda",
    ("Cl", "rudder"): "Cldr",
    ("Cm", "alpha"): "Cma", ("Cm", "q_hat"): "Cmq", ("Cm", "elevator"): "Cmde",
    ("Cn", "beta"): "Cnb", ("Cn", "p_hat"): "Cnp", ("Cn", "r_hat"): "Cnr", ("Cn", "aileron"): "Cnda",
    ("Cn", "rudder"): "Cndr",
}  # fmt: skip


@pytest.mark.parametrize("variable", AT_REST)
@pytest.mark.parametrize("coefficient", ["CL", "CY", "Cl", "Cm", "Cn"])
def test_each_coefficient_changes_with_each_variable_by_its_derivative(coefficient, variable):
    step = 1e-3
    before = coefficients_at(DISTINCT, **AT_REST)
    after = coefficients_at(DISTINCT, **{**AT_REST, variable: step})
    slope = (getattr(after, coefficient) - getattr(before, coefficient)) / step
    name = DERIVATIVES.get((coefficient, variable))
    assert slope == pytest.approx(getattr(DISTINCT, name) if name else 0.0, rel=1e-6, abs=1e-9)


def test_drag_is_lowest_at_its_lift_coefficient():
    polar = {"CD0": 0.03, "K": 0.06, "CL_minD": 0.2}
    assert drag_coefficient(0.2, **polar) == 0.03
    assert drag_coefficient(0.7, **polar) == drag_coefficient(-0.3, **polar) == pytest.approx(0.03 + 0.06 * 0.5**2)


def test_broadside_to_the_flow_the_wing_is_a_flat_plate():
    """At 90 deg CD = CD0 + 2 and there is no lift; at 45 deg lift and drag come from the same normal force."""
    CL, CD = lift_and_drag(DISTINCT, np.pi / 2, 0.0)
    assert (CL, CD) == pytest.approx((0.0, 2.03), abs=1e-9)
    CL, CD = lift_and_drag(DISTINCT, np.pi / 4, 0.0)
    assert CL == pytest.approx(CD - 0.03)
