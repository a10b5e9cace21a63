"""`analyze` of several logs: each flight into its folder, and all together above them."""

import importlib
import os
import threading
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from analysis.campaign.campaign import Campaign, Work, run
from analysis.campaign.folders import exclusive
from analysis.campaign.processes import Outcome, below
from analysis.campaign.processes import Progress as Step
from analysis.cli.files_used import files_used
from analysis.cli.one_log import analyze_log
from analysis.cli.options import Options
from analysis.cli.verdict import tell
from flight.command_line import ExitCode
from flight.errors import InputError

PRELOAD = ("analysis.pipeline", "analysis.report.write", "analysis.report.terminal")  # of each analysis


@dataclass(frozen=True)
class FlightAnalysis:
    """`analyze_log` with its options, for other processes."""

    options: Options

    def __call__(self, log: Path, folder: Path, runs: Path | None, progress: Step) -> None:
        analyze_log(log, folder, replace(self.options, runs=runs), progress)

    def under(self, root: Path) -> "FlightAnalysis":
        given = {field.name: getattr(self.options, field.name) for field in fields(Options)}
        moved: dict[str, Any] = {name: below(root, value) for name, value in given.items() if isinstance(value, Path)}
        if self.options.propeller:
            moved["propeller"] = str(below(root, Path(self.options.propeller)))
        return FlightAnalysis(replace(self.options, **moved))


def settings(options: Options) -> str:
    """The options' values as text; of a file its name alone, since its content counts and not its folder."""
    values = (getattr(options, field.name) for field in fields(Options))
    return repr([value.name if isinstance(value, Path) else value for value in values])


def analyze_logs(
    logs: Sequence[Path], output: Path | None, options: Options, *, jobs: int | None, scheduler: str | None, quiet: bool
) -> ExitCode:
    """Analyze logs and pool the flights. Returns `ExitCode.FAILURE` when some of the logs cannot be used, or the
    results of one are not to be trusted.

    Raises InputError when none can, or the flights cannot be pooled.
    """
    if output is None:
        raise InputError("several logs: give the folder for the results with -o")
    if options.runs is not None:
        raise InputError(
            f"--runs {options.runs}: belongs to one log; with several, edit runs.toml in the folder of a flight and run"
            " the same command again"
        )
    options.replacements()  # a wrong file is refused once, not for each log
    work = Work(FlightAnalysis(options), settings(options), lambda log: files_used(log, options), PRELOAD)
    stderr = Console(stderr=True)
    # Meanwhile this process has nothing else to do: what the report needs is loaded before the last flight has ended.
    threading.Thread(target=_load_report, daemon=True).start()
    with exclusive(output):
        with ProgressOnConsole(stderr, quiet) as monitor:
            campaign = run(logs, output, work, monitor, jobs=jobs or _processors(), scheduler=scheduler)
            monitor.finished(campaign)
        for note in campaign.notes:
            stderr.print(f"note: {note}", highlight=False, markup=False, soft_wrap=True)
        if not campaign.folders:
            raise InputError(f"{output}: none of the {len(logs)} logs can be used")
        found = _pool(campaign, output, quiet)
    return ExitCode.FAILURE if campaign.failures else found


def _load_report() -> None:
    for module in ("analysis.campaign.campaign", "analysis.pooling.pool", "analysis.report.write"):
        importlib.import_module(module)


def _pool(campaign: Campaign, output: Path, quiet: bool) -> ExitCode:
    """Write and print the results of all flights, and what speaks against them.

    Raises InputError when they cannot be pooled.
    """
    with Console(stderr=True, quiet=quiet).status(f"pooling {len(campaign.folders)} flights …"):
        from analysis.campaign.campaign import read_results
        from analysis.pooling.evidence import against_electrical
        from analysis.pooling.pool import pool_results
        from analysis.report.terminal import print_pooled
        from analysis.report.write import write_electrical_flights, write_pooled

        page, found = output / "report.html", read_results(campaign.folders)
        if not found.to_pool and not found.electrical:
            raise InputError(f"{output}: no flight to pool; {found.left_out[0]}; each flight has its folder")
        if found.to_pool:
            pooled = pool_results(found.to_pool).results(found.left_out, campaign.failures)
            write_pooled(pooled, output)
        else:
            flights = write_electrical_flights(found.electrical, campaign.failures, output)

    def print_results() -> None:
        if quiet:
            return
        if found.to_pool:
            print_pooled(pooled, page, Console())
        else:
            note = f"{len(found.electrical)} flights give electrical power only, which is not pooled"
            Console().print(f"{note}\nreport: {page}", highlight=False, markup=False)

    return tell(pooled.evidence if found.to_pool else against_electrical(flights), print_results)


def _processors() -> int:
    """Processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


class ProgressOnConsole:
    """A line for each flight that is being analyzed, and a bar for all; without a terminal, a line when one ends."""

    def __init__(self, console: Console, quiet: bool):
        self.console, self.quiet = console, quiet
        self.jobs, self.done = 0, 0
        self.rows: dict[str, Any] = {}
        self.bars = Progress(
            TextColumn("{task.description}", markup=False),
            BarColumn(20),
            MofNCompleteColumn(),
            TextColumn("{task.fields[step]}", markup=False),
            TimeElapsedColumn(),
            console=console,
            transient=True,
            disable=quiet or not console.is_terminal,
        )
        self.total = self.bars.add_task("flights", total=None, step="reading")

    def __enter__(self) -> "ProgressOnConsole":
        self.bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.bars.stop()

    def planned(self, jobs: int, kept: int) -> None:
        self.jobs = jobs
        self.bars.update(self.total, total=jobs + kept, completed=kept, step="")
        if kept:
            self._note(f"flights done already: {kept}; to analyze: {jobs}")

    def step(self, name: str, step: str) -> None:
        if name not in self.rows:
            self.rows[name] = self.bars.add_task(f"  {name}", total=None, step=step)
        self.bars.update(self.rows[name], step=step)

    def failed(self, error: str) -> None:
        self.console.print(f"error: {error}", highlight=False, markup=False, soft_wrap=True)

    def ended(self, name: str, outcome: Outcome) -> None:
        self.done += 1
        if name in self.rows:
            self.bars.remove_task(self.rows.pop(name))
        self.bars.advance(self.total)
        if outcome.error:
            self.failed(outcome.error)
        else:
            self._note(f"{name}: {outcome.seconds:.1f} s ({self.done} of {self.jobs})")

    def finished(self, campaign: Campaign) -> None:
        if self.done:
            self._note(
                f"{self.done} analyzed in {campaign.processor_seconds:.0f} s of processor time, with at most"
                f" {campaign.peak_bytes / 1e6:.0f} MB of memory each"
            )

    def _note(self, text: str) -> None:
        if not self.quiet:
            self.console.print(text, highlight=False, markup=False, soft_wrap=True)
