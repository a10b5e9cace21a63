"""How sure: the arithmetic of more runs, the margin to the stall, and what the verdict rests on."""

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from flightpower.analysis.methods.interval_sources import Share
from flightpower.analysis.pages.sections.certainty import (
    certainty_section,
    halving,
    more_runs_to_halve,
    next_flight,
    stall_margin,
)
from flightpower.analysis.pages.sections.summary import reference_point, verdict_section
from flightpower.analysis.records.flight import (
    CurveStatus,
    IntervalPart,
    Kind,
    PathResult,
    Results,
    RunAgainstOthers,
    RunResidual,
    SensorError,
    SlowestFlown,
)
from flightpower.analysis.results.evidence import with_trust
from flightpower.analysis.results.next_flight import Sources


def part(noise_W: float, systematic_W: float) -> IntervalPart:
    return IntervalPart(speed_mps=13.0, noise_W=noise_W, systematic_W=systematic_W)


def drag(results: Results, **of: object) -> Results:
    """The results with fields of the curve of power required replaced."""
    return results.with_curve(Kind.POWER_REQUIRED, **of)


def test_noise_alone_is_halved_by_four_times_the_runs() -> None:
    assert more_runs_to_halve(part(2.0, 0.0), 5) == 15


def test_a_part_that_all_runs_share_takes_more_runs_or_forbids_it() -> None:
    """noise 2, shared 0.9: (4 + 0.81)/4 - 0.81 = 0.3925 W² remain for the noise, which takes 4/0.3925 = 10.2 times the
    runs."""
    assert more_runs_to_halve(part(2.0, 0.9), 10) == 92
    assert more_runs_to_halve(part(1.0, 0.6), 10) is None


def test_the_sentence_says_how_many_runs_or_why_not(results: Results) -> None:
    few = halving(drag(results, interval_parts=[part(2.0, 0.0)]))
    assert few and few.by_more_runs
    assert few.text.startswith("To halve ±2.0 W at 13.0 m/s, fly 3 more runs like these 1:")
    never = halving(drag(results, interval_parts=[part(1.0, 2.0)]))
    assert never and not never.by_more_runs
    assert "±2.0 W is common to all runs" in never.text
    assert "Four times the runs would give ±2.1 W." in never.text  # sqrt(0.5^2 + 2^2)
    assert halving(drag(results, interval_parts=[])) is None


def test_the_next_flight_of_the_results_is_reported_first_and_nothing_twice(results: Results) -> None:
    by_runs = drag(results, interval_parts=[part(2.0, 0.0)])
    shared = drag(results, interval_parts=[part(1.0, 2.0)])
    assert next_flight(by_runs)[0].startswith("To halve")
    sentence = "The next twenty minutes: porpoise. The interval is widest by the slope of angle of attack."
    first, *others = next_flight(replace(by_runs, next_flight=[sentence]))
    assert first == sentence and not any("To halve" in other for other in others)
    first, second, *_ = next_flight(replace(shared, next_flight=[sentence]))
    assert first == sentence and "are not enough" in second  # the propeller table is in no other sentence
    error = SensorError(
        name="alpha_scale", title="slope of angle of attack", value=0.0, standard_error=3.0, assumed_sigma=3.0,
        unit="%", determined=False, missing=["gusts"],
    )  # fmt: skip
    path = PathResult(converged=True, gust_mps=0.7, residuals={}, checks=[], sensor_errors=[error])
    gusty = replace(results, path=path)
    assert "The flight does not determine slope of angle of attack (gusts)." in next_flight(gusty)
    assert not any(
        "gusts" in advice
        for advice in next_flight(replace(gusty, next_flight=[sentence], next_flight_lowers="alpha_scale"))
    )


def by_source(**watts2: float) -> Sources:
    """Sources with these variances [W^2] by name, each of them equal at all speeds."""
    return lambda V: {Share[name]: np.full(len(V), variance) for name, variance in watts2.items()}


def test_what_is_common_to_all_runs_is_named_by_its_parts_the_largest_first(results: Results) -> None:
    """20 W^2 in all: 5 of noise, 9 of updraft, 5 of airspeed, 0.95 of thrust, and 0.05, a quarter of a percent."""
    shared = drag(results, interval_parts=[part(1.0, 2.0)])
    sources = by_source(NOISE=5.0, PROPELLER=0.95, AIRSPEED=5.0, UPDRAFT=9.0, WEIGHT=0.05)
    parts = "45 % comes from updraft, 25 % from airspeed, 5 % from thrust of the propeller"
    text = halving(shared, sources).text  # type: ignore[union-attr]
    assert f"Of the variance at that speed, {parts}. The next twenty minutes: fly on another day" in text
    section = certainty_section(shared, sources)
    assert section.shared_part.endswith(f"of the variance, {parts}") and text in section.next_flight
    advised = replace(shared, next_flight_lowers="updraft")
    assert halving(advised, sources).text.endswith(f"{parts}.")  # type: ignore[union-attr]
    thrust = by_source(NOISE=1.0, PROPELLER=2.0, UPDRAFT=1.0)
    assert "have a table measured with this propeller" in halving(shared, thrust).text  # type: ignore[union-attr]
    for unknown in (None, by_source(NOISE=1.0, SHARED=4.0)):
        assert "errors of the sensors, of the propeller table" in halving(shared, unknown).text  # type: ignore[union-attr]
        assert certainty_section(shared, unknown).shared_part.endswith("air that rises or sinks")


def test_the_margin_to_the_stall_is_what_the_wing_has_carried(results: Results) -> None:
    slowest = SlowestFlown(speed_mps=12.0, lift_coefficient=1.0, largest_lift_coefficient=1.21)
    assert "a margin of 10 % of speed to the stall at least" in stall_margin(replace(results, slowest_flown=slowest))
    none = replace(slowest, largest_lift_coefficient=1.0)
    assert "margin to the stall is unknown" in stall_margin(replace(results, slowest_flown=none))
    assert "not known" in stall_margin(results)


def test_the_verdict_is_the_curve_at_the_speed_of_least_drag(results: Results) -> None:
    reference, meaning = reference_point(results)
    assert (reference.speed_mps, meaning) == (13.1, "the speed of least drag")
    unknown = replace(results.best_range_speed, speed_mps=None)
    middle, meaning = reference_point(drag(results, best_range_speed=unknown, least_power_speed=unknown))
    ends = results.power_required[0].speed_mps, results.power_required[-1].speed_mps
    assert middle.speed_mps == pytest.approx(np.mean(ends), abs=0.3) and meaning == "the middle of those flown"
    assert reference.power_lo_W < reference.power_W < reference.power_hi_W
    assert "; 1 pair of methods differs" in verdict_section(results).reasons
    agreeing = replace(results, disagreements=[])
    assert "1 other method agrees within the intervals" in verdict_section(agreeing).reasons
    for wrong, heading in (
        ({"status": CurveStatus.NOT_CONVERGED}, "Not to be trusted as it stands"),
        ({"cross_check_differs": True}, "Doubtful"),
    ):
        headings = [verdict_section(with_trust(item)).heading for item in (agreeing, replace(agreeing, **wrong))]
        assert headings == ["Trusted", heading]


def test_a_fit_of_the_runs_alone_is_said_to_agree_only_where_it_is_compared(results: Results) -> None:
    def answer(**changed: Any) -> str:
        rows = certainty_section(replace(results, **changed)).checks.rows
        return dict(rows)["Does a fit of the runs alone agree?"]

    assert answer() == "Yes, within what the intervals allow (output error)."
    assert answer(cross_check_differs=True).startswith("No: it differs by more than")
    still, moving = (verdict_section(replace(results, cross_check=c)).reasons for c in (results.cross_check, []))
    assert "the cross-check on the runs alone agrees" in still and "cross-check" not in moving


def test_residuals_that_are_not_white_are_said_to_be(results: Results) -> None:
    def answer(autocorrelation: list[float]) -> str:
        run = RunResidual(run="acceleration at 1 s", points=100, step_s=0.2, rms_mps2=0.1,
                          autocorrelation=[1.0, *autocorrelation])  # fmt: skip
        return dict(certainty_section(replace(results, run_residuals=[run])).checks.rows)[
            "Do the fits leave only noise?"
        ]

    assert answer([0.1] * 20).startswith("Yes. 0 %")
    assert answer([0.5] * 10 + [0.0] * 10).startswith("Not only") and "50 %" in answer([0.5] * 10 + [0.0] * 10)


def test_the_certificate_lists_each_run_and_the_answer_names_the_largest_difference(results: Results) -> None:
    assert certainty_section(results).certificate is None
    runs = [
        RunAgainstOthers(run=f"acceleration at {i} s", kind="acceleration", speed_mps=17.0, power_W=70.0 + z,
                         others_W=70.0, standard_error_W=1.0, z=z)
        for i, z in enumerate((0.5, -7.0))
    ]  # fmt: skip
    for some, answer in ((runs[:1], "Yes"), (runs, "No")):
        section = certainty_section(replace(results, runs_against_others=some))
        assert section.certificate is not None and len(section.certificate.rows) == len(some)
        assert dict(section.checks.rows)["Do the runs agree with each other?"].startswith(answer)
        differences = dict(zip(section.certificate.header, zip(*section.certificate.rows, strict=True), strict=True))
        assert differences["difference, %"] == ("+0.7", "-10.0")[: len(some)], "0.5 and -7 W of 70"
