"""Renews the stored references; see `tests/unchanged/stored_values.py`."""

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: threads cost more than they give

from tests.unchanged import aboard, commands, estimation
from tests.unchanged.stored_values import store

if __name__ == "__main__":
    CASES = {**commands.CASES, **aboard.CASES, **estimation.CASES}
    for name in sys.argv[1:] or CASES:
        store(name, CASES[name]())
