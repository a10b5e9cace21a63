"""Power required and shaft power of level flight, for flights in which a propeller's table gives thrust."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto
from typing import NamedTuple

import numpy as np

from flightpower.analysis.curve import Curve
from flightpower.analysis.estimation.model import NamedValues, PriorMeasurement
from flightpower.analysis.methods.whole_flight.curve import CurveOfFlight, ElectricalEstimate, drag_prior, lift_prior
from flightpower.analysis.methods.whole_flight.energy_balance import FlightConditions, QuarticPolar, drag_power
from flightpower.analysis.methods.whole_flight.fit import estimate_of, most_probable_fit, samples_of
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable
from flightpower.analysis.methods.whole_flight.parameters import THRUST_ERRORS
from flightpower.analysis.methods.whole_flight.settings import SHARED, THRUST, WINDOWS
from flightpower.analysis.methods.whole_flight.thrust_balance import MotorConstants, ThrustBalance
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.arrays import Array
from flightpower.flight.propeller import Propeller
from flightpower.flight.propeller_speed import revps_for_thrust


class DragLacks(Enum):
    """The thing that is missing if drag is not known."""

    PROPELLER = auto()
    MOTOR_SPEED = auto()
    POSSIBLE_EFFICIENCY = auto()


class DragWithheld(NamedTuple):
    """The reason why drag is withheld. motor_efficiency : as in `DragEstimate`; None where it is not known"""

    lacks: DragLacks = DragLacks.PROPELLER
    motor_efficiency: float | None = None

    def sentence(self) -> str:
        """The sentence for the report."""
        match self.lacks:
            case DragLacks.PROPELLER:
                return (
                    "Drag and shaft power are not known: they require the propeller's table (--propeller) and motor"
                    " speed (ESC telemetry or RPM messages) or the motor's constants (in an aircraft file, --aircraft)."
                )
            case DragLacks.MOTOR_SPEED:
                return (
                    "Drag and shaft power are not known: besides the propeller's table they require motor speed in the"
                    " log (ESC telemetry or RPM messages), or the motor's constants (kv, resistance, no-load current)"
                    " in an aircraft file (--aircraft)."
                )
            case DragLacks.POSSIBLE_EFFICIENCY:
                return (
                    "Drag is not known: by the propeller's table and motor speed the shaft takes"
                    f" {100 * (self.motor_efficiency or 0.0):.0f} % of the electrical power, which no motor does; check"
                    " the table, and the pole pairs that the speed was counted with."
                )


class ThrustSource(NamedTuple):
    """Inputs for thrust. motor: used if motor speed is not measured. uncertainty: includes errors of the table.
    stand: thrust measured at rest
    """

    propeller: Propeller | None = None
    motor: MotorConstants | None = None
    uncertainty: Uncertainty = Uncertainty()
    stand: Sequence[PriorMeasurement] = ()


@dataclass(frozen=True)
class DragEstimate(CurveOfFlight):
    """Power required at the speeds of the electrical curve, and shaft power.

    shaft : (n,) shaft power of level flight [W]; NaN where the propeller cannot give the thrust
    motor_efficiency : shaft power from the table over the motor's electrical power, averaged over flight under power
    measured_speed : whether motor speed was measured
    """

    shaft: Uncertain
    motor_efficiency: float
    measured_speed: bool


def drag_estimate(
    flight: FlightTable,
    electrical: ElectricalEstimate,
    span_m: float,
    source: ThrustSource,
    most_windows: int = WINDOWS.most,
) -> DragEstimate | DragWithheld:
    """Return the estimate of drag, or the reason why it is withheld."""
    measured = bool(flight.table[recording.MOTOR][flight.flown].notna().mean() > FLIGHT.measured_share)
    propeller, motor, uncertainty, stand = source
    if propeller is None:
        return DragWithheld()
    if not measured and motor is None:
        return DragWithheld(DragLacks.MOTOR_SPEED)
    c, airspeed = electrical.conditions, electrical.airspeed
    samples = samples_of(flight, airspeed.scale, airspeed.zero_Pa, airspeed.wind)
    if samples.motor_revps is not None:
        finite = np.isfinite(samples.motor_revps)
        if measured:
            samples = samples._replace(
                motor_revps=np.interp(samples.t_s, samples.t_s[finite], samples.motor_revps[finite])
            )
    balance = ThrustBalance(samples, c, propeller, None if measured else motor, most_windows)
    powered = balance.motor_W() > 0.2 * np.percentile(balance.motor_W(), 95)
    efficiency = float(np.sum(balance.shaft_W()[powered]) / np.sum(balance.motor_W()[powered]))
    if not THRUST.motor_efficiency[0] < efficiency < THRUST.motor_efficiency[1]:
        return DragWithheld(DragLacks.POSSIBLE_EFFICIENCY, efficiency)
    of_thrust = [(0.0, uncertainty.thrust_scale_fraction), (0.0, uncertainty.thrust_slope)]
    prior = {
        **drag_prior(span_m, c.wing_area_m2),
        **dict(zip(THRUST_ERRORS, of_thrust, strict=True)),
        **lift_prior(span_m, c.wing_area_m2),
    }
    rows = np.array([reading.row(balance.names) for reading in stand]).reshape(len(stand), len(balance.names))
    values = np.array([reading.value / reading.sigma for reading in stand])
    fit = most_probable_fit(balance, prior, (rows, values))
    power_sigma = SHARED.current if measured else float(np.hypot(SHARED.current, SHARED.motor_constants))
    parameters = estimate_of(
        flight, balance, fit, airspeed, power_sigma=power_sigma, updraft_share=SHARED.updraft_share_for_drag
    )
    V = electrical.V_mps

    def required(p: NamedValues, conditions: FlightConditions) -> Array:
        return drag_power(V, 1.0, 0.0, QuarticPolar.of(p), conditions)

    def shaft(p: NamedValues, conditions: FlightConditions) -> Array:
        correction = {name: p[name] for name in THRUST_ERRORS}
        revps = revps_for_thrust(propeller, V, required(p, conditions) / V, conditions.rho, **correction)
        _, shaft_W = propeller.thrust_and_power(V, revps, conditions.rho)
        return np.asarray(shaft_W)

    power, shaft_power = (parameters.quantity(quantity) for quantity in (required, shaft))
    curve = Curve(kind=Kind.POWER_REQUIRED, condition=electrical.curve.condition, V_mps=V, power_W=power)
    return DragEstimate(curve, parameters, shaft_power, efficiency, measured)
