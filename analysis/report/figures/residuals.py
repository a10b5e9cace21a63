"""Figures of the residuals' autocorrelation, of air data against the path, and of the ground track."""

from collections.abc import Sequence

import numpy as np

from analysis.maneuvers.kinds import Maneuver
from analysis.report.figures.figure import Figure
from analysis.report.figures.flight import NOT_SHADED, TIME_TITLE
from analysis.report.figures.style import BLUE, GREY, INK, ORANGE, OTHER_RUN, RUN_COLOR, rounded, styled, thinned
from analysis.results.schema_provenance import AirFound, RunResidual, Track
from analysis.trajectory.reconstruction import Trajectory
from flight.motion import body_from_earth

NORMAL_95 = 1.96
ARROW_SHARE = 0.15  # length of the wind's arrow over the size of the track


def autocorrelation(residuals: Sequence[RunResidual]) -> Figure:
    """Autocorrelation of the residuals of drag, a line for each run, with the bounds of white noise."""
    figure = Figure()
    in_legend = set()
    for run in residuals:
        kind = run.run.partition(" at ")[0]
        lags = run.step_s * np.arange(len(run.autocorrelation), dtype=np.float64)
        figure.add_scatter(
            x=rounded(lags), y=rounded(np.array(run.autocorrelation)), mode="lines", name=kind, legendgroup=kind,
            line={"color": RUN_COLOR.get(kind, OTHER_RUN), "width": 1.8}, showlegend=kind not in in_legend,
            hovertemplate=f"{run.run}: %{{y:.2f}}<extra></extra>",
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


def air_and_path(trajectory: Trajectory) -> Figure:
    """Airspeed and angle of attack of the probe, and as the path and the mean wind give them."""
    blocks, x = trajectory.block_means, trajectory.states
    flying = np.where(blocks.flying, 1.0, np.nan)
    north, east, down, phi, theta, psi = (
        values.to_numpy()
        for values in (
            x["v_north"] - x["wind_north"], x["v_east"] - x["wind_east"], x["v_down"], x["phi"], x["theta"], x["psi"],
        )
    )  # fmt: skip
    u, _, w = (np.asarray(component) for component in body_from_earth(north, east, down, phi, theta, psi))
    speed = np.sqrt(north**2 + east**2 + down**2)
    figure = Figure(2, 0.06)
    rows = (
        (blocks["V_mps"], speed, "airspeed, m/s"),
        (np.degrees(blocks["alpha_rad"]), np.degrees(np.arctan2(w, u)), "α, deg"),
    )
    for panel, (probe, path, title) in enumerate(rows, start=1):
        for values, name, color, width in ((probe, "probe", GREY, 3.0), (path, "path and wind", BLUE, 1.5)):
            t, y = thinned(blocks.t_s, values * flying)
            figure.add_scatter(
                x=rounded(t), y=rounded(y), mode="lines", panel=panel, name=name, legendgroup=name,
                showlegend=panel == 1, line={"color": color, "width": width},
            )  # fmt: skip
        figure.update_yaxis(title=title, panel=panel)
    figure.update_xaxis(title=TIME_TITLE)
    return styled(figure, 520)


def ground_track(track: Track, runs: Sequence[Maneuver], air: AirFound | None) -> Figure:
    """The path over the ground with equal axes, runs coloured by kind, and the direction of the wind."""
    figure = Figure()
    t, north, east = np.array(track.t_s), np.array(track.north_m), np.array(track.east_m)
    figure.add_scatter(x=rounded(east), y=rounded(north), mode="lines", line={"color": GREY, "width": 1.2},
                       name="whole flight", hoverinfo="skip")  # fmt: skip
    in_legend = set()
    for run in runs:
        if run.kind in NOT_SHADED:
            continue
        rows = (t >= run.start_s) & (t <= run.end_s)
        figure.add_scatter(
            x=rounded(east[rows]), y=rounded(north[rows]), mode="lines", name=run.kind, legendgroup=run.kind,
            line={"color": RUN_COLOR.get(run.kind, OTHER_RUN), "width": 4}, showlegend=run.kind not in in_legend,
            hovertemplate=f"{run.name}<extra></extra>",
        )  # fmt: skip
        in_legend.add(run.kind)
    figure.add_scatter(x=[east[0]], y=[north[0]], mode="markers", name="start", hoverinfo="skip",
                       marker={"symbol": "star", "size": 14, "color": INK})  # fmt: skip
    if air is not None:
        length = ARROW_SHARE * max(float(np.ptp(north)), float(np.ptp(east)), 1.0)
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
