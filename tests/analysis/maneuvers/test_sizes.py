"""Thresholds scale with the aircraft's speed; what a light aircraft or a gentle pilot loses is reported."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.curve import speed_at
from flightpower.analysis.maneuvers.find import find, find_steady
from flightpower.analysis.maneuvers.find_level import find_runs
from flightpower.analysis.maneuvers.find_loads import find_loads
from flightpower.analysis.maneuvers.flown import flown_condition, flown_lift
from flightpower.analysis.maneuvers.kinds import Unsuitable
from flightpower.analysis.maneuvers.quality import too_low
from flightpower.analysis.sources.daemon import SPEED_SCALE, speed_scale
from flightpower.flight.aircraft import Aircraft, load_aircraft
from flightpower.flight.runs import RunRejected, flying_Pa
from flightpower.flight.units import GRAVITY_MPS2
from tests.analysis.maneuvers.test_find import RATE_HZ, flight, up_and_down

LIGHT, NEXSTAR, HEAVY = (load_aircraft(name) for name in ("light-1kg", "nexstar", "survey-6kg"))
SCALE = speed_scale(LIGHT)


def test_only_slower_aircraft_have_other_thresholds() -> None:
    assert speed_scale(NEXSTAR) == speed_scale(HEAVY) == 1.0
    assert flying_Pa(speed_scale(NEXSTAR)) == 30.0


def test_the_pressure_of_flight_is_one_lift_coefficient_for_all_slower_aircraft() -> None:
    """Half the wing loading has half the dynamic pressure; the light aircraft stalls at 22.9 Pa."""

    def CL(aircraft: Aircraft) -> float:
        return aircraft.mass.weight_N / aircraft.geometry.wing_area_m2 / flying_Pa(speed_scale(aircraft))

    assert CL(LIGHT) == pytest.approx(CL(LIGHT.weighing(1.5 * LIGHT.mass.weight_N)))
    assert flying_Pa(SCALE) < 22.9 / 2
    feather = dataclasses.replace(LIGHT, geometry=dataclasses.replace(LIGHT.geometry, wing_area_m2=2.0))
    assert flying_Pa(speed_scale(feather)) == 8.0, "never below the noise of the transducer"


def scaled(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(**{SPEED_SCALE: SCALE})


def test_a_short_gentle_run_counts_for_a_light_aircraft_and_is_reported_for_another() -> None:
    """7 to 9.2 m/s in 6 s is a gentle 0.37 m/s^2; 7 to 14 m/s in 2.2 s is short."""
    speed = up_and_down(low=7.0, high=9.2, seconds=6.0)
    slow = flight(speed).assign(V_mps=speed)
    runs, rejected = find_runs(scaled(slow))
    assert [run.kind for run in runs] == ["acceleration", "deceleration"] and not rejected
    runs, rejected = find_runs(slow, noise_mps=0.3)
    assert not runs and [item.rejection.reason for item in rejected] == [RunRejected.TOO_GENTLE] * 2
    assert rejected[0].rejection.limit == 0.5
    brief = flight(up_and_down(low=7.0, high=14.0, seconds=2.2))
    assert len(find_runs(scaled(brief))[0]) == 2 and not find_runs(brief)[0]


def test_the_approach_of_a_light_aircraft_is_no_run() -> None:
    """Sinking 0.9 m/s at 8 m/s is as steep as 1.5 m/s at 13 m/s, an approach. The Nexstar may sink at 0.9 m/s."""
    speed = up_and_down(low=7.0, high=9.2, seconds=6.0)
    sinking = flight(speed, height=100.0 - 0.9 * np.arange(len(speed)) / RATE_HZ).assign(V_mps=speed)
    runs, rejected = find_runs(scaled(sinking))
    assert not runs and [item.rejection.reason for item in rejected] == [RunRejected.CLIMBED] * 2
    faster = flight(up_and_down(), height=100.0 - 0.9 * np.arange(len(up_and_down())) / RATE_HZ)
    assert [run.kind for run in find_runs(faster)[0]] == ["acceleration", "deceleration"]


def test_a_light_aircraft_may_fly_lower() -> None:
    data = flight(np.full(250, 9.0), height=np.full(250, 15.0))
    low = too_low(data)
    assert low is not None and low.limit == 20.0 and too_low(scaled(data)) is None


def oscillating(amplitude: float, irregular: bool = False) -> pd.DataFrame:
    """Return level flight whose load factor swings by an amplitude for 30 s, once per 1.5 s or at random."""
    n = round(40 * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    wave = np.sin(2 * np.pi * t / 1.5)
    if irregular:
        noise = np.random.default_rng(3).standard_normal(n)
        wave = np.convolve(noise, np.exp(-np.arange(50) / 8), mode="same") / 2
    load = 1 + amplitude * wave * ((t > 5) & (t < 35))
    return flight(np.full(n, 15.0)).assign(az_mps2=-GRAVITY_MPS2 * load)


def test_a_porpoise_too_gentle_to_count_is_reported_and_gusts_are_not() -> None:
    result, rejected = find_loads(oscillating(0.2))
    (gentle,) = rejected
    assert (
        not result and gentle.kind == "porpoising" and gentle.reason.startswith("too gentle to count: load factor 0.8")
    )
    assert gentle.start_s == pytest.approx(5.0, abs=2.0) and gentle.end_s == pytest.approx(35.0, abs=2.0)
    assert find_loads(oscillating(0.2, irregular=True))[1] == []
    counts = [len(find_loads(oscillating(amplitude))[1]) for amplitude in (0.04, 0.08)]
    assert counts == [0, 1], "from 5 % of the weight on, swings are deliberate"
    enough, rejected = find_loads(oscillating(0.6))
    assert [item.kind for item in enough] == ["porpoising"] and rejected == []


@pytest.mark.parametrize(("amplitude", "steady"), [(0.0, True), (0.3, True), (0.42, False)])
def test_steady_flight_has_a_steady_load_factor(amplitude: float, steady: bool) -> None:
    """A load factor that varies by more than 0.25 rms is not steady; in gusts of 15 kt it still is."""
    t = np.arange(round(40 * RATE_HZ)) / RATE_HZ
    wave = np.sin(2 * np.pi * t / 2.0)
    data = flight(np.full(len(t), 15.0)).assign(n_revps=90.0, az_mps2=-GRAVITY_MPS2 * (1 + amplitude * wave))
    result, rejected = find_steady(data)
    assert bool(result) == steady
    assert [item.rejection.reason for item in rejected] == ([] if steady else [Unsuitable.LOAD_VARIED])


@pytest.mark.parametrize("amplitude", [0.0, 0.5])
def test_no_run_is_part_of_a_porpoise(amplitude: float) -> None:
    """Speed rises from 12 to 16.5 m/s in 10 s, with or without swings of the load factor throughout."""
    t = np.arange(round(30 * RATE_HZ)) / RATE_HZ
    data = flight(np.interp(t, [10.0, 20.0], [12.0, 16.5])).assign(
        n_revps=90.0, az_mps2=-GRAVITY_MPS2 * (1 + amplitude * np.sin(2 * np.pi * t / 1.5))
    )
    maneuvers = find(data, [])
    assert bool(maneuvers.of("porpoising")) == (amplitude > 0)
    assert [run.kind for run in maneuvers.level_runs] == ([] if amplitude else ["acceleration"])
    assert bool(maneuvers.of("steady")) == (amplitude == 0)


def test_noise_of_speed_does_not_make_the_slowest_speed_of_a_light_aircraft_lower() -> None:
    """6 Pa are 0.7 m/s of noise at 7 m/s; the first percentile of single samples would be 5.4 m/s, below the stall."""
    speed = np.linspace(7.0, 14.0, 250)
    data = scaled(flight(speed)).assign(V_mps=speed + np.random.default_rng(1).normal(0, 4.9, 250) / speed)
    slowest = speed_at(flown_lift(data, LIGHT)[1], flown_condition(data, LIGHT))
    assert slowest == pytest.approx(7.0, rel=0.05)


def loaded(load: np.ndarray) -> pd.DataFrame:
    """Return level flight at 15 m/s with this load factor, preceded and followed by 10 s at load factor 1."""
    load_factor = np.concatenate([np.ones(round(10 * RATE_HZ)), load, np.ones(round(10 * RATE_HZ))])
    return flight(np.full(len(load_factor), 15.0)).assign(az_mps2=-GRAVITY_MPS2 * load_factor)


def pull_and_push(most: float, least: float, seconds: float = 8.0) -> np.ndarray:
    """Return a load factor that is a half sine up to `most`, then a half sine down to `least`."""
    half = np.sin(np.linspace(0, np.pi, round(seconds / 2 * RATE_HZ)))
    return np.concatenate([1 + (most - 1) * half, 1 - (1 - least) * half])


def test_a_roller_coaster_pulls_and_pushes_beyond_a_quarter() -> None:
    (result,), rejected = find_loads(loaded(pull_and_push(1.5, 0.5)))
    assert result.kind == "roller coaster" and not rejected
    assert result.notes[0].startswith("load factor 0.5 to 1.5")
    # It lasts while load factor differs from 1 by more than 0.15, so a tenth of the half sine at each end is left out.
    assert result.start_s == pytest.approx(10.0 + 4.0 * np.arcsin(0.3) / np.pi, abs=0.15)
    assert result.end_s == pytest.approx(18.0 - 4.0 * np.arcsin(0.3) / np.pi, abs=0.15)
    for most, least in ((1.22, 0.5), (1.5, 0.78), (1.0, 0.5), (1.5, 1.0)):
        assert find_loads(loaded(pull_and_push(most, least))) == ([], []), (most, least)
    assert find_loads(loaded(pull_and_push(1.3, 0.7, 5.0)))[0]


def test_pulls_alone_are_no_swings_of_a_porpoise() -> None:
    """Nine pulls to 1.5 and one push are none; a porpoise goes from push to pull and back eight times."""
    pull = 1 + 0.5 * np.sin(np.linspace(0, np.pi, round(1.2 * RATE_HZ)))
    (result,), _ = find_loads(loaded(np.concatenate([pull] * 5 + [2 - pull] + [pull] * 4)))
    assert result.kind == "roller coaster"
    (porpoise,), _ = find_loads(loaded(np.concatenate([pull, 2 - pull] * 5)))
    assert porpoise.kind == "porpoising"


@pytest.mark.parametrize(
    ("seconds", "reason"), [(2.2, RunRejected.TOO_SHORT), (2.8, None), (39.0, None), (41.0, RunRejected.TOO_LONG)]
)
def test_a_roller_coaster_lasts_from_2_5_to_40_seconds(seconds: float, reason: RunRejected | None) -> None:
    half = np.full(round(seconds / 2 * RATE_HZ), 0.5)
    result, rejected = find_loads(loaded(np.concatenate([1 + half, 1 - half])))
    if reason:
        assert not result and rejected[0].rejection.reason is reason
    else:
        assert result and not rejected


def test_a_pause_of_more_than_a_second_divides_a_roller_coaster() -> None:
    # Beside the pause itself, load factor is within 0.15 of 1 for 0.39 s at either end.
    for pause_s, parts in ((0.1, 1), (0.5, 2)):
        pause = np.ones(round(pause_s * RATE_HZ))
        result, _ = find_loads(loaded(np.concatenate([pull_and_push(1.5, 0.5), pause, pull_and_push(1.5, 0.5)])))
        assert len(result) == parts
