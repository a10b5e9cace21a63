"""A picture of a simulated flight's truth."""

from typing import Any

import numpy as np
import pandas as pd

# One panel a quantity: title, then the columns drawn in it with a factor to the unit a pilot would use.
PANELS: tuple[tuple[str, dict[str, float]], ...] = (
    ("speed [m/s]", {"V_mps": 1.0}),
    ("height [m]", {"height_m": 1.0}),
    ("angles [deg]", {"alpha_rad": 180 / np.pi, "pitch_rad": 180 / np.pi, "roll_rad": 180 / np.pi}),
    ("pitch rate [deg/s]", {"q_radps": 180 / np.pi}),
    ("controls [deg]", {"elevator_rad": 180 / np.pi, "aileron_rad": 180 / np.pi, "rudder_rad": 180 / np.pi}),
    ("motor [rev/s]", {"motor_speed_revps": 1.0}),
    ("forces [N]", {"thrust_N": 1.0, "drag_N": 1.0}),
)
MOST_POINTS = 4000


def figure(truth: pd.DataFrame, metadata: dict[str, Any]) -> Any:
    """A plotly figure with the panels above one another and the segments shaded; at most 4,000 points a line."""
    from plotly.subplots import make_subplots

    drawn = make_subplots(rows=len(PANELS), cols=1, shared_xaxes=True, subplot_titles=[title for title, _ in PANELS])
    every = truth.iloc[:: max(1, len(truth) // MOST_POINTS)]
    for row, (_, columns) in enumerate(PANELS, start=1):
        for name, factor in columns.items():
            drawn.add_scatter(x=every["time_s"], y=every[name] * factor, name=name.rpartition("_")[0], row=row, col=1)
    for i, (_, segment) in enumerate(truth.groupby("segment")):
        begin, end = segment["time_s"].iloc[[0, -1]]
        drawn.add_vrect(x0=begin, x1=end, fillcolor="gray", opacity=0.08 if i % 2 else 0.0, line_width=0)
        drawn.add_annotation(
            x=(begin + end) / 2, y=1.03, yref="paper", text=segment["kind"].iloc[0], showarrow=False, textangle=-45
        )
    title = f"{metadata.get('aircraft', '')}: {metadata.get('plan', '')}, seed {metadata.get('seed', '')}"
    drawn.update_layout(title=title, height=190 * len(PANELS), template="plotly_white", margin={"t": 140})
    drawn.update_xaxes(title_text="time [s]", row=len(PANELS), col=1)
    return drawn
