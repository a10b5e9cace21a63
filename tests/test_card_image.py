"""The card image, short of building it: `make card` does that."""

import importlib.util
import re
import struct
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent


def loaded(name: str):
    spec = importlib.util.spec_from_file_location(name, ROOT / "debian" / f"{name}.py")
    assert spec and spec.loader
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def card():
    """card_image.py, which imports build.py from its own folder."""
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(str(ROOT / "debian"))
        yield loaded("card_image")
    sys.modules.pop("build", None)


def test_partitions_begin_at_a_multiple_of_4_mib_and_do_not_overlap(card) -> None:
    """Cards erase 4 MiB at once, and the boot partition is FAT, which a Pi's firmware reads."""
    boot, root = card.layout(1_500 << 20)
    assert boot.start % (4 << 20) == root.start % (4 << 20) == 0
    assert 0 < boot.start and boot.start + boot.size <= root.start
    assert (boot.kind, root.kind, root.size) == (0x0C, 0x83, 1_500 << 20)
    with pytest.raises(ValueError, match="multiple of 512"):
        card.layout(1000)


def test_the_first_sector_is_a_table_as_firmware_reads_it(card) -> None:
    """By the offsets of the format: signature at 440, entries of 16 bytes at 446, 55 AA at the end."""
    sector = card.master_boot_record(card.layout(1_000 << 20), 0x12345678)
    assert len(sector) == 512 and sector[510:] == b"\x55\xaa"
    assert struct.unpack_from("<I", sector, 440) == (0x12345678,)
    found = [(sector[at + 4], *struct.unpack_from("<II", sector, at + 8)) for at in range(446, 510, 16)]
    assert found == [(0x0C, 8192, 1_048_576), (0x83, 8192 + 1_048_576, 2_048_000), (0, 0, 0), (0, 0, 0)]
    with pytest.raises(ValueError, match="has four"):
        card.master_boot_record([card.Partition(0, 512, 0x83)] * 5, 1)


def test_the_command_line_leaves_the_serial_line_to_the_receiver_and_finds_the_root_by_its_label(card) -> None:
    settings = dict(re.findall(r'^(\w+)="?([^"\n]*)', card.FILES["etc/default/raspi-firmware"], re.MULTILINE))
    assert settings["CONSOLES"] == "tty0"
    assert settings["ROOTPART"] == f"LABEL={card.LABELS['root']}"
    mounted = {line.split()[1]: line.split()[0] for line in card.FSTAB.splitlines()}
    assert mounted == {"/": settings["ROOTPART"], "/boot/firmware": f"LABEL={card.LABELS['boot']}"}
    assert f"dtoverlay={card.OVERLAY}" in card.FILES["etc/default/raspi-firmware-custom"]


def test_the_overlay_gives_the_devices_of_the_example_tray(card) -> None:
    """/dev/i2c-1 by an alias, at the speed of the page of the hardware; /dev/ttyAMA0 without Bluetooth."""
    source = (ROOT / "debian" / "card.dts").read_text("utf-8")
    tray = (ROOT / "daq" / "tray.example.toml").read_text("utf-8")
    page = (ROOT / "systemd" / "README.md").read_text("utf-8")
    (alias,) = re.findall(r"\bi2c(\d) = \"/soc/i2c@7e804000\"", source)
    (asked,) = re.findall(r"i2c_arm_baudrate=(\d+)", page)
    assert f'bus = "/dev/i2c-{alias}"' in tray and f"clock-frequency = <{asked}>" in source
    assert 'port = "/dev/ttyAMA0"' in tray
    assert re.search(r"<&uart0>.*?uart0_gpio14.*?bluetooth \{\s*status = \"disabled\"", source, re.DOTALL)


@pytest.mark.parametrize(("architecture", "kernel", "of_a_pi"), [("arm64", "arm64", True), ("amd64", "amd64", False)])
def test_a_pi_s_firmware_is_installed_on_a_pi_s_card_only(card, architecture: str, kernel: str, of_a_pi: bool) -> None:
    command = card.bootstrap(card.Architecture(architecture), Path("a.deb"), Path("/x/root"), Path("/x/firmware"))
    (included,) = (word.removeprefix("--include=").split(",") for word in command if word.startswith("--include="))
    assert f"linux-image-{kernel}" in included and ("raspi-firmware" in included) is of_a_pi
    assert f"--architectures={architecture}" in command


def test_python_s_compiler_is_another_file_until_all_packages_are_installed(card, tmp_path) -> None:
    """By its diversion: the package with our service and Debian's own call it."""
    command = card.bootstrap(card.Architecture.ARM64, Path("a.deb"), Path("/x/root"), Path("/x/firmware"))
    added, removed, installed, initrd = (
        next(i for i, word in enumerate(command) if sought in word)
        for sought in (
            f"--add {card.COMPILER}",
            f"--remove {card.COMPILER}",
            "apt-get install -y",
            "update-initramfs -c",
        )
    )
    assert added < installed < removed < initrd
    stub = tmp_path / "py_compile.py"
    stub.write_text(card.NO_COMPILER)
    (tmp_path / "module.py").write_text("")
    for words in ([str(tmp_path / "module.py")], ["-"]):
        done = subprocess.run([sys.executable, "-E", "-S", stub, *words], input="module.py\n", text=True, cwd=tmp_path)
        assert done.returncode == 0
    assert not (tmp_path / "__pycache__").exists()
