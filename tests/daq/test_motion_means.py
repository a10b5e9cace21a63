"""Speed, height, bank and forces in flight are those of the atmosphere, the probe and the laws of mechanics."""

import math

import pytest

from flightpower.daq.motion_means import Motion, MotionFromMeans
from flightpower.daq.thrust import load_thrust
from flightpower.daq.tick_means import Means
from flightpower.flight.aircraft import load_aircraft
from flightpower.flight.atmosphere import density, pressure_at, temperature_at
from flightpower.flight.probe_maps import PolynomialMap, ProbeMaps
from flightpower.flight.units import GRAVITY_MPS2

NEXSTAR = load_aircraft("nexstar")
GROUND_PA, GROUND_K, ZERO_PA = 95_000.0, 293.0, 4.0
STEP_S = 0.2


def means(t_s: float, V: float, height_m: float, **other: float | None) -> Means:
    static = float(pressure_at(height_m, ground_pressure_Pa=GROUND_PA, ground_temperature_K=GROUND_K))
    rho = float(density(static, temperature_at(height_m, GROUND_K)))
    columns: dict[str, float | None] = {
        "q_c_Pa": ZERO_PA + rho / 2 * V**2, "dp_alpha_Pa": 0.0, "dp_beta_Pa": 0.0, "static_Pa": static,
        "static_temperature_K": GROUND_K, "ax_mps2": 0.0, "ay_mps2": 0.0, "az_mps2": -GRAVITY_MPS2, "p_radps": 0.0,
        "q_radps": 0.0, "r_radps": 0.0, "n_revps": 0.0 if V == 0 else 80.0,
    }  # fmt: skip
    return Means(t_s=t_s, **(columns | other))  # type: ignore[arg-type]


def flown(seconds: float, V: float, height_m: float, probe: ProbeMaps | None = None, **other: float) -> Motion:
    """The motion at the end of so many seconds of steady flight, which follow ten seconds on the ground."""
    source = MotionFromMeans(NEXSTAR, probe, load_thrust("apc-12x8e", folding=False), {})
    for i in range(50):
        assert source.at(means(STEP_S * i, 0.0, 0.0)) is None
    result = None
    for i in range(round(seconds / STEP_S)):
        result = source.at(means(10 + STEP_S * i, V, height_m, **other))
    assert result is not None and source.ground_known
    return result


def test_speed_and_height_are_those_of_the_atmosphere_above_the_ground() -> None:
    result = flown(2.0, 17.0, 80.0)
    assert result.V == pytest.approx(17.0, rel=1e-4) and result.height_m == pytest.approx(80.0, abs=0.01)
    assert result.complete


def test_the_forces_for_the_energy_balance_are_over_mass() -> None:
    result = flown(2.0, 17.0, 80.0, az_mps2=-12.0)
    assert result.drag is not None
    thrust, qS, CL, J = result.drag
    rho = float(
        density(
            pressure_at(80.0, ground_pressure_Pa=GROUND_PA, ground_temperature_K=GROUND_K),
            temperature_at(80.0, GROUND_K),
        )
    )
    table = load_thrust("apc-12x8e", folding=False)
    assert table is not None
    assert thrust == pytest.approx(table.thrust_N(17.0, 80.0, rho) / NEXSTAR.mass_kg, rel=1e-3)
    assert qS == pytest.approx(rho / 2 * 17.0**2 * NEXSTAR.geometry.wing_area_m2 / NEXSTAR.mass_kg, rel=1e-3)
    assert CL * qS == pytest.approx(12.0)
    assert J == pytest.approx(17.0 / (80.0 * table.diameter_m), rel=1e-4)


def test_the_probe_s_map_gives_angles_and_true_dynamic_pressure() -> None:
    """alpha = 0.1 C_alpha, q_c = 0.9 qbar: speed is higher than q_c alone gives, and thrust is turned by alpha."""
    probe = ProbeMaps(
        format="flightpower-probe-1",
        alpha_rad=PolynomialMap([(1, 0)], [0.1]),
        beta_rad=PolynomialMap([(0, 1)], [0.1]),
        q_ratio=PolynomialMap([(0, 0)], [0.9]),
        hull=[(-5.0, -5.0), (5.0, 5.0)],
    )
    plain = flown(2.0, 17.0, 80.0)
    q_c = 0.9 * 17.0**2 * plain.drag[1] * NEXSTAR.mass_kg / NEXSTAR.geometry.wing_area_m2 / 17.0**2  # type: ignore[index]
    tilted = flown(2.0, 17.0 * math.sqrt(0.9), 80.0, probe, dp_alpha_Pa=4.0 * q_c)
    assert tilted.V == pytest.approx(17.0, rel=1e-3)
    assert plain.drag is not None and tilted.drag is not None
    assert tilted.drag[0] / plain.drag[0] == pytest.approx(math.cos(0.4), rel=0.01)


@pytest.mark.parametrize("bank_deg", [30.0, -20.0])
def test_the_bank_of_a_turn_is_found_after_its_time_constant(bank_deg: float) -> None:
    """The turn is coordinated: no side force, and a yaw rate in body axes of g sin(bank)/V."""
    rate = GRAVITY_MPS2 * math.sin(math.radians(bank_deg)) / 17.0
    assert math.degrees(flown(20.0, 17.0, 60.0, r_radps=rate).bank) == pytest.approx(bank_deg, abs=0.1)
    slipping = flown(20.0, 17.0, 60.0, ay_mps2=-GRAVITY_MPS2 * math.sin(math.radians(bank_deg)))
    assert math.degrees(slipping.bank) == pytest.approx(bank_deg, abs=0.1)


def test_a_quick_roll_is_followed_by_the_rate_gyro() -> None:
    source = MotionFromMeans(NEXSTAR, None, None, {})
    for i in range(50):
        source.at(means(STEP_S * i, 0.0, 0.0))
    for i in range(10):
        source.at(means(10 + STEP_S * i, 17.0, 60.0))
    result = None
    for i in range(3):
        result = source.at(means(12 + STEP_S * i, 17.0, 60.0, p_radps=0.5))
    assert result is not None
    keep = math.exp(-STEP_S / 3.0)
    assert result.bank == pytest.approx(0.5 * STEP_S * (keep + keep**2 + keep**3), rel=1e-6)


def test_what_is_no_flight_gives_no_motion() -> None:
    source = MotionFromMeans(NEXSTAR, None, None, {})
    for i in range(50):
        source.at(means(STEP_S * i, 0.0, 0.0))
    assert source.at(means(11.0, 6.0, 0.0)) is None  # 22 Pa
    assert source.at(means(12.0, 15.0, 0.0)) is not None
    assert source.at(means(13.0, 15.0, 0.0, static_Pa=0.4 * GROUND_PA)) is None
    assert source.at(means(14.0, 15.0, 0.0, q_c_Pa=None)) is None
