"""Figures of a flight and its estimation: time histories, ground track, the fit of each run, residuals, convergence."""

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np
import pandas as pd

from flightpower.analysis.estimation.fit import Convergence
from flightpower.analysis.estimation.noise import NORMAL_95
from flightpower.analysis.maneuvers.kinds import Maneuver
from flightpower.analysis.methods.dynamic import DRAG_TITLE, SPEED_TITLE, RunFit
from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate
from flightpower.analysis.methods.whole_flight.flight_table import FlightTable
from flightpower.analysis.pages.charts.figure import Axis, Bars, Cursor, Dash, Figure, Line, Points, Shade, Symbol
from flightpower.analysis.pages.charts.style import (
    BLUE,
    GRAY,
    GRID,
    INK,
    ORANGE,
    OTHER_RUN,
    RED,
    RUN_COLOR,
    thinned,
    true_airspeed,
)
from flightpower.analysis.records.flight import AirFound, Correlation, RejectedResult, RunResidual, Track
from flightpower.analysis.trajectory.consistency import ANGLES, SPEED, Consistency
from flightpower.analysis.trajectory.reconstruction import Trajectory
from flightpower.flight.arrays import Array
from flightpower.flight.motion import body_from_earth


class OnMap(Protocol):
    """A stretch of a flight that is colored on the map."""

    @property
    def kind(self) -> str: ...
    @property
    def name(self) -> str: ...
    @property
    def start_s(self) -> float: ...
    @property
    def end_s(self) -> float: ...


NOT_SHADED = ("standing", "flying")


def time_axis() -> Axis:
    return Axis("time since the start of the log", "s")


def over_time(rows: Sequence[tuple[Array, Array, Axis]], points: int = 1000) -> Figure:
    """Draw time histories. rows: time [s], values and axis of each panel. points: the most that are drawn in a panel"""
    figure = Figure(len(rows), height_px=60 + 180 * len(rows), x=time_axis())
    figure.ys = [axis for _, _, axis in rows]
    for panel, (t_s, values, axis) in enumerate(rows, start=1):
        x, y = thinned(t_s, values, points)
        figure.add(Line(x=x, y=y, panel=panel, color=INK, width=1.8, label=axis.name))
    return figure


def timeline(table: pd.DataFrame, runs: Sequence[Maneuver], rejected: Sequence[RejectedResult] = ()) -> Figure:
    """Draw speed, height and motor speed of the whole flight, with shaded runs and gray-outlined rejected stretches."""
    t_s = table.index.to_numpy()
    rows = (
        (table["V_mps"], Axis("speed", "m/s")),
        (table["height_m"], Axis("height", "m")),
        (60 * table["n_revps"], Axis("motor", "rpm")),
    )
    figure = over_time([(t_s, values.to_numpy(), axis) for values, axis in rows])
    figure.shades = [
        Shade(run.start_s, run.end_s, RUN_COLOR.get(run.kind, OTHER_RUN), 0.22, name=run.kind, run=run.name)
        for run in runs
        if run.kind not in NOT_SHADED
    ] + [
        Shade(rejected_result.start_s, rejected_result.end_s, GRAY, 0.07, outlined=True, name="rejected")
        for rejected_result in rejected
    ]
    return figure


def consistency(agreement: Consistency, overlaid: int = 600) -> Figure:
    """Draw differences between sensors that should be zero, before and after the correction of sensor errors and gusts.

    overlaid : most points of each line, fewer than usual since the lines cover each other
    """
    degrees = float(np.degrees(1.0))
    rows = ((ANGLES, Axis("θ - α - γ", "deg"), degrees), (SPEED, Axis("V - GPS", "m/s"), 1.0))
    figure = Figure(len(rows), height_px=520, x=time_axis())
    figure.ys = [axis for _, axis, _ in rows]
    for panel, (column, _, factor) in enumerate(rows, start=1):
        for name, differences, color in zip(("before", "after"), agreement, (GRAY, BLUE), strict=True):
            x, y = thinned(differences.index.to_numpy(), factor * differences[column].to_numpy(), overlaid)
            figure.add(Line(x=x, y=y, panel=panel, name=name, color=color, width=1.8))
        figure.zero_lines.add(panel)
    return figure


def run_fit(run: str, t_s: Array, measured: dict[str, Array], modeled: dict[str, Array]) -> list[Figure]:
    """Draw measurement and fitted model of one run, and next to them their difference."""
    height_px = 130 * len(measured) + 60
    fit = Figure(len(measured), height_px=height_px, x=Axis(f"time, s ({run})", most_ticks=5))
    differences = Figure(len(measured), height_px=height_px, x=Axis("time", "s", most_ticks=5))
    for panel, quantity in enumerate(measured, start=1):
        model = modeled[quantity]
        difference = measured[quantity] - model
        fit.add(Points(x=t_s, y=measured[quantity], panel=panel, color=GRAY, size=6, name="measured", run=run))
        fit.add(Line(x=t_s, y=model, panel=panel, color=ORANGE, width=3, name="model"))
        fit.ys[panel - 1] = Axis(quantity, most_ticks=5)
        differences.add(Points(x=t_s, y=difference, panel=panel, color=GRAY, size=6, run=run))
        differences.zero_lines.add(panel)
        differences.ys[panel - 1] = Axis("difference", most_ticks=5)
    return [fit, differences]


def residuals_of_drag(fits: Sequence[RunFit], kinds: Mapping[str, str], averaged_s: float = 1.0) -> Figure:
    """Draw drag measured along each run against airspeed, in percent of the drag of the common polar, as means over
    about `averaged_s`. kinds : of the runs, by name"""
    figure = Figure(cursor=Cursor.NEAREST, x=true_airspeed())
    for fit in fits:
        averaged = max(1, round(averaged_s / float(np.median(np.diff(fit.t_s)))))
        usable = np.arange(len(fit.t_s) // averaged * averaged).reshape(-1, averaged)
        V, measured, modeled = (
            values[usable].mean(axis=1) for values in (fit.modeled[SPEED_TITLE], fit.measured[DRAG_TITLE],
                                                       fit.modeled[DRAG_TITLE])
        )  # fmt: skip
        kind = kinds.get(fit.run, fit.run)
        figure.add(
            Line(
                x=V, y=100 * (measured / modeled - 1), name=kind, color=RUN_COLOR.get(kind, OTHER_RUN), width=1.5,
                label=fit.run, value="{y:+.1f} %", run=fit.run,
            )
        )  # fmt: skip
    figure.zero_lines.add(1)
    figure.y = Axis("drag less the model's", "%")
    return figure


def autocorrelation(residuals: Sequence[RunResidual]) -> Figure:
    """Draw the autocorrelation of the residuals of drag, one line per run, with the bounds for white noise."""
    figure = Figure(height_px=380, cursor=Cursor.NEAREST, x=Axis("lag", "s"))
    for run in residuals:
        lags = run.step_s * np.arange(len(run.autocorrelation), dtype=np.float64)
        figure.add(
            Line(
                x=lags, y=np.array(run.autocorrelation), name=run.kind, color=RUN_COLOR.get(run.kind, OTHER_RUN),
                width=1.8, label=run.run, value="{y:.2f}", run=run.run,
            )
        )  # fmt: skip
    longest = max((run.step_s * (len(run.autocorrelation) - 1) for run in residuals), default=1.0)
    bound = NORMAL_95 / float(np.sqrt(np.median([run.points for run in residuals])))
    for sign in (-1, 1):
        ends = np.array([0, longest]), np.full(2, sign * bound)
        figure.add(Line(x=ends[0], y=ends[1], color=INK, dash=Dash.DASHED, name="95 % bound of white noise", value=""))
    figure.y = Axis("autocorrelation", limits=(-1.05, 1.05))
    return figure


def air_and_path(trajectory: Trajectory, overlaid: int = 600) -> Figure:
    """Draw airspeed and angle of attack of the probe, and those from path and mean wind. overlaid : as above"""
    blocks, x = trajectory.block_means, trajectory.states
    flying = np.where(blocks.flying, 1.0, np.nan)
    north, east, down, phi, theta, psi = (
        values.to_numpy()
        for values in (
            x["v_north"] - x["wind_north"], x["v_east"] - x["wind_east"], x["v_down"], x["phi"], x["theta"], x["psi"],
        )
    )  # fmt: skip
    u, _, w = (np.asarray(component) for component in body_from_earth((north, east, down), (phi, theta, psi)))
    speed = np.sqrt(north**2 + east**2 + down**2)
    rows = (
        (blocks["V_mps"], speed, Axis("airspeed", "m/s")),
        (np.degrees(blocks["alpha_rad"]), np.degrees(np.arctan2(w, u)), Axis("α", "deg")),
    )
    figure = Figure(len(rows), height_px=520, x=time_axis())
    figure.ys = [axis for _, _, axis in rows]
    for panel, (probe, path, _) in enumerate(rows, start=1):
        for values, name, color, width in ((probe, "probe", GRAY, 3.0), (path, "path and wind", BLUE, 1.5)):
            t, y = thinned(blocks.t_s, values * flying, overlaid)
            figure.add(Line(x=t, y=y, panel=panel, name=name, color=color, width=width))
    return figure


def ground_track(track: Track, runs: Sequence[OnMap], air: AirFound | None) -> Figure:
    """Draw the path over the ground with equal axes, runs colored by kind, and the direction of the wind."""
    figure = Figure(equal=True, cursor=Cursor.NEAREST, x=Axis("east", "m"))
    figure.y = Axis("north", "m")
    t, north, east = np.array(track.t_s), np.array(track.north_m), np.array(track.east_m)
    figure.add(Line(x=east, y=north, color=GRAY, width=1.2, name="whole flight", value=""))
    for run in runs:
        if run.kind in NOT_SHADED:
            continue
        rows = (t >= run.start_s) & (t <= run.end_s)
        figure.add(
            Line(
                x=east[rows], y=north[rows], name=run.kind, color=RUN_COLOR.get(run.kind, OTHER_RUN), width=4,
                label=run.name, value="{x:.0f} m east, {y:.0f} m north", run=run.name,
            )
        )  # fmt: skip
    figure.add(Points(x=east[:1], y=north[:1], name="start", symbol=Symbol.STAR, size=14, color=INK, value=""))
    if air is not None and air.wind_mps is not None and air.wind_from_deg is not None:
        figure.add(wind_arrow(track, air.wind_mps, air.wind_from_deg))
    return figure


def wind_arrow(track: Track, wind_mps: float, from_deg: float) -> Line:
    """Return an arrow in the direction of the wind, at the corner of a path over the ground."""
    north, east = np.array(track.north_m), np.array(track.east_m)
    length = 0.15 * max(float(np.ptp(north)), float(np.ptp(east)), 1.0)
    toward = np.radians(from_deg + 180)
    x, y = float(east.min()), float(north.max())
    ends = np.array([x, x + length * np.sin(toward)]), np.array([y, y + length * np.cos(toward)])
    return Line(x=ends[0], y=ends[1], color=ORANGE, width=3, arrow=True, name=f"wind, {wind_mps:.1f} m/s", value="")


LINES = ((BLUE, Symbol.CIRCLE), (ORANGE, Symbol.SQUARE))


def convergence(histories: Mapping[str, Convergence]) -> Figure:
    """Draw cost above its last value, and length of the step, over the iterations of each estimation (at most two)."""
    longest = max(len(history.steps) for history in histories.values())
    x = Axis("iteration", step=-(-longest // 7), limits=(-0.4, longest + 0.4))
    figure = Figure(2, height_px=500, x=x)
    for (name, history), (color, symbol) in zip(histories.items(), LINES, strict=False):
        costs = np.array(history.costs)
        for panel, first, values in ((1, 0, costs[:-1] - costs[-1]), (2, 1, np.array(history.steps))):
            iteration = np.arange(first, first + len(values), dtype=float)
            positive = np.where(values > 0, values, np.nan)  # other values have no logarithm
            figure.add(
                Line(x=iteration, y=positive, panel=panel, name=name, color=color, symbol=symbol, value="{y:.2e}")
            )
    figure.ys = [Axis("cost above the last", logarithmic=True), Axis("step, std. errors", logarithmic=True)]
    return figure


def correlation(correlation: Correlation) -> Figure:
    """Draw the matrix as colored cells with values: blue if two errors tend to have the same sign, red if not."""
    names = [name.replace("_", "\n") for name in correlation.names]
    n, matrix = len(names), np.array(correlation.matrix)
    rows, columns = (index.ravel() for index in np.indices(matrix.shape))
    values = matrix.ravel()
    figure = Figure(height_px=80 + 54 * n, rows=True, left_px=96, cursor=Cursor.NEAREST)
    figure.add(
        Bars(
            x=columns.astype(float), base=n - 0.97 - rows.astype(float), y=np.full(n * n, 0.94), width=0.96, color=GRID,
            value="",
            colors=[GRID if r == c else BLUE if v > 0 else RED for r, c, v in zip(rows, columns, values, strict=True)],
            opacities=[1.0 if r == c else round(abs(v) / 2, 3) for r, c, v in zip(rows, columns, values, strict=True)],
            texts=[f"{value:+.2f}".replace("-", "−") if abs(value) < 1 else "1" for value in values],
        )
    )  # fmt: skip
    figure.x = Axis(limits=(-0.5, n - 0.5), ticks=dict(enumerate(names)), grid=False)
    figure.y = Axis(limits=(0, n), ticks={n - 0.5 - i: name for i, name in enumerate(names)}, grid=False)
    return figure


def whole_flight(table: FlightTable, V_mps: Array) -> Figure:
    """Draw airspeed, height and electrical power of the whole log; the part used is shaded."""
    t_s = table.table.index.to_numpy()
    figure = over_time(
        [
            (t_s, V_mps, Axis("airspeed", "m/s")),
            (t_s, table.table["height_m"].to_numpy(), Axis("height", "m")),
            (t_s, table.table["power_W"].to_numpy(), Axis("power", "W")),
        ]
    )
    figure.shades = [Shade(float(t_s[part.start]), float(t_s[part.stop - 1]), BLUE, 0.12) for part in table.airborne]
    return figure


def residuals_of_balance(estimate: ElectricalEstimate) -> Figure:
    """Draw the energy balance's residuals over time."""
    figure = Figure(height_px=320, x=time_axis())
    figure.add(
        Line(
            x=estimate.time_s, y=estimate.residual_W, color=BLUE, symbol=None, label="residual", value="{y:.0f} W",
        )
    )  # fmt: skip
    figure.zero_lines.add(1)
    figure.y = Axis("residual", "W")
    return figure
