"""The drawings of the page: time histories of the flight, its track from above, and its curve."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd

from flightpower.analysis.methods.whole_flight.curve import ElectricalEstimate
from flightpower.analysis.pages.charts.figure import Axis, Bars, Figure, Line, Points, Symbol
from flightpower.analysis.pages.charts.flight import OnMap, ground_track, over_time, time_axis, wind_arrow
from flightpower.analysis.pages.charts.style import (
    BLUE,
    GRAY,
    INK,
    PALETTE,
    band,
    curve_arrays,
    curve_lines,
    round_length,
    true_airspeed,
)
from flightpower.analysis.pages.charts.svg import chart
from flightpower.analysis.pages.open.request import LIMITS
from flightpower.analysis.records.flight import Kind, PowerPoint, Track
from flightpower.analysis.sources import recording
from flightpower.analysis.sources.recording import Channel, Event, EventKind, FlightRecording
from flightpower.flight.arrays import Array
from flightpower.flight.atmosphere import height_at
from flightpower.flight.units import SEA_LEVEL_DENSITY

Row = tuple[Array, Array, Axis]


class Stretch(NamedTuple):
    """A stretch of the flight that is colored by its kind on the map."""

    kind: str
    start_s: float
    end_s: float

    @property
    def name(self) -> str:
        return self.kind


def strips(rows: Sequence[Row], channels: Mapping[str, Channel], events: Sequence[Event], end_s: float) -> str:
    """Draw stacked time histories, then the named channels; modes and messages at the bottom."""
    rows = [row for row in rows if np.isfinite(row[1]).any()]
    rows += [(channel.t_s, channel.value, Axis(name)) for name, channel in channels.items()]
    rows = [_between(row, end_s) for row in rows]
    with_samples = [row for row in rows if len(row[0])]
    panels = len(with_samples) + bool(events)
    if not panels:
        return ""
    figure = over_time(with_samples, LIMITS.points)
    figure.panels, figure.height_px = panels, LIMITS.strip_px * panels + 60
    figure.x = Axis(time_axis().name, time_axis().unit, limits=(0.0, end_s))
    if events:
        figure.ys.append(Axis("modes", limits=(0.0, 1.0), ticks={}, grid=False))
        figure.add(*_modes(events, panels, end_s), *_messages(events, panels, end_s))
    return chart(figure, "strips", "The flight over time, with modes and messages")


def _between(row: Row, end_s: float) -> Row:
    t_s, values, axis = row
    inside = (t_s >= 0) & (t_s <= end_s)
    return t_s[inside], values[inside], axis


def _modes(events: Sequence[Event], panel: int, end_s: float) -> list[Bars]:
    """Return a bar for each stretch in a mode, with a color for each mode, and its name if there is room."""
    switched = [event for event in events if event.kind is EventKind.MODE]
    starts = np.clip([event.t_s for event in switched], 0.0, end_s)
    lengths = np.diff(np.append(starts, end_s))
    names = list(dict.fromkeys(event.text for event in switched))
    bars = []
    for i, name in enumerate(names):
        in_mode = np.array([event.text == name for event in switched]) & (lengths > 0)
        room = len(name) / LIMITS.letters * end_s
        bars.append(
            Bars(
                x=lengths[in_mode], base=starts[in_mode], y=np.full(int(in_mode.sum()), 0.35), width=0.6, lying=True,
                panel=panel, color=PALETTE[i % len(PALETTE)], opacities=[0.3] * int(in_mode.sum()), label=name,
                value="for {x:.0f} s",
                texts=[name if length > room else "" for length in lengths[in_mode]],
            )
        )  # fmt: skip
    return bars


def _messages(events: Sequence[Event], panel: int, end_s: float) -> list[Points]:
    """Return a mark for each message; its text is shown where the cursor is over it."""
    return [
        Points(
            x=np.array([min(max(event.t_s, 0.0), end_s)]), y=np.array([0.85]), panel=panel, color=INK, size=9,
            symbol=Symbol.DOWN, label=event.text, value="{x:.1f} s",
        )
        for event in [event for event in events if event.kind is EventKind.MESSAGE][: LIMITS.entries]
    ]  # fmt: skip


def rows_of_runs(table: pd.DataFrame) -> list[Row]:
    """Return air data, motor and attitude from a table of `air_data`."""
    t_s = table.index.to_numpy()
    rows = (
        (table["V_mps"], Axis("speed", "m/s")),
        (table["height_m"], Axis("height", "m")),
        (60 * table["n_revps"], Axis("motor", "rpm")),
        (100 * table["throttle"], Axis("throttle", "%")),
        (np.degrees(table["alpha_rad"]), Axis("angle of attack", "deg")),
        (np.degrees(table["bank_rad"]), Axis("bank", "deg")),
    )
    return [(t_s, column.to_numpy(), axis) for column, axis in rows]


def rows_of_recording(flight: FlightRecording, start_s: float) -> list[Row]:
    """Return logged input of an energy balance: indicated airspeed, ground speed, height, power, throttle, motor."""
    channels = flight.channels
    rows: list[tuple[Channel, Axis]] = []
    if (pitot := channels.get(recording.AIRSPEED_PRESSURE)) is not None:
        speed = np.sign(pitot.value) * np.sqrt(2 * np.abs(pitot.value) / SEA_LEVEL_DENSITY)
        rows.append((Channel(pitot.t_s, speed), Axis("indicated airspeed", "m/s")))
    if channels.keys() >= set(recording.GPS):
        north, east = channels[recording.GPS[0]], channels[recording.GPS[1]]
        over_ground = np.hypot(north.value, east.at(north.t_s))
        rows.append((Channel(north.t_s, over_ground), Axis("speed over ground", "m/s")))
    if (static := channels.get(recording.STATIC)) is not None:
        lowest_Pa = float(np.percentile(static.value, 99))
        height_m = np.asarray(height_at(static.value, ground_pressure_Pa=lowest_Pa, ground_temperature_K=288.15))
        rows.append((Channel(static.t_s, height_m), Axis("height", "m")))
    if channels.keys() >= {recording.VOLTAGE, recording.CURRENT}:
        current = channels[recording.CURRENT]
        power_W = current.value * channels[recording.VOLTAGE].at(current.t_s)
        rows.append((Channel(current.t_s, power_W), Axis("electrical power", "W")))
    for name, factor, axis in (
        (recording.THROTTLE, 100, Axis("throttle", "%")),
        (recording.MOTOR, 60, Axis("motor", "rpm")),
    ):
        if name in channels:
            rows.append((Channel(channels[name].t_s, factor * channels[name].value), axis))
    return [(channel.t_s - start_s, channel.value, axis) for channel, axis in rows]


def track_of(flight: FlightRecording, start_s: float, end_s: float) -> Track | None:
    """Return the ground track, once a second, from the receiver's positions or else the integral of its velocity."""
    t_s = np.arange(0.0, end_s, 1.0)
    if flight.place:
        north, east = (flight.place[name].at(t_s + start_s) for name in recording.PLACE)
    elif flight.channels.keys() >= set(recording.GPS):
        north, east = (
            np.append(0.0, np.cumsum(flight.channels[name].at(t_s + start_s)))[:-1] for name in recording.GPS[:2]
        )
    else:
        return None
    return Track(t_s=t_s.tolist(), north_m=np.round(north, 1).tolist(), east_m=np.round(east, 1).tolist())


def map_chart(track: Track, stretches: Sequence[OnMap], wind: tuple[float | None, float | None]) -> str:
    """Draw the path with its stretches, north up, with scale and arrow. wind : speed [m/s], direction from [deg]"""
    figure = ground_track(track, stretches, None)
    north, east = np.array(track.north_m), np.array(track.east_m)
    reach = max(float(np.ptp(north)), float(np.ptp(east)), 1.0)
    length = round_length(reach / 3)
    left, below = float(east.min()), float(north.min()) - 0.08 * reach
    figure.add(
        Line(x=np.array([left, left + length]), y=np.full(2, below), color=INK, width=5, name=f"{length:g} m", value="")
    )
    right = float(east.max())
    tip = np.array([float(north.max()) - 0.15 * reach, float(north.max())])
    figure.add(Line(x=np.full(2, right), y=tip, color=INK, width=3, arrow=True, name="north", value=""))
    speed_mps, from_deg = wind
    if speed_mps is not None and from_deg is not None:
        figure.add(wind_arrow(track, speed_mps, from_deg))
    return chart(figure, "track", "The path over the ground, north up")


def curve_chart(kind: Kind, points: list[PowerPoint], estimate: ElectricalEstimate | None = None) -> str:
    """Draw the curve with its interval, and for electrical power the measurements; the page adds further curves."""
    V, _, lo, hi = curve_arrays(points)
    figure = Figure(height_px=380, x=true_airspeed())
    figure.y = Axis(kind.words, "W", limits=(0, 1.08 * float(np.max(hi))))
    figure.add(band(V, (lo, hi), BLUE, 0.3, name=kind.words))
    if estimate is not None:
        figure.add(
            Points(
                x=estimate.measured_V_mps, y=estimate.measured_W, color=GRAY, size=6, opacity=0.6, value="{y:.0f} W",
                name="the flight, reduced to level flight",
            )
        )  # fmt: skip
    figure.add(*curve_lines(points, kind.words, BLUE, width=4))
    return chart(figure, "curve", f"{kind.words.capitalize()} against airspeed, with its 95 % interval")
