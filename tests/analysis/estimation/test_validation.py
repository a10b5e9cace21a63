"""Tests prediction of data that a model was not fitted to, collinearity, and a fit as table and file."""

import numpy as np
import pytest

from flightpower.analysis.estimation import uncertainty
from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Finding, load_summary, save_summary
from flightpower.analysis.estimation.hints import collinearities
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.validation import agreement, cross_validate, predict
from flightpower.flight.errors import InputError
from tests.analysis.estimation.test_output_error import (
    SHORT_PERIOD,
    SIGMA,
    STEP_S,
    T_S,
    TRUTH,
    exact_response,
    noisy,
)

FIT = fit_output_error(SHORT_PERIOD, noisy(1))
LINE = Model(
    name="line",
    inputs=("u1", "u2"),
    outputs=("y",),
    parameters=(Parameter(name="a", start=0.0), Parameter(name="b", start=0.0)),
    output_function=lambda x, u, p: (p.a * u.u1 + p.b * u.u2,),
)


def other_maneuver(seed=5, x0=(0.05, -0.1)):
    """Return a maneuver whose input and initial state differ from those of the fit."""
    de = 0.03 * np.sin(2.5 * T_S) * (T_S > 1)
    rng = np.random.default_rng(seed)
    clean = exact_response(TRUTH, de, STEP_S, x0)
    z = {name: y + SIGMA[name] * rng.standard_normal(len(y)) for name, y in clean.items()}
    return Segment(name="other", t_s=T_S, u={"de": de}, z=z)


def test_the_right_model_predicts_other_data_to_its_noise():
    """The rms of 150 samples scatters by 1/sqrt(300) = 6 %; errors of parameters and initial state add about 3 %."""
    prediction = predict(FIT, other_maneuver())
    for name, sigma in SIGMA.items():
        assert prediction.agreement[name].rms == pytest.approx(sigma, rel=0.2)
        assert prediction.agreement[name].R2 > 0.8
        assert prediction.agreement[name].theil < 0.2
        assert prediction.agreement[name].covariance > 0.9


def test_a_wrong_model_is_seen_on_other_data():
    """Its damping is fixed at a quarter of the true value."""
    wrong = fit_output_error(SHORT_PERIOD.changed(Mq={"start": -0.75, "free": False}), noisy(1))
    assert predict(wrong, other_maneuver()).agreement["q"].rms > 1.5 * SIGMA["q"]


def test_a_given_initial_state_is_not_estimated():
    segment = other_maneuver()
    started = Segment(name="other", t_s=T_S, u=segment.u, z=segment.z, x0={"alpha": 0.2, "q": 0.0})
    assert predict(FIT, started).y[0] == pytest.approx([0.2, 0.0])


def test_agreement_is_split_into_means_deviations_and_the_rest():
    z = np.array([1.0, 2.0, 3.0, 4.0, np.nan])
    shifted, stretched = agreement(z, z + 2), agreement(z, 2.5 + 3 * (z - 2.5))
    assert (shifted.rms, shifted.bias, shifted.variance) == pytest.approx((2.0, 1.0, 0.0))
    assert (stretched.bias, stretched.variance, stretched.covariance) == pytest.approx((0.0, 1.0, 0.0), abs=1e-12)
    assert agreement(z, np.full(5, 2.5)).R2 == pytest.approx(0.0)
    assert agreement(z, -z).theil == pytest.approx(1.0)


def test_cross_validation_leaves_each_maneuver_out_once():
    segments = [noisy(seed, name=f"run {seed}") for seed in range(3)]
    fitted_to = []

    def estimate(rest):
        fitted_to.append([segment.name for segment in rest])
        return fit_output_error(SHORT_PERIOD, rest)

    validation = cross_validate(segments, estimate)
    assert fitted_to == [["run 1", "run 2"], ["run 0", "run 2"], ["run 0", "run 1"]]
    assert [validation[f"run {i}"].agreement["q"].rms for i in range(3)] == pytest.approx([SIGMA["q"]] * 3, rel=0.2)
    with pytest.raises(InputError, match="at least two segments"):
        cross_validate(segments[:1], estimate)


def test_two_inputs_that_are_alike_are_named():
    """If two inputs are equal to 1e-4, the sum of their coefficients is known to 0.07, but each coefficient only to
    10,000 times that. If the inputs differ, nothing is reported."""
    rng = np.random.default_rng(0)
    u1, noise = rng.standard_normal((2, 200))

    def fit(u2):
        segment = Segment(name="s", t_s=0.1 * np.arange(200), u={"u1": u1, "u2": u2}, z={"y": u1 + u2 + noise})
        return fit_output_error(LINE, segment)

    collinear = fit(u1 + 1e-4 * rng.standard_normal(200))
    assert Finding.COLLINEAR in collinear.verdict.findings and "a and b (condition index" in collinear.verdict.text
    assert collinear.summary().table().count("correlated with") == 2
    assert Finding.COLLINEAR not in fit(rng.standard_normal(200)).verdict.findings


def test_the_condition_index_of_two_correlated_unknowns():
    """Columns with the correlation r have the eigenvalues 1 + r and 1 - r (Belsley)."""
    r = 0.9999
    (collinearity,) = collinearities(("a", "b", "c"), np.array([[4.0, 2 * r, 0], [2 * r, 1, 0], [0, 0, 9]]))
    assert collinearity.names == ("a", "b")
    assert collinearity.condition_index == pytest.approx(np.sqrt((1 + r) / (1 - r)))
    assert collinearity.proportions == pytest.approx(((1 + r) / 2, (1 + r) / 2))


def test_a_fit_is_printed_on_a_screen_and_kept(tmp_path):
    text = str(FIT)
    assert text == repr(FIT)
    assert all(name in text for name in TRUTH)
    assert len(text.splitlines()) < 12 and max(map(len, text.splitlines())) <= 100
    corrected = uncertainty.morelli_klein(FIT).covariance
    summary = FIT.summary(corrected)
    save_summary(summary, tmp_path / "fit.json")
    assert load_summary(tmp_path / "fit.json") == summary
    assert summary.rows[0].corrected == pytest.approx(np.sqrt(corrected[0, 0]))
    with pytest.raises(InputError, match="exists already"):
        save_summary(summary, tmp_path / "fit.json")
    (tmp_path / "other.json").write_text("{}")
    with pytest.raises(InputError, match="not a saved fit"):
        load_summary(tmp_path / "other.json")


def test_an_unknown_that_is_not_determined_is_kept_without_a_number(tmp_path):
    segment = Segment(name="s", t_s=np.arange(9.0), u={"u1": np.ones(9), "u2": np.ones(9)}, z={"y": np.arange(9.0)})
    summary = fit_output_error(LINE, segment).summary()
    assert summary.rows[0].standard_error is None
    assert "undetermined" in summary.table()
    save_summary(summary, tmp_path / "fit.json")
    assert load_summary(tmp_path / "fit.json") == summary
