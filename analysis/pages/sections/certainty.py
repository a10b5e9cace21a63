"""How certain the result is and why, what would halve its interval, and the margin to the stall."""

import math
from typing import NamedTuple

from scipy import special

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.pages.answers import stall_margin_percent
from flightpower.analysis.pages.html_page import HtmlTable
from flightpower.analysis.pages.sections.curve import ERRORS_IN_COMMON, in_percent, shared_part, shares_of_shared
from flightpower.analysis.pages.sections.flight import CHANNELS, decimals
from flightpower.analysis.pages.sections.summary import reference_point
from flightpower.analysis.records.flight import UNKNOWN_SPEED, IntervalPart, Kind, Results
from flightpower.analysis.results.evidence import noise_limit
from flightpower.analysis.results.next_flight import BY_SHARE, REMEDIES, Sources
from flightpower.analysis.settings import EVIDENCE
from flightpower.analysis.trajectory.settings import PRIOR_CHECK


class CertaintySection(NamedTuple):
    shared_part: str
    withheld: list[str]  # what is not known, and what would be needed
    checks: HtmlTable
    certificate: HtmlTable | None
    next_flight: list[str]
    stall: str


def certainty_section(results: Results, sources: Sources | None = None) -> CertaintySection:
    """Return the section. sources : function for the variance of power by source, such as `variance_by_source`"""
    return CertaintySection(
        shared_part=shared_part(results, sources),
        withheld=results.withheld,
        checks=HtmlTable(("question", "answer"), _checks(results)),
        certificate=certificate(results),
        next_flight=next_flight(results, sources),
        stall=stall_margin(results) if results.kind is Kind.POWER_REQUIRED else "",
    )


def _checks(results: Results) -> list[tuple[str, str]]:
    rows = [("Did the estimation converge?", _sentence(results.verdict))]
    curves = [method for method in results.methods if method.power_required]
    if curves:
        pairs = len(results.disagreements)
        answer = "None disagrees" if not pairs else f"{pairs} {'pair disagrees' if pairs == 1 else 'pairs disagree'}"
        rows.append(
            ("Do other methods agree?", f"{answer}, of {len(curves)} that had data; see Comparison of methods.")
        )
    if results.cross_check:
        differs = "No: it differs by more than" if results.cross_check_differs else "Yes, within what"
        rows.append(("Does a fit of the runs alone agree?", f"{differs} the intervals allow (output error)."))
    agreement = _agreement_of_runs(results)
    if agreement:
        rows.append(("Do the runs agree with each other?", agreement))
    white = _whiteness(results)
    if white:
        rows.append(("Do the fits leave only noise?", white))
    if results.path is not None:
        largest = max(results.path.residuals.values(), default=0.0)
        large = [
            CHANNELS.get(name, name) for name, rms in results.path.residuals.items() if rms > PRIOR_CHECK.largest_rms
        ]
        answer = f"Not all; residuals of {', '.join(large)} are up to" if large else "Yes: no residual is above"
        rows.append(("Do the sensors agree with one path?", f"{answer} {largest:.1f} times the channel's noise (rms)."))
    if results.provenance is not None and results.provenance.sensors:
        rows.append(("Is the log whole?", _health(results)))
    return rows


def _agreement_of_runs(results: Results) -> str:
    """Say which run differs most from the others of its kind."""
    compared = results.runs_against_others
    if not compared:
        return ""
    worst, limit = max(abs(run.z) for run in compared), noise_limit(len(compared))
    answer = "Yes" if worst <= limit else "No"
    return (
        f"{answer}: the largest difference of a run from the others of its kind is {worst:.1f} standard errors, of"
        f" {len(compared)} runs; in a sound flight it is below {limit:.1f}."
    )


def certificate(results: Results) -> HtmlTable | None:
    """Compare each run with the others of its kind; None if no two runs can be compared."""
    if not results.runs_against_others:
        return None
    return HtmlTable(
        ("run", "speed, m/s", "power, W", "by the others, W", "difference, %", "z, standard errors"),
        [
            (
                run.run,
                f"{run.speed_mps:.1f}",
                f"{run.power_W:.1f}",
                f"{run.others_W:.1f}",
                f"{100 * (run.power_W / run.others_W - 1):+.1f}",
                f"{run.z:+.1f}",
            )
            for run in results.runs_against_others
        ],
    )


def _whiteness(results: Results) -> str:
    significant = total = 0
    for run in results.run_residuals:
        bound = NORMAL_95 / math.sqrt(max(run.points, 1))
        lags = run.autocorrelation[1:]
        total += len(lags)
        significant += sum(abs(value) > bound for value in lags)
    if not total:
        return ""
    share = significant / total
    verdict = (
        "Yes"
        if special.bdtrc(significant - 1, total, 0.05) > EVIDENCE.rare_false_alarms
        else "Not only: the residuals are colored, which the standard errors allow for"
    )
    return (
        f"{verdict}. {100 * share:.0f} % of the autocorrelations lie beyond the 95 % bound of white noise (5 % by"
        " chance)."
    )


def _health(results: Results) -> str:
    assert results.provenance is not None
    provenance = results.provenance
    parts = []
    if provenance.ticks_missed is not None and provenance.ticks is not None:
        parts.append(
            f"{provenance.ticks_missed} of {provenance.ticks + provenance.ticks_missed} sampling instants were missed"
        )
    faulty = [
        f"{sensor.topic} ({sum(sensor.faults.values())} of {sensor.messages} messages)"
        for sensor in provenance.sensors
        if sensor.faults
    ]
    parts.append(f"faults: {', '.join(faulty)}" if faulty else "no sensor reported a fault")
    return _sentence("; ".join(parts))


def _sentence(text: str) -> str:
    return f"{text[:1].upper()}{text[1:]}."


class Halving(NamedTuple):
    """Sentences on how to halve the interval, and whether more runs of the same kinds would do it."""

    text: str
    by_more_runs: bool


def halving(results: Results, sources: Sources | None = None) -> Halving | None:
    """Say what would halve the interval at the reference speed; None if its parts are not known.

    Noise averages out over runs: n times as many runs divide its square by n. The part that all runs share remains.
    """
    if not results.interval_parts or not results.runs:
        return None
    reference_mps = reference_point(results).point.speed_mps
    part = min(results.interval_parts, key=lambda part: abs(part.speed_mps - reference_mps))
    total_W = math.hypot(part.noise_W, part.systematic_W)
    start = f"To halve ±{_watts(total_W)} at {part.speed_mps:.1f} m/s"
    runs = len(results.runs)
    more = more_runs_to_halve(part, runs)
    if more is not None and more <= EVIDENCE.most_repetitions:
        return Halving(
            f"{start}, fly {more} more runs like these {runs}: noise of ±{_watts(part.noise_W)} averages, and"
            f" ±{_watts(part.systematic_W)}, which is common to all runs, remains.",
            by_more_runs=True,
        )
    four = math.hypot(part.noise_W / 2, part.systematic_W)
    return Halving(
        f"{start}, more runs of this kind are not enough: ±{_watts(part.systematic_W)} is common to all runs and does"
        f" not shrink with more of them. Four times the runs would give ±{_watts(four)}."
        f" {_largest_shared(results, sources, part.speed_mps)}",
        by_more_runs=False,
    )


def _watts(power_W: float) -> str:
    """Return watts with two significant digits."""
    return f"{power_W:.{decimals(power_W)}f} W"


def more_runs_to_halve(part: IntervalPart, runs: int) -> int | None:
    """Return how many more runs halve the half width of the interval; None if the shared part alone exceeds that."""
    quarter = (part.noise_W**2 + part.systematic_W**2) / 4
    left = quarter - part.systematic_W**2
    if left <= 0:
        return None
    return math.ceil(runs * (part.noise_W**2 / left - 1))


def _largest_shared(results: Results, sources: Sources | None, speed_mps: float) -> str:
    """Name the sources of the part common to all runs, largest first, and how to reduce them."""
    shares = shares_of_shared(sources, speed_mps)
    if not shares:
        return f"What is common to all runs are {ERRORS_IN_COMMON}."
    text = f"Of the variance at that speed, {in_percent(shares)}."
    lowers = BY_SHARE.get(next(iter(shares)))  # none for angle of attack, whose two errors have separate sentences
    if lowers is None or lowers == results.next_flight_lowers:
        return text
    return f"{text} {REMEDIES[lowers].when}: {REMEDIES[lowers].sentence}."


def stall_margin(results: Results) -> str:
    """Say how far the slowest speed flown is from the stall, as far as the flight shows it."""
    slowest = results.slowest_flown
    if slowest is None:
        return "Not known: the flight's slowest speed is not known."
    CL, largest = slowest.lift_coefficient, slowest.largest_lift_coefficient
    not_flown = (
        f"The stall was not flown. The slowest speed flown is {slowest.speed_mps:.1f} m/s (lift coefficient {CL:.2f})."
    )
    if largest <= CL * 1.005:
        return (
            f"{not_flown} The flight never exceeded this lift coefficient, so the margin to the stall is unknown; it"
            " may be small."
        )
    return (
        f"{not_flown} For a moment the wing carried a lift coefficient of {largest:.2f}: the slowest speed flown has a"
        f" margin of {stall_margin_percent(slowest)} % of speed to the stall at least."
    )


def next_flight(results: Results, sources: Sources | None = None) -> list[str]:
    """Say what to fly next, the most useful first.

    The sentences of the results come first: they say what narrows the interval most. The number of runs that halve the
    interval is given only if there are no such sentences, and the missing excitation of a sensor error only if they do
    not name that error.
    """
    advice = list(results.next_flight)
    to_halve = halving(results, sources)
    if to_halve and not (advice and to_halve.by_more_runs):
        advice.append(to_halve.text)
    if results.balance:
        advice += _after_energy_balance(results)
    if results.minimum_power_speed.speed_mps is None and results.slowest_flown is not None:
        advice.append(
            f"Slower than {results.slowest_flown.speed_mps:.1f} m/s, if the stall allows: power still decreases there,"
            " so that the speed of best endurance is not known."
        )
    if results.path is not None:
        missing: dict[str, list[str]] = {}
        for error in results.path.sensor_errors:
            for reason in error.missing:
                if error.name != results.next_flight_lowers:
                    missing.setdefault(reason, []).append(error.title)
        advice += [
            f"The flight does not determine {', '.join(titles)} ({reason})." for reason, titles in missing.items()
        ]
    if any(point.extrapolated for point in results.main.points):
        advice.append(
            "A propeller table that reaches further, or more motor speed in the fast runs: parts of the curve lie"
            " outside the table (dashed)."
        )
    kinds = sorted({" or ".join(method.not_flown) for method in results.methods if method.not_flown})
    if kinds:
        advice.append(f"For an independent check by other methods: {', '.join(kinds)}.")
    return advice


def _after_energy_balance(results: Results) -> list[str]:
    """Say what narrows a whole flight's interval at the reference speed: more time, or a better calibration."""
    reference_mps = reference_point(results).point.speed_mps
    part = min(results.main.interval_parts, key=lambda part: abs(part.speed_mps - reference_mps))
    halves = f"At {part.speed_mps:.1f} m/s, ±{_watts(math.hypot(part.noise_W, part.systematic_W))} come from"
    parts = f"{halves} ±{_watts(part.noise_W)} of air motion and ±{_watts(part.systematic_W)} of the instruments:"
    if part.noise_W > part.systematic_W:
        advice = [f"{parts} a longer flight in still air, with steady legs at several speeds, narrows it."]
    else:
        advice = [
            f"{parts} the current meter against a charger or clamp meter, mass and pitot narrow it, not more time."
        ]
    if not (results.main.least_power_speed or UNKNOWN_SPEED).inside_flown_range:
        advice.append("Slower, if the stall allows: the speed of best endurance is at the end of the speeds flown.")
    return [*advice, "A plan needs the sensors of drag: flow angles, motor speed and runs; this flight has none."]
