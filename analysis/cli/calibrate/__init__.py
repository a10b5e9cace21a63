"""`calibrate`: one module per command, with its arguments, messages and exit codes."""

import os

import typer

from analysis.cli.calibrate.airspeed import airspeed
from analysis.cli.calibrate.magnetometer import magnetometer
from analysis.cli.calibrate.probe import probe
from analysis.cli.calibrate.surfaces import surfaces
from analysis.cli.calibrate.tubing import tubing
from analysis.cli.errors import run

app = typer.Typer(no_args_is_help=True, add_completion=False, rich_markup_mode="markdown")


@app.callback()
def _group() -> None:
    """Calibrations: the probe in a wind tunnel; tubes, magnetometer and surfaces on the bench; airspeed in flight."""
    # The matrices are small: a thread pool gains nothing and slows down the start.
    os.environ.setdefault("OMP_NUM_THREADS", "1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


for command in (probe, tubing, airspeed, magnetometer, surfaces):
    app.command()(command)


def main() -> None:
    run(app)
