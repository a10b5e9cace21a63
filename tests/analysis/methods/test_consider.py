"""Intervals contain errors that residuals do not show: thrust beyond the table, weight, updraft."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.curve import Condition, Polar, lift_coefficient, power_required
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.uncertainty import cramer_rao
from flightpower.analysis.methods import consider
from flightpower.analysis.methods.dynamic import INPUTS, drag_model
from flightpower.flight.aircraft import load_aircraft, parse_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller import Propeller, Row

NEXSTAR = load_aircraft("nexstar")
DRAG = drag_model(NEXSTAR)
AT = Condition(NEXSTAR.mass.weight_N, 1.2, NEXSTAR.geometry.wing_area_m2)
A = np.array([0.04, -0.02, 0.06])


def test_noise_is_the_larger_of_both_estimates_of_each_parameter(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short record may hide that its noise is colored; then white noise counts. Correlations are of colored noise."""
    white, colored = np.diag([4.0, 1.0]), np.array([[1.0, 0.6], [0.6, 9.0]])
    for name, covariance in (("cramer_rao", white), ("morelli_klein", colored)):
        monkeypatch.setattr(consider.uncertainty, name, lambda _, of=covariance: SimpleNamespace(covariance=of))
    assert consider.of_noise(None) == pytest.approx(np.array([[4.0, 1.2], [1.2, 9.0]]))  # type: ignore[arg-type]


def straight_table(last_J: float) -> Propeller:
    """Return a propeller table whose thrust is a straight line through zero, so its continuation is exact."""
    J = np.linspace(0.0, last_J, 5)
    return Propeller("straight", 0.3, (Row(6000, tuple(J), tuple(0.2 * (0.88 - J)), tuple(0.1 * (1 - J))),))


def deceleration(table: Propeller, table_error: float = 0.0) -> Segment:
    """Return a deceleration from an advance ratio of 1.15 to 0.5, with a little noise.

    table_error : error of thrust beyond the table, in standard deviations of the continuation
    """
    V = np.linspace(24.0, 12.0, 60)
    CL = lift_coefficient(V, AT)
    qS_over_m = AT.rho * V**2 / 2 * AT.wing_area_m2 / NEXSTAR.mass_kg
    J = np.linspace(1.15, 0.5, 60)
    n = V / (J * table.diameter_m)
    unit = AT.rho * n**2 * table.diameter_m**4 / NEXSTAR.mass_kg
    beyond = table.continuation_error(J, 60 * n) * unit
    u = {
        "CL": CL,
        "CL_squared": CL**2,
        "qS_over_m": qS_over_m,
        "thrust_along_V_over_m": table.coefficients(J, 60 * n)[0] * unit,
        "thrust_beyond_over_m": beyond,
        "J": J,
    }
    noise = 0.01 * np.random.default_rng(1).standard_normal(60)
    drag = qS_over_m * (A[0] + A[1] * CL + A[2] * CL**2) - table_error * beyond + noise
    return Segment(name="d", t_s=0.2 * np.arange(60), u={name: u[name] for name in INPUTS}, z={"drag": drag})


def half_width(last_J: float) -> float:
    """Return the half width of the interval of power at 20 m/s [W], with a table that ends at `last_J`."""
    fit = fit_output_error(DRAG, [deceleration(straight_table(last_J))])
    covariance = cramer_rao(fit).covariance[:3, :3]
    return float(1.96 * power_required([20.0], Polar(A, covariance), AT)[1][0])


def test_the_interval_is_wider_where_the_table_ends_before_the_runs_and_widest_where_it_ends_first() -> None:
    inside, near, far, farthest = (half_width(J) for J in (1.2, 1.05, 0.85, 0.7))
    assert inside < min(near, far) and max(near, far) < farthest
    assert farthest > 1.3 * inside


def test_thrust_that_departs_from_the_line_beyond_the_table_is_covered() -> None:
    """Thrust departs by one standard deviation. Without that term, the fit would be off by more than its interval."""
    fit = fit_output_error(DRAG, [deceleration(straight_table(0.8), table_error=1.0)])
    covariance = cramer_rao(fit).covariance[:3, :3]
    V = np.array([14.0, 18.0, 22.0])
    result, error = power_required(V, Polar(fit.values[:3], covariance), AT)
    true, _ = power_required(V, Polar(A, covariance), AT)
    assert (np.abs(result - true) < 1.96 * error).all()


def test_a_polar_at_another_weight_gives_the_same_power_at_each_speed() -> None:
    heavier = consider.weighing_more(replace(NEXSTAR, uncertainty=replace(NEXSTAR.uncertainty, weight_fraction=0.02)))
    assert heavier.mass.weight_N == pytest.approx(1.02 * NEXSTAR.mass.weight_N)
    nominal = consider.at_nominal_weight(np.array([*A, 0.01, 0.02]), replace(NEXSTAR, uncertainty=heavier.uncertainty))
    V = np.linspace(12, 24, 5)
    there, _ = power_required(V, Polar(A, np.eye(3)), AT._replace(weight_N=heavier.mass.weight_N))
    here, _ = power_required(V, Polar(nominal[:3], np.eye(3)), AT)
    assert here == pytest.approx(there) and nominal[3:].tolist() == [0.01, 0.02]


def test_a_polar_in_denser_air_gives_the_same_power_at_each_speed() -> None:
    aircraft = replace(NEXSTAR, uncertainty=replace(NEXSTAR.uncertainty, air_density_fraction=0.02))
    nominal = consider.at_nominal_density(np.array([*A, 0.01, 0.02]), aircraft)
    V = np.linspace(12, 24, 5)
    there, _ = power_required(V, Polar(A, np.eye(3)), AT._replace(rho=1.02 * AT.rho))
    here, _ = power_required(V, Polar(nominal[:3], np.eye(3)), AT)
    assert here == pytest.approx(there) and nominal[3:].tolist() == [0.01, 0.02]


def test_an_updraft_takes_weight_times_its_speed_off_the_power() -> None:
    V = np.array([12.0, 18.0, 24.0])
    CL, qS = lift_coefficient(V, AT), AT.rho * V**2 / 2 * AT.wing_area_m2
    forces = pd.DataFrame({"CD": A[0] + A[1] * CL + A[2] * CL**2, "CL": CL, "V": V})
    still = consider.without_updraft(forces, 0.05)
    assert ((still["CD"] - forces["CD"]) * qS * V).to_numpy() == pytest.approx(0.05 * AT.weight_N)
    assert consider.without_updraft(forces, 0.0)["CD"].equals(forces["CD"])


def test_priors_are_read_from_the_aircraft_file_and_have_defaults() -> None:
    text = NEXSTAR.text + 'weight = "0.5 %"\nupdraft = "2 cm/s"\nhysteresis = "0.1 %"\n'
    uncertainty = parse_aircraft(text, "mine.toml").uncertainty
    assert (uncertainty.weight_fraction, uncertainty.updraft_mps, uncertainty.hysteresis_fraction) == pytest.approx(
        (0.005, 0.02, 0.001)
    )
    assert (NEXSTAR.uncertainty.weight_fraction, NEXSTAR.uncertainty.updraft_mps) == (0.002, 0.004)
    with pytest.raises(InputError, match=r"mine.toml: uncertainty.weight: must not be negative"):
        parse_aircraft(text.replace("0.5 %", "-1 %"), "mine.toml")
    with pytest.raises(InputError, match=r"mine.toml: uncertainty.thrust_scale: must be greater than zero"):
        parse_aircraft(text.replace('"1.8 %"', '"0 %"'), "mine.toml")
