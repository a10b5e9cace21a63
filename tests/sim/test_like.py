"""An aircraft of one's own that flies like a model, and errors that stay with an installation."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.flight.aerodynamics import aerodynamics_of
from flightpower.flight.aircraft import aircraft_text, parse_aircraft
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.sim.fly import fly
from flightpower.sim.like import oswald_factor, scaled_from, with_installation
from flightpower.sim.plan import parse_plan
from flightpower.sim.plant import plant_of
from flightpower.sim.sensors import budget as budgets
from flightpower.sim.sensors import draw, load_budget
from flightpower.sim.trim import Trimmer

SMALL = """
name = "small"
[geometry]
span = "1.2 m"
wing_area = "0.2 m^2"
[mass]
weight = "0.9 kg"
[propulsion]
propeller = "apc-10x5e"
"""
LARGE = """
name = "large"
[geometry]
span = "3.2 m"
wing_area = "1.3 m^2"
[mass]
weight = "12 kg"
[propulsion]
propeller = "blade-16x10"
"""
ACCELERATION = """
[[segment]]
kind = "run"
throttle = 0.9
speed_of_max = 0.8
"""


@pytest.fixture(scope="module")
def model():
    return load_complete_aircraft("nexstar")


def test_a_model_scaled_to_itself_is_itself(model):
    text, where = aircraft_text("nexstar")
    assert replace(scaled_from(text, where, model), text=text) == model
    four = "\n".join(
        ['name = "x"', "[geometry]", 'span = "5.73 ft"', 'wing_area = "4.99 ft^2"', "[mass]", 'weight = "8.47 lbf"']
    )
    scaled = scaled_from(four, "x.toml", model)
    assert scaled.propulsion == model.propulsion and scaled.probe == model.probe
    assert scaled.geometry.chord_m == pytest.approx(model.geometry.chord_m)
    assert scaled.mass.Iy_kgm2 == pytest.approx(model.mass.Iy_kgm2)


@pytest.mark.parametrize("text", [SMALL, LARGE], ids=["small", "large"])
def test_lengths_and_inertias_scale_as_their_dimensions(text, model):
    own = scaled_from(text, "own.toml", model)
    length = own.geometry.span_m / model.geometry.span_m
    radii = [a.mass.Iy_kgm2 / a.mass_kg / a.geometry.span_m**2 for a in (own, model)]
    assert radii[0] == pytest.approx(radii[1])
    assert own.probe.position_m == pytest.approx([length * x for x in model.probe.position_m])
    assert own.geometry.chord_m * own.geometry.span_m / own.geometry.wing_area_m2 == pytest.approx(
        model.geometry.chord_m * model.geometry.span_m / model.geometry.wing_area_m2
    )


def test_a_slender_wing_has_less_induced_drag_and_the_text_says_so(model):
    """Twice the aspect ratio at the same area halves K; e and all other coefficients stay as they were."""
    slender = SMALL.replace("1.2 m", f"{1.2 * 2**0.5:.9f} m")
    own, other = (scaled_from(text, "own.toml", model) for text in (SMALL, slender))
    K, of_other = (aerodynamics_of(a).K for a in (own, other))
    assert of_other == pytest.approx(K / 2) and own.aspect_ratio == pytest.approx(7.2)
    assert K == pytest.approx(0.065 * model.aspect_ratio / 7.2)
    assert oswald_factor(own) == pytest.approx(oswald_factor(other)) == pytest.approx(oswald_factor(model))
    assert replace(aerodynamics_of(other), K=K) == aerodynamics_of(own) != aerodynamics_of(model)
    assert f"# Induced drag K = {of_other:.4f}: 1/(pi e AR), AR 14.40, e 0.744 of nexstar.\n" in other.text


def test_coefficients_that_the_file_has_are_kept_and_the_others_are_the_model_s(model):
    own = scaled_from(f"{SMALL}[aerodynamics]\nCD0 = 0.03\n", "own.toml", model)
    assert replace(aerodynamics_of(own), CD0=0.045) == aerodynamics_of(scaled_from(SMALL, "own.toml", model))
    assert aerodynamics_of(own).CD0 == 0.03
    listed = [line.removeprefix("#   ") for line in own.text.splitlines()]
    assert "aerodynamics.Cma" in listed and "aerodynamics.CD0" not in listed
    scaled = scaled_from(f"{SMALL}[aerodynamics]\nK = 0.05\n", "own.toml", model)
    assert aerodynamics_of(scaled).K == 0.05 and "Induced drag" not in scaled.text


@pytest.mark.parametrize("text", [SMALL, LARGE], ids=["small", "large"])
def test_it_has_thrust_and_speed_to_spare_and_flies(text, model):
    own = scaled_from(text, "own.toml", model)
    of_own, of_model = Trimmer(plant_of(own), 100.0), Trimmer(plant_of(model), 100.0)
    assert of_own.V_max / of_own.V_stall > 0.8 * of_model.V_max / of_model.V_stall
    truth = fly(own, parse_plan(ACCELERATION, "acceleration")).truth
    assert truth["V_mps"].iloc[-1] > truth["V_mps"].iloc[0] and np.abs(np.diff(truth["height_m"])).max() < 1.0


def test_what_the_file_says_is_kept_and_the_rest_is_listed(model):
    own = scaled_from(SMALL + "pole_pairs = 6\n", "own.toml", model)
    assert own.propulsion.pole_pairs == 6 and own.propulsion.propeller == "apc-10x5e"
    listed = {line.removeprefix("#   ") for line in own.text.splitlines() if line.startswith("#   ")}
    assert {"mass.Ix", "elevator", "aerodynamics.CLa", "propulsion.battery_energy"} <= listed
    assert not {"propulsion.pole_pairs", "propulsion.propeller", "mass.weight"} & listed
    own_aircraft = parse_aircraft(own.text, "own.toml")
    assert own_aircraft.aerodynamics == {} or own_aircraft.aerodynamics is None
    assert own_aircraft.mass.Ix_kgm2 is None


def test_the_log_of_an_installation_has_its_name(model):
    named = with_installation(model, "may")
    assert parse_aircraft(named.text, "named.toml").installation.name == "may"
    assert with_installation(named, "may") is named
    with pytest.raises(InputError, match="may"):
        with_installation(named, "june")


def test_errors_of_the_installation_stay_and_those_of_the_day_change():
    budget = load_budget("harsh")
    first, second = (budgets.of_installation(draw(budget, seed), draw(budget, 99)) for seed in (1, 2))
    assert np.array_equal(first.imu_rotation, second.imu_rotation)
    for name in ("alpha_offset_rad", "V_scale", "thrust_scale", "lag_s", "weight_scale"):
        assert getattr(first.values, name) == getattr(second.values, name) != 0
    assert first.values.updraft_mps != second.values.updraft_mps
    assert not np.array_equal(first.accel_bias, second.accel_bias) and first.zero != second.zero
    assert first.seed != second.seed
