"""What a complete log gives beside the runs: the drag polar of the energy of the whole flight."""

from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.curve import Condition, Curve, Kind, power_required
from flightpower.analysis.methods.whole_flight.drag import DragEstimate
from flightpower.analysis.methods.whole_flight.energy_balance import FlightConditions, QuarticPolar, drag_power
from flightpower.analysis.methods.whole_flight.fit import Estimate, SharedError
from flightpower.analysis.methods.whole_flight.method import method_estimate, whole_flight
from flightpower.analysis.methods.whole_flight.parameters import Source, unpack
from flightpower.analysis.methods.whole_flight.settings import GPS
from flightpower.analysis.methods.whole_flight.thrust_balance import PARAMETERS as NAMES
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.log_reader import Log
from flightpower.flight.propeller_files import load_propeller
from flightpower.flight.units import GRAVITY_MPS2

CONDITIONS = FlightConditions(mass_kg=3.8, wing_area_m2=0.46, rho=1.19, idle_power_W=4.0)
PARAMETERS = np.array([np.log(0.04), np.log(0.06), 0.2, 0.0, 0.0, 0.0, 0.0, 0.0, np.log(0.2), 0.0])


def test_the_polar_has_the_power_and_the_interval_of_the_curve() -> None:
    condition = Condition(CONDITIONS.mass_kg * GRAVITY_MPS2, CONDITIONS.rho, CONDITIONS.wing_area_m2)
    V, scaled = np.linspace(12.0, 22.0, 31), np.zeros(len(PARAMETERS))
    scaled[NAMES.index("ln_CD0")] = 0.03
    drag_W = drag_power(V, 1.0, 0.0, QuarticPolar.of(unpack(NAMES, PARAMETERS)), CONDITIONS)
    heavier = CONDITIONS._replace(mass_kg=1.01 * CONDITIONS.mass_kg)
    shared = {Source.DENSITY: SharedError(scaled, CONDITIONS), Source.MASS: SharedError(0 * scaled, heavier)}
    parameters = Estimate(NAMES, PARAMETERS, np.diag(np.full(len(NAMES), 1e-12)), shared, CONDITIONS)
    power = Uncertain(drag_W, np.zeros((len(V), len(V))))
    curve = Curve(kind=Kind.POWER_REQUIRED, condition=condition, V_mps=V, power_W=power)
    drag = DragEstimate(curve, parameters, power, 0.8, True)
    estimate = method_estimate(drag)
    assert estimate.polar is not None
    power, error = power_required(V, estimate.polar, condition)
    assert power == pytest.approx(drag_W, rel=1e-6)
    by_scale = drag_power(V, 1.0, 0.0, QuarticPolar.of(unpack(NAMES, PARAMETERS + scaled)), CONDITIONS) - drag_W
    by_mass = drag_power(V, 1.0, 0.0, QuarticPolar.of(unpack(NAMES, PARAMETERS)), heavier) - drag_W
    assert error == pytest.approx(np.hypot(by_scale, by_mass), rel=0.02)


def test_a_log_without_battery_says_so() -> None:
    aircraft = load_complete_aircraft("nexstar")
    flight = whole_flight(Log(Path("log.mcap"), {}), aircraft, load_propeller(aircraft.propulsion.propeller))
    assert flight.electrical is None and flight.method.polar is None
    assert flight.method.notes == ("the log has no voltage and current",)


def test_an_airspeed_sensor_is_as_uncertain_as_an_aircraft_file_that_says_nothing() -> None:
    assert GPS.scale_sigma == Uncertainty().airspeed_scale_fraction
