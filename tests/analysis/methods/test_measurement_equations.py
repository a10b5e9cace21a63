"""Tests physical facts about the aircraft models at single flight states: lags, scales, thrust and priors."""

import numpy as np
import pytest
from test_aircraft_models import ALL_MODELS, NEXSTAR, RHO

from flightpower.analysis.methods.aircraft_models import Priors, force_models
from flightpower.analysis.methods.dynamic import drag_model
from flightpower.analysis.methods.thrust_prior import J_REFERENCE
from flightpower.flight.aircraft import Uncertainty

m = NEXSTAR.mass_kg


def at_state(model, changed=(), **values):
    """Return (xdot, y) by name at one flight state, by default level at 18 m/s, with parameters at their start."""
    usual = {"V": 18.0, "V_ref": 18.0, "thrust": 6.0, "thrust_per_speed": -0.3, "J": 0.5, "rho": RHO}
    usual |= {"alpha": 0.05, "theta": 0.05, "h": 100.0} | values
    p = {q.name: q.start for q in model.parameters} | {"air_data_lag": 0.0} | dict(changed)
    x, u = [usual.get(s, 0.0) for s in model.states], [usual.get(i, 0.0) for i in model.inputs]
    p = [p[q.name] for q in model.parameters]
    derivative = dict(zip(model.states, model.evaluate_dynamics(x, u, p), strict=True))
    return derivative, dict(zip(model.outputs, model.evaluate_outputs(x, u, p), strict=True))


def test_measured_airspeed_and_angle_lag_behind():
    """In an acceleration, the probe shows the speed as it was one lag earlier."""
    model = ALL_MODELS["level_run"]
    derivative, prompt = at_state(model, thrust=20.0)
    _, late = at_state(model, {"air_data_lag": 0.1}, thrust=20.0)
    assert derivative["V"] > 1
    assert prompt["V"] - late["V"] == pytest.approx(0.1 * derivative["V"])
    assert prompt["alpha"] - late["alpha"] == pytest.approx(0.1 * (derivative["theta"] - derivative["gamma"]))


def test_a_probe_that_reads_airspeed_high_reads_angles_low():
    """An angle is pressure difference over dynamic pressure, so +1 % of airspeed is -2 % of the angle."""
    _, right = at_state(ALL_MODELS["level_run"])
    _, high = at_state(ALL_MODELS["level_run"], {"V_scale": 0.01})
    assert high["V"] / right["V"] == pytest.approx(1.01)
    assert high["alpha"] / right["alpha"] == pytest.approx(0.98)


def test_thrust_is_that_at_the_speed_of_the_state():
    """At -0.3 N s/m, flying 2 m/s faster than the speed at which the table was read takes 0.6 N from the thrust."""
    model = ALL_MODELS["level_run"]
    _, slope = at_state(model, V=20.0)
    _, flat = at_state(model, V=20.0, thrust_per_speed=0.0)
    assert m * (slope["ax"] - flat["ax"]) == pytest.approx(-0.6)


@pytest.mark.parametrize("name", ["two_state", "pitch_and_height", "longitudinal", "level_run"])
def test_errors_of_the_thrust_table(name):
    """A slope of 0.1 adds 2 % of thrust at an advance ratio 0.2 above the reference; a scale of 0.1 adds 10 %."""
    _, right = at_state(ALL_MODELS[name], J=0.7)
    _, sloped = at_state(ALL_MODELS[name], {"thrust_slope": 0.1}, J=0.7)
    _, scaled = at_state(ALL_MODELS[name], {"thrust_scale": 0.1}, J=0.7)
    assert m * (sloped["ax"] - right["ax"]) == pytest.approx(0.02 * 6.0)
    assert m * (scaled["ax"] - right["ax"]) == pytest.approx(0.1 * 6.0)


FORCE_MODELS = force_models(NEXSTAR)


def test_a_search_starts_at_a_usual_aircraft_in_trim():
    """It has a cambered wing of span efficiency 0.8, a fuselage, landing gear, and a static margin of 15 %."""
    start = {q.name: q.start for model in (*ALL_MODELS.values(), FORCE_MODELS) for q in model.parameters}
    AR = NEXSTAR.aspect_ratio
    slope = 2 * np.pi * AR / (2 + np.sqrt(AR**2 + 4))
    assert (start["CL0"], start["CLa"], start["A0"], start["A2"]) == pytest.approx(
        (0.25, slope, 0.04, 1 / (np.pi * 0.8 * AR))
    )
    pitching = (start["Cm0"], start["Cma"], start["Cmq"], start["Cmde"])
    assert pitching == pytest.approx((0.05, -0.15 * slope, -15.0, -1.2))
    assert start["Cma"] / start["CLa"] == pytest.approx(-0.15)
    # Axial and normal force describe the same wing at angles of attack up to 10 deg, to 0.03 in drag.
    for alpha in np.radians([0.0, 5.0, 10.0]):
        CX = start["CX0"] + start["CXa"] * alpha + start["CXa2"] * alpha**2
        CZ = start["CZ0"] + start["CZa"] * alpha + start["CZa2"] * alpha**2
        CL, CD = CX * np.sin(alpha) - CZ * np.cos(alpha), -CX * np.cos(alpha) - CZ * np.sin(alpha)
        assert pytest.approx(0.25 + slope * alpha, abs=0.05) == CL
        assert pytest.approx(0.04 + CL**2 / (np.pi * 0.8 * AR), abs=0.03) == CD
    drag = {q.name: q for q in drag_model(NEXSTAR).parameters}
    assert (drag["A0"].start, drag["A2"].start, drag["thrust_beyond"].prior_sigma) == (0.04, 0.06, 1.0)


def test_priors_of_the_models_are_those_of_the_aircraft_file():
    """An aircraft file without [uncertainty] and a model without stated priors assume the same values."""
    priors, uncertainty = Priors(), Uncertainty()
    assert (priors.alpha_bias_rad, priors.alpha_scale, priors.V_scale, priors.accelerometer_bias_mps2) == pytest.approx(
        (uncertainty.angle_of_attack_offset_rad, uncertainty.angle_of_attack_slope_fraction,
         uncertainty.airspeed_scale_fraction, uncertainty.accelerometer_offset_mps2)
    )  # fmt: skip
    assert (priors.thrust_scale, priors.thrust_slope) == (uncertainty.thrust_scale_fraction, uncertainty.thrust_slope)
    (CZa2,) = (q for q in FORCE_MODELS.parameters if q.name == "CZa2")
    assert CZa2.prior_sigma == 2.0


@pytest.mark.parametrize("name", [*ALL_MODELS, "force_models"])
def test_the_slope_of_thrust_is_about_the_same_advance_ratio_in_all_models(name):
    """Its error changes nothing at J = 0.5, and changes ax twice as much at J = 0.7 as at J = 0.6."""
    model = ALL_MODELS.get(name, FORCE_MODELS)
    outputs = {J: [at_state(model, {"thrust_slope": slope}, J=J)[1] for slope in (0.0, 0.1)] for J in (0.5, 0.6, 0.7)}
    assert J_REFERENCE == 0.5
    change = {J: right["ax"] - without["ax"] for J, (without, right) in outputs.items()}
    assert change[0.5] == pytest.approx(0.0, abs=1e-12)
    assert abs(change[0.6]) > 0.001 and change[0.7] == pytest.approx(2 * change[0.6])
