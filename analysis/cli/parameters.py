"""The command `parameters`, which makes a file for an autopilot from results: only arguments, messages, exit codes."""

from pathlib import Path
from typing import Annotated

import typer

from flightpower.analysis.cli.route import StallOptions, read_results
from flightpower.analysis.options import ReplaceOption
from flightpower.analysis.results.parameter_file import For, StallMargin, parameter_file
from flightpower.flight.command_line import application, run, takes_options
from flightpower.flight.files import check_new_file, write_file

app = application()


@app.command()
@takes_options(StallOptions)
def parameters(
    results: Annotated[
        Path, typer.Argument(metavar="RESULTS", help="results.json of `analyze`: of one flight, or of several.")
    ],
    firmware: Annotated[For, typer.Option("--for", help="Firmware that loads the file.")],
    output: Annotated[Path, typer.Option("-o", "--output", metavar="FILE", help="File to write.")],
    options: StallOptions,
    replace: ReplaceOption = False,
) -> None:
    """Airspeeds, sink and level-flight power as a file for ArduPilot (.param), PX4 (.params) or INAV (CLI lines).

    The file states for each value its interval, its source, and the value in the log. No airspeed is below the stall
    margin; sink and power belong to the cruise speed in the file. It names what cannot be derived. Compare each
    value with yours before you load it.

    \b
    Examples:
      flightpower parameters log.report/results.json --for px4 -o my.params
      flightpower parameters log.report/results.json --for ardupilot --stall "10 m/s" -o my.param
      flightpower parameters out/results.json --for inav -o my.txt     # of all flights that `analyze … -o out` pooled
    """
    check_new_file(output, replace=replace)
    stall = StallMargin(options.stall_mps, options.stall_margin)
    write_file(output, parameter_file(read_results(results), firmware, stall))
    print(f"wrote {output}")


def main() -> None:
    """Run the command. Wrong input gives one line on stderr and exit code 2."""
    run(app, "parameters")


if __name__ == "__main__":
    main()
