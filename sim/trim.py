"""Computes trimmed flight (level, climbing, descending, turning), the limits of trim, and the true power-required
curve.

There are eleven unknowns (airspeed, flow angles, attitude, controls, motor speed, climb, turn) and eight equations (six
accelerations, the rate of climb, no side force), so three unknowns must be given: the bank angle and any two of
airspeed, climb and motor speed.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from flightpower.flight.aerodynamics import lift_and_drag
from flightpower.flight.atmosphere import GRAVITY_MPS2 as g
from flightpower.flight.errors import InputError
from flightpower.flight.motion import body_from_earth, velocity_derivative, velocity_of
from flightpower.flight.number import Number
from flightpower.sim.air import Air, ambient
from flightpower.sim.plant import FIRST_GUST, MOTOR, AircraftState, Commands, Plant, in_still_air
from flightpower.sim.propulsion import throttle_for

RESIDUAL_LIMIT = 1e-9


class TrimUnknowns(NamedTuple):
    V: Any  # [m/s]
    alpha: Any
    beta: Any
    theta: Any
    phi: Any
    elevator: Any
    aileron: Any
    rudder: Any
    motor: Any  # [rev/s]
    climb: Any  # [m/s]
    turn: Any  # rate of heading [rad/s]


@dataclass(frozen=True)
class Trim:
    """A trimmed condition relative to the air; add the wind to fly it over the ground."""

    unknowns: TrimUnknowns
    throttle: float
    height_m: float
    residual: float

    def state(
        self, *, heading_rad: float = 0.0, wind_ned: tuple[float, float, float] = (0.0, 0.0, 0.0)
    ) -> AircraftState:
        """The state of the aircraft in this trim, at the origin, in a given mean wind [m/s], and without gusts."""
        z = self.unknowns
        air_velocity = velocity_of(z.V, z.alpha, z.beta)
        wind = body_from_earth(wind_ned, (z.phi, z.theta, heading_rad))
        u, v, w = (float(a + b) for a, b in zip(air_velocity, wind, strict=True))
        p, q, r = turn_rates(z.turn, z.phi, z.theta)
        return AircraftState(
            0.0,
            0.0,
            -self.height_m,
            u,
            v,
            w,
            z.phi,
            z.theta,
            heading_rad,
            float(p),
            float(q),
            float(r),
            z.elevator,
            z.aileron,
            z.rudder,
            z.motor,
            *([0.0] * (len(AircraftState._fields) - MOTOR - 1)),
        )

    @property
    def commands(self) -> Commands:
        z = self.unknowns
        return Commands(z.elevator, z.aileron, z.rudder, self.throttle)


def turn_rates(turn: Number, phi: Number, theta: Number) -> tuple[Number, Number, Number]:
    """Body rates of a steady turn of the heading (3.12-3.14 inverted)."""
    return -turn * np.sin(theta), turn * np.sin(phi) * np.cos(theta), turn * np.cos(phi) * np.cos(theta)


def residuals(plant: Plant, z: TrimUnknowns, height_m: float) -> tuple[Number, ...]:
    """The eight equations, in m/s^2, rad/s^2 and m/s; zero in trim."""
    u, v, w = velocity_of(z.V, z.alpha, z.beta)
    p, q, r = turn_rates(z.turn, z.phi, z.theta)
    gusts = [0.0] * (len(AircraftState._fields) - FIRST_GUST)
    x = AircraftState(
        0.0,
        0.0,
        -height_m,
        u,
        v,
        w,
        z.phi,
        z.theta,
        0.0,
        p,
        q,
        r,
        z.elevator,
        z.aileron,
        z.rudder,
        z.motor,
        0.0,
        *gusts,
    )
    now, _ = plant.instant(x, Commands(z.elevator, z.aileron, z.rudder, 0.0), motor_held=True)
    accelerations = velocity_derivative((u, v, w), (p, q, r), z.phi, z.theta, now.specific_force)
    ball = now.specific_force[1]
    return *accelerations, *now.angular_acceleration, -now.ground_velocity[2] - z.climb, ball


class Trimmer:
    """Solves trims of one plant at one height; the equations are compiled once."""

    def __init__(self, plant: Plant, height_m: float):
        import casadi as ca

        ca.GlobalOptions.setNumpyMode(-1)
        # Trim is relative to the air, so wind and turbulence are left out; so is a steady updraft.
        self.plant = in_still_air(
            plant,
            Air(ground_pressure_Pa=plant.air.ground_pressure_Pa, ground_temperature_K=plant.air.ground_temperature_K),
        )
        self.height_m = height_m
        z = ca.SX.sym("z", len(TrimUnknowns._fields))
        r = ca.vertcat(*residuals(self.plant, TrimUnknowns(*ca.vertsplit(z)), height_m))
        self._function = ca.Function("trim", [z], [r, ca.jacobian(r, z)])

    @cached_property
    def density(self) -> float:
        return float(ambient(self.plant.air, self.height_m).density)

    def solve(self, *, bank_rad: float = 0.0, start: TrimUnknowns | None = None, **fixed: float) -> Trim:
        """Find the trim for this bank and any two of `V`, `climb` and `motor`.

        Raises InputError with the limiting value if the aircraft cannot fly the trim: too slow, too fast, too steep.
        """
        if len(fixed) != 2 or not set(fixed) <= {"V", "climb", "motor"}:
            raise InputError("a trim takes exactly two of airspeed, climb and motor speed")
        z, norm = self._newton({**fixed, "phi": bank_rad}, start)
        self._check(z, norm, fixed, bank_rad)
        propulsion = self.plant.aircraft.propulsion
        throttle = float(throttle_for(propulsion, self.plant.propeller, V=z.V, n=z.motor, rho=self.density))
        if throttle > 1 + 1e-9:
            raise InputError(f"{self._needs(z)}, more than the battery can give{self._limit(fixed)}")
        if throttle == 0:
            raise InputError(f"{self._needs(z)}: less than it windmills with the motor off; it cannot glide so steeply")
        return Trim(z, min(throttle, 1.0), self.height_m, norm)

    def _newton(self, fixed: dict[str, float], start: TrimUnknowns | None) -> tuple[TrimUnknowns, float]:
        names = TrimUnknowns._fields
        z = np.array(start if start is not None else self._guess(fixed), dtype=float)
        for name, value in fixed.items():
            z[names.index(name)] = value
        free = [i for i, name in enumerate(names) if name not in fixed]
        r, J = (np.array(a) for a in self._function(z))
        norm = float(np.linalg.norm(r))
        for _ in range(60):
            if norm < 1e-12 or not np.isfinite(norm):
                break
            step = np.linalg.lstsq(J[:, free], -r[:, 0], rcond=None)[0]
            # Halve a step that increases the residual: the propeller's table has corners and lift has a maximum.
            for scale in 0.5 ** np.arange(12):
                trial = z.copy()
                trial[free] += scale * step
                r_trial, J_trial = (np.array(a) for a in self._function(trial))
                trial_norm = float(np.linalg.norm(r_trial))
                if trial_norm < norm:
                    break
            else:
                break
            z, r, J, norm = trial, r_trial, J_trial, trial_norm
        return TrimUnknowns(*z.tolist()), norm

    def _guess(self, fixed: dict[str, float]) -> TrimUnknowns:
        aero, S = self.plant.aero, self.plant.aircraft.geometry.wing_area_m2
        V = fixed.get("V") or 1.6 * self.V_stall
        load = 1 / np.cos(fixed["phi"])
        CL = load * self.plant.mass_kg * g / (self.density * V**2 / 2 * S)
        alpha = float(np.clip((CL - aero.CL0) / aero.CLa, -0.2, 0.95 * aero.stall_angle_rad))
        climb = fixed.get("climb", 0.0)
        elevator = -(aero.Cm0 + aero.Cma * alpha) / aero.Cmde
        motor = fixed.get("motor") or V / (0.6 * self.plant.propeller.diameter_m)
        turn = g / V * np.tan(fixed["phi"])
        return TrimUnknowns(
            V, alpha, 0.0, alpha + climb / V, fixed["phi"], elevator, 0.0, 0.0, motor, climb, float(turn)
        )

    def _check(self, z: TrimUnknowns, norm: float, fixed: dict[str, float], bank_rad: float) -> None:
        name, stall = self.plant.aircraft.name, self.V_stall / np.sqrt(np.cos(bank_rad))
        if "V" in fixed and fixed["V"] < stall:
            raise InputError(
                f"{name}: {fixed['V']:.2f} m/s is too slow to trim at {np.rad2deg(bank_rad):.0f} deg of bank: "
                f"it stalls at {stall:.2f} m/s"
            )
        if not norm < RESIDUAL_LIMIT:
            request = ", ".join(f"{key} = {value:g}" for key, value in fixed.items())
            raise InputError(f"{name}: no trim found for {request} (residual {norm:.2g}); it stalls at {stall:.2f} m/s")
        travel = self.plant.aircraft.elevator.angle_rad
        if not min(travel) <= z.elevator <= max(travel):
            raise InputError(
                f"{name}: {z.V:.2f} m/s needs {np.rad2deg(z.elevator):.1f} deg of elevator, it has "
                f"{np.rad2deg(min(travel)):.0f} to {np.rad2deg(max(travel)):.0f}"
            )
        fastest = self.plant.aircraft.propulsion.max_rpm / 60
        if z.motor > fastest * (1 + 1e-9):
            raise InputError(f"{self._needs(z)}, the motor has {60 * fastest:.0f}{self._limit(fixed)}")

    def _needs(self, z: TrimUnknowns) -> str:
        return (
            f"{self.plant.aircraft.name}: {z.V:.2f} m/s with {z.climb:+.2f} m/s of climb needs {60 * z.motor:.0f} rpm"
        )

    def _limit(self, fixed: dict[str, float]) -> str:
        return f"; level flight is possible up to {self.V_max:.2f} m/s" if fixed.get("climb") == 0 else ""

    @cached_property
    def V_stall(self) -> float:
        """The slowest airspeed [m/s] at which lift, with the elevator in trim, still carries the weight."""
        aero = self.plant.aero
        alpha = np.linspace(0, 1.5 * aero.stall_angle_rad, 2000)
        elevator = -(aero.Cm0 + aero.Cma * alpha) / aero.Cmde
        CL_max = float(np.max(lift_and_drag(aero, alpha, elevator)[0]))
        return float(
            np.sqrt(2 * self.plant.mass_kg * g / (self.density * self.plant.aircraft.geometry.wing_area_m2 * CL_max))
        )

    @cached_property
    def V_max(self) -> float:
        """The fastest level airspeed [m/s], limited by full throttle or by the motor's highest speed."""
        low, high = 1.3 * self.V_stall, 8 * self.V_stall
        for _ in range(35):
            middle = (low + high) / 2
            low, high = (middle, high) if self._can_fly_level(middle) else (low, middle)
        return low

    def _can_fly_level(self, V: float) -> bool:
        z, norm = self._newton({"V": V, "climb": 0.0, "phi": 0.0}, None)
        propulsion = self.plant.aircraft.propulsion
        if norm > 1e-6 or not 0 < z.motor <= propulsion.max_rpm / 60:
            return False
        return bool(throttle_for(propulsion, self.plant.propeller, V=V, n=z.motor, rho=self.density) <= 1)


def power_required(
    plant: Plant, V: Number, *, density: Number, weight_N: float | None = None
) -> tuple[Number, Number, Number]:
    """The true P_req(V) = D V with lift equal to weight and zero pitching moment; also CL and CD.

    V : (n,) true airspeed [m/s], not below the stall. Returns power [W], CL, CD, each (n,).
    """
    W = plant.mass_kg * g if weight_N is None else weight_N
    qS = density * np.asarray(V) ** 2 / 2 * plant.aircraft.geometry.wing_area_m2
    aero, wanted = plant.aero, W / qS
    # Lift rises with alpha up to the stall: bisect there.
    low, high = np.full_like(wanted, -0.3), np.full_like(wanted, _angle_of_most_lift(plant))
    for _ in range(60):
        alpha = (low + high) / 2
        elevator = -(aero.Cm0 + aero.Cma * alpha) / aero.Cmde
        CL, CD = lift_and_drag(aero, alpha, elevator)
        low, high = np.where(CL < wanted, alpha, low), np.where(CL < wanted, high, alpha)
    CD = CD + plant.added_CD(CL, V)
    return qS * CD * np.asarray(V), CL, CD


def _angle_of_most_lift(plant: Plant) -> float:
    aero = plant.aero
    alpha = np.linspace(0, 1.5 * aero.stall_angle_rad, 2000)
    elevator = -(aero.Cm0 + aero.Cma * alpha) / aero.Cmde
    return float(alpha[np.argmax(lift_and_drag(aero, alpha, elevator)[0])])
