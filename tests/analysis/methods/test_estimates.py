"""Constructed flights test what covariances contain, and estimates that other tests do not reach."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from constructed import (
    AIRCRAFT,
    PROPELLER,
    RHO,
    S,
    W,
    accelerations_and_decelerations,
    flown,
    m,
    measured,
    polar,
    same_everywhere,
    tables_of,
)

from flightpower.analysis.curve import Condition, Polar, power_required
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods import dynamic
from flightpower.analysis.methods.causes import error_prior_sigma, estimate_errors
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.method import (
    Method,
    MethodEstimate,
    _missing_term,
    estimate_with,
    method_inputs,
)
from flightpower.analysis.methods.methods import fallback
from flightpower.analysis.methods.methods_from_runs import ENERGY, ONE_RUN, VARIED_LIFT
from flightpower.analysis.methods.steady_points import PIW_VIW_THREE, PIW_VIW_TWO
from flightpower.analysis.methods.thrust_prior import thrust_prior
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS, STATES
from flightpower.analysis.trajectory.smoother import StatesGivenErrors

AT = Condition(W, RHO, S)
V = np.array([12.0, 14.0, 17.0, 20.0, 22.5])
SPEEDS = (11.6, 13.5, 16.0, 19.0, 22.8)
PRIOR_SIGMA = error_prior_sigma(AIRCRAFT.uncertainty)


def power(A: np.ndarray) -> np.ndarray:
    return power_required(V, Polar(A, np.zeros((3, 3))), AT)[0]


def power_error(C: np.ndarray) -> np.ndarray:
    return power_required(V, Polar(polar(), C), AT)[1]


def test_the_polar_of_a_cross_check_contains_noise_and_floor() -> None:
    f, _ = accelerations_and_decelerations()
    rng = np.random.default_rng(1)
    CL = 9.81 / f["qS_over_m_mps2"].to_numpy()
    u = {"CL": CL, "CL_squared": CL**2, "qS_over_m": f["qS_over_m_mps2"].to_numpy()}
    u |= dict.fromkeys(("thrust_along_V_over_m", "thrust_beyond_over_m", "J"), 0 * CL)
    drag = u["qS_over_m"] * (polar() @ [CL**0, CL, CL**2]) + 0.01 * rng.standard_normal(len(CL))
    fit = fit_output_error(
        dynamic.drag_model(AIRCRAFT), Segment(name="run", t_s=f.index.to_numpy(), u=u, z={"drag": drag})
    )
    floor = covariance.polar_of(fit).covariance - covariance.of_noise(fit)[:3, :3]
    assert power_error(floor) == pytest.approx(W * V * np.tan(np.radians(0.02)), rel=1e-6)


def test_an_error_of_the_trajectory_is_in_the_covariance_of_every_method() -> None:
    """An error of 0.05 m/s^2 in ax is one of m 0.05 m/s^2 in drag; it adds in quadrature to thrust errors and floor."""
    f, runs = accelerations_and_decelerations()
    trajectory = measured(f)
    C, i = trajectory.covariance.copy(), SENSOR_ERRORS.index("ax_bias")
    C[i, i] = 0.05**2
    trajectory = replace(trajectory, covariance=C)
    flight_forces = FlightForces(trajectory, AIRCRAFT, PROPELLER)
    errors = estimate_errors(flight_forces, trajectory, np.ones(len(f), dtype=bool))
    result = estimate_with(ONE_RUN, method_inputs(flight_forces, trajectory, runs, errors))
    by_trajectory = power_error(result.trajectory_deviations @ result.trajectory_deviations.T)
    assert by_trajectory == pytest.approx(0.05 * m * V, rel=0.03)
    parts = [by_trajectory, power_error(covariance.floor())]
    parts += [power(s) * PRIOR_SIGMA[name] for name, s in result.sensitivities.items()]
    assert len(parts) == 4
    assert power_error(result.systematic) == pytest.approx(np.sqrt(np.sum(np.square(parts), axis=0)), rel=1e-9)


def test_errors_of_trajectory_and_states_are_in_the_dynamic_method_s_covariance() -> None:
    """A change of the estimates due to a sensor error is systematic; a change due to errors of the states is noise."""
    f, runs = accelerations_and_decelerations()
    trajectory = measured(f)
    i, theta = SENSOR_ERRORS.index("ax_bias"), STATES.index("theta")

    def estimated(trajectory):
        return dynamic.estimate_polar(trajectory, runs, AIRCRAFT, PROPELLER)

    exact = estimated(trajectory)
    C, shifted = trajectory.covariance.copy(), trajectory.sensor_errors.copy()
    C[i, i], shifted[i] = 0.05**2, 0.05
    change = estimated(replace(trajectory, sensor_errors=shifted)).values - exact.values
    systematic = estimated(replace(trajectory, covariance=C)).systematic - exact.systematic
    assert systematic == pytest.approx(np.outer(change, change), rel=1e-3, abs=1e-12)
    n, nx = trajectory.states.shape
    instant = int(np.searchsorted(trajectory.states.index, runs[0].start_s + 3.0))
    factor, states = np.full((1, n * nx), 1e16), trajectory.states.copy()
    factor[0, instant * nx + theta], states.iloc[instant, theta] = 1 / 0.01, states.iloc[instant, theta] + 0.01
    change = estimated(replace(trajectory, states=states)).values - exact.values
    noise = estimated(replace(trajectory, states_given_errors=StatesGivenErrors(factor))).noise - exact.noise
    assert power_error(noise[:3, :3]) == pytest.approx(power_error(np.outer(change, change)[:3, :3]), rel=0.05)


def test_errors_of_states_are_not_counted_again_in_the_residuals_they_cause() -> None:
    """Residuals consist of nothing but errors of the states, which are counted as noise once."""
    f, runs = accelerations_and_decelerations()
    flight_data = measured(f)
    theta, rng = STATES.index("theta"), np.random.default_rng(1)
    n, nx = flight_data.states.shape
    states = flight_data.states.assign(theta=flight_data.states["theta"] + 0.01 * rng.standard_normal(n))
    draws = np.zeros((16, n, nx))
    draws[:, :, theta] = 0.01 * rng.standard_normal((16, n))
    factor = np.full((n, nx), 1e16)
    factor[:, theta] = 1 / 0.01
    state_errors = StatesGivenErrors(factor.reshape(1, -1))

    def noise(**changes) -> np.ndarray:
        trajectory = replace(flight_data, states=states, **changes)
        return power_error(dynamic.estimate_polar(trajectory, runs, AIRCRAFT, PROPELLER).noise[:3, :3]) ** 2

    by_residuals, once = noise(), noise(states_given_errors=state_errors, draws=draws)
    by_states = noise(states_given_errors=state_errors) - by_residuals
    fast = slice(2, None)  # at lower speeds most of the noise is from the prior of thrust
    assert np.all(by_states < once)
    assert np.all(once[fast] < (by_states + 0.3 * by_residuals)[fast])


def points(speeds, A: np.ndarray, kind: str, bank: float = 0.0):
    """Return level turns, one per speed, and their runs: lift is W / cos(bank), and columns are divided by mass."""
    n = 1 / np.cos(bank)
    parts, runs = [], []
    for i, speed in enumerate(speeds):
        part = flown(np.full(60, speed), A, RHO, weight_N=W * n).assign(bank=bank)
        part[[c for c in part.columns if c.startswith(("qS_over_m", "thrust_x_over_m"))]] *= n
        part.index = part.index + 100.0 * i
        parts.append(part)
        runs.append(Maneuver(kind, slice(0, 0), part.index[0], part.index[-1], 0.0, 0.0, 0.0))
    return pd.concat(parts), runs


@pytest.mark.parametrize(("method", "kind"), [(PIW_VIW_THREE, "steady"), (ENERGY, "acceleration")])
def test_lift_in_a_turn_is_weight_over_the_cosine_of_bank(method: Method, kind: str) -> None:
    table, runs = points(SPEEDS, polar(), kind, bank=0.4)
    assert method.regression(tables_of(table), runs, AIRCRAFT).coefficients() == pytest.approx(polar(), rel=1e-4)


@pytest.mark.parametrize("CL_minD", [0.2, -0.2])
def test_the_missing_term_is_the_error_of_a_two_term_fit_for_a_CL_minD_of_0_2(CL_minD: float) -> None:
    CL, A = np.linspace(0.3, 1.0, 12), polar(CL_minD)
    X = np.stack([CL**0, CL**2], axis=1)
    (A0, A2), *_ = np.linalg.lstsq(X, A @ [CL**0, CL, CL**2], rcond=None)
    error = np.array([A0, 0.0, A2]) - A
    assert _missing_term(CL, A) == pytest.approx(np.outer(error, error), rel=1e-6)
    table, runs = points(SPEEDS, polar(0.0), "steady")
    inputs = same_everywhere(table, runs)
    two, three = (estimate_with(method, inputs) for method in (PIW_VIW_TWO, PIW_VIW_THREE))
    missing = two.systematic - three.systematic
    assert missing == pytest.approx(
        _missing_term(PIW_VIW_TWO.regression(tables_of(table), runs, AIRCRAFT).CL, polar(0.0))
    )


def test_fallback_knows_how_its_polar_changes_with_thrust() -> None:
    """If the thrust errors were known, only the polar's own covariance would remain; signs fit the polar's change."""
    trajectory = measured(accelerations_and_decelerations()[0])
    sensitivities = {"thrust_scale": np.array([0.05, 0.0, 0.02]), "thrust_slope": np.array([0.0, 0.01, 0.0])}
    shares = {name: np.outer(s, s) * PRIOR_SIGMA[name] ** 2 for name, s in sensitivities.items()}
    own = covariance.floor()
    noise = 1e-8 * np.eye(3)
    C = own + sum(shares.values())
    method_estimate = MethodEstimate(
        PIW_VIW_THREE, Polar(polar(), noise + C), noise, C, sensitivities=sensitivities, flown_CL=(0.3, 1.0)
    )
    result, flown_CL, _ = fallback([method_estimate, MethodEstimate(VARIED_LIFT)], trajectory, AIRCRAFT, "flight.mcap")
    assert flown_CL == (0.3, 1.0)
    assert result.values == pytest.approx([*polar(), 0.0, 0.0])
    for i, name in ((3, "thrust_scale"), (4, "thrust_slope")):
        variance = result.systematic[i, i]
        assert np.sqrt(variance) == pytest.approx(PRIOR_SIGMA[name])
        assert result.systematic[:3, i] / variance == pytest.approx(sensitivities[name])
    errors = [parameter.standard_error for parameter in result.parameters[:5]]
    assert errors == pytest.approx(np.sqrt(np.diag(result.noise + result.systematic)))
    C_thrust = result.systematic[3:, 3:]
    rest = C - result.systematic[:3, 3:] @ np.linalg.inv(C_thrust) @ result.systematic[3:, :3]
    assert rest == pytest.approx(own, abs=1e-15)

    # With thrust measured on a stand, the stand's prior replaces the prior of the table.
    on_stand = replace(AIRCRAFT, propulsion=replace(AIRCRAFT.propulsion, static_thrust_ratio=1.05))
    prior, S = thrust_prior(on_stand), np.stack(list(sensitivities.values()), axis=1)
    after, *_ = fallback([method_estimate, MethodEstimate(VARIED_LIFT)], trajectory, on_stand, "flight.mcap")
    assert after.values == pytest.approx([*(polar() + S @ prior.mean), *prior.mean])
    assert after.systematic == pytest.approx(
        np.block([[own + S @ prior.covariance @ S.T, S @ prior.covariance], [prior.covariance @ S.T, prior.covariance]])
    )
    assert after.polar.covariance == pytest.approx(noise + after.systematic[:3, :3])
