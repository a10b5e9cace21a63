"""What the next flight should be for: effects of sensor errors on power, and what is left when one is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Polar
from flightpower.analysis.results.next_flight import _effects_W, missing_information, next_flight
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.analysis.trajectory.observability import MATTERS

AT = Condition(weight_N=37.0, rho=1.2, wing_area_m2=0.46)
A = np.array([0.045, -0.02, 0.065])
ALPHA_0, ALPHA_PER_CL, BIAS = 0.04, 0.2, 0.01


class Blocks(dict):  # type: ignore[type-arg]
    flying = np.arange(60) >= 10


def flown(sigma: dict[str, float], gust_mps: float = 0.0) -> SimpleNamespace:
    """A flight at 12 to 24 m/s whose angle of attack is linear in lift and measured with a known bias."""
    V = np.linspace(12.0, 24.0, 60)
    CL = 2 * AT.weight_N / (AT.rho * V**2 * AT.wing_area_m2)
    alpha = np.where(Blocks.flying, ALPHA_0 + ALPHA_PER_CL * CL + BIAS, 1.0)
    return SimpleNamespace(
        block_means=Blocks(V_mps=V, alpha_rad=alpha), value=lambda name: {"alpha_bias": BIAS}[name], gust_mps=gust_mps,
        covariance=np.diag([sigma.get(name, 1e-9) ** 2 for name in SENSOR_ERRORS]),
    )  # fmt: skip


@pytest.mark.parametrize("V", [13.0, 20.0])
def test_power_errs_by_the_turned_lift_and_by_the_drag_of_another_speed(V: float) -> None:
    """An angle's error turns the lift W: W V for each radian. D = q S A0 + A1 W + A2 W^2/(q S) gives dD/dV."""
    effects, places = _effects_W(flown({}), A, AT, V)  # type: ignore[arg-type]
    of = dict(zip(MATTERS, effects, strict=True))
    qS = AT.rho * V**2 / 2 * AT.wing_area_m2
    alpha = ALPHA_0 + ALPHA_PER_CL * AT.weight_N / qS
    slope = 2 * qS / V * A[0] - 2 * A[2] * AT.weight_N**2 / (qS * V)
    assert of["alpha_bias"] == pytest.approx(AT.weight_N * V)
    assert of["alpha_scale"] == pytest.approx(AT.weight_N * V * alpha)
    assert of["V_scale"] == pytest.approx(-(V**2) * slope - 2 * AT.weight_N * V * alpha, rel=1e-3)
    assert [SENSOR_ERRORS[i] for i in places] == list(MATTERS)


@pytest.mark.parametrize(("cause", "sigma"), [("alpha_bias", 0.01), ("alpha_scale", 0.1), ("V_scale", 0.05)])
def test_half_an_error_leaves_a_quarter_of_its_variance(cause: str, sigma: float) -> None:
    """The interval at the speed where it is widest: that of the error and of little noise, both in 95 %."""
    CL = (0.25, 1.1)
    noise = np.zeros((5, 5))
    noise[0, 0] = 0.0005**2
    trajectory = flown({cause: sigma})

    def power(V: float) -> float:
        qS = AT.rho * V**2 / 2 * AT.wing_area_m2
        lift = AT.weight_N / qS
        return float(qS * V * (A @ [1, lift, lift**2]))

    # A0 alone errs, so that the interval in percent is widest at the highest speed.
    fastest = np.sqrt(2 * AT.weight_N / (AT.rho * CL[0] * AT.wing_area_m2))
    qSV = AT.rho * fastest**3 / 2 * AT.wing_area_m2
    effects, _ = _effects_W(trajectory, A, AT, float(fastest))  # type: ignore[arg-type]
    by_error = float(abs(effects[MATTERS.index(cause)])) * sigma
    polar = Polar(A, np.diag([(by_error / qSV) ** 2 + 0.0005**2, 0.0, 0.0]))
    result = missing_information(trajectory, SimpleNamespace(polar=polar, noise=noise), AT, CL)  # type: ignore[arg-type]
    assert result is not None and result.cause == cause
    assert result.speed_mps == pytest.approx(fastest)
    whole, by_noise = np.hypot(by_error, 0.0005 * qSV), 0.0005 * qSV
    assert result.percent == pytest.approx(196 * whole / power(fastest), rel=1e-3)
    assert result.percent_without == pytest.approx(196 * np.hypot(by_error / 2, by_noise) / power(fastest), rel=1e-3)
    unknown = Polar(A, np.full((3, 3), np.nan))
    assert missing_information(trajectory, SimpleNamespace(polar=unknown, noise=noise), AT, CL) is None  # type: ignore[arg-type]


def test_a_narrow_interval_needs_no_other_flight_and_calm_air_no_calmer_day() -> None:
    noise = np.zeros((5, 5))

    def said(percent: float, gust_mps: float, cause: str = "alpha_bias") -> list[str]:
        """The half width at the highest speed, where A0 = 0.04 is all of the drag."""
        only = np.array([0.04, 0.0, 0.0])
        polar = Polar(only, np.diag([(0.04 * percent / 196) ** 2, 0.0, 0.0]))
        noise[0, 0] = polar.covariance[0, 0] if cause == "noise" else 0.0
        trajectory = flown({"alpha_bias": 1e-4}, gust_mps)
        return list(next_flight(trajectory, SimpleNamespace(polar=polar, noise=noise), AT, (0.25, 1.1)).sentences)  # type: ignore[arg-type]

    assert said(0.99 * 0.98, 0.5) == [], "a standard error of half a percent"
    assert len(said(1.01 * 0.98, 0.5)) == 2
    assert len(said(1.01 * 0.98, 0.0)) == 1
    assert len(said(3.0, 0.5, "noise")) == 1, "more runs, whatever the air"
