"""The lags of all pneumatic lines from a log with steps of pressure, and the lines for the aircraft file."""

from dataclasses import replace
from typing import NamedTuple

from analysis.airdata.lines import FIELD, TOPIC, air_in
from analysis.airdata.step_test import Lag, diameter_of_lag_m, exponential, find_steps, fit_lag, through
from analysis.airdata.tubing import low_frequency_lag_s
from analysis.signals.log_fields import field_of
from flight.aircraft import Aircraft, PneumaticLine
from flight.log_reader import Log

# The inner diameter of a narrow tube is known to some 5 %, and its lag varies with the fourth power: a 95 % interval
# that is wider than this says less than the aircraft file.
WIDEST = 0.4  # half width, relative to the lag


class LineLag(NamedTuple):
    """What a log shows of one line.

    name : in the aircraft file     topic : of the line's transducer
    measured : None if the log has no step of this pressure
    expected_s : lag of the line in the aircraft file; None if its length is not given there
    line : with the diameter that has the measured lag; None if length or lag is not known, or not supported
    """

    name: str
    topic: str
    measured: Lag | None
    expected_s: float | None
    line: PneumaticLine | None

    @property
    def unsupported(self) -> str:
        """Why the bursts do not support a calibration of this line, and what to do; empty if they do."""
        lag = self.measured
        if lag is None:
            return ""
        half_width = (lag.hi_s - lag.lo_s) / 2
        if lag.hi_s == float("inf") or (lag.bounded and half_width > WIDEST * lag.lag_s):
            return (
                f"the bursts found ({lag.steps}) do not determine the lag within {100 * WIDEST:.0f} %: record more of"
                " them in one log, or at 100 Hz"
            )
        return ""


def line_lags(log: Log, aircraft: Aircraft) -> list[LineLag]:
    """The lag of every line for which `lines.TOPIC` names a transducer, at the log's pressure and temperature."""
    gas = air_in(log)
    found = []
    for name, topic in TOPIC.items():
        line = aircraft.probe.lines.get(name)
        if line is not None and line.length_m <= 0:
            line = None
        expected_s = low_frequency_lag_s([line], gas) if line else None
        steps, noise = find_steps(*field_of(log, topic, FIELD[name]))
        if not steps:
            found.append(LineLag(name, topic, None, expected_s, None))
            continue
        lag = fit_lag(steps, noise, through(line, gas) if line else exponential)
        one = LineLag(name, topic, lag, expected_s, None)
        if line and lag.bounded and not one.unsupported:
            one = one._replace(line=replace(line, diameter_m=diameter_of_lag_m(line, lag.lag_s, gas)))
        found.append(one)
    return found


def to_toml(lags: list[LineLag]) -> str:
    """The sections `[probe.lines.…]` of an aircraft file for the lines with a measured lag; empty if there are none."""
    return "\n".join(
        f"[probe.lines.{name}]  # measured: {1e3 * lag.lag_s:.1f} ms\n"
        f'length = "{line.length_m:g} m"\n'
        f'diameter = "{1e3 * line.diameter_m:.3f} mm"\n'
        f'cavity = "{1e9 * line.cavity_m3:g} mm^3"\n'
        for name, _, lag, _, line in lags
        if lag and line
    )
