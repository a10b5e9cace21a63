"""The Debian package of the recorder: service, udev rules, program of the motor speed counter, and all it needs.

    make deb                                                        # for this computer's processor, into dist/
    .venv/bin/python debian/build.py --architecture arm64           # for a Raspberry Pi, on any computer with Debian

/usr/lib/flightpower is a virtual environment whose libraries come from wheels, with the versions of constraints.txt:
compiled modules for each Python of PYTHONS lie side by side, so that one package fits Debian 12 and 13, and nothing is
compiled for another processor. What it needs of Debian is named in one line, before anything is installed or built
(--needs: only that); with lintian, an error that it finds is an error here.
"""

import argparse
import os
import re
import shutil
import subprocess
import sys
import time
from email.message import Message
from email.parser import HeaderParser
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
SYSTEMD = ROOT / "systemd"
PYTHONS = ("3.11", "3.13")  # of Debian 12 and 13, and of Raspberry Pi OS; `control` depends on them
COMMANDS = ("daq", "flightpower")
PAGES = ("daq", "daq run", "daq zero", "daq check", "daq info", "daq list", "daq status", "daq config", "flightpower")
NEEDED = {
    "dpkg-buildpackage": "dpkg-dev", "dh": "debhelper", "help2man": "help2man", "avr-gcc": "gcc-avr", "git": "git",
}  # fmt: skip
AVR_HEADER = Path("/usr/lib/avr/include/avr/io.h")  # of avr-libc, which has no command
# What the recorder never loads, as in install.sh: other dialects of MAVLink, zstandard's second implementation, the
# parser of pymavlink's generator; and what only other programs read.
NEVER_LOADED = (
    "bin", "share", "lxml", "lxml-*.dist-info", "zstandard/_cffi*.so", "**/*.pyi", "**/*.h", "**/*.c", "**/*.pyx",
)  # fmt: skip
DIALECT = "v20/ardupilotmega"
# What is in /usr/bin, and the program that it starts, whose name is that of the command.
COMMAND = '#!/bin/sh\nexec /usr/lib/flightpower/bin/python3 -I /usr/lib/flightpower/bin/{0} "$@"\n'
PROGRAM = "from flightpower.scripts import {0}\n\n{0}()\n"


class Architecture(StrEnum):
    AMD64 = "amd64"
    ARM64 = "arm64"

    @property
    def of_wheels(self) -> str:
        """The processor in the names of wheels, and of GNU tools."""
        return {"amd64": "x86_64", "arm64": "aarch64"}[self]

    @property
    def strip_tool(self) -> str:
        """The program that shortens compiled modules."""
        return f"{self.of_wheels}-linux-gnu-strip"


class Needs(NamedTuple):
    """What of Debian is missing here, as names of packages."""

    packages: list[str]

    @property
    def line(self) -> str:
        return f"the package needs: sudo apt-get install --no-install-recommends {' '.join(self.packages)}"


def needs(architecture: Architecture) -> Needs:
    needed = NEEDED | {architecture.strip_tool: f"binutils-{architecture.of_wheels.replace('_', '-')}-linux-gnu"}
    missing = [package for command, package in needed.items() if shutil.which(command) is None]
    return Needs([*missing, *([] if AVR_HEADER.exists() else ["avr-libc"])])


def main() -> None:
    """Build the package, and have lintian look at it."""
    parser = argparse.ArgumentParser(description="The Debian package of the recorder.")
    own_architecture = Architecture.ARM64 if os.uname().machine == "aarch64" else Architecture.AMD64
    parser.add_argument("--architecture", choices=list(Architecture), type=Architecture, default=own_architecture)
    parser.add_argument("--output", type=Path, default=ROOT / "dist", help="the folder for the package")
    parser.add_argument("--version", default="", help="in place of that of the commit")
    parser.add_argument("--needs", action="store_true", help="only say what is missing here")
    options = parser.parse_args()
    missing = needs(options.architecture)
    if missing.packages:
        sys.exit(missing.line)
    if not options.needs:
        build(options.architecture, options.output, options.version)


def build(architecture: Architecture, output: Path, version: str) -> None:
    source = ROOT / "build" / f"deb-{architecture}" / "source"
    shutil.rmtree(source.parent, ignore_errors=True)
    shutil.copytree(ROOT / "debian", source / "debian", ignore=shutil.ignore_patterns("*.py"))
    committed_s = run("git", "log", "-1", "--format=%ct", cwd=ROOT) or str(int(time.time()))
    version_setting = {"SETUPTOOLS_SCM_PRETEND_VERSION_FOR_FLIGHTPOWER": version} if version else {}
    os.environ.update(version_setting, SOURCE_DATE_EPOCH=committed_s)
    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", source.parent, ROOT)
    (wheel,) = source.parent.glob("flightpower-*.whl")
    root = source / "root"
    packages = root / "usr/lib/flightpower/site-packages"
    environment(packages, wheel, architecture)
    files_of_the_system(root)
    program_of_the_counter(root / "usr/share/flightpower")
    strip(packages, architecture)
    python_version = wheel.name.split("-")[1]
    pages(root / "usr/share/man", python_version)
    copyright_of(packages, source / "debian" / "copyright")
    changelog(source / "debian" / "changelog", debian_version(python_version), float(committed_s))
    run("dpkg-buildpackage", "--build=binary", "--no-sign", "-d", f"--host-arch={architecture}", cwd=source)
    output.mkdir(exist_ok=True)
    (package,) = source.parent.glob("*.deb")
    target = output / package.name
    shutil.move(package, target)
    print(f"{target}: {target.stat().st_size / 1e6:.1f} MB")
    if shutil.which("lintian"):
        sys.exit(subprocess.run(["lintian", "--fail-on", "error", target]).returncode)


def run(*command: object, cwd: Path | None = None) -> str:
    """What the command prints; ends the program with its error if it fails."""
    done = subprocess.run([str(word) for word in command], cwd=cwd, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))[:200]}: {(done.stderr or done.stdout).strip()[-1000:]}")
    return done.stdout.strip()


def debian_version(python_version: str) -> str:
    """A version that sorts as Python's does: a development version comes before its release."""
    public, *local = python_version.split("+")
    return "+".join([re.sub(r"\.?(dev|a|b|rc)(?=\d)", r"~\1", public), *local])


def environment(packages: Path, wheel: Path, architecture: Architecture) -> None:
    """A virtual environment for each of PYTHONS, which share one folder of libraries."""
    home = packages.parent
    for python in PYTHONS:
        folder = packages if python == PYTHONS[0] else home / python
        platforms = [f"--platform=manylinux{tag}_{architecture.of_wheels}" for tag in ("2014", "_2_17", "_2_28")]
        run(
            sys.executable, "-m", "pip", "install", "--quiet", "--no-compile", "--only-binary=:all:", *platforms,
            "--implementation=cp", f"--python-version={python}", "--constraint", ROOT / "constraints.txt",
            "--target", folder, f"{wheel}[status]",
        )  # fmt: skip
        if folder != packages:
            for module in folder.rglob("*.so"):
                shutil.copy(module, packages / module.relative_to(folder))
            shutil.rmtree(folder)
        (home / f"lib/python{python}").mkdir(parents=True)
        (home / f"lib/python{python}/site-packages").symlink_to("../../site-packages")
    for pattern in NEVER_LOADED:
        for path in list(packages.glob(pattern)):
            shutil.rmtree(path) if path.is_dir() else path.unlink()
    for path in (packages / "pymavlink/dialects").rglob("*"):
        if path.is_file() and path.name != "__init__.py" and DIALECT not in path.as_posix():
            path.unlink()
    (home / "pyvenv.cfg").write_text("home = /usr/bin\ninclude-system-site-packages = false\n")
    (home / "bin").mkdir()
    (home / "bin/python3").symlink_to("/usr/bin/python3")


def strip(packages: Path, architecture: Architecture) -> None:
    """Compiled modules without what only a debugger reads: a third of the package."""
    for module in packages.rglob("*.so"):
        run(architecture.strip_tool, "--strip-unneeded", module)
        module.chmod(0o644)


def files_of_the_system(root: Path) -> None:
    """Units, rules, commands, examples."""
    units = root / "lib/systemd/system"  # where debhelper of Debian 12 looks
    for folder in (units, root / "usr/bin"):
        folder.mkdir(parents=True)
    for unit in SYSTEMD.glob("*.service"):
        (units / unit.name).write_text(unit.read_text().replace("/opt/flightpower/bin/daq", "/usr/bin/daq"))
    for name in COMMANDS:
        (root / "usr/lib/flightpower/bin" / name).write_text(PROGRAM.format(name))
        (root / "usr/bin" / name).write_text(COMMAND.format(name))
        (root / "usr/bin" / name).chmod(0o755)
    for source, target in (
        ("systemd/60-flightpower.rules", "lib/udev/rules.d/60-flightpower.rules"),
        ("systemd/flightpower.sysusers", "usr/lib/sysusers.d/flightpower.conf"),
        ("systemd/tray.sh", "usr/sbin/flightpower-tray"),
        ("systemd/README.md", "usr/share/doc/flightpower/README.md"),
        ("CHANGELOG.md", "usr/share/doc/flightpower/changelog"),
        ("daq/tray.example.toml", "usr/share/doc/flightpower/examples/tray.toml"),
        ("firmware/esc_counter/README.md", "usr/share/doc/flightpower/esc_counter.md"),
    ):
        (root / target).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(ROOT / source, root / target)


def program_of_the_counter(folder: Path) -> None:
    """What avrdude writes to the board."""
    folder.mkdir(parents=True)
    run("make", "-C", ROOT / "firmware/esc_counter", f"OUT={folder}")
    (folder / "esc_counter.elf").unlink()


def pages(folder: Path, version: str) -> None:
    """A page of the manual for each command, from its help."""
    programs = [(Path(sys.executable).parent / page, page.replace(" ", "-"), 1) for page in PAGES]
    for program, page, section in [*programs, (SYSTEMD / "tray.sh", "flightpower-tray", 8)]:
        target = folder / f"man{section}/{page}.{section}"
        target.parent.mkdir(parents=True, exist_ok=True)
        help_text = subprocess.run(f"{program} --help", shell=True, capture_output=True, text=True, check=True).stdout
        purpose = re.search(r"\n\n +(\S(?:.|\n)*?)(?:\.\s|\n\n)", help_text)
        assert purpose, help_text
        # help2man takes the page's name from the program's, and an indented line for an example.
        text, options, rest = help_text.partition("Options:\n")
        stub = folder / page
        stub.write_text(f"#!/bin/sh\ncat <<'EOF'\n{text.replace(chr(10) + '  ', chr(10))}{options}{rest}EOF\n")
        stub.chmod(0o755)
        made = run(
            "help2man", "--no-info", f"--section={section}", f"--name={' '.join(purpose[1].split())}",
            f"--version-string={version}", "--source=flightpower", stub,
        )  # fmt: skip
        target.write_text(re.sub(r"(?m)^\.IP\n((?:[^.].*\n)+)", r".IP\n.nf\n\1.fi\n", made + "\n"), "utf-8")
        stub.unlink()


def copyright_of(packages: Path, path: Path) -> None:
    """Copyright holders of the package's parts, from their distributions' metadata."""
    _, _, notice, *terms = (ROOT / "LICENSE").read_text().splitlines()
    stanzas = [
        "Format: https://www.debian.org/doc/packaging-manuals/copyright-format/1.0/\nUpstream-Name: flightpower",
        f"Files: *\nCopyright: {notice[len('Copyright (c) ') :]}\nLicense: Expat",
    ]
    for info in sorted(packages.glob("*.dist-info")):
        about = HeaderParser().parsestr((info / "METADATA").read_text("utf-8"))
        if about["Name"] != "flightpower":
            fields = (about["Author"], about["Author-email"], about["Maintainer-email"])
            author = next(filter(None, fields), f"the authors of {about['Name']}")
            files = f"usr/lib/flightpower/site-packages/{info.name.split('-')[0]}*"
            stanzas.append(f"Files: {files}\nCopyright: {author}\nLicense: {license_of(about)}")
    mit = "".join(f" {line}\n" if line else " .\n" for line in terms[1:])
    path.write_text("\n\n".join([*stanzas, f"License: Expat\n{mit}"]), "utf-8")


def license_of(about: Message) -> str:
    """The license that a distribution states: expression, text in one line, or classifier."""
    license_text = about["License-Expression"] or about["License"] or ""
    classified = [line.rsplit(" :: ", 1)[1] for line in about.get_all("Classifier", []) if line.startswith("License")]
    return license_text if license_text and "\n" not in license_text else ", ".join(classified) or "see its dist-info"


def changelog(path: Path, version: str, time_s: float) -> None:
    when = time.strftime("%a, %d %b %Y %H:%M:%S +0000", time.gmtime(time_s))
    maintainer = re.search(r"^Maintainer: (.*)$", (path.parent / "control").read_text(), re.MULTILINE)
    assert maintainer
    path.write_text(
        f"flightpower ({version}) unstable; urgency=medium\n\n  * See /usr/share/doc/flightpower/changelog.gz.\n\n"
        f" -- {maintainer[1]}  {when}\n"
    )


if __name__ == "__main__":
    main()
