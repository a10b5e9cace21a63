"""The published output-error estimates of an ATTAS short-period manoeuvre (Jategaonkar, test case 11)."""

from pathlib import Path

import numpy as np
import pytest

from analysis.estimation import output_error
from analysis.estimation.data import Segment
from analysis.estimation.model import Model, Parameter

DATA = Path(__file__).parents[4] / "shared" / "data" / "attas"

# name: (starting value, published estimate, standard error of an independent run)
CASE_11 = {
    "Z0": (-2.5e-3, -0.00898779, 0.00065),
    "Zal": (-0.214, -0.483362, 0.0066),
    "Zq": (0.0278, 0.104198, 0.0055),
    "Zde": (0.166, 0.676322, 0.0119),
    "M0": (0.272, 0.475234, 0.0014),
    "Mal": (-2.74, -4.92651, 0.0161),
    "Mq": (-1.08, -2.00573, 0.0115),
    "Mde": (-3.19, -7.20806, 0.0253),
}

MODEL = Model(
    name="short period with zero terms",
    states=("alpha", "q"),
    inputs=("de",),
    outputs=("alpha", "q"),
    parameters=tuple(Parameter(name=name, start=start) for name, (start, _, _) in CASE_11.items()),
    dynamics=lambda x, u, p: (
        p.Z0 + p.Zal * x.alpha + (p.Zq + 1) * x.q + p.Zde * u.de,
        p.M0 + p.Mal * x.alpha + p.Mq * x.q + p.Mde * u.de,
    ),
    output_function=lambda x, u, p: (x.alpha, x.q),
)


@pytest.fixture(scope="module")
def segments():
    files = [DATA / "fAttasElv1.mat", DATA / "fAttasElv2.mat"]
    if not all(file.is_file() for file in files):
        pytest.skip(f"the ATTAS records are not there ({DATA})")
    from scipy.io import loadmat

    records = [next(v for k, v in loadmat(file).items() if not k.startswith("__")) for file in files]
    degrees = [{"q": r[:, 7], "alpha": r[:, 12], "de": r[:, 21]} for r in records]
    channels = [{name: np.deg2rad(values) for name, values in d.items()} for d in degrees]
    first = {name: float(channels[0][name][0]) for name in ("alpha", "q")}  # the reference gives it to both
    return [
        Segment(
            name=f"manoeuvre {i}",
            t_s=np.arange(len(c["de"])) / 25,
            u={"de": c["de"]},
            z={"alpha": c["alpha"], "q": c["q"]},
            x0=first,
        )
        for i, c in enumerate(channels, start=1)
    ]


@pytest.fixture(scope="module")
def fit(segments):
    return output_error.estimate(MODEL, segments, initial_states="given")


@pytest.mark.parametrize("name", CASE_11)
def test_estimates_are_the_published_ones_to_five_digits(fit, name):
    assert fit.parameters[name].value == pytest.approx(CASE_11[name][1], rel=1e-5)


@pytest.mark.parametrize("name", CASE_11)
def test_standard_errors_to_one_percent_or_what_was_printed(fit, name):
    published = CASE_11[name][2]
    last_digit = 10.0 ** -len(f"{published:f}".rstrip("0").split(".")[1])
    error = fit.parameters[name].standard_error
    assert error == pytest.approx(published, abs=max(0.01 * published, last_digit / 2))


def test_converges_in_ten_iterations_with_the_published_noise(fit):
    assert fit.verdict.ok and fit.iterations <= 10
    assert np.diag(fit.noise_covariance) == pytest.approx([2.72649e-6, 7.93907e-6], rel=1e-5)


def test_two_manoeuvres_are_worth_both_their_information(fit, segments):
    """Information adds, so that the joint bound is below that of either manoeuvre alone."""
    for segment in segments:
        alone = output_error.estimate(MODEL, segment, initial_states="given")
        for name in CASE_11:
            assert fit.parameters[name].standard_error < alone.parameters[name].standard_error
