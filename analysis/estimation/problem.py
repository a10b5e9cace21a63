"""The free numbers of all segments in one vector: what an optimiser moves, and how each segment uses it."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.data import Segment
from analysis.estimation.model import Model
from flight.errors import InputError

Array = NDArray[np.float64]


class Number(NamedTuple):
    """One free number: where to start, where to stop, and what is known of it (information of a normal prior)."""

    name: str
    unit: str
    start: float
    lower: float = -np.inf
    upper: float = np.inf
    prior_mean: float = 0.0
    prior_information: float = 0.0


@dataclass(frozen=True)
class Problem:
    """The free numbers of all segments in one vector, and how each segment uses them.

    columns : per segment, the place of each of its numbers: free parameters, free initial states, further numbers
    """

    model: Model
    segments: tuple[Segment, ...]
    U: list[Array]
    Z: list[Array]
    names: tuple[str, ...]
    units: tuple[str, ...]
    start: Array
    lower: Array
    upper: Array
    prior_mean: Array
    prior_information: Array  # diagonal
    columns: list[NDArray[np.intp]]
    free_states: NDArray[np.intp]
    x0: list[Array]

    @classmethod
    def prepare(
        cls,
        model: Model,
        segments: tuple[Segment, ...],
        initial_states: Literal["free", "given"] | tuple[str, ...],
        start: Mapping[str, float],
        further: Sequence[Number] = (),
    ) -> "Problem":
        if not segments:
            raise InputError(f"model {model.name}: there is no segment to fit")
        for name, count in Counter(segment.name for segment in segments).items():
            if count > 1:
                raise InputError(f"two segments are named {name!r}")
        choice = (
            {"free": model.states, "given": ()}.get(initial_states)
            if isinstance(initial_states, str)
            else initial_states
        )
        if choice is None or not set(choice) <= set(model.states):
            raise InputError(f"initial_states = {initial_states!r}: 'free', 'given', or some of {model.states}")
        free_states = np.array([i for i, s in enumerate(model.states) if s in choice], dtype=np.intp)

        numbers: dict[str, Number] = {}
        owned, x0 = [], []
        for segment in segments:
            x0.append(initial_state_of(model, segment))
            own = [
                Number(
                    q.name if q.shared else f"{q.name}[{segment.name}]",
                    q.unit,
                    float(np.clip(start.get(q.name, q.start), q.lower, q.upper)),
                    q.lower,
                    q.upper,
                    q.prior_center,
                    q.prior_sigma**-2.0,
                )
                for q in model.parameters
                if q.free
            ]
            own += [Number(f"{model.states[i]}(0)[{segment.name}]", "", x0[-1][i]) for i in free_states]
            numbers |= {number.name: number for number in own}
            owned.append([*own, *further])
        numbers |= {number.name: number for number in further}
        place = {name: i for i, name in enumerate(numbers)}
        columns = [np.array([place[number.name] for number in own], dtype=np.intp) for own in owned]
        for name in start:
            if name not in numbers and name not in free_names(model):
                raise InputError(f"start: {name!r} is none of the free numbers {', '.join(numbers)}")
        if not numbers:
            raise InputError(f"model {model.name}: nothing is free to be estimated")
        free = list(numbers.values())
        lower, upper = np.array([n.lower for n in free]), np.array([n.upper for n in free])
        values = [start.get(n.name, n.start) for n in free]
        return cls(
            model, segments,
            [inputs_of(model, s) for s in segments], [measurements_of(model, s) for s in segments],
            tuple(numbers), tuple(n.unit for n in free), np.clip(values, lower, upper), lower, upper,
            np.array([n.prior_mean for n in free]), np.array([n.prior_information for n in free]),
            columns, free_states, x0,
        )  # fmt: skip

    def of_segment(self, theta: Array, i: int) -> tuple[Array, Array, Array]:
        """Segment i's parameters (all of them, in model order), initial state, and the further numbers."""
        free = np.array([q.free for q in self.model.parameters], dtype=bool)
        parameters, states, further = np.split(theta[self.columns[i]], np.cumsum([free.sum(), len(self.free_states)]))
        p = np.array([q.start for q in self.model.parameters], dtype=float)
        p[free] = parameters
        x0 = self.x0[i].copy()
        x0[self.free_states] = states
        return p, x0, further


def free_names(model: Model) -> tuple[str, ...]:
    return tuple(q.name for q in model.parameters if q.free)


def initial_state_of(model: Model, segment: Segment) -> Array:
    """(states,) of the segment, else the model's guess, else the first sample of an output of that name."""
    guess = dict(model.initial_state(segment)) if model.initial_state else {}
    guess.update(segment.x0)
    for state in model.states:
        if state not in guess:
            measured = segment.z.get(state, np.array([]))
            measured = measured[np.isfinite(measured)]
            if not len(measured):
                raise InputError(f"segment {segment.name}: no starting value for state {state}; give it in x0")
            guess[state] = measured[0]
    return np.array([guess[state] for state in model.states], dtype=float)


def inputs_of(model: Model, segment: Segment) -> Array:
    """(n, inputs) in the model's order; InputError names an input the segment does not have."""
    return _stack(model.inputs, segment.u, len(segment), f"segment {segment.name}: input", model.name)


def measurements_of(model: Model, segment: Segment) -> Array:
    """(n, outputs) in the model's order, NaN where missing; InputError names an output the segment does not have."""
    return _stack(model.outputs, segment.z, len(segment), f"segment {segment.name}: output", model.name)


def _stack(names: tuple[str, ...], signals: Mapping[str, Array], n: int, what: str, model: str) -> Array:
    for name in names:
        if name not in signals:
            raise InputError(f"{what} {name}, which model {model} needs, is missing")
    return np.column_stack([signals[name] for name in names]) if names else np.zeros((n, 0))
