"""What a user writes: a model as a few plain functions, its names, starting values, bounds and priors.

The functions are written with NumPy (`np.sin`, `np.sqrt`, arithmetic), so that floats, arrays and CasADi symbols pass
through them alike. They get state, input and parameters by name, `x.alpha`, `u.elevator`, `p.CLa`, and return one
value for each state, or for each output, in the order in which the model names them.
"""

import math
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from analysis.estimation.data import Segment
from flight.errors import InputError


class Named:
    """A few values by name, `p.CLa` or `p["CLa"]`; a name that is not there is an error that lists the known ones."""

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


ModelFunction = Callable[[Named, Named, Named], Sequence[Any]]


@dataclass(frozen=True, kw_only=True)
class Parameter:
    """A number the model needs; free (to be estimated) or held at `start`.

    A prior is normal, with `prior_sigma` about `prior_mean` (about `start` when not given). A parameter that is not
    `shared` has its own value in every segment; its full name is then `name[segment]`.
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
        if not math.isfinite(self.start):
            raise InputError(f"parameter {self.name}: start must be a finite number, is {self.start}")
        if not self.lower <= self.start <= self.upper:
            raise InputError(
                f"parameter {self.name}: start {self.start:g} lies outside [{self.lower:g}, {self.upper:g}]"
            )
        if not self.prior_sigma > 0:
            raise InputError(f"parameter {self.name}: prior_sigma must be greater than zero, is {self.prior_sigma}")

    @property
    def prior_center(self) -> float:
        return self.start if self.prior_mean is None else self.prior_mean


@dataclass(frozen=True, kw_only=True)
class Model:
    """xdot = dynamics(x, u, p), y = outputs(x, u, p), z = y + noise (3.24-3.26).

    A model without states is an ordinary regression; it needs no `dynamics`. `initial_state` guesses the state at the
    start of a segment from its data, where the segment itself does not give it (see `Segment.x0`).

    Raises InputError when a name occurs twice.
    """

    name: str
    outputs: tuple[str, ...]
    output_function: ModelFunction
    parameters: tuple[Parameter, ...]
    states: tuple[str, ...] = ()
    inputs: tuple[str, ...] = ()
    dynamics: ModelFunction | None = None
    initial_state: Callable[[Segment], Mapping[str, float]] | None = None

    def __post_init__(self) -> None:
        for kind, names in (
            ("states", self.states),
            ("inputs", self.inputs),
            ("outputs", self.outputs),
            ("parameters", [p.name for p in self.parameters]),
        ):
            for name, count in Counter(names).items():
                if count > 1:
                    raise InputError(f"model {self.name}: two {kind} are named {name!r}")
        if not self.outputs:
            raise InputError(f"model {self.name}: it has no outputs, so nothing to compare with data")
        if self.states and self.dynamics is None:
            raise InputError(f"model {self.name}: it has states but no dynamics function")

    def changed(self, **changes: Mapping[str, Any]) -> "Model":
        """The same model with some parameters changed: `model.changed(CLde={"start": 0.4, "free": False})`.

        Raises InputError for a parameter the model does not have.
        """
        unknown = set(changes) - {p.name for p in self.parameters}
        if unknown:
            raise InputError(f"model {self.name}: no parameter is named {sorted(unknown)[0]!r}")
        return replace(self, parameters=tuple(replace(p, **changes.get(p.name, {})) for p in self.parameters))

    def evaluate_dynamics(self, x: Iterable[Any], u: Iterable[Any], p: Iterable[Any]) -> tuple[Any, ...]:
        """xdot, one value a state; x, u, p in the model's order: floats, arrays or symbols."""
        if self.dynamics is None:
            return ()
        return self._call(self.dynamics, "dynamics", self.states, x, u, p)

    def evaluate_outputs(self, x: Iterable[Any], u: Iterable[Any], p: Iterable[Any]) -> tuple[Any, ...]:
        """y, one value an output."""
        return self._call(self.output_function, "outputs", self.outputs, x, u, p)

    def _call(self, function: ModelFunction, what: str, names: tuple[str, ...], x: Any, u: Any, p: Any) -> tuple:
        try:
            result = tuple(
                function(
                    Named("state", dict(zip(self.states, x, strict=True))),
                    Named("input", dict(zip(self.inputs, u, strict=True))),
                    Named("parameter", dict(zip([q.name for q in self.parameters], p, strict=True))),
                )
            )
        except InputError as error:
            raise InputError(f"model {self.name}: {what}: {error}") from None
        if len(result) != len(names):
            raise InputError(
                f"model {self.name}: {what} returned {len(result)} values for {len(names)} names ({', '.join(names)})"
            )
        return result
