"""Assumed values widen the interval by the effect of their standard deviations, and by nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Polar, power_required, speed_at
from flightpower.analysis.methods.assumed_values import (
    AssumptionUncertainty,
    _folding_note,
    assumption_uncertainty,
    with_assumption_uncertainty,
)
from flightpower.analysis.methods.dynamic import DynamicEstimate
from flightpower.analysis.methods.settings import COVARIANCE
from flightpower.analysis.records.flight import CurveStatus, ParameterResult
from flightpower.analysis.trajectory.priors import upwash_slope_sigma
from flightpower.analysis.trajectory.settings import PRIORS
from flightpower.flight.aircraft import parse_aircraft

FOUR_KEYS = """
name = "mine"
[geometry]
span = "1.75 m"
wing_area = "0.46 m^2"
[mass]
weight = "4 kg"
"""
A = np.array([0.05, -0.02, 0.065])
OWN = np.diag([1e-6, 1e-6, 1e-6, 3e-4, 2e-2])
AT, FLOWN_CL = Condition(39.2, 1.2, 0.46), (0.2, 1.0)


def estimate(values, covariance=OWN):
    names = ("A0", "A1", "A2", "thrust_scale", "thrust_slope", "V_scale")
    parameters = [ParameterResult(name=name, value=0.0, standard_error=0.0, unit="") for name in names]
    return DynamicEstimate(
        polar=Polar(values[:3], covariance[:3, :3]),
        parameters=parameters,
        status=CurveStatus.CONVERGED,
        verdict="",
        warnings=[],
        fits=[],
        values=values,
        noise=covariance / 2,
        systematic=covariance / 2,
    )


class Rerun:
    """A0 grows by 0.01 per meter of probe position, A1 by 0.02 per meter of IMU position, A2 with upwash."""

    def estimate(self, aircraft, propeller, slope_sigma):
        values = np.array([*A, 0.0, 0.0])
        values[2] += 0.1 * aircraft.probe.upwash_per_CL_rad
        values[0] += 0.01 * aircraft.probe.position_m[0]
        values[1] += 0.02 * aircraft.imu_position_m[0]
        return estimate(values, OWN * (1 + slope_sigma))

    def values(self, aircraft, propeller, slope_sigma):
        return self.estimate(aircraft, propeller, slope_sigma).values


def test_without_missing_keys_nothing_is_added(nexstar, propeller):
    assert assumption_uncertainty(Rerun(), nexstar, propeller, AT, FLOWN_CL) is None
    assert upwash_slope_sigma(nexstar) == 0.0
    complete = estimate(np.array([*A, 0.0, 0.0]))
    assert with_assumption_uncertainty(complete, None) is complete


def test_the_change_by_one_standard_deviation_is_squared_into_the_covariance(propeller):
    uncertainty = assumption_uncertainty(Rerun(), parse_aircraft(FOUR_KEYS, "mine.toml"), propeller, AT, FLOWN_CL)
    assert uncertainty is not None
    wanted = np.zeros((5, 5))
    wanted[0, 0] = (0.01 * PRIORS.probe_ahead_m) ** 2
    wanted[2, 2] = (0.1 * PRIORS.upwash_rad) ** 2
    wanted[1, 1] = (0.02 * COVARIANCE.imu_position_m) ** 2
    assert uncertainty.covariance == pytest.approx(wanted, abs=1e-15)


def test_the_notes_say_what_stands_in_and_by_how_much_the_key_would_narrow_the_interval(propeller):
    own_aircraft = parse_aircraft(FOUR_KEYS + '[probe]\nupwash_per_CL = "1 deg"\n', "mine.toml")
    uncertainty = assumption_uncertainty(Rerun(), own_aircraft, propeller, AT, FLOWN_CL)
    assert uncertainty is not None
    (probe_note,) = (note for note in uncertainty.notes if "probe.position" in note)
    V = np.array([speed_at(FLOWN_CL[1], AT)])
    widths = []
    for key in ("", '[probe]\nposition = ["0.3 m", "0 m", "0 m"]\nupwash_per_CL = "1 deg"\n'):
        aircraft = parse_aircraft(FOUR_KEYS + key, "") if key else own_aircraft
        added = assumption_uncertainty(Rerun(), aircraft, propeller, AT, FLOWN_CL)
        widened = with_assumption_uncertainty(estimate(np.array([*A, 0.0, 0.0])), added)
        widths.append(power_required(V, widened.polar, AT)[1][0])
    assert f"{100 * (1 - widths[1] / widths[0]):.0f} % narrower" in probe_note
    assert not any("upwash" in note for note in uncertainty.notes)


def test_widening_adds_to_the_systematic_part_alone():
    before = estimate(np.array([*A, 0.0, 0.0]))
    by = AssumptionUncertainty(np.diag([4e-6, 0.0, 0.0, 0.0, 0.0]), [])
    after = with_assumption_uncertainty(before, by)
    assert after.systematic - before.systematic == pytest.approx(by.covariance)
    assert after.polar.covariance[0, 0] == pytest.approx(5e-6)
    assert np.array_equal(after.noise, before.noise) and np.array_equal(after.polar.A, before.polar.A)
    assert (
        after.parameters[0].standard_error == pytest.approx(np.sqrt(5e-6))
        and after.parameters[5] == before.parameters[5]
    )


def test_unknown_upwash_is_a_slope_of_angle_of_attack(nexstar):
    """1 deg of upwash per CL times a lift slope of 4.5 per rad (aspect ratio 6.6) is 8 % of slope."""
    own_aircraft = parse_aircraft(FOUR_KEYS, "mine.toml")
    assert upwash_slope_sigma(own_aircraft) == pytest.approx(np.radians(1) * 4.5, rel=0.05)
    slender = replace(own_aircraft, geometry=replace(own_aircraft.geometry, span_m=3.5))
    assert upwash_slope_sigma(slender) > upwash_slope_sigma(own_aircraft)


@pytest.mark.parametrize(("span_m", "lift_slope"), [(1e5, 2 * np.pi), (1e-3, np.pi / 2 * 1e-6 / 0.46), (1.75, 4.673)])
def test_the_slope_by_unknown_upwash_is_upwash_times_the_lift_slope_of_the_wing(span_m, lift_slope):
    """The lift slope a is 2 pi for an endless wing, pi/2 AR for a wing of vanishing span (Jones), and 4.673 for an
    aspect ratio of 6.66 (Helmbold). An angle alpha gives the lift coefficient a alpha, so a alpha deg of upwash."""
    own_aircraft = parse_aircraft(FOUR_KEYS, "mine.toml")
    wing = replace(own_aircraft, geometry=replace(own_aircraft.geometry, span_m=span_m))
    assert upwash_slope_sigma(wing) == pytest.approx(np.radians(1) * lift_slope, rel=2e-3)


def test_known_upwash_narrows_the_interval_by_its_change_and_by_its_slope(propeller):
    """`Rerun` has the covariance OWN (1 + sigma). With upwash known, sigma is zero and A2 no longer changes."""
    own_aircraft = parse_aircraft(FOUR_KEYS, "mine.toml")
    uncertainty = assumption_uncertainty(Rerun(), own_aircraft, propeller, AT, FLOWN_CL)
    assert uncertainty is not None
    (note,) = (note for note in uncertainty.notes if "probe.upwash_per_CL" in note)
    V = np.array([speed_at(FLOWN_CL[1], AT)])

    def standard_error(covariance):
        return power_required(V, Polar(A, covariance[:3, :3]), AT)[1][0]

    without = standard_error(OWN * (1 + upwash_slope_sigma(own_aircraft)) + uncertainty.covariance)
    part = np.zeros((5, 5))
    part[2, 2] = (0.1 * PRIORS.upwash_rad) ** 2
    narrower = standard_error(OWN + uncertainty.covariance - part)
    assert f"{100 * (1 - narrower / without):.0f} % narrower" in note


@pytest.mark.parametrize(("share", "expected"), [(0.004, False), (-0.03, True), (0.03, True)])
def test_what_folding_would_change_is_reported_with_its_sign(share, expected):
    notes = _folding_note(share, 12.3)
    assert bool(notes) == expected
    assert not expected or notes[0].endswith(f"power at 12.3 m/s changes by {'-' if share < 0 else '+'}3 %.")
