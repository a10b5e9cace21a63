"""An image of a card with Debian and the recorder: written to a card, it records from power-on.

    make card                                                    # root; for a Raspberry Pi, from dist/*_arm64.deb
    .venv/bin/python debian/card_image.py --key ~/.ssh/id_ed25519.pub --tray tray.toml

Debian 13 by mmdebstrap, with the package of `make deb` installed in it. A first partition (FAT) has firmware, kernel,
device trees and config.txt, which Debian's raspi-firmware writes anew with each kernel; the second (ext4) grows over
the card at the first start. The overlay card.dts gives the tray's bus and serial line, and is tried on the device tree
of every BOARD. User pi logs in by SSH with the key, by Ethernet; without a key nobody does. Host keys and machine id
are made at the first start. Needs the packages of COMMANDS; for another processor, qemu-user-static and binfmt-support.

What is slow under emulation is done once, or not by the emulated processor: the initrd is made when all packages are
installed, and modules of Python are compiled by this computer's Python of the same version where it has one.
"""

import os
import shutil
import struct
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from build import ROOT, Architecture, run

COMMANDS = {
    "mmdebstrap": "mmdebstrap", "mke2fs": "e2fsprogs", "mkfs.vfat": "dosfstools", "mcopy": "mtools",
    "dtc": "device-tree-compiler", "fdtoverlay": "device-tree-compiler", "arch-test": "arch-test",
}  # fmt: skip
SUITE = "trixie"
PYTHON = "python3.13"  # of SUITE
PACKAGES = (
    "systemd-sysv", "udev", "dbus", "kmod", "sudo", "initramfs-tools", "python3", "i2c-tools", "procps", "e2fsprogs",
    "iproute2", "rsync", "openssh-server", "cloud-guest-utils", "fdisk",
)  # fmt: skip
OF_PI = ("raspi-firmware",)
# Whose device tree the overlay must fit. Debian's kernel reaches the pins of a Pi 5 by a chip it has no driver for.
BOARDS = ("bcm2837-rpi-zero-2-w", "bcm2837-rpi-3-b", "bcm2837-rpi-3-b-plus", "bcm2711-rpi-4-b")
OVERLAY = "flightpower"
# In place of Python's compiler, by which each package with modules has them compiled, until all are installed.
COMPILER = f"/usr/lib/{PYTHON}/py_compile.py"
NO_COMPILER = """\
import sys

if sys.argv[1:] == ["-"]:
    sys.stdin.read()
"""
MODULES = (
    f"usr/lib/{PYTHON}",
    "usr/lib/python3/dist-packages",
    "usr/share/python3",
    "usr/lib/flightpower/site-packages",
)
NOT_UNPACKED = ("doc", "info", "lintian", "locale", "man")  # of /usr/share, but for licenses
SECTOR = 512
MIB = 1 << 20
FIRST = 4 * MIB  # of the first partition: a multiple of what cards erase at once
BOOT_SIZE = 512 * MIB  # two kernels with their initrds during an upgrade
ROOM = 1.3  # the root's partition over its files, until it grows
FAT32, LINUX = 0x0C, 0x83  # types of partitions
LABELS = {"boot": "RASPIFIRM", "root": "rootfs"}
FSTAB = f"""\
LABEL={LABELS["root"]} / ext4 rw,noatime,x-systemd.growfs 0 1
LABEL={LABELS["boot"]} /boot/firmware vfat rw,noatime 0 2
"""
FILES = {
    "etc/hostname": "raspberrypi\n",
    "etc/hosts": "127.0.0.1 localhost\n127.0.1.1 raspberrypi\n",
    "etc/fstab": FSTAB,
    # No console on the serial line: the GPS is there.
    "etc/default/raspi-firmware": f'CMA=0\nROOTPART="LABEL={LABELS["root"]}"\nCONSOLES="tty0"\nKERNEL_ARCH="arm64"\n',
    "etc/default/raspi-firmware-custom": f"dtoverlay={OVERLAY}\n",
    "etc/modules-load.d/i2c-dev.conf": "i2c-dev\n",
    "etc/sudoers.d/pi": "pi ALL=(ALL) NOPASSWD: ALL\n",
    "etc/ssh/sshd_config.d/keys-only.conf": "PasswordAuthentication no\n",
    "etc/systemd/network/ethernet.network": "[Match]\nType=ether\n\n[Network]\nDHCP=yes\nMulticastDNS=yes\n",
    "etc/systemd/system/ssh.service.d/host-keys.conf": """\
[Service]
ExecStartPre=
ExecStartPre=/usr/bin/ssh-keygen -A
""",
    "etc/systemd/system/grow-root.service": """\
[Unit]
Description=Grows the second partition over the card
DefaultDependencies=no
After=systemd-remount-fs.service
Before=systemd-growfs-root.service local-fs.target

[Service]
Type=oneshot
# growpart returns 1 when nothing is left to grow over.
SuccessExitStatus=1
ExecStart=/bin/sh -c 'root=$$(findmnt -no SOURCE /); growpart /dev/$$(lsblk -no PKNAME $$root) $${root##*[!0-9]}'

[Install]
WantedBy=local-fs.target
""",
}  # fmt: skip
# In the finished root. The empty machine id is no first boot, at which systemd would enable every unit of a package.
SETUP = """
set -eu
id pi >/dev/null 2>&1 || useradd --create-home --shell /bin/bash --groups sudo,adm,i2c,dialout pi
systemctl enable grow-root.service systemd-networkd.service flightpower-daq.service
flightpower-tray --files-only
rm -f /etc/ssh/ssh_host_*
mkdir -p /var/log/journal
"""


class Partition(NamedTuple):
    """start, size [bytes]; kind: FAT32 or LINUX."""

    start: int
    size: int
    kind: int


def layout(root_size: int) -> tuple[Partition, Partition]:
    """The partitions of boot and root, for a root file system of so many bytes."""
    if root_size % SECTOR:
        raise ValueError(f"a root of {root_size} bytes: must be a multiple of {SECTOR}")
    return Partition(FIRST, BOOT_SIZE, FAT32), Partition(FIRST + BOOT_SIZE, root_size, LINUX)


def master_boot_record(partitions: Sequence[Partition], signature: int) -> bytes:
    """The first sector of a card, with up to four partitions by number of sector (LBA).

    Cylinders, heads and sectors, which nothing reads any more, are at their limit. signature: 32 bit, of the disk.
    """
    if len(partitions) > 4:
        raise ValueError(f"{len(partitions)} partitions: this table has four")
    beyond_chs = b"\xfe\xff\xff"
    entries = b"".join(
        struct.pack("<B3sB3sII", 0, beyond_chs, one.kind, beyond_chs, one.start // SECTOR, one.size // SECTOR)
        for one in partitions
    )
    return bytes(440) + struct.pack("<IH", signature, 0) + entries.ljust(64, b"\0") + b"\x55\xaa"


def bootstrap(architecture: Architecture, package: Path, root: Path, firmware: Path) -> list[str]:
    """mmdebstrap's command. firmware: the folder that stands for the first partition in the meantime."""
    pi = architecture is Architecture.ARM64
    included = (*PACKAGES, f"linux-image-{architecture}", *(OF_PI if pi else ()))
    return [
        "mmdebstrap", "--mode=root", "--variant=minbase", f"--architectures={architecture}",
        f"--include={','.join(included)}", "--components=main,non-free-firmware",
        "--aptopt=APT::Install-Recommends false", "--dpkgopt=force-unsafe-io",
        *(f"--dpkgopt=path-exclude=/usr/share/{name}/*" for name in NOT_UNPACKED),
        "--dpkgopt=path-include=/usr/share/doc/*/copyright",
        # The settings of raspi-firmware must be there before its package: dpkg keeps them.
        "--dpkgopt=force-confold", f"--setup-hook=cp -rT {root.parent}/files $1",
        f'--setup-hook=mkdir -p $1/boot/firmware && mount --bind {firmware} $1/boot/firmware',
        f"--setup-hook=dpkg-divert --root=$1 --local --no-rename --divert {COMPILER}.kept --add {COMPILER}",
        f"--customize-hook=cp {package} $1/package.deb",
        "--customize-hook=chroot $1 apt-get install -y --no-install-recommends /package.deb",
        f"--customize-hook=rm $1/package.deb $1{COMPILER}",
        f"--customize-hook=dpkg-divert --root=$1 --local --rename --remove {COMPILER}",
        "--customize-hook=chroot $1 update-initramfs -c -k all", "--customize-hook=umount $1/boot/firmware",
        SUITE, str(root),
    ]  # fmt: skip


def compiled(root: Path) -> None:
    """Compile the modules of Python. Bytecode is of a version of Python, and of no processor."""
    own = shutil.which(PYTHON)
    if own and subprocess.run([own, "-c", ""], capture_output=True).returncode == 0:
        run(own, "-I", "-m", "compileall", "-q", "-s", root, "-p", "/", *(root / name for name in MODULES))
    else:
        run("chroot", root, PYTHON, "-I", "-m", "compileall", "-q", *(f"/{name}" for name in MODULES))


def overlay(root: Path, target: Path) -> None:
    """Compile card.dts into target. Ends the program if it does not fit the device tree of a board."""
    run("dtc", "-q", "-@", "-I", "dts", "-O", "dtb", "-o", target, ROOT / "debian" / "card.dts")
    for board in BOARDS:
        trees = list(root.glob(f"usr/lib/linux-image-*/broadcom/{board}.dtb"))
        if not trees:
            sys.exit(f"card_image.py: Debian's kernel has no device tree {board}.dtb")
        for tree in trees:
            run("fdtoverlay", "-i", tree, "-o", os.devnull, target)


def completed(root: Path, architecture: Architecture, key: Path | None, tray: Path | None) -> None:
    """What the package does not do: tray file, user, units of the card."""
    if tray:
        shutil.copy(tray, root / "etc/flightpower/tray.toml")
    run("chroot", root, "sh", "-c", SETUP)
    (root / "etc/sudoers.d/pi").chmod(0o440)
    (root / "etc/machine-id").write_text("")
    if key:
        target = root / "home/pi/.ssh/authorized_keys"
        target.parent.mkdir(mode=0o700)
        target.write_text(key.read_text())
        run("chroot", root, "chown", "-R", "pi:", "/home/pi/.ssh")
    if architecture is Architecture.ARM64:
        overlays = root.parent / "firmware" / "overlays"
        overlays.mkdir(exist_ok=True)
        overlay(root, overlays / f"{OVERLAY}.dtbo")


def packed(folder: Path, image: Path) -> None:
    """The image of the card from folder/firmware and folder/root."""
    boot, root = folder / "boot.img", folder / "root.img"
    for part in (boot, root, image):
        part.unlink(missing_ok=True)
    with boot.open("wb") as file:
        file.truncate(BOOT_SIZE)
    run("mkfs.vfat", "-F", "32", "-n", LABELS["boot"], boot)
    run("mcopy", "-s", "-i", boot, *sorted((folder / "firmware").iterdir()), "::")
    used = int(run("du", "--summarize", "--block-size=1M", folder / "root").split()[0])
    run(
        "mke2fs", "-q", "-t", "ext4", "-L", LABELS["root"], "-d", folder / "root", root, f"{round(ROOM * used) + 64}M",
    )  # fmt: skip
    partitions = layout(root.stat().st_size)
    with image.open("wb") as file:
        file.write(master_boot_record(partitions, int.from_bytes(os.urandom(4), "little")))
    for one, content in zip(partitions, (boot, root), strict=True):
        run(
            "dd", f"if={content}", f"of={image}", "bs=1M", f"seek={one.start // MIB}", "conv=sparse,notrunc",
        )  # fmt: skip
    with image.open("ab") as file:
        file.truncate(partitions[-1].start + partitions[-1].size)
    boot.unlink()
    root.unlink()


def main(
    architecture: Annotated[Architecture, typer.Option(help="amd64: for a trial in QEMU.")] = Architecture.ARM64,
    package: Annotated[Path | None, typer.Option(help="The .deb; else the newest in dist.")] = None,
    key: Annotated[Path | None, typer.Option(help="Public key of who may log in as pi by SSH.")] = None,
    tray: Annotated[Path | None, typer.Option(help="Tray file, else the example.")] = None,
    output: Annotated[Path, typer.Option(help="The folder for the image.")] = ROOT / "dist",
) -> None:
    """Make the image."""
    missing = sorted({name for command, name in COMMANDS.items() if shutil.which(command) is None})
    if missing:
        sys.exit(f"card_image.py needs packages: sudo apt-get install --no-install-recommends {' '.join(missing)}")
    if os.geteuid() != 0:
        sys.exit("card_image.py must be run as root: it makes a Debian system")
    packages = sorted((ROOT / "dist").glob(f"flightpower_*_{architecture}.deb"), key=lambda path: path.stat().st_mtime)
    if package is None and not packages:
        sys.exit(f"card_image.py: no package in dist; first: make deb ARCHITECTURE={architecture}")
    for given in (package, key, tray):
        if given and not given.is_file():
            sys.exit(f"card_image.py: {given} is no file")
    folder = (ROOT / "build" / f"card-{architecture}").resolve()
    shutil.rmtree(folder, ignore_errors=True)
    for name in ("firmware", "files"):
        (folder / name).mkdir(parents=True)
    for name, text in (FILES | {COMPILER.removeprefix("/"): NO_COMPILER}).items():
        (folder / "files" / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / "files" / name).write_text(text)
    chosen = (package or packages[-1]).resolve()
    print(f"Debian {SUITE} for {architecture} with {chosen.name}", flush=True)
    done = subprocess.run(
        # In a mount namespace, with which the mounts of a build that fails end.
        ["unshare", "--mount", *bootstrap(architecture, chosen, folder / "root", folder / "firmware")],
        env=os.environ | {"INITRD": "No"},  # asks the kernel's hook for none yet
        capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        sys.exit(f"mmdebstrap: {done.stderr.strip()[-1500:]}")
    compiled(folder / "root")
    completed(folder / "root", architecture, key, tray)
    output.mkdir(exist_ok=True)
    image = output / f"{chosen.stem}.img"
    packed(folder, image)
    print(f"{image}: {image.stat().st_size / 1e9:.1f} GB")


if __name__ == "__main__":
    typer.run(main)
