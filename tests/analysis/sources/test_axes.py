"""Axes that a straight flight does not show."""

import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.sources import axes
from flightpower.analysis.sources.axes import check_axes
from flightpower.flight.errors import InputError


def circling(turn: float) -> pd.DataFrame:
    """Air data of a minute at 15 m/s whose yaw rate swings by 0.4 rad/s; `turn` is the sign of the GPS course."""
    t_s = np.arange(0, 60, 0.04)
    rate = 0.4 * np.sin(2 * np.pi * t_s / 20)
    course = turn * np.cumsum(rate) * 0.04
    roll_rate = np.gradient(np.arcsin(15 * rate / 9.80665), 0.04)
    steady = {"V_mps": 15.0, "qbar_Pa": 138.0, "q_c_Pa": 138.0, "az_mps2": -9.8, "flying": True}
    columns = ("ax_mps2", "ay_mps2", "q_radps", "alpha_rad", "beta_rad", "dp_alpha_Pa", "dp_beta_Pa", "height_m")
    velocity = {"gps_north_mps": 15 * np.cos(course), "gps_east_mps": 15 * np.sin(course), "gps_down_mps": 0.0}
    return pd.DataFrame(
        dict.fromkeys(columns, 0.0) | steady | velocity | {"p_radps": roll_rate, "r_radps": rate},
        index=pd.Index(t_s, name="t_s"),
    ).assign(qbar_Pa=138 + np.linspace(0, 1e-3, len(t_s)))


def test_a_yaw_rate_against_the_course_is_refused() -> None:
    check_axes(circling(1), "flight.mcap")
    with pytest.raises(InputError) as caught:
        check_axes(circling(-1), "flight.mcap")
    assert str(caught.value) == (
        "flight.mcap: /imu and /gps: angular_rate_z_radps turns against the course of velocity_north_mps and"
        " velocity_east_mps: the rate is not positive to the right, or north and east are exchanged"
    )


def test_a_roll_rate_out_of_the_turn_is_refused() -> None:
    table = circling(1)
    with pytest.raises(InputError, match="angular_rate_x_radps has the wrong sign; write it positive right wing down"):
        check_axes(table.assign(p_radps=-table["p_radps"]), "flight.mcap")
    check_axes(table.assign(p_radps=0.0), "flight.mcap")


def test_the_climb_rate_is_that_of_the_height() -> None:
    t_s = np.arange(0, 60, 0.04)
    table = pd.DataFrame({"height_m": 50 + 2.0 * t_s}, index=pd.Index(t_s, name="t_s"))
    climb = axes._climb_mps(table).dropna()
    assert np.allclose(climb.iloc[50:-50], 2.0) and len(climb) > 1400


def test_means_are_of_stretches_that_count_as_a_whole() -> None:
    t_s = np.arange(0, 10, 0.04)
    table = pd.DataFrame({"V_mps": t_s}, index=pd.Index(t_s, name="t_s"))
    means = axes._means(table, pd.Series(t_s < 5.0, index=table.index), 1.0)["V_mps"]
    assert np.diff(means.index) == pytest.approx(1.0)
    finite = means.dropna()
    assert np.allclose(finite, finite.index, atol=0.03) and finite.index.max() < 5.0


def swinging(**change: float) -> pd.DataFrame:
    """Two minutes of dives and climbs: each sensor reads what mechanics demands, times its factor in `change`."""
    t_s = np.arange(0, 120, 0.04)
    V = 18 + 4 * np.sin(0.5 * t_s)
    Vdot = 2 * np.cos(0.5 * t_s)
    climb = 2 * np.sin(0.3 * t_s)
    lift_over_m = 9.8 + 3 * np.sin(0.7 * t_s)
    q = 0.6 * V**2
    columns = {
        "V_mps": V,
        "qbar_Pa": q,
        "q_c_Pa": q,
        "alpha_rad": 0.02 * lift_over_m * 150 / q,
        "beta_rad": 0.03 * np.sin(1.1 * t_s),
        "dp_alpha_Pa": 0.4 * lift_over_m * 30,
        "dp_beta_Pa": 0.05 * q * np.sin(1.1 * t_s),
        "ax_mps2": Vdot + 9.8 * climb / V,
        "ay_mps2": -0.02 * q * np.sin(1.1 * t_s) * 0.03,
        "az_mps2": -lift_over_m,
        "p_radps": 0.0,
        "q_radps": (lift_over_m - 9.8) / V,
        "r_radps": 0.0,
        "height_m": 60 - 2 / 0.3 * np.cos(0.3 * t_s),
        "gps_north_mps": V,
        "gps_east_mps": 0.0,
        "gps_down_mps": -climb,
        "flying": True,
    }
    table = pd.DataFrame(columns, index=pd.Index(t_s, name="t_s"))
    for name, factor in change.items():
        table[name] *= factor
    return table


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q_radps": 57.3}, "degrees per second"),
        ({"q_radps": -1.0}, "wrong sign; write it positive nose up"),
        ({"alpha_rad": -1.0, "dp_alpha_Pa": -1.0}, "the angle of attack falls where lift rises"),
        ({"dp_alpha_Pa": 0.01}, "is it in hPa"),
        ({"beta_rad": -1.0}, "the side force points to where the air comes from"),
        ({"gps_down_mps": -1.0}, "write it positive downwards"),
        ({"gps_north_mps": 3.6}, "it looks like km/h; multiply by 0.2778"),
        ({"gps_north_mps": 100.0}, "it looks like cm/s; multiply by 0.01"),
        ({"gps_north_mps": 1000.0}, "it looks like mm/s; multiply by 0.001"),
        ({"gps_north_mps": 0.01}, "write m/s"),
    ],
)
def test_a_sensor_that_contradicts_mechanics_is_refused(change: dict[str, float], message: str) -> None:
    check_axes(swinging(), "flight.mcap")
    with pytest.raises(InputError, match=message):
        check_axes(swinging(**change), "flight.mcap")


@pytest.mark.parametrize("name", ["gps_down_mps", "q_radps", "ax_mps2", "ay_mps2", "beta_rad", "dp_beta_Pa"])
def test_a_sensor_that_shows_nothing_of_the_motion_is_not_called_reversed(name: str) -> None:
    """Only a sensor that contradicts the motion is: noise, gusts and calm flights give small correlations of either
    sign."""
    table = swinging()
    noise = np.random.default_rng(1).normal(0, float(table[name].std()), len(table))
    check_axes(table.assign(**{name: noise}), "flight.mcap")


def blended(wanted: pd.Series, correlation: float) -> np.ndarray:
    """A signal as strong as `wanted` and correlated with it; the rest is its Hilbert transform, 90 deg out of phase."""
    x = wanted.to_numpy() - wanted.mean()
    spectrum = np.fft.rfft(x)
    quarter = np.fft.irfft(-1j * spectrum, len(x))
    return np.asarray(correlation * x + np.sqrt(1 - correlation**2) * quarter * x.std() / quarter.std())


def judged(table: pd.DataFrame) -> str:
    """The message on a table; empty if it is accepted."""
    try:
        check_axes(table, "flight.mcap")
    except InputError as error:
        return str(error)
    return ""


def with_correlation(name: str, correlation: float) -> pd.DataFrame:
    """`swinging` with one sensor that has this correlation with what mechanics demands of it; right signs give +1."""
    table = swinging()
    demanded = {
        "q_radps": (-table["az_mps2"] - 9.8) / table["V_mps"],
        "alpha_rad": -table["az_mps2"] / table["qbar_Pa"],
        "dp_beta_Pa": -table["az_mps2"] / table["qbar_Pa"] * table["q_c_Pa"].mean(),
        "ay_mps2": -table["beta_rad"] * table["qbar_Pa"],
        "ax_mps2": table["V_mps"].diff().fillna(0.0) / 0.04 + 9.8 * -table["gps_down_mps"] / table["V_mps"],
    }[name]
    az_mps2 = blended(demanded, correlation)
    if name == "ax_mps2":  # along the path, as the check computes it
        az_mps2 = (az_mps2 - table["az_mps2"] * np.sin(table["alpha_rad"])) / np.cos(table["alpha_rad"])
    if name == "dp_beta_Pa":
        az_mps2 = az_mps2 / demanded.mean() * table["q_c_Pa"].mean() * table["q_c_Pa"] / table["q_c_Pa"].mean()
    return table.assign(**{name: az_mps2})


@pytest.mark.parametrize(
    ("name", "small", "large", "message"),
    [
        ("q_radps", -0.2, -0.5, "positive nose up"),  # -0.35
        ("alpha_rad", -0.4, -0.65, "the angle of attack falls where lift rises"),  # -0.5
        ("ax_mps2", -0.3, -0.7, "write it positive forward"),  # -0.5
        ("ay_mps2", -0.3, -0.5, "points to where the air comes from"),  # 0.4 against
    ],
)
def test_from_a_correlation_on_a_sensor_is_reversed(name: str, small: float, large: float, message: str) -> None:
    assert judged(with_correlation(name, small)) == ""
    assert message in judged(with_correlation(name, large))


def test_alpha_and_beta_are_exchanged_if_beta_follows_the_lift_and_much_better_than_alpha() -> None:
    """A correlation of 0.6 that exceeds alpha's by 0.2 is required."""
    assert judged(with_correlation("dp_beta_Pa", 0.95).assign(dp_alpha_Pa=swinging()["dp_alpha_Pa"])) == ""
    calm = {"dp_alpha_Pa": 0.1 * swinging()["q_c_Pa"]}  # no angle of attack appears
    assert judged(with_correlation("dp_beta_Pa", 0.5).assign(**calm)) == ""
    assert "exchanged" in judged(with_correlation("dp_beta_Pa", 0.7).assign(**calm))
    lift = -swinging()["az_mps2"] / swinging()["qbar_Pa"]
    less = {"dp_alpha_Pa": (blended(lift, 0.6) / lift.mean() + 1) * swinging()["q_c_Pa"]}
    assert judged(with_correlation("dp_beta_Pa", 0.72).assign(**less)) == ""
    assert "exchanged" in judged(with_correlation("dp_beta_Pa", 0.92).assign(**less))


def test_only_motion_that_is_there_is_judged() -> None:
    """The limits are standard deviations of 0.5 m/s of climb, 0.3 m/s^2 along the path, 0.1 rad/s of turn and 5 % of
    lift."""
    for climb, refused in ((0.45, False), (0.55, True)):
        t_s = swinging().index.to_numpy()
        rate = np.sqrt(2) * climb * np.sin(0.3 * t_s)
        height = 60 - np.sqrt(2) * climb / 0.3 * np.cos(0.3 * t_s)
        table = swinging().assign(height_m=height, gps_down_mps=rate)
        assert ("positive downwards" in judged(table)) == refused
    for gain, refused in ((0.27, False), (0.33, True)):
        t_s = swinging().index.to_numpy()
        V = 18 + np.sqrt(2) * gain / 0.5 * np.sin(0.5 * t_s)
        still = {"height_m": 60.0, "gps_down_mps": 0.0, "alpha_rad": 1e-9 * swinging()["alpha_rad"]}
        table = swinging().assign(V_mps=V, ax_mps2=-np.sqrt(2) * gain * np.cos(0.5 * t_s), **still)
        assert ("positive forward" in judged(table)) == refused
    for turn, refused in ((0.09, False), (0.12, True)):
        t_s = circling(1).index.to_numpy()
        rate = np.sqrt(2) * turn * np.sin(2 * np.pi * t_s / 20)
        course = -np.cumsum(rate) * 0.04
        velocity = {"gps_north_mps": 15 * np.cos(course), "gps_east_mps": 15 * np.sin(course)}
        assert ("turns against the course" in judged(circling(1).assign(r_radps=rate, **velocity))) == refused
    for spread, refused in ((0.045, False), (0.055, True)):
        lift = 1 + np.sqrt(2) * spread * np.sin(0.7 * swinging().index.to_numpy())
        level = {"az_mps2": -9.8 * lift, "V_mps": 18.0, "height_m": 60.0, "q_radps": 0.0}
        # qbar is nearly constant: its lowest tenths are left out
        level |= {"q_c_Pa": 200.0, "qbar_Pa": np.linspace(200, 200.001, len(lift)), "alpha_rad": -0.05 * lift}
        message = judged(swinging().assign(**level, dp_alpha_Pa=-100 * lift, gps_down_mps=0.0))
        assert ("falls where lift rises" in message) == refused


@pytest.mark.parametrize(("slope", "refused"), [(0.026, True), (0.035, False)])
def test_alphas_pressure_changes_with_the_lift_by_some_per_cent_of_the_dynamic_pressure(slope, refused) -> None:
    table = swinging()
    lift = -table["az_mps2"] / table["qbar_Pa"]
    table["dp_alpha_Pa"] = slope * lift / lift.mean() * table["q_c_Pa"]
    assert ("is it in hPa" in judged(table)) == refused


@pytest.mark.parametrize(("ratio", "refused"), [(2.4, False), (2.6, True), (0.06, False), (0.04, True)])
def test_the_ground_speed_is_that_of_the_air_and_a_wind(ratio: float, refused: bool) -> None:
    table = swinging()
    counted = table["V_mps"][table["qbar_Pa"] > table["qbar_Pa"].quantile(0.15)].median()
    message = judged(table.assign(gps_north_mps=ratio * 0.6 * counted, gps_east_mps=ratio * 0.8 * counted))
    assert ("m/s (median of the flight) at" in message) == refused


@pytest.mark.parametrize(
    ("ratio", "remedy"),
    [(5.2, "like km/h"), (5.6, "write m/s"), (45.0, "write m/s"), (55.0, "like cm/s"), (145.0, "like cm/s")],
)
def test_a_unit_is_named_if_it_gives_a_ground_speed_near_the_airspeed(ratio: float, remedy: str) -> None:
    """The wind may be at most half the airspeed."""
    table = swinging()
    counted = table["V_mps"][table["qbar_Pa"] > table["qbar_Pa"].quantile(0.15)].median()
    assert remedy in judged(table.assign(gps_north_mps=ratio * counted, gps_east_mps=0.0))


def test_a_log_may_begin_at_any_time() -> None:
    late = swinging()
    late.index += 1000.0
    assert judged(late) == ""
    assert "positive downwards" in judged(late.assign(gps_down_mps=-late["gps_down_mps"]))


def test_rates_need_a_force_of_less_than_the_specific_force_and_gravity_for_all_but_a_twentieth_of_the_flight() -> None:
    """The slack is 5 m/s^2. The slowest 15 % of the flight do not count, since wheels may carry some of the weight
    there."""
    table = swinging()
    most = np.sqrt(table["ax_mps2"] ** 2 + table["ay_mps2"] ** 2 + table["az_mps2"] ** 2) + 9.80665
    turning = {
        more: np.sqrt(((most + more) / table["V_mps"]) ** 2 - table["q_radps"] ** 2) for more in (4.0, 6.0, 30.0)
    }
    assert judged(table.assign(r_radps=turning[4.0])) == ""
    assert "degrees per second" in judged(table.assign(r_radps=turning[6.0]))
    quick = table["qbar_Pa"] > table["qbar_Pa"].quantile(0.5)
    for share, refused in ((0.015, False), (0.08, True)):  # shares of the flight that counts, all in its fast half
        rows = quick & (np.cumsum(quick) <= 2 * share * len(table) * 0.85)
        assert ("degrees per second" in judged(table.assign(r_radps=turning[30.0].where(rows, 0.0)))) == refused
    for slowest, refused in ((0.15, False), (0.30, True)):
        rows = table["qbar_Pa"] <= table["qbar_Pa"].quantile(slowest)
        assert ("degrees per second" in judged(table.assign(r_radps=turning[30.0].where(rows, 0.0)))) == refused


def test_the_force_along_the_path_has_the_share_of_the_angle_of_attack() -> None:
    """While the aircraft slows down at a growing angle of attack, lift still makes the accelerometer's x axis read
    more."""
    t_s = swinging().index.to_numpy()
    V, Vdot = 18 + np.sin(0.5 * t_s), 0.5 * np.cos(0.5 * t_s)
    alpha = 0.15 - 0.1 * np.cos(0.5 * t_s)
    body = {
        "ax_mps2": Vdot * np.cos(alpha) + 9.8 * np.sin(alpha),
        "az_mps2": Vdot * np.sin(alpha) - 9.8 * np.cos(alpha),
    }
    # The height is constant; lift at the angle of attack is not judged here.
    table = circling(1).iloc[:0].reindex(t_s).assign(**dict.fromkeys(circling(1).columns, 0.0))
    table = table.assign(V_mps=V, alpha_rad=alpha, qbar_Pa=1e6 + np.arange(len(t_s)), q_c_Pa=1e6, flying=True, **body)
    table.loc[:, "gps_north_mps"] = V
    assert judged(table) == ""
    assert "positive forward" in judged(table.assign(alpha_rad=0.0))


def test_a_climb_at_constant_speed_needs_force() -> None:
    t_s = swinging().index.to_numpy()
    table = swinging().assign(V_mps=18.0, ax_mps2=9.8 * 2 * np.sin(0.3 * t_s) / 18.0, alpha_rad=0.0)
    assert judged(table) == ""
    assert "positive forward" in judged(table.assign(ax_mps2=-table["ax_mps2"]))
