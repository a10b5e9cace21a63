"""A stand's measurement makes the prior of the thrust errors a correlated, conditional normal distribution."""

from dataclasses import replace

import msgspec
import numpy as np
import pandas as pd
import pytest
from constructed import PROPELLER, accelerations_and_decelerations, measured

from flightpower.analysis.air.flight_data import Calibrations
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.model import PriorMeasurement
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.methods.causes import _thrust_errors
from flightpower.analysis.methods.dynamic import INPUTS, drag_model, estimate_polar
from flightpower.analysis.methods.rejected_assumptions import rejected_assumptions
from flightpower.analysis.methods.thrust_prior import J_REFERENCE, stand_conflict, thrust_prior
from flightpower.analysis.pages.exports.derived import _by_thrust_table
from flightpower.analysis.results.assemble import pooling_statistics
from flightpower.analysis.results.flight_found import static_thrust
from flightpower.flight.aircraft import Aircraft, Uncertainty, load_aircraft
from flightpower.flight.errors import InputError

NEXSTAR = load_aircraft("nexstar")
A = np.array([0.045, -0.02, 0.065])
SCALE, SLOPE = 0.01, -0.04


def on_stand(ratio: float, **uncertainty: float) -> Aircraft:
    return replace(
        NEXSTAR,
        propulsion=replace(NEXSTAR.propulsion, static_thrust_ratio=ratio),
        uncertainty=replace(NEXSTAR.uncertainty, **uncertainty),
    )


def fitted(aircraft: Aircraft, noise_mps2: float = 0.02, slope: float = SLOPE, scale: float = SCALE) -> Fit:
    """Return the fit of a deceleration of 60 blocks, with errors of thrust and noise in drag."""
    rng = np.random.default_rng(4)
    V = np.linspace(23.0, 12.0, 60)
    qS_over_m = 0.07 * V**2
    CL, J = 9.81 / qS_over_m, np.linspace(0.85, 0.45, 60)
    thrust = 1.0 + np.cos(np.arange(60) / 7)
    drag = qS_over_m * (A @ [CL**0, CL, CL**2]) - thrust * (scale + slope * (J - J_REFERENCE))
    u = dict(zip(INPUTS, (CL, CL**2, qS_over_m, thrust, 0 * V, J), strict=True))
    z = {"drag": drag + noise_mps2 * rng.standard_normal(60)}
    return fit_output_error(drag_model(aircraft), Segment(name="run", t_s=0.2 * np.arange(60), u=u, z=z))


def test_the_prior_is_the_conditional_distribution_of_two_independent_errors_given_their_combination() -> None:
    """The closed form holds for jointly normal x = (scale, slope), y = scale - slope/2 + e (Bishop 2006, 2.81-82)."""
    prior = thrust_prior(on_stand(1.03, static_thrust_ratio_fraction=0.01, thrust_curvature_fraction=0.02))
    s2, k2 = 0.018**2, 0.15**2
    y2 = s2 + k2 / 4 + (1.03 * 0.01) ** 2 + 0.02**2
    assert prior.mean == pytest.approx([s2 * 0.03 / y2, -k2 / 2 * 0.03 / y2])
    expected = [[s2 - s2**2 / y2, s2 * k2 / 2 / y2], [s2 * k2 / 2 / y2, k2 - k2**2 / 4 / y2]]
    assert prior.covariance == pytest.approx(np.array(expected))
    assert prior.information @ prior.covariance == pytest.approx(np.eye(2), abs=1e-9)
    assert prior.information @ prior.mean == pytest.approx(prior.vector)


def test_without_a_stand_the_priors_are_independent() -> None:
    prior = thrust_prior(NEXSTAR)
    assert prior.mean.tolist() == [0, 0] and prior.covariance == pytest.approx(np.diag([0.018**2, 0.15**2]))
    assert drag_model(NEXSTAR).prior_measurements == ()


def test_a_flight_is_estimated_as_by_the_correlated_prior() -> None:
    """The estimate solves the normal equations with the prior's information, and its covariance is their inverse."""
    aircraft = on_stand(1.05)
    fit, alone = fitted(aircraft), fitted(NEXSTAR)
    prior = thrust_prior(aircraft)
    (of_fit,) = fit.segment_fits
    u = of_fit.segment.u
    columns = [u["qS_over_m"], u["qS_over_m"] * u["CL"], u["qS_over_m"] * u["CL"] ** 2]
    columns += [-u["thrust_along_V_over_m"], -u["thrust_along_V_over_m"] * (u["J"] - J_REFERENCE)]
    X, variance = np.stack(columns, axis=1), fit.noise_covariance[0, 0]
    information, vector = X.T @ X / variance, X.T @ of_fit.segment.z["drag"] / variance
    information[3:, 3:] += prior.information
    vector[3:] += prior.vector
    assert fit.values[:5] == pytest.approx(np.linalg.solve(information, vector), rel=1e-4)
    assert fit.covariance[:5, :5] == pytest.approx(np.linalg.inv(information), rel=1e-4)
    assert fit.covariance[4, 4] < 0.6 * alone.covariance[4, 4]
    assert np.linalg.eigvalsh(alone.covariance[:5, :5] - fit.covariance[:5, :5]).min() > -1e-6


def test_a_parameter_that_is_fixed_counts_with_its_value() -> None:
    """With the scale fixed at 0.01, the stand measures only the slope and acts as its prior."""
    measurement = PriorMeasurement(
        name="stand", coefficients={"thrust_scale": 1, "thrust_slope": -0.5}, value=0.03, sigma=0.02
    )
    model = drag_model(NEXSTAR).changed(thrust_scale={"start": 0.01, "free": False})
    by_stand = replace(model, prior_measurements=(measurement,))
    no_own = {"thrust_slope": {"prior_sigma": np.inf}}
    as_prior = model.changed(thrust_slope={"prior_mean": -0.04, "prior_sigma": 0.04})
    segments = [segment_fit.segment for segment_fit in fitted(NEXSTAR).segment_fits]
    result, expected = (fit_output_error(m, segments) for m in (by_stand.changed(**no_own), as_prior))
    assert result.values == pytest.approx(expected.values, rel=1e-6)
    assert result.covariance == pytest.approx(expected.covariance, rel=1e-6)
    assert result.negative_log_likelihood == pytest.approx(expected.negative_log_likelihood, rel=1e-9)


def test_a_stand_that_the_flight_contradicts_is_named_and_widens_the_interval() -> None:
    """The flight's scale of 0.01 and slope of -0.04 give 1.03 of the table's thrust at rest; the stand says 1.4."""
    wrong, right = (fitted(on_stand(ratio), noise_mps2=0.002) for ratio in (1.4, 1.03))
    assert not rejected_assumptions(right)
    (rejected,) = rejected_assumptions(wrong)
    assert "thrust at rest, against the stand" in rejected.warning and "repeat the measurement" in rejected.warning
    assert abs(rejected.change[4]) > np.sqrt(wrong.covariance[4, 4])


def test_a_thrust_outside_the_95_percent_of_its_prior_adds_all_of_its_correction_to_the_interval() -> None:
    """A wrong weight has the same effect, so the table may still be right. 8 % of thrust is reported; 1 % is not."""
    (rejected,) = rejected_assumptions(fitted(NEXSTAR, noise_mps2=0.002, scale=0.08))
    assert rejected.change[3] == pytest.approx(-0.08, abs=0.01) and "Check the weight" in rejected.warning
    assert not rejected_assumptions(fitted(NEXSTAR, noise_mps2=0.002))


def test_results_have_the_stand_for_pools_and_thrust_at_rest(probe) -> None:
    f, runs = accelerations_and_decelerations()
    aircraft = on_stand(1.1, static_thrust_ratio_fraction=1e-4, thrust_curvature_fraction=0.0)
    estimate = estimate_polar(measured(f), runs, aircraft, PROPELLER)
    thrust = static_thrust(estimate)
    assert (thrust.value, thrust.standard_error) == pytest.approx((1.1, 1.1e-4), rel=0.02)
    statistics = pooling_statistics(estimate, (0.3, 1.0), aircraft, PROPELLER, Calibrations(probe))
    assert statistics is not None
    (prior_measurement,) = statistics.prior_measurements or []
    assert prior_measurement.coefficients == {"thrust_scale": 1.0, "thrust_slope": -0.5}
    assert (prior_measurement.value, prior_measurement.sigma) == pytest.approx((0.1, 1.1e-4))
    without = pooling_statistics(
        estimate_polar(measured(f), runs, NEXSTAR, PROPELLER), (0.3, 1.0), NEXSTAR, PROPELLER, Calibrations(probe)
    )
    assert b"prior_measurements" not in msgspec.json.encode(without), "without a stand there is no such field"


def test_thrust_that_is_not_corrected_is_off_by_what_the_stand_says() -> None:
    """With an exact scale and stand, the slope takes all: thrust is off by 10 % at J = 0, and not at J = 0.5."""
    exact = {"static_thrust_ratio_fraction": 1e-6, "thrust_curvature_fraction": 0.0, "thrust_scale_fraction": 1e-6}
    f = pd.DataFrame({"J": [0.0, 0.5], "thrust_beyond_over_m_mps2": 0.0, "qS_over_m_mps2": 10.0})
    nominal = np.array([[0.05, 15.0, 0.05, 8.0, 0.6, 0.05]] * 2)
    variance_N2 = _by_thrust_table(nominal, f, on_stand(1.1, **exact))[:, 0]
    assert np.sqrt(variance_N2) == pytest.approx([0.8, 0.0], abs=1e-3)


def test_errors_that_explain_disagreements_have_the_stand() -> None:
    rng, n = np.random.default_rng(0), 400
    V = 18.0 + 6.0 * np.sin(np.arange(n) / 20)
    qS_over_m = 0.07 * V**2
    CL = 9.81 / qS_over_m
    drag = qS_over_m * (A @ [CL**0, CL, CL**2]) + 0.02 * rng.standard_normal(n)
    columns = {"CL": CL, "CL_squared": CL**2, "CD": drag / qS_over_m, "qS_over_m_mps2": qS_over_m}
    forces = pd.DataFrame(columns | {"J": 0.6 + 0.01 * (V - 18)})
    forces["thrust_along_V_over_m_mps2"] = 3.0 + np.cos(np.arange(n) / 20)
    exact = on_stand(1.1, static_thrust_ratio_fraction=1e-4, thrust_curvature_fraction=0.0)
    for rows in (n, 5):  # 5 samples are too few, and the prior is returned
        thrust_errors = _thrust_errors(forces[:rows], exact)
        assert thrust_errors["thrust_scale"].value - thrust_errors["thrust_slope"].value / 2 == pytest.approx(
            0.1, abs=1e-3
        )


def test_a_ratio_beyond_the_priors_of_the_table_is_doubted() -> None:
    assert not stand_conflict(1.15, 0.01, Uncertainty())
    assert "+2.6 of the standard deviations assumed (8.3 %)" in stand_conflict(1.22, 0.01, Uncertainty())


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"sigma": 0.0}, "sigma must be greater than zero"),
        ({"coefficients": {}}, "must be finite numbers"),
        ({"coefficients": {"lift": 1.0}}, "'lift' must be a shared parameter"),
    ],
)
def test_a_prior_measurement_that_means_nothing_is_refused(changed: dict[str, object], message: str) -> None:
    arguments: dict[str, object] = {"name": "stand", "coefficients": {"A0": 1.0}, "value": 0.0, "sigma": 1.0}
    with pytest.raises(InputError, match=message):
        replace(drag_model(NEXSTAR), prior_measurements=(PriorMeasurement(**(arguments | changed)),))  # type: ignore[arg-type]
