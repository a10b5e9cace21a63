"""Entry points of all commands. Each first makes NumPy compute in one thread."""

import importlib
import os
import sys
from collections.abc import Callable

INSTALL = 'pip install ".[analysis,sim]"'  # installs all that the commands need on a laptop


def _command(module: str) -> Callable[[], None]:
    def main() -> None:
        # This must precede the import of NumPy, which reads the variables. The matrices are small: two threads that
        # wait for each other took half again as much processor time.
        os.environ.setdefault("OMP_NUM_THREADS", "1")
        os.environ.setdefault("FLIGHTPOWER_PROCESSES", "2")  # `flightpower.analysis.beside`
        try:
            importlib.import_module(module).main()
        except ModuleNotFoundError as error:
            if error.name and error.name.split(".")[0] == __package__:
                raise
            print(f"error: {error.name} is not installed; in the clone: {INSTALL}", file=sys.stderr)
            sys.exit(2)  # `flightpower.flight.command_line.ExitCode.BAD_INPUT`

    return main


flightpower = _command("flightpower.command")
analyze = _command("flightpower.analysis.cli.analyze")
calibrate = _command("flightpower.analysis.cli.calibrate")
daq = _command("flightpower.daq.__main__")
sim = _command("flightpower.simulate")
