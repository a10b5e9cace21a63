"""The electrical power of level flight in the form of `results.json`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from analysis.curve import Cost, maximum_lift_to_drag, power_points
from analysis.estimation.noise import NORMAL_95
from analysis.methods.whole_flight.curve import ElectricalEstimate, FlownAircraft
from analysis.methods.whole_flight.drag import DragEstimate, DragWithheld
from analysis.methods.whole_flight.energy_balance import QuarticPolar, level_efficiency
from analysis.methods.whole_flight.flight_table import FlightTable
from analysis.methods.whole_flight.simulated_truth import SimulatedTruth
from analysis.performance.autopilot_parameters import flight_values, typed_in
from analysis.records.flight import (
    AircraftResult,
    ConditionResult,
    CurveStatus,
    DragPolar,
    ElectricalResult,
    ElectricalStatistics,
    Interval,
    IntervalPart,
    MethodTried,
    Provenance,
    Results,
    SpeedInterval,
)
from analysis.results.evidence import with_trust
from analysis.settings import CURVES
from analysis.sources.grid_settings import FLIGHT
from flight.atmosphere import SEA_LEVEL_DENSITY
from flight.version import version

UNKNOWN = SpeedInterval(speed_mps=None, lo_mps=None, hi_mps=None, inside_flown_range=False)
LARGE_SCALE = 0.03
LARGE_HALF_WIDTH = 0.3

WITHHELD_CLIMB = (
    "Climb, highest speed and ceiling are not known: they require full throttle over several speeds, a propeller table"
    " and motor speed."
)


class UsedBattery(NamedTuple):
    """usable : share of its energy"""

    energy_Wh: float
    usable: float

    @property
    def usable_J(self) -> float:
        return 3600 * self.energy_Wh * self.usable


class ElectricalFindings(NamedTuple):
    """What is known of a flight.

    propeller : name of the table that drag follows from          battery : None where its energy is not known
    logged : the autopilot's parameters          simulated : the comparison with a simulation's truth
    vehicle : of the recording          tried : methods that its runs allow, and that give no curve
    """

    flight: FlightTable
    estimate: ElectricalEstimate
    drag: DragEstimate | DragWithheld = DragWithheld()
    propeller: str = ""
    battery: UsedBattery | None = None
    logged: Mapping[str, float] = {}
    simulated: SimulatedTruth | None = None
    vehicle: str = ""
    tried: Sequence[MethodTried] = ()


def electrical_results(
    log: Path, aircraft: FlownAircraft, found: ElectricalFindings, provenance: Provenance
) -> Results:
    """The contents of `results.json`."""
    flight, estimate, drag, propeller, _, logged, simulated, vehicle, tried = found
    beside, known = _beside_the_curve(found), None if isinstance(drag, DragWithheld) else drag
    parameters, withheld = typed_in(flight_values(estimate, beside.best_range_speed, logged, known))
    rows = flight.table[flight.flown]
    weight = ConditionResult(weight_N=aircraft.weight_N, air_density_kgpm3=estimate.conditions.rho)
    results = Results(
        software_version=version(),
        log=str(log),
        aircraft=AircraftResult(
            name=aircraft.name, title=aircraft.name, wing_area_m2=aircraft.wing_area_m2, span_m=aircraft.span_m,
            propeller=propeller,
        ),
        vehicle=vehicle,
        test=weight,
        standard=ConditionResult(weight_N=aircraft.weight_N, air_density_kgpm3=SEA_LEVEL_DENSITY),
        air_temperature_K=flight.air_temperature_K,
        air_pressure_Pa=float(rows["static_Pa"].mean()),
        runs=[],
        rejected=[],
        parameters=[],
        drag_polar=_polar(known, aircraft) if known else None,
        power_required=known.curve.points() if known else [],
        power_required_standard=[],
        cross_check=[],
        minimum_power_speed=UNKNOWN,
        best_range_speed=UNKNOWN,
        status=CurveStatus.CONVERGED,
        verdict="converged",
        methods_tried=list(tried),
        warnings=[*flight.notes, *_warnings(estimate), *([simulated.sentence()] if simulated else [])],
        electrical_power=estimate.curve.points(),
        electrical=beside,
        autopilot_parameters=parameters,
        autopilot_parameters_withheld=withheld,
        provenance=provenance,
    )  # fmt: skip
    return with_trust(results)


def _polar(drag: DragEstimate, aircraft: FlownAircraft) -> DragPolar:
    """The quadratic polar; the term of fourth order is in the curve alone."""
    p = QuarticPolar.of(drag.parameters.named())
    A0, A1, A2 = p.CD0 + p.K * p.CL_minD**2, -2 * p.K * p.CL_minD, p.K
    best = maximum_lift_to_drag(np.array([A0, A1, A2]))
    return DragPolar(
        A0=A0, A1=A1, A2=A2, CD0=p.CD0, K=p.K, CL_minD=p.CL_minD,
        oswald_efficiency=aircraft.wing_area_m2 / (np.pi * p.K * aircraft.span_m**2),
        maximum_lift_to_drag=best if np.isfinite(best) else None,
    )  # fmt: skip


def _thrust_basis(drag: DragEstimate, propeller: str) -> str:
    speed = "motor speed in the log" if drag.measured_speed else "motor speed by electrical power and motor constants"
    return (
        f"Thrust by the table of {propeller} and {speed}. By these the motor with its controller has an efficiency of"
        f" {100 * drag.motor_efficiency:.0f} % on average."
    )


def _beside_the_curve(found: ElectricalFindings) -> ElectricalResult:
    flight, estimate, drag, propeller, battery, *_ = found
    curve, power = estimate.curve, estimate.curve.power_W
    noise, systematic = (NORMAL_95 * np.sqrt(np.diag(part)) for part in (power.own, power.by_shared))
    scale, half_scale = estimate.airspeed.scale, NORMAL_95 * float(np.sqrt(estimate.airspeed.scale_variance))
    return ElectricalResult(
        least_power_speed=curve.best(Cost.POWER),
        best_range_speed=curve.best(Cost.ENERGY_PER_METER),
        endurance_s=curve.longest(Cost.POWER, battery.usable_J) if battery else None,
        range_m=curve.longest(Cost.ENERGY_PER_METER, battery.usable_J) if battery else None,
        battery_energy_Wh=battery.energy_Wh if battery else None,
        interval_parts=[
            IntervalPart(speed_mps=float(v), noise_W=float(n), systematic_W=float(s))
            for v, n, s in zip(curve.V_mps, noise, systematic, strict=True)
        ],
        residual_W=float(np.sqrt(np.mean(estimate.residual_W**2))),
        idle_power_W=estimate.conditions.idle_power_W,
        airspeed_scale=Interval(value=scale, lo=scale - half_scale, hi=scale + half_scale)
        if estimate.airspeed.wind is None
        else None,
        wind_mps=estimate.airspeed.wind_mps,
        wind_from_deg=estimate.airspeed.wind_from_deg,
        flown_s=float(flight.flown.sum() * FLIGHT.step_s),
        withheld=[drag.sentence(), WITHHELD_CLIMB] if isinstance(drag, DragWithheld) else [WITHHELD_CLIMB],
        shaft_power=[]
        if isinstance(drag, DragWithheld)
        else power_points(drag.V_mps, drag.shaft.value, drag.shaft.half_width),
        thrust_basis="" if isinstance(drag, DragWithheld) else _thrust_basis(drag, propeller),
        pooling=_statistics(estimate),
        shaft_over_electrical=drag.motor_efficiency,
        thrust_efficiency=None if found.simulated else _thrust_efficiency(estimate),
    )


def _thrust_efficiency(estimate: ElectricalEstimate) -> Interval | None:
    """Of level flight at the speed at which its relative error is least; None where it is known at no speed."""
    V = estimate.V_mps
    efficiency = estimate.parameters.quantity(lambda parameters, given: level_efficiency(V, parameters, given))
    value, error = efficiency.value, efficiency.standard_error
    known = np.flatnonzero(np.isfinite(error) & (value > 0))
    if not len(known):
        return None
    at = known[np.argmin(error[known] / value[known])]
    half = NORMAL_95 * error[at]
    return Interval(value=float(value[at]), lo=float(value[at] - half), hi=float(value[at] + half))


def _statistics(estimate: ElectricalEstimate) -> ElectricalStatistics:
    """At as many speeds as a curve is smooth between."""
    at = np.linspace(0, len(estimate.V_mps) - 1, 1 + CURVES.points // 5).round().astype(int)
    found = estimate.among_flights.at(at)
    return ElectricalStatistics(
        speed_mps=estimate.V_mps[at].tolist(),
        power_W=found.value.tolist(),
        own_covariance=found.own.tolist(),
        shared={str(name): change.tolist() for name, change in found.shared.items()},
    )


def _warnings(estimate: ElectricalEstimate) -> list[str]:
    notes = []
    scale, airspeed = estimate.airspeed.scale, estimate.airspeed
    if airspeed.wind_mps is None:
        notes.append("No GPS in this log: the airspeed is taken as measured, and wind is not known.")
    elif abs(scale) > LARGE_SCALE:
        notes.append(
            f"Airspeed reads {100 * abs(scale):.0f} % too {'high' if scale > 0 else 'low'} by GPS; this is corrected."
            " Check the pitot's place and the calibration."
        )
    wide = estimate.standard_error_W * NORMAL_95 > LARGE_HALF_WIDTH * estimate.power_W
    if wide.any():
        notes.append(
            f"The interval is wider than ±{100 * LARGE_HALF_WIDTH:.0f} % at"
            f" {100 * wide.mean():.0f} % of the speeds flown: a longer flight with steady legs at several speeds"
            " narrows it."
        )
    return notes
