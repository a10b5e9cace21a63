"""What was measured: segments (manoeuvres) on a uniform time base."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flight.errors import InputError

Array = NDArray[np.float64]

UNIFORM_WITHIN = 0.01  # of the time step: an RK4 step's own error is far larger than what 1 % of a step does


@dataclass(frozen=True, kw_only=True)
class Segment:
    """One manoeuvre: inputs and measured outputs by name, on a uniform time base.

    t_s : (n,) time [s], uniform within 1 % of its step      u : name to (n,) inputs, without gaps
    z : name to (n,) measured outputs; NaN where a sample is missing
    x0 : state at the first sample by name; the starting value where it is estimated, the value where it is given

    Raises InputError naming segment and signal: lengths that differ, NaN in an input, a time base that is not uniform.
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
        usual = float(np.median(steps))
        off = np.abs(steps - usual)
        if not (usual > 0 and off.max() <= UNIFORM_WITHIN * usual):
            at = int(np.argmax(off))  # also where a time is NaN
            raise InputError(
                f"segment {self.name}: the time base is not uniform: the step at t = {t[at]:g} s is {steps[at]:g} s,"
                f" the usual one {usual:g} s"
            )
        for kind, signals in (("u", self.u), ("z", self.z)):
            arrays = {name: _vector(values, f"segment {self.name}: {name}") for name, values in signals.items()}
            for name, values in arrays.items():
                if len(values) != len(t):
                    raise InputError(f"segment {self.name}: {name} has {len(values)} samples, the time base {len(t)}")
                if kind == "u" and not np.isfinite(values).all():
                    at = int(np.argmax(~np.isfinite(values)))
                    raise InputError(
                        f"segment {self.name}: input {name} is {values[at]} at t = {t[at]:g} s;"
                        " inputs must be given at every sample"
                    )
                if kind == "z" and np.isinf(values).any():
                    raise InputError(f"segment {self.name}: output {name} is infinite; a missing sample is NaN")
            object.__setattr__(self, kind, arrays)

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
        raise InputError(f"{what}: should be one-dimensional, has shape {array.shape}")
    return array


def split(segment: Segment, parts: int) -> tuple[Segment, ...]:
    """The segment cut into `parts` of about equal length, each of which gets its own initial state.

    What makes an unstable model usable: an error grows over one part only (multiple shooting without the knots tied).
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
