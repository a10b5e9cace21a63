"""Synchronization: measured values are recovered at their instants; clipping and gaps are left out and reported."""

from pathlib import Path

import msgspec
import numpy as np
import pytest

from flightpower.analysis.sources.daemon import synchronize
from flightpower.flight.log_entries import LogEntry, entries_of
from flightpower.flight.log_reader import Log
from flightpower.flight.messages import (
    TOPICS_FOR_DRAG,
    TYPE_OF_TOPIC,
    AbsolutePressure,
    DifferentialPressure,
    Imu,
    Rpm,
    Status,
)

SECONDS = 20.0
SOUND = {
    "/imu": Imu(
        specific_force_x_mps2=0.0, specific_force_y_mps2=0.0, specific_force_z_mps2=-9.8,
        angular_rate_x_radps=0.0, angular_rate_y_radps=0.0, angular_rate_z_radps=0.0, group_delay_s=0.01,
    ),
    "/static": AbsolutePressure(pressure_Pa=101_325.0, temperature_K=288.15),
    "/probe/alpha": DifferentialPressure(differential_pressure_Pa=3.0),
    "/probe/beta": DifferentialPressure(differential_pressure_Pa=3.0),
    "/probe/airspeed": DifferentialPressure(differential_pressure_Pa=150.0),
    "/rpm": Rpm(motor_speed_revps=100.0),
}  # fmt: skip


def log_of(status_at=lambda topic, t_s: Status.OK) -> Log:
    """A log of constant readings; `status_at` says which of them failed, and how (None: no message at all)."""
    log = Log(Path("flight.mcap"), metadata={"flightpower": {"tick_rate_Hz": "25"}})
    for topic, message in SOUND.items():
        rows = []
        for tick in range(round(SECONDS * 25)):
            status = status_at(topic, tick / 25)
            if status is not None:
                sent = message if status is Status.OK else TYPE_OF_TOPIC[topic](status=status)
                rows.append(LogEntry(10**18 + tick * 40_000_000, tick, sent))
        if rows:
            log.entries[topic] = entries_of(rows)
    return log


def test_a_sound_log_has_nothing_to_say() -> None:
    channels = synchronize(log_of())
    assert channels.notes == []
    assert channels.rate_Hz == 25.0
    assert channels.table[["ax_mps2", "dp_beta_Pa"]].notna().mean().min() > 0.99


def test_clipping_is_reported_and_left_out() -> None:
    """The sensor is at the end of its range for five of twenty seconds: such a limit is not a measurement."""
    clipped = synchronize(
        log_of(lambda topic, t: Status.SATURATED if topic == "/probe/alpha" and 5 <= t < 10 else Status.OK)
    )
    assert clipped.table.loc[5.1:9.9, "dp_alpha_Pa"].isna().all()
    assert any("/probe/alpha was at the end of its range for 25.0 % of the log" in note for note in clipped.notes)


@pytest.mark.parametrize("lost", [None, Status.TIMEOUT], ids=["no message", "timeouts"])
def test_a_long_gap_is_said_with_its_place(lost) -> None:
    holed = synchronize(log_of(lambda topic, t: lost if topic == "/static" and 8 < t < 13 else Status.OK))
    assert holed.table.loc[8.1:12.9, "static_Pa"].isna().all()
    assert holed.table["ax_mps2"].notna().mean() > 0.99
    assert holed.notes == ["/static has a gap of 5.0 s from 8 s on, which is not interpolated."]


def test_a_topic_that_may_be_missing_is_missing_without_ado() -> None:
    assert "/probe/beta" not in TOPICS_FOR_DRAG
    without = synchronize(log_of(lambda topic, t: None if topic == "/probe/beta" else Status.OK))
    assert without.table["dp_beta_Pa"].isna().all()


def test_a_motor_that_speeds_up_is_not_found_to_lag() -> None:
    """Speed rises by 4 rev/s in a second, as in an acceleration. Ten electrical periods of seven pole pairs are timed,
    which takes 11 to 18 ms, and each tick finds the newest. If it were dated to the tick, speed would be 16 ms late,
    0.06 rev/s. What a tick finds is at most 18 ms old: 0.02 rev/s rms, and a tenth of that on average."""
    log = log_of(lambda topic, t: None if topic == "/rpm" else Status.OK)
    pulses = np.arange(1.0, 1300.0) * 10 / 7  # revolutions turned
    speed, more = 80.0, 4.0
    pulse_s = (np.sqrt(speed**2 + 2 * more * pulses) - speed) / more
    rows = []
    for tick in range(25, round((pulse_s[-1]) * 25)):
        newest = np.searchsorted(pulse_s, tick / 25) - 1
        period_s = pulse_s[newest] - pulse_s[newest - 1]
        rpm = Rpm(period_us=round(1e6 * period_s), motor_speed_revps=10 / 7 / period_s)
        rows.append(LogEntry(10**18 + tick * 40_000_000, tick, rpm))
    log.entries["/rpm"] = entries_of(rows)
    result = synchronize(log).table["n_revps"].loc[2:14]
    off = result - (speed + more * result.index.to_numpy())
    assert abs(off.mean()) < 0.004 and off.std() < 0.03


@pytest.mark.parametrize("counted", [True, False])
def test_a_fast_motor_s_speed_is_the_mean_over_all_pulses_since_the_last_frame(counted) -> None:
    """At 1,000 electrical periods a second and more the counter sends every 10 ms and times all pulses since the last
    message. With the reported number of pulses the age is right; assuming ten periods, it would be off by up to 3
    ms."""
    log = log_of(lambda topic, t: None if topic == "/rpm" else Status.OK)
    speed, more = 240.0, 6.0
    pulses = np.arange(1.0, 32000.0) / 7  # revolutions turned
    pulse_s = (np.sqrt(speed**2 + 2 * more * pulses) - speed) / more
    frame_s = np.arange(0.0037, pulse_s[-1], 0.01)
    newest = np.searchsorted(pulse_s, frame_s) - 1
    rows = []
    for tick in range(25, 15 * 25):
        late_ms = tick % 10
        frame = np.searchsorted(frame_s, tick / 25 + late_ms / 1000) - 1
        n = int(newest[frame] - newest[frame - 1])
        period_s = (pulse_s[newest[frame]] - pulse_s[newest[frame - 1]]) / n
        message = {"pulses_captured": n + 1, "pulses_rejected": 2, "pulses_inserted": 1} if counted else {}
        rpm = Rpm(period_us=round(1e7 * period_s), motor_speed_revps=1 / 7 / period_s, **message)
        rows.append(LogEntry(10**18 + tick * 40_000_000 + late_ms * 1_000_000, tick, rpm))
    log.entries["/rpm"] = entries_of(rows)
    result = synchronize(log).table["n_revps"].loc[2:14]
    off = result - (speed + more * result.index.to_numpy())
    assert off.std() < 0.03
    assert abs(off.mean()) < 0.003 if counted else off.mean() < -0.005


def test_each_delay_is_subtracted_once() -> None:
    """The pressure rises by 10 Pa/s behind a line of 0.2 s, and the rate by 1 rad/s^2 behind a filter of 10 ms."""
    log = log_of()
    for topic, fields_at in (
        ("/static", lambda t_s: {"pressure_Pa": 1e5 + 10 * (t_s - 0.2)}),
        ("/imu", lambda t_s: {"angular_rate_x_radps": t_s - 0.01}),
    ):
        log.entries[topic] = entries_of(
            [
                e._replace(message=msgspec.structs.replace(e.message, **fields_at(e.tick / 25)))
                for e in log.entries[topic]
            ]
        )
    table = synchronize(log, {"/static": 0.2}).table.loc[2:18]
    assert table["static_Pa"].to_numpy() == pytest.approx(1e5 + 10 * table.index.to_numpy(), abs=1e-6)
    assert table["p_radps"].to_numpy() == pytest.approx(table.index.to_numpy(), abs=1e-6)


@pytest.mark.parametrize("own_s", [None, 0.030])
def test_specific_force_and_angular_rate_have_their_own_delays(own_s) -> None:
    """Both rise by 1 a second; each is recovered at the instant at which it was measured."""
    log = log_of()
    log.entries["/imu"] = entries_of([
        LogEntry(10**18 + tick * 40_000_000, tick, msgspec.structs.replace(
            SOUND["/imu"], specific_force_x_mps2=tick / 25 - (own_s or 0.01), angular_rate_x_radps=tick / 25 - 0.01,
            specific_force_group_delay_s=own_s,
        ))
        for tick in range(round(SECONDS * 25))
    ])  # fmt: skip
    table = synchronize(log).table.loc[1:18]
    assert table["ax_mps2"].to_numpy() == pytest.approx(table.index.to_numpy(), abs=1e-9)
    assert table["p_radps"].to_numpy() == pytest.approx(table.index.to_numpy(), abs=1e-9)
