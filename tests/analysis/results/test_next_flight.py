"""Tests advice for the next flight: effects of sensor errors on power, and the interval once one is reduced."""

from types import SimpleNamespace

import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Polar
from flightpower.analysis.methods.interval_sources import Share
from flightpower.analysis.records.flight import NextFlightLowers
from flightpower.analysis.results.next_flight import BY_SHARE, _effects_W, missing_information, next_flight
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import MATTERS

AT = Condition(weight_N=37.0, rho=1.2, wing_area_m2=0.46)
A = np.array([0.045, -0.02, 0.065])
ALPHA_0, ALPHA_PER_CL, BIAS = 0.04, 0.2, 0.01


class Blocks(dict):  # type: ignore[type-arg]
    flying = np.arange(60) >= 10


def flown(sigma: dict[str, float], gust_mps: float = 0.0) -> SimpleNamespace:
    """Return a flight at 12 to 24 m/s; its angle of attack is linear in lift and measured with a known bias."""
    V = np.linspace(12.0, 24.0, 60)
    CL = 2 * AT.weight_N / (AT.rho * V**2 * AT.wing_area_m2)
    alpha = np.where(Blocks.flying, ALPHA_0 + ALPHA_PER_CL * CL + BIAS, 1.0)
    return SimpleNamespace(
        block_means=Blocks(V_mps=V, alpha_rad=alpha), value=lambda name: {"alpha_bias": BIAS}[name], gust_mps=gust_mps,
        covariance=np.diag([sigma.get(name, 1e-9) ** 2 for name in SENSOR_ERRORS]),
    )  # fmt: skip


@pytest.mark.parametrize("V", [13.0, 20.0])
def test_power_errs_by_the_turned_lift_and_by_the_drag_of_another_speed(V: float) -> None:
    """An error of the angle turns the lift W, so power changes by W V per radian. dD/dV follows from
    D = q S A0 + A1 W + A2 W^2/(q S)."""
    effects, places = _effects_W(flown({}), A, AT, V)  # type: ignore[arg-type]
    of = dict(zip(MATTERS, effects, strict=True))
    qS = AT.rho * V**2 / 2 * AT.wing_area_m2
    alpha = ALPHA_0 + ALPHA_PER_CL * AT.weight_N / qS
    slope = 2 * qS / V * A[0] - 2 * A[2] * AT.weight_N**2 / (qS * V)
    assert of["alpha_bias"] == pytest.approx(AT.weight_N * V)
    assert of["alpha_scale"] == pytest.approx(AT.weight_N * V * alpha)
    assert of["V_scale"] == pytest.approx(-(V**2) * slope - 2 * AT.weight_N * V * alpha, rel=1e-3)
    assert [SENSOR_ERRORS[i] for i in places] == list(MATTERS)


ANGLE = Share.ANGLE_OF_ATTACK


@pytest.mark.parametrize(
    ("largest", "cause"),
    [(share, BY_SHARE[share]) for share in Share if share is not ANGLE] + [(ANGLE, NextFlightLowers.ALPHA_BIAS)],
)
def test_the_largest_part_is_named_and_half_its_error_leaves_a_quarter_of_it(
    largest: Share, cause: NextFlightLowers
) -> None:
    """An error's share is its part of the variance at the speed where the interval is widest in percent."""
    CL = (0.25, 1.1)
    # Only A0 is uncertain, so the interval in percent is widest at the highest speed.
    polar = Polar(A, np.diag([0.002**2, 0.0, 0.0]))
    fastest = np.sqrt(2 * AT.weight_N / (AT.rho * CL[0] * AT.wing_area_m2))
    qSV = AT.rho * fastest**3 / 2 * AT.wing_area_m2

    def sources(V: np.ndarray) -> dict[Share, np.ndarray]:
        total = (AT.rho * V**3 / 2 * AT.wing_area_m2 * 0.002) ** 2
        others = [share for share in Share if share is not largest]
        return {largest: 0.4 * total} | {share: 0.6 / len(others) * total for share in others}

    result = missing_information(flown({"alpha_bias": 0.01}), polar, AT, CL, sources)  # type: ignore[arg-type]
    assert result is not None and result.cause is cause
    assert result.speed_mps == pytest.approx(fastest)
    lift = AT.weight_N / (qSV / fastest)
    half_width = 196 * 0.002 / float(A @ [1, lift, lift**2])
    assert result.percent == pytest.approx(half_width, rel=1e-3)
    assert result.percent_without == pytest.approx(half_width * np.sqrt(0.6 + 0.4 / 4), rel=1e-3)
    (sentence, *_) = next_flight(flown({"alpha_bias": 0.01}), polar, AT, CL, sources).sentences  # type: ignore[arg-type]
    assert f"the largest part of it from {largest}" in sentence
    unknown = Polar(A, np.full((3, 3), np.nan))
    assert missing_information(flown({}), unknown, AT, CL, sources) is None  # type: ignore[arg-type]


@pytest.mark.parametrize(("error", "sigma"), [("alpha_bias", 0.01), ("alpha_scale", 0.2)])
def test_of_the_angle_of_attack_the_error_with_the_larger_effect_is_named(error: str, sigma: float) -> None:
    """A bias of 0.01 rad outweighs a scale error of 1e-9, and a scale error of 0.2 outweighs a bias of 1e-9 rad."""
    polar = Polar(A, np.diag([0.002**2, 0.0, 0.0]))
    trajectory = flown({error: sigma, "V_scale": 0.5})
    result = missing_information(trajectory, polar, AT, (0.25, 1.1), lambda V: {ANGLE: 1 + V, Share.NOISE: V})  # type: ignore[arg-type]
    assert result is not None and result.cause == error


def test_a_narrow_interval_needs_no_other_flight_and_calm_air_no_calmer_day() -> None:
    def sentences(percent: float, gust_mps: float, cause: Share = ANGLE) -> list[str]:
        """Return the advice for a half width in percent at the highest speed, where A0 = 0.04 is all of the drag."""
        polar = Polar(np.array([0.04, 0.0, 0.0]), np.diag([(0.04 * percent / 196) ** 2, 0.0, 0.0]))
        trajectory = flown({"alpha_bias": 1e-4}, gust_mps)
        return list(next_flight(trajectory, polar, AT, (0.25, 1.1), lambda V: {cause: 1e-9 * V}).sentences)  # type: ignore[arg-type]

    assert sentences(0.99 * 0.98, 0.5) == [], "a standard error below half a percent"
    assert len(sentences(1.01 * 0.98, 0.5)) == 2
    assert len(sentences(1.01 * 0.98, 0.0)) == 1
    assert len(sentences(3.0, 0.5, Share.NOISE)) == 1, "only more runs, whatever the air"
    assert len(sentences(3.0, 0.5, Share.WEIGHT)) == 1
