"""Made-up results of an analysis: the values of an aircraft of 3.84 kg with its propeller, and their errors."""

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np

from flightpower.analysis.curve import Condition, speed_at
from flightpower.analysis.missions.energy import Battery
from flightpower.analysis.missions.inputs import RouteInput
from flightpower.analysis.missions.mission import Mission, Wind, parse_legs
from flightpower.analysis.missions.power import source_of
from flightpower.analysis.missions.prediction import RESOLUTION, Air, Flight, Route
from flightpower.analysis.performance.propagation import ParameterVector
from flightpower.analysis.records.flight import (
    AircraftResult,
    AirFound,
    AvailableResult,
    BatteryResult,
    ComputationModel,
    ConditionResult,
    CurveResult,
    CurveStatus,
    Kind,
    PerformanceResult,
    PowerStatistics,
    PowerTrainResult,
    PropellerRow,
    PropellerTable,
    Results,
    SlowestFlown,
)
from flightpower.flight.propeller_files import load_propeller

WEIGHT_N, RHO, AREA_M2 = 3.84 * 9.80665, 1.19, 0.4636
FLOWN_CL = (0.25, 1.0)
VALUES = {
    "A0": 0.0465, "A1": -0.0195, "A2": 0.065, "thrust_scale": 0.0, "thrust_slope": 0.0, "alpha_0": -0.075,
    "alpha_CL": 0.235, "shaft_scale": 1.0, "friction": 0.28, "copper": 300.0, "meter_scale": 0.0,
    "unloaded_revps": 165.0, "revps_per_Nm": 60.0,
}  # fmt: skip
SHARES = {"A0": 0.03, "A1": 0.05, "A2": 0.04, "shaft_scale": 0.03, "friction": 0.1, "copper": 0.1}  # relative
AT = ConditionResult(weight_N=WEIGHT_N, air_density_kgpm3=RHO)
CALM = Wind(0.0, 0.0, 0.0)
BATTERY = Battery(energy_J=74 * 3600.0, reserve=0.2)


def parameters() -> ParameterVector:
    sigma = np.array([SHARES.get(name, 0.0) * abs(value) for name, value in VALUES.items()])
    sigma[list(VALUES).index("meter_scale")] = 0.02
    return ParameterVector(tuple(VALUES), np.array([*VALUES.values()]), np.diag(sigma**2))


def aerodynamic_results(**changed: Any) -> RouteInput:
    return of_results(aerodynamic_flight(**changed))


def of_results(results: Results) -> RouteInput:
    return msgspec.convert(results, RouteInput, from_attributes=True)


def aerodynamic_flight(**changed: Any) -> Results:
    table = load_propeller("apc-12x8e")
    polar = parameters()
    model = ComputationModel(
        names=list(polar.names),
        values=polar.values.tolist(),
        covariance=polar.covariance.tolist(),
        no_load_torque_Nm=0.01,
        flown_CL=FLOWN_CL,
        propeller=PropellerTable(
            name=table.name,
            diameter_m=table.diameter_m,
            beyond_zero_thrust=table.beyond_zero_thrust,
            rows=[PropellerRow(rpm=r.rpm, J=list(r.J), cT=list(r.cT), cP=list(r.cP)) for r in table.rows],
        ),
    )
    available = AvailableResult(
        reason="", basis="", power_available=[], climb_mps=[], maximum_speed_mps=None, maximum_speed_extrapolated=False,
        best_climb_mps=None, best_climb_speed_mps=None, service_ceiling_m=None, absolute_ceiling_m=None, notes=[],
    )  # fmt: skip
    train = PowerTrainResult(measured=True, basis="", parameters=[], efficiency=[], points=[])
    use = PerformanceResult(
        power_train=train, available=available, loadings=[], costs=[],
        field_table=[], model=model,
    )  # fmt: skip
    slowest = SlowestFlown(
        speed_mps=float(speed_at(FLOWN_CL[1], Condition(WEIGHT_N, RHO, AREA_M2))),
        lift_coefficient=FLOWN_CL[1],
        largest_lift_coefficient=1.2,
    )
    battery = BatteryResult(energy_Wh=74.0, usable=0.8)
    return _results(**{"use": use, "battery": battery, "slowest_flown": slowest} | changed)


def electrical_results(**changed: Any) -> RouteInput:
    return of_results(electrical_flight(**changed))


def electrical_flight(**changed: Any) -> Results:
    """Return results with a curve of electrical power that includes 8 W of idle power."""
    V = np.linspace(11.0, 22.0, 13)
    power_W = 8 + 0.022 * V**3 + 500 / V
    statistics = PowerStatistics(
        speed_mps=V.tolist(),
        power_W=power_W.tolist(),
        own_covariance=np.diag((0.01 * power_W) ** 2).tolist(),
        shared={"current": (0.02 * power_W).tolist()},
    )
    curve = CurveResult(condition=AT, points=[], idle_power_W=8.0, statistics=statistics)
    return _results(**{"kind": Kind.ELECTRICAL, "curves": {Kind.ELECTRICAL: curve}} | changed)


def _results(**more: Any) -> Results:
    return Results(
        **{
            "software_version": "0", "log": "log.mcap", "aircraft": AircraftResult(
                name="a", title="A", wing_area_m2=AREA_M2, span_m=1.75, propeller="apc-12x8e"
            ), "test": AT, "air": AirFound(temperature_K=288.15, pressure_Pa=1.19 * 287.05287 * 288.15),
            "kind": Kind.POWER_REQUIRED, "curves": {Kind.POWER_REQUIRED: CurveResult(condition=AT, points=[])},
            "status": CurveStatus.CONVERGED,
        }
        | more
    )  # fmt: skip


def flight(wind: Wind = CALM, **changed: Any) -> Flight:
    air = Air(1.19 * 287.05287 * 288.15, 288.15)
    return replace(Flight(wind, BATTERY, air, WEIGHT_N), **changed)


def legs(text: str) -> Mission:
    return parse_legs(text, 0.0)


def route_of(results: RouteInput, mission: Mission, how: Flight) -> Route:
    rng = np.random.default_rng(0)
    return Route(source_of(results, how.idle_W, RESOLUTION.draws, rng), mission, how, rng)
