"""Checks for `daq check` whether readings fit an aircraft at rest on the ground."""

import math
from collections.abc import Mapping, Sequence
from statistics import fmean

from flightpower.daq.still_air_zero import COVER, PRESSURE
from flightpower.flight.messages import (
    AIRBORNE_MODELS,
    AbsolutePressure,
    DifferentialPressure,
    Gps,
    Imu,
    Magnetometer,
    Message,
)
from flightpower.flight.units import GRAVITY_MPS2

THREE_DIMENSIONAL = 3  # fix
OPEN_SKY = "give the antenna a clear view of the sky and wait a minute"
FORCE_TOLERANCE = 0.1  # fraction of 1 g: the MPU-9250's zero-g output is within 0.08 g, its scale within 3 % (PS 3.2)
MAX_TILT_DEG = 45.0  # limit for a parked aircraft; a wrong axis is 90 or 180 deg off
# MS5611-01BA03 within 1.5 mbar, MS5805-02BA01 within 2 mbar at room temperature, plus a margin for sun on the tray.
MAX_BAROMETER_DIFFERENCE_PA = 500.0
EARTH_FIELD_T = (20e-6, 70e-6)  # 22 to 67 uT at the surface (World Magnetic Model), plus the aircraft's own field
# Pressure at sea level is 950 to 1050 hPa except in storms: 550 m of height in the standard atmosphere. GPS adds tens
# of meters.
MAX_HEIGHT_DIFFERENCE_M = 650.0


# The trajectory needs velocity within a few tenths of a meter per second; under open sky a receiver states 0.1 to 0.3.
MAX_SPEED_ACCURACY_MPS = 0.5
MIN_SATELLITES = 6  # four give a solution; with more, a wrong pseudorange cannot spoil it unnoticed


def is_finite(message: Message) -> bool:
    """Whether every number in the message is finite."""
    values = (getattr(message, field) for field in message.__struct_fields__)
    return all(math.isfinite(value) for value in values if isinstance(value, float))


def rest_problem(messages: Sequence[Message]) -> str:
    """Why the mean of one topic does not fit an aircraft at rest, with advice; empty if it fits."""
    forces, differences = [], []
    for message in messages:
        if isinstance(message, Imu) and message.specific_force_x_mps2 is not None:
            force = message.specific_force_x_mps2, message.specific_force_y_mps2, message.specific_force_z_mps2
            forces.append([component or 0.0 for component in force])
        if isinstance(message, DifferentialPressure) and message.differential_pressure_Pa is not None:
            differences.append(message.differential_pressure_Pa)
    if forces:
        return _force_problem([fmean(component) for component in zip(*forces, strict=True)])
    if problem := field_problem(messages) or receiver_problem(messages):
        return problem
    if differences and abs(fmean(differences)) > PRESSURE.offset:
        return f"{fmean(differences):.0f} Pa at rest, limit {PRESSURE.offset:g}: {COVER}; or a tube is blocked"
    return ""


def _force_problem(force: Sequence[float]) -> str:
    size = math.hypot(*force)
    if abs(size / GRAVITY_MPS2 - 1) > FORCE_TOLERANCE:
        return f"specific force {size / GRAVITY_MPS2:.2f} g at rest: put the aircraft down; otherwise the IMU is broken"
    tilt_deg = math.degrees(math.atan2(math.hypot(force[0], force[1]), -force[2]))
    if tilt_deg > MAX_TILT_DEG:
        x, y, z = (component / GRAVITY_MPS2 for component in force)
        return (
            f"at rest the specific force must be about (0, 0, -1) g, but is ({x:.1f}, {y:.1f}, {z:.1f}) g: "
            "set the aircraft upright; otherwise correct `axes` in the tray file, of the magnetometer too"
        )
    return ""


def receiver_problem(messages: Sequence[Message]) -> str:
    """Why the latest solution of the satellites is not good enough to take off, with advice; empty if it is."""
    solutions = [message for message in messages if isinstance(message, Gps) and message.fix_type is not None]
    if not solutions:
        return ""
    last = solutions[-1]
    if last.dynamic_model not in AIRBORNE_MODELS:
        fault = "does not say its dynamic model" if last.dynamic_model is None else f"is set to {last.dynamic_model}"
        return f"the receiver {fault}, and smooths velocity unless it is 6 to 8 (airborne): switch it off and on"
    if last.fix_type != THREE_DIMENSIONAL or (last.satellites or 0) < MIN_SATELLITES:
        return f"fix of type {last.fix_type} with {last.satellites} satellites, {MIN_SATELLITES} needed: {OPEN_SKY}"
    if (accuracy_mps := last.speed_accuracy_mps or 0.0) > MAX_SPEED_ACCURACY_MPS:
        return f"velocity known to {accuracy_mps:.1f} m/s, limit {MAX_SPEED_ACCURACY_MPS:g}: {OPEN_SKY}"
    return ""


def field_problem(messages: Sequence[Message]) -> str:
    """Why the mean flux density cannot be the earth's, with advice; empty if it can be."""
    fields = [
        (m.field_x_T or 0.0, m.field_y_T or 0.0, m.field_z_T or 0.0)
        for m in messages
        if isinstance(m, Magnetometer) and m.field_x_T is not None
    ]
    if not fields:
        return ""
    size_T = math.hypot(*(fmean(component) for component in zip(*fields, strict=True)))
    if EARTH_FIELD_T[0] <= size_T <= EARTH_FIELD_T[1]:
        return ""
    return f"{size_T * 1e6:.0f} uT, the earth's field is 22 to 67: move iron and battery wires away from the IMU"


def height_comparison(messages: Mapping[str, Sequence[Message]]) -> tuple[bool, str] | None:
    """Whether static pressure fits the height by GPS, and a sentence about it; None unless both measure."""
    heights_m = [
        m.height_msl_m
        for m in messages.get("/gps", ())
        if isinstance(m, Gps) and m.height_msl_m is not None and m.fix_type == THREE_DIMENSIONAL
    ]
    topic = next((topic for topic in ("/static", "/baro") if pressures_Pa(messages.get(topic, ()))), None)
    if not heights_m or topic is None:
        return None
    height_m, pressure_Pa = fmean(heights_m), fmean(pressures_Pa(messages[topic]))
    difference_m = standard_height_m(pressure_Pa) - height_m
    text = (
        f"{topic} has {pressure_Pa / 100:.0f} hPa at {height_m:.0f} m (GPS), {difference_m:+.0f} m from the standard"
        f" atmosphere, limit {MAX_HEIGHT_DIFFERENCE_M:.0f}"
    )
    if abs(difference_m) <= MAX_HEIGHT_DIFFERENCE_M:
        return True, text
    return False, f"{text}: a blocked or open line, or a broken barometer"


def standard_height_m(pressure_Pa: float) -> float:
    """Height in the standard atmosphere's troposphere [m] (ISO 2533)."""
    return 44330.77 * (1 - math.pow(pressure_Pa / 101325.0, 0.190263))


def pressures_Pa(messages: Sequence[Message]) -> list[float]:
    return [m.pressure_Pa for m in messages if isinstance(m, AbsolutePressure) and m.pressure_Pa is not None]


def barometer_comparison(messages: Mapping[str, Sequence[Message]]) -> tuple[bool, str] | None:
    """Whether the two barometers agree, and a sentence about it; None unless both measure."""
    pressures = [pressures_Pa(messages.get(topic, ())) for topic in ("/baro", "/static")]
    if not all(pressures):
        return None
    difference_Pa = fmean(pressures[0]) - fmean(pressures[1])
    text = f"/baro is {difference_Pa / 100:+.1f} hPa from /static, limit {MAX_BAROMETER_DIFFERENCE_PA / 100:g}"
    if abs(difference_Pa) <= MAX_BAROMETER_DIFFERENCE_PA:
        return True, text
    return False, f"{text}: check for a blocked static line, wind, or a broken barometer"
