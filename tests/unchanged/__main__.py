"""Renews or compares stored results; see `tests/unchanged/stored_values.py`."""

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: threads cost more than they give

from tests.unchanged import aboard, commands, estimation, stored_values

CASES = {**commands.CASES, **aboard.CASES, **estimation.CASES}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m tests.unchanged", description=__doc__)
    parser.add_argument("cases", nargs="*", metavar="CASE", help="all, unless some are named")
    parser.add_argument("--exact", type=Path, metavar="FOLDER", help="write every number in full there")
    parser.add_argument("--compare", type=Path, nargs=2, metavar="FOLDER", help="two folders written by --exact")
    arguments = parser.parse_args()
    if arguments.compare:
        changed = stored_values.compare(*arguments.compare)
        sys.exit("\n".join([*changed[:200], f"{len(changed)} values changed"]) if changed else 0)
    for name in arguments.cases or CASES:
        value = CASES[name]()
        if arguments.exact:
            stored_values.store_in_full(name, value, arguments.exact)
        else:
            stored_values.store(name, value)
