"""Where the packages lie: `flightpower.daq` is the folder daq, and so on. All else stands in pyproject.toml.

Other packages are called `analysis` or `daq`, too, so that the parts are installed inside `flightpower`. A clone has
links, which Python and type checkers follow; setup.py makes links that Git or a source archive left out.
"""

import os
from pathlib import Path

from setuptools import find_packages, setup

PARTS = ("analysis", "daq", "flight", "hw_fakes", "sim")
ROOT = Path(__file__).parent

for part in PARTS:
    link = ROOT / "flightpower" / part
    if link.is_dir():
        continue
    link.unlink(missing_ok=True)  # on Windows, Git writes a file that names the target
    if os.name == "nt":  # a junction: links ask for a right that users of Windows lack
        import _winapi

        _winapi.CreateJunction(str(ROOT / part), str(link))
    else:
        link.symlink_to(Path("..", part), target_is_directory=True)

setup(
    package_dir={f"flightpower.{part}": part for part in PARTS},
    packages=[
        "flightpower",
        *(f"flightpower.{name}" for part in PARTS for name in (part, *(f"{part}.{x}" for x in find_packages(part)))),
    ],
)
