"""The results of a flight from its energy balance: electrical power, and power required if thrust is known."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from scipy import special

from flightpower.analysis.curve import Condition, maximum_lift_to_drag, power_points
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate, FlownAircraft
from flightpower.analysis.methods.whole_flight.drag import DragEstimate, DragWithheld
from flightpower.analysis.methods.whole_flight.energy_balance import QuarticPolar
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable
from flightpower.analysis.methods.whole_flight.simulated_truth import SimulatedTruth
from flightpower.analysis.performance.autopilot_parameters import flight_values, typed_in
from flightpower.analysis.performance.request import density_altitude_m
from flightpower.analysis.records.flight import (
    UNKNOWN_SPEED,
    AircraftResult,
    AirFound,
    BatteryResult,
    CurveResult,
    CurveStatus,
    DragPolar,
    EnergyBalanceResult,
    FieldRow,
    Interval,
    Kind,
    MethodTried,
    PowerPoint,
    Provenance,
    Results,
)
from flightpower.analysis.results.curves import condition_result, curve_result, power_statistics
from flightpower.analysis.results.evidence import with_trust
from flightpower.analysis.results.settings import RESULTS
from flightpower.analysis.settings import CURVES, EVIDENCE
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.flight.atmosphere import SEA_LEVEL_DENSITY
from flightpower.flight.version import version

LARGE_SCALE = 0.03

WITHHELD_CLIMB = (
    "Climb, highest speed and ceiling are not known: they require full throttle over several speeds, a propeller table"
    " and motor speed."
)


class EnergyBalanceFindings(NamedTuple):
    """What is known about a flight.

    propeller : name of the table used to compute drag          battery : None if its energy is not known
    logged : the autopilot's parameters          simulated : the comparison with a simulation's truth
    vehicle : of the recording          tried : methods that the runs allow but that give no curve
    """

    flight: FlightTable
    estimate: ElectricalEstimate
    drag: DragEstimate | DragWithheld = DragWithheld()
    propeller: str = ""
    battery: BatteryResult | None = None
    logged: Mapping[str, float] = {}
    simulated: SimulatedTruth | None = None
    vehicle: str = ""
    tried: Sequence[MethodTried] = ()


def assemble_energy_balance(
    log: Path, aircraft: FlownAircraft, findings: EnergyBalanceFindings, provenance: Provenance
) -> Results:
    """Return the contents of `results.json`."""
    flight, estimate, drag, propeller, battery, logged, simulated, vehicle, tried = findings
    polar_estimate = None if isinstance(drag, DragWithheld) else drag
    condition = estimate.curve.condition
    standard = condition._replace(rho=SEA_LEVEL_DENSITY)
    electrical = electrical_curve(estimate, standard, battery)
    curves = {Kind.ELECTRICAL: electrical}
    if polar_estimate:
        curves[Kind.POWER_REQUIRED] = curve_result(polar_estimate.curve, standard)
        curves[Kind.SHAFT] = CurveResult(
            condition=condition_result(condition),
            points=power_points(polar_estimate.V_mps, polar_estimate.shaft.value, polar_estimate.shaft.half_width),
        )
    best = electrical.best_range_speed or UNKNOWN_SPEED
    parameters, withheld = typed_in(flight_values(estimate, best, logged, polar_estimate))
    return with_trust(
        Results(
            software_version=version(),
            log=str(log),
            aircraft=AircraftResult(
                name=aircraft.name,
                title=aircraft.name,
                wing_area_m2=aircraft.wing_area_m2,
                span_m=aircraft.span_m,
                propeller=propeller,
            ),
            vehicle=vehicle,
            test=condition_result(condition),
            standard=condition_result(standard),
            kind=Kind.ELECTRICAL,
            curves=curves,
            air=_air(flight, estimate),
            battery=battery,
            drag_polar=_polar(polar_estimate, aircraft) if polar_estimate else None,
            status=CurveStatus.CONVERGED,
            verdict="converged",
            methods_tried=list(tried),
            warnings=[*flight.notes, *_warnings(estimate), *([simulated.sentence()] if simulated else [])],
            withheld=[drag.sentence(), WITHHELD_CLIMB] if isinstance(drag, DragWithheld) else [WITHHELD_CLIMB],
            balance=_balance(findings),
            autopilot_parameters=parameters,
            autopilot_parameters_withheld=withheld,
            provenance=provenance,
        )
    )


def against_field_table(
    electrical: CurveResult, required: Sequence[PowerPoint], table: Sequence[FieldRow]
) -> list[str]:
    """Return a sentence if battery power from the whole flight's energy differs from that in the field table, which is
    computed from drag, propeller and motor, by more than errors cause once in a thousand flights. The sentence is about
    the speed where the difference is clearest.

    required : points of the curve from which the table is computed; the table's relative interval is at least theirs
    """
    battery, drag = (np.array([(p.speed_mps, p.power_W, p.power_lo_W, p.power_hi_W) for p in points]).T
                   for points in (electrical.points, required))  # fmt: skip
    rows = [row for row in table if battery[0, 0] <= row.speed_mps <= battery[0, -1] and not row.extrapolated]
    if not rows:
        return []
    V, table_W = np.array([(row.speed_mps, row.battery_W) for row in rows]).T
    (_, power_W, lo_W, hi_W), (_, drag_W, drag_lo_W, drag_hi_W) = (
        [np.interp(V, curve[0], values) for values in curve] for curve in (battery, drag)
    )
    allowed = np.hypot((hi_W - lo_W) / 2 / power_W, (drag_hi_W - drag_lo_W) / 2 / drag_W)
    ratio = np.abs(np.log(power_W / table_W)) / allowed
    index = int(np.argmax(ratio))
    if ratio[index] * NORMAL_95 <= -special.ndtri(EVIDENCE.rare_false_alarms / 2):
        return []
    share = (drag_hi_W[index] - drag_lo_W[index]) / 2 / drag_W[index]
    return [
        f"Two answers for the battery: at {V[index]:.0f} m/s the energy of the whole flight gives"
        f" {power_W[index]:.0f} W ({lo_W[index]:.0f} to {hi_W[index]:.0f}), and drag, propeller and motor, as in the"
        f" field table, {table_W[index]:.0f} W"
        f" ({(1 - share) * table_W[index]:.0f} to {(1 + share) * table_W[index]:.0f}). Errors as large as assumed would"
        " explain this once in a thousand flights. Hold that speed for a minute, level, and compare with the meter."
    ]


def electrical_curve(estimate: ElectricalEstimate, standard: Condition, battery: BatteryResult | None) -> CurveResult:
    """Return electrical power with the statistics that a pool needs, at enough speeds for a smooth curve."""
    indices = np.linspace(0, len(estimate.V_mps) - 1, 1 + CURVES.points // 5).round().astype(int)
    statistics = power_statistics(estimate.V_mps[indices], estimate.among_flights.at(indices))
    return curve_result(estimate.curve, standard, statistics=statistics, battery=battery)


def _air(flight: FlightTable, estimate: ElectricalEstimate) -> AirFound:
    rows, airspeed = flight.table[flight.flown], estimate.airspeed
    of_wind = airspeed.mean_wind_covariance
    return AirFound(
        temperature_K=flight.air_temperature_K,
        pressure_Pa=float(rows["static_Pa"].mean()),
        wind_mps=airspeed.wind_mps,
        wind_from_deg=airspeed.wind_from_deg,
        wind_standard_error_mps=None if of_wind is None else float(np.sqrt(np.mean(np.diag(of_wind)))),
        gust_mps=estimate.gust_mps,
        density_altitude_m=float(density_altitude_m(estimate.conditions.rho)),
    )


def _polar(drag: DragEstimate, aircraft: FlownAircraft) -> DragPolar:
    """Return the quadratic polar; the fourth-order term is only in the curve."""
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
        f"Thrust by the table of {propeller} and {speed}. With these the motor with its controller has an efficiency of"
        f" {100 * drag.motor_efficiency:.0f} % on average."
    )


def _balance(findings: EnergyBalanceFindings) -> EnergyBalanceResult:
    flight, estimate, drag, propeller, *_ = findings
    scale, half_scale = estimate.airspeed.scale, NORMAL_95 * float(np.sqrt(estimate.airspeed.scale_variance))
    return EnergyBalanceResult(
        residual_W=float(np.sqrt(np.mean(estimate.residual_W**2))),
        flown_s=float(flight.flown.sum() * FLIGHT.step_s),
        airspeed_scale=Interval(value=scale, lo=scale - half_scale, hi=scale + half_scale)
        if estimate.airspeed.wind is None
        else None,
        thrust_basis="" if isinstance(drag, DragWithheld) else _thrust_basis(drag, propeller),
        shaft_over_electrical=drag.motor_efficiency,
        thrust_efficiency=None if findings.simulated else _thrust_efficiency(estimate),
    )


def _thrust_efficiency(estimate: ElectricalEstimate) -> Interval | None:
    """Return the efficiency in level flight at the speed where the flight's energy shows it best; None if nowhere."""
    value, error = estimate.shown_efficiency.value, estimate.shown_efficiency.standard_error
    determined = np.flatnonzero(np.isfinite(value) & np.isfinite(error))
    if not len(determined):
        return None
    index = determined[np.argmin(error[determined])]
    lo, middle, hi = np.exp(value[index] + NORMAL_95 * error[index] * np.array([-1.0, 0.0, 1.0])).tolist()
    return Interval(value=middle, lo=lo, hi=hi)


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
    wide = estimate.standard_error_W * NORMAL_95 > RESULTS.wide * estimate.power_W
    if wide.any():
        notes.append(
            f"The interval is wider than ±{100 * RESULTS.wide:.0f} % at"
            f" {100 * wide.mean():.0f} % of the speeds flown: a longer flight with steady legs at several speeds"
            " narrows it."
        )
    return notes
