"""From thrust to the battery, against the simulator's motor, which is written independently."""

from dataclasses import replace

import numpy as np
import pytest
from motor_data import RHO, recorded, steady_points

from analysis.performance.power_train import METER_SCALE_SIGMA, fit_power_train
from analysis.performance.propagation import from_sigma_points
from analysis.performance.propeller_speed import corrected_thrust, revps_for_thrust
from sim.propulsion import throttle_for

NO_CORRECTION = {"thrust_scale": 0.0, "thrust_slope": 0.0}


def test_the_speed_of_rotation_found_gives_the_thrust_asked_for(propeller) -> None:
    V, thrust = np.meshgrid(np.linspace(8, 28, 9), np.linspace(0.5, 12, 8))
    scale, slope = 0.03, -0.1
    n = revps_for_thrust(propeller, V, thrust, RHO, thrust_scale=scale, thrust_slope=slope)
    given = corrected_thrust(propeller, V, n, RHO, thrust_scale=scale, thrust_slope=slope)
    _, shaft = propeller.thrust_and_power(V, n, RHO)
    assert given == pytest.approx(thrust, rel=1e-8)
    assert np.all(shaft > thrust * V * 0.9), "a propeller cannot give more than it takes, the correction aside"


def test_a_thrust_no_speed_of_rotation_gives_has_none(propeller) -> None:
    assert np.isnan(revps_for_thrust(propeller, 15.0, 1e5, RHO))


def predicted(train, propeller, V, n):
    """The battery's power at speeds and motor speeds, (estimate, standard error)."""
    _, shaft = propeller.thrust_and_power(V, n, RHO)
    return from_sigma_points(train.battery_power(shaft, n, train.parameters.sigma_points()))


def elsewhere(nexstar, propeller):
    """Points that no steady point was flown at, and what the battery truly gives there."""
    V = np.array([11.0, 15.0, 18.0, 21.0, 23.5])
    n = V / (np.array([0.50, 0.64, 0.60, 0.68, 0.64]) * propeller.diameter_m)
    truth = recorded(nexstar, propeller, V, n, throttle_for(nexstar.propulsion, propeller, V=V, n=n, rho=RHO))
    return V, n, truth["battery_W"].to_numpy()


def test_losses_fitted_to_steady_points_hold_at_other_points(nexstar, propeller) -> None:
    """Without noise: priors pull by nothing worth a watt."""
    train = fit_power_train(steady_points(nexstar, propeller), nexstar.propulsion, propeller, **NO_CORRECTION)
    assert train.measured
    V, n, truth = elsewhere(nexstar, propeller)
    assert predicted(train, propeller, V, n).value == pytest.approx(truth, rel=0.005)
    for point in train.efficiencies:
        assert point.overall == pytest.approx(point.propeller * point.motor, rel=1e-9)
        assert 0.4 < point.overall < point.motor < 1


def test_what_a_propeller_that_speeds_up_stores_is_not_called_loss(nexstar, propeller) -> None:
    """A motor that speeds up slowly stores energy; the fit must not take that for friction."""
    data = steady_points(nexstar, propeller)
    steady = fit_power_train(data, nexstar.propulsion, propeller, **NO_CORRECTION).parameters
    heavy = replace(nexstar.propulsion, propeller_inertia_kgm2=2e-3)
    n = data["n"].to_numpy() * (1 + 0.01 * np.sin(np.arange(len(data)) / 25))  # 0.2 rad/s: within what is slow
    moving = recorded(nexstar, propeller, data["V"].to_numpy(), n, data["throttle"].to_numpy())
    held = throttle_for(nexstar.propulsion, propeller, V=moving["V"], n=n, rho=RHO)
    moving = recorded(nexstar, propeller, moving["V"].to_numpy(), n, held)
    stored = (2 * np.pi) ** 2 * heavy.propeller_inertia_kgm2 * n * np.gradient(n, 0.2)
    moving["battery_W"] += stored
    found = fit_power_train(moving, heavy, propeller, **NO_CORRECTION).parameters
    V, at, truth = elsewhere(nexstar, propeller)
    for parameters in (steady, found):
        train = replace(fit_power_train(data, heavy, propeller, **NO_CORRECTION), parameters=parameters)
        assert predicted(train, propeller, V, at).value == pytest.approx(truth, rel=0.01)


def test_intervals_cover_as_often_as_they_say(nexstar, propeller) -> None:
    """40 flights: table off by 5 % in power, the meter by 2 %, noise of half an ampere that lasts 1 s.

    95 % within 3 standard errors of a binomial share of 40 x 5 points that err together: the effective number is 40.
    """
    data = steady_points(nexstar, propeller)
    V, n, truth = elsewhere(nexstar, propeller)
    rng = np.random.default_rng(3)
    hits = []
    for _ in range(40):
        table_scale, meter = 1 + 0.05 * rng.standard_normal(), 1 + METER_SCALE_SIGMA * rng.standard_normal()
        off = replace_power(propeller, 1 / table_scale)
        noise = np.convolve(rng.standard_normal(len(data) + 4), np.ones(5) / np.sqrt(5), mode="valid") * 0.5 * 14
        seen = data.assign(battery_W=data["battery_W"] * meter + noise)
        train = fit_power_train(seen, nexstar.propulsion, off, **NO_CORRECTION)
        found = predicted(train, off, V, n)
        hits.append((found.lo <= truth) & (truth <= found.hi))
    assert np.mean(hits) >= 0.95 - 3 * np.sqrt(0.95 * 0.05 / 40)


def replace_power(propeller, factor):
    """The same propeller with a table whose power coefficients are off by a factor."""
    rows = tuple(replace(row, cP=tuple(factor * c for c in row.cP)) for row in propeller.rows)
    return type(propeller)("off", propeller.diameter_m, rows)


def test_without_battery_data_the_aircraft_file_is_believed_and_that_is_said(nexstar, propeller) -> None:
    blind = steady_points(nexstar, propeller).assign(battery_W=np.nan)
    train = fit_power_train(blind, nexstar.propulsion, propeller, **NO_CORRECTION)
    assert not train.measured and train.efficiencies == ()
    assert "no battery voltage" in train.basis and "560 rpm/V" in train.basis
    V, n, truth = elsewhere(nexstar, propeller)
    found = predicted(train, propeller, V, n)
    assert np.all((found.lo <= truth) & (truth <= found.hi))
    measured = fit_power_train(steady_points(nexstar, propeller), nexstar.propulsion, propeller, **NO_CORRECTION)
    assert np.all(found.standard_error > 1.5 * predicted(measured, propeller, V, n).standard_error)


def test_a_few_seconds_are_no_measurement(nexstar, propeller) -> None:
    data = steady_points(nexstar, propeller, seconds=5.0).iloc[:20]
    train = fit_power_train(data, nexstar.propulsion, propeller, **NO_CORRECTION)
    assert not train.measured and "Only" in train.basis
