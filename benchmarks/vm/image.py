"""Makes the disk image of a small Debian computer with the tray's fake parts, from scratch in a folder."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent.parent
GUEST = Path(__file__).resolve().parent / "guest"
SUITES = {(3, 11): "bookworm", (3, 13): "trixie"}  # Debian release with the same Python, which wheels must match
COMMANDS = {
    "mmdebstrap": "mmdebstrap",
    "qemu-system-x86_64": "qemu-system-x86",
    "mke2fs": "e2fsprogs",
    "losetup": "mount",
    "git": "git",
    "dh": "debhelper",
    "avr-gcc": "gcc-avr avr-libc",
    "help2man": "help2man",
}
PACKAGES = (
    "systemd,systemd-sysv,udev,dbus,kmod,sudo,linux-image-amd64,initramfs-tools,python3,python3-venv,i2c-tools,procps,"
    "e2fsprogs,iproute2,curl,rsync,openssh-server,openssh-client"
)
# As in Raspberry Pi OS: a user who may use sudo and is in the devices' groups, and SSH.
USER = """
set -eu
! id pi 2>/dev/null || exit 0
useradd --create-home --shell /bin/bash --groups sudo,adm,i2c,dialout pi
echo 'pi ALL=(ALL) NOPASSWD: ALL' > /etc/sudoers.d/pi
mkdir -p /var/log/journal /home/pi/.ssh
ssh-keygen -q -t ed25519 -N '' -f /home/pi/.ssh/id_ed25519
cp /home/pi/.ssh/id_ed25519.pub /home/pi/.ssh/authorized_keys
echo "raspberrypi.local $(cat /etc/ssh/ssh_host_ed25519_key.pub)" > /home/pi/.ssh/known_hosts
chown -R pi: /home/pi/.ssh
update-initramfs -u
"""
FAKES_NEED = ("numpy", "pymavlink", "msgspec")
DISK_SIZE = "2500M"
UPGRADE = "1.0.1"


def run(*command: object, **options: object) -> str:
    """Return the command's output; if it fails, end the program with its error."""
    done = subprocess.run([str(part) for part in command], capture_output=True, text=True, **options)  # type: ignore[call-overload]
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command))[:200]}: {done.stderr.strip()[-500:]}")
    return str(done.stdout).strip()


def build(folder: Path) -> None:
    """Make base.img, vmlinuz and initrd in `folder`. Debian and other projects' wheels are made once and kept."""
    folder.mkdir(parents=True, exist_ok=True)
    debian = _debian(folder)
    _wheels(folder)
    _packages(folder)
    home = debian / "home" / "pi"
    for name in ("flightpower", "wheels", "wheels-upgrade", "debs"):
        shutil.rmtree(home / name, ignore_errors=True)
    _checkout(home / "flightpower")
    for name in ("wheels", "wheels-upgrade", "debs"):
        shutil.copytree(folder / name, home / name)
    run("chroot", debian, "chown", "-R", "pi:", "/home/pi")
    _fakes(folder, debian)
    wants = debian / "etc/systemd/system/multi-user.target.wants"
    (wants / "fake-tray.service").unlink(missing_ok=True)
    (wants / "fake-tray.service").symlink_to("/etc/systemd/system/fake-tray.service")
    for name, link in (("vmlinuz", "vmlinuz-*"), ("initrd", "initrd.img-*")):
        shutil.copy(max((debian / "boot").glob(link)), folder / name)
    (folder / "base.img").unlink(missing_ok=True)
    run("mke2fs", "-q", "-F", "-t", "ext4", "-L", "rootfs", "-d", debian, folder / "base.img", DISK_SIZE)


def _debian(folder: Path) -> Path:
    """Return the root of a Debian system, which is only made again if its recipe has changed."""
    suite = SUITES.get(sys.version_info[:2])
    if suite is None:
        sys.exit(f"make vm needs Python 3.11 or 3.13, those of Debian 12 and 13, and not {sys.version.split()[0]}")
    root, stamp, recipe = folder / "debian", folder / "debian.json", json.dumps([suite, PACKAGES])
    if not stamp.exists() or stamp.read_text() != recipe:
        stamp.unlink(missing_ok=True)
        shutil.rmtree(root, ignore_errors=True)
        print(f"Debian {suite} into {root} (3 min)", flush=True)
        run(
            "mmdebstrap", "--mode=root", "--variant=minbase", f"--include={PACKAGES}",
            "--aptopt=APT::Install-Recommends false", "--dpkgopt=path-exclude=/usr/share/doc/*",
            "--dpkgopt=path-exclude=/usr/share/locale/*", suite, root,
        )  # fmt: skip
        stamp.write_text(recipe)
    run("cp", "-rT", GUEST / "etc", root / "etc")
    run("chroot", root, "sh", "-c", USER)
    return root


def _checkout(target: Path) -> None:
    """Copy the repository's files as they are now, without its history."""
    for name in run("git", "ls-files", "-z", cwd=ROOT).split("\0"):
        if name and (ROOT / name).exists():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, target / name, follow_symlinks=False)


def _wheels(folder: Path) -> None:
    """Make wheels of this project, its dependencies and the status page's server; in wheels-upgrade a newer version."""
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--disable-pip-version-check", "--wheel-dir")
    source, requirements = folder / "source", ("--constraint", ROOT / "constraints.txt", ".[status]")
    _checkout(source)
    for name, version, options in (("wheels", "1.0.0", requirements), ("wheels-upgrade", UPGRADE, ("--no-deps", "."))):
        wheels = folder / name
        for old in wheels.glob("flightpower-*.whl"):
            old.unlink()
        environment = os.environ | {"SETUPTOOLS_SCM_PRETEND_VERSION_FOR_FLIGHTPOWER": version}
        run(*pip, wheels, "--find-links", wheels, *options, cwd=source, env=environment)
    shutil.rmtree(source)


def _packages(folder: Path) -> None:
    """Make the Debian package in debs, and the same with a later version in debs/upgrade."""
    debs, opened = folder / "debs", folder / "opened"
    for used in (debs, opened):
        shutil.rmtree(used, ignore_errors=True)
    (debs / "upgrade").mkdir(parents=True)
    run(sys.executable, ROOT / "debian/build.py", "--version", "1.0.0", "--output", debs)
    (package,) = debs.glob("*.deb")
    run("dpkg-deb", "--raw-extract", package, opened)
    control = opened / "DEBIAN/control"
    control.write_text(control.read_text().replace("Version: 1.0.0\n", f"Version: {UPGRADE}\n"))
    run("dpkg-deb", "-Zgzip", "--root-owner-group", "--build", opened, debs / "upgrade")


def _fakes(folder: Path, debian: Path) -> None:
    """Put the fake parts and the libraries that only they need into /opt/fakes of the image."""
    library = folder / "fakes"
    if not all((library / name).exists() for name in FAKES_NEED):
        run(
            sys.executable, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--target", library,
            "--constraint", ROOT / "constraints.txt", *FAKES_NEED,
        )  # fmt: skip
    target = debian / "opt" / "fakes"
    shutil.rmtree(target, ignore_errors=True)
    shutil.copytree(library, target)
    for package in ("flight", "hw_fakes", "sim"):
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / package, target / "flightpower" / package, ignore=ignored)
    shutil.copy(ROOT / "flightpower/__init__.py", target / "flightpower")
    for file in (ROOT / "tests/hw_fakes/analytic_sensor_truth.py", Path(__file__).parent / "parts.py"):
        shutil.copy(file, target)
    shutil.copy(GUEST / "fake_tray.py", target)
    (target / "scipy").mkdir()
    (target / "scipy" / "__init__.py").touch()
    shutil.copy(GUEST / "first_order.py", target / "scipy" / "signal.py")
    run("chroot", debian, "sh", "-c", "cd /opt/fakes && python3 -B -c 'import fake_tray'")  # is a library missing?
