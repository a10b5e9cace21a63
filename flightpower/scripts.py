"""Entry points of all commands. Each first sees to it that no module of the user's hides a package of this software,
and that NumPy computes in one thread.
"""

import importlib
import os
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("analysis", "daq", "flight", "hw_fakes", "sim")
INSTALL = 'pip install ".[analysis,sim]"'  # all that the commands need on a laptop
BAD_INPUT = 2  # of `flight.command_line.ExitCode`, which cannot be imported where `flight` is hidden


def hidden_package() -> str:
    """One line where another module hides one of PACKAGES; empty where none does."""
    ours = Path(__file__).resolve().parents[1]
    for name in PACKAGES:
        spec = find_spec(name)
        origin = spec.origin if spec else None
        if origin and Path(origin).resolve() != ours / name / "__init__.py":
            return f"{origin}: hides the package {name} of flightpower; rename it, or work in another folder"
    return ""


def _command(module: str) -> Callable[[], None]:
    def main() -> None:
        if message := hidden_package():
            print(f"error: {message}", file=sys.stderr)
            sys.exit(BAD_INPUT)
        # Before NumPy is imported, which reads it. The matrices are small: two threads, which wait for each other, took
        # half as much processor time again.
        os.environ.setdefault("OMP_NUM_THREADS", "1")
        try:
            importlib.import_module(module).main()
        except ModuleNotFoundError as error:
            if error.name and error.name.split(".")[0] in PACKAGES:
                raise
            print(f"error: {error.name} is not installed; in the clone: {INSTALL}", file=sys.stderr)
            sys.exit(BAD_INPUT)

    return main


flightpower = _command("flightpower.command")
analyze = _command("analysis.cli.analyze")
calibrate = _command("analysis.cli.calibrate")
daq = _command("daq.__main__")
sim = _command("flightpower.simulate")
