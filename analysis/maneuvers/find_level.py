"""Quality of a maneuver's data: reasons to reject it, and notes for the reader of the results.

Finds level accelerations and decelerations (runs) by the criteria of `flight.runs`, and gives the reason for each
rejected stretch.
"""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from analysis.maneuvers.kinds import Maneuver, RejectedManeuver, maneuver_in
from analysis.maneuvers.settings import NOTED
from analysis.maneuvers.smooth import SmoothedMotion, smooth
from analysis.signals.aircraft_size import speed_scale_of
from analysis.signals.smoothing import stretches
from flight import runs
from flight.runs import LEVEL_RUN, Rejection, RunMeasures, changing_part, legs_of, missing_data
from flight.units import GRAVITY_MPS2

Array = NDArray[np.float64]

NEEDED = ("V_mps", "alpha_rad", "ax_mps2", "az_mps2", "q_radps", "thrust_N", "rho")


def too_low(data: pd.DataFrame) -> Rejection | None:
    """The rejection of a stretch that is too near the ground, or whose height is not known; None if neither."""
    height = data["height_m"].dropna()
    return runs.too_low(float(height.min()) if len(height) else np.nan, speed_scale_of(data))


def without_data(data: pd.DataFrame) -> Rejection | None:
    """The rejection of a stretch in which a needed channel is missing for too long; None if none is."""
    return missing_data(*missing_share(data))


def missing_share(data: pd.DataFrame) -> tuple[str, float]:
    """The first needed quantity that is missing for longer than allowed, or else the first, and its share of time."""
    shares = [(quantity(name), float(data[name].isna().mean())) for name in NEEDED]
    return next((one for one in shares if missing_data(*one)), shares[0])


def notes(data: pd.DataFrame, bank: Array) -> tuple[str, ...]:
    """What a reader should know of a maneuver that is used, a few words each. bank: (n,) [rad]."""
    remarks = []
    uncovered = 1 - float(data["propeller_covered"].mean())
    if uncovered > NOTED.outside_table:
        remarks.append(
            f"{100 * uncovered:.0f} % of the data lie outside the propeller table, which is extrapolated there"
        )
    height = data["height_m"].dropna()
    if len(height) and np.ptp(height) > NOTED.height_m:
        remarks.append(f"height varied by {np.ptp(height):.0f} m")
    if np.nanmax(np.abs(bank)) > NOTED.bank_rad:
        remarks.append(f"bank reached {np.degrees(np.nanmax(np.abs(bank))):.0f} deg")
    step = throttle_step(data)
    if step > NOTED.throttle_step:
        remarks.append(
            f"throttle moved by {100 * step:.0f} % within {NOTED.throttle_step_s:g} s: a step pitches the aircraft"
        )
    rms = load_factor_rms(data)
    if rms > NOTED.light_turbulence:
        word = "rough" if rms > NOTED.rough_turbulence else "light"
        remarks.append(f"{word} turbulence: the load factor varies by {rms:.2f} rms")
    for name in NEEDED:
        missing = float(data[name].isna().mean())
        if missing > NOTED.gap_share:
            remarks.append(
                f"{quantity(name)} was stale or missing for {100 * missing:.1f} % of the time and is interpolated there"
            )
    return tuple(remarks)


def load_factor_rms(data: pd.DataFrame) -> float:
    """Rms of the load factor about its two-second mean [-]: a measure of turbulence."""
    step_s = float(data.index[1] - data.index[0])
    n = data["az_mps2"] / GRAVITY_MPS2
    slow = n.rolling(max(3, round(NOTED.turbulence_window_s / step_s)), center=True, min_periods=1).mean()
    return float((n - slow).std())


def throttle_step(data: pd.DataFrame) -> float:
    """Largest change of throttle within NOTED.throttle_step_s [-]; zero if throttle is not known."""
    if "throttle" not in data or not data["throttle"].notna().any():
        return 0.0
    step_s = float(data.index[1] - data.index[0])
    change = data["throttle"].diff(max(1, round(NOTED.throttle_step_s / step_s))).abs().max()
    return float(change) if np.isfinite(change) else 0.0


def quantity(column: str) -> str:
    """A column's name without its unit: "thrust" for "thrust_N"."""
    return column.rpartition("_")[0] or column


def find_runs(table: pd.DataFrame) -> tuple[list[Maneuver], list[RejectedManeuver]]:
    """Runs and rejected stretches, each in order of time. table: of `air_data`."""
    motion, scale = smooth(table, LEVEL_RUN.smoothing_s), speed_scale_of(table)
    flying = table["flying"].to_numpy() & np.isfinite(motion.V)
    turning_or_steep = (np.abs(np.nan_to_num(motion.bank)) > LEVEL_RUN.largest_bank_rad) | (
        np.abs(np.nan_to_num(motion.climb)) > LEVEL_RUN.steep_mps
    )
    level_runs: list[Maneuver] = []
    rejected: list[RejectedManeuver] = []
    for stretch in [*stretches(flying & ~turning_or_steep), *stretches(flying & turning_or_steep)]:
        for leg in legs_of(motion.V[stretch].tolist()):
            rows = _changing_rows(motion, stretch.start, leg, scale)
            data = table.iloc[rows]
            measures = _measures(data, motion, rows, leg.sign)
            if measures.negligible(scale):
                continue
            if rejection := measures.rejection(scale):
                rejected.append(RejectedManeuver(leg.kind, float(data.index[0]), float(data.index[-1]), rejection))
            else:
                level_runs.append(maneuver_in(leg.kind, rows, table, motion.V, notes(data, motion.bank[rows])))
    return sorted(level_runs, key=lambda run: run.start_s), sorted(rejected, key=lambda run: run.start_s)


def _changing_rows(motion: SmoothedMotion, start: int, leg: runs.Leg, scale: float) -> slice:
    """The rows of the table of the changing part of a leg. start: row at which the leg's indices begin."""
    begin = start + leg.first
    rows = slice(begin, start + leg.last + 1)
    changing = leg.sign * motion.Vdot[rows] > LEVEL_RUN.changing_mps2 * scale
    part = changing_part(motion.V[rows].tolist(), changing.tolist())
    return slice(begin + part.start, begin + part.stop)


def _measures(data: pd.DataFrame, motion: SmoothedMotion, rows: slice, sign: int) -> RunMeasures:
    V, height = motion.V[rows], data["height_m"].dropna()
    return RunMeasures(
        rows=len(data),
        step_s=motion.step_s,
        seconds=float(data.index[-1] - data.index[0]),
        peak_mps2=float(np.max(sign * motion.Vdot[rows])),
        speed_change=float(np.ptp(V) / np.mean(V)),
        lowest_m=float(height.min()),
        mean_climb_mps=float(np.nanmean(motion.climb[rows])),
        height_range_m=float(np.ptp(height)),
        largest_bank_rad=float(np.nanmax(np.abs(motion.bank[rows]))),
        missing=missing_share(data),
    )
