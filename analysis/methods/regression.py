"""Linear least squares for a drag polar (2.18) from time series or steady points, and its covariance due to noise."""

from collections.abc import Callable, Mapping, Sequence
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


@dataclass(frozen=True)
class Tables:
    """Tables with the same rows, for the analysis of one flight with different errors: times t_s (n,) and columns.

    columns : by name, (k, n) for k tables, or (n,) if the column is the same in all tables
    """

    t_s: Array
    columns: Mapping[str, Array]

    def first(self) -> "Tables":
        """The first table alone, with columns (n,)."""
        return Tables(self.t_s, {name: column.reshape(-1, len(self.t_s))[0] for name, column in self.columns.items()})


def rows_of(t_s: Array, run: Maneuver) -> slice:
    """The rows of a run in a table with the times t_s (n,)."""
    return slice(*np.searchsorted(t_s, (run.start_s, np.nextafter(run.end_s, np.inf))))


class RunData(NamedTuple):
    """A run, its times (n,) [s], and the table's columns over the run by name, each (n,), or (k, n) for k tables."""

    run: Maneuver
    t_s: Array
    columns: dict[str, Array]


def run_data(tables: Tables, runs: list[Maneuver], columns: tuple[str, ...]) -> list[RunData]:
    """The columns over each run, with gaps interpolated. Raises InputError when no run has all columns."""
    t, run_data = tables.t_s, []
    for run in runs:
        rows = rows_of(t, run)
        data = [_interpolated(tables.columns[name][..., rows]) for name in columns]
        if len(t[rows]) >= REGRESSION.fewest_blocks and all(np.isfinite(column).all() for column in data):
            run_data.append(RunData(run, t[rows], dict(zip(columns, data, strict=True))))
    if not run_data:
        raise InputError("no run has all the required data")
    return run_data


def _interpolated(values: Array) -> Array:
    """Values (…, n) with gaps along the last axis filled."""
    if np.isfinite(values).all():
        return values
    rows = pd.DataFrame(values.reshape(-1, values.shape[-1]).T).interpolate(limit_direction="both")
    return np.asarray(rows.to_numpy().T.reshape(values.shape))


def least_squares(X: Array, z: Array) -> Array:
    """The least-squares solution A (…, m) of X (…, n, m) A = z (…, n); the smallest one if there are several."""
    scale = np.sqrt(np.mean(X**2, axis=-2))
    columns = np.concatenate([X / scale[..., None, :], z[..., None]], axis=-1)
    R, m = np.asarray(np.linalg.qr(columns, mode="r")), X.shape[-1]
    solved = np.linalg.pinv(R[..., :m], rcond=X.shape[-2] * np.finfo(float).eps) @ R[..., m:]
    return np.asarray(solved[..., 0] / scale)


COEFFICIENTS = ("A0", "A1", "A2")
THREE_TERM: Array = np.eye(len(COEFFICIENTS))
TWO_TERM: Array = THREE_TERM[:, [0, 2]]  # A1 = 0: least drag at zero lift
# The regression as a model, for the covariance due to colored residuals; it is compiled once for all methods.
POLAR_FIT = Model(
    name="polar",
    inputs=("X0", "X1", "X2"),
    outputs=("z",),
    output_function=lambda _, u, p: (p.A0 * u.X0 + p.A1 * u.X1 + p.A2 * u.X2,),
    parameters=tuple(Parameter(name=name, start=0.0) for name in COEFFICIENTS),
)


class PolarRegression(Protocol):
    """A linear problem for the polar's A (3,), from data at lift coefficients CL (n,); or k such problems at once.

    Only a single problem gives the covariance due to noise.
    """

    @property
    def CL(self) -> Array: ...
    def coefficients(self) -> Array: ...
    def noise_covariance(self) -> Array: ...


class RunRegression(NamedTuple):
    """One run: X (n, 3) A = z (n,), at times t_s (n,), flown at lift coefficients CL (n,). For k tables, each array
    except t_s has a first axis (k,).

    absorbed : function that gives the covariance (n, n) of those errors of z that the fit largely absorbs, so that
        residuals do not show them
    """

    name: str
    t_s: Array
    X: Array
    z: Array
    CL: Array
    absorbed: Callable[[], Array] | None = None


@dataclass(frozen=True)
class TimeSeriesRegression:
    """A regression on all samples of runs, with colored residuals."""

    runs: Sequence[RunRegression]

    @property
    def CL(self) -> Array:
        return np.concatenate([run.CL for run in self.runs], axis=-1)

    def coefficients(self) -> Array:
        """A (3,) or (k, 3) by least squares."""
        X = np.concatenate([run.X for run in self.runs], axis=-2)
        return least_squares(X, np.concatenate([run.z for run in self.runs], axis=-1))

    def noise_covariance(self) -> Array:
        """Covariance (3, 3) of A due to colored residuals and to errors that the fit absorbs."""
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
    """A regression on points X (n, 3), z (n,) with standard errors sigma (n,); for k tables each has a first axis (k,).

    terms : (3, m) the columns of A that are fitted
    """

    X: Array
    z: Array
    sigma: Array
    terms: Array
    CL: Array

    def _weighted_fit(self) -> tuple[Array, Array, Array]:
        """Regressors and observations over their standard errors, and the fitted terms (m,)."""
        X, z = (self.X @ self.terms) / self.sigma[..., None], self.z / self.sigma
        return X, z, least_squares(X, z)

    def coefficients(self) -> Array:
        """A (3,) or (k, 3) by weighted least squares."""
        _, _, theta = self._weighted_fit()
        return np.asarray(theta @ self.terms.T)

    def noise_covariance(self) -> Array:
        """Covariance (3, 3) of A from the points' standard errors, or from their scatter about the fit if larger.

        The scatter of few points is uncertain itself. So the covariance from scatter is enlarged by (t / 1.96)^2 with
        Student's t, which makes estimate +- 1.96 standard errors a 95 % interval for any number of points.
        """
        X, z, theta = self._weighted_fit()
        dof = len(z) - X.shape[1]
        scatter = float(np.sum((z - X @ theta) ** 2)) / dof if dof > 0 else 0.0
        student = (special.stdtrit(dof, 0.975) / NORMAL_95) ** 2 if dof > 0 else 1.0
        C = np.linalg.inv(X.T @ X) * max(1.0, scatter * student)
        return np.asarray(self.terms @ C @ self.terms.T)
