"""Tables with known columns, because common programs always name them the same: radios, decoders, ground stations."""

import re
from collections.abc import Collection, Mapping
from typing import NamedTuple

from flightpower.analysis.sources.quantities import Quantity

Q = Quantity


class Known(NamedTuple):
    """name : pattern for a column's whole name, in lower case     unit : its unit; if empty, the name gives it
    opposite : whether its sign is opposite to the quantity's
    """

    name: str
    unit: str = ""
    opposite: bool = False


class Recorder(NamedTuple):
    """title : for messages     signs : patterns, each of which must match some column
    columns : candidates for each quantity, of which the first that is present is used
    """

    title: str
    signs: tuple[str, ...]
    columns: Mapping[Quantity, tuple[Known, ...]]


UNIT = r" ?\([^)]+\)"
# Sensors of FrSky, Crossfire, ELRS and others as the radio names them; the names contain all units. RxBt is the
# receiver's battery, but with Crossfire and ELRS (RQly) the aircraft's, as sent by its flight controller.
RADIO = {
    Q.TIME: (Known("time", "s"),),
    Q.INDICATED_AIRSPEED: (Known(rf"aspd{UNIT}"),),
    Q.HEIGHT: (Known(rf"alt{UNIT}"), Known(rf"galt{UNIT}")),
    Q.GROUND_SPEED: (Known(rf"gspd{UNIT}"),),
    Q.COURSE: (Known(rf"hdg{UNIT}"),),
    Q.LATITUDE: (Known("gps latitude", "deg"),),
    Q.LONGITUDE: (Known("gps longitude", "deg"),),
    Q.VOLTAGE: (Known(rf"vfas{UNIT}"),),
    Q.CURRENT: (Known(rf"curr{UNIT}"),),
}
CROSSFIRE = RADIO | {Q.VOLTAGE: (Known(rf"vfas{UNIT}"), Known(rf"rxbt{UNIT}"))}
# Axes are forward, left, up; airspeed is for sea-level density.
BLACKBOX = {
    Q.TIME: (Known(r"time \(us\)", "us"),),
    Q.INDICATED_AIRSPEED: (Known("airspeed", "cm/s"),),
    Q.HEIGHT: (Known(r"baroalt \(cm\)", "cm"),),
    Q.FORCE_FORWARD: (Known(rf"accsmooth\[0\]{UNIT}"),),
    Q.FORCE_RIGHT: (Known(rf"accsmooth\[1\]{UNIT}", opposite=True),),
    Q.FORCE_DOWN: (Known(rf"accsmooth\[2\]{UNIT}", opposite=True),),
    Q.VELOCITY_NORTH: (Known(r"navvel\[0\]", "cm/s"), Known(r"gps_velned\[0\]", "cm/s")),
    Q.VELOCITY_EAST: (Known(r"navvel\[1\]", "cm/s"), Known(r"gps_velned\[1\]", "cm/s")),
    Q.VELOCITY_DOWN: (Known(r"navvel\[2\]", "cm/s", True), Known(r"gps_velned\[2\]", "cm/s")),
    Q.GROUND_SPEED: (Known(rf"gps_speed{UNIT}"),),
    Q.COURSE: (Known("gps_ground_course", "deg"),),
    Q.VOLTAGE: (Known(rf"vbat(latest)?{UNIT}"),),
    Q.CURRENT: (Known(rf"amperage(latest)?{UNIT}"),),
}
MILLI_G = "millistandard_gravity"
# Fields and units as in MAVLink's messages.
MAVLINK = {
    Q.TIME: (Known("timestamp", "s"),),
    Q.INDICATED_AIRSPEED: (Known(r"vfr_hud\.airspeed", "m/s"),),
    Q.STATIC_PRESSURE: (Known(r"scaled_pressure\.press_abs", "hPa"), Known(r"highres_imu\.abs_pressure", "hPa")),
    Q.HEIGHT: (Known(r"vfr_hud\.alt", "m"),),
    Q.FORCE_FORWARD: (Known(r"raw_imu\.xacc", MILLI_G), Known(r"scaled_imu2?\.xacc", MILLI_G)),
    Q.FORCE_RIGHT: (Known(r"raw_imu\.yacc", MILLI_G), Known(r"scaled_imu2?\.yacc", MILLI_G)),
    Q.FORCE_DOWN: (Known(r"raw_imu\.zacc", MILLI_G), Known(r"scaled_imu2?\.zacc", MILLI_G)),
    Q.VELOCITY_NORTH: (Known(r"global_position_int\.vx", "cm/s"),),
    Q.VELOCITY_EAST: (Known(r"global_position_int\.vy", "cm/s"),),
    Q.VELOCITY_DOWN: (Known(r"global_position_int\.vz", "cm/s"),),
    Q.VOLTAGE: (Known(r"sys_status\.voltage_battery", "mV"),),
    Q.CURRENT: (
        Known(r"sys_status\.current_battery", "centiampere"),
        Known(r"battery_status\.current_battery", "centiampere"),
    ),
    Q.THROTTLE: (Known(r"vfr_hud\.throttle", "percent"),),
}
# QGroundControl writes numbers in the units that its user has chosen. SI units are assumed here; the laws check them
# against position, which is always in degrees, and climb rate.
QGROUNDCONTROL = {
    Q.TIME: (Known("timestamp", "s"),),
    Q.INDICATED_AIRSPEED: (Known("airspeed", "m/s"),),
    Q.HEIGHT: (Known("altituderelative", "m"), Known("altitudeamsl", "m")),
    Q.VELOCITY_DOWN: (Known("climbrate", "m/s", True),),
    Q.LATITUDE: (Known(r"gps\.lat", "deg"),),
    Q.LONGITUDE: (Known(r"gps\.lon", "deg"),),
    Q.VOLTAGE: (Known(r"battery0?\.voltage", "V"),),
    Q.CURRENT: (Known(r"battery0?\.current", "A"),),
    Q.THROTTLE: (Known("throttlepct", "percent"),),
}
# Sensors of Jeti: a name consists of the device's name, which its owner may change, the sensor's name, and the unit.
JETI = {
    Q.TIME: (Known(r"time \[s\]", "s"),),
    Q.INDICATED_AIRSPEED: (Known(r"mspeed\S* (air ?speed|velocity|speed) \[[^]]+\]"),),
    Q.HEIGHT: (
        Known(r"(m?vario|mspeed)\S* (rel\. ?)?alti(tude|t\.)? \[m\]"),
        Known(r"mgps\S* (altrelat\.|altitude) \[m\]"),
    ),
    Q.GROUND_SPEED: (Known(r"mgps\S* speed \[[^]]+\]"),),
    Q.COURSE: (Known(r"mgps\S* course \[[^]]+\]", "deg"),),
    Q.LATITUDE: (Known(r"mgps\S* latitude \[[^]]+\]", "deg"),),
    Q.LONGITUDE: (Known(r"mgps\S* longitude \[[^]]+\]", "deg"),),
    Q.VOLTAGE: (Known(r"mui\S* voltage \[v\]", "V"), Known(r"mezon.* u battery \[v\]", "V")),
    Q.CURRENT: (Known(r"mui\S* current \[a\]", "A"), Known(r"mezon.* i battery \[a\]", "A")),
}
ON_A_RADIO = ("time", r"(rssi|1rss|rqly|rxbt|txbat|vfr|vfas)(\(.*)?")
RECORDERS = (
    Recorder("EdgeTX or OpenTX, with Crossfire or ELRS", (*ON_A_RADIO, r"(rqly|1rss|tqly).*"), CROSSFIRE),
    Recorder("EdgeTX or OpenTX", ON_A_RADIO, RADIO),
    Recorder("a Jeti radio", (r"time \[s\]", r"(rx|tx|mui|mezon|mgps|mspeed)\S* .*"), JETI),
    Recorder("blackbox_decode", ("loopiteration", r"time \(us\)"), BLACKBOX),
    Recorder("mavlogdump.py", ("timestamp", r"[a-z_0-9]+\.[a-z_0-9]+", r"(vfr_hud|sys_status)\..*"), MAVLINK),
    Recorder("QGroundControl", ("timestamp", "groundspeed", "climbrate", "airspeed", r"gps\.lat"), QGROUNDCONTROL),
)  # fmt: skip


def recorder_of(names: Collection[str]) -> Recorder | None:
    """Return the program that named the columns; None if it is not known."""
    plain = [name.lower() for name in names]

    def is_there(sign: str) -> bool:
        return any(re.fullmatch(sign, name) for name in plain)

    return next((recorder for recorder in RECORDERS if all(map(is_there, recorder.signs))), None)


def known_columns(recorder: Recorder, names: Collection[str]) -> dict[Quantity, tuple[str, Known]]:
    """Return a table's columns by quantity; each is the first in the recorder's list that the table has."""
    matched = {}
    for quantity, columns in recorder.columns.items():
        matches = ((name, column) for column in columns for name in names if re.fullmatch(column.name, name.lower()))
        if (first := next(matches, None)) is not None:
            matched[quantity] = first
    return matched
