"""The top of the page: power required at one speed, whether it can be trusted, and the headline answers as cards."""

from typing import NamedTuple

import numpy as np

from flightpower.analysis.pages.answers import HeadlineAnswer, headline_answers
from flightpower.analysis.pages.sections.flight import temperature_text
from flightpower.analysis.pages.wording import VERDICT
from flightpower.analysis.records.flight import CurveStatus, Kind, PowerPoint, Results
from flightpower.analysis.results.evidence import sentences
from flightpower.analysis.results.settings import RESULTS
from flightpower.flight.units import FOOT_M, GRAVITY_MPS2


class AnswerCard(NamedTuple):
    """A headline answer. If it is a speed, `speed` is the number in m/s, and `answer` the text after the unit."""

    question: str
    speed: str
    answer: str
    other_units: str
    note: str


class SummarySection(NamedTuple):
    title: str
    condition: str
    cards: list[AnswerCard]
    steady_points: bool  # whether the figure shows them
    motor_note: str  # set if the motor was not measured
    warnings: list[str]
    source: str


def summary_section(results: Results) -> SummarySection:
    use = results.use
    return SummarySection(
        title=f"{results.aircraft.title}: {results.kind.words}",
        condition=(
            f"{results.test.weight_N / GRAVITY_MPS2:.2f} kg, air {results.test.air_density_kgpm3:.3f} kg/m³"
            f"{temperature_text(results.air)}"
            f"{f', propeller {results.aircraft.propeller}' if results.aircraft.propeller else ''}"
        ),
        cards=[_card(answer) for answer in headline_answers(results)],
        steady_points=any(method.points for method in results.methods),
        motor_note=use.power_train.basis if use and not use.power_train.measured else "",
        warnings=results.warnings,
        source=f"flightpower {results.software_version}, from {results.log}",
    )


def _card(answer: HeadlineAnswer) -> AnswerCard:
    if answer.speed_mps is None:
        return AnswerCard(answer.question, "", answer.remark, "", answer.note)
    speed = f"{answer.speed_mps:.1f}"
    other_units = f"{3.6 * float(speed):.0f} km/h · {float(speed) / FOOT_M:.0f} ft/s"
    return AnswerCard(answer.question, speed, answer.remark, other_units, answer.note)


class NamedPoint(NamedTuple):
    """A point of the curve, and the name of its speed."""

    point: PowerPoint
    meaning: str


class VerdictSection(NamedTuple):
    number: str
    interval: str
    sentence: str
    heading: str
    color_class: str
    reasons: str  # empty if the heading says everything

    @property
    def colon(self) -> str:
        """The punctuation between heading and reasons."""
        return ":" if self.reasons else "."


def reference_point(results: Results) -> NamedPoint:
    """Return the point at the speed of best range, which is the speed of least drag if drag is known; else at the speed
    of least power, or at the middle of the speeds flown."""
    main = results.main
    candidates = (
        (main.best_range_speed, f"the speed of {'best range' if results.kind is Kind.ELECTRICAL else 'least drag'}"),
        (main.least_power_speed, "the speed of least power"),
    )
    for optimum, meaning in candidates:
        if optimum and optimum.speed_mps is not None and optimum.inside_flown_range:
            return NamedPoint(_point_at(results, optimum.speed_mps), meaning)
    curve = main.points
    return NamedPoint(_point_at(results, (curve[0].speed_mps + curve[-1].speed_mps) / 2), "the middle of those flown")


def _point_at(results: Results, speed_mps: float) -> PowerPoint:
    curve = results.main.points
    V = [point.speed_mps for point in curve]
    power, lo, hi = (
        float(np.interp(speed_mps, V, values))
        for values in np.array([(p.power_W, p.power_lo_W, p.power_hi_W) for p in curve]).T
    )
    return PowerPoint(speed_mps=speed_mps, power_W=power, power_lo_W=lo, power_hi_W=hi)


def verdict_section(results: Results) -> VerdictSection:
    reference, meaning = reference_point(results)
    heading, color_class = VERDICT[results.trust]
    half_percent = 50 * (reference.power_hi_W - reference.power_lo_W) / reference.power_W
    wide = half_percent >= 100 * RESULTS.wide
    what = "from the battery" if results.kind is Kind.ELECTRICAL else "drag times true airspeed"
    return VerdictSection(
        number=f"{reference.power_W:.1f} W",
        interval=f"{reference.power_lo_W:.1f} to {reference.power_hi_W:.1f} W",
        sentence=(
            f"in level flight at {reference.speed_mps:.1f} m/s, {meaning}. This is {what}, for"
            f" {results.test.weight_N / GRAVITY_MPS2:.2f} kg in air of {results.test.air_density_kgpm3:.3f} kg/m³."
        ),
        heading=f"{heading}, but wide (±{half_percent:.0f} %)" if wide else heading,
        color_class=color_class,
        reasons=" ".join(sentences(results.evidence)) or _support(results),
    )


def _support(results: Results) -> str:
    """Say what supports the result; empty if no other method was applied."""
    if results.kind is Kind.ELECTRICAL:
        return ""
    others = sum(bool(method.power_required) for method in results.methods)
    parts = ["the estimation converged" if results.status is CurveStatus.CONVERGED else results.verdict]
    pairs = len(results.disagreements)
    if others and not pairs:
        parts.append(f"{others} other {'method agrees' if others == 1 else 'methods agree'} within the intervals")
    if results.cross_check:
        parts.append("the cross-check on the runs alone agrees")
    differ = "1 pair of methods differs" if pairs == 1 else f"{pairs} pairs of methods differ"
    reason = f"; {differ}, and the comparison of methods gives the reason" if pairs else ""
    return f"{', '.join(parts)}{reason}."
