"""Flies a plan: the time loop of pilot and aircraft, and the table of true values."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pandas as pd

from flightpower.flight.arrays import Array
from flightpower.flight.complete_aircraft import CompleteAircraft
from flightpower.flight.errors import InputError
from flightpower.flight.motion import earth_from_body, velocity_derivative
from flightpower.sim.air import mean_wind
from flightpower.sim.bench import BenchSegment
from flightpower.sim.ground import EndState, Motion, move, smooth_step, stand
from flightpower.sim.integration import Observation, Stepper
from flightpower.sim.pilot import Pilot, drawn_phases
from flightpower.sim.plan import DT_S, Plan
from flightpower.sim.plan_segment import FlightContext
from flightpower.sim.plant import NO_DEVIATIONS, AircraftState, Commands, Deviations, Plant, plant_of
from flightpower.sim.segments import GROUND, ClimbSegment, LandSegment, RunSegment, StandSegment, TakeOffSegment
from flightpower.sim.trim import Trim, Trimmer
from flightpower.sim.truth import Columns, Prescribed, airborne_rows, kinematic_rows, power_required_table, table_of

Progress = Callable[[float], None]

# A flight beyond these limits diverges, or its time step is too long.
MAX_RATE_RADPS = 20.0
MIN_AIRSPEED_MPS = 3.0
RECORD_BLOCK = 4096


@dataclass
class Flight:
    """A simulated flight: the truth at every step, with aircraft, plan and seed."""

    aircraft: CompleteAircraft
    plan: Plan
    plant: Plant
    seed: int
    truth: pd.DataFrame
    power_required: pd.DataFrame
    metadata: dict[str, Any] = field(default_factory=dict)

    @property
    def duration_s(self) -> float:
        return float(self.truth["time_s"].iloc[-1])


def fly(
    aircraft: CompleteAircraft,
    plan: Plan,
    *,
    seed: int = 0,
    deviations: Deviations = NO_DEVIATIONS,
    dt: float = DT_S,
    progress: Progress | None = None,
) -> Flight:
    """Fly `plan` with `aircraft`; `seed` draws the turbulence. `progress` is called with the time flown [s].

    Raises InputError if the aircraft cannot fly the plan, or if the flight diverges.
    """
    plant = plant_of(aircraft, plan.air, deviations)
    return _FlightSimulation(aircraft, plan, plant, seed, dt=dt, progress=progress or (lambda _: None)).fly()


class _FlightSimulation:
    """The state of a flight being flown."""

    def __init__(
        self, aircraft: CompleteAircraft, plan: Plan, plant: Plant, seed: int, *, dt: float, progress: Progress
    ):
        self.aircraft, self.plan, self.plant, self.seed, self.dt = aircraft, plan, plant, seed, dt
        self.progress = progress
        highest = max([plan.height_m, *(s.height_m for s in plan.segments if isinstance(s, ClimbSegment))])
        self.trimmer = Trimmer(plant, highest)
        self.stepper = Stepper(plant, dt, plan.integrator)
        self.runs_flown = 0
        self.other_stepper: Stepper | None = None  # stepper with the landing gear in the other position
        self.pilot = Pilot(plant, self.trimmer, plan.pilot, dt)
        self.white = _white_noise(seed, dt) if plan.air.turbulence_mps > 0 else None
        self.wander_phases = drawn_phases(seed)
        self.context = FlightContext(
            V_stall=self.trimmer.V_stall,
            V_max=self.trimmer.V_max,
            dt=dt,
            height_m=plan.height_m,
            heading_rad=plan.heading_rad,
            speed_mps=plan.speed_over_stall * self.trimmer.V_stall,
        )
        self.t = 0.0
        self.airborne = False
        self.pose = EndState.at_rest(np.zeros(3), np.array([0.0, 0.0, plan.heading_rad]))
        self.rows: list[Columns] = []
        self.energy_J = 0.0

    def fly(self) -> Flight:
        if self.plan.segments[0].kind not in GROUND:
            self._start_in_trim()
        for i, segment in enumerate(self.plan.segments):
            self._fly_segment(segment, i)
        truth = table_of(self.rows, self.dt)
        flown = truth.loc[truth["phase"] == "flight"]
        source = flown if len(flown) else truth
        density = float(source["density_kgpm3"].mean())
        table = power_required_table(self.plant, self.trimmer, density)
        metadata = {
            "aircraft": self.aircraft.name,
            "plan": self.plan.name,
            "seed": str(self.seed),
            "density_kgpm3": repr(density),
            "weight_N": repr(self.plant.mass_kg * self.aircraft.mass.weight_N / self.aircraft.mass_kg),
            "stall_speed_mps": repr(self.trimmer.V_stall),
            "max_speed_mps": repr(self.trimmer.V_max),
        }
        return Flight(self.aircraft, self.plan, self.plant, self.seed, truth, table, metadata)

    def _fly_segment(self, segment: Any, index: int) -> None:
        where = f"plan {self.plan.name}: segment {index + 1} ({segment.kind})"
        from_ground = segment.kind in GROUND and not isinstance(segment, LandSegment)
        if from_ground and self.airborne:
            raise InputError(f"{where}: the aircraft is in the air; put a segment 'land' before")
        if not from_ground and not self.airborne:
            raise InputError(f"{where}: the aircraft is on the ground; put a segment 'take-off' before")
        if isinstance(segment, StandSegment):
            self._stand(segment, index)
        elif isinstance(segment, BenchSegment):
            self._bench(segment, index, where)
        elif isinstance(segment, TakeOffSegment):
            self._take_off(segment, index)
        elif isinstance(segment, LandSegment):
            self._land(segment, index)
        else:
            self._check_speed(segment, where)
            self._segment(segment, index, where)

    def _check_speed(self, segment: Any, where: str) -> None:
        """Raise InputError before the flight if a segment's speed or climb cannot be trimmed."""
        low, high = self.trimmer.V_stall, self.trimmer.V_max
        for value, unit in (
            (getattr(segment, "speed_mps", None), 1.0),
            (getattr(segment, "speed_over_stall", None), low),
            (getattr(segment, "speed_of_max", None), high),
        ):
            if value is None:
                continue
            V = value * unit
            if V <= low:
                raise InputError(f"{where}: {V:.2f} m/s is too slow: {self.aircraft.name} stalls at {low:.2f} m/s")
            if V > high:
                raise InputError(f"{where}: {V:.2f} m/s is too fast: {self.aircraft.name} reaches {high:.2f} m/s level")
        if isinstance(segment, ClimbSegment) and segment.height_m > self.context.height_m:
            speed = segment.speed_mps or self.context.speed_mps
            if segment.speed_over_stall is not None:
                speed = segment.speed_over_stall * low
            elif segment.speed_of_max is not None:
                speed = segment.speed_of_max * high
            try:
                self.trimmer.solve(V=speed, climb=segment.rate_mps(self.context))
            except InputError as error:
                raise InputError(f"{where}: {error}") from None

    def _start_in_trim(self) -> None:
        trim = self._trim_at(self.context.speed_mps, self.context.height_m)
        self._start_airborne(trim, np.array([0.0, 0.0, -self.context.height_m]))

    def _trim_at(self, V: float, height_m: float) -> Trim:
        trimmer = self.trimmer if height_m == self.trimmer.height_m else Trimmer(self.plant, height_m)
        return trimmer.solve(V=V, climb=0.0)

    def _start_airborne(self, trim: Trim, position: Array) -> None:
        x = self._airborne_state(trim, position)
        self.seen = self.stepper.start(x, trim.commands)
        self.context.throttle = trim.throttle
        self.airborne = True

    def _airborne_state(self, trim: Trim, position: Array) -> AircraftState:
        wind = tuple(float(c) for c in mean_wind(self.plan.air, position[0], position[1], -position[2]))
        state = trim.state(heading_rad=self.context.heading_rad, wind_ned=wind)  # type: ignore[arg-type]
        return state._replace(
            north=float(position[0]), east=float(position[1]), down=float(position[2]), energy=self.energy_J
        )

    def _segment(self, segment: Any, index: int, where: str) -> None:
        plant, stepper = self._configured(segment)
        pilot, context, white = self.pilot, self.context, self.white
        states, commands, noises = _GrowingTable(len(AircraftState._fields)), _GrowingTable(4), _GrowingTable(4)
        seen = self.seen
        targets_of = segment.fly(seen, context)
        try:
            targets = next(targets_of, None)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        step, wanders = 0, bool(self.plan.wander.bank_rad or self.plan.wander.height_m)
        while targets is not None:
            if wanders:
                targets = self.plan.wander.wandering(targets, self.t + step * self.dt, self.wander_phases)
            command = pilot.fly(seen, targets)
            stepper.commands[:] = command
            if white is not None:
                stepper.white[:] = next(white)
                noises.add(stepper.white)
            states.add(stepper.x)
            commands.add(command)
            seen = stepper.step()
            context.throttle = command.throttle
            step += 1
            if not (seen.V > MIN_AIRSPEED_MPS and abs(seen.q) < MAX_RATE_RADPS and seen.height > 0):
                raise InputError(f"{where}: {_divergence_message(seen, self.t + step * self.dt)}")
            if step % 64 == 0:
                self.progress(self.t + step * self.dt)
            try:
                targets = targets_of.send(seen)
            except StopIteration:
                targets = None
        white_noise = noises.array() if white else None
        self._add(airborne_rows(plant, states.array(), commands.array(), white_noise), index, segment.kind)
        self.energy_J = float(stepper.x[AircraftState._fields.index("energy")])
        self.t += step * self.dt
        self.seen = seen
        self.stepper = stepper

    def _configured(self, segment: Any) -> tuple[Plant, Stepper]:
        """The aircraft's plant in this segment, and its stepper; the gear is extended in every second pair of runs."""
        out = False
        if isinstance(segment, RunSegment):
            out = self.plant.deviations.gear_CD != 0 and self.runs_flown // 2 % 2 == 1
            self.runs_flown += 1
        if out == self.stepper.plant.gear_out:
            return self.stepper.plant, self.stepper
        new_stepper = self.other_stepper or Stepper(replace(self.plant, gear_out=out), self.dt, self.plan.integrator)
        self.other_stepper = self.stepper
        new_stepper.start(AircraftState(*self.stepper.x.tolist()), Commands(*self.stepper.commands.tolist()))
        return new_stepper.plant, new_stepper

    def _stand(self, segment: Any, index: int) -> None:
        n = round(segment.duration_s / self.dt)
        motion = stand(self.pose.position, self.pose.attitude, n)
        self._prescribed(segment, index, motion)

    def _bench(self, segment: BenchSegment, index: int, where: str) -> None:
        try:
            segment.check()
            t: Array = np.arange(round(segment.duration_s / self.dt), dtype=np.float64) * self.dt
            columns = segment.columns(self.plant, t)
        except InputError as error:
            raise InputError(f"{where}: {error}") from None
        motion = segment.motion(self.pose.position, self.pose.attitude, t)
        self._prescribed(segment, index, motion)
        self.rows[-1].update(columns)

    def _take_off(self, segment: Any, index: int) -> None:
        context, T = self.context, segment.duration_s
        V = segment.speed_over_stall * self.trimmer.V_stall
        trim = self._trim_at(V, segment.height_m)
        context.height_m, context.speed_mps, context.heading_rad = segment.height_m, V, self.pose.attitude[2]
        airborne = self._airborne_state(trim, np.array([0.0, 0.0, -segment.height_m]))
        velocity = np.array(
            earth_from_body((airborne.u, airborne.v, airborne.w), (airborne.phi, airborne.theta, airborne.psi))
        )
        # The mean speed is half the final speed; the quintic over that distance does not overshoot.
        position = self.pose.position + velocity * T / 2 * np.array([1.0, 1.0, 0.0])
        position[2] = -segment.height_m
        attitude = np.array([airborne.phi, airborne.theta, airborne.psi])
        goal = EndState(position, velocity, np.zeros(3), attitude, np.zeros(3))
        n = round(T / self.dt)
        motion = move(self.pose, goal, n * self.dt, np.arange(n) * self.dt)
        share = smooth_step(np.arange(n) / n)
        self._prescribed(segment, index, motion, share, (trim.state(), trim.commands))
        self._start_airborne(trim, position)

    def _land(self, segment: Any, index: int) -> None:
        x = AircraftState(*self.stepper.x.tolist())
        commands = Commands(*self.stepper.commands.tolist())
        now, _ = self.plant.instant(x, commands)
        rate = self.plant.derivative(x, commands)
        velocity = np.array([float(c) for c in now.ground_velocity])
        ax, ay, az = velocity_derivative((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), x.phi, x.theta, now.specific_force)
        acceleration = np.array([float(c) for c in earth_from_body((ax, ay, az), (x.phi, x.theta, x.psi))])
        start = EndState(
            np.array([x.north, x.east, x.down]),
            velocity,
            acceleration,
            np.array([x.phi, x.theta, x.psi]),
            np.array([float(c) for c in (rate.phi, rate.theta, rate.psi)]),
        )
        T = segment.duration_s
        position = start.position + velocity * T / 2
        position[2] = 0.0
        goal = EndState.at_rest(position, np.array([0.0, 0.0, x.psi]))
        n = round(T / self.dt)
        motion = move(start, goal, n * self.dt, np.arange(n) * self.dt)
        share = 1 - smooth_step(np.arange(n) / n)
        self._prescribed(segment, index, motion, share, (x, commands))
        self.pose, self.airborne = goal, False

    def _prescribed(
        self,
        segment: Any,
        index: int,
        motion: Motion,
        share: Array | None = None,
        end: tuple[AircraftState, Commands] | None = None,
    ) -> None:
        """Add rows of prescribed motion; controls and motor speed are `share` times those at its airborne end."""
        share = np.zeros(len(motion.position)) if share is None else share
        phase = segment.kind if end else "ground"
        rows = kinematic_rows(
            self.plant, Prescribed(motion, share, end), phase=phase, energy_J=self.energy_J, dt=self.dt
        )
        self._add(rows, index, segment.kind)
        self.energy_J = float(rows["battery_energy_J"][-1])
        self.t += len(share) * self.dt
        self.progress(self.t)

    def _add(self, rows: Columns, index: int, kind: str) -> None:
        n = len(rows["phase"])
        labels = {"phase": rows["phase"], "segment": np.full(n, index), "kind": np.full(n, kind)}
        self.rows.append({**labels, **rows})


def _divergence_message(seen: Observation, t: float) -> str:
    failure = "the flight diverges" if seen.height > 0 else "the aircraft hits the ground"
    return (
        f"{failure} at {t:.2f} s: V = {seen.V:.1f} m/s, alpha = {np.rad2deg(seen.alpha):.1f} deg, "
        f"height = {seen.height:.1f} m, roll {np.rad2deg(seen.phi):.0f}, pitch {np.rad2deg(seen.theta):.0f} deg, "
        f"q = {seen.q:.1f} rad/s"
    )


class _GrowingTable:
    """A table to which rows are appended."""

    def __init__(self, width: int):
        self._data = np.empty((RECORD_BLOCK, width))
        self._n = 0

    def add(self, row: Array | Sequence[float]) -> None:
        if self._n == len(self._data):
            self._data = np.concatenate([self._data, np.empty_like(self._data)])
        self._data[self._n] = row
        self._n += 1

    def array(self) -> Array:
        return self._data[: self._n]


def _white_noise(seed: int, dt: float) -> Iterator[Array]:
    """White noise of unit intensity, held over a step: standard normal numbers divided by sqrt(dt)."""
    rng = np.random.default_rng([seed, 0x6D])
    while True:
        yield from rng.standard_normal((RECORD_BLOCK, 4)) / np.sqrt(dt)
