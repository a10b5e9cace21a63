"""Results of every kind, without a flight."""

import numpy as np
import pytest
from msgspec.structs import replace

from flightpower.analysis.records.flight import (
    AircraftResult,
    AirFound,
    AvailableResult,
    BatteryResult,
    ConditionResult,
    CurveResult,
    CurveStatus,
    DisagreementResult,
    DragPolar,
    FieldRow,
    Interval,
    IntervalPart,
    Kind,
    LevelEfficiencyPoint,
    MethodPoint,
    MethodResult,
    ParameterResult,
    PerformanceCase,
    PerformanceResult,
    PowerPoint,
    PowerTrainResult,
    Results,
    RunResult,
    SpeedInterval,
)


def curve(scale: float = 1.0, dashed_above: float = np.inf) -> list[PowerPoint]:
    return [
        PowerPoint(speed_mps=v, power_W=p, power_lo_W=0.95 * p, power_hi_W=1.05 * p, extrapolated=v > dashed_above)
        for v, p in ((v, scale * (0.011 * v**3 + 330 / v)) for v in np.linspace(12, 24, 13).tolist())
    ]


@pytest.fixture
def results() -> Results:
    """Results without battery, full throttle or performance, as when the propeller table does not allow them."""
    run = RunResult(
        kind="acceleration",
        start_s=10,
        end_s=18,
        lowest_speed_mps=12,
        highest_speed_mps=24,
        altitude_change_m=0,
        notes=[],
    )
    steady = MethodResult(
        name="piw-viw", title="PIW-VIW", equations="(2.6)", power_required=curve(1.1),
        points=[MethodPoint(speed_mps=15.0, power_W=60.0, power_lo_W=55.0, power_hi_W=65.0, start_s=100.0)],
        notes=["few points & short"],
    )  # fmt: skip
    failed = MethodResult(name="w-delta", title="W/δ", notes=["no steady points"])
    disagreement = DisagreementResult(
        methods=("dynamic", "piw-viw"), speed_mps=15.0, difference_W=6.0, allowed_W=3.0, culprit="propeller table",
        text="PIW-VIW lies 10 % above: the propeller's table <gives> too much.",
    )  # fmt: skip
    none = SpeedInterval(speed_mps=None, lo_mps=None, hi_mps=None, inside_flown_range=False)
    condition = ConditionResult(weight_N=37.0, air_density_kgpm3=1.2)
    required = CurveResult(
        condition=condition, points=curve(dashed_above=20.0), standard=curve(), least_power_speed=none,
        best_range_speed=SpeedInterval(speed_mps=13.1, lo_mps=12.8, hi_mps=13.4, inside_flown_range=True),
        interval_parts=[IntervalPart(speed_mps=v, noise_W=1.0, systematic_W=2.0) for v in (12.0, 18.0, 24.0)],
    )  # fmt: skip
    return Results(
        software_version="0", log="flight.mcap",
        aircraft=AircraftResult(name="n", title="A & B", wing_area_m2=0.46, span_m=1.7, propeller="p"),
        test=condition,
        standard=ConditionResult(weight_N=38.0, air_density_kgpm3=1.225),
        air=AirFound(temperature_K=290.0, pressure_Pa=1e5), runs=[run],
        kind=Kind.POWER_REQUIRED, curves={Kind.POWER_REQUIRED: required}, cross_check=curve(1.02),
        drag_polar=DragPolar(
            A0=0.045, A1=0.0, A2=0.065, CD0=0.045, K=0.065, CL_minD=0.0, oswald_efficiency=0.75,
            maximum_lift_to_drag=9.2,
        ),
        status=CurveStatus.CONVERGED, verdict="converged", warnings=["mind <this>"],
        methods=[steady, failed], disagreements=[disagreement],
    )  # fmt: skip


def interval(value: float) -> Interval:
    """An interval whose ends lie at different distances from the value."""
    return Interval(value=value, lo=0.9 * value, hi=1.2 * value)


@pytest.fixture
def with_battery(results: Results) -> Results:
    """The results with a battery: 50 min at 14 m/s, 40 km at 16 m/s; 25 m/s and a climb of 4 m/s at full throttle."""
    flown = PerformanceCase(
        title="as flown", weight_N=37.0, air_density_kgpm3=1.2, density_altitude_m=200.0, endurance_s=interval(3000.0),
        endurance_speed_mps=interval(14.0), endurance_power_W=70.0, endurance_at_slowest=False,
        range_m=interval(40_000.0), range_speed_mps=interval(16.0), range_power_W=80.0,
        maximum_speed_mps=interval(25.0), best_climb_mps=interval(4.0),
    )  # fmt: skip
    available = AvailableResult(
        reason="", basis="From full throttle.", power_available=curve(2.0), climb_mps=[4.0] * 13,
        maximum_speed_mps=interval(25.0), maximum_speed_extrapolated=True, best_climb_mps=interval(4.0),
        best_climb_speed_mps=15.0, service_ceiling_m=interval(3000.0), absolute_ceiling_m=interval(3500.0), notes=[],
    )  # fmt: skip
    efficiency = [
        LevelEfficiencyPoint(
            speed_mps=v, propeller=interval(0.7), motor=interval(0.8), overall=interval(0.56), extrapolated=False
        )
        for v in (12.0, 18.0, 24.0)
    ]
    train = PowerTrainResult(
        measured=False, basis="The motor is assumed.", efficiency=efficiency, points=[],
        parameters=[ParameterResult(name="friction", value=0.17, standard_error=0.02, unit="W s/rev")],
    )  # fmt: skip
    row = FieldRow(
        speed_mps=14.0, power_required_W=50.0, battery_W=80.0, endurance_s=3000.0, range_m=42_000.0, climb_mps=None,
        extrapolated=True,
    )  # fmt: skip
    use = PerformanceResult(
        power_train=train, available=available,
        loadings=[flown], costs=["Costs <b>."],
        field_table=[row],
    )  # fmt: skip
    return replace(results, use=use, battery=BatteryResult(energy_Wh=74.0, usable=0.8))
