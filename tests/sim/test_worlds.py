"""Worlds that the analysis does not assume: each differs from the study's as it says, and obeys the same physics."""

from dataclasses import astuple, fields, replace

import numpy as np
import pytest

from flightpower.flight.aircraft import Uncertainty, load_aircraft, parse_aircraft
from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.air import Air, GustStates, gust_scales, mean_wind, updraft, von_karman
from flightpower.sim.drag_shape import BUCKET_CL, DragShape
from flightpower.sim.fly import fly
from flightpower.sim.plan import parse_plan
from flightpower.sim.plant import Deviations, plant_of
from flightpower.sim.sensors import FlightSensorTruth, draw, load_budget
from flightpower.sim.trim import power_required
from flightpower.sim.true_propeller import table_until, true_propeller
from flightpower.sim.world import load_world, parse_world, worlds

TABLE = load_propeller("apc-12x8e")
RPM, ZERO_J = 6000.0, 0.88
EVERYTHING = """
title = "All differences at once."
errors = "none"
[systematic]
weight_scale = 0.03
windmilling = 1.0
thrust_bow = 0.05
CD_quartic = 0.02
CD_bucket = 0.002
reynolds_exponent = 0.3
[air]
wind = "4 m/s"
veer = "20 deg"
turbulence = "4 m/s"
gust_spectrum = "von-karman"
gust_length_factor = 2.0
convection = "0.3 m/s"
[pilot]
bank = "5 deg"
height = "3 m"
"""
LEVEL_AND_RUN = """
height = "60 m"
[[segment]]
kind = "hold"
duration = "20 s"
speed_over_stall = 1.4
[[segment]]
kind = "run"
throttle = 0.2
speed_over_stall = 1.15
"""


@pytest.fixture(scope="module")
def everything():
    world = parse_world(EVERYTHING, "everything")
    plan = world.plan(parse_plan(LEVEL_AND_RUN, "level-and-run"), seed=3)
    return fly(load_aircraft("nexstar"), plan, seed=3, deviations=draw(world.errors, 3).deviations)


@pytest.mark.parametrize("name", [name for name in worlds() if name not in ("study", "none")])
def test_every_world_differs_from_the_study(name):
    world, study = load_world(name), load_world("study")
    assert world.title
    assert replace(world, name="", title="", errors=replace(world.errors, title="")) != replace(
        study, name="", title="", errors=replace(study.errors, title="")
    )


@pytest.mark.parametrize("name", [name for name in worlds() if load_world(name).uncertainty])
def test_the_aircraft_file_states_what_the_world_does(name):
    """It states all of [uncertainty]; what the world does not state keeps its default."""
    world = load_world(name)
    uncertainty = parse_aircraft(world.aircraft_text(load_aircraft("nexstar").text), "aircraft.toml").uncertainty
    assert astuple(uncertainty) == pytest.approx(astuple(world.uncertainty), rel=1e-9)
    assert load_world("study").uncertainty_section() == ""


def test_every_key_of_uncertainty_reaches_the_aircraft_file():
    doubled = Uncertainty(**{field.name: 2 * field.default + 0.25 for field in fields(Uncertainty)})
    world = replace(load_world("study"), uncertainty=doubled)
    for aircraft in ("nexstar", "light-1kg"):  # with a section [uncertainty] of its own, and without
        uncertainty = parse_aircraft(world.aircraft_text(load_aircraft(aircraft).text), "aircraft.toml").uncertainty
        assert astuple(uncertainty) == pytest.approx(astuple(doubled), rel=1e-9)


def test_what_an_aircraft_file_says_of_other_errors_stays():
    world = replace(load_world("study"), uncertainty=Uncertainty(updraft_mps=0.1))
    text = world.aircraft_text('title = "x"\n[uncertainty]\nupdraft = "1 m/s"\nthrust_slope = 0.4\n\n[probe]\n')
    assert text == 'title = "x"\n[uncertainty]\nupdraft = "0.1 m/s"\nthrust_slope = 0.4\n\n[probe]\n'


def test_a_world_is_its_budget_with_what_it_changes():
    study, twice, weight = load_budget("study").systematic, load_world("twice").errors, load_world("weight").errors
    assert twice.systematic.alpha_offset_rad == 2 * study.alpha_offset_rad
    assert twice.noise == load_budget("study").noise
    assert weight.systematic == replace(study, weight_scale=0.03)
    with pytest.raises(InputError, match=r"world odd.*gravity"):
        parse_world('title = "x"\n[systematic]\ngravity = 2\n', "odd")


def test_energy_is_conserved_with_all_differences_at_once(everything):
    """Kinetic and potential energy change by the work of air and thrust; weights are those of the true aircraft."""
    f = {name: everything.truth[name].to_numpy() for name in everything.truth.select_dtypes(float)}
    m = everything.plant.mass_kg
    speed2 = sum(f[f"velocity_{axis}_mps"] ** 2 for axis in ("north", "east", "down"))
    energy = m * (speed2 / 2 + g * f["height_m"])
    power = sum(f[f"force_{axis}_N"] * f[f"{velocity}_mps"] for axis, velocity in zip("xyz", "uvw", strict=True))
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2) * 0.02])
    assert energy - energy[0] == pytest.approx(work, abs=2e-3 * np.ptp(energy))


def test_a_wandering_pilot_keeps_to_the_limits_of_bank_and_height():
    """In still air, over the hold, after it has settled. Sines with the shares 0.5, 0.3 and 0.2 rarely peak
    together."""
    world = parse_world('title = "x"\nerrors = "none"\n[pilot]\nbank = "5 deg"\nheight = "3 m"\n', "x")
    plan = parse_plan(
        'height = "60 m"\n[[segment]]\nkind = "hold"\nduration = "60 s"\nspeed_over_stall = 1.5\n', "hold"
    )
    truth = fly(load_aircraft("nexstar"), world.plan(plan, 0), seed=0).truth
    bank_deg, height_m = np.degrees(truth["roll_rad"]), truth["height_m"] - 60
    assert 2.5 < np.abs(bank_deg).max() < 7
    assert 1.5 < np.abs(height_m).max() < 3.6


def test_the_true_curve_is_that_of_the_true_aircraft():
    aircraft = load_aircraft("nexstar")
    plain, V = plant_of(aircraft), np.array([13.0, 18.0, 23.0])
    power, CL, CD = power_required(plain, V, density=1.2)

    def other(**deviations):
        return power_required(plant_of(aircraft, deviations=Deviations(**deviations)), V, density=1.2)

    _, heavier_CL, _ = other(weight_scale=0.03)
    assert heavier_CL == pytest.approx(1.03 * CL, rel=1e-6)
    bent, _, bent_CD = other(drag=DragShape(quartic=0.02))
    assert bent_CD - CD == pytest.approx(0.02 * (CL - plain.aero.CL_minD) ** 4)
    assert bent / power == pytest.approx(bent_CD / CD)
    _, _, slippery = other(drag=DragShape(bucket=0.0015))
    assert (CD - slippery)[np.argmin(np.abs(CL - BUCKET_CL))] == pytest.approx(0.0015, rel=0.01)
    _, _, scaled = other(drag=DragShape(reynolds_exponent=0.3))
    assert scaled[0] > CD[0] and scaled[-1] < CD[-1]
    reference_mps = np.sqrt(2 * aircraft.mass.weight_N / (1.225 * aircraft.geometry.wing_area_m2 * 0.5))
    assert scaled - CD == pytest.approx(plain.aero.CD0 * ((V / reference_mps) ** -0.3 - 1), rel=1e-6)


def test_windmilling_drag_curves_away_from_the_table_s_continuation():
    """Thrust and slope at zero thrust are equal; the stalled blades brake less far beyond."""
    true = true_propeller(TABLE, windmilling=1.0)
    J = np.array([0.3, 0.6, 0.85, 0.9, 1.1, 1.4])
    line, element = (np.asarray(p.table(J, RPM)[0]) for p in (TABLE, true))
    assert element[:3] == pytest.approx(line[:3])
    assert element[3] == pytest.approx(line[3], rel=0.05)
    assert 0.8 < element[4] / line[4] < 0.95 and 0.5 < element[5] / line[5] < 0.75
    assert (element[3:] < 0).all()
    half = true_propeller(TABLE, windmilling=0.5)
    assert half.table(J, RPM)[0] == pytest.approx((line + element) / 2)


def test_a_bowed_table_has_the_same_zero_of_thrust():
    """P2 is 1 at the ends and -1/2 in the middle."""
    bowed = true_propeller(TABLE, bow=0.04)
    J = np.array([0.0, 0.43, ZERO_J])
    ratio = np.asarray(bowed.table(J, RPM)[0])[:2] / np.asarray(TABLE.table(J, RPM)[0])[:2]
    assert ratio == pytest.approx([1.04, 0.98], abs=1e-3)
    assert bowed.table(ZERO_J, RPM)[0] == pytest.approx(0.0, abs=1e-9)


def test_a_short_table_ends_before_zero_thrust_and_a_complete_one_beyond():
    assert all(row.cT[-1] >= 0.035 and row.J[-1] > 0.65 for row in table_until(TABLE, 0.035).rows)
    propulsion = load_aircraft("nexstar").propulsion
    complete, short = load_world("windmilling-known").table(propulsion), load_world("short-table").table(propulsion)
    flown = true_propeller(TABLE, windmilling=1.0)
    J = np.linspace(0.3, 1.5, 40)
    assert complete.covers(J, RPM).all()
    assert complete.table(J, RPM)[0] == pytest.approx(flown.table(J, RPM)[0])
    assert not short.covers(0.8, RPM) and short.covers(0.6, RPM)
    assert load_world("windmilling").table(propulsion) is None


def test_von_karman_spectra_are_those_of_the_standard():
    """MIL-F-8785C sec. 3.7.1.1, one-sided in spatial frequency; the rational filters approximate it to 5 %."""
    V, H, N = 17.0, 60.0, len(GustStates._fields)
    scales = gust_scales(5.0, H, 1.0)

    def evaluate(x, n):
        rates, gust = von_karman(GustStates(*x), n, V=V, span_m=1.75, scales=scales)
        return np.array(rates, dtype=float), np.array(gust, dtype=float)

    columns, inputs = [evaluate(e, np.zeros(4)) for e in np.eye(N)], [evaluate(np.zeros(N), e) for e in np.eye(4)]
    A, C = (np.column_stack([c[k] for c in columns]) for k in (0, 1))
    B, D = (np.column_stack([c[k] for c in inputs]) for k in (0, 1))

    def spectra(Omega):
        response = C @ np.linalg.solve(1j * Omega * V * np.eye(N) - A, B) + D
        return np.sum(np.abs(response) ** 2, axis=1)[:3] * V / np.pi

    for wavelengths in np.geomspace(0.05, 12, 12):  # Omega L
        a = (1.339 * wavelengths) ** 2
        longitudinal, lateral = 2 / (1 + a) ** (5 / 6), (1 + 8 / 3 * a) / (1 + a) ** (11 / 6)
        for i, shape, sigma, L in (
            (0, longitudinal, scales.sigma_u, scales.L_u),
            (1, lateral, scales.sigma_u, scales.L_u),
            (2, lateral, scales.sigma_w, scales.L_w),
        ):
            assert spectra(wavelengths / L)[i] == pytest.approx(sigma**2 * L / np.pi * shape, rel=0.05)


def test_gust_lengths_take_a_factor_and_intensities_do_not():
    longer, standard = gust_scales(5.0, 60.0, 2.5), gust_scales(5.0, 60.0)
    assert (longer.L_u, longer.L_w) == (2.5 * standard.L_u, 2.5 * standard.L_w)
    assert (longer.sigma_u, longer.sigma_w) == (standard.sigma_u, standard.sigma_w)
    with pytest.raises(InputError, match="gust_spectrum"):
        Air(gust_spectrum="kolmogorov")


def test_convection_has_unit_rms_and_no_mean_over_all_places_but_has_one_along_a_track():
    rng = np.random.default_rng(0)
    north, east = rng.uniform(0, 50_000, (2, 100_000))
    w = updraft(north, east, length_m=250.0, seed=1)
    assert np.sqrt(np.mean(w**2)) == pytest.approx(1.0, abs=0.02) and abs(w.mean()) < 0.02
    track = [updraft(np.linspace(0, 300, 100), 0.0, length_m=250.0, seed=seed).mean() for seed in range(20)]
    assert np.std(track) > 0.1
    _, _, down = mean_wind(Air(convection_mps=0.3, convection_length_m=250.0, convection_seed=1), north, east, 60.0)
    assert np.allclose(down, -0.3 * w)


def test_the_wind_veers_with_height():
    air = Air(wind_mps=6.0, wind_from_rad=0.4, veer_rad=0.35)
    (n0, e0, _), (n1, e1, _) = (mean_wind(air, 0.0, 0.0, height) for height in (1e-6 + 0.05, 100.0))
    assert np.arctan2(-e0, -n0) == pytest.approx(0.4, abs=1e-3)
    assert np.arctan2(-e1, -n1) == pytest.approx(0.75)


def test_zeros_step_once_and_shift_in_the_airstream(everything):
    """Subtracting the flight without these errors leaves nothing at its start, a lag of a minute, and then a step."""
    budget = load_budget("none")
    errors = draw(replace(budget, systematic=replace(budget.systematic, zero_step_Pa=5.0, zero_cooling_Pa=3.0)), 2)
    t = np.linspace(0, everything.duration_s, 2000)
    off = FlightSensorTruth(everything, errors).differential_pressure_Pa("alpha", t)
    off = off - FlightSensorTruth(everything, draw(budget, 2)).differential_pressure_Pa("alpha", t)
    jump = np.argmax(np.abs(np.diff(off)))
    assert np.diff(off)[jump] == pytest.approx(errors.zero_step["alpha"], rel=0.02)
    assert t[jump] / everything.duration_s == pytest.approx(errors.zero_step_at, abs=1e-3)
    share = off[-1] - errors.zero_step["alpha"]
    assert share == pytest.approx(errors.zero_cooling["alpha"], rel=0.5) and share != 0
