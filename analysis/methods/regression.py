"""Linear least squares for a drag polar (2.18), from time series or from steady points, and its covariance by noise."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
import pandas as pd
from scipy import special

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods import consider as covariance
from flightpower.analysis.methods.settings import REGRESSION
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError


class RunData(NamedTuple):
    """A run, its times (n,) [s], and columns of the table over it by name, each (n,)."""

    run: Maneuver
    t_s: Array
    columns: dict[str, Array]


def run_data(table: pd.DataFrame, runs: list[Maneuver], columns: tuple[str, ...]) -> list[RunData]:
    """The columns over each run, gaps interpolated. Raises InputError when no run has all columns."""
    t, values = table.index.to_numpy(), [table[name].to_numpy() for name in columns]
    run_data = []
    for run in runs:
        rows = slice(*np.searchsorted(t, (run.start_s, np.nextafter(run.end_s, np.inf))))
        data = np.stack([column[rows] for column in values], axis=1)
        if not np.isfinite(data).all():
            data = pd.DataFrame(data).interpolate(limit_direction="both").to_numpy()
        if len(data) >= REGRESSION.fewest_blocks and np.isfinite(data).all():
            run_data.append(RunData(run, t[rows], dict(zip(columns, data.T, strict=True))))
    if not run_data:
        raise InputError("no run has all the required data")
    return run_data


COEFFICIENTS = ("A0", "A1", "A2")
THREE_TERM: Array = np.eye(len(COEFFICIENTS))
TWO_TERM: Array = THREE_TERM[:, [0, 2]]  # A1 = 0: least drag at zero lift
# The same regression as a model, for the covariance by colored residuals; it is compiled once for all methods.
POLAR_FIT = Model(
    name="polar",
    inputs=("X0", "X1", "X2"),
    outputs=("z",),
    output_function=lambda _, u, p: (p.A0 * u.X0 + p.A1 * u.X1 + p.A2 * u.X2,),
    parameters=tuple(Parameter(name=name, start=0.0) for name in COEFFICIENTS),
)


class PolarRegression(Protocol):
    """A linear problem for the polar's A (3,), from data at lift coefficients CL (n,)."""

    @property
    def CL(self) -> Array: ...
    def coefficients(self) -> Array: ...
    def noise_covariance(self) -> Array: ...


class RunRegression(NamedTuple):
    """One run: X (n, 3) A = z (n,), at times t_s (n,), flown at lift coefficients CL (n,).

    absorbed : gives the covariance (n, n) of errors of z that the fit largely absorbs, so that residuals do not show
    them
    """

    name: str
    t_s: Array
    X: Array
    z: Array
    CL: Array
    absorbed: Callable[[], Array] | None = None


@dataclass(frozen=True)
class TimeSeriesRegression:
    """Runs, sample by sample, with colored residuals."""

    runs: Sequence[RunRegression]

    @property
    def CL(self) -> Array:
        return np.concatenate([run.CL for run in self.runs])

    def coefficients(self) -> Array:
        """A (3,) by least squares."""
        X, z = np.concatenate([run.X for run in self.runs]), np.concatenate([run.z for run in self.runs])
        scale = np.sqrt(np.mean(X**2, axis=0))
        A, *_ = np.linalg.lstsq(X / scale, z, rcond=None)
        return np.asarray(A / scale)

    def noise_covariance(self) -> Array:
        """Covariance (3, 3) of A by colored residuals, and by errors that the fit absorbs."""
        start = dict(zip(COEFFICIENTS, self.coefficients().tolist(), strict=True))
        segments = [
            Segment(
                name=f"{i} {run.name}", t_s=run.t_s, u=dict(zip(POLAR_FIT.inputs, run.X.T, strict=True)), z={"z": run.z}
            )
            for i, run in enumerate(self.runs)
        ]
        C = covariance.of_noise(fit_output_error(POLAR_FIT, segments, start=start))
        gain = np.linalg.inv(sum(run.X.T @ run.X for run in self.runs))
        return C + sum(gain @ run.X.T @ run.absorbed() @ run.X @ gain for run in self.runs if run.absorbed is not None)


@dataclass(frozen=True)
class PointRegression:
    """Points X (n, 3), z (n,) with standard errors sigma (n,); `terms` (3, k) are the columns of A that are fitted."""

    X: Array
    z: Array
    sigma: Array
    terms: Array
    CL: Array

    def _weighted_fit(self) -> tuple[Array, Array, Array]:
        """Regressors and observations over their standard errors, and the fitted terms (k,)."""
        X, z = (self.X @ self.terms) / self.sigma[:, None], self.z / self.sigma
        theta, *_ = np.linalg.lstsq(X, z, rcond=None)
        return X, z, np.asarray(theta, dtype=float)

    def coefficients(self) -> Array:
        """A (3,) by weighted least squares."""
        _, _, theta = self._weighted_fit()
        return np.asarray(self.terms @ theta)

    def noise_covariance(self) -> Array:
        """Covariance (3, 3) of A: by the points' standard errors, or by their scatter about the fit if that is larger.

        The scatter of few points is uncertain itself. The covariance by scatter is enlarged by (t / 1.96)^2 with
        Student's t, so that estimate +- 1.96 standard errors is a 95 % interval for any number of points.
        """
        X, z, theta = self._weighted_fit()
        dof = len(z) - X.shape[1]
        scatter = float(np.sum((z - X @ theta) ** 2)) / dof if dof > 0 else 0.0
        student = (special.stdtrit(dof, 0.975) / NORMAL_95) ** 2 if dof > 0 else 1.0
        C = np.linalg.inv(X.T @ X) * max(1.0, scatter * student)
        return np.asarray(self.terms @ C @ self.terms.T)
