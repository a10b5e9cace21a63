"""Entry points of all commands. Each first sees to it that no module of the user's hides a package of this software."""

import importlib
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("analysis", "daq", "flight", "hw_fakes", "sim")
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
        importlib.import_module(module).main()

    return main


flightpower = _command("flightpower.command")
analyze = _command("analysis.cli.analyze")
calibrate = _command("analysis.cli.calibrate")
daq = _command("daq.__main__")
sim = _command("sim.__main__")
