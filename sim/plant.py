"""The aircraft as a system of differential equations: rigid body, servos, motor, and the gusts it flies through.

`Plant.derivative` and `Plant.outputs` are written with NumPy functions: floats, arrays and CasADi symbols pass through.
`compile_step` turns them into one compiled integration step.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from flight.aerodynamics import Aerodynamics, aerodynamics_of, body_axes, coefficients
from flight.aircraft import Aircraft, ControlSurface
from flight.atmosphere import GRAVITY_MPS2
from flight.motion import (
    Inertia,
    attitude_derivative,
    body_from_earth,
    earth_from_body,
    flow_of,
    rate_derivative,
    velocity_derivative,
)
from flight.propeller import CellIndex, Propeller, PropellerModel, TableCell, TableCells
from flight.propeller_files import load_propeller
from sim.air import Air, Gust, GustStates, ambient, dryden, mean_wind
from sim.propulsion import SLOWEST_REVPS, PowerTrainState, power_train


class AircraftState(NamedTuple):
    """Everything that has a derivative, SI and radians."""

    north: Any
    east: Any
    down: Any  # from the ground: minus height
    u: Any  # velocity over the ground in body axes
    v: Any
    w: Any
    phi: Any
    theta: Any
    psi: Any
    p: Any
    q: Any
    r: Any
    elevator: Any
    aileron: Any
    rudder: Any
    motor: Any  # [rev/s]
    energy: Any  # taken from the battery [J]
    gust_u: Any
    gust_v1: Any
    gust_v2: Any
    gust_w1: Any
    gust_w2: Any
    gust_p: Any
    gust_q: Any
    gust_r: Any


FIRST_GUST = AircraftState._fields.index("gust_u")
MOTOR = AircraftState._fields.index("motor")


class Commands(NamedTuple):
    """What the pilot asks of the servos [rad] and of the speed controller (0 to 1)."""

    elevator: Any
    aileron: Any
    rudder: Any
    throttle: Any


@dataclass(frozen=True, kw_only=True)
class Deviations:
    """How the aircraft of the day departs from its file; the analysis cannot see these directly."""

    thrust_scale: float = 0.0  # cT is (1 + this) times the table's
    thrust_slope_J: float = 0.0  # and tilted over advance ratio about J = 0.5
    weight_scale: float = 0.0  # the aircraft weighs (1 + this) times what the file says
    updraft_mps: float = 0.0
    CD_quartic: float = 0.0  # drag beyond the parabola: CD += this times (CL - CL_minD)^4


NO_DEVIATIONS = Deviations()


class FlightCondition(NamedTuple):
    """Everything that follows from a state and commands: what the truth file holds beside the state."""

    V: Any
    alpha: Any
    beta: Any
    pressure: Any
    temperature: Any
    density: Any
    wind: tuple[Any, Any, Any]  # north, east, down, without gusts
    gust: Gust
    ground_velocity: tuple[Any, Any, Any]  # north, east, down
    CL: Any
    CD: Any
    CY: Any
    Cl: Any
    Cm: Any
    Cn: Any
    specific_force: tuple[Any, Any, Any]  # body axes, at the centre of gravity
    angular_acceleration: tuple[Any, Any, Any]
    train: PowerTrainState


@dataclass(frozen=True)
class Plant:
    """An aircraft in the air of the day."""

    aircraft: Aircraft
    aero: Aerodynamics
    propeller: PropellerModel
    air: Air
    deviations: Deviations = NO_DEVIATIONS

    @property
    def mass_kg(self) -> float:
        return self.aircraft.mass_kg * (1 + self.deviations.weight_scale)

    @property
    def inertia(self) -> Inertia:
        m = self.aircraft.mass
        return Inertia(m.Ix_kgm2, m.Iy_kgm2, m.Iz_kgm2, m.Ixz_kgm2, self.aircraft.propulsion.propeller_inertia_kgm2)

    def instant(
        self, x: AircraftState, commands: Commands, white=(0.0, 0.0, 0.0, 0.0), *, motor_held: bool = False
    ) -> tuple[FlightCondition, GustStates]:
        """Flow, forces and accelerations at a state, and the rates of change of the gust filters.

        `motor_held`: as if something kept the motor at its speed, whatever the throttle; trim is solved that way.
        """
        geometry, aero = self.aircraft.geometry, self.aero
        b, c, S, m = geometry.span_m, geometry.chord_m, geometry.wing_area_m2, self.mass_kg
        height = -x.down
        p_s, T_s, rho = ambient(self.air, height)
        wind = mean_wind(self.air, x.north, x.east, height, self.deviations.updraft_mps)
        wind_north, wind_east, wind_down = wind
        wind_body = body_from_earth(wind_north, wind_east, wind_down, x.phi, x.theta, x.psi)
        gust_rates, gust = self._gusts(x, wind_body, white)
        V, alpha, beta = flow_of(x.u - wind_body[0] - gust.u, x.v - wind_body[1] - gust.v, x.w - wind_body[2] - gust.w)
        C = coefficients(
            aero,
            alpha=alpha,
            beta=beta,
            p_hat=(x.p - gust.p) * b / (2 * V),
            q_hat=(x.q - gust.q) * c / (2 * V),
            r_hat=(x.r - gust.r) * b / (2 * V),
            elevator=x.elevator,
            aileron=x.aileron,
            rudder=x.rudder,
        )
        CD = C.CD + self.deviations.CD_quartic * (C.CL - aero.CL_minD) ** 4
        CX, CZ = body_axes(C.CL, CD, alpha)
        train = power_train(
            self.aircraft.propulsion,
            self.propeller,
            V=V,
            n=x.motor,
            throttle=commands.throttle,
            rho=rho,
            thrust_scale=1 + self.deviations.thrust_scale,
            thrust_slope_J=self.deviations.thrust_slope_J,
        )
        qS = rho * V**2 / 2 * S
        force = ((CX * qS + train.thrust_N) / m, C.CY * qS / m, CZ * qS / m)
        # The motor turns the propeller clockwise, seen from behind: the aircraft is turned the other way.
        gained = 0.0 if motor_held else self.inertia.Ip * 2 * np.pi * train.motor_acceleration_revps2
        reaction = -(train.propeller_torque_Nm + gained)
        turning = rate_derivative(
            x.p,
            x.q,
            x.r,
            C.Cl * qS * b + reaction,
            C.Cm * qS * c,
            C.Cn * qS * b,
            self.inertia,
            2 * np.pi * x.motor,
        )
        over_ground = earth_from_body(x.u, x.v, x.w, x.phi, x.theta, x.psi)
        return (
            FlightCondition(
                V=V,
                alpha=alpha,
                beta=beta,
                pressure=p_s,
                temperature=T_s,
                density=rho,
                wind=wind,
                gust=gust,
                ground_velocity=over_ground,
                CL=C.CL,
                CD=CD,
                CY=C.CY,
                Cl=C.Cl,
                Cm=C.Cm,
                Cn=C.Cn,
                specific_force=force,
                angular_acceleration=turning,
                train=train,
            ),
            gust_rates,
        )

    def _gusts(self, x: AircraftState, wind_body, white) -> tuple[GustStates, Gust]:
        if self.air.turbulence_mps == 0:
            # Zeros of the state's own kind, so that nothing has to be computed for a calm day.
            return GustStates(*(0 * v for v in x[FIRST_GUST:])), Gust(*(0 * v for v in x[FIRST_GUST : FIRST_GUST + 6]))
        # The gust filters run at the airspeed without gusts: multiplied by the gusty one they would feed on themselves.
        V_mean = np.sqrt((x.u - wind_body[0]) ** 2 + (x.v - wind_body[1]) ** 2 + (x.w - wind_body[2]) ** 2)
        return dryden(
            GustStates(*x[FIRST_GUST:]),
            white,
            V=V_mean,
            height_m=-x.down,
            span_m=self.aircraft.geometry.span_m,
            W20_mps=self.air.turbulence_mps,
        )

    def derivative(self, x: AircraftState, commands: Commands, white=(0.0, 0.0, 0.0, 0.0)) -> AircraftState:
        """Rates of change of every state (3.6-3.14), with servos and motor."""
        now, gust_rates = self.instant(x, commands, white)
        north, east, down = now.ground_velocity
        udot, vdot, wdot = velocity_derivative(x.u, x.v, x.w, x.p, x.q, x.r, x.phi, x.theta, *now.specific_force)
        phidot, thetadot, psidot = attitude_derivative(x.phi, x.theta, x.p, x.q, x.r)
        pdot, qdot, rdot = now.angular_acceleration
        return AircraftState(
            north,
            east,
            down,
            udot,
            vdot,
            wdot,
            phidot,
            thetadot,
            psidot,
            pdot,
            qdot,
            rdot,
            servo_rate(self.aircraft.elevator, x.elevator, commands.elevator),
            servo_rate(self.aircraft.aileron, x.aileron, commands.aileron),
            servo_rate(self.aircraft.rudder, x.rudder, commands.rudder),
            now.train.motor_acceleration_revps2,
            now.train.battery_voltage_V * now.train.battery_current_A,
            *gust_rates,
        )


def servo_rate(surface: ControlSurface, angle, command):
    """Rate of a surface [rad/s]: a first-order lag towards the command, limited in travel and in rate."""
    within = np.clip(command, min(surface.angle_rad), max(surface.angle_rad))
    return np.clip((within - angle) / surface.lag_s, -surface.rate_radps, surface.rate_radps)


def plant_of(aircraft: Aircraft, air: Air | None = None, deviations: Deviations = NO_DEVIATIONS) -> Plant:
    """The plant of an aircraft file. Raises InputError without [aerodynamics] or propeller table."""
    propeller = load_propeller(aircraft.propulsion.propeller).with_beyond_zero_thrust(
        aircraft.propulsion.beyond_zero_thrust
    )
    return Plant(aircraft, aerodynamics_of(aircraft), propeller, air or Air(), deviations)


class Observation(NamedTuple):
    """What the pilot sees of the aircraft, and the time loop of a flight that goes wrong."""

    V: float
    alpha: float
    beta: float
    height: float
    climb: float
    phi: float
    theta: float
    psi: float
    p: float
    q: float
    r: float
    load_factor: float


def observation_of(x: AircraftState, now: FlightCondition) -> Observation:
    return Observation(
        now.V,
        now.alpha,
        now.beta,
        -x.down,
        -now.ground_velocity[2],
        x.phi,
        x.theta,
        x.psi,
        x.p,
        x.q,
        x.r,
        -now.specific_force[2] / GRAVITY_MPS2,
    )


def add(x: AircraftState, rate: AircraftState, dt: float) -> AircraftState:
    return AircraftState(*(a + dt * b for a, b in zip(x, rate, strict=True)))


def euler(f: Callable[[AircraftState], AircraftState], x: AircraftState, dt: float) -> AircraftState:
    """One step of the source's integrator (3.44)."""
    return add(x, f(x), dt)


def rk4(f: Callable[[AircraftState], AircraftState], x: AircraftState, dt: float) -> AircraftState:
    """One step of the classical fourth-order Runge-Kutta method."""
    k1 = f(x)
    k2 = f(add(x, k1, dt / 2))
    k3 = f(add(x, k2, dt / 2))
    k4 = f(add(x, k3, dt))
    mean = AircraftState(*((a + 2 * b + 2 * c + d) / 6 for a, b, c, d in zip(k1, k2, k3, k4, strict=True)))
    return add(x, mean, dt)


INTEGRATORS = {"euler": euler, "rk4": rk4}


class Stepper:
    """One compiled integration step, called through fixed buffers: a few microseconds.

    `start` somewhere, write `commands` (4,) and `white` (4,), call `step`: `x` (n_states,) moves on.
    """

    def __init__(self, plant: Plant, dt: float, integrator: str = "rk4"):
        assert isinstance(plant.propeller, Propeller)
        self.x = np.zeros(len(AircraftState._fields))
        self.commands = np.zeros(4)
        self.white = np.zeros(4)
        self._cell = np.zeros(8)
        self._buffers: list[Any] = []  # kept alive as long as the functions on them
        self._next = np.zeros(len(AircraftState._fields))
        self._seen = np.zeros(len(Observation._fields))
        self._in_cell, self._in_table = (
            self._bound(compile_step(plant, dt, integrator, cell=c)) for c in (True, False)
        )
        self._plant = plant
        self._cells = TableCells(plant.propeller)
        self._diameter_m = plant.propeller.diameter_m
        self._index: CellIndex = (0, 0)

    def start(self, x: AircraftState, commands: Commands) -> Observation:
        """Put the aircraft into a state; what is seen there."""
        self.x[:], self.commands[:] = x, commands
        now, _ = self._plant.instant(x, commands)
        seen = Observation(*(float(value) for value in observation_of(x, now)))
        self._index = self._cell_index(seen.V, x.motor)
        return seen

    def step(self) -> Observation:
        """One step on; what is seen then.

        The propeller's table is most of what there is to compute, and a step rarely leaves a cell of it: each is done
        with the cell alone, and done again with the whole table when it ended in another one.
        """
        self._cell[:] = self._cells.numbers(self._index)
        self._in_cell()
        index = self._cell_index(self._seen.item(0), self._next.item(MOTOR))
        if index != self._index:
            self._in_table()
            self._index = self._cell_index(self._seen.item(0), self._next.item(MOTOR))
        self.x[:] = self._next
        return Observation._make(self._seen.tolist())

    def _cell_index(self, V: float, motor: float) -> CellIndex:
        n = max(motor, SLOWEST_REVPS)
        return self._cells.index(V / (n * self._diameter_m), 60 * n)

    def _bound(self, function) -> Callable[[], None]:
        """The function on our buffers."""
        buffer, run = function.buffer()
        for i, array in enumerate((self.x, self.commands, self.white, self._cell)):
            buffer.set_arg(i, array.data)
        for i, array in enumerate((self._next, self._seen)):
            buffer.set_res(i, array.data)
        self._buffers.append(buffer)
        return run


def compile_step(plant: Plant, dt: float, integrator: str = "rk4", *, cell: bool = False):
    """A CasADi function (x, commands, white, numbers) -> (x after dt, seen there).

    cell: the propeller is the cell of its table whose `numbers` (8,) are given; otherwise it is the whole table.
    """
    import casadi as ca

    ca.GlobalOptions.setNumpyMode(-1)
    inputs = [ca.SX.sym("x", len(AircraftState._fields)), ca.SX.sym("c", 4), ca.SX.sym("n", 4), ca.SX.sym("p", 8)]
    x, c, n, numbers = (ca.vertsplit(symbols) for symbols in inputs)
    if cell:
        propeller = plant.propeller
        plant = replace(plant, propeller=TableCell(propeller.diameter_m, propeller.beyond_zero_thrust, numbers))
    commands = Commands(*c)
    after = INTEGRATORS[integrator](lambda s: plant.derivative(s, commands, n), AircraftState(*x), dt)
    now, _ = plant.instant(after, commands)
    results = ca.cse([ca.vertcat(*after), ca.vertcat(*observation_of(after, now))])
    return ca.Function("step", inputs, results)


def in_still_air(plant: Plant, air: Air) -> Plant:
    """The same aircraft in other air, still: without the updraft among its deviations."""
    return replace(plant, air=air, deviations=replace(plant.deviations, updraft_mps=0.0))
