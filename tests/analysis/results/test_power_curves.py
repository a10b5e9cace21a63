"""Tests curves, optimum speeds and the CSV file for a known polar."""

import csv
import io
from types import SimpleNamespace

import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Cost, Polar, polar_curve
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.method import SteadyPoint
from flightpower.analysis.records.flight import ConditionResult, CurveStatus, PowerPoint
from flightpower.analysis.results import curves as power_curves
from flightpower.analysis.results.assemble import _point
from flightpower.analysis.results.files import to_csv

AT = Condition(weight_N=37.7, rho=1.19, wing_area_m2=0.4636)
CD0, K = 0.04, 0.06
POLAR = Polar(np.array([CD0, 0.0, K]), np.diag([0.001**2, 0.0, 0.0]))


def test_the_curve_is_drag_times_speed_with_a_95_percent_interval() -> None:
    """If A0 is known to 0.001, power is known to 0.001 rho V^3 S / 2."""
    points = power_curves.power_curve(POLAR, AT, (0.3, 0.9)).points()
    assert points[0].speed_mps < points[-1].speed_mps
    for point in points:
        qS_N = AT.rho * point.speed_mps**2 / 2 * AT.wing_area_m2
        CL = AT.weight_N / qS_N
        assert 0.3 * (1 - 1e-9) <= CL <= 0.9 * (1 + 1e-9)
        assert point.power_W == pytest.approx(qS_N * (CD0 + K * CL**2) * point.speed_mps)
        half_W = 1.96 * qS_N * 0.001 * point.speed_mps
        assert point.power_hi_W - point.power_W == pytest.approx(half_W, rel=1e-4)
        assert point.power_W - point.power_lo_W == pytest.approx(half_W, rel=1e-4)


def test_a_point_of_a_method_keeps_its_coefficients_at_another_weight_and_density() -> None:
    point = _point(SteadyPoint(CL=0.5, CD=0.06, CD_error=0.002, start_s=7.0), AT)
    qS_N = AT.weight_N / 0.5
    assert AT.rho * point.speed_mps**2 / 2 * AT.wing_area_m2 == pytest.approx(qS_N)
    assert point.power_W == pytest.approx(qS_N * 0.06 * point.speed_mps)
    assert point.power_hi_W is not None and point.power_lo_W is not None and point.start_s == 7.0
    assert point.power_hi_W - point.power_W == pytest.approx(1.96 * qS_N * 0.002 * point.speed_mps, rel=1e-4)
    assert point.power_W - point.power_lo_W == pytest.approx(1.96 * qS_N * 0.002 * point.speed_mps, rel=1e-4)


def test_optimum_speeds_are_those_of_the_textbook_and_marked_outside_the_flown_range() -> None:
    """CDi is 3 CD0 at least power (1.6), and CD0 at least drag (1.10)."""
    slow = polar_curve(POLAR, AT, (0.3, 1.6)).best(Cost.POWER)
    far = polar_curve(POLAR, AT, (0.9, 1.6)).best(Cost.ENERGY_PER_METER)
    for result, CL, inside in ((slow, np.sqrt(3 * CD0 / K), True), (far, np.sqrt(CD0 / K), False)):
        V = np.sqrt(2 * AT.weight_N / (AT.rho * CL * AT.wing_area_m2))
        assert result.speed_mps == pytest.approx(V)
        assert result.lo_mps is not None and result.hi_mps is not None and result.lo_mps < V < result.hi_mps
        assert result.inside_flown_range == inside


def test_an_optimum_slower_than_was_flown_is_not_named() -> None:
    """Least drag is at C_L = 0.82, but 0.7 is the most flown; next, it is just inside but its interval is not."""
    not_flown = polar_curve(POLAR, AT, (0.3, 0.7)).best(Cost.ENERGY_PER_METER)
    assert (not_flown.speed_mps, not_flown.lo_mps, not_flown.inside_flown_range) == (None, None, False)
    assert not_flown.reason == "It lies below the slowest speed flown."
    at_end = polar_curve(POLAR, AT, (0.3, np.sqrt(CD0 / K) + 1e-4)).best(Cost.ENERGY_PER_METER)
    assert at_end.speed_mps is not None and at_end.lo_mps is None and at_end.inside_flown_range
    assert at_end.reason == "The interval reaches below the slowest speed flown."


def test_a_polar_without_an_optimum_has_none() -> None:
    falling = Polar(np.array([-0.01, 0, K]), POLAR.covariance)
    assert polar_curve(falling, AT, (0.3, 0.9)).best(Cost.ENERGY_PER_METER).speed_mps is None


def test_csv_rows_hold_their_condition_speed_power_and_interval() -> None:
    def curve(power_W: float) -> list[PowerPoint]:
        return [
            PowerPoint(
                speed_mps=14.5,
                power_W=power_W,
                power_lo_W=power_W - 2,
                power_hi_W=power_W + 3,
                extrapolated=power_W > 50,
            )
        ]

    results = SimpleNamespace(
        test=ConditionResult(weight_N=37.7, air_density_kgpm3=1.19),
        standard=ConditionResult(weight_N=36.0, air_density_kgpm3=1.225),
        main=SimpleNamespace(points=curve(44.0), standard=curve(55.0)),
    )
    test, standard = csv.DictReader(io.StringIO(to_csv(results, results.standard)))  # type: ignore[arg-type]
    assert test == {
        "condition": "test", "weight_N": "37.7", "air_density_kgpm3": "1.19", "speed_mps": "14.5", "power_W": "44",
        "power_lo_W": "42", "power_hi_W": "47", "extrapolated": "false",
    }  # fmt: skip
    assert (standard["condition"], standard["weight_N"], standard["air_density_kgpm3"]) == ("standard", "36", "1.225")
    assert (standard["power_W"], standard["extrapolated"]) == ("55", "true")


def test_the_two_parts_of_an_interval_are_those_of_their_covariances(nexstar) -> None:
    """A0 has a standard error of 0.001 from noise and of 0.002 from systematic errors."""
    noise, systematic = np.diag([0.001**2, 0, 0, 0, 0]), np.diag([0.002**2, 0, 0, 0, 0])
    estimate = DynamicEstimate(
        polar=Polar(POLAR.A, (noise + systematic)[:3, :3]), parameters=[], status=CurveStatus.CONVERGED, verdict="",
        warnings=[], fits=[], values=np.zeros(5), noise=noise, systematic=systematic,
    )  # fmt: skip
    (part,) = power_curves.interval_parts(estimate, nexstar, AT, np.array([15.0]))
    unit_W = AT.rho * 15.0**3 / 2 * AT.wing_area_m2
    assert (part.noise_W, part.systematic_W) == pytest.approx((1.96 * 0.001 * unit_W, 1.96 * 0.002 * unit_W), rel=1e-4)


def test_the_drag_polar_in_both_forms_is_the_same(nexstar) -> None:
    drag_polar = power_curves.drag_polar(Polar(np.array([0.05, -0.02, 0.06]), np.zeros((3, 3))), nexstar)
    CL = np.array([0.2, 0.6, 1.0])
    assert drag_polar.A0 + drag_polar.A1 * CL + drag_polar.A2 * CL**2 == pytest.approx(
        drag_polar.CD0 + drag_polar.K * (CL - drag_polar.CL_minD) ** 2
    )
    assert drag_polar.oswald_efficiency == pytest.approx(1 / (np.pi * 0.06 * nexstar.aspect_ratio))
    assert drag_polar.maximum_lift_to_drag == pytest.approx(
        np.max(
            np.linspace(0.5, 1.5, 9999)
            / (0.05 - 0.02 * np.linspace(0.5, 1.5, 9999) + 0.06 * np.linspace(0.5, 1.5, 9999) ** 2)
        ),
        rel=1e-6,
    )


def test_the_polar_of_two_terms_is_the_nearest_and_its_interval_that_of_the_polar() -> None:
    """It is exact for A1 = 0. For other A1, a line in C_L^2 is fitted to C_L by least squares."""
    flown = (0.3, 1.1)
    exact = Polar(np.array([0.04, 0.0, 0.06]), np.diag([0.002**2, 0.0, 0.005**2]))
    for result, value, error in zip(
        power_curves.two_term_polar(exact, flown), (0.04, 0.06), (0.002, 0.005), strict=True
    ):
        half = NORMAL_95 * error
        assert (result.value, result.lo, result.hi) == pytest.approx((value, value - half, value + half))
    CL = np.linspace(*flown, 61)
    slope, start = np.polyfit(CL**2, CL, 1)
    curved = Polar(np.array([0.04, -0.02, 0.06]), np.diag([0.0, 0.01**2, 0.0]))
    for results, value, share in zip(
        power_curves.two_term_polar(curved, flown), (0.04, 0.06), (start, slope), strict=True
    ):
        assert results.value == pytest.approx(value - 0.02 * share)
        assert results.hi - results.value == pytest.approx(NORMAL_95 * 0.01 * share)
