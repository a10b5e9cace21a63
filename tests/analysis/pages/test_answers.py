"""The headline answers in words, on the page and the terminal."""

import io
from pathlib import Path

import pytest
from msgspec.structs import replace
from rich.console import Console

from flightpower.analysis.pages.answers import (
    end_remark,
    headline_answers,
    near_stall,
    not_slower,
    optimum_speed_text,
)
from flightpower.analysis.pages.sections.curve import at_whole_speeds, curve_section
from flightpower.analysis.pages.sections.flight import decimals, sensors_section
from flightpower.analysis.pages.sections.performance import ceilings, loading_rows, speed_rows, to_csv, to_markdown
from flightpower.analysis.pages.terminal import print_summary
from flightpower.analysis.records.flight import (
    Check,
    ConditionResult,
    ConsistencyCheck,
    CurveResult,
    Interval,
    Kind,
    PathResult,
    PerformanceResult,
    PowerPoint,
    Results,
    SensorError,
    SlowestFlown,
    SpeedInterval,
)


@pytest.fixture
def use(with_battery: Results) -> PerformanceResult:
    assert with_battery.use is not None
    return with_battery.use


def test_with_a_battery_the_answers_are_those_on_the_battery(with_battery: Results) -> None:
    """3000 s are 50 min and 40 000 m are 40 km; an interval reads from its lower to its upper end."""
    battery = "with 74 Wh, 80 % used (motor assumed, not measured)"
    assert [
        (headline_answer.question, headline_answer.answer, headline_answer.note)
        for headline_answer in headline_answers(with_battery)
    ] == [
        ("Best endurance", "14.0 m/s (12.6 to 16.8)", f"50 min (45 to 60) {battery}."),
        ("Best range", "16.0 m/s (14.4 to 19.2)", f"40.0 km (36.0 to 48.0) {battery}, in still air."),
        (
            "Full throttle, level",
            "25.0 m/s (22.5 to 30.0)",
            "Climbs 4.0 m/s (3.6 to 4.8) at 15 m/s. Faster than any speed flown: an extrapolation.",
        ),
    ]


def test_an_answer_that_is_not_sure_says_so(with_battery: Results, use: PerformanceResult) -> None:
    """It is unsure at an end of the speeds flown, outside the propeller table, at a speed not flown, or without full
    throttle."""
    at_end = replace(use.loadings[0], endurance_at_slowest=True, range_at_fastest=True, extrapolated=True)
    slow = replace(with_battery.best_range_speed, speed_mps=10.2)
    results = replace(
        with_battery.with_curve(Kind.POWER_REQUIRED, least_power_speed=slow),
        use=replace(
            use,
            loadings=[at_end],
            power_train=replace(use.power_train, measured=True),
            available=replace(use.available, maximum_speed_mps=Interval(value=20.0, lo=19.0, hi=21.0)),
        ),
    )
    endurance, far, throttle = headline_answers(results)
    assert endurance.answer == "14.0 m/s, the slowest flown" and far.answer == "16.0 m/s, the fastest flown"
    assert "Outside the propeller table: an extrapolation." in endurance.note
    assert (endurance.speed_mps, far.speed_mps) == (14.0, 16.0)
    assert not_slower(results) in endurance.note and "10.2" not in endurance.note
    assert "assumed" not in endurance.note
    assert throttle.note.endswith("Outside the propeller table: an extrapolation.")
    unknown = replace(results, use=replace(use, available=replace(use.available, reason="No full throttle.")))
    last = headline_answers(unknown)[-1]
    assert (last.speed_mps, last.answer, last.note) == (None, "not known", "No full throttle.")


def test_the_end_of_a_curve_is_named_the_same_in_card_and_table() -> None:
    """At an end, the best speed may lie beyond it: no interval is given, and the text does not call it extrapolated."""
    points = [
        PowerPoint(speed_mps=v, power_W=p, power_lo_W=0.9 * p, power_hi_W=1.1 * p) for v, p in ((14.4, 31), (28, 354))
    ]
    for speed_mps, end in ((14.4, "slowest"), (28.0, "fastest")):
        best = SpeedInterval(speed_mps=speed_mps, lo_mps=None, hi_mps=14.6, inside_flown_range=False)
        curve = CurveResult(
            condition=ConditionResult(weight_N=19.6, air_density_kgpm3=1.2), points=points, least_power_speed=best,
            best_range_speed=best,
        )  # fmt: skip
        assert end_remark(best, curve) == f", the {end} of the curve"
        assert optimum_speed_text(best, curve) == f"{speed_mps:.1f} m/s, the {end} of the curve"
    beyond = SpeedInterval(speed_mps=31.0, lo_mps=29.0, hi_mps=33.0, inside_flown_range=False)
    assert optimum_speed_text(beyond, curve) == "31.0 m/s (29.0 to 33.0), outside the speeds flown: an extrapolation"


def test_ceilings_are_density_altitudes_with_their_intervals(use: PerformanceResult) -> None:
    assert ceilings(use) == (
        "Service ceiling (climb of 0.5 m/s): density altitude 3000 m (2700 to 3600)."
        " Absolute ceiling (no climb): density altitude 3500 m (3150 to 4200). The battery may not last that far."
    )
    assert (
        ceilings(replace(use, available=replace(use.available, service_ceiling_m=None, absolute_ceiling_m=None))) == ""
    )


def test_the_field_table_is_in_its_units(with_battery: Results, use: PerformanceResult) -> None:
    """37 N are 3.77 kg, 3000 s 50 min, 42 000 m 42 km; a star marks what is extrapolated, and is explained."""
    assert speed_rows(use) == [["14 *", "50", "80", "50", "42.0", "–"]]
    assert loading_rows(use) == [["as flown", "3.77", "50", "14.0", "40.0", "16.0", "25.0", "4.0"]]
    ends = replace(use, loadings=[replace(use.loadings[0], endurance_at_slowest=True, range_at_fastest=True)])
    assert loading_rows(ends)[0][3] == "14.0\u00a0(slowest)" and loading_rows(ends)[0][5] == "16.0\u00a0(fastest)"
    text = to_markdown(with_battery, use)
    assert "\\* outside the propeller table" in text and "The motor is assumed." in text
    flown = replace(use, field_table=[replace(use.field_table[0], extrapolated=False)])
    assert "outside the propeller table" not in to_markdown(with_battery, flown)
    header, row = to_csv(with_battery, use).splitlines()
    assert dict(zip(header.split(","), row.split(","), strict=True)) == {
        "weight_N": "37", "air_density_kgpm3": "1.2", "speed_mps": "14", "power_required_W": "50", "battery_W": "80",
        "endurance_s": "3000", "range_m": "42000", "climb_mps": "", "extrapolated": "true",
    }  # fmt: skip


def test_the_curve_in_numbers(with_battery: Results) -> None:
    """12 m/s are 39 ft/s; 46.508 W are 34.3 ft lbf/s; the interval of the curve is 5 % to either side."""
    curve = curve_section(with_battery)
    assert curve.table.rows[0] == ("12.0", "39", "46.5", "44.2 to 48.8", "34.3")
    facts = dict(curve.facts)
    assert "C_D0 0.0450" in facts["Drag polar"] and facts["Drag polar"].endswith("(L/D)max 9.2")
    assert facts["Data"] == "1 acceleration and 0 decelerations; estimation converged"
    assert "on the battery at 16.0 m/s" in facts["Least drag at"]


def test_electrical_power_is_tabulated_at_whole_speeds() -> None:
    """Power is linear between points 0.5 m/s apart; 10.3 to 12.8 m/s has two whole speeds, a wide curve skips some."""
    speeds = [10.3 + 0.5 * i for i in range(6)]
    points = [PowerPoint(speed_mps=v, power_W=2 * v, power_lo_W=v, power_hi_W=3 * v) for v in speeds]
    results = [(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in at_whole_speeds(points)]
    assert results == [pytest.approx((v, 2 * v, v, 3 * v)) for v in (11.0, 12.0)]
    assert at_whole_speeds(points[:3]) == [] == at_whole_speeds([])
    wide = [PowerPoint(speed_mps=v, power_W=v, power_lo_W=v, power_hi_W=v) for v in (20.0, 140.0)]
    assert [p.speed_mps for p in at_whole_speeds(wide)][:3] == [20.0, 24.0, 28.0]


def test_sensors_are_shown_before_and_after_correction(results: Results) -> None:
    before = Check(title="speed", unit="m/s", mean=0.5, mean_standard_error=0.1, sigma=0.2)
    error = SensorError(
        name="V", title="scale of airspeed", value=1.234, standard_error=0.056, assumed_sigma=1.25, unit="%",
        determined=False, missing=["no GPS", "no turn"],
    )  # fmt: skip
    path = PathResult(
        converged=True, gust_mps=0.1, residuals={"compass": 2.04, "V": 0.96},
        checks=[ConsistencyCheck(before=before, after=replace(before, mean=-0.001, sigma=0.1))], sensor_errors=[error],
    )  # fmt: skip
    section = sensors_section(replace(results, path=path))
    assert section is not None
    assert section.checks.rows == [("speed", "+0.50 ± 0.20 m/s", "+0.00 ± 0.10 m/s")]
    assert section.residuals == "airspeed 1.0, compass 2.0"
    assert section.errors.rows == [("scale of airspeed", "+1.234 ± 0.056 %", "± 1.25", "no: no GPS; no turn")]
    assert sensors_section(results) is None


def test_a_standard_error_is_shown_to_two_digits() -> None:
    assert [decimals(sigma) for sigma in (0.0061, 0.056, 0.98, 1.0, 2.9, 17.0, 0.0)] == [4, 3, 2, 1, 1, 0, 2]


def test_the_terminal_shows_curve_answers_and_every_warning(with_battery: Results) -> None:
    """Brackets in a text are text: Rich would treat them as markup and drop them."""
    out = io.StringIO()
    results = replace(with_battery, warnings=["The log is torn [bold]here[/bold]."])
    print_summary(results, Path("flight.report/report.html"), Console(file=out, width=200))
    text = out.getvalue()
    assert "A & B: power required" in text
    assert "44.2 to 48.8" in text
    assert "Best endurance: 14.0 m/s (12.6 to 16.8)" in text and "50 min (45 to 60)" in text
    assert "note: The log is torn [bold]here[/bold]." in text
    assert f"note: {results.disagreements[0].text}" in text
    assert "report: flight.report/report.html" in text


def test_a_speed_near_the_stall_is_not_one_to_hold(with_battery: Results, use: PerformanceResult) -> None:
    """The wing carried 1.0816 times the lift coefficient of 12 m/s, so it stalls at 11.54 m/s or slower; a plan holds
    no speed below 1.08 times 1.04 of that, 12.96 m/s."""
    slowest = SlowestFlown(speed_mps=12.0, lift_coefficient=1.0, largest_lift_coefficient=1.04**2)
    results = replace(with_battery, slowest_flown=slowest)
    assert near_stall(results, 12.95) == " Hold no speed below 13.0 m/s."
    assert near_stall(results, 12.97) == near_stall(results, None) == ""
    assert not_slower(results).endswith(" 4 % above the stall. Hold no speed below 13.0 m/s.")
    unknown = replace(results, slowest_flown=replace(slowest, largest_lift_coefficient=1.0))
    assert not_slower(unknown).endswith("its margin to the stall is not known.")
    slow = replace(use, loadings=[replace(use.loadings[0], endurance_speed_mps=Interval(value=12.5, lo=12.0, hi=13.0))])
    endurance, far, _ = headline_answers(replace(results, use=slow))
    assert "Hold no speed below 13.0 m/s." in endurance.note and "Hold" not in far.note
