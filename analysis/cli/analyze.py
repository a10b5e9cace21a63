"""The command `analyze`, from a log to the report: only arguments, messages and exit codes."""

import shlex
import sys
import tempfile
from pathlib import Path
from typing import Annotated, Any

import msgspec
import typer
from rich.console import Console
from typer.core import TyperCommand

from flightpower.analysis.cli.compare import app as compare_app
from flightpower.analysis.cli.verdict import report_evidence
from flightpower.analysis.flights.campaign.addresses import (
    as_file,
    find_logs,
    is_address,
    name_by_address,
    place,
    printable,
)
from flightpower.analysis.options import Options, QuietOption
from flightpower.analysis.pages.one_log import Report, analyze_log
from flightpower.analysis.sources.open import refuse_folder
from flightpower.flight.command_line import ExitCode, application, run, takes_options
from flightpower.flight.errors import InputError

app = application(no_args_is_help=False)


class AnalyzeCommand(TyperCommand):
    """Runs `analyze LOG...`, or `analyze compare A B` if the first argument is exactly the word compare."""

    def make_context(self, info_name: str | None, args: list[str], parent: Any = None, **extra: Any) -> Any:
        if args[:1] == ["compare"]:
            compare = typer.main.get_command(compare_app)
            return compare.make_context(f"{info_name} compare", args[1:], parent, **extra)
        return super().make_context(info_name, args, parent, **extra)

    def collect_usage_pieces(self, ctx: Any) -> list[str]:
        return ["[OPTIONS]", "LOG [LOG]..."]

    def invoke(self, ctx: Any) -> Any:
        return super().invoke(ctx) if ctx.command is self else ctx.command.invoke(ctx)


@app.command(cls=AnalyzeCommand)
@takes_options(Options)
def analyze(
    *,
    context: typer.Context,
    logs: Annotated[
        list[str],
        typer.Argument(
            metavar="LOG",
            help="A log that the daemon recorded, one of other software (docs/understand/log-format.md), one of PX4"
            " (.ulg), ArduPilot (.BIN, .log, .tlog) or Paparazzi (.data); a folder of logs; an address of either, such"
            " as s3://bucket/flights/. Several: each is analyzed, and the flights of one aircraft are pooled.",
        ),
    ],
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="FOLDER",
            help="Folder for the results; default: the log's name with .report instead of its"
            " suffix; for an address, in the current folder. Needed with several logs.",
        ),
    ] = None,
    options: Options = Options(),
    json: Annotated[
        bool,
        typer.Option("--json", help="Print the results as JSON on stdout (docs/use/results.md), instead of a summary."),
    ] = False,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", metavar="N", min=1, help="Logs to analyze at the same time; default: as many as processors."
        ),
    ] = None,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler",
            metavar="ADDRESS",
            help="Analyze on a Dask cluster, such as tcp://10.0.0.5:8786, instead of on this computer.",
        ),
    ] = None,
    replace: Annotated[
        bool,
        typer.Option(
            "--replace",
            help="As without it: reports are replaced; an edited runs.toml or left_out.txt is kept beside the new one.",
        ),
    ] = False,
    quiet: QuietOption = False,
) -> int:
    """Compute the power required from a log: report.html, results.json, power_required.csv and a table for the field.

    The log contains the aircraft file, the propeller table, the calibrations of probe, magnetometer and transducers,
    and the zero. Each can be replaced, or given where the log lacks it.
    The curve covers the speeds flown in accelerations and decelerations, with a 95 % interval. The report also has
    endurance and range on a battery, climb and highest speed at full throttle, and the effect of weight and air
    density on these.
    A log of PX4 or ArduPilot, or one without flow angles or motor speed, gives the electrical power of level flight.
    With several logs, each gets its own folder in FOLDER, which also has the report and the results of all flights
    together. After an interruption the same command continues; it adds new logs without repeating the others.
    Two such folders are compared by `analyze compare`.

    \b
    Examples:
      analyze log.mcap                               the report is in log.report
      analyze log.mcap --aircraft my.toml -o results
      analyze log.mcap --battery-Wh "5000 mAh, 14.8 V" --usable 70%
      analyze log.mcap --runs log.report/runs.toml   after editing that file
      analyze log.ulg --mass 9.4 --wing-area 1.5 --span 4
      analyze flights/*.mcap -o out                  many flights as one
      analyze s3://bucket/flights/ -o out            the same, read from a bucket
      analyze compare old/ new/ -o difference

    Exit code 0: done; a doubtful result is named first. 1: done, but the result is not to be trusted, and lines on
    stderr say why; or, of several logs, some cannot be used or are not to be trusted. 2: the input cannot be used; one
    line on stderr says why, and nothing was written, except runs.toml with candidates where no maneuver gives a curve;
    of several logs, the folders of flights that could be analyzed stay.
    """
    stderr = Console(stderr=True, quiet=quiet)
    if output is None:
        refuse_folder(Path(logs[0]))
    with stderr.status("looking for logs …"):
        listing = find_logs(logs)
    if len(logs) == 1 and listing.failures:
        raise InputError(listing.failures[0])
    if len(logs) > 1 or listing.in_folders or scheduler is not None:
        if json:
            raise InputError("--json: only for one log; several write their results into FOLDER")
        from flightpower.analysis.cli.several_logs import analyze_logs

        raise typer.Exit(analyze_logs(listing, output, options, jobs=jobs, scheduler=scheduler, quiet=quiet))
    log = listing.logs[0]
    folder = output or (log.parent if isinstance(log, Path) else Path()) / f"{place(log).stem}.report"
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file; give the folder for the results with -o")
    words = [printable(word) if is_address(word) else word for word in sys.argv[1:]]
    command_line = shlex.join([str(context.find_root().info_name), *words])
    with stderr.status("reading the log …") as status, as_file(log, Path(tempfile.gettempdir())) as (file, _):
        done = analyze_log(file, folder, options, lambda step: status.update(f"{step} …"), command_line)
        name_by_address(folder, file, log)
        done = done._replace(results=msgspec.structs.replace(done.results, log=str(log)))
    if done.backup:
        edited = done.backup.with_stem(done.backup.stem.rpartition("-")[0])
        note = f"note: {edited} was written; the previous file is now {done.backup.name}"
        stderr.print(note, highlight=False, markup=False, soft_wrap=True)
    if done.replaced_report:
        stderr.print(f"note: {done.replaced_report}", highlight=False, markup=False, soft_wrap=True)
    return _finish(done, json, quiet)


def _finish(done: Report, json: bool, quiet: bool) -> ExitCode:
    """Print the results, and on stderr the evidence against them. Returns the exit code."""
    from flightpower.analysis.results.files import to_json

    def print_results() -> None:
        if json:
            print(to_json(done.results).decode())
        elif not quiet:
            done.print_summary(Console())

    return report_evidence(done.results.evidence, print_results)


def main() -> None:
    run(app, "analyze")


if __name__ == "__main__":
    main()
