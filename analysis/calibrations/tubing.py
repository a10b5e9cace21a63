"""Finds the lags of pneumatic lines from recorded pressure steps: a balloon that bursts, a syringe that is pulled off.

The transducer is sampled at each tick, and the time of a step between two ticks is unknown. Each step has three
unknowns: its two levels and its time. The time is uniformly distributed and independent of the sampling, so the
likelihood is integrated over it. (The most likely time would do for a lag of many ticks; with a lag of few ticks, a
wrong lag can fit every step at some time.) All steps of a line share one lag. A lag much shorter than a tick cannot be
distinguished from zero; the result is then only an upper bound.

The shape of the step matters as well: for a tube that rings or is slow to settle, an exponential gives a lag that is
wrong by a third. So if the line's length and cavity are known, the shape is the step response by Bergh & Tijdeman for
the diameter that has the lag in question.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from scipy import special
from scipy.optimize import brentq

from flightpower.analysis.air.lines import FIELD, TOPIC, air_in
from flightpower.analysis.air.settings import LAG
from flightpower.analysis.air.tubing import Gas, low_frequency_lag_s, response
from flightpower.analysis.calibrations.runner import AircraftFileLines, Calibrated, LogFile, calibration
from flightpower.analysis.options import AircraftOption
from flightpower.analysis.sources.daemon import field_of
from flightpower.analysis.sources.grid_settings import STATISTICS
from flightpower.flight.aircraft import Aircraft, PneumaticLine
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError
from flightpower.flight.log_reader import Log

Shape = Callable[[Array], Array]  # remaining fraction of the step, from 1 to 0, at times since the step [s]


@dataclass(frozen=True)
class PressureStep:
    """Samples around one step: times [s] and values [Pa], (n,). last_quiet : index of the last one before the step"""

    t_s: Array
    value: Array
    last_quiet: int


@dataclass(frozen=True)
class Lag:
    """A line's lag with its 95 % interval [s]; `lo_s` is zero if there is no lower bound."""

    lag_s: float
    lo_s: float
    hi_s: float
    steps: int
    noise: float  # standard deviation of the samples [Pa]
    misfit: float  # rms of the residuals divided by the noise

    @property
    def fits(self) -> bool:
        """Whether the steps have the shape that the model of a line predicts."""
        return self.misfit <= STATISTICS.largest_misfit

    @property
    def bounded(self) -> bool:
        """Whether the lag has a lower bound."""
        return self.lo_s > 0

    @property
    def more_steps(self) -> int:
        """Number of further steps needed for a narrow enough interval; its width is proportional to 1/sqrt(steps)."""
        half = (self.hi_s - self.lo_s) / (2 * self.lag_s)
        return max(math.ceil(self.steps * ((half / LAG.half_width[1]) ** 2 - 1)), 0) if self.bounded else 0


def find_steps(t_s: Array, value: Array) -> tuple[list[PressureStep], float]:
    """Find clear, quick steps between quiet levels, and the noise [Pa]. t_s : (n,) ascending; value : (n,) [Pa]

    The noise is taken as at least 0.3 of a transducer's count.
    """
    if len(t_s) < 8:
        return [], 0.0
    interval = float(np.median(np.diff(t_s)))
    quiet, longest = max(4, round(LAG.step_s / interval)), max(2, round(LAG.step_s / interval))
    moves = np.diff(value)
    least = np.min(np.abs(moves[moves != 0])) if np.any(moves) else 0.0
    noise = max(float(np.median(np.abs(moves - np.median(moves)))) / 0.6745 / np.sqrt(2), 0.3 * least)
    jumps = np.flatnonzero(np.abs(moves) > 0.5 * LAG.smallest_step * noise)
    steps: list[PressureStep] = []
    free = 0
    for i in jumps.tolist():
        if i < max(quiet, free):
            continue
        before = value[i - quiet + 1 : i + 1]
        start = i - quiet + 1
        end = i + longest + quiet
        if end >= len(value) or t_s[end] - t_s[start] > 2 * (end - start) * interval:
            continue
        after = value[end - quiet : end]
        size = abs(np.median(after) - np.median(before))
        settled = max(np.std(before), np.std(after)) < 3 * noise + 0.01 * size
        if size > LAG.smallest_step * noise and settled:
            near_level = np.abs(value[start:end] - np.median(before)) < 4 * noise
            steps.append(PressureStep(t_s[start:end], value[start:end], int(np.flatnonzero(near_level)[-1])))
            free = end + quiet // 2
    return steps, noise


def exponential(lag_s: float) -> Shape:
    """Return the first-order shape of a step into a cavity behind a flow resistance."""
    return lambda t: np.exp(-np.maximum(t, 0.0) / lag_s)


def fit_lag(steps: list[PressureStep], noise: float, shape_of: Callable[[float], Shape] = exponential) -> Lag:
    """Return the most likely common lag of all steps, with its interval from the likelihood ratio.

    steps: all with the same number of samples. shape_of: gives a step's shape for a lag; use `through(line, gas)` if
    the line's length and cavity are known.
    Raises InputError if there is no step.
    """
    if not steps:
        raise InputError("no step of pressure found")

    times, values = np.array([step.t_s for step in steps]), np.array([step.value for step in steps])
    # The step happened near its last quiet sample, but noise may hide the beginning of a slow step.
    near_s = np.array([step.t_s[[min(step.last_quiet + i, len(step.t_s) - 1) for i in range(3)]] for step in steps])

    def misfits_of(lags: Array) -> list[Misfit]:
        return [_misfit(times, values, near_s, lag_s, shape_of(lag_s)) for lag_s in lags.tolist()]

    rough = np.geomspace(*LAG.tried_s, 61)
    rough_misfits = misfits_of(rough)
    near = int(np.argmin(_deviance(rough_misfits, _variance(rough_misfits, times.size))))
    lags = np.geomspace(rough[max(near - 1, 0)], rough[min(near + 1, len(rough) - 1)], 15)
    misfits = misfits_of(lags)
    variance = _variance(misfits, times.size)
    cost = _deviance(misfits, variance)
    best = int(np.argmin(cost))
    all_lags = np.concatenate([rough, lags])
    order = np.argsort(all_lags)
    profile = np.concatenate([_deviance(rough_misfits, variance), cost])[order] - cost[best]
    lo, hi = _interval(all_lags[order], profile)
    lag_s = _minimum(lags, cost, best)
    lo, hi = min(lo, (1 - LAG.half_width[0]) * lag_s), max(hi, (1 + LAG.half_width[0]) * lag_s)
    resolved_s = LAG.resolved * float(np.median(np.diff(steps[0].t_s)))
    if lag_s < resolved_s:
        lo, hi = 0.0, max(hi, resolved_s)
    misfit = float(np.sqrt(variance) / noise) if noise > 0 else 1.0
    return Lag(lag_s, lo, hi, len(steps), noise, misfit)


def through(line: PneumaticLine, gas: Gas) -> Callable[[float], Shape]:
    """Return a function from lag to step shape, for a tube of this length and cavity whose diameter gives the lag."""

    @cache
    def shape_of(lag_s: float) -> Shape:
        tube = replace(line, diameter_m=diameter_of_lag_m(line, lag_s, gas))
        step_s, points, settled = max(2.5e-4, lag_s / 100), 4096, 8  # settled: number of points left out at the end
        f: Array = np.asarray(np.fft.rfftfreq(points, step_s), dtype=float)
        up = np.where(np.arange(points) < points // 2, 1.0, 0.0)  # up and down again, long enough to settle
        # Lanczos sigma factors suppress the ringing that comes from cutting off the spectrum at its highest frequency.
        spectrum: Any = np.fft.rfft(up) * response([tube], f, gas) * np.sinc(f / f[-1])
        arrived = np.fft.irfft(spectrum, points)
        half = points // 2
        remaining = 1 - (arrived[: half - settled] - arrived[-1]) / (arrived[half - settled] - arrived[-1])
        t = step_s * np.arange(len(remaining))
        return lambda x: np.interp(x, t, remaining, left=1.0, right=0.0)

    return shape_of


class Misfit(NamedTuple):
    """Residuals of all steps for one lag, at possible times of the steps, with fitted levels."""

    instants_s: Array  # possible times of each step, (steps, m), ascending
    squares: Array  # sums of squared residuals, (steps, m)


def _misfit(times: Array, values: Array, near_s: Array, lag_s: float, shape: Shape) -> Misfit:
    """Try instants for each step, most densely near the best fit. times, values : (steps, n)     near_s : (steps, 3)"""
    # If the lag is much shorter than a tick, a sample shows the step only if it happened just before that sample.
    just_before = (near_s[:, :, None] - lag_s * np.linspace(0, 4, 9)).reshape(len(near_s), -1)
    count = 33  # number of instants
    evenly = np.linspace(near_s[:, 0] - lag_s, near_s[:, -1], count, axis=1)
    instants = np.sort(np.hstack([evenly, just_before]), axis=1)
    reach = 2 * (near_s[:, -1] - near_s[:, 0] + lag_s) / (count - 1)
    tried, squares = [], []
    for _ in range(4):
        tried.append(instants)
        squares.append(_residual_squares(values, shape(times[:, None, :] - instants[:, :, None])))
        best = np.take_along_axis(instants, np.argmin(squares[-1], axis=1)[:, None], axis=1)[:, 0]
        instants = np.linspace(best - reach, best + reach, count, axis=1)
        reach *= 4 / (count - 1)
    all_instants, all_squares = np.hstack(tried), np.hstack(squares)
    order = np.argsort(all_instants, axis=1, kind="stable")
    return Misfit(np.take_along_axis(all_instants, order, axis=1), np.take_along_axis(all_squares, order, axis=1))


def _variance(misfits: list[Misfit], samples: int) -> float:
    """Return the variance of a sample's noise from the best lag's residuals. samples : number in all steps together"""
    degrees = samples - 3 * len(misfits[0].squares) - 1
    least = min(float(misfit.squares.min(axis=1).sum()) for misfit in misfits)
    return max(least / max(degrees, 1), 1e-12)


def _deviance(misfits: list[Misfit], variance: float) -> Array:
    """Return -2 log likelihood of each lag; the likelihood is integrated over the times of the steps."""

    def of_lag(misfit: Misfit) -> float:
        least = misfit.squares.min(axis=1)
        likely = np.exp((least[:, None] - misfit.squares) / (2 * variance))
        of_steps = least / variance - 2 * np.log(np.trapezoid(likely, misfit.instants_s, axis=1))
        return float(of_steps.sum())

    return np.array([of_lag(misfit) for misfit in misfits])


def _residual_squares(values: Array, g: Array) -> Array:
    """Return residual sums of squares (steps, m) for linear regression of values (steps, n) on g (steps, m, n)."""
    y = values - values.mean(axis=1, keepdims=True)
    h = g - g.mean(axis=2, keepdims=True)
    explained = np.einsum("smn,sn->sm", h, y) ** 2 / np.maximum(np.einsum("smn,smn->sm", h, h), 1e-12)
    return np.asarray(np.sum(y**2, axis=1)[:, None] - explained)


def _minimum(lags: Array, cost: Array, best: int) -> float:
    """Return the lag at the minimum of a parabola through the best lag and its neighbors."""
    if best in (0, len(lags) - 1):
        return float(lags[best])
    left, middle, right = cost[best - 1 : best + 2]
    bend = left - 2 * middle + right
    shift = (left - right) / (2 * bend) if bend > 0 else 0.0
    return float(lags[best] * (lags[best + 1] / lags[best]) ** np.clip(shift, -1, 1))


def _interval(lags: Array, profile: Array) -> tuple[float, float]:
    """Return the lags where the profile crosses the 95 % level on each side of its minimum, or else 0 and infinity."""
    level = float(special.chdtri(1, 1 - 0.95))  # level for the likelihood ratio
    best = int(np.argmin(profile))
    left = np.flatnonzero(profile[:best] > level)
    right = np.flatnonzero(profile[best:] > level)
    lo = hi = 0.0
    if len(left):
        lo = _crossing(lags, profile - level, left[-1])
    hi = _crossing(lags, profile - level, best + right[0] - 1) if len(right) else float("inf")
    return lo, hi


def _crossing(lags: Array, above_level: Array, i: int) -> float:
    a, b = above_level[i], above_level[i + 1]
    return float(lags[i] + (lags[i + 1] - lags[i]) * a / (a - b))


def diameter_of_lag_m(line: PneumaticLine, lag_s: float, gas: Gas) -> float:
    """Return the inner diameter [m] that gives a line of this length and cavity this lag, for the aircraft file.

    The inner diameter of a narrow tube is only known to a few percent, and the lag varies with its fourth power.
    """

    def excess(log_d: float) -> float:
        return float(np.log(low_frequency_lag_s([replace(line, diameter_m=float(np.exp(log_d)))], gas) / lag_s))

    # The lag of a wide tube falls only with the square of its diameter, because of its own volume, but monotonically.
    return float(np.exp(brentq(excess, np.log(1e-5), np.log(1.0))))


class LineLag(NamedTuple):
    """The lag of one line, from a log and from the aircraft file.

    name : the line's name in the aircraft file     topic : the topic of its transducer
    measured : the lag in the log; None if the log has no step of this pressure
    expected_s : lag of the line in the aircraft file; None if its length is not given there
    line : the line with the diameter that gives the measured lag; None if length or lag is unknown or not supported
    """

    name: str
    topic: str
    measured: Lag | None
    expected_s: float | None
    line: PneumaticLine | None

    @property
    def unsupported(self) -> str:
        """Reason why the bursts do not support a calibration of this line, and the remedy; empty if they do."""
        lag = self.measured
        if lag is None:
            return ""
        half_width = (lag.hi_s - lag.lo_s) / 2
        if lag.hi_s == float("inf") or (lag.bounded and half_width > LAG.half_width[-1] * lag.lag_s):
            return (
                f"the bursts found ({lag.steps}) do not determine the lag within {100 * LAG.half_width[-1]:.0f} %:"
                " record more of them in one log, or at 100 Hz"
            )
        return ""


def line_lags(log: Log, aircraft: Aircraft) -> list[LineLag]:
    """Return the lag of every line with a transducer in `lines.TOPIC`, at the log's pressure and temperature."""
    gas = air_in(log)
    lags = []
    for name, topic in TOPIC.items():
        line = aircraft.probe.lines.get(name)
        if line is not None and line.length_m <= 0:
            line = None
        expected_s = low_frequency_lag_s([line], gas) if line else None
        steps, noise = find_steps(*field_of(log, topic, FIELD[name]))
        if not steps:
            lags.append(LineLag(name, topic, None, expected_s, None))
            continue
        lag = fit_lag(steps, noise, through(line, gas) if line else exponential)
        line_lag = LineLag(name, topic, lag, expected_s, None)
        if line and lag.bounded and not line_lag.unsupported:
            line_lag = line_lag._replace(line=replace(line, diameter_m=diameter_of_lag_m(line, lag.lag_s, gas)))
        lags.append(line_lag)
    return lags


def to_toml(lags: list[LineLag]) -> str:
    """Return sections `[probe.lines.…]` of an aircraft file for lines with a measured diameter; empty without any."""
    return "\n".join(
        f"[probe.lines.{name}]  # measured: {1e3 * lag.lag_s:.1f} ms\n"
        f'length = "{line.length_m:g} m"\n'
        f'diameter = "{1e3 * line.diameter_m:.3f} mm"\n'
        f'cavity = "{1e9 * line.cavity_m3:g} mm^3"\n'
        for name, _, lag, _, line in lags
        if lag and line
    )


@calibration(AircraftFileLines)
def tubing(log: LogFile, aircraft: AircraftOption = None) -> Calibrated:
    """Measure the lag of each pneumatic line from recorded steps of pressure.

    Start the daemon, with rate_Hz = 100 in the tray file if possible. Pull a piece of soft tube over one port of the
    probe, with a T-piece to a syringe and to a small balloon or a stretched film. Press to about half of the
    transducer's range, wait two seconds, burst the film (or pull the tube off with a jerk), wait two seconds. Repeat
    eight times or more for each line, at irregular times, all in one log. Each burst happens at an unknown time between
    two ticks; several of them together determine the lag.

    If the 95 % interval is wider than 5 % either way, the command prints how many more such bursts are needed: usually
    none at 100 Hz; at 25 Hz about thirty for a lag of half a tick.

    A lag below a third of a tick only gets an upper bound; at 25 Hz such a line needs no correction. The result is the
    inner diameter of the tube that has the measured lag, with the length and cavity of the aircraft file. A line is
    left out if its 95 % interval is wider than 40 % either way: a diameter known to 5 % says as much. Exit code 2: no
    burst was found; exit code 1: none of the lags is determined.

    To rehearse it: `sim fly --plan tubing-bursts -o out/bursts`.

    \b
    Example:
      calibrate tubing log.mcap -o lines.toml
    """
    from flightpower.analysis.air.contents import aircraft_of
    from flightpower.flight.aircraft import load_aircraft
    from flightpower.flight.log_reader import read_log

    recorded = read_log(log)
    lags = line_lags(recorded, load_aircraft(aircraft) if aircraft else aircraft_of(recorded))
    if all(lag.measured is None for lag in lags):
        raise InputError(
            f"{log}: no burst of pressure on any line; press to half of the transducer's range, hold for two seconds,"
            " burst, and repeat eight times for each line"
        )
    lines = [line for lag in lags for line in summary(lag)]
    if sections := to_toml(lags):
        return Calibrated(lines, sections)
    if undetermined := [f"{lag.topic}: {lag.unsupported}" for lag in lags if lag.unsupported]:
        return Calibrated(lines, unsupported="; ".join(undetermined))
    return Calibrated([*lines, "Nothing to change in the aircraft file."])


def summary(line: "LineLag") -> list[str]:
    """Return the result for one pneumatic line, as lines of text."""
    lag = line.measured
    if lag is None:
        return [f"{line.topic}: no step found"]
    if lag.hi_s == float("inf"):
        value = f"{1e3 * lag.lag_s:.1f} ms, without an upper bound"
    elif lag.bounded:
        value = f"{1e3 * lag.lag_s:.1f} ms ({1e3 * lag.lo_s:.1f} to {1e3 * lag.hi_s:.1f})"
    else:
        value = f"shorter than {1e3 * lag.hi_s:.1f} ms, too short for this tick rate"
    expected = f"; by the aircraft file {1e3 * line.expected_s:.1f} ms" if line.expected_s is not None else ""
    lines = [f"{line.topic}: lag {value}, from {lag.steps} steps{expected}"]
    if lag.more_steps:
        lines.append(
            f"  for 5 %: about {lag.more_steps} more bursts like these in the same log, or a log at a higher rate"
        )
    if not lag.fits:
        lines.append(f"  the steps do not fit the model of a line ({lag.misfit:.1f} times the noise): look for a leak")
    if line.unsupported:
        lines.append(f"  left out: {line.unsupported}")
    return lines
