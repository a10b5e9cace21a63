"""The lag of a pneumatic line from a recorded step of pressure: a balloon that bursts, a syringe that comes off.

When the step happened is not known, only what the transducer saw of it at each tick. So each step brings its levels
along as unknowns, and its instant, of which it is known that it does not care for the ticks: any is as likely, and all
count for as much as the samples leave them. (The best instant of each alone would do for many ticks to a lag; with few,
a wrong lag finds one for every step.) The lag is what all steps of a line have in common. A lag that is short against a
tick cannot be told from none: then only an upper bound comes out.

The shape of the step matters as much as its length: of a tube that rings, or that pressure creeps through, an
exponential tells a lag wrong by a third. So with the line's length and cavity given, the step is that of Bergh &
Tijdeman's response with the diameter that has the lag in question.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.stats import chi2

from analysis.airdata.tubing import Gas, low_frequency_lag_s, response
from flight.aircraft import Line
from flight.errors import InputError

Array = NDArray[np.float64]
Shape = Callable[[Array], Array]  # what is still to come, 1 at the step and 0 in the end, over time [s]

QUIET_S = 0.5  # before and after a step: there its levels and the noise are read
LARGEST_CHANGE_S = 0.5  # a step that takes longer was no burst
CLEAR = 12.0  # times the noise
SHORTEST_LAG_S, LONGEST_LAG_S = 2e-4, 0.25
LAGS, FINE, INSTANTS, ZOOMS = 61, 15, 33, 4
WANTED = 0.05  # of a lag: half of the interval that suffices
INTERVAL = float(chi2.ppf(0.95, 1))
FLOOR = 0.02
RESOLVED = 0.3  # of a tick: a shorter lag leaves nothing between two samples but its name
FINEST_S, POINTS, SETTLED = 2.5e-4, 4096, 8  # a step's shape


@dataclass(frozen=True)
class PressureStep:
    """The samples around one step: times [s] and values [Pa], (n,); the last quiet sample before it is `last_quiet`."""

    t_s: Array
    value: Array
    last_quiet: int


@dataclass(frozen=True)
class Lag:
    """A line's lag with its 95 % interval [s]; `lo_s` is zero where no lower bound can be given."""

    lag_s: float
    lo_s: float
    hi_s: float
    steps: int
    noise: float  # standard deviation of the samples [Pa]
    misfit: float  # rms of what the fit leaves, over that

    @property
    def bounded(self) -> bool:
        """Whether the data say more than «shorter than»."""
        return self.lo_s > 0

    @property
    def more_steps(self) -> int:
        """How many more such steps narrow the interval to WANTED: it goes with the square root of their number."""
        half = (self.hi_s - self.lo_s) / (2 * self.lag_s)
        return max(math.ceil(self.steps * ((half / WANTED) ** 2 - 1)), 0) if self.bounded else 0


def find_steps(t_s: Array, value: Array) -> tuple[list[PressureStep], float]:
    """Clear, quick steps between quiet levels, and the noise [Pa]. t_s : (n,) ascending; value : (n,) [Pa].

    A transducer whose noise is below its own counts is given half a count's.
    """
    if len(t_s) < 8:
        return [], 0.0
    interval = float(np.median(np.diff(t_s)))
    quiet, longest = max(4, round(QUIET_S / interval)), max(2, round(LARGEST_CHANGE_S / interval))
    moves = np.diff(value)
    least = np.min(np.abs(moves[moves != 0])) if np.any(moves) else 0.0
    noise = max(float(np.median(np.abs(moves - np.median(moves)))) / 0.6745 / np.sqrt(2), 0.3 * least)
    jumps = np.flatnonzero(np.abs(moves) > 0.5 * CLEAR * noise)
    steps: list[PressureStep] = []
    free = 0
    for i in jumps.tolist():
        if i < max(quiet, free):
            continue
        before = value[i - quiet + 1 : i + 1]
        # A slow line makes no single big jump: begin where the level was last what it had been.
        start = i - quiet + 1
        end = i + longest + quiet
        if end >= len(value) or t_s[end] - t_s[start] > 2 * (end - start) * interval:
            continue
        after = value[end - quiet : end]
        size = abs(np.median(after) - np.median(before))
        settled = max(np.std(before), np.std(after)) < 3 * noise + 0.01 * size
        if size > CLEAR * noise and settled:
            quiet_still = np.abs(value[start:end] - np.median(before)) < 4 * noise
            steps.append(PressureStep(t_s[start:end], value[start:end], int(np.flatnonzero(quiet_still)[-1])))
            free = end + quiet // 2
    return steps, noise


def exponential(lag_s: float) -> Shape:
    """What is still to come after a step into a cavity behind a resistance, over time since the step [s]."""
    return lambda t: np.exp(-np.maximum(t, 0.0) / lag_s)


def fit_lag(steps: list[PressureStep], noise: float, shape_of: Callable[[float], Shape] = exponential) -> Lag:
    """The lag that all steps share, the likeliest, with the interval of its likelihood.

    shape_of: what a step looks like, by lag; `through(line, gas)` where the line's length and cavity are known.
    Raises InputError when there is no step.
    """
    if not steps:
        raise InputError("no step of pressure found")

    def misfits_of(lags: Array) -> list[list[Misfit]]:
        found = []
        for lag in lags:
            shape = shape_of(float(lag))
            found.append([_misfit(step, lag, shape) for step in steps])
        return found

    rough = np.geomspace(SHORTEST_LAG_S, LONGEST_LAG_S, LAGS)
    rough_misfits = misfits_of(rough)
    near = int(np.argmin(_unlikeliness(rough_misfits, _variance(rough_misfits, steps))))
    lags = np.geomspace(rough[max(near - 1, 0)], rough[min(near + 1, LAGS - 1)], FINE)
    misfits = misfits_of(lags)
    variance = _variance(misfits, steps)
    cost = _unlikeliness(misfits, variance)
    best = int(np.argmin(cost))
    everywhere = np.concatenate([rough, lags])
    order = np.argsort(everywhere)
    profile = np.concatenate([_unlikeliness(rough_misfits, variance), cost])[order] - cost[best]
    lo, hi = _interval(everywhere[order], profile)
    lag_s = _least(lags, cost, best)
    # What nobody knows better, the tube's length, its cavity and the air in it, blurs every lag.
    lo, hi = min(lo, (1 - FLOOR) * lag_s), max(hi, (1 + FLOOR) * lag_s)
    resolved_s = RESOLVED * float(np.median(np.diff(steps[0].t_s)))
    if lag_s < resolved_s:
        lo, hi = 0.0, max(hi, resolved_s)
    misfit = float(np.sqrt(variance) / noise) if noise > 0 else 1.0
    return Lag(lag_s, lo, hi, len(steps), noise, misfit)


def through(line: Line, gas: Gas) -> Callable[[float], Shape]:
    """The same behind a tube of this length and cavity, by lag: its diameter is the one that has the lag."""

    def shape_of(lag_s: float) -> Shape:
        tube = replace(line, diameter_m=diameter_of_lag_m(line, lag_s, gas))
        step_s = max(FINEST_S, lag_s / 100)
        f: Array = np.asarray(np.fft.rfftfreq(POINTS, step_s), dtype=float)
        up = np.where(np.arange(POINTS) < POINTS // 2, 1.0, 0.0)  # up and down again, long enough to settle
        # Lanczos' factors: without them what is cut off at the highest frequency rings at the step.
        spectrum: Any = np.fft.rfft(up) * response([tube], f, gas) * np.sinc(f / f[-1])
        came = np.fft.irfft(spectrum, POINTS)
        half = POINTS // 2
        fallen = 1 - (came[: half - SETTLED] - came[-1]) / (came[half - SETTLED] - came[-1])
        t = step_s * np.arange(len(fallen))
        return lambda x: np.interp(x, t, fallen, left=1.0, right=0.0)

    return shape_of


class Misfit(NamedTuple):
    """What a lag leaves of a step, for instants at which it may have happened, levels at their best."""

    instants_s: Array  # (m,), ascending
    squares: Array  # (m,), sums of them


def _misfit(step: PressureStep, lag_s: float, shape: Shape) -> Misfit:
    """Closest instants where they fit best."""
    # The next sample was quiet no more, or noise made it look so; and noise may hide the beginning of a slow step.
    near_s = step.t_s[step.last_quiet : step.last_quiet + 3]
    # A step that is short against a tick meets a sample half-way only if it happened just before.
    just_before = (near_s[:, None] - lag_s * np.linspace(0, 4, 9)).ravel()
    instants = np.unique(np.append(np.linspace(near_s[0] - lag_s, near_s[-1], INSTANTS), just_before))
    reach = 2 * (near_s[-1] - near_s[0] + lag_s) / (INSTANTS - 1)
    tried, squares = [], []
    for _ in range(ZOOMS):
        tried.append(instants)
        squares.append(_levels(step, shape(step.t_s[None, :] - instants[:, None])))
        best = instants[np.argmin(squares[-1])]
        instants = np.linspace(best - reach, best + reach, INSTANTS)
        reach *= 4 / (INSTANTS - 1)
    everywhere, first = np.unique(np.concatenate(tried), return_index=True)
    return Misfit(everywhere, np.concatenate(squares)[first])


def _variance(misfits: list[list[Misfit]], steps: list[PressureStep]) -> float:
    """Of a sample's noise, from what the best of all lags leaves."""
    degrees = sum(len(step.t_s) - 3 for step in steps) - 1
    least = min(sum(float(m.squares.min()) for m in of_lag) for of_lag in misfits)
    return max(least / max(degrees, 1), 1e-12)


def _unlikeliness(misfits: list[list[Misfit]], variance: float) -> Array:
    """-2 log likelihood of each lag, over all instants of its steps."""

    def of_step(misfit: Misfit) -> float:
        least = float(misfit.squares.min())
        likely = np.exp((least - misfit.squares) / (2 * variance))
        return least / variance - 2 * float(np.log(np.trapezoid(likely, misfit.instants_s)))

    return np.array([sum(of_step(misfit) for misfit in of_lag) for of_lag in misfits])


def _levels(step: PressureStep, g: Array) -> Array:
    """Residual sums of squares of value on [1, g] for each row of g, (m, n)."""
    y = step.value - step.value.mean()
    h = g - g.mean(axis=1, keepdims=True)
    explained = (h @ y) ** 2 / np.maximum(np.sum(h**2, axis=1), 1e-12)
    return np.asarray(np.sum(y**2) - explained)


def _least(lags: Array, cost: Array, best: int) -> float:
    """The least of a parabola through the best lag and its neighbours."""
    if best in (0, len(lags) - 1):
        return float(lags[best])
    left, middle, right = cost[best - 1 : best + 2]
    bend = left - 2 * middle + right
    shift = (left - right) / (2 * bend) if bend > 0 else 0.0
    return float(lags[best] * (lags[best + 1] / lags[best]) ** np.clip(shift, -1, 1))


def _interval(lags: Array, profile: Array) -> tuple[float, float]:
    """Where the profile crosses the 95 % level, left and right of its least; 0 and infinity where it does not."""
    best = int(np.argmin(profile))
    left = np.flatnonzero(profile[:best] > INTERVAL)
    right = np.flatnonzero(profile[best:] > INTERVAL)
    lo = hi = 0.0
    if len(left):
        lo = _crossing(lags, profile, left[-1])
    hi = _crossing(lags, profile, best + right[0] - 1) if len(right) else float("inf")
    return lo, hi


def _crossing(lags: Array, profile: Array, i: int) -> float:
    a, b = profile[i] - INTERVAL, profile[i + 1] - INTERVAL
    return float(lags[i] + (lags[i + 1] - lags[i]) * a / (a - b))


def diameter_of_lag_m(line: Line, lag_s: float, gas: Gas) -> float:
    """The tube diameter with which this line, of its length and cavity, has this lag [m].

    What the aircraft file takes: the inner diameter of a narrow tube is what nobody knows to better than some per cent,
    and the lag goes with its fourth power.
    """

    def excess(log_d: float) -> float:
        return np.log(low_frequency_lag_s([replace(line, diameter_m=float(np.exp(log_d)))], gas) / lag_s)

    # A wide tube's own volume makes its lag fall with the square only: that still brackets.
    return float(np.exp(brentq(excess, np.log(1e-5), np.log(1.0))))
