"""A single sensor error is named as the cause of the disagreements; without an error there is no disagreement."""

import dataclasses
import re
from importlib import resources
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from methods import Analyzed, analyzed, draw_errors, fly

from flightpower.analysis.curve import Condition, power_required, speed_at
from flightpower.analysis.maneuvers.find import find
from flightpower.analysis.maneuvers.flown import flown_condition, flown_lift
from flightpower.analysis.methods.causes import estimate_errors
from flightpower.analysis.methods.dynamic import estimate_polar
from flightpower.analysis.methods.forces import FlightForces
from flightpower.analysis.methods.method import MethodEstimate
from flightpower.analysis.methods.methods import every_method, fallback
from flightpower.analysis.trajectory.priors import SensorPriors
from flightpower.analysis.trajectory.reconstruction import reconstruct
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.sensors import load_budget

AIRCRAFT = load_aircraft("nexstar")


def analyzed_flight(
    probe, seed: int, plan: str = "accel-decel", errors: str = "bench", W20_kt: float = 0.0, **wrong
) -> Analyzed:
    return analyzed(AIRCRAFT, fly(AIRCRAFT, probe, draw_errors(load_budget(errors), seed, **wrong), plan, W20_kt, seed))


# Each case has one error, several times COMPARISON.installation_sigma, and its own seed.
@pytest.mark.parametrize(
    ("seed", "wrong", "pair", "cause"),
    [
        (10, {"alpha_offset_rad": np.radians(1.5)}, ("dynamic", "direct"), "angle of attack"),
        pytest.param(
            11, {"pitch_tilt": np.radians(-1.5)}, ("dynamic", "direct"), "angle of attack", marks=pytest.mark.thorough
        ),
        (12, {"accel_x_bias": 0.25}, ("dynamic", "direct-speed"), "pitch attitude"),
        pytest.param(13, {"V_scale": 0.05}, ("dynamic", "energy"), "airspeed", marks=pytest.mark.thorough),
        pytest.param(
            14, {"lag_s": 0.2}, ("decelerations", "accelerations"), "air-data lag", marks=pytest.mark.thorough
        ),
        (15, {"thrust_scale": -0.07}, ("decelerations", "accelerations"), "propeller table"),
    ],
)
def test_a_single_error_is_named_and_no_other(probe, seed: int, wrong, pair, cause: str) -> None:
    disagreements = analyzed_flight(probe, seed, **wrong).disagreements
    assert pair in {disagreement.methods for disagreement in disagreements}
    assert {disagreement.culprit for disagreement in disagreements} == {cause}
    for disagreement in disagreements:
        assert abs(disagreement.difference_W) > disagreement.allowed_W
        assert abs(disagreement.shares_W["unexplained"]) < disagreement.allowed_W, "the estimated error must explain it"


def between_accelerations_and_decelerations(probe, seed: int, **wrong) -> str:
    """Return the cause named for the difference between the two kinds of runs, flown in W20 = 3 kt."""
    disagreements = analyzed_flight(probe, seed, W20_kt=3.0, **wrong).disagreements
    (item,) = (
        disagreement for disagreement in disagreements if disagreement.methods == ("decelerations", "accelerations")
    )
    return item.culprit


@pytest.mark.thorough
def test_a_wrong_propeller_table_is_named_in_gusts_of_3_kt(probe) -> None:
    assert between_accelerations_and_decelerations(probe, 15, thrust_scale=-0.07) == "propeller table"


@pytest.mark.thorough
def test_a_lag_is_not_mistaken_for_thrust_in_gusts_of_3_kt(probe) -> None:
    """The lag is named in 10 of 12 flights (seeds 100 to 111); in the other two no cause is named."""
    causes = [between_accelerations_and_decelerations(probe, seed, lag_s=0.2) for seed in (100, 101, 102)]
    assert causes.count("air-data lag") >= 2 and set(causes) <= {"air-data lag", "unexplained"}


@pytest.mark.thorough
@pytest.mark.slow
def test_gusts_are_not_mistaken_for_lag_or_thrust(probe) -> None:
    """In this flight in 3 kt, a lag of 14 ms once looked like 76 ms and thrust 2.3 % too high, by 5 standard errors."""
    errors = draw_errors(load_budget("study"), 1)
    flown = fly(AIRCRAFT, probe, errors, "full-test-flight", 3.0, 1)
    trajectory = reconstruct(flown.table, flown.still, SensorPriors(alpha_scale_sigma=probe.alpha_scale_sigma))
    flight_forces = FlightForces(trajectory, AIRCRAFT, load_propeller(AIRCRAFT.propulsion.propeller))
    rows = np.zeros(len(flight_forces.t_s), dtype=bool)
    for run in find(flown.table, flown.still).of("acceleration", "deceleration"):
        rows |= (flight_forces.t_s >= run.start_s) & (flight_forces.t_s <= run.end_s)
    result = estimate_errors(flight_forces, trajectory, rows)
    lag, thrust = result["lag"], result["thrust_scale"]
    assert abs(lag.value - errors.values.lag_s) < 3 * lag.standard_error
    assert abs(thrust.value - errors.values.thrust_scale) < 3 * thrust.standard_error


@pytest.mark.parametrize(("tilt_deg", "side"), [(1.5, "high"), pytest.param(-1.5, "low", marks=pytest.mark.thorough)])
def test_energy_shows_a_wrong_pitch_of_the_trajectory_with_size_and_sign(probe, tilt_deg: float, side: str) -> None:
    """No estimated error explains the drag on a deliberately tilted trajectory; the tilt follows from W V tilt."""
    flown = fly(AIRCRAFT, probe, draw_errors(load_budget("none"), 0), "accel-decel", 0.0, 0)
    trajectory = reconstruct(flown.table, flown.still)
    states = trajectory.states.assign(theta=trajectory.states["theta"] + np.radians(tilt_deg))
    tilted = dataclasses.replace(trajectory, states=states)
    propeller = load_propeller(AIRCRAFT.propulsion.propeller)
    maneuvers = find(flown.table, flown.still)
    level = maneuvers.of("acceleration", "deceleration")
    estimate = estimate_polar(tilted, level, AIRCRAFT, propeller)
    rows = pd.concat([flown.table.iloc[run.rows] for run in level])
    condition, flown_CL = flown_condition(rows, AIRCRAFT), flown_lift(rows, AIRCRAFT)
    disagreements = every_method(
        tilted, level, AIRCRAFT, propeller, condition, dynamic=estimate, dynamic_CL=flown_CL
    ).disagreements
    (item,) = (disagreement for disagreement in disagreements if disagreement.methods[1] == "energy")
    assert item.culprit == "pitch attitude"
    words = re.search(r"pitch attitude is ([\d.]+) deg too (high|low)", item.text)
    assert words and words[2] == side
    assert float(words[1]) == pytest.approx(abs(tilt_deg), rel=0.3)


@pytest.mark.parametrize(
    ("errors", "seed"),
    [("bench", 20), *(pytest.param(*case, marks=pytest.mark.thorough) for case in (("none", 0), ("bench", 21)))],
)
def test_methods_agree_where_nothing_is_wrong(probe, errors: str, seed: int) -> None:
    assert analyzed_flight(probe, seed, errors=errors).disagreements == []


def worst_error(flight: Analyzed, truth, name: str) -> float:
    """Return the largest error of a method's power at the speeds it saw, relative to the simulator's true power."""
    (estimate,) = (e for e in flight.estimates if e.method.name == name)
    V = speed_at(np.linspace(*estimate.flown_CL, 20), flight.condition)
    power, _ = power_required(V, estimate.polar, flight.condition)
    return float(np.max(np.abs(power / np.interp(V, truth["speed_mps"], truth["power_W"]) - 1)))


@pytest.mark.thorough
@pytest.mark.slow
def test_piw_viw_on_simulated_steady_points_is_within_two_per_cent(probe) -> None:
    """Sensors have bench errors and thrust is 0.5 % off its table; the table's uncertainty only widens the interval."""
    flown = fly(AIRCRAFT, probe, draw_errors(load_budget("bench"), 30, thrust_scale=0.005), "steady-points", 0.0, 30)
    assert worst_error(analyzed(AIRCRAFT, flown), flown.truth, "piw-viw") < 0.02


@pytest.mark.slow
def test_a_wrong_propeller_table_is_named_by_every_pair_that_disagrees(probe, tmp_path: Path) -> None:
    """The flight has two runs and four steady points; the table is 8 % off, all of it within the dynamic interval."""
    plan = tmp_path / "both.toml"
    plan.write_text(with_steady_points(), "utf-8")
    disagreements = analyzed_flight(probe, 40, str(plan), thrust_scale=-0.08).disagreements
    assert {disagreement.culprit for disagreement in disagreements} == {"propeller table"}


def with_steady_points() -> str:
    """Return the demonstration's plan with four steady points, flown back and forth, before its descent."""
    text = (resources.files("flightpower.sim") / "plans" / "accel-decel.toml").read_text("utf-8")
    before, after = text.rsplit('[[segment]]\nkind = "climb"', 1)
    holds = "".join(
        f'[[segment]]\nkind = "turn"\n[[segment]]\nkind = "hold"\nduration = "24 s"\nspeed_over_stall = {share}\n'
        for share in (1.2, 1.5, 1.8, 2.1)
    )
    return f'{before}{holds}[[segment]]\nkind = "climb"{after}'


def test_a_flight_of_maneuvers_alone_has_a_curve_and_one_of_a_single_speed_has_none(probe) -> None:
    """The curve from varied lift contains the truth in its interval, and is within 10 % of it at the middle speed."""
    flown = fly(AIRCRAFT, probe, draw_errors(load_budget("bench"), 31), "maneuvers", 0.0, 31)
    trajectory = reconstruct(flown.table, flown.still)
    propeller = load_propeller(AIRCRAFT.propulsion.propeller)
    rho = float(flown.truth["density_kgpm3"].iloc[0])
    condition = Condition(AIRCRAFT.mass.weight_N, rho, AIRCRAFT.geometry.wing_area_m2)
    maneuvers = find(flown.table, flown.still)

    def estimates(*kinds: str) -> list[MethodEstimate]:
        return every_method(trajectory, maneuvers.of(*kinds), AIRCRAFT, propeller, condition).by_method

    estimate, flown_CL, _ = fallback(
        estimates("steady", "roller coaster", "wind-up turn"), trajectory, AIRCRAFT, "flight.mcap"
    )
    V = speed_at(np.geomspace(flown_CL[0] * 1.1, flown_CL[1] / 1.1, 9), condition)
    power, error = power_required(V, estimate.polar, condition)
    truth = np.interp(V, flown.truth["speed_mps"], flown.truth["power_W"])
    assert np.all(np.abs(power - truth) < 1.96 * error)
    assert abs(power[4] / truth[4] - 1) < 0.1
    with pytest.raises(InputError, match=r"flight.mcap: no acceleration .* 3 different speeds are needed, there are 1"):
        fallback(estimates("steady"), trajectory, AIRCRAFT, "flight.mcap")
