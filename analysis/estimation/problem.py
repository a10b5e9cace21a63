"""The vector of unknowns theta: free parameters, free initial states and noise parameters of all segments."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import compress
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.integration import InputRule, Integrator
from flightpower.analysis.estimation.model import Model, UnknownKey, UnknownKind
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


@dataclass(frozen=True, kw_only=True)
class FitOptions:
    """How a fit integrates the model and searches for the optimum.

    integrator, inputs : integration method, and the inputs between samples; see `simulation.build_simulator`
    initial_states : "free" estimates the state at the start of each segment; "given" takes it from `Segment.x0`, else
    from `Model.initial_state`, else from the first sample of the output of that name; a tuple names the free states
    max_iterations : number of iterations after which the fit ends without convergence
    second_start : whether a fit that is not convincing is repeated from the record cut in pieces, at the cost of two
    more fits
    """

    integrator: Integrator = "rk4"
    inputs: InputRule = "linear"
    initial_states: Literal["free", "given"] | tuple[str, ...] = "free"
    max_iterations: int = 50
    second_start: bool = True


class Unknown(NamedTuple):
    """One element of theta: start, bounds, mean and information (1/variance) of its normal prior, largest step."""

    key: UnknownKey
    unit: str
    start: float
    lower: float = -np.inf
    upper: float = np.inf
    prior_mean: float = 0.0
    prior_information: float = 0.0
    largest_step: float = np.inf  # in one iteration

    @property
    def name(self) -> str:
        return str(self.key)


@dataclass(frozen=True)
class Problem:
    """A model, its data, and the vector of unknowns theta (m,) of all segments.

    U, Z : per segment, inputs (n, inputs) and measured outputs (n, outputs), NaN where missing
    unknowns : (m,), in the order of theta     start : (m,), within the bounds
    columns : per segment, the indices in theta of its unknowns: free parameters, free initial states, noise parameters
    free_states : indices of the states whose initial values are estimated
    measured_rows, measured_values : (k, m) and (k,), the prior measurements of the model in units of their sigma:
        rows theta = values
    x0 : per segment, the initial state (states,); elements in `free_states` are only starting values
    """

    model: Model
    segments: tuple[Segment, ...]
    U: list[Array]
    Z: list[Array]
    unknowns: tuple[Unknown, ...]
    start: Array
    columns: list[NDArray[np.intp]]
    free_states: NDArray[np.intp]
    x0: list[Array]
    measured_rows: Array
    measured_values: Array

    @classmethod
    def assemble(
        cls,
        model: Model,
        segments: tuple[Segment, ...],
        initial_states: Literal["free", "given"] | tuple[str, ...],
        start: Mapping[str, float],
        noise: Sequence[Unknown] = (),
    ) -> "Problem":
        """Collect the unknowns of all segments. noise : noise parameters, common to all segments, at the end of theta.

        Raises InputError for missing or contradictory data, unknown names, or when nothing is free.
        """
        if not isinstance(start, Mapping):
            raise InputError(f"start must give values by name, {{'CLa': 4.5}}, is {start!r}")
        if not segments:
            raise InputError(f"model {model.name}: there is no segment to fit; give at least one")
        for name, count in Counter(segment.name for segment in segments).items():
            if count > 1:
                raise InputError(f"two segments are named {name!r}; give each its own name")
        choice = (
            {"free": model.states, "given": ()}.get(initial_states)
            if isinstance(initial_states, str)
            else initial_states
        )
        if choice is None or not set(choice) <= set(model.states):
            raise InputError(
                f"initial_states = {initial_states!r}: choose 'free', 'given', or a tuple of some of {model.states}"
            )
        free_states = np.array([i for i, s in enumerate(model.states) if s in choice], dtype=np.intp)

        unknowns: dict[str, Unknown] = {}
        by_segment, x0 = [], []
        for segment in segments:
            x0.append(initial_state_of(model, segment))
            own = [
                Unknown(
                    UnknownKey(UnknownKind.PARAMETER, q.name, None if q.shared else segment.name),
                    q.unit,
                    float(np.clip(start.get(q.name, q.start), q.lower, q.upper)),
                    q.lower,
                    q.upper,
                    q.prior_mean_or_start,
                    q.prior_sigma**-2.0,
                )
                for q in model.parameters
                if q.free
            ]
            own += [
                Unknown(UnknownKey(UnknownKind.INITIAL_STATE, model.states[i], segment.name), "", x0[-1][i])
                for i in free_states
            ]
            unknowns |= {unknown.name: unknown for unknown in own}
            by_segment.append([*own, *noise])
        unknowns |= {unknown.name: unknown for unknown in noise}
        index = {name: i for i, name in enumerate(unknowns)}
        columns = [np.array([index[unknown.name] for unknown in own], dtype=np.intp) for own in by_segment]
        for name in start:
            if name not in unknowns and name not in free_names(model):
                raise InputError(f"start: {name!r} is not among the unknowns {', '.join(unknowns)}")
        if not unknowns:
            raise InputError(f"model {model.name}: nothing is free to be estimated; free a parameter or initial state")
        free = list(unknowns.values())
        lower, upper = np.array([n.lower for n in free]), np.array([n.upper for n in free])
        values = [start.get(n.name, n.start) for n in free]
        return cls(
            model, segments,
            [inputs_of(model, s) for s in segments], [measurements_of(model, s) for s in segments],
            tuple(free), np.clip(values, lower, upper), columns, free_states, x0, *_prior_measurements(model, index),
        )  # fmt: skip

    def without(self, keep: NDArray[np.bool_]) -> "Problem":
        """The problem with only those unknowns for which `keep` (m,) is true."""
        new_index = np.cumsum(keep) - 1
        return replace(
            self,
            unknowns=tuple(compress(self.unknowns, keep)),
            start=self.start[keep],
            columns=[new_index[columns[keep[columns]]] for columns in self.columns],
            measured_rows=self.measured_rows[:, keep],
        )

    @cached_property
    def keys(self) -> tuple[UnknownKey, ...]:
        return tuple(unknown.key for unknown in self.unknowns)

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(unknown.name for unknown in self.unknowns)

    @cached_property
    def lower(self) -> Array:
        return np.array([unknown.lower for unknown in self.unknowns])

    @cached_property
    def upper(self) -> Array:
        return np.array([unknown.upper for unknown in self.unknowns])

    @cached_property
    def prior_mean(self) -> Array:
        return np.array([unknown.prior_mean for unknown in self.unknowns])

    @cached_property
    def prior_information(self) -> Array:
        """(m,) 1/variance of the normal prior of each unknown, 0 without one."""
        return np.array([unknown.prior_information for unknown in self.unknowns])

    @cached_property
    def largest_step(self) -> Array:
        return np.array([unknown.largest_step for unknown in self.unknowns])

    @cached_property
    def prior_matrix(self) -> Array:
        """Information (m, m) of all priors: those of the unknowns, and the prior measurements."""
        return np.asarray(np.diag(self.prior_information) + self.measured_rows.T @ self.measured_rows)

    def prior_cost(self, theta: Array) -> float:
        """The part of the negative log-likelihood that is due to the priors, up to a constant."""
        from_prior, from_measured = theta - self.prior_mean, self.measured_rows @ theta - self.measured_values
        return float(self.prior_information @ from_prior**2) / 2 + float(from_measured @ from_measured) / 2

    def prior_gradient(self, theta: Array) -> Array:
        """Gradient (m,) of `prior_cost`."""
        from_measured = self.measured_rows @ theta - self.measured_values
        return np.asarray(self.prior_information * (theta - self.prior_mean) + self.measured_rows.T @ from_measured)

    def unpack(self, theta: Array, i: int) -> tuple[Array, Array, Array]:
        """Segment i's parameters (free and fixed, in model order), initial state (states,), and noise parameters."""
        free = np.array([q.free for q in self.model.parameters], dtype=bool)
        parameters, states, noise = np.split(theta[self.columns[i]], np.cumsum([free.sum(), len(self.free_states)]))
        p = np.array([q.start for q in self.model.parameters], dtype=float)
        p[free] = parameters
        x0 = self.x0[i].copy()
        x0[self.free_states] = states
        return p, x0, noise


def _prior_measurements(model: Model, index: Mapping[str, int]) -> tuple[Array, Array]:
    """`measured_rows` and `measured_values`; fixed parameters count as known. index: position in theta by name."""
    start = {q.name: q.start for q in model.parameters}
    rows = np.zeros((len(model.prior_measurements), len(index)))
    values = np.zeros(len(rows))
    for i, measurement in enumerate(model.prior_measurements):
        values[i] = measurement.value / measurement.sigma
        for name, coefficient in measurement.coefficients:
            if name in index:
                rows[i, index[name]] = coefficient / measurement.sigma
            else:
                values[i] -= coefficient * start[name] / measurement.sigma
    return rows, values


def as_segments(segments: Segment | Sequence[Segment]) -> tuple[Segment, ...]:
    """One or several segments as a tuple. Raises InputError for anything else."""
    items = (segments,) if isinstance(segments, Segment) else tuple(segments)
    for segment in items:
        if not isinstance(segment, Segment):
            raise InputError(f"segments: give Segment objects, not {segment!r}")
    return items


def free_names(model: Model) -> tuple[str, ...]:
    """Names of the free parameters, in model order."""
    return tuple(q.name for q in model.parameters if q.free)


def initial_state_of(model: Model, segment: Segment) -> Array:
    """Initial state (states,): from `Segment.x0`, else `Model.initial_state`, else the first sample of that output.

    Raises InputError when none of them gives a value.
    """
    x0 = dict(model.initial_state(segment)) if model.initial_state else {}
    x0.update(segment.x0)
    for state in model.states:
        if state not in x0:
            measured = segment.z.get(state, np.array([]))
            measured = measured[np.isfinite(measured)]
            if not len(measured):
                raise InputError(f"segment {segment.name}: no starting value for state {state}; give it in x0")
            x0[state] = measured[0]
    return np.array([x0[state] for state in model.states], dtype=float)


def inputs_of(model: Model, segment: Segment) -> Array:
    """(n, inputs) in the model's order. Raises InputError for a missing input."""
    return _stack(model.inputs, segment.u, len(segment), f"segment {segment.name}: input", model.name)


def measurements_of(model: Model, segment: Segment) -> Array:
    """(n, outputs) in the model's order, NaN where a sample is missing. Raises InputError for a missing output."""
    return _stack(model.outputs, segment.z, len(segment), f"segment {segment.name}: output", model.name)


def _stack(names: tuple[str, ...], signals: Mapping[str, Array], n: int, what: str, model: str) -> Array:
    for name in names:
        if name not in signals:
            raise InputError(f"{what} {name}, which model {model} needs, is missing; add it to the segment")
    return np.column_stack([signals[name] for name in names]) if names else np.zeros((n, 0))
