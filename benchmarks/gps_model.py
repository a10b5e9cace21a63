"""What a receiver that was not told that it flies costs: the same flights with its filter set, and as at the factory.

    python benchmarks/gps_model.py --flights 4

Simulated flights through the fake tray and the daemon, analyzed; error of power against the simulator's truth, over
speeds from the slowest to the fastest flown. The lag of the fake receiver is `SMOOTHING_S` of `hw_fakes/ublox.py`,
which is an assumption: u-blox publishes no figure.
"""

import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np
import pandas as pd
import typer

from flightpower.analysis.records.flight import Results

COMMAND = (sys.executable, "-m", "flightpower")
# Without the last two commands, which set the dynamic model and read it back.
AS_AT_THE_FACTORY = """
import sys
from flightpower.daq.sensors import ublox
configuration = ublox.configuration
ublox.configuration = lambda *arguments: configuration(*arguments)[:-2]
from flightpower.simulate import main
main()
"""


def power_errors(folder: Path, *options: str, configured: bool) -> tuple[np.ndarray, np.ndarray]:
    """Errors of power and half widths of its interval [%] over the speeds of one flight."""
    command = (*COMMAND, "sim") if configured else (sys.executable, "-c", AS_AT_THE_FACTORY)
    subprocess.run([*command, "fly", *options, "-o", folder, "--replace"], check=True, capture_output=True)
    log, report = folder / "log.mcap", folder / "report"
    subprocess.run([*COMMAND, "analyze", log, "--quiet", "-o", report], capture_output=True)
    points = msgspec.json.decode((report / "results.json").read_bytes(), type=Results).power_required
    truth = pd.read_csv(folder / "truth_power_required.csv")
    speed, power = np.array([[p.speed_mps, p.power_W] for p in points]).T
    half = np.array([p.power_hi_W - p.power_lo_W for p in points]) / 2
    true_W = np.interp(speed, truth.iloc[:, 0], truth.iloc[:, 1])
    return 100 * (power / true_W - 1), 100 * half / power


def main(
    count: Annotated[int, typer.Option("--flights")] = 4,
    first_seed: Annotated[int, typer.Option("--seed")] = 2001,
) -> None:
    with tempfile.TemporaryDirectory() as name:
        for plan in ("accel-decel", "full-test-flight"):
            for is_set in (True, False):
                flights = [
                    power_errors(
                        Path(name), "--plan", plan, "--errors", "study", "--seed", str(seed), configured=is_set
                    )
                    for seed in range(first_seed, first_seed + count)
                ]
                errors, half = (np.concatenate(each) for each in zip(*flights, strict=True))
                print(
                    f"{plan:18} {'airborne' if is_set else 'portable'}: error rms {np.sqrt(np.mean(errors**2)):.2f} %,"
                    f" mean {errors.mean():+.2f} %, largest {np.abs(errors).max():.1f} %,"
                    f" half width {half.mean():.2f} %, covered {100 * np.mean(np.abs(errors) <= half):.0f} %",
                    flush=True,
                )


if __name__ == "__main__":
    typer.run(main)
