"""Compares measurements and results with the truth in a log of ArduPilot's own simulation. The analysis does not use
this truth."""

from dataclasses import dataclass

import numpy as np

from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.methods.whole_flight.airspeed_gps import true_airspeed
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable
from flightpower.analysis.methods.whole_flight.settings import WINDOWS
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.grid import resampled
from flightpower.analysis.sources.grid_settings import FLIGHT
from flightpower.analysis.sources.recording import FlightRecording
from flightpower.flight.arrays import Array
from flightpower.flight.units import GRAVITY_MPS2 as g


@dataclass(frozen=True)
class SimulatedTruth:
    """Differences between results and the truth of a simulation.

    airspeed_error : relative error of the mean airspeed     airspeed_half_width : half width of its 95 % interval
    steady_windows : number of windows with a steady true state
    power_error : relative excess of the curve over the power measured in these windows; NaN if there are none
    """

    airspeed_error: float
    airspeed_half_width: float
    steady_windows: int
    power_error: float

    def sentence(self) -> str:
        comparison = (
            "The flight is a simulation by ArduPilot. Its truth is not used; the airspeed differs"
            f" from it by {signed_percent(self.airspeed_error)} (95 % interval ±{100 * self.airspeed_half_width:.1f} %)"
        )
        if not self.steady_windows:
            return f"{comparison}."
        return (
            f"{comparison}, and in {self.steady_windows} windows of truly steady level flight the curve differs from"
            f" the measured power by {signed_percent(self.power_error)}."
        )


def signed_percent(share: float) -> str:
    """Write a fraction as "+0.3 %", or as "0.0 %" if it rounds to zero."""
    percent = round(100 * share, 1)
    return f"{percent:+.1f} %" if percent else "0.0 %"


def compared(flight: FlightRecording, table: FlightTable, estimate: ElectricalEstimate) -> SimulatedTruth | None:
    """Compare an estimate with the truth; None if the log is not from a simulation or has no comparable sample."""
    if recording.TRUE_AIRSPEED not in flight.truth:
        return None
    t_s = table.table.index.to_numpy() + table.start_s
    true_V, true_height = (
        resampled(flight.truth[name], t_s) if name in flight.truth else np.full(len(t_s), np.nan)
        for name in (recording.TRUE_AIRSPEED, recording.TRUE_HEIGHT)
    )
    rows, airspeed = table.table, estimate.airspeed
    V = true_airspeed(rows["pressure_Pa"].to_numpy(), rows["rho"].to_numpy(), airspeed.scale, airspeed.zero_Pa)
    finite = table.flown & np.isfinite(true_V) & np.isfinite(V)
    if not finite.any():
        return None
    steady = _steady(true_V, true_height, table, estimate.conditions.mass_kg)
    at_V = np.array([np.mean(true_V[window]) for window in steady])
    inside = (at_V >= estimate.V_mps[0]) & (at_V <= estimate.V_mps[-1]) if len(at_V) else np.zeros(0, dtype=bool)
    measured = np.array([np.mean(rows["power_W"].to_numpy()[window]) for window in steady])[inside]
    curve = np.interp(at_V[inside], estimate.V_mps, estimate.power_W) if inside.any() else measured
    # Derivatives of ln V with respect to the pitot's scale and zero; density adds its part unless GPS shows airspeed.
    of_pitot = np.array([1.0, 1 / (2 * np.mean(rows["pressure_Pa"].to_numpy()[finite]))])
    sigma = np.hypot(np.sqrt(of_pitot @ airspeed.covariance @ of_pitot), (1 - airspeed.by_gps) * table.rho_sigma / 2)
    return SimulatedTruth(
        float(np.mean(V[finite]) / np.mean(true_V[finite]) - 1),
        float(NORMAL_95 * sigma),
        int(inside.sum()),
        float(np.sum(curve) / np.sum(measured) - 1) if inside.any() else np.nan,
    )


def _steady(V: Array, height: Array, rows: FlightTable, mass_kg: float) -> list[slice]:
    """Windows of the balance's length in which the change of true energy takes less than 2 % of the measured power and
    the airspeed varies by less than 2 %.
    """
    length, power = round(WINDOWS.length_s / FLIGHT.step_s), rows.table["power_W"].to_numpy()
    energy_J = mass_kg * (g * height + V**2 / 2)
    windows = []
    for start in range(0, len(V) - length, length):
        window = slice(start, start + length)
        change_W = abs(energy_J[window][-1] - energy_J[window][0]) / WINDOWS.length_s
        still = change_W < 0.02 * np.mean(power[window]) and np.std(V[window]) < 0.02 * np.mean(V[window])
        if rows.flown[window].all() and still:
            windows.append(window)
    return windows
