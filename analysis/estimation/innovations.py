"""The likelihood of the innovations of a Kalman filter, with its gradient and Fisher information."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.estimation.fit import SegmentFit
from flightpower.analysis.estimation.integration import Record, Response
from flightpower.analysis.estimation.kalman_filter import Innovations, KalmanFilter, NoiseLevels
from flightpower.analysis.estimation.model import UnknownKey, UnknownKind
from flightpower.analysis.estimation.noise import NORMAL_95, Whitened
from flightpower.analysis.estimation.optimizer import Evaluation, nowhere
from flightpower.analysis.estimation.problem import Problem
from flightpower.analysis.estimation.process_noise import ProcessNoise, intensity_key, noise_key
from flightpower.analysis.estimation.settings import FILTER_ERROR
from flightpower.flight.arrays import Array


@dataclass(frozen=True)
class InnovationsLikelihood:
    """Likelihood of the innovations. fixed : ln w and ln v that are not among the unknowns."""

    problem: Problem
    filter: KalmanFilter
    noises: tuple[ProcessNoise, ...]
    fixed: dict[UnknownKey, float]

    @property
    def intensities(self) -> list[UnknownKey]:
        """The free intensities."""
        return [key for key in self.problem.keys if key.kind is UnknownKind.PROCESS_NOISE]

    def index(self, key: UnknownKey) -> int:
        return self.problem.keys.index(key)

    def holding(self, values: Mapping[UnknownKey, float], theta: Array) -> tuple["InnovationsLikelihood", Array]:
        """The likelihood with some ln w and ln v fixed at `values`, and theta without them."""
        keep = np.array([key not in values for key in self.problem.keys])
        return replace(self, problem=self.problem.without(keep), fixed=self.fixed | dict(values)), theta[keep]

    def negligible(self, point: Evaluation) -> list[UnknownKey]:
        """Noises without a prior that are at their lower bound, or that hardly change the variances of the innovations
        and lower the likelihood as they grow.

        A noise that the data determine only to a factor of exp(10) has no effect on the innovations.
        """
        problem, information = self.problem, np.diag(point.information)
        return [
            key
            for i, key in enumerate(problem.keys)
            if key.is_noise
            and problem.prior_information[i] == 0
            and (
                point.theta[i] <= problem.lower[i]
                or (point.gradient[i] < 0 and information[i] < FILTER_ERROR.negligible)
            )
        ]

    def expected_gain(self, point: Evaluation) -> float:
        """Expected decrease of the cost in a step with the information matrix."""
        H = point.information + self.problem.prior_matrix
        return float(point.gradient @ np.linalg.lstsq(H, point.gradient, rcond=None)[0]) / 2

    def doubtful(self, point: Evaluation, tried: Mapping[UnknownKey, float]) -> list[UnknownKey]:
        """Intensities near the optimum that are not significant, the least certain first.

        tried : intensities tried before, with the information about ln w at that time; they are tried again when it has
        fallen
        The intensity squared, divided by its standard error, is half the root of the information about ln w.
        """
        problem, information = self.problem, np.diag(point.information)
        insignificant = [
            i
            for i, key in enumerate(problem.keys)
            if key.kind is UnknownKind.PROCESS_NOISE
            and information[i] < FILTER_ERROR.tried_again * tried.get(key, np.inf)
            and problem.prior_information[i] == 0
            and information[i] < 4 * NORMAL_95**2
        ]
        if not insignificant or self.expected_gain(point) > FILTER_ERROR.near_gain:
            return []
        return [problem.keys[i] for i in sorted(insignificant, key=lambda i: information[i])]

    def filtered(self, theta: Array, i: int) -> tuple[Innovations, Array]:
        """Segment i's innovations, with derivatives for the unknowns of this segment only; and ln v (outputs,)."""
        problem = self.problem
        p, x0, free_noise = problem.unpack(theta, i)
        keys = [intensity_key(noise.state) for noise in self.noises]
        keys += [noise_key(output) for output in problem.model.outputs]
        free = [k for k, key in enumerate(keys) if key not in self.fixed]
        ln_noise = np.array([self.fixed.get(key, np.nan) for key in keys])
        ln_noise[free] = free_noise
        ln_w, ln_v = np.split(ln_noise, [len(self.noises)])
        active_before_s = np.array([noise.active_before_s for noise in self.noises])
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            record = Record(x0, problem.U[i], p, problem.segments[i].step_s)
            innovations = self.filter.run(record, problem.Z[i], NoiseLevels(ln_w, ln_v, active_before_s))
        count = len(self.filter.free)
        own = np.concatenate(
            [np.arange(count), count + len(keys) + problem.free_states, count + np.array(free, dtype=int)]
        )
        return innovations._replace(d_e=innovations.d_e[:, :, own], d_ln_s=innovations.d_ln_s[:, :, own]), ln_v

    def curvature(self, point: Evaluation) -> Array:
        """(m, m) Hessian of the data's part of the cost, second derivatives of the innovations and ln s neglected.

        With u = e/sigma, S = -e'/sigma and l = (ln s)', it is the sum of S S' + u (S l' + l S') + u^2 l l'/2; the
        information is its expected value.
        """
        return point.information if point.observed is None else point.observed

    def evaluate(self, theta: Array) -> Evaluation:
        problem, m = self.problem, len(theta)
        g, H, of_variances, cost = np.zeros(m), np.zeros((m, m)), np.zeros((m, m)), 0.0
        observed = np.zeros((m, m))
        segment_fits = []
        for i, segment in enumerate(problem.segments):
            innovations, ln_v = self.filtered(theta, i)
            present = np.isfinite(problem.Z[i])
            if not (_finite(innovations, present) and np.isfinite(innovations.x).all()):
                return nowhere(theta)
            own = problem.columns[i]
            sigma = np.where(present, np.exp(innovations.ln_s / 2), 1.0)
            e = np.where(present, innovations.e / sigma, 0.0)
            S = np.where(present[:, :, None], -innovations.d_e / sigma[:, :, None], 0.0)
            d_ln_s = np.where(present[:, :, None], innovations.d_ln_s, 0.0).reshape(-1, len(own))
            flat = S.reshape(-1, len(own))
            with np.errstate(over="ignore", invalid="ignore"):
                cost += float(np.sum(e**2) + np.sum(innovations.ln_s[present])) / 2
                g[own] += flat.T @ e.ravel() + d_ln_s.T @ (e.ravel() ** 2 - 1) / 2
                # A normal variable with mean mu and variance s has the information mu'^2/s + (ln s)'^2/2.
                variance_part = d_ln_s.T @ d_ln_s / 2
                H[np.ix_(own, own)] += flat.T @ flat + variance_part
                of_variances[np.ix_(own, own)] += variance_part
                weighted = d_ln_s * e.reshape(-1, 1)
                mixed = flat.T @ weighted
                observed[np.ix_(own, own)] += flat.T @ flat + mixed + mixed.T + weighted.T @ weighted / 2
            if not (np.isfinite(cost) and np.isfinite(g).all() and np.isfinite(H).all()):
                return nowhere(theta)
            residuals = np.where(present, innovations.e, np.nan)
            white = Whitened(e, np.ones_like(e), S, present)
            response = Response(innovations.x, innovations.y, -innovations.d_e)
            segment_fits.append(SegmentFit(segment, response, residuals, white, own))
        cost += problem.prior_cost(theta)
        g -= problem.prior_gradient(theta)
        return Evaluation(
            theta, cost, tuple(segment_fits), np.diag(np.exp(2 * ln_v)), g, H, of_variances, observed=observed
        )


def _finite(innovations: Innovations, present: NDArray[np.bool_]) -> bool:
    return all(
        np.isfinite(values[present]).all()
        for values in (innovations.e, innovations.ln_s, innovations.d_e, innovations.d_ln_s)
    )


def not_finite(likelihood: InnovationsLikelihood) -> str:
    """The message that names the segment and time from which the filter is not finite with the starting values."""
    problem = likelihood.problem
    for i, segment in enumerate(problem.segments):
        x = likelihood.filtered(problem.start, i)[0].x
        finite = np.isfinite(x).all(axis=1)
        if not finite.all():
            return (
                f"model {problem.model.name}, segment {segment.name}: with the starting values the filter is not finite"
                f" from t = {segment.t_s[int(np.argmin(finite))]:g} s on; give better starting values"
            )
    return (
        f"model {problem.model.name}: with the starting values the likelihood is not finite;"
        " give better starting values"
    )
