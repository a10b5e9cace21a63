"""Removes files from .venv that no program loads, and keeps only one copy of a library that has several names.

    .venv/bin/python benchmarks/environment.py     # `make` does it after installing; prints what it saved

The tests of pandas and SciPy, header files and static libraries take 120 MB. CasADi's wheel has its shared libraries up
to three times, because a wheel holds no links; this takes 140 MB. Nothing is removed outside the environment of the
Python that runs this. To restore all of a package: pip install --force-reinstall PACKAGE.
"""

import filecmp
import os
import shutil
import sys
import sysconfig
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

FOLDERS = (
    "casadi/include", "pandas/tests", "pyarrow/include", "pyarrow/tests", "scipy/**/tests",
)  # fmt: skip
FILES = ("casadi/*.a",)
LIBRARIES = ("**/*.so", "**/*.so.*", "**/*.dylib")
SMALL_BYTES = 100_000


def main() -> None:
    """Remove the files, link equal libraries, and print what was saved."""
    if sys.prefix == sys.base_prefix:
        sys.exit("environment.py: run it by the Python of a virtual environment")
    packages = Path(sysconfig.get_path("platlib"))
    before = size_bytes(packages)
    for path in removable(packages):
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    link_equal_files(packages)
    print(f"{packages}: {size_bytes(packages) / 1e6:.0f} MB, {before / 1e6:.0f} MB before")


def removable(packages: Path) -> Iterator[Path]:
    """Yield the folders and files to remove."""
    for pattern in FOLDERS:
        yield from [path for path in packages.glob(pattern) if path.is_dir()]
    for pattern in FILES:
        yield from packages.glob(pattern)


def link_equal_files(packages: Path) -> None:
    """Link all names of each large library to one copy."""
    by_size = defaultdict(set)
    for pattern in LIBRARIES:
        for path in packages.glob(pattern):
            if not path.is_symlink() and path.stat().st_size > SMALL_BYTES:
                by_size[path.stat().st_size].add(path)
    for paths in by_size.values():
        first, *others = sorted(paths)
        for path in others:
            if not first.samefile(path) and filecmp.cmp(first, path, shallow=False):
                path.unlink()
                os.link(first, path)


def size_bytes(folder: Path) -> int:
    """Return the total size [bytes] of all files; a file with several names counts once."""
    sizes = {(info.st_dev, info.st_ino): info.st_size for path in folder.rglob("*") if (info := path.lstat())}
    return sum(sizes.values())


if __name__ == "__main__":
    main()
