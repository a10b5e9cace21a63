"""`make near FILE=…`: the tests nearest to a file, by the graph of imports."""

from pathlib import Path

import pytest

from tests import near

FILES = {
    "analysis/curve.py": "",
    "analysis/pool.py": "from flightpower.analysis.curve import Curve",
    "analysis/page.py": "SCRIPT = 'chart.js'",
    "analysis/chart.js": "",
    "analysis/alone.py": "",
    "benchmarks/flights.py": "import flightpower.analysis.pool",
    "tests/analysis/conftest.py": "",
    "tests/analysis/cases.py": "from flightpower.analysis import (  # a comment, with a comma\n    curve as c,\n)",
    "tests/analysis/test_curve.py": (
        "import os\nfrom flightpower.analysis.curve import Curve\nfrom flightpower.analysis.page import Page"
    ),
    "tests/analysis/test_many.py": (
        "import flightpower.analysis.curve, flightpower.analysis.pool, flightpower.analysis.page"
    ),
    "tests/analysis/test_with_cases.py": "import cases",
    "tests/analysis/test_pool.py": "from flightpower.analysis import pool",
    "tests/analysis/test_flown.py": "import flights",
    "tests/analysis/test_other.py": "import math",
}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
    return tmp_path


def test_tests_that_import_the_file_come_before_those_that_import_its_importers(project: Path) -> None:
    stems = [path.stem for path in near.tests_near(project, Path("analysis/curve.py"), count=9)]
    assert stems == ["test_curve", "test_many", "test_pool", "test_with_cases", "test_flown"]


def test_as_many_are_given_as_are_asked_for(project: Path) -> None:
    tests_near = near.tests_near(project, Path("analysis/pool.py"), count=2)
    assert [path.stem for path in tests_near] == ["test_pool", "test_many"]


def test_a_test_is_nearest_to_itself_and_a_script_to_what_names_it(project: Path) -> None:
    assert near.tests_near(project, Path("tests/analysis/test_other.py")) == [Path("tests/analysis/test_other.py")]
    assert near.tests_near(project, Path("analysis/chart.js"), count=1) == [Path("tests/analysis/test_curve.py")]


def test_a_file_that_no_test_reaches_is_reported(project: Path) -> None:
    with pytest.raises(LookupError, match=r"analysis/alone\.py: no test imports it"):
        near.tests_near(project, Path("analysis/alone.py"))


def test_here_a_file_s_own_test_comes_first() -> None:
    graph = near.imports(near.ROOT)
    for name, test in (
        ("analysis/curve.py", "tests/analysis/test_curve.py"),
        ("daq/sensors/ublox.py", "tests/daq/test_driver_ublox.py"),
        ("analysis/uncertain.py", "tests/analysis/test_uncertain.py"),
    ):
        assert near.nearest(Path(name), graph, [Path(name)], count=1) == [Path(test)]
