"""`calibrate`: from measurements on the ground and in the air to the small files that tray and analysis take."""

import math
import os
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.console import Console

from analysis.cli.errors import run
from analysis.estimation.intervals import NORMAL_95
from analysis.files import write_file
from flight.errors import InputError

app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode="markdown")

Replace = Annotated[bool, typer.Option("--replace", help="Replace an existing file.")]
LogFile = Annotated[Path, typer.Argument(help="A log that the daemon recorded.")]
AircraftFile = Annotated[
    Path | None, typer.Option("--aircraft", help="Aircraft file to use instead of the one the log carries.")
]


class Channel(StrEnum):
    elevator = "elevator"
    aileron = "aileron"
    rudder = "rudder"


@app.callback()
def _group() -> None:
    """Calibrations: the probe from a wind tunnel; tubes, magnetometer and surfaces on the bench; airspeed in flight."""
    # A thread pool helps none of these small matrices and costs the start of every call.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


@app.command()
def probe(
    tunnel: Annotated[Path, typer.Argument(help="CSV with a header such as `speed [m/s],alpha [deg],…`")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Where the calibration goes.")] = Path("probe.json"),
    report: Annotated[
        Path | None, typer.Option("--report", help="Where the report page goes; default: beside the calibration, .html")
    ] = None,
    angle_scale: Annotated[
        float, typer.Option("--angle-scale", help="How well the tunnel's own angles are known, 1 sigma, in per cent.")
    ] = 0.5,
    replace: Replace = False,
) -> None:
    """Turn a wind tunnel's measurements of a five-port probe into the calibration the daemon puts into its logs.

    The tunnel file has the columns speed, alpha, beta, dp_alpha (lower minus upper port), dp_beta (right minus left),
    q_c (centre minus static), static and temperature, each with its unit in brackets. Measure at three speeds at least,
    or nobody can say whether the calibration depends on speed, and at angles beyond those that will be flown: outside
    of what was measured, the analysis leaves results out.

    A page beside the calibration shows what the maps leave over, what speed does, and where they hold. The error of the
    slope of alpha goes along in the file (alpha_scale_sigma); the turntable and the walls of the tunnel have their part
    in it, which no measurement shows: --angle-scale.
    """
    from analysis.airdata import probe as probes
    from analysis.report import calibration as page

    where = report or output.with_suffix(".html")
    if where == output:
        raise InputError(f"{where}: the report and the calibration cannot be one file; give --report")
    _free(output, replace)
    _free(where, replace)
    if not 0 <= angle_scale < 20:
        raise InputError(f"--angle-scale {angle_scale:g}: give a percentage, 0 to 20")
    measured = probes.read_tunnel(tunnel)
    calibration = probes.calibrate(measured, tunnel.name, angle_scale_sigma=angle_scale / 100)
    html = page.render(measured, calibration, angle_scale_sigma=angle_scale / 100)
    _write_json(output, calibration)
    write_file(where, html)
    console = Console()
    console.print(f"{calibration.points} points, polynomials chosen by cross-validation:")
    for name, surface, scale, unit in (
        ("alpha", calibration.alpha_rad, math.degrees(1), "deg"),
        ("beta", calibration.beta_rad, math.degrees(1), "deg"),
        ("q_c/qbar", calibration.q_ratio, 100, "%"),
    ):
        rms = f"{surface.residual_rms * scale:.3f} {unit}"
        console.print(f"  {name:9} order {surface.order}, predicts left-out points to {rms} rms")
    console.print(f"slope of alpha good to {100 * calibration.alpha_scale_sigma:.2f} % (1 sigma)")
    console.print(f"wrote {output} and {where}")


@app.command()
def tubing(
    log: LogFile,
    aircraft: AircraftFile = None,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="Where the lines for the aircraft file go; default: printed.")
    ] = None,
    replace: Replace = False,
) -> None:
    """The lag of each pneumatic line, from a recorded step of pressure.

    How to make one: start the daemon, with rate_Hz = 100 in the tray if you can. Pull a piece of soft tube over one
    port of the probe, with a T-piece to a syringe and to a small balloon or a stretched film. Press to about half
    of the transducer's range, wait two seconds, burst the film (or pull the tube off with a jerk), wait two
    seconds. Eight times or more for each line, without an eye on the clock: what one burst leaves open, when it
    happened between two ticks, the others close. All in one log; a balloon again and again, or the syringe pulled off.
    When the interval is wider than 5 % either way, how many more such bursts would narrow it is printed: at 100 Hz
    few logs want any, at 25 Hz a lag of half a tick takes about thirty.

    A lag below a third of a tick only gets an upper bound: such a line needs no correction at 25 Hz. What comes out is
    the tube's inner diameter that has the lag measured, for the aircraft file: length and cavity are as they stand
    there.
    """
    from analysis.airdata import lines, step_test
    from analysis.airdata.tubing import low_frequency_lag_s
    from analysis.log_contents import aircraft_of
    from flight.aircraft import load_aircraft
    from flight.log_reader import read_log

    _free(output, replace)
    recorded = read_log(log)
    plane = load_aircraft(aircraft) if aircraft else aircraft_of(recorded)
    gas = lines.air_in(recorded)
    console, fragment = Console(stderr=output is None), []
    for name, topic in lines.TOPIC.items():
        t_s, value = _field(recorded, topic, lines.FIELD[name])
        steps, noise = step_test.find_steps(t_s, value)
        line = plane.probe.lines.get(name)
        if not steps:
            console.print(f"{topic}: no step seen")
            continue
        known = line is not None and line.length_m > 0
        shape = step_test.through(line, gas) if known and line is not None else step_test.exponential
        lag = step_test.fit_lag(steps, noise, shape)
        said = f"{1e3 * lag.lag_s:.1f} ms ({1e3 * lag.lo_s:.1f} to {1e3 * lag.hi_s:.1f})" if lag.bounded else (
            f"shorter than {1e3 * lag.hi_s:.1f} ms, too short for this tick rate"
        )  # fmt: skip
        from_file = f"; by the aircraft file {1e3 * low_frequency_lag_s([line], gas):.1f} ms" if known and line else ""
        console.print(f"{topic}: lag {said}, from {lag.steps} steps{from_file}")
        if lag.more_steps:
            console.print(
                f"  for 5 %: about {lag.more_steps} more bursts like these in the same log, or a log at a higher rate"
            )
        if lag.misfit > MISFIT:
            console.print(
                f"  the steps are not those of a line: {lag.misfit:.1f} times the noise is left. A slow leak?"
            )
        if lag.bounded and known and line is not None:
            d_mm = 1e3 * step_test.diameter_of_lag_m(line, lag.lag_s, gas)
            fragment.append(
                f'[probe.lines.{name}]  # measured: {1e3 * lag.lag_s:.1f} ms\nlength = "{line.length_m:g} m"\n'
                f'diameter = "{d_mm:.3f} mm"\ncavity = "{1e9 * line.cavity_m3:g} mm^3"\n'
            )
    if not fragment:
        console.print("Nothing to change in the aircraft file.")
        return
    _give("\n".join(fragment), output)


MISFIT = 2.0


@app.command()
def airspeed(
    log: LogFile,
    aircraft: AircraftFile = None,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="Write the result as JSON, too.")] = None,
    replace: Replace = False,
) -> None:
    """The airspeed's scale error and the wind, from flight on opposite headings against GPS.

    Fly two legs or more of half a minute at a steady speed, there and back along one line, better along two lines that
    cross; turns help. Steady wind moves GPS speed by as much in one direction as it takes in the other, and what is
    left is the scale. A flight in one direction only is told so: wind and scale cannot be told apart then. `analyze`
    does the same by itself for each flight; this is for looking at it, or for a flight made for the purpose.
    """
    from analysis.airdata import lines
    from analysis.airdata.air import air_data
    from analysis.log_contents import aircraft_of, probe_of, propeller_of
    from analysis.signals.rest import rest_segments, zero_of_attachment, zeros
    from analysis.signals.synchronize import synchronize
    from analysis.trajectory import airspeed_scale as speeds
    from analysis.trajectory.reconstruction import reconstruct
    from flight.aircraft import load_aircraft
    from flight.log_reader import read_log

    _free(output, replace)
    recorded = read_log(log)
    plane = load_aircraft(aircraft) if aircraft else aircraft_of(recorded)
    channels = synchronize(recorded, lines.lags_s(plane, lines.air_in(recorded)))
    still = rest_segments(channels.table, channels.rate_Hz)
    taken = zero_of_attachment(recorded.attachments.get("zero.json"), f"{log}: zero.json")
    at_rest = zeros(channels.table, still, taken)
    air = air_data(channels.table, plane, probe_of(recorded), propeller_of(recorded, plane), at_rest)
    if not air.table["flying"].any():
        raise InputError(f"{log}: nothing was flown in this log")
    found = speeds.calibrate(air.table, reconstruct(air.table, still))
    half = NORMAL_95 * found.scale_error
    console = Console()
    side = "high" if found.scale >= 0 else "low"
    console.print(f"airspeed reads {100 * abs(found.scale):.2f} ± {100 * half:.2f} % too {side} (95 % interval)")
    console.print(f"wind {found.wind_mps:.1f} m/s from {found.wind_from_deg:.0f} deg, mean of the flight")
    for note in found.notes + channels.notes + air.notes:
        console.print(f"note: {note}")
    if output:
        _write_json(output, {"format": "flightpower-airspeed-1", "source": log.name, **found._asdict()})
        console.print(f"wrote {output}")


@app.command()
def magnetometer(
    log: LogFile,
    output: Annotated[Path, typer.Option("-o", "--output", help="Where it goes.")] = Path("magnetometer.json"),
    replace: Replace = False,
) -> None:
    """Hard and soft iron of the magnetometer, from a log in which the aircraft was turned about.

    Best on the ground, away from cars and reinforced concrete, everything aboard switched on and the motor off: turn
    the aircraft slowly through all attitudes for a minute, nose up and down, on its sides and on its back. Steep turns
    in flight in both directions serve too, but leave the vertical part open; how far each part is known is printed.
    """
    import numpy as np

    from analysis.airdata import magnetometer as compass
    from flight.log_reader import read_log

    _free(output, replace)
    recorded = read_log(log)
    parts = [_field(recorded, "/mag", f"field_{axis}_T") for axis in "xyz"]
    if not len(parts[0][1]):
        raise InputError(f"{log}: no magnetometer in this log")
    found = compass.calibrate(np.column_stack([values for _, values in parts]), str(log))
    _write_json(output, found)
    console = Console()
    for axis, b, error in zip("xyz", found.hard_iron_T, found.hard_iron_error_T, strict=True):
        console.print(f"hard iron {axis} {1e6 * b:+.1f} ± {1e6 * error:.1f} uT")
    console.print(f"soft iron good to {100 * found.soft_iron_error:.1f} %; field {1e6 * found.field_T:.1f} uT")
    console.print(
        f"strength varies by {1e6 * found.residual_before_T:.2f} uT rms as measured,"
        f" {1e6 * found.residual_T:.2f} uT corrected"
    )
    if found.directions < FLAT:
        console.print("note: seen in directions near one plane only; turn it about another axis, too")
    console.print(f"wrote {output}")


FLAT = 0.25


@app.command()
def surfaces(
    log: LogFile,
    surface: Annotated[Channel, typer.Option("--surface", help="Which surface was moved.")] = Channel.elevator,
    angles: Annotated[
        str,
        typer.Option("--angles", help='What the protractor said, in order, in degrees: "-22 -11 0 11 -". - is none.'),
    ] = "",
    channel: Annotated[
        int | None, typer.Option("--channel", help="Servo output, from 1; default: that of the log's aircraft file.")
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option("-o", "--output", help="Where the section for the aircraft file goes; default: printed."),
    ] = None,
    replace: Replace = False,
) -> None:
    """Surface angle against servo pulse, from a session with a protractor.

    Start the daemon, motor disarmed. Clamp a protractor (a digital level will do) to the surface, zero it at neutral.
    Move the stick to five positions from end to end, hold each for three seconds or more without trembling, and write
    the angles down in order; once there and once back shows the play of the linkage. Positive: elevator trailing edge
    down, aileron rolls right, rudder trailing edge left.

    Run this without --angles first: it lists the positions it found, with the time and the pulse of each. Then give the
    angles, - for a position you did not read (a pause at neutral, say). The section goes into the aircraft file.
    """
    from analysis.airdata import surfaces as deflections
    from analysis.log_contents import aircraft_of
    from flight.log_reader import read_log

    _free(output, replace)
    recorded = read_log(log)
    number = channel if channel is not None else getattr(aircraft_of(recorded), surface.value).channel
    t_s, pulse = _pulses(recorded, number)
    if not len(pulse):
        raise InputError(f"{log}: no pulse of servo output {number} in this log; --channel names another")
    found = deflections.holds(t_s, pulse)
    if not angles.strip():
        Console().print(f"positions of output {number}: {deflections.in_words(found)}. Now give --angles.")
        return
    told = deflections.table(found, [_angle(word) for word in angles.replace(",", " ").split()])
    Console(stderr=output is None).print(
        f"{len(told.pulse_us)} positions; the same position read twice differs by {told.hysteresis_deg:.1f} deg at most"
    )
    _give(deflections.to_toml(surface.value, number, told), output)


def _angle(word: str) -> float | None:
    if word == "-":
        return None
    try:
        return float(word)
    except ValueError:
        raise InputError(f"--angles: {word!r} is not an angle in degrees; - stands for a position not read") from None


def _field(log: Any, topic: str, field: str) -> tuple[Any, Any]:
    """Times [s] since the log began and values of a topic's good messages."""
    import numpy as np

    from flight.messages import Status

    entries = log.entries.get(topic, [])
    good = [(e.time_ns, getattr(e.message, field)) for e in entries if e.message.status is Status.OK]
    good = [(time_ns, value) for time_ns, value in good if value is not None]
    start_ns = good[0][0] if good else 0
    return np.array([(time_ns - start_ns) / 1e9 for time_ns, _ in good]), np.array([value for _, value in good], float)


def _pulses(log: Any, channel: int) -> tuple[Any, Any]:
    import numpy as np

    if channel < 1:
        raise InputError(f"--channel {channel}: servo outputs count from 1")
    t_s, pulses = [], []
    for entry in log.entries.get("/controls", []):
        if entry.message.pulse_us is not None and len(entry.message.pulse_us) >= channel:
            t_s.append(entry.time_ns / 1e9)
            pulses.append(entry.message.pulse_us[channel - 1])
    return np.array(t_s) - (t_s[0] if t_s else 0.0), np.array(pulses, dtype=float)


def _free(path: Path | None, replace: bool) -> None:
    """Raises InputError when a file stands where one is to be written."""
    if path is not None and path.exists() and not replace:
        raise InputError(f"{path}: exists already; give --replace, or another name with -o")


def _write_json(path: Path, content: object) -> None:
    write_file(path, msgspec.json.format(msgspec.json.encode(content), indent=1))


def _give(text: str, output: Path | None) -> None:
    if output is None:
        print(text, end="")
        return
    write_file(output, text)
    Console().print(f"wrote {output}")


def main() -> None:
    run(app)
