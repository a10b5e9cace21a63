"""The stated uncertainty of the cross-check covers wrong instruments and moving air."""

from dataclasses import replace

import methods
import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Polar, power_required
from flightpower.analysis.maneuvers.find import find
from flightpower.analysis.maneuvers.kinds import ACCELERATION, DECELERATION, Maneuver
from flightpower.analysis.methods.cross_check import CrossCheck, disagreement, on_runs_alone, spread
from flightpower.analysis.methods.settings import CROSS_CHECK
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.sim.sensors import load_budget

SPEEDS_MPS = np.array([14.0, 17.0, 20.0])


@pytest.fixture(scope="module")
def flown(nexstar, probe):
    def fly(seed, turbulence_kt, **wrong):
        errors = methods.draw_errors(load_budget("study"), seed, **wrong)
        return methods.fly(nexstar, probe, errors, "accel-decel", turbulence_kt, seed)

    return fly


def checked(flight, aircraft, propeller):
    """Return the cross-check, and the error of its power in its own standard errors and in percent."""
    runs = find(flight.table, flight.still).of("acceleration", "deceleration")
    check = on_runs_alone(flight.table, runs, aircraft, propeller, gust_mps=0.0, zeroed=True)
    rho = float(np.mean([flight.table["rho"].iloc[run.rows].mean() for run in runs]))
    condition = Condition(aircraft.mass.weight_N, rho, aircraft.geometry.wing_area_m2)
    power, error = power_required(SPEEDS_MPS, check.polar, condition)
    truth = np.interp(SPEEDS_MPS, flight.truth["speed_mps"], flight.truth["power_W"])
    return check, (power - truth) / error, 100 * (power / truth - 1)


@pytest.mark.parametrize("V_scale", [-0.04, 0.04])
def test_an_airspeed_that_is_wrong_is_not_a_thrust_that_is(flown, nexstar, propeller, V_scale):
    """4 % is twice the error of a usual probe. Table thrust at a speed 4 % too high would be 9 to 12 % low."""
    check, deviation, per_cent = checked(flown(1, 0.0, V_scale=V_scale, thrust_scale=0.0), nexstar, propeller)
    assert check.converged
    assert np.abs(deviation).max() < 3
    assert np.abs(per_cent).max() < 6


@pytest.mark.parametrize("turbulence_kt", [0.0, 3.0])
def test_vibration_neither_looks_like_gusts_nor_hides_them(flown, nexstar, propeller, turbulence_kt):
    """Noise of 0.3 m/s2 makes residuals as white as in still air. In gusts there is none, as it gives false alarms."""
    flight = flown(103, turbulence_kt)
    vibration = 0.3 * np.random.default_rng(0).normal(size=(len(flight.table), 3))
    shaken = flight.table.assign(**{f"a{axis}_mps2": flight.table[f"a{axis}_mps2"] + vibration[:, i]
                                    for i, axis in enumerate("xyz")})  # fmt: skip
    runs = find(shaken, flight.still).of("acceleration", "deceleration")
    gust_mps = reconstruct(shaken, flight.still).gust_mps
    check = on_runs_alone(shaken, runs, nexstar, propeller, gust_mps=gust_mps, zeroed=True)
    assert (check is None) == (turbulence_kt > 0)


def test_thrust_on_a_stand_is_a_prior_of_the_cross_check(flown, nexstar, propeller):
    """A nearly exact stand ratio of 1.1 moves power by only a few percent, since the slope absorbs most of it."""
    exact = replace(nexstar.uncertainty, static_thrust_ratio_fraction=1e-4, thrust_curvature_fraction=0.0)
    on_stand = replace(nexstar, propulsion=replace(nexstar.propulsion, static_thrust_ratio=1.1), uncertainty=exact)
    (_, _, without), (_, _, with_stand) = (checked(flown(2, 0.0), item, propeller) for item in (nexstar, on_stand))
    assert np.abs(with_stand - without).max() > 0.1


def test_it_differs_where_the_intervals_do_not_allow_it() -> None:
    condition, flown_CL = Condition(37.7, 1.2, 0.46), (0.3, 1.0)

    def polar(CD0: float) -> Polar:
        return Polar(np.array([CD0, 0.0, 0.06]), np.diag([0.001, 0.0, 0.0]) ** 2)

    def compared(CD0: float, *, converged: bool = True) -> tuple[bool, int]:
        result = disagreement(polar(0.04), CrossCheck(polar(CD0), "no minimum", converged), condition, flown_CL)
        return result.differs, len(result.warnings)

    assert compared(0.0443) == (False, 0)  # limit: sqrt(chi-square of 3 at 95 %) = 2.80, times hypot(1, 1.2): 4.37
    assert compared(0.0445) == (True, 1)
    (warning,) = disagreement(polar(0.04), CrossCheck(polar(0.08), "", True, False), condition, (0.6, 0.6)).warnings
    assert "by +65 %" in warning, "C_D is 0.1016 in place of 0.0616"
    assert compared(0.05, converged=False) == (False, 1)  # left out, with a warning


def test_of_a_long_flight_runs_of_both_kinds_from_beginning_to_end_are_checked() -> None:
    """The runs checked, of 240 in two hours, are evenly spread, and about half of them are decelerations."""
    runs = [
        Maneuver(DECELERATION if i % 2 else ACCELERATION, slice(i, i + 1), 30.0 * i, 30.0 * i + 12, 11.0, 22.0, 0.0)
        for i in range(240)
    ]
    taken = spread(runs)
    index = [runs.index(run) for run in taken]
    assert len(index) == CROSS_CHECK.most_runs and index[0] == 0 and index[-1] == 239
    assert max(np.diff(index)) <= np.ceil(239 / (CROSS_CHECK.most_runs - 1)) and min(np.diff(index)) >= np.floor(
        239 / (CROSS_CHECK.most_runs - 1)
    )
    assert abs(sum(run.kind == DECELERATION for run in taken) - CROSS_CHECK.most_runs / 2) <= CROSS_CHECK.most_runs / 8
    assert spread(runs[: CROSS_CHECK.most_runs]) == runs[: CROSS_CHECK.most_runs]
