"""Takes pictures of pages for the documentation in Chromium: report, page of `flightpower open`, card, route.

.venv/bin/python benchmarks/page_pictures.py out/demo docs/figures
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

import typer

from flightpower.sim.output_folder import LOG
from tests.browser import Browser, started

PROGRAM = (sys.executable, "-m", "flightpower")
QUALITY = 45  # quality of WebP, at which no picture is larger than 80 kB
BELOW_THE_FOLDER = 110  # pixels: the local page begins with the folder of this computer
CURVE_DONE = "last !== null && !document.body.classList.contains('busy')"  # text on the local page
DRAWN = "new Promise(done => setTimeout(done, 2500))"
LEGS = "9 km 045, 8 km 135 +50 m, 12 km 250"


def main(
    flight: Annotated[Path, typer.Argument(help="Folder of a simulated flight that was analyzed.")],
    output: Annotated[Path, typer.Argument(help="Folder for the pictures.")],
) -> None:
    report, log = (flight / LOG).with_suffix(".report").resolve(), flight / LOG
    with started() as browser, tempfile.TemporaryDirectory() as name:
        folder = Path(name)
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
