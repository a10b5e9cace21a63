"""The top of the page: aircraft and air, the headline answers as cards, and the notes on the first figure."""

from typing import NamedTuple

from analysis.report.answers import HeadlineAnswer, headline_answers
from analysis.results.schema import Results
from flight.units import GRAVITY_MPS2

FEET_PER_SECOND, KM_PER_HOUR = 1 / 0.3048, 3.6  # of 1 m/s


class AnswerCard(NamedTuple):
    """A headline answer. Of one that is a speed, `speed` is its number in m/s and `answer` what follows the unit."""

    question: str
    speed: str
    answer: str
    other_units: str
    note: str


class SummarySection(NamedTuple):
    title: str
    condition: str
    cards: list[AnswerCard]
    steady_points: bool  # shown in the figure
    motor_note: str  # where the motor was not measured
    warnings: list[str]
    source: str


def summary_section(results: Results) -> SummarySection:
    use = results.use
    return SummarySection(
        title=f"{results.aircraft.title}: power required",
        condition=(
            f"{results.test.weight_N / GRAVITY_MPS2:.2f} kg, air {results.test.air_density_kgpm3:.3f} kg/m³"
            f" ({results.air_temperature_K - 273.15:.0f} °C), propeller {results.aircraft.propeller}"
        ),
        cards=[_card(answer) for answer in headline_answers(results)],
        steady_points=any(method.points for method in results.methods),
        motor_note=use.power_train.basis if use and not use.power_train.measured else "",
        warnings=results.warnings,
        source=f"flightpower {results.software_version}, from {results.log}",
    )


def _card(answer: HeadlineAnswer) -> AnswerCard:
    number, unit, rest = answer.answer.partition(" m/s")
    if not unit:
        return AnswerCard(answer.question, "", answer.answer, "", answer.note)
    speed = float(number)
    other_units = f"{speed * KM_PER_HOUR:.0f} km/h · {speed * FEET_PER_SECOND:.0f} ft/s"
    return AnswerCard(answer.question, number, rest, other_units, answer.note)
