"""Effects of rotation on probe and IMU are removed at the center of gravity; bank angles of steady flight."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.air.air import (
    _stuck,
    _where_it_began,
    air_data,
    bank_angle,
    specific_force_at_cg,
    with_sensors_elsewhere,
)
from flightpower.analysis.air.probe import FittedMap, ProbeCalibration
from flightpower.analysis.sources.daemon import COLUMNS, speed_scale
from flightpower.flight.aircraft import Aircraft, ProbeInstallation
from flightpower.flight.probe_maps import FIRST_FORMAT
from flightpower.flight.propeller import Propeller

V_MPS, ALPHA_RAD, BETA_RAD = 15.0, 0.05, 0.03
DENSITY_KGPM3 = 1.225  # of the standard atmosphere at sea level
QBAR_PA = DENSITY_KGPM3 * V_MPS**2 / 2
G_MPS2 = 9.80665


def plane(*powers: tuple[int, int], slope: float) -> FittedMap:
    return FittedMap(powers=list(powers), coefficients=[slope], residual_rms=0.0, order=1)


# alpha = 0.5 C_alpha, beta = 0.4 C_beta, q_c = qbar.
LINEAR_PROBE = ProbeCalibration(
    format=FIRST_FORMAT, source="", points=30,
    alpha_rad=plane((1, 0), slope=0.5), beta_rad=plane((0, 1), slope=0.4), q_ratio=plane((0, 0), slope=1.0),
    alpha_scale_sigma=0.0, hull=[(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)],
)  # fmt: skip


def log_of(rates_radps, alpha_rad: float, beta_rad: float, force_mps2=(0.0, 0.0, -G_MPS2)) -> pd.DataFrame:
    """A minute of constant readings: the flow at the probe, and rates and specific force at the IMU."""
    t = np.arange(0, 60, 0.04)
    table = pd.DataFrame(np.nan, index=pd.Index(t, name="t_s"), columns=list(COLUMNS))
    noise = np.random.default_rng(0).normal(0, 0.05, len(t))  # otherwise transducers would seem stuck
    constant = dict(zip(("p_radps", "q_radps", "r_radps"), rates_radps, strict=True))
    constant |= dict(zip(("ax_mps2", "ay_mps2", "az_mps2"), force_mps2, strict=True))
    constant |= {"static_Pa": 101_325.0, "static_temperature_K": 288.15, "n_revps": 90.0}
    pressures = {"dp_alpha_Pa": 2 * alpha_rad * QBAR_PA, "dp_beta_Pa": 2.5 * beta_rad * QBAR_PA, "q_c_Pa": QBAR_PA}
    return table.assign(**constant, **{name: value + noise for name, value in pressures.items()})


def at_probe(rates_radps, x_m: float) -> tuple[float, float]:
    """(alpha, beta) at a point x_m ahead of the center of gravity: its velocity is v + omega x r."""
    u, v, w = V_MPS * np.array(
        [np.cos(ALPHA_RAD) * np.cos(BETA_RAD), np.sin(BETA_RAD), np.sin(ALPHA_RAD) * np.cos(BETA_RAD)]
    ) + np.cross(rates_radps, (x_m, 0.0, 0.0))
    return float(np.arctan2(w, u)), float(np.arcsin(v / np.sqrt(u**2 + v**2 + w**2)))


@pytest.mark.parametrize("rates_radps", [(0.0, 0.0, 0.5), (0.0, 0.5, 0.0), (0.0, -0.4, -0.3)])
def test_a_turning_boom_changes_no_angle_at_the_center_of_gravity(
    nexstar: Aircraft, propeller: Propeller, rates_radps
) -> None:
    """At 0.5 rad/s a probe 0.6 m ahead sees 1.1 deg more or less; the remaining error is of second order, 0.05 deg."""
    aircraft = replace(nexstar, probe=ProbeInstallation(position_m=(0.6, 0.0, 0.0), upwash_per_CL_rad=0.0))
    table = log_of(rates_radps, *at_probe(rates_radps, 0.6))
    air = air_data(table, aircraft, LINEAR_PROBE, propeller, speed_scale(aircraft)).table
    assert np.degrees(air["alpha_rad"].mean() - ALPHA_RAD) == pytest.approx(0.0, abs=0.05)
    assert np.degrees(air["beta_rad"].mean() - BETA_RAD) == pytest.approx(0.0, abs=0.05)


def test_upwash_in_proportion_to_lift_is_taken_out(nexstar: Aircraft, propeller: Propeller) -> None:
    """The upwash is 0.02 rad at the lift coefficient of level flight, weight over qbar S."""
    CL = nexstar.mass.weight_N / (QBAR_PA * nexstar.geometry.wing_area_m2)
    aircraft = replace(nexstar, probe=ProbeInstallation(position_m=(0.6, 0.0, 0.0), upwash_per_CL_rad=0.02 / CL))
    air = air_data(
        log_of((0.0, 0.0, 0.0), ALPHA_RAD + 0.02, 0.0), aircraft, LINEAR_PROBE, propeller, speed_scale(aircraft)
    ).table
    assert air["alpha_rad"].mean() == pytest.approx(ALPHA_RAD, abs=2e-4)


@pytest.mark.parametrize("scale", [1.0, 0.6])
def test_upwash_follows_the_lift_of_a_porpoise(nexstar: Aircraft, propeller: Propeller, scale: float) -> None:
    """The lift coefficient swings by half at 0.7 Hz, and the upwash with it. An upwash averaged over 0.5 s would lose
    a fifth of that, and the slope of angle of attack would absorb the loss."""
    slower = nexstar.weighing(nexstar.mass.weight_N * scale**2)
    CL = slower.mass.weight_N / (QBAR_PA * slower.geometry.wing_area_m2)
    aircraft = replace(slower, probe=ProbeInstallation(position_m=(0.0, 0.0, 0.0), upwash_per_CL_rad=0.02 / CL))
    table = log_of((0.0, 0.0, 0.0), ALPHA_RAD, 0.0)
    swing = 0.5 * np.sin(2 * np.pi * 0.7 * table.index.to_numpy())
    air = air_data(
        table.assign(az_mps2=-G_MPS2 * (1 + swing)), aircraft, LINEAR_PROBE, propeller, speed_scale(aircraft)
    ).table
    assert np.polyfit(swing, air["alpha_by_upwash_rad"], 1) == pytest.approx([0.02, 0.02], rel=2e-3)


def test_speed_and_density_are_those_of_the_pressures(nexstar: Aircraft, propeller: Propeller) -> None:
    air = air_data(
        log_of((0.0, 0.0, 0.0), ALPHA_RAD, 0.0), nexstar, LINEAR_PROBE, propeller, speed_scale(nexstar)
    ).table
    assert air["rho"].mean() == pytest.approx(DENSITY_KGPM3, rel=1e-3)
    assert air["V_mps"].mean() == pytest.approx(V_MPS, rel=1e-3)
    assert air["J"].mean() == pytest.approx(V_MPS / (90.0 * propeller.diameter_m), rel=1e-3)


def test_a_tray_that_warms_itself_does_not_make_the_air_warmer(nexstar: Aircraft, propeller: Propeller) -> None:
    """The tray warms by 10 K in a minute at the height where the log began: density stays that of the first reading."""
    table = log_of((0.0, 0.0, 0.0), ALPHA_RAD, 0.0)
    warming = table.assign(static_temperature_K=288.15 + np.linspace(0, 10, len(table)))
    air = air_data(warming, nexstar, LINEAR_PROBE, propeller, speed_scale(nexstar)).table
    assert air["rho"].iloc[-1] == pytest.approx(DENSITY_KGPM3, rel=2e-3)


@pytest.mark.parametrize(("seconds", "noted"), [(1.0, False), (3.0, True)])
def test_flight_outside_the_probe_s_range_is_noted_if_it_is_more_than_a_moment(
    nexstar: Aircraft, propeller: Propeller, seconds: float, noted: bool
) -> None:
    """1 s of a minute is less than 2 %, 3 s are 5 %: C_alpha of 1.5 lies outside the hull."""
    table = log_of((0.0, 0.0, 0.0), ALPHA_RAD, 0.0)
    table.loc[20.0 : 20.0 + seconds, "dp_alpha_Pa"] = 1.5 * QBAR_PA
    air = air_data(table, nexstar, LINEAR_PROBE, propeller, speed_scale(nexstar))
    assert air.table.loc[20.0 : 20.0 + seconds, "V_mps"].isna().all()
    assert any("outside the probe's calibrated range" in note for note in air.notes) == noted
    assert any(note.startswith("5 % of the flight lies outside") for note in air.notes) == noted


def test_the_specific_force_is_that_of_the_center_of_gravity(nexstar: Aircraft) -> None:
    """An IMU at r also feels omega x (omega x r): at 1 rad/s about z and 0.2 m ahead, -0.2 m/s^2 along x."""
    rates, position = (0.0, 0.4, 1.0), (0.2, -0.1, 0.05)
    extra = np.cross(rates, np.cross(rates, position))
    table = log_of(rates, ALPHA_RAD, 0.0, force_mps2=np.array([0.3, -0.2, -G_MPS2]) + extra)
    moved = specific_force_at_cg(table, replace(nexstar, imu_position_m=position))
    result = moved[["ax_mps2", "ay_mps2", "az_mps2"]].mean().tolist()
    assert result == pytest.approx([0.3, -0.2, -G_MPS2], abs=1e-9)


def test_known_offsets_by_vibration_and_the_boom_s_bending_are_taken_out(nexstar: Aircraft, propeller) -> None:
    """The offset at 120 rev/s is 1.44 times that at 100; under 1 g the reading grows by the bending of the boom."""
    table = log_of((0.0, 0.0, 0.0), ALPHA_RAD, 0.0).assign(n_revps=120.0)
    table.loc[:20.0, "n_revps"] = np.nan  # the motor stands
    installation = replace(nexstar.installation, accelerometer_vibration_mps2=(0.1, -0.2, 0.3))
    result = specific_force_at_cg(table, replace(nexstar, installation=installation))
    change = (table - result)[["ax_mps2", "ay_mps2", "az_mps2"]]
    assert change.loc[30.0].tolist() == pytest.approx([0.144, -0.288, 0.432])
    assert not change.loc[:20.0].to_numpy().any()
    bends = replace(nexstar, probe=replace(nexstar.probe, boom_bending_rad=0.02))
    straight, bent = (air_data(table, item, LINEAR_PROBE, propeller, 1.0).table for item in (nexstar, bends))
    assert (straight["alpha_rad"] - bent["alpha_rad"]).dropna().to_numpy() == pytest.approx(0.02)


def flown(seconds: float = 60.0, **columns) -> pd.DataFrame:
    t = np.arange(0, seconds, 0.04)
    zero = dict.fromkeys(("alpha_rad", "beta_rad", "p_radps", "r_radps", "ay_mps2"), 0.0)
    return pd.DataFrame(zero | {"V_mps": V_MPS} | columns, index=pd.Index(t, name="t_s"))


@pytest.mark.parametrize("bank_rad", [0.4, -0.4])
def test_bank_of_a_coordinated_level_turn_at_a_large_angle_of_attack(bank_rad: float) -> None:
    """Lift balances the weight and turns the path; pitch follows from level flight. Assuming cos(theta) = 1 costs 2
    %."""
    alpha = 0.2
    pitch = np.arctan(np.tan(alpha) * np.cos(bank_rad))
    along = np.cos(pitch) * np.cos(bank_rad) * np.cos(alpha) + np.sin(pitch) * np.sin(alpha)
    turn = G_MPS2 * np.cos(pitch) * np.sin(bank_rad) / (V_MPS * along)
    p, r = -turn * np.sin(pitch), turn * np.cos(pitch) * np.cos(bank_rad)
    angle = bank_angle(flown(alpha_rad=alpha, p_radps=p, r_radps=r))
    # The forward pass adds p * 3 s, the integral of p over the time constant; the backward pass subtracts it.
    assert angle[500:1000] == pytest.approx(bank_rad, rel=0.03)


def test_an_aircraft_that_skids_to_and_fro_with_level_wings_has_no_bank() -> None:
    """Its path is straight: the nose swings with vdot + r u = 0, which needs no side force."""
    t = np.arange(0, 60, 0.04)
    v = V_MPS * 0.1 * np.sin(2 * np.pi * t / 20)
    angle = bank_angle(flown(beta_rad=np.arcsin(v / V_MPS), r_radps=-np.gradient(v, 0.04) / V_MPS))
    assert np.degrees(np.abs(angle[250:-250]).max()) < 0.2


def test_bank_of_a_straight_sideslip() -> None:
    """The banked wings balance the side force: g sin(phi) = -ay."""
    angle = bank_angle(flown(beta_rad=0.1, ay_mps2=-1.0))
    assert angle[500:1000] == pytest.approx(np.arcsin(1.0 / G_MPS2), rel=1e-3)


def test_bank_follows_a_quick_roll_by_the_roll_rate() -> None:
    """20 deg to the right and back within a second, which is too quick for the lateral balance to show."""
    t = np.arange(0, 60, 0.04)
    rolled = np.radians(20) * np.where(np.abs(t - 30) < 0.5, (1 + np.cos(2 * np.pi * (t - 30))) / 2, 0.0)
    angle = bank_angle(flown(p_radps=np.gradient(rolled, 0.04)))
    assert np.degrees(angle.max()) == pytest.approx(20, abs=3)
    assert t[np.argmax(angle)] == pytest.approx(30, abs=0.1)


def test_bank_does_not_depend_on_when_the_clock_began() -> None:
    t = np.arange(len(flown())) * 0.04
    rolled = 0.3 * np.sin(1.5 * t)
    table = flown(p_radps=np.gradient(rolled, 0.04))
    later = table.set_axis(table.index + 1000.0)
    assert bank_angle(later) == pytest.approx(bank_angle(table), abs=1e-9)


@pytest.mark.parametrize(("scale", "samples"), [(1.0, 5), (0.5, 20)])
def test_quotients_are_over_a_mean_dynamic_pressure(
    nexstar: Aircraft, propeller: Propeller, scale: float, samples: int
) -> None:
    """The mean is taken over 0.2 s, or four times that at half the speed; dynamic pressure and speed follow each
    sample."""
    wing_loading = DENSITY_KGPM3 / 2 * (scale * 11.0) ** 2
    aircraft = nexstar.weighing(wing_loading * nexstar.geometry.wing_area_m2)
    table = log_of((0.0, 0.0, 0.0), ALPHA_RAD, 0.0)
    table.iloc[700, table.columns.get_loc("q_c_Pa")] = 1.2 * QBAR_PA
    table["dp_alpha_Pa"] = 2 * ALPHA_RAD * QBAR_PA + 1e-3 * np.arange(len(table)) % 0.05
    air = air_data(table, aircraft, LINEAR_PROBE, propeller, speed_scale(aircraft)).table
    alpha = air["alpha_by_upwash_rad"] + air["alpha_rad"]
    lower = np.flatnonzero(alpha.to_numpy() < (1 - 0.1 / samples) * ALPHA_RAD)
    assert len(lower) == samples and abs(lower.mean() - 700) <= 0.5
    assert alpha.iloc[lower].mean() == pytest.approx(ALPHA_RAD / (1 + 0.2 / samples), rel=0.002)
    assert air["qbar_Pa"].iloc[700] == pytest.approx(1.2 * QBAR_PA, rel=1e-9)
    assert air["V_mps"].iloc[700] == pytest.approx(np.sqrt(1.2) * V_MPS, rel=0.006)


def test_thrust_and_advance_ratio_are_those_of_a_turning_propeller(nexstar: Aircraft, propeller: Propeller) -> None:
    """J = V/(n D). Below one revolution a second the motor counts as stopped; no table covers such a slow propeller."""
    table = log_of((0.0, 0.0, 0.0), ALPHA_RAD, 0.0)
    table["n_revps"] = np.select([np.arange(1500) < 500, np.arange(1500) < 1000], [0.9, 1.1], 90.0)
    air = air_data(table, nexstar, LINEAR_PROBE, propeller, speed_scale(nexstar)).table
    assert air["J"].iloc[:500].isna().all() and air["thrust_N"].iloc[:500].isna().all()
    assert air["shaft_power_W"].iloc[:500].isna().all() and not air["propeller_covered"].iloc[:1000].any()
    turning = air.iloc[1000:]
    assert turning["J"].mean() == pytest.approx(V_MPS / (90.0 * propeller.diameter_m), rel=1e-3)
    thrust_N, shaft_W = propeller.thrust_and_power(V_MPS, 90.0, DENSITY_KGPM3)
    assert turning["thrust_N"].mean() == pytest.approx(float(thrust_N), rel=2e-3)
    assert turning["shaft_power_W"].mean() == pytest.approx(float(shaft_W), rel=2e-3)
    assert turning["propeller_covered"].all() and air["J"].iloc[500:1000].notna().all()


def test_the_air_on_the_ground_is_that_of_the_first_two_seconds() -> None:
    """Neither electronics that warm by 1 K a second after power-on nor a flight that begins later changes anything."""
    t = np.arange(0, 20, 0.1)
    late = np.where(t > 2.01, 10.0, 0.0)
    table = pd.DataFrame({"static_Pa": 1e5 - 100 * late, "static_temperature_K": 288.0 + t + late}, index=t + 50)
    table.iloc[:3] = np.nan
    pressure_Pa, temperature_K = _where_it_began(table)
    assert pressure_Pa == pytest.approx(1e5 - 1000 * 3 / 21) and temperature_K == pytest.approx(289.3 + 10 * 3 / 21)


@pytest.mark.parametrize(
    ("samples", "spread_Pa", "stuck"), [(240, 0.0, False), (260, 0.0, True), (260, 0.018, True), (260, 0.022, False)]
)
def test_a_transducer_without_noise_for_ten_seconds_of_flight_is_stuck(samples, spread_Pa, stuck) -> None:
    """The readings span less than 0.02 Pa. On the ground, below the dynamic pressure of flight, this does not count."""
    q_c = pd.Series(np.r_[np.full(100, 20.0), np.full(samples, 100.0)], name="q_c_Pa")
    pressure = pd.Series(np.r_[np.arange(100.0), np.linspace(7.0, 7.0 + spread_Pa, samples)], name="dp_beta_Pa")
    assert _stuck(pressure, q_c, 30.0) is stuck


def test_air_data_do_not_depend_on_the_time_at_which_a_log_begins(nexstar: Aircraft, propeller: Propeller) -> None:
    """The origin of the time scale does not matter either; the IMU is off the center of gravity and the rates swing."""
    aircraft = replace(nexstar, imu_position_m=(0.2, 0.0, 0.1))

    def readings_of(begin_s: float) -> pd.DataFrame:
        table = log_of((0.0, 0.0, 0.0), ALPHA_RAD, 0.0)
        table["q_radps"] = 0.3 * np.sin(table.index.to_numpy())
        table.index += begin_s
        at_cg = specific_force_at_cg(table, aircraft)
        return air_data(at_cg, aircraft, LINEAR_PROBE, propeller, speed_scale(aircraft)).table

    at_zero, late = readings_of(0.0), readings_of(500.0)
    for name in ("V_mps", "alpha_rad", "ax_mps2", "az_mps2", "bank_rad"):
        assert late[name].to_numpy() == pytest.approx(at_zero[name].to_numpy(), nan_ok=True, abs=1e-9), name


def test_air_data_of_sensors_elsewhere_are_those_of_an_aircraft_file_with_these_places(
    nexstar: Aircraft, propeller: Propeller
) -> None:
    """The probe is 0.25 m further ahead with 0.02 rad more upwash, the IMU 0.1 m further ahead and below, and the rates
    swing. The readings are the same."""
    table = log_of((0.2, 0.0, -0.3), ALPHA_RAD, BETA_RAD)
    table["q_radps"] = 0.5 * np.sin(2 * table.index.to_numpy())
    upwash = nexstar.probe.upwash_per_CL_rad + 0.02
    other = replace(
        nexstar,
        probe=replace(nexstar.probe, position_m=(0.7, 0.0, 0.0), upwash_per_CL_rad=upwash),
        imu_position_m=(0.15, 0.0, 0.12),
    )

    def air_of(aircraft: Aircraft) -> pd.DataFrame:
        at_cg = specific_force_at_cg(table, aircraft)
        return air_data(at_cg, aircraft, LINEAR_PROBE, propeller, speed_scale(aircraft)).table

    before, after = air_of(nexstar), air_of(other)
    moved = with_sensors_elsewhere(before, nexstar, other)
    for name in ("alpha_rad", "beta_rad", "alpha_by_rotation_rad", "alpha_by_upwash_rad", "ax_mps2", "az_mps2"):
        assert moved[name].to_numpy() == pytest.approx(after[name].to_numpy(), nan_ok=True, abs=5e-5), name
        assert np.nanmax(np.abs(after[name] - before[name])) > 5e-3, name
