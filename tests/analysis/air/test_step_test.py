"""The parts of a step test in closed form: which steps count, the fit of a level, minimum and interval of a profile."""

import numpy as np
import pytest

from flightpower.analysis.air.settings import LAG
from flightpower.analysis.air.tubing import air
from flightpower.analysis.calibrations.tubing import (
    Lag,
    LineLag,
    Misfit,
    _crossing,
    _deviance,
    _interval,
    _minimum,
    _misfit,
    _residual_squares,
    exponential,
    find_steps,
    fit_lag,
    summary,
    through,
    to_toml,
)
from flightpower.flight.aircraft import PneumaticLine

RATE_HZ, NOISE_PA = 100.0, 1.0


def step_record(lag_s: float, *, at_s: float = 5.0, size_Pa: float = 200.0, seconds: float = 10.0, seed: int = 0):
    t = np.arange(0, seconds, 1 / RATE_HZ)
    clean = np.where(t > at_s, size_Pa * np.exp(-(t - at_s) / lag_s), size_Pa)
    return t, clean + np.random.default_rng(seed).normal(0, NOISE_PA, len(t))


def test_a_step_starts_in_quiet_and_its_last_quiet_sample_is_the_one_before_it() -> None:
    t, value = step_record(0.02, at_s=5.004)
    (step,), noise = find_steps(t, value)
    assert noise == pytest.approx(NOISE_PA, rel=0.1)
    assert step.t_s[step.last_quiet] == pytest.approx(5.0)
    assert step.value[0] == pytest.approx(200.0, abs=5) and step.value[-1] == pytest.approx(0.0, abs=5)
    # quiet for as long as the longest step that counts, a step of that length, and quiet as long again
    assert (step.t_s[0], step.t_s[-1]) == pytest.approx((5.01 - LAG.step_s, 4.99 + 2 * LAG.step_s))


def test_a_step_as_high_as_the_noise_is_none() -> None:
    assert find_steps(*step_record(0.02, size_Pa=3.0))[0] == []


def test_the_times_of_steps_and_lags_shift_and_scale_with_the_record() -> None:
    """The clock's origin changes nothing; a record that is twice as slow has twice the lag."""
    t, value = step_record(0.05)
    lag = fit_lag(*find_steps(t, value))
    assert lag.lag_s == pytest.approx(0.05, rel=0.05) and lag.lo_s < 0.05 < lag.hi_s
    assert fit_lag(*find_steps(t + 1000.0, value)).lag_s == pytest.approx(lag.lag_s, rel=1e-6)
    higher = fit_lag(*find_steps(t, 3 * value + 50.0))
    assert (higher.lag_s, higher.noise) == pytest.approx((lag.lag_s, 3 * lag.noise), rel=1e-6)


def test_a_lag_that_leaves_more_instants_possible_is_as_much_more_likely() -> None:
    """Integrals of the normal likelihoods of a step's instant are proportional to their widths; the deviance is -2 ln
    of the integral."""
    instants, variance = np.linspace(-1, 1, 2001)[None], 4.0

    def of_width(width_s: float, least: float) -> Misfit:
        return Misfit(instants, variance * (least + (instants / width_s) ** 2))

    narrow, wide, worse = _deviance([of_width(0.05, 3.0), of_width(0.1, 3.0), of_width(0.1, 5.0)], variance)
    assert narrow == pytest.approx(3.0 - 2 * np.log(0.05 * np.sqrt(2 * np.pi)), rel=1e-6)
    assert wide - narrow == pytest.approx(-2 * np.log(2), rel=1e-6)
    assert worse - wide == pytest.approx(2.0, rel=1e-6)


def test_an_instant_and_a_level_that_fit_exactly_leave_nothing() -> None:
    t = np.arange(0, 2, 0.01)[None]
    values = 5 + 80 * exponential(0.1)(t - 0.803)
    misfit = _misfit(t, values, np.array([[0.80, 0.81, 0.82]]), 0.1, exponential(0.1))
    assert misfit.instants_s[0, np.argmin(misfit.squares)] == pytest.approx(0.803, abs=1e-5)
    assert misfit.squares.min() < 1e-4 and (np.diff(misfit.instants_s) >= 0).all()
    off = _misfit(t, values, np.array([[0.80, 0.81, 0.82]]), 0.2, exponential(0.2))
    assert off.squares.min() > 1000


def test_residuals_are_those_of_a_regression_with_a_level() -> None:
    rng = np.random.default_rng(1)
    y, g = rng.normal(size=(2, 30)), rng.normal(size=(2, 4, 30))
    residual_squares = _residual_squares(y, g)
    for s in range(2):
        for m in range(4):
            _, squares, *_ = np.linalg.lstsq(np.column_stack([g[s, m], np.ones(30)]), y[s], rcond=None)
            assert residual_squares[s, m] == pytest.approx(squares[0])


@pytest.mark.parametrize("shift", [-0.4, 0.0, 0.3])
def test_the_minimum_of_a_parabola_is_found_between_the_lags(shift: float) -> None:
    """The lags are evenly spaced in their logarithm, and the parabola is a function of that logarithm."""
    steps = np.arange(7.0)
    lags = 0.01 * 1.2**steps
    assert _minimum(lags, 5 + 2 * (steps - 3 - shift) ** 2, 3) == pytest.approx(0.01 * 1.2 ** (3 + shift))
    assert _minimum(lags, steps, 0) == lags[0] and _minimum(lags, -steps, 6) == lags[-1]
    assert _minimum(lags, np.ones(7), 3) == lags[3]


def test_the_interval_ends_where_the_likelihood_ratio_is_that_of_95_per_cent() -> None:
    """-2 log likelihood of a normal estimate: 1.96 standard deviations to each side; no end where it is not reached."""
    lags = np.linspace(0.01, 0.03, 4001)
    lo, hi = _interval(lags, ((lags - 0.02) / 0.003) ** 2)
    assert (lo, hi) == pytest.approx((0.02 - 1.96 * 0.003, 0.02 + 1.96 * 0.003), abs=1e-6)
    assert _interval(lags, ((lags - 0.02) / 0.03) ** 2) == (0.0, float("inf"))
    assert _crossing(np.array([1.0, 2.0]), np.array([-1.0, 3.0]), 0) == pytest.approx(1.25, abs=1e-4)


def lag(lag_s: float, lo_s: float, hi_s: float, *, steps: int = 8, misfit: float = 1.0) -> Lag:
    return Lag(lag_s, lo_s, hi_s, steps, NOISE_PA, misfit)


REST = ", from 8 steps; by the aircraft file 19.0 ms"


def test_more_steps_narrow_the_interval_with_the_square_root_of_their_number() -> None:
    assert lag(0.020, 0.018, 0.022).more_steps == 24  # from 10 to 5 % takes four times as many
    assert lag(0.020, 0.0192, 0.0208).more_steps == 0
    assert lag(0.020, 0.0, 0.030).more_steps == 0 and not lag(0.020, 0.0, 0.030).bounded


@pytest.mark.parametrize(
    ("measured", "lines"),
    [
        (lag(0.020, 0.0192, 0.0208), ["/probe/alpha: lag 20.0 ms (19.2 to 20.8)" + REST]),
        (lag(0.020, 0.0, 0.008), ["/probe/alpha: lag shorter than 8.0 ms, too short for this tick rate" + REST]),
        (lag(0.020, 0.0192, 0.0208, misfit=2.1), [
            "/probe/alpha: lag 20.0 ms (19.2 to 20.8)" + REST,
            "  the steps do not fit the model of a line (2.1 times the noise): look for a leak",
        ]),
        (lag(0.020, 0.018, 0.0219, misfit=1.9), [
            "/probe/alpha: lag 20.0 ms (18.0 to 21.9)" + REST,
            "  for 5 %: about 23 more bursts like these in the same log, or a log at a higher rate",
        ]),
        (lag(0.020, 0.0, float("inf")), [
            "/probe/alpha: lag 20.0 ms, without an upper bound" + REST,
            "  left out: the bursts found (8) do not determine the lag within 40 %: record more of them in one log, or"
            " at 100 Hz",
        ]),
        (None, ["/probe/alpha: no step found"]),
    ],
)  # fmt: skip
def test_what_is_reported_of_a_line(measured: Lag | None, lines: list[str]) -> None:
    line = PneumaticLine(length_m=0.9, diameter_m=0.4e-3, cavity_m3=20e-9)
    assert summary(LineLag("alpha", "/probe/alpha", measured, 0.019, line)) == lines


def test_a_measured_line_is_written_in_the_units_of_an_aircraft_file() -> None:
    line = PneumaticLine(length_m=0.9, diameter_m=1.234e-3, cavity_m3=20e-9)
    text = to_toml([LineLag("alpha", "/probe/alpha", lag(0.0205, 0.0192, 0.0208), 0.019, line)])
    assert text.splitlines() == [
        "[probe.lines.alpha]  # measured: 20.5 ms", 'length = "0.9 m"', 'diameter = "1.234 mm"', 'cavity = "20 mm^3"',
    ]  # fmt: skip


def test_a_line_is_left_out_if_its_lag_is_known_no_better_than_40_per_cent() -> None:
    def unsupported(lo_s: float, hi_s: float) -> str:
        return LineLag("alpha", "/probe/alpha", lag(0.020, lo_s, hi_s), None, None).unsupported

    assert not unsupported(0.0125, 0.028) and unsupported(0.0115, 0.028)


@pytest.mark.parametrize("lag_s", [0.005, 0.05])
def test_a_step_at_the_end_of_a_tube_falls_from_one_to_zero_and_stays(lag_s: float) -> None:
    """A narrow tube behaves nearly as a flow resistance: the step's mean delay is the lag."""
    line = PneumaticLine(length_m=0.3, diameter_m=0.4e-3, cavity_m3=200e-9)
    shape = through(line, air(100e3, 293.15))(lag_s)
    t = np.linspace(-lag_s, 40 * lag_s, 8001)
    remaining = shape(t)
    assert (remaining[t <= 0] == 1.0).all() and np.abs(remaining[t > 12 * lag_s]).max() < 1e-3
    assert np.diff(remaining).max() < 1e-3, "it does not rise"
    assert np.trapezoid(remaining[t >= 0], t[t >= 0]) == pytest.approx(lag_s, rel=0.03)
