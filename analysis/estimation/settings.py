"""Thresholds of the estimators for tests, search, filter error, verdict, and computation."""

from dataclasses import dataclass

from flightpower.flight.settings import Settings, setting


@dataclass(frozen=True)
class Tests(Settings):
    """Levels of statistical tests."""

    false_alarms: float = setting(0.05, "1", "level of a test whose result is shown with its probability")
    rare_false_alarms: float = setting(0.001, "1", "level of a test that is made in every analysis, for a warning")


TESTS = Tests()


@dataclass(frozen=True)
class Search(Settings):
    """When a maximization has converged, and how it makes a step."""

    step_tolerance: float = setting(
        1e-4, "standard errors", "length of the last step, by the information matrix; where no step decreases the cost,"
        " twice the decrease that was predicted, in standard errors squared",
    )  # fmt: skip
    lndet_tolerance: float = setting(1e-6, "1", "change of ln det R in the last step")
    near: float = setting(
        0.25, "1", "steps that change the response by less than this share of the residuals use the curvature of the"
        " cost; for longer ones the information matrix is the better guide",
    )  # fmt: skip
    smallest_curvature: float = setting(
        1e-2, "1", "least ratio of the smallest eigenvalues of curvature and information: further from the optimum the"
        " curvature may be indefinite",
    )  # fmt: skip
    pieces: int = setting(
        10, "pieces", "of a record, for a second start: a pole that is off by a factor of two slips no cycle in one"
    )
    shortest_piece: int = setting(
        12, "samples", "of a record: a shorter record determines little besides its initial state"
    )
    secant_length: float = setting(
        0.3, "standard errors", "secants of longer steps led away from the optimum of unstable aircraft"
    )


@dataclass(frozen=True)
class FilterError(Settings):
    """Noise parameters of filter error: their bounds, and when noise counts as zero."""

    step_tolerance: float = setting(
        1e-3, "standard errors", "with noise parameters convergence is linear, a factor of 3 to 4 per step"
    )
    intensity_range: float = setting(1e3, "1", "factor of the bounds of an intensity about its start")
    noise_range: tuple[float, float] = setting(
        (1e-4, 10.0),
        "1",
        "least and largest noise over an output's rms: with less, a few outputs determine the state and there is no"
        " optimum",
    )
    largest_step: float = setting(2.0, "1", "of the logarithm of a noise in one iteration")
    negligible: float = setting(0.01, "1", "information about ln w or ln v, whose standard error is then 10")
    near_gain: float = setting(1.0, "1", "expected decrease of the cost below which a fit is near the optimum")
    tried_again: float = setting(
        0.25,
        "1",
        "an intensity is tried again once the information has fallen to this share of what it was when it was left out",
    )
    zero_cost: float = setting(
        0.5, "1", "increase of the cost up to which noise counts as zero; an unstable model needs it, however small"
    )


@dataclass(frozen=True)
class VerdictLimits(Settings):
    """Limits that decide what a verdict mentions."""

    large_correlation: float = setting(
        0.9, "1", "two unknowns are determined only together (Klein & Morelli 2006, ch. 5)"
    )
    condition_index: float = setting(100.0, "1", "strong collinearity (Belsley, Kuh & Welsch 1980, ch. 3)")
    variance_proportion: float = setting(0.5, "1", "of an unknown that takes part in it (Belsley, Kuh & Welsch 1980)")
    negligible_share: float = setting(
        0.01, "1", "of an eigenvector: an unknown below it takes no part in a combination"
    )
    outlier: float = setting(6.0, "sigma", "of the residuals; one normal value in a billion is larger")
    error_growth: float = setting(1e3, "1", "of an error in a segment: above it output error hardly finds optima")
    same_optimum: float = setting(0.01, "1", "difference in log-likelihood; 2 is significant at 5 %")

    @property
    def not_white(self) -> float:
        """Lag-one correlation, in standard deviations, that a white record exceeds once in a thousand."""
        from scipy import special

        return float(special.ndtri(1 - TESTS.rare_false_alarms / 2))


@dataclass(frozen=True)
class Computation(Settings):
    """Uniformity of time steps."""

    uniformity: float = setting(0.01, "1", "of a time step; the error of RK4 over a step is far larger than its effect")


SEARCH, FILTER_ERROR, VERDICT, COMPUTATION = Search(), FilterError(), VerdictLimits(), Computation()
