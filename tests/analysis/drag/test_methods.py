"""Every method on flights whose drag polar is known by construction; weight and density; too little data."""

import dataclasses

import numpy as np
import pandas as pd
import pytest

from analysis.drag import polar as curve
from analysis.drag import regression
from analysis.drag.direct import DIRECT, FROM_SPEED
from analysis.drag.energy import ENERGY
from analysis.drag.method import Method
from analysis.drag.piw_viw import PIW_VIW_THREE, PIW_VIW_TWO, as_points, piw_viw, steady_points
from analysis.drag.w_delta import W_DELTA, W_DELTA_SLOW
from analysis.estimation.intervals import NORMAL_95
from analysis.maneuvers.kinds import Maneuver
from flight.aircraft import load_aircraft
from flight.atmosphere import GAS_CONSTANT_AIR, GRAVITY_MPS2, SEA_LEVEL_DENSITY
from flight.errors import InputError

AIRCRAFT = load_aircraft("nexstar")
S, W = AIRCRAFT.geometry.wing_area_m2, AIRCRAFT.mass.weight_N
m = AIRCRAFT.mass_kg
NO_DOUBT = np.zeros((3, 3))
STEP_S = 0.2


def polar(CL_minD: float = 0.15, CD0: float = 0.045, K: float = 0.065) -> np.ndarray:
    return np.array([CD0 + K * CL_minD**2, -2 * K * CL_minD, K])


def angle(CL):
    return (CL - 0.3) / 4.6


def flown(V, A, rho, gamma=0.0, weight_N=W) -> pd.DataFrame:
    """What a method is given of a flight at speeds V (n,) along a straight path: forces in exact balance, no errors.

    Lift carries what thrust does not: L + T sin(alpha) = W cos(gamma); D + m Vdot + W sin(gamma) = T cos(alpha).
    """
    t = np.arange(len(V)) * STEP_S
    V = np.asarray(V, dtype=float)
    Vdot = np.gradient(V, t) if np.ptp(V) else np.zeros_like(V)
    mass = weight_N / GRAVITY_MPS2
    qS = rho * V**2 / 2 * S
    lift = np.full_like(V, weight_N * np.cos(gamma))
    for _ in range(50):
        CL = lift / qS
        drag = qS * (A[0] + A[1] * CL + A[2] * CL**2)
        thrust = (drag + mass * Vdot + weight_N * np.sin(gamma)) / np.cos(angle(CL))
        lift = weight_N * np.cos(gamma) - thrust * np.sin(angle(CL))
    alpha = angle(CL)
    forward, down = thrust - drag * np.cos(alpha) + lift * np.sin(alpha), -drag * np.sin(alpha) - lift * np.cos(alpha)
    height = 100 + np.concatenate([[0], np.cumsum((V[1:] + V[:-1]) / 2 * STEP_S * np.sin(gamma))])
    temperature_K = 280.0
    columns = {
        "V": V, "V_felt": V, "alpha": alpha, "alpha_felt": alpha, "gamma": gamma, "theta_felt": gamma + alpha,
        "climb": V * np.sin(gamma), "bank": 0.0, "Vdot": Vdot, "rho": rho, "ax": forward / mass, "az": down / mass,
        "qS": qS / mass, "qS_felt": qS / mass, "thrust": thrust / mass, "thrust_felt": thrust / mass,
        "height_felt": height, "static_Pa": rho * GAS_CONSTANT_AIR * temperature_K, "temperature_K": temperature_K,
        "covered": 1.0, "J": 0.5, "gust_mps": 0.0, "gust_s": 4.0,
        "gust_along_mps": 0.0, "gust_along_s": 9.0,
    }  # fmt: skip
    return pd.DataFrame(columns, index=t)


def joined(parts: list[pd.DataFrame], kind: str) -> tuple[pd.DataFrame, list[Maneuver]]:
    """Parts of a flight one after the other, and each as a run."""
    runs, start = [], 0.0
    for part in parts:
        part.index = part.index + start
        end = float(part.index[-1])
        runs.append(Maneuver(kind, slice(0, 0), start, end, 0.0, 0.0, 0.0))
        start = end + 10.0
    return pd.concat(parts), runs


def answer(method: Method, parts: list[pd.DataFrame], kind: str) -> np.ndarray:
    given, runs = joined(parts, kind)
    return method.problem(given, runs, AIRCRAFT).values()


SPEEDS = (11.6, 13.5, 16.0, 19.0, 22.8)  # 38 to 75 ft/s


def steady(A, rho=1.15, weight_N=W) -> list[pd.DataFrame]:
    return [flown(np.full(60, V), A, rho, weight_N=weight_N) for V in SPEEDS]


def test_three_terms_give_any_parabola_back_from_steady_points() -> None:
    for CL_minD in (0.0, 0.15, 0.4):
        assert answer(PIW_VIW_THREE, steady(polar(CL_minD)), "steady") == pytest.approx(
            polar(CL_minD), rel=1e-6, abs=1e-9
        )


@pytest.mark.parametrize("method", [PIW_VIW_TWO, W_DELTA, W_DELTA_SLOW])
def test_two_terms_give_a_parabola_about_zero_lift_back(method: Method) -> None:
    assert answer(method, steady(polar(0.0)), "steady") == pytest.approx(polar(0.0), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize(("CL_minD", "wrong"), [(0.15, 0.06), (0.40, 0.21)])
def test_two_terms_are_wrong_at_low_speed_by_what_the_method_says(CL_minD: float, wrong: float) -> None:
    """Method section 2: 6 % at low speed for CL_minD = 0.15, 21 % for 0.40, by a line through points of equal weight.

    With weights by relative error, as `steady` has them, the fit is better at low speed: 3 and 8 %.
    """
    at = curve.Condition(W, 1.225, S)
    V = np.linspace(11.58, 22.86, 30)  # 38 to 75 ft/s
    given, runs = joined([flown(np.full(20, v), polar(CL_minD), 1.225) for v in V], "steady")
    problem = PIW_VIW_TWO.problem(given, runs, AIRCRAFT)
    assert isinstance(problem, regression.Points)
    equal = dataclasses.replace(problem, sigma=np.ones(len(V)))
    true, classic, weighted = (
        curve.power_required(V, curve.Polar(A, NO_DOUBT), at)[0]
        for A in (polar(CL_minD), equal.values(), problem.values())
    )
    assert abs(classic / true - 1)[0] == pytest.approx(wrong, rel=0.1)
    assert abs(weighted / true - 1)[0] < 0.5 * wrong


def test_both_forms_of_w_over_delta_say_the_same() -> None:
    parts = steady(polar(0.15))
    assert answer(W_DELTA, parts, "steady") == pytest.approx(
        answer(W_DELTA_SLOW, steady(polar(0.15)), "steady"), rel=1e-9
    )


def test_piw_and_viw_do_not_know_weight_or_density() -> None:
    """The same lift coefficients at another weight and density: the same PIW and VIW to rounding (2.3), (2.5)."""
    A = polar()
    here = joined(steady(A), "steady")
    heavier = dataclasses.replace(AIRCRAFT, mass=dataclasses.replace(AIRCRAFT.mass, weight_N=1.3 * W))
    factor = np.sqrt(1.3 * 1.15 / 0.9)
    there = [flown(np.full(60, factor * V), A, 0.9, weight_N=1.3 * W) for V in SPEEDS]
    one = piw_viw(steady_points(*here, AIRCRAFT), AIRCRAFT)
    other = piw_viw(steady_points(*joined(there, "steady"), heavier), heavier)
    assert np.array(other) == pytest.approx(np.array(one), rel=1e-9)


def test_piw_is_power_at_the_standard_weight_and_sea_level() -> None:
    A = polar()
    PIW, VIW = piw_viw(steady_points(*joined(steady(A), "steady"), AIRCRAFT), AIRCRAFT)
    standard = curve.Condition(AIRCRAFT.mass.standard_weight_N, SEA_LEVEL_DENSITY, S)
    assert PIW == pytest.approx(curve.power_required(VIW, curve.Polar(A, NO_DOUBT), standard)[0], rel=1e-9)


def test_points_hold_for_another_weight_and_density() -> None:
    points = as_points(*joined(steady(polar()), "steady"), AIRCRAFT)
    A = polar()
    for point in points:
        assert point.CD == pytest.approx(A[0] + A[1] * point.CL + A[2] * point.CL**2, rel=1e-9)


def test_what_went_into_speed_and_height_is_no_power_required() -> None:
    """A steady point that drifts by 0.02 m/s^2 and climbs by 0.2 m/s: 1.2 + 7.5 W of thrust power, none of it drag."""
    A = polar()
    drifting = [flown(V + 0.02 * np.arange(60) * STEP_S, A, 1.15, gamma=0.2 / V) for V in SPEEDS]
    assert answer(PIW_VIW_THREE, drifting, "steady") == pytest.approx(A, rel=2e-3)


def runs_of_speed(A) -> list[pd.DataFrame]:
    up = np.linspace(11.5, 24.0, 50)
    return [flown(up, A, 1.15), flown(up[::-1], A, 1.15), flown(up, A, 1.15, gamma=0.02)]


@pytest.mark.parametrize("method", [DIRECT, FROM_SPEED])
def test_direct_drag_gives_the_polar_back_from_accelerations_and_climbs(method: Method) -> None:
    assert answer(method, runs_of_speed(polar()), "acceleration") == pytest.approx(polar(), rel=1e-6)


def test_energy_gives_the_polar_back_from_speed_and_height_alone() -> None:
    """To the error of the trapezoidal rule over 0.2 s, (dt^2/12) f''/f of each integral: 1e-4."""
    fitted = answer(ENERGY, runs_of_speed(polar()), "acceleration")
    V = np.array([12.0, 15.0, 20.0, 23.5])
    at = curve.Condition(W, 1.15, S)
    power, true = (curve.power_required(V, curve.Polar(A, NO_DOUBT), at)[0] for A in (fitted, polar()))
    assert power == pytest.approx(true, rel=2e-3)


def test_points_intervals_cover_as_often_as_they_say_however_few_points() -> None:
    """500 draws of six points of known standard errors: 95 % or more, less three standard errors of a share, 2.9 %."""
    rng = np.random.default_rng(3)
    A = polar()
    CL = np.linspace(0.3, 1.0, 6)
    X = np.stack([np.ones_like(CL), CL, CL**2], axis=1)
    sigma = 0.01 * (X @ A)
    hits = 0
    for _ in range(500):
        problem = regression.Points(X, X @ A + sigma * rng.standard_normal(6), sigma, regression.THREE_TERM, CL)
        error = problem.values() - A
        hits += abs(X[2] @ error) < NORMAL_95 * np.sqrt(X[2] @ problem.noise() @ X[2])
    assert hits / 500 > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 500)


@pytest.mark.parametrize(
    ("method", "speeds", "cause"),
    [
        (PIW_VIW_THREE, (13.0, 20.0), "at 3 different speeds are needed, there are 2"),
        (PIW_VIW_THREE, (13.0, 13.4, 20.0), "there are 2"),
        (PIW_VIW_TWO, (13.0, 13.2), "at 2 different speeds are needed, there are 1"),
        (W_DELTA, (13.0,), "there are 1"),
    ],
)
def test_too_few_speeds_for_a_form_are_refused(method: Method, speeds, cause: str) -> None:
    with pytest.raises(InputError, match=cause):
        answer(method, [flown(np.full(60, V), polar(), 1.15) for V in speeds], "steady")


@pytest.mark.parametrize("method", [DIRECT, ENERGY, FROM_SPEED])
def test_runs_without_thrust_are_no_runs(method: Method) -> None:
    parts = runs_of_speed(polar())
    for part in parts:
        part["thrust"] = part["thrust_felt"] = np.nan
    with pytest.raises(InputError, match="no run has all the data"):
        answer(method, parts, "acceleration")


def test_steady_points_without_thrust_are_no_points() -> None:
    parts = steady(polar())
    for part in parts:
        part["thrust"] = np.nan
    with pytest.raises(InputError, match="no steady point has thrust data"):
        answer(PIW_VIW_THREE, parts, "steady")


def test_energy_is_refused_in_rough_air() -> None:
    """Methods that integrate over a run are ruined by turbulence (method section 6): 0.8 m/s are W20 = 15 kt."""
    parts = runs_of_speed(polar())
    for part in parts:
        part["gust_mps"] = 0.8
    with pytest.raises(InputError, match="too turbulent"):
        answer(ENERGY, parts, "acceleration")


def test_a_steady_point_in_gusts_is_known_worse_by_what_they_lift() -> None:
    """sigma sqrt(2 T/t) of vertical wind for 0.15 m/s, 4 s and a point of 11.8 s, times the weight: 4.7 W."""
    parts = steady(polar())
    calm = steady_points(*joined(parts, "steady"), AIRCRAFT).error
    for part in parts:
        part["gust_mps"] = 0.15
    gusty = steady_points(pd.concat(parts), joined([p.copy() for p in steady(polar())], "steady")[1], AIRCRAFT).error
    assert np.sqrt(gusty**2 - calm**2) == pytest.approx(0.15 * np.sqrt(2 * 4 / 11.8) * W, rel=1e-6)


def test_what_gusts_add_to_the_balance_of_energy_is_in_its_interval() -> None:
    """100 flights of four runs through gusts of W20 = 3 kt, with nothing else wrong: 95 % and more are covered.

    Rising air lifts at the cost of nothing, air that comes on faster adds V du: both as height, (w t - V u/g).
    """
    A, rng = polar(), np.random.default_rng(11)
    at = curve.Condition(W, 1.15, S)
    V = np.array([12.5, 15.0, 18.0, 22.0])
    true = curve.power_required(V, curve.Polar(A, NO_DOUBT), at)[0]
    up = np.linspace(11.5, 24.0, 50)
    gusts = {"gust_mps": 0.15, "gust_s": 2.0, "gust_along_mps": 0.25, "gust_along_s": 9.0}

    def drawn(sigma: float, time_s: float) -> np.ndarray:
        values = [sigma * rng.standard_normal()]
        stays = np.exp(-STEP_S / time_s)
        for new in sigma * np.sqrt(1 - stays**2) * rng.standard_normal(len(up) - 1):
            values.append(stays * values[-1] + new)
        return np.array(values)

    hits = []
    for _ in range(100):
        parts = [flown(speed, A, 1.15).assign(**gusts) for speed in (up, up[::-1], up, up[::-1])]
        for part in parts:
            w, u = drawn(0.15, 2.0), drawn(0.25, 9.0)
            part["height_felt"] += np.cumsum(w) * STEP_S - part["V"] * u / GRAVITY_MPS2
        given, runs = joined(parts, "acceleration")
        problem = ENERGY.problem(given, runs, AIRCRAFT)
        power, error = curve.power_required(V, curve.Polar(problem.values(), problem.noise()), at)
        hits.append(np.abs(power - true) < NORMAL_95 * error)
    assert np.mean(hits, axis=0).min() > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 100)
