"""Integrates the plant in time: one compiled step, and the pilot's observation after it."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from flightpower.flight.atmosphere import GRAVITY_MPS2
from flightpower.flight.propeller import CellIndex, Propeller, TableCell, TableCells
from flightpower.sim.plant import MOTOR, AircraftState, Commands, FlightCondition, Plant
from flightpower.sim.propulsion import SLOWEST_REVPS, motor_time_constant

# rk4 is stable up to a step of 2.8 times the shortest time constant; the propeller's torque shortens the motor's time
# constant.
LONGEST_STEP = 2.0


class Observation(NamedTuple):
    """The pilot's observation; the time loop also uses it to detect divergence."""

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
    forward_mps2: float  # specific force along the body's first axis


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
        now.specific_force[0],
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
    """One compiled integration step on fixed buffers, which takes a few microseconds.

    Call `start`; then, for each step, write `commands` (4,) and `white` (4,) and call `step`, which updates `x`
    (n_states,).
    """

    def __init__(self, plant: Plant, dt: float, integrator: str = "rk4"):
        assert isinstance(plant.propeller, Propeller)
        self.x = np.zeros(len(AircraftState._fields))
        self.commands = np.zeros(4)
        self.white = np.zeros(4)
        self._cell = np.zeros(8)
        self._buffers: list[Any] = []  # kept alive as long as the functions that use them
        self._next = np.zeros(len(AircraftState._fields))
        self._seen = np.zeros(len(Observation._fields))
        self._in_cell, self._in_table = (
            self._bound(compile_step(plant, dt, integrator, cell=c)) for c in (True, False)
        )
        self.plant = plant
        self._cells = TableCells(plant.propeller)
        self._diameter_m = plant.propeller.diameter_m
        self._index: CellIndex = (0, 0)

    def start(self, x: AircraftState, commands: Commands) -> Observation:
        """Set the state. Returns the observation in that state."""
        self.x[:], self.commands[:] = x, commands
        now, _ = self.plant.instant(x, commands)
        seen = Observation(*(float(value) for value in observation_of(x, now)))
        self._index = self._cell_index(seen.V, x.motor)
        return seen

    def step(self) -> Observation:
        """Advance by one step. Returns the observation after it.

        The propeller's table dominates the cost, and a step rarely leaves a cell of it. So each step is computed with
        one cell, and again with the whole table if it ends in another cell.
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

    def _bound(self, function: Any) -> Callable[[], None]:
        """Bind the function to the buffers of this object."""
        buffer, run = function.buffer()
        for i, array in enumerate((self.x, self.commands, self.white, self._cell)):
            buffer.set_arg(i, array.data)
        for i, array in enumerate((self._next, self._seen)):
            buffer.set_res(i, array.data)
        self._buffers.append(buffer)
        step: Callable[[], None] = run
        return step


def compile_step(plant: Plant, dt: float, integrator: str = "rk4", *, cell: bool = False) -> Any:
    """A CasADi function (x, commands, white, numbers) -> (x after dt, seen there).

    If the motor is faster than the step, the step is integrated in equal parts; commands and noise are held over the
    whole step. cell: whether the propeller is one cell of its table, with the given `numbers` (8,), or the whole table.
    """
    import casadi as ca

    ca.GlobalOptions.setNumpyMode(-1)
    inputs = [ca.SX.sym("x", len(AircraftState._fields)), ca.SX.sym("c", 4), ca.SX.sym("n", 4), ca.SX.sym("p", 8)]
    x, c, n, numbers = (ca.vertsplit(symbols) for symbols in inputs)
    if cell:
        propeller = plant.propeller
        plant = replace(plant, propeller=TableCell(propeller.diameter_m, propeller.beyond_zero_thrust, numbers))
    commands = Commands(*c)
    after = AircraftState(*x)
    parts = max(1, int(np.ceil(dt / (LONGEST_STEP * motor_time_constant(plant.aircraft.propulsion)))))
    for _ in range(parts):
        after = INTEGRATORS[integrator](lambda s: plant.derivative(s, commands, n), after, dt / parts)
    now, _ = plant.instant(after, commands)
    results = ca.cse([ca.vertcat(*after), ca.vertcat(*observation_of(after, now))])
    return ca.Function("step", inputs, results)
