"""The outcome of an estimation: the estimates, their covariance, and a verdict on both."""

import enum
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from analysis.estimation.data import Segment
from analysis.estimation.model import Model, Named
from analysis.estimation.noise import Whitened
from analysis.estimation.simulation import Response

Array = NDArray[np.float64]


class Status(enum.StrEnum):
    CONVERGED = "converged"
    AT_BOUND = "at a bound"
    NOT_IDENTIFIABLE = "not identifiable"
    NOT_CONVERGED = "not converged"


class Verdict(NamedTuple):
    """What to think of a fit: a status, and one line for people."""

    status: Status
    text: str

    @property
    def ok(self) -> bool:
        return self.status is Status.CONVERGED

    def __str__(self) -> str:
        return self.text


class Estimate(NamedTuple):
    name: str
    value: float
    standard_error: float  # Cramer-Rao, priors included; 0 for a parameter that was held, inf if not identifiable
    unit: str
    free: bool


@dataclass(frozen=True)
class Piece:
    """What one segment contributed: its response, residuals z - y (NaN where missing), and these in noise units.

    columns : place in `Fit.names` of each column of `white.S`
    """

    segment: Segment
    response: Response
    residuals: Array
    white: Whitened
    columns: NDArray[np.intp]


@dataclass(frozen=True)
class Fit:
    """The outcome of `estimate`.

    names : of all free numbers, "CLa" for a shared parameter, "b[run]" for a segment's own, "V(0)[run]" for an
    initial state; `values` (m,), `information` (of the data), `prior_information` (diagonal) and `covariance` (m, m;
    Cramer-Rao with the priors) follow this order. `parameters` also holds what was not free.
    """

    model: Model
    names: tuple[str, ...]
    values: Array
    covariance: Array
    parameters: dict[str, Estimate]
    noise_covariance: Array
    verdict: Verdict
    iterations: int
    negative_log_likelihood: float
    information: Array
    prior_information: Array
    pieces: tuple[Piece, ...]
    spread_information: Array | float = 0.0  # the part of `information` that sizes, not values, of residuals give

    @property
    def residuals(self) -> dict[str, Array]:
        """Segment name to (n, outputs), z - y; NaN where a sample is missing."""
        return {piece.segment.name: piece.residuals for piece in self.pieces}

    @property
    def responses(self) -> dict[str, Response]:
        return {piece.segment.name: piece.response for piece in self.pieces}

    @property
    def samples(self) -> int:
        """Number of measured values that went in."""
        return int(sum(piece.white.present.sum() for piece in self.pieces))

    def shared(self, values: Array | None = None) -> Named:
        """The model's shared parameters by name, at `values` (in the order of `names`) or at the estimate."""
        free = dict(zip(self.names, self.values if values is None else values, strict=True))
        return Named("shared parameter", {q.name: free.get(q.name, q.start) for q in self.model.parameters if q.shared})
