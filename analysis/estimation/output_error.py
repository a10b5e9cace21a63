"""Maximum likelihood by output error (3.24-3.34): Gauss-Newton with exact sensitivities.

The noise covariance R is re-estimated from the residuals at every point. The likelihood is then a function of the
parameters alone (the concentrated likelihood), and its gradient is the gradient with R held constant. Each step must
increase this likelihood, so that the usual oscillation between R and the parameters cannot occur.

For long records, information and gradient are summed block by block without keeping sensitivities. With a diagonal R
both are sums over the outputs, each divided by the output's variance: one pass over the record gives the sums, and R
follows from the residuals afterwards.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from flightpower.analysis.estimation.data import Band, Segment, band_matrix, split
from flightpower.analysis.estimation.fit import Finding, Fit, Remark, SegmentFit
from flightpower.analysis.estimation.hints import hints_of
from flightpower.analysis.estimation.integration import SAMPLES, Record, Response
from flightpower.analysis.estimation.model import Model
from flightpower.analysis.estimation.noise import (
    NoiseKind,
    information_factor,
    negative_log_likelihood,
    noise_covariance_of,
    whiten,
)
from flightpower.analysis.estimation.optimizer import Evaluation, Stop, make_fit, maximize, nowhere
from flightpower.analysis.estimation.problem import FitOptions, Problem, as_segments, free_names
from flightpower.analysis.estimation.settings import SEARCH, VERDICT
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

if TYPE_CHECKING:
    from flightpower.analysis.estimation.simulation import Simulator


BLOCK = SAMPLES


@dataclass(frozen=True)
class Sums:
    """Sums over the samples of one segment, for each output.

    y : (n, outputs) response     residuals : (n, outputs) z - y, NaN where missing
    gram : (outputs, unknowns, unknowns) of S_i S_j     product : (outputs, unknowns) of S_i times the residual
    """

    y: Array
    residuals: Array
    gram: Array
    product: Array


def responses_in_blocks(simulator: "Simulator", records: Iterable[Record]) -> Iterator[Iterable[Response]]:
    """The blocks of each record's response; short records are computed together."""
    block: list[Record] = []
    for record in records:
        if block and sum(len(short.U) for short in block) + len(record.U) > BLOCK:
            yield from ([response] for response in simulator.run_all(block))
            block = []
        if len(record.U) > BLOCK:
            yield simulator.run_in_blocks(*record, BLOCK)
        else:
            block.append(record)
    if block:
        yield from ([response] for response in simulator.run_all(block))


def summed(blocks: Iterable[Response], Z: Array, columns: NDArray[np.intp]) -> Sums | None:
    """The sums over a record; None if the response is not finite. columns : unknowns among the simulator's."""
    y, residuals = np.empty_like(Z), np.empty_like(Z)
    gram, product = np.zeros((Z.shape[1], len(columns), len(columns))), np.zeros((Z.shape[1], len(columns)))
    first = 0
    for block in blocks:
        if not (np.isfinite(block.y).all() and np.isfinite(block.S).all()):
            return None
        rows = slice(first, first + len(block.y))
        first = rows.stop
        y[rows] = block.y
        residuals[rows] = Z[rows] - block.y
        e = np.nan_to_num(residuals[rows])
        present = np.isfinite(residuals[rows])
        for i in range(Z.shape[1]):
            S = np.ascontiguousarray(block.S[:, i, columns]) * present[:, i, None]
            gram[i] += S.T @ S
            product[i] += S.T @ e[:, i]
    return Sums(y, residuals, gram, product)


@dataclass(frozen=True, kw_only=True)
class MeasurementNoise:
    """What is known about the noise of the outputs.

    structure : structure of R (outputs, outputs) if R is estimated, "diagonal" or "full"
    covariance : known R (outputs, outputs), or known variances (outputs,); default: R is estimated
    tail_dof : degrees of freedom of t noise (about 4) for data with outliers; for an estimated diagonal R only

    Raises InputError for a `tail_dof` with another R, or not greater than zero.
    """

    structure: NoiseKind = "diagonal"
    covariance: ArrayLike | None = None
    tail_dof: float | None = None

    def __post_init__(self) -> None:
        if self.tail_dof is not None and (
            self.structure == "full" or self.covariance is not None or self.tail_dof <= 0
        ):
            raise InputError(
                "tail_dof must be greater than zero, and needs a diagonal noise covariance that is estimated"
            )


def fit_output_error(
    model: Model,
    segments: Segment | Sequence[Segment],
    *,
    start: Mapping[str, float] | None = None,
    noise: MeasurementNoise = MeasurementNoise(),
    band_Hz: Band | None = None,
    options: FitOptions = FitOptions(),
) -> Fit:
    """Fit a model to one or several segments together.

    start : starting values by name or full name; they replace those of the parameters
    band_Hz : lowest and highest frequency of the residuals that are used; default: all. The likelihood is then that of
    the Fourier transforms of z - y (see `data.band_matrix`), in which biases have no part and must be fixed. Of the
    functions of `uncertainty`, those for colored residuals do not apply.

    The verdict says whether the optimum was reached, is at a bound, or leaves unknowns undetermined; its hints name
    residuals that are not white and unstable motion. If the fit is not convincing, a second one starts from a fit of
    the records cut in pieces, over which the response cannot slip a cycle or diverge (multiple shooting). If its
    optimum is better, it is returned with a remark. Raises InputError for data or options that cannot be used, and
    when the response to the starting values is not finite.
    """
    segments = as_segments(segments)
    first = _fit_from(model, segments, start or {}, noise, band_Hz, options)
    if band_Hz is not None or (first.verdict.ok and not first.verdict.hints):
        return first
    if {hint.finding for hint in first.verdict.hints} == {Finding.NOT_WHITE} and first.verdict.ok:
        # Most often the model lacks something and the optimum is the same: no more iterations than the first fit took.
        options = replace(options, max_iterations=first.iterations)
    again = _second_start(model, segments, start or {}, noise, options)
    if again is None or not again.verdict.ok:
        return first
    gain = first.negative_log_likelihood - again.negative_log_likelihood
    if first.verdict.ok and gain < VERDICT.same_optimum:
        return first
    text = "reached from the record cut in pieces; the given start leads to a worse end"
    return replace(again, verdict=again.verdict.with_remarks(Remark(Finding.REACHED_FROM_PIECES, text)))


def _second_start(
    model: Model,
    segments: tuple[Segment, ...],
    start: Mapping[str, float],
    noise: MeasurementNoise,
    options: FitOptions,
) -> Fit | None:
    """The fit started from estimates of the records cut in pieces; None where there are no pieces, and if it fails.

    In each piece the response starts again, at a state that is estimated. Reference: Bock, Recent advances in parameter
    identification techniques for O.D.E., 1983.
    """
    parts = [min(SEARCH.pieces, len(segment) // SEARCH.shortest_piece) for segment in segments]
    shared = {q.name for q in model.parameters if q.free and q.shared}
    if not (options.second_start and model.states and shared) or max(parts, default=0) < 2:
        return None
    cut = tuple(
        piece for segment, count in zip(segments, parts, strict=True) for piece in split(segment, max(1, count))
    )
    once = replace(options, second_start=False)
    try:
        pieces = _fit_from(
            model, cut, {name: value for name, value in start.items() if name in shared}, noise, None,
            replace(once, initial_states="free"),
        )  # fmt: skip
        estimates = {name: pieces.parameters[name].value for name in shared}
        return _fit_from(model, segments, {**start, **estimates}, noise, None, once)
    except InputError:  # a state without a starting value in each piece, or a response that is not finite
        return None


def _fit_from(
    model: Model,
    segments: tuple[Segment, ...],
    start: Mapping[str, float],
    noise: MeasurementNoise,
    band_Hz: Band | None,
    options: FitOptions,
) -> Fit:
    """The fit from one start. Arguments and errors as for `fit_output_error`."""
    from flightpower.analysis.estimation.simulation import build_simulator  # imports CasADi, which only a fit needs

    simulator = build_simulator(model, free_names(model), options.integrator, options.inputs)
    problem = Problem.assemble(model, segments, options.initial_states, start)
    noise_covariance = None if noise.covariance is None else _known_covariance(noise.covariance, model)
    transforms = None if band_Hz is None else [_band_matrix(model, segment, band_Hz) for segment in segments]
    likelihood = OutputErrorLikelihood(
        problem, simulator, noise.structure, noise_covariance, noise.tail_dof, transforms
    )
    point = likelihood.evaluate(problem.start)
    if not np.isfinite(point.cost):
        raise InputError(_not_finite(likelihood))
    point, iterations, stop = maximize(likelihood, point, options.max_iterations)
    if likelihood.is_long:
        point = likelihood.evaluate_whole(point.theta)._replace(costs=point.costs, steps=point.steps)
    fit = make_fit(likelihood, point, iterations, stop)
    verdict = fit.verdict
    if stop is Stop.NO_BETTER_STEP and simulator.has_branches:
        verdict = verdict.with_remarks(
            Remark(
                Finding.MODEL_HAS_BRANCHES,
                "the model has branches (np.where, np.sign, np.maximum), where the likelihood may jump: smooth them,"
                " for example with np.tanh",
            )
        )
    if band_Hz is None:
        verdict = verdict._replace(hints=hints_of(fit))
    return replace(fit, verdict=verdict, integrator=options.integrator, inputs=options.inputs)


def _band_matrix(model: Model, segment: Segment, band_Hz: Band) -> Array:
    for name in model.outputs:
        if name in segment.z and not np.isfinite(segment.z[name]).all():
            raise InputError(
                f"segment {segment.name}: output {name} has missing samples; the frequency domain needs all of them"
            )
    return band_matrix(band_Hz, len(segment), segment.step_s)


def _known_covariance(covariance: ArrayLike, model: Model) -> Array:
    R = np.asarray(covariance, dtype=float)
    R = np.diag(R) if R.ndim == 1 else R
    m = len(model.outputs)
    if R.shape != (m, m) or not np.allclose(R, R.T) or np.linalg.eigvalsh(R)[0] <= 0:
        raise InputError(f"noise_covariance must be a positive definite ({m}, {m}) matrix, or {m} variances")
    return R


@dataclass(frozen=True)
class OutputErrorLikelihood:
    """Likelihood of the residuals z - y. known_R : (outputs, outputs), or None to estimate R.

    transforms : per segment a matrix (k, n) that multiplies residuals and sensitivities; None leaves them as they are
    """

    problem: Problem
    simulator: "Simulator"
    noise: NoiseKind = "diagonal"
    known_R: Array | None = None
    tail_dof: float | None = None
    transforms: list[Array] | None = None
    LARGEST_KEPT: ClassVar[int] = 1_000_000  # elements of the sensitivities that iterations keep (8 MB)

    def responses(self, theta: Array) -> list[Response]:
        """Responses of all segments, each with sensitivities to its own unknowns only."""
        problem, count = self.problem, len(self.simulator.free)
        responses = self.simulator.run_all(self._records(theta))
        if len(problem.free_states) == len(problem.model.states):
            return responses
        columns = np.concatenate([np.arange(count), count + problem.free_states])
        return [response._replace(S=response.S[:, :, columns]) for response in responses]

    def _records(self, theta: Array) -> list[Record]:
        problem, records = self.problem, []
        for i, segment in enumerate(problem.segments):
            p, x0, _ = problem.unpack(theta, i)
            records.append(Record(x0, problem.U[i], p, segment.step_s))
        return records

    @property
    def is_long(self) -> bool:
        """Whether iterations do not keep the sensitivities. They can do without only if a diagonal R is estimated."""
        elements = sum(Z.size * len(own) for Z, own in zip(self.problem.Z, self.problem.columns, strict=True))
        plain = self.noise == "diagonal" and self.known_R is None and self.tail_dof is None
        return plain and self.transforms is None and elements > self.LARGEST_KEPT

    def evaluate_in_blocks(self, theta: Array) -> Evaluation:
        """`evaluate` for an estimated diagonal R, without sensitivities in the segment fits."""
        problem, m = self.problem, len(theta)
        columns = np.concatenate([np.arange(len(self.simulator.free)), len(self.simulator.free) + problem.free_states])
        sums = []
        for blocks, Z in zip(responses_in_blocks(self.simulator, self._records(theta)), problem.Z, strict=True):
            with np.errstate(over="ignore", invalid="ignore"):
                of_segment = summed(blocks, Z, columns)
            if of_segment is None:
                return nowhere(theta)
            sums.append(of_segment)
        R = self._covariance([of_segment.residuals for of_segment in sums])
        if not np.isfinite(R).all():
            return nowhere(theta)
        variance = np.diag(R)
        g, H, products, cost = np.zeros(m), np.zeros((m, m)), np.zeros((len(variance), m)), 0.0
        segment_fits = []
        for of_segment, segment, own in zip(sums, problem.segments, problem.columns, strict=True):
            white = whiten(of_segment.residuals, np.zeros((*of_segment.residuals.shape, 0)), R, None)
            cost += negative_log_likelihood(white, R, None)
            products[:, own] += of_segment.product / variance[:, None]
            H[np.ix_(own, own)] += np.tensordot(1 / variance, of_segment.gram, axes=1)
            response = Response(np.zeros((len(segment), 0)), of_segment.y, white.S)
            segment_fits.append(SegmentFit(segment, response, of_segment.residuals, white, own))
        g += products.sum(axis=0)
        cost += problem.prior_cost(theta)
        g -= problem.prior_gradient(theta)
        ln_det_R = float(np.linalg.slogdet(R)[1])
        return Evaluation(theta, cost, tuple(segment_fits), R, g, H, ln_det_R=ln_det_R, products=products)

    def evaluate(self, theta: Array) -> Evaluation:
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            point = self.evaluate_in_blocks(theta) if self.is_long else self.evaluate_whole(theta)
            finite = np.isfinite(point.cost) and np.isfinite(point.information).all()
        return point if finite else nowhere(theta)

    def evaluate_whole(self, theta: Array) -> Evaluation:
        """The likelihood with the whitened sensitivities of all segments."""
        problem, m = self.problem, len(theta)
        with np.errstate(over="ignore", invalid="ignore"):
            responses = self.responses(theta)
            residuals = [z - response.y for z, response in zip(problem.Z, responses, strict=True)]
        if not all(np.isfinite(r.y).all() and np.isfinite(r.S).all() for r in responses):
            return nowhere(theta)
        used, S = residuals, [response.S for response in responses]
        if self.transforms is not None:
            used = [T @ e for T, e in zip(self.transforms, residuals, strict=True)]
            S = [np.tensordot(T, s, axes=1) for T, s in zip(self.transforms, S, strict=True)]
        R = self._covariance(used)
        if not np.isfinite(R).all():  # the response is so far off that its square overflows
            return nowhere(theta)
        g, H, cost = np.zeros(m), np.zeros((m, m)), 0.0
        segment_fits = []
        for i, response in enumerate(responses):
            white = whiten(used[i], S[i], R, self.tail_dof)
            cost += negative_log_likelihood(white, R, self.tail_dof)
            columns = problem.columns[i]
            flat = white.S.reshape(-1, len(columns))
            g[columns] += flat.T @ (white.weight * white.e).ravel()
            H[np.ix_(columns, columns)] += flat.T @ flat
            segment_fits.append(SegmentFit(problem.segments[i], response, residuals[i], white, columns))
        cost += problem.prior_cost(theta)
        g -= problem.prior_gradient(theta)
        H *= information_factor(self.tail_dof)
        return Evaluation(theta, cost, tuple(segment_fits), R, g, H, ln_det_R=float(np.linalg.slogdet(R)[1]))

    def curvature(self, point: Evaluation) -> Array:
        """(m, m) Hessian of the cost, second derivatives of the response neglected.

        With R re-estimated the cost is N/2 ln det R(theta). Its second derivative is
        N/2 [tr(R^-1 d2R) - tr(R^-1 dR_j R^-1 dR_k)]; the first term is the information matrix.
        """
        if self.known_R is not None or self.tail_dof is not None:
            return point.information
        m = len(point.theta)
        outputs = len(self.problem.model.outputs)
        d_R, samples = np.zeros((outputs, outputs, m)), np.zeros(outputs)
        for fit in point.segment_fits:
            white = fit.white
            rows = white.present.all(axis=1) if self.noise == "full" else slice(None)
            samples += white.present[rows].sum(axis=0)
            if point.products is None:
                product = np.tensordot(white.e[rows], white.S[rows], axes=(0, 0))
                d_R[:, :, fit.columns] += product + product.transpose(1, 0, 2)
        if point.products is not None:
            d_R[np.arange(outputs), np.arange(outputs)] = 2 * point.products
        if self.noise == "diagonal":
            d_R *= np.eye(outputs)[:, :, None]
        d_R /= np.sqrt(2 * np.maximum(samples, 1))[:, None, None]
        flat = d_R.reshape(-1, m)
        return point.information - flat.T @ flat

    def _covariance(self, residuals: list[Array]) -> Array:
        if self.known_R is not None:
            return self.known_R
        return noise_covariance_of(np.concatenate(residuals), self._output_rms, self.noise, self.tail_dof)

    @cached_property
    def _output_rms(self) -> Array:
        """Rms (outputs,) of the measurements, 1 for an output of zeros. Raises InputError for one without samples."""
        measurements = np.concatenate(self.problem.Z)
        for name, measured in zip(self.problem.model.outputs, measurements.T, strict=True):
            if not np.isfinite(measured).any():
                raise InputError(f"output {name} has no samples in any segment; give data or remove the output")
        scale = np.sqrt(np.nanmean(measurements**2, axis=0))
        scale[scale == 0] = 1.0
        return np.asarray(scale)


def _not_finite(likelihood: OutputErrorLikelihood) -> str:
    """The message that names the segment and time from which the response to the starting values is not finite."""
    problem = likelihood.problem
    advice = "give better starting values; if the model is unstable, split the segment (data.split)"
    for segment, response in zip(problem.segments, likelihood.responses(problem.start), strict=True):
        finite = np.isfinite(response.y).all(axis=1) & np.isfinite(response.S).all(axis=(1, 2))
        if not finite.all():
            return (
                f"model {problem.model.name}, segment {segment.name}: with the starting values the response is not"
                f" finite from t = {segment.t_s[int(np.argmin(finite))]:g} s on; {advice}"
            )
    return f"model {problem.model.name}: with the starting values the squares of the residuals are not finite; {advice}"
