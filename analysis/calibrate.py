"""`calibrate`: from measurements on the ground to the small files that travel in a log."""

import math
from pathlib import Path
from typing import Annotated

import msgspec
import typer
from rich.console import Console

from analysis import commands
from analysis.airdata import probe as probes
from flight.errors import InputError

app = typer.Typer(help="Calibrations from ground measurements.", no_args_is_help=True, add_completion=False)


@app.callback()
def _group() -> None:
    """Calibrations from ground measurements."""


@app.command()
def probe(
    tunnel: Annotated[Path, typer.Argument(help="CSV with a header such as `speed [m/s],alpha [deg],…`")],
    output: Annotated[Path, typer.Option("-o", "--output", help="Where the calibration goes.")] = Path("probe.json"),
    replace: Annotated[bool, typer.Option("--replace", help="Replace an existing calibration.")] = False,
) -> None:
    """Turn a wind tunnel's measurements of a five-port probe into the calibration the daemon puts into its logs.

    The tunnel file has the columns speed, alpha, beta, dp_alpha (lower minus upper port), dp_beta (right minus left),
    q_c (centre minus static), static and temperature, each with its unit in brackets.
    """
    if output.exists() and not replace:
        raise InputError(f"{output}: exists already; give --replace, or another name with -o")
    calibration = probes.calibrate(probes.read_tunnel(tunnel), tunnel.name)
    commands.write_file(output, msgspec.json.format(msgspec.json.encode(calibration), indent=1))
    console = Console()
    console.print(f"{calibration.points} points, polynomials chosen by cross-validation:")
    for name, surface, scale, unit in (
        ("alpha", calibration.alpha_rad, math.degrees(1), "deg"),
        ("beta", calibration.beta_rad, math.degrees(1), "deg"),
        ("q_c/qbar", calibration.q_ratio, 100, "%"),
    ):
        rms = f"{surface.residual_rms * scale:.3f} {unit}"
        console.print(f"  {name:9} order {surface.order}, predicts left-out points to {rms} rms")
    console.print(f"wrote {output}")


def main() -> None:
    commands.run(app)
