"""Tests from which size on verdicts name residuals that are not white, outliers, and instability."""

from types import SimpleNamespace

import numpy as np
import pytest

from flightpower.analysis.estimation.fit import Finding, FitStatus
from flightpower.analysis.estimation.hints import hints_of, innovation_hints, unstable_growth
from flightpower.analysis.estimation.model import Model, Parameter

N = 401


def fit_of(residuals, *, white=None, weight=1.0, present=None, growth=0.0, status=FitStatus.CONVERGED, seconds=10.0):
    """Return a fit of one output "z" and a state that grows with exp(growth t). white: residuals over their sigma."""
    e = np.asarray(residuals, dtype=float)[:, None]
    model = Model(
        name="growing", states=("x",), outputs=("z",), parameters=(Parameter(name="rate", start=growth),),
        dynamics=lambda x, u, p: (p.rate * x.x,), output_function=lambda x, u, p: (x.x,),
    )  # fmt: skip
    n = len(e)
    segment_fit = SimpleNamespace(
        residuals=e,
        white=SimpleNamespace(
            e=e if white is None else np.asarray(white)[:, None],
            weight=np.full((n, 1), weight),
            present=np.ones((n, 1), dtype=bool) if present is None else present[:, None],
        ),
        segment=Segmented("run 1", np.linspace(50.0, 50.0 + seconds, n)),
        response=SimpleNamespace(x=np.full((n, 1), 2.0)),
    )
    return SimpleNamespace(
        model=model, segment_fits=(segment_fit,), verdict=SimpleNamespace(status=status),
        parameters={"rate": SimpleNamespace(value=growth)},
    )  # fmt: skip


class Segmented:
    def __init__(self, name: str, t_s: np.ndarray):
        self.name, self.t_s, self.u = name, t_s, {}

    def __len__(self) -> int:
        return len(self.t_s)


def correlated(lag_one: float, n: int = N) -> np.ndarray:
    """Return a record with this lag-one correlation, a cosine; only its ends make a small difference."""
    x = np.cos(np.arange(n) * np.arccos(lag_one))
    rest = lag_one - (x[1:] @ x[:-1]) / (x @ x)
    assert abs(rest) < 0.01
    return x


@pytest.mark.parametrize(("lag_one", "is_reported"), [(0.13, False), (0.2, True), (-0.13, False), (-0.2, True)])
def test_residuals_are_called_colored_from_3_3_standard_deviations_on(lag_one: float, is_reported: bool) -> None:
    """White noise has a standard deviation of 1/sqrt(400) = 0.05, so the limit is 0.165."""
    fit = fit_of(correlated(lag_one))
    hints = hints_of(fit)
    assert [hint.finding for hint in hints] == [Finding.NOT_WHITE] * is_reported
    assert all(f"lag-one correlation up to {abs(lag_one):.2f}" in hint.text for hint in hints)
    assert (len(innovation_hints(fit)) == 1) is is_reported


def test_pairs_with_a_missing_value_do_not_count() -> None:
    """Half of the samples make a fourth of the pairs, so the limit is twice as large."""
    present = np.arange(N) % 4 < 2
    assert hints_of(fit_of(correlated(0.2), present=present)) == ()
    assert hints_of(fit_of(correlated(0.35), present=present)) != ()


@pytest.mark.parametrize(("largest", "expected"), [(5.9, False), (6.1, True), (-6.1, True)])
def test_a_value_beyond_six_standard_deviations_is_an_outlier_unless_the_noise_has_tails(largest, expected) -> None:
    white = correlated(0.0)
    white[[3, 200]] = largest
    hints = hints_of(fit_of(correlated(0.0), white=white))
    assert [hint.finding for hint in hints] == [Finding.OUTLIERS] * expected
    assert all("2 of z beyond 6 standard deviations" in hint.text for hint in hints)
    assert hints_of(fit_of(correlated(0.0), white=white, weight=0.9)) == ()


@pytest.mark.parametrize(("growth", "is_reported"), [(0.65, False), (0.72, True), (-0.72, False)])
def test_an_error_that_grows_a_thousandfold_is_reported_where_the_fit_is_not_convincing(
    growth: float, is_reported: bool
) -> None:
    """ln 1000 over 10 s is a growth rate of 0.69 1/s."""
    fit = fit_of(correlated(0.0), growth=growth, status=FitStatus.NOT_CONVERGED)
    ln_growth, eigenvalue, name = unstable_growth(fit, fit.segment_fits[0])
    assert (ln_growth, eigenvalue, name) == (
        pytest.approx(10 * growth, rel=1e-6),
        pytest.approx(growth, rel=1e-6),
        "run 1",
    )
    hints = hints_of(fit)
    assert [hint.finding for hint in hints] == [Finding.UNSTABLE] * is_reported
    assert all("+0.72 1/s an error grows by 1e+03 within segment run 1" in hint.text for hint in hints)
    assert hints_of(fit_of(correlated(0.0), growth=growth)) == ()
