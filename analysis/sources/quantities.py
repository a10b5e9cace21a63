"""The quantities that a table's columns may hold: their names in a column map, SI units, and possible values.

Axes are those of the aircraft: forward, right, down. Angles and rates are positive for nose up, right wing down, and
nose right.
"""

from enum import StrEnum
from typing import NamedTuple


class Quantity(StrEnum):
    TIME = "time"
    AIRCRAFT = "aircraft_number"
    TRUE_AIRSPEED = "true_airspeed"
    INDICATED_AIRSPEED = "indicated_airspeed"
    DYNAMIC_PRESSURE = "dynamic_pressure"
    STATIC_PRESSURE = "static_pressure"
    HEIGHT = "height"
    AIR_TEMPERATURE = "air_temperature"
    ANGLE_OF_ATTACK = "angle_of_attack"
    SIDESLIP = "sideslip"
    FORCE_FORWARD = "specific_force_forward"
    FORCE_RIGHT = "specific_force_right"
    FORCE_DOWN = "specific_force_down"
    ROLL_RATE = "roll_rate"
    PITCH_RATE = "pitch_rate"
    YAW_RATE = "yaw_rate"
    ROLL = "roll"
    PITCH = "pitch"
    HEADING = "heading"
    VELOCITY_NORTH = "velocity_north"
    VELOCITY_EAST = "velocity_east"
    VELOCITY_DOWN = "velocity_down"
    GROUND_SPEED = "ground_speed"
    COURSE = "course"
    LATITUDE = "latitude"
    LONGITUDE = "longitude"
    VOLTAGE = "battery_voltage"
    CURRENT = "battery_current"
    POWER = "battery_power"
    MOTOR_SPEED = "motor_speed"
    THRUST = "thrust"
    THROTTLE = "throttle"


class Kind(NamedTuple):
    """unit : in SI. least, greatest: limits for most values of a flight. meaning: text for the draft of a map"""

    unit: str
    least: float
    greatest: float
    meaning: str


KINDS: dict[Quantity, Kind] = {
    Quantity.TIME: Kind("s", -1e12, 1e12, "any clock that is not set in flight"),
    Quantity.AIRCRAFT: Kind("dimensionless", -1e18, 1e18, "one number throughout"),
    Quantity.TRUE_AIRSPEED: Kind("m/s", -5.0, 300.0, "through the air"),
    Quantity.INDICATED_AIRSPEED: Kind("m/s", -5.0, 300.0, "calibrated, at the density of sea level"),
    Quantity.DYNAMIC_PRESSURE: Kind("Pa", -100.0, 20_000.0, "pitot less static pressure"),
    Quantity.STATIC_PRESSURE: Kind("Pa", 20_000.0, 110_000.0, "of the outside air"),
    Quantity.HEIGHT: Kind("m", -500.0, 12_000.0, "by pressure, or above any level"),
    Quantity.AIR_TEMPERATURE: Kind("K", 200.0, 330.0, "outside"),
    Quantity.ANGLE_OF_ATTACK: Kind("rad", -0.7, 0.7, "of the body axes, positive nose up"),
    Quantity.SIDESLIP: Kind("rad", -0.7, 0.7, "positive with wind from the right"),
    Quantity.FORCE_FORWARD: Kind("m/s^2", -100.0, 100.0, "as an accelerometer shows"),
    Quantity.FORCE_RIGHT: Kind("m/s^2", -100.0, 100.0, "as an accelerometer shows"),
    Quantity.FORCE_DOWN: Kind("m/s^2", -100.0, 100.0, "as an accelerometer shows: -9.8 in level flight"),
    Quantity.ROLL_RATE: Kind("rad/s", -15.0, 15.0, "positive right wing down"),
    Quantity.PITCH_RATE: Kind("rad/s", -15.0, 15.0, "positive nose up"),
    Quantity.YAW_RATE: Kind("rad/s", -15.0, 15.0, "positive nose right"),
    Quantity.ROLL: Kind("rad", -3.2, 3.2, "positive right wing down"),
    Quantity.PITCH: Kind("rad", -1.6, 1.6, "positive nose up"),
    Quantity.HEADING: Kind("rad", -60.0, 60.0, "from north, clockwise"),
    Quantity.VELOCITY_NORTH: Kind("m/s", -300.0, 300.0, "over ground"),
    Quantity.VELOCITY_EAST: Kind("m/s", -300.0, 300.0, "over ground"),
    Quantity.VELOCITY_DOWN: Kind("m/s", -100.0, 100.0, "negative in a climb"),
    Quantity.GROUND_SPEED: Kind("m/s", -1.0, 300.0, "horizontal"),
    Quantity.COURSE: Kind("rad", -60.0, 60.0, "over ground, from north, clockwise"),
    Quantity.LATITUDE: Kind("rad", -1.6, 1.6, "of a receiver; with the longitude instead of the velocity over ground"),
    Quantity.LONGITUDE: Kind("rad", -6.3, 6.3, "positive east"),
    Quantity.VOLTAGE: Kind("V", 2.0, 1000.0, "of the propulsion battery"),
    Quantity.CURRENT: Kind("A", -1.0, 1000.0, "positive when discharging"),
    Quantity.POWER: Kind("W", -10.0, 200_000.0, "from the battery; instead of the current, or of both"),
    Quantity.MOTOR_SPEED: Kind("turn/s", -1.0, 1000.0, "of the propeller"),
    Quantity.THRUST: Kind("N", -1e5, 1e6, "along the body axis, of all engines"),
    Quantity.THROTTLE: Kind("dimensionless", -1.1, 1.1, "0 to 1"),
}
