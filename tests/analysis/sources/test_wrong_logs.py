"""A log that other software wrote by log-format.md is analyzed; one with a mistake is refused in one clear line.

One simulated flight, written by docs/examples/write_log.py. Every wrong log is this one, changed.
"""

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import reduce
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
import pandas as pd
import pytest

from flightpower.analysis import flight
from flightpower.analysis.air.contents import Replacements, contents
from flightpower.analysis.air.flight_data import Calibrations, flight_data
from flightpower.analysis.pipeline.runs import analyze_runs
from flightpower.analysis.sources.axes import check_axes
from flightpower.analysis.sources.daemon import values
from flightpower.analysis.sources.structure import check_log
from flightpower.analysis.trajectory.priors import SensorPriors, stated_sigma
from flightpower.daq.attachments import propeller_text
from flightpower.flight.aircraft import Uncertainty, parse_aircraft
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.log_entries import LogEntry, entries_of
from flightpower.flight.log_reader import Log, read_log
from flightpower.flight.messages import Battery
from flightpower.flight.undecodable import Undecodable
from flightpower.flight.units import GRAVITY_MPS2
from flightpower.sim.sensors.budget import load_budget

PLAN = """
title = "Stand, climb, one acceleration and one deceleration"

[[segment]]
kind = "stand"
duration = "8 s"

[[segment]]
kind = "take-off"

[[segment]]
kind = "climb"
height = "50 m"
climb = "4 m/s"
speed_over_stall = 1.6

[[segment]]
kind = "hold"
duration = "8 s"
speed_over_stall = 1.15

[[segment]]
kind = "run"
throttle = 1.0
speed_of_max = 0.92

[[segment]]
kind = "hold"
duration = "3 s"
speed_of_max = 0.92

[[segment]]
kind = "run"
throttle = 0.4
speed_over_stall = 1.15

[[segment]]
kind = "hold"
duration = "4 s"
speed_over_stall = 1.15
"""

ROOT = Path(__file__).parents[3]
sys.path += [str(ROOT / "benchmarks"), str(ROOT / "docs" / "examples")]
import flights  # noqa: E402
import write_log  # noqa: E402

FORCE = tuple(f"specific_force_{axis}_mps2" for axis in "xyz")
RATE = tuple(f"angular_rate_{axis}_radps" for axis in "xyz")
PROBE = ("/probe/alpha", "/probe/beta", "/probe/airspeed")
DIFFERENCE = ("differential_pressure_Pa",)
VELOCITY = tuple(f"velocity_{axis}_mps" for axis in ("north", "east", "down"))


class Written(NamedTuple):
    """A log, and the true power required of its flight (`sim.truth`)."""

    log: Log
    truth: pd.DataFrame


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Written:
    """The log of docs/examples/write_log.py, from a CSV of a flight in 6 kt of turbulence."""
    folder = tmp_path_factory.mktemp("log")
    (folder / "plan.toml").write_text(PLAN, "utf-8")
    craft = load_complete_aircraft("nexstar")
    flown = flights.flown(craft, flights.draw_errors(load_budget("bench"), 0), folder / "plan.toml", 0, 6.0)
    table = flown.table.assign(gps_fix_type=flown.table["gps_north_mps"] * 0 + 3)
    table.reset_index(names="time_s").to_csv(folder / "flight.csv", index=False, float_format="%.7g")
    (folder / "aircraft.toml").write_text(craft.text, "utf-8")
    (folder / "propeller.csv").write_text(propeller_text(craft.propulsion.propeller), "utf-8")
    (folder / "probe.json").write_bytes(msgspec.json.encode(flights.tunnel_probe()))
    attachments = [folder / name for name in ("aircraft.toml", "propeller.csv", "probe.json")]
    write_log.write_log(folder / "flight.csv", folder / "flight.mcap", attachments)
    log = replace(read_log(folder / "flight.mcap"), path=Path("flight.mcap"))
    return Written(log, flown.flight.power_required)


@pytest.fixture
def written(flown: Written) -> Log:
    return flown.log


def judged(log: Log) -> None:
    """Run the checks in the order of the pipeline."""
    log_contents = contents(log)
    check_log(log, log_contents.propeller.diameter_m)
    check_axes(
        flight_data(log, log_contents.aircraft, log_contents.propeller, Calibrations(log_contents.probe)).table,
        str(log.path),
    )


def refusal(log: Log) -> str:
    with pytest.raises(InputError) as caught:
        judged(log)
    return str(caught.value).removeprefix("flight.mcap: ")


Change = Callable[[Log], Log]


def entries(change: Callable[[str, list[LogEntry]], list[LogEntry]], *topics: str) -> Change:
    """A change of the messages of some topics, or of all topics."""
    return lambda log: replace(
        log,
        entries={
            topic: entries_of(change(topic, entry)) if topic in topics or not topics else entry
            for topic, entry in log.entries.items()
        },
    )


def scaled(topic: str, fields: tuple[str, ...], factor: float, offset: float = 0.0) -> Change:
    def change(_: str, log_entries: list[LogEntry]) -> list[LogEntry]:
        return [
            entry._replace(
                message=msgspec.structs.replace(
                    entry.message, **{field: factor * getattr(entry.message, field) + offset for field in fields}
                )
            )
            for entry in log_entries
        ]

    return entries(change, topic)


def all_of(*changes: Change) -> Change:
    return lambda log: reduce(lambda changed, change: change(changed), changes, log)


def exchanged(topic: str, other: str) -> Change:
    return lambda log: replace(log, entries=log.entries | {topic: log.entries[other], other: log.entries[topic]})


def timed(time_ns: Callable[[int], int], *topics: str) -> Change:
    return entries(lambda _, result: [entry._replace(time_ns=time_ns(entry.time_ns)) for entry in result], *topics)


def counted(tick: Callable[[int], int]) -> Change:
    return entries(lambda _, result: [entry._replace(tick=tick(entry.tick)) for entry in result])


def without(topic: str, *, unknown: str = "") -> Change:
    return lambda log: replace(
        log,
        entries={name: entry for name, entry in log.entries.items() if name != topic},
        unknown_topics={unknown: None} if unknown else {},
    )


def misnamed(topic: str, field: str, name: str) -> Change:
    """A change to what is read from messages that have `name` in place of `field`."""
    nothing = entries(
        lambda _, result: [e._replace(message=msgspec.structs.replace(e.message, **{field: None})) for e in result],
        topic,
    )
    return lambda log: replace(nothing(log), fields=log.fields | {topic: log.fields[topic] - {field} | {name}})


def test_the_example_of_the_page_is_analyzed(flown: Written) -> None:
    """Time starts at 0, and there is no status, schema or metadata: the intervals contain the truth."""
    curve = analyze_runs(flown.log).results.power_required
    true_W = np.interp([point.speed_mps for point in curve], flown.truth["speed_mps"], flown.truth["power_W"])
    assert all(point.power_lo_W < power < point.power_hi_W for point, power in zip(curve, true_W, strict=True))


class Reached(Exception):
    """Ends an analysis."""


def test_the_trajectory_begins_with_what_the_aircraft_file_states(flown: Written, monkeypatch) -> None:
    """Each key changes the prior of its errors."""

    def record_priors(_table: object, _rest: object, priors: SensorPriors, **_: object) -> None:
        raise Reached(priors.file_sigma)

    monkeypatch.setattr(flight, "reconstruct", record_priors)
    text = (
        load_complete_aircraft("nexstar").text
        + """
angle_of_attack_offset = "2 deg"
angle_of_attack_slope = "6 %"
airspeed_scale = "2 %"
air_data_lag = "30 ms"
accelerometer_offset = "0.5 m/s^2"
"""
    )
    with pytest.raises(Reached) as reached:
        analyze_runs(flown.log, Replacements(aircraft=parse_aircraft(text, "mine.toml")))
    (prior,) = reached.value.args
    usual = stated_sigma(Uncertainty(), load_complete_aircraft("nexstar").wing_loading_Pa)
    assert {name: sigma for name, sigma in prior.items() if sigma != usual[name]} == pytest.approx(
        {"alpha_bias": np.radians(2), "alpha_scale": 0.06, "V_scale": 0.02, "air_data_lag": 0.03}
        | dict.fromkeys(("ax_bias", "ay_bias", "az_bias"), 0.5)
    )


@pytest.mark.parametrize("tick", [lambda tick: 0, lambda tick: 8 * tick], ids=["stays 0", "counts all messages"])
def test_the_sequence_need_not_count_ticks(written: Log, tick: Callable[[int], int]) -> None:
    log_contents = contents(written)
    data = flight_data(
        counted(tick)(written), log_contents.aircraft, log_contents.propeller, Calibrations(log_contents.probe)
    )
    assert len(data.table) == len(written.entries["/imu"])


def with_current(ampere: float) -> Change:
    """A change that adds a current of so many amperes where the motor turns."""
    return lambda log: replace(
        log,
        entries=log.entries
        | {
            "/battery": entries_of(
                [
                    entry._replace(
                        message=Battery(voltage_V=15.0, current_A=ampere * bool(entry.message.motor_speed_revps))
                    )
                    for entry in log.entries["/rpm"]
                ]
            )
        },
    )


def test_a_discharging_battery_is_accepted(written: Log) -> None:
    judged(with_current(9.0)(written))


WRONG: dict[str, tuple[Change, str]] = {
    "g": (scaled("/imu", FORCE, 1 / GRAVITY_MPS2),
        "/imu: specific_force_{x,y,z}_mps2 have a magnitude of 0.995 (median in flight), but rest and flight "
        "have about 9.8: it looks like g; multiply by 9.80665"),
    "without gravity": (scaled("/imu", FORCE[2:], 1, GRAVITY_MPS2),
        "/imu: specific_force_{x,y,z}_mps2 have a magnitude of 1.4 (median in flight), but rest and flight "
        "have about 9.8: gravity was taken out; write what an accelerometer measures"),
    "charging": (with_current(-9.0),
        "/battery: current_A is negative in flight (-9 A): write it positive when discharging"),
    "degrees": (scaled("/imu", RATE, 57.2958),
        "/imu: angular_rate_y_radps and angular_rate_z_radps are too large for the specific force in 52 % of "
        "the flight: they look like degrees per second; multiply by 0.0174533"),
    "z up": (scaled("/imu", FORCE[1:], -1),
        "/imu: specific_force_z_mps2 is +9.6 (median in flight), but rest and level flight have about -9.8: z"
        " points up, or gravity was written in place of specific force; axes are x forward, y right, z down"),
    "hPa": (scaled("/static", ("pressure_Pa",), 0.01),
        "/static: pressure_Pa is 996.1 (median), but air has 20000 to 110000 Pa below 11 km: it looks like "
        "hPa (mbar); multiply by 100"),
    "Celsius": (scaled("/static", ("temperature_K",), 1, -273.15),
        "/static: temperature_K is 18.3 (median), but air has 220 to 330 K: it looks like degrees Celsius "
        "(add 273.15) or Fahrenheit"),
    "difference in hPa": (scaled("/probe/airspeed", DIFFERENCE, 0.01),
        "/probe/alpha: differential_pressure_Pa reaches 56.3 Pa, but that of /probe/airspeed only 2.25 Pa, "
        "which is larger in flight: the topics or tubes are exchanged, a tube is blocked, or one of the "
        "pressures is not in Pa"),
    "all differences in hPa": (all_of(*(scaled(topic, DIFFERENCE, 0.01) for topic in PROBE)),
        "no flight in it: differential_pressure_Pa of /probe/airspeed reaches only 2.2 Pa, but 7 m/s make 30 "
        "Pa; is it in hPa (mbar), kPa or inches of water?"),
    "alpha in hPa": (scaled("/probe/alpha", DIFFERENCE, 0.01),
        "/probe/alpha: differential_pressure_Pa changes with the lift, but by +0.0050 of that of "
        "/probe/airspeed only: is it in hPa (mbar), kPa or inches of water?"),
    "airspeed reversed": (scaled("/probe/airspeed", DIFFERENCE, -1),
        "/probe/airspeed: differential_pressure_Pa is negative in flight (-225 Pa): write center port minus "
        "static, or exchange the two tubes"),
    "alpha reversed": (scaled("/probe/alpha", DIFFERENCE, -1),
        "/probe/alpha: the angle of attack falls where lift rises: differential_pressure_Pa has the wrong "
        "sign; write lower minus upper port, in the calibration of the probe too"),
    "beta reversed": (scaled("/probe/beta", DIFFERENCE, -1),
        "/probe/beta: the side force points to where the air comes from: differential_pressure_Pa (right "
        "minus left port, in the probe's calibration too) or specific_force_y_mps2 of /imu (to the right) has "
        "the wrong sign"),
    "x reversed": (scaled("/imu", FORCE[:1], -1),
        "/imu: specific_force_x_mps2 falls where the aircraft speeds up or climbs; write it positive "
        "forward"),
    "pitch rate reversed": (scaled("/imu", RATE[1:2], -1),
        "/imu: the nose goes down where specific_force_z_mps2 shows a pull-up: angular_rate_y_radps has the "
        "wrong sign; write it positive nose up"),
    "airspeed and alpha exchanged": (exchanged("/probe/airspeed", "/probe/alpha"),
        "/probe/alpha: differential_pressure_Pa reaches 225 Pa, but that of /probe/airspeed only 52.4 Pa, "
        "which is larger in flight: the topics or tubes are exchanged, a tube is blocked, or one of the "
        "pressures is not in Pa"),
    "alpha and beta exchanged": (exchanged("/probe/alpha", "/probe/beta"),
        "/probe/alpha and /probe/beta: differential_pressure_Pa of beta follows the lift (correlation +0.79),"
        " that of alpha does not (+0.10): the topics or tubes are exchanged"),
    "revolutions a minute": (scaled("/rpm", ("motor_speed_revps",), 60),
        "/rpm: motor_speed_revps is 4429 (median of the turning motor), at which the tips of a propeller of "
        "0.30 m move faster than sound: it looks like rev/min; divide by 60"),
    "velocity up": (scaled("/gps", VELOCITY[2:], -1),
        "/gps: velocity_down_mps is positive where /static shows a climb: write it positive downwards"),
    "km/h": (scaled("/gps", VELOCITY, 3.6),
        "/gps: velocity_north_mps and velocity_east_mps make 59.2 m/s (median of the flight) at 16.6 m/s of "
        "airspeed: it looks like km/h; multiply by 0.2778"),
    "microseconds": (timed(lambda ns: ns // 1000),
        "/imu: log_time is in microseconds (40000 between messages); write nanoseconds"),
    "seconds": (timed(lambda ns: ns // 10**9),
        "/imu: most messages have the log_time of the one before; write each message's own, in nanoseconds"),
    "other clock": (timed(lambda ns: ns + 10**18, "/static"),
        "/static: its log times begin +1e+09 s from those of /imu and have none in common with them; take the"
        " log_time of all topics from one clock, in nanoseconds"),
    "clock set": (timed(lambda ns: ns + 10**18 * (ns > 50 * 10**9)),
        "/imu: log_time jumps by 1e+09 s; use a clock that is not set while it records"),
    "no topic": (without("/static", unknown="/Static"),
        "no topic /static, which the power curve needs; is it /Static? Rename it"),
    "misnamed": (misnamed("/static", "pressure_Pa", "pressure"),
        "/static: pressure_Pa has no value, but there is an unknown field pressure: rename it"),
    "misnamed, optional": (misnamed("/gps", "velocity_down_mps", "velocity_d_mps"),
        "/gps: velocity_down_mps has no value, but there is an unknown field velocity_d_mps: rename it"),
    "no temperature": (misnamed("/static", "temperature_K", "kelvin"),
        "/static: temperature_K has no value; fields of its messages that docs/understand/log-format.md does not have: "
        "kelvin"),
    "rate": (lambda log: replace(log, metadata={"flightpower": {"tick_rate_Hz": "250"}}),
        "metadata flightpower: tick_rate_Hz is '250', but /imu has 25 messages a second: write that number, "
        "or leave it out"),
    "rate, no number": (lambda log: replace(log, metadata={"flightpower": {"tick_rate_Hz": "25 Hz"}}),
        "metadata flightpower: tick_rate_Hz is '25 Hz', but /imu has 25 messages a second: write that number,"
        " or leave it out"),
}  # fmt: skip


@pytest.mark.parametrize(("change", "message"), WRONG.values(), ids=WRONG.keys())
def test_a_mistake_is_refused_with_its_name(written: Log, change: Change, message: str) -> None:
    assert refusal(change(written)) == message


def test_a_number_beyond_all_limits_is_damage() -> None:
    """1e300 V made NumPy overflow in the checks; the other voltage stays usable."""
    entries = entries_of([LogEntry(i, i, Battery(voltage_V=x, current_A=5.0)) for i, x in enumerate((15.0, 1e300))])
    np.testing.assert_array_equal(values(entries, "voltage_V"), (15.0, np.nan))


def test_some_damaged_messages_are_no_reason_to_refuse(written: Log) -> None:
    judged(replace(written, undecodable_of={"/imu": Undecodable(b"{", "truncated", 100)}))
