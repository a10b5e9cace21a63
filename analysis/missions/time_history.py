"""Time history of a plan flown exactly as written in air without gusts: kinematics only, no controls, no pilot.

Speed follows from drag and thrust along the plan, attitude and load factor from the path; sensors are exact in flight.
The columns are the same as in `air_data`, so that the estimator can treat the history like a flight.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.missions.expected_aircraft import ExpectedAircraft
from flightpower.analysis.missions.pieces import Hold, Land, Maneuver, Porpoise, Run, Stand, TakeOff, Turn
from flightpower.analysis.missions.plan_settings import MARGINS, PATH
from flightpower.analysis.sources.daemon import SPEED_SCALE, speed_scale
from flightpower.analysis.trajectory import dryden
from flightpower.analysis.trajectory.priors import BENCH_SIGMA
from flightpower.flight import motion
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.runs import AIRCRAFT_SIZE
from flightpower.flight.units import GRAVITY_MPS2 as g


class Path(NamedTuple):
    """Airspeed [m/s], bank and angle of climb [rad] of a maneuver, each (n,), at steps of PATH.step_s."""

    V: Array
    bank: Array
    climb: Array


class TimeHistory(NamedTuple):
    """table: like `air_data`'s, PATH.step_s apart. wind: (n, 2) [m/s]. attitude, velocity: (n, 3). rest: at standstill.
    starts_s : (k + 1,) start of each maneuver, and the end. position_m : (n, 2) north, east"""

    table: pd.DataFrame
    attitude: Array
    velocity: Array
    wind: Array
    rest: list[slice]
    starts_s: Array
    position_m: Array


def fly(
    plan: Sequence[Maneuver],
    expected: ExpectedAircraft,
    height_m: float,
    wind_mps: float,
    *,
    wind_from_deg: float = PATH.wind_from_deg,
    airborne: bool = False,
) -> TimeHistory:
    """Compute the history of a plan. airborne: starts in the air. wind_from_deg: clockwise from the first leg."""
    flown = paths(plan, expected, height_m, airborne=airborne)
    V_path, bank, climb = (np.concatenate(parts) for parts in zip(*flown, strict=True))
    starts_s = np.cumsum([0, *(len(path.V) for path in flown)]) * PATH.step_s
    blown_mps = wind_vector(wind_mps, wind_from_deg)
    return _history(Path(V_path, bank, climb), expected, height_m, blown_mps, airborne=airborne, starts_s=starts_s)


def paths(
    plan: Sequence[Maneuver], expected: ExpectedAircraft, height_m: float, *, airborne: bool = False
) -> list[Path]:
    """Compute the path of each maneuver, starting with the speed and throttle at which the previous one ends."""
    V, throttle = 1.6 * expected.stall_mps if airborne else 0.0, 0.5
    paths = []
    for maneuver in plan:
        path = _path(maneuver, expected, height_m, V, throttle)
        paths.append(path)
        V = float(path.V[-1])
        throttle = maneuver.throttle if isinstance(maneuver, Run) else throttle_at(expected, V)
    return paths


def wind_vector(wind_mps: float, wind_from_deg: float = PATH.wind_from_deg) -> Array:
    """Return the wind's velocity (2,) along the first leg and to its right [m/s]; wind_from_deg: clockwise from it."""
    return -wind_mps * np.array([np.cos(np.radians(wind_from_deg)), np.sin(np.radians(wind_from_deg))])


def turn_rate(bank: Array | float, V: Array) -> Array:
    """Return the turn rate of a level turn [rad/s]."""
    return np.asarray(g * np.tan(bank) / V)


def throttle_at(expected: ExpectedAircraft, V: float) -> float:
    """Return the throttle of level flight at a speed [m/s]."""
    grid = np.linspace(0.0, 1.0, 41)
    return float(np.interp(float(expected.drag_N(max(V, 1.0))), [expected.thrust_N(t, V) for t in grid], grid))


def _path(maneuver: Maneuver, expected: ExpectedAircraft, height_m: float, V: float, throttle: float) -> Path:
    match maneuver:
        case Stand(duration_s):
            n = _steps(duration_s)
            return Path(np.zeros(n), np.zeros(n), np.zeros(n))
        case TakeOff(speed_mps):
            return _take_off(expected, speed_mps, height_m)
        case Hold(duration_s, speed_mps):
            n = _steps(duration_s)
            return Path(_towards(expected, V, speed_mps, n), np.zeros(n), np.zeros(n))
        case Turn():
            return turn_path(expected, V, maneuver)
        case Run():
            speeds = _run(expected, V, throttle, maneuver)
            return Path(speeds, np.zeros(len(speeds)), np.zeros(len(speeds)))
        case Porpoise():
            return _porpoise(expected, V, maneuver)
        case Land(speed_mps):
            return _landing(expected, V, speed_mps, height_m)
    raise AssertionError(maneuver)


def _steps(duration_s: float) -> int:
    return max(1, round(duration_s / PATH.step_s))


def _towards(expected: ExpectedAircraft, V: float, wanted: float, n: int) -> Array:
    """Return the speeds (n,) of a pilot who changes from V to another speed and holds it.

    While drag or full throttle limit the change, it is integrated step by step; after that the speed approaches the
    wanted one with the pilot's lag.
    """
    grid = np.linspace(expected.least_mps, 1.5 * expected.fastest_mps, 60)
    m = expected.aircraft.mass_kg
    drag = expected.drag_N(grid) / m
    most = np.clip(np.array([expected.thrust_N(1.0, v) for v in grid]) / m - drag, 0.05, PATH.hardest_mps2)
    speeds = np.empty(n)
    slowest_change, fastest_change = -float(drag.min()), float(most.min())
    for i in range(n):
        if slowest_change <= (wanted - V) / PATH.speed_lag_s <= fastest_change:
            left = (1 - PATH.step_s / PATH.speed_lag_s) ** np.arange(1, n - i + 1)
            speeds[i:] = wanted + (V - wanted) * left
            break
        grid_place = (V - grid[0]) / (grid[1] - grid[0])
        k = min(max(int(grid_place), 0), len(grid) - 1)
        V += PATH.step_s * min(max((wanted - V) / PATH.speed_lag_s, -drag[k]), most[k])
        speeds[i] = V
    return speeds


def _run(expected: ExpectedAircraft, V: float, first: float, run: Run) -> Array:
    speeds, faster = [], run.until_mps > V
    m = expected.aircraft.mass_kg
    for i in range(_steps(run.longest_s)):
        t = i * PATH.step_s
        throttle = first + (run.throttle - first) * min(t / run.ramp_s, 1.0)
        V += PATH.step_s * (expected.thrust_N(throttle, V) - float(expected.drag_N(V))) / m
        V = max(V, expected.least_mps)
        speeds.append(V)
        if t > run.ramp_s and (V >= run.until_mps if faster else V <= run.until_mps):
            break
    return np.array(speeds)


def turn_path(expected: ExpectedAircraft, V: float, turn: Turn) -> Path:
    """Return the path of a turn entered at speed V [m/s]."""
    speed_mps, angle_rad, bank_rad = turn.speed_mps, turn.angle_rad, turn.bank_rad
    most = _steps(1.2 * abs(angle_rad) * max(V, speed_mps) / (g * np.tan(bank_rad)) + 20.0)
    speeds = _towards(expected, V, speed_mps, most)
    rising = np.minimum(np.arange(most) * PATH.step_s / PATH.roll_s, 1.0) * bank_rad
    turned = np.cumsum(turn_rate(rising, speeds)) * PATH.step_s
    # Rolling out takes PATH.roll_s and turns half as far as full bank would in that time.
    rest = turn_rate(bank_rad, speeds) * PATH.roll_s / 2
    n = int(np.searchsorted(turned + rest, abs(angle_rad)))
    out = np.maximum(1 - np.arange(_steps(5 * PATH.roll_s)) * PATH.step_s / PATH.roll_s, 0.0)
    bank = np.concatenate([rising[:n], bank_rad * out]) * np.sign(angle_rad)
    return Path(speeds[: len(bank)], bank, np.zeros(len(bank)))


def _porpoise(expected: ExpectedAircraft, V: float, porpoise: Porpoise) -> Path:
    n = _steps(porpoise.duration_s)
    t = np.arange(n) * PATH.step_s
    speeds = _towards(expected, V, porpoise.speed_mps, n)
    first, last = 2 * np.pi / porpoise.first_period_s, 2 * np.pi / porpoise.last_period_s
    phase = first * t + (last - first) * t**2 / (2 * porpoise.duration_s)
    omega = first + (last - first) * t / porpoise.duration_s
    fade = np.minimum(np.minimum(t, t[::-1]) / 1.0, 1.0)
    climb = -g * porpoise.load / (porpoise.speed_mps * omega) * np.cos(phase) * fade
    return Path(speeds, np.zeros(n), climb)


def climb_rate_mps(expected: ExpectedAircraft) -> float:
    """Return the rate of climb and descent between the ground and the height of the flight [m/s]: at the speed between
    maneuvers, below what full throttle gives. Raises InputError if full throttle does not climb."""
    V = expected.cruise_mps
    most_mps = V * (expected.thrust_N(1.0, V) - float(expected.drag_N(V))) / expected.aircraft.mass.weight_N
    if most_mps <= 0:
        raise InputError(
            f"{expected.aircraft.name}: full throttle does not climb at {V:.1f} m/s, the speed between maneuvers;"
            " check propeller, motor and weight"
        )
    return min(PATH.climb_over_stall * expected.stall_mps, MARGINS.fastest * most_mps)


def _take_off(expected: ExpectedAircraft, speed_mps: float, height_m: float) -> Path:
    s = (np.arange(_steps(PATH.take_off_s)) + 1) * PATH.step_s / PATH.take_off_s
    V = speed_mps * (10 * s**3 - 15 * s**4 + 6 * s**5)
    rise = 30 * s**2 * (1 - s) ** 2 * min(AIRCRAFT_SIZE.least_height_m, height_m) / PATH.take_off_s
    up = np.full(
        _steps(max(height_m - AIRCRAFT_SIZE.least_height_m, 0.0) / climb_rate_mps(expected)), climb_rate_mps(expected)
    )
    V = np.concatenate([V, np.full(len(up) + _steps(5.0), speed_mps)])
    rate = np.concatenate([rise, up, np.zeros(_steps(5.0))])
    return Path(V, np.zeros(len(V)), np.arcsin(np.clip(rate / np.maximum(V, 1.0), -0.5, 0.5)))


def _landing(expected: ExpectedAircraft, V: float, speed_mps: float, height_m: float) -> Path:
    down = _take_off(expected, speed_mps, height_m)
    speeds = down.V[::-1].copy()
    n = min(len(speeds), _steps(8.0))
    speeds[:n] = _towards(expected, V, speed_mps, n)
    return Path(speeds, down.bank, -down.climb[::-1])


def _history(
    path: Path, expected: ExpectedAircraft, height_m: float, blown_mps: Array, *, airborne: bool, starts_s: Array
) -> TimeHistory:
    V, bank, climb = path
    n = len(V)
    t = np.arange(n) * PATH.step_s
    samples = 5  # an aircraft cannot change its path instantly
    smooth = np.ones(samples) / samples
    climb, bank = (np.convolve(np.pad(x, samples // 2, mode="edge"), smooth, mode="valid") for x in (climb, bank))
    flown = np.maximum(V, expected.least_mps)
    load = (flown * np.gradient(climb, PATH.step_s) / g + np.cos(climb)) / np.cos(bank)
    alpha = np.clip(expected.alpha_rad(flown, load), -0.2, 0.3) * np.minimum(V / flown, 1.0)
    theta = np.arctan(np.cos(bank) * np.tan(alpha)) + climb
    heading = np.cumsum(turn_rate(bank, flown)) * PATH.step_s
    body = motion.velocity_of(V, alpha, 0.0)
    air = np.column_stack(motion.earth_from_body(body, (bank, theta, heading)))
    height = np.cumsum(-air[:, 2]) * PATH.step_s + (height_m if airborne else 0.0)
    height = np.maximum(height, 0.0)
    profile = dryden.mean_wind_profile(height) / dryden.mean_wind_profile(height_m)
    # The wind adds to the velocity in flight, but not while the aircraft stands on the ground.
    wind = profile[:, None] * blown_mps
    moved = np.clip(V / expected.stall_mps, 0.0, 1.0)[:, None]
    velocity = air + np.column_stack([wind * moved, np.zeros(n)])
    phi_rate, theta_rate, psi_rate = (np.gradient(x, PATH.step_s) for x in (bank, theta, heading))
    acceleration = np.gradient(velocity, PATH.step_s, axis=0) - np.array([0.0, 0.0, g])
    north, east, down = acceleration.T
    force = motion.body_from_earth((north, east, down), (bank, theta, heading))
    flying = V > 0.7 * expected.stall_mps
    nan_at_rest = np.where(flying, 1.0, np.nan)
    drag = expected.drag_N(flown, load)
    thrust = drag + expected.aircraft.mass_kg * (np.gradient(V, PATH.step_s) + g * np.sin(climb))
    revps = np.where(V > 0, expected.revps_of_thrust(np.maximum(flown, 1.0), thrust / np.cos(alpha)), 0.0)
    # A hemispherical probe in potential flow: C = dp_alpha/q_c, and d alpha / d ln(dp_alpha) at constant q_c.
    C = 9 / 4 * np.sin(2 * alpha) / (1 - 9 / 4 * np.sin(alpha) ** 2)
    dalpha_dlndp_alpha = np.tan(2 * alpha) / 2 / (1 + C * np.tan(2 * alpha) / 2)
    columns = {
        "p_radps": phi_rate - psi_rate * np.sin(theta),
        "q_radps": theta_rate * np.cos(bank) + psi_rate * np.sin(bank) * np.cos(theta),
        "r_radps": -theta_rate * np.sin(bank) + psi_rate * np.cos(bank) * np.cos(theta),
        **dict(zip(("ax_mps2", "ay_mps2", "az_mps2"), force, strict=True)),
        **{f"gps_{axis}_mps": velocity[:, i] for i, axis in enumerate(("north", "east", "down"))},
        SPEED_SCALE: np.full(n, speed_scale(expected.aircraft)),
        "height_m": height,
        "rho": np.full(n, expected.rho),
        "V_mps": V * nan_at_rest,
        "alpha_rad": alpha * nan_at_rest,
        "beta_rad": 0.0 * nan_at_rest,
        "bank_rad": bank,
        "dalpha_dlndp_alpha_rad": dalpha_dlndp_alpha * nan_at_rest,
        "dlnV_dlndp_alpha": C * dalpha_dlndp_alpha / 2 * nan_at_rest,
        "alpha_by_upwash_rad": 0.0 * nan_at_rest,
        "n_revps": revps,
        "thrust_N": thrust,
        "qbar_Pa": expected.rho * V**2 / 2 * nan_at_rest,
        "propeller_covered": flying,
        "flying": flying,
    }
    # The analysis measures sensor noise at rest: there the values alternate by one standard deviation to either side.
    noise = np.where(V == 0, np.where(np.arange(n) % 2, 1.0, -1.0), 0.0)
    columns |= {name: columns.get(name, 0.0) + sigma * noise for name, sigma in BENCH_SIGMA.items()}
    table = pd.DataFrame(columns, index=pd.Index(t, name="t_s"))
    edges = np.flatnonzero(np.diff(np.concatenate([[0], (V == 0).astype(int), [0]])))
    rest = [slice(int(a), int(b)) for a, b in edges.reshape(-1, 2)]
    position = np.cumsum(velocity[:, :2], axis=0) * PATH.step_s
    return TimeHistory(table, np.column_stack([bank, theta, heading]), velocity, wind, rest, starts_s, position)
