"""Figures of a flight and its estimation: over time, over the ground, the fit of each run, residuals, convergence."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from analysis.estimation.fit import Convergence
from analysis.estimation.noise import NORMAL_95
from analysis.maneuvers.kinds import STEADY, Maneuver
from analysis.methods.dynamic import DRAG_TITLE, SPEED_TITLE, RunFit
from analysis.pages.charts.style import (
    BLUE,
    GRAY,
    GRID,
    INK,
    ORANGE,
    OTHER_RUN,
    PAPER,
    RED,
    RUN_COLOR,
    Figure,
    rounded,
    styled,
    thinned,
    translucent,
)
from analysis.records.flight import AirFound, Correlation, RejectedResult, RunResidual, Track
from analysis.trajectory.consistency import ANGLES, SPEED, Consistency
from analysis.trajectory.reconstruction import Trajectory
from flight.arrays import Array
from flight.motion import body_from_earth

NOT_SHADED = ("standing", "flying")
TIME_TITLE = "time since the start of the log, s"
ROWS = (("V_mps", "speed, m/s"), ("height_m", "height, m"), ("n_revps", "motor, rpm"))


def timeline(table: pd.DataFrame, runs: Sequence[Maneuver], rejected: Sequence[RejectedResult] = ()) -> Figure:
    """Speed, height and motor speed of the whole flight; runs shaded by kind, rejected stretches outlined in gray."""
    figure = Figure(len(ROWS))
    t_s = table.index.to_numpy()
    for i, (column, title) in enumerate(ROWS, start=1):
        x, y = thinned(t_s, table[column].to_numpy() * (60 if column == "n_revps" else 1))
        figure.add_scatter(
            x=rounded(x), y=rounded(y), panel=i, mode="lines", line={"color": INK, "width": 1.8}, showlegend=False,
            name=title,
        )  # fmt: skip
        figure.update_yaxis(title=title, panel=i)
    shaded = [run for run in runs if run.kind not in NOT_SHADED]
    figure.update_layout(shapes=_shades(shaded, rejected))
    in_legend = {run.kind: RUN_COLOR.get(run.kind, OTHER_RUN) for run in shaded}
    if rejected:
        in_legend["rejected"] = GRAY
    for kind, color in in_legend.items():
        marker = {"color": color, "size": 14, "symbol": "square", "opacity": 0.6}
        figure.add_scatter(x=[None], y=[None], mode="markers", marker=marker, name=kind)
    figure.update_xaxis(title=TIME_TITLE)
    return styled(figure, 620)


def _shades(runs: Sequence[Maneuver], rejected: Sequence[RejectedResult]) -> list[dict[str, object]]:
    """Rectangles across all panels."""
    stretches: list[dict[str, object]] = [
        {"name": run.name, "x0": run.start_s, "x1": run.end_s, "fillcolor": RUN_COLOR.get(run.kind, OTHER_RUN),
         "opacity": 0.22 if run.kind == STEADY else 0.16, "line": {"width": 0}}
        for run in runs
    ] + [
        {"x0": stretch.start_s, "x1": stretch.end_s, "fillcolor": "rgba(0, 0, 0, 0.04)",
         "line": {"color": GRAY, "width": 1.5, "dash": "dot"}}
        for stretch in rejected
    ]  # fmt: skip
    place: dict[str, object] = {"type": "rect", "xref": "x", "yref": "paper", "y0": 0, "y1": 1}
    return [place | stretch for stretch in stretches]


def consistency(agreement: Consistency, overlaid: int = 600) -> Figure:
    """Differences between sensors that should be zero, before and after the correction of sensor errors and gusts.

    overlaid : points of each line, over which another lies
    """
    degrees = float(np.degrees(1.0))
    rows = ((ANGLES, "θ - α - γ, deg", degrees), (SPEED, "V - GPS, m/s", 1.0))
    figure = Figure(len(rows), 0.06)
    for i, (column, title, factor) in enumerate(rows, start=1):
        for name, differences, color in zip(("before", "after"), agreement, (GRAY, BLUE), strict=True):
            x, y = thinned(differences.index.to_numpy(), factor * differences[column].to_numpy(), overlaid)
            figure.add_scatter(
                x=rounded(x), y=rounded(y), mode="lines", panel=i, name=name, legendgroup=name, showlegend=i == 1,
                line={"color": color, "width": 1.8},
            )  # fmt: skip
        figure.add_zero_line({"color": INK, "width": 1}, panel=i)
        figure.update_yaxis(title=title, panel=i)
    figure.update_xaxis(title=TIME_TITLE)
    return styled(figure, 520)


def run_fit(run: str, t_s: Array, measured: dict[str, Array], modeled: dict[str, Array]) -> list[Figure]:
    """One run: measurement and fitted model, and their difference beside them."""
    both, differences = Figure(len(measured), 0.04), Figure(len(measured), 0.04)
    point, model = {"size": 6, "color": GRAY}, {"color": ORANGE, "width": 3}
    for i, quantity in enumerate(measured, start=1):
        difference = measured[quantity] - modeled[quantity]
        for figure, values, digits in ((both, measured[quantity], 4), (differences, difference, 3)):
            figure.add_scatter(
                x=rounded(t_s, 4), y=rounded(values, digits), mode="markers", panel=i, marker=point, name="measured",
                legendgroup="measured", showlegend=i == 1 and figure is both, meta={"run": run},
            )  # fmt: skip
        both.add_scatter(
            x=rounded(t_s, 4), y=rounded(modeled[quantity], 4), mode="lines", panel=i, line=model, name="model",
            showlegend=i == 1,
        )  # fmt: skip
        differences.add_zero_line(model, panel=i)
        both.update_yaxis(title=quantity, panel=i)
        differences.update_yaxis(title="difference", panel=i)
    for figure in (both, differences):
        figure.update_xaxis(title=f"time, s ({run})" if figure is both else "time, s")
        styled(figure, 150 * len(measured) + 80)
        figure.update_layout(font={"size": 15})
    differences.update_layout(showlegend=False)
    return [both, differences]


def residuals_of_drag(fits: Sequence[RunFit], kinds: Mapping[str, str], averaged_s: float = 1.0) -> Figure:
    """Drag measured along each run, against airspeed, in percent of that of the common polar; means of about
    `averaged_s`. kinds : of the runs, by name"""
    figure = Figure()
    in_legend = set()
    for fit in fits:
        averaged = max(1, round(averaged_s / float(np.median(np.diff(fit.t_s)))))
        usable = np.arange(len(fit.t_s) // averaged * averaged).reshape(-1, averaged)
        V, measured, modeled = (
            values[usable].mean(axis=1) for values in (fit.modeled[SPEED_TITLE], fit.measured[DRAG_TITLE],
                                                       fit.modeled[DRAG_TITLE])
        )  # fmt: skip
        kind = kinds.get(fit.run, fit.run)
        figure.add_scatter(
            x=rounded(V), y=rounded(100 * (measured / modeled - 1)), mode="lines+markers", name=kind, legendgroup=kind,
            line={"color": RUN_COLOR.get(kind, OTHER_RUN), "width": 1}, marker={"size": 6},
            showlegend=kind not in in_legend, hovertemplate=f"{fit.run}: %{{y:+.1f}} %<extra></extra>",
            meta={"run": fit.run},
        )  # fmt: skip
        in_legend.add(kind)
    figure.add_zero_line({"color": INK, "width": 2})
    figure.update_xaxis(title="true airspeed, m/s")
    figure.update_yaxis(title="drag less the model's, %")
    return styled(figure, 400, hover="closest")


def autocorrelation(residuals: Sequence[RunResidual]) -> Figure:
    """Autocorrelation of the residuals of drag, a line for each run, with the bounds of white noise."""
    figure = Figure()
    in_legend = set()
    for run in residuals:
        kind = run.kind
        lags = run.step_s * np.arange(len(run.autocorrelation), dtype=np.float64)
        figure.add_scatter(
            x=rounded(lags), y=rounded(np.array(run.autocorrelation)), mode="lines", name=kind, legendgroup=kind,
            line={"color": RUN_COLOR.get(kind, OTHER_RUN), "width": 1.8}, showlegend=kind not in in_legend,
            hovertemplate=f"{run.run}: %{{y:.2f}}<extra></extra>", meta={"run": run.run},
        )  # fmt: skip
        in_legend.add(kind)
    longest = max((run.step_s * (len(run.autocorrelation) - 1) for run in residuals), default=1.0)
    bound = NORMAL_95 / float(np.sqrt(np.median([run.points for run in residuals])))
    for sign in (-1, 1):
        figure.add_scatter(
            x=[0, longest], y=[sign * bound] * 2, mode="lines", line={"color": INK, "width": 2, "dash": "dash"},
            name="95 % bound of white noise", showlegend=sign > 0, hoverinfo="skip",
        )  # fmt: skip
    figure.update_xaxis(title="lag, s")
    figure.update_yaxis(title="autocorrelation", range=[-1.05, 1.05])
    return styled(figure, 380, hover="closest")


def air_and_path(trajectory: Trajectory, overlaid: int = 600) -> Figure:
    """Airspeed and angle of attack of the probe, and as the path and the mean wind give them. overlaid : as above"""
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
    figure = Figure(2, 0.06)
    rows = (
        (blocks["V_mps"], speed, "airspeed, m/s"),
        (np.degrees(blocks["alpha_rad"]), np.degrees(np.arctan2(w, u)), "α, deg"),
    )
    for panel, (probe, path, title) in enumerate(rows, start=1):
        for values, name, color, width in ((probe, "probe", GRAY, 3.0), (path, "path and wind", BLUE, 1.5)):
            t, y = thinned(blocks.t_s, values * flying, overlaid)
            figure.add_scatter(
                x=rounded(t), y=rounded(y), mode="lines", panel=panel, name=name, legendgroup=name,
                showlegend=panel == 1, line={"color": color, "width": width},
            )  # fmt: skip
        figure.update_yaxis(title=title, panel=panel)
    figure.update_xaxis(title=TIME_TITLE)
    return styled(figure, 520)


def ground_track(track: Track, runs: Sequence[Maneuver], air: AirFound | None) -> Figure:
    """The path over the ground with equal axes, runs colored by kind, and the direction of the wind."""
    figure = Figure()
    t, north, east = np.array(track.t_s), np.array(track.north_m), np.array(track.east_m)
    figure.add_scatter(x=rounded(east, 4), y=rounded(north, 4), mode="lines", line={"color": GRAY, "width": 1.2},
                       name="whole flight", hoverinfo="skip")  # fmt: skip
    in_legend = set()
    for run in runs:
        if run.kind in NOT_SHADED:
            continue
        rows = (t >= run.start_s) & (t <= run.end_s)
        figure.add_scatter(
            x=rounded(east[rows]), y=rounded(north[rows]), mode="lines", name=run.kind, legendgroup=run.kind,
            line={"color": RUN_COLOR.get(run.kind, OTHER_RUN), "width": 4}, showlegend=run.kind not in in_legend,
            hovertemplate=f"{run.name}<extra></extra>", meta={"run": run.name},
        )  # fmt: skip
        in_legend.add(run.kind)
    figure.add_scatter(x=[east[0]], y=[north[0]], mode="markers", name="start", hoverinfo="skip",
                       marker={"symbol": "star", "size": 14, "color": INK})  # fmt: skip
    if air is not None:
        length = 0.15 * max(float(np.ptp(north)), float(np.ptp(east)), 1.0)
        toward = np.radians(air.wind_from_deg + 180)
        tail = (float(east.min()), float(north.max()))
        figure.add_scatter(
            x=rounded(np.array([tail[0], tail[0] + length * np.sin(toward)])),
            y=rounded(np.array([tail[1], tail[1] + length * np.cos(toward)])),
            mode="lines+markers", line={"color": ORANGE, "width": 3}, hoverinfo="skip",
            marker={"symbol": "arrow", "size": [0, 16], "angleref": "previous", "color": ORANGE},
            name=f"wind, {air.wind_mps:.1f} m/s",
        )  # fmt: skip
    figure.update_xaxis(title="east, m", constrain="domain")
    figure.update_yaxis(title="north, m", scaleanchor="x")
    return styled(figure, 560, hover="closest")


LINES = ((BLUE, "circle"), (ORANGE, "square"))


def convergence(histories: Mapping[str, Convergence]) -> Figure:
    """Cost above its last value, and length of the step, over the iterations of each estimation (at most two)."""
    figure = Figure(2, 0.08)
    for (name, history), (color, symbol) in zip(histories.items(), LINES, strict=False):
        costs = np.array(history.costs)
        for panel, first, values in ((1, 0, costs[:-1] - costs[-1]), (2, 1, np.array(history.steps))):
            figure.add_scatter(
                x=np.arange(first, first + len(values)), y=_for_logarithm(values), mode="lines+markers", panel=panel,
                name=name, legendgroup=name, showlegend=panel == 1, line={"color": color, "width": 2},
                marker={"symbol": symbol, "size": 8},
            )  # fmt: skip
    longest = max(len(history.steps) for history in histories.values())
    figure = styled(figure, 500)
    figure.update_yaxis(title="cost above the last")
    figure.update_yaxis(title="step, std. errors", panel=2)
    figure.update_yaxes(type="log", exponentformat="e", nticks=5)
    figure.update_xaxis(title="iteration", dtick=-(-longest // 7), range=[-0.4, longest + 0.4])
    return figure


def _for_logarithm(values: Array) -> Array:
    """Values to four significant digits; NaN where they are not positive."""
    return np.array([float(f"{value:.4g}") if value > 0 else np.nan for value in values])


def correlation(correlation: Correlation) -> Figure:
    """The matrix as colored cells with their values: blue where two errors have the same sign, red where not."""
    names = [name.replace("_", "<br>") for name in correlation.names]
    n, matrix = len(names), np.array(correlation.matrix)
    rows, columns = (index.ravel() for index in np.indices(matrix.shape))
    colors = [
        GRID if row == column else translucent(BLUE if value > 0 else RED, round(abs(value) / 2, 3))
        for row, column, value in zip(rows, columns, matrix.ravel(), strict=True)
    ]
    written = [f"{value:+.2f}".replace("-", "−") if abs(value) < 1 else "1" for value in matrix.ravel()]
    figure = Figure()
    figure.add_bars(
        x=columns, base=n - 1 - rows, y=np.ones(n * n), width=1, showlegend=False, hoverinfo="skip",
        marker={"color": colors, "line": {"color": PAPER, "width": 3}}, textposition="inside", textangle=0,
        insidetextanchor="middle", text=written, insidetextfont={"color": INK},
    )  # fmt: skip
    figure = styled(figure, 80 + 54 * n, hover="closest")
    axis: dict[str, Any] = {"showgrid": False, "ticks": "", "showline": False, "tickmode": "array", "fixedrange": True}
    figure.update_xaxis(tickvals=np.arange(n), ticktext=names, tickangle=0, range=[-0.5, n - 0.5], **axis)
    figure.update_yaxis(tickvals=np.arange(n) + 0.5, ticktext=names[::-1], range=[0, n], **axis)
    figure.update_layout(barmode="overlay")
    return figure
