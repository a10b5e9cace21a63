"""Cost of the report: CPU time of its modules' import and of writing all files, and the size of the page.

.venv/bin/python benchmarks/report_page.py LOG
"""

import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

from analysis.pipeline import analyze
from flight.log_reader import read_log


def main(log: Annotated[Path, typer.Argument(help="A log that `analyze` accepts.")]) -> None:
    analysis = analyze(read_log(log))
    start_s = time.process_time()
    from analysis.report.write import write_report

    imported_s = time.process_time()
    with tempfile.TemporaryDirectory() as folder:
        write_report(analysis, Path(folder))
        written_s = time.process_time()
        size = (Path(folder) / "report.html").stat().st_size
    print(f"import {imported_s - start_s:.2f} s, writing {written_s - imported_s:.2f} s, page {size / 1e6:.2f} MB")


if __name__ == "__main__":
    typer.run(main)
