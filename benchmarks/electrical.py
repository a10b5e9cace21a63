"""Errors and coverage of the electrical power of level flight over simulated flights that an autopilot logs.

It compares seven speeds from the slowest to the fastest of each curve. `python benchmarks/study.py autopilot-logs`
repeats it.
"""

import dataclasses
import itertools
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from flights import Rows, Setup, flown
from numpy.typing import NDArray

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.flights.comparison import compare
from flightpower.analysis.flights.pool import pool_results
from flightpower.analysis.methods.whole_flight.curve import FlownAircraft, estimate
from flightpower.analysis.methods.whole_flight.drag import DragWithheld, ThrustSource, drag_estimate
from flightpower.analysis.methods.whole_flight.flight_table import flight_table
from flightpower.analysis.methods.whole_flight.thrust_balance import motor_constants
from flightpower.analysis.records.flight import Results
from flightpower.analysis.results.energy_balance import EnergyBalanceFindings as Found
from flightpower.analysis.results.energy_balance import assemble_energy_balance
from flightpower.analysis.results.provenance import provenance_of_file
from flightpower.analysis.sources.ardupilot import read_ardupilot
from flightpower.analysis.sources.px4 import read_px4
from flightpower.analysis.sources.recording import AIRSPEED_PRESSURE, MOTOR, Channel, FlightRecording
from flightpower.flight.aircraft import Aircraft
from flightpower.flight.complete_aircraft import CompleteAircraft, load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.ardupilot_log import write_ardupilot_log
from flightpower.sim.fly import Flight, _FlightSimulation
from flightpower.sim.integration import Stepper
from flightpower.sim.log_faults import FAULTS
from flightpower.sim.plan import DT_S, Plan, load_plan
from flightpower.sim.plant import AircraftState, Commands, Deviations, plant_of
from flightpower.sim.propulsion import ThrustFactor, power_train, throttle_for
from flightpower.sim.px4_log import IDLE_A, write_px4_log
from flightpower.sim.sensors import FlightSensorTruth
from flightpower.sim.sensors.budget import DrawnErrors

Array = NDArray[np.float64]
Errors = tuple[Array, Array]

AUTOPILOTS = {"px4": (write_px4_log, read_px4), "ardupilot": (write_ardupilot_log, read_ardupilot)}
WITHOUT = {"motor": MOTOR, "blind": AIRSPEED_PRESSURE}
KEPT_S, LOST_S = 4.0, 4.0  # mean durations of stretches that a telemetry radio transmits, and loses
SPEEDS = 7
MORE_DRAG = 0.04
CLOSED_LOOP = "laps"  # this plan is flown by an energy controller, in a mean wind of W20
MOTOR_REVPS = np.linspace(20.0, 250.0, 3000)


def true_power(aircraft: CompleteAircraft, flight: Flight, errors: DrawnErrors, V: Array, rho: float) -> Array:
    """Return the electrical power of level flight (n,) [W]; NaN below the slowest speed of the true curve.

    The true curve is for one density. At another density the same lift coefficient has the same drag at another speed.
    """
    truth = flight.power_required
    faster = np.sqrt(truth["density_kgpm3"].iloc[0] / rho)
    drag_N = np.interp(V / faster, truth["speed_mps"], truth["drag_N"], left=np.nan)
    e = errors.values
    factor = ThrustFactor(1 + e.thrust_scale, e.thrust_slope_J)
    return np.where(np.isfinite(drag_N), battery_power(aircraft, drag_N, V, rho, factor, idle_A=IDLE_A), np.nan)


def battery_power(
    aircraft: CompleteAircraft,
    drag_N: Array,
    V: Array,
    rho: float,
    factor: ThrustFactor = ThrustFactor(),
    *,
    idle_A: float = 0.0,
) -> Array:
    """Return the electrical power (n,) [W] for which thrust equals drag (n,) at airspeeds V (n,).

    idle_A: current in addition to the motor's
    """
    propeller, power = plant_of(aircraft).propeller, []
    for v, D in zip(V, drag_N, strict=True):
        thrust, _ = propeller.thrust_and_power(np.full_like(MOTOR_REVPS, v), MOTOR_REVPS, rho)
        J = v / (MOTOR_REVPS * propeller.diameter_m)
        thrust = thrust * factor.scale * (1 + factor.slope_J * (J - 0.5))
        n = float(np.interp(D, thrust[np.argmin(thrust) :], MOTOR_REVPS[np.argmin(thrust) :]))
        throttle = float(throttle_for(aircraft.propulsion, propeller, V=v, n=n, rho=rho))
        now = power_train(aircraft.propulsion, propeller, V=v, n=n, throttle=throttle, rho=rho)
        power.append(float(now.battery_voltage_V * (now.battery_current_A + idle_A)))
    return np.array(power)


class _InTurningWind(_FlightSimulation):
    """A flight whose mean wind turns right by `turn_rad` in total, in equal steps from segment to segment."""

    turn_rad = 0.0

    def _fly_segment(self, segment: Any, index: int) -> None:
        turned = self.turn_rad / len(self.plan.segments) * (index > 0)
        air = dataclasses.replace(self.plan.air, wind_from_rad=self.plan.air.wind_from_rad + turned)
        self.plan, self.plant = (dataclasses.replace(item, air=air) for item in (self.plan, self.plant))
        if self.airborne:
            x, commands = self.stepper.x.tolist(), self.stepper.commands.tolist()
            self.stepper = Stepper(self.plant, self.dt, self.plan.integrator)
            self.seen = self.stepper.start(AircraftState(*x), Commands(*commands))
        super()._fly_segment(segment, index)


def in_turning_wind(
    aircraft: CompleteAircraft, plan: Plan, turn_rad: float, seed: int, deviations: Deviations
) -> Flight:
    """Fly in a mean wind that turns by `turn_rad` during the flight."""
    plant = plant_of(aircraft, plan.air, deviations)
    simulation = _InTurningWind(aircraft, plan, plant, seed, dt=DT_S, progress=lambda _: None)
    simulation.turn_rad = turn_rad
    return simulation.fly()


def one_flight(
    setup: Setup,
    *,
    autopilots: str = "px4",
    data: str = "electrical",
    traps: bool = False,
    turning_deg: float = 0.0,
) -> Rows:
    """Return rows by case.

    data, several separated by commas: electrical; blind: without the airspeed sensor; torn: one sample a second, half
    of them lost by the radio; rpm or motor: power required from the propeller table and motor speed, or from the
    motor's constants. traps: add each fault of real logs, or its refusal. turning_deg: angle by which the mean wind
    turns during the flight
    """
    aircraft, errors = load_complete_aircraft(setup.aircraft), setup.drawn_errors
    flight, sensors, _ = flown(
        aircraft, errors, setup.plan, setup.seed, setup.turbulence_kt, wind_too=setup.plan == CLOSED_LOOP
    )
    if turning_deg:
        plan = dataclasses.replace(load_plan(setup.plan), air=flight.plan.air)
        flight = in_turning_wind(aircraft, plan, np.radians(turning_deg), setup.seed, errors.deviations)
        sensors = FlightSensorTruth(flight, errors)
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        for autopilot, fault in itertools.product(autopilots.split(","), FAULTS if traps else ["wrong-battery-first"]):
            write, read = AUTOPILOTS[autopilot]
            write(log, flight, sensors, errors, [fault])
            for quantity in data.split(","):
                title = f"{autopilot}, {fault if traps else quantity}"
                try:
                    rows.append((title, np.stack(_errors(aircraft, flight, errors, read(log), quantity))))
                except InputError as refused:
                    rows.append((f"{title}: {refused}".replace(folder, ""), np.empty((2, 0))))
    return rows


def one_campaign(setup: Setup, *, sizes: str = "1,3,10", changed: int = 0, blind: bool = False) -> Rows:
    """Pool the first flights of one aircraft, whose errors are the same in all flights.

    changed: number of flights with `MORE_DRAG` that are compared with as many without it
    """
    pools, aircraft = [int(size) for size in sizes.split(",")], load_complete_aircraft(setup.aircraft)
    name = "blind" if blind else "electrical"
    flights, rows = [_pooled_flight(setup, aircraft, n, name) for n in range(max(pools))], []
    for size in pools:
        pool = pool_results([flight for flight, _, _ in flights[:size]])
        indices = np.linspace(0, len(pool.curve.V_mps) - 1, SPEEDS).round().astype(int)
        _, flight, errors = flights[0]
        truth = true_power(aircraft, flight, errors, pool.curve.V_mps[indices], pool.curve.condition.rho)
        power = pool.curve.power_W.at(indices)
        rows.append((f"pool of {size}", np.stack([100 * (power.value / truth - 1), 100 * power.half_width / truth])))
    if changed:
        drag = {part: (1 + MORE_DRAG) * aircraft.aerodynamics[part] for part in ("CD0", "K")}
        draggy = dataclasses.replace(aircraft, aerodynamics={**aircraft.aerodynamics, **drag})
        b = [_pooled_flight(setup, draggy, 100 + n, name) for n in range(changed)]
        a = [flight for flight, _, _ in flights[:changed]]
        comparison = compare(pool_results(a), pool_results([flight for flight, _, _ in b])).results()
        V = np.array([row.speed_mps for row in comparison.differences])
        true = [true_power(craft, flight[1], flight[2], V, comparison.test.air_density_kgpm3)
                for craft, flight in ((aircraft, flights[0]), (draggy, b[0]))]  # fmt: skip
        error = np.array([row.difference_percent for row in comparison.differences]) - 100 * (true[1] / true[0] - 1)
        half = np.array([row.hi_percent - row.lo_percent for row in comparison.differences]) / 2
        rows.append((f"difference, {changed} flights each", np.stack([error, half])))
        rows.append((f"{MORE_DRAG:.0%} of drag {'seen' if comparison.differs else 'not seen'}", np.empty((2, 0))))
        halves = compare(pool_results(a[::2]), pool_results(a[1::2]))
        rows.append((f"equal configurations found {'different' if halves.differs else 'equal'}", np.empty((2, 0))))
    return rows


def _pooled_flight(setup: Setup, aircraft: CompleteAircraft, n: int, data: str) -> tuple[Results, Flight, DrawnErrors]:
    """Simulate flight n of a campaign: it shares the aircraft's errors, but has its own air and zeros."""
    flight_setup = setup._replace(seed=1000 * setup.seed + n)
    errors = dataclasses.replace(flight_setup.drawn_errors, values=setup.drawn_errors.values)
    flight, sensors, _ = flown(aircraft, errors, flight_setup.plan, flight_setup.seed, flight_setup.turbulence_kt)
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "log"
        write_px4_log(log, flight, sensors, errors)
        recording = _without(read_px4(log), data)
    airframe = FlownAircraft("A", aircraft.mass.weight_N, aircraft.geometry.wing_area_m2, aircraft.geometry.span_m)
    table = flight_table(recording, airframe.weight_N, airframe.wing_area_m2)
    estimated = Found(table, estimate(table, airframe.weight_N, airframe.wing_area_m2, airframe.span_m))
    provenance = provenance_of_file(Path(__file__), "", None, "")
    results = assemble_energy_balance(Path(f"flight {flight_setup.seed}"), airframe, estimated, provenance)
    return results, flight, errors


def columns(_: Aircraft) -> list[str]:
    return ["slowest", *[""] * (SPEEDS - 2), "fastest"]


def _without(recording: FlightRecording, data: str) -> FlightRecording:
    """Return the recording without the channel or samples that this case lacks."""
    channels = {name: channel for name, channel in recording.channels.items() if name != WITHOUT.get(data)}
    if data == "torn":
        noise = channels[AIRSPEED_PRESSURE].value[:8].view(np.uint32)  # each flight loses samples at other times
        rng, end_s = np.random.default_rng(noise), max(float(channel.t_s[-1]) for channel in channels.values())
        kept_s, lost_s = rng.exponential(((KEPT_S,), (LOST_S,)), (2, round(end_s / KEPT_S)))
        starts_s = np.cumsum(kept_s + lost_s) - kept_s - lost_s
        for name, channel in channels.items():
            sent = np.flatnonzero(np.diff(np.floor(channel.t_s)) > 0)
            of_pair = np.clip(np.searchsorted(starts_s, channel.t_s[sent]) - 1, 0, None)
            received = sent[channel.t_s[sent] - starts_s[of_pair] < kept_s[of_pair]]
            channels[name] = Channel(channel.t_s[received], channel.value[received])
    return dataclasses.replace(recording, channels=channels, by_radio=data == "torn")


def _errors(
    aircraft: CompleteAircraft, flight: Flight, errors: DrawnErrors, recording: FlightRecording, data: str
) -> Errors:
    weight, geometry = aircraft.mass.weight_N, aircraft.geometry
    recording = _without(recording, data)
    table = flight_table(recording, weight, geometry.wing_area_m2)
    electrical = estimate(table, weight, geometry.wing_area_m2, geometry.span_m)
    indices = np.linspace(0, len(electrical.V_mps) - 1, SPEEDS).round().astype(int)
    if data in ("rpm", "motor"):
        propeller, constants = load_propeller(aircraft.propulsion.propeller), motor_constants(aircraft.propulsion)
        drag = drag_estimate(table, electrical, geometry.span_m, ThrustSource(propeller, constants))
        assert not isinstance(drag, DragWithheld), drag
        required, V = flight.power_required, electrical.V_mps[indices]
        slower = V / np.sqrt(required["density_kgpm3"].iloc[0] / electrical.conditions.rho)
        truth = V * np.interp(slower, required["speed_mps"], required["drag_N"], left=np.nan)
        return 100 * (drag.power_W[indices] / truth - 1), 100 * drag.curve.power_W.half_width[indices] / truth
    power, half = electrical.power_W[indices], NORMAL_95 * electrical.standard_error_W[indices]
    truth = true_power(aircraft, flight, errors, electrical.V_mps[indices], electrical.conditions.rho)
    return 100 * (power / truth - 1), 100 * half / truth
