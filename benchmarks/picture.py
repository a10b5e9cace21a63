"""Takes the README's picture in Chromium: the demonstration's curve with the simulator's truth drawn over it.

.venv/bin/python benchmarks/picture.py out/demo docs/power-required.png
"""

from pathlib import Path
from typing import Annotated, Any

import msgspec
import pandas as pd
import plotly.graph_objects as go
import typer
from simulation_figures import picture

from flightpower.analysis.pages.charts.power import power_required
from flightpower.analysis.pages.charts.style import ORANGE
from flightpower.analysis.records.flight import Results
from flightpower.sim.output_folder import CURVE, LOG

WIDTH, HEIGHT = 1200, 600


def main(
    flight: Annotated[Path, typer.Argument(help="Folder of a simulated flight that was analyzed.")],
    output: Annotated[Path, typer.Argument(help="PNG file to write.")],
) -> None:
    report = (flight / LOG).with_suffix(".report")
    results = msgspec.json.decode((report / "results.json").read_bytes(), type=Results)
    picture(chart_of(results, pd.read_csv(flight / CURVE)), output)


def chart_of(results: Results, truth: pd.DataFrame) -> Any:
    """Return the report's figure with the true curve over the speeds shown."""
    content = power_required(results)
    figure = go.Figure(content.data, content.layout)
    band, *curves = figure.data
    band.update(name="95 % interval", showlegend=True)
    for number, trace in enumerate(trace for trace in curves if trace.line.dash == "dash"):
        trace.update(name="not flown", showlegend=number == 0)
    speeds = [float(V) for trace in curves for V in trace.x]
    truth = truth[truth["speed_mps"].between(min(speeds), max(speeds))]
    figure.add_scatter(
        x=truth["speed_mps"], y=truth["power_W"], mode="lines", name="truth (simulator)",
        line={"color": ORANGE, "width": 3, "dash": "dot"},
    )  # fmt: skip
    title = f"{results.aircraft.title}: power required, from one simulated flight of two and a half minutes"
    figure.update_layout(
        width=WIDTH, height=HEIGHT, margin={"t": 130}, title={"text": title, "x": 0.02, "y": 0.96, "font": {"size": 22}}
    )
    return figure


if __name__ == "__main__":
    typer.run(main)
