"""Zeros come from rest or from an earlier measurement; their drift is reported and removed."""

import json

import msgspec
import numpy as np
import pandas as pd
import pytest

from flightpower.analysis.sources.grid import stretches
from flightpower.analysis.sources.grid_settings import REST
from flightpower.analysis.sources.rest import CHANNELS, ZERO_FILE, _around_flight, mean_at_rest, rest_segments, zeros
from flightpower.daq import still_air_zero as daq_zero
from flightpower.daq.still_air_zero import ZeroReading
from flightpower.flight.errors import InputError

RATE_HZ = 25.0
BIAS = {"p_radps": 0.01, "q_radps": -0.02, "r_radps": 0.005, "dp_alpha_Pa": 1.5, "dp_beta_Pa": -0.8, "q_c_Pa": 2.2}
NOISE = {"p_radps": 0.005, "q_radps": 0.005, "r_radps": 0.005, "dp_alpha_Pa": 1.0, "dp_beta_Pa": 1.0, "q_c_Pa": 1.0}


def log_table(seed: int = 0, drift: dict[str, float] | None = None) -> pd.DataFrame:
    """20 s standing, 60 s flying, 10 s standing; zeros as in BIAS, noise as in NOISE.

    drift: how far a zero moves, at a constant rate, from the start to the end of the log.
    """
    rng = np.random.default_rng(seed)
    n = round(90 * RATE_HZ)
    t = np.arange(n) / RATE_HZ
    flying = (t >= 20) & (t < 80)
    table = {name: BIAS[name] + rng.normal(0, NOISE[name], n) for name in CHANNELS}
    table["q_c_Pa"] = table["q_c_Pa"] + np.where(flying, 150 + 20 * np.sin(t), 0)
    table["q_radps"] = table["q_radps"] + np.where(flying, 0.1 * np.sin(3 * t), 0)
    for name in ("ax_mps2", "ay_mps2", "az_mps2"):
        table[name] = rng.normal(0, 0.06, n) + np.where(flying, np.sin(5 * t), 0)
    for name, change in (drift or {}).items():
        table[name] = table[name] + change * t / t[-1]
    table["n_revps"] = np.where(flying, 100.0, np.nan)
    return pd.DataFrame(table, index=pd.Index(t, name="t_s"))


def test_both_stands_are_found_and_nothing_else() -> None:
    table = log_table()
    results = [(table.index[s.start], table.index[s.stop - 1]) for s in rest_segments(table, RATE_HZ)]
    assert len(results) == 2
    assert results[0][0] < 1.5 and 18 < results[0][1] < 20
    assert 80 < results[1][0] < 82 and results[1][1] > 88.5


def test_noise_of_the_transducer_is_no_wind() -> None:
    """A 10-bit converter over 4 kPa has 12 Pa of noise, more than AIRSPEED_SPREAD_PA. Wind of 40 Pa on the probe is
    seen."""
    table = log_table()
    noise = np.random.default_rng(1).normal(0, 12.0, len(table))
    table["q_c_Pa"] = 5 * ((table["q_c_Pa"] + noise) / 5).round()
    results = [(table.index[s.start], table.index[s.stop - 1]) for s in rest_segments(table, RATE_HZ)]
    assert len(results) == 2
    assert results[0][0] < 1.5 and 18 < results[0][1] < 20 and results[1][1] > 88.5
    windy = table.index < 10
    table.loc[windy, "q_c_Pa"] += 40 * np.sin(2 * np.pi * table.index[windy].to_numpy())
    first, *_ = rest_segments(table, RATE_HZ)
    assert 9.5 < table.index[first.start] < 11.5


@pytest.mark.parametrize("landing", [False, True])
def test_a_gentle_take_off_or_landing_is_no_rest(landing: bool) -> None:
    """A force along the path that grows steadily by 0.3 m/s² a second has no spread over a second, only another mean.

    When the mean over WINDOW_S has changed by FORCE_CHANGE_MPS2, the aircraft moves at 0.1²/(2·0.3) = 0.02 m/s.
    """
    table = log_table()
    t = table.index.to_numpy()
    since = np.maximum(82 - t, 0) * (t >= 80) if landing else np.maximum(t - 18, 0) * (t < 20)
    table["ax_mps2"] += 0.3 * since
    table.loc[(t > 80) if landing else (t < 20), "n_revps"] = np.nan
    first, second = rest_segments(table, RATE_HZ)
    assert t[first.stop - 1] < (18.4 if not landing else 20)
    assert t[second.start] > (81.6 if landing else 80)
    assert t[first.stop - 1] > 17 and t[second.start] < 83


def test_a_smooth_roll_out_is_no_rest() -> None:
    """Steady braking by 1.2 m/s² gives no spread of force and rotation; GPS shows the motion."""
    table, calm = log_table(), log_table(seed=1)
    t = table.index.to_numpy()
    rolling = (t >= 73) & (t < 80)
    table.loc[rolling, :] = calm.iloc[: int(rolling.sum())].to_numpy()
    table.loc[rolling, "ax_mps2"] -= 1.2
    assert [round(float(t[s.start])) for s in rest_segments(table, RATE_HZ)] == [0, 74, 81]
    speed_mps = np.where(rolling, 1.2 * (80 - t), np.where((t > 20) & (t < 73), 15.0, 0.0))
    with_gps = table.assign(gps_north_mps=speed_mps, gps_east_mps=0.0)
    with_gps.loc[with_gps.index[1::2], ["gps_north_mps", "gps_east_mps"]] = np.nan  # fewer solutions than ticks
    assert [round(float(t[s.start])) for s in rest_segments(with_gps, RATE_HZ)] == [0, 81]


def test_a_steady_glide_with_the_motor_off_is_no_rest() -> None:
    table = log_table()
    t = table.index.to_numpy()
    glide = (t > 40) & (t < 60)
    calm = log_table(seed=1).iloc[: int(glide.sum())].assign(n_revps=0.0)
    table.loc[glide, :] = calm.to_numpy()
    table.loc[glide, "q_c_Pa"] += 74.0  # 11 m/s
    assert [round(float(t[s.start])) for s in rest_segments(table, RATE_HZ)] == [0, 81]


def test_zeros_lie_within_four_of_their_own_standard_errors() -> None:
    """Each error comes from about 25 means over a second, so at four sigmas it is good to 4 / sqrt(2 * 24)."""
    for seed in range(20):
        table = log_table(seed)
        rest = zeros(table, rest_segments(table, RATE_HZ))
        assert rest is not None
        expected = np.sqrt(rest.seconds * RATE_HZ)
        for name in CHANNELS:
            assert abs(rest.value[name] - BIAS[name]) < 4 * rest.standard_error[name]
            blocks = rest.seconds / REST.window_s - 2
            assert rest.standard_error[name] == pytest.approx(NOISE[name] / expected, rel=4 / np.sqrt(2 * blocks))
            assert abs(rest.drift[name]) < 5 * rest.drift_error[name]
        assert rest.drifting == {} and rest.notes == []


def test_a_drift_is_reported_and_taken_out_along_a_line() -> None:
    """3 Pa over the log, 0.4 deg/s of the gyro: found within four standard errors, and removed at every instant."""
    drift = {"q_c_Pa": 3.0, "q_radps": np.radians(0.4)}
    table = log_table(drift=drift)
    t = table.index.to_numpy()
    rest = zeros(table, rest_segments(table, RATE_HZ))
    assert rest is not None and set(rest.drifting) == set(drift)
    assert any("/probe/airspeed moved by +2" in note and "linearly" in note for note in rest.notes)
    assert any("gyro q moved by +0.3" in note for note in rest.notes)
    for name, change in drift.items():
        true = BIAS[name] + change * t / t[-1]
        flown = (t > 20) & (t < 80)
        assert np.max(np.abs(rest.at(name, t) - true)[flown]) < 4 * rest.drift_error[name]
    assert np.ptp(rest.at("dp_alpha_Pa", t)) == 0


def zero_file(**readings: float) -> bytes:
    """A file as written by `daq zero`."""
    pressure = "differential_pressure_Pa"
    of = {
        "dp_alpha_Pa": ("/probe/alpha", pressure),
        "q_c_Pa": ("/probe/airspeed", pressure),
        "q_radps": ("/imu", "angular_rate_y_radps"),
    }
    result: dict = {}
    for name, mean in readings.items():
        topic, field = of[name]
        result.setdefault(topic, {})[field] = {"mean": mean, "standard_deviation": 0.1, "samples": 250}
    content = {
        "format": "flightpower-zero-1",
        "taken_unix_ns": 1,
        "seconds": 10.0,
        "temperature_K": {},
        "readings": result,
    }
    return json.dumps(content).encode()


def test_what_the_daemon_saves_is_what_the_analysis_reads() -> None:
    item = {f: ZeroReading(mean=k + 0.5, standard_deviation=0.1, samples=250) for k, f in enumerate(daq_zero.RATES)}
    pressure = {daq_zero.DIFFERENCE: ZeroReading(mean=-2.0, standard_deviation=0.5, samples=250)}
    saved = daq_zero.Zero(
        format=daq_zero.FORMAT,
        taken_unix_ns=10**18,
        seconds=10.0,
        temperature_K={},
        readings={"/imu": item, "/probe/beta": pressure},
    )
    result = ZERO_FILE.parsed(msgspec.json.encode(saved), "zero.json").by_channel()
    assert result == {"p_radps": 0.5, "q_radps": 1.5, "r_radps": 2.5, "dp_beta_Pa": -2.0}


def test_without_rest_the_zero_of_the_log_is_used_and_what_it_lacks_is_reported() -> None:
    table = log_table().iloc[round(25 * RATE_HZ) : round(75 * RATE_HZ)]
    taken = ZERO_FILE.parsed(zero_file(dp_alpha_Pa=1.5, q_c_Pa=2.2), "zero.json").by_channel()
    rest = zeros(table, rest_segments(table, RATE_HZ), taken)
    assert rest is not None
    assert rest.value["dp_alpha_Pa"] == 1.5 and rest.value["q_c_Pa"] == 2.2 and rest.value["r_radps"] == 0.0
    assert "daq zero" in rest.notes[0] and "gyro r" in rest.notes[1] and "/probe/beta" in rest.notes[1]


def test_a_zero_that_disagrees_with_the_log_s_own_rest_is_reported() -> None:
    table = log_table()
    still = rest_segments(table, RATE_HZ)
    near = zeros(table, still, ZERO_FILE.parsed(zero_file(q_c_Pa=2.0, q_radps=-0.021), "zero.json").by_channel())
    far = zeros(table, still, ZERO_FILE.parsed(zero_file(q_c_Pa=-6.0, q_radps=0.02), "zero.json").by_channel())
    assert near is not None and far is not None
    assert near.notes == []
    assert len(far.notes) == 2 and "/probe/airspeed" in far.notes[1] and "-6.00 Pa" in far.notes[1]
    assert far.value == near.value


def test_something_else_than_a_zero_is_refused() -> None:
    for data in (b"{", b"[]", zero_file().replace(b"zero-1", b"zero-9")):
        with pytest.raises(InputError, match=r"zero\.json"):
            ZERO_FILE.parsed(data, "zero.json")
    assert ZERO_FILE.parsed_if_any(None, "zero.json") is None


def test_a_log_that_ends_in_flight_does_not_know_its_drift() -> None:
    table = log_table(drift={"q_c_Pa": 3.0}).iloc[: round(60 * RATE_HZ)]
    rest = zeros(table, rest_segments(table, RATE_HZ))
    assert rest is not None and rest.drifting == {}
    assert any("only before the flight" in note for note in rest.notes)


def test_a_flight_without_a_stand_has_no_zeros() -> None:
    table = log_table().iloc[round(25 * RATE_HZ) : round(75 * RATE_HZ)]
    assert zeros(table, rest_segments(table, RATE_HZ)) is None


def test_stretches_are_the_runs_of_true() -> None:
    assert stretches(np.array([True, False, True, True])) == [slice(0, 1), slice(2, 4)]
    assert stretches(np.zeros(3, dtype=bool)) == []


@pytest.mark.parametrize(
    ("channel", "disturbed"),
    [
        ("n_revps", lambda t: np.full(len(t), 20.0)),  # the motor idles
        ("q_radps", lambda t: 0.1 * np.sin(2 * np.pi * t)),  # somebody carries the aircraft
        ("az_mps2", lambda t: np.sin(2 * np.pi * t)),
        ("q_c_Pa", lambda t: 20 * np.sin(2 * np.pi * t)),  # gusts blow into the probe
    ],
)
def test_an_aircraft_that_is_disturbed_is_not_at_rest(channel: str, disturbed) -> None:
    table = log_table()
    early = table.index < 10
    table.loc[early, channel] = disturbed(table.index[early].to_numpy())
    first, *_ = rest_segments(table, RATE_HZ)
    assert 9.5 < table.index[first.start] < 11.5


def test_rests_are_before_and_after_the_flight_by_the_pressure_above_that_at_rest() -> None:
    """The transducer has a zero of 100 Pa, more than the dynamic pressure of flight."""
    table = log_table()
    table["q_c_Pa"] += 100.0
    rests = rest_segments(table, RATE_HZ)
    before, after = _around_flight(table, rests, 30.0)
    assert (before, after) == (rests[:1], rests[1:])
    assert _around_flight(table, rests, 500.0) == (rests, [])


def test_the_error_of_a_mean_is_that_of_means_over_a_second() -> None:
    """Noise that stays the same for a second counts once a second."""
    slow = np.repeat(np.random.default_rng(1).normal(0, 1, 400), 25)
    mean, error = mean_at_rest(pd.Series(slow), [slice(0, 10_000)], 0.04)
    assert mean == pytest.approx(slow.mean()) and error == pytest.approx(1 / np.sqrt(400), rel=0.15)
    few, few_error = mean_at_rest(pd.Series(slow[::25]), [slice(0, 5)], 0.04)
    assert few == pytest.approx(slow[:125:25].mean()) and few_error == pytest.approx(
        np.std(slow[:125:25], ddof=1) / np.sqrt(5)
    )
