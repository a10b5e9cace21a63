"""A result that is not to be trusted says why, and `analyze` ends with exit code 1."""

import json

import pytest
from msgspec.structs import replace

from analysis.cli.analyze import _finish
from analysis.cli.electrical import Done
from analysis.results.trust import reasons_not_to_trust
from analysis.schema import CurveStatus, Results

CHANGES = {
    "did not converge": lambda r: replace(
        r, status=CurveStatus.NOT_CONVERGED, verdict="not converged: the step length"
    ),
    "at a bound": lambda r: replace(r, status=CurveStatus.NOT_CONVERGED, verdict="converged at a bound: A0 = 0"),
    "reaches zero": lambda r: replace(r, power_required=[replace(r.power_required[0], power_lo_W=-1.0)]),
    "does not increase with lift": lambda r: replace(r, drag_polar=replace(r.drag_polar, A2=-0.01)),
    "cross-check by output error differs": lambda r: replace(r, cross_check_differs=True),
}


@pytest.mark.parametrize("said", CHANGES)
def test_each_reason_is_said_on_stderr_with_exit_code_1(results: Results, said: str, capsys) -> None:
    assert _finish(Done(results, print), json=True, quiet=False) == 0
    printed = capsys.readouterr()
    assert json.loads(printed.out)["format"] == results.format and printed.err == ""
    assert _finish(Done(CHANGES[said](results), print), json=False, quiet=True) == 1
    printed = capsys.readouterr()
    assert said in printed.err and len(printed.err.splitlines()) == 1 and printed.out == ""


def test_a_result_without_curve_of_drag_can_be_trusted(results: Results) -> None:
    electrical = replace(results, drag_polar=None, power_required=[], electrical_power=results.power_required)
    assert reasons_not_to_trust(electrical) == []
