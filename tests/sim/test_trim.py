"""Trim, its limits, and the modes of motion about it."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.flight.aerodynamics import drag_coefficient
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.flight.errors import InputError
from flightpower.sim.drag_shape import DragShape
from flightpower.sim.integration import Stepper
from flightpower.sim.modes import modes
from flightpower.sim.plant import AircraftState, Deviations, plant_of
from flightpower.sim.trim import RESIDUAL_LIMIT, Trimmer, power_required

AIRCRAFT = ("nexstar", "astraeus-ls", "astraeus-hs", "light-1kg", "survey-6kg")


@pytest.mark.parametrize("name", AIRCRAFT)
def test_trim_leaves_no_residual_from_stall_to_top_speed(name):
    trimmer = Trimmer(plant_of(load_aircraft(name)), 100.0)
    for V in np.linspace(1.02 * trimmer.V_stall, 0.999 * trimmer.V_max, 8):
        trim = trimmer.solve(V=V, climb=0.0)
        assert trim.residual < RESIDUAL_LIMIT
        x = trim.state()
        rate = trimmer.plant.derivative(x, trim.commands)
        # Only the position and the battery change, and nothing in the motor does.
        for field in set(AircraftState._fields) - {"north", "east", "energy"}:
            assert abs(getattr(rate, field)) < 1e-6, field


@pytest.mark.parametrize(("climb", "bank_deg"), [(2.0, 0.0), (-1.0, 0.0), (0.0, 40.0), (0.0, -40.0), (1.0, 25.0)])
def test_climbing_and_turning_flight_stays_what_it_was(trimmer, climb, bank_deg):
    trim = trimmer.solve(V=18.0, climb=climb, bank_rad=np.deg2rad(bank_deg))
    assert trim.residual < RESIDUAL_LIMIT
    x = trim.state()
    rate = trimmer.plant.derivative(x, trim.commands)
    assert -rate.down == pytest.approx(climb, abs=1e-9)
    # A level coordinated turn: tan(bank) = V psidot / g, up to the thrust's share of the lift (alpha and climb small).
    assert rate.psi * 18.0 / g == pytest.approx(np.tan(np.deg2rad(bank_deg)), rel=0.03, abs=1e-9)
    stepper = Stepper(trimmer.plant, 0.02)
    stepper.start(x, trim.commands)
    for _ in range(100):
        seen = stepper.step()
    # The density falls by 1e-4 per meter of climb, and trim follows; the spiral mode takes half a minute to show.
    assert seen.V == pytest.approx(18.0, abs=0.01)
    assert seen.phi == pytest.approx(np.deg2rad(bank_deg), abs=0.01)


def test_any_two_of_speed_climb_and_motor_give_the_same_trim(trimmer):
    first = trimmer.solve(V=17.0, climb=1.0).unknowns
    for fixed in ({"V": 17.0, "motor": first.motor}, {"motor": first.motor, "climb": 1.0}):
        again = trimmer.solve(start=first._replace(V=18.0, climb=0.0), **fixed).unknowns
        assert np.allclose(again, first, atol=1e-6)


def test_required_power_is_that_of_the_polar(plant, trimmer):
    """Power is that of (1.5) away from the stall, and that of the trim's thrust if its share of lift is counted in."""
    V = np.linspace(1.3 * trimmer.V_stall, trimmer.V_max, 10)
    power, CL, _ = power_required(plant, V, density=trimmer.density)
    q = trimmer.density * V**2 / 2
    S, W = plant.aircraft.geometry.wing_area_m2, plant.aircraft.mass.weight_N
    aero = plant.aero
    expected = q * S * V * drag_coefficient(W / (q * S), CD0=aero.CD0, K=aero.K, CL_minD=aero.CL_minD)
    assert np.allclose(CL, W / (q * S), rtol=1e-9)
    assert np.allclose(power, expected, rtol=2e-4)  # tanh of 4 widths from the stall
    for item, P in zip(V, power, strict=True):
        trim = trimmer.solve(V=item, climb=0.0)
        now, _ = trimmer.plant.instant(trim.state(), trim.commands)
        flown, _, _ = power_required(
            plant, np.array([item]), density=trimmer.density, weight_N=now.CL * item**2 * trimmer.density / 2 * S
        )
        assert now.train.thrust_N * np.cos(now.alpha) * item == pytest.approx(flown[0], rel=1e-3)
        assert flown[0] == pytest.approx(P, rel=0.05)


def test_the_quartic_in_the_polar_is_in_the_truth(plant, trimmer):
    V = np.array([12.5])
    bent = replace(plant, deviations=Deviations(drag=DragShape(quartic=0.05)))
    (straight, CL, _), (curved, _, _) = (power_required(p, V, density=trimmer.density) for p in (plant, bent))
    qS = trimmer.density * V**2 / 2 * plant.aircraft.geometry.wing_area_m2
    assert curved - straight == pytest.approx(qS * V * 0.05 * (CL - plant.aero.CL_minD) ** 4)


def test_what_cannot_be_trimmed_says_the_limit(trimmer):
    with pytest.raises(InputError, match=rf"too slow.*stalls at {trimmer.V_stall:.2f} m/s"):
        trimmer.solve(V=0.9 * trimmer.V_stall, climb=0.0)
    with pytest.raises(InputError, match=rf"level flight is possible up to {trimmer.V_max:.2f} m/s"):
        trimmer.solve(V=1.1 * trimmer.V_max, climb=0.0)
    with pytest.raises(InputError, match=r"climb needs .* rpm"):
        trimmer.solve(V=16.0, climb=9.0)
    with pytest.raises(InputError, match=r"60 deg of bank: it stalls at"):
        trimmer.solve(V=13.0, climb=0.0, bank_rad=np.deg2rad(60))
    with pytest.raises(InputError, match="cannot glide so steeply"):
        trimmer.solve(V=20.0, climb=-4.0)
    with pytest.raises(InputError, match="exactly two"):
        trimmer.solve(V=13.0)


@pytest.mark.parametrize("name", AIRCRAFT)
def test_the_phugoid_has_lanchesters_period(name):
    """pi sqrt(2) V/g holds for an aircraft that keeps its angle of attack. Ours yields by its pitch damping, which the
    ratio of maneuver margin to static margin accounts for; made ten times stiffer, it does not."""
    plant = plant_of(load_aircraft(name))
    trimmer = Trimmer(plant, 100.0)
    V = 1.7 * trimmer.V_stall
    lanchester = np.pi * np.sqrt(2) * V / g

    def undamped(p):
        result = next(m for m in modes(p, Trimmer(p, 100.0).solve(V=V, climb=0.0)) if m.name == "phugoid")
        return 2 * np.pi / result.natural_frequency_radps

    aero, geometry = plant.aero, plant.aircraft.geometry
    relative_density = trimmer.density * geometry.wing_area_m2 * geometry.chord_m / (4 * plant.mass_kg)
    yielding = np.sqrt((aero.Cma + aero.Cmq * aero.CLa * relative_density) / aero.Cma)
    assert undamped(plant) == pytest.approx(lanchester * yielding, rel=0.05)
    # The aircraft is stiffer about the angle of attack of this very trim, so the elevator need not move.
    alpha = trimmer.solve(V=V, climb=0.0).unknowns.alpha
    stiff = replace(plant, aero=replace(aero, Cma=10 * aero.Cma, Cm0=aero.Cm0 - 9 * aero.Cma * alpha))
    assert undamped(stiff) == pytest.approx(lanchester, rel=0.05)


@pytest.mark.parametrize("name", AIRCRAFT)
def test_modes_are_those_of_an_aeroplane(name):
    trimmer = Trimmer(plant_of(load_aircraft(name)), 100.0)
    by_name = {m.name: m for m in modes(trimmer.plant, trimmer.solve(V=1.6 * trimmer.V_stall, climb=0.0))}
    assert set(by_name) == {"short period", "phugoid", "dutch roll", "roll", "spiral"}
    short, phugoid = by_name["short period"], by_name["phugoid"]
    # The source saw 1.1 Hz on an Astraeus.
    assert 0.8 < short.natural_frequency_radps / (2 * np.pi) < 3
    assert short.natural_frequency_radps > 5 * phugoid.natural_frequency_radps
    for name_of_stable in ("short period", "phugoid", "dutch roll", "roll"):
        assert by_name[name_of_stable].eigenvalue.real < 0
    assert abs(by_name["spiral"].time_constant_s) > 5  # slow, whichever way
