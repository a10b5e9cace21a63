"""Values to type into an autopilot, from a curve of power required, and their table on the page."""

import pytest
from msgspec.structs import replace

from flightpower.analysis.pages.sections.performance import autopilot_section
from flightpower.analysis.performance.autopilot_parameters import of_power_required
from flightpower.analysis.records.flight import Kind, PowerPoint, Results


def with_parameters(results: Results) -> Results:
    parameters, withheld = of_power_required(results, results.use)
    return replace(results, autopilot_parameters=parameters, autopilot_parameters_withheld=withheld)


def test_no_speed_lies_below_the_slowest_flown(results: Results) -> None:
    """The speed of best range is not known: it lies below the speeds flown."""
    result = {parameter.name: parameter for parameter in with_parameters(results).autopilot_parameters}
    slowest, trim = result["FW_AIRSPD_MIN"].value, result["FW_AIRSPD_TRIM"]
    density_root = (results.test.air_density_kgpm3 / 1.225) ** 0.5
    assert slowest == pytest.approx(results.power_required[0].speed_mps * density_root, rel=1e-3)
    assert slowest <= trim.lo <= trim.value <= trim.hi


def test_sink_is_power_required_over_weight(results: Results) -> None:
    flat = [PowerPoint(speed_mps=v, power_W=75.0, power_lo_W=70.0, power_hi_W=80.0) for v in (12.0, 20.0)]
    parameters = with_parameters(results.with_curve(Kind.POWER_REQUIRED, points=flat)).autopilot_parameters
    sink = next(parameter for parameter in parameters if parameter.name == "TECS_SINK_MIN")
    weight_N = results.test.weight_N
    assert (sink.lo * weight_N, sink.value * weight_N, sink.hi * weight_N) == pytest.approx((70.0, 75.0, 80.0))


def test_the_table(results: Results) -> None:
    section = autopilot_section(with_parameters(results))
    assert section is not None and "FW_AIRSPD_TRIM" in {row[1] for row in section.parameters.rows}
    assert any("FW_THR_TRIM" in text for text in section.withheld)
    assert autopilot_section(results) is None
    assert "in the log" not in section.parameters.header, "the log of the daemon has no parameters"
    logged = with_parameters(results)
    first = replace(logged.autopilot_parameters[0], logged=15.0)
    section = autopilot_section(replace(logged, autopilot_parameters=[first, *logged.autopilot_parameters[1:]]))
    assert section is not None
    index = section.parameters.header.index("in the log")
    assert [row[index] for row in section.parameters.rows][:2] == ["15.0", ""]
    assert {len(row) for row in section.parameters.rows} == {len(section.parameters.header)}
