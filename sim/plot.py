"""Plots the true values of a simulated flight."""

from typing import Any

import numpy as np
import pandas as pd

DEG = 180 / np.pi
COLORS = ("#1f5fa8", "#c0392b", "#2e8b57")
# One panel per quantity: the axis title, then its columns with name and factor to the unit.
PANELS: tuple[tuple[str, dict[str, tuple[str, float]]], ...] = (
    ("speed<br>[m/s]", {"V_mps": ("airspeed", 1.0)}),
    ("height<br>[m]", {"height_m": ("height", 1.0)}),
    ("angles<br>[deg]", {"alpha_rad": ("alpha", DEG), "pitch_rad": ("pitch", DEG), "roll_rad": ("roll", DEG)}),
    ("pitch rate<br>[deg/s]", {"q_radps": ("q", DEG)}),
    (
        "surfaces<br>[deg]",
        {"elevator_rad": ("elevator", DEG), "aileron_rad": ("aileron", DEG), "rudder_rad": ("rudder", DEG)},
    ),
    ("motor<br>[rev/s]", {"motor_speed_revps": ("motor", 1.0)}),
    ("force<br>[N]", {"thrust_N": ("thrust", 1.0), "drag_N": ("drag", 1.0)}),
    ("power<br>[W]", {"shaft_power_W": ("shaft", 1.0), "battery_W": ("battery", 1.0)}),
)
ONLY_IN_FLIGHT = ("alpha_rad",)  # meaningless on the ground
MOST_POINTS = 4000
PANEL_HEIGHT = 150


def figure(truth: pd.DataFrame, metadata: dict[str, Any]) -> Any:
    """A plotly figure with the panels above one another and the segments shaded; at most 4,000 points a line."""
    from plotly.subplots import make_subplots

    gap = 0.02
    chart = make_subplots(rows=len(PANELS), cols=1, shared_xaxes=True, vertical_spacing=gap)
    table = truth.assign(battery_W=truth["battery_voltage_V"] * truth["battery_current_A"])
    for name in ONLY_IN_FLIGHT:
        table[name] = table[name].where(table["phase"] == "flight")
    every = table.iloc[:: max(1, len(table) // MOST_POINTS)]
    for row, (title, columns) in enumerate(PANELS, start=1):
        legend = "legend" if row == 1 else f"legend{row}"
        for color, (column, (name, factor)) in zip(COLORS, columns.items(), strict=False):
            line = {"color": color, "width": 1.5}
            chart.add_scatter(
                x=every["time_s"], y=every[column] * factor, name=name, line=line, legend=legend, row=row, col=1
            )
        top = chart.layout[f"yaxis{row if row > 1 else ''}"].domain[1]
        chart.update_layout({legend: {"y": top, "yanchor": "top", "x": 1.01}})
        chart.update_yaxes(title_text=title, row=row, col=1)
    for i, (_, segment) in enumerate(table.groupby("segment")):
        begin, end = segment["time_s"].iloc[[0, -1]]
        chart.add_vrect(x0=begin, x1=end, fillcolor="gray", opacity=0.08 if i % 2 else 0.0, line_width=0)
        chart.add_annotation(
            x=(begin + end) / 2,
            y=1.0,
            yref="paper",
            yanchor="bottom",
            text=segment["kind"].iloc[0],
            showarrow=False,
            textangle=-90,
            font={"size": 10},
        )
    title = f"{metadata.get('aircraft', '')}: {metadata.get('plan', '')}, seed {metadata.get('seed', '')}"
    height = PANEL_HEIGHT * len(PANELS) + 180
    chart.update_layout(title=title, height=height, template="plotly_white", margin={"t": 130, "b": 50})
    chart.update_xaxes(title_text="time [s]", row=len(PANELS), col=1)
    return chart
