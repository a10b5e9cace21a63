"""The channels of an ordinary flight, each with its own times; of several sensors, the one that is used."""

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

AIRSPEED_PRESSURE = "airspeed_pressure_Pa"  # pitot less static pressure, its zero not yet corrected
STATIC, FORCE_X, FORCE_Y, FORCE_Z = "static_Pa", "ax_mps2", "ay_mps2", "az_mps2"
VOLTAGE, CURRENT = "battery_V", "battery_A"
MOTOR, THROTTLE = "motor_revps", "throttle"  # the latter from 0 to 1, negative where it reverses
TRUE_AIRSPEED, TRUE_HEIGHT = "true_airspeed_mps", "true_height_m"  # of a simulation
OF_AIRSPEED, OF_BAROMETER = frozenset({AIRSPEED_PRESSURE}), frozenset({STATIC})
OF_BATTERY = frozenset({VOLTAGE, CURRENT})
GPS = ("gps_north_mps", "gps_east_mps", "gps_down_mps")
PLACE = ("north_m", "east_m")  # by a receiver


# By channel: the least and greatest possible value, and the greatest difference from the median of five samples.
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
    """Times [s], ascending, and values, both (n,)."""

    t_s: Array
    value: Array

    def at(self, t_s: Array) -> Array:
        """Values at other times (m,): linear between samples, the first and the last value beyond them."""
        return np.interp(t_s, self.t_s, self.value)


# Every number that a log has over time, by its own name, on the clock of the recording; read when it is called for.
AllChannels = Mapping[str, Callable[[], Channel]]


class EventKind(StrEnum):
    """What an autopilot or the daemon reports besides its measurements."""

    MODE = "mode"  # lasts until the next one
    MESSAGE = "message"


class Event(NamedTuple):
    """A change of mode, or a message. t_s : on the clock of the channels"""

    t_s: float
    kind: EventKind
    text: str


class Position(NamedTuple):
    """Where a receiver was at a time of the channels' clock."""

    t_s: float
    latitude_deg: float
    longitude_deg: float


class Fix(NamedTuple):
    """When and where a receiver was, as far as it says so.

    unix_at_zero_s : Unix time at zero of the channels' clock          by_satellites : whether that is a receiver's time
    latitude_deg, longitude_deg, height_msl_m : of its first position
    ends : its first and its last position, in a log of the daemon; empty without one
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
    zeroed : whether whatever recorded them has corrected the zero of the airspeed's pressure
    thermometers : by description, temperatures of the air, or of parts that the air cools [K]
    notes : choices and damage, in sentences
    parameters : the autopilot's, by name, as logged
    air_temperature_K : in flight, where the user says it
    inside : which thermometers are inside electronics, and so warmer than the air
    enabled_by : by a sensor's channels, which parameters of the autopilot switch it on
    by_radio : received as telemetry, of which much may be lost
    truth : of a simulation by the firmware, TRUE_AIRSPEED and TRUE_HEIGHT; compared, never used
    place : by PLACE, the distance from the first position of the receiver [m]; empty where it shows none
    fix : date and place
    events : modes and messages, in order of time
    vehicle : of `vehicle_of`; empty where the log does not say which board wrote it
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
    """Identifies an autopilot's board in results: the first 8 hexadecimal digits of its serial number's SHA-256.

    Results are passed on, and the number itself names the board to its maker. Of a thousand boards two are alike with a
    probability of 1e-4.
    """
    return hashlib.sha256(serial_number.encode()).hexdigest()[:8]


def channel(t_s: ArrayLike, value: ArrayLike) -> Channel:
    """A channel without its samples that are not finite."""
    t, x = without_damage(t_s), without_damage(value)
    finite = np.isfinite(t) & np.isfinite(x)
    return Channel(t[finite], x[finite])


def without_damage(value: ArrayLike) -> Array:
    """The numbers, NaN for those that no quantity of a flight has in any unit: damage makes them overflow."""
    x = np.asarray(value, dtype=float)
    with np.errstate(invalid="ignore"):
        return np.where(np.abs(x) < 1e30, x, np.nan)


def modes(t_s: ArrayLike, numbers: ArrayLike, names: Mapping[int, str]) -> list[Event]:
    """The changes of a mode that is logged as a number (n,) at times (n,); one without a name keeps its number."""
    t, number = np.asarray(t_s, dtype=float), np.asarray(numbers, dtype=float)
    finite = np.isfinite(t) & (np.abs(number) < 2**31)  # a larger number is damaged
    t, number = t[finite], number[finite].astype(int)
    changed = np.flatnonzero(np.append(True, number[1:] != number[:-1])[: len(number)])
    return [Event(float(t[i]), EventKind.MODE, names.get(int(number[i]), f"mode {number[i]}")) for i in changed]


def in_order(events: Iterable[Event]) -> tuple[Event, ...]:
    """Events in order of time, without those whose time or text is missing."""
    return tuple(sorted(event for event in events if np.isfinite(event.t_s) and event.text.strip()))


def pressure_of_indicated_airspeed(speed_mps: ArrayLike) -> Array:
    """Differential pressure [Pa] that an autopilot showed as this indicated airspeed; negative below zero."""
    speed = np.asarray(speed_mps, dtype=float)
    return np.asarray(np.sign(speed) * SEA_LEVEL_DENSITY / 2 * speed**2)  # indicated airspeed is defined at sea level


def without_jumps(*groups: Mapping[str, Channel]) -> tuple[list[dict[str, Channel]], list[str]]:
    """`without_clock_jumps` of the airspeed, which is in the first group, applied to channels in several groups.

    Without an airspeed sensor, of the velocity by GPS.
    """
    main = groups[0].get(AIRSPEED_PRESSURE, groups[0].get(GPS[0]))
    if main is None:
        return [dict(group) for group in groups], []
    joined = {name: channel for group in groups for name, channel in group.items()}
    regular, notes = without_clock_jumps(main, joined)
    return [{name: regular[name] for name in group if name in regular} for group in groups], notes


def without_clock_jumps(main: Channel, channels: Mapping[str, Channel]) -> tuple[dict[str, Channel], list[str]]:
    """The channels over the longest part of `main` between jumps of the clock, ascending in time, and a note.

    Values that are impossible, single wrong times and channels that are too short are left out.
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
    """The channels with no airspeed where a VTOL's lifting motors run, and a note; so no balance is made there.

    lifting_s: times (n,) at which the autopilot lets them run, by those of the airspeed.
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
    """Drops single samples whose time is out of order although both neighbors are in order."""
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
    """Rows between steps back, and steps forward by more than READABLE.clock_jump_s."""
    step = np.diff(t_s)
    edges = np.flatnonzero((step < -1.0) | (step > READABLE.clock_jump_s)) + 1
    return [slice(int(a), int(b)) for a, b in zip([0, *edges], [*edges, len(t_s)], strict=True)]


def _within(channel: Channel, low: float, high: float) -> Channel:
    """The part of a channel that overlaps most with an interval of time."""
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
    """What one monitor measures. sum_of : names of the monitors whose currents it adds, where the autopilot says so"""

    name: str
    voltage: Channel
    current: Channel
    sum_of: frozenset[str] = frozenset()


def measuring_battery(
    batteries: Sequence[Battery], controllers: Sequence[Battery] = ()
) -> tuple[Battery | None, list[str]]:
    """The battery that gives most power, or the sum of two that feed the motor together, and notes; None where none
    measures voltage and current. A monitor that shows the sum of others stands for them. controllers: what the speed
    controllers measure, which counts where no battery does and unless it is always the same, as firmware fills in.
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
    """The monitors without those that are contained in another one's sum, and notes."""
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
        if power[total.name] < max(power[part.name] for part in parts):  # a summing monitor that fails
            left_out.add(total.name)
        else:
            left_out |= {part.name for part in parts}
            notes.append(f"{total.name} is the sum of {' and '.join(part.name for part in parts)}: they are not added.")
    return [battery for battery in batteries if battery.name not in left_out], notes


def _parts_of(total: Battery, others: Sequence[Battery]) -> Sequence[Battery]:
    """The other batteries, two or more, whose currents add up to this one's while that is above its mean."""
    t_s, current_A = total.current
    if not len(t_s):
        return ()
    working = current_A >= np.mean(current_A)
    t_s, current_A = t_s[working], current_A[working]
    measured = [(battery, battery.current.at(t_s)) for battery in others if len(battery.current.t_s)]
    largest = sorted(measured, key=lambda pair: -float(np.mean(pair[1])))[
        :8
    ]  # the combinations stay few in a damaged log
    errors_A = {
        parts: float(np.median(np.abs(current_A - sum(largest[i][1] for i in parts))))
        for count in range(2, len(largest) + 1)
        for parts in combinations(range(len(largest)), count)
    }
    best = min(errors_A, key=errors_A.__getitem__, default=())
    return [largest[i][0] for i in best] if best and _same_current(current_A, errors_A[best]) else ()


def _same_pack(battery: Battery, other: Battery) -> bool:
    """Whether two monitors show the same voltage, and the same current at each time, within their errors."""
    t_s = battery.current.t_s
    measured = [(b.voltage.at(t_s), b.current.at(t_s)) for b in (battery, other)]
    (V, A), (other_V, other_A) = measured
    error_V = float(np.median(np.abs(V - other_V)))
    return error_V < 0.02 * float(np.median(V)) and _same_current(A, float(np.median(np.abs(A - other_A))))


def _same_current(current_A: Array, error_A: float) -> bool:
    """Whether a median difference is what two meters of one current have."""
    return error_A < 0.05 * float(np.median(np.abs(current_A)))


def _in_parallel(battery: Battery, other: Battery) -> Battery:
    """Both packs as one with the voltage of the first that gives the power of both."""
    t_s = battery.current.t_s
    other_W = other.voltage.at(t_s) * other.current.at(t_s)
    current_A = battery.current.value + other_W / np.maximum(battery.voltage.at(t_s), 1.0)
    return Battery(f"{battery.name} and {other.name}", battery.voltage, Channel(t_s, current_A))


def turning_motor(motors: Sequence[Channel]) -> tuple[Channel | None, list[str]]:
    """The speed of the one motor that turns, and a note where several do."""
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
    """Channels of the battery that feeds the motor, of the motor and of the throttle; notes on battery and motor."""
    battery, battery_notes = measuring_battery(batteries, controllers)
    motor, motor_notes = turning_motor(motors)
    channels = {MOTOR: motor, THROTTLE: throttle}
    if battery:
        channels |= {VOLTAGE: battery.voltage, CURRENT: battery.current}
    return {name: channel for name, channel in channels.items() if channel is not None}, battery_notes, motor_notes


def most_varying(channels: Sequence[Channel]) -> Channel | None:
    """The channel that varies most: of several airspeed sensors, this is the connected one."""
    varying = [channel for channel in channels if len(channel.value) and np.ptp(channel.value) > 0]
    return max(varying, key=lambda channel: float(np.std(channel.value)), default=None)


def _mean_power_W(battery: Battery) -> float:
    if not len(battery.voltage.t_s) or not len(battery.current.t_s):
        return 0.0
    voltage = battery.voltage.at(battery.current.t_s)
    return float(np.mean(voltage * np.maximum(battery.current.value, 0.0)))
