"""Least squares for a drag polar (2.18), by time series and by points, each with the covariance of its residuals."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from analysis.drag import covariance
from analysis.estimation import output_error
from analysis.estimation.data import Segment
from analysis.estimation.intervals import NORMAL_95
from analysis.estimation.model import Model, Parameter

Array = NDArray[np.float64]

THREE_TERM: Array = np.eye(3)
TWO_TERM: Array = np.eye(3)[:, [0, 2]]  # A1 = 0: the drag is least at no lift


class Point(NamedTuple):
    """One steady point: lift and drag coefficient, the standard error of the latter, and when it was flown."""

    CL: float
    CD: float
    CD_error: float
    start_s: float


class Problem(Protocol):
    """A linear problem for the polar's A (3,)."""

    @property
    def CL(self) -> Array: ...
    def values(self) -> Array: ...
    def noise(self) -> Array: ...


class Piece(NamedTuple):
    """One run: X (n, 3) A = z (n,), at times t_s (n,), flown at lift coefficients CL (n,).

    unseen : covariance (n, n) of what z is off by and the fit mostly swallows, so that residuals do not show it
    """

    name: str
    t_s: Array
    X: Array
    z: Array
    CL: Array
    unseen: Array | None = None


@dataclass(frozen=True)
class TimeSeries:
    """Runs, sample by sample; neighbouring residuals are alike."""

    pieces: Sequence[Piece]

    @property
    def CL(self) -> Array:
        return np.concatenate([piece.CL for piece in self.pieces])

    def values(self) -> Array:
        """A (3,) by least squares."""
        X, z = (np.concatenate([getattr(piece, name) for piece in self.pieces]) for name in ("X", "z"))
        scale = np.sqrt(np.mean(X**2, axis=0))
        A, *_ = np.linalg.lstsq(X / scale, z, rcond=None)
        return A / scale

    def noise(self) -> Array:
        """Covariance (3, 3) of A for coloured residuals, and of what they do not show."""
        names = ("A0", "A1", "A2")
        inputs = ("X0", "X1", "X2")
        model = Model(
            name="polar",
            inputs=inputs,
            outputs=("z",),
            output_function=lambda _, u, p: (p.A0 * u.X0 + p.A1 * u.X1 + p.A2 * u.X2,),
            parameters=tuple(Parameter(name=n, start=float(a)) for n, a in zip(names, self.values(), strict=True)),
        )
        segments = [
            Segment(name=f"{i} {p.name}", t_s=p.t_s, u=dict(zip(inputs, p.X.T, strict=True)), z={"z": p.z})
            for i, p in enumerate(self.pieces)
        ]
        C = covariance.of_noise(output_error.estimate(model, segments))
        gain = np.linalg.inv(sum(p.X.T @ p.X for p in self.pieces))
        return C + sum(gain @ p.X.T @ p.unseen @ p.X @ gain for p in self.pieces if p.unseen is not None)


@dataclass(frozen=True)
class Points:
    """Points of known standard errors; `terms` (3, k) are the columns of A that are fitted.

    X (n, 3), z (n,), sigma (n,)
    """

    X: Array
    z: Array
    sigma: Array
    terms: Array
    CL: Array

    def _weighted(self) -> tuple[Array, Array]:
        return (self.X @ self.terms) / self.sigma[:, None], self.z / self.sigma

    def values(self) -> Array:
        """A (3,) by weighted least squares."""
        X, z = self._weighted()
        theta, *_ = np.linalg.lstsq(X, z, rcond=None)
        return self.terms @ theta

    def noise(self) -> Array:
        """Covariance (3, 3) of A: of the points' standard errors, or of their scatter about the fit if that is larger.

        Few points show their scatter poorly: Student's t widens the covariance to what a 95 % interval then needs.
        """
        X, z = self._weighted()
        theta, *_ = np.linalg.lstsq(X, z, rcond=None)
        dof = len(z) - X.shape[1]
        scatter = float(np.sum((z - X @ theta) ** 2)) / dof if dof > 0 else 0.0
        wider = (stats.t.ppf(0.975, dof) / NORMAL_95) ** 2 if dof > 0 else 1.0
        C = np.linalg.inv(X.T @ X) * max(1.0, scatter * wider)
        return self.terms @ C @ self.terms.T
