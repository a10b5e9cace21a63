"""The definition of a model: functions for dynamics and outputs, and parameters with starting values, bounds, priors.

The functions use NumPy (`np.sin`, `np.sqrt`, arithmetic) and accept floats, arrays and CasADi symbols. They receive
state, input and parameters by name, `x.alpha`, `u.elevator`, `p.CLa`. They return one value for each state, or for each
output, in the order of the model's names.
"""

import enum
import math
import numbers
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.estimation.data import Segment
from flightpower.flight.errors import InputError


class NamedValues:
    """Values by name, `p.CLa` or `p["CLa"]`. An unknown name raises InputError with the known names."""

    def __init__(self, what: str, values: Mapping[str, Any]):
        self.__dict__.update(values)
        self._what, self._values = what, dict(values)

    def __getitem__(self, name: str) -> Any:
        if name not in self._values:
            raise InputError(f"no {self._what} is named {name!r}; known: {', '.join(self._values) or 'none'}")
        return self._values[name]

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return self[name]


class UnknownKind(enum.Enum):
    """The kind of an unknown."""

    PARAMETER = enum.auto()
    INITIAL_STATE = enum.auto()
    PROCESS_NOISE = enum.auto()  # ln w, w the intensity
    MEASUREMENT_NOISE = enum.auto()  # ln v, v the standard deviation


class UnknownKey(NamedTuple):
    """Identifies an unknown by kind and by name of a parameter, state or output; by segment if each has its own value.

    As text it is the name in tables: "CLa", "b[run]", "V(0)[run]", "ln w(V)", "ln v(ax)".
    """

    kind: UnknownKind
    name: str
    segment: str | None = None

    @property
    def is_noise(self) -> bool:
        return self.kind in (UnknownKind.PROCESS_NOISE, UnknownKind.MEASUREMENT_NOISE)

    def __str__(self) -> str:
        forms = {
            UnknownKind.PARAMETER: "{}",
            UnknownKind.INITIAL_STATE: "{}(0)",
            UnknownKind.PROCESS_NOISE: "ln w({})",
            UnknownKind.MEASUREMENT_NOISE: "ln v({})",
        }
        return forms[self.kind].format(self.name) + (f"[{self.segment}]" if self.segment is not None else "")


ModelFunction = Callable[[NamedValues, NamedValues, NamedValues], Sequence[Any]]


class _Equations(NamedTuple):
    """A function of the model, what it computes, and the names of its values."""

    what: str
    function: ModelFunction
    names: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A model parameter: free (to be estimated) or fixed at `start`.

    The prior is normal with mean `prior_mean` (default: `start`) and standard deviation `prior_sigma`, in `unit`. The
    default `prior_sigma` of infinity means no prior. A parameter with `shared=False` has its own value in every
    segment and the full name `name[segment]`.

    Raises InputError when `start` is not finite or outside the bounds, or `prior_sigma` is not positive.
    """

    name: str
    start: float
    unit: str = ""
    lower: float = -math.inf
    upper: float = math.inf
    prior_mean: float | None = None
    prior_sigma: float = math.inf
    free: bool = True
    shared: bool = True

    def __post_init__(self) -> None:
        for what in ("start", "lower", "upper", "prior_sigma"):
            if not isinstance(getattr(self, what), numbers.Real):
                raise InputError(f"parameter {self.name}: {what} must be a number, is {getattr(self, what)!r}")
        if not math.isfinite(self.start):
            raise InputError(f"parameter {self.name}: start must be a finite number, is {self.start}")
        if not self.lower <= self.start <= self.upper:
            raise InputError(
                f"parameter {self.name}: start {self.start:g} lies outside [{self.lower:g}, {self.upper:g}]"
            )
        if not self.prior_sigma > 0:
            raise InputError(f"parameter {self.name}: prior_sigma must be greater than zero, is {self.prior_sigma}")

    @property
    def prior_mean_or_start(self) -> float:
        return self.start if self.prior_mean is None else self.prior_mean


@dataclass(frozen=True, kw_only=True)
class PriorMeasurement:
    """A linear combination of shared parameters that was measured before: sum of coefficient times parameter.

    Its error is normal with standard deviation `sigma`. Together with the parameters' own priors it forms a correlated
    prior. coefficients : pairs (parameter, coefficient), or a mapping by parameter name

    Raises InputError when there is no coefficient, a number is not finite, or `sigma` is not positive.
    """

    name: str
    coefficients: tuple[tuple[str, float], ...]
    value: float
    sigma: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "coefficients", tuple(dict(self.coefficients).items()))
        numbers = (*(coefficient for _, coefficient in self.coefficients), self.value, self.sigma)
        if not self.coefficients or not all(map(math.isfinite, numbers)):
            raise InputError(f"prior measurement {self.name}: coefficients, value and sigma must be finite numbers")
        if not self.sigma > 0:
            raise InputError(f"prior measurement {self.name}: sigma must be greater than zero, is {self.sigma}")

    def row(self, names: Iterable[str]) -> NDArray[np.float64]:
        """Coefficients (m,) of parameters of these names in units of `sigma`; 0 for a parameter without one."""
        by_name = dict(self.coefficients)
        return np.array([by_name.get(name, 0.0) for name in names]) / self.sigma

    def deviation(self, values: Mapping[str, float]) -> float:
        """Difference between parameters of these values and the measurement, in standard deviations."""
        return (sum(c * values[name] for name, c in self.coefficients) - self.value) / self.sigma


@dataclass(frozen=True, kw_only=True)
class Model:
    """xdot = dynamics(x, u, p), y = outputs(x, u, p), z = y + noise (3.24-3.26).

    A model without states is an ordinary regression and needs no `dynamics`. `initial_state` computes a starting value
    of the state at a segment's first sample from the segment's data; `Segment.x0` takes precedence over it. `delays`
    names inputs that act late, each with the parameter that is its delay [s]: (("elevator", "tau"),). Output error and
    equation error estimate delays; inputs are interpolated between samples. `prior_measurements` add to the priors of
    the parameters.

    Raises InputError when a name occurs twice, there are no outputs, states have no dynamics, or a delay's input or
    parameter, or a prior measurement's parameter, does not exist.
    """

    name: str
    outputs: tuple[str, ...]
    output_function: ModelFunction
    parameters: tuple[Parameter, ...]
    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    dynamics: ModelFunction | None = None
    initial_state: Callable[[Segment], Mapping[str, float]] | None = None
    delays: tuple[tuple[str, str], ...] = ()
    prior_measurements: tuple[PriorMeasurement, ...] = ()

    def __post_init__(self) -> None:
        for kind, expected_type in (("states", str), ("inputs", str), ("outputs", str), ("parameters", Parameter)):
            object.__setattr__(self, kind, self._as_tuple(kind, expected_type))
        for kind, names in (
            ("states", self.states),
            ("inputs", self.inputs),
            ("outputs", self.outputs),
            ("parameters", [p.name for p in self.parameters]),
        ):
            for name, count in Counter(names).items():
                if count > 1:
                    raise InputError(f"model {self.name}: two {kind} are named {name!r}")
        object.__setattr__(self, "delays", tuple(dict(self.delays).items()))
        for input_name, parameter in self.delays:
            if input_name not in self.inputs or parameter not in [q.name for q in self.parameters if q.shared]:
                raise InputError(
                    f"model {self.name}: delays: {input_name!r} must be an input and {parameter!r} a shared parameter"
                )
        shared = {q.name for q in self.parameters if q.shared}
        for measurement in self.prior_measurements:
            for name in sorted(dict(measurement.coefficients).keys() - shared):
                raise InputError(
                    f"model {self.name}: prior measurement {measurement.name}: {name!r} must be a shared parameter"
                )
        if not self.outputs:
            raise InputError(f"model {self.name}: it has no outputs to compare with data; name at least one")
        if self.states and self.dynamics is None:
            raise InputError(f"model {self.name}: it has states but no dynamics function; give dynamics")

    def _as_tuple(self, kind: str, item_type: type) -> tuple[Any, ...]:
        """The names or parameters as a tuple; lists are accepted."""
        items = getattr(self, kind)
        if isinstance(items, (list, tuple)) and all(isinstance(item, item_type) for item in items):
            return tuple(items)
        what = "Parameter objects" if item_type is Parameter else "names"
        raise InputError(
            f"model {self.name}: {kind} must be a tuple of {what}, with a comma if it is one; is {items!r}"
        )

    def changed(self, **changes: Mapping[str, Any]) -> "Model":
        """A copy of the model with some parameters changed: `model.changed(CLde={"start": 0.4, "free": False})`.

        Raises InputError for an unknown parameter.
        """
        unknown = set(changes) - {p.name for p in self.parameters}
        if unknown:
            raise InputError(f"model {self.name}: no parameter is named {sorted(unknown)[0]!r}")
        return replace(self, parameters=tuple(replace(p, **changes.get(p.name, {})) for p in self.parameters))

    def evaluate_dynamics(self, x: Iterable[Any], u: Iterable[Any], p: Iterable[Any]) -> tuple[Any, ...]:
        """xdot, one value per state. x, u, p are in the model's order: floats, arrays or symbols."""
        if self.dynamics is None:
            return ()
        return self._call(_Equations("dynamics", self.dynamics, self.states), x, u, p)

    def evaluate_outputs(self, x: Iterable[Any], u: Iterable[Any], p: Iterable[Any]) -> tuple[Any, ...]:
        """y, one value per output. x, u, p as in `evaluate_dynamics`."""
        return self._call(_Equations("outputs", self.output_function, self.outputs), x, u, p)

    def _call(self, equations: _Equations, x: Iterable[Any], u: Iterable[Any], p: Iterable[Any]) -> tuple[Any, ...]:
        what, function, names = equations
        try:
            result = function(
                NamedValues("state", dict(zip(self.states, x, strict=True))),
                NamedValues("input", dict(zip(self.inputs, u, strict=True))),
                NamedValues("parameter", dict(zip([q.name for q in self.parameters], p, strict=True))),
            )
        except InputError as error:
            raise InputError(f"model {self.name}: {what}: {error}") from None
        if not isinstance(result, (tuple, list)) and getattr(result, "ndim", 0) != 1:
            raise InputError(
                f"model {self.name}: {what} must return a tuple with one value for each of {', '.join(names)};"
                f" with a comma if it is one: (value,)"
            )
        result = tuple(result)
        if len(result) != len(names):
            raise InputError(
                f"model {self.name}: {what} returned {len(result)} values for {len(names)} names ({', '.join(names)})"
            )
        return result
