"""Whole flights: one motion from standing to standing, what the source observed, and plans that cannot be flown."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.interpolate import CubicSpline

from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.motion import earth_from_body
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan, parse_plan, shipped_plans
from flightpower.sim.sensors import draw, load_budget
from flightpower.sim.truth import read_truth, write_truth

AIRBORNE_HEAD = 'title = "t"\nheight = "100 m"\nspeed_over_stall = 1.6\n'


def fly_text(nexstar, text, **how):
    return fly(nexstar, parse_plan(text, "mine"), **how)


def part(flight, index):
    return flight.truth[flight.truth["segment"] == index]


def test_the_truth_is_one_motion_from_standing_to_standing(flight):
    """Position, velocity, attitude, rates and specific force of every row belong together, as derivatives of splines
    show: on the ground, on the way up, in flight and on the way down."""
    truth = flight.truth
    t = truth["time_s"].to_numpy()
    assert np.allclose(np.diff(t), 0.02)
    inner = slice(5, -5)

    def rate(column):
        return CubicSpline(t, truth[column].to_numpy())(t, 1)[inner]

    for position, velocity, sign in (("north_m", "north", 1), ("east_m", "east", 1), ("height_m", "down", -1)):
        assert np.allclose(rate(position), sign * truth[f"velocity_{velocity}_mps"][inner], atol=2e-3)
    attitude = [truth[name].to_numpy() for name in ("roll_rad", "pitch_rad", "yaw_rad")]
    force = [truth[f"specific_force_{axis}_mps2"].to_numpy() for axis in "xyz"]
    on_earth = earth_from_body(force, attitude)
    # Where throttle or servo has a corner the force has one as well, and a spline is off by a step times the change of
    # slope.
    for direction, f, gravity in zip(("north", "east", "down"), on_earth, (0, 0, 9.80665), strict=True):
        error = rate(f"velocity_{direction}_mps") - (f + gravity)[inner]
        assert np.sqrt(np.mean(error**2)) < 0.01
        assert np.max(np.abs(error)) < 0.6
    phi, theta = attitude[0][inner], attitude[1][inner]
    q = truth["q_radps"].to_numpy()[inner]
    r = truth["r_radps"].to_numpy()[inner]
    assert np.allclose(rate("pitch_rad"), q * np.cos(phi) - r * np.sin(phi), atol=0.01)
    assert np.allclose(rate("yaw_rad") * np.cos(theta), q * np.sin(phi) + r * np.cos(phi), atol=0.01)


def test_the_battery_gives_all_flight_long_what_voltage_and_current_say(flight):
    truth = flight.truth
    power = (truth["battery_voltage_V"] * truth["battery_current_A"]).to_numpy()
    assert np.all(np.diff(truth["battery_energy_J"]) >= 0)
    assert truth["battery_energy_J"].iloc[-1] == pytest.approx(np.sum(power) * 0.02, rel=0.01)


def test_what_nobody_knows_on_the_ground_is_nan(flight):
    truth = flight.truth
    assert truth.loc[truth["phase"] != "flight", "CL"].isna().all()
    assert not truth.loc[truth["phase"] == "flight"].isna().any().any()
    assert set(truth["phase"]) == {"ground", "take-off", "flight", "land"}


def test_same_seed_same_flight(nexstar):
    text = AIRBORNE_HEAD + '[air]\nturbulence = "6 m/s"\n[[segment]]\nkind = "hold"\nduration = "3 s"\n'
    item, again, other = (fly_text(nexstar, text, seed=s).truth for s in (1, 1, 2))
    pd.testing.assert_frame_equal(item, again)
    assert not np.allclose(item["V_mps"], other["V_mps"], atol=0.01)


@pytest.mark.parametrize("name", shipped_plans())
def test_every_shipped_plan_can_be_read(name):
    plan = load_plan(name)
    assert plan.title
    kinds = [segment.kind for segment in plan.segments]
    assert kinds[0] == kinds[-1] == "stand"  # zeros of the sensors at both ends
    assert ("land" in kinds) == ("take-off" in kinds)


def test_the_whole_test_flight_is_what_it_says(nexstar):
    flight = fly(nexstar, load_plan("full-test-flight"))
    runs = [group for _, group in flight.truth[flight.truth["kind"] == "run"].groupby("segment")]
    faster = [r for r in runs if r["V_mps"].iloc[-1] > r["V_mps"].iloc[0]]
    assert len(faster) == 6 and len(runs) == 11
    assert runs[-1]["throttle"].iloc[-1] == 1.0
    for run in runs:
        assert run["time_s"].iloc[-1] - run["time_s"].iloc[0] < 20  # shorter than 20 s, which is the point
        assert np.ptp(run["height_m"]) < 1.0
        assert np.ptp(run["V_mps"]) > 9
    headings = [round(float(np.cos(r["yaw_rad"].mean() - runs[0]["yaw_rad"].mean()))) for r in faster]
    assert headings[:5] == [1, -1, 1, -1, 1]
    steady = [
        g.iloc[-750:] for _, g in flight.truth[flight.truth["kind"] == "hold"].groupby("segment") if len(g) > 1000
    ]
    assert len(steady) == 7
    for point in steady:
        assert np.std(point["V_mps"]) < 0.15 and np.ptp(point["height_m"]) < 0.5


def test_a_deceleration_pitches_slowly_and_by_some_degrees(nexstar):
    """The source has 8 deg in 20 s, from its own speeds down, in as long a run as its throttle allowed."""
    flight = fly(nexstar, load_plan("case-1"))
    run = next(
        g
        for _, g in flight.truth[flight.truth["kind"] == "run"].groupby("segment")
        if g["V_mps"].iloc[-1] < g["V_mps"].iloc[0]
    )
    pitch = np.rad2deg(run["pitch_rad"].to_numpy())
    assert 5 < pitch[-1] - pitch[0] < 13
    assert np.rad2deg(run["q_radps"].abs().max()) < 6.8  # the source's peak, seen in an acceleration


def test_the_sources_own_runs_on_its_own_aircraft():
    """The source has 8 deg of pitch in a deceleration of 20 s, and at most 6.8 deg/s in an acceleration. Its throttle
    and its speeds are not printed in what we have of it, so it is matched within a sixth."""
    truth = fly(load_aircraft("astraeus-hs"), load_plan("long-deceleration")).truth
    faster, slower = (run for _, run in truth[truth["kind"] == "run"].groupby("segment"))
    assert np.rad2deg(faster["q_radps"].abs().max()) == pytest.approx(6.8, rel=1 / 6)
    assert len(slower) * 0.02 == pytest.approx(20, rel=1 / 6)
    pitch = np.rad2deg(slower["pitch_rad"].to_numpy())
    assert pitch[-1] - pitch[0] == pytest.approx(8, rel=1 / 6)
    assert np.rad2deg(slower["q_radps"].abs().max()) < 1.0  # slow enough to leave the pitch rate out


def test_a_throttle_step_pitches_the_aircraft_and_a_ramp_less(nexstar):
    flight = fly(nexstar, load_plan("throttle-step"))
    step, ramp = (g for _, g in flight.truth[flight.truth["kind"] == "run"].groupby("segment"))
    first = slice(0, 100)
    assert step["q_radps"][first].abs().max() > 1.5 * ramp["q_radps"].iloc[first].abs().max()


@pytest.mark.parametrize(("name", "change"), [("returns", 0.0), ("higher", 1.0), ("lower", -1.0)])
def test_case_2_ends_where_it_says(nexstar, name, change):
    flight = fly(nexstar, load_plan(f"case-2-{name}"))
    for _, run in flight.truth[flight.truth["kind"] == "run"].groupby("segment"):
        height = run["height_m"].to_numpy()
        if change:
            assert (height[-1] - height[0]) * change > 3
        else:
            assert np.ptp(height) > 2 * abs(height[-1] - height[0])
            assert np.ptp(height) > 2


def test_a_turn_ends_on_the_opposite_heading(nexstar):
    text = (
        AIRBORNE_HEAD + '[[segment]]\nkind = "turn"\nangle = "180 deg"\n[[segment]]\nkind = "turn"\nangle = "-90 deg"\n'
    )
    truth = fly_text(nexstar, text).truth
    ends = [np.rad2deg(g["yaw_rad"].iloc[-1]) for _, g in truth.groupby("segment")]
    assert ends == pytest.approx([180, 90], abs=4)
    assert np.ptp(truth["height_m"]) < 3


def test_the_roller_coaster_and_the_wind_up_turn_pull_what_they_should(nexstar):
    flight = fly(nexstar, load_plan("maneuvers"))
    truth = flight.truth
    load = {
        kind: -truth.loc[truth["kind"] == kind, "specific_force_z_mps2"] / 9.80665
        for kind in ("roller-coaster", "wind-up-turn", "3-2-1-1")
    }
    assert load["roller-coaster"].min() == pytest.approx(0.4, abs=0.15)
    assert load["roller-coaster"].max() == pytest.approx(1.6, abs=0.15)
    assert load["wind-up-turn"].max() == pytest.approx(1.8, abs=0.2)
    elevator = truth.loc[truth["kind"] == "3-2-1-1", "elevator_command_rad"].to_numpy()[: round(7 * 0.4 / 0.02)]
    assert np.ptp(elevator) == pytest.approx(2 * np.deg2rad(3), rel=0.02)
    assert np.sum(np.abs(np.diff(elevator)) > np.deg2rad(3)) == 3  # 3, 2, 1, 1


def test_a_porpoising_aircraft_swings_its_angle_of_attack_but_hardly_its_speed_and_height(nexstar):
    plan = parse_plan('[[segment]]\nkind = "porpoise"\nduration = "20 s"\nspeed_over_stall = 1.5\n', "porpoise")
    truth = fly(nexstar, plan).truth.query("time_s > 2")
    alpha = np.rad2deg(truth["alpha_rad"])
    assert np.ptp(alpha) > 6
    assert np.ptp(truth["V_mps"]) < 0.05 * truth["V_mps"].mean()
    assert np.ptp(truth["height_m"]) < 2
    crossings = np.flatnonzero(np.diff(np.sign(alpha - alpha.mean()))) * 0.02
    assert np.diff(crossings)[:4].mean() == pytest.approx(1.8 / 2, rel=0.1)  # half periods
    assert np.diff(crossings)[-4:].mean() == pytest.approx(1.3 / 2, rel=0.1)


def test_a_sluggish_pilot_holds_height_worse_than_a_good_one(nexstar):
    hold = '[[segment]]\nkind = "hold"\nduration = "5 s"\nspeed_over_stall = 1.3\n'
    run = '[[segment]]\nkind = "run"\nthrottle = 1.0\nspeed_of_max = 0.95\nramp = "0 s"\n'
    body = AIRBORNE_HEAD + "{pilot}\n" + hold + run
    swing = {
        pilot: np.ptp(part(fly_text(nexstar, body.replace("{pilot}", f'pilot = "{pilot}"')), 1)["height_m"])
        for pilot in ("good", "low-gain", "high-gain")
    }
    assert swing["low-gain"] > 2 * swing["good"]
    assert swing["high-gain"] < swing["low-gain"]


def test_the_errors_of_the_day_change_the_aircraft_that_flies(nexstar):
    text = AIRBORNE_HEAD + '[[segment]]\nkind = "hold"\nduration = "6 s"\n'
    errors = draw(load_budget("harsh"), 3)
    flight = fly_text(nexstar, text, deviations=errors.deviations)
    plain = fly_text(nexstar, text)
    assert flight.plant.mass_kg == pytest.approx(plain.plant.mass_kg * (1 + errors.values.weight_scale))
    assert flight.power_required["weight_N"].iloc[0] == pytest.approx(flight.plant.mass_kg * 9.80665)
    # The truth to find is that of the aircraft that flew, heavier or lighter and with its own polar.
    assert not np.allclose(flight.power_required["power_W"], plain.power_required["power_W"], rtol=1e-4)


def test_the_truth_file_comes_back(tmp_path, flight):
    path = tmp_path / "truth.parquet"
    write_truth(path, flight.truth, flight.metadata, flight.power_required)
    truth, metadata = read_truth(path)
    pd.testing.assert_frame_equal(truth, flight.truth)
    assert metadata["aircraft"] == "nexstar"
    pd.testing.assert_frame_equal(pd.DataFrame(metadata["power_required"]), flight.power_required)


@pytest.mark.parametrize("content", [b"", b"PAR1 nonsense PAR1"])
def test_what_is_no_truth_file_says_so(tmp_path, content):
    path = tmp_path / "truth.parquet"
    path.write_bytes(content)
    with pytest.raises(InputError, match="not the truth of a simulated flight"):
        read_truth(path)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            '[[segment]]\nkind = "hold"\nduration = "5 s"\nspeed = "9 m/s"\n',
            r"segment 1 \(hold\).*too slow.*stalls at 10\.\d+ m/s",
        ),
        (
            '[[segment]]\nkind = "hold"\nduration = "5 s"\nspeed = "60 m/s"\n',
            r"segment 1 \(hold\).*too fast.*reaches \d+\.\d+ m/s",
        ),
        ('[[segment]]\nkind = "climb"\nheight = "200 m"\nclimb = "12 m/s"\n', r"segment 1 \(climb\).*rpm"),
        (
            '[[segment]]\nkind = "roller-coaster"\nhighest = 4.0\n',
            r"load factor of 4\.00 stalls the aircraft.*limit is",
        ),
        ('[[segment]]\nkind = "take-off"\n[[segment]]\nkind = "stand"\nduration = "1 s"\n', "segment 2.*in the air"),
        ('[[segment]]\nkind = "stand"\nduration = "1 s"\n[[segment]]\nkind = "turn"\n', "segment 2.*on the ground"),
    ],
)
def test_a_plan_that_cannot_be_flown_says_what_and_the_limit(nexstar, text, expected):
    with pytest.raises(InputError, match=expected) as caught:
        fly_text(nexstar, text)
    assert "\n" not in str(caught.value)


def test_a_flight_that_diverges_stops_with_time_and_state(nexstar):
    text = (
        AIRBORNE_HEAD.replace("speed_over_stall = 1.6\n", "")
        + '[pilot]\npitch = -3.0\n[[segment]]\nkind = "hold"\nduration = "60 s"\n'
    )
    with pytest.raises(InputError, match=r"(diverges|hits the ground) at \d+\.\d+ s: V = .*alpha = .*height"):
        fly_text(nexstar, text)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "has no"),
        ('[[segment]]\nkind = "loop"\n', "loop.*is not one of"),
        ("[[segment]]\n", "None.*is not one of"),
        ('[[segment]]\nkind = "stand"\n', "duration is missing"),
        ('[[segment]]\nkind = "stand"\nduration = "20 m"\n', "duration"),
        ('[[segment]]\nkind = "stand"\nduration = 20\n', "duration"),
        ('[[segment]]\nkind = "stand"\nduration = "20 s"\nspeed = 3\n', "unknown key 'speed'"),
        ('[[segment]]\nkind = "repeat"\ntimes = 0\n', "times"),
        ('[[segment]]\nkind = "repeat"\ntimes = 2\n', "has no"),
        ('pilot = "ace"\n[[segment]]\nkind = "stand"\nduration = "1 s"\n', "ace.*good"),
        ('[pilot]\nskil = 1\n[[segment]]\nkind = "stand"\nduration = "1 s"\n', "skil"),
        ('[air]\nwind = "3 m"\n[[segment]]\nkind = "stand"\nduration = "1 s"\n', "wind"),
        ('integrator = "magic"\n[[segment]]\nkind = "stand"\nduration = "1 s"\n', "magic"),
        ("[[segment\n", "TOML"),
        ("segment = 3\n", "has no"),
    ],
)
def test_a_broken_plan_is_one_clear_line(text, expected):
    with pytest.raises(InputError, match=expected) as caught:
        parse_plan(text, "mine")
    assert str(caught.value).startswith("plan mine") or "pilot" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_plan_lists_those_there_are():
    with pytest.raises(InputError, match=r"accel-decel.*full-test-flight"):
        load_plan("aerobatics")


def test_euler_flies_nearly_the_same_flight(nexstar):
    """Euler in place of RK4 changes power by less than 0.5 %; the flights themselves stay together."""
    text = AIRBORNE_HEAD + '{}\n[[segment]]\nkind = "run"\nthrottle = 1.0\nspeed_of_max = 0.9\n'
    ends = [
        fly(nexstar, replace(parse_plan(text.replace("{}", ""), "mine"), integrator=i)).truth.iloc[-1]
        for i in ("rk4", "euler")
    ]
    assert ends[0]["time_s"] == pytest.approx(ends[1]["time_s"], abs=0.05)
    assert ends[0]["alpha_rad"] == pytest.approx(ends[1]["alpha_rad"], abs=np.deg2rad(0.1))
