"""Runs reported good or lost on the aircraft: the criteria of the analysis, on synthetic flights."""

import dataclasses
import math
from itertools import pairwise
from statistics import NormalDist

import numpy as np
import pytest

from flightpower.analysis.methods import thrust_prior
from flightpower.daq import energy_balance, run_monitor
from flightpower.daq.energy_balance import EnergyBalance, PowerInterval, inverted
from flightpower.daq.legs import KEPT_ROWS, Legs, Row
from flightpower.daq.run_monitor import JudgedRun, RunMonitor
from flightpower.daq.sensors import Sample
from flightpower.daq.thrust import load_thrust
from flightpower.daq.tick_means import Means, TickMeans
from flightpower.flight.aircraft import Uncertainty, load_aircraft
from flightpower.flight.messages import DifferentialPressure, Rpm, Status
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.runs import LEVEL_RUN, Rejection, RunRejected
from flightpower.flight.units import GRAVITY_MPS2

NEXSTAR = load_aircraft("nexstar")
PRESSURE_PA, KELVIN, RHO = 101325.0, 288.15, 1.225
ZERO_PA = 3.0  # of the airspeed transducer


def means_at(t_s: float, V: float, height_m: float, *, bank_rate: float = 0.0, n: float | None = 80.0) -> Means:
    """Means of a level aircraft's sensors; with no bank rate the wings are level."""
    kelvin = KELVIN - 0.0065 * height_m
    static = PRESSURE_PA * (kelvin / KELVIN) ** 5.25588
    rho = static / (287.05287 * kelvin)
    return Means(
        t_s=t_s, q_c_Pa=ZERO_PA + rho / 2 * V**2, dp_alpha_Pa=0.0, dp_beta_Pa=0.0, static_Pa=static,
        static_temperature_K=KELVIN, ax_mps2=0.0, ay_mps2=0.0, az_mps2=-GRAVITY_MPS2, p_radps=0.0, q_radps=0.0,
        r_radps=bank_rate, n_revps=n,
    )  # fmt: skip


def notified(
    *, over_s=14.0, V=(12.0, 22.0), climb_mps=0.0, height_m=60.0, turn_radps=0.0, n=80.0, aircraft=NEXSTAR
) -> list[str]:
    """The texts that the pilot gets for a speed change between two steady flights, after ten seconds on the ground."""
    monitor, texts = RunMonitor(aircraft, None), []
    seconds = 10 + 8 + over_s + 8
    for i in range(round(seconds / 0.2)):
        t = 0.2 * (i + 0.5)
        share = min(max((t - 18) / over_s, 0.0), 1.0)
        flying = t > 10
        speed = V[0] + (V[1] - V[0]) * share if flying else 0.0
        height = height_m + climb_mps * over_s * share if flying else 0.0
        motor = (None if 0 < share < 1 else 80.0) if n is None else n
        turn = turn_radps if 0.3 < share < 0.9 else 0.0
        texts += monitor.texts(means_at(t, speed, height, bank_rate=turn, n=motor if flying else 0.0))
    return [text for _, text in texts]


def test_a_level_acceleration_is_good_and_its_speeds_are_reported():
    good, interval = notified()
    assert good.startswith("acceleration good: 1") and good.endswith(("m/s in 14 s", "m/s in 15 s"))
    low, high = (float(word) for word in good.split(": ")[1].replace(" m/s in", "").split()[:3:2])
    assert (low, high) == pytest.approx((12.0, 22.0), abs=0.6)  # the zero of the transducer was taken at rest
    assert interval.startswith("1 runs, 1") and max(map(len, (good, interval))) <= 50


@pytest.mark.parametrize(
    ("flown", "why"),
    [
        ({"climb_mps": 1.5}, "climbed 21 m"),  # 14 s
        ({"climb_mps": -1.5}, "sank 21 m"),
        ({"over_s": 2.0}, "3.0 s, not 5 s"),
        ({"over_s": 41.0, "V": (12.0, 37.0)}, "long"),
        ({"height_m": 12.0}, "down to 12 m"),
        ({"n": None}, "no data"),
    ],
)
def test_a_run_that_the_analysis_would_reject_has_to_be_repeated(flown, why):
    (text,) = notified(**flown)
    assert text.startswith("acceleration lost: ") and why in text and text.endswith("; repeat") and len(text) <= 50


def progress_in(V, seconds, *, climb_mps=0.0) -> list:
    """(time, progress) of a change of speed that begins after eight seconds of level flight."""
    monitor, progress = RunMonitor(NEXSTAR, None), []
    for i in range(round((18 + seconds + 8) / 0.2)):
        t = 0.2 * (i + 0.5)
        changing_s = min(max(t - 18, 0.0), seconds)
        flying = t > 10
        speed = V[0] + (V[1] - V[0]) * changing_s / seconds if flying else 0.0
        monitor.add(means_at(t, speed, 60 + climb_mps * changing_s if flying else 0.0, n=80.0 if flying else 0.0))
        if t > 17:
            progress.append((t - 18, monitor.progress()))
    return [(t, now) for t, now in progress if now is not None]


@pytest.mark.parametrize(("V", "kind"), [((12.0, 22.0), "acceleration"), ((22.0, 12.0), "deceleration")])
def test_the_pilot_is_reported_how_long_to_hold_a_run(V, kind):
    """The time left runs down with the clock, and a run that was held as long as reported is good."""
    progress = progress_in(V, 14.0)
    left = [(t, now.more_s) for t, now in progress if now.more_s > 0]
    assert {now.kind for _, now in progress} == {kind} and all(len(now.text) <= 50 for _, now in progress)
    assert len(left) > 5 and all(later < earlier for (_, earlier), (_, later) in pairwise(left))
    held_s = [t + more_s for t, more_s in left]
    assert max(held_s) < 8.0 and min(held_s) > LEVEL_RUN.shortest_s - 1.0
    assert [now.more_s for t, now in progress if 9 < t < 13] == pytest.approx([0.0] * 20)
    assert not [now for t, now in progress if t > 17], "speed is held"
    change = V[1] - V[0]
    good, _ = notified(V=(V[0], V[0] + change * max(held_s) / 14), over_s=max(held_s))
    assert good.startswith(f"{kind} good")


def test_a_run_that_climbs_too_steeply_is_not_encouraged():
    assert progress_in((12.0, 22.0), 14.0) and not progress_in((12.0, 22.0), 14.0, climb_mps=1.8)


def test_a_light_aircraft_s_runs_may_be_shorter_and_lower():
    """Times and heights scale with the speed at a lift coefficient of 1: 6.7 m/s, not 11."""
    light = load_aircraft("light-1kg")
    scale = math.sqrt(2 * light.mass.weight_N / light.geometry.wing_area_m2 / RHO) / 11.0
    assert scale == pytest.approx(0.61, abs=0.01)
    flown = {"V": (7.0, 13.0), "aircraft": light}
    assert notified(**flown, over_s=3.5)[0].startswith("acceleration good")
    assert notified(**flown, over_s=3.5, height_m=15.0)[0].startswith("acceleration good")
    assert "down to 9 m" in notified(**flown, over_s=3.5, height_m=9.0)[0]
    assert "not 3 s" in notified(**flown, over_s=1.0)[0]
    assert "sank 11 m" in notified(**flown, over_s=12.0, climb_mps=-0.9)[0], "as steep as an approach"


def test_smoothing_and_advance_ratio_are_those_of_the_analysis():
    """Both take their criteria from `flight.runs`."""
    assert (2 * run_monitor.HALF + 1) * run_monitor.STEP_S == pytest.approx(LEVEL_RUN.smoothing_s)
    assert energy_balance.J_REFERENCE == thrust_prior.J_REFERENCE


def flown(rows, aircraft=NEXSTAR) -> list[str]:
    """The texts that the pilot gets for (V, height, turn) five times a second, after ten seconds on the ground; None is
    a gap."""
    monitor, texts = RunMonitor(aircraft, None), []
    for i, row in enumerate([(0.0, 0.0, 0.0)] * 50 + list(rows)):
        if row is not None:
            texts += monitor.texts(
                means_at(0.2 * (i + 0.5), row[0], row[1], bank_rate=row[2], n=80.0 if i >= 50 else 0.0)
            )
    return [text for _, text in texts if not text[0].isdigit()]


LEVEL = [(12.0, 60.0, 0.0)] * 40 + [(12 + 0.14 * i, 60.0, 0.0) for i in range(50)]  # 12 to 19 m/s in 10 s


@pytest.mark.parametrize("turn_radps", [0.0, 0.8])
def test_a_run_ends_where_a_steep_climb_or_a_turn_begins(turn_radps):
    """Speed goes on rising, with 3 m/s of climb or 55 deg of bank; the run before that was good."""
    climb = 0.0 if turn_radps else 0.6
    on = [(19 + 0.14 * i, 60 + climb * i, turn_radps) for i in range(30)]
    good, *others = flown(LEVEL + on + on[-1:] * 40)
    assert good.startswith("acceleration good: 1") and 17.0 < float(good.split(" to ")[1].split()[0]) < 20.5
    assert not [text for text in others if "good" in text]


def test_a_gap_of_one_mean_ends_a_run():
    """Speeds are fits over eleven means, and no fit spans a gap."""
    rows = [*LEVEL, *[(19.0, 60.0, 0.0)] * 40]
    assert [text.split(":")[0] for text in flown(rows)] == ["acceleration good"]
    rows[64] = None  # in the middle
    assert not [text for text in flown(rows) if "good" in text]
    monitor = RunMonitor(NEXSTAR, None)
    for i in range(100):
        monitor.add(means_at(0.2 * (i + 0.5), 15.0 if i >= 50 else 0.0, 60.0 if i >= 50 else 0.0, n=0.0))
    smoothed = monitor._legs.rows
    assert [row.t_s for row in smoothed] == pytest.approx([0.2 * (i + 0.5) for i in range(55, 95)])
    assert [row.V for row in smoothed] == pytest.approx([15.0] * 40, abs=0.01)


def test_a_change_of_speed_for_less_than_three_seconds_is_not_mentioned():
    for steps, told_of in ((3, False), (14, True)):
        V = [12.0] * 40 + [12 + 5.0 * i / steps for i in range(steps)] + [17.0] * 40
        assert bool(flown([(v, 60.0, 0.0) for v in V])) is told_of


def test_a_run_changes_speed_by_a_fifth_of_its_mean_and_not_too_gently():
    """The change has to reach 0.5 m/s^2 somewhere. A small or gentle change is reported only if it would have covered
    enough speed."""

    def change(first: float, last: float, over_s: float) -> list[str]:
        n = round(5 * over_s)
        V = [first] * 40 + [first + (last - first) * i / n for i in range(n)] + [last] * 40
        return flown([(v, 60.0, 0.0) for v in V])

    assert change(18.0, 21.0, 6.0) == [] and "good" in change(17.0, 22.5, 8.0)[0]
    assert change(15.0, 19.5, 14.0) == ["acceleration lost: too gentle; repeat"]
    assert change(15.0, 17.5, 8.0) == []


def test_the_speeds_covered_are_those_of_the_run():
    """At the ends speed changes slowly, by between 0.09 and 0.25 m/s^2; the aircraft flies at 6.7 m/s at C_L = 1."""
    slow, fast = 0.2 * 0.16 * np.arange(30), 0.2 * 0.9 * np.arange(1, 26)
    V = np.concatenate([7 + slow, 7 + slow[-1] + fast, 7 + slow[-1] + fast[-1] + slow])
    monitor, texts = RunMonitor(load_aircraft("light-1kg"), None), []
    for i, v in enumerate([0.0] * 50 + [7.0] * 30 + V.tolist() + [float(V[-1])] * 40):
        texts += monitor.texts(means_at(0.2 * (i + 0.5), v, 50.0 if v else 0.0, n=80.0 if v else 0.0))
    good, interval = (text for _, text in texts)
    assert good.split(": ")[1].split(" m/s")[0] == interval.split(", ")[1].split(" m/s")[0]


def test_the_interval_s_half_width_is_reported_in_per_cent(monkeypatch):
    monitor = RunMonitor(NEXSTAR, None)
    monitor.runs, monitor.slowest_mps, monitor.fastest_mps = 3, 12.04, 21.96
    monkeypatch.setattr(monitor.energy, "at_endurance_speed", lambda *speeds: PowerInterval(15.0, 0.042))
    assert monitor.interval_text() == "3 runs, 12.0 to 22.0 m/s: power +-4.2 %"


def test_a_leg_in_which_speed_is_held_is_given_after_four_seconds_and_again_if_speed_goes_on():
    """Speed goes on by more than 5 %, and the leg ends at the furthest speed."""
    divided, reported, t, V = Legs(), [], 0.0, 12.0
    for wanted, seconds in ((20.0, 4.0), (20.0, 10.0), (20.8, 2.0), (20.8, 8.0), (22.0, 2.0), (22.0, 8.0)):
        n = round(seconds / 0.2)
        step = (wanted - V) / n
        for _ in range(n):
            t, V = t + 0.2, V + step
            leg = divided.add(Row(t, V, step / 0.2, 0.0, 0.0, 50.0, 50.0, True, None))
            reported += [(t, leg.sign, leg.ended, leg.rows[-1].t_s)] if leg else []
    assert [(sign, ended) for _, sign, ended, _ in reported] == [(1, False), (1, False)]
    assert reported[0][0] == pytest.approx(4.0 + 4.1, abs=0.2) and reported[0][3] == pytest.approx(4.0, abs=0.3)
    assert reported[1][0] == pytest.approx(26.0 + 4.1, abs=0.2) and reported[1][3] == pytest.approx(26.0, abs=0.3)


def test_nothing_is_reported_of_steady_flight_and_of_turns():
    assert notified(V=(15.0, 15.5)) == []
    assert math.tan(LEVEL_RUN.largest_bank_rad) < 17 * 0.6 / GRAVITY_MPS2
    assert not [text for text in notified(turn_radps=0.6) if "bank" in text]


def test_broken_readings_end_a_run_and_nothing_else():
    monitor = RunMonitor(NEXSTAR, None)
    for i in range(400):
        t = 0.2 * i
        means = means_at(t, 0.0 if t < 10 else 15 + 5 * math.sin(t / 4), 50.0 if t > 10 else 0.0)
        for name in ("static_Pa", "q_c_Pa", "n_revps", "az_mps2", "static_temperature_K"):
            if i % 7 == 0 and i % 5 != 4:
                setattr(means, name, (None, -1e9, 0.0, 1e9)[i % 4])
        monitor.texts(means)
    monitor.add(Means(t_s=1e6))


def test_means_are_of_good_readings_in_a_fifth_of_a_second():
    means, result = TickMeans(), []
    for i in range(11):
        status = Status.OK if i % 2 == 0 else Status.NO_REPLY
        reading = DifferentialPressure(status=status, differential_pressure_Pa=float(i) if i % 2 == 0 else None)
        samples = [Sample("/probe/airspeed", 0, reading), Sample("/rpm", 0, Rpm(status=Status.NO_DATA))]
        result.append(means.add(40_000_000 * i + 7, samples))
    first, second = [each for each in result if each is not None]
    assert (first.t_s, first.q_c_Pa, first.n_revps) == (0.1, 2.0, None) and (second.t_s, second.q_c_Pa) == (0.3, 7.0)


@pytest.mark.parametrize("propeller", ["apc-10x5e", "apc-12x8e"])
def test_thrust_is_that_of_the_analysis(propeller):
    table, expected = load_thrust(propeller, folding=False), load_propeller(propeller)
    assert table is not None
    for V in (0.5, 12.0, 25.0):
        for n in (20.0, 83.0, 200.0):
            assert table.thrust_N(V, n, RHO) == pytest.approx(expected.thrust_and_power(V, n, RHO)[0], rel=1e-9)


def test_the_energy_balance_finds_the_drag_polar_that_made_the_runs():
    """Accelerations and decelerations without noise, of an aircraft with a known polar and a known thrust."""
    balance, A, qS_per_V2 = EnergyBalance(Uncertainty()), (0.045, -0.02, 0.06), 0.08
    for thrust in (4.0, 0.3, 3.0, -0.2):
        V, rows = 12.0 if thrust > 1 else 22.0, []
        for i in range(60):
            qS = qS_per_V2 * V**2
            CL = GRAVITY_MPS2 / qS
            Vdot = thrust - qS * (A[0] + A[1] * CL + A[2] * CL**2)
            rows.append(Row(0.2 * i, V, Vdot, 0.0, 0.0, 50.0, 50.0, True, (thrust, qS, CL, 0.5)))
            V += 0.2 * Vdot
        balance.add_run(rows)
    for V in (13.0, 16.0, 20.0):
        qS = qS_per_V2 * V**2
        CL = GRAVITY_MPS2 / qS
        power = qS * V * (A[0] + A[1] * CL + A[2] * CL**2)
        assert balance.power_W(V, 1.0) == pytest.approx(power, rel=0.01)
    power_interval = balance.at_endurance_speed(12.0, 22.0)
    assert power_interval is not None and 0 < power_interval.half_width < 0.1


def noisy_balance(rng: np.random.Generator, sigma_mps2: float) -> EnergyBalance:
    """The energy balance after runs of an aircraft with a known polar, with a random thrust error in each window."""
    balance, A, qS_per_V2 = EnergyBalance(Uncertainty()), (0.045, -0.02, 0.06), 0.08
    for thrust in (4.0, 0.3, 3.0, -0.2):
        V, rows = 12.0 if thrust > 1 else 22.0, []
        error = np.repeat(rng.normal(0, sigma_mps2, 6), 11)
        for i in range(61):
            qS = qS_per_V2 * V**2
            CL = GRAVITY_MPS2 / qS
            Vdot = thrust - qS * (A[0] + A[1] * CL + A[2] * CL**2)
            measured = thrust + float(error[i])
            rows.append(Row(0.2 * i, V, Vdot, 0.0, 0.0, 50.0, 50.0, True, (measured, qS, CL, 0.5)))
            V += 0.2 * Vdot
        balance.add_run(rows)
    return balance


def test_the_interval_is_that_of_the_noise_the_thrust_and_the_airspeed():
    """Noise alone scatters the results of many flights; the interval adds 1.8 % of thrust and 1.25 % of airspeed."""
    rng, V = np.random.default_rng(0), 14.0
    power, variance = [], []
    for _ in range(60):
        balance = noisy_balance(rng, 0.3)
        power.append(balance.power_W(V, 1.0))
        polar = balance.polar()
        assert polar is not None
        g, covariance = np.array(balance._gradient(V)), np.array(polar[1])
        variance.append(g @ covariance[:3, :3] @ g)
    power = np.array(power)
    thrust_part = (0.018 * np.mean(power)) ** 2
    assert np.mean(variance) == pytest.approx(np.var(power) + thrust_part, rel=0.4)
    quiet = noisy_balance(rng, 0.0)
    polar = quiet.at_endurance_speed(12.0, 22.0)
    assert polar is not None
    grid = np.linspace(12.0, 22.0, 25)
    assert polar.speed_mps == pytest.approx(grid[np.argmin([quiet.power_W(v, 1.0) for v in grid])])
    g, covariance = np.array(quiet._gradient(polar.speed_mps)), np.array(quiet.polar()[1])
    relative = math.sqrt(g @ covariance[:3, :3] @ g) / quiet.power_W(polar.speed_mps, 1.0)
    assert polar.half_width == pytest.approx(NormalDist().inv_cdf(0.975) * math.hypot(relative, 1.5 * 0.0125))
    assert 0.018 < relative < 0.06


@pytest.mark.parametrize("thrust_scale, airspeed_scale", [(0.05, 1e-5), (1e-5, 0.05), (0.03, 0.04)])
def test_in_steady_flight_the_interval_is_what_the_aircraft_file_states(thrust_scale, airspeed_scale):
    """In steady flight drag equals thrust, so an unknown scale of thrust is one of power."""
    uncertainty = Uncertainty(
        thrust_scale_fraction=thrust_scale, thrust_slope=1e-5, airspeed_scale_fraction=airspeed_scale
    )
    monitor = RunMonitor(dataclasses.replace(NEXSTAR, uncertainty=uncertainty), None)
    for V in np.linspace(12.0, 22.0, 12):
        qS = 0.08 * V**2
        CL = GRAVITY_MPS2 / qS
        of_mass = qS * (0.045 - 0.02 * CL + 0.06 * CL**2), qS, CL, 0.5
        monitor.energy.add_run([Row(0.2 * i, V, 0.0, 0.0, 0.0, 50.0, 50.0, True, of_mass) for i in range(600)])
    power_interval = monitor.energy.at_endurance_speed(12.0, 22.0)
    assert power_interval is not None
    assert power_interval.half_width == pytest.approx(
        NormalDist().inv_cdf(0.975) * math.hypot(thrust_scale, 1.5 * airspeed_scale), rel=0.02
    )


def test_thrust_on_a_stand_is_a_prior_of_the_in_flight_estimate():
    """With an exact thrust stand and an exact slope, 3 % more thrust means 3 % more power."""
    uncertainty = Uncertainty(
        thrust_slope=1e-5,
        airspeed_scale_fraction=1e-5,
        static_thrust_ratio_fraction=1e-5,
        thrust_curvature_fraction=0.0,
    )
    with_stand = dataclasses.replace(NEXSTAR.propulsion, static_thrust_ratio=1.03)
    powers, half_widths = [], []
    for propulsion in (NEXSTAR.propulsion, with_stand):
        monitor = RunMonitor(dataclasses.replace(NEXSTAR, uncertainty=uncertainty, propulsion=propulsion), None)
        for V in np.linspace(12.0, 22.0, 12):
            qS = 0.08 * V**2
            CL = GRAVITY_MPS2 / qS
            of_mass = qS * (0.045 - 0.02 * CL + 0.06 * CL**2), qS, CL, 0.5
            monitor.energy.add_run([Row(0.2 * i, V, 0.0, 0.0, 0.0, 50.0, 50.0, True, of_mass) for i in range(600)])
        powers.append(monitor.energy.power_W(15.0, 4.0))
        half_widths.append(monitor.energy.at_endurance_speed(12.0, 22.0).half_width)
    assert powers[1] == pytest.approx(1.03 * powers[0], rel=1e-3)
    assert half_widths[0] ** 2 - half_widths[1] ** 2 == pytest.approx((1.96 * 0.018) ** 2, rel=0.1)


def test_a_climb_is_paid_from_the_energy_and_an_inverse_is_one():
    """In a climbing run part of the work of thrust goes into height, and the drag stays the same."""

    def run(climb_mps: float) -> EnergyBalance:
        balance = EnergyBalance(Uncertainty())
        for first in (12.0, 14.0, 16.0, 18.0):
            rows = []
            for i in range(56):
                V = first + 0.08 * i
                qS = 0.08 * V**2
                CL = GRAVITY_MPS2 / qS
                thrust = qS * (0.045 - 0.02 * CL + 0.06 * CL**2) + 0.4 + GRAVITY_MPS2 * climb_mps / V
                height = 50 + climb_mps * 0.2 * i
                rows.append(Row(0.2 * i, V, 0.4, climb_mps, 0.0, height, height, True, (thrust, qS, CL, 0.5)))
            balance.add_run(rows)
        return balance

    for V in (13.0, 19.0):
        assert run(1.0).power_W(V, 1.0) == pytest.approx(run(0.0).power_W(V, 1.0), rel=0.01)
    matrix = np.array([[4.0, 1.0, 0.5], [1.0, 3.0, -0.2], [0.5, -0.2, 2.0]])
    assert np.array(inverted(matrix.tolist())) == pytest.approx(np.linalg.inv(matrix))
    assert inverted([[1.0, 1.0], [1.0, 1.0]]) is None and inverted([[-1.0]]) is None


def test_legs_forget_what_is_older_than_minutes_and_go_on():
    legs, V = Legs(), 15 + 5 * np.sin(np.arange(0, 600, 0.2) / 10)
    ended = []
    for i, speed in enumerate(V.tolist()):
        leg = legs.add(Row(0.2 * i, speed, 0.0, 0.0, 0.0, 50.0, 50.0, True, None))
        ended += [leg] if leg is not None and leg.ended else []
    assert len(legs.rows) <= 2 * KEPT_ROWS
    for leg in ended[1:]:  # each half wave lasts 31.4 s, even after rows were dropped
        assert leg.rows[-1].t_s - leg.rows[0].t_s == pytest.approx(10 * math.pi, abs=0.5)
        assert (leg.rows[-1].V - leg.rows[0].V) * leg.sign == pytest.approx(10.0, abs=0.01)


def row(t_s: float, **changes) -> Row:
    flown = {"V": 15.0, "Vdot": 0.6, "climb": 0.0, "bank": 0.0, "height_m": 60.0, "smooth_height_m": 60.0}
    return Row(t_s, **({**flown, "complete": True, "drag": (5.0, 60.0, 0.5, 0.4)} | changes))


@pytest.mark.parametrize(
    ("first", "last", "reason", "words"),
    [
        ({}, {}, None, ""),
        ({"climb": 3.0}, {}, RunRejected.CLIMBED, "climbed 15 m"),
        ({}, {"climb": -3.0}, RunRejected.CLIMBED, "sank 15 m"),
        ({"height_m": 90.0}, {}, RunRejected.HEIGHT_VARIED, "height +-15 m"),
        ({"bank": math.radians(-26)}, {}, RunRejected.BANKED, "bank 26 deg"),
        ({}, {"complete": False}, RunRejected.DATA_MISSING, "no data, 50 %"),
        ({}, {"V": 18.0}, RunRejected.SPEED_CHANGED_LITTLE, "speed changed 18 %"),
    ],
)
def test_a_verdict_says_how_far_the_run_is_from_its_limits(
    first: dict, last: dict, reason: RunRejected | None, words: str
) -> None:
    rows = [row(100.0, **first), row(110.0, **({"V": 20.0} | last))]
    rejection = RunMonitor(NEXSTAR, None)._measures(1, rows).rejection(1.0)
    assert (rejection.reason if rejection else None) is reason
    assert JudgedRun("acceleration", 100.0, 110.0, 15.0, 20.0, 0.3, rejection).reason == words


def test_every_reason_has_words_and_a_turn_is_not_told():
    for reason in RunRejected:
        verdict = JudgedRun("deceleration", 0.0, 10.0, 20.0, 12.0, 0.5, Rejection(reason, 1.0, 2.0))
        assert verdict.reason and len(verdict.text) <= 50 and verdict.notified == (reason is not RunRejected.BANKED)
        assert not verdict._replace(speed_change=0.1).notified


def test_verdicts_are_the_same_if_both_ends_are_within_a_second() -> None:
    ends = ((10.0, 20.0), (10.9, 19.1), (11.1, 20.0))
    verdicts = [JudgedRun("acceleration", *both, 12.0, 20.0, 0.5, None) for both in ends]
    assert run_monitor._same(verdicts[0], verdicts[1]) and run_monitor._same(verdicts[1], verdicts[0])
    assert not run_monitor._same(verdicts[0], verdicts[2]) and not run_monitor._same(verdicts[2], verdicts[0])
    assert not run_monitor._same(verdicts[0], verdicts[0]._replace(end_s=21.1))
