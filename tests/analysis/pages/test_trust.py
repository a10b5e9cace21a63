"""Evidence against a result makes it doubtful or not to be trusted; `analyze` reports it and ends with exit code 1."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from msgspec.structs import replace
from typer.testing import CliRunner

from flightpower.analysis.cli.analyze import _finish
from flightpower.analysis.cli.export import app as export_app
from flightpower.analysis.missions.information import read_results
from flightpower.analysis.pages.one_log import Report
from flightpower.analysis.pages.sections.curve import curve_section
from flightpower.analysis.pages.sections.summary import verdict_section
from flightpower.analysis.records.flight import (
    CurveStatus,
    EnergyBalanceResult,
    Evidence,
    EvidenceKind,
    ImplausibleReadings,
    Interval,
    JointConflict,
    Kind,
    LevelEfficiencyPoint,
    MethodRejection,
    MethodTried,
    PartOfResult,
    PathResult,
    PoolingStatistics,
    PriorMeasurementStatistics,
    Results,
    RunAgainstOthers,
    Trust,
)
from flightpower.analysis.results.evidence import (
    evidence_against,
    noise_limit,
    reasons_not_to_trust,
    sentences,
    trust_by,
    with_trust,
)
from flightpower.analysis.results.files import to_json
from flightpower.analysis.results.provenance import provenance_of_file
from flightpower.analysis.results.settings import TRUST
from flightpower.analysis.trajectory.equations import SENSOR_ERRORS
from flightpower.flight.command_line import ExitCode
from flightpower.flight.errors import InputError
from flightpower.flight.messages import Comparison

NOT_TRUSTED = {
    EvidenceKind.NOT_CONVERGED: lambda r: replace(r, status=CurveStatus.NOT_CONVERGED, verdict="at a bound: A0 = 0"),
    EvidenceKind.TRAJECTORY_NOT_CONVERGED: lambda r: replace(r, status=CurveStatus.TRAJECTORY_NOT_CONVERGED),
    EvidenceKind.INTERVAL_REACHES_ZERO: lambda r: drag(r, points=[replace(r.power_required[0], power_lo_W=-1.0)]),
    EvidenceKind.POLAR_CURVES_DOWNWARD: lambda r: replace(r, drag_polar=replace(r.drag_polar, A2=-0.01)),
    EvidenceKind.THRUST_TABLE: lambda r: drag(r, statistics=statistics(thrust_scale=-19.0)),
    EvidenceKind.MOTOR_SPEED: lambda r: replace(r, speed_over_motor_constant=0.79),
    EvidenceKind.RUN_AGAINST_OTHERS: lambda r: replace(r, runs_against_others=[compared(0.5), compared(-9.0)]),
    EvidenceKind.SENSOR_ERROR: lambda r: drag(
        replace(r, path=path(V_scale=-7.3)), statistics=with_error("V_scale", 0.9)
    ),
}
DOUBTFUL = {
    EvidenceKind.CROSS_CHECK: lambda r: replace(r, cross_check_differs=True),
    EvidenceKind.THRUST_TABLE: lambda r: drag(r, statistics=statistics(thrust_slope=4.0)),
    EvidenceKind.MOTOR_SPEED: lambda r: replace(r, speed_over_motor_constant=14 / 12),
    EvidenceKind.RUN_AGAINST_OTHERS: lambda r: replace(r, runs_against_others=[compared(0.5), compared(-6.0)]),
    EvidenceKind.OUTSIDE_TABLE: lambda r: drag(
        r, points=[replace(point, extrapolated=True) for point in r.power_required]
    ),
    EvidenceKind.IMPLAUSIBLE_READINGS: lambda r: doubted(r, Comparison.AIRSPEED),
    EvidenceKind.SENSOR_ERROR: lambda r: drag(
        replace(r, path=path(V_scale=-4.8)), statistics=with_error("V_scale", 0.9)
    ),
    EvidenceKind.SENSOR_ERRORS_TOGETHER: lambda r: together(r, 0.001),
}


def doubted(results: Results, compared: Comparison, after_s: float = 0.0) -> Results:
    """The results with two seconds of readings that contradict each other, starting `after_s` after the start of the
    run."""
    (run,) = results.runs
    period = ImplausibleReadings(compared=compared, start_s=run.start_s + after_s, end_s=run.start_s + after_s + 2.0)
    origin = provenance_of_file(Path(__file__), "", None, "")
    return replace(results, provenance=replace(origin, implausible=[period]))


def statistics(stand: float = 0.0, **sigmas: float) -> PoolingStatistics:
    """Statistics of a flight whose only thrust corrections are these multiples of the prior deviation, 0.1."""
    names = ["A0", "A1", "A2", "thrust_scale", "thrust_slope"]
    values = [0.05, 0.0, 0.06, *(0.1 * sigmas.get(name, 0.0) for name in names[3:])]
    return PoolingStatistics(
        names=names, values=values, covariance=[], weighting_covariance=[], prior_mean=[0.0] * 5,
        prior_sigma=[None, None, None, 0.1, 0.1], changes={}, polar_covariance=[], flown_CL=(0.2, 1.0),
        installation="", propeller_table="", probe_calibration="",
        prior_measurements=[
            PriorMeasurementStatistics(name="stand", coefficients={"A0": 1.0}, value=0.05 - stand, sigma=1.0)
        ],
    )  # fmt: skip


def with_error(name: str, half_widths: float) -> PoolingStatistics:
    """Statistics with an estimate of a sensor error of 0.05 ± 0.01, which changes the constant term of drag by so many
    half widths of its interval, 0.0196."""
    by_error = half_widths * 0.0196 / 0.05 * 0.01**2
    base = statistics()
    return replace(
        base, names=[*base.names, name], values=[*base.values, 0.05], prior_mean=[*base.prior_mean, 0.0],
        prior_sigma=[*base.prior_sigma, 0.01],
        covariance=[[]] * 5 + [[by_error, 0.0, 0.0, 0.0, 0.0, 0.01**2]],
        polar_covariance=[[0.01**2, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]],
    )  # fmt: skip


def compared(z: float) -> RunAgainstOthers:
    return RunAgainstOthers(
        run="acceleration at 10 s", kind="acceleration", speed_mps=17.0, power_W=70.0, others_W=70.0 - z,
        standard_error_W=1.0, z=z,
    )  # fmt: skip


def path(**conflicts: float) -> PathResult:
    return PathResult(
        converged=True, gust_mps=0.1, residuals={}, checks=[], sensor_errors=[], prior_conflicts=conflicts
    )


def together(results: Results, probability: float, **conflicts: float) -> Results:
    """Results of a flight with two sensor errors of this joint probability, and single ones beyond their priors."""
    pair = JointConflict(errors={"alpha_bias": -3.4, "alpha_scale": -3.5}, probability=probability)
    return drag(replace(results, path=replace(path(**conflicts), joint_conflict=pair)), statistics=statistics())


def test_sensor_errors_that_are_improbable_together_are_named_unless_one_is_reported_alone(results: Results) -> None:
    (evidence,) = with_trust(together(results, 0.001)).evidence
    assert "offset of angle of attack (-3.4)" in evidence.text and "slope of angle of attack (-3.5)" in evidence.text
    assert with_trust(together(results, 0.004)).evidence == []
    (alone,) = with_trust(together(results, 0.001, V_scale=-4.8)).evidence
    assert alone.kind is EvidenceKind.SENSOR_ERROR


@pytest.mark.parametrize(
    ("sigmas", "half_widths", "level", "ending"),
    [
        (-4.8, 0.9, Trust.DOUBTFUL, ")"),
        (-4.8, 1.1, Trust.NOT_TO_BE_TRUSTED, "; its correction moves the curve out of the interval)"),
        (-7.3, 1.1, Trust.NOT_TO_BE_TRUSTED, "; not to be trusted beyond 2 times that)"),
    ],
)
def test_a_sensor_error_says_by_which_of_two_reasons_it_is_not_to_be_trusted(
    results: Results, sigmas: float, half_widths: float, level: Trust, ending: str
) -> None:
    errs = drag(replace(results, path=path(V_scale=sigmas)), statistics=with_error("V_scale", half_widths))
    (evidence,) = with_trust(errs).evidence
    assert evidence.level is level and evidence.limit is not None
    assert f"assumed (limit {evidence.limit:.1f}{ending}. Usually" in evidence.text


def test_an_updraft_that_the_curve_is_corrected_for_is_reported(results: Results) -> None:
    """It has its own limit, exceeded by 1 % of daytime flights; written results can be read back."""
    (evidence,) = with_trust(
        drag(replace(results, path=path(updraft=-2.6, V_scale=-2.6)), statistics=statistics())
    ).evidence
    assert evidence.subject == "updraft" and evidence.false_alarm_rate == pytest.approx(0.0124, abs=1e-4)
    assert "updraft" in str(to_json(replace(results, evidence=[evidence])))


def efficiency(results: Results, propeller: Interval, motor: Interval) -> Results:
    point = LevelEfficiencyPoint(speed_mps=15.0, propeller=propeller, motor=motor, overall=motor, extrapolated=False)
    assert results.use is not None
    return replace(
        results,
        use=replace(results.use, power_train=replace(results.use.power_train, measured=True, efficiency=[point])),
    )


@pytest.mark.parametrize("name", SENSOR_ERRORS)
def test_a_sensor_error_is_named_in_words(results: Results, name: str) -> None:
    """This includes the zeros, which are not listed among the sensor errors of the path."""
    assert all(name not in cell for row in curve_section(results).parameters.rows for cell in row)
    (evidence,) = with_trust(drag(replace(results, path=path(**{name: -9.5})), statistics=statistics())).evidence
    assert (evidence.subject, evidence.figure) == (name, -9.5)
    if "_" in name:  # "updraft" is a word
        assert name not in evidence.text
    assert "-9.5 times the standard deviation" in evidence.text


@pytest.mark.parametrize(
    ("sigmas", "half_widths", "trust"),
    [(4.8, 0.9, Trust.DOUBTFUL), (4.8, 1.1, Trust.NOT_TO_BE_TRUSTED), (-7.3, 0.1, Trust.NOT_TO_BE_TRUSTED),
     (3.3, 9.0, Trust.TRUSTED)],
)  # fmt: skip
def test_an_interval_that_did_not_grow_to_the_size_of_a_conflict_is_not_to_be_trusted(
    results: Results, sigmas: float, half_widths: float, trust: Trust
) -> None:
    """Another defect may look like a sensor error; then the right curve is the one without its correction. The limit is
    3.5."""
    changed = with_trust(
        drag(replace(results, path=path(V_scale=sigmas)), statistics=with_error("V_scale", half_widths))
    )
    assert changed.trust is trust


@pytest.mark.parametrize("kind", NOT_TRUSTED)
def test_a_result_not_to_be_trusted_says_why_on_stderr_with_exit_code_1(
    results: Results, kind: EvidenceKind, capsys: Any
) -> None:
    assert _finish(Report(results, print), json=True, quiet=False) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["format"] == results.format and printed.err == ""
    changed = with_trust(NOT_TRUSTED[kind](results))
    assert changed.trust is Trust.NOT_TO_BE_TRUSTED and [evidence.kind for evidence in changed.evidence] == [kind]
    assert _finish(Report(changed, print), json=False, quiet=True) == 1
    printed = capsys.readouterr()
    assert len(printed.err.splitlines()) == 1 and printed.out == ""


@pytest.mark.parametrize("kind", DOUBTFUL)
def test_a_doubtful_result_says_so_first_and_ends_with_exit_code_0(
    results: Results, kind: EvidenceKind, capsys: Any
) -> None:
    changed = with_trust(DOUBTFUL[kind](results))
    assert changed.trust is Trust.DOUBTFUL and [evidence.kind for evidence in changed.evidence] == [kind]
    assert reasons_not_to_trust(changed) == []
    assert _finish(Report(changed, print), json=True, quiet=False) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["trust"] == Trust.DOUBTFUL and len(printed.err.splitlines()) == 1
    assert printed.err.startswith(f"doubtful: {changed.evidence[0].part}.")


@pytest.mark.parametrize(
    ("z", "trust"),
    [(2.9, Trust.TRUSTED), (-3.1, Trust.DOUBTFUL), (5.8, Trust.DOUBTFUL), (-6.1, Trust.NOT_TO_BE_TRUSTED)],
)
def test_accelerations_against_decelerations_doubt_the_thrust_of_a_curve_by_energy(
    results: Results, z: float, trust: Trust
) -> None:
    """One test at 0.3 % has its limit at 2.97 standard errors; from twice that on, the curve is not to be trusted."""
    changed = with_trust(replace(results, accelerations_against_decelerations=compared(z)))
    assert changed.trust is trust
    assert [evidence.kind for evidence in changed.evidence] == [EvidenceKind.THRUST_TABLE] * (
        trust is not Trust.TRUSTED
    )


def test_a_page_says_what_is_in_doubt_where_it_changes() -> None:
    doubts = [
        Evidence(kind=EvidenceKind.CROSS_CHECK, level=Trust.DOUBTFUL, part=part, log="1.mcap", text=f"{i}")
        for i, part in enumerate((PartOfResult.CURVE, PartOfResult.CURVE, PartOfResult.POWER_TRAIN))
    ]
    message = sentences(doubts)
    assert message[0].startswith(PartOfResult.CURVE) and PartOfResult.CURVE not in message[1]
    assert 0 < message[2].index(PartOfResult.POWER_TRAIN) < message[2].index("1.mcap: 2")


@pytest.mark.parametrize(
    ("compared", "after_s", "shared_s"),
    [(Comparison.AIRSPEED, 7.0, 1.0), (Comparison.AIRSPEED, 9.0, 0.0), (Comparison.GPS, 0.0, 0.0)],
)
def test_readings_are_doubted_only_in_runs(
    results: Results, compared: Comparison, after_s: float, shared_s: float
) -> None:
    """The GPS receiver only aids the trajectory, so the trajectory reports its faults."""
    figures = [e.figure for e in evidence_against(doubted(results, compared, after_s))]
    assert figures == [shared_s] * (shared_s > 0)


def test_the_evidence_of_a_sound_result_is_none(with_battery: Results) -> None:
    assert evidence_against(with_battery) == [] and with_trust(with_battery).trust is Trust.TRUSTED


def test_thrust_within_what_noise_and_prior_allow_is_no_evidence(results: Results) -> None:
    """In a sound flight with three corrections, one lies beyond 3.3 standard deviations in one flight of 300."""
    assert 3.2 < noise_limit(3) < 3.4
    assert evidence_against(drag(results, statistics=statistics(thrust_scale=3.0))) == []


def test_a_stand_that_the_flight_denies_is_evidence(results: Results) -> None:
    (item,) = evidence_against(drag(results, statistics=statistics(stand=5.0)))
    assert item.kind is EvidenceKind.THRUST_TABLE and item.figure == pytest.approx(5.0)


def test_efficiencies_above_one_are_impossible_and_above_any_propeller_doubtful(with_battery: Results) -> None:
    sound, above_one = Interval(value=0.8, lo=0.75, hi=0.85), Interval(value=1.1, lo=1.05, hi=1.15)
    uncertain, best = Interval(value=1.1, lo=0.7, hi=1.5), Interval(value=0.95, lo=0.92, hi=0.98)
    verdicts = [
        trust_by(evidence_against(efficiency(with_battery, propeller, motor)))
        for propeller, motor in (
            (sound, sound), (above_one, sound), (sound, above_one), (uncertain, sound), (best, sound), (sound, best)
        )
    ]  # fmt: skip
    N, D, T = Trust.NOT_TO_BE_TRUSTED, Trust.DOUBTFUL, Trust.TRUSTED
    assert verdicts == [T, N, N, D, D, T]


@pytest.mark.parametrize(
    ("efficiency", "level"),
    [
        # Expected is 0.6 within a factor of 1.17: half of that is 3.3 standard deviations off, if known to 15 %.
        ((0.6, 0.5, 0.7), None), ((0.3, 0.222, 0.405), Trust.DOUBTFUL), ((0.4, 0.3, 0.53), None),
        ((0.29, 0.18, 0.47), Trust.DOUBTFUL), ((0.25, 0.08, 0.8), None), ((0.17, 0.15, 0.19), Trust.NOT_TO_BE_TRUSTED),
        ((0.89, 0.66, 1.2), None), ((0.92, 0.75, 1.13), Trust.DOUBTFUL), ((1.1, 0.6, 2.0), None),
        ((0.95, 0.85, 1.06), Trust.NOT_TO_BE_TRUSTED), ((2.9, 2.5, 3.3), Trust.NOT_TO_BE_TRUSTED),
    ],
)  # fmt: skip
def test_a_power_train_of_impossible_efficiency_tells_a_wrong_current(
    results: Results, efficiency: tuple[float, float, float], level: Trust | None
) -> None:
    value, lo, hi = efficiency
    evidence = evidence_against(balanced(results, thrust_efficiency=Interval(value=value, lo=lo, hi=hi)))
    assert [(item.kind, item.level, item.figure) for item in evidence] == (
        [(EvidenceKind.THRUST_EFFICIENCY, level, value)] if level else []
    )
    assert all(
        f"{value:.2f} ({lo:.2f} to {hi:.2f})" in item.text and "current sensor" in item.text for item in evidence
    )
    assert all(f"shown {0.6 / value:.2g} times" in item.text for item in evidence)


@pytest.mark.parametrize(("times", "doubted"), [(1.0, False), (2.0, False), (10.0, True)])
def test_a_mass_that_no_wing_carries_at_the_slowest_speed_is_doubted(
    results: Results, times: float, doubted: bool
) -> None:
    heavier = replace(results.test, weight_N=times * results.test.weight_N)
    slowest_mps = results.power_required[0].speed_mps
    CL = 2 * heavier.weight_N / (heavier.air_density_kgpm3 * slowest_mps**2 * results.aircraft.wing_area_m2)
    evidence = evidence_against(replace(results, test=heavier))
    assert [(item.level, item.figure) for item in evidence if item.kind is EvidenceKind.LIFT_COEFFICIENT] == (
        [(Trust.DOUBTFUL, pytest.approx(CL))] if doubted else []
    )
    assert (CL > 2.5) == doubted


@pytest.mark.parametrize(
    ("reasons", "is_reported"),
    [
        ([MethodRejection.UNPHYSICAL, MethodRejection.NOT_FLOWN], True),
        ([MethodRejection.NOT_FLOWN, MethodRejection.NO_ESTIMATE], True),
        ([MethodRejection.NOT_FLOWN, MethodRejection.NOT_FLOWN], False),
        ([MethodRejection.UNPHYSICAL, MethodRejection.NONE], False), ([], False),
    ],
)  # fmt: skip
def test_a_method_that_the_runs_allow_and_that_fails_is_reported_first(
    results: Results, reasons: list[MethodRejection], is_reported: bool
) -> None:
    """A method without flown runs is not named; no method is named if another one gives the curve."""
    tried = [
        MethodTried(name=f"m{i}", title=f"Method {i}", reason=reason, text=reason) for i, reason in enumerate(reasons)
    ]
    of_low = Interval(value=0.29, lo=0.24, hi=0.35)
    evidence = evidence_against(replace(balanced(results, thrust_efficiency=of_low), methods_tried=tried))
    kinds = [EvidenceKind.METHOD_FAILED, EvidenceKind.THRUST_EFFICIENCY]
    assert [item.kind for item in evidence] == kinds[not is_reported :] and trust_by(evidence) is Trust.DOUBTFUL
    if is_reported:
        failed = next(method_tried for method_tried in tried if method_tried.reason is not MethodRejection.NOT_FLOWN)
        assert evidence[0].subject == failed.name and f"{failed.title}: {failed.text}" in evidence[0].text


@pytest.mark.parametrize(("share", "doubtful"), [(0.15, True), (0.46, False), (0.9, False), (1.03, True)])
def test_a_shaft_that_takes_what_no_motor_gives_is_reported(results: Results, share: float, doubtful: bool) -> None:
    evidence = evidence_against(balanced(results, shaft_over_electrical=share))
    assert [(item.kind, item.level, item.figure) for item in evidence] == (
        [(EvidenceKind.MOTOR_EFFICIENCY, Trust.DOUBTFUL, share)] if doubtful else []
    )


def balanced(results: Results, **more: Any) -> Results:
    """Results with only a curve of electrical power."""
    energy_balance_result = EnergyBalanceResult(residual_W=3.0, flown_s=600.0, airspeed_scale=None, **more)
    curves = {Kind.ELECTRICAL: results.main}
    return replace(results, drag_polar=None, kind=Kind.ELECTRICAL, curves=curves, balance=energy_balance_result)


def drag(results: Results, **of: Any) -> Results:
    """The results with fields of the curve of power required replaced."""
    return results.with_curve(Kind.POWER_REQUIRED, **of)


def test_the_cause_is_reported_before_what_follows_from_it_and_the_worst_first(with_battery: Results) -> None:
    both = replace(
        efficiency(with_battery, Interval(value=1.1, lo=1.05, hi=1.15), Interval(value=0.8, lo=0.7, hi=0.9)),
        speed_over_motor_constant=1.17, cross_check_differs=True,
    )  # fmt: skip
    both = drag(both, statistics=statistics(thrust_scale=-19.0))
    assert [item.kind for item in evidence_against(both)] == [
        EvidenceKind.THRUST_TABLE, EvidenceKind.PROPELLER_EFFICIENCY, EvidenceKind.MOTOR_SPEED, EvidenceKind.CROSS_CHECK
    ]  # fmt: skip


def test_the_motor_s_constants_may_be_wrong_by_some_percent(results: Results) -> None:
    within = [1 - 0.9 * TRUST.motor_constant, 1 + 0.9 * TRUST.motor_constant]
    assert [evidence_against(replace(results, speed_over_motor_constant=ratio)) for ratio in within] == [[], []]


def test_a_result_without_curve_of_drag_can_be_trusted(results: Results) -> None:
    assert reasons_not_to_trust(balanced(results)) == []


def test_an_export_of_such_a_result_is_written_and_ends_with_exit_code_1(
    results: Results, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """`analyze` does the same; a program that calls it must not go on with the tables unaware."""
    written: list[Path] = []
    analyzed = SimpleNamespace(results=with_trust(NOT_TRUSTED[EvidenceKind.POLAR_CURVES_DOWNWARD](results)))
    monkeypatch.setattr("flightpower.analysis.cli.export.open_source", lambda path, columns: None)
    monkeypatch.setattr("flightpower.analysis.pipeline.analyze", lambda *_, **__: analyzed)
    monkeypatch.setattr("flightpower.analysis.pages.exports.tables.tables_of", lambda flight: {})
    monkeypatch.setattr(
        "flightpower.analysis.pages.exports.tables.export_tables", lambda tables, log, to, path: written.append(path)
    )
    (tmp_path / "log.mcap").touch()
    outcome = CliRunner().invoke(export_app, [str(tmp_path / "log.mcap"), "--to", "mat"], standalone_mode=False)
    assert outcome.return_value is ExitCode.FAILURE
    assert written == [tmp_path / "log.mat"]


def test_no_flight_is_planned_after_such_a_result(results: Results, tmp_path: Path) -> None:
    file = tmp_path / "results.json"
    for change, usable in ((NOT_TRUSTED[EvidenceKind.POLAR_CURVES_DOWNWARD], False), (lambda same: same, True)):
        changed = with_trust(change(results))
        file.write_bytes(to_json(changed))
        if usable:
            assert read_results(file) == changed
        else:
            with pytest.raises(InputError, match="plan without it"):
                read_results(file)


def test_the_verdict_of_electrical_power_claims_no_more_than_trust(results: Results) -> None:
    """A curve of electrical power without evidence against it is trusted, but the page does not say "nothing to
    note"."""
    electrical = replace(
        results, kind=Kind.ELECTRICAL, curves={Kind.ELECTRICAL: results.main}, evidence=[], trust=Trust.TRUSTED,
        warnings=["The autopilot dropped a message."],
    )  # fmt: skip
    verdict = verdict_section(electrical)
    assert (verdict.heading.split(",")[0], verdict.reasons, verdict.colon) == ("Trusted", "", ".")
    assert verdict_section(results).colon == ":"
