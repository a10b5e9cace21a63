"""Every key of the aircraft file, with example, meaning, way to measure it, users, and the default without it.

Messages, the template of `flightpower new aircraft` and a page of the site are made from this list;
`python -m flightpower.flight.aircraft_keys` prints the tables of that page.
"""

from typing import NamedTuple

ALL = "everything"
SURFACES, LINES = ("elevator", "aileron", "rudder"), ("alpha", "beta", "airspeed", "static")


class Key(NamedTuple):
    """example : as written in the file     without : consequence if the key is missing; "" if it is required"""

    example: str
    meaning: str
    measure: str
    needed_by: str
    without: str = ""


SIMULATOR = "simulator"
LATER = "`sim` asks for it"
NO_ANGLES = "the daemon logs pulse widths only; the cross-check takes the surface as fixed; `sim` asks for it"
NO_LINE = "no lag except the 0.012 s (one standard deviation) that is assumed anyway"
NO_MOTOR = "a motor that loses a fifth of its highest power is assumed, ±50 %; `sim` asks for it"

# SURFACE stands for elevator, aileron and rudder, LINE for alpha, beta, airspeed and static.
KEYS: dict[str, Key] = {
    "name": Key('"mine"', "Short name, as in file names.", "Choose one.", ALL),
    "title": Key('"My aircraft"', "Name in headings.", "Choose one.", "report", "the name"),
    "source": Key('"Own measurements, 2026"', "Where the numbers come from.", "Write it down.", "reader", "empty"),
    "imu_position": Key(
        '["0.05 m", "0.0 m", "0.02 m"]',
        "The IMU from the center of gravity: forward, right, down.",
        "With a ruler, from the balance point.",
        "analysis, simulator",
        "the center of gravity, ±0.1 m each way; intervals contain it",
    ),
    "geometry.span": Key('"1.75 m"', "Wing span b.", "From tip to tip, with a tape measure.", ALL),
    "geometry.wing_area": Key(
        '"0.46 m^2"',
        "Wing area S, including the part inside the fuselage.",
        "Span times mean chord.",
        ALL,
    ),
    "geometry.chord": Key(
        '"0.265 m"',
        "Mean aerodynamic chord.",
        "Of a tapered wing 2/3 c_root (1 + t + t²)/(1 + t), t = c_tip/c_root.",
        "cross-check, simulator",
        "wing area over span; `sim` asks for it",
    ),
    "mass.weight": Key(
        '"4 kg"',
        "Weight in flight with battery, in N, lbf, kg, g or lb.",
        "Weigh the aircraft ready to fly.",
        ALL,
    ),
    "mass.standard_weight": Key(
        '"4 kg"',
        "Weight of PIW, VIW and the standard curve.",
        "Choose a round number.",
        "analysis",
        "the weight",
    ),
    "mass.Ix": Key(
        '"0.18 kg m^2"',
        "Moment of inertia about the body x axis (roll).",
        "Bifilar pendulum: I = m g d² T²/(16 π² L), d between the strings, L long, period T.",
        SIMULATOR,
        LATER,
    ),
    "mass.Iy": Key('"0.28 kg m^2"', "Moment of inertia about the body y axis (pitch).", "As Ix.", SIMULATOR, LATER),
    "mass.Iz": Key('"0.37 kg m^2"', "Moment of inertia about the body z axis (yaw).", "As Ix.", SIMULATOR, LATER),
    "mass.Ixz": Key('"0 kg m^2"', "Product of inertia.", "Small; leave it out.", SIMULATOR, "zero"),
    "propulsion.propeller": Key(
        '"apc-12x8e"',
        "Propeller table: a name that `flightpower propellers` lists, or a file (docs/use/propellers.md).",
        "Printed on the blade; tables of UIUC and APC are read as downloaded.",
        "analysis, simulator",
        "the log's table, or `analyze --propeller`",
    ),
    "propulsion.propeller_inertia": Key(
        '"9.0e-5 kg m^2"',
        "Moment of inertia of propeller and motor bell.",
        "Blades as rods: m D²/12.",
        "power train, simulator",
        "9e-5 kg m² (D/0.305 m)⁵; `sim` asks for it",
    ),
    "propulsion.max_rpm": Key("8300", "Highest speed of rotation.", "Static, on the ground.", SIMULATOR, LATER),
    "propulsion.pole_pairs": Key(
        "7",
        "Number of motor magnets divided by two.",
        "Count the magnets.",
        "daemon with a pulse counter, simulator",
        "the daemon asks for it where the tray file does not give it",
    ),
    "propulsion.motor_kv_rpm_per_volt": Key(
        "560", "Speed constant of the motor [rev/min/V].", "Data sheet.", "endurance, range, climb; simulator", NO_MOTOR
    ),
    "propulsion.motor_resistance": Key(
        '"0.035 ohm"',
        "Its resistance, with controller.",
        "Data sheet.",
        "endurance, range, climb; simulator",
        NO_MOTOR,
    ),
    "propulsion.motor_no_load_current": Key(
        '"1.6 A"',
        "Current of the motor without propeller.",
        "Data sheet, or measure it.",
        "endurance, range, climb; simulator",
        NO_MOTOR,
    ),
    "propulsion.battery_voltage": Key(
        '"14.8 V"',
        "Nominal voltage.",
        "On the label.",
        "simulator",
        LATER,
    ),
    "propulsion.battery_resistance": Key(
        '"0.02 ohm"',
        "Internal resistance.",
        "A charger shows it.",
        "simulator",
        LATER,
    ),
    "propulsion.battery_energy": Key(
        '"74 W h"',
        "Energy of the charged battery.",
        "Voltage times ampere hours.",
        "endurance, range; simulator",
        "no endurance, range or climb unless given with `analyze --battery-Wh`; `sim` asks for it",
    ),
    "propulsion.throttle_channel": Key("3", "Servo output of the throttle, from 1.", "Transmitter.", "daemon", "3"),
    "propulsion.beyond_zero_thrust": Key(
        '"windmill"',
        'What the propeller does at negative thrust and with the motor stopped: "windmill" (rigid blades), or "fold".',
        "Folding propellers fold.",
        "analysis, simulator",
        "windmill",
    ),
    "propulsion.static_thrust_ratio": Key(
        "1.02",
        "Thrust at rest, on a stand, over that of the propeller's table.",
        "`calibrate thrust`.",
        "analysis",
        "errors of the table as large as `uncertainty.thrust_scale` and `thrust_slope` say",
    ),
    "SURFACE.channel": Key("2", "Servo output, from 1.", "Transmitter.", "daemon, simulator", NO_ANGLES),
    "SURFACE.pulse_us": Key(
        "[1000, 1500, 2000]", "Pulse widths [µs], ascending.", "`calibrate surfaces`.", "daemon, simulator", NO_ANGLES
    ),
    "SURFACE.angle": Key(
        '["-22 deg", "0 deg", "21 deg"]',
        "Angles at these: elevator trailing edge down, aileron rolls right, rudder trailing edge left are positive.",
        "Protractor, `calibrate surfaces`.",
        "daemon, simulator",
        NO_ANGLES,
    ),
    "SURFACE.rate": Key('"5 rad/s"', "Highest rate of the servo.", "Data sheet.", SIMULATOR, "5 rad/s"),
    "SURFACE.lag": Key('"20 ms"', "Lag of the servo.", "Data sheet.", SIMULATOR, "20 ms"),
    "probe.position": Key(
        '["0.45 m", "0.0 m", "0.0 m"]',
        "Tip of the probe from the center of gravity: forward, right, down.",
        "With a ruler, from the balance point.",
        "analysis, simulator",
        "0.3 m forward, ±0.2 m; intervals contain it",
    ),
    "probe.upwash_per_CL": Key(
        '"1.0 deg"',
        "Angle of attack at the probe less that of the aircraft, per unit of lift coefficient.",
        "Lifting line, or a vortex lattice of the wing.",
        "analysis, simulator",
        "1 deg, ±1 deg; intervals contain it (`sim` takes 0)",
    ),
    "probe.boom_bending": Key(
        '"0.05 deg"',
        "Angle by which the probe's boom bends down under each g of load factor.",
        "Weights on its tip, `calibrate boom`.",
        "analysis",
        "0",
    ),
    "probe.lines.LINE.length": Key('"0.6 m"', "Length of the tube.", "Tape measure.", "analysis, simulator", NO_LINE),
    "probe.lines.LINE.diameter": Key('"1.59 mm"', "Inner diameter.", "Data sheet.", "analysis, simulator", NO_LINE),
    "probe.lines.LINE.cavity": Key(
        '"20 mm^3"',
        "Volume in the transducer.",
        "Data sheet.",
        "analysis, simulator",
        NO_LINE,
    ),
    "uncertainty.weight": Key(
        '"0.2 %"',
        "Standard deviation of the weight.",
        "Resolution of the scale; changes since weighing.",
        "analysis",
        "0.2 %: two divisions of 5 g at 4 kg; intervals contain it",
    ),
    "uncertainty.updraft": Key(
        '"0.02 m/s"',
        "Standard deviation of the mean vertical motion of the air over the runs of one flight.",
        "Under clouds, over a slope (wind times slope), or where the log has no time and place by satellites.",
        "analysis",
        "by the sun's height, the wind and the runs of the log: 0.004 m/s before sunrise on a plain in twenty minutes,"
        " 0.03 m/s in four, 0.05 to 0.15 m/s at noon; intervals contain it",
    ),
    "uncertainty.air_density": Key(
        '"0.2 %"',
        "Standard deviation of the density of the air in one flight.",
        "0.1 % for each hPa of static pressure, 0.35 % for each K of the temperature on the ground.",
        "analysis",
        "0.2 %: 1.5 hPa and 0.8 K at most; intervals contain it",
    ),
    "uncertainty.gust_length": Key(
        "1.4",
        "Scale length of vertical gusts over the height above ground.",
        "1 near the ground in wind, 1.4 with convection, more over woods and hills.",
        "analysis",
        "1.4; intervals contain it",
    ),
    "uncertainty.transducer_zero": Key(
        '"2.5 Pa"',
        "Standard deviation of the change of the differential pressure transducers' zeros between rest and flight; half"
        " of its variance is taken as a step in mid-flight.",
        "Cool or warm the tray by as much as the airstream does; data sheets allow up to 1 % of full scale.",
        "analysis",
        "0: zeros as at rest, with a drift linear in time between rests",
    ),
    "uncertainty.hysteresis": Key(
        '"0.2 %"',
        "Standard deviation of the hysteresis of the differential pressure transducers, of the range flown.",
        "Raise a pressure on the bench and lower it again; the data sheet gives a limit with nonlinearity, of full"
        " scale.",
        "analysis",
        "0",
    ),
    "uncertainty.angle_of_attack_offset": Key(
        '"0.5 deg"',
        "Standard deviation of the offset of the probe's angle of attack.",
        "How well the probe is aligned with the body axes: by eye to 1 deg, with an inclinometer to 0.2 deg.",
        "analysis",
        "1 deg: aligned by eye; intervals contain what the flight does not determine",
    ),
    "uncertainty.angle_of_attack_slope": Key(
        '"3 %"',
        "Standard deviation of the slope of the probe's angle of attack, without those of calibration and upwash.",
        "Compare probes of one drawing, in flow that differs from the tunnel's; `calibrate transducers` replaces it.",
        "analysis",
        "3 %: 5 % at most; intervals contain what the flight does not determine",
    ),
    "uncertainty.airspeed_scale": Key(
        '"1.25 %"',
        "Standard deviation of the scale of airspeed.",
        "Half the error of dynamic pressure, from transducer and static ports; `calibrate transducers` replaces it.",
        "analysis",
        "1.25 %: 2 % at most; intervals contain what the flight does not determine",
    ),
    "uncertainty.air_data_lag": Key(
        '"12 ms"',
        "Standard deviation of the lag of the air data that is left after the correction for the tubes in this file.",
        "Length and diameter of the tubes; a step of pressure on the bench.",
        "analysis",
        "12 ms: tubes of 20 ms at most; intervals contain what the flight does not determine",
    ),
    "uncertainty.accelerometer_offset": Key(
        '"0.19 m/s^2"',
        "Standard deviation of the offset of each accelerometer, with the misalignment of the IMU under 1 g.",
        "Turn the tray to six sides on the bench; the data sheet gives a limit.",
        "analysis",
        "0.19 m/s^2: 0.3 m/s^2 at most, and half a degree; intervals contain what the flight does not determine",
    ),
    "uncertainty.accelerometer_vibration": Key(
        '"0.02 m/s^2"',
        "Standard deviation of the offset of the accelerometer by vibration, forward and down, at a motor speed of 100"
        " rev/s; it grows with the square of the speed.",
        "Run the motor up with the aircraft strapped down: the change of the mean acceleration.",
        "analysis",
        "0.02 m/s^2; intervals contain what the flight does not determine",
    ),
    "uncertainty.accelerometer_scale": Key(
        '"1 %"',
        "Standard deviation of the scale of each accelerometer.",
        "Lay the tray on its six sides, `calibrate imu`; the data sheet gives a limit.",
        "analysis",
        "1 %: 3 % at most; intervals contain what the flight does not determine",
    ),
    "uncertainty.boom_bending": Key(
        '"0.03 deg"',
        "Standard deviation of the angle by which the probe's boom bends under each g of load factor.",
        "Hang the probe's own weight on the boom once more, and read the change of its angle.",
        "analysis",
        "0.03 deg: a carbon tube of 10 mm, 0.3 m long; intervals contain what the flight does not determine",
    ),
    "uncertainty.airspeed_per_lift": Key(
        '"0.5 %"',
        "Standard deviation of the relative error of airspeed per unit of lift coefficient, from the position of"
        " the static"
        " ports.",
        "Larger for ports near wing or fuselage, where some percent are usual.",
        "analysis",
        "0.1 %: a probe far ahead; intervals contain what the flight does not determine",
    ),
    "uncertainty.thrust_scale": Key(
        '"1.8 %"',
        "Standard deviation of the scale of thrust in the propeller's table.",
        "Repetitions in the tunnel, propellers of one make, disturbance by the body behind it.",
        "analysis",
        "1.8 %: 3 % at most, for repetitions in one tunnel; 17 % of a computed table; intervals contain what the flight"
        " does not determine",
    ),
    "uncertainty.thrust_slope": Key(
        "0.15",
        "Standard deviation of the slope of relative error of thrust over advance ratio.",
        "Relative difference of tables of one propeller at two advance ratios, over the difference of these.",
        "analysis",
        "0.15: 0.25 at most; 0.58 of a computed table; intervals contain what the flight does not determine",
    ),
    "uncertainty.static_thrust_ratio": Key(
        '"1.2 %"',
        "Standard deviation of `propulsion.static_thrust_ratio`.",
        "`calibrate thrust`.",
        "analysis",
        "1 %: the scale of a load cell; intervals contain it",
    ),
    "uncertainty.thrust_curvature": Key(
        '"3 %"',
        "Standard deviation of the relative error of thrust at rest from its straight line over advance ratio in"
        " flight; it counts with `propulsion.static_thrust_ratio` alone.",
        "Relative difference of two tables of one propeller: at J = 0, from the straight line through J = 0.2 to 0.55.",
        "analysis",
        "3 %, for tables measured at 5000 rpm and more; say 10 % for a slower propeller, 30 % for a computed table",
    ),
    "installation.name": Key(
        '"boom on the left wing, 12 May"',
        "Name of the installation of probe, tubes and tray.",
        "Choose a name, and a new one whenever one of these is removed or moved.",
        "pooling of flights",
        "the probe is treated as remounted for each flight",
    ),
    "installation.accelerometer_offset": Key(
        '["0.1 m/s^2", "-0.05 m/s^2", "0.2 m/s^2"]',
        "What the accelerometers read where no force acts on them: forward, right, down.",
        "The tray on its six sides, `calibrate imu`.",
        "analysis",
        "0",
    ),
    "installation.accelerometer_scale": Key(
        '["0.3 %", "-0.5 %", "2 %"]',
        "Share by which the accelerometers read more than the force: forward, right, down.",
        "The tray on its six sides, `calibrate imu`.",
        "analysis",
        "0",
    ),
    "installation.accelerometer_vibration": Key(
        '["0.1 m/s^2", "0 m/s^2", "0.02 m/s^2"]',
        "What the accelerometers read more while the motor turns at 100 rev/s: forward, right, down. It grows with the"
        " square of the speed.",
        "Run-up on the strapped aircraft, `calibrate run-up`.",
        "analysis",
        "0",
    ),
    "aerodynamics": Key(
        "{ … }",
        "Coefficients and derivatives per radian (`flight/aerodynamics.py`); see the shipped files.",
        "Estimate them from geometry.",
        SIMULATOR,
        LATER,
    ),
}


def _examples() -> dict[str, str]:
    """Examples by key, with surfaces and lines spelled out."""
    named = {"SURFACE": SURFACES, "LINE": LINES}
    examples = {}
    for key, entry in KEYS.items():
        stands_for = next((word for word in named if word in key.split(".")), None)
        for name in named[stands_for] if stands_for else ("",):
            examples[key.replace(stands_for, name) if stands_for else key] = entry.example
    return examples


EXAMPLES = _examples()


def to_markdown() -> str:
    """Return the tables of all keys as Markdown, for a page of the site."""
    rows = ["| key | such as | meaning | how to measure it | needed by | without it |", "|---|---|---|---|---|---|"]
    rows += [
        f"| `{key}` | `{k.example}` | {k.meaning} | {k.measure} | {k.needed_by} | {k.without or 'an error'} |"
        for key, k in KEYS.items()
    ]
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    print(to_markdown(), end="")
