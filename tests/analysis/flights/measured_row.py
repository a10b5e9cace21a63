"""Synthetic flights whose rows have the sizes of flights that were simulated and analyzed (measured_row.json).

The model is that of the joint estimate (`analysis.flights.joint`): the first step estimates the errors of the
installation, the second drag and thrust for these. The information of each step and the scatter of its residuals follow
from the covariances of the measured row, as in a pool.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.curve import POLAR
from flightpower.analysis.flights.flight_statistics import INSTALLATION_ERRORS, POOLED, FlightStatistics, M
from flightpower.analysis.flights.joint import OWN_CHANGES
from flightpower.analysis.methods import consider as covariance

Array = NDArray[np.float64]

FILE = Path(__file__).with_name("measured_row.json")
R = M - len(INSTALLATION_ERRORS)  # parameters of the second step: drag and thrust


class MeasuredRow(NamedTuple):
    """The mean of rows: arrays (M, M), (R, R), (M,) in the order of POOLED; `changes` (M,) are by error."""

    covariance: Array
    weighting_covariance: Array
    prior_sigma: Array
    prior_mean: Array
    changes: dict[str, Array]
    flown_CL: tuple[float, float]


def mean_row(flights: Sequence[FlightStatistics]) -> MeasuredRow:
    """Return the mean row of flights. Raises ValueError if the flights have two priors, which no mean describes."""
    first = flights[0]
    if any((statistics.prior_matrix != first.prior_matrix).any() for statistics in flights):
        raise ValueError("flights of two priors")
    with np.errstate(divide="ignore"):
        sigma = first.prior_information**-0.5
    return MeasuredRow(
        np.mean([statistics.parameters.own for statistics in flights], axis=0),
        np.mean([statistics.weighting_covariance for statistics in flights], axis=0),
        sigma,
        first.prior_mean,
        {
            name: np.mean([statistics.parameters.shared[name] for statistics in flights], axis=0)
            for name in first.parameters.shared
        },
        (
            float(np.mean([statistics.flown_CL[0] for statistics in flights])),
            float(np.mean([statistics.flown_CL[1] for statistics in flights])),
        ),
    )


def written(row: MeasuredRow, command: str) -> str:
    """The text of measured_row.json; `command` is the command that produced it."""

    def numbers(values: Array) -> list[Any]:
        return [float(f"{x:.5g}") if np.isfinite(x) else None for x in values.tolist()]

    content = {
        "command": command,
        "names": list(POOLED),
        "covariance": [numbers(item[: i + 1]) for i, item in enumerate(row.covariance)],
        "weighting_covariance": [numbers(item[: i + 1]) for i, item in enumerate(row.weighting_covariance)],
        "prior_sigma": numbers(row.prior_sigma),
        "prior_mean": numbers(row.prior_mean),
        "changes": {name: numbers(change) for name, change in row.changes.items()},
        "flown_CL": numbers(np.array(row.flown_CL)),
    }
    lines = ",\n".join(f" {json.dumps(name)}: {json.dumps(value)}" for name, value in content.items())
    return "{\n" + lines + "\n}\n"


def measured_row() -> MeasuredRow:
    """The row stored in measured_row.json."""
    content = json.loads(FILE.read_text("utf-8"))
    assert content["names"] == list(POOLED), "measured_row.json is of an earlier version; benchmarks/fleet.py generator"
    return MeasuredRow(
        _symmetric(content["covariance"]),
        _symmetric(content["weighting_covariance"]),
        np.array([np.inf if x is None else x for x in content["prior_sigma"]]),
        np.array(content["prior_mean"]),
        {name: np.array(change) for name, change in content["changes"].items()},
        tuple(content["flown_CL"]),
    )


def _symmetric(lower_triangle: list[list[float]]) -> Array:
    lower = np.zeros((len(lower_triangle), len(lower_triangle)))
    for i, row in enumerate(lower_triangle):
        lower[i, : i + 1] = row
    return np.asarray(lower + np.tril(lower, -1).T)


class RowModel:
    """Draws flights like a measured one; `noise` multiplies the standard deviations that come from the data."""

    def __init__(self, row: MeasuredRow, noise: float = 1.0):
        self.row = row
        s, r = slice(R, M), slice(R)
        self.P = np.diag(row.prior_sigma**-2.0)
        S, D = row.covariance, row.weighting_covariance
        slope = np.linalg.solve(S[s, s], S[s, r]).T
        by_errors = np.linalg.solve(D, slope)
        first = _positive(np.linalg.inv(S[s, s]) - self.P[s, s])
        second = _positive(np.linalg.inv(D) - self.P[r, r])
        scatter = _positive(np.linalg.solve(D, np.linalg.solve(D, S[r, r] - slope @ S[s, r]).T) - self.P[r, r])
        self.first, self.second, scatter, self.by_errors = (
            item / noise**2 for item in (first, second, scatter, by_errors)
        )
        self.first_root, self.scatter_root = _root(self.first), _root(scatter)
        self.C_first = np.linalg.inv(self.first + self.P[s, s])
        self.D = np.linalg.inv(self.second + self.P[r, r])
        slope = self.D @ self.by_errors
        C_second = self.D @ (scatter + self.P[r, r]) @ self.D + slope @ self.C_first @ slope.T
        self.S = np.block([[C_second, slope @ self.C_first], [self.C_first @ slope.T, self.C_first]])
        self.S = (self.S + self.S.T) / 2

    def truth(self, rng: np.random.Generator, polar: Array) -> Array:
        """Shared parameters (M,), drawn from their priors."""
        n = len(POLAR)
        nuisance = self.row.prior_mean[n:] + self.row.prior_sigma[n:] * rng.standard_normal(M - n)
        return np.concatenate([polar, nuisance])

    def shared_errors(self, rng: np.random.Generator) -> Array:
        """Errors (M,) common to all flights of an airframe, which no residual shows, including the floor of the
        polar."""
        changes = [change for name, change in self.row.changes.items() if name not in OWN_CHANGES]
        n = len(POLAR)
        tilted = np.concatenate([np.sqrt(np.diag(covariance.floor())) * rng.standard_normal(n), np.zeros(M - n)])
        return np.asarray(sum((rng.standard_normal() * change for change in changes), tilted))

    def pooling(self, x: Array, shared: Array, rng: np.random.Generator) -> dict[str, Any]:
        """New values for the fields of `pooling` in a flight's results; `shared` is the result of `shared_errors`."""
        s, r = slice(R, M), slice(R)
        vector = self.P @ self.row.prior_mean
        first_root = self.first @ x[s] + self.first_root @ rng.standard_normal(M - R)
        errors = self.C_first @ (first_root + vector[s])
        first_root = self.second @ x[r] + self.by_errors @ (errors - x[s]) + self.scatter_root @ rng.standard_normal(R)
        values = np.concatenate([self.D @ (first_root + vector[r]), errors]) + shared
        for name, change in self.row.changes.items():
            if name in OWN_CHANGES:
                values = values + rng.standard_normal() * change
        n = len(POLAR)
        total = self.S[:n, :n] + covariance.floor()
        total = total + sum(np.outer(change[:n], change[:n]) for change in self.row.changes.values())
        return {
            "names": list(POOLED),
            "values": values.tolist(),
            "covariance": [row[: i + 1] for i, row in enumerate(self.S.tolist())],
            "weighting_covariance": [row[: i + 1] for i, row in enumerate(self.D.tolist())],
            "prior_mean": self.row.prior_mean.tolist(),
            "prior_sigma": [item if np.isfinite(item) else None for item in self.row.prior_sigma.tolist()],
            "changes": {name: change.tolist() for name, change in self.row.changes.items()},
            "polar_covariance": total.tolist(),
            "flown_CL": list(self.row.flown_CL),
        }


def _positive(A: Array) -> Array:
    """The nearest matrix without negative eigenvalues in units of its diagonal, since rounding of the row can cause
    them."""
    scale = np.sqrt(np.abs(np.diag(A)))
    own, vectors = np.linalg.eigh((A + A.T) / 2 / np.outer(scale, scale))
    return np.asarray((vectors * np.maximum(own, 0.0)) @ vectors.T * np.outer(scale, scale))


def _root(A: Array) -> Array:
    scale = np.sqrt(np.diag(A))
    own, vectors = np.linalg.eigh(A / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(own, 0.0)))
