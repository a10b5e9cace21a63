"""Compares every speed that results and report name with the slowest one flown; benchmarks and tests share this."""

import re
from collections.abc import Iterator

import numpy as np

from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.pages.answers import headline_answers
from flightpower.analysis.pages.charts.power import every_method, power_required, run_by_run
from flightpower.analysis.pages.sections.certainty import certainty_section
from flightpower.analysis.pages.sections.curve import curve_section, methods_section
from flightpower.analysis.pages.sections.performance import loading_rows, speed_rows
from flightpower.analysis.pages.sections.summary import verdict_section
from flightpower.analysis.records.flight import Results

ROUNDED = 0.051  # speeds are written to a tenth of a meter per second


def below_slowest(results: Results, *, figures: bool = True) -> list[str]:
    """Describe every speed in results and report that is below the slowest speed flown, or below the speed at its lift
    coefficient."""
    named = [*_speeds(results), *(_drawn_speeds(results) if figures else ())]
    return [f"{where}: {V:.2f} m/s" for where, V, slowest in named if V < slowest]


def _speeds(results: Results) -> Iterator[tuple[str, float, float]]:
    """Yield where a speed is named, the speed, and the slowest speed allowed there [m/s]."""
    flown = results.slowest_flown
    assert flown is not None
    S = results.aircraft.wing_area_m2
    slowest = _slowest(results)

    def slowest_at(weight_N: float, rho: float) -> float:
        return float(speed_at(flown.lift_coefficient, Condition(weight_N, rho, S))) * (1 - 1e-9)

    for name in ("minimum_power_speed", "best_range_speed"):
        result = getattr(results, name)
        yield from ((name, v, slowest) for v in (result.speed_mps, result.lo_mps, result.hi_mps) if v is not None)
    yield from (("power_required", p.speed_mps, slowest) for p in results.power_required + results.cross_check)
    condition = results.standard
    standard = slowest_at(condition.weight_N, condition.air_density_kgpm3)
    yield from (("power_required_standard", p.speed_mps, standard) for p in results.power_required_standard)
    for method in results.methods + results.single_runs:
        yield from ((method.title, p.speed_mps, slowest) for p in method.power_required)
    yield from (("disagreements", disagreement.speed_mps, slowest) for disagreement in results.disagreements)
    use = results.use
    if use is not None:
        yield from (("power_available", p.speed_mps, slowest) for p in use.available.power_available)
        yield from (("efficiency", p.speed_mps, slowest) for p in use.power_train.efficiency)
        yield from (("field_table", row.speed_mps, slowest) for row in use.field_table)
        for case, cells in zip(use.loadings, loading_rows(use), strict=True):
            least = slowest_at(case.weight_N, case.air_density_kgpm3)
            for best in (case.endurance_speed_mps, case.range_speed_mps):
                yield from ((case.title, v, least) for v in (best.value, best.lo, best.hi))
            yield from (("loadings", float(cells[i].split("\u00a0")[0]), least - ROUNDED) for i in (3, 5))
        yield from (("field", float(cells[0].removesuffix(" *")), slowest) for cells in speed_rows(use))
    for text in _texts(results):
        for number in re.findall(r"(\d+\.\d+)(?: to (\d+\.\d+)\))? m/s(?!²)", text):
            yield from ((f'"{text}"', float(n), slowest - ROUNDED) for n in number if n)
        for lo, hi in re.findall(r"m/s \((\d+\.\d+|up) to (\d+\.\d+)\)", text):
            yield from ((f'"{text}"', float(n), slowest - ROUNDED) for n in (lo, hi) if n != "up")


def _drawn_speeds(results: Results) -> Iterator[tuple[str, float, float]]:
    slowest = _slowest(results) - ROUNDED
    for figure in (power_required(results), every_method(results), run_by_run(results)):
        yield from ((f"figure, {t.name}", float(np.nanmin(t.x)), slowest) for t in figure.marks if len(t.x))


def _slowest(results: Results) -> float:
    """The slowest speed of any curve: a method on steady points begins at its own slowest point, which was flown."""
    assert results.slowest_flown is not None
    points = [point.speed_mps for method in results.methods for point in method.points]
    return min([results.slowest_flown.speed_mps, *points]) * (1 - 1e-9)


def _texts(results: Results) -> Iterator[str]:
    """Sentences and cells of the report that may name a speed of flight; a rate of climb is no such speed."""
    for answer in headline_answers(results):
        yield answer.answer
        yield re.sub(r"Climbs .*? m/s \(.*?\)", "", answer.note)
    curve = curve_section(results)
    yield from (text for _, text in curve.facts)
    yield from (f"{row[0]} m/s" for row in curve.table.rows)
    certainty = certainty_section(results)
    yield from (certainty.stall, *certainty.next_flight)
    yield verdict_section(results).sentence
    methods = methods_section(results)
    yield from methods.disagreements
    yield from (cell for row in methods.table.rows for cell in row[3:5])
    yield from (warning for warning in results.warnings if "differ" in warning)
