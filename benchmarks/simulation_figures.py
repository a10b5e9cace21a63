"""Makes the figures of simulation.md: flies shipped plans and draws with plotly; headless Chromium takes pictures.

.venv/bin/python benchmarks/simulation_figures.py
"""

import shutil
import subprocess
import sys
import tempfile
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from flightpower.flight.complete_aircraft import load_complete_aircraft
from flightpower.flight.errors import InputError
from flightpower.sim.fly import fly
from flightpower.sim.plan import load_plan
from flightpower.sim.sensors import load_budget

FOLDER = Path(__file__).parents[1] / "docs" / "figures"
WIDTH, HEIGHT = 900, 560
COLORS = ("#1f5fa8", "#c0392b", "#2e8b57", "#8e44ad")
DEG = 180 / np.pi


@lru_cache
def truth_of(plan: str, aircraft: str = "nexstar") -> pd.DataFrame:
    return fly(load_complete_aircraft(aircraft), load_plan(plan)).truth


def runs(plan: str, aircraft: str = "nexstar", kind: str = "run") -> list[pd.DataFrame]:
    """Return the plan's runs in the order flown, each with its own time from zero."""
    runs = []
    for _, rows in truth_of(plan, aircraft).groupby("segment"):
        if rows["kind"].iloc[0] == kind:
            runs.append(rows.assign(t_s=rows["time_s"] - rows["time_s"].iloc[0]))
    return runs


def panels(titles: list[str], columns: int = 1) -> Any:
    from plotly.subplots import make_subplots

    rows = -(-len(titles) // columns)
    figure = make_subplots(rows=rows, cols=columns, subplot_titles=titles, vertical_spacing=0.13, shared_xaxes=True)
    figure.update_layout(
        template="plotly_white", width=WIDTH, height=HEIGHT, margin={"l": 60, "r": 20, "t": 40, "b": 50}
    )
    figure.update_layout(font={"size": 14}, legend={"orientation": "h", "y": -0.12})
    for column in range(1, columns + 1):
        figure.update_xaxes(title_text="time since the run began [s]", row=rows, col=column)
    return figure


def line(
    figure: Any, run: pd.DataFrame, y: Any, color: str, place: tuple[int, int], *, name: str | None = None
) -> None:
    """Draw a line in the panel (row, column); with a name it is in the legend."""
    row, column = place
    style = {"color": color, "width": 2}
    figure.add_scatter(x=run["t_s"], y=y, name=name, line=style, showlegend=name is not None, row=row, col=column)


def deceleration() -> Any:
    """Draw a gentle deceleration of the source's aircraft, next to its acceleration."""
    figure = panels(
        ["acceleration: speed [m/s]", "deceleration: speed [m/s]", "pitch [deg]", "pitch [deg]"]
        + ["pitch rate [deg/s]"] * 2,
        2,
    )
    for column, run in enumerate(runs("long-deceleration", "astraeus-hs"), start=1):
        color = COLORS[column]
        line(figure, run, run["V_mps"], color, (1, column))
        line(figure, run, run["pitch_rad"] * DEG, color, (2, column))
        line(figure, run, run["q_radps"] * DEG, color, (3, column))
    return figure


def throttle_step() -> Any:
    """Draw the first seconds of the same acceleration, with a throttle step and a throttle ramp."""
    figure = panels(["throttle", "pitch rate [deg/s]", "pitch [deg]"])
    for run, name, color in zip(runs("throttle-step"), ("step", "ramp of 2 s"), COLORS, strict=False):
        first = run[run["t_s"] < 4]
        line(figure, first, first["throttle"], color, (1, 1), name=name)
        line(figure, first, first["q_radps"] * DEG, color, (2, 1))
        line(figure, first, first["pitch_rad"] * DEG, color, (3, 1))
    return figure


def cases() -> Any:
    """Draw cases 1 and 2: height and speed in accelerations and decelerations."""
    figure = panels(
        ["acceleration: height gained [m]", "deceleration: height gained [m]", "speed [m/s]", "speed [m/s]"], 2
    )
    plans = {
        "case-1": "held",
        "case-2-returns": "returns",
        "case-2-higher": "ends higher",
        "case-2-lower": "ends lower",
    }
    for color, (plan, name) in zip(COLORS, plans.items(), strict=True):
        for column, run in enumerate(runs(plan), start=1):
            gained = run["height_m"] - run["height_m"].iloc[0]
            line(figure, run, gained, color, (1, column), name=name if column == 1 else None)
            line(figure, run, run["V_mps"], color, (2, column))
    return figure


def signal_to_noise() -> dict[str, list[float]]:
    """Draw case 3: variance of q over variance of its noise (4.6, 4.7), for noise times 0.5, 1 and 1.5."""
    sigma = load_budget("bench").noise.gyro_radps
    first, _, third = runs("case-3")
    elevator = runs("case-3", kind="3-2-1-1")[0]
    elevator = elevator[elevator["t_s"] < 7 * 0.3 + 4.0]  # leaves out the recovery
    maneuvers = {
        "throttle ramp, height held": first,
        "throttle step, height wanders": third,
        "3-2-1-1 elevator": elevator,
    }
    return {
        name: [float(run["q_radps"].var()) / (factor * sigma) ** 2 for factor in (0.5, 1.0, 1.5)]
        for name, run in maneuvers.items()
    }


def case_3() -> Any:
    import plotly.graph_objects as go

    figure = go.Figure()
    ratios = signal_to_noise()
    for i, (color, label) in enumerate(zip(COLORS, ("noise x 0.5", "x 1", "x 1.5"), strict=False)):
        values = [snr[i] for snr in ratios.values()]
        figure.add_bar(
            x=list(ratios),
            y=values,
            name=label,
            marker_color=color,
            text=[f"{v:.0f}" for v in values],
            textposition="outside",
        )
    figure.update_layout(template="plotly_white", width=WIDTH, height=420, font={"size": 14})
    figure.update_layout(legend={"orientation": "h"}, margin={"l": 70, "r": 20, "t": 20, "b": 60})
    figure.update_yaxes(type="log", dtick=1, title_text="variance of q / of its noise", range=[0, 4.2])
    return figure


FIGURES = {"deceleration": deceleration, "throttle-step": throttle_step, "cases-1-2": cases, "case-3": case_3}


def picture(figure: Any, path: Path) -> None:
    """Save a figure as PNG. Raises InputError if there is no Chromium."""
    browser = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if browser is None:
        raise InputError("the figures need Chromium to take their picture; on Debian: apt-get install chromium")
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "figure.html"
        figure.write_html(page, include_plotlyjs=True, config={"staticPlot": True})
        page.write_text(page.read_text("utf-8").replace("<body>", '<body style="margin:0">'), "utf-8")
        size = f"--window-size={figure.layout.width},{figure.layout.height}"
        command = [browser, "--headless", "--no-sandbox", "--disable-gpu", "--hide-scrollbars", size]
        command += [
            "--disable-background-networking",
            "--virtual-time-budget=5000",
            f"--user-data-dir={folder}/profile",
        ]
        subprocess.run([*command, f"--screenshot={path}", page.as_uri()], check=True, capture_output=True)


def main() -> None:
    """Draw all figures, or those named on the command line."""
    FOLDER.mkdir(parents=True, exist_ok=True)
    for name in sys.argv[1:] or FIGURES:
        path = FOLDER / f"{name}.png"
        picture(FIGURES[name](), path)
        print(f"{path}: {path.stat().st_size / 1024:.0f} kB", file=sys.stderr)


if __name__ == "__main__":
    main()
