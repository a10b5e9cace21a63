"""The page's words for results of every kind, without a flight."""

import numpy as np
from msgspec.structs import replace

from flightpower.analysis.curve import Condition, Cost, Polar, polar_curve
from flightpower.analysis.maneuvers.flown import TableLimit
from flightpower.analysis.pages import page
from flightpower.analysis.pages.answers import headline_answers, optimum_speed_text
from flightpower.analysis.pages.charts.figure import Dash, Figure, Line
from flightpower.analysis.pages.charts.flight import run_fit
from flightpower.analysis.pages.charts.power import every_method, power_required
from flightpower.analysis.pages.wording import listed_methods
from flightpower.analysis.records.flight import (
    Kind,
    ParameterResult,
    PathResult,
    RejectedResult,
    Results,
    SensorError,
)
from flightpower.analysis.results.files import to_csv

T = np.linspace(0.0, 1.0, 5)


def test_without_battery_answers_the_aerodynamic_speeds_are_the_answers(results: Results) -> None:
    slow, far = headline_answers(results)
    assert slow.question == "Best endurance" and slow.answer == "not found: the curve has no such point"
    assert far.question == "Best range" and far.answer == "13.1 m/s (12.8 to 13.4)"


def drawings(results: Results) -> dict[str, Figure]:
    """The figures that the page always has, and those of a battery."""
    names = ("power", "methods", "timeline", "polar", "parts", "loadings", "efficiency")
    return dict.fromkeys(names, power_required(results))


def test_the_page_says_all_of_it_and_escapes_what_users_wrote(results: Results) -> None:
    text = page.render(results, drawings(results), {})
    for message in (
        "A &amp; B",
        "mind &lt;this&gt;",
        "&lt;gives&gt; too much",
        "few points &amp; short",
        "no steady points",
    ):
        assert message in text, message
    assert "no curve" in text, "the method that failed is in the table"
    assert "Of the ±2.2 W at 18 m/s, ±2.0 W is common to all runs" in text  # hypot(1, 2)
    assert "All methods agree" not in text


HOSTILE = "<script>alert('x')</script>&\"</style>"


def test_text_of_a_user_is_text_wherever_it_stands(with_battery: Results) -> None:
    """A user's text stays text in titles, tables, sentences, warnings and figures; a script could change every number
    of the page."""
    r = with_battery
    assert r.use is not None
    results = replace(
        r, aircraft=replace(r.aircraft, title=HOSTILE, propeller=HOSTILE), log=HOSTILE, warnings=[HOSTILE],
        verdict=HOSTILE, runs=[replace(r.runs[0], kind=HOSTILE, notes=[HOSTILE]), r.runs[0]],
        rejected=[RejectedResult(kind=HOSTILE, start_s=0, end_s=1, reason=HOSTILE)],
        parameters=[ParameterResult(name=HOSTILE, value=1, standard_error=1, unit=HOSTILE)],
        methods=[replace(r.methods[0], title=HOSTILE, equations=HOSTILE, notes=[HOSTILE], taken_as_measured=[HOSTILE])],
        disagreements=[replace(r.disagreements[0], text=HOSTILE)],
        path=PathResult(converged=True, gust_mps=0.1, residuals={"V": 1.0}, checks=[], sensor_errors=[
            SensorError(name="V", title=HOSTILE, value=1.0, standard_error=0.1, assumed_sigma=1.0, unit=HOSTILE,
                        determined=False, missing=[HOSTILE])]),
        use=replace(
            r.use, costs=[HOSTILE], too_much=[HOSTILE], power_train=replace(r.use.power_train, basis=HOSTILE),
            available=replace(r.use.available, reason=HOSTILE, basis=HOSTILE, notes=[HOSTILE]),
            loadings=[replace(r.use.loadings[0], title=HOSTILE)],
        ),
    )  # fmt: skip
    figures = drawings(results) | {"methods": every_method(results)}
    text = page.render(results, figures, {HOSTILE: run_fit(HOSTILE, T, {"V": T}, {"V": T})})
    assert text.count('<div class="plot"') == len(drawings(r)) + 2
    assert text.count("<script>") == 2, "that of the charts and its start"
    assert "alert('x')" not in text
    assert text.count("&lt;script&gt;alert") > 20


def test_what_a_battery_gives_stands_on_the_page(with_battery: Results) -> None:
    text = page.render(with_battery, drawings(with_battery), {})
    assert "<b>14.0</b> m/s<small> (12.6 to 16.8)</small>" in text
    assert "50 km/h · 46 ft/s" in text  # 14 m/s
    assert "74 Wh of which 80 % are used" in text
    assert text.count("The motor is assumed.") == 3, "below the curve, the field table and the efficiencies"
    assert "* Outside the propeller table: an extrapolation." in text
    assert "Costs &lt;b&gt;." in text
    assert "friction loss of the motor" in text


def test_the_caption_names_the_circles_where_there_are_some(results: Results) -> None:
    without = replace(results, methods=[method for method in results.methods if not method.points])
    assert "Circles: steady points, with the thrust" in page.render(results, drawings(results), {})
    assert "Circles: steady points, with the thrust" not in page.render(without, drawings(without), {})


def test_the_caption_names_why_a_curve_is_dashed(results: Results, with_battery: Results) -> None:
    """Power required is dashed above 20 m/s in these results; their highest level speed is 25 m/s, and 24 m/s was
    flown."""

    def caption(of: Results, *limits: TableLimit) -> str:
        return (
            page.render(of, drawings(of), {}, limits=limits).partition("Band: 95 % interval.")[2].partition("</p>")[0]
        )

    by_motor, by_J = "at motor speeds that the propeller table does not reach", "beyond the advance ratios J = V/(nD)"
    text = caption(results, TableLimit.MOTOR_SPEED)
    assert f"Dashed: extrapolated {by_motor}." in text and "fastest" not in text and "J =" not in text
    text = caption(with_battery, TableLimit.ADVANCE_RATIO)
    assert f"Dashed: extrapolated beyond the fastest speed flown, or {by_J}" in text and by_motor not in text
    assert "full throttle" not in text
    curve = results.curves[Kind.POWER_REQUIRED]
    inside = [replace(point, extrapolated=False) for point in curve.points]
    flown = replace(results, curves={Kind.POWER_REQUIRED: replace(curve, points=inside)})
    assert "Dashed" not in caption(flown)
    assert with_battery.use is not None
    available = replace(with_battery.use.available, power_available=curve.points, maximum_speed_mps=None)
    at_full = replace(with_battery, curves=flown.curves, use=replace(with_battery.use, available=available))
    assert "Dashed: extrapolated at full throttle outside the propeller table." in caption(at_full)


def test_methods_that_agree_are_said_to_agree(results: Results) -> None:
    agreeing = replace(results, disagreements=[])
    assert "All methods agree within their intervals." in page.render(agreeing, drawings(results), {})
    differing = page.render(replace(agreeing, cross_check_differs=True), drawings(results), {})
    assert "All methods agree within their intervals, except the cross-check: see the warning above." in differing


def test_a_curve_is_dashed_where_it_is_flagged_and_solid_elsewhere(results: Results) -> None:
    dashes = {mark.dash for mark in power_required(results).named("power required") if isinstance(mark, Line)}
    assert dashes >= {Dash.SOLID, Dash.DASHED}
    methods = every_method(results)
    assert methods.marks[-1].name == methods.entries()[0] == "Dynamic, two steps", "the leading method lies on top"


def test_the_table_of_the_curve_carries_the_flag(results: Results) -> None:
    header, *rows = [line.split(",") for line in to_csv(results).splitlines()]
    assert header[-1] == "extrapolated"
    flags = {row[3]: row[-1] for row in rows if row[0] == "test"}
    assert flags["12"] == "false" and flags["24"] == "true"


def test_a_flight_of_steady_points_alone_shows_their_methods_alone(results: Results) -> None:
    steady = replace(results, runs=[replace(results.runs[0], kind="steady")], cross_check=[])
    assert [method.name for method in listed_methods(steady)] == ["piw-viw", "w-delta"]
    polar = steady.drag_polar
    leads = replace(steady.methods[1], drag_polar=[polar.A0, polar.A1, polar.A2])
    assert listed_methods(replace(steady, methods=[steady.methods[0], leads]))[0].name == "w-delta"


def test_a_speed_whose_interval_has_no_lower_end_says_so() -> None:
    """A curve may have its minimum anywhere below, so no speed of 0 m/s is claimed."""
    polar = Polar(np.array([0.03, 0.0, 0.004]), np.diag([0.004, 0.01, 0.004]) ** 2)
    condition = Condition(37.7, 1.2, 0.46)
    lowest = polar_curve(polar, condition, (0.2, 10.0)).best(Cost.POWER)
    assert lowest.lo_mps is None and lowest.speed_mps and lowest.hi_mps
    assert optimum_speed_text(lowest) == f"{lowest.speed_mps:.1f} m/s (up to {lowest.hi_mps:.1f})"


def test_what_is_to_be_known_beside_the_verdict_is_called_a_note(results: Results) -> None:
    text = page.render(replace(results, warnings=["The autopilot dropped a message."]), drawings(results), {})
    assert '<p class="warning">Note: The autopilot dropped a message.</p>' in text
