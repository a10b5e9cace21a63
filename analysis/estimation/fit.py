"""The result of an estimation: estimates, covariance, residuals, verdict; and its numbers alone, as a table or JSON."""

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.integration import InputRule, Integrator, Response
from flightpower.analysis.estimation.model import Model, NamedValues, UnknownKey, UnknownKind
from flightpower.analysis.estimation.noise import Whitened
from flightpower.analysis.estimation.settings import TESTS, VERDICT
from flightpower.flight.arrays import Array
from flightpower.flight.errors import InputError

FORMAT = "flightpower fit 1"


class SummaryRow(msgspec.Struct, frozen=True):
    """One unknown. standard_error : Cramer-Rao, priors included     corrected : for colored residuals, if computed."""

    name: str
    unit: str
    value: float
    standard_error: float | None
    corrected: float | None = None


class FitSummary(msgspec.Struct, frozen=True):
    """The numbers of a fit.

    rows : one for each of m unknowns     fixed : parameters that were not estimated, by name
    correlation : (m, m)     noise : standard deviations of the residuals by output
    """

    model: str
    status: str
    verdict: str
    iterations: int
    samples: int
    negative_log_likelihood: float
    rows: list[SummaryRow]
    fixed: dict[str, float]
    correlation: list[list[float | None]]
    noise: dict[str, float]
    format: str = FORMAT

    def table(self) -> str:
        """Estimates, standard errors and large correlations as text, 100 columns wide at most."""
        corrected = any(row.corrected is not None for row in self.rows)
        heading = f"{'':24}{'estimate':>13}{'std error':>12}{'corrected' if corrected else '':>12}  unit"
        lines = [f"{self.model}: {self.verdict} ({self.samples} values)", heading.rstrip()]
        partners = self._partners()
        for i, row in enumerate(self.rows):
            error = "undetermined" if row.standard_error is None else f"{row.standard_error:.3g}"
            wider = "" if row.corrected is None else f"{row.corrected:.3g}"
            line = f"{row.name[:24]:24}{row.value:13.6g}{error:>13}{wider if corrected else '':>12}  {row.unit:8}"
            lines.append((line + partners.get(i, "")).rstrip())
        lines += [f"{name[:24]:24}{value:13.6g}       fixed" for name, value in self.fixed.items()]
        lines.append("residuals (rms): " + ", ".join(f"{name} {sigma:.3g}" for name, sigma in self.noise.items()))
        return "\n".join(lines)

    def _partners(self) -> dict[int, str]:
        """For each unknown its largest correlation with another, as text, if it is large."""
        partners = {}
        for i, row in enumerate(self.correlation):
            others = [(abs(value), j) for j, value in enumerate(row) if value is not None and j != i]
            size, j = max(others, default=(0.0, 0))
            if size > VERDICT.large_correlation:
                partners[i] = f"correlated with {self.rows[j].name} ({row[j]:+.3f})"
        return partners


def save_summary(summary: FitSummary, file: Path) -> None:
    """Write JSON. Raises InputError if the file exists."""
    if file.exists():
        raise InputError(f"{file}: exists already; give another name")
    file.write_bytes(msgspec.json.format(msgspec.json.encode(summary), indent=2) + b"\n")


def load_summary(file: Path) -> FitSummary:
    """Read what `save_summary` wrote. Raises InputError for another kind of file."""
    try:
        summary = msgspec.json.decode(file.read_bytes(), type=FitSummary)
    except (OSError, msgspec.MsgspecError) as error:
        raise InputError(f"{file}: not a saved fit: {error}") from None
    if summary.format != FORMAT:
        raise InputError(f"{file}: not a saved fit: its format is {summary.format!r}, expected {FORMAT!r}")
    return summary


class FitStatus(enum.StrEnum):
    CONVERGED = "converged"
    AT_BOUND = "at a bound"
    NOT_IDENTIFIABLE = "not identifiable"
    NOT_CONVERGED = "not converged"


class Finding(enum.Enum):
    """The statements that a verdict can make, for programs."""

    OPTIMUM = enum.auto()
    AT_BOUND = enum.auto()
    TOO_FEW_VALUES = enum.auto()
    UNDETERMINED = enum.auto()
    NO_BETTER_STEP = enum.auto()
    TOO_FEW_ITERATIONS = enum.auto()
    MODEL_HAS_BRANCHES = enum.auto()
    COLLINEAR = enum.auto()
    NEGLIGIBLE_MEASUREMENT_NOISE = enum.auto()
    NEGLIGIBLE_BUT_STABILIZING = enum.auto()
    PROCESS_NOISE_NOT_SIGNIFICANT = enum.auto()
    REACHED_FROM_STARTS = enum.auto()
    WORSE_OPTIMA = enum.auto()
    STARTS_NOT_CONVERGED = enum.auto()
    REACHED_FROM_PIECES = enum.auto()
    NOT_WHITE = enum.auto()
    OUTLIERS = enum.auto()
    UNSTABLE = enum.auto()


class Remark(NamedTuple):
    """One finding, for a program and in words."""

    finding: Finding
    text: str


class Verdict(NamedTuple):
    """Whether a fit can be used.

    remarks : the first gives the status in words, the others what the user should know
    hints : faults of model or data that the residuals suggest
    """

    status: FitStatus
    remarks: tuple[Remark, ...]
    hints: tuple[Remark, ...] = ()

    @property
    def ok(self) -> bool:
        return self.status is FitStatus.CONVERGED

    @property
    def text(self) -> str:
        """The remarks, as one line."""
        return "; ".join(remark.text for remark in self.remarks)

    @property
    def findings(self) -> tuple[Finding, ...]:
        return tuple(remark.finding for remark in (*self.remarks, *self.hints))

    def with_remarks(self, *remarks: Remark) -> "Verdict":
        return self._replace(remarks=(*self.remarks, *remarks))

    def __str__(self) -> str:
        return "; ".join(remark.text for remark in (*self.remarks, *self.hints))


class Intensity(NamedTuple):
    """An intensity of process noise [unit of the state per sqrt(s)], its 95 % interval, and its significance.

    p_value : of the likelihood-ratio test against zero intensity. Zero is at the boundary of the parameter space, so
    that the estimate is zero in half of all records without this noise (Self & Liang 1987, J. Am. Stat. Assoc. 82,
    605, case 5). NaN if not tested or fixed.
    """

    value: float
    lo: float
    hi: float
    p_value: float

    @property
    def significant(self) -> bool:
        return self.p_value < TESTS.false_alarms


class ParameterEstimate(NamedTuple):
    name: str
    value: float
    standard_error: float  # Cramer-Rao, priors included; 0 for a fixed parameter, inf if not identifiable
    unit: str
    free: bool


class Convergence(NamedTuple):
    """The course of an estimation.

    costs : negative log-likelihood at the start and after each iteration
    steps : length of the step of each iteration in the metric of the information matrix: the change, in standard
    errors, of that combination of unknowns which changes most
    """

    costs: tuple[float, ...]
    steps: tuple[float, ...]


@dataclass(frozen=True)
class SegmentFit:
    """One segment's part of a fit.

    residuals : (n, outputs) z - y, NaN where missing     white : residuals and sensitivities, whitened
    columns : index in `Fit.names` of each column of `white.S`
    """

    segment: Segment
    response: Response
    residuals: Array
    white: Whitened
    columns: NDArray[np.intp]


@dataclass(frozen=True)
class Fit:
    """The result of an estimation.

    keys, names : of the m unknowns, typed and as text: "CLa" for a shared parameter, "b[run]" for a segment's own,
    "V(0)[run]" for an initial state. `values` and all matrices are in this order.
    values : (m,)
    covariance : (m, m) Cramer-Rao bound, priors included; inf and NaN for unknowns that are not identifiable
    parameters : free and fixed parameters by name
    noise_covariance : R (outputs, outputs)
    negative_log_likelihood : up to a constant, priors included
    information : (m, m) Fisher information of the data     prior_information : (m, m), of all priors
    variance_information : the part of `information` that comes from the variances of the residuals, not their means
    process_noise : intensities by state, of filter error
    integrator, inputs : with which the response was computed
    costs, steps : those of `Convergence`, if kept
    """

    model: Model
    keys: tuple[UnknownKey, ...]
    values: Array
    covariance: Array
    parameters: dict[str, ParameterEstimate]
    noise_covariance: Array
    verdict: Verdict
    iterations: int
    negative_log_likelihood: float
    information: Array
    prior_information: Array
    segment_fits: tuple[SegmentFit, ...]
    variance_information: Array | float = 0.0
    process_noise: Mapping[str, Intensity] = field(default_factory=dict)
    integrator: Integrator = "rk4"
    inputs: InputRule = "linear"
    costs: tuple[float, ...] = ()
    steps: tuple[float, ...] = ()

    def __str__(self) -> str:
        return self.summary().table()

    __repr__ = __str__

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(map(str, self.keys))

    @property
    def residuals(self) -> dict[str, Array]:
        """z - y (n, outputs) by segment name, NaN where a sample is missing."""
        return {fit.segment.name: fit.residuals for fit in self.segment_fits}

    @property
    def responses(self) -> dict[str, Response]:
        """The model's response by segment name."""
        return {fit.segment.name: fit.response for fit in self.segment_fits}

    @property
    def samples(self) -> int:
        """Number of measured values, over all outputs and segments."""
        return int(sum(fit.white.present.sum() for fit in self.segment_fits))

    @property
    def convergence(self) -> Convergence:
        return Convergence(self.costs, self.steps)

    @property
    def correlation(self) -> Array:
        """Correlation (m, m) of the estimates; NaN for unknowns that are not identifiable."""
        return correlation_of(self.covariance)

    def summary(self, corrected: Array | None = None) -> FitSummary:
        """The numbers without the data. corrected : (m, m) covariance for colored residuals (`uncertainty`)."""
        residuals = np.concatenate([fit.residuals for fit in self.segment_fits])
        wider = [None] * len(self.names) if corrected is None else np.sqrt(np.diag(corrected)).tolist()
        unit_of = {q.name: q.unit for q in self.model.parameters}
        units = {key: unit_of[key.name] for key in self.keys if key.kind is UnknownKind.PARAMETER}
        return FitSummary(
            model=self.model.name,
            status=self.verdict.status.value,
            verdict=str(self.verdict),
            iterations=self.iterations,
            samples=self.samples,
            negative_log_likelihood=self.negative_log_likelihood,
            rows=[
                SummaryRow(str(key), units.get(key, ""), float(value), _finite(error), _finite(wide))
                for key, value, error, wide in zip(
                    self.keys, self.values, np.sqrt(np.diag(self.covariance)).tolist(), wider, strict=True
                )
            ],
            fixed={q.name: q.start for q in self.model.parameters if not q.free},
            correlation=[[_finite(value) for value in row] for row in self.correlation.tolist()],
            noise=dict(zip(self.model.outputs, np.sqrt(np.nanmean(residuals**2, axis=0)).tolist(), strict=True)),
        )

    def shared(self, values: Array | None = None) -> NamedValues:
        """Shared parameters by name, free and fixed. values : (m,) in the order of `names`; default: the estimate."""
        free = dict(zip(self.names, self.values if values is None else values, strict=True))
        shared = {q.name: free.get(q.name, q.start) for q in self.model.parameters if q.shared}
        return NamedValues("shared parameter", shared)


def correlation_of(covariance: Array) -> Array:
    """Correlation (m, m); NaN where the covariance is not finite."""
    errors = np.sqrt(np.diag(covariance))
    with np.errstate(invalid="ignore"):
        matrix: Array = covariance / np.outer(errors, errors)
    return matrix


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
