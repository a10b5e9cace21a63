"""Measured data: segments (one per maneuver) with a uniform time base, delayed inputs, and a band of frequencies.

An estimation in the frequency domain uses only the band in which the aircraft moves. Biases, drift and trim lie below
it, structural vibration and most of the noise above it. Within the band the noise is nearly white, so that standard
errors need no correction for color (Klein & Morelli, Aircraft System Identification, 2006, ch. 7).
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from flightpower.analysis.estimation.settings import COMPUTATION
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One maneuver: inputs and measured outputs by name, with a uniform time base.

    t_s : (n,) time [s], each step within 1 % of the median step
    u : name to (n,) inputs, all finite
    z : name to (n,) measured outputs, NaN where a sample is missing
    x0 : state at the first sample by name: the starting value if it is estimated, else the fixed value

    Raises InputError with segment and signal when lengths differ, an input is not finite, an output is infinite, or
    the time base is not uniform.
    """

    name: str
    t_s: Array
    u: Mapping[str, Array]
    z: Mapping[str, Array]
    x0: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        t = _vector(self.t_s, f"segment {self.name}: t_s")
        object.__setattr__(self, "t_s", t)
        if len(t) < 2:
            raise InputError(f"segment {self.name}: at least two samples are needed, there are {len(t)}")
        steps = np.diff(t)
        median = float(np.median(steps))
        deviation = np.abs(steps - median)
        if not (median > 0 and deviation.max() <= COMPUTATION.uniformity * median):
            index = int(np.argmax(deviation))  # argmax returns the first NaN, if any
            raise InputError(
                f"segment {self.name}: the time base is not uniform: the step at t = {t[index]:g} s is"
                f" {steps[index]:g} s, the median step is {median:g} s; resample to a uniform time base"
            )
        for signals in ("u", "z"):
            columns = getattr(self, signals)
            arrays = {name: _vector(values, f"segment {self.name}: {name}") for name, values in columns.items()}
            for name, values in arrays.items():
                if len(values) != len(t):
                    raise InputError(f"segment {self.name}: {name} has {len(values)} samples, the time base {len(t)}")
                if signals == "u" and not np.isfinite(values).all():
                    index = int(np.argmax(~np.isfinite(values)))
                    raise InputError(
                        f"segment {self.name}: input {name} is {values[index]} at t = {t[index]:g} s;"
                        " inputs must be given at every sample"
                    )
                if signals == "z" and np.isinf(values).any():
                    raise InputError(f"segment {self.name}: output {name} is infinite; mark missing samples with NaN")
            object.__setattr__(self, signals, arrays)

    @property
    def step_s(self) -> float:
        return float(self.t_s[-1] - self.t_s[0]) / (len(self.t_s) - 1)

    def __len__(self) -> int:
        return len(self.t_s)


def _vector(values: ArrayLike, what: str) -> Array:
    try:
        array = np.ascontiguousarray(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what}: not numbers ({error})") from None
    if array.ndim != 1:
        raise InputError(f"{what}: must be one-dimensional, has shape {array.shape}")
    return array


def split(segment: Segment, parts: int) -> tuple[Segment, ...]:
    """The segment cut into `parts` of about equal length, each with its own initial state.

    Use it for unstable models: errors then grow over one part only.
    """
    cuts = np.linspace(0, len(segment), parts + 1).round().astype(int)
    return tuple(
        Segment(
            name=f"{segment.name}/{i + 1}",
            t_s=segment.t_s[a:b],
            u={name: values[a:b] for name, values in segment.u.items()},
            z={name: values[a:b] for name, values in segment.z.items()},
            x0=segment.x0 if i == 0 else {},
        )
        for i, (a, b) in enumerate(pairwise(cuts))
    )


def delayed(signal: Array, step_s: float, delay_s: float) -> tuple[Array, Array]:
    """(n,) the signal `delay_s` earlier, and its time derivative there.

    Between samples it is a monotone cubic, whose slope has no jumps; before the first sample the signal is constant.
    """
    from scipy.interpolate import PchipInterpolator  # takes 0.15 s to import

    t = np.arange(len(signal)) * step_s
    delayed_s = np.clip(t - delay_s, t[0], t[-1])
    cubic = PchipInterpolator(t, signal)
    inside = delayed_s == t - delay_s
    return np.asarray(cubic(delayed_s)), np.where(inside, cubic(delayed_s, 1), 0.0)


Band = tuple[float, float]  # lowest and highest frequency [Hz]


def frequencies_of(band_Hz: Band, samples: int, step_s: float) -> Array:
    """(k,) frequencies [Hz] of the discrete Fourier transform within the band, without zero.

    They are multiples of 1/duration, and the transforms of white noise at them are independent. Raises InputError for
    a band with fewer than two such frequencies, or one that reaches half the sampling rate.
    """
    low, high = band_Hz
    duration_s = samples * step_s
    first, last = max(1, int(np.ceil(low * duration_s - 1e-9))), int(np.floor(high * duration_s + 1e-9))
    if not 0 <= low < high or 2 * last >= samples:
        raise InputError(
            f"band {low:g} to {high:g} Hz: give two frequencies, the lower first, below half the sampling rate of"
            f" {1 / step_s:g} Hz"
        )
    if last <= first:
        raise InputError(
            f"band {low:g} to {high:g} Hz: a record of {duration_s:.3g} s resolves {1 / duration_s:.2g} Hz only; give a"
            " wider band or a longer record"
        )
    return np.arange(first, last + 1) / duration_s


def band_matrix(band_Hz: Band, samples: int, step_s: float) -> Array:
    """(2k, samples): real and imaginary parts of the discrete Fourier transform within the band.

    Its rows are orthonormal: white noise of variance s has transforms of variance s. Errors as for `frequencies_of`.
    """
    phase = 2 * np.pi * np.outer(frequencies_of(band_Hz, samples, step_s), np.arange(samples) * step_s)
    return np.asarray(np.sqrt(2 / samples) * np.concatenate([np.cos(phase), np.sin(phase)]))
