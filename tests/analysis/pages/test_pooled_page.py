"""The page of several flights: its size, its words, and what a comparison says."""

import math
import re
from pathlib import Path
from typing import Any

import msgspec
import pytest

from flightpower.analysis.pages.pooled_page import (
    comparison_answers,
    curve_table,
    difference,
    differences_table,
    pooled_answers,
    render_comparison,
    render_pooled,
    render_side_by_side,
)
from flightpower.analysis.records.flight import Kind, Results
from flightpower.analysis.records.pool import Agreement, ComparisonResults, PooledResults, PowerDifference
from tests.browser import AXE, CHROMIUM, NO_AXE, Browser

V = [12.0, 14.0, 16.0, 18.0, 20.0, 22.0, 24.0]
CONDITION = {"weight_N": 37.7, "air_density_kgpm3": 1.2}
AIRCRAFT = {"name": "n", "title": "A & B", "wing_area_m2": 0.46, "span_m": 1.7, "propeller": "p"}


def power(speed: float) -> dict[str, Any]:
    P = 0.011 * speed**3 + 330 / speed
    return {"speed_mps": speed, "power_W": P, "power_lo_W": 0.98 * P, "power_hi_W": 1.02 * P, "extrapolated": False}


def flight(k: int) -> dict[str, Any]:
    outlier = k == 7
    deviations = [(v, 30.0 if outlier else math.sin(k * v), 2.0) for v in V]
    return {
        "log": f"2026-05-01-{k:02d} <flight>", "installation": "", "test": CONDITION,
        "drag_polar": {"A0": 0.04, "A1": 0.0, "A2": 0.06}, "half_width_percent": [3.0] * 7,
        "half_width_without_percent": [2.1] * 7, "share_of_information": 0.01, "p": 1e-9 if outlier else 0.5,
        "p_installation": 0.5,
        "against_pool": [
            {"speed_mps": v, "difference_percent": d, "limit_percent": m} for v, d, m in deviations
        ],
        "outlier": outlier, "reason": "was the probe touched?" if outlier else "", "mounted_anew": False,
        "trust": "doubtful" if k == 3 else "trusted",
    }  # fmt: skip


def doubt(log: str) -> dict[str, Any]:
    return {"kind": "motor speed against the motor's constant", "level": "doubtful", "part": "the whole curve",
            "log": log, "text": "Check the poles."}  # fmt: skip


def pooled(flights: int) -> PooledResults:
    several = flights > 1
    content = {
        "software_version": "0", "aircraft": AIRCRAFT, "installation": "tray 1", "test": CONDITION,
        "trust": "doubtful", "evidence": [doubt("2026-05-01-03 <flight>")], "agreement": "no" if several else None,
        "parameters": [{"name": "V_scale", "value": 0.001, "standard_error": 0.002, "unit": ""}],
        "kind": Kind.POWER_REQUIRED,
        "curves": {
            Kind.POWER_REQUIRED: {"condition": CONDITION, "points": [power(12 + k / 5) for k in range(61)]},
        },
        "between_flights": [
            {"speed_mps": v, "observed_percent": 2.0, "expected_percent": 1.0, "excess_percent": 1.7} for v in V
        ] if several else [],
        "homogeneity": {
            "chi_square": 99.0, "degrees_of_freedom": 3, "p": 1e-9, "text": "The flights differ."
        } if several else None,
        "installation_homogeneity": {
            "chi_square": 5.0, "degrees_of_freedom": 5, "p": 0.42, "text": "The installation is the same."
        } if several else None,
        "flights": [flight(k) for k in range(flights)],
        "outliers": [{"log": flight(7)["log"], "p": 1e-9, "reason": "was the probe touched?"}] if several else [],
        "one_more": {
            "like": flight(0)["log"], "speed_mps": V, "half_width_percent": [2.0] * 7,
            "half_width_then_percent": [1.5] * 7,
        },
        "flights_to_see": [{"difference_percent": 2.0, "flights_each": 5}],
        "trends": [
            {"quantity": "air temperature", "unit": "K", "lowest": 281.0, "highest": 293.0, "change_percent": 1.2,
             "standard_error_percent": 0.2, "p": 1e-6, "flights": flights}
        ] if several else [],
        "notes": ["mind <this>"], "left_out": [], "failures": ["x.mcap: not an MCAP file"],
        "drag_polar": {"A0": 0.04, "A1": 0.0, "A2": 0.06}, "polar_covariance": [],
    }  # fmt: skip
    return msgspec.convert(content, PooledResults)


def comparison() -> ComparisonResults:
    side = {"aircraft": AIRCRAFT, "installation": "tray 1", "logs": ["a", "b"], "name": "old"}
    rows = [
        {"speed_mps": v, "power_a_W": 50.0, "power_b_W": 51.5, "difference_percent": 3.0, "lo_percent": 3.0 - v / 10,
         "hi_percent": 3.0 + v / 10, "independent_half_width_percent": 4.0}
        for v in V
    ]  # fmt: skip
    content = {
        "software_version": "0", "kind": Kind.POWER_REQUIRED, "a": side, "b": {**side, "name": "new"},
        "test": CONDITION, "differences": rows, "quoted": rows[0],
        "p": 0.001, "differs": True, "text": "B differs from A.",
        "flights_to_see": [{"difference_percent": 1.0, "flights_each": None}],
        "trust": "doubtful", "evidence": [doubt("new/x")], "notes": ["mind <this>"],
        "same_installation": True, "same_propeller": True,
    }  # fmt: skip
    return msgspec.convert(content, ComparisonResults)


def body(page: str) -> str:
    """The page without scripts, styles and tags."""
    text = re.sub(r"<(script|style).*?</\1>", "", page, flags=re.DOTALL)
    return re.sub(r"<[^>]+>", " ", text)


def test_a_page_of_a_hundred_flights_is_small_and_names_them() -> None:
    page = render_pooled(pooled(100))
    assert len(page.encode()) < 0.6e6
    text = body(page)
    assert "±2.0 to ±2.0 %" in text and "±1.5 % instead of ±2.0 %" in text and "5 flights" in text
    assert "outlier: was the probe touched?" in text
    assert "+1.2 %" in text and "281.0 K" in text and "293.0 K" in text
    said_first = text.index("2026-05-01-03 &lt;flight&gt;: Check the poles.")
    assert text.index("Doubtful:") < said_first < text.index("Certainty of the curve")
    assert "a trend (p = below 0.0001)" not in text and "a trend (p below 0.0001)" in text
    assert "x.mcap: not an MCAP file" in text and "mind &lt;this&gt;" in text
    assert page.count('href="2026-05-01-') == 100 and "%3Cflight%3E/report.html" in page
    assert "http" not in re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL).replace("http-equiv", "")


def test_one_flight_has_nothing_to_agree_with() -> None:
    assert [answer.question for answer in pooled_answers(pooled(1))][1] == "With one more flight"
    assert "Do the flights agree" not in body(render_pooled(pooled(1)))


def test_card_and_verdict_say_the_same_of_one_flight_that_differs() -> None:
    content = pooled(12)
    assert pooled_answers(content)[1].answer == "all but 2026-05-01-07 <flight>"
    assert "No evidence against" not in body(render_pooled(content))
    content = msgspec.structs.replace(content, agreement=Agreement.YES, outliers=[], trust="trusted", evidence=[])
    assert pooled_answers(content)[1].answer == "yes" and "No evidence against" in body(render_pooled(content))


@pytest.mark.parametrize(("independent", "is_reported"), [(4.0, True), (0.9, False)])
def test_a_comparison_does_not_say_that_its_interval_would_shrink_without_what_cancels(
    independent: float, is_reported: bool
) -> None:
    """Flights that disagree widen the stated interval, possibly beyond the interval in which nothing cancels."""
    quoted = msgspec.structs.replace(comparison().quoted, independent_half_width_percent=independent)
    note = comparison_answers(msgspec.structs.replace(comparison(), quoted=quoted))[1].note
    assert ("did not cancel" in note) is is_reported and "m/s" in note


def test_a_comparison_says_what_cancels() -> None:
    text = body(render_comparison(comparison()))
    assert (
        "mind &lt;this&gt;" in text
        and text.index("new/x: Check the poles.") < text.index("Clearest")
        and "new against old" in text
        and "+3.0 % (+1.8 to +4.2)" in text
        and "±4.0 %" in text
        and "more than 200" in text
    )


@pytest.mark.parametrize(("p", "message"), [(0.04, "a trend (p = 0.04"), (0.06, "none seen (p = 0.06")])
def test_a_trend_is_one_at_five_per_cent(p: float, message: str) -> None:
    content = pooled(12)
    trends = [msgspec.structs.replace(content.trends[0], p=p)]
    assert message in body(render_pooled(msgspec.structs.replace(content, trends=trends)))


def test_a_trend_that_is_not_known_is_not_told_in_powers_of_ten() -> None:
    content = pooled(12)
    unknown = msgspec.structs.replace(content.trends[0], change_percent=-370.0, standard_error_percent=410.0)
    text = body(render_pooled(msgspec.structs.replace(content, trends=[unknown])))
    assert "e+02" not in text and "-370" not in text and "not known" in text


def test_both_configurations_are_drawn_above_their_difference() -> None:
    a, b, band, line = difference(comparison()).marks
    assert (a.name, b.name) == ("A: old", "B: new") and a.panel == b.panel != line.panel
    assert set(a.y) == {50.0} and set(b.y) == {51.5} and set(line.y) == {3.0}
    assert band.name == line.name and min(band.y) == pytest.approx(0.6)


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium here (Debian: apt-get install chromium)")
@pytest.mark.skipif(not AXE.is_file(), reason=NO_AXE)
def test_a_program_finds_no_barrier_in_pools_and_comparisons(browser: Browser, tmp_path: Path) -> None:
    for name, page in (("pooled", render_pooled(pooled(12))), ("compared", render_comparison(comparison()))):
        (tmp_path / name).with_suffix(".html").write_text(page, "utf-8")
    for file in sorted(tmp_path.iterdir()):
        for width, dark in ((1280, False), (400, True)):
            browser.show(file, width, dark=dark)
            browser.value_of("drawAll()")
            assert browser.barriers() == [] and browser.complaints == []
            assert browser.value_of("document.documentElement.scrollWidth") <= width


def test_flights_that_are_not_pooled_stand_side_by_side() -> None:
    item = {
        "log": "a", "software_version": "0", "aircraft": AIRCRAFT, "test": CONDITION, "kind": Kind.ELECTRICAL,
        "curves": {Kind.ELECTRICAL: {"condition": CONDITION, "points": [power(v) for v in V]}},
    }  # fmt: skip
    flights = msgspec.convert([item, {**item, "log": "b"}], list[Results])
    text = body(render_side_by_side(flights, "two aircraft in one pool", ["c.ulg: torn"]))
    assert (
        "2 flights" in text
        and "Not pooled: two aircraft in one pool" in text
        and "(46 to 47)" in text
        and "c.ulg: torn" in text
    )
    assert "3.84 kg" in text, "37.7 N over 9.80665 m/s^2"


def test_tables_thin_the_curve_and_give_half_widths_in_per_cent() -> None:
    table = curve_table(pooled(3), 12)
    assert 12 <= len(table.rows) <= 13 and table.rows[0] == ("12.0", "46.5", "45.6 to 47.4", "2.0")
    rows = [
        {"speed_mps": v, "power_a_W": 50.0, "power_b_W": 49.0, "difference_percent": -2.0, "lo_percent": -3.0,
         "hi_percent": 1.0, "independent_half_width_percent": 4.0} for v in V
    ]  # fmt: skip
    thinned = differences_table(msgspec.convert(rows, list[PowerDifference]), 3)
    assert len(thinned.rows) == 4 and thinned.rows[0] == ("12.0", "50.0", "49.0", "-2.0", "-3.0 to +1.0")
