"""The aircraft as a system of differential equations: rigid body, servos, motor, and the gusts it flies through.

`Plant.instant` and `Plant.derivative` are written with NumPy functions: floats, arrays and CasADi symbols pass through.
`sim.integration` makes a compiled integration step of them.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from flightpower.flight.aerodynamics import Aerodynamics, aerodynamics_of, body_axes, coefficients
from flightpower.flight.aircraft import ControlSurface
from flightpower.flight.complete_aircraft import CompleteAircraft, CompletePropulsion
from flightpower.flight.motion import (
    Inertia,
    attitude_derivative,
    body_from_earth,
    earth_from_body,
    flow_of,
    rate_derivative,
    velocity_derivative,
)
from flightpower.flight.number import Number
from flightpower.flight.propeller import PropellerModel
from flightpower.flight.propeller_files import load_propeller
from flightpower.sim.air import VON_KARMAN, Air, Gust, GustStates, ambient, dryden, gust_scales, mean_wind, von_karman
from flightpower.sim.drag_shape import PARABOLA, REFERENCE_CL, DragShape
from flightpower.sim.propulsion import PowerTrainState, ThrustFactor, power_train
from flightpower.sim.true_propeller import true_propeller


class AircraftState(NamedTuple):
    """The state vector; SI units and radians."""

    north: Any
    east: Any
    down: Any  # down from the ground: minus height
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
    energy: Any  # energy taken from the battery [J]
    gust_u: Any
    gust_v1: Any
    gust_v2: Any
    gust_w1: Any
    gust_w2: Any
    gust_p: Any
    gust_q: Any
    gust_r: Any
    gust_u2: Any
    gust_v3: Any
    gust_w3: Any


FIRST_GUST = AircraftState._fields.index("gust_u")
MOTOR = AircraftState._fields.index("motor")


class Commands(NamedTuple):
    """Commanded surface angles [rad] and throttle (0 to 1)."""

    elevator: Any
    aileron: Any
    rudder: Any
    throttle: Any


@dataclass(frozen=True, kw_only=True)
class Deviations:
    """Differences of the simulated aircraft from its file, which no sensor measures."""

    thrust_scale: float = 0.0  # the true cT is (1 + thrust_scale) times the table's,
    thrust_slope_J: float = 0.0  # and times (1 + thrust_slope_J (J - 0.5))
    weight_scale: float = 0.0  # the true weight is (1 + weight_scale) times the file's
    updraft_mps: float = 0.0
    thrust_bow: float = 0.0  # curvature of cT relative to the table, and
    windmilling: float = 0.0  # share of the blade-element branch beyond zero thrust: `sim.true_propeller`
    drag: DragShape = PARABOLA
    gear_CD: float = 0.0  # drag of the landing gear when it is extended
    thrust_loss: float = 0.0  # fraction of thrust, and
    battery_sag: float = 0.0  # fraction of the battery's voltage, lost by the time the battery is empty


NO_DEVIATIONS = Deviations()
STANDARD_DENSITY_KGPM3 = 1.225


class FlightCondition(NamedTuple):
    """All quantities that follow from a state and commands; the truth file has them besides the state."""

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
    specific_force: tuple[Any, Any, Any]  # body axes, at the center of gravity
    angular_acceleration: tuple[Any, Any, Any]
    train: PowerTrainState


@dataclass(frozen=True)
class Plant:
    """An aircraft, and the air of one flight."""

    aircraft: CompleteAircraft
    aero: Aerodynamics
    propeller: PropellerModel
    air: Air
    deviations: Deviations = NO_DEVIATIONS
    gear_out: bool = False

    @property
    def mass_kg(self) -> float:
        return self.aircraft.mass_kg * (1 + self.deviations.weight_scale)

    @property
    def inertia(self) -> Inertia:
        m = self.aircraft.mass
        return Inertia(m.Ix_kgm2, m.Iy_kgm2, m.Iz_kgm2, m.Ixz_kgm2, self.aircraft.propulsion.propeller_inertia_kgm2)

    def instant(
        self, x: AircraftState, commands: Commands, white: Number = (0.0, 0.0, 0.0, 0.0), *, motor_held: bool = False
    ) -> tuple[FlightCondition, GustStates]:
        """Flow, forces and accelerations at a state, and the rates of change of the gust filters.

        `motor_held`: whether the motor speed is constant, whatever the throttle; for trim.
        """
        geometry, aero = self.aircraft.geometry, self.aero
        b, c, S, m = geometry.span_m, geometry.chord_m, geometry.wing_area_m2, self.mass_kg
        height = -x.down
        p_s, T_s, rho = ambient(self.air, height)
        wind = mean_wind(self.air, x.north, x.east, height, self.deviations.updraft_mps)
        wind_body = body_from_earth(wind, (x.phi, x.theta, x.psi))
        gust_rates, gust = self._gusts(x, wind_body, white)
        V, alpha, beta = flow_of(x.u - wind_body[0] - gust.u, x.v - wind_body[1] - gust.v, x.w - wind_body[2] - gust.w)
        C = coefficients(
            aero,
            alpha=alpha,
            beta=beta,
            reduced_rates=(
                (x.p - gust.p) * b / (2 * V),
                (x.q - gust.q) * c / (2 * V),
                (x.r - gust.r) * b / (2 * V),
            ),
            surfaces=(x.elevator, x.aileron, x.rudder),
        )
        CD = C.CD + self.added_CD(C.CL, V)
        CX, CZ = body_axes(C.CL, CD, alpha)
        train = power_train(
            self._propulsion(x.energy),
            self.propeller,
            V=V,
            n=x.motor,
            throttle=commands.throttle,
            rho=rho,
            thrust_factor=self._thrust_factor(x.energy),
        )
        qS = rho * V**2 / 2 * S
        force = ((CX * qS + train.thrust_N) / m, C.CY * qS / m, CZ * qS / m)
        # The propeller turns clockwise seen from behind, so its reaction torque rolls the aircraft left. qS: force [N].
        gained = 0.0 if motor_held else self.inertia.Ip * 2 * np.pi * train.motor_acceleration_revps2
        reaction = -(train.propeller_torque_Nm + gained)
        moment = (C.Cl * qS * b + reaction, C.Cm * qS * c, C.Cn * qS * b)
        turning = rate_derivative((x.p, x.q, x.r), moment, self.inertia, 2 * np.pi * x.motor)
        over_ground = earth_from_body((x.u, x.v, x.w), (x.phi, x.theta, x.psi))
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

    def added_CD(self, CL: Number, V: Number) -> Number:
        """Drag coefficient beyond that of the aircraft file, elementwise."""
        wing_loading_Pa = self.aircraft.mass.weight_N / self.aircraft.geometry.wing_area_m2
        reference_mps = float(np.sqrt(2 * wing_loading_Pa / (STANDARD_DENSITY_KGPM3 * REFERENCE_CL)))
        gear_CD = self.deviations.gear_CD if self.gear_out else 0.0
        return self.deviations.drag.added_CD(self.aero, CL, V, reference_mps) + gear_CD

    def _battery_used(self, energy_J: Number) -> Number:
        return energy_J / (3600 * self.aircraft.propulsion.battery_energy_Wh)

    def _propulsion(self, energy_J: Number) -> CompletePropulsion:
        """The power train with the battery's voltage after this energy."""
        propulsion, sag = self.aircraft.propulsion, self.deviations.battery_sag
        if not sag:
            return propulsion
        voltage = propulsion.battery_voltage_V * (1 - sag * self._battery_used(energy_J))
        return replace(propulsion, battery_voltage_V=voltage)

    def _thrust_factor(self, energy_J: Number) -> ThrustFactor:
        scale, loss = 1 + self.deviations.thrust_scale, self.deviations.thrust_loss
        if loss:
            scale = scale * (1 - loss * self._battery_used(energy_J))
        return ThrustFactor(scale, self.deviations.thrust_slope_J)

    def _gusts(self, x: AircraftState, wind_body: Number, white: Number) -> tuple[GustStates, Gust]:
        if self.air.turbulence_mps == 0:
            # Zeros of the state's own type (even CasADi symbols), so that calm air costs nothing.
            return GustStates(*(0 * v for v in x[FIRST_GUST:])), Gust(*(0 * v for v in x[FIRST_GUST : FIRST_GUST + 6]))
        # The gust filters use the airspeed without gusts; otherwise the gusts would feed back into themselves.
        V_mean = np.sqrt((x.u - wind_body[0]) ** 2 + (x.v - wind_body[1]) ** 2 + (x.w - wind_body[2]) ** 2)
        filters = von_karman if self.air.gust_spectrum == VON_KARMAN else dryden
        scales = gust_scales(self.air.turbulence_mps, -x.down, self.air.gust_length_factor)
        return filters(
            GustStates(*x[FIRST_GUST:]), white, V=V_mean, span_m=self.aircraft.geometry.span_m, scales=scales
        )

    def derivative(self, x: AircraftState, commands: Commands, white: Number = (0.0, 0.0, 0.0, 0.0)) -> AircraftState:
        """Rates of change of every state (3.6-3.14), with servos and motor."""
        now, gust_rates = self.instant(x, commands, white)
        north, east, down = now.ground_velocity
        udot, vdot, wdot = velocity_derivative((x.u, x.v, x.w), (x.p, x.q, x.r), x.phi, x.theta, now.specific_force)
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


def servo_rate(surface: ControlSurface, angle: Number, command: Number) -> Number:
    """Rate of a surface [rad/s]: a first-order lag towards the command, limited in travel and in rate."""
    within = np.clip(command, min(surface.angle_rad), max(surface.angle_rad))
    return np.clip((within - angle) / surface.lag_s, -surface.rate_radps, surface.rate_radps)


def plant_of(aircraft: CompleteAircraft, air: Air | None = None, deviations: Deviations = NO_DEVIATIONS) -> Plant:
    """The plant of an aircraft file. Raises InputError without [aerodynamics] or propeller table."""
    propeller = load_propeller(aircraft.propulsion.propeller).with_beyond_zero_thrust(
        aircraft.propulsion.beyond_zero_thrust
    )
    propeller = true_propeller(propeller, bow=deviations.thrust_bow, windmilling=deviations.windmilling)
    return Plant(aircraft, aerodynamics_of(aircraft), propeller, air or Air(), deviations)


def in_still_air(plant: Plant, air: Air) -> Plant:
    """Return this aircraft in the given still air, without the updraft among its deviations."""
    return replace(plant, air=air, deviations=replace(plant.deviations, updraft_mps=0.0))
