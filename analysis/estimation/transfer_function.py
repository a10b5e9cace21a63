"""Transfer functions as models: y/u = (b0 + b1 s + ...)/(a0 + a1 s + ... + s^n).

Reference: Klein & Morelli, Aircraft System Identification, 2006, sec. 7.4; Sanathanan & Koerner, IEEE Trans. Automatic
Control 8(1), 1963, 56.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.data import Band, Segment, frequencies_of, transform
from analysis.estimation.model import Model, NamedValues, Parameter
from flight.errors import InputError

Array = NDArray[np.float64]

REWEIGHTINGS = 10  # of the Sanathanan-Koerner iteration, which converges or cycles within a few


def transfer_function(numerator: int, denominator: int, u: str = "u", y: str = "y") -> Model:
    """The model in controllable canonical form, with states x1 to xn and free parameters b0.. and a0.. .

    numerator, denominator : orders of the polynomials; the numerator's must be the smaller one
    u, y : names of input and output

    For the parameters' starting values see `starting_values`. Raises InputError for other orders.
    """
    if not 0 <= numerator < denominator:
        raise InputError(
            f"transfer function of orders {numerator}/{denominator}: the numerator's order must be smaller than the"
            " denominator's, and not negative"
        )
    states = tuple(f"x{i + 1}" for i in range(denominator))

    def dynamics(x: NamedValues, inputs: NamedValues, p: NamedValues) -> tuple[Any, ...]:
        last = inputs[u] - sum(p[f"a{i}"] * x[state] for i, state in enumerate(states))
        return (*(x[state] for state in states[1:]), last)

    return Model(
        name=f"transfer function of orders {numerator}/{denominator}",
        states=states,
        inputs=(u,),
        outputs=(y,),
        parameters=(
            *(Parameter(name=f"b{i}", start=1.0) for i in range(numerator + 1)),
            *(Parameter(name=f"a{i}", start=1.0) for i in range(denominator)),
        ),
        dynamics=dynamics,
        output_function=lambda x, inputs, p: (sum(p[f"b{i}"] * x[states[i]] for i in range(numerator + 1)),),
        initial_state=lambda segment: dict.fromkeys(states, 0.0),
    )


def starting_values(model: Model, segments: Segment | Sequence[Segment], band_Hz: Band) -> dict[str, float]:
    """The model's parameters by linear least squares on Fourier transforms, reweighted by 1/|denominator|.

    model : from `transfer_function`. The motion should begin and end at rest, because the initial state is neglected.
    Raises InputError for a band that the record does not resolve.
    """
    segments = (segments,) if isinstance(segments, Segment) else tuple(segments)
    names = [q.name for q in model.parameters]
    zeros = [name for name in names if name.startswith("b")]
    poles = [name for name in names if name.startswith("a")]
    rows, targets, powers = [], [], []
    for segment in segments:
        f = frequencies_of(band_Hz, len(segment), segment.step_s)
        s = 2j * np.pi * f
        U = transform(segment.u[model.inputs[0]], segment.step_s, f)
        Y = transform(segment.z[model.outputs[0]], segment.step_s, f)
        rows.append(np.column_stack([s**i * U for i in range(len(zeros))] + [-(s**i) * Y for i in range(len(poles))]))
        targets.append(s ** len(poles) * Y)
        powers.append(np.column_stack([s**i for i in range(len(poles) + 1)]))
    A, b, S = np.concatenate(rows), np.concatenate(targets), np.concatenate(powers)
    solution: Array = np.zeros(len(names))
    weight = np.ones(len(b))
    for _ in range(REWEIGHTINGS):
        real = np.concatenate([(A * weight[:, None]).real, (A * weight[:, None]).imag])
        solution = np.linalg.lstsq(real, np.concatenate([(b * weight).real, (b * weight).imag]), rcond=None)[0]
        weight = 1 / np.abs(S @ [*solution[len(zeros) :], 1.0])
    return dict(zip([*zeros, *poles], solution.tolist(), strict=True))
