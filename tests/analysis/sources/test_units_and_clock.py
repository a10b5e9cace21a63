"""Units that a wrong log is reported to use, and intervals of its clock."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from flightpower.analysis.sources.ranges import LIMITS, check_units
from flightpower.analysis.sources.structure import _wrong_interval, check_clock
from flightpower.flight.errors import InputError
from flightpower.flight.log_entries import LogEntry, entries_of
from flightpower.flight.messages import TYPE_OF_TOPIC
from flightpower.flight.units import to_si

NAMES = {"hPa (mbar)": "hPa", "milliseconds": "ms", "degrees": "deg", "gauss": "100 uT", "mG": "100 nT"}
OF_FIELD = {"Pa": "Pa", "s": "s", "rad": "rad", "V": "V", "A": "A", "T": "T"}


def _quantity_text(unit: str) -> str:
    unit_name = NAMES.get(unit, unit)
    return unit_name if unit_name[0].isdigit() else f"1 {unit_name}"


def test_a_unit_s_factor_is_that_of_the_unit() -> None:
    """Throttle is a share; as a pulse it ranges from 1000 to 2000 microseconds."""
    checked = 0
    for limits in LIMITS:
        si = OF_FIELD.get(limits.field.rpartition("_")[2], "")
        for unit, factor in limits.units.items():
            expected = to_si(_quantity_text(unit), si, unit) if si else {"percent": 0.01}.get(unit, 1 / 2000)
            assert factor == pytest.approx(expected, rel=1e-5), unit
            checked += 1
    assert checked >= 15


@pytest.mark.parametrize("interval_s", [0.005, 0.04, 1.0])
@pytest.mark.parametrize(("unit", "per_second"), [("microseconds", 1e6), ("milliseconds", 1e3), ("seconds", 1.0)])
def test_a_clock_s_unit_is_reported_for_any_rate_of_a_daemon(interval_s: float, unit: str, per_second: float) -> None:
    """Numbers that should be nanoseconds, at 200, 25 and 1 messages a second."""
    message = _wrong_interval(interval_s * per_second / 1e9)
    assert message.startswith(f"log_time is in {unit} ({interval_s * per_second:.0f} between messages)")


@pytest.mark.parametrize(
    ("rate_Hz", "message"),
    [(math.inf, "most messages have the log_time of the one before"), (400.0, "400 messages a second are too many"),
     (0.5, "2 s between messages")],
)  # fmt: skip
def test_another_interval_is_reported_as_it_is(rate_Hz: float, message: str) -> None:
    assert _wrong_interval(1 / rate_Hz).startswith(message)


DIAMETER_M = 0.3
REVPS_OF_SOUND = 340.0 / (np.pi * DIAMETER_M)


def log_of(seconds: float = 24.0, begin_s: float = 0.0, **changed: dict[str, Any]) -> Any:
    """A log of level flight at 1 g, 25 messages a second; `changed` replaces fields of a topic by a number, or by one
    for each message.

    In the first half the aircraft is at rest, without dynamic pressure.
    """
    n = round(25 * seconds)
    flown = (np.arange(n) >= n // 2).astype(float)
    fields: dict[str, dict[str, Any]] = {
        "/imu": {"group_delay_s": 0.005, "specific_force_x_mps2": 0.3, "specific_force_y_mps2": 0.0,
                 "specific_force_z_mps2": -9.8},
        "/static": {"pressure_Pa": 1e5, "temperature_K": 290.0},
        "/rpm": {"motor_speed_revps": 80.0},
        "/probe/airspeed": {"differential_pressure_Pa": 150.0 * flown},
        "/probe/alpha": {"differential_pressure_Pa": 40.0 * flown},
        "/probe/beta": {"differential_pressure_Pa": -20.0 * flown},
    }  # fmt: skip
    for name, change in changed.items():
        topic = "/" + name.replace("_of_", "/")
        fields[topic] = fields.get(topic, {}) | change
    entries = {}
    for topic, values in fields.items():
        of_message = {field: np.broadcast_to(np.asarray(value, dtype=float), n) for field, value in values.items()}
        entries[topic] = entries_of(
            [
                LogEntry(
                    round((begin_s + i / 25) * 1e9),
                    i,
                    TYPE_OF_TOPIC[topic](**{field: float(value[i]) for field, value in of_message.items()}),
                )
                for i in range(n)
            ]
        )
    return SimpleNamespace(path=Path("flight.mcap"), entries=entries)


AIRSPEED, ALPHA = "probe_of_airspeed", "probe_of_alpha"
DIFFERENCE, SPEED = "differential_pressure_Pa", "motor_speed_revps"
HALF = np.repeat([0.0, 1.0], 300)  # of `log_of`: at rest, then flown
USUAL: tuple[dict[str, Any], ...] = (
    {},
    {"static": {"pressure_Pa": 20_100.0}},  # 11 km
    {"static": {"temperature_K": 220.0}},
    {"static": {"temperature_K": 330.0}},
    {"imu": {"group_delay_s": 0.9}},
    {"controls": {"elevator_rad": -1.5}},
    {"controls": {"throttle": 1.2}},  # a pulse beyond the calibrated end
    {"battery": {"voltage_V": 150.0, "current_A": 700.0}},
    {"mag": {"field_x_T": 0.9e-3}},  # beside a magnet
    {"rpm": {SPEED: 0.98 * REVPS_OF_SOUND}},
    {"rpm": {SPEED: 0.0}},
    {"imu": {"specific_force_z_mps2": -0.35 * 9.80665}},
    {"imu": {"specific_force_z_mps2": -2.9 * 9.80665}},
    {"imu": {"specific_force_x_mps2": 8.4, "specific_force_z_mps2": -5.0}},  # a climb at 59 deg
    # Only flight counts: carried upside down to the runway for half the log, the aircraft flew upright.
    {"imu": {"specific_force_z_mps2": np.where(HALF > 0, -9.8, 9.8)}},
    {AIRSPEED: {DIFFERENCE: 12.0 * HALF}, ALPHA: {DIFFERENCE: 9.0 * HALF}, "probe_of_beta": {DIFFERENCE: 0.0}},
    {ALPHA: {DIFFERENCE: 1.25 * 150.0 * HALF}},  # 1.3 times q_c are reached at 20 deg
    # A gust in the first second after power-on, or a hand on the tube, is not a flight backwards.
    {AIRSPEED: {DIFFERENCE: np.where(HALF > 0, 150.0, -70.0)}},
)  # fmt: skip


@pytest.mark.parametrize("changed", USUAL, ids=str)
def test_what_aircraft_and_sensors_can_do_is_not_refused(changed: dict[str, Any]) -> None:
    check_units(log_of(**changed), DIAMETER_M)


IMPOSSIBLE: tuple[tuple[dict[str, Any], str], ...] = (
    ({"static": {"pressure_Pa": 19_000.0}}, "/static: pressure_Pa is 1.9e.04 .median.*write SI units"),
    ({"static": {"pressure_Pa": 130_000.0}}, "air has 20000 to 110000 Pa below 11 km: write SI units"),
    ({"static": {"temperature_K": 190.0}}, "temperature_K is 190.0 .median., but air has 220 to 330 K: write kelvin"),
    ({"static": {"temperature_K": 420.0}}, "write kelvin"),
    ({"static": {"temperature_K": -55.0}}, "looks like degrees Celsius"),
    ({"static": {"temperature_K": 140.0}}, "looks like degrees Celsius .* or Fahrenheit"),
    ({"static": {"temperature_K": -65.0}}, "write kelvin"),
    ({"static": {"temperature_K": 155.0}}, "write kelvin"),
    ({"imu": {"group_delay_s": 1.1}}, "a filter delays by less than 1 s: it looks like milliseconds"),
    ({"controls": {"elevator_rad": -1.7}}, "a surface turns by less than 90 deg: it looks like degrees"),
    ({"controls": {"throttle": 1.6}}, r"throttle is 1.6 \(95 % of the log below\), but full throttle is 1: it"),
    ({"controls": {"throttle": 1900.0}}, "it looks like microseconds; multiply by 0.0005"),
    ({"battery": {"voltage_V": 210.0}}, "such a battery has less than 200 V: it looks like mV"),
    ({"battery": {"current_A": 1100.0}}, "it gives less than 1000 A: it looks like mA"),
    ({"mag": {"field_x_T": 1.1e-3}}, "the earth's field has 22e-6 to 67e-6 T: it looks like gauss"),
    ({"rpm": {SPEED: 1.02 * REVPS_OF_SOUND}}, "in rad/s, or electrical revolutions"),
    ({"rpm": {SPEED: 60 * 22.0 / (np.pi * DIAMETER_M)}}, "it looks like rev/min; divide by 60"),
    ({"rpm": {SPEED: 60 * 19.0 / (np.pi * DIAMETER_M)}}, "in rad/s, or electrical revolutions"),
    # Two thirds of the log have no power and are left out of the median.
    ({"rpm": {SPEED: np.where(np.arange(600) < 400, 0.9, 2 * REVPS_OF_SOUND)}}, "move faster than sound"),
    ({"imu": {"specific_force_x_mps2": 0.0, "specific_force_z_mps2": -0.25 * 9.80665}}, "a magnitude of 2.45"),
    ({"imu": {"specific_force_x_mps2": 0.0, "specific_force_z_mps2": -3.2 * 9.80665}}, "a magnitude of 31.4"),
    ({"imu": {"specific_force_x_mps2": 0.0, "specific_force_z_mps2": -1000.0}}, "like milli-g; multiply by 0.00980665"),
    ({"imu": {"specific_force_x_mps2": 9.0, "specific_force_z_mps2": -4.0}}, r"axes are exchanged .x has \+9.0."),
    ({"imu": {"specific_force_x_mps2": 9.0, "specific_force_z_mps2": 3.0}}, r"axes are exchanged .x has \+9.0."),
    ({"imu": {"specific_force_x_mps2": 8.0, "specific_force_z_mps2": 6.0}}, "z points up"),
    ({"imu": {"specific_force_z_mps2": np.where(HALF > 0, 9.8, -9.8)}}, "z points up"),
    ({ALPHA: {DIFFERENCE: 1.35 * 150.0 * HALF}}, "/probe/alpha: .* reaches 202 Pa, but that of /probe/airspeed only"),
    ({AIRSPEED: {DIFFERENCE: 7.0 * HALF}, ALPHA: {DIFFERENCE: 1.0}, "probe_of_beta": {DIFFERENCE: 1.0}}, "no flight"),
    ({AIRSPEED: {DIFFERENCE: np.where(HALF > 0, 30.0, -70.0)}}, "is negative in flight .-70 Pa."),
)  # fmt: skip


@pytest.mark.parametrize(("changed", "message"), IMPOSSIBLE, ids=[message for _, message in IMPOSSIBLE])
def test_what_physics_does_not_allow_is_refused_with_its_remedy(changed: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        check_units(log_of(**changed), DIAMETER_M)


@pytest.mark.parametrize(("jump_s", "refused"), [(3500.0, False), (3700.0, True)])
def test_a_clock_that_jumps_by_more_than_an_hour_was_set(jump_s: float, refused: bool) -> None:
    log = log_of(2.0)
    for entries in log.entries.values():
        for i in range(25, len(entries)):
            entries.time_ns[i] += round(jump_s * 1e9)
    if refused:
        with pytest.raises(InputError, match=r"jumps by 3.7e\+03 s"):
            check_clock(log)
    else:
        check_clock(log)


@pytest.mark.parametrize(("begin_s", "apart"), [(9.9, ""), (-9.9, ""), (10.1, r"\+10.1 s"), (-10.1, "-10.1 s")])
def test_a_topic_has_times_in_common_with_the_imu(begin_s: float, apart: str) -> None:
    log, other = log_of(10.0, 100.0), log_of(10.0, 100.0 + begin_s)
    log.entries["/static"] = other.entries["/static"]
    if apart:
        with pytest.raises(InputError, match=f"/static: its log times begin {apart} from those of /imu"):
            check_clock(log)
    else:
        check_clock(log)


@pytest.mark.parametrize(("messages", "refused"), [(29, True), (30, False)])
def test_fewer_than_thirty_messages_are_too_few(messages: int, refused: bool) -> None:
    log = log_of(messages / 25)
    if refused:
        with pytest.raises(InputError, match="29 messages are too few"):
            check_clock(log)
    else:
        check_clock(log)


@pytest.mark.parametrize(("rate_Hz", "refused"), [(201.0, False), (212.0, True), (0.95, False), (0.88, True)])
def test_the_rates_of_the_daemon_are_analyzed(rate_Hz: float, refused: bool) -> None:
    log = log_of(2.0)
    for entries in log.entries.values():
        for i in range(len(entries)):
            entries.time_ns[i] = round(i / rate_Hz * 1e9)
    if refused:
        with pytest.raises(InputError, match=r"messages a second are too many|s between messages"):
            check_clock(log)
    else:
        check_clock(log)
