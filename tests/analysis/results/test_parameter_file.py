"""Parameter files can be read as ground stations read them; they have no airspeed below the stall margin."""

import sys
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
import pytest

from flightpower.analysis.cli import parameters
from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.performance.autopilot_parameters import ENTRIES, THROTTLE, FlightValues, around, typed_in
from flightpower.analysis.records.flight import (
    AircraftResult,
    AvailableResult,
    ConditionResult,
    CurveResult,
    Evidence,
    EvidenceKind,
    Kind,
    PartOfResult,
    PerformanceCase,
    PerformanceResult,
    PowerPoint,
    PowerTrainResult,
    Results,
    SlowestFlown,
    Trust,
)
from flightpower.analysis.results.parameter_file import (
    CRUISE,
    FASTEST,
    FIRMWARE,
    SLOWEST,
    For,
    StallMargin,
    parameter_file,
)
from flightpower.flight.errors import InputError

NO_STALL = StallMargin(1.0)  # stall far below any speed flown


def results(largest_CL: float | None = None, logged: dict[str, float] | None = None, **changed: Any) -> Results:
    """Return results of a flight between 11 and 22 m/s with cruise at 13.117 m/s."""
    values = FlightValues(
        cruise=around(13.117, 0.2), slowest=around(11.0, 0.1), fastest=around(22.0, 0.1),
        wing_loading=around(132.7, 1.0), cruise_power=around(74.66, 2.0), idle_power=around(8.0, 0.5),
        sink=around(1.2, 0.05), CD0=around(0.0405, 0.001), B=around(0.0510, 0.001), logged=logged or {},
    )  # fmt: skip
    result, withheld = typed_in(values)
    condition = ConditionResult(weight_N=37.66, air_density_kgpm3=1.19)
    slowest = largest_CL and SlowestFlown(speed_mps=11.0, lift_coefficient=1.1, largest_lift_coefficient=largest_CL)
    return Results(
        **{
            "software_version": "0", "log": "log.ulg", "aircraft": AircraftResult(
                name="a", title="A", wing_area_m2=0.4636, span_m=1.75, propeller=""
            ), "test": condition, "kind": Kind.POWER_REQUIRED,
            "curves": {Kind.POWER_REQUIRED: CurveResult(condition=condition, points=changed.pop("points", []))},
            "slowest_flown": slowest or None, "autopilot_parameters": result, "autopilot_parameters_withheld": withheld,
        }
        | changed
    )  # fmt: skip


def read(text: str, firmware: For) -> dict[str, float]:
    """Read a file as QGroundControl, Mission Planner and INAV's command line do."""
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    if firmware is For.PX4:
        rows = [line.split("\t") for line in lines]
        assert all((vehicle, component, kind) == ("1", "1", "9") for vehicle, component, _, _, kind in rows)
        return {name: float(value) for _, _, name, value, _ in rows}
    if firmware is For.ARDUPILOT:
        return {name: float(value) for name, value in (line.split(",") for line in lines)}
    assert all(line.startswith("set ") for line in lines)
    return {name: int(value) for name, value in (line.removeprefix("set ").split(" = ") for line in lines)}


@pytest.mark.parametrize("firmware", For)
def test_the_values_are_those_of_the_flight(firmware: For) -> None:
    result = results()
    values = read(parameter_file(result, firmware, NO_STALL), firmware)
    own = {parameter.name: parameter.value for parameter in result.autopilot_parameters}
    assert len(values) >= 3
    for name, value in values.items():
        assert value == pytest.approx(own[name], rel=2e-3)


def test_of_two_names_of_one_parameter_the_log_decides() -> None:
    newer = read(parameter_file(results(), For.ARDUPILOT, NO_STALL), For.ARDUPILOT)
    older = read(parameter_file(results(logged={"TRIM_ARSPD_CM": 1400.0}), For.ARDUPILOT, NO_STALL), For.ARDUPILOT)
    assert "AIRSPEED_CRUISE" in newer and "TRIM_ARSPD_CM" not in newer
    assert older["TRIM_ARSPD_CM"] == 1312 and "AIRSPEED_CRUISE" not in older
    assert "AIRSPEED_MIN" in older and "ARSPD_FBW_MIN" not in older


@pytest.mark.parametrize("firmware", For)
@pytest.mark.parametrize("stall_mps", [None, 9.0, 12.345])
def test_no_airspeed_is_below_the_stall_margin(firmware: For, stall_mps: float | None) -> None:
    """This holds in m/s or cm/s and after rounding; airspeeds above the margin are not changed."""
    result = results(largest_CL=1.3)
    at_stall = float(speed_at(1.3, Condition(37.66, 1.225, 0.4636))) if stall_mps is None else stall_mps
    values = read(parameter_file(result, firmware, StallMargin(stall_mps, 1.2)), firmware)
    for name in values.keys() & (SLOWEST | CRUISE | FASTEST):
        scale = 100.0 if firmware is For.INAV else 1.0
        assert values[name] >= 1.2 * at_stall * scale
        if name in SLOWEST:
            assert values[name] == pytest.approx(max(11.0, 1.2 * at_stall) * scale, rel=2e-3)


@pytest.mark.parametrize("firmware", For)
def test_where_no_stall_is_known_the_slowest_flown_stands_for_it(firmware: For) -> None:
    """An autopilot's log does not show the largest lift coefficient. 12 m/s true are 11.83 m/s equivalent."""
    points = [PowerPoint(speed_mps=v, power_W=80.0, power_lo_W=70.0, power_hi_W=90.0) for v in (12.0, 22.0)]
    result = results()
    curve = CurveResult(condition=result.test, points=points)
    electrical = msgspec.structs.replace(result, kind=Kind.ELECTRICAL, curves={Kind.ELECTRICAL: curve})
    text = parameter_file(electrical, firmware)
    least = 1.2 * 12.0 * (1.19 / 1.225) ** 0.5
    for name, value in read(text, firmware).items():
        if name in SLOWEST | CRUISE:
            assert value == pytest.approx(least * (100.0 if firmware is For.INAV else 1.0), rel=1e-3)
    assert "--stall" in text and f"{least:.4g} m/s" in text


def test_sink_and_power_are_those_of_a_raised_cruise() -> None:
    """Power goes with the cube of airspeed: 1.3 times the speed takes 2.197 times the power and interval."""
    speeds = [10.0, *np.linspace(12.0, 20.0, 801), 24.0]
    points = [PowerPoint(speed_mps=v, power_W=v**3, power_lo_W=0.9 * v**3, power_hi_W=1.1 * v**3) for v in speeds]
    result = results()
    curves = {
        kind: CurveResult(condition=result.test, points=points) for kind in (Kind.POWER_REQUIRED, Kind.ELECTRICAL)
    }
    result = msgspec.structs.replace(result, curves=curves)
    raised = StallMargin(1.3 * 13.117 / 1.2)
    sink = read(parameter_file(result, For.ARDUPILOT, raised), For.ARDUPILOT)
    assert sink["TECS_SINK_MIN"] == pytest.approx(1.2 * 1.3**3, rel=1e-3)
    text = parameter_file(result, For.INAV, raised)
    assert read(text, For.INAV)["cruise_power"] == pytest.approx(7466 * 1.3**3, rel=1e-3)
    assert f"({7266 * 1.3**3:.4g} to {7666 * 1.3**3:.4g})" in text and "Cruise is now the lowest airspeed" in text
    assert read(text, For.INAV)["idle_power"] == 800  # with the motor stopped, at any speed
    slower = parameter_file(result, For.INAV, StallMargin(10.0))
    assert read(slower, For.INAV)["cruise_power"] == 7466 and "Cruise is now" not in slower


def test_without_a_curve_of_drag_the_sink_of_a_raised_cruise_is_that_of_the_polar() -> None:
    """It goes with V^3 (C_D0 + B C_L^2), C_L = K / V^2; cruise power is withheld if no curve contains it."""
    V, raised_mps = 13.117, 15.6
    power = [v**3 * (0.0405 + 0.0510 * (132.7 / v**2) ** 2) for v in (V, raised_mps)]
    text = parameter_file(results(), For.PX4, StallMargin(13.0))
    assert read(text, For.PX4)["FW_T_SINK_MIN"] == pytest.approx(1.2 * power[1] / power[0], rel=1e-3)
    text = parameter_file(results(), For.INAV, StallMargin(13.0))
    assert "cruise_power" not in read(text, For.INAV) and "# cruise_power is withheld: its value at the raised" in text
    polar = [parameter for parameter in results().autopilot_parameters if parameter.name != "SOAR_POLAR_B"]
    text = parameter_file(results(autopilot_parameters=polar), For.PX4, StallMargin(13.0))
    assert "FW_T_SINK_MIN" not in read(text, For.PX4) and text.count("FW_T_SINK_MIN is withheld") == 1


def test_a_stall_speed_that_is_given_is_reported() -> None:
    text = parameter_file(results(), For.PX4, StallMargin(8.0))
    assert "9.6 m/s: 1.2 times 8 m/s, the stall speed given" in text
    assert read(text, For.PX4)["FW_AIRSPD_MIN"] == 11.0


def test_a_stall_margin_beyond_the_fastest_flown_is_refused() -> None:
    with pytest.raises(InputError, match="--stall"):
        parameter_file(results(), For.PX4, StallMargin(20.0, 1.2))


@pytest.mark.parametrize("firmware", For)
def test_what_does_not_follow_is_named_in_the_names_of_the_firmware_alone(firmware: For) -> None:
    """A pilot of INAV need not know what ArduPlane calls its throttle."""
    text = parameter_file(results(), firmware, NO_STALL)
    others = {entry.name for entry in ENTRIES if entry.firmware != FIRMWARE[firmware]}
    others |= {
        name for name, message in THROTTLE.items() if name != FIRMWARE[firmware] for name in [message.split()[0]]
    }
    comments = "".join(line for line in text.splitlines(keepends=True) if line.startswith("#"))
    assert {name for name in others if name in comments} == set()
    assert not any(word in text for word in FIRMWARE.values() if word != FIRMWARE[firmware])
    assert f"# {THROTTLE[FIRMWARE[firmware]]} does not follow: it requires a throttle" in comments
    written = {parameter.name for parameter in results().autopilot_parameters}
    own = {entry.name for entry in ENTRIES if entry.firmware == FIRMWARE[firmware]}
    assert all(f"{name} is withheld" in text for name in own - written)
    assert own - written == {For.PX4: {"ASPD_SCALE_1"}, For.ARDUPILOT: {"ARSPD_RATIO"}, For.INAV: set()}[firmware]


@pytest.mark.parametrize(
    ("firmware", "climb", "sink"),
    [(For.PX4, "FW_T_CLMB_MAX", "FW_T_SINK_MAX"), (For.ARDUPILOT, "TECS_CLMB_MAX", "TECS_SINK_MAX")],
)
def test_climb_and_sink_are_limited_by_full_throttle_and_by_drag(firmware: For, climb: str, sink: str) -> None:
    """Climb at cruise is 4.5 m/s, less 10 % at its lower end; 120 W over 37.66 N are a sink of 3.19 m/s."""
    points = [PowerPoint(speed_mps=v, power_W=p, power_lo_W=0.95 * p, power_hi_W=1.05 * p)
              for v, p in ((12.0, 50.0), (16.0, 120.0))]  # fmt: skip
    case = PerformanceCase(
        title="", weight_N=37.66, air_density_kgpm3=1.19, density_altitude_m=0.0, endurance_s=around(3000.0, 1.0),
        endurance_speed_mps=around(12.0, 0.1), endurance_power_W=60.0, endurance_at_slowest=False,
        range_m=around(40000.0, 1.0), range_speed_mps=around(14.0, 0.1), range_power_W=70.0,
        maximum_speed_mps=None, best_climb_mps=around(5.0, 0.5),
    )  # fmt: skip
    available = AvailableResult(
        reason="", basis="", power_available=points, climb_mps=[5.0, 4.0], maximum_speed_mps=None,
        maximum_speed_extrapolated=False, best_climb_mps=around(5.0, 0.5), best_climb_speed_mps=12.0,
        service_ceiling_m=None, absolute_ceiling_m=None, notes=[],
    )  # fmt: skip
    train = PowerTrainResult(measured=True, basis="", parameters=[], efficiency=[], points=[])
    use = PerformanceResult(
        power_train=train, available=available, loadings=[case], costs=[],
        field_table=[],
    )  # fmt: skip
    values = read(parameter_file(results(use=use, points=points), firmware, NO_STALL), firmware)
    assert values[climb] == pytest.approx(4.5 * 0.9, rel=1e-3)
    assert values[sink] == pytest.approx(120 / 37.66, rel=1e-3)
    without = msgspec.structs.replace(use, available=msgspec.structs.replace(available, best_climb_mps=None))
    assert climb not in read(parameter_file(results(use=without), firmware, NO_STALL), firmware)


DISTRUST = Evidence(
    kind=EvidenceKind.CROSS_CHECK, level=Trust.NOT_TO_BE_TRUSTED, part=PartOfResult.CURVE, text="It differs."
)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (results(), ("--for", "px4")),
        (results(), ("--for", "betaflight", "-o", "new")),
        (results(), ("--for", "px4", "-o", "results.json")),
        (results(autopilot_parameters=[]), ("--for", "inav", "-o", "new")),
        (results(trust=Trust.NOT_TO_BE_TRUSTED, evidence=[DISTRUST]), ("--for", "px4", "-o", "new")),
        (results(), ("--for", "px4", "--stall", "fast", "-o", "new")),
    ],
)
def test_what_is_wrong_is_one_line(content, words, tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path("results.json").write_bytes(msgspec.json.encode(content))
    monkeypatch.setattr(sys, "argv", ["parameters", "results.json", *words])
    with pytest.raises(SystemExit) as ended:
        parameters.main()
    printed = capsys.readouterr()
    assert ended.value.code == 2
    assert printed.err.startswith("error: ") and printed.err.count("\n") == 1
    assert not Path("new").exists()


def test_the_command_writes_the_file(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("results.json").write_bytes(msgspec.json.encode(results(largest_CL=1.3)))
    monkeypatch.setattr(sys, "argv", ["parameters", "results.json", "--for", "inav", "-o", "my.txt"])
    parameters.main()
    assert read(Path("my.txt").read_text("utf-8"), For.INAV).keys() == {
        "nav_fw_cruise_speed", "cruise_power", "idle_power"
    }  # fmt: skip
