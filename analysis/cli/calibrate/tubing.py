"""`calibrate tubing`"""

from typing import TYPE_CHECKING

from analysis.cli.calibrate.runner import AircraftFileLines, Calibrated, LogFile, calibration
from analysis.options import AircraftOption
from flight.errors import InputError

if TYPE_CHECKING:
    from analysis.airdata.line_calibration import LineLag


@calibration(AircraftFileLines)
def tubing(log: LogFile, aircraft: AircraftOption = None) -> Calibrated:
    """Measure the lag of each pneumatic line from recorded steps of pressure.

    Start the daemon, with rate_Hz = 100 in the tray file if possible. Pull a piece of soft tube over one port of the
    probe, with a T-piece to a syringe and to a small balloon or a stretched film. Press to about half of the
    transducer's range, wait two seconds, burst the film (or pull the tube off with a jerk), wait two seconds. Repeat
    eight times or more for each line, at irregular times, all in one log. Each burst happens at an unknown time between
    two ticks; several of them together determine the lag.

    If the 95 % interval is wider than 5 % either way, the command prints how many more such bursts are needed: usually
    none at 100 Hz; at 25 Hz about thirty for a lag of half a tick.

    A lag below a third of a tick only gets an upper bound; at 25 Hz such a line needs no correction. The result is the
    inner diameter of the tube that has the measured lag, with the length and cavity of the aircraft file. A line is
    left out if its 95 % interval is wider than 40 % either way: a diameter known to 5 % says as much. Exit code 2: no
    burst was found; exit code 1: none of the lags is determined.

    To rehearse it: `sim fly --plan tubing-bursts -o out/bursts`.

    \b
    Example:
      calibrate tubing log.mcap -o lines.toml
    """
    from analysis.airdata.line_calibration import line_lags, to_toml
    from analysis.log_contents import aircraft_of
    from flight.aircraft import load_aircraft
    from flight.log_reader import read_log

    recorded = read_log(log)
    lags = line_lags(recorded, load_aircraft(aircraft) if aircraft else aircraft_of(recorded))
    if all(one.measured is None for one in lags):
        raise InputError(
            f"{log}: no burst of pressure on any line; press to half of the transducer's range, hold for two seconds,"
            " burst, and repeat eight times for each line"
        )
    lines = [line for one in lags for line in summary(one)]
    if sections := to_toml(lags):
        return Calibrated(lines, sections)
    if undetermined := [f"{one.topic}: {one.unsupported}" for one in lags if one.unsupported]:
        return Calibrated(lines, unsupported="; ".join(undetermined))
    return Calibrated([*lines, "Nothing to change in the aircraft file."])


def summary(line: "LineLag") -> list[str]:
    """The result for one line of tubing, in lines of text."""
    lag = line.measured
    if lag is None:
        return [f"{line.topic}: no step found"]
    if lag.hi_s == float("inf"):
        value = f"{1e3 * lag.lag_s:.1f} ms, without an upper bound"
    elif lag.bounded:
        value = f"{1e3 * lag.lag_s:.1f} ms ({1e3 * lag.lo_s:.1f} to {1e3 * lag.hi_s:.1f})"
    else:
        value = f"shorter than {1e3 * lag.hi_s:.1f} ms, too short for this tick rate"
    expected = f"; by the aircraft file {1e3 * line.expected_s:.1f} ms" if line.expected_s is not None else ""
    lines = [f"{line.topic}: lag {value}, from {lag.steps} steps{expected}"]
    if lag.more_steps:
        lines.append(
            f"  for 5 %: about {lag.more_steps} more bursts like these in the same log, or a log at a higher rate"
        )
    if not lag.fits:
        lines.append(f"  the steps do not fit the model of a line ({lag.misfit:.1f} times the noise): look for a leak")
    if line.unsupported:
        lines.append(f"  left out: {line.unsupported}")
    return lines
