"""Tests the daemon as a service of a small Debian computer in QEMU, without hardware acceleration.

    make vm                                                      # root; image made in out/vm from nothing
    .venv/bin/python benchmarks/vm --only pulls --pulls 3        # on the image of the last run

It is installed as a user would, by systemd/README.md without a network. Its I2C parts are a character device in the
machine (CUSE); its serial parts are at the other end of two USB adapters and a serial line. Then the power is pulled
while the machine boots and while it records (QEMU is killed; the card's image is kept), the USB receiver is unplugged,
the clock is stepped from 1970, and a newer version is installed while the daemon records. The Debian package is
installed on another card, upgraded while it records, and removed. After each trial, the logs on the card are read.
Finally the daemon records eight hours of simulated time on this computer. Exit code 1 if a log is unreadable, changed
or gone, if more than a second before a power cut is lost, or if a step of the installation fails.
"""

import os
import random
import shutil
import sys
import time
from pathlib import Path

import typer

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path += [str(HERE.parent), str(ROOT / "tests" / "hw_fakes")]

import image  # noqa: E402
import trials  # noqa: E402
from machine import Machine  # noqa: E402

TRIALS = ("install", "figures", "pulls", "usb", "clock", "upgrade", "package", "hours")


def main(
    folder: Path = ROOT / "out" / "vm",
    pulls: int = 20,
    seed: int = 1003,
    only: str = "",
) -> None:
    """Run all trials; --only NAME: one, on the last run's card, or for `package` on one without this software."""
    begin_s = time.monotonic()
    missing = [package for command, package in image.COMMANDS.items() if shutil.which(command) is None]
    if missing:
        sys.exit(f"make vm needs packages: sudo apt-get install --no-install-recommends {' '.join(missing)}")
    if os.geteuid() != 0:
        sys.exit("make vm must be run as root: it makes a Debian system and mounts its disk")
    if only and only not in TRIALS:
        sys.exit(f"--only {only}: must be one of {', '.join(TRIALS)}")
    folder, disk = folder.resolve(), folder.resolve() / "card.img"
    chosen = [only] if only else list(TRIALS)
    rows: list[trials.Row] = []
    if "install" in chosen:
        image.build(folder)
        image.run("cp", "--sparse=always", folder / "base.img", disk)
        with Machine(folder, disk) as machine:
            rows += trials.install(machine)
        print_table(rows)
    if "figures" in chosen:
        with Machine(folder, disk) as machine:
            rows += trials.figures(machine)
            machine.switch_off()
    if "pulls" in chosen:
        rows += trials.power_pulls(folder, disk, count=pulls, rng=random.Random(seed))
    for name, trial in (("usb", trials.unplugged), ("clock", trials.clock_stepped), ("upgrade", trials.upgraded)):
        if name in chosen:
            try:
                rows += trial(folder, disk)
            except TimeoutError as error:
                rows.append(trials.Row(name, str(error), False))
    if "package" in chosen:
        if only or not (folder / "base.img").exists():
            image.build(folder)
        image.run("cp", "--sparse=always", folder / "base.img", folder / "package.img")
        rows += trials.package(folder, folder / "package.img")
    if "hours" in chosen:
        rows += trials.eight_hours()
    print_table(rows)
    bad = sum(not row.good for row in rows)
    minutes = (time.monotonic() - begin_s) / 60
    load = f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores"
    print(f"{len(rows)} rows, {bad} bad, in {minutes:.0f} min; {load}; QEMU with TCG")
    if bad:
        raise typer.Exit(1)


def print_table(rows: list[trials.Row]) -> None:
    for row in rows:
        print(f"{'ok ' if row.good else 'BAD'}  {row.what:36}  {row.figure}", flush=True)


if __name__ == "__main__":
    typer.run(main)
