"""Two sources of one propeller side by side: the APC 10x5E as UIUC measured it, and as APC computed it in 2014.

    .venv/bin/python benchmarks/propellers.py            # measured and computed, side by side
    .venv/bin/python benchmarks/propellers.py --draw     # and its figure, by Chromium
    .venv/bin/python benchmarks/propellers.py --distorted wrong.csv   # the 12x8E, wrong by as much as these two differ

Reads the files as downloaded, from ../shared/data/propellers.
"""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from simulation_figures import picture

from flightpower.flight.propeller import Propeller, Row
from flightpower.flight.propeller_files import load_propeller

ROOT = Path(__file__).resolve().parents[1]
DATA = ROOT.parent / "shared" / "data" / "propellers"
J = np.array([0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
ZERO_THRUST_J, RPM = 0.70, 6011.5  # of the 10x5E; at which the two are compared
COLORS = ("#004a99", "#c64b00", "#00735c", "#8a2f8f")


def main(
    draw: Annotated[bool, typer.Option("--draw", help="Draw docs/figures/propellers.png.")] = False,
    distorted: Annotated[Path | None, typer.Option("--distorted", help="Write a 12x8E that is off as much.")] = None,
) -> None:
    measured = load_propeller(DATA / "apce_10x5_kt0821_5000.txt")
    computed = load_propeller(DATA / "PER3_10x5E.dat")
    print("| rpm | | " + " | ".join(f"J = {j:.1f}" for j in J) + " |")
    print("|---|---|" + "---:|" * len(J))
    for row in measured.rows:
        for i, name in enumerate(("cT", "cP")):
            ratio = computed.coefficients(J, row.rpm)[i] / measured.coefficients(J, row.rpm)[i]
            print(f"| {row.rpm:.0f} | {name} | " + " | ".join(f"{100 * (r - 1):+.0f} %" for r in ratio) + " |")
    if distorted:
        distorted.write_text(_wrong(load_propeller("apc-12x8e"), measured, computed).to_csv(), "utf-8")
    if draw:
        picture(_figure(measured, computed), ROOT / "docs" / "figures" / "propellers.png")


def _wrong(propeller: Propeller, measured: Propeller, computed: Propeller) -> Propeller:
    """cT and cP times computed over measured of the 10x5E, J taken as a share of that of zero thrust."""
    rows = []
    for row in propeller.rows:
        J_of_it = np.array(row.J) * ZERO_THRUST_J / row.J[-1]
        above, below = (np.maximum(source.coefficients(J_of_it, RPM), 1e-3) for source in (computed, measured))
        ratio = np.clip(above / below, 0.7, 1.6)  # near zero thrust the ratio has no meaning
        cT, cP = (tuple(coefficient) for coefficient in (ratio * (row.cT, row.cP)).tolist())
        rows.append(Row(row.rpm, row.J, cT, cP))
    return Propeller("wrong", propeller.diameter_m, tuple(rows), "distorted on purpose")


def _figure(measured, computed):
    from plotly.subplots import make_subplots

    figure = make_subplots(rows=1, cols=2, subplot_titles=["thrust coefficient", "power coefficient"])
    grid = np.linspace(0, 0.7, 141)
    for color, row in zip(COLORS, measured.rows, strict=True):
        for column in (1, 2):
            dots, line = (row.cT, row.cP)[column - 1], computed.coefficients(grid, row.rpm)[column - 1]
            name, first = f"{row.rpm:.0f} rpm", column == 1
            figure.add_scatter(
                x=row.J, y=dots, mode="markers", marker={"color": color, "size": 8}, row=1, col=column,
                name=f"measured, {name}", showlegend=first,
            )  # fmt: skip
            style = {"color": color, "width": 2.5, "dash": "solid" if row is measured.rows[0] else "dash"}
            figure.add_scatter(
                x=grid, y=line, mode="lines", line=style, row=1, col=column, name=f"computed, {name}", showlegend=first
            )
    figure.update_layout(template="plotly_white", width=900, height=520, font={"size": 15})
    figure.update_layout(margin={"l": 50, "r": 20, "t": 40, "b": 50}, legend={"orientation": "h", "y": -0.15})
    figure.update_xaxes(title_text="advance ratio J")
    return figure


if __name__ == "__main__":
    typer.run(main)
