"""What a complete log gives beside the runs, by the energy of the whole flight: electrical power and a drag polar."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flightpower.analysis.air.contents import Replacements
from flightpower.analysis.curve import Condition, Curve
from flightpower.analysis.curve import power_required as polar_power
from flightpower.analysis.flight import Reconstructed, reconstructed, recorded, synchronized, with_runs
from flightpower.analysis.methods.whole_flight.drag import DragEstimate
from flightpower.analysis.methods.whole_flight.energy_balance import FlightConditions, QuarticPolar, drag_power
from flightpower.analysis.methods.whole_flight.fit import Estimate, SharedError
from flightpower.analysis.methods.whole_flight.method import airspeed_by_trajectory, method_estimate, whole_flight
from flightpower.analysis.methods.whole_flight.parameters import Source, unpack
from flightpower.analysis.methods.whole_flight.settings import GPS
from flightpower.analysis.methods.whole_flight.thrust_balance import PARAMETERS as NAMES
from flightpower.analysis.records.flight import Kind
from flightpower.analysis.sources.daemon_recording import recording_of, recording_with_air_data
from flightpower.analysis.sources.recording import AIRSPEED_PRESSURE
from flightpower.analysis.uncertain import Uncertain
from flightpower.flight.aircraft import Uncertainty
from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.log_reader import Log, read_log
from flightpower.flight.units import GRAVITY_MPS2
from flightpower.sim.plant import plant_of
from flightpower.sim.trim import power_required
from tests.unchanged.commands import flight

sys.path.insert(0, str(Path(__file__).parents[4] / "benchmarks"))
from electrical import battery_power

AIRCRAFT = load_complete_aircraft("nexstar")

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
    certain = Uncertain(drag_W, np.zeros((len(V), len(V))))
    curve = Curve(kind=Kind.POWER_REQUIRED, condition=condition, V_mps=V, power_W=certain)
    drag = DragEstimate(curve, parameters, certain, 0.8, True)
    estimate = method_estimate(drag)
    assert estimate.polar is not None
    power, error = polar_power(V, estimate.polar, condition)
    assert power == pytest.approx(drag_W, rel=1e-6)
    by_scale = drag_power(V, 1.0, 0.0, QuarticPolar.of(unpack(NAMES, PARAMETERS + scaled)), CONDITIONS) - drag_W
    by_mass = drag_power(V, 1.0, 0.0, QuarticPolar.of(unpack(NAMES, PARAMETERS)), heavier) - drag_W
    assert error == pytest.approx(np.hypot(by_scale, by_mass), rel=0.02)


@pytest.fixture(scope="module")
def complete(tmp_path_factory: pytest.TempPathFactory) -> Reconstructed:
    """The demonstration by sensors without errors, up to its trajectory."""
    path = tmp_path_factory.mktemp("complete") / "log.mcap"
    path.write_bytes(flight("demo", "--errors", "none"))
    return reconstructed(with_runs(synchronized(recorded(read_log(path), Replacements())), None))


def test_a_log_without_battery_says_so(complete: Reconstructed) -> None:
    energy = whole_flight(replace(complete, log=Log(Path("log.mcap"), {})))
    assert energy.electrical is None and energy.method.polar is None
    assert energy.method.notes == ("the log has no voltage and current",)


def test_without_sensor_errors_electrical_power_does_not_lean(complete: Reconstructed) -> None:
    """The reading of the center port falls with the angle of attack, and GPS at one heading cannot show by how much:
    with both taken as they are the curve was 5.4 % too high."""
    estimate = whole_flight(complete).electrical
    assert estimate is not None
    V, rho = estimate.V_mps, estimate.conditions.rho
    required_W, _, _ = power_required(plant_of(AIRCRAFT), V, density=rho)
    error = estimate.power_W / battery_power(AIRCRAFT, required_W / V, V, rho) - 1
    assert abs(np.mean(error)) < 0.01
    assert np.max(np.abs(error)) < 0.03


def test_the_dynamic_pressure_of_a_complete_log_is_that_of_the_calibrated_probe(complete: Reconstructed) -> None:
    """Slow flight at 8 deg: the center port shows 5 % too little; at small angles it shows dynamic pressure."""
    as_recorded, by_probe = (
        recording.channels[AIRSPEED_PRESSURE]
        for recording in (recording_of(complete.log), recording_with_air_data(complete.log, complete.table))
    )
    table = complete.table
    t_s = table.index.to_numpy() + by_probe.t_s[-1] - table.index[-1]
    slow = (table["alpha_rad"] > np.radians(7.5)) & (table["height_m"] > 50) & table["flying"]
    ratio = as_recorded.at(t_s[slow]) / by_probe.at(t_s[slow])
    assert np.mean(ratio) == pytest.approx(0.95, abs=0.01)
    fast = (table["alpha_rad"].abs() < np.radians(1.0)) & table["flying"]
    assert np.mean(as_recorded.at(t_s[fast]) / by_probe.at(t_s[fast])) == pytest.approx(1.0, abs=0.002)


def test_a_path_as_measured_leaves_the_airspeed_to_gps(complete: Reconstructed) -> None:
    trajectory = complete.trajectory
    airspeed = airspeed_by_trajectory(trajectory, 0.7)
    assert airspeed is not None
    assert airspeed.scale == trajectory.value("V_scale") and 0 < airspeed.scale_variance < airspeed.prior_sigma**2
    assert airspeed_by_trajectory(replace(trajectory, as_measured=True), 0.7) is None


def test_an_airspeed_sensor_is_as_uncertain_as_an_aircraft_file_that_says_nothing() -> None:
    assert GPS.scale_sigma == Uncertainty().airspeed_scale_fraction
