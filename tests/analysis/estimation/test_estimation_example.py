"""The example in the documentation runs, is short, finds the true values, and prints what the page shows."""

import re
from pathlib import Path

import pytest

from flightpower.analysis.estimation.fit import Finding

TEXT = (Path(__file__).parents[3] / "docs" / "understand" / "estimation-example.md").read_text("utf-8")
CODE, IN_TURBULENCE = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)
PRINTED = re.search(r"```text\n(.*?)```", TEXT, re.DOTALL)[1]


@pytest.fixture(scope="module")
def ran():
    scope: dict = {}
    exec(compile(CODE, "docs/understand/estimation-example.md", "exec"), scope)
    return scope


def test_it_is_under_forty_lines():
    assert sum(bool(line.strip()) for line in CODE.splitlines()) < 40


def test_it_finds_the_true_values(ran):
    fit, errors = ran["fit"], ran["corrected"].standard_errors
    assert fit.verdict.ok
    # The data are linear but the model has a sine, whose frequency is 0.1^2/16, 0.06 %, lower at 0.1 rad amplitude.
    for name, truth in (("stiffness", 36 * 1.00125), ("damping", 0.8), ("theta_bias", 0.01)):
        assert abs(fit.parameters[name].value - truth) < 4 * errors[name], name
    assert abs(ran["frequency"].value[0] - 0.9528) < 4 * ran["frequency"].standard_error[0] + 0.0006


def test_the_page_shows_what_it_prints(capsys):
    """Numbers agree to 1 %, because the last digits depend on the machine."""
    exec(compile(CODE, "docs/understand/estimation-example.md", "exec"), {})
    number = re.compile(r"-?\d+\.\d+")
    shown, printed = capsys.readouterr().out, PRINTED
    assert number.sub("#", shown).split() == number.sub("#", printed).split()
    assert [float(x) for x in number.findall(shown)] == pytest.approx(
        [float(x) for x in number.findall(printed)], rel=0.01
    )


def test_the_flap_is_not_identifiable(ran):
    from flightpower.analysis.estimation import output_error

    fit = output_error.fit_output_error(ran["wing"], ran["released"])
    assert fit.verdict.findings == (Finding.UNDETERMINED,) and fit.verdict.text in TEXT


def test_process_noise_is_not_significant_in_still_air(ran, capsys):
    exec(compile(IN_TURBULENCE, "docs/understand/estimation-example.md", "exec"), ran)
    assert "process noise of q is not significant" in capsys.readouterr().out
    assert "process noise of q is not significant" in TEXT
    still = ran["wing"].changed(flap_effect={"free": False})
    from flightpower.analysis.estimation import output_error

    direct = output_error.fit_output_error(still, ran["released"])
    for name in ("stiffness", "damping", "theta_bias"):
        estimate = direct.parameters[name]
        assert abs(ran["fit"].parameters[name].value - estimate.value) < 0.5 * estimate.standard_error, name
