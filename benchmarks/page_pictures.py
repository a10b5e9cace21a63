"""Takes pictures for the documentation in Chromium: curve with truth, report, page of `flightpower open`, card, route.

.venv/bin/python benchmarks/page_pictures.py out/demo docs
"""

import base64
import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import msgspec
import pandas as pd
import typer

from flightpower.analysis.pages.charts.figure import Dash, Line
from flightpower.analysis.pages.charts.power import power_required
from flightpower.analysis.pages.charts.style import ORANGE
from flightpower.analysis.pages.charts.svg import chart, chart_style
from flightpower.analysis.records.flight import Results
from flightpower.sim.output_folder import CURVE, LOG
from tests.browser import Browser, started

PROGRAM = (sys.executable, "-m", "flightpower")
QUALITY = 45  # quality of WebP, at which no picture is larger than 80 kB
BELOW_THE_FOLDER = 110  # pixels: the local page begins with the folder of this computer
CURVE_DONE = "last !== null && !document.body.classList.contains('busy')"  # text on the local page
DRAWN = "new Promise(done => setTimeout(done, 2500))"
LEGS = "9 km 045, 8 km 135 +50 m, 12 km 250"


def main(
    flight: Annotated[Path, typer.Argument(help="Folder of a simulated flight that was analyzed.")],
    docs: Annotated[Path, typer.Argument(help="Folder of the documentation.")],
) -> None:
    report, log, output = (flight / LOG).with_suffix(".report").resolve(), flight / LOG, docs / "figures"
    with started() as browser, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "curve.html").write_text(curve_page(report / "results.json", flight / CURVE), "utf-8")
        take(browser, folder / "curve.html", (0, 1000, 560), docs / "power-required.webp")
        take(browser, report / "report.html", (0, 1000, 1000), output / "report.webp")
        results = ("--results", str(report / "results.json"), "--wind", "5 m/s from 270 deg")
        subprocess.run([*PROGRAM, "route", "--legs", LEGS, *results, "--map", str(folder / "route.svg")], check=False)
        take(browser, folder / "route.svg", (0, 700, 660), output / "route.webp")
        wind = ("--heading", "250", "--wind-kt", "8", "--wind-from", "280")
        subprocess.run([*PROGRAM, "plan", "nexstar", *wind, "-o", str(folder / "plan")], check=True)
        take(browser, folder / "plan" / "card.html", (0, 794, 800), output / "card.webp")
        flown = Path(shutil.copy2(log, folder))  # a pilot's folder, without the truth
        served = subprocess.Popen(
            [*PROGRAM, "open", "--no-browser", str(flown)],
            stdout=subprocess.PIPE, text=True, env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )  # fmt: skip
        try:
            assert served.stdout
            address = next(match[0] for line in served.stdout if (match := re.search(r"http://\S+", line)))
            take(browser, address, (BELOW_THE_FOLDER, 1100, 900), output / "local-page.webp", CURVE_DONE)
        finally:
            served.terminate()


def curve_page(results_file: Path, truth_file: Path) -> str:
    """Return a page with the report's curve and the simulator's, over the same speeds."""
    results = msgspec.json.decode(results_file.read_bytes(), type=Results)
    figure = power_required(results)
    figure.height_px = 460
    speeds = [float(V) for mark in figure.marks for V in mark.x]
    truth = pd.read_csv(truth_file)
    truth = truth[truth["speed_mps"].between(min(speeds), max(speeds))]
    figure.add(
        Line(
            x=truth["speed_mps"].to_numpy(), y=truth["power_W"].to_numpy(), color=ORANGE, width=4, dash=Dash.DOTTED,
            name="truth (simulator)",
        )
    )  # fmt: skip
    title = f"{results.aircraft.title}: power required, from one simulated flight of two and a half minutes"
    style = f"body {{ font: 16px sans-serif; margin: 16px }} h1 {{ font-size: 18px }} {chart_style()}"
    head = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{title}</title><style>{style}</style>'
    return f"{head}<h1>{title}</h1>{chart(figure, 'curve', title)}</html>"


def take(
    browser: Browser, page: Path | str, window: tuple[int, int, int], output: Path, is_ready: str = "true"
) -> None:
    """Take the first screen of a page once it is drawn. window: pixels left out at the top; width and height"""
    above, width, height = window
    browser.show(page, width, height=above + height)
    browser.wait_for(is_ready)
    browser.value_of(DRAWN)
    clip = {"x": 0, "y": above, "width": width, "height": height, "scale": 1}
    picture = browser.command("Page.captureScreenshot", format="webp", quality=QUALITY, clip=clip)
    output.write_bytes(base64.b64decode(picture["data"]))
    print(f"{output}: {output.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    typer.run(main)
