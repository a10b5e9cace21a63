"""Compares a table's quantities by laws of motion, and reports a wrong unit, sign, delay or column.

A law gives one quantity from others. Both sides are smoothed over a second on one grid. Their correlation at the best
delay, that delay, and the ratio of their spreads show what is wrong. The limits were tested on simulated and real
flights.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from enum import StrEnum
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from flightpower.analysis.sources.column_map import Channels
from flightpower.analysis.sources.grid import resampled
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.analysis.sources.law_settings import LAWS
from flightpower.analysis.sources.motion import SIDES, Motion
from flightpower.analysis.sources.position import velocity_by_position
from flightpower.analysis.sources.quantities import KINDS, Quantity
from flightpower.analysis.sources.recording import Channel
from flightpower.analysis.sources.resolution import without_steps
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY, density, height_at, temperature_at
from flightpower.flight.runs import LEVEL_RUN
from flightpower.flight.units import GRAVITY_MPS2 as g
from flightpower.flight.units import to_si

Q = Quantity
ForceAxes = (Q.FORCE_FORWARD, Q.FORCE_RIGHT, Q.FORCE_DOWN)


class Mistake(StrEnum):
    RANGE = "impossible values"
    UNIT = "unit"
    SIGN = "sign"
    DELAY = "delay"
    EXCHANGED = "exchanged columns"
    UNRELATED = "another quantity"


class Finding(NamedTuple):
    """quantities : those of which one is wrong    text : the finding in words, with the remedy"""

    mistake: Mistake
    quantities: tuple[Quantity, ...]
    text: str


class Relation(NamedTuple):
    """Relation of two signals: correlation without delay and at the best delay [s], and the ratio of their spreads."""

    at_once: float
    best: float
    delay_s: float
    ratio: float


class Law(NamedTuple):
    """Two signals (n,) that rise together.

    quantities : those in the law, starting with the first signal's     exact : whether the signals' ratio is one
    least : spread of the second signal below which disturbances hide the law, so that nothing is judged
    lag_s : delay of one signal behind the other that the law itself implies
    """

    quantities: tuple[Quantity, ...]
    first: Array
    second: Array
    exact: bool
    least: float = 0.0
    lag_s: float = 0.0


# Units that are mistaken for SI units: by the unit in words, the unit and the SI unit.
TAKEN_FOR_SI = {
    "degrees": ("deg", "rad"), "knots": ("knot", "m/s"), "km/h": ("km/h", "m/s"), "feet": ("ft", "m"),
    "miles per hour": ("mile/hour", "m/s"), "g": ("standard_gravity", "m/s^2"), "thousandths": ("mm", "m"),
    "hundredths": ("cm", "m"), "feet per minute": ("ft/min", "m/s"), "revolutions per minute": ("rpm", "turn/s"),
}  # fmt: skip


class Grid:
    """The quantities on one grid of FLIGHT.step_s, smoothed over a second; NaN in gaps."""

    def __init__(self, channels: Channels):
        low = min(float(channel.t_s[0]) for channel in channels.values())
        high = max(float(channel.t_s[-1]) for channel in channels.values())
        self.t_s = np.arange(low, high, FLIGHT.step_s)
        self._channels, self._made = channels, dict[Quantity, Array | None]()

    def __getitem__(self, quantity: Quantity) -> Array | None:
        """Return the quantity (n,); None if the table does not have it."""
        if quantity not in self._made:
            channel = self._channels.get(quantity)
            if channel is not None and quantity in (Q.HEADING, Q.COURSE, Q.ROLL):
                channel = Channel(channel.t_s, np.unwrap(channel.value))
            elif channel is not None and quantity in (Q.HEIGHT, Q.STATIC_PRESSURE):
                channel = without_steps(channel)
            made = None if channel is None else resampled(channel, self.t_s)
            self._made[quantity] = made
        return self._made[quantity]

    def all(self, *quantities: Quantity) -> list[Array] | None:
        """Return all of these quantities; None if one is missing."""
        columns = [self[quantity] for quantity in quantities]
        return (
            None if any(values is None for values in columns) else [values for values in columns if values is not None]
        )

    def rate(self, value: Array) -> Array:
        """Return the derivative with respect to time (n,)."""
        return np.asarray(np.gradient(value, FLIGHT.step_s))

    def change(self, value: Array, samples: int = 1) -> Array:
        """Return the change over this many samples (n,), from the derivative."""
        return np.asarray(samples * FLIGHT.step_s * self.rate(value))

    def climb(self) -> Array:
        """Return the rate of climb (n,) [m/s]; NaN if there is no height."""
        height = self.height()
        return np.full(len(self.t_s), np.nan) if height is None else self.rate(height[1])

    def true_airspeed(self) -> Array:
        """Return the true airspeed in flight (n,); NaN on the ground."""
        airspeed_table = self.airspeed()
        return (
            np.full(len(self.t_s), np.nan)
            if airspeed_table is None
            else np.where(_flown(airspeed_table[1]), airspeed_table[1], np.nan)
        )

    def pressure_of_flight(self) -> Array:
        """Return the square of the airspeed in flight (n,), to which dynamic pressure is proportional."""
        return np.asarray(np.maximum(self.true_airspeed(), 1.0) ** 2)

    def turn_rate(self) -> Array:
        """Return the rate of the course over ground (n,); NaN where ground speed is low or unknown."""
        ground = self.ground_velocity()
        if ground is None:
            return np.full(len(self.t_s), np.nan)
        _, north, east = ground
        moving = np.hypot(north, east) > 0.3 * np.nanpercentile(np.hypot(north, east), 90)
        finite = np.isfinite(north + east)
        course = np.full(len(north), np.nan)
        course[finite] = np.unwrap(np.arctan2(east[finite], north[finite]))
        return np.where(moving, self.rate(course), np.nan)

    def height(self) -> tuple[Quantity, Array] | None:
        if (h := self[Q.HEIGHT]) is not None:
            return Q.HEIGHT, h
        pressure = self[Q.STATIC_PRESSURE]
        return None if pressure is None else (Q.STATIC_PRESSURE, np.asarray(height_at(np.maximum(pressure, 1.0))))

    def airspeed(self) -> tuple[Quantity, Array] | None:
        """Return the quantity that gives the true airspeed, and the true airspeed (n,)."""
        height = self.height()
        rho = SEA_LEVEL_DENSITY
        if height is not None:
            pressure = 101325.0 * (1 - 2.25577e-5 * np.clip(height[1], -500, 12_000)) ** 5.25588
            rho = density(pressure, temperature_at(np.clip(height[1], -500, 12_000)))
        if (V := self[Q.TRUE_AIRSPEED]) is not None:
            return Q.TRUE_AIRSPEED, V
        if (V := self[Q.INDICATED_AIRSPEED]) is not None:
            return Q.INDICATED_AIRSPEED, np.asarray(V * np.sqrt(SEA_LEVEL_DENSITY / rho))
        if (q := self[Q.DYNAMIC_PRESSURE]) is not None:
            return Q.DYNAMIC_PRESSURE, np.asarray(np.sqrt(2 * np.maximum(q, 0.0) / rho))
        return None

    def ground_velocity(self) -> tuple[tuple[Quantity, ...], Array, Array] | None:
        """Return the quantities that give the ground velocity, and its north and east components (n,)."""
        if (pair := self.all(Q.VELOCITY_NORTH, Q.VELOCITY_EAST)) is not None:
            return (Q.VELOCITY_NORTH, Q.VELOCITY_EAST), pair[0], pair[1]
        if (pair := self.all(Q.GROUND_SPEED, Q.COURSE)) is not None:
            return (Q.GROUND_SPEED, Q.COURSE), pair[0] * np.cos(pair[1]), pair[0] * np.sin(pair[1])
        if {Q.LATITUDE, Q.LONGITUDE} <= self._channels.keys():
            by_position = velocity_by_position(self._channels[Q.LATITUDE], self._channels[Q.LONGITUDE])
            north, east = (resampled(channel, self.t_s) for channel in by_position)
            return (Q.LATITUDE, Q.LONGITUDE), north, east
        return None


def _flown(V: Array) -> NDArray[np.bool_]:
    """Return the rows in which an aircraft with this airspeed (n,) flies, rather than stands or rolls."""
    finite = V[np.isfinite(V)]
    if not len(finite):
        return np.zeros(len(V), dtype=bool)
    moving = finite[finite > 0.3 * np.percentile(finite, 90)]
    return np.asarray(V > (0.6 * np.median(moving) if len(moving) else np.inf))


def _heave_s(V: Array) -> float:
    """Return how long [s] lift lags behind pitch at the median airspeed in flight; V : (n,)."""
    flown = _flown(V)
    return LAWS.delay.heave_s_per_mps * float(np.median(V[flown])) if flown.any() else 0.0


def relation(first: Array, second: Array) -> Relation | None:
    """Return the relation of two signals; None if too little is known, or if one is constant."""
    finite = np.isfinite(first + second)
    if finite.sum() * FLIGHT.step_s < 20.0:
        return None
    x, y = (np.where(finite, values - np.mean(values[finite]), 0.0) for values in (first, second))
    if np.std(x[finite]) == 0 or np.std(y[finite]) == 0:
        return None
    reach = round(6.0 / FLIGHT.step_s)
    correlation = _correlations(x, y, finite, reach)
    best = int(np.argmax(np.abs(correlation)))
    ratio = float(np.std(x[finite]) / np.std(y[finite]))
    return Relation(float(correlation[reach]), float(correlation[best]), (best - reach) * FLIGHT.step_s, ratio)


def _correlations(x: Array, y: Array, finite: NDArray[np.bool_], reach: int) -> Array:
    """Return correlations of x with y delayed by -reach to reach samples; zero if too few are known."""

    def sums(first: Array, second: Array) -> Array:
        late = sliding_window_view(np.pad(second, reach), len(second))[::-1]
        return np.asarray(late @ first)

    k = finite.astype(float)
    n = np.maximum(sums(k, k), 1)
    mean_x, mean_y = sums(x, k) / n, sums(k, y) / n
    variance_x, variance_y = sums(x * x, k) / n - mean_x**2, sums(k, y * y) / n - mean_y**2
    spread = np.sqrt(np.maximum(variance_x, 0.0) * np.maximum(variance_y, 0.0))
    useful = (n >= 50) & (spread > 1e-9 * np.std(x) * np.std(y))
    return np.where(useful, (sums(x, y) / n - mean_x * mean_y) / np.where(useful, spread, 1.0), 0.0)


def findings(channels: Channels, name: Callable[[Quantity], str]) -> list[Finding]:
    """Return the contradictions, impossible ranges first, then the most contradicted. name: gives a quantity's name."""
    if not channels:
        return []
    findings = list(_ranges(channels, name))
    grid = Grid(channels)
    findings += _gravity(grid, name)
    findings += _battery(grid, name)
    for laws in (_attitude_laws, _vertical_laws, _speed_laws, _power_laws):
        for law in laws(grid):
            if (finding := _judged(law, name)) is not None:
                findings.append(finding)
    findings += _energy(grid, name)
    findings += _ground_speed(grid, name)
    often = Counter(quantity for finding in findings for quantity in finding.quantities)
    return sorted(findings, key=lambda finding: (finding.mistake is not Mistake.RANGE, -often[finding.quantities[0]]))


def _ranges(channels: Channels, name: Callable[[Quantity], str]) -> Iterator[Finding]:
    for quantity, channel in channels.items():
        kind = KINDS[quantity]
        out_of_range = np.logical_or(channel.value < kind.least, channel.value > kind.greatest)
        if np.mean(out_of_range) > 0.2:
            usual = float(np.median(channel.value[out_of_range]))
            yield Finding(
                Mistake.RANGE,
                (quantity,),
                f"{name(quantity)} is {usual:.4g} {kind.unit} in {100 * np.mean(out_of_range):.0f} % of the table,"
                " which it cannot be: correct its unit or column in the map",
            )


def _gravity(grid: Grid, name: Callable[[Quantity], str]) -> Iterator[Finding]:
    """Check that the median specific force is near g and points upward."""
    force = grid.all(*ForceAxes)
    if force is None:
        return
    median = np.array([np.nanmedian(component) for component in force])
    size = float(np.nanmedian(np.linalg.norm(force, axis=0)))
    largest = int(np.argmax(np.abs(median)))
    down = name(Q.FORCE_DOWN)
    if not _one_unit(size / g):
        looks = _looks_like(size / g)
        yield Finding(
            Mistake.UNIT, ForceAxes, f"the specific force is {size:.3g} m/s^2 in the middle, not near 9.8{looks}"
        )
    elif largest != 2 and abs(median[largest]) > 0.8 * size:
        yield Finding(
            Mistake.EXCHANGED,
            (Q.FORCE_DOWN, ForceAxes[largest]),
            f"gravity is in {name(ForceAxes[largest])}, not in {down}: exchange the columns",
        )
    elif median[2] > 0.5 * size:
        yield Finding(
            Mistake.SIGN, (Q.FORCE_DOWN,), f"{down} is {median[2]:+.3g} m/s^2, in level flight it is -9.8: factor = -1"
        )


def _battery(grid: Grid, name: Callable[[Quantity], str]) -> Iterator[Finding]:
    pair = grid.all(Q.VOLTAGE, Q.CURRENT)
    if pair is not None:
        spread = [float(np.nanstd(values)) / max(abs(float(np.nanmean(values))), 1e-9) for values in pair]
        if spread[0] > 0.15 and spread[0] > 1.5 * spread[1]:
            yield Finding(
                Mistake.EXCHANGED,
                (Q.VOLTAGE, Q.CURRENT),
                f"{name(Q.VOLTAGE)} varies by {100 * spread[0]:.0f} %, more than {name(Q.CURRENT)}: a battery's voltage"
                " does not; exchange the columns",
            )
    low = grid[Q.CURRENT] if grid[Q.POWER] is None else grid[Q.POWER]
    if low is not None and np.nanpercentile(low, 5) < -0.5 and np.nanmedian(low) < 0:
        quantity = Q.CURRENT if grid[Q.POWER] is None else Q.POWER
        yield Finding(Mistake.SIGN, (quantity,), f"{name(quantity)} is negative in flight: factor = -1 in the map")


def _attitude_laws(grid: Grid) -> Iterator[Law]:
    angles = grid.all(Q.ROLL, Q.PITCH)
    rates = grid.all(Q.ROLL_RATE, Q.PITCH_RATE, Q.YAW_RATE)
    heading = grid[Q.HEADING]
    if angles is not None and rates is not None:
        (roll, pitch), (p, q, r) = angles, rates
        turning = (q * np.sin(roll) + r * np.cos(roll)) / np.cos(pitch)
        yield Law((Q.ROLL_RATE, Q.ROLL), p, grid.rate(roll) - turning * np.sin(pitch), True)
        pitching = grid.rate(pitch)
        yield Law((Q.PITCH_RATE, Q.PITCH), q * np.cos(roll) - r * np.sin(roll), pitching, True)
        if heading is not None:
            yawing = grid.rate(heading) * np.cos(pitch) * np.cos(roll) - pitching * np.sin(roll)
            yield Law((Q.YAW_RATE, Q.HEADING), r, yawing, True)
    elif angles is not None and heading is not None:
        (roll, pitch), heading_rate = angles, grid.rate(heading)
        turning_by = {
            Q.ROLL_RATE: grid.rate(roll) - heading_rate * np.sin(pitch),
            Q.PITCH_RATE: grid.rate(pitch) * np.cos(roll) + heading_rate * np.cos(pitch) * np.sin(roll),
            Q.YAW_RATE: heading_rate * np.cos(pitch) * np.cos(roll) - grid.rate(pitch) * np.sin(roll),
        }
        for quantity, by_angles in turning_by.items():
            if (rate := grid[quantity]) is not None:
                yield Law((quantity, Q.ROLL, Q.PITCH, Q.HEADING), rate, by_angles, True)
    elif (pair := grid.all(Q.ROLL_RATE, Q.ROLL)) is not None:
        yield Law((Q.ROLL_RATE, Q.ROLL), pair[0], grid.rate(pair[1]), True)
    ground, airspeed = grid.ground_velocity(), grid.airspeed()
    if ground is None:
        return
    quantities, course_rate = ground[0], grid.turn_rate()
    if heading is not None:
        yield Law((Q.HEADING, *quantities), grid.rate(heading), course_rate, False)
    if grid[Q.YAW_RATE] is not None:
        yield Law((Q.YAW_RATE, *quantities), *SIDES[Motion.COURSE_IN_TURN](grid), False)
    if (bank := grid[Q.ROLL]) is not None and airspeed is not None:
        turn = np.arctan(np.clip(airspeed[1] * course_rate / g, -3, 3))
        yield Law((Q.ROLL, *quantities), bank, turn, True, least=LEVEL_RUN.largest_bank_rad / 8)


def _vertical_laws(grid: Grid) -> Iterator[Law]:
    height, velocity_down, airspeed = grid.height(), grid[Q.VELOCITY_DOWN], grid.airspeed()
    if height is None:
        return
    climb = grid.rate(height[1])
    if velocity_down is not None:
        yield Law((height[0], Q.VELOCITY_DOWN), *SIDES[Motion.CLIMB](grid), True)
    if (pressure := grid[Q.STATIC_PRESSURE]) is not None and height[0] is Q.HEIGHT:
        yield Law((Q.HEIGHT, Q.STATIC_PRESSURE), height[1], np.asarray(height_at(np.maximum(pressure, 1.0))), True)
    if airspeed is None:
        return
    path = np.where(_flown(airspeed[1]), climb / np.maximum(airspeed[1], 1.0), np.nan)
    alpha = grid[Q.ANGLE_OF_ATTACK]
    if (pitch := grid[Q.PITCH]) is not None:
        if alpha is not None:
            roll = np.zeros(len(pitch)) if (banked := grid[Q.ROLL]) is None else banked
            level = np.where(np.abs(roll) < 0.5, pitch - path, np.nan)
            yield Law((Q.ANGLE_OF_ATTACK, Q.PITCH, height[0], airspeed[0]), alpha, level / np.cos(roll), True)
        else:
            yield Law((Q.PITCH, height[0]), pitch, path, False, lag_s=_heave_s(airspeed[1]))


def _speed_laws(grid: Grid) -> Iterator[Law]:
    airspeed, height = grid.airspeed(), grid.height()
    if airspeed is None:
        return
    speed_quantity, V = airspeed
    flown = _flown(V)
    down, q, alpha = grid[Q.FORCE_DOWN], grid[Q.PITCH_RATE], grid[Q.ANGLE_OF_ATTACK]
    angles = grid.all(Q.ROLL, Q.PITCH)
    if down is not None and q is not None and angles is not None:
        needed = V * q + g * np.cos(angles[0]) * np.cos(angles[1])
        lag_s = _heave_s(V)
        if alpha is not None:  # the part of gravity that accelerates the aircraft in heave
            needed, lag_s = needed - grid.rate(V * np.sin(alpha)), 0.0
        yield Law(
            (Q.FORCE_DOWN, Q.PITCH_RATE, speed_quantity), np.where(flown, -down, np.nan), needed, False, lag_s=lag_s
        )
    if alpha is not None and down is not None:
        yield Law(
            (Q.ANGLE_OF_ATTACK, Q.FORCE_DOWN, speed_quantity), *SIDES[Motion.LIFT_BY_ANGLE_OF_ATTACK](grid), False
        )
    for quantity in (Q.INDICATED_AIRSPEED, Q.DYNAMIC_PRESSURE):
        if quantity is not speed_quantity and (other := grid[quantity]) is not None:
            component = (
                other if quantity is Q.INDICATED_AIRSPEED else np.sqrt(2 * np.maximum(other, 0.0) / SEA_LEVEL_DENSITY)
            )
            yield Law((quantity, speed_quantity), component, V, True)
    if height is not None and grid.all(Q.FORCE_FORWARD, Q.FORCE_DOWN, Q.ANGLE_OF_ATTACK) is not None:
        yield Law((Q.FORCE_FORWARD, speed_quantity, height[0]), *SIDES[Motion.FORCE_ALONG_PATH](grid), True)


def _power_laws(grid: Grid) -> Iterator[Law]:
    pair = grid.all(Q.VOLTAGE, Q.CURRENT)
    power = grid[Q.POWER] if pair is None else pair[0] * pair[1]
    source = Q.POWER if pair is None else Q.CURRENT
    if power is not None:
        for quantity in (Q.MOTOR_SPEED, Q.THROTTLE):
            if (values := grid[quantity]) is not None:
                yield Law((quantity, source), values, np.cbrt(np.maximum(power, 0.0)), False)
    airspeed, height = grid.airspeed(), grid.height()
    if airspeed is None or height is None:
        return
    V = airspeed[1]
    flown = _flown(V)
    gain = np.where(flown, grid.rate(V) + g * grid.rate(height[1]) / np.maximum(V, 1.0), np.nan)
    if (thrust := grid[Q.THRUST]) is not None:
        yield Law((Q.THRUST, airspeed[0], height[0]), thrust, gain, False)


def _judged(law: Law, name: Callable[[Quantity], str]) -> Finding | None:
    fitted = relation(law.first, law.second)
    if fitted is None or float(np.nanstd(law.second)) < law.least:
        return None
    first, others = name(law.quantities[0]), " and ".join(name(quantity) for quantity in law.quantities[1:])
    if abs(fitted.best) < LAWS.correlation.related:
        if not law.exact:
            return None
        return Finding(
            Mistake.UNRELATED,
            law.quantities,
            f"{first} does not follow {others}, by which it is given (correlation {fitted.best:.2f}): one of these"
            " columns is another quantity, or its unit is wrong",
        )
    shortest_s, share, _ = LAWS.delay
    explained = 1 - fitted.best**2 < share * (1 - fitted.at_once**2)
    if abs(fitted.delay_s) - law.lag_s >= shortest_s and explained and abs(fitted.best) > LAWS.correlation.delayed:
        late = f"late by {fitted.delay_s:.1f} s" if fitted.delay_s > 0 else f"early by {-fitted.delay_s:.1f} s"
        return Finding(
            Mistake.DELAY, law.quantities, f"{first} is {late} against {others}: give the delay of one in the map"
        )
    if fitted.best < 0:
        return Finding(
            Mistake.SIGN,
            law.quantities,
            f"{first} falls where it rises by {others}: one of them has the wrong sign or axis; factor = -1 in the map",
        )
    if law.exact and fitted.best > LAWS.correlation.scaled and not _one_unit(fitted.ratio):
        return Finding(
            Mistake.UNIT,
            law.quantities,
            f"{first} varies {fitted.ratio:.3g} times as much as it does by {others}{_looks_like(fitted.ratio)}",
        )
    return None


@cache
def _factors() -> dict[str, float]:
    """Return, by the unit in words, the factor from that unit to the SI unit for which it is mistaken."""
    return {words: to_si(f"1 {unit}", si, words) for words, (unit, si) in TAKEN_FOR_SI.items()}


def _one_unit(ratio: float) -> bool:
    """Return whether a ratio is nearer to one than to the ratio of any unit to its SI unit."""
    return bool(abs(np.log(ratio)) < min(abs(np.log(factor)) for factor in _factors().values()) / 2)


def _looks_like(ratio: float) -> str:
    off = {
        words: min(abs(np.log(ratio * by)) for by in (difference, 1 / difference))
        for words, difference in _factors().items()
    }
    near = {words: difference for words, difference in off.items() if difference < 0.12}
    unit = min(near, key=lambda difference: near[difference], default=None)
    return f": one of them is in {unit}, or should be" if unit else ": correct the unit of one of them"


class EnergyBalance(NamedTuple):
    """How changes of height balance changes of speed. ratio: of their spreads, 1 if both units are right.

    correlation: since both have noise, the true ratio is between ratio * correlation and ratio / correlation.
    """

    ratio: float
    correlation: float


def energy_balance(grid: Grid) -> EnergyBalance | None:
    """Compare height and speed by energy: g dh/dt and -V dV/dt, both less the parts that airspeed and power explain.

    Drag power is a function of airspeed (constant, V^3, 1/V), and the rest of the power raises kinetic and potential
    energy. Both are smoothed over LAWS.energy[0] seconds. Returns None if too little is known.
    """
    airspeed, height = grid.airspeed(), grid[Q.HEIGHT]
    if airspeed is None or height is None:
        return None
    battery = grid.all(Q.VOLTAGE, Q.CURRENT)
    power = battery[0] * battery[1] if battery is not None else grid[Q.POWER]
    V = airspeed[1]
    power = np.ones(len(V)) if power is None else power
    width = round(LAWS.energy[0] / FLIGHT.step_s)
    flown = _flown(V) & np.isfinite(V + height + power)
    share = _moving_mean(flown.astype(float), width)
    inside = share > 1 - 0.5 / width
    V, height, power = (
        _moving_mean(np.where(flown, values, 0.0), width) / np.maximum(share, 0.5 / width)
        for values in (V, height, power)
    )
    if inside.sum() * FLIGHT.step_s < LAWS.energy[1]:
        return None
    columns = np.stack([np.ones(len(V)), V**3, 1 / np.maximum(V, 1.0), power], axis=1)[inside]
    basis = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), full_matrices=False)[0]
    climb, slowing = g * grid.rate(height)[inside], -(V * grid.rate(V))[inside]
    left = [values - basis @ (basis.T @ values) for values in (climb, slowing)]
    spreads = [float(np.linalg.norm(values)) for values in left]
    if min(spreads) == 0:
        return None
    return EnergyBalance(spreads[0] / spreads[1], float(left[0] @ left[1]) / (spreads[0] * spreads[1]))


def _moving_mean(values: Array, width: int) -> Array:
    return np.convolve(values, np.ones(width) / width, mode="same")


def height_is_checked(channels: Channels) -> bool:
    """Return whether pressure, climb or changes of speed in the table can check the unit of its height."""
    grid = Grid(channels)
    if grid[Q.STATIC_PRESSURE] is not None or grid[Q.VELOCITY_DOWN] is not None:
        return True
    balance = energy_balance(grid)
    return balance is not None and balance.correlation > LAWS.correlation.related


def _energy(grid: Grid, name: Callable[[Quantity], str]) -> Iterator[Finding]:
    """Yield a finding if noise cannot explain the ratio of climb to speed changes; only without a climb column."""
    airspeed, balance = grid.airspeed(), energy_balance(grid)
    if airspeed is None or balance is None or grid[Q.VELOCITY_DOWN] is not None:
        return
    if balance.correlation < LAWS.correlation.related:
        return
    nearest = np.clip(1.0, balance.ratio * balance.correlation, balance.ratio / balance.correlation)
    if not _one_unit(float(nearest)):
        yield Finding(
            Mistake.UNIT,
            (Q.HEIGHT, airspeed[0]),
            f"{name(Q.HEIGHT)} gains {balance.ratio:.2g} times the energy that {name(airspeed[0])} loses"
            f"{_looks_like(balance.ratio)}",
        )


def _ground_speed(grid: Grid, name: Callable[[Quantity], str]) -> Iterator[Finding]:
    """Check the airspeed against ground velocity: its scale, its delay and a steady wind are fitted."""
    ground, airspeed = grid.ground_velocity(), grid.airspeed()
    if ground is None or airspeed is None:
        return
    quantities, north, east = ground
    speed_quantity, V = airspeed
    down = np.zeros(len(north)) if (sinking := grid[Q.VELOCITY_DOWN]) is None else np.nan_to_num(sinking)
    flown = np.isfinite(V + north + east) & _flown(V)
    if flown.sum() * FLIGHT.step_s < 30.0:
        return
    over = " and ".join(name(quantity) for quantity in quantities)

    def fit(lag: int) -> tuple[float, float]:
        """Return the scale k and the remaining spread of airspeed, from |v - w|² = k² V², linear in w, |w|² and k²."""
        rows = np.flatnonzero(flown)
        rows = rows[(rows - lag >= 0) & (rows - lag < len(V))][::5]
        n, e, d, airspeed = north[rows - lag], east[rows - lag], down[rows - lag], V[rows]
        usable = np.isfinite(n + e + d)
        n, e, d, airspeed = (values[usable] for values in (n, e, d, airspeed))
        columns = np.stack([2 * n, 2 * e, airspeed**2, np.ones(len(n))], axis=1)
        size = np.mean(airspeed**2)
        weak = np.diag([2.0, 2.0, 0.0, 0.0]) * np.sqrt(size)  # winds are slow compared with airspeeds
        x = np.linalg.lstsq(np.vstack([columns, weak]), np.append(n**2 + e**2 + d**2, np.zeros(4)), rcond=None)[0]
        left = np.sqrt(np.maximum((n - x[0]) ** 2 + (e - x[1]) ** 2 + d**2, 0.0))
        scale = float(np.median(left) / np.median(airspeed))
        return scale, float(np.std(left / max(scale, 1e-6) - airspeed))

    scale, spread = fit(0)
    if not _one_unit(scale):
        yield Finding(
            Mistake.UNIT,
            (speed_quantity, *quantities),
            f"{over} make {scale:.3g} times {name(speed_quantity)}, less the wind{_looks_like(scale)}",
        )
        return
    tried = {lag: fit(lag)[1] for lag in range(-30, 31, 2)}
    best = min(tried, key=lambda lag: tried[lag])
    if abs(best) * FLIGHT.step_s > LAWS.delay[0] and tried[best] ** 2 < LAWS.delay[1] * spread**2:
        late = "late" if best > 0 else "early"
        yield Finding(
            Mistake.DELAY,
            (speed_quantity, *quantities),
            f"{name(speed_quantity)} is {late} by {abs(best) * FLIGHT.step_s:.1f} s against {over}: give the delay of"
            " one",
        )
    heading = grid[Q.HEADING]
    if heading is not None:
        away = float(np.nanmean(np.cos(np.arctan2(east, north) - heading)[flown]))
        if away < -0.3:
            yield Finding(
                Mistake.SIGN,
                (Q.HEADING, *quantities),
                f"{name(Q.HEADING)} points backward along {over}: reverse a sign",
            )
