"""The pages of docs/evidence show what their data files contain, and each part is run once per version."""

import json
from pathlib import Path
from xml.etree import ElementTree

import evidence
import pytest
from evidence_figures import BLUE, RED, coverage_by_world, error_by_speed
from records import counted, markdown, rounded

PAGE = "Claim.\n<!-- begin one -->\n<!-- end -->\n<!-- begin one.rows -->\nold\n<!-- end -->\nEnd.\n"


def part(rows: list[dict]) -> evidence.Part:
    return evidence.Part(lambda run: {"rows": [{"n": run.n}, *rows]}, 30, 1, "flights")


def test_every_page_shows_the_tables_of_its_data_files() -> None:
    """If not, `python benchmarks/evidence.py --render` updates them."""
    for page in (evidence.ROOT / "README.md", *evidence.PAGES.glob("*.md")):
        text = page.read_text("utf-8")
        assert evidence.rendered(text, evidence.PAGES / "data") == text, page.name


def test_the_data_files_are_of_parts_and_name_no_place() -> None:
    for path in (evidence.PAGES / "data").glob("*.json"):
        content = json.loads(path.read_text("utf-8"))
        assert path.stem in evidence.PARTS and not content["commit"].endswith("-changed")
        assert "/home" not in path.read_text("utf-8") and "/tmp" not in path.read_text("utf-8")


def test_a_part_runs_again_only_by_another_version(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(evidence, "version", lambda: "abc")
    shown = {}
    for version, rows in (("abc", [{"n": 1}]), ("abc", [{"n": 2}]), ("def", [{"n": 3}])):
        monkeypatch.setattr(evidence, "version", lambda version=version: version)
        monkeypatch.setattr(evidence, "PARTS", {"one": part(rows)})
        evidence.run_part("one", tmp_path, 1, quick=False)
        shown[version] = json.loads((tmp_path / "one.json").read_text("utf-8"))["tables"]["rows"][1]["n"]
    assert shown == {"abc": 1, "def": 3}


def test_tables_are_written_between_the_marks_and_nothing_else_changes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert "Not run yet" in evidence.rendered(PAGE, tmp_path)
    monkeypatch.setattr(evidence, "PARTS", {"one": part([{"n": 7, "each": [1.0, None]}])})
    evidence.run_part("one", tmp_path, 1, quick=True)
    text = evidence.rendered(PAGE, tmp_path)
    assert "| 7 | 1.0 / - |" in text and "1 flights; commit" in text and "old" not in text
    assert text.startswith("Claim.\n") and text.endswith("End.\n") and evidence.rendered(text, tmp_path) == text
    with pytest.raises(KeyError):
        evidence.rendered(PAGE.replace("one.rows", "one.columns"), tmp_path)


def test_coverage_is_judged_by_what_is_asked() -> None:
    """Coverage outside the limits by less than two counting errors is undecided, and needs more flights."""
    cases = ((80, 6.0), (80, 2.0), (90, 6.0), (98, 0.1), (100, 4.0), (100, 0.5))
    met = [evidence.judged({"coverage, %": share, "±": counting}, 90, 98)["met"] for share, counting in cases]
    assert met == ["open", "too seldom", "yes", "yes", "open", "too often"]


def test_the_counting_error_of_what_was_always_seen_is_that_of_one_flight_more() -> None:
    """25 covered flights and one half covered scatter by 0.5 sqrt(25) / 26. For many, it is sqrt(p (1 - p) / n)."""
    assert counted([1.0] * 25)[1] == pytest.approx(100 * 0.5 * 5 / 26 / 26**0.5)
    assert counted([1.0, 0.0] * 50) == pytest.approx((50.0, 5.0), abs=0.1)


def sentence_of(records: list[dict]) -> str:
    return " ".join(evidence._table({"rows": records}, "rows-in-words").split())


def test_the_readme_says_how_well_whole_flights_were_covered() -> None:
    rows = [{"plan": plan, "W20, kt": kt, "flights": 60, "error": [worst, 2.0, 1.8], "coverage, %": covered}
            for plan, kt, worst, covered in (("two-pairs", "3", 9.9, 50), ("full-test-flight", "3", 2.4, 97),
                                             ("full-test-flight", "15", 7.2, 96))]  # fmt: skip
    assert "below 1.8 to 2.4 %" in sentence_of(rows) and "below 1.8 to 7.2 %" in sentence_of(rows)
    assert "97 and 96 % of the speeds of 60 flights" in sentence_of(rows)


def test_the_readme_says_how_far_real_flights_were_off() -> None:
    """The larger end of the errors counts, whatever its sign; a refused flight has no error."""
    rows = [{"flight": "Daredevil, 10 July", "error, %": "-1.8 to +3.5"}, {"flight": "another", "curve by": "refused"},
            {"flight": "Daredevil, 5 July", "error, %": "-10.6 to +1.6"},
            {"flight": "Cyclone", "error, %": "-26.8 to -6.7", "inside": "2 of 4"},
            {"flight": "its decelerations alone", "error, %": "-1.0 to +0.4"}]  # fmt: skip
    assert "within 1.0 %" in sentence_of(rows) and "within 4 % in one flight and 11 % in another" in sentence_of(rows)
    assert "is 7 to 27 % off, and inside its interval at 2 of 4 speeds" in sentence_of(rows)
    assert sentence_of(rows[:2]) == "not run by this version"


def test_a_figure_shows_what_was_not_met_in_another_color_and_every_known_point() -> None:
    worlds = [{"world": name, "coverage, %": share, "±": 1.0, "met": met}
              for name, share, met in (("a", 95, "yes"), ("b", 60, "too seldom"))]  # fmt: skip
    figure = coverage_by_world(worlds, (90, 98))
    assert figure.count(BLUE) == 1 and figure.count(RED) == 1 and ElementTree.fromstring(figure) is not None
    curve = {"plan": "whole", "W20, kt": "3", "error": [2.0, 1.0, 1.0, 1.0, None], "half width": [2.5, 2, 2, 2, None]}
    figure = error_by_speed([curve, {**curve, "plan": "another"}], "whole")
    assert figure.count("<circle") == 4 and ElementTree.fromstring(figure) is not None


def test_numbers_are_shown_as_rounded() -> None:
    row = {"a": rounded([1.04, float("nan")], 1), "b": rounded(-0.04, 1), "c": 12000}
    assert markdown([row, {"a": None}]).splitlines()[2:] == ["| 1.0 / - | 0.0 | 12,000 |", "| - |  |  |"]
