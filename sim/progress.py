"""A progress bar on stderr."""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

Report = Callable[[float], None]  # takes how many seconds are done


@contextmanager
def progress_bar(what: str, total_s: float | None = None) -> Iterator[Report]:
    """A function that takes the seconds done; it shows a progress bar on stderr after two seconds."""
    console = Console(stderr=True)
    bar = Progress(
        TextColumn(what),
        BarColumn(),
        TextColumn("{task.completed:.0f} s"),
        TimeRemainingColumn(),
        console=console,
        transient=True,
    )
    task = bar.add_task(what, total=total_s)
    begun, shown = time.monotonic(), False

    def report(seconds: float) -> None:
        nonlocal shown
        if not shown and console.is_terminal and time.monotonic() - begun > 2:
            bar.start()
            shown = True
        bar.update(task, completed=seconds)

    try:
        yield report
    finally:
        if shown:
            bar.stop()
