"""Figures of a fit show its numbers."""

import numpy as np
import pytest
from disturbed import LINEAR, linear_record

from analysis.estimation import output_error, plots
from flight.errors import InputError


@pytest.fixture(scope="module")
def fit():
    segments = [linear_record(seed, strength=0.0, name=f"run {seed}") for seed in (0, 1)]
    return output_error.estimate(LINEAR, segments, start={"Mq": -1.0})


def test_overlay_and_residuals_of_a_segment(fit):
    measured, fitted = plots.overlay(fit, "run 1").data[:2]
    assert (measured.y == fit.segment_fits[1].segment.z["alpha"]).all()
    assert (fitted.y == fit.responses["run 1"].y[:, 0]).all()
    figure = plots.residuals(fit)
    assert (figure.data[1].y == fit.residuals["run 0"][:, 1]).all()
    with pytest.raises(InputError, match="no segment is named 'run 2'; known: run 0, run 1"):
        plots.overlay(fit, "run 2")


def test_autocorrelation_of_white_residuals_is_within_its_limits(fit):
    figure = plots.autocorrelation(fit, lags=30)
    limit = abs(figure.layout.shapes[0].y0)
    assert limit == pytest.approx(1.96 / np.sqrt(500), rel=1e-3)
    assert len(figure.data) == 2 and (np.abs(figure.data[0].y) < limit).mean() > 0.8
    e = np.concatenate([residual[:, 0] for residual in fit.residuals.values()])
    assert figure.data[0].y[0] == pytest.approx(e[1:] @ e[:-1] / (e @ e), abs=0.01)


def test_correlation_matrix_and_convergence(fit):
    heatmap = plots.correlation_matrix(fit).data[0]
    assert heatmap.z == pytest.approx(fit.correlation) and tuple(heatmap.x) == fit.names
    above = plots.convergence(fit).data[0].y
    steps = fit.convergence.steps
    assert len(steps) == len(above) and above[-1] == pytest.approx(steps[-1] ** 2 / 2, rel=0.01)  # in standard errors
    assert fit.costs[-1] == fit.negative_log_likelihood and len(above) == len(fit.costs) - 1 <= fit.iterations
    assert (np.diff(above) <= 0).all() and above[0] > 1
