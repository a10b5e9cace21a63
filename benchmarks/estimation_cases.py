"""Measures how estimation fares in hard cases: filter error from poor starts, false optima, verdicts, coverage.

    python benchmarks/estimation_cases.py filter
    python benchmarks/estimation_cases.py optima
    python benchmarks/estimation_cases.py cases
    python benchmarks/estimation_cases.py agreement

docs/evidence/accuracy.md quotes the output. Seeds start at 1000; they were not used to choose any setting.
"""

import sys
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from flightpower.analysis.estimation.data import split
from flightpower.analysis.estimation.filter_error import fit_filter_error
from flightpower.analysis.estimation.fit import Fit
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.estimation.output_error import fit_output_error
from flightpower.analysis.estimation.problem import FitOptions
from flightpower.analysis.estimation.settings import VERDICT
from flightpower.flight.errors import InputError

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "analysis" / "estimation"))
import bimodal
import disturbed
import hard_cases
import test_term_selection as terms
import twins

FIRST_SEED = 1000
SAME = 1.0  # two fits of filter error whose log-likelihoods differ by less are the same
CONSOLE = Console(width=150)
app = typer.Typer(add_completion=False, pretty_exceptions_enable=False)


@app.command("filter")
def filter_() -> None:
    """Test filter error in turbulence and on an unstable aircraft: iterations, arrival from poor starts, coverage."""
    table = Table("filter error", "fits", "reached the optimum", "iterations: median, largest", "wanted", box=None)
    seeds = range(FIRST_SEED, FIRST_SEED + 20)
    turbulence = [_turbulence(seed, start="equation error") for seed in seeds]
    pair = (turbulence, [_turbulence(seed, start=twins.TURBULENCE_TRUTH) for seed in seeds])
    table.add_row("turbulence, from equation error", "20", _arrived(*pair), _iterations(turbulence), "15 iterations")
    best = [_unstable(seed, start=twins.UNSTABLE_TRUTH) for seed in seeds]
    for name, fits in (
        ("unstable, from equation error", [_unstable(seed, start="equation error") for seed in seeds]),
        (
            "unstable, starts off by 0.5 to 2",
            [_unstable(seed, start=_off(seed)) for seed in seeds],
        ),
    ):
        table.add_row(name, "20", _arrived(fits, best), _iterations(fits), "19 of 20")
    CONSOLE.print(table)
    table = Table(
        "95 % intervals cover", "fits", "all, %", "by parameter, %", "wanted, %", "iterations", "within 15", box=None
    )
    for name, make, truth in (
        ("turbulence", lambda seed: _turbulence(seed, start="equation error"), twins.TURBULENCE_TRUTH),
        ("unstable", lambda seed: _unstable(seed, start="equation error"), twins.UNSTABLE_TRUTH),
    ):
        inside, fits = [], []
        for seed in range(FIRST_SEED, FIRST_SEED + 200):
            fits.append(make(seed))
            estimates = fits[-1].parameters
            inside.append(
                [abs(estimates[n].value - v) < NORMAL_95 * estimates[n].standard_error for n, v in truth.items()]
            )
        by_parameter = 100 * np.mean(inside, axis=0)
        within = f"{sum(fit.iterations <= 15 for fit in fits)} of {len(fits)}"
        extremes = f"{by_parameter.min():.1f} to {by_parameter.max():.1f}"
        table.add_row(name, "200", f"{100 * np.mean(inside):.1f}", extremes, "93 to 97", _iterations(fits), within)
    CONSOLE.print(table)


def _turbulence(seed, **options):
    return fit_filter_error(
        twins.TURBULENCE, twins.in_turbulence(seed), twins.TURBULENCE_NOISE, test_significance=False, **options
    )


def _unstable(seed, **options):
    return fit_filter_error(
        twins.UNSTABLE,
        twins.unstable(seed),
        twins.UNSTABLE_NOISE,
        options=FitOptions(inputs="held"),
        test_significance=False,
        **options,
    )


def _off(seed):
    rng = np.random.default_rng(seed)
    return {name: value * rng.uniform(0.5, 2.0) for name, value in twins.UNSTABLE_TRUTH.items()}


def _arrived(fits, best) -> str:
    costs = [f.negative_log_likelihood - b.negative_log_likelihood for f, b in zip(fits, best, strict=True)]
    reached = sum(f.verdict.ok and cost < SAME for f, cost in zip(fits, costs, strict=True))
    return f"{reached} of {len(fits)}"


def _iterations(fits) -> str:
    counts = [f.iterations for f in fits]
    return f"{np.median(counts):.0f}, {max(counts)}"


@app.command()
def optima(starts: Annotated[int, typer.Option(help="Starts of each case.")] = 80) -> None:
    """Count output-error fits from random starts: at the best optimum, elsewhere with a warning, elsewhere without."""
    seed = FIRST_SEED
    sine = hard_cases.CASES["a false optimum"].fit(seed).segment_fits[0].segment
    unstable = twins.unstable(seed)
    still = disturbed.linear_record(seed, strength=0.0)
    pieces = split(unstable, 10)
    cases = {
        "short period, factors 1/3 to 3": (
            lambda start: fit_output_error(disturbed.LINEAR, still, start=start), disturbed.LINEAR_TRUTH, 3.0,
        ),
        "frequency of a sine, factors 1/3 to 3": (
            lambda start: fit_output_error(hard_cases.OSCILLATION, sine, start=start),
            {"omega": 4.4, "size": 1.0}, 3.0,
        ),
        "unstable, whole record, 1/2 to 2": (
            lambda start: fit_output_error(twins.UNSTABLE, unstable, options=FitOptions(inputs="held"), start=start),
            twins.UNSTABLE_TRUTH, 2.0,
        ),
        "unstable, ten parts, 1/2 to 2": (
            lambda start: fit_output_error(twins.UNSTABLE, pieces, options=FitOptions(inputs="held"), start=start),
            twins.UNSTABLE_TRUTH, 2.0,
        ),
    }  # fmt: skip
    table = Table(f"{starts} starts", "at the best optimum", "elsewhere, told", "elsewhere, silent", box=None)
    for name, (fit, truth, factor) in cases.items():
        rng = np.random.default_rng(seed)
        fits: list[Fit | None] = []
        for _ in range(starts):
            start = {key: value * factor ** rng.uniform(-1, 1) for key, value in truth.items()}
            try:
                fits.append(fit(start))
            except InputError:  # the response is not finite, and the error says so
                fits.append(None)
        best = _cheapest([fit(truth), *fits])
        at_best = sum(f is not None and f.negative_log_likelihood < best + 0.01 and f.verdict.ok for f in fits)
        silent = sum(
            f is not None and f.negative_log_likelihood >= best + 0.01 and f.verdict.ok and not f.verdict.hints
            for f in fits
        )
        table.add_row(name, str(at_best), str(starts - at_best - silent), str(silent))
    CONSOLE.print(table)
    _second_starts()


def _second_starts(starts: int = 40) -> None:
    """Compare cases with several optima with and without a second start, from fits to pieces of the record."""
    table = Table(
        f"{starts} starts, 1/2 to 2", "at the best optimum", "elsewhere, converged", "elsewhere, silent",
        "one start: at the best", "elsewhere, converged", box=None,
    )  # fmt: skip
    for name, case in bimodal.cases(FIRST_SEED).items():
        row: list[str] = []
        for second in (True, False):
            options = replace(case.options, second_start=second)
            output_errors = []
            for start in [case.truth, *case.starts(starts, FIRST_SEED)]:
                try:
                    output_errors.append(fit_output_error(case.model, case.record, start=start, options=options))
                except InputError:
                    continue
            least = min(f.negative_log_likelihood for f in output_errors if f.verdict.ok) + VERDICT.same_optimum
            converged = [f for f in output_errors[1:] if f.verdict.ok]
            elsewhere = [f for f in converged if f.negative_log_likelihood >= least]
            row += [str(len(converged) - len(elsewhere)), str(len(elsewhere))]
            row += [str(sum(not f.verdict.hints for f in elsewhere))] if second else []
        table.add_row(name, *row)
    CONSOLE.print(table)
    _second_starts_of_filter_error(starts)


def _second_starts_of_filter_error(starts: int) -> None:
    """Run the cases by filter error. At the best optimum, parameters are within a tenth of their standard errors."""
    table = Table("filter error", "at the best optimum", "elsewhere, told", "elsewhere, silent", box=None)
    for name, case in bimodal.cases(FIRST_SEED).items():
        filter_errors = [
            fit_filter_error(
                case.model, case.record, case.noise, start=start, options=case.options, test_significance=False
            )
            for start in [case.truth, *case.starts(starts, FIRST_SEED)]
        ]
        best = min((f for f in filter_errors if f.verdict.ok), key=lambda f: f.negative_log_likelihood)
        elsewhere = [f for f in filter_errors[1:] if not f.verdict.ok or not _same_parameters(f, best, case.truth)]
        silent = sum(f.verdict.ok and not f.verdict.hints for f in elsewhere)
        table.add_row(name, str(starts - len(elsewhere)), str(len(elsewhere) - silent), str(silent))
    CONSOLE.print(table)


def _same_parameters(fit: Fit, best: Fit, names: Iterable[str]) -> bool:
    pairs = [(fit.parameters[name], best.parameters[name]) for name in names]
    return all(abs(first.value - other.value) < 0.1 * other.standard_error for first, other in pairs)


def _cheapest(fits) -> float:
    """Return the least cost of fits with a clean verdict, NaN if there is none; unconverged fits may have any cost."""
    clean = [f.negative_log_likelihood for f in fits if f is not None and f.verdict.ok and not f.verdict.hints]
    return min(clean, default=np.nan)


@app.command()
def cases(seeds: Annotated[int, typer.Option(help="Number of draws of the noise.")] = 20) -> None:
    """Count how often the verdict rejects twelve fits that must not be used, and print its words."""
    table = Table("case", "named", "verdict", box=None)
    for name, case in hard_cases.CASES.items():
        verdicts = [case.fit(seed).verdict for seed in range(FIRST_SEED, FIRST_SEED + seeds)]
        named = sum(case.finding in verdict.findings for verdict in verdicts)
        table.add_row(name, f"{named} of {seeds}", str(verdicts[0]))
    CONSOLE.print(table)


@app.command()
def agreement(seeds: Annotated[int, typer.Option(help="Number of records.")] = 100) -> None:
    """Compare structure selection with the true terms, and the frequency domain with the time domain."""
    every = range(FIRST_SEED, FIRST_SEED + seeds)
    table = Table("", "measured", "wanted", box=None)
    for name, method in zip(("stepwise", "orthogonal functions"), terms.METHODS, strict=True):
        right = sum(set(method(*terms.flight(seed)).names) == set(terms.TRUE) for seed in every)
        table.add_row(f"true terms found, {name}", f"{right} of {seeds}", "95 of 100")
    apart, truth = [], disturbed.LINEAR_TRUTH
    # Constants do not appear in the frequency domain, so they must be fixed.
    still = disturbed.LINEAR.changed(**{name: {"start": truth[name], "free": False} for name in ("Z0", "M0")})
    for seed in every:
        segment = disturbed.linear_record(seed, strength=0.0)
        half_Hz = 0.5 / segment.step_s
        in_time = fit_output_error(still, segment)
        in_frequency = fit_output_error(still, segment, band_Hz=(0.0, 0.99 * half_Hz))
        difference = np.abs(in_frequency.values - in_time.values)
        errors = [np.sqrt(np.diag(fit.covariance)) for fit in (in_time, in_frequency)]
        apart.append((difference / errors)[:, : len(truth) - 2])
    for i, domain in enumerate(("time", "frequency")):
        ratios = np.array(apart)[:, i]
        within = f"rms {np.sqrt(np.mean(ratios**2)):.2f}, largest {ratios.max():.2f}"
        table.add_row(f"frequency less time domain, in standard errors of {domain} domain", within, "rms 1")
    CONSOLE.print(table)


if __name__ == "__main__":
    app()
