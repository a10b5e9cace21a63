"""Computes the inputs of the tray's sensors on a simulated flight; implements `sim.sensor_truth.SensorTruth`."""

from functools import cached_property

import numpy as np
import pandas as pd
from scipy.interpolate import CubicSpline

from flightpower.flight.aircraft import ControlSurface, PneumaticLine
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import GRAVITY_MPS2
from flightpower.flight.complete_aircraft import CompleteAircraft
from flightpower.flight.motion import body_from_earth, specific_force_at, velocity_of
from flightpower.flight.units import EARTH_RADIUS_M
from flightpower.sim.bench import BurstsSegment, ColumnSegment
from flightpower.sim.fly import Flight
from flightpower.sim.sensor_truth import GpsSolution
from flightpower.sim.sensors.budget import DIFFERENTIAL, DrawnErrors
from flightpower.sim.sensors.noise import GRID_HZ, gauss_markov, rng_of, white
from flightpower.sim.sensors.probe import flow_at_probe, port_pressures
from flightpower.sim.sensors.tubing import StepResponse, first_order_lag, step_response, time_constant_s

# Place of the flight, and the magnetic field there (flux density [T], dip [rad]).
HOME_LATITUDE_DEG, HOME_LONGITUDE_DEG = 35.773, -78.674
FIELD_T, DIP_RAD = 48.5e-6, np.deg2rad(63.0)

PNEUMATIC_DT_S = 1 / 200
# The electronics warm the tray above air temperature, exponentially.
WARM_UP_K, WARM_UP_S = 10.0, 240.0
# The airstream cools one side of a transducer: the gradient is full at this airspeed, and lags by this time constant.
COOLING_MPS, COOLING_S = 15.0, 60.0
PART_S = 60.0  # time constant with which a part in the aircraft follows the air's temperature
# Time constant of the autopilot's correction towards the vertical of the accelerometer.
ATTITUDE_FILTER_S = 2.0
GYRO_AND_ACCEL_RATE = GRID_HZ / 25  # the noise is stated for 25 Hz means of 200 Hz samples
SERVO_OUTPUTS = 8
# The budget states the vibration in cruise; the force of an imbalance is proportional to the square of the speed.
CRUISE_REVPS = 100.0
NEUTRAL_US, THROTTLE_LOW_US, THROTTLE_HIGH_US = 1500.0, 1000.0, 2000.0
DEFAULT_LINE = PneumaticLine(length_m=0.0, diameter_m=1e-3, cavity_m3=0.0)


class FlightSensorTruth:
    """Sensor inputs on `flight`, with the drawn `errors`."""

    def __init__(self, flight: Flight, errors: DrawnErrors):
        self._flight, self._errors = flight, errors
        self._aircraft: CompleteAircraft = flight.aircraft
        self._truth: pd.DataFrame = flight.truth
        self._t = flight.truth["time_s"].to_numpy()
        self.duration_s = float(self._t[-1])

    def imu(self, t_s: Array) -> tuple[Array, Array]:
        t, e = self._clipped(t_s), self._errors
        ax, ay, az, p, q, r, pdot, qdot, rdot, turns, speed = self._imu_spline(t).T
        position = self._aircraft.imu_position_m
        force = np.column_stack(specific_force_at((ax, ay, az), (p, q, r), (pdot, qdot, rdot), position))
        force += self._vibration(turns, speed)[:, None]
        rates = np.column_stack([p, q, r])
        rotation = (e.imu_rotation @ e.box_rotation).T
        force_scale = e.accel_scale + e.defects.imu_accelerometer_scale
        rate_scale = e.gyro_scale + e.defects.imu_gyro_scale
        force = force @ rotation * (1 + force_scale) + e.accel_bias + e.defects.vibration_offset_mps2(speed)
        rates = rates @ rotation * (1 + rate_scale) + e.gyro_bias
        sigma = np.sqrt(GYRO_AND_ACCEL_RATE)
        for i, axis in enumerate("xyz"):
            force[:, i] += sigma * e.noise.accel_mps2 * white(e.seed, f"accel {axis}", t_s)
            rates[:, i] += sigma * e.noise.gyro_radps * white(e.seed, f"gyro {axis}", t_s)
        return force, rates

    def imu_temperature_K(self, t_s: Array) -> Array:
        return self._warmed(t_s) + 6.0  # the chip is warmer than the board

    def magnetic_field_T(self, t_s: Array) -> Array:
        t, e = self._clipped(t_s), self._errors
        phi, theta, psi = self._attitude_spline(t).T
        earth = (FIELD_T * np.cos(DIP_RAD), 0.0, FIELD_T * np.sin(DIP_RAD))
        body = np.column_stack(body_from_earth(earth, (phi, theta, psi)))
        field = body @ e.box_rotation.T @ e.soft_iron.T + e.hard_iron
        for i, axis in enumerate("xyz"):
            field[:, i] += e.noise.magnetic_T * white(e.seed, f"mag {axis}", t_s)
        return field

    def absolute_pressure_Pa(self, which: str, t_s: Array) -> Array:
        e = self._errors
        noise = {"baro": e.noise.baro_Pa, "static": e.noise.static_Pa}[which]
        value = self._pneumatic(which, t_s) + e.absolute[which]
        return value + noise * white(e.seed, f"absolute {which}", t_s)

    def differential_pressure_Pa(self, which: str, t_s: Array) -> Array:
        e = self._errors
        noise = {"alpha": e.noise.alpha_Pa, "beta": e.noise.beta_Pa, "airspeed": e.noise.airspeed_Pa}[which]
        warm = WARM_UP_K * (1 - np.exp(-np.maximum(t_s, 0.0) / WARM_UP_S)) / 10.0
        value = self._pneumatic(which, t_s) + e.zero[which] + e.zero_drift[which] * warm
        if e.zero_cooling[which]:
            value = value + e.zero_cooling[which] * np.interp(self._clipped(t_s), self._t, self._cooled)
        if e.zero_step[which]:
            value = value + e.zero_step[which] * (np.asarray(t_s) > e.zero_step_at * self.duration_s)
        return value + noise * white(e.seed, f"differential {which}", t_s)

    def transducer_temperature_K(self, which: str, t_s: Array) -> Array:
        return self._warmed(t_s)

    def gps(self, t_s: Array) -> GpsSolution:
        e = self._errors
        valid_at = np.asarray(t_s) - e.values.gps_latency_s
        north, east, height, v_n, v_e, v_d = self._gps_spline(self._clipped(valid_at)).T
        wander, white_velocity = self._gps_wander(valid_at), []
        for axis in "ned":
            white_velocity.append(white(e.seed, f"gps velocity {axis}", t_s))
        position = e.noise.gps_position_m * wander[:, :3] * np.array([1.0, 1.0, 1.8])
        velocity = e.noise.gps_velocity_mps * (wander[:, 3:] + np.column_stack(white_velocity)) / np.sqrt(2)
        lost = (t_s >= e.values.gps_lost_s) & (t_s < e.values.gps_lost_s + e.values.gps_lost_for_s)
        latitude = HOME_LATITUDE_DEG + np.rad2deg((north + position[:, 0]) / EARTH_RADIUS_M)
        meters_per_rad = EARTH_RADIUS_M * np.cos(np.deg2rad(HOME_LATITUDE_DEG))
        longitude = HOME_LONGITUDE_DEG + np.rad2deg((east + position[:, 1]) / meters_per_rad)
        ones = np.ones(len(valid_at))
        return GpsSolution(
            valid_at_s=valid_at,
            fix=~lost,
            latitude_deg=latitude,
            longitude_deg=longitude,
            height_msl_m=height + self._flight.plan.air.ground_elevation_m + position[:, 2],
            velocity_ned_mps=np.column_stack([v_n, v_e, v_d]) + velocity,
            horizontal_accuracy_m=ones * max(1.4 * e.noise.gps_position_m, 0.3),
            vertical_accuracy_m=ones * max(1.8 * e.noise.gps_position_m, 0.5),
            speed_accuracy_mps=ones * max(1.7 * e.noise.gps_velocity_mps, 0.05),
        )

    def motor_speed_revps(self, t_s: Array) -> Array:
        e = self._errors
        n = e.defects.counted_revps(self._linear("motor_speed_revps", t_s)) * (1 + e.values.motor_speed_scale)
        noise = e.noise.motor_speed_revps * white(e.seed, "motor speed", t_s)
        return np.where(n > 1.0, np.maximum(n + noise, 0.0), 0.0)  # a stopped motor gives no pulses

    def servo_pulses_us(self, t_s: Array) -> Array:
        pulses = np.full((len(t_s), SERVO_OUTPUTS), NEUTRAL_US)
        for surface, column in (
            (self._aircraft.elevator, "elevator_command_rad"),
            (self._aircraft.aileron, "aileron_command_rad"),
            (self._aircraft.rudder, "rudder_command_rad"),
        ):
            pulses[:, surface.channel - 1] = _pulses(surface, self._linear(column, t_s))
        throttle = self._linear("throttle", t_s)
        channel = self._aircraft.propulsion.throttle_channel
        pulses[:, channel - 1] = THROTTLE_LOW_US + (THROTTLE_HIGH_US - THROTTLE_LOW_US) * throttle
        return pulses

    def autopilot_attitude_rad(self, t_s: Array) -> Array:
        e = self._errors
        columns = self._autopilot_attitude
        attitude = np.column_stack([np.interp(self._clipped(t_s), self._t, c) for c in columns.T])
        for i, axis in enumerate(("roll", "pitch", "yaw")):
            attitude[:, i] += e.noise.attitude_rad * white(e.seed, f"attitude {axis}", t_s)
        attitude[:, 2] = np.arctan2(np.sin(attitude[:, 2]), np.cos(attitude[:, 2]))
        return attitude

    def battery(self, t_s: Array) -> tuple[Array, Array]:
        e = self._errors
        voltage, current = self._linear("battery_voltage_V", t_s), self._linear("battery_current_A", t_s)
        voltage += e.noise.battery_voltage_V * white(e.seed, "battery voltage", t_s)
        current *= 1 + e.values.battery_scale
        current += e.noise.battery_current_A * white(e.seed, "battery current", t_s)
        return voltage, current

    # The truth as a function of time.

    def _clipped(self, t_s: Array) -> Array:
        clipped: Array = np.clip(np.asarray(t_s, dtype=float), 0.0, self.duration_s)
        return clipped

    def _spline(self, columns: list[str]) -> CubicSpline:
        return CubicSpline(self._t, self._truth[columns].to_numpy(dtype=float))

    def _linear(self, column: str, t_s: Array) -> Array:
        values: Array = np.interp(self._clipped(t_s), self._t, self._truth[column].to_numpy(dtype=np.float64))
        return values

    @cached_property
    def _imu_spline(self) -> CubicSpline:
        names = [f"specific_force_{axis}_mps2" for axis in "xyz"]
        names += ["p_radps", "q_radps", "r_radps", "pdot_radps2", "qdot_radps2", "rdot_radps2"]
        speed = self._truth["motor_speed_revps"].to_numpy()
        dt = self._t[1] - self._t[0]
        turns = np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * dt)])
        return CubicSpline(self._t, np.column_stack([self._truth[names].to_numpy(dtype=float), turns, speed]))

    @cached_property
    def _attitude_spline(self) -> CubicSpline:
        return self._spline(["roll_rad", "pitch_rad", "yaw_rad"])

    @cached_property
    def _gps_spline(self) -> CubicSpline:
        velocity = [f"velocity_{axis}_mps" for axis in ("north", "east", "down")]
        return self._spline(["north_m", "east_m", "height_m", *velocity])

    def _vibration(self, turns: Array, speed: Array) -> Array:
        """Vibration by the propeller's imbalance, at one and two times its speed of rotation; zero when it stops."""
        amplitude = self._errors.noise.vibration_mps2 * (speed / CRUISE_REVPS) ** 2
        return amplitude * (np.sin(2 * np.pi * turns) + np.sin(4 * np.pi * turns) / 2)

    def _warmed(self, t_s: Array) -> Array:
        warm = WARM_UP_K * (1 - np.exp(-np.maximum(t_s, 0.0) / WARM_UP_S))
        return np.interp(self._clipped(t_s), self._t, self._followed) + warm

    @cached_property
    def _followed(self) -> Array:
        """Temperature [K] of a part inside the aircraft that follows the air's, along the truth (n,)."""
        kelvin = self._truth["temperature_K"].to_numpy(dtype=float)
        return first_order_lag(kelvin, float(self._t[1] - self._t[0]), PART_S)

    @cached_property
    def _cooled(self) -> Array:
        """Fraction of the temperature gradient that the airstream causes across a transducer, along the truth (n,)."""
        V = self._truth["V_mps"].to_numpy(dtype=float)
        return first_order_lag(np.minimum(V / COOLING_MPS, 1.5), float(self._t[1] - self._t[0]), COOLING_S)

    @cached_property
    def _wander_grid(self) -> tuple[Array, Array]:
        """Slow GPS errors on a 10 Hz grid, three of position and three of velocity, with unit variance."""
        dt, e = 0.1, self._errors
        n = int(self.duration_s / dt) + 3
        slow = [gauss_markov(e.seed, f"gps wander {i}", n, dt, e.noise.gps_correlation_s) for i in range(3)]
        fast = [gauss_markov(e.seed, f"gps velocity wander {i}", n, dt, 2.0) for i in range(3)]
        return np.linspace(0.0, (n - 1) * dt, n), np.column_stack(slow + fast)

    def _gps_wander(self, t_s: Array) -> Array:
        grid, values = self._wander_grid
        return np.column_stack([np.interp(t_s, grid, column) for column in values.T])

    @cached_property
    def _autopilot_attitude(self) -> Array:
        """Complementary filter: gyro for fast changes, accelerometer as the vertical for slow ones; wrong when speed
        changes.

        Computed as true attitude plus the low-passed difference of the accelerometer's attitude from it.
        """
        truth, e = self._truth, self._errors
        dt = float(self._t[1] - self._t[0])
        ax, ay, az = (truth[f"specific_force_{axis}_mps2"].to_numpy() for axis in "xyz")
        phi, theta, psi = (truth[name].to_numpy() for name in ("roll_rad", "pitch_rad", "yaw_rad"))
        pitch_from_force = np.arcsin(np.clip(ax / GRAVITY_MPS2, -1.0, 1.0))
        roll_from_force = np.arctan2(-ay, np.maximum(-az, 0.1 * GRAVITY_MPS2))
        roll = phi + first_order_lag(roll_from_force - phi, dt, ATTITUDE_FILTER_S)
        pitch = theta + first_order_lag(pitch_from_force - theta, dt, ATTITUDE_FILTER_S)
        return np.column_stack([roll, pitch, np.unwrap(psi)]) + e.values.attitude_rad

    # Pneumatics: from the ports to the transducers, computed once for the flight.

    def _pneumatic(self, which: str, t_s: Array) -> Array:
        grid, pressures = self._pressures
        return np.interp(self._clipped(t_s), grid, pressures[which])

    def _position_factor(self, q_bar: Array, force_z: Array) -> Array:
        """Factor (n,) on the airspeed pressure, for an airspeed error in proportion to lift. force_z: (n,) [m/s^2]."""
        aircraft = self._aircraft
        lift_Pa = -force_z * aircraft.mass_kg / aircraft.geometry.wing_area_m2
        CL = np.clip(lift_Pa / np.maximum(q_bar, 1.0), 0.0, 2.0)
        return np.asarray((1 + self._errors.defects.airspeed_per_lift * CL) ** 2)

    @cached_property
    def _pressures(self) -> tuple[Array, dict[str, Array]]:
        """Pressures at the transducers on a 200 Hz grid, including lines and systematic errors."""
        grid = np.arange(0.0, self.duration_s + PNEUMATIC_DT_S / 2, PNEUMATIC_DT_S)
        names = ["p_radps", "q_radps", "r_radps", "upwash_rad", "static_pressure_Pa", "temperature_K", "density_kgpm3"]
        names += ["specific_force_z_mps2"]
        velocity = velocity_of(*(self._truth[name].to_numpy() for name in ("V_mps", "alpha_rad", "beta_rad")))
        columns = [self._truth[name].to_numpy() for name in names]
        spline = CubicSpline(self._t, np.column_stack([*velocity, *columns]))
        u, v, w, p, q, r, upwash, static, temperature, density, force_z = spline(np.minimum(grid, self.duration_s)).T
        e = self._errors.values
        position = self._aircraft.probe.position_m
        V, alpha, beta = flow_at_probe((u, v, w), (p, q, r), position, upwash)
        alpha = alpha - self._errors.defects.boom_bending_rad * force_z / GRAVITY_MPS2
        q_bar = density * V**2 / 2
        ports = port_pressures(q_bar, alpha + e.alpha_offset_rad, beta + e.beta_offset_rad)
        pressure, kelvin = float(static.mean()), float(temperature.mean())

        def through(name: str, x: Array) -> Array:
            line = self._aircraft.probe.lines.get(name, DEFAULT_LINE)
            tau_s = time_constant_s(line, pressure, kelvin) + e.lag_s
            bursts = self._bursts(name, grid, step_response(line, pressure, kelvin, e.lag_s))
            return first_order_lag(x, PNEUMATIC_DT_S, tau_s) + bursts

        static_line = through("static", static + ports.static + e.static_position * q_bar)
        leak = self._errors.defects.airspeed_leak
        center_line = through("airspeed", static + (1 - leak) * ports.center)
        pressures = {
            "alpha": through("alpha", ports.lower_minus_upper) * (1 + e.alpha_scale),
            "beta": through("beta", ports.right_minus_left) * (1 + e.beta_scale),
            "airspeed": (center_line - static_line) * (1 + e.V_scale) ** 2 * self._position_factor(q_bar, force_z),
            "static": static_line,
            "baro": static,
        }
        for name in DIFFERENTIAL:
            pressures[name] = with_hysteresis(pressures[name], e.hysteresis) + self._colored(name, len(grid))
        return grid, pressures

    def _bursts(self, name: str, t: Array, line: StepResponse) -> Array:
        """The plan's bursts of pressure, and its water column, at the end of a line [Pa], (n,)."""
        total = np.zeros_like(t)
        for index, segment in enumerate(self._flight.plan.segments):
            on_line = isinstance(segment, BurstsSegment) and segment.line == name
            if not on_line and not (isinstance(segment, ColumnSegment) and name in DIFFERENTIAL):
                continue
            start_s = float(self._truth.loc[self._truth["segment"] == index, "time_s"].iloc[0])
            if isinstance(segment, ColumnSegment):
                total += segment.applied_Pa(t - start_s)
            elif isinstance(segment, BurstsSegment):
                jitter = rng_of(self._errors.seed, f"bursts {index}").uniform(-1, 1, segment.count)
                total += segment.response(t - start_s, line, jitter)
        return total

    def _colored(self, name: str, n: int) -> Array:
        noise = self._errors.noise
        if noise.colored_Pa == 0:
            return np.zeros(n)
        channel = f"coloured {name}"  # this spelling determines the random numbers  # codespell:ignore coloured
        sequence = gauss_markov(self._errors.seed, channel, n, PNEUMATIC_DT_S, noise.colored_time_s)
        return noise.colored_Pa * sequence


def with_hysteresis(x: Array, fraction: float) -> Array:
    """Apply hysteresis as a play operator, whose width is `fraction` times the range of x (n,)."""
    if fraction == 0:
        return x
    half = fraction * float(np.ptp(x)) / 2
    y = np.empty_like(x)
    position = x[0]
    for i, value in enumerate(x.tolist()):
        position = min(max(position, value - half), value + half)
        y[i] = position
    return y


def _pulses(surface: ControlSurface, angle: Array) -> Array:
    """Pulse widths [us] for arrays of angles, as `ControlSurface.pulse_of_angle_us` gives for one angle."""
    angles, pulses = np.array(surface.angle_rad), np.array(surface.pulse_us)
    order = np.argsort(angles)
    pulse_us: Array = np.interp(angle, angles[order], pulses[order])
    return pulse_us
