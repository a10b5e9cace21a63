"""The channels of an ordinary flight, each with its own times, and the choice of one among several sensors."""

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from functools import reduce
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from flightpower.analysis.sources.autopilot_settings import INSTANCES, READABLE
from flightpower.flight.arrays import Array
from flightpower.flight.units import SEA_LEVEL_DENSITY

AIRSPEED_PRESSURE = "airspeed_pressure_Pa"  # pitot minus static pressure; the zero may not be corrected yet
STATIC, FORCE_X, FORCE_Y, FORCE_Z = "static_Pa", "ax_mps2", "ay_mps2", "az_mps2"
VOLTAGE, CURRENT = "battery_V", "battery_A"
MOTOR, THROTTLE = "motor_revps", "throttle"  # throttle is from 0 to 1, negative in reverse
TRUE_AIRSPEED, TRUE_HEIGHT = "true_airspeed_mps", "true_height_m"  # from a simulation
OF_AIRSPEED, OF_BAROMETER = frozenset({AIRSPEED_PRESSURE}), frozenset({STATIC})
OF_BATTERY = frozenset({VOLTAGE, CURRENT})
GPS = ("gps_north_mps", "gps_east_mps", "gps_down_mps")
PLACE = ("north_m", "east_m")  # from a GPS receiver


# By channel: least and greatest possible value, and greatest possible difference from the median of five samples.
POSSIBLE = {
    AIRSPEED_PRESSURE: READABLE.possible["pitot_Pa"],
    STATIC: READABLE.possible["static_Pa"],
    FORCE_X: READABLE.possible["force_mps2"],
    FORCE_Y: READABLE.possible["force_mps2"],
    FORCE_Z: READABLE.possible["force_mps2"],
    VOLTAGE: READABLE.possible["voltage_V"],
    CURRENT: READABLE.possible["current_A"],
    MOTOR: READABLE.possible["motor_revps"],
    THROTTLE: READABLE.possible["throttle"],
    **dict.fromkeys((*GPS, TRUE_AIRSPEED), READABLE.possible["ground_mps"]),
    TRUE_HEIGHT: READABLE.possible["height_m"],
    **dict.fromkeys(PLACE, READABLE.possible["place_m"]),
}


class Channel(NamedTuple):
    """Times [s] in ascending order, and values, both (n,)."""

    t_s: Array
    value: Array

    def at(self, t_s: Array) -> Array:
        """Return values at other times (m,): linear between samples, the first or the last value beyond them."""
        return np.interp(t_s, self.t_s, self.value)


# Every number that a log has over time, by its name in the log, on the recording's clock; read when it is needed.
AllChannels = Mapping[str, Callable[[], Channel]]


class EventKind(StrEnum):
    """Kinds of events that an autopilot or the daemon reports besides its measurements."""

    MODE = "mode"  # lasts until the next mode
    MESSAGE = "message"


class Event(NamedTuple):
    """A change of mode, or a message. t_s : time on the clock of the channels"""

    t_s: float
    kind: EventKind
    text: str


class Position(NamedTuple):
    """Position of a receiver at a time on the channels' clock."""

    t_s: float
    latitude_deg: float
    longitude_deg: float


class Fix(NamedTuple):
    """Date and place of a flight, as far as the receiver gives them.

    unix_at_zero_s : Unix time when the channels' clock is zero     by_satellites : whether that time is from GPS
    latitude_deg, longitude_deg, height_msl_m : the first position
    ends : the first and the last position, for a log of the daemon only; empty without a position
    """

    unix_at_zero_s: float | None = None
    by_satellites: bool = True
    latitude_deg: float | None = None
    longitude_deg: float | None = None
    height_msl_m: float | None = None
    ends: tuple[Position, ...] = ()


@dataclass(frozen=True)
class FlightRecording:
    """A log of any autopilot.

    channels : by name, in SI units; a name is missing where nothing was measured
    zeroed : whether the recorder has already corrected the zero of the airspeed's pressure
    thermometers : by description, temperatures of the air, or of parts that the air cools [K]
    notes : choices and damage, in sentences
    parameters : the autopilot's, by name, as logged
    air_temperature_K : air temperature in flight, if the user gives it
    inside : which thermometers are inside electronics, and so warmer than the air
    enabled_by : for each set of sensor channels, the autopilot's parameters that switch the sensor on
    by_radio : whether it was received as telemetry, of which much may be lost
    truth : TRUE_AIRSPEED and TRUE_HEIGHT from a simulation by the firmware; for comparison only
    place : by PLACE, the distance from the receiver's first position [m]; empty without positions
    fix : date and place
    events : modes and messages, in order of time
    vehicle : from `vehicle_of`; empty if the log does not identify the board that wrote it
    recorded_by : our daemon with its version; empty for other recorders
    """

    path: Path
    channels: Mapping[str, Channel]
    thermometers: Mapping[str, Channel] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    zeroed: bool = True
    parameters: Mapping[str, float] = field(default_factory=dict)
    air_temperature_K: float | None = None
    inside: frozenset[str] = frozenset()
    enabled_by: Mapping[frozenset[str], str] = field(default_factory=dict)
    truth: Mapping[str, Channel] = field(default_factory=dict)
    by_radio: bool = False
    vehicle: str = ""
    recorded_by: str = ""
    place: Mapping[str, Channel] = field(default_factory=dict)
    events: tuple[Event, ...] = ()
    fix: Fix = field(default_factory=Fix)


def vehicle_of(serial_number: str) -> str:
    """Return an autopilot board's identifier for results: the first 8 hex digits of its serial number's SHA-256.

    Results are passed on to others, and the serial number itself would identify the board to its maker. The probability
    that any two of a thousand boards have the same identifier is 1e-4.
    """
    return hashlib.sha256(serial_number.encode()).hexdigest()[:8]


def channel(t_s: ArrayLike, value: ArrayLike) -> Channel:
    """Return a channel with the samples that are finite."""
    t, x = without_damage(t_s), without_damage(value)
    finite = np.isfinite(t) & np.isfinite(x)
    return Channel(t[finite], x[finite])


def without_damage(value: ArrayLike) -> Array:
    """Return the numbers, with NaN for damaged ones: so large that no quantity of a flight has them in any unit."""
    x = np.asarray(value, dtype=float)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(x) < 1e30, x, np.nan)


def modes(t_s: ArrayLike, numbers: ArrayLike, names: Mapping[int, str]) -> list[Event]:
    """Return the changes of a mode logged as numbers (n,) at times (n,); a mode without a name keeps its number."""
    t, number = np.asarray(t_s, dtype=float), np.asarray(numbers, dtype=float)
    finite = np.isfinite(t) & (np.abs(number) < 2**31)  # larger numbers are damaged
    t, number = t[finite], number[finite].astype(int)
    changed = np.flatnonzero(np.append(True, number[1:] != number[:-1])[: len(number)])
    return [Event(float(t[i]), EventKind.MODE, names.get(int(number[i]), f"mode {number[i]}")) for i in changed]


def in_order(events: Iterable[Event]) -> tuple[Event, ...]:
    """Return the events in order of time, without those that lack a time or text."""
    return tuple(sorted(event for event in events if np.isfinite(event.t_s) and event.text.strip()))


def pressure_of_indicated_airspeed(speed_mps: ArrayLike) -> Array:
    """Return the differential pressure [Pa] behind an autopilot's indicated airspeed; negative for negative speeds."""
    speed = np.asarray(speed_mps, dtype=float)
    return np.asarray(np.sign(speed) * SEA_LEVEL_DENSITY / 2 * speed**2)  # indicated airspeed is defined at sea level


def without_jumps(*groups: Mapping[str, Channel]) -> tuple[list[dict[str, Channel]], list[str]]:
    """Apply `without_clock_jumps` to channels in several groups, with the first group's airspeed as `main`.

    Without an airspeed sensor, GPS velocity takes its place.
    """
    main = groups[0].get(AIRSPEED_PRESSURE, groups[0].get(GPS[0]))
    if main is None:
        return [dict(group) for group in groups], []
    joined = {name: channel for group in groups for name, channel in group.items()}
    regular, notes = without_clock_jumps(main, joined)
    return [{name: regular[name] for name in group if name in regular} for group in groups], notes


def without_clock_jumps(main: Channel, channels: Mapping[str, Channel]) -> tuple[dict[str, Channel], list[str]]:
    """Return the channels during the longest part of `main` without a clock jump, ascending in time, and a note.

    Impossible values, samples with a single wrong time, and channels that are too short are left out.
    """
    main = _without_single_times(main)
    channels = {name: _without_single_times(channel) for name, channel in channels.items()}
    temperature = READABLE.possible["temperature_K"]
    channels = {name: _possible(channel, *POSSIBLE.get(name, temperature)) for name, channel in channels.items()}
    parts = _parts(main.t_s)
    notes = []
    if len(parts) > 1:
        longest = max(parts, key=lambda rows: rows.stop - rows.start)
        span = float(main.t_s[longest.stop - 1] - main.t_s[longest.start])
        notes = [f"The log's clock jumped; the longest part without a jump, {span:.0f} s, is used."]
        low, high = main.t_s[longest.start], main.t_s[longest.stop - 1]
        channels = {name: _within(channel, float(low), float(high)) for name, channel in channels.items()}
    ascending = {name: _ascending(channel) for name, channel in channels.items()}
    return {name: channel for name, channel in ascending.items() if len(channel.t_s) >= READABLE.fewest_samples}, notes


def without_hover(
    channels: Mapping[str, Channel], lifting_s: Callable[[Array], Sequence[Array]]
) -> tuple[dict[str, Channel], list[str]]:
    """Drop airspeed where a VTOL's lifting motors run, so that no energy balance is made there; also return a note.

    lifting_s: gives, for the times (n,) of the airspeed, the times at which the lifting motors run.
    """
    airspeed = channels.get(AIRSPEED_PRESSURE)
    if airspeed is None:
        return {**channels}, []
    t_s = np.sort(np.concatenate([*lifting_s(airspeed.t_s), np.empty(0)]))
    if not len(t_s):
        return {**channels}, []
    after = np.searchsorted(t_s, airspeed.t_s)
    nearest = np.minimum(
        np.abs(airspeed.t_s - t_s[np.clip(after, 0, len(t_s) - 1)]),
        np.abs(airspeed.t_s - t_s[np.clip(after - 1, 0, None)]),
    )
    wing = nearest > READABLE.hover_s
    if wing.all():
        return {**channels}, []
    note = f"The lifting motors ran in {100 * np.mean(~wing):.0f} % of the log: hover and assisted flight are left out."
    return {**channels, AIRSPEED_PRESSURE: Channel(airspeed.t_s[wing], airspeed.value[wing])}, [note]


def _without_single_times(channel: Channel) -> Channel:
    """Drop single samples whose time is out of order although both neighbors are in order."""
    if len(channel.t_s) < 3:
        return channel
    before, middle, after = channel.t_s[:-2], channel.t_s[1:-1], channel.t_s[2:]
    wrong = (after >= before) & ((middle > after) | (middle < before))
    regular = np.concatenate([[True], ~wrong, [True]])
    return Channel(channel.t_s[regular], channel.value[regular])


def _possible(channel: Channel, least: float, greatest: float, spike: float) -> Channel:
    plausible = (channel.value >= least) & (channel.value <= greatest)
    t_s, value = channel.t_s[plausible], channel.value[plausible]
    if len(value) < READABLE.fewest_samples:
        return Channel(t_s, value)
    around = np.median(np.lib.stride_tricks.sliding_window_view(np.pad(value, 2, mode="reflect"), 5), axis=1)
    plausible = np.abs(value - around) <= spike
    return Channel(t_s[plausible], value[plausible])


def _parts(t_s: Array) -> list[slice]:
    """Return the rows between jumps of the clock: back by over 1 s, or forward by over READABLE.clock_jump_s."""
    step = np.diff(t_s)
    edges = np.flatnonzero((step < -1.0) | (step > READABLE.clock_jump_s)) + 1
    return [slice(int(a), int(b)) for a, b in zip([0, *edges], [*edges, len(t_s)], strict=True)]


def _within(channel: Channel, low: float, high: float) -> Channel:
    """Return the part of a channel with the most samples in an interval of time, cut to that interval."""
    best = Channel(np.empty(0), np.empty(0))
    for rows in _parts(channel.t_s) if len(channel.t_s) else []:
        t_s, value = channel.t_s[rows], channel.value[rows]
        inside = (t_s >= low) & (t_s <= high)
        if inside.sum() > len(best.t_s):
            best = Channel(t_s[inside], value[inside])
    return best


def _ascending(channel: Channel) -> Channel:
    if not len(channel.t_s):
        return channel
    later = np.concatenate([[True], channel.t_s[1:] > np.maximum.accumulate(channel.t_s)[:-1]])
    return Channel(channel.t_s[later], channel.value[later])


class Battery(NamedTuple):
    """Readings of one monitor. sum_of : names of the monitors whose currents it adds up, if the autopilot says so"""

    name: str
    voltage: Channel
    current: Channel
    sum_of: frozenset[str] = frozenset()


def measuring_battery(
    batteries: Sequence[Battery], controllers: Sequence[Battery] = ()
) -> tuple[Battery | None, list[str]]:
    """Return the battery that gives most power, or the sum of those that feed the motor together, and notes.

    The battery is None if nothing measures voltage and current. A monitor that shows the sum of others replaces them.
    controllers: readings of the speed controllers, used if no battery monitor measures power. A controller whose
    current never changes is ignored, because firmware fills in such values.
    """
    batteries, notes = _without_parts(batteries)
    power = [_mean_power_W(battery) for battery in batteries]
    if not any(P > 0 for P in power):
        measuring = [
            battery for battery in controllers if _mean_power_W(battery) > 0 and np.ptp(battery.current.value) > 0
        ]
        if not measuring:
            return None, []
        note = "No power module measures current: power is that of the speed controllers, without the avionics."
        return reduce(_in_parallel, measuring), [note]
    best = int(np.argmax(power))
    if best > 0:
        notes.append(f"{batteries[best].name} measures the propulsion: {batteries[0].name} carries less power.")
    used = batteries[best]
    for i, P in enumerate(power):
        if i == best or P <= INSTANCES.second_battery * power[best]:
            continue
        pair = f"{batteries[i].name} carries {100 * P / power[best]:.0f} % of the power of {batteries[best].name} and"
        if P < INSTANCES.second_pack * power[best]:
            notes.append(f"{pair} is not counted: where both feed the motor, the electrical power is too small.")
        elif _same_pack(batteries[i], batteries[best]):
            notes.append(f"{pair} has its voltage and current: one battery, measured twice, is counted once.")
        else:
            used = _in_parallel(used, batteries[i])
            notes.append(f"{pair} is added to it: two packs feed the motor.")
    return used, notes


def _without_parts(batteries: Sequence[Battery]) -> tuple[list[Battery], list[str]]:
    """Return the monitors without those that another monitor's sum contains, and notes."""
    power = {battery.name: _mean_power_W(battery) for battery in batteries}
    left_out: set[str] = set()
    notes = []
    for total in sorted(batteries, key=lambda battery: (not battery.sum_of, -power[battery.name])):
        others = [
            battery for battery in batteries if battery.name not in left_out | {total.name} and power[battery.name] > 0
        ]
        parts = [battery for battery in others if battery.name in total.sum_of] or _parts_of(total, others)
        if not parts or total.name in left_out:
            continue
        if power[total.name] < max(power[part.name] for part in parts):  # this summing monitor has failed
            left_out.add(total.name)
        else:
            left_out |= {part.name for part in parts}
            notes.append(f"{total.name} is the sum of {' and '.join(part.name for part in parts)}: they are not added.")
    return [battery for battery in batteries if battery.name not in left_out], notes


def _parts_of(total: Battery, others: Sequence[Battery]) -> Sequence[Battery]:
    """Return two or more other batteries whose currents add up to that of `total` while it is above its mean."""
    t_s, current_A = total.current
    if not len(t_s):
        return ()
    working = current_A >= np.mean(current_A)
    t_s, current_A = t_s[working], current_A[working]
    measured = [(battery, battery.current.at(t_s)) for battery in others if len(battery.current.t_s)]
    largest = sorted(measured, key=lambda pair: -float(np.mean(pair[1])))[
        :8
    ]  # limits the number of combinations in a damaged log
    errors_A = {
        parts: float(np.median(np.abs(current_A - sum(largest[i][1] for i in parts))))
        for count in range(2, len(largest) + 1)
        for parts in combinations(range(len(largest)), count)
    }
    best = min(errors_A, key=errors_A.__getitem__, default=())
    return [largest[i][0] for i in best] if best and _same_current(current_A, errors_A[best]) else ()


def _same_pack(battery: Battery, other: Battery) -> bool:
    """Return whether two monitors show the same voltage and current at all times, within their errors."""
    t_s = battery.current.t_s
    measured = [(b.voltage.at(t_s), b.current.at(t_s)) for b in (battery, other)]
    (V, A), (other_V, other_A) = measured
    error_V = float(np.median(np.abs(V - other_V)))
    return error_V < 0.02 * float(np.median(V)) and _same_current(A, float(np.median(np.abs(A - other_A))))


def _same_current(current_A: Array, error_A: float) -> bool:
    """Return whether a median difference is small enough for two meters of one current."""
    return error_A < 0.05 * float(np.median(np.abs(current_A)))


def _in_parallel(battery: Battery, other: Battery) -> Battery:
    """Combine two packs into one that has the voltage of the first and the power of both."""
    t_s = battery.current.t_s
    other_W = other.voltage.at(t_s) * other.current.at(t_s)
    current_A = battery.current.value + other_W / np.maximum(battery.voltage.at(t_s), 1.0)
    return Battery(f"{battery.name} and {other.name}", battery.voltage, Channel(t_s, current_A))


def turning_motor(motors: Sequence[Channel]) -> tuple[Channel | None, list[str]]:
    """Return the speed of the only motor that turns; if several turn, None and a note."""
    turning = [
        channel
        for channel in motors
        if len(channel.value) and float(np.percentile(channel.value, 90)) > INSTANCES.turning_revps
    ]
    if len(turning) > 1:
        return None, [f"{len(turning)} motors turn in this log; motor speed is used only where a single one turns."]
    return (turning[0], []) if turning else (None, [])


def propulsion(
    batteries: Sequence[Battery], controllers: Sequence[Battery], motors: Sequence[Channel], throttle: Channel | None
) -> tuple[dict[str, Channel], list[str], list[str]]:
    """Return channels of the battery that feeds the motor, the motor and the throttle; notes on battery and motor."""
    battery, battery_notes = measuring_battery(batteries, controllers)
    motor, motor_notes = turning_motor(motors)
    channels = {MOTOR: motor, THROTTLE: throttle}
    if battery:
        channels |= {VOLTAGE: battery.voltage, CURRENT: battery.current}
    return {name: channel for name, channel in channels.items() if channel is not None}, battery_notes, motor_notes


def most_varying(channels: Sequence[Channel]) -> Channel | None:
    """Return the channel that varies most: among several airspeed sensors, this is the connected one."""
    varying = [channel for channel in channels if len(channel.value) and np.ptp(channel.value) > 0]
    return max(varying, key=lambda channel: float(np.std(channel.value)), default=None)


def _mean_power_W(battery: Battery) -> float:
    if not len(battery.voltage.t_s) or not len(battery.current.t_s):
        return 0.0
    voltage = battery.voltage.at(battery.current.t_s)
    return float(np.mean(voltage * np.maximum(battery.current.value, 0.0)))
