"""Output error on a short period agrees with the published estimates of ATTAS test case 11 (Jategaonkar, Flight
Vehicle System Identification, 2nd ed.).

The copyright of the flight records belongs to their author and the AIAA. So most tests use two simulated maneuvers of
the same kind, with the published parameters and noise as truth; the last test reads the records themselves if
`../shared/data/attas` has them.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.io import loadmat
from scipy.linalg import expm
from scipy.stats import chi2

from flightpower.analysis.estimation.data import Segment
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.model import Model, Parameter
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import FitOptions
from tests.shared_data import beside, needs

RECORDS = beside("attas")

# name: (starting value, published estimate, standard error of an independent run on the records)
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
TRUTH = np.array([published for _, published, _ in CASE_11.values()])
NOISE_VARIANCES = np.array([2.72649e-6, 7.93907e-6])  # published R of alpha [rad^2] and q [rad^2/s^2]

STEP_S, SAMPLES = 1 / 25, 626
TRIM, AMPLITUDE = np.deg2rad([2.2, 2.5])  # of the elevator
UNIT_S, RAMP_S = 0.8, 0.2  # unit of a 3-2-1-1, and time in which the elevator changes sides

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


def elevator(first_side: int, widths: tuple[int, ...], start_s: float) -> np.ndarray:
    """Return a multistep about the trim (SAMPLES,) [rad], with straight ramps between its sides."""
    ends_s = start_s + UNIT_S * np.cumsum((0, *widths))
    sides = [0, *(first_side * (-1) ** i for i in range(len(widths))), 0]
    t, de = [0.0], [0.0]
    for end_s, (before, after) in zip(ends_s, pairwise(sides), strict=True):
        t += [end_s, end_s + RAMP_S]
        de += [before, after]
    return TRIM + AMPLITUDE * np.interp(STEP_S * np.arange(SAMPLES), t, de)


ELEVATORS = {
    "3-2-1-1": elevator(1, (3, 2, 1, 1), 6.0),
    "two doublets": elevator(-1, (3, 3, 1, 1), 6.0),
}


def steady(p: np.ndarray, de: float) -> np.ndarray:
    """Return (alpha, q) of steady flight."""
    Z0, Zal, Zq, Zde, M0, Mal, Mq, Mde = p
    return np.linalg.solve([[Zal, Zq + 1], [Mal, Mq]], [-Z0 - Zde * de, -M0 - Mde * de])


def exact_response(p: np.ndarray, de: np.ndarray, x0: np.ndarray) -> np.ndarray:
    """Return alpha and q (SAMPLES, 2) by the matrix exponential, not RK4, for an elevator linear between samples."""
    Z0, Zal, Zq, Zde, M0, Mal, Mq, Mde = p
    rates = np.zeros((5, 5))  # of alpha, q, 1, elevator, elevator rate
    rates[0], rates[1], rates[3, 4] = (Zal, Zq + 1, Z0, Zde, 0), (Mal, Mq, M0, Mde, 0), 1
    over_a_step = expm(rates * STEP_S)
    x = [x0]
    for now, then in pairwise(de):
        x.append((over_a_step @ [*x[-1], 1, now, (then - now) / STEP_S])[:2])
    return np.array(x)


def maneuvers(seed: int) -> list[Segment]:
    rng = np.random.default_rng(seed)
    segments = []
    for name, de in ELEVATORS.items():
        x0 = steady(TRUTH, TRIM)
        z = exact_response(TRUTH, de, x0) + rng.normal(size=(SAMPLES, 2)) * np.sqrt(NOISE_VARIANCES)
        t = STEP_S * np.arange(SAMPLES)
        start = dict(zip(("alpha", "q"), x0, strict=True))
        segments.append(Segment(name=name, t_s=t, u={"de": de}, z={"alpha": z[:, 0], "q": z[:, 1]}, x0=start))
    return segments


def estimated(segments: Segment | list[Segment]) -> Fit:
    return fit_output_error(MODEL, segments, options=FitOptions(initial_states="given"))


@pytest.fixture(scope="module")
def segments() -> list[Segment]:
    return maneuvers(seed=0)


@pytest.fixture(scope="module")
def fit(segments: list[Segment]) -> Fit:
    return estimated(segments)


@pytest.fixture(scope="module")
def information() -> np.ndarray:
    """Return the Fisher information (8, 8) of both maneuvers, from central differences of the exact response."""
    x0, total = steady(TRUTH, TRIM), np.zeros((8, 8))
    for de in ELEVATORS.values():
        sides = [[exact_response(TRUTH + sign * step, de, x0) for sign in (1, -1)] for step in np.eye(8) * 1e-4]
        slopes = np.array([(high - low) / 2e-4 for high, low in sides])
        total += np.einsum("itk,jtk,k->ij", slopes, slopes, 1 / NOISE_VARIANCES)
    return total


def test_the_published_parameters_are_found_again_within_their_errors(information: np.ndarray) -> None:
    """In each of twenty pairs of maneuvers, squared errors weighted by the information are chi-squared of 8."""
    squares = 0.0
    for seed in range(20):
        fit = estimated(maneuvers(seed))
        errors = np.array([fit.parameters[name].value for name in CASE_11]) - TRUTH
        assert np.all(np.abs(errors) < 4 * np.array([fit.parameters[name].standard_error for name in CASE_11]))
        squares += errors @ information @ errors
    low, high = chi2.ppf([0.001, 0.999], df=20 * 8)
    assert low < squares < high


@pytest.mark.parametrize("name", CASE_11)
def test_standard_errors_are_the_bound_and_of_the_published_size(fit, information: np.ndarray, name: str) -> None:
    """Noise is estimated to 2 % from 626 samples of each output in two maneuvers, and so is the bound."""
    bound = np.sqrt(np.linalg.inv(information).diagonal())[list(CASE_11).index(name)]
    error = fit.parameters[name].standard_error
    assert error == pytest.approx(bound, rel=0.04)
    assert error == pytest.approx(CASE_11[name][2], rel=0.1), "maneuvers are as long and as large as in the record"


def test_converges_in_ten_iterations_with_the_published_noise(fit) -> None:
    assert fit.verdict.ok and fit.iterations <= 10
    assert np.diag(fit.noise_covariance) == pytest.approx(NOISE_VARIANCES, rel=3 * np.sqrt(2 / (2 * SAMPLES)))


def test_two_maneuvers_are_worth_both_their_information(fit, segments: list[Segment]) -> None:
    """Information adds, so the joint bound is below the bound of either maneuver alone."""
    for segment in segments:
        alone = estimated(segment)
        for name in CASE_11:
            assert fit.parameters[name].standard_error < alone.parameters[name].standard_error


@needs(RECORDS)
def test_the_records_give_the_published_estimates() -> None:
    """Estimates and noise agree to five digits, standard errors to 1 % or to the last digit that was printed."""
    files = [RECORDS / "fAttasElv1.mat", RECORDS / "fAttasElv2.mat"]
    records = [next(v for k, v in loadmat(file).items() if not k.startswith("__")) for file in files]
    channels = [{"q": r[:, 7], "alpha": r[:, 12], "de": r[:, 21]} for r in np.deg2rad(records)]
    first = {name: float(channels[0][name][0]) for name in ("alpha", "q")}  # the reference uses it for both
    segments = [
        Segment(
            name=f"maneuver {i}",
            t_s=STEP_S * np.arange(len(c["de"])),
            u={"de": c["de"]},
            z={"alpha": c["alpha"], "q": c["q"]},
            x0=first,
        )
        for i, c in enumerate(channels, start=1)
    ]
    fit = estimated(segments)
    assert fit.verdict.ok and fit.iterations <= 10
    assert np.diag(fit.noise_covariance) == pytest.approx(NOISE_VARIANCES, rel=1e-5)
    for name, (_, published, published_error) in CASE_11.items():
        assert fit.parameters[name].value == pytest.approx(published, rel=1e-5), name
        last_digit = 10.0 ** -len(f"{published_error:f}".rstrip("0").split(".")[1])
        allowed = max(0.01 * published_error, last_digit / 2)
        assert fit.parameters[name].standard_error == pytest.approx(published_error, abs=allowed), name
